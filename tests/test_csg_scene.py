"""CSG in scenes: what may be written, what is said where it is wrong, and how it is addressed, changed and written."""

import json
import random
import warnings
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from unchecked import unchecked

import visray as vr
from visray import primitives
from visray.cli import main
from visray.csg_report import CsgWarning, csg_notes
from visray.dark import DarkWarning
from visray.feature_rules import used_materials
from visray.features import features
from visray.operands import named_operands
from visray.primitives.csg_operands import operands
from visray.primitives.primitive import Primitive
from visray.scene.address import changed, numeric_addresses, replaced, value
from visray.scene.check import checked, examined
from visray.scene.load import dump, load
from visray.scene.nesting_flaws import MOST_LEVELS, MOST_OPERANDS

BOX, BALL = {"type": "box"}, {"type": "sphere"}
MATERIALS = {
    "glass": vr.Material(kt=(0.9, 0.9, 0.9)),
    "water": vr.Material(kt=(0.9, 0.9, 0.9), ior=1.25),
    "fog": vr.Material(kt=(0.9, 0.9, 0.9), dmax=2.0),
    "red": vr.Material(kd=(1.0, 0.0, 0.0)),
}
SHEET = {"type": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}
KINDS = ", ".join(kind.__dataclass_fields__["type"].default for kind in primitives.OBJECTS)


def csg(op: str, *of: dict, **fields: object) -> dict:
    return {"type": "csg", "op": op, "of": list(of), **fields}


def said(obj: dict, geometries: dict | None = None) -> list[str]:
    """What is said about an object c, without `objects.c` at the beginning."""
    return [text.removeprefix("objects.c") for text in examined(raw(obj, geometries))[1]]


def raw(obj: dict, geometries: dict | None = None) -> dict:
    return {"objects": {"c": obj}, "materials": MATERIALS, "geometries": geometries or {}, "camera": {}, "lights": {}}


def box(**fields: object) -> dict:
    return BOX | fields


def ball(**fields: object) -> dict:
    return BALL | fields


@pytest.mark.parametrize(
    ("obj", "what"),
    [
        (csg("union", ball(radius=-1), BOX), ".of.0.radius = -1: must be greater than 0"),
        (csg("union", ball(radius=1e-12), BOX), ".of.0.radius = 1e-12: must be at least 1e-09"),
        (
            {"type": "csg", "op": "union", "of": {"a": {"type": "spere"}, "b": BOX}},
            f'.of.a.type = "spere": unknown type; did you mean "sphere"? (one of {KINDS})',
        ),
        (
            {"type": "union", "of": [BALL, BOX]},
            '.type = "union": unknown type; write "type": "csg", "op": "union"',
        ),
        ({"type": "csg", "op": "union", "of": 3}, ".of = 3: must be a list of objects, or objects by name"),
        ({"type": "csg", "op": "union", "of": None}, ".of = null: must be a list of objects, or objects by name"),
        ({"type": "csg", "op": "union"}, ": the key 'of' is missing; it is a list of objects, or objects by name"),
        (ball(cut="box"), '.cut = "box": must be a list of objects, or objects by name'),
        (ball(cut=BOX), '.cut = {"type": "box"}: must be a list of objects, or objects by name; write [{...}]'),
        (
            {"type": "csg", "op": "union", "of": {"a.b": BALL, "c": BOX}},
            '.of: "a.b" is not a valid name; a name is not empty, has no dot, and has no space at either end',
        ),
        (csg("union", BALL, 3), f".of.1 = 3: must be an object {{...}} with a type: one of {KINDS}"),
        (csg("union", BALL, {}), f".of.1: the key 'type' is missing; one of {KINDS}"),
        (
            csg("unon", BALL, BOX),
            '.op = "unon": unknown value; did you mean "union"? (one of union, intersection, difference, merge)',
        ),
        (
            csg("difference", BALL, box(cut=[ball(radus=1)])),
            ".of.1.cut.0.radus: unknown key; did you mean 'radius'? "
            "(one of type, material, transform, cut, cut_material, center, radius)",
        ),
        (
            csg("difference", BALL, csg("union", BOX, box(min=[0, "x", 0]))),
            '.of.1.of.1.min.1 = "x": must be a number',
        ),
        (
            csg("union", BALL, {"type": "polynomial", "expression": "x", "clip": {"type": "bal"}}),
            '.of.1.clip.type = "bal": unknown type; one of sphere, box',
        ),
        (csg("union", BALL, box(transform=[{"scale": 0}])), ".of.1.transform.0.scale = 0: a scale must not be 0"),
        (
            csg("subtract", BALL, BOX),
            '.op = "subtract": unknown value; did you mean "difference"? (one of union, intersection, difference, '
            "merge)",
        ),
        (
            {"type": "minus", "of": [BALL, BOX]},
            '.type = "minus": unknown type; write "type": "csg", "op": "difference"',
        ),
        (
            csg("union", BALL, box(translate=[0, 1, 0])),
            '.of.1.translate: unknown key; write "transform": [{"translate": [0, 1, 0]}]',
        ),
        (
            csg("union", BALL, box(transform={"scale": 2})),
            '.of.1.transform = {"scale": 2}: must be a list [...]; write [{...}]',
        ),
        (ball(material=BOX), '.material = {"type": "box"}: must be the name of a material'),
    ],
)
def test_a_wrong_field_is_named_at_its_address(obj: dict, what: str) -> None:
    assert said(obj) == [what]


