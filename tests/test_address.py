"""Addresses of values in a scene."""

import pytest

from visray.camera import Camera
from visray.errors import UserError
from visray.lights import PointLight
from visray.materials import Material
from visray.primitives import Disk, Sphere
from visray.scene.address import changed, numeric_addresses, parse_assignment, replaced, value
from visray.scene.scene import Gradient, Scene, Settings
from visray.transforms import Rotate, Scale, Translate

SCENE = Scene(
    camera=Camera(origin=(0.0, 0.0, 5.0)),
    materials={"red": Material(kd=(1.0, 0.0, 0.0))},
    lights={"lamp": PointLight(position=(1.0, 2.0, 3.0))},
    objects={
        "ball": Sphere(
            center=(1.0, 2.0, 3.0),
            material="red",
            transform=(Translate(translate=(4.0, 5.0, 6.0)), Scale(scale=2.0), Rotate(rotate=30.0)),
        ),
        "plate": Disk(),
    },
)


def message(address: str) -> str:
    with pytest.raises(UserError) as caught:
        value(SCENE, address)
    assert len(caught.value.lines) == 1
    return caught.value.lines[0]


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("objects.ball.radius", 1.0),
        ("objects.ball.center", (1.0, 2.0, 3.0)),
        ("objects.ball.center.1", 2.0),
        ("objects.ball.transform.0.translate", (4.0, 5.0, 6.0)),
        ("objects.ball.transform.0.translate.2", 6.0),
        ("objects.ball.transform.1.scale", 2.0),
        ("objects.ball.material", "red"),
        ("objects.plate", Disk()),
        ("materials.red.kd.0", 1.0),
        ("lights.lamp.position.2", 3.0),
        ("camera", Camera(origin=(0.0, 0.0, 5.0))),
        ("settings.spp", 16),
        ("background.top", (0.5, 0.7, 1.0)),
    ],
)
def test_value(address: str, expected: object) -> None:
    assert value(SCENE, address) == expected


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("objects.bal.radius", "objects has no 'bal'; did you mean \"ball\"? (one of ball, plate)"),
        ("objects.plate.radus", "objects.plate has no 'radus'; did you mean \"radius\"? "),
        ("objects.ball.center.3", "objects.ball.center has no '3'; one of 0, 1, 2"),
        ("objects.ball.center.-1", "objects.ball.center has no '-1'; "),
        ("objects.ball.center.x", "objects.ball.center has no 'x'; one of 0, 1, 2"),
        ("objects.ball.radius.0.1", "objects.ball.radius is a single value; leave .0.1 out"),
        ("objects.plate.transform.0", "objects.plate.transform has no '0'; there is none"),
        ("objects.ball.transform.0.scale", "objects.ball.transform.0 has no 'scale'; one of translate"),
        ("objects.ball.hash", "objects.ball has no 'hash'; one of material, transform, type, center, radius"),
        ("camra.fov", "the scene has no 'camra'; did you mean \"camera\"? "),
        ("", "the scene has no ''; one of camera, film, "),
        ("objects..radius", "objects has no ''; one of ball, plate"),
    ],
)
def test_an_unknown_address_lists_what_is_there(address: str, expected: str) -> None:
    assert message(address).startswith(f"{address}: {expected}")


def test_replaced_makes_a_new_checked_scene() -> None:
    changed_scene = replaced(SCENE, "objects.ball.center.1", 7)
    assert changed_scene.objects["ball"].center == (1.0, 7.0, 3.0)
    assert isinstance(changed_scene.objects["ball"].center[1], float)
    assert SCENE.objects["ball"].center == (1.0, 2.0, 3.0)
    assert list(changed_scene.objects) == ["ball", "plate"]
    assert replaced(changed_scene, "objects.ball.center", (1.0, 2.0, 3.0)) == SCENE


@pytest.mark.parametrize(
    ("address", "new"),
    [
        ("objects.ball.radius", 2.5),
        ("objects.ball.transform.0.translate", (0.0, 1.0, 0.0)),
        ("objects.ball.transform.2.rotate", -45.0),
        ("objects.ball.transform.1.scale", (1.0, 2.0, 3.0)),
        ("background", (0.0, 0.5, 1.0)),
        ("background", Gradient(top=(0.0, 0.0, 0.0), bottom=(1.0, 0.0, 0.0))),
        ("settings", Settings(spp=3)),
        ("objects.plate", Sphere(radius=0.5)),
        ("settings.precision", "double"),
        ("film.transparent", True),
    ],
)
def test_what_is_put_in_is_found_again(address: str, new: object) -> None:
    assert value(replaced(SCENE, address, new), address) == new


