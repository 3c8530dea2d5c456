"""Files of the original VisRayTrace and its siblings as scenes. The shipped ones are tried where they are at hand."""

import json
from pathlib import Path

import pytest

from visray.camera import Camera
from visray.errors import UserError
from visray.lights import PointLight
from visray.materials import Material
from visray.primitives import Box, Cylinder, Plane, Rectangle, Sphere, Triangle
from visray.scene.load import load
from visray.scene.scene import Film, Gradient, Scene
from visray.scene.seed_format import SeedWarning, convert

SHIPPED = Path(__file__).resolve().parents[2] / "shared" / "seed-scenes"
shipped = pytest.mark.skipif(not SHIPPED.is_dir(), reason="the original files are not here")

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

    def convert(self, *objects: object, setup: object = None, **scene: object) -> tuple[Scene, list[str]]:
        self.write(*objects, setup=setup, **scene)
        made, told = convert(self.scene, self.setup)
        return made, [self.short(text) for text in told]

    def errors(self, *objects: object, setup: object = None, **scene: object) -> list[str]:
        self.write(*objects, setup=setup, **scene)
        with pytest.raises(UserError) as caught:
            convert(self.scene, self.setup)
        return [self.short(text) for text in caught.value.lines]

    def short(self, text: str) -> str:
        assert "\n" not in text
        return text.replace(str(self.scene), "scene").replace(str(self.setup), "setup")


@pytest.fixture
def pair(tmp_path: Path) -> Pair:
    return Pair(tmp_path)