def test_operands_under_another_key_are_meant_to_be_of() -> None:
    found = said({"type": "csg", "op": "union", "operands": [BALL, BOX]})
    assert any(text.startswith(".operands: unknown key; did you mean 'of'?") for text in found)


def test_a_misspelt_geometry_is_in_use() -> None:
    instance = {"type": "instance", "geometry": "drll"}
    what = '.of.1.geometry = "drll": unknown geometry; did you mean "drill"? (one of drill)'
    assert said(csg("difference", BOX, instance), {"drill": BALL}) == [what]
    assert len(said(csg("difference", BOX, instance), {"other": BALL})) == 2


def test_an_object_is_no_geometry() -> None:
    what = '.geometry = "c": unknown geometry; c is an object; move it to geometries'
    assert said({"type": "instance", "geometry": "c"}) == [what]


def test_the_operands_of_a_geometry_may_have_materials() -> None:
    what = 'geometries.g.material = "red": a geometry has no material; give one to each of its instances'
    instance = {"type": "instance", "geometry": "g"}
    assert said(instance, {"g": box(material="red")}) == [what]
    assert said(instance, {"g": box(material="red", cut=[BALL])}) == [what + ", or to its operands"]


@pytest.mark.parametrize(
    ("obj", "what"),
    [
        (csg("union", BALL), ".of: has only one operand; a union is made of at least two"),
        (csg("intersection"), ".of: has no operand; an intersection is made of at least two"),
        (ball(cut=[]), ".cut: is empty; name at least one solid, or leave it out"),
        (ball(cut={}), ".cut: is empty; name at least one solid, or leave it out"),
        (ball(cut_material="red"), '.cut_material = "red": nothing is cut here; leave it out'),
        (csg("merge", BALL, BOX, cut_material="red"), '.cut_material = "red": nothing is cut here; leave it out'),
        *(
            (obj | {"cut_material": "red"}, '.cut_material = "red": a cut makes no face in what is open; leave it out')
            for obj in ({"type": "disk", "cut": [BALL]}, csg("difference", BALL, BOX, ends="open"))
        ),
        (
            csg("union", csg("difference", BALL, BOX), box(cut=[BALL]), BALL, cut_material="red"),
            '.cut_material = "red": nothing is cut here, but in objects.c.of.0 and objects.c.of.1; write it there',
        ),
        (csg("union", BALL, BOX, ends="open"), '.ends = "open": a union cuts nothing open; leave ends out'),
        (
            csg("difference", BALL, box(material="rod")),
            '.of.1.material = "rod": unknown material; did you mean "red"? (one of glass, water, fog, red, default)',
        ),
        (
            csg("difference", BALL, BOX, cut_material="rod"),
            '.cut_material = "rod": unknown material; did you mean "red"? (one of glass, water, fog, red, default)',
        ),
        (
            csg("difference", BALL, {"type": "instance", "geometry": "g"}),
            '.of.1.geometry = "g": unknown geometry; there is none',
        ),
        (
            csg("difference", BALL, box(max=[-1, 2, 2])),
            ".of.1.max = [-1.0, 2.0, 2.0]: must be greater than min in x",
        ),
        (csg("union", BALL, {"type": "mesh", "file": "no.obj"}), None),
        (
            csg("union", BALL, box(transform=[{"scale": 1e-5}, {"scale": 1e-5}])),
            '.of.1.transform = [{"scale": 1e-05}, {"scale": 1e-05}]: '
            "the steps together scale below 1e-09 or reach beyond 1e+09",
        ),
        (
            csg("union", BALL, box(transform=[{"scale": 1e-5}]), transform=[{"scale": 1e-5}]),
            '.of.1.transform = [{"scale": 1e-05}]: followed by the transforms of what is around it, '
            "the steps together scale below 1e-09 or reach beyond 1e+09",
        ),
    ],
)
def test_a_flaw_of_operands_is_named_at_its_address(obj: dict, what: str | None) -> None:
    assert said(obj) == [what or '.of.1.file = "no.obj": there is no such file; check the path']


DISK = {"type": "disk"}
CYLINDER = "use a solid, such as a thin cylinder"


