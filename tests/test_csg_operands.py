"""The walk through operands: addresses, materials and transforms of an object's operands at all depths."""

from dataclasses import replace

import numpy as np

from visray import Box, Csg, Cylinder, Disk, Instance, Mesh, Plane, Polynomial, Scene, Sphere
from visray.camera import Camera
from visray.primitives.csg_operands import bodies, has_operands, is_solid, operands, own_material
from visray.transforms import Rotate, Scale, Translate, compose

MOVE, TURN, GROW = Translate(translate=(1.0, 2.0, 3.0)), Rotate(rotate=90.0), Scale(scale=2.0)


def walked(obj, geometries=None):
    return {o.address: o for o in operands("objects.a", obj, geometries or {})}


def materials(obj, geometries=None):
    return {address: o.material for address, o in walked(obj, geometries).items()}


def test_each_operand_comes_before_its_own_and_cuts_last():
    inner = Csg(op="union", of=[Box(), Sphere()], cut={"bite": Cylinder()})
    outer = Csg(op="difference", of={"body": Sphere(cut=[Box()]), "rest": inner})
    assert list(walked(outer)) == [
        "objects.a",
        "objects.a.of.body",
        "objects.a.of.body.cut.0",
        "objects.a.of.rest",
        "objects.a.of.rest.of.0",
        "objects.a.of.rest.of.1",
        "objects.a.of.rest.cut.bite",
    ]
    leaves = [address for address, o in walked(outer).items() if o.is_leaf]
    assert leaves == [a for a in walked(outer) if a not in ("objects.a", "objects.a.of.rest")]


def test_an_instance_leads_to_its_geometry():
    geometries = {"hollow": Csg(op="difference", of=[Box(), Sphere()])}
    obj = Csg(op="merge", of=[Instance(geometry="hollow", material="red"), Sphere(material="blue")])
    assert materials(obj, geometries) == {
        "objects.a": "red",
        "objects.a.of.0": "red",
        "geometries.hollow": "red",
        "geometries.hollow.of.0": "red",
        "geometries.hollow.of.1": "red",
        "objects.a.of.1": "blue",
    }
    # Without geometries, the walk stays in the object.
    assert list(walked(obj)) == ["objects.a", "objects.a.of.0", "objects.a.of.1"]


def test_a_cut_face_has_the_material_of_the_cut():
    bowl = Sphere(material="outer", cut_material="inner", cut=[Box(), Box(material="own")])
    assert materials(bowl) == {"objects.a": "outer", "objects.a.cut.0": "inner", "objects.a.cut.1": "own"}


def test_operands_take_the_material_of_what_is_around_them():
    inner = Csg(op="union", of=[Box(), Sphere()])
    outer = Csg(op="difference", of=[Sphere(), inner], material="yellow", cut_material="pale")
    assert materials(outer) == {
        "objects.a": "yellow",
        "objects.a.of.0": "yellow",
        "objects.a.of.1": "pale",
        "objects.a.of.1.of.0": "pale",
        "objects.a.of.1.of.1": "pale",
    }
    own = Csg(op="difference", of=[Sphere(), Csg(op="union", of=inner.of, material="red")], cut_material="pale")
    assert materials(own)["objects.a.of.1.of.1"] == "red"


def test_in_a_union_only_its_cut_has_the_cut_material():
    for op in ("union", "merge"):
        obj = Csg(op=op, of=[Sphere(), Box()], cut=[Box()], material="red", cut_material="pale")
        assert list(materials(obj).values()) == ["red", "red", "red", "pale"]


def test_an_object_without_a_material_has_that_of_its_first_operand():
    obj = Csg(op="intersection", of=[Csg(op="union", of=[Sphere(material="glass"), Box()]), Box()])
    assert own_material(obj, {}) == "glass"
    assert set(materials(obj).values()) == {"glass"}
    assert own_material(Csg(op="union", of=[Box(), Box(material="red")]), {}) == "default"


