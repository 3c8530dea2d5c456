"""A ka that is not written follows kd, or the texture in its place: pictures, effects, derivatives and updates."""

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import pytest

import visray as vr
from visray.adaptive.brightness import Brightness
from visray.errors import UserError
from visray.features import features
from visray.scene.address import numeric_addresses
from visray.study.mitsuba.crosscheck import check

KD = (0.2, 0.5, 0.75)
CHECKER = vr.CheckerTexture(a=(0.9, 0.1, 0.3), b=(0.2, 0.8, 0.4), scale=(2.0, 2.0))
# Materials whose ka follows, each with the ka that it has then.
FOLLOWING = {
    "plain": (vr.Material(kd=KD), KD),
    "textured": (vr.Material(kd=KD, texture="tiles"), (1, 1, 1)),
    "keeping ka": (vr.Material(kd=KD, texture="tiles", textured="kd"), KD),
    "unlit": (vr.Material(kd=KD, shading="unlit"), KD),
    "shiny glass": (vr.Material(kd=KD, ks=(0.4, 0.3, 0.2), kt=(0.2, 0.2, 0.2), kr=(0.1, 0.1, 0.1)), KD),
}


def scene(material: vr.Material, light: float = 1.0, ambient: tuple = (0.4, 0.3, 0.2)) -> vr.Scene:
    """A wall that fills the picture. light: intensity of the only light"""
    return vr.Scene(
        camera=vr.Camera(origin=(0, 0, 5), fov=30.0),
        film=vr.Film(width=12, height=10),
        background=(0, 0, 0),
        ambient=ambient,
        textures={"tiles": CHECKER},
        materials={"m": material},
        lights={"key": vr.PointLight(position=(2, 3, 4), intensity=light, Ia=(0.1, 0.0, 0.2))},
        objects={"wall": vr.Rectangle(width=(8, 0, 0), height=(0, 8, 0), material="m")},
        settings=vr.Settings(spp=2, precision="double"),
    )


def picture(of: Any) -> np.ndarray:
    return vr.render(of, progress=False)["RGB"]


@pytest.mark.parametrize("name", FOLLOWING)
def test_it_is_the_same_picture_as_with_these_numbers(name: str) -> None:
    material, ka = FOLLOWING[name]
    mine, twin = scene(material), scene(replace(material, ka=ka))
    assert np.array_equal(picture(mine), picture(twin))
    assert features(mine).names() == features(twin).names()
    assert Brightness.of(vr.prepare(mine)) == Brightness.of(vr.prepare(twin))
    assert mine.materials["m"].resolved == twin.materials["m"]


def test_ambient_light_alone_shows_kd_or_the_texture() -> None:
    """Without light, a wall has the colour ambient x kd, or ambient x texture, but for rounding."""
    shown = np.unique(picture(scene(FOLLOWING["plain"][0], 0.0)).reshape(-1, 3), axis=0)
    assert np.allclose(shown, [np.multiply((0.4, 0.3, 0.2), KD)], rtol=1e-6)
    still = replace(scene(FOLLOWING["textured"][0], 0.0), settings=vr.Settings(spp=1, precision="double"))
    tiles = np.unique(picture(still).reshape(-1, 3), axis=0)
    expected = sorted(np.multiply((0.4, 0.3, 0.2), c).tolist() for c in (CHECKER.a, CHECKER.b))
    assert np.allclose(tiles, expected, rtol=1e-6)


def test_the_default_is_a_fifth_of_the_colour_in_shadow() -> None:
    assert vr.Scene(camera=vr.Camera(), lights={}).ambient == (0.2, 0.2, 0.2) and vr.Material().ka is None
    assert vr.Material().resolved.ka == vr.Material().kd