@pytest.mark.parametrize(
    ("obj", "what"),
    [
        (csg("union", DISK, BOX), f".of.0: is an open disk, and the operands of a union must be solids; {CYLINDER}"),
        (
            csg("difference", BOX, DISK),
            f".of.1: is an open disk, and only the first operand of a difference may be open; {CYLINDER}",
        ),
        (box(cut={"d": DISK}), f".cut.d: is an open disk, and what is taken away must be a solid; {CYLINDER}"),
        (
            box(cut=[csg("intersection", DISK, BALL)]),
            f".cut.0: is open, as objects.c.cut.0.of.0 is an open disk, and what is taken away must be a solid; "
            f"{CYLINDER}",
        ),
        (
            box(cut=[csg("intersection", BOX, BALL, ends="open")]),
            '.cut.0: is an open csg, and what is taken away must be a solid; write "ends": "capped"',
        ),
        (
            csg("union", BOX, {"type": "polynomial", "surface": "heart"}),
            '.of.1: is an open polynomial, and the operands of a union must be solids; write "ends": "capped"',
        ),
        (
            csg("union", BOX, {"type": "rectangle"}),
            ".of.1: is an open rectangle, and the operands of a union must be solids; use a solid, such as a thin box",
        ),
        (
            csg("union", BOX, SHEET),
            ".of.1: is an open mesh, and the operands of a union must be solids; close it: it has 3 open edges around "
            "1 hole, the first from (0, 0, 0) to (1, 0, 0)",
        ),
    ],
)
def test_an_open_operand_is_refused_where_a_solid_is_needed(obj: dict, what: str) -> None:
    assert said(obj) == [what]


@pytest.mark.parametrize(
    "obj",
    [
        csg("difference", DISK, BALL),
        csg("intersection", SHEET, BALL, ends="open"),
        csg("difference", csg("intersection", DISK, BALL), BOX),
        {"type": "triangle", "a": [0, 0, 0], "b": [1, 0, 0], "c": [0, 1, 0], "cut": [BALL]},
        {"type": "polynomial", "surface": "heart", "cut": [{"type": "plane"}]},
        {"type": "plane", "cut": [BALL], "cut_material": "red"},
        csg("union", {"type": "plane"}, BALL),
        csg("difference", BALL, csg("union", BOX, BALL, cut=[BOX], cut_material="red")),
        csg("union", box(material="glass"), box(material="water"), box(material="red")),
        csg("union", csg("union", box(material="glass"), box(material="water")), box(material="red"), material="fog"),
        csg("difference", box(material="glass"), BALL, cut_material="glass"),
    ],
)
def test_what_is_right_is_accepted(obj: dict) -> None:
    assert said(obj) == []
    # The second look finds the entries among those that were validated before.
    scene = examined(raw(obj))[0]
    assert checked(scene).objects["c"] is scene.objects["c"] or isinstance(scene.objects["c"], vr.Polynomial)


@pytest.mark.parametrize(
    ("obj", "what"),
    [
        (
            csg("difference", box(material="glass"), ball(material="red")),
            '.of.1.material = "red": is not transparent, unlike "glass" of objects.c; in one solid all materials are, '
            "or none is",
        ),
        (
            box(material="red", cut=[BALL], cut_material="glass"),
            '.cut_material = "glass": is transparent, unlike "red" of objects.c; in one solid all materials are, or '
            "none is",
        ),
        (
            csg("merge", box(material="glass"), ball(material="water")),
            '.of.1.material = "water": has the ior 1.25, and "glass" of objects.c has 1.5; a transparent solid has one '
            "ior",
        ),
        (
            csg("union", BALL, box(material="fog", cut=[ball(material="glass")])),
            '.of.1.cut.0.material = "glass": has the dmax 1e+09, and "fog" of objects.c.of.1 has 2; a transparent '
            "solid has one dmax",
        ),
    ],
)
def test_materials_of_one_solid_must_go_together(obj: dict, what: str) -> None:
    assert said(obj) == [what]


def test_an_instance_gives_its_material_to_its_geometry() -> None:
    geometries = {"g": csg("difference", BOX, ball(material="red"))}
    assert said({"type": "instance", "geometry": "g"}, geometries) == []
    assert said({"type": "instance", "geometry": "g", "material": "glass"}, geometries) == [
        'geometries.g.of.1.material = "red": is not transparent, unlike "glass" of objects.c; in one solid all '
        "materials are, or none is"
    ]


