"""Files of VisRayTrace (2021-22) and its siblings as scenes. The files that came with it are tested where available.

The table lists VisRayTrace's defects that concern its files or how it read them, and what visray does instead. The
numbers are from our list of its defects, D1 to D37; those not named here lie in its arithmetic, not in files.

| defect of VisRayTrace | visray | test |
|---|---|---|
| D1 the lens is 2 wide, whatever the file says | the file counts, with a warning | test_the_lens |
| D2 MAXDEPTH, background are read, not used | they count; 1 only with compat | test_depth, test_misses |
| D9 `id` and `dmax` random if missing | no id is needed; no attenuation | test_transparent_materials |
| D10 a spot's angle random, its direction unit | 30 degrees, warning; any length | test_spot_lights... |
| D11 small area lights have no samples | one, with a warning | test_area_lights |
| D12 a directional light crashes | it shines | test_directional_lights |
| D13 to D16 boxes without light | boxes; corners in any order | test_objects |
| D17 to D19 meshes lose triangles | no triangle is lost, whatever nBox is | test_meshes |
| D20 a cylinder's axis is ignored | it counts | test_objects |
| D21 pictures slide on spheres off the origin | they do not | test_pictures_on_a_sphere |
| D22 fitted planes level, puntoCentro random | they lean; absolute, warning | test_objects, test_a_fitted_plane... |
| D24, D25 polynomials beyond a light, and missed | as they are, within a ball | test_polynomials_are_clipped... |
| D31 misread monomials | they count as written, with a warning | test_misread_monomials |
| D28 own colour of glass in full | weighted with 1 - kt; full with compat | test_compat |
| D29 glass gizmos lose kt, nut, dmax | they keep them | test_gizmos_keep_their_material (test_legacy_data) |
| D30 no JET; colours beyond the table | jet; the ends | test_colour_maps, test_every_row... (same) |
| D32 two values per file, -1 for none | per row; -1 only with compat | test_every_row..., test_minus_1... (same) |
| D33 the second colour inverts the first | the same | test_every_row... (same) |
| D34 data mirrored on maps | not mirrored; mirrored with compat | test_a_datum_in_the_north_west... (same) |
| D35 gizmos but three crash | box and cone; others an error | test_wrong_properties (same) |
| D36 animation crashes | objects move | test_legacy_animation |
| D37 invalid JSON | an error with line and column | test_shipped_pairs_that_are_refused |
| D37 "lookAt:" | read, with a warning | test_spellings_that_slipped... |
| D37 a picture in another folder | found, with a warning | test_pictures_elsewhere |
"""

import json
import os
from itertools import product
from math import asin, atan2, cos, pi, radians, sin
from pathlib import Path

import pytest
from drjit.scalar import Array3f64

from visray.camera import Camera
from visray.cli import main
from visray.errors import UserError
from visray.lights import DirectionalLight, PointLight, RectangleLight, SpotLight
from visray.materials import Material
from visray.polynomials import exact_terms
from visray.primitives import Box, Cylinder, Mesh, Plane, Polynomial, Rectangle, Sphere, Triangle
from visray.primitives.clips import Ball
from visray.primitives.primitive import scalars
from visray.quantities import FARTHEST
from visray.scene.legacy.convert import LegacyWarning, convert
from visray.scene.load import load
from visray.scene.scene import Film, Occlusion, Scene, Settings, SkyGradient
from visray.textures import ImageTexture

SHIPPED = Path(__file__).resolve().parents[2] / "shared" / "seed-scenes"
shipped = pytest.mark.skipif(not SHIPPED.is_dir(), reason="VisRayTrace's own files are not available")

CAMERA = {"lookFrom": [0, 1, 5], "lookAt": [0, 0, 0], "vup": [0, 1, 0], "vfov": 40, "aspectRatio": 2, "pixelsX": 100}
MATT = {"type": "lambertian", "ka": [0.1, 0.1, 0.1], "kd": [0.5, 0.5, 0.5], "ks": [0.2, 0.2, 0.2], "shininess": 10}
BALL = {"name": "ball", "type": "sphere", "center": [1, 2, 3], "radius": 0.5, "material": MATT}


class Pair:
    """A scene file and a setup file in a folder, from what differs from the simplest of each."""

    def __init__(self, folder: Path):
        self.scene, self.setup = folder / "scene.json", folder / "setup.json"

    def write(self, *objects: object, setup: object = None, **scene: object) -> None:
        whole = {"scene": "test", "typeScene": "VIRTUALWORLD", "objects": list(objects)} | scene
        self.scene.write_text(json.dumps({k: v for k, v in whole.items() if v is not None}), encoding="utf-8")
        self.setup.write_text(json.dumps({"camera": CAMERA} if setup is None else setup), encoding="utf-8")

    def convert(
        self, *objects: object, setup: object = None, compat: bool = False, **scene: object
    ) -> tuple[Scene, list[str]]:
        self.write(*objects, setup=setup, **scene)
        loaded, warnings = convert(self.scene, self.setup, compat)
        return loaded, [self.short(text) for text in warnings]

    def errors(self, *objects: object, setup: object = None, **scene: object) -> list[str]:
        self.write(*objects, setup=setup, **scene)
        with pytest.raises(UserError) as caught:
            convert(self.scene, self.setup)
        return [self.short(text) for text in caught.value.lines]

    def short(self, text: str) -> str:
        assert "\n" not in text
        text = text.replace(str(self.scene), "scene").replace(str(self.setup), "setup")
        return text.replace(str(self.scene.parent), "FOLDER")


@pytest.fixture
def pair(tmp_path: Path) -> Pair:
    return Pair(tmp_path)


def thing(pair: Pair, **fields: object) -> object:
    """The object that one JSON object becomes, without its material."""
    loaded, warnings = pair.convert({"name": "x", "material": MATT} | fields)
    assert warnings == []
    assert loaded.objects["x"].material == "x"
    return loaded.objects["x"]


def test_a_pair_of_files(pair: Pair) -> None:
    light = {
        "type": "pointLight",
        "position": [2, 8, 10],
        "Ia": [0.3, 0.3, 0.3],
        "Id": [0.7, 0.6, 0.5],
        "Is": [1, 1, 1],
    }
    setup = {
        "renderType": "IMAGE",
        "output": "out.ppm",
        "camera": CAMERA,
        "globalLight": [0.1, 0.2, 0.3],
        "lights": [light | {"a": 0.5, "b": 0.25, "c": 0.01}],
        "background": True,
        "MAXDEPTH": 4,
        "colorTopBackground": [0.5, 0.7, 1],
        "colorDownBackground": [1, 1, 1],
        "numSamples": 9,
    }
    loaded, warnings = pair.convert(BALL, setup=setup)
    assert warnings == []
    assert loaded.camera == Camera(origin=(0.0, 1.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=40.0)
    assert loaded.film == Film(width=100, height=50)
    assert loaded.ambient == (0.1, 0.2, 0.3)
    assert loaded.background == SkyGradient(top=(0.5, 0.7, 1.0), bottom=(1.0, 1.0, 1.0))
    assert loaded.settings == Settings(spp=9, depth=3)
    assert loaded.lights == {
        "light 1": PointLight(
            position=(2.0, 8.0, 10.0), Ia=(0.3, 0.3, 0.3), Id=(0.7, 0.6, 0.5), Is=(1.0, 1.0, 1.0), a=0.5, b=0.25, c=0.01
        )
    }
    assert loaded.objects == {"ball": Sphere(center=(1.0, 2.0, 3.0), radius=0.5, material="ball")}
    matt = Material(ka=(0.1, 0.1, 0.1), kd=(0.5, 0.5, 0.5), ks=(0.2, 0.2, 0.2), shininess=10.0)
    assert loaded.materials == {"ball": matt}


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"type": "SPHERE", "radious": 2}, Sphere(radius=2.0)),
        (
            {"type": "plane", "point": [0, 0, -1], "normal": [0, 2, 0]},
            Plane(point=(0.0, 0.0, -1.0), normal=(0.0, 2.0, 0.0)),
        ),
        ({"type": "triangle"}, Triangle(a=(-1.0, -1.0, 0.0), b=(1.0, -1.0, 0.0), c=(0.0, 2.0, 0.0))),
        (
            {"type": "triangle", "p1": [0, 0, 0], "v2": [1, 0, 0], "c": [0, 1, 0]},
            Triangle(a=(0.0, 0.0, 0.0), b=(1.0, 0.0, 0.0), c=(0.0, 1.0, 0.0)),
        ),
        ({"type": "Cylinder"}, Cylinder(radius=0.1, height=4.0)),
        (
            {"type": "cylinder", "center": [1, 2, 3], "radious": 0.5, "h": 2, "axis": [1, 0, 0]},
            Cylinder(center=(1.0, 2.0, 3.0), radius=0.5, height=2.0, axis=(1.0, 0.0, 0.0)),
        ),
        ({"type": "cylinder", "radius": 0.5, "height": 3}, Cylinder(radius=0.5, height=3.0)),
        ({"type": "BOX"}, Box()),
        (
            {"type": "box", "minPoint": [3, 0, 3], "maxPoint": [0, 1, 0]},
            Box(min=(0.0, 0.0, 0.0), max=(3.0, 1.0, 3.0)),
        ),
        (
            {"type": "box", "punt_min": [0, 0, 0], "punt_max": [1, 2, 3]},
            Box(min=(0.0, 0.0, 0.0), max=(1.0, 2.0, 3.0)),
        ),
        # Absolute bounds, relative ones, and a normal that points down.
        (
            {"type": "FITTEDPLANE", "point": [1, 2, 3], "normal": [0, 3, 0], "pmin": [-4, -6], "pmax": [4, 2]}
            | {"puntoCentro": False},
            Rectangle(center=(0.0, 2.0, -2.0), width=(8.0, 0.0, 0.0), height=(0.0, 0.0, -8.0)),
        ),
        (
            {"type": "fittedplane", "point": [1, 2, 3], "normal": [0, 1, 0], "pmin": [-4, -6], "pmax": [4, 2]}
            | {"puntoCentro": True},
            Rectangle(center=(1.0, 2.0, 1.0), width=(8.0, 0.0, 0.0), height=(0.0, 0.0, -8.0)),
        ),
        (
            {"type": "fittedplane", "normal": [0, -1, 0], "pmin": [1, 1], "pmax": [-1, -1]},
            Rectangle(center=(0.0, 0.0, 0.0), width=(2.0, 0.0, 0.0), height=(0.0, 0.0, 2.0)),
        ),
        # Leaning: the part of the plane over the same square.
        (
            {"type": "fittedplane", "normal": [-1, 1, -2], "pmin": [0, 0], "pmax": [2, 4]},
            Rectangle(center=(1.0, 5.0, 2.0), width=(2.0, 2.0, 0.0), height=(0.0, -8.0, -4.0)),
        ),
    ],
)
def test_objects(pair: Pair, fields: dict, expected: object) -> None:
    loaded = thing(pair, **fields)
    assert loaded == type(expected)(**{**vars(expected), "material": "x"})


