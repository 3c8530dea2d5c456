"""Palette colours in materials: what `colored` names, in Python and in the tables of kernels."""

from dataclasses import fields, replace
from itertools import combinations

import drjit as dr
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visray.errors import UserError
from visray.materials import COLORED, Material, colored
from visray.pack import pack
from visray.primitives import Sphere
from visray.pytree import rows
from visray.quantities import Arrays, quantities
from visray.scene.address import replaced
from visray.scene.load import load
from visray.scene.scene import Scene
from visray.scene.write import dump
from visray.textures import CheckerTexture

GLASS = Material(ka=(0.1, 0.2, 0.3), kd=(0.9, 0.8, 0.7), ks=(0.5, 0.6, 0.7), kr=(0.1, 0.2, 0.4), kt=(0.8, 0.7, 0.5))
CHOICES = [names for count in range(len(COLORED) + 1) for names in combinations(COLORED, count)]


def table(a: Arrays, materials: list[Material]) -> Material:
    """The materials as the packed table of a scene."""
    return pack(Scene(materials={f"m{k}": m for k, m in enumerate(materials)}), a).materials


@pytest.mark.parametrize("precision", ["single", "double"])
@settings(derandomize=True, deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_tables_are_coloured_as_single_materials_are(precision: str, seed: int) -> None:
    """Every choice of fields, each with a colour of its own: kd is equal, and products have one rounding."""
    # Eighths are exact, with 0 and 1 among them.
    colors = (np.random.default_rng(seed).integers(0, 9, (len(CHOICES), 3)) / 8).tolist()
    a = Arrays.of("llvm", precision)
    materials = [replace(GLASS, colored=names) for names in CHOICES]
    # The first material of a table is the default one.
    own = rows(table(a, materials), dr.arange(a.U, 1, 1 + len(CHOICES)))
    found = colored(own, a.put(a.V, np.array(colors).T))
    singles = [m.with_color(rgb) for m, rgb in zip(materials, colors)]
    for name in quantities(Material):
        expected = np.array([getattr(m, name) for m in singles]).T
        values = np.array(getattr(found, name)).astype(float)
        error = 3 * np.finfo(np.float32 if precision == "single" else float).eps / 2
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
    own = rows(table(a, [replace(GLASS, colored=("kd", "kr"))]), a.U(1))
    rgb = a.put(a.V, np.full((3, 4), 0.5))
    dr.enable_grad(rgb)
    found = colored(own, rgb)
    dr.backward(dr.sum(dr.sum(found.kd) + 10 * dr.sum(found.kr) + 100 * dr.sum(found.ks)))
    assert np.allclose(np.array(dr.grad(rgb)).T, 1 + 10 * np.array(GLASS.kr))


def test_a_field_that_occurs_twice_is_refused() -> None:
    scene = Scene(materials={"m": GLASS})
    assert replaced(scene, "materials.m.colored", ["kd", "ks"]).materials["m"].colored == ("kd", "ks")
    with pytest.raises(UserError, match=r"materials\.m\.colored = .*: has kd twice; name it once"):
        replaced(scene, "materials.m.colored", ["kd", "ks", "kd"])
    with pytest.raises(UserError, match=r"materials\.m\.colored\.0 = .*shininess"):
        replaced(scene, "materials.m.colored", ["shininess"])


def test_it_is_written_and_read(tmp_path) -> None:
    scene = Scene(materials={"m": replace(GLASS, colored=("kr", "ks"))}, objects={"ball": Sphere(material="m")})
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
    scene = Scene(textures={"t": CheckerTexture()}, materials={"m": Material(texture="t")})
    assert scene.materials["m"].with_color((0.0, 0.0, 0.0)).texture == "t"
