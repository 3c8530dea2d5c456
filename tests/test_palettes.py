"""Palettes: their colours against matplotlib's, their slopes, the ways to write them, and what is noted about them."""

import matplotlib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.colors import ListedColormap, to_rgb

from visray.data.color_value import color_flaw, color_numbers
from visray.data.palette import TABLE, palette_flaw, palette_of
from visray.data.palette import names as palette_names
from visray.data.palette_note import GOOD, VISIBLE, contrary_lightness
from visray.data.vision import BLINDNESS, Viewing, appearance, blind, seen
from visray.output.curves import linear, linear_slope

MAPS = list(matplotlib.colormaps)
LISTED = [n for n in MAPS if isinstance(matplotlib.colormaps[n], ListedColormap)]
STEPPED = [n for n in LISTED if matplotlib.colormaps[n].N < TABLE]
CONTINUOUS = [n for n in LISTED if n not in STEPPED]
FORMULAS = [n for n in MAPS if n not in LISTED]
# One step of a screen's numbers.
LEVEL = 1 / 255
DENSE = np.arange(10_007) / 10_006
RANDOM = settings(derandomize=True, deadline=None, max_examples=200)
SPECS = ("viridis", "flag", "twilight_shifted", "gist_stern", "RdBu_r", "tab10", "parula", ("navy", "#fff", (1, 0, 0)),
         ((0, "red"), (0.25, "white"), (0.25, "black"), (1, "#0f0")))  # fmt: skip


def light(c: np.ndarray) -> np.ndarray:
    """Linear light of sRGB numbers, one at a time, by the words of the standard."""
    return np.array([x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in c.ravel()]).reshape(c.shape)


# Colours


@pytest.mark.parametrize("name", MAPS)
def test_a_map_has_the_entries_of_matplotlib(name):
    """matplotlib shows one of 256 colours (510 for twilight). At their places the palette has them."""
    found, palette = matplotlib.colormaps[name], palette_of(name)
    assert palette.steps == (found.N if name in STEPPED else 0)
    if not palette.steps:
        places = np.arange(found.N) / (found.N - 1)
        assert abs(palette.srgb(places) - found(np.arange(found.N))[:, :3]).max() < 1e-14


@pytest.mark.parametrize("name", CONTINUOUS)
def test_between_entries_a_list_is_blended(name):
    found = matplotlib.colormaps[name]
    below = np.minimum((DENSE * (found.N - 1)).astype(int), found.N - 2)
    share = (DENSE * (found.N - 1) - below)[:, None]
    blended = (1 - share) * found(below)[:, :3] + share * found(below + 1)[:, :3]
    assert abs(palette_of(name).srgb(DENSE) - blended).max() < 1e-12


@pytest.mark.parametrize("name", FORMULAS)
def test_between_entries_a_formula_is_followed_to_one_level(name):
    """The reference is the same formula, which matplotlib evaluates at 2^16 places."""
    table = matplotlib.colormaps[name].resampled(2**16)(np.arange(2**16))[:, :3]
    places = np.arange(2**16) / (2**16 - 1)
    # Where the formula jumps (as that of gist_stern does), the palette blends both sides over one of its intervals.
    jumps = np.flatnonzero(abs(np.diff(table, axis=0)).max(axis=1) > 5 * LEVEL) / (2**16 - 1)
    calm = abs(places[:, None] - jumps).min(axis=1, initial=1) > 1 / 8000
    assert calm.mean() > 0.99
    assert abs(palette_of(name).srgb(places) - table)[calm].max() <= LEVEL


@pytest.mark.parametrize("name", STEPPED)
def test_a_qualitative_map_blends_nothing(name):
    assert (palette_of(name).srgb(DENSE) == matplotlib.colormaps[name](DENSE)[:, :3]).all()
    assert (palette_of(name).slope(DENSE) == 0).all()


def test_linear_light_is_by_the_exact_curve():
    for spec in SPECS:
        palette = palette_of(spec)
        assert abs(palette.linear(DENSE) - light(palette.srgb(DENSE))).max() < 1e-14