def test_a_fitted_plane_has_the_normal_of_the_file(pair: Pair) -> None:
    for normal in ([0, 1, 0], [0, -1, 0], [0.5, 1, -0.25], [0.5, -1, -0.25]):
        plane = thing(pair, type="fittedplane", normal=normal, pmin=[-1, -2], pmax=[3, 4])
        (ax, ay, az), (bx, by, bz) = plane.width, plane.height
        cross = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        ratio = cross[1] / normal[1]
        assert ratio > 0
        assert cross == pytest.approx([ratio * n for n in normal])


def ball(name: str = "ball", **material: object) -> dict:
    return BALL | {"name": name, "material": MATT | material}


def test_materials(pair: Pair) -> None:
    loaded, warnings = pair.convert(
        # Keys that only other types have are silently ignored, as in VisRayTrace.
        ball("matt", kt=[0.5, 0, 0], nut=-1, opacity=1, dmax=0, id=3),
        ball("mirror", type="METAL", ks=[0.9, 0.8, 0.7], kt=[1, 1, 1], nut=0.0),
        ball("twin"),
        setup={"camera": CAMERA, "MAXDEPTH": 3},
    )
    assert warnings == []
    # Equal materials become one, with the name of the first object.
    assert {name: o.material for name, o in loaded.objects.items()} == {
        "matt": "matt",
        "mirror": "mirror",
        "twin": "matt",
    }
    matt = {"ka": (0.1, 0.1, 0.1), "kd": (0.5, 0.5, 0.5), "shininess": 10.0}
    assert loaded.materials == {
        "matt": Material(**matt, ks=(0.2, 0.2, 0.2)),
        "mirror": Material(**matt, ks=(0.9, 0.8, 0.7), kr=(0.9, 0.8, 0.7)),
    }


def test_transparent_materials(pair: Pair) -> None:
    loaded, warnings = pair.convert(
        ball("glass", type="Transparent", kt=[1, 0.5, 0], nut=1.5, dmax=2, id=0),
        ball("other glass", type="transparent", kt=[1, 0.5, 0], nut=1.5, dmax=2, id=1),
        ball("air", type="transparent", dmax=1e30),
        setup={"camera": CAMERA, "MAXDEPTH": 2},
    )
    assert warnings == []
    assert list(loaded.materials) == ["glass", "air"]
    glass, air = loaded.materials.values()
    assert (glass.kt, glass.ior, glass.dmax, glass.kr) == ((1.0, 0.5, 0.0), 1.5, 2.0, (0.0,) * 3)
    assert (air.kt, air.ior, air.dmax) == ((0.0,) * 3, 1.000293, FARTHEST)


def test_shares_beyond_1_are_brought_there(pair: Pair) -> None:
    loaded, warnings = pair.convert(
        ball("mirror", type="metal", ks=[1.5, 1, 0]),
        ball("glass", type="transparent", kt=[1.5, -1, 0.5]),
        setup={"camera": CAMERA, "MAXDEPTH": 2},
    )
    mirror, glass = loaded.materials.values()
    assert (mirror.ks, mirror.kr, glass.kt) == ((1.5, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.5))
    assert warnings == [
        "scene: objects.mirror.material.ks = [1.5, 1.0, 0.0]: a mirror reflects at most 1; its highlights keep ks",
        "scene: objects.glass.material.kt = [1.5, -1.0, 0.5]: a surface lets through from 0 to 1; the nearest is used",
    ]


