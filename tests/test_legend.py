"""Legends: they say what is true of the data, are legible, and never overlap."""

import io
import itertools
import logging
import subprocess
import sys
import warnings
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image as Pillow

from visray.data.color_rule import ColorRule
from visray.data.palette import palette_of
from visray.legend.bars import bar_of
from visray.legend.boxes import Box
from visray.legend.drawing import HALO, INKS, Drawn, drawn
from visray.legend.fonts import BASE, UNKNOWN, Pen, fonts_for
from visray.legend.layout import LEAST_SIDE
from visray.legend.parts import ColorBar, LegendContent, Place, SizeScale
from visray.legend.ticks import MOST, number_text, round_values, round_values_of_log, ticks_of
from visray.output.curves import LUMINANCE, curve, linear
from visray.output.image import Image

POSITIONS = ("right", "left", "bottom")
VALUES = np.linspace(0.0, 2000.0, 41)


def bar(label: str = "Rain (mm)", **rule) -> ColorBar:
    values = rule.pop("values", VALUES)
    return bar_of(label, ColorRule(column="x", **rule).resolved(values), values)


def full(**changes) -> LegendContent:
    """A legend with three palettes, two scales of sizes, texts and places."""
    bars = (
        bar(over="red", domain=(0.0, 1500.0), values=np.append(VALUES, np.nan)),
        bar("Population, on a logarithmic scale", palette="magma", norm="log", values=10 ** np.linspace(3, 7, 9)),
        bar("Change of temperature", palette="RdBu", bands=6, domain=(-3.0, 3.0)),
    )
    sizes = (
        SizeScale("Height: inhabitants", "bar", (("100,000", 4.0), ("500,000", 20.0), ("1M", 40.0))),
        SizeScale("Magnitude", "disk", (("2", 4.0), ("4", 12.0), ("6", 24.0))),
    )
    places = tuple(Place(f"Place {i}", 40.0 + 37 * i % 260, 40.0 + 53 * i % 140, i % 2 == 0) for i in range(12))
    whole = LegendContent("A title", "And a subtitle", "Source: us", bars, sizes, places)
    return replace(whole, **changes)


def shown(picture: Drawn) -> np.ndarray:
    """Colours for a screen, not premultiplied, and alpha. Shape: (H, W, 4)."""
    a = picture.pixels[..., 3:].astype(float)
    light = np.divide(picture.pixels[..., :3], a, out=np.zeros((*a.shape[:2], 3)), where=a > 0)
    return np.concatenate([curve(np.clip(light, 0, 1), "srgb"), a], axis=2)


def boxes(picture: Drawn) -> list[Box]:
    return [box for _, box in picture.layout.boxes] + [label.box for label in picture.layout.labels]


# Colour bars


@pytest.mark.parametrize("name", ["viridis", "magma", "RdBu", "tab10", "turbo"])
def test_a_bar_has_the_colours_of_its_palette(name: str) -> None:
    """In each pixel those that matplotlib has there, to 1/255, and no transparency."""
    content = LegendContent(bars=(bar(palette=name),))
    picture = drawn(content, 640, 360)
    (strip,) = picture.layout.keys[0].strips
    left, top, right, bottom = map(int, strip.box)
    pixels = shown(picture)[top:bottom, left:right]
    t = (np.arange(right - left) + 0.5) / (right - left)
    assert (pixels[..., 3] == 1).all()
    assert np.abs(pixels[..., :3] - palette_of(name).srgb(t)).max() <= 1 / 255
    # matplotlib takes one of 256 colours, and visray blends two of them.
    table = matplotlib.colormaps[name](np.arange(matplotlib.colormaps[name].N))[:, :3]
    step = np.abs(np.diff(table, axis=0)).max() if len(table) == 256 else 0
    assert np.abs(pixels[..., :3] - matplotlib.colormaps[name](t)[:, :3]).max() <= 1 / 255 + step