def test_steps_go_from_the_operand_outwards():
    inner = Csg(op="union", of=[Box(transform=(MOVE,)), Sphere()], cut=[Box(transform=(GROW,))], transform=(TURN,))
    outer = Csg(op="difference", of=[Sphere(), inner, Instance(geometry="g", transform=(MOVE,))], transform=(GROW,))
    found = walked(outer, {"g": Box(transform=(TURN,))})
    assert found["objects.a.of.1.of.0"].steps == (MOVE, TURN, GROW)
    assert found["objects.a.of.1.cut.0"].steps == (GROW, TURN, GROW)
    assert found["geometries.g"].steps == (TURN, MOVE, GROW)
    # By hand: the corner (1, 1, 1) moves to (2, 3, 4), turns by 90 degrees about y to (4, 3, -2), and is doubled.
    matrix = compose(found["objects.a.of.1.of.0"].steps)
    np.testing.assert_allclose(matrix @ (1, 1, 1, 1), (8, 6, -4), atol=1e-15)


def test_what_is_a_solid():
    geometries = {"ball": Sphere(), "sheet": Disk()}
    closed = [Sphere(), Plane(), Polynomial(expression="x", ends="capped"), Instance(geometry="ball")]
    sheet = Mesh(vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]])
    sheets = [Disk(), Polynomial(expression="x"), Instance(geometry="sheet"), sheet]
    for first, expected in [*((x, True) for x in closed), *((x, False) for x in sheets)]:
        assert is_solid(first, geometries) is expected
        assert is_solid(Csg(op="difference", of=[first, Box()]), geometries) is expected
        assert is_solid(Csg(op="difference", of=[first, Box()], ends="open"), geometries) is False


def test_what_has_operands():
    assert not has_operands(Sphere()) and not has_operands(Instance(geometry="g"))
    assert has_operands(Sphere(cut=[Box()])) and has_operands(Csg(op="union", of=[Sphere(), Box()]))


def test_without_a_name_each_operand_has_the_material_of_its_own_first_operand():
    glass = Csg(op="difference", of=[Sphere(material="glass"), Box()])
    amber = Csg(op="difference", of=[Sphere(material="amber"), Box()])
    assert list(materials(Csg(op="union", of=[glass, amber])).values()) == ["glass"] * 4 + ["amber"] * 3
    assert list(materials(Csg(op="union", of=[glass, amber], material="red")).values()) == [
        *("red", "red", "glass", "red"),
        *("red", "amber", "red"),
    ]


def test_bodies_are_the_operands_of_unions():
    pair = Csg(op="union", of=[Sphere(), Box()])
    geometries = {"pair": pair}
    obj = Csg(op="union", of=[Instance(geometry="pair"), Csg(op="difference", of=[pair, Box()]), Plane()])
    found = [body.address for body in bodies("objects.a", obj, geometries)]
    assert found == ["geometries.pair.of.0", "geometries.pair.of.1", "objects.a.of.1", "objects.a.of.2"]
    whole = [Sphere(), Csg(op="merge", of=pair.of), Csg(op="union", of=pair.of, cut=[Box()]), Instance(geometry="x")]
    assert [[b.address for b in bodies("objects.a", x, geometries)] for x in whole] == [["objects.a"]] * 4


def test_the_kernel_gives_each_leaf_the_material_of_the_walk():
    geometries = {"hollow": Csg(op="intersection", of=[Box(), Sphere()], cut=[Cylinder()], cut_material="pale")}
    inner = Csg(op="union", of=[Instance(geometry="hollow"), Disk(material="x")], cut_material="y", cut=[Sphere()])
    obj = Csg(op="difference", of={"a": Sphere(), "b": inner, "c": Box(cut={"d": Plane()})}, cut_material="red")
    for whole in (obj, replace(obj, material="own"), replace(obj, cut=[Box()]), Instance(geometry="hollow")):
        scene = Scene(geometries=geometries, objects={"a": whole}, camera=Camera(), lights={})
        leaves = [x for x in operands("objects.a", whole, geometries) if x.is_leaf]
        form = scene.placed_shape(whole).form
        assert [leaf.material for leaf in form.leaves] == [x.material for x in leaves]
        assert [leaf.steps for leaf in form.leaves] == [x.steps for x in leaves]
        assert form.medium == own_material(whole, geometries)
