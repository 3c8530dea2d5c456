"""Data scenes of VisRayTrace (typeScene REALDATA): every row lies, is as large and is coloured as its formulas say.

The formulas are evaluated here a second time, from the file itself. The files that came with VisRayTrace are tested
where available.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import nan
from pathlib import Path

import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.data.rows import Rows
from visray.errors import UserError
from visray.materials import Material
from visray.scene.legacy.color_maps import OWN, custom_colors
from visray.scene.legacy.convert import convert
from visray.scene.legacy.data_layers import GIZMOS
from visray.scene.load import load
from visray.scene.scene import Scene

SHIPPED = Path(__file__).resolve().parents[2] / "shared" / "seed-scenes"
PAIRS = {
    "Barcelona": ("dadesBCN/dadesBCNTexture.json", "dadesBCN/setupDataBCN.json"),
    "globe": ("dadesBCN/dadesBCNOneValueSph.json", "dadesBCN/setupDataBCNOneValueSph.json"),
}

MATT = {"type": "lambertian", "ka": [0.2, 0.2, 0.2], "kd": [0.7, 0.6, 0.5], "ks": [0.3, 0.3, 0.3], "shininess": 10}
PLANE = {"type": "FITTEDPLANE", "normal": [0, 1, 0], "point": [0, -1, 0], "pmin": [-5, -5], "pmax": [5, 5]}
PLANE |= {"material": MATT, "puntoCentro": False}
RAIN = {"name": "rain", "gyzmo": "cylinder", "minValue": 0, "maxValue": 80, "colorMap": "COLOR_MAP_TYPE_VIRIDIS"}
RAIN |= {"material": MATT, "data": [[2.1, 41.4, 35], [2.6, 41.8, 62], [2.0, 42.0, 0], [3.0, 41.0, 80]]}
FILE = {
    "scene": "stations",
    "typeScene": "REALDATA",
    "base": PLANE,
    "Real": {"minPoint": [2, 41], "maxPoint": [3, 42]},
    "Virtual": {"minPoint": [-5, -1, -5], "maxPoint": [5, 2, 5]},
    "properties": [RAIN],
}
GLOBE = {"type": "sphere", "center": [1, 2, 3], "radius": 4, "material": MATT}
# From above, with north at the top of the picture.
SETUP = {
    "camera": {"lookFrom": [0, 30, 0], "lookAt": [0, 0, 0], "vup": [0, 0, -1], "vfov": 25, "aspectRatio": 1}
    | {"pixelsX": 64},
    "globalLight": [1, 1, 1],
}


def changed(tree: dict, **fields: object) -> dict:
    """A copy of a dict with other values; None takes a key out."""
    return {key: value for key, value in (tree | fields).items() if value is not None}


def of(base: dict = PLANE, *properties: dict, **fields: object) -> dict:
    """A file with this base and these properties."""
    return changed(FILE, base=base, properties=list(properties) or [RAIN], **fields)


def write(folder: Path, file: dict, setup: dict = SETUP) -> tuple[Path, Path]:
    scene_file, setup_file = folder / "scene.json", folder / "setup.json"
    scene_file.write_text(json.dumps(file), encoding="utf-8")
    setup_file.write_text(json.dumps(setup), encoding="utf-8")
    return scene_file, setup_file


Convert = Callable[..., tuple[Scene, list[str]]]


@pytest.fixture
def converted(tmp_path: Path) -> Convert:
    """Function from a file to its scene and its warnings, without the names of files."""

    def convert_file(file: dict, compat: bool = False) -> tuple[Scene, list[str]]:
        paths = write(tmp_path, file)
        scene, warnings = convert(*paths, compat)
        return scene, [text.replace(f"{paths[0]}: ", "") for text in warnings]

    return convert_file


@pytest.fixture
def errors(converted: Convert, tmp_path: Path) -> Callable[[dict], list[str]]:
    """Function from a wrong file to the errors, without the names of files."""

    def errors_of(file: dict) -> list[str]:
        with pytest.raises(UserError) as caught:
            converted(file)
        assert all("\n" not in text for text in caught.value.lines)
        return [text.replace(f"{tmp_path / 'scene.json'}: ", "") for text in caught.value.lines]

    return errors_of


# The formulas, evaluated a second time.


@dataclass
class Shown:
    """Gizmos: the middle, half the width and the height of each, its direction upwards, and its colour, as linear
    light. Shapes: (N, 3), (N), (N), (N, 3), (N, 3)."""

    kind: str
    middle: np.ndarray
    radius: np.ndarray
    height: np.ndarray
    up: np.ndarray
    color: np.ndarray


def light(srgb: np.ndarray) -> np.ndarray:
    """Linear light of sRGB numbers (IEC 61966-2-1)."""
    return np.where(srgb > 0.04045, ((srgb + 0.055) / 1.055) ** 2.4, srgb / 12.92)


def remapped(v: np.ndarray, real: tuple[float, float], virtual: tuple[float, float]) -> np.ndarray:
    """VisRayTrace's linear map."""
    return (v - real[0]) * (virtual[1] - virtual[0]) / (real[1] - real[0]) + virtual[0]