@pytest.mark.parametrize("rule", [{}, {"norm": "log"}, {"norm": "power"}, {"norm": "quantile"}, {"bands": 5}])
def test_a_bar_shows_the_colour_that_the_rule_gives_to_a_value(rule: dict) -> None:
    """At each pixel, to 1/255: a value of the data has the colour that the strip has at its place."""
    values = np.array([1.0, 3, 4, 20, 21, 22, 500, 1000])
    content = LegendContent(bars=(bar(values=values, **rule),))
    resolved = ColorRule(column="x", **rule).resolved(values)
    picture = drawn(content, 640, 360)
    strip = picture.layout.keys[0].strips[0].box
    n = int(strip.right - strip.left)
    at = (np.arange(n) + 0.5) / n
    if resolved.bands is not None:
        middles = 0.5 * (resolved.bands[1:] + resolved.bands[:-1])
        expected = resolved.srgb(middles[(at * len(middles)).astype(int)])
    else:
        expected = resolved.srgb(resolved.value(at))
    found = shown(picture)[int(strip.top), int(strip.left) : int(strip.right), :3]
    assert np.abs(found - expected).max() <= 1 / 255


def test_ticks_are_where_their_values_are() -> None:
    """The mark of a tick is in the colour of the text, in the pixel of its value."""
    content = LegendContent(bars=(bar(domain=(0.0, 2000.0)),), theme="light", size=1.4)
    picture = drawn(content, 640, 360)
    (key,) = picture.layout.keys
    strip = key.strips[0].box
    marks = {t.text: x for t, (x, _, _) in zip(key.texts[1:], key.ticks)}
    assert marks
    for text, x in marks.items():
        value = float(text.replace(",", ""))
        assert x == pytest.approx(strip.left + (strip.right - strip.left) * value / 2000)
        column = shown(picture)[int(strip.bottom) + 2, int(x) - 2 : int(x) + 3]
        # The mark is as wide as a pixel, and lies in two of them.
        assert column[:, :3].min() < 0.6


def test_ticks_of_each_norm() -> None:
    def said(values, **rule) -> list[tuple[float, str]]:
        resolved = ColorRule(column="x", **rule).resolved(np.array(values, float))
        return [(round(tick.position, 6), tick.text) for tick in ticks_of(resolved)]

    assert said([0, 1000]) == [(i / 5, text) for i, text in enumerate(["0", "200", "400", "600", "800", "1,000"])]
    assert said([1, 1e6], norm="log") == [
        (round(i / 6, 6), text) for i, text in enumerate(["1", "10", "100", "1,000", "10,000", "100,000", "1M"])
    ]
    minus = "\N{MINUS SIGN}"
    assert said([-3, 3], bands=3) == [(0, f"{minus}3"), (0.333333, f"{minus}1"), (0.666667, "1"), (1, "3")]
    assert said([0, 50], bands=(0.0, 5.0, 50.0)) == [(0, "0"), (0.5, "5"), (1, "50")]
    assert said([1, 2, 3, 40, 500], norm="quantile") == [(0, "1"), (0.25, "2"), (0.5, "3"), (0.75, "40"), (1, "500")]
    assert said([0, 4], norm="power") == [(0, "0"), (0.5, "1"), (0.707107, "2"), (0.866025, "3"), (1, "4")]
    assert said([-8, 2], norm="symmetric") == [(0.1875, f"{minus}5"), (0.5, "0"), (0.8125, "5")]
    assert said([7, 7]) == [(0.5, "7")]
    assert said([np.nan]) == [(0.5, "0")]


def value_of(text: str) -> float:
    """The number that a text of a tick means."""
    text = text.replace(",", "").replace("\N{MINUS SIGN}", "-")
    front, times, power = text.partition("10") if any(c in "⁻⁰¹²³⁴⁵⁶⁷⁸⁹" for c in text) else (text, "", "")
    if times:
        digits = power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
        mantissa = front.rstrip("\N{MULTIPLICATION SIGN}")
        return float(f"{mantissa + '1' if mantissa in ('', '-') else mantissa}e{digits}")
    return float(text[:-1]) * 1e6 if text.endswith("M") else float(text)


SIZES = st.floats(-1e12, 1e12) | st.floats(-1.0, 1.0) | st.integers(-(10**6), 10**6).map(float)


@given(a=SIZES, b=SIZES)
@settings(max_examples=300, deadline=None, derandomize=True)
def test_round_values_lie_between_their_limits_and_are_round(a: float, b: float) -> None:
    lo, hi = sorted((a, b))
    if not hi - lo > 1e-9 * max(abs(lo), abs(hi)):
        return
    values = round_values(lo, hi)
    assert 2 <= len(values) <= MOST
    assert all(lo <= v <= hi for v in values) and values == sorted(set(values))
    steps = np.diff(values)
    assert np.allclose(steps, steps[0], rtol=1e-5)
    # One digit: 1, 2 or 5.
    assert f"{steps[0]:.3e}"[:5] in ("1.000", "2.000", "5.000")
    for v in values:
        assert value_of(number_text(v)) == pytest.approx(v, rel=1e-11, abs=0)