@pytest.mark.parametrize("spec", SPECS, ids=str)
@pytest.mark.parametrize("encoding", ["srgb", "linear"])
def test_the_slope_is_that_of_the_interval_on_the_right(spec, encoding):
    """In an interval the curve to linear light is convex, so a secant lies between the slopes at its ends."""
    palette = palette_of(spec, encoding=encoding)
    t = np.concatenate([np.random.default_rng(1).uniform(0, 1, 500), palette.knots[:-1]])
    h = (palette.knots[np.searchsorted(palette.knots, t, "right")] - t) / 2
    t, h = t[h > 1e-6], h[h > 1e-6]
    first, last = palette.slope(t), palette.slope(t + h)
    secant = (palette.linear(t + h) - palette.linear(t)) / h[:, None]
    rounding = 1e-15 * (1 + abs(first)) / h[:, None]
    # The two pieces of the sRGB curve do not quite meet.
    rounding += np.where((palette.srgb(t) <= 0.04045) != (palette.srgb(t + h) <= 0.04045), 1e-7 / h[:, None], 0)
    assert (secant >= np.minimum(first, last) - rounding).all() and (secant <= np.maximum(first, last) + rounding).all()


def test_the_slope_of_the_curve():
    shown = np.linspace(0.001, 0.999, 997)
    h = 1e-6
    difference = (linear(shown + h) - linear(shown - h)) / (2 * h)
    assert abs(difference - linear_slope(shown))[abs(shown - 0.04045) > 2 * h].max() < 1e-8


@pytest.mark.parametrize("spec", SPECS, ids=str)
def test_reversed(spec):
    palette, turned = palette_of(spec), palette_of(spec, reversed=True)
    t = np.random.default_rng(3).uniform(0, 1, 5000)
    t = t[abs(palette.slope(t)).max(axis=1) < 350]  # where a map of matplotlib jumps, its two directions differ
    assert len(t) > 4900
    assert abs(palette.srgb(t) - turned.srgb(1 - t)).max() < 1e-9
    assert (palette.note is None) == (turned.note is None)
    if isinstance(spec, str):
        other = palette_of(spec.removesuffix("_r") if spec.endswith("_r") else f"{spec}_r")
        t = t[abs(other.slope(1 - t)).max(axis=1) < 350]
        assert abs(other.srgb(1 - t) - turned.srgb(1 - t)).max() < 1e-12


def test_a_table_has_256_entries():
    table = palette_of("plasma", table=True)
    entries = matplotlib.colormaps["plasma"](np.arange(TABLE))[:, :3]
    t = np.append(np.random.default_rng(2).uniform(0, 1, 5000), [0, 1])
    assert (table.srgb(t) == entries[[int(255 * x) for x in t]]).all() and (table.slope(t) == 0).all()
    # Whole products keep their entry, whatever the rounding of t.
    for hi in range(1, 300):
        n = np.arange(TABLE)
        assert (table.srgb(n * hi / 255 / hi) == entries).all()


def test_numbers_that_are_linear_light_are_not_converted():
    palette = palette_of(("#000", (0.5, 0.25, 1)), encoding="linear")
    assert (palette.linear(np.array([0.5])) == [[0.25, 0.125, 0.5]]).all()
    assert abs(light(palette.srgb(DENSE)) - palette.linear(DENSE)).max() < 1e-14


def test_beyond_the_ends_and_missing():
    for spec in SPECS:
        palette = palette_of(spec)
        assert (palette.srgb(np.array([-1, 2, -np.inf])) == palette.srgb(np.array([0, 1, 0]))).all()
        assert np.isnan(palette.linear(np.array([np.nan]))).all()


def test_colours_and_stops_by_hand():
    palette = palette_of(("#ff0000", "lime", (0, 0, 1)))
    assert (palette.srgb(np.array([0, 0.25, 0.5, 0.75])) == [[1, 0, 0], [0.5, 0.5, 0], [0, 1, 0], [0, 0.5, 0.5]]).all()
    stops = palette_of([[0, "black"], [0.2, "white"], [0.2, "#f00"], [1, "#00f"]])
    assert (
        abs(stops.srgb(np.array([0.1, 0.2, 0.6, 1])) - [[0.5] * 3, [1, 0, 0], [0.5, 0, 0.5], [0, 0, 1]]).max() < 1e-15
    )


# Names


def test_the_original_programs_names():
    for word in ("INFERNO", "PLASMA", "MAGMA", "VIRIDIS", "PARULA", "JET"):
        expected = palette_of(word.lower()).srgb(DENSE)
        for text in (word, word.title(), f"COLOR_MAP_TYPE_{word}", f"color_map_type_{word.lower()}"):
            assert (palette_of(text).srgb(DENSE) == expected).all()
    for text in ("CUSTOM", "custom", "COLOR_MAP_TYPE_CUSTOM"):
        assert palette_flaw(text)[1].startswith("a custom palette needs its colours; write them in place of the name")
    ends = palette_of("parula").srgb(np.array([0.0, 1.0]))
    assert (ends == [[0.208, 0.166, 0.529], [0.976, 0.983, 0.054]]).all()


