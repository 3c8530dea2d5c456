"""Addresses of values in a scene."""

import random
from dataclasses import asdict
from pathlib import Path

import pytest
from unchecked import unchecked

from visray.camera import Camera
from visray.errors import UserError
from visray.lights import DirectionalLight, DiskLight, PointLight, RectangleLight, SphereLight, SpotLight
from visray.materials import Material
from visray.primitives import Disk, Sphere
from visray.scene.address import changed, numeric_addresses, parse_assignment, parse_assignments, replaced, value
from visray.scene.load import load
from visray.scene.scene import Occlusion, Scatter, Scene, Settings, SkyGradient
from visray.textures import CheckerTexture, ImageTexture
from visray.transforms import Rotate, Scale, Translate

SCENES = Path(__file__).resolve().parents[1] / "scenes"
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
RICH = Scene(
    camera=Camera(aperture=0.5, focus=4.0),
    textures={"tiles": CheckerTexture(scale=(4.0, 2.0)), "photo": ImageTexture(file="a.png")},
    materials={"glass": Material(ka=(0.1, 0.1, 0.1), kt=(0.25, 0.5, 1.0), texture="tiles"), "plain": Material()},
    lights={
        "sun": DirectionalLight(direction=(0.0, -1.0, 0.5)),
        "beam": SpotLight(position=(0.0, 5.0, 0.0), direction=(0.0, -1.0, 0.0), angle=12.5),
        "window": RectangleLight(position=(1.0, 2.0, 3.0), samples=4),
        "lid": DiskLight(position=(1.0, 2.0, 3.0), radius=0.25),
        "bulb": SphereLight(position=(1.0, 2.0, 3.0), radius=0.125),
    },
    settings=Settings(occlusion=Occlusion(sky=16), scatter=Scatter(rays=2)),
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
    ("address", "expected", "text", "new"),
    [
        ("camera.aperture", 0.5, "0", 0.0),
        ("camera.focus", 4.0, "2.5", 2.5),
        ("textures.tiles.scale", (4.0, 2.0), "[1, 3]", (1.0, 3.0)),
        ("textures.tiles.scale.1", 2.0, "-1", -1.0),
        ("textures.tiles.a.2", 0.8, "1", 1.0),
        ("textures.photo.file", "a.png", "images/b c.png", "images/b c.png"),
        ("textures.photo.filter", "bilinear", "nearest", "nearest"),
        ("textures.photo", ImageTexture(file="a.png"), '{"type": "checker"}', CheckerTexture()),
        ("materials.glass.kt", (0.25, 0.5, 1.0), "[0, 0, 0.5]", (0.0, 0.0, 0.5)),
        ("materials.glass.kt.1", 0.5, "1", 1.0),
        ("materials.glass.kr.0", 0.0, "0.25", 0.25),
        ("materials.glass.ior", 1.5, "1.33", 1.33),
        ("materials.glass.dmax", 1e9, "2", 2.0),
        ("materials.glass.texture", "tiles", "photo", "photo"),
        ("materials.glass.texture", "tiles", "null", None),
        ("materials.plain.texture", None, "photo", "photo"),
        ("lights.sun.direction.2", 0.5, "1", 1.0),
        ("lights.beam.angle", 12.5, "20", 20.0),
        ("lights.beam.exponent", 0.0, "3", 3.0),
        ("lights.window.samples", 4, "8", 8),
        ("lights.window.width", (1.0, 0.0, 0.0), "[2, 0, 1]", (2.0, 0.0, 1.0)),
        ("lights.lid.normal.1", 1.0, "2", 2.0),
        ("lights.bulb.radius", 0.125, "0.5", 0.5),
        ("settings.shading", "blinn-phong", "toon", "toon"),
        ("settings.depth", 16, "0", 0),
        ("settings.occlusion.sky", 16, "0", 0),
        ("settings.occlusion.distance", 1.0, "2", 2.0),
        ("settings.occlusion.hemisphere", "cosine", "box", "box"),
        ("settings.occlusion", Occlusion(sky=16), '{"near": 4}', Occlusion(near=4)),
        ("settings.scatter.depth", 1, "3", 3),
    ],
)
def test_every_part_can_be_read_and_set(address: str, expected: object, text: str, new: object) -> None:
    assert value(RICH, address) == expected
    where, parsed = parse_assignment(f"{address}={text}")
    found = value(replaced(RICH, where, parsed), address)
    assert found == new and type(found) is type(new)


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("settings.occlusion.skye", "settings.occlusion has no 'skye'; did you mean \"sky\"? (one of sky, near, "),
        ("settings.occlusion.sky.0", "settings.occlusion.sky is a single value; leave .0 out"),
        ("materials.plain.texture.scale", "materials.plain.texture is a single value; leave .scale out"),
        ("textures.tile.a", "textures has no 'tile'; did you mean \"tiles\"? (one of tiles, photo)"),
        ("lights.sun.position", "lights.sun has no 'position'; one of intensity, Ia, Id, Is, a, b, c, type, direction"),
        ("materials.glass.Kt", "materials.glass has no 'Kt'; did you mean \"kt\"? (one of color, ka, "),
    ],
)
def test_an_unknown_address_in_a_nested_part_lists_what_is_there(address: str, expected: str) -> None:
    with pytest.raises(UserError) as caught:
        value(RICH, address)
    assert len(caught.value.lines) == 1 and caught.value.lines[0].startswith(f"{address}: {expected}")


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
        (
            "objects.ball.hash",
            "objects.ball has no 'hash'; one of material, transform, cut, cut_material, type, center, radius",
        ),
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
        ("background", SkyGradient(top=(0.0, 0.0, 0.0), bottom=(1.0, 0.0, 0.0))),
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