def thing(pair: Pair, **fields: object) -> object:
    """The object that one JSON object becomes, without its material."""
    made, told = pair.convert({"name": "x", "material": MATT} | fields)
    assert told == []
    assert made.objects["x"].material == "x"
    return made.objects["x"]


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
    made, told = pair.convert(BALL, setup=setup)
    assert told == []
    assert made.camera == Camera(origin=(0.0, 1.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=40.0)
    assert made.film == Film(width=100, height=50)
    assert made.ambient == (0.1, 0.2, 0.3)
    assert made.background == Gradient(top=(0.5, 0.7, 1.0), bottom=(1.0, 1.0, 1.0))
    assert made.settings.spp == 9
    assert made.settings.shadows is True
    assert made.lights == {
        "light 1": PointLight(
            position=(2.0, 8.0, 10.0), Ia=(0.3, 0.3, 0.3), Id=(0.7, 0.6, 0.5), Is=(1.0, 1.0, 1.0), a=0.5, b=0.25, c=0.01
        )
    }
    assert made.objects == {"ball": Sphere(center=(1.0, 2.0, 3.0), radius=0.5, material="ball")}
    matt = Material(ka=(0.1, 0.1, 0.1), kd=(0.5, 0.5, 0.5), ks=(0.2, 0.2, 0.2), shininess=10.0)
    assert made.materials == {"ball": matt}


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
    made = thing(pair, **fields)
    assert made == type(expected)(**{**vars(expected), "material": "x"})


def test_a_fitted_plane_has_the_normal_of_the_file(pair: Pair) -> None:
    for normal in ([0, 1, 0], [0, -1, 0], [0.5, 1, -0.25], [0.5, -1, -0.25]):
        plane = thing(pair, type="fittedplane", normal=normal, pmin=[-1, -2], pmax=[3, 4])
        (ax, ay, az), (bx, by, bz) = plane.width, plane.height
        cross = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        ratio = cross[1] / normal[1]
        assert ratio > 0
        assert cross == pytest.approx([ratio * n for n in normal])


def test_materials_keep_their_blinn_phong_part_and_say_what_is_lost(pair: Pair) -> None:
    def ball(name: str, **material: object) -> dict:
        return BALL | {"name": name, "material": MATT | material}

    made, told = pair.convert(
        ball("matt", kt=[0, 0, 0], nut=1, opacity=1),
        ball("mirror", type="METAL", ks=[0.9, 0.9, 0.9]),
        ball("glass", type="Transparent", kt=[1, 1, 1], nut=1.5, dmax=2, id=0),
        ball("globe", type="MaterialTextura", textureFile="://resources/earth.png"),
        ball("twin"),
    )
    assert told == [
        "scene: objects.mirror.material: the reflection of metal is not built yet; its Blinn-Phong part is used",
        "scene: objects.glass.material: the refraction and transparent shadows of transparent is not built yet; "
        "its Blinn-Phong part is used",
        "scene: objects.globe.material: the texture of materialtextura is not built yet; its Blinn-Phong part is used",
    ]
    # Equal materials become one, with the name of the first object.
    assert list(made.materials) == ["matt", "mirror"]
    assert {name: o.material for name, o in made.objects.items()} == {
        "matt": "matt",
        "mirror": "mirror",
        "glass": "matt",
        "globe": "matt",
        "twin": "matt",
    }
    assert made.materials["mirror"].ks == (0.9, 0.9, 0.9)


def test_absent_material_fields_are_the_original_ones(pair: Pair) -> None:
    bare = Material(ka=(1.0, 1.0, 1.0), kd=(1.0, 1.0, 1.0), ks=(1.0, 1.0, 1.0), shininess=1.0)
    made, told = pair.convert(BALL | {"material": {}})
    assert made.materials == {"ball": bare}
    assert told == []
    made, told = pair.convert({k: v for k, v in BALL.items() if k != "material"})
    assert made.materials == {"ball": bare}
    assert told == [
        "scene: objects.ball: has no material; ka, kd, ks are 1 and shininess is 1, as in the original",
    ]


def test_names_become_valid_and_unique(pair: Pair) -> None:
    nameless = {k: v for k, v in BALL.items() if k != "name"}
    made, told = pair.convert(
        BALL, BALL, BALL | {"name": "ball 2"}, BALL | {"name": "a.b "}, BALL | {"name": ""}, nameless
    )
    assert list(made.objects) == ["ball", "ball 2", "ball 2 2", "a_b", "sphere", "sphere 2"]
    assert told == [
        "scene: objects.1.name = \"ball\": the object is called 'ball 2' here",
        "scene: objects.2.name = \"ball 2\": the object is called 'ball 2 2' here",
        "scene: objects.3.name = \"a.b \": the object is called 'a_b' here",
        "scene: objects.4.name = \"\": the object is called 'sphere' here",
        "scene: objects.5.name = \"\": the object is called 'sphere 2' here",
    ]


@pytest.mark.parametrize("kind", ["VIRTUALWORLD", "VIRTUAL", "virtual", "ONLINE", "VirtualWorld"])
def test_virtual_worlds(pair: Pair, kind: str) -> None:
    made, told = pair.convert(BALL, typeScene=kind)
    assert (list(made.objects), told) == (["ball"], [])


def test_a_missing_type_of_scene_is_inferred(pair: Pair) -> None:
    made, told = pair.convert(BALL, typeScene=None)
    assert (list(made.objects), told) == (["ball"], ["scene: typeScene: is missing; VIRTUALWORLD is used"])
    for key in ("properties", "attributes"):
        assert pair.errors(typeScene=None, objects=None, **{key: []}) == [
            'scene: typeScene = "REALDATA": a data scene (test) is not built yet'
        ]


def test_all_that_is_not_built_is_named_at_once(pair: Pair) -> None:
    lights = [
        {"type": "spotLight", "position": [0, 9, 0], "direction": [0, -1, 0], "angle": 0.17},
        {"type": "AREALIGHT", "position": [0, 9, 0], "width": [1, 0, 0], "height": [0, 0, 1]},
        {"type": "directionalLight", "direction": [0, -1, 0]},
    ]
    found = pair.errors(
        {"name": "pot", "type": "MESH", "objFileName": "://resources/pot.obj", "nBox": 3},
        {"name": "heart", "type": "polynomial", "monomis": ["x2", "-1"]},
        typeScene="TEMPORALVW",
        setup={"camera": CAMERA, "lights": lights},
    )
    assert found == [
        'scene: typeScene = "TEMPORALVW": an animated scene (test) is not built yet',
        'scene: objects.pot.objFileName = "://resources/pot.obj": mesh is not built yet',
        'scene: objects.heart.monomis = ["x2", "-1"]: polynomial is not built yet',
        'setup: lights.0.type = "spotLight": is not built yet; only pointLight is',
        'setup: lights.1.type = "areaLight": is not built yet; only pointLight is',
        'setup: lights.2.type = "directionalLight": is not built yet; only pointLight is',
    ]
    assert pair.errors(typeScene="realdata") == ['scene: typeScene = "realdata": a data scene (test) is not built yet']


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
        ({"material": MATT | {"kd": [1, -1, 0]}}, "materials.ball.kd.1 = -1.0: must be at least 0"),
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
            "objects.ball.max = [1.0, 0.0, 1.0]: must be great",
        ),
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
    made, told = pair.convert(BALL | {"Radius ": 3}, setup={"camera": camera, "GlobalLight": [1, 1, 1]})
    assert made.camera.target == (0.0, 0.0, -1.0)
    assert made.ambient == (1.0, 1.0, 1.0)
    assert made.objects["ball"].radius == 0.5
    assert told == [
        "scene: objects.ball.Radius : passed over; 'radius' says the same",
        "setup: key: 'GlobalLight' is read as 'globalLight'; the original passed it over",
        "setup: camera: 'lookAt:' is read as 'lookAt'; the original passed it over",
    ]