def test_a_setup_switches_effects_of_materials_off(pair: Pair) -> None:
    objects = (
        ball("mirror", type="metal"),
        ball("glass", type="transparent", kt=[1, 1, 1], kd=[1, 0, 0], nut=-1, dmax=-1),
        ball("globe", type="materialtextura", kd=[0, 1, 0], textureFile="://resources/none.png"),
    )
    switches = {"reflections": False, "refractions": False, "textures": False}
    loaded, warnings = pair.convert(*objects, setup={"camera": CAMERA} | switches)
    assert warnings == []
    assert loaded.textures == {}
    assert [(m.kr, m.kt, m.texture, m.kd) for m in loaded.materials.values()] == [
        ((0.0,) * 3, (0.0,) * 3, None, kd) for kd in ((0.5,) * 3, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    ]


def picture(folder: Path, name: str) -> Path:
    """A file where a picture could be; no test here looks into it."""
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    return file


def globe(asked: object, name: str = "globe") -> dict:
    return ball(name, type="MaterialTextura", textureFile=asked)


@pytest.mark.parametrize("asked", ["://resources/{}", ":/resources/{}", ":///resources/{}", "://{}", "{}", "./{}"])
@pytest.mark.parametrize(
    ("scene", "there", "inner"),
    [
        ("scene.json", "map.png", "map.png"),
        ("scene.json", "earth/map.png", "earth/map.png"),
        # A scene in a sub-folder of the resources.
        ("earth/scene.json", "earth/map.png", "earth/map.png"),
        ("earth/scene.json", "map.png", "map.png"),
        ("earth/scene.json", "stars/map.png", "stars/map.png"),
    ],
)
def test_pictures(tmp_path: Path, asked: str, scene: str, there: str, inner: str) -> None:
    file = picture(tmp_path, there)
    pair = Pair(picture(tmp_path, scene).parent)
    loaded, warnings = pair.convert(globe(asked.format(inner)))
    assert warnings == []
    assert loaded.textures == {
        "map": ImageTexture(file=str(file), filter="nearest", wrap="clamp"),
    }
    assert loaded.materials["globe"].texture == "map"
    # The original's rule is that a texture leaves ka as it is.
    rules = {compat: pair.convert(globe(asked.format(inner)), compat=compat)[0] for compat in (False, True)}
    assert {compat: s.materials["globe"].textured for compat, s in rules.items()} == {False: "ka and kd", True: "kd"}


@pytest.mark.parametrize(
    ("scene", "there"),
    [
        # Beside the scene, in a folder beside it, in one beside the scene's folder.
        ("data/scene.json", "data/map.png"),
        ("scene.json", "earth/map.png"),
        ("data/scene.json", "earth/map.png"),
    ],
)
def test_pictures_elsewhere(tmp_path: Path, scene: str, there: str) -> None:
    file = picture(tmp_path, there)
    pair = Pair(picture(tmp_path, scene).parent)
    for asked in ("://resources/deep/map.png", "C:\\tmp\\map.png", "/nowhere/map.png"):
        loaded, warnings = pair.convert(globe(asked))
        assert [t.file for t in loaded.textures.values()] == [str(file)]
        assert warnings == [
            f"scene: objects.globe.material.textureFile = {json.dumps(asked)}: is not there; "
            f"{str(file).replace(str(pair.scene.parent), 'FOLDER')} is used"
        ]


def test_pictures_of_a_scene_named_from_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(picture(tmp_path, "earth/map.png").parent)
    pair = Pair(Path("."))
    for asked in ("map.png", "earth/map.png"):
        assert pair.convert(globe(f"://resources/{asked}"))[0].textures["map"].file in ("map.png", "../earth/map.png")


def test_a_picture_is_one_texture_with_a_name_of_its_own(pair: Pair) -> None:
    folder = pair.scene.parent
    for name in ("a/map.v2.png", "b/map.v2.png", " .png"):
        picture(folder, name)
    asked = ("a/map.v2.png", "b/map.v2.png", "a/../a/map.v2.png", " .png")
    loaded, warnings = pair.convert(*(globe(f"://resources/{name}", name=f"globe {i}") for i, name in enumerate(asked)))
    assert warnings == []
    assert {name: Path(t.file).relative_to(folder).as_posix() for name, t in loaded.textures.items()} == {
        "map_v2": "a/map.v2.png",
        "map_v2 2": "b/map.v2.png",
        "picture": " .png",
    }
    textures = {name: loaded.materials[thing.material].texture for name, thing in loaded.objects.items()}
    assert list(textures.values()) == ["map_v2", "map_v2 2", "map_v2", "picture"]


@pytest.mark.parametrize("asked", ["://resources/none.png", "", "://resources/", "\u0000", "x" * 5000])
def test_a_picture_that_is_not_there_is_an_error(pair: Pair, asked: str) -> None:
    (text,) = pair.errors(globe(asked))
    assert text.startswith("scene: objects.globe.material.textureFile = ")
    relative = os.path.normpath(asked.removeprefix("://resources/").replace("\0", "\\x00"))
    tried = os.path.normpath(f"FOLDER/{relative}"), os.path.normpath(pair.scene.parents[1] / relative)
    what = f"there is no such picture; tried {tried[0]} and {tried[1]}, and the sub-folders of both folders"
    assert text.endswith(f": {what}")


def test_a_texture_without_a_file_is_black(pair: Pair) -> None:
    loaded, warnings = pair.convert(ball(type="materialtextura"))
    assert (loaded.materials["ball"].kd, loaded.textures) == ((0.0,) * 3, {})
    assert warnings == ["scene: objects.ball.material.textureFile: is missing; kd is black, as in VisRayTrace"]


POLYNOMIAL = {"name": "p", "type": "polynomial", "monomis": ["x2", "-1"], "material": MATT}
BOUND = "scene: objects.p.monomis: only the part within {} of the origin is drawn; VisRayTrace had no such bound"


def surface(pair: Pair, *monomis: object) -> tuple[Polynomial, list[str]]:
    """The polynomial of these monomials, and what is warnings of it besides that it is bounded."""
    loaded, warnings = pair.convert(POLYNOMIAL | {"monomis": list(monomis)})
    assert warnings[-1] == BOUND.format("10.2")
    return loaded.objects["p"], warnings[:-1]


def same(monomis: list[str], expression: str) -> bool:
    return exact_terms(monomis) == exact_terms(expression)


def test_a_polynomial(pair: Pair) -> None:
    sample = ("0.9x2", "z2", "y4", "y3", "-3y2", "-1")
    found, warnings = surface(pair, *sample)
    assert found == Polynomial(monomis=sample, clip=Ball(radius=2 * 26**0.5), material="p")
    assert (found.ends, warnings) == ("open", [])
    assert same(found.monomis, "0.9*x^2 + z^2 + y^4 + y^3 - 3*y^2 - 1")


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("xyz", "x*y*z"),
        ("x2y3", "x^2*y^3"),
        ("-x", "-x"),
        ("2.25", "2.25"),
        ("xx", "x^2"),
        ("x^2", "x^2"),
        ("-12x", "-12*x"),
    ],
)
def test_monomials_that_visraytrace_read_correctly(pair: Pair, written: str, meant: str) -> None:
    found, warnings = surface(pair, written, "z5")
    assert (found.monomis, warnings) == ((written, "z5"), [])
    assert same(found.monomis, f"{meant} + z^5")


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("+3x2", "3*x^2"),
        (".5x2", "x^2/2"),
        ("x12", "x^12"),
        ("2*x", "2*x"),
        ("xx2", "x^3"),
        ("x2yx", "x^3*y"),
        ("1e-3x", "x/1000"),
        ("Y2", "y^2"),
        ("2 x", "2*x"),
    ],
)
def test_misread_monomials(pair: Pair, written: str, meant: str) -> None:
    found, warnings = surface(pair, "z5", written)
    text = "is read as it is written; VisRayTrace misread it"
    assert warnings == [f"scene: objects.p.monomis.1 = {json.dumps(written)}: {text}"]
    assert same(found.monomis, f"{meant} + z^5")


def test_without_monomials_it_is_a_hyperboloid(pair: Pair) -> None:
    found, warnings = surface(pair)
    assert found.monomis == ("x2", "y2", "-z2", "-1")
    assert warnings == ["scene: objects.p.monomis: is empty; x2 + y2 - z2 - 1 is used"]
    loaded, warnings = pair.convert({k: v for k, v in POLYNOMIAL.items() if k != "monomis"})
    assert loaded.objects["p"] == found
    assert warnings == [
        "scene: objects.p.monomis: is missing; x2 + y2 - z2 - 1 is used",
        BOUND.format("10.2"),
    ]


def test_monomials_that_are_none_are_errors(pair: Pair) -> None:
    found = pair.errors(POLYNOMIAL | {"monomis": ["x2", 1, "y2", None]})
    assert found == [
        'scene: objects.p.monomis.1 = 1: must be a string such as "-0.5x2y"',
        'scene: objects.p.monomis.3 = null: must be a string such as "-0.5x2y"',
    ]
    assert pair.errors(POLYNOMIAL | {"monomis": "x2"}) == ['scene: objects.p.monomis = "x2": must be a list [...]']
    for written in ("-", "", "x2 + y2", "a2", "3"):
        (text,) = pair.errors(POLYNOMIAL | {"monomis": [written]})
        assert text.startswith("scene: objects.p.monomis")


@pytest.mark.parametrize(
    ("eye", "radius"), [([3, 0, 4], 10), ([0, 0, 0.5], 5), ([10, 2, 3], 2 * 113**0.5), ([8e8, 0, 0], 1e9)]
)
def test_polynomials_are_clipped_twice_as_far_as_the_camera(pair: Pair, eye: list[float], radius: float) -> None:
    loaded, warnings = pair.convert(POLYNOMIAL, setup={"camera": CAMERA | {"lookFrom": eye}})
    assert loaded.objects["p"].clip == Ball(radius=radius)
    assert warnings == [BOUND.format(f"{radius:.4g}")]


@pytest.mark.parametrize("normal", [[0, 1, 0], [0, -1, 0], [0.5, 1, -0.25], [0.5, -1, -0.25]])
def test_pictures_on_a_fitted_plane(pair: Pair, normal: list[float]) -> None:
    """u and v as in VisRayTrace: row 0 of the picture, our v = 1, at the least z, whichever side the normal is on."""
    picture(pair.scene.parent, "map.png")
    plane = {"type": "fittedplane", "normal": normal, "pmin": [-1, -2], "pmax": [3, 4]}
    loaded, _ = pair.convert(globe("map.png") | plane)
    thing = loaded.objects["globe"]
    placed = scalars(thing).placed(None)
    for x, z in product((-1, -0.5, 2, 3), (-2, 0, 1.5, 4)):
        y = -(normal[0] * x + normal[2] * z) / normal[1]
        u, row = (x - -1) / (3 - -1), (z - -2) / (4 - -2)
        assert Rectangle.uv(placed, Array3f64(x, y, z)) == pytest.approx((u, 1 - row), abs=1e-12)


def test_pictures_on_a_sphere(pair: Pair) -> None:
    """u and v as in VisRayTrace for a sphere at the origin, row 0 at the north pole."""
    picture(pair.scene.parent, "map.png")
    loaded, _ = pair.convert(globe("map.png") | {"center": [0, 0, 0], "radius": 2})
    placed = scalars(loaded.objects["globe"]).placed(None)
    for longitude, latitude in product((-170, -90, -1, 0, 45, 90, 179), (-89, -30, 0, 1, 60, 89)):
        a, b = radians(longitude), radians(latitude)
        x, y, z = 2 * cos(b) * cos(a), 2 * sin(b), 2 * cos(b) * sin(a)
        u, row = 0.5 - atan2(z / 2, x / 2) / (2 * pi), asin(-y / 2) / pi + 0.5
        assert Sphere.uv(placed, Array3f64(x, y, z)) == pytest.approx((u, 1 - row), abs=1e-12)


def test_absent_material_fields_are_those_of_visraytrace(pair: Pair) -> None:
    bare = Material(ka=(1.0, 1.0, 1.0), kd=(1.0, 1.0, 1.0), ks=(1.0, 1.0, 1.0), shininess=1.0)
    loaded, warnings = pair.convert(BALL | {"material": {}})
    assert loaded.materials == {"ball": bare}
    assert warnings == []
    loaded, warnings = pair.convert({k: v for k, v in BALL.items() if k != "material"})
    assert loaded.materials == {"ball": bare}
    assert warnings == [
        "scene: objects.ball: has no material; ka, kd, ks are 1 and shininess is 1, as in VisRayTrace",
    ]


