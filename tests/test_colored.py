"""Palette colours in materials: what `colored` names, in Python and in the tables of kernels."""

from dataclasses import fields, replace
from itertools import combinations

import drjit as dr
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import visray as vr
from visray.adaptive.brightness import Brightness
from visray.camera import Camera
from visray.data_report import DataWarning
from visray.errors import UserError
from visray.features import features
from visray.material_report import energy_notes
from visray.materials import COLORED, Material, colored
from visray.primitives import Sphere
from visray.quantities import Arrays, quantities, stacked
from visray.scene.address import replaced
from visray.scene.check import checked
from visray.scene.load import load
from visray.scene.scene import Scene
from visray.scene.write import dump
from visray.setup import prepare
from visray.textures import CheckerTexture
from visray.written_out import written_out

GLASS = Material(ka=(0.1, 0.2, 0.3), kd=(0.9, 0.8, 0.7), ks=(0.5, 0.6, 0.7), kr=(0.1, 0.2, 0.4), kt=(0.8, 0.7, 0.5))
CHOICES = [names for count in range(len(COLORED) + 1) for names in combinations(COLORED, count)]


@pytest.mark.parametrize("precision", ["single", "double"])
@settings(derandomize=True, deadline=None, max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_tables_are_coloured_as_single_materials_are(precision: str, seed: int) -> None:
    """With every choice of fields: kd is equal, and products have one rounding."""
    # Eighths are exact, with 0 and 1 among them.
    colors = (np.random.default_rng(seed).integers(0, 9, (6, 3)) / 8).tolist()
    a = Arrays.of("llvm", precision)
    own, color = stacked(a, Material, [GLASS] * len(colors)), a.put(a.V, np.array(colors).T)
    error = 3 * np.finfo(np.float32 if precision == "single" else float).eps / 2
    for names in CHOICES:
        found = colored(own, color, names)
        singles = [replace(GLASS, colored=names).with_color(rgb) for rgb in colors]
        for name in quantities(Material):
            expected = np.array([getattr(m, name) for m in singles]).T
            values = np.array(getattr(found, name)).astype(float)
            assert np.allclose(values, expected, rtol=error, atol=0), name


@pytest.mark.parametrize("names", CHOICES, ids="-".join)
def test_only_what_is_named_changes(names: tuple[str, ...]) -> None:
    m, rgb = replace(GLASS, colored=names), (0.5, 0.25, 0.75)
    new = m.with_color(rgb)
    for f in fields(Material):
        before, after = getattr(m, f.name), getattr(new, f.name)
        if f.name not in names:
            assert after == before
        else:
            assert after == (rgb if f.name == "kd" else tuple(x * y for x, y in zip(before, rgb)))


def test_derivatives_by_colours() -> None:
    """1 for kd, the own number for a product, and nothing for what is not named."""
    a = Arrays.of("llvm", "double")
    own = stacked(a, Material, [GLASS] * 4)
    rgb = a.put(a.V, np.full((3, 4), 0.5))
    dr.enable_grad(rgb)
    found = colored(own, rgb, ("kd", "kr"))
    dr.backward(dr.sum(dr.sum(found.kd) + 10 * dr.sum(found.kr) + 100 * dr.sum(found.ks)))
    assert np.allclose(np.array(dr.grad(rgb)).T, 1 + 10 * np.array(GLASS.kr))


def test_a_field_that_occurs_twice_is_refused() -> None:
    scene = Scene(materials={"m": GLASS}, camera=Camera(), lights={})
    assert replaced(scene, "materials.m.colored", ["kd", "ks"]).materials["m"].colored == ("kd", "ks")
    with pytest.raises(UserError, match=r"materials\.m\.colored = .*: has kd twice; name it once"):
        replaced(scene, "materials.m.colored", ["kd", "ks", "kd"])
    with pytest.raises(UserError, match=r"materials\.m\.colored\.0 = .*shininess"):
        replaced(scene, "materials.m.colored", ["shininess"])


def test_it_is_written_and_read(tmp_path) -> None:
    scene = Scene(
        materials={"m": replace(GLASS, colored=("kr", "ks"))},
        objects={"ball": Sphere(material="m")},
        camera=Camera(),
        lights={},
    )
    (tmp_path / "scene.json").write_text(dump(scene))
    assert load(tmp_path / "scene.json").materials == scene.materials


def test_a_material_that_shows_no_colour_says_why() -> None:
    assert Material().color_flaw() is None
    assert replace(GLASS, colored=("ks",)).color_flaw() is None
    assert Material(texture="t", colored=("ks",), ks=(1, 1, 1)).color_flaw() is None
    assert Material(texture="t").color_flaw() == "has a texture, which takes the place of the colour in kd"
    unseen = "shows no colour, as colored = {} names no field that is seen"
    assert Material(colored=()).color_flaw() == unseen.format([])
    assert Material(colored=("ks", "kr")).color_flaw() == unseen.format(["ks", "kr"])
    assert replace(GLASS, shading="unlit", colored=("ks", "ka")).color_flaw() == unseen.format(["ks", "ka"])
    assert replace(GLASS, shading="unlit").color_flaw() is None


def test_textures_are_left_as_they_are() -> None:
    scene = Scene(textures={"t": CheckerTexture()}, materials={"m": Material(texture="t")}, camera=Camera(), lights={})
    assert scene.materials["m"].with_color((0.0, 0.0, 0.0)).texture == "t"


# Data: layers whose colours are not those of their material.


def layered(material: Material, spp: int = 2, heat: tuple = (0.0, 1.0, 2.0, 3.0), **fields) -> vr.Scene:
    """A map with four balls in colours, and a ball that is written."""
    source = {"lon": [-90, 90, -90, 90], "lat": [40, 40, -40, -40], "heat": heat}
    layer = vr.DataLayer(source=source, gizmo="sphere", color="heat", radius=0.5, material="paint", **fields)
    scene = vr.Scene(
        camera=vr.Camera(origin=(0, 5, 3), target=(0, 0, 0), fov=50),
        film=vr.Film(width=32, height=24),
        background=(0.2, 0.3, 0.4),
        ambient=(0.2, 0.2, 0.2),
        lights={"key": vr.PointLight(position=(2, 6, 3))},
        materials={"paint": material},
        data=vr.Data(base=vr.MapBase(width=4.0), layers={"rain": layer}),
        settings=vr.Settings(spp=spp),
    )
    return checked(scene)


LOOKS = {
    "black without colours": Material(ka=(0, 0, 0), kd=(0, 0, 0), colored=("kd",)),
    "metal": Material(ka=(0, 0, 0), kd=(0, 0, 0), ks=(0.9, 0.9, 0.9), kr=(0.8, 0.8, 0.8), colored=("ks", "kr")),
    "glass": Material(kd=(0.02, 0.02, 0.02), kt=(0.9, 0.9, 0.9), colored=("kt", "ks"), ks=(0.4, 0.4, 0.4)),
    "sign": Material(shading="unlit", ka=(0, 0, 0)),
    "following": Material(kd=(0.3, 0.6, 0.9)),
    "following, only kd": Material(kd=(0.3, 0.6, 0.9), colored=("kd",)),
    "following, only ka": Material(kd=(0.3, 0.6, 0.9), colored=("ka",)),
}


@pytest.mark.parametrize("look", LOOKS)
def test_rows_in_colours_look_like_objects_in_these_colours(look: str) -> None:
    """Effects that only the colours need are simulated, and those of the material are not lost. A product with a colour
    has a rounding more than the product that a written material has."""
    of_data = layered(LOOKS[look])
    twin = written_out(of_data)
    assert features(of_data).names() == features(twin).names()
    a, b = (vr.render(prepare(x), progress=False) for x in (of_data, twin))
    assert np.allclose(a["RGB"], b["RGB"], rtol=1e-5)
    pixels = a["RGB"][np.array(a["id"]).reshape(24, 32) > 1]
    assert len(np.unique(pixels.round(3), axis=0)) > 10


@pytest.mark.parametrize("look", LOOKS)
def test_bounds_of_brightness_hold_for_the_colours(look: str) -> None:
    of_data = layered(LOOKS[look])
    mine, twin = (Brightness.of(prepare(x)) for x in (of_data, written_out(of_data)))
    rows = [bound for name, bound in twin.objects.items() if name.startswith("data:")]
    assert mine.objects["paint"] >= max(rows) * (1 - 1e-12)


def test_shares_of_colours_add_up_in_notes() -> None:
    """A kd that every colour replaces says nothing; colours and kr together do."""
    assert not energy_notes(layered(Material(kd=(0.7, 0.7, 0.7), kr=(0.1, 0.1, 0.1)), heat=(1, 1, 1, 1)))
    assert energy_notes(layered(Material(kd=(0, 0, 0), kr=(0.9, 0.9, 0.9))))[0].startswith("materials.paint: kr + kd")


def test_an_update_of_what_colours_change_is_a_new_scene() -> None:
    prepared = vr.prepare(layered(LOOKS["metal"]))
    change = {"materials.paint.colored": ("kd",)}
    updated = vr.render(prepared.updated(change), progress=False)["RGB"]
    assert np.array_equal(updated, vr.render(layered(replace(LOOKS["metal"], colored=("kd",))), progress=False)["RGB"])


def test_colours_that_are_not_seen_are_reported() -> None:
    scene = replace(layered(Material()), textures={"t": CheckerTexture()}, materials={"paint": Material(texture="t")})
    text = "data.layers.rain.color: is not seen, as materials.paint has a texture, which takes the place of the colour"
    with pytest.warns(DataWarning, match=text):
        vr.prepare(scene)


def test_the_story_of_a_pixel_has_the_colours() -> None:
    scene = layered(LOOKS["metal"], spp=1)
    image = vr.render(scene, progress=False)
    y, x = np.argwhere(np.array(image["id"]).reshape(24, 32) == 3)[0]
    first = vr.why(scene, int(x), int(y)).surfaces[0]
    color = scene.data.rows["rain"].color[:, int(first.object.split(".")[-1])]
    assert np.allclose(first.material["kr"], 0.8 * color, rtol=1e-6)
    assert np.allclose(first.material["ks"], 0.9 * color, rtol=1e-6)