def test_names():
    assert {f"{n}{r}" for n in palette_names() for r in ("", "_r")} == {*MAPS, "parula", "parula_r"}
    for name in MAPS:
        assert palette_flaw(name) is None and palette_of(name).name == name
        assert palette_of(name.upper()).name == name  # no two names differ in case only


@pytest.mark.parametrize(
    ("spec", "part", "message"),
    [
        ("virids", "", 'unknown palette; did you mean "viridis"'),
        ("rdbU_", "", 'unknown palette; did you mean "RdBu"'),
        ("zzzz", "", "unknown palette; take one such as viridis, cividis, RdBu or parula"),
        ("tomato", "", "is no palette; write a name such as viridis, or at least two colours"),
        ("", "", "is no palette"),
        ([], "", "has fewer than two colours"),
        (["red"], "", "has fewer than two colours"),
        (["red", "blu"], "1", 'unknown colour; did you mean "blue"?'),
        (["red", "#12345"], "1", "is no colour; after # there are six digits from 0 to f, or three"),
        ([(0, 0, 255), "red"], "0", "is beyond 1; divide numbers from 0 to 255 by 255"),
        ([(0, 0, -0.1), "red"], "0", "must be three numbers from 0 to 1"),
        ([(0, 0, np.nan), "red"], "0", "must be three numbers from 0 to 1"),
        ([(0, "red"), "blue"], "1", "is one of colours and stops"),
        ([(0, "red"), (2, "blue")], "1", "the positions of the stops go from 0 to 1"),
        ([(0.1, "red"), (1, "blue")], "0", "the positions of the stops go from 0 to 1"),
        ([(0, "red"), (0.6, "blue"), (0.5, "red"), (1, "blue")], "2", "must not fall"),
        ([(0, "red"), (np.nan, "blue"), (1, "blue")], "1", "must not fall"),
        ([(0, "red"), (0, "blue"), (1, "red")], "1", "too many stops"),
        ([(0, "red"), (0.5, "blue"), (0.5, "red"), (0.5, "lime"), (1, "blue")], "3", "too many stops"),
        ([(0, "red"), (1, "blu")], "1", 'did you mean "blue"?'),
        ([1, 2], "", "each entry of a palette is a colour or a stop"),
        (5, "", "must be the name of a palette"),
        ({"a": 1}, "", "must be the name of a palette"),
    ],
)  # fmt: skip
def test_what_is_refused(spec, part, message):
    found = palette_flaw(spec)
    assert found[0] == part and message in found[1]
    with pytest.raises(ValueError):
        palette_of(spec)


def test_a_colour_has_several_forms():
    for text in ("#ff6347", "#FF6347", "tomato", "Tomato", (1, 99 / 255, 71 / 255), [1.0, 99 / 255, 71 / 255]):
        assert abs(color_numbers(text) - to_rgb("tomato")).max() < 1e-15
    assert (color_numbers("#0f8") == [0, 1, 136 / 255]).all() and (
        color_numbers("tab:blue") == to_rgb("tab:blue")
    ).all()
    for wrong in ("none", "", "0.5", "#12345678", "#1234", "C0", 1, None, True, (1, 2), (True, 0, 0), ("1", 0, 0)):
        assert color_flaw(wrong), wrong


# What is noted


def test_lightness_colourfulness_and_hue_of_the_standards_example():
    """Source: CIE 159:2004, worked example."""
    found = appearance(np.array([[19.01, 20.00, 21.78]]), Viewing((95.05, 100.0, 108.88), 318.31, 20.0))[0]
    assert abs(found[:2] - [41.73, 0.1088]).max() < 2e-3 and abs(np.degrees(found[2]) % 360 - 219.0) < 0.1
    assert abs(seen(np.array([[0.0, 0, 0], [1, 1, 1]])) - [[0, 0, 0], [100, 0, 0]]).max() < 2.5


@pytest.mark.parametrize("name", ["viridis", "magma", "plasma", "inferno"])
def test_the_steps_of_the_even_maps_are_equal(name):
    """These maps were drawn for equal steps in CAM02-UCS, by others and with another program: to 5%."""
    lengths = np.linalg.norm(np.diff(seen(palette_of(name).linear(np.arange(33) / 32)), axis=0), axis=1)
    assert lengths.max() / lengths.min() < 1.05


