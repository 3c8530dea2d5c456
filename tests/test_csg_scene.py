"""CSG in scenes: what may be written, what is said where it is wrong, and how it is addressed, changed and written."""

from pathlib import Path

import pytest

import visray as vr
from visray import primitives
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
    return {"objects": {"c": obj}, "materials": MATERIALS, "geometries": geometries or {}}


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
    ],
)
def test_a_wrong_field_is_named_at_its_address(obj: dict, what: str) -> None:
    assert said(obj) == [what]


@pytest.mark.parametrize(
    ("obj", "what"),
    [
        (csg("union", BALL), ".of: has only one operand; a union is made of at least two"),
        (csg("intersection"), ".of: has no operand; an intersection is made of at least two"),
        (ball(cut=[]), ".cut: is empty; name at least one solid, or leave it out"),
        (ball(cut={}), ".cut: is empty; name at least one solid, or leave it out"),
        (ball(cut_material="red"), '.cut_material = "red": nothing is cut here; leave it out'),
        (csg("merge", BALL, BOX, cut_material="red"), '.cut_material = "red": nothing is cut here; leave it out'),
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
            '.cut.0.material = "glass": is transparent, unlike "red" of objects.c; in one solid all materials are, or '
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
    for obj in (
        csg("difference", BOX, mesh, cut_material="tiles"),
        csg("difference", BOX, mesh | {"material": "tiles"}),
    ):
        assert examined({"objects": {"c": obj}, **tiles})[1] == [f'objects.c.of.1.material = "tiles": {why}']


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
    inner.append(vr.Csg(op="union", of=inner))
    with pytest.raises(vr.UserError, match=r"^objects.c: .* nested deeper than 100 levels, or it contains itself"):
        checked(vr.Scene(objects={"c": inner[1]}))


def tower(levels: int) -> vr.Csg:
    """A csg in a csg in a csg."""
    obj = vr.Sphere()
    for _ in range(levels):
        obj = vr.Csg(op="difference", of=[obj, vr.Box()])
    return obj


@pytest.mark.parametrize("levels", [MOST_LEVELS + 1, 200, 2000])
def test_too_many_levels(levels: int) -> None:
    with pytest.raises(vr.UserError) as caught:
        checked(vr.Scene(objects={"c": tower(levels)}))
    assert caught.value.lines == (
        f"objects.c: its operands are nested deeper than {MOST_LEVELS} levels, or it contains itself; "
        "write them as one list",
    )


def test_as_many_levels_as_there_may_be(tmp_path: Path) -> None:
    scene = checked(vr.Scene(objects={"c": tower(MOST_LEVELS)}))
    path = tmp_path / "tower.json"
    path.write_text(dump(scene))
    assert load(path) == scene


def test_too_many_operands() -> None:
    many = vr.Csg(op="union", of=[vr.Sphere()] * (MOST_OPERANDS + 1))
    with pytest.raises(vr.UserError, match=r"^objects.c: has 10,001 operands; at most 10,000 are possible"):
        checked(vr.Scene(objects={"c": many}))
    # Geometries that hold each other twice: their number is found without looking at each.
    geometries = {"g0": csg("union", BALL, BOX)}
    for i in range(1, 60):
        twice = {"type": "instance", "geometry": f"g{i - 1}"}
        geometries[f"g{i}"] = csg("union", twice, twice)
    assert said({"type": "instance", "geometry": "g59"}, geometries) == [
        "geometries.g13: has 16,384 operands; at most 10,000 are possible, so make several objects"
    ]
