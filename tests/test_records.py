"""Records in Python: checked where they are made, with values by place, written in one line. All kinds are tested."""

import re
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import drjit as dr
import numpy as np
import pytest

import visray as vr
from visray.pytree import mapped
from visray.quantities import Arrays, quantities, record, stacked
from visray.record_text import record_text
from visray.scene import write
from visray.scene.messages import line as line_of
from visray.scene.scene import Scene

# All classes whose records users make. `write.KINDS` has all kinds of the schema.
KINDS = [kind for kind in write.KINDS if kind is not Scene]
NAMES = [kind.__name__ for kind in KINDS]
PUBLIC = {name: getattr(vr, name) for name in vr.__all__} | {kind.__name__: kind for kind in KINDS}
# Numbers that are right for each Quantity of a required field, and values of other required fields.
RIGHT = {
    "a": (0.0, 0.0, 0.0), "b": (1.0, 0.0, 0.0), "c": (0.0, 1.0, 0.0), "op": "union", "of": (), "geometry": "g",
    "file": "a.png", "matrix": ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)), "rotate": 30.0,
    "scale": 2.0, "column": "rain", "duration": 2.0, "address": "objects.a.center", "times": (0.0, 1.0),
    "period": 2.0, "values": (1.0, 2.0), "points": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
}  # fmt: skip
OTHERS = {vr.SpinTrack: {"of": "objects.a"}, vr.Ellipse: {"radii": (1.0, 2.0)}, vr.EllipseTrack: {"radii": (1.0, 2.0)}}


def required(kind: type) -> dict[str, Any]:
    """Right values for the fields of a kind that have no default."""
    names = [f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING]
    return {name: RIGHT.get(name, (0.5, 0.25, 0.125)) for name in names} | OTHERS.get(kind, {})


def sample(kind: type) -> Any:
    return kind(**required(kind))


@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_a_wrong_value_of_each_field_is_refused_where_the_record_is_made(kind):
    for f in fields(kind):
        if get_origin(f.type) is Annotated and get_args(f.type)[0] is Any and f.name not in ("of", "cut"):
            continue  # values of keys can be anything
        with pytest.raises(vr.UserError, match=rf"^{kind.__name__}: {f.name}\b") as caught:
            kind(**required(kind) | {f.name: object()})
        assert len(caught.value.lines) == 1


@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_numbers_of_numpy_become_those_of_python(kind):
    for name, quantity in quantities(kind).items():
        own = required(kind)
        right = own[name] if name in own else getattr(kind(**own), name)
        if right is None or not np.all(np.isreal(right)):
            continue
        for given in (np.asarray(right), np.asarray(right, np.float32), np.asarray(right).tolist()):
            made = getattr(kind(**own | {name: given}), name)
            numbers = made if quantity.size == 3 else (made,)
            assert type(numbers) is tuple and {type(x) for x in numbers} == {float}
            np.testing.assert_allclose(made, right, rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_fields_by_place_are_those_by_name(kind):
    names = [f.name for f in fields(kind) if not f.kw_only]
    values = {name: getattr(sample(kind), name) for name in names}
    rest = {name: value for name, value in required(kind).items() if name not in names}
    assert kind(*values.values(), **rest) == kind(**values, **rest)
    with pytest.raises(TypeError, match=rf"^{kind.__name__}\(\) takes {len(names) or 'no'} values? by place"):
        kind(*range(len(names) + 1))
    if names:
        with pytest.raises(TypeError, match=f"{names[0]} is given twice, by place and by name"):
            kind(values[names[0]], **{names[0]: values[names[0]]})


@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_a_field_that_is_missing_or_unknown_is_told(kind):
    with pytest.raises(TypeError, match=rf"^{kind.__name__}\(\) has no 'unknown'; "):
        kind(**required(kind), unknown=1)
    for name in required(kind):
        with pytest.raises(TypeError, match=rf"^{kind.__name__}\(\) needs {name}$"):
            kind(**{k: v for k, v in required(kind).items() if k != name})


@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_the_text_of_a_record_is_one_line_that_makes_it_again(kind):
    made = sample(kind)
    assert "\n" not in repr(made) and eval(repr(made), PUBLIC) == made
    assert repr(made).count("=") == len(required(kind)) + repr(tuple(required(kind).values())).count("=")
    for name, quantity in quantities(kind).items():
        if quantity.size == 3 and getattr(made, name) is not None:
            other = replace(made, **{name: (0.5, 0.75, 0.25)})
            assert eval(repr(other), PUBLIC) == other and f"{name}=(0.5, 0.75, 0.25)" in repr(other)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if quantities(kind)], ids=lambda kind: kind.__name__)
