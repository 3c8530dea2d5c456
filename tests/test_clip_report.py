"""Notes about clips: surfaces that a clip cuts or misses, with the radius that holds them."""

import re
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visray.camera import Camera
from visray.clip_report import ClipWarning, clip_notes, extent
from visray.explaining import explain
from visray.polynomials.catalogue import SURFACES
from visray.primitives import Polynomial
from visray.primitives.clips import Ball, Block
from visray.primitives.instance import Instance
from visray.renderer import render
from visray.scene.scene import Film, Scene
from visray.setup import prepare


def note(expression: str, **more: Any) -> str:
    """The note about a polynomial surface; "" if there is none."""
    notes = clip_notes(Scene(objects={"h": Polynomial(expression=expression, **more)}, camera=Camera(), lights={}))
    assert all(n.startswith("objects.h: ") for n in notes)
    return "".join(notes)


def radius_of(text: str) -> float:
    return float(re.search(r'"clip": {"type": "sphere", "radius": ([\d.]+)}', text)[1])


# The corners of a rounded cube, its farthest points: on (1, 1, 1), 3 t^4 - 48 t^2 + 120 = 0.
CUBE, CORNER = "x^4 + y^4 + z^4 - 16*(x^2 + y^2 + z^2) + 120", np.sqrt(3 * (48 + np.sqrt(48**2 - 4 * 3 * 120)) / 6)
BALL_OF_6 = "x^2 + y^2 + z^2 - 36"


@pytest.mark.parametrize(
    ("expression", "reach"),
    [
        (CUBE, CORNER),
        ("x^2/36 + y^2/9 + z^2/4 - 1", 6.0),
        ("(x - 2)^2 + (y - 3)^2 + z^2 - 4", np.hypot(2, 3) + 2),
        ("(x^2 + y^2 + z^2 - 4) * ((x - 9)^2 + y^2 + z^2 - 1)", 10.0),  # of two factors, one inside
    ],
)
def test_a_default_clip_that_cuts(expression: str, reach: float) -> None:
    text = note(expression)
    assert "cuts the surface" in text and f"reaches {reach:.3g} " in text
    # Rounded up to two digits, after a thousandth for the search.
    assert reach <= radius_of(text) <= 1.001 * reach * 1.1
    assert not note(expression, clip=Ball(radius=radius_of(text)))


@pytest.mark.parametrize(
    ("expression", "nearest", "reach"),
    [
        (BALL_OF_6, 6.0, 6.0),
        ("(x - 20)^2 + y^2 + z^2 - 1/4", 19.5, 20.5),  # too small for a line from the origin to meet it
        ("x^2 + y^2 - 81", 9.0, np.inf),
        ("z - 7", 7.0, np.inf),
    ],
)
def test_a_default_clip_that_misses(expression: str, nearest: float, reach: float) -> None:
    text = note(expression)
    assert "no point of the surface is in its clip, a ball of radius 5 that is not written" in text
    # A line of 800 is off the nearest point by up to 1/14 of a radian.
    found = float(re.search(r"begins ([\d.]+) from", text)[1])
    assert 0.995 * nearest <= found <= nearest / np.cos(1 / 14) * 1.005
    if np.isfinite(reach):
        assert reach <= radius_of(text) <= 1.1 * reach
    assert "no point" not in note(expression, clip=Ball(radius=radius_of(text)))


def test_nothing_anywhere() -> None:
    text = note("x^2 + y^2 + z^2 + 1")
    assert "no point of the surface" in text and "f has the same sign everywhere" in text


@pytest.mark.parametrize(
    "expression",
    ["x^2 + y^2 - z^2", "x^2 + y^2 - 9", "z - 4", "x^3 + y^3 + z^3 - 1", "x^2*y^2 + y^2*z^2 + z^2*x^2 - 1"],
)
def test_what_goes_on_for_ever_is_cut_without_a_word(expression: str) -> None:
    assert not note(expression)