def test_plain_json_values_can_be_put_in() -> None:
    scene = replaced(SCENE, "objects.plate.transform", [{"rotate": 90}])
    assert scene.objects["plate"].transform == (Rotate(rotate=90.0),)
    scene = replaced(SCENE, "objects.plate", {"type": "sphere", "radius": 3})
    assert scene.objects["plate"] == Sphere(radius=3.0)


@pytest.mark.parametrize(
    ("address", "new", "expected"),
    [
        ("objects.ball.radius", -1.0, "objects.ball.radius = -1.0: must be greater than 0"),
        ("objects.ball.radius", float("inf"), "objects.ball.radius = Infinity: must be finite"),
        ("objects.ball.center", 3.0, "objects.ball.center = 3.0: must be 3 numbers (world units)"),
        (
            "objects.ball.material",
            "rod",
            'objects.ball.material = "rod": unknown material; did you mean "red"? (one of red, default)',
        ),
        ("objects.ball.transform.1.scale", 0, "objects.ball.transform.1.scale = 0: a scale must not be 0"),
        ("camera.origin.2", 0, "camera.target = [0.0, 0.0, 0.0]: must differ from origin"),
    ],
)
def test_what_is_put_in_is_checked(address: str, new: object, expected: str) -> None:
    with pytest.raises(UserError) as caught:
        replaced(SCENE, address, new)
    assert caught.value.lines == (expected,)


def test_several_changes_are_checked_together() -> None:
    scene = changed(SCENE, {"camera.origin": (0.0, 0.0, 0.0), "camera.target.2": -1.0})
    assert scene.camera == Camera(origin=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0))
    scene = changed(SCENE, {"objects.plate": {"type": "sphere", "radius": 1}, "objects.plate.radius": 2.0})
    assert scene.objects["plate"] == Sphere(radius=2.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("objects.ball.radius=2", ("objects.ball.radius", 2)),
        ("objects.ball.radius = 2.5e-1 ", ("objects.ball.radius", 0.25)),
        ("a.center=[1, 2.0, -3]", ("a.center", [1, 2.0, -3])),
        ("settings.precision=double", ("settings.precision", "double")),
        ('objects.a.material="two words"', ("objects.a.material", "two words")),
        ("objects.a.material=two words", ("objects.a.material", "two words")),
        ("settings.shadows=false", ("settings.shadows", False)),
        ('objects.a.transform=[{"scale": 2}]', ("objects.a.transform", [{"scale": 2}])),
        ("objects.a b.material=x=y", ("objects.a b.material", "x=y")),
    ],
)
def test_parse_assignment(text: str, expected: tuple) -> None:
    assert parse_assignment(text) == expected


@pytest.mark.parametrize("text", ["objects.ball.radius", "=2", "a.b=", "", "="])
def test_text_without_address_or_value_is_no_assignment(text: str) -> None:
    with pytest.raises(UserError, match="write ADDRESS=VALUE"):
        parse_assignment(text)


def test_broken_json_in_an_assignment() -> None:
    with pytest.raises(UserError) as caught:
        parse_assignment("a.center=[1 2]")
    assert caught.value.lines == ("a.center: line 1, column 4: is not JSON: expecting ',' delimiter",)
    with pytest.raises(UserError, match="a: top: the key is written twice"):
        parse_assignment('a={"top": 1, "top": 2}')


def test_numeric_addresses() -> None:
    found = numeric_addresses(SCENE)
    assert list(found) == [
        "camera.origin",
        "camera.target",
        "camera.up",
        "camera.fov",
        "background.top",
        "background.bottom",
        "ambient",
        "materials.red.ka",
        "materials.red.kd",
        "materials.red.ks",
        "materials.red.shininess",
        "lights.lamp.position",
        "lights.lamp.intensity",
        "lights.lamp.Ia",
        "lights.lamp.Id",
        "lights.lamp.Is",
        "lights.lamp.a",
        "lights.lamp.b",
        "lights.lamp.c",
        "objects.ball.transform.0.translate",
        "objects.ball.transform.2.axis",
        "objects.ball.center",
        "objects.ball.radius",
        "objects.plate.center",
        "objects.plate.normal",
        "objects.plate.radius",
    ]
    assert (found["objects.ball.center"].size, found["objects.ball.center"].precision) == (3, "geometry")
    assert (found["materials.red.shininess"].size, found["materials.red.shininess"].precision) == (1, "shading")
    for address, quantity in found.items():
        held = value(SCENE, address)
        assert (len(held) if isinstance(held, tuple) else 1) == quantity.size


def test_a_plain_background_is_one_address() -> None:
    found = numeric_addresses(Scene(background=(0.1, 0.2, 0.3)))
    assert [a for a in found if a.startswith("background")] == ["background"]
    assert found["background"].size == 3