@given(lo=st.floats(1e-12, 1e12), factor=st.floats(1.001, 1e12))
@settings(max_examples=300, deadline=None, derandomize=True)
def test_round_values_of_a_logarithmic_bar(lo: float, factor: float) -> None:
    values = round_values_of_log(lo, lo * factor)
    assert len(values) >= 2 and values == sorted(set(values))
    assert all(lo <= v <= lo * factor for v in values)


def test_what_is_beyond_a_palette_is_shown_only_if_there_is_such_a_value() -> None:
    beyond = {"under": "#ff0000", "over": "#00ff00", "missing": "#0000ff", "domain": (0.0, 1.0)}
    inside = bar(values=np.array([0.2, 0.8]), **beyond)
    assert inside.under is inside.over is inside.missing is None
    all_three = bar(values=np.array([-1, 0.5, 2, np.nan]), **beyond)
    assert (all_three.under, all_three.over, all_three.missing) == ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    picture = drawn(LegendContent(bars=(all_three,), no_data="sin datos"), 640, 360)
    pixels, strip = shown(picture), picture.layout.keys[0].strips[0].box
    middle = int(strip.top + strip.bottom) // 2
    assert pixels[middle, int(strip.left) - 4].tolist() == pytest.approx([1, 0, 0, 1], abs=1 / 255)
    assert pixels[middle, int(strip.right) + 3].tolist() == pytest.approx([0, 1, 0, 1], abs=1 / 255)
    patch = picture.layout.keys[0].shapes[-1].points
    x, y = (int(np.mean([p[i] for p in patch])) for i in (0, 1))
    assert pixels[y, x].tolist() == pytest.approx([0, 0, 1, 1], abs=1 / 255)
    assert "sin datos" in [line.text for line in picture.layout.keys[0].texts]


# Sizes


def test_a_scale_shows_sizes_in_pixels() -> None:
    """Areas of the shapes: heights times a width that is the same for all, and disks and squares."""
    entries = (("1", 10.0), ("2", 20.0), ("3", 30.0))
    for shape, areas in (("bar", None), ("disk", [np.pi * r * r for r in (5, 10, 15)]), ("square", [100, 400, 900])):
        content = LegendContent(sizes=(SizeScale("", shape, entries),), theme="light")
        with_text = drawn(content, 640, 360)
        blank = replace(content.sizes[0], entries=tuple((" ", size) for _, size in entries))
        picture = drawn(replace(content, sizes=(blank,)), 640, 360)
        pixels = picture.pixels[..., 3].astype(float)
        # Over the panel, alpha is 1 - (1 - shape) (1 - panel).
        cover = (1 - (1 - pixels) / (1 - INKS["light"].panel[3])) / INKS["light"].shape[3]
        found = []
        for part in picture.layout.keys[0].shapes:
            xs = [p[0] for p in part.points]
            r = 0 if shape != "disk" else part.points[1][0] - part.points[0][0]
            left, right = (min(xs), max(xs)) if shape != "disk" else (xs[0] - r, xs[0] + r)
            found.append(cover[:, int(left) - 1 : int(right) + 2].clip(0, 1)[_inside_of(picture)].sum())
        if areas is None:
            areas = [found[0] * k for k in (1, 2, 3)]
        assert found == pytest.approx(areas, rel=0.03)
        assert [t.text for t in with_text.layout.keys[0].texts] == ["1", "2", "3"]


def _inside_of(picture: Drawn) -> slice:
    """Rows of the first panel without its round corners."""
    (panel,) = picture.layout.panels
    return slice(int(panel.top) + 6, int(panel.bottom) - 6)


# The picture


@pytest.mark.parametrize("position", POSITIONS)
def test_the_picture_is_premultiplied_and_empty_away_from_the_legend(position: str) -> None:
    picture = drawn(full(position=position), 640, 360)
    pixels = picture.pixels
    assert pixels.shape == (360, 640, 4) and pixels.dtype == np.float32
    assert (pixels >= 0).all() and (pixels <= 1).all()
    assert (pixels[..., :3] <= pixels[..., 3:]).all()
    near = np.zeros((360, 640), bool)
    margin = HALO * 2 * picture.layout.em
    for left, top, right, bottom in boxes(picture):
        near[max(0, int(top - margin)) : int(bottom + margin) + 1,
             max(0, int(left - margin)) : int(right + margin) + 1] = True  # fmt: skip
    for label in picture.layout.labels:
        if label.dot:
            x, y, r = label.dot
            near[int(y - r) - 2 : int(y + r) + 3, int(x - r) - 2 : int(x + r) + 3] = True
    assert near.any() and not near.all()
    assert (pixels[~near] == 0).all()
    assert (pixels[near][:, 3] > 0).any()