def feet(file: dict, x: np.ndarray, z: np.ndarray, second: bool, compat: bool) -> tuple[np.ndarray, np.ndarray]:
    """Where gizmos stand on the base, and its normals there. Shapes: (N), (N) -> (N, 3), (N, 3)."""
    base = file["base"]
    if base["type"].upper() == "SPHERE":
        lon, lat = np.radians(x), np.radians(z)
        if second:  # 0.3 along the circle of latitude; VisRayTrace went 0.3 along x, out of the globe
            lon = lon + 0.3 / (base["radius"] * np.cos(lat))
        up = np.stack([np.cos(lat) * np.cos(-lon), np.sin(lat), np.cos(lat) * np.sin(-lon)], 1)
        return np.array(base.get("center", [0, 0, 0])) + base["radius"] * up, up
    (real, virtual) = (list(zip(*(file[key][end] for end in ("minPoint", "maxPoint")))) for key in ("Real", "Virtual"))
    px = remapped(x, real[0], virtual[0]) + (0.3 if second else 0.0)
    pz = remapped(z, real[1], virtual[2] if compat else virtual[2][::-1])
    up = np.tile([0.0, 1.0, 0.0], (len(x), 1))
    return np.stack([px, np.full(len(x), float(base["point"][1])), pz], 1), up


def by_formulas(file: dict, compat: bool = False) -> list[Shown]:
    """The gizmos of a file: for each property those of the values, and those of the second values if there are any."""
    (_, low, _), (_, high, _) = file["Virtual"]["minPoint"], file["Virtual"]["maxPoint"]
    shown = []
    for p in file.get("properties") or file["attributes"]:
        ends = [p.get(f"{side}ValueReal", p.get(f"{side}Value")) for side in ("min", "max")]
        rows = [row if len(row) > 3 else [*row, nan] for row in p["data"]]
        x, z, value, other = np.array([row[:4] for row in rows], float).T
        if compat:
            other = np.where(other == -1, nan, other)
        index = np.clip(np.floor(255.0 * (value - ends[0]) / (ends[1] - ends[0])), 0, 255).astype(int)
        srgb = colormaps[p["colorMap"].removeprefix("COLOR_MAP_TYPE_").lower()](index)[:, :3]
        for second, v, numbers in ((False, value, srgb), (True, other, 1 - srgb)):
            there = ~np.isnan(v)
            if not there.any():
                continue
            s = remapped(v[there], ends, (0.1, 0.5 * abs(high - low)))
            foot, up = feet(file, x[there], z[there], second, compat)
            on_globe = file["base"]["type"].upper() == "SPHERE"
            shape = GIZMO_FORMULAS[p["gyzmo"].lower()]
            radius, height, lift = shape(s)
            lift = 0 * s if on_globe else lift
            color = numbers[there] if compat else light(numbers[there])
            shown.append(
                Shown(p["gyzmo"].lower(), foot + up * lift[:, None], np.abs(radius), np.abs(height), up, color)
            )
    return shown


# For each gizmo and sizes s: its radius, its height, and how high its middle is above the foot. The middle of a
# triangle is that of its corners.
GIZMO_FORMULAS = {
    "sphere": lambda s: (s, 2 * s, 0.5 * s),
    "cylinder": lambda s: (np.full_like(s, 0.1), 4 * s, 2 * s),
    "triangle": lambda s: (s, 3 * s, 0 * s),
    "box": lambda s: (s, 2 * s, s),
    "cone": lambda s: (s, 2 * s, s),
}


def shown_in(scene: Scene) -> list[Shown]:
    """The gizmos of a scene, from the fields of the objects that are rendered."""
    return [Shown(rows.gizmo.name, *MEASURES[rows.gizmo.name](rows), rows.color.T) for rows in scene.data.rows.values()]


def _round(rows: Rows) -> tuple:
    f = rows.fields
    return f["center"].T, f["radius"], f.get("height", 2 * f["radius"]), rows.stand.up.T


def _cone(rows: Rows) -> tuple:
    f = rows.fields
    return (f["base"] + 0.5 * f["height"] * f["axis"]).T, f["radius"], f["height"], rows.stand.up.T


def _box(rows: Rows) -> tuple:
    x, y, _, o = rows.fields["frame"]
    return o.T, np.linalg.norm(x, axis=0), 2 * np.linalg.norm(y, axis=0), rows.stand.up.T


def _triangle(rows: Rows) -> tuple:
    a, b, c = (rows.fields[name].T for name in "abc")
    tall = np.linalg.norm(c - (a + b) / 2, axis=1)
    return (a + b + c) / 3, np.linalg.norm(b - a, axis=1) / 2, tall, rows.stand.up.T


MEASURES = {"sphere": _round, "cylinder": _round, "cone": _cone, "box": _box, "triangle": _triangle}


def assert_same(found: list[Shown], expected: list[Shown]) -> None:
    assert [s.kind for s in found] == [s.kind for s in expected]
    for ours, theirs in zip(found, expected):
        for name in ("middle", "radius", "height", "up", "color"):
            np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=0, atol=1e-6, err_msg=name)


