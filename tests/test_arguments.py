"""Odd arguments of the public functions: a UserError of one line, or what was meant; never another exception."""

import contextlib
import inspect
import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray import setup
from visray.arguments import checked_argument, python_number
from visray.errors import UserError
from visray.live import view as live_view

SCENES = Path(__file__).resolve().parents[1] / "scenes"
BALL = vr.Scene(objects={"a": vr.Sphere()}, lights={"l": vr.PointLight(position=(3.0, 4.0, 5.0))}, camera=vr.Camera())
IMAGE = vr.Image({"RGB": np.ones((2, 3, 3), np.float32), "Z": np.ones((2, 3), np.float32)})
ODD = [
    None, True, 5, -1, 0, 2.5, np.nan, np.inf, 10**30, "", "x", "a.b", b"x", [], {}, (), (1,), (1, 2, 3), (1.5, 2),
    ("a", "b"), [None], [[]], {"a": 1}, object(), np.int64(2), np.float32(2), np.array([1, 2]), np.array(3),
    lambda x: x, vr.Sphere(), vr.Sphere, BALL, vr.Scene, IMAGE, "\ud800", "a\0b", set(), range(3), 1j, ...,
]  # fmt: skip
# Arguments with which a function would do its work.
GOOD = {
    "scene": BALL, "path": str(SCENES / "sphere.json"), "address": "objects.a.radius", "new": 2.0, "error": 0.01,
    "t": 0.0, "images": [IMAGE], "formula": "x^2 + y^2 + z^2 - 1",
    "wrt": ["objects.a.radius"], "addresses": ["objects.a.radius"], "x": 0, "y": 0, "points": (0.0, 0.0, 0.0),
    "table": {"lon": [2.0, 3.0], "lat": [41.0, 42.0], "rain": [1.0, 2.0]},
}  # fmt: skip
FUNCTIONS = [getattr(vr, name) for name in vr.__all__ if inspect.isfunction(getattr(vr, name))]
# It has many parameters, and draws a map for those that are right.
FUNCTIONS = [pytest.param(f, marks=pytest.mark.slow) if f is vr.data_scene else f for f in FUNCTIONS]


class Begun(Exception):
    """The work begins: the arguments are accepted."""


@pytest.fixture
def no_work(monkeypatch):
    """Nothing is prepared, rendered or served."""

    def begin(*_, **__):
        raise Begun

    prepare = setup.prepare
    for module in [m for name, m in sys.modules.items() if name.startswith("visray.")]:
        for name in [name for name, value in vars(module).items() if value is prepare]:
            monkeypatch.setattr(module, name, begin)
    # A live picture would listen at a port, and prepare in a thread of its own.
    monkeypatch.setattr(live_view, "started", begin)