def test_names_become_valid_and_unique(pair: Pair) -> None:
    nameless = {k: v for k, v in BALL.items() if k != "name"}
    loaded, warnings = pair.convert(
        BALL, BALL, BALL | {"name": "ball 2"}, BALL | {"name": "a.b "}, BALL | {"name": ""}, nameless
    )
    assert list(loaded.objects) == ["ball", "ball 2", "ball 2 2", "a_b", "sphere", "sphere 2"]
    assert warnings == [
        "scene: objects.1.name = \"ball\": the object is called 'ball 2' in visray",
        "scene: objects.2.name = \"ball 2\": the object is called 'ball 2 2' in visray",
        "scene: objects.3.name = \"a.b \": the object is called 'a_b' in visray",
        "scene: objects.4.name = \"\": the object is called 'sphere' in visray",
        "scene: objects.5.name = \"\": the object is called 'sphere 2' in visray",
    ]


@pytest.mark.parametrize("kind", ["VIRTUALWORLD", "VIRTUAL", "virtual", "ONLINE", "VirtualWorld"])
def test_virtual_worlds(pair: Pair, kind: str) -> None:
    loaded, warnings = pair.convert(BALL, typeScene=kind)
    assert (list(loaded.objects), warnings) == (["ball"], [])


def test_a_missing_type_of_scene_is_inferred(pair: Pair) -> None:
    loaded, warnings = pair.convert(BALL, typeScene=None)
    assert (list(loaded.objects), warnings) == (["ball"], ["scene: typeScene: is missing; VIRTUALWORLD is used"])
    for key in ("properties", "attributes"):
        assert pair.errors(typeScene=None, objects=None, **{key: []}) == [
            f"scene: {key}: there are none, and no base; properties are a list of {{...}} with data"
        ]


# A pyramid with a square base, as VisRayTrace could not read it: a polygon of four corners, and negative indices.
PYRAMID = """mtllib none.mtl
v -1 0 -1
v 1 0 -1
v 1 0 1
v -1 0 1
v 0 2 0
f 1 2 3 4
f 2 1 5
f 3 2 5
f 4 3 5
f -5 4 5
"""
POT = {"name": "pot", "type": "MESH", "objFileName": "://resources/pot.obj", "nBox": 3.0, "material": MATT}
SMOOTH = "edges that bend by at most 40 degrees look smooth; VisRayTrace and --compat draw flat triangles"
BOXES = "changes only the speed of VisRayTrace; visray chooses by itself how rays find triangles"


@pytest.mark.parametrize("asked", ["://resources/pot.obj", "pot.obj", "./pot.obj"])
@pytest.mark.parametrize("kind", ["MESH", "mesh", "Mesh"])
def test_meshes(pair: Pair, asked: str, kind: str) -> None:
    file = pair.scene.parent / "pot.obj"
    file.write_text(PYRAMID)
    pot = POT | {"type": kind, "objFileName": asked}
    loaded, warnings = pair.convert(pot, pot | {"name": "other", "nBox": 10})
    assert loaded.objects["pot"] == Mesh(file=str(file), material="pot")
    assert loaded.objects["pot"].row_count() == 6 and loaded.objects["pot"].closed
    assert warnings == [f"scene: objects.pot.nBox = 3.0: {BOXES}", f"scene: objects.pot.objFileName: {SMOOTH}"]
    compat, warnings = pair.convert(pot, compat=True)
    assert compat.objects["pot"] == Mesh(file=str(file), normals="face", material="pot")
    assert warnings == [f"scene: objects.pot.nBox = 3.0: {BOXES}"]


def test_meshes_are_imported_with_paths_relative_to_the_new_file(pair: Pair) -> None:
    pair.write(POT)
    (pair.scene.parent / "pot.obj").write_text(PYRAMID)
    target = pair.scene.parent / "native" / "pot.json"
    target.parent.mkdir()
    assert main(["import", str(pair.scene), "--setup", str(pair.setup), "-o", str(target)]) == 0
    assert json.loads(target.read_text())["objects"]["pot"]["file"] == "../pot.obj"
    assert load(target, allow_outside=True).objects["pot"].row_count() == 6


def test_a_mesh_in_another_folder_is_found_with_a_warning(pair: Pair) -> None:
    (pair.scene.parent / "models").mkdir()
    (pair.scene.parent / "models" / "pot.obj").write_text(PYRAMID)
    _, warnings = pair.convert(POT, compat=True)
    assert warnings[1:] == [
        'scene: objects.pot.objFileName = "://resources/pot.obj": is not there; FOLDER/models/pot.obj is used'
    ]


def test_wrong_meshes(pair: Pair) -> None:
    above = pair.scene.parents[1]
    gone = POT | {"objFileName": "://resources/gone.obj"}
    assert pair.errors(gone, POT | {"name": "none", "objFileName": None}, {"type": "mesh", "material": MATT}) == [
        'scene: objects.pot.objFileName = "://resources/gone.obj": there is no such mesh file; '
        f"tried FOLDER/gone.obj and {above}/gone.obj, and the sub-folders of both folders",
        "scene: objects.none.objFileName: the key is missing; it is the path of a mesh file",
        "scene: objects.mesh.objFileName: the key is missing; it is the path of a mesh file",
    ]
    (pair.scene.parent / "pot.obj").write_text("v 0 0 0\nf 1 1 2\n")
    (text,) = pair.errors(POT)
    assert text.startswith('scene: objects.pot.objFileName = "FOLDER/pot.obj": ')


def test_what_is_unknown_and_what_is_wrong_is_named_at_once(pair: Pair) -> None:
    found = pair.errors(BALL | {"radius": 0}, BALL | {"type": "torus"}, typeScene="VIRTUALWORLD")
    assert found[1:] == ["scene: objects.ball.radius = 0.0: must be greater than 0"] and "unknown type" in found[0]


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"type": "spere"}, 'objects.ball.type = "spere": unknown type; did you mean "sphere"? '),
        ({"type": 3}, "objects.ball.type = 3: unknown type; one of sphere, plane, "),
        ({"type": None}, "objects.ball: the key 'type' is missing; one of sphere, plane, "),
        ({"radius": None}, "objects.ball.radius: the key is missing; it is a number"),
        ({"radius": -1}, "objects.ball.radius = -1.0: must be greater than 0"),
        ({"center": [0, float("nan"), 0]}, "objects.ball.center = [0, NaN, 0]: must be finite"),
        (
            {"material": MATT | {"type": "glass"}},
            'objects.ball.material.type = "glass": unknown type; one of lambertian, metal, transparent, ',
        ),
        ({"material": MATT | {"kd": [1, -1, 0]}}, "objects.ball.material.kd.1 = -1.0: must be at least 0"),
        ({"material": MATT | {"type": "metal", "ks": [-1, 0, 0]}}, "objects.ball.material.ks.0 = -1.0: must be at "),
        (
            {"material": MATT | {"type": "transparent", "nut": 0.0}},
            "objects.ball.material.nut = 0.0: must be at least 0.01",
        ),
        ({"material": MATT | {"type": "transparent", "nut": 1e6}}, "objects.ball.material.nut = 1000000.0: must be at"),
        ({"material": MATT | {"type": "transparent", "dmax": 0}}, "objects.ball.material.dmax = 0.0: must be greater"),
        (
            {"material": MATT | {"shininess": float("inf")}},
            "objects.ball.material.shininess = Infinity: must be finite",
        ),
        ({"type": "plane"}, "objects.ball.normal: the key is missing; it is 3 numbers"),
        (
            {"type": "plane", "normal": [0, 0, 0]},
            "objects.ball.normal = [0.0, 0.0, 0.0]: a direction must not be (0, 0, 0)",
        ),
        (
            {"type": "fittedplane", "normal": [0, 1, 0], "pmin": [0, 0]},
            "objects.ball.pmax: the key is missing; it is 2",
        ),
        (
            {"type": "fittedplane", "normal": [0, 1, 0], "pmin": [0, 0], "pmax": [1, 0]},
            "objects.ball.pmax = [1, 0]: must differ from pmin in x and in z",
        ),
        (
            {"type": "fittedplane", "normal": [1, 0, 0], "pmin": [0, 0], "pmax": [1, 1]},
            "objects.ball.normal = [1, 0, 0]: a fittedplane is bounded in x and z",
        ),
        (
            {"type": "box", "minPoint": [0, 0, 0], "maxPoint": [1, 0, 1]},
            "objects.ball.maxPoint = [1.0, 0.0, 1.0]: must be great",
        ),
        ({"type": "cylinder", "h": 0}, "objects.ball.h = 0.0: must be greater than 0"),
        (
            {"type": "triangle", "p1": [0, 0, 0], "v2": [1, 0, 0], "p3": [2, 0, 0]},
            "objects.ball.p3 = [2.0, 0.0, 0.0]: ",
        ),
        ({"radius": 1e300}, "objects.ball.radius = 1e+300: must be at most 1e+09"),
    ],
)
def test_wrong_objects(pair: Pair, fields: dict, what: str) -> None:
    spelt = {k: v for k, v in (BALL | fields).items() if v is not None}
    known = ("name", "type", "material", *(fields if fields.get("type") else spelt))
    found = pair.errors({k: v for k, v in spelt.items() if k in known})
    assert len(found) == 1
    assert found[0].startswith(f"scene: {what}")