@pytest.mark.parametrize("name", FOLLOWING)
@pytest.mark.parametrize("address", ["materials.m.kd", "materials.m.kd.1"])
def test_derivatives_by_kd_are_those_of_both(name: str, address: str) -> None:
    of = scene(FOLLOWING[name][0])
    expected = vr.difference(of, address)
    found = vr.derivative(of, address, progress=False)
    assert np.allclose(found, expected, rtol=1e-6, atol=1e-8)
    reverse = vr.gradient(of, [address], progress=False)[address]
    assert np.allclose(np.sum(reverse), expected.mean(), rtol=1e-6, atol=1e-10)
    moves = name == "keeping ka" or name != "textured"
    assert (np.abs(expected).max() > 1e-3) == moves


def test_a_black_kd_has_a_derivative_through_ambient_light_alone() -> None:
    black = scene(vr.Material(kd=(0, 0, 0)), 0.0)
    assert not features(black)["ambient"] and features(black, ("materials.m.kd.0",))["ambient"]
    found = vr.derivative(black, "materials.m.kd.0", progress=False)
    assert np.allclose(found, (0.4, 0, 0), rtol=1e-12)
    own = scene(vr.Material(ka=(0, 0, 0), kd=(0, 0, 0)), 0.0)
    assert not features(own, ("materials.m.kd.0",))["ambient"]


def test_a_ka_that_follows_has_no_derivative_of_its_own() -> None:
    of = scene(vr.Material())
    assert "materials.m.ka" not in numeric_addresses(of) and "materials.m.kd" in numeric_addresses(of)
    assert vr.value(of, "materials.m.ka") is None
    with pytest.raises(UserError, match=r"materials\.m\.ka: has no derivative of its own, as ka follows kd; name kd"):
        vr.gradient(of, ["materials.m.ka"], progress=False)
    with pytest.raises(UserError, match=r"materials\.m\.ka: is null"):
        vr.difference(of, "materials.m.ka")


@pytest.mark.parametrize("colored", [("ka", "kd"), ("kd",), ("ka",)])
def test_derivatives_by_values_of_rows(colored: tuple) -> None:
    source = {"lon": [-60.0, 60.0], "lat": [0.0, 0.0], "heat": [0.301, 0.777]}
    rule = vr.ColorRule(column="heat", domain=(0.0, 1.0))
    layer = vr.DataLayer(source=source, gizmo="sphere", color=rule, radius=0.5, material="m")
    of = replace(
        scene(vr.Material(kd=KD, colored=colored)),
        camera=vr.Camera(origin=(0, 5, 3), fov=40.0),
        objects={},
        data=vr.Data(base=vr.MapBase(width=4.0), layers={"rain": layer}),
    )
    for address in ("data.rain.1.color", "materials.m.kd"):
        found, expected = vr.derivative(of, address, progress=False), vr.difference(of, address)
        assert np.allclose(found, expected, rtol=1e-5, atol=1e-7)


def test_an_update_changes_both_and_compiles_nothing() -> None:
    prepared = vr.prepare(scene(vr.Material(kd=KD)))
    picture(prepared), picture(prepared.updated({"materials.m.kd": (0.1, 0.2, 0.3)}))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        for change in ({"kd": (0.6, 0.1, 0.2)}, {"ka": (0.5, 0.4, 0.3)}, {"kd": "tomato"}, {"ka": 0.25, "kd": 0.5}):
            dr.kernel_history_clear()
            updated = prepared.updated({f"materials.m.{name}": x for name, x in change.items()})
            mine = picture(updated)
            assert all(k["cache_hit"] and not k["cache_disk"] for k in dr.kernel_history([dr.KernelType.JIT]))
            assert np.array_equal(mine, picture(updated.scene))


def test_mitsuba_agrees() -> None:
    for name in ("plain", "textured", "keeping ka"):
        assert check(scene(FOLLOWING[name][0])).passed


def test_the_story_of_a_pixel_has_the_numbers() -> None:
    story = vr.why(scene(FOLLOWING["plain"][0]), 5, 5).surfaces[0]
    assert np.allclose(story.material["ka"], KD)