def test_records_of_kernels_are_not_checked(kind):
    """Tables hold Dr.Jit arrays, and None in their place. Arrays keep their derivatives."""
    a = Arrays.of()
    table = stacked(a, kind, [getattr(sample(kind), "resolved", sample(kind))] * 2)
    name = next(iter(quantities(kind)))
    changed = replace(table, **{name: getattr(table, name)})
    assert getattr(changed, name) is getattr(table, name)
    assert "<" in record_text(changed) and dr.width(mapped(lambda x: x, changed)) == 2
    assert record(kind, {}) == record(kind, {})


def test_what_is_right_is_said():
    for make, text in (
        (lambda: vr.Sphere(radius=-1), "Sphere: radius = -1: must be greater than 0"),
        (lambda: vr.Sphere(0, 1), "Sphere: center = 0: must be 3 numbers (world units)"),
        (lambda: vr.Settings(sampler="sobl"), 'Settings: sampler = "sobl": unknown value; did you mean "sobol"?'),
        (lambda: vr.Film(width=2.5), "Film: width = 2.5: must be a whole number"),
        (
            lambda: vr.Csg("union", vr.Sphere()),
            'Csg: of = {"material": "default", "transform": [], "cut": null, "cu...: must be a list of objects',
        ),
        (lambda: vr.Material(color=[1, 0.5, 0]), "Material: color = [1, 0.5, 0]: "),
        (lambda: vr.Rotate(float("nan")), "Rotate: rotate = NaN: must be finite"),
    ):
        with pytest.raises(vr.UserError, match="^" + re.escape(text)):
            make()
    with pytest.raises(vr.UserError, match=r"write kd=\[1, 0.5, 0\]"):
        vr.Material(color=[1, 0.5, 0])
    with pytest.raises(TypeError, match="takes 1 value by place"):
        vr.Scale(1, 2, 3)
    with pytest.raises(TypeError, match=r"a point or a colour is one value, as in \(0, 1, 0\)"):
        vr.PointLight(0, 1, 0)
    with pytest.raises(TypeError, match="did you mean 'center'"):
        vr.Sphere(centre=(0, 1, 0))
    with pytest.raises(TypeError, match=r"transform=\[vr.Translate\(...\)\]"):
        vr.Sphere(translate=(0, 1, 0))


def test_truth_values_are_no_numbers_and_sets_have_no_order():
    with pytest.raises(vr.UserError, match=r"^Sphere: radius = true: must be a number"):
        vr.Sphere((0, 0, 0), np.bool_(True))
    with pytest.raises(vr.UserError, match=r"^Sphere: center\.1 = true: must be a number"):
        vr.Sphere((0, np.bool_(True), 0), 1)
    with pytest.raises(vr.UserError, match=r"^Sphere: center = .*: a set has no order; write a list or a tuple"):
        vr.Sphere({3, 1, 2}, 1)
    with pytest.raises(vr.UserError, match="is not a valid name"):
        vr.Scene().with_object("a\n", vr.Sphere())
    with pytest.raises(vr.UserError, match=r"^film\.scale: decides how many pixels there are"):
        vr.difference(vr.Scene(), "film.scale")


def test_a_mesh_is_refused_where_it_is_made():
    """Lists that are wrong together; a table in a message is no text."""
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    for vertices, faces, line in (
        ([*corners[:2], [0, np.nan, 0]], [[0, 1, 2]], "vertices: vertex 2 is not finite; every coordinate must be"),
        (corners, [[0, 1, 3]], "faces: face 0 names vertex 3; the vertices are 0 to 2"),
    ):
        with pytest.raises(vr.UserError, match=f"^Mesh: {line}"):
            vr.Mesh(vertices=vertices, faces=faces)
    mesh = vr.Mesh(vertices=corners, faces=[[0, 1, 2]])
    assert line_of("objects.m.vertices", mesh.vertices, "is wrong") == "objects.m.vertices = 3 x 3 numbers: is wrong"


def test_the_documentation_lists_the_fields_by_place():
    page = (Path(__file__).resolve().parents[1] / "docs" / "python.md").read_text()
    table = {}
    for names, values in re.findall(r"^\| (`[A-Z][^|]*) \| (`[^|]*) \|$", page, re.MULTILINE):
        for name in re.findall(r"`(\w+)`", names):
            table[name] = re.findall(r"`(\w+)`", values)
    by_place = {kind.__name__: [f.name for f in fields(kind) if not f.kw_only] for kind in KINDS}
    public = {name: names for name, names in by_place.items() if names and name in vr.__all__}
    assert table == public