def test_a_png_is_the_picture_with_the_legend_blended_as_on_a_screen() -> None:
    """Over black and over white, against Pillow's own compositing of the legend's file, to 1/255."""
    layer = drawn(full(), 640, 360).pixels
    for grey in (0.0, 1.0, 0.18):
        rgb = np.full((360, 640, 3), grey, np.float32)
        image = Image({"RGB": rgb, "A": np.ones((360, 640), np.float32), "legend": layer})
        alone = Pillow.open(io.BytesIO(image.legend().png()))
        assert alone.mode == "RGBA"
        below = Pillow.fromarray(np.dstack([image.display(legend=False), np.full((360, 640), 255, np.uint8)]))
        below.alpha_composite(alone)
        expected = np.asarray(below)[..., :3].astype(int)
        found = np.asarray(Pillow.open(io.BytesIO(image.png()))).astype(int)
        assert np.abs(found - expected).max() <= 1
        assert (np.asarray(Pillow.open(io.BytesIO(image.png(legend=False)))) == image.display(legend=False)).all()
        assert np.abs(found - image.display(legend=False).astype(int)).max() > 100


def test_over_a_transparent_film_alpha_adds_up() -> None:
    layer = drawn(full(), 640, 360).pixels
    half = np.full((360, 640), 0.5, np.float32)
    image = Image({"RGB": np.full((360, 640, 3), 0.25, np.float32), "A": half, "legend": layer})
    found = image.display().astype(int)
    expected = layer[..., 3] + 0.5 * (1 - layer[..., 3].astype(float))
    assert np.abs(found[..., 3] - 255 * expected).max() <= 0.5 + 1e-3
    (strip,) = drawn(full(), 640, 360).layout.keys[0].strips
    assert np.abs(found[int(strip.box.top), int(strip.box.left), :3] / 255 - strip.pixels[0]).max() <= 1 / 255


def test_exposure_and_gamma_leave_the_legend_legible() -> None:
    """The legend is not exposed; with another display curve its light stays the same."""
    layer = drawn(full(), 640, 360).pixels
    image = Image({"RGB": np.zeros((360, 640, 3), np.float32), "legend": layer})
    assert (image.display(exposure=5) == image.display()).all()
    opaque = layer[..., 3] == 1
    found = linear(image.display(2.2)[opaque] / 255, 2.2)
    assert np.abs(found - layer[opaque][:, :3]).max() <= 0.01


def test_a_layer_that_is_no_legend_is_refused() -> None:
    rgb = np.zeros((4, 5, 3), np.float32)
    with pytest.raises(
        Exception, match=r"layer 'legend' has the shape \(4, 5, 3\); right would be \(height, width, 4\)"
    ):
        Image({"RGB": rgb, "legend": rgb}).display()
    with pytest.raises(Exception, match=r"it has no legend; render a scene with data\.legend"):
        Image({"RGB": rgb}).legend()


def test_the_same_legend_has_the_same_bits() -> None:
    first, second = (drawn(full(), 640, 360).pixels for _ in range(2))
    assert first.tobytes() == second.tobytes()


# Where things lie

LONG = "An extraordinarily long text about everything that was ever measured anywhere, in any unit and at any time. "


@pytest.mark.parametrize("position", POSITIONS)
@pytest.mark.parametrize("size", [(640, 360), (1920, 1080), (320, 200), (360, 640), (200, 900), (900, 170), (160, 160)])
@pytest.mark.parametrize("many", [1, 4])
def test_nothing_overlaps(position: str, size: tuple[int, int], many: int) -> None:
    width, height = size
    bars = (*full().bars * many, bar("كمية الأمطار في السنة"))
    content = full(position=position, bars=bars, title=LONG * many, subtitle="هطول الأمطار", source=LONG * many)
    picture = drawn(content, width, height)
    placed = boxes(picture)
    assert placed
    for box in placed:
        assert box.inside(width, height)
    for a, b in itertools.combinations(placed, 2):
        assert not a.overlaps(b)
    pen = Pen(fonts_for(content.texts()))
    panels = picture.layout.panels
    for key in picture.layout.keys:
        lines = []
        for line in key.texts:
            wide = pen.width(line.text, line.size)
            left = line.x - wide * {"left": 0, "center": 0.5, "right": 1}[line.align]
            lines.append(Box(left, line.y - 0.75 * line.size, left + wide, line.y + 0.2 * line.size))
        for box in (*lines, *(strip.box for strip in key.strips)):
            assert any(p.left <= box.left and box.right <= p.right and p.top <= box.top and box.bottom <= p.bottom
                       for p in panels)  # fmt: skip
        for a, b in itertools.combinations((*lines, *(strip.box for strip in key.strips)), 2):
            assert not a.overlaps(b)