def refuses_or_begins(function, arguments):
    """Calls a function. Any exception but a UserError of printable lines, or Begun, is a fault."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            function(**arguments)
    except Begun:
        return
    except UserError as error:
        assert error.lines and all(line and "\n" not in line for line in error.lines)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_odd_arguments_of_functions(function, no_work, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = list(inspect.signature(function).parameters)
    required = [n for n, p in inspect.signature(function).parameters.items() if p.default is p.empty]
    good = {name: GOOD[name] for name in required + (["error"] if function is vr.tune else [])}
    good |= {"path": "a.webp"} if function is vr.write_movie else {}
    for name in names:
        for odd in ODD:
            refuses_or_begins(function, good | {name: odd})


def test_odd_arguments_of_images(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for odd in ODD:
        for call in (vr.Image.read, IMAGE.png, IMAGE.write, IMAGE.display, IMAGE.__getitem__, vr.Image):
            refuses_or_begins(lambda call=call, odd=odd: call(odd), {})
        refuses_or_begins(lambda odd=odd: vr.Image({"RGB": odd}), {})
        refuses_or_begins(lambda odd=odd: vr.Image({"RGB": IMAGE["RGB"]}, odd), {})
        refuses_or_begins(IMAGE.write, {"path": "a.png", "gamma": odd})
        refuses_or_begins(IMAGE.write, {"path": "a.png", "exposure": odd})
        refuses_or_begins(IMAGE.write, {"path": "a.exr", "layers": odd})


def kinds():
    """The dataclasses among the public names that are parts of a scene."""
    values = [getattr(vr, name) for name in vr.__all__]
    return [x for x in values if hasattr(x, "__dataclass_fields__") and hasattr(x, "__pydantic_config__")]


def test_odd_values_in_scenes():
    """Every section and every setting of a scene, from Python."""
    for name in vr.Scene.__dataclass_fields__:
        for odd in [*ODD, {"a": object()}, {1: vr.Sphere()}, {None: 1}, {"a": vr.Scene}]:
            refuses_or_begins(lambda name=name, odd=odd: vr.explain(vr.Scene(**{name: odd})), {})
    for name in vr.Settings.__dataclass_fields__:
        for odd in ODD:
            refuses_or_begins(
                lambda name=name, odd=odd: vr.explain(
                    vr.Scene(settings=vr.Settings(**{name: odd}), camera=vr.Camera(), lights={})
                ),
                {},
            )


@pytest.mark.parametrize("size", [5, None, "12", (1, 2, 3), {1, 2}, np.array(3), (2.5, 2), ("a", "b"), [-1, 2]])
def test_a_size_that_is_none(size):
    if size is None:
        assert vr.render(BALL, size=None, spp=1, layers="RGB").width == BALL.film.width
        return
    with pytest.raises(UserError, match=r"size = .*such as \(640, 480\)|film.width|film.height"):
        vr.render(BALL, size=size)


def test_numbers_of_numpy_are_numbers():
    arguments = {"spp": np.int64(2), "size": np.array([6, 4]), "seed": np.uint8(3), "threads": np.int32(1)}
    image = vr.render(BALL, **arguments, progress=np.bool_(False))
    same = vr.render(BALL, spp=2, size=(6, 4), seed=3)
    np.testing.assert_array_equal(image["RGB"], same["RGB"])
    ball = vr.Sphere(radius=np.float32(0.5), center=(np.int64(1), np.float64(2), 0))
    assert vr.dump(vr.Scene(objects={"a": ball}, camera=vr.Camera(), lights={})) == vr.dump(
        vr.Scene(objects={"a": vr.Sphere(radius=0.5, center=(1, 2, 0))}, camera=vr.Camera(), lights={})
    )
    assert vr.value(vr.replaced(BALL, "objects.a.radius", np.float32(0.25)), "objects.a.radius") == 0.25
    assert python_number(np.bool_(True)) is True and isinstance(python_number(np.array(3)), np.ndarray)


def test_an_image_is_an_array_for_numpy():
    np.testing.assert_array_equal(np.asarray(IMAGE), IMAGE["RGB"])
    assert np.array(IMAGE, dtype=np.float64).dtype == np.float64 and np.mean(IMAGE) == 1
    assert not np.shares_memory(np.array(IMAGE), IMAGE["RGB"])


def test_an_image_has_its_colour_and_its_coverage():
    np.testing.assert_array_equal(IMAGE.rgb, IMAGE["RGB"])
    assert IMAGE.alpha.shape == (2, 3) and (IMAGE.alpha == 1).all() and not IMAGE.interrupted
    half = vr.Image({"RGB": IMAGE["RGB"], "A": np.full((2, 3), 0.5, np.float32)}, {"interrupted": 1})
    assert half.alpha is half["A"] and half.interrupted
    assert np.asarray(IMAGE, copy=False) is IMAGE["RGB"] or np.shares_memory(np.asarray(IMAGE, copy=False), IMAGE.rgb)
    with pytest.raises(ValueError, match="copy"):
        np.asarray(IMAGE, dtype=np.float64, copy=False)
    assert vr.Image.save is vr.Image.write


FILE = str(SCENES / "sphere.json")


@pytest.mark.parametrize(
    "function", [f for f in map(vars(vr).get, dir(vr)) if inspect.isfunction(f)], ids=lambda f: f.__name__
)
def test_every_function_of_a_scene_takes_a_file_or_a_dict(function, no_work, tmp_path):
    parameters = inspect.signature(function).parameters
    if "scene" not in parameters:
        return
    own = {"address": "objects.large.radius", "wrt": ["objects.large.radius"], "wrts": ["objects.large.radius"],
           "addresses": ["objects.large.radius"]}  # fmt: skip
    required = [n for n, p in parameters.items() if p.default is p.empty and n != "scene"]
    values = {name: own.get(name, GOOD.get(name)) for name in required}
    moving = (
        {"animation": {"duration": 2, "tracks": {"turn": {"type": "orbit"}}}} if function in (vr.at, vr.animate) else {}
    )
    values |= {"error": 0.01} if function is vr.tune else {}
    content = json.loads(Path(FILE).read_text()) | moving
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    for scene in (vr.load(path), str(path), path, content):
        with contextlib.suppress(Begun):
            function(scene, **values)


def test_a_dict_is_a_scene():
    content = json.loads(Path(FILE).read_text())
    assert vr.load(content) == vr.load(FILE) and vr.load(content | {"$schema": "x"}) == vr.load(FILE)
    assert vr.value(content, "objects.large.radius") == vr.value(FILE, "objects.large.radius")
    mixed = vr.load({"objects": [vr.Plane(material=vr.Material(kd=(1, 0, 0))), {"type": "sphere"}]})
    assert list(mixed.objects) == ["plane", "sphere"] and mixed.materials["plane"].kd == (1.0, 0.0, 0.0)
    with pytest.raises(UserError, match=r"^objects.a.radius = -1: must be greater than 0$"):
        vr.load({"objects": {"a": {"type": "sphere", "radius": -1}}, "camera": {}, "lights": {}})
    with pytest.raises(UserError, match="a dict is no VisRayTrace scene"):
        vr.load(content, compat=True)


def test_what_is_right_is_said():
    for value, annotation, text in (
        (5, str | Path | None, "a = 5: must be a text or a path or None"),
        ([], str, "a = []: must be a text"),
        ("x", bool, "a = 'x': must be True or False"),
        (5, dict, "a = 5: must be a dict"),
    ):
        with pytest.raises(UserError) as caught:
            checked_argument("a", value, annotation)
        assert str(caught.value) == text


@pytest.mark.parametrize(
    ("options", "advice"),
    [
        ({"a": 2}, r'surface_scene\(\): .*\'a\'; a parameter of a formula is written parameters=\{"a": 2\}'),
        ({"clp": "2"}, 'surface_scene.*did you mean "clip"'),
        ({"from_": (1, 0, 0)}, "surface_scene.*one of formula, parameters, size, clip, view"),
    ],
)
def test_an_argument_that_is_not_there_is_told(options, advice):
    with pytest.raises(TypeError, match=advice):
        vr.surface_scene("x^2 - a", **options)
