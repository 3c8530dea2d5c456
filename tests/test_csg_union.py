"""Unions: one solid, or bodies of their own with one number and one name."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_media import CROWN, FLINT, check, media, ratios
from test_paths import BLACK
from test_updated import compiled

import visray as vr
from visray import Box, Camera, Csg, Cylinder, DirectionalLight, Film, Instance, Plane, Scene, Settings, Sphere
from visray.edges import EdgesInView, EdgeWarning
from visray.errors import UserError
from visray.geometry import gamma
from visray.materials import Material
from visray.primitives.csg_bodies import MOST_JOINED
from visray.setup import prepare
from visray.transforms import Rotate, Scale, Translate

PAIR = {"a": Sphere(center=(-0.5, 0, 0), radius=0.9), "b": Sphere(center=(0.5, 0, 0.2), radius=0.8)}
MATERIALS = {
    "glass": Material(ka=BLACK, kd=(0.05, 0.05, 0.05), kt=(0.9, 0.8, 0.7), ior=1.5, dmax=4.0),
    "water": Material(ka=BLACK, kd=(0.05, 0.05, 0.05), kt=(0.7, 0.8, 0.9), ior=1.33, dmax=4.0),
    "red": Material(kd=(0.8, 0.2, 0.1)),
    "blue": Material(kd=(0.1, 0.2, 0.8)),
}


def scene_of(objects: dict, **more: Any) -> Scene:
    """Objects in front of a floor with their shadows."""
    fields = {"materials": MATERIALS, "settings": Settings(spp=1)} | more
    return Scene(
        camera=Camera(origin=(2, 1.5, 4), target=(0, 0, 0), fov=40), film=Film(width=64, height=48),
        lights={"sun": DirectionalLight(direction=(-1, -2, -1.5))},
        objects={"floor": Plane(point=(0, -1.2, 0), material="blue"), **objects}, **fields,
    )  # fmt: skip


def picture(objects: dict, layers: tuple = ("RGB", "id"), **more: Any) -> vr.Image:
    return vr.render(scene_of(objects, **more), layers=layers, progress=False)


def of_glass(objects: dict, material: str = "glass") -> dict:
    return {name: replace(x, material=material) for name, x in objects.items()}


# Which unions are one solid


def test_transparent_operands_are_bodies() -> None:
    glass = of_glass(PAIR)
    for union in (Csg(op="union", of=glass), Csg(op="union", of=PAIR, material="glass")):
        scene = scene_of({"u": union})
        bodies = {"objects.u.of.a": glass["a"], "objects.u.of.b": glass["b"]}
        assert dict(scene.bodies) == {"floor": scene.objects["floor"]} | bodies
        assert list(scene.parts()) == list(scene.bodies.items())
    mixed = Csg(op="union", of=PAIR | {"a": glass["a"]}, material="red")
    assert list(scene_of({"u": mixed}).unions) == ["u"]
    for one in (
        Csg(op="merge", of=glass),
        Csg(op="union", of=PAIR, material="red"),
        Csg(op="union", of=glass, cut=[Box()]),
        Csg(op="difference", of=(Csg(op="union", of=glass), Box()), material="glass"),
    ):
        scene = scene_of({"u": one})
        assert not scene.unions and scene.bodies is scene.objects


def test_very_many_opaque_operands_are_bodies() -> None:
    rng = np.random.default_rng(1)
    balls = [
        Sphere(center=tuple(c), radius=0.2, material="red") for c in rng.uniform(-1, 1, (MOST_JOINED + 1, 3)).tolist()
    ]
    few, many = ({"u": Csg(op="union", of=tuple(balls[:n]))} for n in (MOST_JOINED, MOST_JOINED + 1))
    assert not scene_of(few).unions and len(scene_of(many).unions["u"]) == MOST_JOINED + 1
    one, apart = picture(many | {"u": Csg(op="merge", of=tuple(balls))}), picture(many)
    assert all(np.array_equal(one[name], apart[name]) for name in ("RGB", "id"))
    assert f"more than {MOST_JOINED} " in Csg.__doc__


def test_an_opaque_union_is_a_merge() -> None:
    """Bit for bit, also where faces coincide."""
    of = {"a": Box(material="red"), "b": Box(min=(0, -0.5, -0.5), max=(1, 0.5, 0.5), material="blue")}
    one, other = (picture({"u": Csg(op=op, of=of, transform=(Rotate(rotate=33.0),))}) for op in ("union", "merge"))
    assert all(np.array_equal(one[name], other[name]) for name in ("RGB", "id"))


def test_nested_unions_and_instances_are_flat() -> None:
    """Materials and transforms of all bodies, by hand; names below an instance begin with it."""
    move, turn, grow = Translate(translate=(1.0, 0, 0)), Rotate(rotate=90.0), Scale(scale=2.0)
    pair = Csg(op="union", of={"x": Sphere(material="water"), "y": Box()}, transform=(grow,))
    union = Csg(
        op="union",
        of=[Csg(op="union", of=[Sphere(transform=(move,)), Box(material="red")], transform=(turn,)),
            Instance(geometry="pair", transform=(turn,)),
            Csg(op="difference", of=[Sphere(), Box()], material="red"),
            Instance(geometry="rod", material="water")],
        material="glass", transform=(move,),
    )  # fmt: skip
    scene = scene_of({"u": union, "copy": Instance(geometry="pair", material="glass", transform=(move,))},
                     geometries={"pair": pair, "rod": Cylinder(transform=(grow,))})  # fmt: skip
    found = {name: (x.type, x.material, x.transform) for name, x in scene.bodies.items() if name != "floor"}
    assert found == {
        "objects.u.of.0.of.0": ("sphere", "glass", (move, turn, move)),
        "objects.u.of.0.of.1": ("box", "red", (turn, move)),
        "objects.u.of.1.of.x": ("sphere", "water", (grow, turn, move)),
        "objects.u.of.1.of.y": ("box", "glass", (grow, turn, move)),
        "objects.u.of.2": ("csg", "red", (move,)),
        # The geometry has the transform of its own.
        "objects.u.of.3": ("instance", "water", (move,)),
        "objects.copy.of.x": ("sphere", "water", (grow, move)),
        "objects.copy.of.y": ("box", "glass", (grow, move)),
    }


# Pictures


def test_a_union_of_glass_is_its_operands_side_by_side_under_one_number() -> None:
    """Bit for bit, with refraction, nested media and coloured shadows, in all ways to find rows; and no merge."""
    mixed = {"a": replace(PAIR["a"], material="glass"), "b": replace(PAIR["b"], material="water"),
             "c": Box(min=(-0.2, -0.9, -0.2), max=(0.3, 0.2, 0.2), material="red")}  # fmt: skip
    union, apart = picture({"u": Csg(op="union", of=mixed)}), picture(mixed)
    assert np.array_equal(union["RGB"], apart["RGB"])
    number = np.minimum(apart["id"], 2)
    assert np.array_equal(union["id"], number) and set(np.unique(number)) == {0, 1, 2}
    assert vr.explain(scene_of({"u": Csg(op="union", of=mixed)}))["nested media"]
    pair = [picture({"u": Csg(op=op, of=of_glass(PAIR))}) for op in ("union", "merge")]
    shown = pair[0]["id"] == 2
    assert np.array_equal(shown, pair[1]["id"] == 2)
    assert (np.abs(pair[0]["RGB"] - pair[1]["RGB"]).max(2) > 0.01)[shown].mean() > 0.1


def test_surfaces_inside_a_union_are_seen_by_light() -> None:
    """Along the x axis: the smaller ball counts in both, and the surface of the larger one inside it is hidden."""
    balls = {
        "left": Sphere(center=(-0.5, 0, 0), material="crown"),
        "right": Sphere(center=(0.6, 0, 0), radius=0.8, material="flint"),
    }
    check(
        ratios(media({"u": Csg(op="union", of=balls)}), (-5, 0, 0), (1, 0, 0), 4),
        ("objects.u.of.left", 1 / CROWN), ("objects.u.of.right", CROWN / FLINT), ("objects.u.of.left", None, "buried"),
        ("objects.u.of.right", FLINT),
    )  # fmt: skip


def test_a_half_space_in_a_union_is_a_body() -> None:
    """Water below a plane, and a ball of glass in it: light enters the water, and not only a sheet."""
    of = {"sea": Plane(material="crown"), "ball": Sphere(center=(0, -2, 0), material="flint")}
    for plane in (of["sea"], Instance(geometry="sea", material="crown")):
        scene = media({"u": Csg(op="union", of=of | {"sea": plane})}, geometries={"sea": Plane()})
        check(
            ratios(scene, (0, 3, 0), (0, -1, 0), 3),
            ("objects.u.of.sea", 1 / CROWN), ("objects.u.of.ball", CROWN / FLINT), ("objects.u.of.ball", FLINT / CROWN),
        )  # fmt: skip


def test_explain_names_the_operands_that_overlap() -> None:
    overlaps = vr.explain(scene_of({"u": Csg(op="union", of=of_glass(PAIR))})).overlaps
    assert [(x.counts, x.hidden) for x in overlaps] == [("objects.u.of.b", "objects.u.of.a")]


def test_explain_says_how_many_bodies_there_are() -> None:
    notes = vr.explain(scene_of({"u": Csg(op="union", of=of_glass(PAIR))})).notes
    assert "objects.u: a union of 2 shapes: 2 spheres; drawn as 2 bodies" in notes
    notes = vr.explain(scene_of({"u": Csg(op="merge", of=of_glass(PAIR))})).notes
    assert "objects.u: a merge of 2 shapes: 2 spheres" in notes


# Numbers of operands


# Bodies of two balls, of which the nearer one fills the picture.
BALLS = Csg(op="union", of={"a": Sphere(), "b": Sphere(center=(0, 0, -3), radius=0.5)})


def close(objects: dict, kt: float = 0.1, **more: Any) -> Scene:
    """Light on the middle of the balls."""
    return Scene(
        camera=Camera(origin=(0, 0, 1.5), fov=30), film=Film(width=8, height=6), objects=objects,
        materials={"shiny": Material(kd=(0.5, 0.5, 0.5), kt=(kt, kt, kt), ior=1.0)},
        lights={"lamp": vr.PointLight(position=(2, 3, 4))},
        settings=Settings(spp=1, precision="double", shadows=False, depth=0), **more,
    )  # fmt: skip


def assert_derivative(scene: Scene, address: str) -> None:
    """It equals differences: their errors are the step's square by the third derivative, which is at most a few hundred
    times the first one at these lengths, and the rounding over the step."""
    step = 1e-5
    found, hand = vr.derivative(scene, address, progress=False), vr.difference(scene, address, step)
    assert np.abs(found - hand).max() <= (step**2 + gamma(100) / step) * np.abs(hand).max() * 100
    assert (np.abs(hand) > 0).all()


def test_numbers_of_bodies_have_derivatives() -> None:
    scene = close({"u": replace(BALLS, material="shiny")})
    assert scene.unions
    for address in ("objects.u.of.a.radius", "objects.u.of.a.center.0"):
        assert_derivative(scene, address)
    with pytest.raises(UserError, match=r"objects\.u\.of\.b\.height"):
        vr.derivative(scene, "objects.u.of.b.height", progress=False)


def test_each_instance_adds_to_the_derivative_by_a_geometry() -> None:
    """Two copies side by side, each in view."""
    copies = {n: Instance(geometry="g", material="shiny", transform=(Translate(translate=(x, 0, 0)),))
              for n, x in (("u", 0.0), ("v", 0.1))}  # fmt: skip
    scene = close(copies, geometries={"g": BALLS})
    assert set(vr.render(scene, progress=False)["id"].ravel()) == {1, 2} and set(scene.unions) == set(copies)
    with pytest.warns(EdgeWarning, match="silhouettes of objects.u, objects.v"):
        assert_derivative(scene, "geometries.g.of.a.radius")


@pytest.mark.parametrize(
    ("obj", "edges"),
    [
        (Csg(op="merge", of=(Sphere(), Sphere(center=(0.3, 0, 0)))), {"silhouettes", "creases"}),
        (Csg(op="difference", of=(Sphere(), Sphere(center=(0, 0, -9)))), set()),
        (Csg(op="difference", of=(Box(min=(-9, -9, -9), max=(9, 9, 1)), Sphere(center=(0, 0, -9)))), {"creases"}),
        (
            Csg(op="intersection", of=(vr.Torus(center=(0, 1, 0), axis=(1, 0, 0), minor=0.5), Sphere(radius=5.0))),
            {"silhouettes"},
        ),
        (Csg(op="union", of=(Sphere(material="shiny"), Sphere(center=(0, 0, -3)))), set()),
    ],
)
def test_edges_of_operands_are_those_in_view(obj: Csg, edges: set) -> None:
    """Two balls in view; a ball that fills the picture; a box, which has edges, though not in view; a torus, which may
    hide itself; and a body of a union."""
    scene = close({"u": obj})
    prepared = prepare(scene)
    found = EdgesInView(scene, prepared.kernel, ["objects.u"], prepared.x, prepared.y).found()
    assert set(found) == edges
    assert all(where == ["objects.u"] for where in found.values())


def test_there_is_no_derivative_where_a_union_becomes_bodies() -> None:
    scene = close({"u": replace(BALLS, material="shiny")}, kt=0.0)
    with pytest.raises(UserError, match=r"materials\.shiny\.kt: has no derivative at 0, as an opaque union"):
        vr.gradient(scene, "materials.shiny.kt", progress=False)


def test_an_update_of_a_body_compiles_nothing() -> None:
    scene = scene_of({"u": Csg(op="union", of=of_glass(PAIR))})
    prepared = prepare(scene)
    vr.render(prepared, progress=False)
    changes = {"objects.u.of.a.radius": 0.7, "objects.u.of.b.center.0": 0.6}
    # The first update compiles what puts rows into columns.
    prepared.updated(changes)
    pictures = []
    assert not compiled(lambda: pictures.append(vr.render(prepared.updated(changes), progress=False)))
    new = of_glass({"a": replace(PAIR["a"], radius=0.7), "b": replace(PAIR["b"], center=(0.6, 0, 0.2))})
    assert np.array_equal(pictures[0]["RGB"], picture({"u": Csg(op="union", of=new)})["RGB"])
    # Without kt it is one solid.
    opaque = prepared.updated({"materials.glass.kt": (0.0, 0.0, 0.0)})
    assert not opaque.scene.unions and len(opaque.packed.batches) == 2