def test_what_has_no_room_is_told() -> None:
    whole = full()
    picture = drawn(full(bars=whole.bars * 6, title=LONG * 9), 320, 200)
    assert any(note.startswith("legend: the title is too long, and cut") for note in picture.notes)
    assert any("320 x 200 pixels have no room for the key of" in note for note in picture.notes)
    places = tuple(Place(f"Place {i}", 100.0, 100.0) for i in range(20))
    picture = drawn(full(bars=(), sizes=(), places=places), 320, 200)
    assert 1 <= len(picture.layout.labels) <= 8
    left_out = 20 - len(picture.layout.labels)
    assert any(f"legend: {left_out} of 20 names of places have no room: Place " in note for note in picture.notes)


def test_a_tiny_film_has_no_legend_and_a_note() -> None:
    for size in ((LEAST_SIDE - 1, 400), (400, LEAST_SIDE - 1), (1, 1)):
        picture = drawn(full(), *size)
        assert picture.pixels.shape == (size[1], size[0], 4) and not picture.pixels.any()
        (note,) = picture.notes
        assert note == f"legend: left out, because {size[0]} x {size[1]} pixels are too few for text; give 160 or more"


def test_names_stand_beside_their_points_in_order() -> None:
    """The first place has the best position; one at the right edge is named on its left."""
    places = (Place("first", 100.0, 100.0), Place("second", 100.0, 100.0), Place("edge", 318.0, 150.0))
    one, two, edge = drawn(LegendContent(places=places), 320, 200).layout.labels
    assert one.box.left > 100 and two.box.right < 100 and edge.box.right < 318
    assert [label.line.text for label in (one, two, edge)] == ["first", "second", "edge"]


# Legibility


def contrast(a: np.ndarray, b: np.ndarray) -> float:
    """Ratio of the luminances of two colours for a screen. Source: WCAG 2.2, contrast ratio."""
    one, two = sorted(float(linear(np.asarray(c, float)) @ LUMINANCE) for c in (a, b))
    return (two + 0.05) / (one + 0.05)