PROPERTIES = {
    "one value": [RAIN],
    "two values": [changed(RAIN, data=[[2.1, 41.4, 35, 20], [2.6, 41.8, 62, 80]])],
    "two values in some rows": [changed(RAIN, data=[[2.1, 41.4, 35], [2.6, 41.8, 62, 80], [2.4, 41.7, 3]])],
    "several properties": [
        RAIN,
        changed(RAIN, gyzmo="sphere", colorMap="COLOR_MAP_TYPE_PLASMA", data=[[2.3, 41.2, 10, 30]]),
        changed(RAIN, name="heat", gyzmo="triangle", minValue=-20, maxValue=40, data=[[2.3, 41.9, -15], [2, 41, 39]]),
    ],
    "beyond the range of values": [
        changed(RAIN, minValue=30, maxValue=50, data=[[2.1, 41.4, 35], [2.5, 41.5, 20], [2.2, 41.1, -9], [3, 42, 70]]),
        changed(RAIN, name="two", gyzmo="sphere", minValue=-5, data=[[2.2, 41.5, -40], [2.5, 41.5, -4], [2, 42, 100]]),
        changed(RAIN, name="three", gyzmo="triangle", data=[[2.2, 41.5, -40], [2.5, 41.5, -4], [2, 42, 100]]),
    ],
    "minValueReal wins": [changed(RAIN, minValueReal=-10, maxValueReal=100)],
    "far beside the plane": [changed(RAIN, data=[[2.5, 88, 5, 6], [2.5, -30, 10], [181.9, 41, 5, 10]])],
    "beside the plane": [changed(RAIN, data=[[1.5, 41.5, 20], [3.2, 42.9, 40]])],
}
PROPERTIES |= {kind: [changed(RAIN, gyzmo=kind.upper())] for kind in GIZMOS}
BASES = {
    "plane of the same size": {"base": PLANE},
    "larger plane": {"base": PLANE | {"pmin": [-10, -8], "pmax": [10, 12]}},
    "smaller plane": {"base": PLANE | {"pmin": [1, -2], "pmax": [3, 4], "point": [0, 0.5, 0]}},
    "plane about its point": {"base": PLANE | {"point": [2, 1, -3], "puntoCentro": True}},
    "oblong Virtual": {"base": PLANE, "Virtual": {"minPoint": [-5, -1, -5], "maxPoint": [5, 2, 5.31]}},
    "infinite plane": {"base": {"type": "Plane", "normal": [0, 1, 0], "point": [0, 0.5, 7], "material": MATT}},
    "globe": {"base": GLOBE},
}


@pytest.mark.parametrize("compat", [False, True], ids=["ours", "compat"])
@pytest.mark.parametrize("properties", PROPERTIES.values(), ids=PROPERTIES)
@pytest.mark.parametrize("base", BASES.values(), ids=BASES)
def test_every_row_is_as_the_formulas_say(converted: Convert, base: dict, properties: list, compat: bool) -> None:
    file = changed(FILE, properties=properties, **base)
    assert_same(shown_in(converted(file, compat)[0]), by_formulas(file, compat))


@pytest.mark.skipif(not SHIPPED.is_dir(), reason="VisRayTrace's own files are not available")
@pytest.mark.parametrize("compat", [False, True], ids=["ours", "compat"])
@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_every_row_of_the_shipped_files(pair: tuple[str, str], compat: bool) -> None:
    scene, _ = convert(*(SHIPPED / name for name in pair), compat)
    assert_same(shown_in(scene), by_formulas(json.loads((SHIPPED / pair[0]).read_text()), compat))


def test_the_note_about_a_picture_says_what_to_write(converted: Convert, tmp_path: Path) -> None:
    paper = DULL | {"type": "materialtextura", "textureFile": quarters(tmp_path)}
    base = PLANE | {"pmin": [-10, -10], "pmax": [10, 10], "material": paper}
    _, warnings = converted(of(base))
    advice = "Virtual.minPoint = [-10, -1, -10] and Virtual.maxPoint = [10, 2, 10]"
    assert warnings == [
        "base: its picture is 2 and 2 times as large as Virtual in x and in z, so the data lie where the formula puts "
        f"them, not where the picture shows them; if the picture shows all of Real, write {advice}"
    ]
    scene, warnings = converted(of(base, Virtual={"minPoint": [-10, -1, -10], "maxPoint": [10, 2, 10]}))
    assert warnings == [] and scene.data.base.extent == (2, 3, 41, 42)
    assert converted(of(base | {"material": MATT}))[1] == []


def test_a_file_that_turns_real_around_is_right_already(converted: Convert) -> None:
    """So authors put the north where the map has it. Then the formula is right, and compat mirrors nothing."""
    turned = changed(FILE, Real={"minPoint": [2, 42], "maxPoint": [3, 41]})
    ours, compat = (converted(turned, flag)[0] for flag in (False, True))
    for shown, kept in zip(shown_in(ours), shown_in(compat)):
        np.testing.assert_allclose(shown.middle, kept.middle, atol=1e-12)
    np.testing.assert_allclose(shown_in(compat)[0].middle, by_formulas(turned, compat=True)[0].middle, atol=1e-6)
    np.testing.assert_allclose(shown_in(ours)[0].middle, by_formulas(FILE)[0].middle, atol=1e-6)