def test_what_is_passed_over_is_told(pair: Pair) -> None:
    light = {"type": "pointLight", "position": [0, 5, 0, 9], "width": [1, 0, 0], "height": [0, 1, 0], "Id": "white"}
    setup = {
        "camera": CAMERA | {"zoom": 3, "defocusBlur": {"enabled": True, "aperture": 1}, "pixelsX": "wide"},
        "lights": [light],
        "renderType": "temporal",
        "shading": "CelShadow",
        "ambientOcclusion": {"enabled": True, "raysGlobal": 20},
    }
    made, told = pair.convert(BALL | {"colour": 3, "center": [1]}, setup=setup)
    assert made.objects["ball"].center == (1.0, 0.0, 0.0)
    assert made.film.width == 400
    assert made.lights["light 1"] == PointLight(position=(0.0, 5.0, 0.0), Id=(0.0, 0.0, 0.0), Is=(0.0, 0.0, 0.0))
    assert told == [
        "scene: objects.ball.colour: unknown key, passed over; one of name, type, material, data, center, radius",
        "scene: objects.ball.center = [1]: must be 3 numbers; missing ones are 0",
        'setup: renderType = "temporal": a sequence of frames is not built yet; the scene is one picture',
        "setup: ambientOcclusion: is not built yet; passed over",
        "setup: camera.zoom: unknown key, passed over; one of lookFrom, lookAt, vup, vfov, aspectRatio, pixelsX, "
        "defocusBlur, aperture",
        "setup: camera.defocusBlur: is not built yet; everything is sharp",
        'setup: camera.pixelsX = "wide": passed over; must be a number',
        "setup: lights.0: has a width and a height, which belong to an areaLight; it is a pointLight without them",
        "setup: lights.0.position = [0, 5, 0, 9]: must be 3 numbers; further ones are passed over",
        'setup: lights.0.Id = "white": passed over; must be 3 numbers',
        'setup: shading = "CelShadow": is not built yet; BlinnPhong is used',
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
    made, told = pair.convert(BALL, setup={"camera": CAMERA} | setup)
    assert made.settings.shadows is shadows
    silent = shadows or "shadows" in setup
    assert told == (
        [] if silent else ['setup: shading = "BlinnPhong": has no shadows; write BlinnPhongShadow to have them']
    )


def test_an_empty_setup_has_the_defaults_of_the_original(pair: Pair) -> None:
    made, told = pair.convert(BALL, setup={})
    assert made.camera == Camera(origin=(0.0, 0.0, 10.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=90.0)
    assert made.film == Film(width=400, height=400)
    assert (made.background, made.ambient, made.lights) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), {})
    assert told == [
        "setup: camera: is missing; it looks from (0, 0, 10) to the origin, 90 degrees wide, 400 x 400 pixels"
    ]
    made, told = pair.convert(BALL, setup={"camera": {"lookFrom": [0, 0, 3]}, "colorDownBackground": [1, 1, 1]})
    assert made.camera == Camera(origin=(0.0, 0.0, 3.0), up=(0.0, 1.0, 0.0), fov=90.0)
    assert made.background == Gradient(top=(0.0, 0.0, 0.0), bottom=(1.0, 1.0, 1.0))
    assert told == [
        "setup: camera.vup: is missing; (0, 1, 0) is used",
        "setup: camera.vfov: is missing; 90 degrees is used, since the original's 180 gives no picture",
    ]