def test_a_mesh_without_texture_coordinates_has_no_texture_in_csg(tmp_path: Path) -> None:
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = [(1, 3, 2), (1, 2, 4), (2, 3, 4), (3, 1, 4)]
    lines = [*(f"v {x} {y} {z}" for x, y, z in corners), *(f"f {a} {b} {c}" for a, b, c in faces)]
    (tmp_path / "solid.obj").write_text("\n".join(lines))
    mesh = {"type": "mesh", "file": str(tmp_path / "solid.obj")}
    tiles = {"textures": {"t": {"type": "checker"}}, "materials": {"tiles": {"texture": "t"}}}
    why = "has the texture 't', and the mesh file has no texture coordinates; take a material without texture"
    for obj, field in (
        (csg("difference", BOX, mesh, cut_material="tiles"), "cut_material"),
        (csg("difference", BOX, mesh | {"material": "tiles"}), "of.1.material"),
    ):
        assert examined({"objects": {"c": obj}, **tiles})[1] == [f'objects.c.{field} = "tiles": {why}']


def test_geometries_in_operands_are_used() -> None:
    instance = {"type": "instance", "geometry": "g"}
    assert said(csg("difference", BALL, instance), {"g": BOX}) == []
    nested = {"g": csg("union", BALL, {"type": "instance", "geometry": "h"}), "h": box(cut=[BALL])}
    assert said(instance, nested) == []
    assert said(csg("difference", BALL, BOX), {"g": BOX}) == [
        "geometries.g: no object is an instance of it; add one, or leave the geometry out"
    ]
    assert said(csg("difference", BALL, instance), {"g": DISK}) == [
        f".of.1: is open, as geometries.g is an open disk, and only the first operand of a difference may be open; "
        f"{CYLINDER}"
    ]


def test_nothing_contains_itself() -> None:
    def instance(name: str) -> dict:
        return {"type": "instance", "geometry": name}

    both = {"a": csg("union", BALL, instance("b")), "b": box(cut={"x": instance("a")})}
    assert said(instance("a"), both) == [
        'geometries.a.of.1.geometry = "b": a geometry cannot contain itself: a contains b, b contains a; take another '
        "geometry"
    ]
    # The way to a cycle is no part of it.
    assert said(instance("c"), {"c": csg("union", BALL, instance("a"))} | both)[0].startswith("geometries.a.of.1")
    own = {"a": csg("union", BALL, instance("a"))}
    assert said(instance("a"), own) == [
        'geometries.a.of.1.geometry = "a": a geometry cannot contain itself: a contains a; take another geometry'
    ]
    inner: list = [vr.Sphere()]
    inner.append(unchecked(vr.Csg, op="union", of=inner))
    with pytest.raises(vr.UserError, match=r"^objects.c: .* nested deeper than 100 levels, or it contains itself"):
        checked(vr.Scene(objects={"c": inner[1]}, camera=vr.Camera(), lights={}))


def tower(levels: int) -> vr.Csg:
    """A csg in a csg in a csg."""
    obj = vr.Sphere()
    for _ in range(levels):
        obj = vr.Csg(op="difference", of=[obj, vr.Box()])
    return obj


@pytest.mark.parametrize("levels", [MOST_LEVELS + 1, 200, 2000])
def test_too_many_levels(levels: int) -> None:
    with pytest.raises(vr.UserError) as caught:
        checked(vr.Scene(objects={"c": tower(levels)}, camera=vr.Camera(), lights={}))
    assert caught.value.lines == (
        f"objects.c: its operands are nested deeper than {MOST_LEVELS} levels, or it contains itself; "
        "write them as one list",
    )


def test_as_many_levels_as_there_may_be(tmp_path: Path) -> None:
    scene = checked(vr.Scene(objects={"c": tower(MOST_LEVELS)}, camera=vr.Camera(), lights={}))
    path = tmp_path / "tower.json"
    path.write_text(dump(scene))
    assert load(path) == scene


@pytest.mark.parametrize(("count", "wrong"), [(MOST_LEVELS, False), (MOST_LEVELS + 1, True), (3 * MOST_LEVELS, True)])
def test_levels_go_on_through_geometries(count: int, wrong: bool) -> None:
    geometries = {"g0": BOX}
    for i in range(1, count + 1):
        geometries[f"g{i}"] = csg("union", BALL, {"type": "instance", "geometry": f"g{i - 1}"})
    line = (
        "geometries.g101: its operands are nested deeper than 100 levels, or it contains itself; write them as one list"
    )
    assert said({"type": "instance", "geometry": f"g{count}"}, geometries) == [line] * wrong


def test_transforms_go_on_through_geometries() -> None:
    small = [{"scale": 1e-5}]
    flaw = "the steps together scale below 1e-09 or reach beyond 1e+09"
    geometries = {"g": csg("union", BALL, box(transform=small))}
    assert said({"type": "instance", "geometry": "g", "transform": [{"scale": 1e-3}]}, geometries) == []
    assert said({"type": "instance", "geometry": "g", "transform": small}, geometries) == [
        f'geometries.g.of.1.transform = [{{"scale": 1e-05}}]: followed by the transforms of what is around it, {flaw}'
    ]
    assert said(csg("union", BOX, {"type": "instance", "geometry": "g"}, transform=small), geometries) == [
        f'geometries.g.of.1.transform = [{{"scale": 1e-05}}]: followed by the transforms of what is around it, {flaw}'
    ]