@pytest.mark.parametrize(
    ("address", "new", "expected"),
    [
        (
            "materials.glass.texture",
            "tile",
            'materials.glass.texture = "tile": unknown texture; did you mean "tiles"? ',
        ),
        ("materials.glass.texture", {"tiles"}, "materials.glass.texture = \"{'tiles'}\": must be a string or null"),
        ("settings.occlusion.sky", -1, "settings.occlusion.sky = -1: must be at least 0"),
        ("settings.occlusion", 5, "settings.occlusion = 5: must be an object {...} with the keys sky, near, "),
        ("lights.window.height.0", float("nan"), "lights.window.height.0 = NaN: must be finite"),
        ("lights.window.height", (2, 0, 0), "lights.window.height = [2.0, 0.0, 0.0]: must not be parallel to width: "),
        ("lights.sun.c", 1, "lights.sun.c = 1.0: must be 0: "),
        # Instances are checked as well, wherever they lie.
        ("camera", unchecked(Camera, fov=-1.0), "camera.fov = -1.0: must be at least 0.01"),
        ("materials", {"glass": unchecked(Material, ior=0.0)}, "materials.glass.ior = 0.0: must be at least 0.01"),
        (
            "settings",
            unchecked(Settings, occlusion=unchecked(Occlusion, near=-1)),
            "settings.occlusion.near = -1: must be at least 0",
        ),
    ],
)
def test_what_is_put_into_a_nested_part_is_checked(address: str, new: object, expected: str) -> None:
    with pytest.raises(UserError) as caught:
        replaced(RICH, address, new)
    assert len(caught.value.lines) == 1 and caught.value.lines[0].startswith(expected)


def test_several_changes_are_checked_together() -> None:
    scene = changed(SCENE, {"camera.origin": (0.0, 0.0, 0.0), "camera.target.2": -1.0})
    assert scene.camera == Camera(origin=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0))
    scene = changed(SCENE, {"objects.plate": {"type": "sphere", "radius": 1}, "objects.plate.radius": 2.0})
    assert scene.objects["plate"] == Sphere(radius=2.0)
    scene = changed(SCENE, {"objects.plate": Sphere(), "objects.plate.radius": 3.0})
    assert scene.objects["plate"] == Sphere(radius=3.0)
    scene = changed(SCENE, {"settings": Settings(spp=3), "settings.occlusion.sky": 4, "settings.scatter.rays": 2})
    assert scene.settings == Settings(spp=3, occlusion=Occlusion(sky=4), scatter=Scatter(rays=2))


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
        ("objects.ball.radius=.5", ("objects.ball.radius", 0.5)),
        ("objects.ball.radius=-.25", ("objects.ball.radius", -0.25)),
        ("objects.ball.radius=2.", ("objects.ball.radius", 2.0)),
        ("camera.origin=0,1.5,-5e-1", ("camera.origin", [0, 1.5, -0.5])),
        ("camera.origin=(0, 1, 5)", ("camera.origin", [0, 1, 5])),
        ("objects.a.material=1, red", ("objects.a.material", "1, red")),
        ('textures.t.file="a,film.width=5"', ("textures.t.file", "a,film.width=5")),
    ],
)
def test_parse_assignment(text: str, expected: tuple) -> None:
    assert parse_assignment(text) == expected


@pytest.mark.parametrize("text", ["objects.ball.radius", "=2", "a.b=", "", "="])
def test_text_without_address_or_value_is_no_assignment(text: str) -> None:
    with pytest.raises(UserError, match="write ADDRESS=VALUE"):
        parse_assignment(text)


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        (["camera.fov=40,film.width=5"], {"camera.fov": 40, "film.width": 5}),
        (["camera.fov=40 film.width=5"], {"camera.fov": 40, "film.width": 5}),
        (["camera.origin=[1, 2, 3]; objects.a b.radius = 2"], {"camera.origin": [1, 2, 3], "objects.a b.radius": 2}),
        (["ambient=0,1,5,background=[0,0,0]"], {"ambient": [0, 1, 5], "background": [0, 0, 0]}),
        (['textures.t.file="a,film.width=5", film.width=6'], {"textures.t.file": "a,film.width=5", "film.width": 6}),
        (['data={"title": "a, film.width=5"}'], {"data": {"title": "a, film.width=5"}}),
        (["objects.a.material=1, red"], {"objects.a.material": "1, red"}),
        (["camera.fov=40", "camera.fov=50"], {"camera.fov": 50}),
        (["film.width=1,film.height=2,camera.fov=3"], {"film.width": 1, "film.height": 2, "camera.fov": 3}),
    ],
)
def test_several_assignments_in_one_text(texts: list[str], expected: dict) -> None:
    assert parse_assignments(texts) == expected