@pytest.mark.parametrize("theme", INKS)
@pytest.mark.parametrize("grey", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_text_is_legible_over_any_grey(grey: float, theme: str) -> None:
    """Also where the theme is that of another part of the picture: text in a panel has the contrast 4.5 or more, as the
    guidelines for web pages ask, and so has text on its halo."""
    picture = drawn(full(theme=theme), 640, 360)
    (panel,) = picture.layout.panels
    corner = shown(picture)[int(panel.top) + 3, int(panel.left + panel.right) // 2]
    ink = INKS[theme]
    assert np.abs(np.array(ink.panel) - corner).max() <= 1.5 / 255
    for r, g, b, a in (corner, ink.halo):
        behind = np.array((r, g, b)) * a + grey * (1 - a)
        for text in (ink.text, ink.faint):
            assert contrast(text[:3], behind) >= 4.5


@pytest.mark.parametrize(("grey", "theme"), [(0.0, "dark"), (0.3, "dark"), (0.6, "light"), (1.0, "light")])
def test_the_theme_is_that_of_the_picture_below(grey: float, theme: str) -> None:
    below = np.full((360, 640, 3), linear(np.array(grey)))
    assert drawn(full(), 640, 360, below).pixels.tobytes() == drawn(full(theme=theme), 640, 360).pixels.tobytes()


def test_the_theme_can_be_chosen() -> None:
    dark = np.zeros((360, 640, 3))
    assert drawn(full(theme="dark"), 640, 360).pixels.tobytes() == drawn(full(), 640, 360, dark).pixels.tobytes()
    assert drawn(full(theme="light"), 640, 360, dark).pixels.tobytes() == drawn(full(), 640, 360).pixels.tobytes()


# Scripts


def test_letters_of_many_scripts_are_drawn() -> None:
    for text in ("Łódź", "Среднее", "Μέση", "שלום", "هطول الأمطار", "ẞ→≤", "$x^2$ costs $5"):
        fonts = fonts_for([text])
        assert fonts.families == (BASE,) and not fonts.missing and not fonts.notes
        assert drawn(LegendContent(text), 320, 200).pixels.any()


def test_arabic_letters_are_joined_and_run_from_right_to_left() -> None:
    """Joined letters are narrower than the same letters drawn one by one."""
    pen = Pen(fonts_for(["مرحبا"]))
    assert pen.width("مرحبا", 100) < sum(pen.width(c, 100) for c in "مرحبا") - 10


def test_texts_that_run_from_right_to_left_begin_at_the_right() -> None:
    content = full(
        title="1991: هطول الأمطار", subtitle="Rain", source="שלום", bars=(bar("الأمطار"),), sizes=(), places=()
    )
    picture = drawn(content, 640, 360)
    title, subtitle, source = picture.layout.texts
    label, (panel,) = picture.layout.keys[0].texts[0], picture.layout.panels
    assert [line.align for line in (title, subtitle, source, label)] == ["right", "left", "right", "right"]
    assert title.x == source.x == 640 - subtitle.x
    assert panel.left < label.x < panel.right
    ink = np.flatnonzero(picture.pixels[int(title.y - title.size) : int(title.y), :, 3].any(axis=0))
    assert ink.min() > 320 and 640 - ink.max() < 2 * picture.layout.em


def test_a_missing_character_is_named_and_nothing_else_is_said(capfd, caplog) -> None:
    """A private character, which no font has. matplotlib's own warnings and messages stay away."""
    unknown = "\N{BOX DRAWINGS LIGHT HORIZONTAL}\ue8ff"
    with warnings.catch_warnings(), caplog.at_level(logging.DEBUG):
        warnings.simplefilter("error")
        caplog.clear()
        picture = drawn(full(title=f"a{unknown}b", font="No Such Font"), 640, 360)
    assert picture.notes[:2] == (
        f'legend: there is no font "No Such Font" on this machine; {BASE} is used',
        "legend: no font on this machine has the character \ue8ff; a square is drawn for each; install a font of that "
        "script, and name it in data.legend.font",
    )
    assert capfd.readouterr() == ("", "")
    assert not [r for r in caplog.records if r.name == "matplotlib.font_manager" and r.levelno >= logging.WARNING]
    same = drawn(full(title=f"a\N{BOX DRAWINGS LIGHT HORIZONTAL}{UNKNOWN}b"), 640, 360)
    assert picture.pixels.tobytes() == same.pixels.tobytes()


def test_controls_and_selectors_are_not_drawn() -> None:
    plain = drawn(LegendContent("a b"), 320, 200)
    for text in ("a\nb", "a\tb", "a b\ufe0f", "a b\x07", " a b "):
        picture = drawn(LegendContent(text), 320, 200)
        assert not picture.notes
        assert picture.pixels.tobytes() == plain.pixels.tobytes()


def test_matplotlibs_state_is_left_alone() -> None:
    code = """
import matplotlib.backends.backend_agg, matplotlib.figure, sys, warnings
from visray.legend.drawing import drawn
from visray.legend.parts import LegendContent
# Not by its own method, which would choose a backend and import pyplot.
now = lambda: (dict(dict.items(matplotlib.rcParams)), list(warnings.filters))
before = now()
drawn(LegendContent("Title", source="Source"), 320, 200)
assert now() == before
assert "matplotlib.pyplot" not in sys.modules
import logging
assert not logging.getLogger("matplotlib.font_manager").filters + logging.getLogger("matplotlib").filters
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_settings_of_a_user_change_nothing() -> None:
    expected = drawn(full(), 640, 360).pixels.tobytes()
    changed = {"font.size": 30, "text.color": "red", "font.family": "monospace", "figure.dpi": 200, "savefig.dpi": 10,
               "figure.autolayout": True, "lines.linewidth": 9, "patch.facecolor": "red", "font.weight": "bold",
               "text.parse_math": True, "axes.facecolor": "red", "figure.facecolor": "red"}  # fmt: skip
    with matplotlib.rc_context(changed):
        assert drawn(full(), 640, 360).pixels.tobytes() == expected
