"""Scene files: what they may hold, and what is said where they are wrong."""

import json
import os
import warnings
from collections.abc import Callable
from inspect import cleandoc
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from light_samples import LIGHT_NAMES, light_sample
from samples import NAMES
from samples import SAMPLES as KIND_SAMPLES
from unchecked import unchecked

from visray import lights, modes, primitives, textures
from visray.camera import Camera
from visray.errors import UserError
from visray.lights import DirectionalLight, DiskLight, PointLight, RectangleLight, SphereLight, SpotLight
from visray.lights.light import AreaLight, Light
from visray.materials import Material
from visray.primitives import Box, Instance, Plane, Polynomial, Rectangle, Sphere, Triangle
from visray.primitives.clips import Ball, Block
from visray.scene.check import examined, flaws
from visray.scene.load import checked, dump, load, schema
from visray.scene.scene import Film, Occlusion, Scatter, Scene, Settings, SkyGradient
from visray.textures import CheckerTexture, ImageTexture
from visray.transforms import Matrix, Rotate, Scale, Translate

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(p for p in (ROOT / "scenes").glob("*.json") if p.name != "schema.json")
KINDS, LIGHTS = (
    ", ".join(kind.__dataclass_fields__["type"].default for kind in kinds)
    for kinds in (primitives.OBJECTS, lights.KINDS)
)
TEXTURES = "image, checker"
SKIES = "an object {...} with the keys top, bottom or an object {...} with the keys file, rotation, intensity"
MATERIAL = (
    "color, ka, kd, ks, shininess, kr, kt, ior, dmax, absorption, fresnel, emission, priority, texture, textured, "
    "shading, colored, back"
)


def write(folder: Path, content: object) -> Path:
    path = folder / "x.json"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def errors(folder: Path, content: object) -> list[str]:
    """What load says of a file, without the file's name, which begins each line."""
    path = write(folder, content)
    with pytest.raises(UserError) as caught, warnings.catch_warnings():
        warnings.simplefilter("error")
        load(path)
    assert all(text.startswith(f"{path}: ") and "\n" not in text for text in caught.value.lines)
    return [text.removeprefix(f"{path}: ") for text in caught.value.lines]


def wrong(folder: Path, **ball: object) -> list[str]:
    return errors(folder, {"objects": {"ball": {"type": "sphere", **ball}}, "camera": {}, "lights": {}})


def everything() -> Scene:
    """A scene with every kind of everything."""
    things = {name: KIND_SAMPLES[name].posed for name in NAMES}
    things["named"] = Polynomial(surface="heart")
    things["written"] = Polynomial(
        expression="x^2 + y^2 - k*z", parameters={"k": 0.5}, clip=Block(max=(1.0, 2.0, 3.0)), ends="capped"
    )
    things["listed"] = Polynomial(monomis=("x2", "y2", "-z2", "-1"), clip=Ball(center=(0.0, 0.5, 0.0), radius=2.0))
    steps = (
        Translate(translate=(1.0, 2.0, 3.0)),
        Scale(scale=2.0),
        Scale(scale=(1.0, -2.0, 0.5)),
        Rotate(rotate=30.0, axis=(1.0, 1.0, 0.0)),
        Matrix(matrix=((1.0, 0.0, 0.0, 5.0), (0.0, 1.0, 0.5, 0.0), (0.0, 0.0, 1.0, 0.1))),
    )
    things["copy"] = Instance(geometry="shape", material="plain", transform=steps[:2])
    things["placed ball"] = Sphere(center=(0.1, 0.2, 0.3), radius=1e-3, material="gold, polished", transform=steps)
    return Scene(
        camera=Camera(origin=(1.0, 2.0, 3.0), fov=35.5, aperture=0.1, focus=4.0),
        film=Film(width=64, height=48, transparent=True),
        background=(0.1, 0.2, 0.3),
        ambient=(0.5, 0.5, 0.5),
        textures={
            "tiles": CheckerTexture(a=(0.1, 0.2, 0.3), scale=(4.0, 2.0)),
            "photo": ImageTexture(file="/photos/a b.png", offset=(0.5, 0.0), wrap="mirror", encoding="linear"),
        },
        materials={
            "gold, polished": Material(kd=(0.8, 0.6, 0.2), shininess=100.0, kr=(0.8, 0.6, 0.2)),
            "glass": Material(kt=(0.9, 1.0, 0.9), ior=1.33, dmax=2.0, texture="photo"),
            "plain": Material(),
        },
        lights={
            **{name: light_sample(name).posed for name in LIGHT_NAMES},
            "lamp": PointLight(position=(2.0, 4.0, 6.0), c=0.01),
            "sun": DirectionalLight(direction=(0.0, -1.0, 0.5), intensity=2.0, a=2.0),
            "beam": SpotLight(position=(0.0, 5.0, 0.0), direction=(0.0, -1.0, 0.0), angle=12.5, exponent=3.0),
            "window": RectangleLight(position=(1.0, 2.0, 3.0), width=(2.0, 0.0, 0.0), samples=4),
            "lid": DiskLight(position=(1.0, 2.0, 3.0), normal=(1.0, 0.0, 0.0), radius=0.25),
            "bulb": SphereLight(position=(1.0, 2.0, 3.0), radius=0.125, Ia=(0.1, 0.1, 0.1)),
        },
        geometries={"shape": Sphere(radius=0.5, transform=steps[2:3])},
        objects=things,
        settings=Settings(
            spp=4,
            seed=7,
            precision="double",
            sampler="sobol",
            shading="toon",
            shadows=False,
            depth=2,
            misses="ambient",
            local="full",
            area="centre",
            occlusion=Occlusion(sky=16, near=8, distance=0.5, hemisphere="box"),
            scatter=Scatter(rays=4, depth=2),
        ),
    )


def test_everything_has_every_kind() -> None:
    whole = everything()
    for kinds, found in (
        (primitives.OBJECTS, whole.objects),
        (lights.KINDS, whole.lights),
        (textures.KINDS, whole.textures),
    ):
        assert {type(thing) for thing in found.values()} == set(kinds)