@pytest.mark.parametrize(
    ("setup", "what"),
    [
        ({"camera": CAMERA | {"vfov": 180}}, "camera.vfov = 180.0: must be less than 180"),
        ({"camera": CAMERA | {"lookAt": [0, 1, 5]}}, "camera.lookAt = [0.0, 1.0, 5.0]: must differ from origin"),
        ({"camera": CAMERA | {"vup": [0, 0, 0]}}, "camera.vup = [0.0, 0.0, 0.0]: a direction must not be (0, 0, 0)"),
        (
            {"camera": CAMERA | {"vup": [0, 1, 5]}},
            "camera.vup = [0.0, 1.0, 5.0]: must not be parallel to the view direction",
        ),
        ({"camera": CAMERA | {"pixelsX": 0}}, "camera.pixelsX = 0: must be at least 1"),
        (
            {"camera": CAMERA | {"aspectRatio": 0}},
            "camera.aspectRatio = 0: must be greater than 0; it is width / height",
        ),
        ({"camera": CAMERA | {"aspectRatio": 101}}, "camera.pixelsX / camera.aspectRatio = 0: must be greater than 0"),
        ({"camera": CAMERA, "numSamples": 0}, "numSamples = 0: must be greater than 0"),
        ({"camera": CAMERA, "globalLight": [-1, 0, 0]}, "globalLight.0 = -1.0: must be at least 0"),
        ({"camera": CAMERA, "colorTopBackground": [0, -1, 0]}, "colorTopBackground.1 = -1.0: must be at least 0"),
        ({"camera": CAMERA, "lights": {}}, "lights = {}: must be a list [...]"),
        ({"camera": CAMERA, "lights": [3]}, "lights.0 = 3: must be an object {...}"),
        (
            {"camera": CAMERA, "lights": [{"type": "pointLight", "position": [0, 0, 0], "a": -1}]},
            "lights.0.a = -1.0: must be at least 0",
        ),
        (
            {"camera": CAMERA, "lights": [{"type": "pointLight"}]},
            "lights.0.position: the key is missing; it is 3 numbers",
        ),
        (
            {"camera": CAMERA | {"defocusBlur": {"enabled": True, "aperture": -1}}},
            "camera.defocusBlur.aperture = -1.0: must be at least 0",
        ),
        (
            {"camera": CAMERA, "ambientOcclusion": {"enabled": True, "raysLocal": -1}},
            "ambientOcclusion.raysLocal = -1: ",
        ),
        (
            {"camera": CAMERA, "ambientOcclusion": {"enabled": True, "maxDistance": 0}},
            "ambientOcclusion.maxDistance = 0.0: must be greater than 0",
        ),
        (
            {"camera": CAMERA, "lights": [{"type": "pointLihgt", "position": [0, 0, 0]}]},
            'lights.0.type = "pointLihgt": unknown type; did you mean "pointLight"? '
            "(one of pointLight, spotLight, areaLight, directionalLight)",
        ),
        (
            {"camera": CAMERA, "shading": "Gouraud"},
            'shading = "Gouraud": unknown shading; one of BlinnPhong, Phong, Cel, ',
        ),
        ([], "[]: is not a setup; a setup is an object {...}"),
    ],
)
def test_wrong_setups(pair: Pair, setup: object, what: str) -> None:
    found = pair.errors(BALL, setup=setup)
    assert [text[: len(f"setup: {what}")] for text in found] == [f"setup: {what}"]


def test_the_type_of_scene_must_be_known(pair: Pair) -> None:
    assert pair.errors(BALL, typeScene="VRTUAL") == [
        'scene: typeScene = "VRTUAL": unknown typeScene; '
        'did you mean "VIRTUAL"? (one of VIRTUAL, ONLINE, REALDATA, TEMPORAL)'
    ]
    assert pair.errors(objects=None) == ["scene: objects: the key is missing; it is the list of the scene's objects"]
    assert pair.errors(objects={}) == ["scene: objects = {}: must be a list [...]"]
    assert pair.errors(3) == ["scene: objects.0 = 3: must be an object {...}"]


def test_spellings_that_slipped_are_read_with_a_warning(pair: Pair) -> None:
    camera = {k: v for k, v in CAMERA.items() if k != "lookAt"} | {"lookAt:": [0, 0, -1]}
    loaded, warnings = pair.convert(BALL | {"Radius ": 3}, setup={"camera": camera, "GlobalLight": [1, 1, 1]})
    assert loaded.camera.target == (0.0, 0.0, -1.0)
    assert loaded.ambient == (1.0, 1.0, 1.0)
    assert loaded.objects["ball"].radius == 0.5
    assert warnings == [
        "scene: objects.ball.Radius : ignored; 'radius' says the same",
        "setup: key: 'GlobalLight' is read as 'globalLight'; VisRayTrace ignored it",
        "setup: camera: 'lookAt:' is read as 'lookAt'; VisRayTrace ignored it",
    ]


def test_what_is_ignored_is_reported(pair: Pair) -> None:
    light = {"type": "pointLight", "position": [0, 5, 0, 9], "width": [1, 0, 0], "height": [0, 1, 0], "Id": "white"}
    setup = {
        "camera": CAMERA | {"zoom": 3, "pixelsX": "wide"},
        "lights": [light],
        "renderType": "temporal",
        "ambientOcclusion": True,
    }
    loaded, warnings = pair.convert(BALL | {"colour": 3, "center": [1]}, setup=setup)
    assert loaded.objects["ball"].center == (1.0, 0.0, 0.0)
    assert loaded.film.width == 400
    assert loaded.lights["light 1"] == PointLight(position=(0.0, 5.0, 0.0), Id=(0.0, 0.0, 0.0), Is=(0.0, 0.0, 0.0))
    assert warnings == [
        "scene: objects.ball.colour: unknown key, ignored; one of name, type, material, data, animation, center, "
        "radius",
        "scene: objects.ball.center = [1]: must be 3 numbers; missing ones are 0",
        'setup: renderType = "temporal": nothing moves in the scene; it is one picture',
        "setup: camera.zoom: unknown key, ignored; one of lookFrom, lookAt, vup, vfov, aspectRatio, pixelsX, "
        "defocusBlur, aperture",
        'setup: camera.pixelsX = "wide": ignored; must be a number',
        "setup: lights.0: has a width and a height, which belong to an areaLight; it is a pointLight without them",
        'setup: lights.0.Id = "white": ignored; must be 3 numbers',
        "setup: lights.0.position = [0, 5, 0, 9]: must be 3 numbers; further ones are ignored",
        "setup: ambientOcclusion = true: ignored; must be an object {...}",
    ]


@pytest.mark.parametrize(
    ("setup", "shadows"),
    [
        ({}, True),
        ({"shading": "BlinnPhongShadow"}, True),
        ({"shading": "blinnphong"}, False),
        ({"shading": "BlinnPhong", "shadows": True}, True),
        ({"shading": "BlinnPhongShadow", "shadows": False}, False),
        ({"shadows": False, "reflections": True, "refractions": False, "textures": True}, False),
    ],
)
def test_shadows(pair: Pair, setup: dict, shadows: bool) -> None:
    loaded, warnings = pair.convert(BALL, setup={"camera": CAMERA} | setup)
    assert loaded.settings.shadows is shadows
    silent = shadows or "shadows" in setup
    assert warnings == (
        [] if silent else ['setup: shading = "BlinnPhong": has no shadows; write BlinnPhongShadow to have them']
    )


@pytest.mark.parametrize(
    ("camera", "aperture", "warning"),
    [
        ({}, 0.0, None),
        ({"aperture": 3}, 0.0, None),
        ({"defocusBlur": {}}, 0.0, None),
        ({"defocusBlur": {"aperture": 3}}, 0.0, None),
        ({"defocusBlur": {"enabled": False, "aperture": 3}}, 0.0, None),
        ({"defocusBlur": {"enabled": True, "aperture": 0.5}, "aperture": 3}, 0.5, None),
        ({"defocusBlur": {"enabled": True}, "aperture": 3}, 3.0, None),
        ({"defocusBlur": {"enabled": True, "aperture": 2}}, 2.0, None),
        ({"defocusBlur": {"enabled": True, "aperture": 3}}, 3.0, " = 3.0: counts in visray; VisRayTrace always used 2"),
        ({"defocusBlur": {"enabled": True}}, 2.0, ": is missing; 2 is used, as always in VisRayTrace"),
    ],
)
def test_the_lens(pair: Pair, camera: dict, aperture: float, warning: str | None) -> None:
    loaded, warnings = pair.convert(BALL, setup={"camera": CAMERA | camera})
    assert (loaded.camera.aperture, loaded.camera.focus) == (aperture, 0.0)
    assert warnings == ([] if warning is None else [f"setup: camera.defocusBlur.aperture{warning}"])