def test_blindness_keeps_greys_and_darkens_red():
    greys = np.repeat(np.linspace(0, 1, 9)[:, None], 3, axis=1)
    for kind in BLINDNESS:
        assert abs(blind(greys, kind) - greys).max() < 2e-6
        # Red and green of the same lightness look alike.
        apart = seen(np.array([[0.6, 0.1, 0.0], [0.1, 0.25, 0.0]]))
        left = seen(blind(np.array([[0.6, 0.1, 0.0], [0.1, 0.25, 0.0]]), kind))
        assert np.linalg.norm(left[0] - left[1]) < 0.5 * np.linalg.norm(apart[0] - apart[1])
    assert seen(blind(np.array([[1.0, 0, 0]]), "protanopia"))[0, 0] < seen(np.array([[1.0, 0, 0]]))[0, 0] - 10


def vienot() -> list[np.ndarray]:
    """Another model of red-green blindness, for linear RGB. Source: Vienot, Brettel and Mollon 1999."""
    cones = np.array([[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714], [0.0299566, 0.184309, 1.46709]])
    without_red = np.array([[0, 2.02344, -2.52581], [0, 1, 0], [0, 0, 1]])
    without_green = np.array([[1, 0, 0], [0.494207, 0, 1.24827], [0, 0, 1]])
    return [np.linalg.inv(cones) @ m @ cones for m in (without_red, without_green)]


def test_another_model_of_blindness_finds_the_same_palettes():
    """No palette is confusing in the other model only; and none in ours only, unless it is uneven too."""
    flagged = []
    for name in (n for n in palette_names() if not palette_of(n).steps):
        palette = palette_of(name)
        light = palette.linear(np.arange(33) / 32)
        first, second = np.triu_indices(33, 4)
        clear, other = seen(light)[first] - seen(light)[second], False
        for matrix in vienot():
            shown = seen(np.clip(light @ matrix.T, 0, 1))
            alike = np.linalg.norm(shown[first] - shown[second], axis=1) < VISIBLE
            other |= bool((alike & (np.linalg.norm(clear, axis=1) > 5 * VISIBLE)).any())
        ours = palette.note is not None and "red-green blind" in palette.note
        assert other == ours or (ours and "not perceptually uniform" in palette.note), name
        flagged += [name] if other else []
    assert {"RdYlGn", "hsv", "cool"} <= set(flagged)


@pytest.mark.parametrize("name", [*GOOD, "magma", "plasma", "inferno", "PuOr", "gray", "YlGnBu", "parula"])
def test_good_palettes_have_no_note(name):
    assert palette_of(name).note is None and palette_of(name, reversed=True).note is None


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("jet", "not perceptually uniform"),
        ("rainbow", "not perceptually uniform"),
        ("hsv", "not perceptually uniform"),
        ("hsv", "lightness that rises and falls"),
        ("hsv", "red-green blind cannot tell apart"),
        ("flag", "lightness that rises and falls"),
        ("RdYlGn", "red-green blind cannot tell apart"),
        ("cool", "red-green blind cannot tell apart"),
    ],
)
def test_hard_palettes_have_a_note(name, words):
    for turned in (False, True):
        note = palette_of(name, turned).note
        assert words in note and note.startswith(f"The palette {name} ") and note.endswith("viridis, cividis or RdBu.")


@pytest.mark.parametrize("name", STEPPED)
def test_qualitative_maps_have_a_note_of_their_own(name):
    assert "made for categories" in palette_of(name).note


def test_notes_of_own_palettes():
    assert palette_of(("black", "white")).note is None
    assert "has only one colour" in palette_of(("red", "red")).note
    uneven = palette_of(((0, "black"), (0.9, "#222"), (1, "white")))
    assert "The palette is not perceptually uniform" in uneven.note
    # A red and a green of one lightness; and a red and a blue.
    assert "red-green blind" in palette_of(("#c00000", "#f0e050", "#4a8000")).note
    assert palette_of(("#700000", "#f0e0b0", "#205090")).note is None


@given(st.lists(st.floats(0, 100), min_size=2, max_size=12))
@RANDOM
def test_contrary_lightness(values):
    """It is 0 for what rises and falls once, and the same whether up or down, forwards or backwards."""
    found = contrary_lightness(np.array(values))
    for other in (values[::-1], [-v for v in values]):
        assert contrary_lightness(np.array(other)) == pytest.approx(found, abs=1e-9)
    up, down = sorted(values), sorted(values, reverse=True)
    assert contrary_lightness(np.array(up + down)) == contrary_lightness(np.array(down + up)) == 0
    assert contrary_lightness(np.array([0, 50, 50 - VISIBLE, 100])) == VISIBLE


def test_without_matplotlib_until_a_palette_is_used():
    import subprocess
    import sys

    code = "import visray.data.color_rule, visray.data.size_rule, sys; assert 'matplotlib' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
