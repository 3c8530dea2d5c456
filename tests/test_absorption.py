"""Absorption: light is lost by the length of its way in a solid, for cameras and in shadows, against exact chords."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import test_paths
from hypothesis import given
from hypothesis import strategies as st
from samples import NAMES, SAMPLES
from test_paths import BLACK, PRECISIONS, WHITE, plain, rays_at, seen, unit
from test_shadows import Room, chord, fitted, glass
from test_shadows import scene_of as shadow_scene

import visray as vr
from visray.absorption import let_through
from visray.features import features
from visray.geometry import gamma
from visray.quantities import Arrays
from visray.study.mitsuba.membership import inside

SIGMA = np.array((0.5, 1.0, 3.0))
# The closed kinds whose samples have exact chords, and all closed kinds.
SOLIDS = [n for n in NAMES if SAMPLES[n].posed.closed and hasattr(SAMPLES[n].twin, "interval")]
CLOSED = [n for n in NAMES if SAMPLES[n].posed.closed]
INK = plain(kt=WHITE, ior=1.0, absorption=tuple(SIGMA.tolist()))
CLEAR = plain(kt=WHITE, ior=1.0)


def scene_of(objects: dict, materials: dict, precision: str = "single", **more: Any) -> vr.Scene:
    """As test_paths.scene_of, with a camera, and without lights that are not given."""
    return test_paths.scene_of(objects, materials, precision, **{"camera": vr.Camera(), "lights": {}} | more)


@given(st.floats(0, 1e9), st.floats(0, 1e9), st.sampled_from(["single", "double"]))
def test_formula_is_the_law_of_beer(absorption: float, length: float, precision: str) -> None:
    a = Arrays.of(precision=precision)
    c = a.put(a.V, np.array((absorption, 0.0, 1.0))[:, None])
    found = np.array(let_through(c, a.put(a.D, np.array([length]))), float)[:, 0]
    x = np.array([float(np.array(c.x)[0]) * length, 0, length])
    tiny = 2.0**-126 if precision == "single" else 2.0**-1022
    assert (np.abs(found - np.exp(-x)) <= gamma(4, precision) * (1 + x) * np.exp(-x) + tiny).all()
    assert found[1] == 1


def test_what_does_not_absorb_lets_all_light_through_an_endless_way() -> None:
    a = Arrays.of()
    assert np.array_equal(np.array(let_through(a.put(a.V, np.array((0.0, 1e-9, 1e9))[:, None]), a.D(np.inf)))[:, 0],
                          [1, 0, 0])  # fmt: skip


def within(found: np.ndarray, low: np.ndarray, high: np.ndarray, sure: np.ndarray, precision: str) -> None:
    """Whether colours are exp(-sigma d) for lengths between low and high, up to some roundings."""
    darkest, brightest = (np.exp(-SIGMA * np.asarray(x, float)[:, None]) for x in (high, low))
    slack = gamma(24, precision) * (1 + SIGMA * np.asarray(high, float)[:, None])
    assert (found >= darkest * (1 - slack))[sure].all() and (found <= brightest * (1 + slack))[sure].all()
    assert sure.mean() > 0.9


@PRECISIONS
@pytest.mark.parametrize("name", SOLIDS)
def test_cameras_see_through_a_solid_by_its_thickness(name: str, precision: str) -> None:
    """A solid of the index 1 before a white sky: exp(-sigma d), d exactly as long as the chord."""
    rng = np.random.default_rng(1)
    thing = replace(fitted(rng, name, np.zeros(3), 1.0, True), material="ink")
    o, d = rays_at(rng, 400, 0.9)
    c = chord(thing, o, 20 * unit(d), gamma(16) * 20)
    found = seen(scene_of({"t": thing}, {"ink": INK}, precision, background=WHITE, depth=6), o, d)
    within(found, 20 * c.low, 20 * c.high, c.met | c.missed, precision)
    assert c.met.mean() > 0.05


@PRECISIONS
@pytest.mark.parametrize("name", SOLIDS)
def test_shadows_of_a_solid_are_by_its_thickness(name: str, precision: str) -> None:
    """kt (1 - d / dmax) exp(-sigma d) in the shadow of point lights and of lights far away."""
    rng, kt = np.random.default_rng(2), (1.0, 0.5, 0.25)
    for how in ("from the light", "from afar"):
        room = Room.of(rng, 300, how)
        thing = replace(fitted(rng, name, room.middle, room.size, True), material="glass")
        sigma, dmax = SIGMA / room.size, 10 * room.size
        ink = replace(glass(dmax, kt), absorption=tuple(sigma.tolist()))
        scene = shadow_scene(
            {"floor": room.floor, "thing": thing}, {"l": room.lamp}, {"glass": ink}, precision=precision
        )
        c, far = room.chords([thing], precision)[0], np.linalg.norm(room.ways[1], axis=1)[:, None]
        low, high = (np.asarray(x, float)[:, None] * far for x in (c.low, c.high))
        darkest, brightest = (
            np.where(c.met[:, None], np.array(kt) * (1 - np.minimum(x / dmax, 1)) * np.exp(-sigma * x), 1)
            * room.cosine[:, None]
            for x in (high, low)
        )
        found, sure = room.seen(replace(scene, camera=vr.Camera())), c.met | c.missed
        slack = gamma(30, precision) * (1 + sigma * high) + room.slip(precision) / room.size
        assert (found >= darkest * (1 - slack))[sure].all() and (found <= brightest * (1 + slack))[sure].all()
        assert sure.mean() > 0.8 and c.met.mean() > 0.01


def pocket(thing: Any, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """A ball that lies in a solid: its middle and its radius."""
    for radius in 0.5 ** np.arange(1, 8):
        middles = rng.uniform(-1, 1, (300, 3))
        rim = radius * unit(rng.normal(size=(60, 3)))
        free = inside(thing, (middles[:, None] + rim).reshape(-1, 3)).reshape(300, 60).all(1)
        if free.any():
            return middles[free][0], radius
    raise AssertionError("the sample has no room inside")


@PRECISIONS
@pytest.mark.parametrize("name", CLOSED)
def test_light_between_two_points_in_a_solid_is_absorbed_too(name: str, precision: str) -> None:
    """Eye, lamp and a disk inside of a solid: no surface is crossed, and both ways count."""
    thing = SAMPLES[name].posed
    middle, r = pocket(thing, np.random.default_rng(3))
    eye, lamp, spot = (middle + 0.5 * r * np.array(v) for v in ((1, 1, 0), (-1, 1, 0), (0, -1, 0)))
    sigma = SIGMA / r
    disk = vr.Disk(center=tuple(spot.tolist()), normal=(0.0, 1.0, 0.0), radius=0.1 * r, material="disk")
    found = []
    for absorption in (tuple(sigma.tolist()), BLACK):
        materials = {"ink": replace(INK, absorption=absorption), "disk": plain(kd=WHITE)}
        scene = scene_of({"thing": replace(thing, material="ink"), "disk": disk}, materials, precision,
                         lights={"l": vr.PointLight(position=tuple(lamp.tolist()))})  # fmt: skip
        found.append(seen(scene, eye, spot - eye)[0])
    way = np.linalg.norm(spot - eye) + np.linalg.norm(spot - lamp)
    assert found[1].min() > 0.5
    # The shadow ray begins where it is sure to be clear of the disk: at some roundings of the coordinates.
    slack = gamma(24, precision) * (1 + 3 * way / r) + gamma(100) * sigma.max()
    assert np.abs(found[0] / found[1] / np.exp(-sigma * way) - 1).max() <= slack


# By hand, along an axis

BIG, SMALL = vr.Sphere(radius=2.0, material="big"), vr.Sphere(material="small")
WHITE_BALL = vr.Sphere(material="white")


def along_axis(
    big: vr.Material, small: vr.Material, inner: Any = SMALL, o: tuple = (9, 0, 0), **more: Any
) -> np.ndarray:
    materials = {"big": big, "small": small, "white": plain(kd=WHITE, shading="unlit")}
    scene = scene_of({"big": BIG, "inner": inner}, materials, "double", background=WHITE, depth=9, **more)
    assert features(scene)["absorption"] and features(scene)["nested media"]
    return seen(scene, o, (-1, 0, 0))[0]


@pytest.mark.parametrize(
    ("big", "small", "inner", "o", "length"),
    [
        (CLEAR, INK, SMALL, (9, 0, 0), 2),
        (INK, CLEAR, SMALL, (9, 0, 0), 2),
        (INK, INK, SMALL, (9, 0, 0), 4),
        (replace(INK, priority=1.0), CLEAR, SMALL, (9, 0, 0), 4),
        (replace(CLEAR, priority=1.0), INK, SMALL, (9, 0, 0), None),
        (INK, CLEAR, WHITE_BALL, (9, 0, 0), 1),
        (INK, CLEAR, WHITE_BALL, (1.25, 0, 0), 0.25),
        (INK, CLEAR, SMALL, (1.5, 0, 0), 1.5),
        (CLEAR, INK, SMALL, (0.5, 0, 0), 1.5),
        (INK, CLEAR, SMALL, (0.5, 0, 0), 1),
        (INK, CLEAR, replace(SMALL, center=(2.0, 0, 0)), (9, 0, 0), 3),
    ],
)
def test_the_medium_that_counts_absorbs(big: Any, small: Any, inner: Any, o: tuple, length: float | None) -> None:
    """Of solids in each other, that of the lowest rank: the smaller one, or the one with the higher priority."""
    if length is None:
        materials = {"big": big, "small": small}
        scene = scene_of({"big": BIG, "inner": inner}, materials, "double", background=WHITE, depth=9)
        assert np.array_equal(seen(scene, o, (-1, 0, 0))[0], WHITE)
        return
    assert np.abs(along_axis(big, small, inner, o) - np.exp(-SIGMA * length)).max() <= gamma(32)


def test_a_slab_is_darker_the_more_light_slants() -> None:
    """Refracted: the way inside is 1 / cos of the angle behind, by Snell's law; times kt twice."""
    slab = {"slab": vr.Box(min=(-1e3, -1e3, 0), max=(1e3, 1e3, 1), material="ink")}
    ink = replace(INK, ior=1.5, kt=(0.9, 0.8, 0.7))
    for degrees in (0, 20, 50, 80):
        angle = np.radians(degrees)
        d = (np.sin(angle), 0, -np.cos(angle))
        way = 1 / np.sqrt(1 - (np.sin(angle) / 1.5) ** 2)
        found = seen(scene_of(slab, {"ink": ink}, "double", background=WHITE, depth=3), (0, 0, 3), d)
        assert np.abs(found - np.array(ink.kt) ** 2 * np.exp(-SIGMA * way)).max() <= gamma(64)