def test_a_light_without_a_type_is_a_point_light(pair: Pair) -> None:
    made, told = pair.convert(BALL, setup={"camera": CAMERA, "lights": [{"position": [1, 2, 3], "Id": [1, 1, 1]}]})
    assert made.lights["light 1"].position == (1.0, 2.0, 3.0)
    assert told == ["setup: lights.0: has no type; a pointLight is used, as in the original"]


def test_a_fitted_plane_without_punto_centro_says_how_it_is_read(pair: Pair) -> None:
    plane = BALL | {"type": "fittedplane", "point": [1, 0, 0], "normal": [0, 1, 0], "pmin": [-1, -1], "pmax": [1, 1]}
    made, told = pair.convert({k: v for k, v in plane.items() if k not in ("center", "radius")})
    assert made.objects["ball"].center == (0.0, 0.0, 0.0)
    assert told == ["scene: objects.ball.puntoCentro: is missing; pmin and pmax are read as absolute x and z"]


def test_both_files_are_read_before_errors_are_told(pair: Pair) -> None:
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
    made, told = convert(pair.scene, pair.setup)
    assert made.settings.spp == 5
    assert [pair.short(text) for text in told] == ["setup: numSamples: the key is written twice; the last one counts"]


def test_load_knows_original_scenes_and_warns(pair: Pair) -> None:
    pair.write(BALL)
    assert load(pair.scene, pair.setup) == convert(pair.scene, pair.setup)[0]
    with pytest.warns(SeedWarning, match="no setup file: no lights, a black background, and a camera"):
        alone = load(pair.scene)
    assert (list(alone.objects), alone.camera.fov, alone.film) == (["ball"], 90.0, Film(width=400, height=400))


def original(scene: str, setup: str | None) -> tuple[Scene, list[str]]:
    made, told = convert(SHIPPED / scene, setup and SHIPPED / setup)
    return made, [text.replace(f"{SHIPPED}/", "") for text in told]