def test_a_file_becomes_a_scene(tmp_path: Path) -> None:
    content = {
        "$schema": "schema.json",
        "camera": {"origin": [0, 1, 5], "fov": 30},
        "film": {"width": 320, "height": 200},
        "background": {"top": [0, 0, 1], "bottom": [1, 1, 1]},
        "materials": {"red": {"kd": [1, 0, 0]}},
        "lights": {"lamp": {"type": "point", "position": [1, 2, 3]}},
        "objects": {
            "ball": {
                "type": "sphere",
                "radius": 2,
                "material": "red",
                "transform": [{"rotate": 90, "axis": [0, 0, 1]}],
            },
            "floor": {"type": "plane"},
        },
        "settings": {"spp": 1},
    }
    assert load(write(tmp_path, content)) == Scene(
        camera=Camera(origin=(0.0, 1.0, 5.0), fov=30.0),
        film=Film(width=320, height=200),
        background=SkyGradient(top=(0.0, 0.0, 1.0), bottom=(1.0, 1.0, 1.0)),
        materials={"red": Material(kd=(1.0, 0.0, 0.0))},
        lights={"lamp": PointLight(position=(1.0, 2.0, 3.0))},
        objects={
            "ball": Sphere(radius=2.0, material="red", transform=(Rotate(rotate=90.0, axis=(0.0, 0.0, 1.0)),)),
            "floor": Plane(),
        },
        settings=Settings(spp=1),
    )


@pytest.mark.parametrize("text", ["{}", "\ufeff{}\n", '{"objects": {}}'])
def test_the_smallest_scene_is_all_defaults(tmp_path: Path, text: str) -> None:
    assert load(write(tmp_path, text)) == Scene(camera=Camera(), lights={})


@pytest.mark.parametrize("scene", [Scene(camera=Camera(), lights={}), everything()], ids=["defaults", "everything"])
def test_dump_loads_back_as_an_equal_scene(tmp_path: Path, scene: Scene) -> None:
    text = dump(scene)
    again = load(write(tmp_path, text), allow_outside=True)
    assert again == scene
    assert again.hash() == scene.hash()
    assert dump(again) == text


def test_dump_leaves_defaults_out_and_keeps_lists_on_a_line() -> None:
    assert dump(Scene(camera=Camera(), lights={})) == '{\n  "camera": {},\n  "lights": {}\n}\n'
    ball = Sphere(center=(1.0, 2.0, 3.0), material="red", transform=(Translate(translate=(0.0, 1.0, 0.0)),))
    text = dump(Scene(materials={"red": Material()}, objects={"ball": ball}, camera=Camera(), lights={}))
    assert text.splitlines() == [
        "{",
        '  "camera": {},',
        '  "materials": {',
        '    "red": {}',
        "  },",
        '  "lights": {},',
        '  "objects": {',
        '    "ball": {',
        '      "type": "sphere",',
        '      "center": [1.0, 2.0, 3.0],',
        '      "material": "red",',
        '      "transform": [{"translate": [0.0, 1.0, 0.0]}]',
        "    }",
        "  }",
        "}",
    ]


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_dump_like_a_file_says_what_that_says_in_its_order(path: Path, tmp_path: Path) -> None:
    scene, raw = load(path), json.loads(path.read_text())
    found = json.loads(dump(scene, path.parent, path))
    for thing in found.get("objects", {}).values():
        # Parameters of known surfaces come with the name, and are spelled out.
        if "surface" in thing and thing not in raw["objects"].values():
            del thing["parameters"]
    assert json.dumps(found) == json.dumps(raw)
    # In another folder files are named as seen from there, the schema too.
    other = tmp_path / path.name
    other.write_text(dump(scene, tmp_path, path))
    assert (tmp_path / json.loads(other.read_text())["$schema"]).samefile(path.parent / "schema.json")
    assert dump(load(other, allow_outside=True), path.parent) == dump(scene, path.parent)


def test_dump_shows_what_differs_in_nested_settings_only() -> None:
    plain = Scene(settings=Settings(occlusion=Occlusion(sky=0), scatter=Scatter()), camera=Camera(), lights={})
    assert json.loads(dump(plain)) == {"camera": {}, "lights": {}}
    nested = Settings(occlusion=Occlusion(sky=8, distance=1.0), scatter=Scatter(depth=3))
    assert json.loads(dump(Scene(settings=nested, camera=Camera(), lights={}))) == {
        "camera": {}, "lights": {}, "settings": {"occlusion": {"sky": 8}, "scatter": {"depth": 3}}
    }  # fmt: skip


PLACE = {"position": (1.0, 2.0, 3.0)}
DOWN = {"direction": (0.0, -1.0, 0.0)}
SAMPLES = [
    Scene(camera=Camera(aperture=0.5), lights={}),
    Scene(camera=Camera(focus=3.0), lights={}),
    *(
        Scene(materials={"m": Material(**{key: (0.25, 0.5, 1.0)})}, camera=Camera(), lights={})
        for key in ("ka", "kd", "ks", "kr", "kt")
    ),
    *(
        Scene(materials={"m": Material(**{key: 1.25})}, camera=Camera(), lights={})
        for key in ("shininess", "ior", "dmax")
    ),
    Scene(textures={"t": CheckerTexture()}, materials={"m": Material(texture="t")}, camera=Camera(), lights={}),
    Scene(
        textures={"t": CheckerTexture(scale=(2.0, -1.0), offset=(0.0, 0.5), b=(1.0, 0.0, 0.0))},
        camera=Camera(),
        lights={},
    ),
    Scene(
        textures={"t": ImageTexture(file="/a/b.exr", filter="nearest", wrap="clamp", encoding="srgb")},
        camera=Camera(),
        lights={},
    ),
    Scene(textures={"t": ImageTexture(file="/a/b.exr", wrap=("repeat", "clamp"))}, camera=Camera(), lights={}),
    Scene(
        textures={"t": CheckerTexture()},
        materials={"m": Material(texture="t", textured="kd")},
        camera=Camera(),
        lights={},
    ),
    *(
        Scene(lights={"l": kind(**PLACE)}, camera=Camera())
        for kind in (PointLight, RectangleLight, DiskLight, SphereLight)
    ),
    Scene(lights={"l": DirectionalLight(**DOWN)}, camera=Camera()),
    Scene(lights={"l": SpotLight(**PLACE, **DOWN)}, camera=Camera()),
    *(Scene(settings=Settings(shading=name), camera=Camera(), lights={}) for name in modes.NAMES[1:]),
    *(Scene(settings=Settings(sampler=name), camera=Camera(), lights={}) for name in ("sobol", "independent")),
    Scene(settings=Settings(depth=0), camera=Camera(), lights={}),
    Scene(settings=Settings(misses="ambient", local="full", area="centre"), camera=Camera(), lights={}),
    Scene(settings=Settings(occlusion=Occlusion(near=65536, hemisphere="box")), camera=Camera(), lights={}),
    Scene(settings=Settings(scatter=Scatter(rays=1, depth=1000)), camera=Camera(), lights={}),
]