def test_too_many_operands() -> None:
    many = vr.Csg(op="union", of=[vr.Sphere()] * (MOST_OPERANDS + 1))
    with pytest.raises(vr.UserError, match=r"^objects.c: has 10,001 operands; at most 10,000 are possible"):
        checked(vr.Scene(objects={"c": many}, camera=vr.Camera(), lights={}))
    # Geometries that hold each other twice: their number is found without looking at each.
    geometries = {"g0": csg("union", BALL, BOX)}
    for i in range(1, 60):
        twice = {"type": "instance", "geometry": f"g{i - 1}"}
        geometries[f"g{i}"] = csg("union", twice, twice)
    assert said({"type": "instance", "geometry": "g59"}, geometries) == [
        "geometries.g13: has 16,384 operands; at most 10,000 are possible, so make several objects"
    ]


NAMED = {
    "c": {
        "type": "csg",
        "op": "difference",
        "of": {
            "rest": {"type": "box", "min": [-1, -2, -3]},
            "hole": {"type": "sphere", "radius": 0.5, "transform": [{"translate": [0, 1, 0]}]},
            "both": csg("intersection", ball(radius=2), {"type": "plane", "normal": [0, 1, 0]}),
        },
    },
    "b": {"type": "sphere", "cut": [{"type": "box", "max": [0, 2, 3]}]},
}


def named() -> vr.Scene:
    return examined({"objects": NAMED, "camera": {}, "lights": {}})[0]


def test_values_have_addresses_at_any_depth() -> None:
    scene = named()
    assert value(scene, "objects.c.of.hole.radius") == 0.5
    assert value(scene, "objects.c.of.both.of.0.radius") == 2
    assert value(scene, "objects.b.cut.0.max.1") == 2
    assert value(scene, "objects.c.of.hole.transform.0.translate.1") == 1
    new = changed(scene, {"objects.c.of.both.of.0.radius": 3.0, "objects.b.cut.0.max.1": 5.0})
    assert value(new, "objects.c.of.both.of") == (vr.Sphere(radius=3.0), vr.Plane())
    assert value(new, "objects.b.cut.0.max") == (0, 5, 3)
    assert list(new.objects["c"].of) == ["rest", "hole", "both"] and new.objects["c"].of["hole"].radius == 0.5
    assert replaced(scene, "objects.b.cut", None).objects["b"] == vr.Sphere()
    assert replaced(scene, "objects.c.of.hole", vr.Box(cut=[vr.Sphere()])).objects["c"].of["hole"].cut == (vr.Sphere(),)


def test_all_numbers_of_operands_are_listed() -> None:
    listed = numeric_addresses(named())
    own = {a.removeprefix("objects."): x.size for a, x in listed.items() if a.startswith("objects.")}
    assert own == {
        "c.of.rest.min": 3,
        "c.of.rest.max": 3,
        "c.of.hole.center": 3,
        "c.of.hole.radius": 1,
        "c.of.hole.transform.0.translate": 3,
        "c.of.both.of.0.center": 3,
        "c.of.both.of.0.radius": 1,
        "c.of.both.of.1.point": 3,
        "c.of.both.of.1.normal": 3,
        "b.center": 3,
        "b.radius": 1,
        "b.cut.0.min": 3,
        "b.cut.0.max": 3,
    }
    for address in listed:
        assert value(named(), address) is not None


@pytest.mark.parametrize(
    ("address", "what"),
    [
        ("c.of.hol.radius", "c.of has no 'hol'; did you mean \"hole\"? (one of rest, hole, both)"),
        ("c.of.both.of.2.radius", "c.of.both.of has no '2'; one of 0, 1"),
        ("c.of.hole.radus", "c.of.hole has no 'radus'; did you mean \"radius\"? "
         "(one of material, transform, cut, cut_material, type, center, radius)"),
        ("c.cut.0.radius", "c.cut is null, as there are no operands; assign a list of objects to it"),
        ("c.op.0", "c.op is a single value; leave .0 out"),
    ],
)  # fmt: skip
def test_a_wrong_address_gets_a_hint(address: str, what: str) -> None:
    with pytest.raises(vr.UserError) as caught:
        value(named(), f"objects.{address}")
    assert caught.value.lines == (f"objects.{address}: objects.{what}",)


def test_a_wrong_new_value_of_an_operand_is_named() -> None:
    with pytest.raises(vr.UserError, match=r"^objects\.c\.of\.hole\.radius = -1: must be greater than 0$"):
        replaced(named(), "objects.c.of.hole.radius", -1)
    with pytest.raises(vr.UserError, match=r"^objects\.b\.cut\.0: is an open disk, and what is taken away must be"):
        replaced(named(), "objects.b.cut.0", {"type": "disk"})