def test_an_absorbing_core_in_clear_glass_casts_its_own_shadow_only() -> None:
    """Straight down: 2 units of ink in 4 of clear glass; and ink of 4 units around a clear core counts whole."""
    lights = {"l": vr.DirectionalLight(direction=(0.0, -1.0, 0.0))}
    floor = vr.Plane(point=(0, -3, 0), material="white")
    for big, small, length in ((CLEAR, INK, 2), (INK, CLEAR, 4)):
        materials = {"big": big, "small": small, "white": plain(kd=WHITE)}
        scene = scene_of({"floor": floor, "big": BIG, "small": SMALL}, materials, "double", lights=lights, depth=0)
        found = seen(scene, (0, -2.5, 0), (0, -1, 0))
        # A dmax of 1e9 takes 2e-9 and 4e-9 of the light.
        assert np.abs(found - np.exp(-SIGMA * length) * (1 - 2e-9) * (1 - 4e-9)).max() <= gamma(32)


def test_opaque_and_flat_objects_absorb_nothing() -> None:
    """An opaque ball with absorption in glass, and a pane: the bits are those without it."""
    o, d = rays_at(np.random.default_rng(4), 500, 1.5)
    things = {"big": BIG, "ball": WHITE_BALL, "pane": vr.Disk(center=(0, 0, 3), normal=(0, 0, 1), material="pane")}
    found = []
    for absorption in (BLACK, (1.0, 2.0, 3.0)):
        materials = {"big": CLEAR, "white": plain(kd=WHITE, shading="unlit", absorption=absorption),
                     "pane": replace(CLEAR, absorption=absorption)}  # fmt: skip
        found.append(seen(scene_of(things, materials, background=WHITE, depth=9), o, d))
    assert np.array_equal(*found)


@pytest.mark.parametrize("name", CLOSED)
def test_another_solid_far_away_changes_no_bit(name: str) -> None:
    """With a second transparent solid, media are looked for among all solids; with one, the hit itself knows them."""
    o, d = rays_at(np.random.default_rng(5), 400, 0.9)
    thing = replace(SAMPLES[name].posed, material="ink")
    far = vr.Sphere(center=(99, 0, 0), material="small")
    found = [
        seen(scene_of({"a": thing} | more, {"ink": INK, "small": CLEAR}, "double", background=WHITE, depth=60), o, d)
        for more in ({}, {"far": far})
    ]
    assert np.array_equal(*found)
    assert found[0].min() < 0.999