MIRROR, GLASS = ball(type="metal"), ball(type="transparent", kt=[1, 1, 1])
FOLLOWED = "16 reflections and refractions are followed (none with --set settings.depth=0)"


@pytest.mark.parametrize(
    ("thing", "setup", "depth", "compat_depth", "warning"),
    [
        (BALL, {}, 16, 0, None),
        (BALL, {"MAXDEPTH": 1}, 16, 0, None),
        (BALL, {"MAXDEPTH": 4}, 3, 3, None),
        (MIRROR, {}, 16, 0, f"MAXDEPTH: is missing; {FOLLOWED}"),
        (MIRROR, {"MAXDEPTH": 1}, 16, 0, f"MAXDEPTH = 1: did not count in VisRayTrace; {FOLLOWED}"),
        (GLASS, {"MAXDEPTH": -3}, 16, 0, f"MAXDEPTH = -3: did not count in VisRayTrace; {FOLLOWED}"),
        (GLASS, {"MAXDEPTH": 2}, 1, 1, None),
        (MIRROR, {"reflections": False}, 16, 0, None),
        (GLASS, {"refractions": False}, 16, 0, None),
        (GLASS, {"MAXDEPTH": 1001}, 1000, 1000, None),
    ],
)
def test_depth(pair: Pair, thing: dict, setup: dict, depth: int, compat_depth: int, warning: str | None) -> None:
    setup = {"camera": CAMERA} | setup
    loaded, warnings = pair.convert(thing, setup=setup)
    assert loaded.settings.depth == depth
    assert warnings == ([] if warning is None else [f"setup: {warning}"])
    loaded, warnings = pair.convert(thing, setup=setup, compat=True)
    assert (loaded.settings.depth, warnings) == (compat_depth, [])


def test_depths_beyond_the_deepest(pair: Pair) -> None:
    for compat in (False, True):
        loaded, warnings = pair.convert(MIRROR, setup={"camera": CAMERA, "MAXDEPTH": 5000}, compat=compat)
        assert loaded.settings.depth == 1000
        assert warnings == ["setup: MAXDEPTH = 5000: must be at most 1001, which is used"]


@pytest.mark.parametrize(
    ("setup", "misses"),
    [({}, "background"), ({"background": True}, "background"), ({"background": False}, "ambient")],
)
def test_misses(pair: Pair, setup: dict, misses: str) -> None:
    loaded, warnings = pair.convert(BALL, setup={"camera": CAMERA} | setup)
    assert (loaded.settings.misses, warnings) == (misses, [])


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ({}, Occlusion()),
        ({"enabled": False, "raysGlobal": 5}, Occlusion()),
        ({"raysGlobal": 5}, Occlusion()),
        ({"enabled": True}, Occlusion(sky=20, near=20, distance=100.0)),
        (
            {"enabled": True, "raysGlobal": 0, "raysLocal": 7, "maxDistance": 3},
            Occlusion(sky=0, near=7, distance=3.0),
        ),
    ],
)
def test_ambient_occlusion(pair: Pair, written: dict, expected: Occlusion) -> None:
    loaded, warnings = pair.convert(BALL, setup={"camera": CAMERA, "ambientOcclusion": written})
    assert (loaded.settings.occlusion, warnings) == (expected, [])


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("BlinnPhong", "blinn-phong"),
        ("phong", "phong"),
        ("Cel", "toon"),
        ("TOON", "toon"),
        ("Normal", "normal"),
        ("Depth", "depth"),
        ("Color", "albedo"),
    ],
)
def test_shading(pair: Pair, written: str, expected: str) -> None:
    loaded, warnings = pair.convert(BALL, setup={"camera": CAMERA, "shading": f"{written}Shadow"})
    assert (loaded.settings.shading, loaded.settings.shadows, warnings) == (expected, True, [])
    loaded, warnings = pair.convert(BALL, setup={"camera": CAMERA, "shading": written})
    assert (loaded.settings.shading, loaded.settings.shadows) == (expected, False)
    # Where nothing is lit, no shadow is missed.
    assert len(warnings) == (expected in ("blinn-phong", "phong", "toon"))


def test_compat(pair: Pair) -> None:
    setup = {"camera": CAMERA, "ambientOcclusion": {"enabled": True}, "MAXDEPTH": 1}
    plain, _ = pair.convert(GLASS, setup=setup)
    loaded, warnings = pair.convert(GLASS, setup=setup, compat=True)
    assert warnings == []
    assert loaded.settings == Settings(
        depth=0,
        area="centre",
        local="full",
        occlusion=Occlusion(sky=20, near=20, distance=100.0, hemisphere="box"),
    )
    # Nothing else is different.
    assert vars(loaded) | {"settings": None} == vars(plain) | {"settings": None}
    loaded, _ = pair.convert(GLASS, setup={"camera": CAMERA}, compat=True)
    assert loaded.settings.occlusion == Occlusion()


def test_an_empty_setup_has_the_defaults_of_visraytrace(pair: Pair) -> None:
    loaded, warnings = pair.convert(BALL, setup={})
    assert loaded.camera == Camera(origin=(0.0, 0.0, 10.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=90.0)
    assert loaded.film == Film(width=400, height=400)
    assert (loaded.background, loaded.ambient, loaded.lights) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), {})
    assert warnings == [
        "setup: camera: is missing; it looks from (0, 0, 10) to the origin, 90 degrees wide, 400 x 400 pixels"
    ]
    loaded, warnings = pair.convert(BALL, setup={"camera": {"lookFrom": [0, 0, 3]}, "colorDownBackground": [1, 1, 1]})
    assert loaded.camera == Camera(origin=(0.0, 0.0, 3.0), up=(0.0, 1.0, 0.0), fov=90.0)
    assert loaded.background == SkyGradient(top=(0.0, 0.0, 0.0), bottom=(1.0, 1.0, 1.0))
    assert warnings == [
        "setup: camera.vup: is missing; (0, 1, 0) is used",
        "setup: camera.vfov: is missing; 90 degrees is used, since VisRayTrace's 180 gives no picture",
    ]


COLOURS = {"Ia": [0.1, 0.2, 0.3], "Id": [0.4, 0.5, 0.6], "Is": [0.7, 0.8, 0.9]}
OURS = {key: tuple(colour) for key, colour in COLOURS.items()}


def lit(pair: Pair, **light: object) -> tuple[object, list[str]]:
    """A light of a setup, and the warnings about it."""
    loaded, warnings = pair.convert(BALL, setup={"camera": CAMERA, "lights": [COLOURS | light]})
    return loaded.lights["light 1"], warnings


def unlit(pair: Pair, **light: object) -> list[str]:
    return pair.errors(BALL, setup={"camera": CAMERA, "lights": [light]})


SPOT = {"type": "spotLight", "position": [-2, 10, 0], "direction": [0, -2, 0], "a": 0.5, "b": 0.25, "c": 0.01}


@pytest.mark.parametrize(
    ("width", "angle"),
    [
        ({"angle": radians(10)}, 10.0),
        ({"angle": pi}, 180.0),
        ({"angle": 3.1416}, 180.0),
        ({"theta": 10}, 10.0),
        ({"cosineCutoff": 0.5}, 60.0),
        ({"cosineCutoff": -1}, 180.0),
    ],
)
def test_spot_lights(pair: Pair, width: dict, angle: float) -> None:
    light, warnings = lit(pair, **SPOT, **width)
    position, direction = (-2.0, 10.0, 0.0), (0.0, -2.0, 0.0)
    assert warnings == []
    assert light.angle == pytest.approx(angle, rel=1e-14)
    assert light == SpotLight(
        **OURS, position=position, direction=direction, angle=light.angle, exponent=0.0, a=0.5, b=0.25, c=0.01
    )