def test_set_reaches_operands_and_cuts(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"objects": NAMED, "camera": {}, "lights": {}}))
    for assignment, expected in (
        ("objects.c.of.hole.radius=-1", "objects.c.of.hole.radius = -1: must be greater than 0"),
        ("objects.c.of.hol.radius=1", "objects.c.of.hol.radius: objects.c.of has no 'hol'; did you mean"),
        ('objects.b.cut=[{"type": "disk"}]', "objects.b.cut.0: is an open disk"),
        ('objects.b.cut={"type": "box"}', 'objects.b.cut = {"type": "box"}: must be a list of objects, or objects by'),
    ):
        assert main(["explain", str(path), "--set", assignment]) == 2
        assert expected in " ".join(capsys.readouterr().err.split())


def grown(rng: random.Random, levels: int, solid: bool = True) -> Primitive:
    """A random object with operands at random depths."""
    if levels == 0 or rng.random() < 0.2:
        kinds = [vr.Sphere, vr.Box, vr.Plane, vr.Cylinder, vr.Torus] if solid else [vr.Disk, vr.Rectangle]
        obj = rng.choice(kinds)()
    else:
        op = rng.choice(("intersection", "difference") if not solid else ("union", "merge", "intersection"))
        of = [grown(rng, levels - 1, solid or i > 0) for i in range(rng.randint(2, 4))]
        obj = vr.Csg(op=op, of=by_name(rng, of), ends="capped" if solid else rng.choice(("capped", "open")))
    fields = {}
    if rng.random() < 0.3:
        fields["transform"] = (
            vr.Rotate(rotate=rng.uniform(-180, 180)),
            vr.Translate(translate=(rng.random(), 1.0, 2.0)),
        )
    if rng.random() < 0.3:
        fields["cut"] = by_name(rng, [grown(rng, 0) for _ in range(rng.randint(1, 2))])
        fields |= {"cut_material": "red"} if solid and rng.random() < 0.5 else {}
    return replace(obj, material=rng.choice(("default", "red")), **fields)


def by_name(rng: random.Random, of: list) -> dict | tuple:
    """Operands as a list, or by names that are in no order."""
    return {rng.choice("abc") + str(rng.random())[2:]: x for x in of} if rng.random() < 0.5 else tuple(of)


def ordered(obj: Primitive) -> list:
    """The operands of an object at all depths, in order."""
    return [(x.address, type(x.shape), x.material) for x in operands("", obj, {})]


@settings(max_examples=40)
@given(st.integers(0, 2**32), st.booleans())
def test_what_is_written_is_read(seed: int, solid: bool) -> None:
    rng = random.Random(seed)
    scene = checked(
        vr.Scene(
            objects={"c": grown(rng, 3, solid)}, materials={"red": MATERIALS["red"]}, camera=vr.Camera(), lights={}
        )
    )
    text = dump(scene)
    again = examined(json.loads(text))[0]
    assert again == scene and again.hash() == scene.hash()
    assert ordered(again.objects["c"]) == ordered(scene.objects["c"])
    # Defaults are left out, and the type of each operand is written.
    found = [json.loads(text)["objects"]["c"]]
    for entry in found:
        assert "type" in entry and entry.get("material") != "default" and None not in entry.values()
        found += [x for role in ("of", "cut") for x in named_operands(entry.get(role)).values()]


def test_the_order_of_operands_is_kept_beside_that_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"objects": {"c": csg("union", NAMED["c"], BOX)}, "camera": {}, "lights": {}}))
    scene = load(path)
    inner = scene.objects["c"].of[0]
    turned = replace(inner, of=dict(reversed(inner.of.items())))
    scene = replaced(scene, "objects.c.of.0", turned)
    assert list(json.loads(dump(scene, like=path))["objects"]["c"]["of"][0]["of"]) == ["both", "hole", "rest"]
    # The two differ in which operand is cut, and so do their hashes.
    assert scene.hash() != load(path).hash()


def test_materials_of_operands_are_in_use() -> None:
    scene = examined(
        {
            "materials": {n: {} for n in ("body", "hole", "pale", "of geometry", "own", "back", "unused")}
            | {"body": {"back": "back"}},
            "geometries": {"g": csg("union", BOX, ball(material="of geometry"))},
            "objects": {
                "c": csg("difference", box(material="body"), ball(material="hole"), BOX, cut_material="pale"),
                "i": {"type": "instance", "geometry": "g", "material": "own"},
            },
            "camera": {},
            "lights": {},
        }
    )[0]
    assert set(used_materials(scene)) == {"body", "hole", "pale", "of geometry", "own", "back"}
    assert scene.materials_of_objects() == [("body", "hole", "pale"), ("own", "of geometry")]
    assert list(scene.objects_of({"pale"})) == ["c"] and list(scene.objects_of({"of geometry", "body"})) == ["c", "i"]