def test_coordinates_that_are_no_degrees(converted: Convert) -> None:
    """Metres, for example: in visray's scene they are divided by a power of ten, and lie where they should."""
    file = of(
        PLANE,
        changed(RAIN, data=[[431000, 4582000, 20, 30], [429000, 4579500, 60]]),
        Real={"minPoint": [428000, 4579000], "maxPoint": [432000, 4583000]},
    )
    scene, warnings = converted(file)
    assert_same(shown_in(scene), by_formulas(file))
    assert warnings == [
        "Real: x and z of the base or of the data are beyond the longitudes and latitudes of the earth; in the data of "
        "the visray scene they are divided by 100000"
    ]


def test_places_beyond_a_pole_of_a_globe(converted: Convert) -> None:
    file = of(GLOBE, changed(RAIN, data=[[10, 100, 20], [-400, -91, 60], [500, 20, 10]]))
    scene, warnings = converted(file)
    assert_same(shown_in(scene), by_formulas(file))
    assert warnings == [
        "properties: 2 of 3 latitudes are beyond a pole; a row is [longitude, latitude, value]; the way goes on over "
        "the pole, as in VisRayTrace"
    ]


def test_a_second_gizmo_near_a_pole_is_at_most_on_the_other_side(converted: Convert) -> None:
    scene, _ = converted(of(GLOBE, changed(RAIN, data=[[10, 89.99999, 20, 30], [350, 90, 20, 30]])))
    lon = scene.data.rows["rain 2"].values["lon"]
    np.testing.assert_allclose(lon, [190, 170])


def test_nothing_is_said_of_the_complement_of_a_palette(converted: Convert) -> None:
    """Nobody chose it. A note tells what is wrong with a palette that somebody chose."""
    for name, count in (("viridis", 0), ("jet", 1)):
        rain = changed(RAIN, data=[[2.1, 41.4, 35, 50], [2.6, 41.8, 62, 80]], colorMap=f"COLOR_MAP_TYPE_{name.upper()}")
        scene, _ = converted(of(PLANE, rain))
        assert len(scene.data.rows) == 2
        assert sum("uniform" in note for note in scene.data.notes()) == count


def test_minus_1_is_a_second_value_but_for_compat(converted: Convert) -> None:
    file = of(PLANE, changed(RAIN, data=[[2.1, 41.4, 35, -1], [2.6, 41.8, 62, 80]]))
    for compat, count in ((False, 2), (True, 1)):
        scene, warnings = converted(file, compat)
        assert [len(rows) for rows in scene.data.rows.values()] == [2, count]
        assert_same(shown_in(scene), by_formulas(file, compat))
        assert any("with the second value -1" in text for text in warnings) == (not compat)
    assert list(converted(of(PLANE, changed(RAIN, data=[[2.1, 41.4, 35, -1]])), True)[0].data.layers) == ["rain"]


def test_minvalue_above_maxvalue(converted: Convert) -> None:
    file = of(PLANE, changed(RAIN, minValue=80, maxValue=0))
    scene, warnings = converted(file)
    (ours,), (theirs,) = shown_in(scene), by_formulas(file)
    np.testing.assert_allclose(ours.height, theirs.height, atol=1e-12)
    # The reversed table is read at the entry that mirrors int(255 t), which may be a neighbour of it.
    assert np.abs(ours.color - theirs.color).max() < 0.02
    assert warnings == [
        "properties.0: minValue, 80, is above maxValue, 0; so large values are drawn small, as in VisRayTrace"
    ]


# Materials and colour maps.


def material_of(scene: Scene, layer: str = "rain") -> Material:
    return scene.materials[scene.data.layers[layer].material]


def test_gizmos_keep_their_material(converted: Convert) -> None:
    """VisRayTrace lost kt, nut and dmax of transparent gizmos."""
    glass = MATT | {"type": "Transparent", "kt": [0.6, 0.5, 0.4], "nut": 1.5, "dmax": 3}
    metal = MATT | {"type": "METAL", "ks": [0.9, 0.8, 0.7]}
    file = of(PLANE, changed(RAIN, material=glass), changed(RAIN, name="heat", material=metal))
    for compat, colored in ((False, ("ka", "kd")), (True, ("kd",))):
        scene, _ = converted(file, compat)
        own = material_of(scene)
        assert (own.kt, own.ior, own.dmax, own.ka) == ((0.6, 0.5, 0.4), 1.5, 3.0, (0.2, 0.2, 0.2))
        assert material_of(scene, "heat").kr == material_of(scene, "heat").ks == (0.9, 0.8, 0.7)
        assert own.colored == material_of(scene, "heat").colored == colored
        assert scene.materials[scene.data.base.material].colored == Material.colored


def test_a_textured_gizmo_has_the_colours_of_its_data(converted: Convert) -> None:
    scene, warnings = converted(of(PLANE, changed(RAIN, material=MATT | {"type": "materialTextura"})))
    assert material_of(scene).texture is None and scene.textures == {}
    assert warnings == [
        'properties.0.material.type = "materialTextura": gizmos have the colours of their data, and no texture'
    ]