def test_spot_lights_that_need_a_word(pair: Pair) -> None:
    assert lit(pair, **SPOT)[0].angle == 30.0
    assert lit(pair, **SPOT)[1] == ["setup: lights.0.angle: is missing; 30 degrees from the axis to the edge are used"]
    light, warnings = lit(pair, **SPOT, angle=0.5, theta=10, cosineCutoff=0.5, exponent=2)
    assert (light.angle, light.exponent) == (pytest.approx(28.6478897565), 2.0)
    assert warnings == [
        "setup: lights.0.exponent = 2.0: in visray the light falls to 0 at the edge of the cone",
        "setup: lights.0.theta: ignored; 'angle' says how wide the light is",
        "setup: lights.0.cosineCutoff: ignored; 'angle' says how wide the light is",
    ]


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"angle": 10}, "lights.0.angle = 10: must be from 0.000175 to pi; it is half of the cone's angle, in radians"),
        ({"angle": 3.15}, "lights.0.angle = 3.15: must be from 0.000175 to pi; "),
        ({"angle": 0}, "lights.0.angle = 0: must be from 0.000175 to pi; "),
        ({"angle": float("nan")}, "lights.0.angle = NaN: must be finite"),
        ({"theta": 181}, "lights.0.theta = 181: must be from 0.01 to 180; "),
        ({"theta": -1}, "lights.0.theta = -1: must be from 0.01 to 180; "),
        ({"cosineCutoff": 1}, "lights.0.cosineCutoff = 1: must be from -1 to below 1; "),
        ({"cosineCutoff": 2}, "lights.0.cosineCutoff = 2: must be from -1 to below 1; "),
        ({"theta": 9, "direction": None}, "lights.0.direction: the key is missing; it is 3 numbers"),
        ({"theta": 9, "direction": [0, 0, 0]}, "lights.0.direction = [0.0, 0.0, 0.0]: a direction must not be "),
        ({"theta": 9, "exponent": -1}, "lights.0.exponent = -1.0: must be at least 0"),
        ({"theta": 9, "Is": [0, -1, 0]}, "lights.0.Is.1 = -1.0: must be at least 0"),
    ],
)
def test_wrong_spot_lights(pair: Pair, fields: dict, what: str) -> None:
    light = {k: v for k, v in (SPOT | fields).items() if v is not None}
    assert [text[: len(f"setup: {what}")] for text in unlit(pair, **light)] == [f"setup: {what}"]


AREA = {"type": "AREALIGHT", "position": [0, 9, 0], "width": [0, 0, 2], "height": [2, 0, 0]}


def test_area_lights(pair: Pair) -> None:
    light, warnings = lit(pair, **AREA, a=1)
    assert warnings == []
    assert light == RectangleLight(
        **OURS, position=(0.0, 9.0, 0.0), width=(0.0, 0.0, 2.0), height=(2.0, 0.0, 0.0), samples=20, a=1.0
    )
    assert lit(pair, **AREA, numLights=3)[0].samples == 3
    assert lit(pair, **AREA | {"height": [0.39, 0, 0]})[0].samples == 3
    small, warnings = lit(pair, **AREA | {"height": [0.09, 0, 0]})
    assert small.samples == 1
    assert warnings == [
        "setup: lights.0.numLights: VisRayTrace took 0 samples of so small an area, and divided by 0; 1 is taken"
    ]
    large, warnings = lit(pair, **AREA | {"height": [1e6, 0, 0]})
    assert large.samples == 2**16
    assert warnings == [
        "setup: lights.0.numLights: VisRayTrace took 1e+07 samples of so large an area; 65536 are taken"
    ]


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"width": None}, "lights.0.width: the key is missing; it is 3 numbers"),
        ({"height": None}, "lights.0.height: the key is missing; it is 3 numbers"),
        ({"position": None}, "lights.0.position: the key is missing; it is 3 numbers"),
        ({"width": [0, 0, 0]}, "lights.0.width = [0.0, 0.0, 0.0]: a direction must not be (0, 0, 0)"),
        ({"height": [0, 0, -3]}, "lights.0.height = [0.0, 0.0, -3.0]: must not be parallel to width"),
        ({"height": [1e200, 0, 0]}, "lights.0.height.0 = 1e+200: must be at most 1e+09"),
        ({"numLights": 0}, "lights.0.numLights = 0: must be greater than 0"),
        ({"numLights": 1e9}, "lights.0.numLights = 1000000000: must be at most 65536"),
    ],
)
def test_wrong_area_lights(pair: Pair, fields: dict, what: str) -> None:
    light = {k: v for k, v in (AREA | fields).items() if v is not None}
    assert [text[: len(f"setup: {what}")] for text in unlit(pair, **light)] == [f"setup: {what}"]


def test_directional_lights(pair: Pair) -> None:
    light, warnings = lit(pair, type="DirectionalLight", direction=[0, -3, 1], a=0.5)
    assert warnings == []
    assert light == DirectionalLight(**OURS, direction=(0.0, -3.0, 1.0), a=0.5)
    light, warnings = lit(pair, type="directionalLight", direction=[0, -3, 1], b=-1, c=2, intensity=0.5)
    assert light == DirectionalLight(**OURS, direction=(0.0, -3.0, 1.0), intensity=0.5)
    assert warnings == [
        f"setup: lights.0.{key}: ignored; a directional light is infinitely far away" for key in ("b = -1", "c = 2")
    ]
    (text,) = unlit(pair, type="directionalLight", position=[1, 1, 1])
    assert text == "setup: lights.0.direction: the key is missing; it is 3 numbers"
    (text,) = unlit(pair, type="directionalLight", direction=[0, 0, 0])
    assert text.startswith("setup: lights.0.direction = [0.0, 0.0, 0.0]: a direction must not be (0, 0, 0)")


def test_a_light_without_a_type_is_a_point_light(pair: Pair) -> None:
    loaded, warnings = pair.convert(
        BALL, setup={"camera": CAMERA, "lights": [{"position": [1, 2, 3], "Id": [1, 1, 1]}]}
    )
    assert loaded.lights["light 1"].position == (1.0, 2.0, 3.0)
    assert warnings == ["setup: lights.0: has no type; a pointLight is used, as in VisRayTrace"]


def test_a_fitted_plane_without_punto_centro_says_how_it_is_read(pair: Pair) -> None:
    plane = BALL | {"type": "fittedplane", "point": [1, 0, 0], "normal": [0, 1, 0], "pmin": [-1, -1], "pmax": [1, 1]}
    loaded, warnings = pair.convert({k: v for k, v in plane.items() if k not in ("center", "radius")})
    assert loaded.objects["ball"].center == (0.0, 0.0, 0.0)
    assert warnings == ["scene: objects.ball.puntoCentro: is missing; pmin and pmax are read as absolute x and z"]


ODD = [
    None,
    True,
    -1,
    0,
    1e300,
    float("nan"),
    float("-inf"),
    10**400,
    "",
    "no\nsense",
    [],
    [[]],
    ["x"],
    [1],
    {},
    {"a": {}},
]


@pytest.mark.parametrize("odd", ODD, ids=[str(i) for i in range(len(ODD))])
@pytest.mark.slow
def test_odd_values_anywhere_give_a_scene_or_lines(pair: Pair, odd: object) -> None:
    """Each key of a pair of files in turn says something odd."""
    picture(pair.scene.parent, "map.png")
    objects = [
        GLASS | {"material": GLASS["material"] | {"nut": 1.5, "dmax": 1, "id": 0}},
        globe("map.png") | {"type": "fittedplane", "normal": [0, 1, 0], "pmin": [0, 0], "pmax": [1, 1]},
        {"type": "box", "minPoint": [0, 0, 0], "maxPoint": [1, 1, 1], "material": MIRROR["material"]},
    ]
    camera = CAMERA | {"defocusBlur": {"enabled": True, "aperture": 1}, "aperture": 2}
    occlusion = {"enabled": True, "raysGlobal": 1, "raysLocal": 1, "maxDistance": 1}
    lights = [SPOT | {"angle": 1}, SPOT | {"cosineCutoff": 0.5, "exponent": 1}, AREA, AREA | {"numLights": 2}]
    lights += [{"type": "directionalLight", "direction": [0, 1, 0], "intensity": 1, "b": 1}]
    setup = {"camera": camera, "ambientOcclusion": occlusion, "lights": lights, "MAXDEPTH": 3, "shading": "Phong"}
    setup |= {"reflections": True, "refractions": True, "textures": True, "shadows": True, "numSamples": 4}
    whole = {"typeScene": "VIRTUAL", "objects": objects} | {"setup": setup}
    count = 0
    for changed in _with_each_value_replaced(whole, odd):
        count += 1
        scene = {k: v for k, v in changed.items() if k != "setup"}
        pair.scene.write_text(json.dumps(scene), encoding="utf-8")
        pair.setup.write_text(json.dumps(changed["setup"]), encoding="utf-8")
        try:
            _, warnings = convert(pair.scene, pair.setup)
        except UserError as error:
            warnings = error.lines
        assert all(pair.short(text).startswith(("scene: ", "setup: ")) for text in warnings)
    assert count > 100


def _with_each_value_replaced(tree: object, odd: object) -> list:
    """Copies of a tree, each with one of its values replaced."""
    keys = tree.keys() if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ()
    copies = []
    for key in keys:
        for value in [odd, *_with_each_value_replaced(tree[key], odd)]:
            copy = tree.copy()
            copy[key] = value
            copies.append(copy)
    return copies


def test_both_files_are_read_before_errors_are_reported(pair: Pair) -> None:
    pair.scene.write_text('{"typeScene": "VIRTUAL",\n "objects": [}', encoding="utf-8")
    pair.setup.write_text("", encoding="utf-8")
    with pytest.raises(UserError) as caught:
        convert(pair.scene, pair.setup)
    assert [pair.short(text) for text in caught.value.lines] == [
        "scene: line 2, column 14: is not JSON: expecting value",
        "setup: the file is empty; it must hold at least {}",
    ]