@pytest.mark.parametrize("scene", SAMPLES, ids=range(len(SAMPLES)))
def test_every_field_comes_back(tmp_path: Path, scene: Scene) -> None:
    assert load(write(tmp_path, dump(scene)), allow_outside=True) == scene


def test_the_files_of_textures_are_relative_to_the_scene_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "scenes"
    folder.mkdir()
    files = {"near": "a.png", "up": "../images/a.png", "fixed": "/images/a.png"}
    images = {name: {"type": "image", "file": file} for name, file in files.items()}
    path = write(folder, {"textures": images | {"tiles": {"type": "checker"}}})
    monkeypatch.chdir(tmp_path)
    for named, before in ((path, f"{folder}/"), (Path("scenes/x.json"), "scenes/"), ("scenes/x.json", "scenes/")):
        found = load(named, allow_outside=True).textures
        assert found["near"].file == f"{before}a.png"
        assert found["up"].file == f"{before}../images/a.png"
        assert found["fixed"].file == "/images/a.png"
        assert found["tiles"] == CheckerTexture()
    monkeypatch.chdir(folder)
    assert load("x.json", allow_outside=True).textures["near"].file == "a.png"


def test_the_files_of_meshes_are_relative_to_the_scene_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are read already when the scene is checked. A message shows the path that was tried, in full."""
    folder = tmp_path / "scenes"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "one.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    write(folder, {"objects": {"one": {"type": "mesh", "file": "meshes/one.off"}}, "camera": {}, "lights": {}})
    monkeypatch.chdir(tmp_path)
    mesh = load("scenes/x.json").objects["one"]
    assert (mesh.file, mesh.row_count()) == ("scenes/meshes/one.off", 1)
    assert '"file": "../scenes/meshes/one.off"' in dump(load("scenes/x.json"), "elsewhere")
    gone = f"meshes/{'far/' * 20}gone.off"
    path = write(folder, {"objects": {"one": {"type": "mesh", "file": gone}}, "camera": {}, "lights": {}})
    assert errors(folder, json.loads(path.read_text())) == [
        f'objects.one.file = "{folder}/{gone}": there is no such file; check the path'
    ]


@pytest.mark.parametrize("folder", ["", ".", "scenes", "link", "nowhere/deep"])
def test_dump_names_the_files_of_textures_from_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "a.png").touch()
    (tmp_path / "far" / "scenes").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "far" / "scenes")
    monkeypatch.chdir(tmp_path)
    files = {"here": "images/a.png", "anywhere": str(tmp_path / "images" / "a.png")}
    scene = Scene(textures={name: ImageTexture(file=file) for name, file in files.items()}, camera=Camera(), lights={})
    text = dump(scene, Path(folder))
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    for texture in load(write(tmp_path / folder, text), allow_outside=True).textures.values():
        assert os.path.samefile(texture.file, "images/a.png")
    written = {texture["file"] for texture in json.loads(text)["textures"].values()}
    assert len(written) == 1 and not os.path.isabs(*written)
    assert [texture["file"] for texture in json.loads(dump(scene))["textures"].values()] == list(files.values())


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    write(tmp_path, "{}")
    for path, what in (
        (tmp_path / "xx.json", f"no such file; did you mean '{tmp_path / 'x.json'}'?"),
        (tmp_path / "y.json", "no such file"),
        (tmp_path / "nowhere" / "far.json", "no such file"),
        (tmp_path, "is a folder; give a file in it"),
    ):
        with pytest.raises(UserError) as caught:
            load(path)
        assert caught.value.lines == (f"{path}: {what}",)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("", "the file is empty; it must hold at least {}"),
        (" \n", "the file is empty; it must hold at least {}"),
        (b'{\n"a": "\xff"}', "line 2: is not UTF-8; save the file as UTF-8 text"),
        ('{\n "camera": {\n  "fov": 30 "up"', "line 3, column 13: is not JSON: expecting ',' delimiter"),
        ("{} {}", "line 1, column 4: is not JSON: extra data"),
        ('{"film": {"width": True}}', "line 1, column 20: is not JSON: write true"),
        ('{"camera": {"fov": .5}}', "line 1, column 20: is not JSON: a number begins with a digit, as in 0.5"),
        ('{"camera": {"fov": +5}}', "line 1, column 20: is not JSON: a number has no plus sign; leave it out"),
        ("{\"$schema\": 'x'}", 'line 1, column 13: is not JSON: a text has double quotes: "..."'),
        ('{"$schema": \u201cx\u201d}', 'line 1, column 13: is not JSON: a text has straight quotes: "..."'),
        ("[" * 100_000, "is nested deeper than 210 objects and lists; no scene needs that"),
        ("[]", "[]: is not a scene; a scene is an object {...}"),
        ("null", "null: is not a scene; a scene is an object {...}"),
        ('{"$schema": 3}', "$schema = 3: must be a string, the name of a JSON Schema"),
        (
            '{"objects": [], "camera": {}}',
            "objects = []: must be an object {...} that holds entries by name",
        ),
        ('{"camera": {"fov": 3, "fov": 4}}', "camera.fov: the key is written twice; keep one"),
        ('{"objects": {"a": {"type": "box"}, "a": {"type": "box"}}}', "objects.a: the key is written twice; keep one"),
        ('{"ambient": [1, 1, NaN]}', "ambient.2 = NaN: must be finite"),
        ('{"camera": {"fov": Infinity}}', "camera.fov = Infinity: must be finite"),
        ('{"camera": {"origin": [0, -Infinity, 0]}}', "camera.origin.1 = -Infinity: must be finite"),
        ('{"camera": {"origin": [0, 1e999, 0]}}', "camera.origin.1 = Infinity: must be finite"),
        ('{"camera": {"origin": [0, 1%s, 0]}}' % ("0" * 5000), "camera.origin.1 = Infinity: must be finite"),
        ('{"film": {"width": NaN}}', "film.width = NaN: must be a whole number"),
    ],
)
def test_text_that_is_no_scene(tmp_path: Path, content: object, what: str) -> None:
    assert errors(tmp_path, content) == [what]


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"radius": -1}, "objects.ball.radius = -1: must be greater than 0"),
        ({"radius": 0}, "objects.ball.radius = 0: must be greater than 0"),
        ({"radius": "1"}, 'objects.ball.radius = "1": must be a number (world units, > 0)'),
        ({"radius": True}, "objects.ball.radius = true: must be a number (world units, > 0)"),
        ({"radius": None}, "objects.ball.radius = null: must be a number (world units, > 0)"),
        ({"center": [1, 2]}, "objects.ball.center = [1, 2]: must be 3 numbers (world units)"),
        ({"center": [1, 2, 3, 4]}, "objects.ball.center = [1, 2, 3, 4]: must be 3 numbers (world units)"),
        ({"center": 3}, "objects.ball.center = 3: must be 3 numbers (world units)"),
        ({"center": [0, "1", 2]}, 'objects.ball.center.1 = "1": must be a number'),
        ({"material": 3}, "objects.ball.material = 3: must be the name of a material"),
        (
            {"material": {"color": "red"}},
            'objects.ball.material = {"color": "red"}: must be the name of a material; write it under materials, and '
            "its name here",
        ),
        (
            {"material": "tomato"},
            'objects.ball.material = "tomato": unknown material; write {"color": "tomato"} under materials, and its '
            "name here",
        ),
        (
            {"material": "defalt"},
            'objects.ball.material = "defalt": unknown material; did you mean "default"? (one of default)',
        ),
        ({"transform": {}}, "objects.ball.transform = {}: must be a list [...]"),
        (
            {"radus": 2},
            "objects.ball.radus: unknown key; "
            "did you mean 'radius'? (one of type, material, transform, cut, cut_material, center, radius)",
        ),
        (
            {"type": "spere"},
            f'objects.ball.type = "spere": unknown type; did you mean "sphere"? (one of {KINDS})',
        ),
        (
            {"type": "triangle", "a": [0, 0, 0], "b": [1, 0, 0]},
            "objects.ball: the key 'c' is missing; it is 3 numbers (world units)",
        ),
        ({"type": "plane", "normal": [0, 0, 0]}, "objects.ball.normal = [0, 0, 0]: a direction must not be (0, 0, 0)"),
    ],
)
def test_one_wrong_field(tmp_path: Path, fields: dict, what: str) -> None:
    assert wrong(tmp_path, **fields) == [what]


@pytest.mark.parametrize(
    ("step", "what"),
    [
        ({"translate": [1, 2]}, ".translate = [1, 2]: must be 3 numbers (world units)"),
        ({"scale": 0}, ".scale = 0: a scale must not be 0"),
        ({"scale": [1, 0, 1]}, ".scale = [1, 0, 1]: a scale must not be 0"),
        ({"scale": "2"}, '.scale = "2": must be a number or 3 numbers'),
        ({"scale": [1, 2]}, ".scale = [1, 2]: must be 3 numbers"),
        ({"rotate": 30, "axis": [0, 0, 0]}, ".axis = [0, 0, 0]: a direction must not be (0, 0, 0)"),
        ({"matrix": [[1, 0, 0, 0]]}, ".matrix = [[1, 0, 0, 0]]: must be 3 lists of 4 numbers"),
        (
            {"matrix": [[1, 2, 3, 0], [1, 2, 3, 0], [0, 0, 1, 0]]},
            ".matrix = [[1, 2, 3, 0], [1, 2, 3, 0], [0, 0, 1, 0]]: "
            "a transform must be invertible; this matrix is singular",
        ),
        ({}, " = {}: unknown step; it has one of the keys translate, scale, rotate, matrix"),
        ({"rotat": 3}, ' = {"rotat": 3}: unknown step; it has one of the keys translate, scale, rotate, matrix'),
        (4, " = 4: must be an object {...} with one of the keys translate, scale, rotate, matrix"),
        (
            {"scale": 2, "rotate": 30},
            ".rotate: unknown key; a step has only one of translate, scale, rotate, matrix; write two steps",
        ),
    ],
)
def test_one_wrong_step(tmp_path: Path, step: object, what: str) -> None:
    assert wrong(tmp_path, transform=[{"translate": [0, 0, 0]}, step]) == [f"objects.ball.transform.1{what}"]


COLOUR = 'a colour: a name such as "tomato", "#rrggbb", a number, or 3 numbers (linear Rec. 709, each >= 0)'


@pytest.mark.parametrize(
    ("background", "what"),
    [
        ([1, 2], [f"background = [1, 2]: must be {COLOUR}"]),
        ([1, 2, -1], ["background.2 = -1: must be at least 0"]),
        (
            True,
            [f"background = true: must be {SKIES} or {COLOUR}"],
        ),
        ({"top": [1, 1, 1]}, [f"background: the key 'bottom' is missing; it is {COLOUR}"]),
        (
            {"top": [1, 1, 1], "botom": [1, 1, 1]},
            [
                f"background: the key 'bottom' is missing; it is {COLOUR}",
                "background.botom: unknown key; did you mean 'bottom'? (one of top, bottom)",
            ],
        ),
    ],
)
def test_a_wrong_background_is_judged_by_its_form(tmp_path: Path, background: object, what: list[str]) -> None:
    assert errors(tmp_path, {"background": background}) == what


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ({"film": {"width": 0}}, "film.width = 0: must be greater than 0"),
        ({"film": {"height": 2.5}}, "film.height = 2.5: must be a whole number"),
        ({"film": {"transparent": 1}}, "film.transparent = 1: must be true or false"),
        (
            {"film": 3},
            "film = 3: must be an object {...} with the keys width, height, transparent, filter, region, scale",
        ),
        ({"settings": {"seed": -1}}, "settings.seed = -1: must be at least 0"),
        ({"settings": {"seed": 2**32}}, "settings.seed = 4294967296: must be less than 4294967296"),
        (
            {"settings": {"precision": "dubble"}},
            'settings.precision = "dubble": unknown value; did you mean "double"? (one of single, double)',
        ),
        ({"camera": {"fov": 180}}, "camera.fov = 180: must be less than 180"),
        ({"camera": {"up": [0, 0, 0]}}, "camera.up = [0, 0, 0]: a direction must not be (0, 0, 0)"),
        ({"materials": {"m": {"kd": [1, 1, -0.5]}}}, "materials.m.kd.2 = -0.5: must be at least 0"),
        (
            {"materials": {"m": {"shinines": 3}}},
            f"materials.m.shinines: unknown key; did you mean 'shininess'? (one of {MATERIAL})",
        ),
        (
            {"lights": {"l": {"type": "pont", "position": [0, 0, 0]}}},
            f'lights.l.type = "pont": unknown type; did you mean "point"? (one of {LIGHTS})',
        ),
        ({"lights": {"l": {"position": [0, 0, 0]}}}, f"lights.l: the key 'type' is missing; one of {LIGHTS}"),
        (
            {"lights": {"l": {"type": "point"}}},
            "lights.l: the key 'position' is missing; it is 3 numbers (world units)",
        ),
        (
            {"objects": {"a": {}}, "camera": {}, "lights": {}},
            f"objects.a: the key 'type' is missing; one of {KINDS}",
        ),
        (
            {"objects": {"a.b": {"type": "sphere"}}, "camera": {}, "lights": {}},
            'objects: "a.b" is not a valid name; a name is not empty, has no dot, and has no space at either end',
        ),
        (
            {"materials": {" m": {}}},
            'materials: " m" is not a valid name; a name is not empty, has no dot, and has no space at either end',
        ),
        (
            {"camra": {}},
            "camra: unknown key; did you mean 'camera'? "
            "(one of camera, film, background, ambient, textures, materials, lights, geometries, objects, data, "
            "animation, settings)",
        ),
    ],
)
def test_other_sections(tmp_path: Path, content: dict, what: str) -> None:
    assert errors(tmp_path, content) == [what]


HERE = {"position": [0, 0, 0]}
NAN = float("nan")


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"type": "disk", **HERE, "radius": 0}, ".radius = 0: must be greater than 0"),
        ({"type": "sphere", **HERE, "radius": -1}, ".radius = -1: must be greater than 0"),
        ({"type": "sphere", **HERE, "radius": NAN}, ".radius = NaN: must be finite"),
        (
            {"type": "rectangle", **HERE, "width": [1, 2, 0], "height": [-2, -4, 0]},
            ".height = [-2.0, -4.0, 0.0]: must not be parallel to width: the light would have no area",
        ),
        ({"type": "rectangle", **HERE, "width": [0, 0, 0]}, ".width = [0, 0, 0]: a direction must not be (0, 0, 0)"),
        ({"type": "rectangle", **HERE, "samples": 0}, ".samples = 0: must be greater than 0"),
        ({"type": "disk", **HERE, "samples": 2.5}, ".samples = 2.5: must be a whole number"),
        ({"type": "sphere", **HERE, "samples": 65537}, ".samples = 65537: must be at most 65536"),
        ({"type": "disk", **HERE, "normal": [0, 0, 0]}, ".normal = [0, 0, 0]: a direction must not be (0, 0, 0)"),
        (
            {"type": "disk", **HERE, "Radius": 1},
            ".Radius: unknown key; did you mean 'radius'? "
            "(one of type, intensity, Ia, Id, Is, a, b, c, samples, visible, position, normal, radius)",
        ),
        (
            {"type": "directional", "direction": [0, 1, 0], "b": 1},
            ".b = 1.0: must be 0: a directional light is infinitely far away, so it would not be seen",
        ),
        (
            {"type": "directional", "direction": [0, 1, 0], **HERE},
            ".position: unknown key; one of type, intensity, Ia, Id, Is, a, b, c, direction",
        ),
        ({"type": "directional"}, ": the key 'direction' is missing; it is 3 numbers (any length but 0; normalised)"),
        ({"type": "spot", **HERE, "direction": [0, 1, 0], "angle": 0}, ".angle = 0: must be at least 0.01"),
        ({"type": "spot", **HERE, "direction": [0, 1, 0], "angle": 181}, ".angle = 181: must be at most 180"),
        (
            {"type": "spot", **HERE, "direction": [0, 1, 0], "angle": "30"},
            '.angle = "30": must be a number (degrees from the axis to the edge, from 0.01 to 180)',
        ),
        ({"type": "spot", **HERE, "direction": [0, 1, 0], "exponent": -1}, ".exponent = -1: must be at least 0"),
        (
            {"type": "point", **HERE, "ia": [1, 1, 1]},
            ".ia: unknown key; did you mean 'Ia'? (one of type, intensity, Ia, Id, Is, a, b, c, position)",
        ),
        ({"type": "point", **HERE, "Is": [0, NAN, 0]}, ".Is.1 = NaN: must be finite"),
        ({"type": "point", **HERE, "intensity": [1, 1, 1]}, ".intensity = [1, 1, 1]: must be a number (>= 0)"),
        ({"type": "Spot", **HERE}, f'.type = "Spot": unknown type; did you mean "spot"? (one of {LIGHTS})'),
        ({"type": "area", **HERE}, f'.type = "area": unknown type; one of {LIGHTS}'),
        ({"type": 3, **HERE}, f".type = 3: unknown type; one of {LIGHTS}"),
        ({"type": None, **HERE}, f".type = null: unknown type; one of {LIGHTS}"),
        ({"type": ["spot"], **HERE}, f'.type = ["spot"]: unknown type; one of {LIGHTS}'),
        ({}, f": the key 'type' is missing; one of {LIGHTS}"),
        (3, f" = 3: must be an object {{...}} with a type: one of {LIGHTS}"),
        (None, f" = null: must be an object {{...}} with a type: one of {LIGHTS}"),
    ],
)
def test_one_wrong_light(tmp_path: Path, fields: object, what: str) -> None:
    assert errors(tmp_path, {"lights": {"l": fields}}) == [f"lights.l{what}"]


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"ior": 0}, ".ior = 0: must be at least 0.01"),
        ({"ior": -1.5}, ".ior = -1.5: must be at least 0.01"),
        ({"ior": NAN}, ".ior = NaN: must be finite"),
        ({"ior": [1, 1, 1]}, ".ior = [1, 1, 1]: must be a number (> 0, from 0.01 to 100; air is 1)"),
        ({"dmax": 0}, ".dmax = 0: must be greater than 0"),
        ({"dmax": -2}, ".dmax = -2: must be greater than 0"),
        ({"dmax": float("inf")}, ".dmax = Infinity: must be finite"),
        ({"kt": [0, 0, 1.5]}, ".kt.2 = 1.5: must be at most 1"),
        ({"kr": [-0.5, 0, 0]}, ".kr.0 = -0.5: must be at least 0"),
        ({"kt": 1.5}, ".kt = 1.5: must be at most 1"),
        ({"kt": [0.5]}, f".kt = [0.5]: must be {COLOUR.replace('each >= 0', 'each from 0 to 1')}"),
        ({"kr": [0, NAN, 0]}, ".kr.1 = NaN: must be finite"),
        ({"Kd": [1, 1, 1]}, f".Kd: unknown key; did you mean 'kd'? (one of {MATERIAL})"),
        ({"IOR": 1}, f".IOR: unknown key; did you mean 'ior'? (one of {MATERIAL})"),
        ({"textur": "wood"}, f".textur: unknown key; did you mean 'texture'? (one of {MATERIAL})"),
        ({"texture": 3}, ".texture = 3: must be a string or null"),
        ({"texture": ["wood"]}, '.texture = ["wood"]: must be a string or null'),
        ({"texture": {"type": "checker"}}, '.texture = {"type": "checker"}: must be a string or null'),
        ({"texture": ""}, '.texture = "": a name is not empty, has no dot, and has no space at either end'),
        ({"texture": "wod"}, '.texture = "wod": unknown texture; did you mean "wood"? (one of wood, tiles)'),
        ({"texture": "Tiles"}, '.texture = "Tiles": unknown texture; did you mean "tiles"? (one of wood, tiles)'),
        ({"texture": "default"}, '.texture = "default": unknown texture; one of wood, tiles'),
        (None, f" = null: must be an object {{...}} with the keys {MATERIAL}"),
    ],
)
def test_one_wrong_material(tmp_path: Path, fields: object, what: str) -> None:
    known = {"wood": {"type": "image", "file": "wood.png"}, "tiles": {"type": "checker"}}
    assert errors(tmp_path, {"textures": known, "materials": {"m": fields}}) == [f"materials.m{what}"]


def test_a_material_may_have_no_texture_and_a_scene_no_textures(tmp_path: Path) -> None:
    assert load(write(tmp_path, {"materials": {"m": {"texture": None}}})).materials == {"m": Material()}
    assert errors(tmp_path, {"materials": {"m": {"texture": "wood"}}}) == [
        'materials.m.texture = "wood": unknown texture; there is none'
    ]


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"type": "image"}, ": the key 'file' is missing; it is a string"),
        ({"type": "image", "file": ""}, '.file = "": must not be empty'),
        ({"type": "image", "file": 3}, ".file = 3: must be a string"),
        (
            {"type": "image", "file": "a.png", "filter": "linear"},
            '.filter = "linear": unknown value; did you mean "bilinear"? (one of nearest, bilinear)',
        ),
        (
            {"type": "image", "file": "a.png", "wrap": ["repeat", "tile"]},
            '.wrap.1 = "tile": unknown value; one of repeat, clamp, mirror',
        ),
        (
            {"type": "image", "file": "a.png", "wrap": ["repeat"]},
            '.wrap = ["repeat"]: must be a list of 2 of repeat, clamp, mirror',
        ),
        (
            {"type": "image", "file": "a.png", "wrap": 3},
            ".wrap = 3: must be one of repeat, clamp, mirror or a list of 2 of repeat, clamp, mirror",
        ),
        (
            {"type": "image", "file": "a.png", "wrap": "tile"},
            '.wrap = "tile": unknown value; one of repeat, clamp, mirror',
        ),
        (
            {"type": "image", "file": "a.png", "encoding": "sRGB"},
            '.encoding = "sRGB": unknown value; did you mean "srgb"? (one of auto, srgb, linear)',
        ),
        ({"type": "checker", "a": [1, 1, -1]}, ".a.2 = -1: must be at least 0"),
        ({"type": "checker", "offset": [1, NAN]}, ".offset.1 = NaN: must be finite"),
        ({"type": "checker", "file": "a.png"}, ".file: unknown key; one of type, scale, offset, a, b"),
        ({"type": "cheker"}, f'.type = "cheker": unknown type; did you mean "checker"? (one of {TEXTURES})'),
        ({"file": "a.png"}, f": the key 'type' is missing; one of {TEXTURES}"),
        (3, f" = 3: must be an object {{...}} with a type: one of {TEXTURES}"),
    ],
)
def test_one_wrong_texture(tmp_path: Path, fields: object, what: str) -> None:
    # That a material names the texture is no second error: the name is there.
    content = {"textures": {"t": fields}, "materials": {"m": {"texture": "t"}}}
    assert errors(tmp_path, content) == [f"textures.t{what}"]


def test_textures_that_are_no_object_make_no_names_unknown(tmp_path: Path) -> None:
    content = {"textures": [], "materials": {"m": {"texture": "wood"}}}
    assert errors(tmp_path, content) == ["textures = []: must be an object {...} that holds entries by name"]


@pytest.mark.parametrize(
    ("settings", "what"),
    [
        ({"depth": 1001}, "depth = 1001: must be at most 1000"),
        ({"depth": -1}, "depth = -1: must be at least 0"),
        ({"depth": NAN}, "depth = NaN: must be a whole number"),
        (
            {"shading": "fong"},
            f'shading = "fong": unknown value; did you mean "phong"? (one of {", ".join(modes.NAMES)})',
        ),
        (
            {"sampler": "halton"},
            'sampler = "halton": unknown value; one of stratified, sobol, independent',
        ),
        (
            {"sampler": None},
            "sampler = null: unknown value; one of stratified, sobol, independent",
        ),
        ({"misses": "black"}, 'misses = "black": unknown value; one of background, ambient'),
        ({"local": "half"}, 'local = "half": unknown value; one of weighted, full'),
        ({"area": "center"}, 'area = "center": unknown value; did you mean "centre"? (one of samples, centre)'),
        (
            {"occlusion": 5},
            "occlusion = 5: must be an object {...} with the keys sky, near, distance, hemisphere, light",
        ),
        (
            {"occlusion": None},
            "occlusion = null: must be an object {...} with the keys sky, near, distance, hemisphere, light",
        ),
        ({"occlusion": {"sky": -1}}, "occlusion.sky = -1: must be at least 0"),
        ({"occlusion": {"near": 65537}}, "occlusion.near = 65537: must be at most 65536"),
        ({"occlusion": {"sky": True}}, "occlusion.sky = true: must be a whole number"),
        ({"occlusion": {"distance": 0}}, "occlusion.distance = 0: must be greater than 0"),
        ({"occlusion": {"distance": NAN}}, "occlusion.distance = NaN: must be finite"),
        (
            {"occlusion": {"hemisphere": "Box"}},
            'occlusion.hemisphere = "Box": unknown value; did you mean "box"? (one of cosine, box)',
        ),
        (
            {"occlusion": {"skye": 1}},
            "occlusion.skye: unknown key; did you mean 'sky'? (one of sky, near, distance, hemisphere, light)",
        ),
        ({"scatter": []}, "scatter = []: must be an object {...} with the keys rays, depth"),
        ({"scatter": {"rays": 0.5}}, "scatter.rays = 0.5: must be a whole number"),
        ({"scatter": {"depth": 1001}}, "scatter.depth = 1001: must be at most 1000"),
    ],
)
def test_one_wrong_setting(tmp_path: Path, settings: dict, what: str) -> None:
    assert errors(tmp_path, {"settings": settings}) == [f"settings.{what}"]


@pytest.mark.parametrize(
    ("camera", "what"),
    [
        ({"aperture": -1}, "aperture = -1: must be at least 0"),
        ({"aperture": NAN}, "aperture = NaN: must be finite"),
        ({"aperture": "1"}, 'aperture = "1": must be a number (world units, >= 0)'),
        ({"focus": -0.5}, "focus = -0.5: must be at least 0"),
        (
            {"Aperture": 1},
            "Aperture: unknown key; did you mean 'aperture'? "
            "(one of type, origin, target, up, shutter, fov, aperture, focus)",
        ),
    ],
)
def test_one_wrong_lens(tmp_path: Path, camera: dict, what: str) -> None:
    assert errors(tmp_path, {"camera": camera}) == [f"camera.{what}"]


@pytest.mark.parametrize(
    ("camera", "what"),
    [
        ({"origin": [1, 2, 3], "target": [1, 2, 3]}, "camera.target = [1.0, 2.0, 3.0]: must differ from origin"),
        (
            {"origin": [0, 5, 0]},
            "camera.up = [0.0, 1.0, 0.0]: must not be parallel to the view direction, target - origin",
        ),
        # In decimals these are parallel; in binary they are so to rounding only.
        (
            {"origin": [0.1, 0.2, 0.3], "target": [0.4, 0.8, 1.2], "up": [-0.7, -1.4, -2.1]},
            "camera.up = [-0.7, -1.4, -2.1]: must not be parallel to the view direction, target - origin",
        ),
        (
            {"up": [1e-200, 0, 0]},
            "camera.up = [1e-200, 0, 0]: a direction must have a component of at least 1e-09",
        ),
    ],
)
def test_cameras_that_see_nothing(tmp_path: Path, camera: dict, what: str) -> None:
    assert errors(tmp_path, {"camera": camera}) == [what]


def test_a_camera_almost_along_up_is_fine(tmp_path: Path) -> None:
    camera = load(write(tmp_path, {"camera": {"origin": [0, 5, 1e-9]}})).camera
    assert camera.origin == (0.0, 5.0, 1e-9)


@pytest.mark.parametrize(
    ("steps", "what"),
    [
        ([Scale(scale=1e-200), Scale(scale=1e-200)], "scale below 1e-09 or reach beyond 1e+09"),
        ([Scale(scale=1e300), Scale(scale=1e300)], "overflow double precision"),
        ([Scale(scale=(1.0, 1.0, 1e-4)), Rotate(rotate=45.0, axis=(1.0, 0.0, 0.0))] * 2, None),
        ([Scale(scale=(1e-8, 1e8, 1.0))], None),
        ([Scale(scale=(1.0, 1.0, 1e5))] * 2, "scale below 1e-09 or reach beyond 1e+09"),
        (
            [Matrix(matrix=((1.0, 1.0, 0.0, 0.0), (1.0, 1.00001, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)))] * 4,
            "have no inverse",
        ),
    ],
)
def test_transforms_that_flatten(steps: list, what: str | None) -> None:
    found = flaws(Scene(objects={"a": Sphere(transform=tuple(steps))}, camera=Camera(), lights={}))
    if what is None:
        assert found == []
    else:
        assert len(found) == 1
        assert found[0].startswith("objects.a.transform = [")
        assert f"the steps together {what}" in found[0]


def test_an_unknown_material_is_named_with_those_there_are(tmp_path: Path) -> None:
    things = {"a": {"type": "sphere", "material": "gld"}, "b": {"type": "sphere", "material": "default"}}
    content = {"materials": {"gold": {}, "red": {}}, "objects": things, "camera": {}, "lights": {}}
    assert errors(tmp_path, content) == [
        'objects.a.material = "gld": unknown material; did you mean "gold"? (one of gold, red, default)'
    ]
    assert wrong(tmp_path, material="rod") == ['objects.ball.material = "rod": unknown material; one of default']
    # A colour in place of a material is answered with where it belongs.
    assert wrong(tmp_path, material="red") == [
        'objects.ball.material = "red": unknown material; write {"color": "red"} under materials, and its name here'
    ]


def test_flaws_of_the_kinds_themselves() -> None:
    things = {
        "box": Box(min=(1.0, 0.0, 0.0), max=(1.0, 1.0, -1.0)),
        "sheet": Rectangle(width=(1.0, 1.0, 0.0), height=(-2.0, -2.0, 0.0)),
        "line": Triangle(a=(0.0, 0.0, 0.0), b=(1.0, 1.0, 1.0), c=(3.0, 3.0, 3.0)),
    }
    assert flaws(Scene(objects=things, camera=Camera(), lights={})) == [
        "objects.box.max = [1.0, 1.0, -1.0]: must be greater than min in x, z",
        "objects.sheet.height = [-2.0, -2.0, 0.0]: must not be parallel to width",
        "objects.line.c = [3.0, 3.0, 3.0]: the corners must not lie on one line",
    ]
    assert flaws(everything()) == []


def test_flaws_of_lights_and_materials_come_before_those_of_objects() -> None:
    scene = Scene(
        materials={"m": Material(texture="wood")},
        lights={
            "sun": DirectionalLight(direction=(0.0, 1.0, 0.0), b=0.5, c=0.25),
            "bar": RectangleLight(position=(0.0, 0.0, 0.0), height=(3.0, 0.0, 0.0)),
        },
        objects={"a": Sphere(material="n")},
        camera=Camera(),
    )
    assert [text.partition(" ")[0] for text in flaws(scene)] == [
        "materials.m.texture",
        "lights.sun.b",
        "lights.sun.c",
        "lights.bar.height",
        "objects.a.material",
    ]


def test_line_breaks_in_names_do_not_break_the_lines(tmp_path: Path) -> None:
    things = {"a\nb": {"type": "sphere", "material": "c\nd"}, "e\nf": {"type": "sphere", "g\nh": 1, "radius": 0}}
    found = errors(tmp_path, {"objects": things, "camera": {}, "lights": {}})
    assert [text.partition(":")[0] for text in found] == [
        "objects.e\\nf.radius = 0",
        "objects.e\\nf.g\\nh",
        'objects.a\\nb.material = "c\\nd"',
    ]


def test_all_errors_of_a_file_come_at_once(tmp_path: Path) -> None:
    content = """{
        "camera": {"origin": [0, 0, 0]},
        "film": {"width": 0},
        "textures": {"wood": {"type": "image"}},
        "materials": {"gold": {"kd": [1, 2]}, "oak": {"texture": "wood"}, "elm": {"texture": "wod"}},
        "lights": {
            "sun": {"type": "directional", "direction": [0, 1, 0], "b": 1},
            "spot": {"type": "spot", "direction": [0, 1, 0]}
        },
        "objects": {
            "a": {"type": "sphere", "radius": -1, "radus": 1},
            "b": {"type": "box", "max": [-1, 1, 1], "material": "gold"},
            "c": {"type": "spher", "type": "spher"},
            "d": {"type": "disk", "material": "silver"}
        }
    }"""
    found = errors(tmp_path, content)
    assert sorted(text.partition(":")[0].partition(" ")[0] for text in found) == [
        "camera.target",
        "film.width",
        "lights.spot",
        "lights.sun.b",
        "materials.elm.texture",
        "materials.gold.kd",
        "objects.a.radius",
        "objects.a.radus",
        "objects.b.max",
        "objects.c.type",
        "objects.c.type",
        "objects.d.material",
        "textures.wood",
    ]


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(["", "sphere", "Gradient", "a.b"])
KEYS = st.sampled_from(["type", "radius", "scale", "top", "material", "texture", "file", "sky", "x"])
VALUES = st.recursive(SCALARS, lambda v: st.lists(v, max_size=4) | st.dictionaries(KEYS, v, max_size=3), max_leaves=6)


def spoilt(tree: object, spoil: Callable[[list], object], value: object) -> object:
    """The tree with `value` at a place that `spoil` chooses."""
    if not isinstance(tree, (dict, list)) or not tree or spoil([False, False, True]):
        return value
    key = spoil(list(tree) if isinstance(tree, dict) else list(range(len(tree))))
    return (
        type(tree)({**tree, key: spoilt(tree[key], spoil, value)})
        if isinstance(tree, dict)
        else [spoilt(v, spoil, value) if i == key else v for i, v in enumerate(tree)]
    )


@given(data=st.data(), value=VALUES)
def test_whatever_stands_in_a_file_is_a_scene_or_an_error_of_one_line(data: st.DataObject, value: object) -> None:
    tree = spoilt(json.loads(dump(everything())), lambda choices: data.draw(st.sampled_from(choices)), value)
    scene, wrong = examined(tree)
    assert (scene is None and wrong) or all("\n" not in text for text in wrong)


def test_checked_validates_a_scene_from_python() -> None:
    scene = Scene(camera=Camera(origin=[0, 1, 5]), objects={"a": Sphere(radius=2)}, lights={})
    assert checked(scene).camera.origin == (0.0, 1.0, 5.0)
    assert isinstance(checked(scene).objects["a"].radius, float)
    assert checked(everything()) == everything()
    bad = Scene(
        camera=unchecked(Camera, fov=0.0, target=(0.0, 1.0, 6.0)),
        lights={"l": unchecked(PointLight, position=(0.0, 0.0, float("nan")))},
        objects={"a": unchecked(Sphere, radius=-1, material="m"), "b": Box(max=(-1.0, 1.0, 1.0)), "c": Camera()},
    )
    with pytest.raises(UserError) as caught:
        checked(bad)
    assert caught.value.lines == (
        "camera.fov = 0.0: must be at least 0.01",
        "lights.l.position.2 = NaN: must be finite",
        "objects.a.radius = -1: must be greater than 0",
        f'objects.c.type = "perspective": unknown type; one of {KINDS}',
        "objects.b.max = [-1.0, 1.0, 1.0]: must be greater than min in x",
    )
    with pytest.raises(UserError, match="not a dict"):
        checked({})


def test_a_setup_file_goes_with_original_scenes_only(tmp_path: Path) -> None:
    path = write(tmp_path, "{}")
    with pytest.raises(UserError) as caught:
        load(path, "setup.json")
    assert caught.value.lines == (
        f"{path}: is not a VisRayTrace scene, and only those take a setup file; leave setup.json out",
    )


def test_the_schema_file_is_current() -> None:
    assert (ROOT / "scenes" / "schema.json").read_text(encoding="utf-8") == json.dumps(schema(), indent=2) + "\n"


def test_the_schema_tells_units_and_what_is_required() -> None:
    made = schema()
    assert list(made)[:2] == ["$schema", "$id"]
    assert made["title"] == "visray scene"
    assert made["additionalProperties"] is False
    assert "$schema" in made["properties"]
    ball = made["$defs"]["Sphere"]
    assert ball["properties"]["radius"] == {
        "default": 1.0,
        "exclusiveMinimum": 0,
        "maximum": 1e9,
        "type": "number",
        "description": "world units, > 0",
    }
    assert ball["description"].startswith(cleandoc(Sphere.__doc__))
    assert ball["required"] == ["type"]
    assert made["$defs"]["Triangle"]["required"] == ["type", "a", "b", "c"]
    assert made["$defs"]["SpotLight"]["required"] == ["type", "position", "direction"]
    assert made["$defs"]["ImageTexture"]["required"] == ["type", "file"]
    assert all(made["properties"][k]["additionalProperties"] is False for k in ("objects", "textures"))
    lights, missing = made["properties"]["lights"]["anyOf"]
    assert (lights["additionalProperties"], missing) == (False, {"type": "null"})


def test_the_schema_tells_what_every_kind_and_every_field_means() -> None:
    made = schema()
    for name, kind in {**made["$defs"], "Scene": made}.items():
        assert kind["description"], name
        for key, field in kind.get("properties", {}).items():
            # A part that is a kind is described there, and a type is its own name.
            assert key in ("type", "$schema") or "$ref" in field or field["description"], f"{name}.{key}"
            assert "title" not in field, f"{name}.{key}"


def test_the_schema_tells_what_the_bases_of_a_kind_bring() -> None:
    lamp = schema()["$defs"]["DiskLight"]
    assert lamp["description"] == "\n\n".join(cleandoc(kind.__doc__) for kind in (DiskLight, AreaLight, Light))
    assert lamp["properties"]["samples"]["description"].endswith("from 1 to 65536")