@pytest.mark.parametrize("written", [f"{prefix}{name}" for name in OWN for prefix in ("", "COLOR_MAP_TYPE_")])
def test_colour_maps(converted: Convert, written: str) -> None:
    for text in (written, written.upper(), f" {written.lower()} "):
        scene, warnings = converted(of(PLANE, changed(RAIN, colorMap=text)))
        assert warnings == []
        name = written.removeprefix("COLOR_MAP_TYPE_")
        assert scene.data.layers["rain"].color.palette == name
        if name in colormaps:
            expected = light(colormaps[name]([0, 255])[:, :3])
            np.testing.assert_allclose(shown_in(scene)[0].color[2:], expected, atol=1e-6)


def test_a_custom_colour_map_is_a_fixed_list_of_different_colours(converted: Convert) -> None:
    colors = custom_colors()
    assert len(set(colors)) == 256 and colors == custom_colors()
    assert min(np.abs(np.subtract(a, b)).max() for a, b in pairwise(colors)) > 0.2
    scene, warnings = converted(of(PLANE, changed(RAIN, colorMap="color_map_type_custom")))
    np.testing.assert_allclose(shown_in(scene)[0].color[2:], light(np.array(colors)[[0, 255]]), atol=1e-6)
    assert warnings == [
        'properties.0.colorMap = "color_map_type_custom": VisRayTrace had 256 random colours; visray has a fixed list '
        "of 256 colours in their place"
    ]


@pytest.mark.parametrize(
    ("written", "what"),
    [
        (
            "COLOR_MAP_TYPE_PLASMO",
            ' = "COLOR_MAP_TYPE_PLASMO": unknown colour map, inferno is used; did you mean "plasma"',
        ),
        ("?", ' = "?": unknown colour map, inferno is used; one of inferno, plasma, magma, viridis, parula, jet'),
        (None, ": is missing; inferno is used"),
        (3, " = 3: ignored; must be a string"),
    ],
)
def test_unknown_colour_maps(converted: Convert, written: object, what: str) -> None:
    scene, warnings = converted(of(PLANE, changed(RAIN, colorMap=written)))
    assert scene.data.layers["rain"].color.palette == "inferno"
    assert warnings[0].startswith(f"properties.0.colorMap{what}")


def test_other_names_of_palettes_are_read(converted: Convert) -> None:
    scene, warnings = converted(of(PLANE, changed(RAIN, colorMap="COLOR_MAP_TYPE_RAINBOW")))
    assert (scene.data.layers["rain"].color.palette, warnings) == ("rainbow", [])


# What is read in several ways, and what is said.


@pytest.mark.parametrize("written", ["REALDATA", "realdata", "RealData", "REALDATA2", "VIRTUALWORLD", "online", None])
@pytest.mark.parametrize("key", ["properties", "attributes"])
def test_data_scenes_are_recognised(converted: Convert, written: str | None, key: str) -> None:
    file = changed(FILE, typeScene=written, properties=None) | {key: [RAIN]}
    scene, warnings = converted(file)
    assert_same(shown_in(scene), by_formulas(FILE))
    as_data = "is read as REALDATA, because the file has data and no objects"
    expected = {
        None: ["typeScene: is missing; REALDATA is used"],
        "VIRTUALWORLD": [f'typeScene = "VIRTUALWORLD": {as_data}'],
        "online": [f'typeScene = "online": {as_data}'],
    }
    assert warnings == expected.get(written, [])


def test_spellings(converted: Convert) -> None:
    """Small differences of the family: gizmo, sizes in other keys, one corner of three numbers."""
    other = changed(RAIN, gyzmo=None, material=None) | {"gizmo": "Cylinder", "Material": MATT, "radius": 2}
    scene, warnings = converted(of(PLANE, other, Real={"minPoint": [2, 41, 7], "maxPoint": [3, 42]}))
    assert_same(shown_in(scene), by_formulas(FILE))
    assert [text.split(":")[0] for text in warnings] == [
        "properties.0",
        "properties.0.radius",
        "Real.minPoint = [2, 41, 7]",
    ]


def test_names_of_layers(converted: Convert) -> None:
    names = ["rain", "rain", "a.b", "", None, "lon", "base"]
    scene, _ = converted(of(PLANE, *(changed(RAIN, name=name) for name in names)))
    assert list(scene.data.layers) == ["rain", "rain 2", "a_b", "value", "value 2", "lon 2", "base 2"]


def test_a_scene_of_a_base_alone_shows_it(converted: Convert) -> None:
    """Without data VisRayTrace drew the base."""
    for file in (changed(FILE, properties=None), changed(FILE, properties=[], Real=None, Virtual=None)):
        scene, warnings = converted(file)
        assert list(scene.objects) == ["base"] and scene.data is None
        assert warnings == ["properties: there are none; the scene shows its base"]