@shipped
def test_the_two_spheres() -> None:
    made, told = original("twoSpheres.json", "setupRenderTwoSpheres.json")
    assert told == [
        "twoSpheres.json: objects.Esfera mitjana.material: the reflection of metal is not built yet; "
        "its Blinn-Phong part is used"
    ]
    assert made.camera == Camera(origin=(13.0, 2.0, 3.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=20.0)
    assert made.film == Film(width=1200, height=600)
    assert made.ambient == (0.1, 0.1, 0.1)
    assert made.background == Gradient(top=(0.5, 0.7, 1.0), bottom=(1.0, 1.0, 1.0))
    assert made.lights["light 1"] == PointLight(
        position=(2.0, 8.0, 10.0), Ia=(0.3,) * 3, Id=(0.3,) * 3, Is=(0.7,) * 3, a=0.5, b=0.0, c=0.01
    )
    assert made.objects["Esfera gran"] == Sphere(center=(0.0, -100.5, -1.0), radius=100.0, material="Esfera gran")
    assert made.materials["Esfera gran"] == Material(
        ka=(0.2, 0.2, 0.2), kd=(0.8, 0.8, 0.0), ks=(1.0, 1.0, 1.0), shininess=10.0
    )
    assert list(made.objects) == ["Esfera petita", "Esfera gran", "Esfera mitjana"]


@shipped
def test_the_box() -> None:
    made, told = original("oneBox.json", "setupRenderOneBox.json")
    assert told == []
    assert made.objects == {
        "One Box": Box(min=(0.0, 0.0, 0.0), max=(3.0, 3.0, 3.0), material="One Box"),
        "plano": Rectangle(center=(0.0, 0.0, -1.0), width=(20.0, 0.0, 0.0), height=(0.0, 0.0, -20.0), material="plano"),
    }
    assert made.film == Film(width=1400, height=790)


@shipped
def test_the_cylinder() -> None:
    made, told = original("oneCylinder.json", "setupRenderOneCylinder.json")
    assert told == ["setupRenderOneCylinder.json: camera: 'lookAt:' is read as 'lookAt'; the original passed it over"]
    cylinder = Cylinder(center=(0.0, -1.0, -1.0), radius=0.5, height=0.5, axis=(0.0, 1.0, 0.0), material="One Cilynder")
    assert made.objects == {"One Cilynder": cylinder}
    assert made.lights == {}
    assert made.ambient == (0.0, 0.0, 0.0)
    assert made.camera.target == (0.0, 0.0, -1.0)
    assert made.film == Film(width=400, height=225)


@shipped
def test_the_transparent_spheres_with_the_setup_of_the_tests() -> None:
    made, told = original("transparentSpheres.json", "setupTests.json")
    assert len(told) == 5
    assert all("is not built yet; its Blinn-Phong part is used" in text for text in told)
    assert len(made.objects) == 5
    assert made.background == Gradient(top=(0.0, 0.8, 0.8), bottom=(1.0, 1.0, 1.0))


@shipped
@pytest.mark.parametrize(
    ("scene", "setup", "count", "told"),
    [
        ("ambientOcclusion.json", "setupAmbientOcclusion.json", 6, 0),
        ("cornell_box_geometry.json", "cornell_box_config_vis.json", 11, 0),
        ("defocusBlur.json", "setupDefocusBlur.json", 7, 1),
        ("penombres.json", "setupPenombres.json", 2, 1),
        ("transparencies.json", "setupTransparencies.json", 3, 2),
        ("earth/earth.json", "earth/setupEarth.json", 1, 1),
        ("earth/stars.json", None, 1, 2),
        ("coneLight.json", "setupTests.json", 2, 0),
    ],
)
def test_other_shipped_pairs(scene: str, setup: str | None, count: int, told: int) -> None:
    made, warned = original(scene, setup)
    assert (len(made.objects), len(warned)) == (count, told)


@shipped
@pytest.mark.parametrize(
    ("scene", "setup", "what"),
    [
        (
            "teapot.json",
            "setupRenderTeapot.json",
            'teapot.json: objects.Br Objecte.objFileName = "://resources/teapot2.obj": mesh is not built yet',
        ),
        (
            "tests.json",
            "setupPoly.json",
            'tests.json: objects.Hiperboloide.monomis = ["x2", "y2", "-z2", "-1"]: polynomial is not built yet',
        ),
        (
            "dadesBCN/dadesBCNTexture.json",
            "dadesBCN/setupDataBCN.json",
            'dadesBCN/dadesBCNTexture.json: typeScene = "REALDATA": a data scene (dadesBCN) is not built yet',
        ),
        (
            "dadesBCN/dadesBCNOneValueSph.json",
            "dadesBCN/setupDataBCNOneValueSph.json",
            'dadesBCN/dadesBCNOneValueSph.json: typeScene = "REALDATA": '
            "a data scene (dadesBCNOneValue) is not built yet",
        ),
        (
            "coneLight.json",
            "setupConeLight.json",
            'setupConeLight.json: lights.0.type = "spotLight": is not built yet; only pointLight is',
        ),
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