def test_swapped_files_are_recognised(pair: Pair) -> None:
    pair.write(BALL)
    with pytest.raises(UserError) as caught:
        load(pair.setup, pair.scene)
    assert [pair.short(text) for text in caught.value.lines] == [
        "setup: is a setup file; the file with the objects comes first, and the setup after it",
        "scene: is a scene file; a setup has a camera and lights",
    ]
    with pytest.raises(UserError, match="is a setup file"):
        load(pair.setup)


def test_the_last_of_two_like_keys_counts(pair: Pair) -> None:
    pair.write(BALL)
    text = f'{{"camera": {json.dumps(CAMERA)}, "numSamples": 3, "numSamples": 5}}'
    pair.setup.write_text(text, encoding="utf-8")
    loaded, warnings = convert(pair.scene, pair.setup)
    assert loaded.settings.spp == 5
    assert [pair.short(text) for text in warnings] == [
        "setup: numSamples: the key is written twice; the last one counts"
    ]


def test_load_recognises_legacy_scenes_and_warns(pair: Pair) -> None:
    pair.write(BALL)
    assert load(pair.scene, pair.setup) == convert(pair.scene, pair.setup)[0]
    with pytest.warns(LegacyWarning, match="no setup file: no lights, a black background, and a camera"):
        alone = load(pair.scene)
    assert (list(alone.objects), alone.camera.fov, alone.film) == (["ball"], 90.0, Film(width=400, height=400))


def shipped_pair(scene: str, setup: str | None) -> tuple[Scene, list[str]]:
    loaded, warnings = convert(SHIPPED / scene, setup and SHIPPED / setup)
    return loaded, [text.replace(f"{SHIPPED}/", "") for text in warnings]


@shipped
def test_the_two_spheres() -> None:
    loaded, warnings = shipped_pair("twoSpheres.json", "setupRenderTwoSpheres.json")
    assert warnings == [f"setupRenderTwoSpheres.json: MAXDEPTH = 1: did not count in VisRayTrace; {FOLLOWED}"]
    assert loaded.settings == Settings()
    metal = loaded.materials["Esfera mitjana"]
    assert metal.kr == metal.ks == (0.7, 0.7, 0.7)
    assert loaded.camera == Camera(origin=(13.0, 2.0, 3.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=20.0)
    assert loaded.film == Film(width=1200, height=600)
    assert loaded.ambient == (0.1, 0.1, 0.1)
    assert loaded.background == SkyGradient(top=(0.5, 0.7, 1.0), bottom=(1.0, 1.0, 1.0))
    assert loaded.lights["light 1"] == PointLight(
        position=(2.0, 8.0, 10.0), Ia=(0.3,) * 3, Id=(0.3,) * 3, Is=(0.7,) * 3, a=0.5, b=0.0, c=0.01
    )
    assert loaded.objects["Esfera gran"] == Sphere(center=(0.0, -100.5, -1.0), radius=100.0, material="Esfera gran")
    assert loaded.materials["Esfera gran"] == Material(
        ka=(0.2, 0.2, 0.2), kd=(0.8, 0.8, 0.0), ks=(1.0, 1.0, 1.0), shininess=10.0
    )
    assert list(loaded.objects) == ["Esfera petita", "Esfera gran", "Esfera mitjana"]


@shipped
def test_the_box() -> None:
    loaded, warnings = shipped_pair("oneBox.json", "setupRenderOneBox.json")
    assert warnings == []
    assert loaded.objects == {
        "One Box": Box(min=(0.0, 0.0, 0.0), max=(3.0, 3.0, 3.0), material="One Box"),
        "plano": Rectangle(center=(0.0, 0.0, -1.0), width=(20.0, 0.0, 0.0), height=(0.0, 0.0, -20.0), material="plano"),
    }
    assert loaded.film == Film(width=1400, height=790)


@shipped
def test_the_cylinder() -> None:
    loaded, warnings = shipped_pair("oneCylinder.json", "setupRenderOneCylinder.json")
    assert warnings == ["setupRenderOneCylinder.json: camera: 'lookAt:' is read as 'lookAt'; VisRayTrace ignored it"]
    cylinder = Cylinder(center=(0.0, -1.0, -1.0), radius=0.5, height=0.5, axis=(0.0, 1.0, 0.0), material="One Cilynder")
    assert loaded.objects == {"One Cilynder": cylinder}
    assert loaded.lights == {}
    assert loaded.ambient == (0.0, 0.0, 0.0)
    assert loaded.camera.target == (0.0, 0.0, -1.0)
    assert loaded.film == Film(width=400, height=225)


@shipped
def test_the_transparent_spheres_with_the_setup_of_the_tests() -> None:
    loaded, warnings = shipped_pair("transparentSpheres.json", "setupTests.json")
    assert warnings == [f"setupTests.json: MAXDEPTH = 1: did not count in VisRayTrace; {FOLLOWED}"]
    assert [(m.ior, m.dmax) for m in loaded.materials.values()][:4] == [
        (ior, FARTHEST) for ior in (1.0003, 1.0003, 1.3333, 1.48)
    ]
    assert loaded.materials["Esfera aigua"].kt == (1.0, 1.0, 1.0)
    assert loaded.materials["Esfera gran"].kr == (1.0, 1.0, 1.0)
    assert loaded.background == SkyGradient(top=(0.0, 0.8, 0.8), bottom=(1.0, 1.0, 1.0))


@shipped
def test_the_teapot() -> None:
    loaded, warnings = shipped_pair("teapot.json", "setupRenderTeapot.json")
    assert warnings == [
        f"teapot.json: objects.Br Objecte.nBox = 3.0: {BOXES}",
        f"teapot.json: objects.Br Objecte.objFileName: {SMOOTH}",
    ]
    pot = loaded.objects["Br Objecte"]
    assert pot == Mesh(file=str(SHIPPED / "teapot2.obj"), material="Br Objecte")
    assert (pot.row_count(), pot.closed, loaded.film) == (6320, False, Film(width=1200, height=600))
    assert loaded.materials["Br Objecte"].kd == (0.7, 0.6, 0.5)


@shipped
def test_the_spot_light() -> None:
    loaded, warnings = shipped_pair("coneLight.json", "setupConeLight.json")
    assert warnings == []
    (light,) = loaded.lights.values()
    assert (light.direction, light.angle) == ((0.0, -1.0, 0.0), pytest.approx(10.0, abs=1e-4))


@shipped
@pytest.mark.parametrize(("scene", "name"), [("earth/earth.json", "earth1"), ("earth/stars.json", "stars")])
def test_the_pictures(scene: str, name: str) -> None:
    loaded, warnings = shipped_pair(scene, "earth/setupEarth.json")
    assert warnings == []
    assert {key: Path(t.file) for key, t in loaded.textures.items()} == {name: SHIPPED / f"earth/{name}.png"}


@shipped
@pytest.mark.parametrize(
    ("scene", "setup", "count", "warnings"),
    [
        ("ambientOcclusion.json", "setupAmbientOcclusion.json", 6, 0),
        ("cornell_box_geometry.json", "cornell_box_config_vis.json", 11, 0),
        ("defocusBlur.json", "setupDefocusBlur.json", 7, 1),
        ("penombres.json", "setupPenombres.json", 2, 1),
        ("transparencies.json", "setupTransparencies.json", 3, 1),
        ("earth/stars.json", None, 1, 1),
        ("coneLight.json", "setupTests.json", 2, 0),
        ("tests.json", "setupPoly.json", 1, 1),
    ],
)
def test_other_shipped_pairs(scene: str, setup: str | None, count: int, warnings: int) -> None:
    loaded, warned = shipped_pair(scene, setup)
    assert (len(loaded.objects), len(warned)) == (count, warnings)


@shipped
@pytest.mark.parametrize(
    ("scene", "setup", "what"),
    [
        (
            "earth/stars.json",
            "earth/setupStars.json",
            "earth/setupStars.json: line 18, column 3: is not JSON: expecting property name enclosed in double quotes",
        ),
    ],
)
def test_shipped_pairs_that_are_refused(scene: str, setup: str, what: str) -> None:
    with pytest.raises(UserError) as caught:
        convert(SHIPPED / scene, SHIPPED / setup)
    assert [text.replace(f"{SHIPPED}/", "") for text in caught.value.lines] == [what]


@shipped
def test_every_shipped_scene_with_every_setup() -> None:
    """What is right comes through whatever it is paired with; what is not built or invalid is one line."""
    files = [path.relative_to(SHIPPED).as_posix() for path in sorted(SHIPPED.rglob("*.json"))]
    setups = [name for name in files if "setup" in name or "config" in name]
    scenes = [name for name in files if name not in setups]
    assert len(scenes) > 10 and len(setups) > 10
    for scene, setup, compat in product(scenes, setups, (False, True)):
        refused = setup == "earth/setupStars.json"
        try:
            loaded, _ = convert(SHIPPED / scene, SHIPPED / setup, compat)
            assert not refused and (loaded.data is not None) == ("dades" in scene)
        except UserError as error:
            # An invalid file is warnings alone, before anything else.
            assert len(error.lines) == 1 and refused