def test_objects_in_a_data_scene_are_drawn(converted: Convert) -> None:
    ball = {"name": "ball", "type": "sphere", "radius": 1, "material": MATT}
    scene, warnings = converted(changed(FILE, objects=[ball]))
    assert list(scene.objects) == ["ball"] and list(scene.data.layers) == ["rain"]
    assert warnings == ["objects: are drawn with the data; VisRayTrace drew no objects in data scenes"]


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        (
            {"data": [[2.1, 41.4, 35], [2.6, 41.8, 82, -3]]},
            "properties.0.data: 2 of 3 values are not from 0 to 80; their sizes go on in the same way, and their "
            "colours are those of the ends",
        ),
        ({"minValue": None}, "properties.0.minValue: is missing; that of the data, 0, is used"),
        ({"maxValue": "80"}, 'properties.0.maxValue = "80": ignored; must be a number'),
        ({"gyzmo": None}, "properties.0.gyzmo: is missing; a sphere is drawn"),
        ({"data": [[2.1, None, 3], [2.1, 41.4, 35]]}, "properties.0.data: 1 row with null are left out"),
        (
            {"data": [[2.1, 41.4, 35, 20, 7]]},
            "properties.0.data: 1 row with more than 4 numbers; all after the fourth are ignored",
        ),
        ({"material": None}, "properties.0: has no material; ka, kd, ks are 1 and shininess is 1, as in VisRayTrace"),
    ],
)
def test_what_is_odd_is_said(converted: Convert, fields: dict, expected: str) -> None:
    _, warnings = converted(of(PLANE, changed(RAIN, **fields)))
    assert expected in warnings


def test_negative_sizes_hang_down(converted: Convert) -> None:
    scene, warnings = converted(of(PLANE, changed(RAIN, minValue=30, maxValue=50, data=[[2.1, 41.4, 20], [2, 41, 40]])))
    heights = scene.data.rows["rain"].stand
    assert heights.sign.tolist() == [-1, 1]
    assert (
        "properties.0.data: 1 of 2 values have sizes of 0 or less; gizmos with negative sizes hang down, and those of "
        "size 0 are not drawn"
    ) in warnings


def test_a_flat_virtual_box_is_said(converted: Convert) -> None:
    file = of(PLANE, Virtual={"minPoint": [-5, 0, -5], "maxPoint": [5, 0, 5]})
    scene, warnings = converted(file)
    assert warnings == [
        "Virtual: its height in y is 0, so the size at maxValue is 0; large values are drawn smaller than small ones, "
        "whose size is 0.1",
        "properties.0.data: 1 of 4 values have sizes of 0 or less; gizmos with negative sizes hang down, and those of "
        "size 0 are not drawn",
    ]
    expected = by_formulas(file)[0]
    np.testing.assert_allclose(shown_in(scene)[0].height, expected.height[:3], atol=1e-9)  # the last one is 0


def test_a_leaning_base_is_level(converted: Convert) -> None:
    scene, warnings = converted(of(PLANE | {"normal": [1, 2, 0]}))
    assert warnings == ["base.normal = [1, 2, 0]: the base is level; gizmos stand at y of its point, as in VisRayTrace"]
    assert scene.data.base.center[1] == -1


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"base": None}, ["base: the key is missing; it is an object of the type fittedplane, plane, sphere"]),
        ({"base": 3}, ["base = 3: is no object; it is an object of the type fittedplane, plane, sphere"]),
        ({"base": {"material": MATT}}, ["base: the key 'type' is missing; one of fittedplane, plane, sphere"]),
        (
            {"base": GLOBE | {"type": "spere"}},
            ['base.type = "spere": cannot be a base; did you mean "sphere"? (one of fittedplane, plane, sphere)'],
        ),
        ({"base": GLOBE | {"type": "box"}}, ['base.type = "box": cannot be a base; one of fittedplane, plane, sphere']),
        ({"base": GLOBE | {"radius": -1}}, ["base.radius = -1.0: must be greater than 0"]),
        (
            {"base": PLANE | {"type": "plane", "normal": [1, 0, 0]}},
            ["base.normal = [1, 0, 0]: the base of data lies level, so its normal must not be level"],
        ),
        ({"Real": None}, ['Real: the key is missing; it is {"minPoint": [...], "maxPoint": [...]}']),
        ({"Virtual": None}, ['Virtual: the key is missing; it is {"minPoint": [...], "maxPoint": [...]}']),
        ({"Real": {"minPoint": [2, 41]}}, ["Real.maxPoint: the key is missing; it is 2 numbers"]),
        (
            {"Real": {"minPoint": [2, 41], "maxPoint": [2, 42]}},
            ["Real: minPoint and maxPoint both have x = 2; they must differ"],
        ),
        (
            {"Virtual": {"minPoint": [0, 0, 5], "maxPoint": [1, 2, 5]}},
            ["Virtual: minPoint and maxPoint both have z = 5; they must differ"],
        ),
        ({"properties": [3]}, ["properties.0 = 3: must be an object {...}"]),
        ({"properties": {}}, ["properties = {}: must be a list [...]"]),
        (
            {"properties": None, "base": None},
            ["properties: there are none, and no base; properties are a list of {...} with data"],
        ),
    ],
)
def test_wrong_files(errors: Callable, fields: dict, expected: list[str]) -> None:
    assert errors(changed(FILE, **fields)) == expected