def test_a_wrong_one_of_several_assignments_is_named() -> None:
    with pytest.raises(UserError, match=r"a\.center: line 1, column 4: is not JSON"):
        parse_assignments(["a.center=[1 2],film.width=3"])
    with pytest.raises(UserError, match=r"'camera\.fov=': is not an assignment"):
        parse_assignments(["camera.fov=,film.width=3"])


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
        "camera.aperture",
        "camera.focus",
        "background.top",
        "background.bottom",
        "ambient",
        "materials.red.kd",
        "materials.red.ks",
        "materials.red.shininess",
        "materials.red.kr",
        "materials.red.kt",
        "materials.red.ior",
        "materials.red.dmax",
        "materials.red.absorption",
        "materials.red.emission",
        "lights.lamp.intensity",
        "lights.lamp.Ia",
        "lights.lamp.Id",
        "lights.lamp.Is",
        "lights.lamp.a",
        "lights.lamp.b",
        "lights.lamp.c",
        "lights.lamp.position",
        "objects.ball.transform.0.translate",
        "objects.ball.transform.2.axis",
        "objects.ball.center",
        "objects.ball.radius",
        "objects.plate.center",
        "objects.plate.normal",
        "objects.plate.radius",
        "settings.occlusion.distance",
    ]
    assert (found["objects.ball.center"].size, found["objects.ball.center"].precision) == (3, "geometry")
    assert (found["materials.red.shininess"].size, found["materials.red.shininess"].precision) == (1, "shading")
    for address, quantity in found.items():
        held = value(SCENE, address)
        assert (len(held) if isinstance(held, tuple) else 1) == quantity.size


@pytest.mark.parametrize(
    ("prefix", "fields"),
    [
        ("textures.tiles", {"a", "b"}),
        ("materials.glass", {"ka", "kd", "ks", "shininess", "kr", "kt", "ior", "dmax", "absorption"}),
        ("lights.sun", {"direction"}),
        ("lights.beam", {"position", "direction", "angle", "exponent"}),
        ("lights.window", {"position", "width", "height"}),
        ("lights.lid", {"position", "normal", "radius"}),
        ("lights.bulb", {"position", "radius"}),
        ("settings", {"occlusion.distance"}),
    ],
)
def test_numeric_addresses_of_a_part(prefix: str, fields: set[str]) -> None:
    found = {address.removeprefix(f"{prefix}.") for address in numeric_addresses(RICH) if address.startswith(prefix)}
    common = {"intensity", "Ia", "Id", "Is", "a", "b", "c"} if prefix.startswith("lights") else set()
    assert fields | common <= found
    # Counts, choices and names are no numbers of a kernel.
    assert not found & {"samples", "type", "texture", "spp", "depth", "occlusion.sky", "filter"}


def test_a_plain_background_is_one_address() -> None:
    found = numeric_addresses(Scene(background=(0.1, 0.2, 0.3), camera=Camera(), lights={}))
    assert [a for a in found if a.startswith("background")] == ["background"]
    assert found["background"].size == 3


def test_odd_assignments_are_made_or_refused_in_one_line() -> None:
    """Values of the wrong kind, at any address and at addresses that do not exist."""
    scene, rng = load(SCENES / "everything.json"), random.Random(1)
    words = [
        "0", "-1", "2.5", "1e400", "NaN", "true", "null", "x", "[]", "{}", "[1,2,3]", "[0,0,0]", "[null]", "1,2", "1%",
        '{"type":"sphere"}', '{"type":["x"]}', '{"type":null}', '{"type":"mesh"}', '{"a":{"a":1}}', '{"":1}', "\ud800",
        r'"\ud800"', '[{"scale":0}]', "[{}]", "[" * 200 + "]" * 200, "0x1", "1_0", '"', "{", '"x^^"', "1e-400", "\0",
    ]  # fmt: skip

    def addresses(node: object, prefix: str) -> list[str]:
        items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, (list, tuple)) else ()
        return [prefix, *(a for key, part in items for a in addresses(part, f"{prefix}.{key}"))]

    places = [a for name, part in asdict(scene).items() for a in addresses(part, name)]
    made = 0
    for _ in range(400):
        address = rng.choice(places) + rng.choice([""] * 8 + [".", ".0", ".x", ".type", " "])
        try:
            changed(scene, dict([parse_assignment(f"{address}={rng.choice(words)}")]))
            made += 1
        except UserError as error:
            assert error.lines and all(line.isprintable() for line in error.lines)
    assert 0 < made < 200