def test_effects_that_only_operands_need() -> None:
    def on(name: str, obj: dict, **materials: dict) -> bool:
        lights = {"l": {"type": "point", "position": [0, 9, 0]}}
        raw = {
            "objects": {"c": obj},
            "materials": materials,
            "textures": {"t": {"type": "checker"}},
            "lights": lights,
            "camera": {},
        }
        return features(examined(raw)[0])[name]

    inner, plain = csg("difference", BOX, csg("union", BALL, ball(material="m"))), csg("difference", BOX, BALL)
    for name, material in (
        ("textures", {"texture": "t"}),
        ("reflection", {"kr": [1, 1, 1]}),
        ("specular", {"ks": [1, 1, 1]}),
        ("unlit", {"shading": "unlit"}),
    ):
        assert on(name, inner, m=material) and not on(name, plain, m=material)
        assert on(name, box(cut=[BALL], cut_material="m"), m=material)
    glass = {"kt": [1, 1, 1]}
    assert on("nested media", csg("union", box(material="m"), ball(material="m")), m=glass)
    assert not on("nested media", csg("merge", box(material="m"), ball(material="m")), m=glass)
    assert on("coloured shadows", csg("merge", BOX, BALL, material="m"), m=glass)
    # A disk that a solid cuts can hide a light from itself no more than a disk, but visray does not look so far.
    assert not on("shadows", DISK) and on("shadows", DISK | {"cut": [BALL]})


FAR = box(transform=[{"translate": [9, 0, 0]}])


def notes(**objects: dict) -> list[str]:
    geometries = {"g": csg("merge", FAR, FAR, {"type": "torus", "transform": FAR["transform"]})}
    used = {"use": {"type": "instance", "geometry": "g"}}
    return csg_notes(examined({"objects": objects | used, "geometries": geometries, "camera": {}, "lights": {}})[0])[1:]


@pytest.mark.parametrize(
    ("obj", "what"),
    [
        (csg("difference", BOX, *[BALL] * 1100), ["a difference of 1,101 shapes: 1 box, 1,100 spheres"]),
        (csg("intersection", BOX, csg("merge", BALL, BALL)), ["an intersection of 3 shapes: 1 box, 2 spheres"]),
        (ball(cut=[BOX]), ["a sphere, from which 1 box is taken away"]),
        (
            csg("union", BALL, BALL, cut=[BOX, csg("union", BOX, BALL)]),
            ["a union of 2 shapes: 2 spheres, from which 2 boxes, 1 sphere are taken away"],
        ),
        (
            {"type": "instance", "geometry": "g", "cut": [BALL]},
            ["an instance of geometries.g, from which 1 sphere is taken away", ...],
        ),
        ({"type": "plane", "cut": [BALL]}, ["a plane, from which 1 sphere is taken away; it is unbounded"]),
        (csg("union", {"type": "plane"}, BALL), ["a union of 2 shapes: 1 plane, 1 sphere; it is unbounded"]),
        (csg("intersection", {"type": "plane"}, BALL), ["an intersection of 2 shapes: 1 plane, 1 sphere"]),
        (csg("intersection", BALL, BALL, FAR), [..., ": is empty, as the boxes of objects.c.of.0 and objects.c.of.2 "]),
        (csg("intersection", BALL, csg("union", FAR, FAR)), [..., ": is empty, as the boxes of objects.c.of.0 and "]),
        (
            csg("union", BALL, csg("intersection", BALL, FAR)),
            [..., ".of.1: is empty, as the boxes of objects.c.of.1.of.0 and objects.c.of.1.of.1 do not meet"],
        ),
        (
            csg("difference", csg("union", csg("intersection", BALL, FAR), csg("intersection", FAR, BALL)), BOX),
            [..., ": is empty, as the boxes of objects.c.of.0.of.0.of.0 and objects.c.of.0.of.0.of.1 do not meet"],
        ),
        (
            ball(cut=[csg("intersection", BALL, {"type": "instance", "geometry": "g"})]),
            [..., ".cut.0: is empty, as the boxes of objects.c.cut.0.of.0 and objects.c.cut.0.of.1 do not meet"],
        ),
        (ball(cut=[FAR]), [..., ".cut.0 does not reach the object around; it takes nothing away"]),
        (
            csg("difference", BALL, FAR, BOX, FAR),
            [..., ".of.1 and 1 more do not reach the object around; they take nothing away"],
        ),
        (csg("difference", BALL, csg("merge", FAR, BOX)), [...]),
        (ball(cut=[box(min=[1, 0, 0], max=[2, 1, 1])]), [...]),
        # Boxes that touch have a face in common.
        (csg("intersection", box(min=[0, 0, 0]), box(min=[-1, 0, 0], max=[0, 1, 1])), [...]),
        (csg("intersection", {"type": "plane"}, {"type": "plane", "normal": [0, -1, 0], "point": [0, 9, 0]}), [...]),
    ],
)
def test_what_is_said_about_an_object(obj: dict, what: list) -> None:
    """Of what it is made, and whether it is unbounded or empty."""
    said = notes(c=obj)
    assert len(said) == len(what)
    for text, expected in zip(said, what):
        assert expected is ... or text.startswith(
            f"objects.c{expected}" if expected[0] in ".:" else f"objects.c: {expected}"
        )