FORM = "a row is [x, z, value] or [x, z, value, value 2]"


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"data": None}, [f"properties.0.data: the key is missing; it is a list of rows, and {FORM}"]),
        ({"data": 3}, ["properties.0.data = 3: must be a list [...]"]),
        ({"data": [[2, 41, 5], 3]}, [f"properties.0.data.1 = 3: is not a row; {FORM}"]),
        ({"data": [[2, 41]]}, [f"properties.0.data.0 = [2, 41]: has 2 of 3 numbers; {FORM}"]),
        ({"data": [[2, 41, "5"]]}, [f'properties.0.data.0 = [2, 41, "5"]: must be numbers, without quotes; {FORM}']),
        ({"data": [[2, 41, True]]}, [f"properties.0.data.0 = [2, 41, true]: must be numbers, without quotes; {FORM}"]),
        ({"data": [[2, float("nan"), 3]]}, [f"properties.0.data.0 = [2, NaN, 3]: must be finite numbers; {FORM}"]),
        (
            {"data": [[2, 41, 5]] + [["x"]] * 7},
            [f'properties.0.data.{i} = ["x"]: has 1 of 3 numbers; {FORM}' for i in range(1, 6)]
            + ["properties.0.data: 7 of 8 rows are wrong; the first 5 are above"],
        ),
        (
            {"gyzmo": "mesh"},
            ['properties.0.gyzmo = "mesh": unknown gizmo; one of sphere, cylinder, triangle, box, cone'],
        ),
        (
            {"gyzmo": "cilinder"},
            [
                'properties.0.gyzmo = "cilinder": unknown gizmo; did you mean "cylinder"? '
                "(one of sphere, cylinder, triangle, box, cone)"
            ],
        ),
        ({"minValue": 80}, ["properties.0: minValue and maxValue are both 80; they must differ"]),
        (
            {"minValue": None, "maxValue": None, "data": [[2, 41, 5]]},
            ["properties.0: minValue and maxValue are both 5; they must differ"],
        ),
        (
            {"data": [[2, 41, 1e300]]},
            ["properties.0.maxValue = [0.0, 80.0]: values so far beyond the domain have a size above 1e+09: row 0"],
        ),
        ({"material": MATT | {"type": "glas"}}, ['properties.0.material.type = "glas": unknown type; ']),
        ({"material": MATT | {"ka": [-1, 0, 0]}}, ["properties.0.material.ka.0 = -1.0: must be at least 0"]),
    ],
)
def test_wrong_properties(errors: Callable, fields: dict, expected: list[str]) -> None:
    found = errors(of(PLANE, changed(RAIN, **fields)))
    assert len(found) == len(expected)
    assert all(text.startswith(start) for text, start in zip(found, expected))


def test_all_errors_are_named_at_once(errors: Callable) -> None:
    wrong = changed(RAIN, data=[[2]], gyzmo="cube")
    found = errors(changed(FILE, base={"type": "box"}, Real=None, properties=[wrong, 3]))
    assert [text.split(":")[0].split(" =")[0] for text in found] == [
        "base.type",
        "properties.0.gyzmo",
        "properties.0.data.0",
        "properties.1",
        "Real",
    ]


# Pictures. Notes about palettes and values are no concern here.

quiet = pytest.mark.filterwarnings("ignore::visray.data_report.DataWarning")


def quarters(folder: Path) -> str:
    """A picture of four quarters; that in the north-west is green."""
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32, :32] = (0, 255, 0)
    Pillow.fromarray(pixels).save(folder / "quarters.png")
    return "://resources/quarters.png"


SUN = {"type": "pointLight", "Ia": [0, 0, 0], "Id": [1, 1, 1], "Is": [0, 0, 0], "a": 1, "b": 0, "c": 0}
DULL = {"type": "lambertian", "ka": [0, 0, 0], "kd": [0, 0, 0], "ks": [0, 0, 0], "shininess": 1}
# A small sphere, which is red.
BALL = changed(RAIN, gyzmo="sphere", colorMap="autumn", material=DULL)


def from_here(x: float, y: float, z: float, up: list[float]) -> dict:
    """A setup whose camera and light are at a point, and look at the origin."""
    camera = SETUP["camera"] | {"lookFrom": [x, y, z], "vup": up}
    return {"camera": camera, "lights": [SUN | {"position": [x, y, z]}], "numSamples": 4}


def seen(folder: Path, file: dict, setup: dict, compat: bool = False) -> np.ndarray:
    """Picture of a file in linear light. Shape: (H, W, 3)."""
    scene, _ = convert(*write(folder, file, setup), compat)
    return np.asarray(vr.render(scene, progress=False))[..., :3]


def is_red(picture: np.ndarray) -> np.ndarray:
    """Mask of the pixels that show a red ball."""
    return (picture[..., 0] > 0.3) & (picture[..., 1] < 0.5 * picture[..., 0])


def is_green(picture: np.ndarray) -> np.ndarray:
    return (picture[..., 1] > 0.3) & (picture[..., 0] < 0.1)


def middle_of(mask: np.ndarray) -> np.ndarray:
    """Mean (column, row) of the pixels of a mask, from 0 at the left and at the top to 1. Shape: (2)."""
    rows, columns = np.nonzero(mask)
    return (np.array([columns.mean(), rows.mean()]) + 0.5) / np.array(mask.shape[::-1])


def on_the_map(lon: float, lat: float) -> np.ndarray:
    """Where a place of FILE lies on its map: 0 in the west and in the north, and 1 in the east and in the south."""
    return np.array([lon - 2, 42 - lat])