def test_a_surface_inside_has_no_note() -> None:
    assert not note("x^2 + y^2 + z^2 - 24.9")
    assert not note("(x - 3)^2 + y^2 + z^2 - 0.0001")


def test_clips_that_are_written_are_only_told_if_they_miss() -> None:
    assert not note(CUBE, clip=Ball(radius=5))
    assert note(BALL_OF_6, clip=Ball(radius=3)) == "objects.h: no point of the surface is in its clip; move the clip"
    assert note(BALL_OF_6, clip=Block(min=(4, 4, 4), max=(5, 5, 5)))
    assert not note(BALL_OF_6, clip=Block(min=(3, 3, 3), max=(5, 5, 5)))


def test_capped_solids_that_fill_their_clip() -> None:
    """The clip is seen: as it was written, or, by default, instead of the solid."""
    assert not note(BALL_OF_6, clip=Ball(radius=3), ends="capped")
    assert radius_of(note(BALL_OF_6, ends="capped")) == 6.1
    assert note("36 - x^2 - y^2 - z^2", clip=Ball(radius=3), ends="capped")


def test_geometries_have_addresses() -> None:
    ball = Polynomial(expression=BALL_OF_6)
    scene = Scene(
        geometries={"g": ball},
        objects={"one": Instance(geometry="g"), "two": Instance(geometry="g")},
        camera=Camera(),
        lights={},
    )
    (text,) = clip_notes(scene)
    assert text.startswith("geometries.g: ")


@pytest.mark.parametrize("name", SURFACES)
def test_known_surfaces_have_no_note(name: str) -> None:
    """And what the catalogue says of them is found: a compact surface is in its ball, the others are cut by it."""
    known, shape = SURFACES[name], Polynomial(surface=name)
    assert not clip_notes(Scene(objects={"s": shape}, camera=Camera(), lights={}))
    if known.compact and known.centre == (0, 0, 0) and known.radius < 2.4:
        default = Polynomial(expression=known.expression, parameters=shape.parameters)
        found = extent(default.compiled(), (5.0,) * 3, True, True)
        assert found.inside and found.reach <= known.radius * 1.01 and found.bounded


@given(
    st.tuples(*[st.floats(-15, 15)] * 3), st.floats(0.05, 12), st.tuples(*[st.floats(0.5, 2)] * 3)
)  # fmt: skip
@pytest.mark.slow
@settings(deadline=None, max_examples=25)
def test_ellipsoids_anywhere(centre: tuple, size: float, axes: tuple) -> None:
    """Against distances of points of the ellipsoid: what is told is true, and what must be told is told."""
    c, r = np.array(centre).round(3), (size * np.array(axes)).round(3)
    terms = (f"((({v}) - ({x}))/{s})^2" for v, x, s in zip("xyz", c, r))
    text = note(" + ".join(terms) + " - 1")
    rng = np.random.default_rng(0)
    p = rng.normal(size=(20_000, 3))
    far = np.linalg.norm(c + r * p / np.linalg.norm(p, axis=1, keepdims=True), axis=1)
    inside_it = bool((((c / r) ** 2).sum()) < 1)
    if far.max() < 4.9:
        assert not text
    elif far.max() > 5.1 and (far.min() < 4.9):
        assert "cuts" in text and radius_of(text) >= 0.99 * far.max()
    elif far.min() > 5.2 or (inside_it and far.min() > 5.1):
        assert "no point" in text and radius_of(text) >= 0.99 * far.max()


def test_pictures_warn() -> None:
    scene = Scene(
        objects={"h": Polynomial(expression=BALL_OF_6)}, film=Film(width=4, height=4), camera=Camera(), lights={}
    )
    with pytest.warns(ClipWarning, match="objects.h: no point of the surface is in its clip"):
        render(scene, spp=1, layers=("RGB",), progress=False)
    assert explain(scene).notes == tuple(clip_notes(scene))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        whole = replace(scene.objects["h"], clip=Ball(radius=7))
        prepare(replace(scene, objects={"h": whole}))