def test_many_objects_are_counted() -> None:
    said = notes(**{f"c{i}": ball(cut=[BOX]) for i in range(1000)})
    assert len(said) == 50 and said[-1] == "objects: 951 CSG objects more are not listed here"


def test_an_empty_object_is_said_once_when_it_is_prepared() -> None:
    scene = examined({"objects": {"nothing": csg("intersection", BALL, FAR)}, "camera": {}, "lights": {}})[0]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(2):
            vr.prepare(scene)
        vr.prepare(examined({"objects": {"something": csg("intersection", BALL, BOX)}, "camera": {}, "lights": {}})[0])
    (warning,) = caught
    assert warning.category is CsgWarning and warning.filename == __file__
    assert str(warning.message).startswith("objects.nothing: is empty, as the boxes of objects.nothing.of.0 and ")


def test_a_cut_that_does_not_reach_is_said_once_when_it_is_prepared() -> None:
    scene = examined({"objects": {"whole": ball(cut=[FAR])}, "camera": {}, "lights": {}})[0]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(2):
            vr.prepare(scene)
    (warning,) = caught
    assert str(warning.message) == "objects.whole.cut.0 does not reach the object around; it takes nothing away"


def test_explain_says_of_what_objects_are_made(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"objects": {"c": csg("difference", BOX, BALL)}, "camera": {}, "lights": {}}))
    assert main(["explain", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["notes"] == ["objects.c: a difference of 2 shapes: 1 box, 1 sphere"]


@pytest.mark.parametrize(
    ("obj", "what"),
    [
        (csg("intersection", BALL, FAR), "all objects are empty"),
        (csg("difference", BALL, box(min=[-2, -2, -2], max=[2, 2, 2])), "without meeting its surface; it may be empty"),
    ],
)
def test_a_picture_of_nothing_says_so(obj: dict, what: str) -> None:
    scene = replace(examined({"objects": {"c": obj}, "camera": {}, "lights": {}})[0], film=vr.Film(width=8, height=6))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        vr.render(scene, layers=["RGB"], progress=False)
    (text,) = (str(x.message) for x in caught if x.category is DarkWarning)
    assert text.startswith("nothing is seen: ") and text.endswith(what)


@pytest.mark.parametrize(
    "wrapped",
    ["instance", pytest.param("operand", marks=pytest.mark.slow), pytest.param("cut", marks=pytest.mark.slow)],
)
def test_a_parameter_of_a_polynomial_has_a_derivative_in_csg(wrapped: str) -> None:
    """At k = 0 the terms with k vanish. The derivative by k is that of the polynomial alone."""
    ball_of_k = {"type": "polynomial", "expression": "x^2+y^2+z^2-1+k*x^3", "parameters": {"k": 0.0}, "ends": "capped"}
    whole, half = box(min=[-3, -3, -3], max=[3, 3, 3]), box(min=[-3, -3, -3], max=[0, 0, 0])
    obj, address = {
        "operand": (csg("intersection", ball_of_k, whole), "objects.c.of.0"),
        "cut": (ball_of_k | {"cut": [half]}, "objects.c"),
        "instance": (csg("intersection", {"type": "instance", "geometry": "g"}, whole), "geometries.g"),
    }[wrapped]

    def derivative(obj: dict, address: str, geometries: dict) -> float:
        scene = examined(raw(obj, geometries) | {"lights": {"l": {"type": "point", "position": [5, 2, 1]}}})[0]
        camera = vr.Camera(origin=(2.0, 3.0, 4.0), target=(0.2, 0.3, 0.4), fov=3.0)
        scene = replace(scene, camera=camera, film=vr.Film(width=4, height=4), settings=vr.Settings(spp=1))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return vr.gradient(scene, [f"{address}.parameters.k"], progress=False)[f"{address}.parameters.k"]

    expected = derivative(ball_of_k, "objects.c", {})
    found = derivative(obj, address, {"g": ball_of_k} if wrapped == "instance" else {})
    assert abs(expected) > 0.01 and found == pytest.approx(expected, rel=1e-9)