@quiet
@pytest.mark.parametrize("compat", [False, True], ids=["ours", "compat"])
@pytest.mark.parametrize("base", [PLANE, PLANE | {"pmin": [-4, -6], "pmax": [6, 2]}], ids=["Virtual", "other"])
def test_a_datum_in_the_north_west_lies_in_the_north_west_of_the_map(tmp_path, base: dict, compat: bool) -> None:
    """The map fills the picture, seen from far above. Its north-west quarter is green."""
    paper = DULL | {"type": "materialtextura", "textureFile": quarters(tmp_path)}
    here = {"minPoint": [base["pmin"][0], -1, base["pmin"][1]], "maxPoint": [base["pmax"][0], 2, base["pmax"][1]]}
    setup = from_here(0, 30, 0, [0, 0, -1])
    bare = seen(tmp_path, of(base | {"material": paper}, changed(BALL, data=[[2.5, 41.5, 1]]), Virtual=here), setup)
    green = middle_of(is_green(bare))
    for lon, lat in ((2.1, 41.9), (2.4, 41.6), (2.9, 41.1)):
        file = of(base | {"material": paper}, changed(BALL, data=[[lon, lat, 10]]), Virtual=here)
        picture = seen(tmp_path, file, setup, compat)
        row = is_green(bare).any(axis=1).nonzero()[0]
        column = is_green(bare).any(axis=0).nonzero()[0]
        # The green quarter ends in the middle of the map.
        quarter = np.array([np.ptp(column) + 1, np.ptp(row) + 1]) / 64
        expected = green - quarter / 2 + 2 * quarter * on_the_map(lon, lat if not compat else 83 - lat)
        np.testing.assert_allclose(middle_of(is_red(picture)), expected, atol=0.03)


@quiet
@pytest.mark.parametrize("compat", [False, True], ids=["ours", "compat"])
def test_a_datum_lies_where_the_globe_shows_it(tmp_path, compat: bool) -> None:
    """The ball in the middle of the green quarter is in the middle of the picture, and green is all around it; at the
    same latitude in the east it is black around."""
    globe = GLOBE | {
        "center": [0, 0, 0],
        "material": DULL | {"type": "materialtextura", "textureFile": quarters(tmp_path)},
    }
    for lon, sign, green in ((-90, 1, True), (90, -1, False)):
        file = of(globe, changed(BALL, data=[[lon, 45, 10]]))
        picture = seen(tmp_path, file, from_here(0, 20, 20 * sign, [0, 1, 0]), compat)
        np.testing.assert_allclose(middle_of(is_red(picture)), 0.5, atol=0.02)
        around = picture[26:38, 26:38]
        assert is_green(around[[0, -1]]).all() == is_green(around[:, [0, -1]]).all() == green
        assert is_green(around).any() == green


@quiet
@pytest.mark.parametrize("compat", [False, True], ids=["ours", "compat"])
@pytest.mark.parametrize("base", [PLANE, GLOBE], ids=["plane", "globe"])
def test_an_imported_scene_renders_to_the_same_bits(tmp_path: Path, base: dict, compat: bool) -> None:
    paper = MATT | {"type": "materialtextura", "textureFile": quarters(tmp_path)}
    two = changed(RAIN, name="heat", gyzmo="sphere", minValue=30, data=[[2.3, 41.2, 20], [10, 45, 40, 70]])
    paths = write(tmp_path, of(base | {"material": paper}, RAIN, two), from_here(3, 20, 14, [0, 1, 0]))
    target = tmp_path / "native.json"
    arguments = ["import", str(paths[0]), "--setup", str(paths[1]), "-o", str(target)]
    assert main(arguments + ["--compat"] * compat) == 0
    pictures = [vr.render(scene, progress=False) for scene in (convert(*paths, compat)[0], load(target))]
    assert all(np.array_equal(pictures[0][name], pictures[1][name], equal_nan=True) for name in pictures[0].layers)


ODD = [None, True, -1, 0, 1e300, nan, 10**400, "", "no\nsense", [], [[]], ["x"], [1], {}, {"a": {}}]


@pytest.mark.parametrize("odd", ODD, ids=[str(i) for i in range(len(ODD))])
@pytest.mark.slow
def test_odd_values_anywhere_give_a_scene_or_lines(converted: Convert, odd: object, tmp_path: Path) -> None:
    """Each key of a file in turn says something odd."""
    two = changed(RAIN, data=[[2.1, 41.4, 35, 1]]) | {"minValueReal": 1, "maxValueReal": 5}
    for base in (PLANE, GLOBE):
        for file in with_each_value_replaced(of(base, two), odd):
            try:
                _, texts = converted(file)
            except UserError as error:
                texts = error.lines
            assert all(isinstance(text, str) and "\n" not in text for text in texts)


def with_each_value_replaced(tree: object, odd: object) -> list:
    """Copies of a tree, each with one of its values replaced."""
    keys = tree.keys() if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ()
    copies = []
    for key in keys:
        for value in [odd, *with_each_value_replaced(tree[key], odd)]:
            copy = tree.copy()
            copy[key] = value
            copies.append(copy)
    return copies
