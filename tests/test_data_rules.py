"""Rules of data: from values to colours and sizes, against matplotlib's norms, NumPy's quantiles, and formulas."""

import json

import matplotlib
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from matplotlib.colors import BoundaryNorm, CenteredNorm, LogNorm, Normalize, PowerNorm
from pydantic import TypeAdapter, ValidationError

from visray.data.color_rule import MOST_BANDS, ColorRule, ColorSpec, NormName, color_rule_of
from visray.data.column import FIRST, rows_text
from visray.data.palette import palette_of
from visray.data.size_rule import SizeRule, SizeSpec, size_rule_of
from visray.output.curves import linear
from visray.quantities import FARTHEST

RANDOM = settings(derandomize=True, deadline=None, max_examples=200)
NORMS = NormName.__args__
SCALES = SizeRule.__dataclass_fields__["scale"].type.__args__
NAN = np.nan
VALUES = np.random.default_rng(5).lognormal(1, 1, 400)
finite = st.floats(-1e6, 1e6, allow_subnormal=False)
positive = st.floats(1e-3, 1e6)
some = st.lists(finite, min_size=1, max_size=20)


def rule(norm: str = "linear", **fields) -> ColorRule:
    """A rule with what its norm needs."""
    return ColorRule(column="rain", norm=norm, **({"bands": 7} if norm == "banded" else {}) | fields)


def colours(values, **fields) -> np.ndarray:
    return ColorRule(column="rain", **fields).colours(np.array(values, float)).linear


def grey(level: float) -> np.ndarray:
    return linear(np.full(3, float(level)))


# Norms


@pytest.mark.parametrize(
    ("fields", "reference"),
    [
        ({"norm": "linear", "domain": (-2.5, 40)}, Normalize(-2.5, 40)),
        ({"norm": "log", "domain": (0.3, 700)}, LogNorm(0.3, 700)),
        ({"norm": "symmetric", "center": 1.5, "domain": (-38.5, 41.5)}, CenteredNorm(1.5, 40)),
        ({"norm": "power", "exponent": 0.4, "domain": (0.2, 40)}, PowerNorm(0.4, 0.2, 40)),
        ({"norm": "power", "exponent": 3, "domain": (-2, 40)}, PowerNorm(3, -2, 40)),
    ],
)
def test_a_norm_is_that_of_matplotlib(fields, reference):
    resolved = ColorRule(column="rain", **fields).resolved(VALUES)
    v = np.linspace(resolved.lo, resolved.hi, 999)
    assert abs(resolved.share(v) - reference(v)).max() < 1e-12
    assert abs(resolved.value(resolved.share(v)) - v).max() < 1e-12 * 700
    assert (resolved.lo, resolved.hi) == fields["domain"]


def test_the_domain_is_that_of_the_data():
    assert rule().resolved(VALUES).lo == VALUES.min() and rule().resolved(VALUES).hi == VALUES.max()
    assert rule("log").resolved(VALUES).lo == VALUES.min()
    found = rule("symmetric", center=2.0).resolved(VALUES)
    half = abs(VALUES - 2).max()
    assert (found.lo, found.hi) == (2 - half, 2 + half) and found.share(np.array([2.0])) == 0.5
    reference = CenteredNorm(2.0)
    reference.autoscale(VALUES)
    assert abs(found.share(VALUES) - reference(VALUES)).max() < 1e-12
    gaps = np.array([NAN, 3, NAN, 7])
    assert (rule().resolved(gaps).lo, rule().resolved(gaps).hi) == (3, 7)


def test_quantiles_are_those_of_numpy():
    resolved, t = rule("quantile").resolved(VALUES), np.linspace(0, 1, 777)
    assert abs(resolved.value(t) - np.quantile(VALUES, t)).max() < 1e-12 * VALUES.max()
    assert abs(resolved.share(np.quantile(VALUES, t)) - t).max() < 1e-9
    inside = VALUES[(VALUES >= 1) & (VALUES <= 6)]
    within = rule("quantile", domain=(1, 6)).resolved(VALUES)
    assert abs(within.value(t) - np.quantile(inside, t)).max() < 1e-12 * 6


def test_equal_data_have_the_mean_of_their_quantiles():
    share = rule("quantile").resolved(np.array([1.0, 5, 5, 5, 9, 9])).share
    assert abs(share(np.array([1.0, 5, 9])) - [0, 2 / 5, 1]).max() < 1e-15
    assert (rule("quantile").resolved(np.array([4.0])).share(np.array([4.0])) == 0.5).all()


@pytest.mark.parametrize("edges", [(0, 1, 2, 5, 20), (-3, 7), (1, 2, 4, 8, 16, 32)])
def test_bands_are_those_of_matplotlib(edges):
    count = len(edges) - 1
    v = np.append(np.random.default_rng(8).uniform(edges[0], edges[-1], 2000), edges[:-1])
    resolved = rule("banded", bands=edges).resolved(VALUES)
    band = BoundaryNorm(edges, count)(v)
    assert abs(resolved.position(v) - (band / (count - 1) if count > 1 else 0.5)).max() < 1e-12
    assert resolved.position(np.array([float(edges[-1])])) == resolved.position(v).max()  # the last edge belongs to it
    table, t = matplotlib.colormaps["viridis"](np.arange(256))[:, :3], resolved.position(v)
    assert all(
        abs(resolved.srgb(v)[:, k] - np.interp(255 * t, np.arange(256), table[:, k])).max() < 1e-12 for k in range(3)
    )


def test_a_number_of_bands_goes_with_every_norm():
    v = np.sort(VALUES)
    for norm in NORMS:
        resolved = rule(norm, bands=5).resolved(VALUES)
        smooth = rule("linear" if norm == "banded" else norm).resolved(VALUES)
        assert abs(smooth.share(resolved.bands) - np.arange(6) / 5).max() < 1e-9
        expected = np.minimum((smooth.share(v) * 5 + 1e-12).astype(int), 4) / 4
        assert (abs(resolved.position(v) - expected) < 1e-12).mean() > 0.98
        assert len(np.unique(resolved.position(v))) <= 5
    quintiles = rule("quantile", bands=5).resolved(VALUES).position(VALUES)
    assert (np.unique(quintiles, return_counts=True)[1] == len(VALUES) // 5).all()


def test_bands_of_a_qualitative_palette_have_its_first_colours():
    found = rule("banded", palette="tab10", bands=(0, 1, 2, 3)).resolved(VALUES).srgb(np.array([0.5, 1.5, 2.5]))
    assert abs(found - matplotlib.colormaps["tab10"](np.arange(3))[:, :3]).max() < 1e-12
    flaws = rule("banded", palette="Dark2", bands=9).flaws()
    assert flaws == [("bands", "the palette Dark2 has only 8 colours; write at most 8 bands, or take another palette")]
    assert not rule("banded", palette="Dark2", bands=8).flaws()


@pytest.mark.parametrize("norm", NORMS)
@given(st.lists(st.floats(0.01, 1e6), min_size=2, max_size=20))
@RANDOM
def test_norms_never_fall(norm, values):
    values = np.array(values)
    resolved = rule(norm).resolved(values)
    t = resolved.share(np.sort(values))
    assert (np.diff(t) >= 0).all() and t.min() >= 0 and t.max() <= 1
    assert np.isfinite(resolved.colours(values).linear).all()
    if not resolved.norm.constant and norm != "symmetric":
        assert t[0] == 0 and t[-1] == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize("palette", ["viridis", "RdBu", ("navy", "white", "tomato")], ids=str)
def test_slopes_of_colours_are_differences(norm, palette):
    resolved = rule(norm, palette=palette, **({"exponent": 1.7} if norm == "power" else {})).resolved(VALUES)
    v = np.random.default_rng(9).uniform(resolved.lo, resolved.hi, 2000)
    h = 1e-7 * (resolved.hi - resolved.lo)
    v = v[(v > resolved.lo + h) & (v < resolved.hi - h)]
    before, here, after = (resolved.colours(x) for x in (v - h, v, v + h))
    difference = (after.linear - before.linear) / (2 * h)
    # Between two knots of the palette and of the norm, the three slopes are nearly equal.
    scale = 1 / (resolved.hi - resolved.lo)
    calm = (abs(after.slope - before.slope) < 1e-4 * scale).all(axis=1)
    assert calm.mean() > 0.9
    assert abs(difference - here.slope)[calm].max() < 1e-4 * scale
    if norm == "banded":
        assert (here.slope == 0).all()


def test_the_slope_of_a_power_is_infinite_at_its_start():
    found = rule("power", domain=(2, 10), exponent=0.5).colours(np.array([2.0, 2.0 + 1e-12])).slope
    assert np.isinf(found[0]).all() and np.isfinite(found[1]).all() and not np.isnan(found).any()


# Colours


def test_under_over_and_missing():
    fields = {"palette": ["black", "white"], "domain": (0.0, 10.0)}
    found = ColorRule(column="rain", **fields).colours(np.array([-5, 0, 5, 10, 11, NAN]))
    assert abs(found.linear - [grey(x) for x in (0, 0, 0.5, 1, 1, 128 / 255)]).max() < 1e-15
    assert (found.under, found.over, found.missing) == (1, 1, 1)
    assert (found.slope[[0, 4, 5]] == 0).all() and (found.slope[1:4] > 0).all()
    ends = colours([-5, 11, NAN, 3], under="red", over=(0, 0, 1), missing="#0f0", **fields)
    assert (ends[:3] == [[1, 0, 0], [0, 0, 1], [0, 1, 0]]).all()
    turned = colours([-5, 10], reversed=True, **fields)
    assert (turned == [[1, 1, 1], [0, 0, 0]]).all()


@pytest.mark.parametrize("norm", NORMS)
def test_constant_data_have_the_middle(norm):
    for values in ([3.0, 3, 3], [3.0], [3.0, NAN]):
        values = np.array(values)
        found = rule(norm, center=3.0 if norm == "symmetric" else 0.0).colours(values)
        assert (found.linear[0] == palette_of("viridis").linear(np.array([0.5]))[0]).all()
        assert (found.slope == 0).all() and found.under == found.over == 0
        (note,) = rule(norm, center=3.0 if norm == "symmetric" else 0.0).notes(values)
        assert note == 'The column "rain" is constant (3); it has the middle of the palette.'
    # Two neighbours in double precision, and the largest ones.
    tight = np.array([3.0, np.nextafter(3.0, 4)])
    wide = np.array([1e-300 if norm == "log" else -1e308, 1e308])
    for values in (tight, wide):
        assert np.isfinite(rule(norm).colours(values).linear).all()


@pytest.mark.parametrize("norm", NORMS)
def test_no_values_at_all(norm):
    for values in (np.full(3, NAN), np.zeros(0)):
        found = rule(norm).colours(values)
        assert found.linear.shape == (len(values), 3) and found.missing == len(values) and (found.slope == 0).all()
        assert not rule(norm).flaws(values)
        assert rule(norm).notes(values) == ['The column "rain" has no values; all colours are those of missing values.']


def test_a_table_is_that_of_the_original():
    """kd = table[int(255 (v - min) / (max - min))], and the numbers are taken as they are."""
    found = colours(VALUES, palette="COLOR_MAP_TYPE_MAGMA", lookup="table", encoding="linear", domain=(0.0, 70.0))
    entries = matplotlib.colormaps["magma"](np.arange(256))[:, :3]
    assert (found == [entries[int(255 * (v - 0) / (70 - 0))] for v in VALUES]).all()


def test_notes():
    assert rule().notes(VALUES) == []
    assert rule(palette="jet").notes(VALUES) == [palette_of("jet").note]
    found = rule(domain=(1, 2)).notes(np.array([0, 1.5, 3, 4]))
    assert found == [
        '1 of 4 values of "rain" are below the domain (1).',
        '2 of 4 values of "rain" are above the domain (2).',
    ]


@pytest.mark.parametrize(
    ("fields", "place", "words"),
    [
        ({"palette": "virids"}, "palette", 'did you mean "viridis"'),
        ({"palette": ("red", "blu")}, "palette.1", 'did you mean "blue"?'),
        ({"under": "gren"}, "under", 'did you mean "green"?'),
        ({"missing": (0, 0, 200)}, "missing", "divide numbers from 0 to 255 by 255"),
        ({"domain": (5, 5)}, "domain", "the first number must be less than the second"),
        ({"domain": (5, 1)}, "domain", 'to turn the palette around, write "reversed": true'),
        ({"norm": "log", "domain": (0, 5)}, "domain", "above 0"),
        ({"norm": "symmetric", "domain": (-1, 3)}, "domain", "must have the center 0 in its middle, as [-3, 3] has"),
        ({"norm": "symmetric", "center": 2.0, "domain": (3, 9)}, "domain", "as [-5, 9] has"),
        ({"norm": "power", "exponent": 0.0}, "exponent", "must be greater than 0"),
        ({"norm": "banded"}, "bands", "write a number of bands, such as 5, or edges, such as [0, 10, 50]"),
        ({"bands": 0}, "bands", f"from 1 to {MOST_BANDS}"),
        ({"bands": MOST_BANDS + 1}, "bands", f"from 1 to {MOST_BANDS}"),
        ({"bands": (1,)}, "bands", "edges"),
        ({"bands": (1, 3, 3)}, "bands", "the edges must rise"),
        ({"bands": (1, 3), "norm": "log"}, "bands", 'the norm is then "banded"'),
        ({"bands": (1, 3), "domain": (1, 3)}, "domain", "leave one of the two out"),
        ({"center": 1.0}, "center", 'write "norm": "symmetric"'),
        ({"exponent": 2.0}, "exponent", 'write "norm": "power"'),
    ],
)  # fmt: skip
def test_flaws_of_fields(fields, place, words):
    found = ColorRule(column="rain", **fields).flaws()
    assert [p for p, _ in found] == [place] and words in found[0][1]


def test_decimal_fractions_are_symmetric_enough():
    for half in (0.1, 0.3, 0.7, 1e-3, 123.4):
        for center in (0.1, -0.3, 17.7):
            text = json.dumps([center - half, center + half])
            assert not rule("symmetric", center=center, domain=tuple(json.loads(text))).flaws()
    assert rule("symmetric", center=0.1, domain=(-0.9, 1.1001)).flaws()


def test_flaws_of_values():
    v = np.array([1, -2, 0, 5, -1, -1, -1, -1, NAN])
    ((place, text),) = rule("log").flaws(v)
    rows = "row 1 (-2), row 2 (0), row 4 (-1), row 5 (-1), row 6 (-1), and 1 more"
    assert place == "norm" and rows in text
    assert not any(rule(norm).flaws(v) for norm in NORMS if norm != "log")
    for norm in NORMS:
        ((place, text),) = rule(norm).flaws(np.array([1, np.inf, 2, -np.inf]), np.array([10, 11, 12, 13]))
        assert place == "column" and "has infinite values: row 11 (inf), row 13 (-inf)" in text
    assert rule().flaws(VALUES) == rule("log").flaws(VALUES) == []


@given(st.lists(st.booleans(), min_size=1, max_size=20))
@RANDOM
def test_rows_in_words(wrong):
    assume(any(wrong))
    wrong = np.array(wrong)
    text = rows_text(wrong, np.arange(len(wrong)) * 0.5, np.arange(len(wrong)) + 100)
    assert text.count("row ") == min(wrong.sum(), FIRST)
    assert text.endswith(f", and {wrong.sum() - FIRST} more") == (wrong.sum() > FIRST)
    assert text.startswith(f"row {100 + np.argmax(wrong)} ({np.argmax(wrong) * 0.5:g})")


# Sizes


def size_of(values, range=(0.0, 2.0), **fields) -> np.ndarray:
    return SizeRule(column="rain", **fields).sizes(np.array(values, float), range).size


def test_sizes_by_hand():
    assert (size_of([0, 5, 10]) == [0, 1, 2]).all()
    assert (size_of([0, 5, -10]) == [0, 1, -2]).all()
    assert abs(size_of([0, 1, 4], scale="sqrt") - [0, 1, 2]).max() < 1e-15
    assert abs(size_of([1, 10, 100, -10], scale="log", range=(0.5, 1.5)) - [0.5, 1, 1.5, -1]).max() < 1e-15
    assert abs(size_of([5, 10, 30], (0.5, 1.5), domain=(10, 20)) - [0, 0.5, 2.5]).max() < 1e-15
    assert (size_of([0, 10], range=(1, 2)) == [1, 2]).all()
    assert (SizeRule(column="a", range=(3, 4)).sizes(np.array([0.0, 7]), (0, 1)).size == [3, 4]).all()
    # A domain that begins below 0 holds negative values as they are.
    assert abs(size_of([-20, -10, -5, 30], domain=(-10, 30)) - [-0.5, 0, 0.25, 2]).max() < 1e-15
    found = size_of([1, NAN, 4])
    assert np.isnan(found).tolist() == [False, True, False]


def test_the_originals_size():
    """s: [min, max] -> [0.1, half the height], beyond as well. Source: remap of VisRayTrace."""
    low, high, top = 12.0, 80.0, 3.5
    v = np.linspace(5, 200, 333)
    expected = (v - low) * (top - 0.1) / (high - low) + 0.1
    keep = expected >= 0
    assert abs(size_of(v[keep], (0.1, top), domain=(low, high)) - expected[keep]).max() < 1e-12 * 20


@pytest.mark.parametrize("scale", SCALES)
@given(st.lists(positive, min_size=2, max_size=20), st.floats(0, 10), st.floats(0.01, 10))
@RANDOM
def test_sizes_grow_with_values(scale, values, a, more):
    v = np.sort(np.array(values))
    found = size_of(v, (a, a + more), scale=scale)
    assert (np.diff(found) >= 0).all() and found[-1] == pytest.approx(a + more, rel=1e-12)
    assert (found >= a - 1e-12).all()
    assert (size_of(-v, (a, a + more), scale=scale) == -found).all()
    if scale == "sqrt":
        area = size_of(v, (0, more), scale=scale) ** 2
        assert area == pytest.approx(v / v[-1] * more**2, rel=1e-12)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("domain", [None, (0.5, 300.0), (2.0, 9.0)])
def test_slopes_of_sizes_are_differences(scale, domain):
    v = np.append(VALUES, [-3.0, -8.0])
    fixed = SizeRule(column="a", scale=scale, domain=domain or SizeRule(column="a", scale=scale).limits(v))
    h = 1e-5 * abs(v)
    after, before = (fixed.sizes(v + k, (0.3, 2)).size for k in (h, -h))
    slope = SizeRule(column="a", scale=scale, domain=domain).sizes(v, (0.3, 2)).slope
    assert slope == pytest.approx((after - before) / (2 * h), rel=1e-6)


def test_zeros_and_constant_data():
    for scale in SCALES:
        found = SizeRule(column="rain", scale=scale).sizes(np.array([4.0, 4, -4, NAN]), (0.5, 2))
        assert found.size[:3].tolist() == [2, 2, -2] and np.isnan(found.size[3])
    assert (SizeRule(column="rain", scale="log").sizes(np.array([4.0]), (0, 2)).slope == 0).all()
    assert SizeRule(column="rain", scale="log").notes(np.array([4.0, 4])) == [
        'All values of the column "rain" are 4; all have the largest size.'
    ]
    # Zeros have the same size beside zeros only as beside other values.
    for scale in ("linear", "sqrt"):
        found = SizeRule(column="rain", scale=scale).sizes(np.zeros(3), (0.5, 2))
        assert (found.size == 0.5).all() and (found.slope == 0).all()
        assert size_of([0, 1], (0.5, 2), scale=scale)[0] == 0.5
        (note,) = SizeRule(column="rain", scale=scale).notes(np.zeros(3))
        assert note == 'All values of the column "rain" are 0; all have the smallest size.'
    assert SizeRule(column="rain").notes(np.array([4.0, 4])) == []
    for scale in SCALES:
        assert SizeRule(column="rain", scale=scale).sizes(np.zeros(0), (0, 1)).size.shape == (0,)
        assert np.isnan(SizeRule(column="rain", scale=scale).sizes(np.full(2, NAN), (0, 1)).size).all()
        assert SizeRule(column="rain", scale=scale).notes(np.full(2, NAN)) == ['The column "rain" has no values.']
    assert np.isinf(SizeRule(column="rain", scale="sqrt").sizes(np.array([0.0, 1]), (0, 1)).slope[0])


@pytest.mark.parametrize(
    ("fields", "values", "place", "words"),
    [
        ({"domain": (5, 5)}, None, "domain", "the first number must be less than the second"),
        ({"domain": (5, 1)}, None, "domain", "turn the range around"),
        ({"domain": (0, 1), "scale": "log"}, None, "domain", "above 0"),
        ({"domain": (-1, 1), "scale": "sqrt"}, None, "domain", "at least 0"),
        ({"domain": (1e300, np.nextafter(1e300, 2e300)), "scale": "log"}, None, "domain", "too near"),
        ({}, [1, np.inf], "column", "has infinite values: row 1 (inf)"),
        ({"scale": "log"}, [1, 0, 3], "scale", "row 1 (0)"),
        ({"scale": "log"}, [1, -2, 3], "scale", 'values of "rain" must be above 0 for log, unlike row 1 (-2)'),
        ({"negative": "refuse"}, [1, -2, 3, -4], "negative", 'values of "rain" are refused: row 1 (-2), row 3 (-4)'),
        ({"domain": (10, 20)}, [15, 5], "domain", "size below 0: row 1 (5)"),
        ({"domain": (10, 20)}, [15, -5], "domain", "size below 0: row 1 (-5)"),
        ({"domain": (-10, 20), "negative": "refuse"}, [15, -11], "domain", "size below 0: row 1 (-11)"),
        ({"domain": (0, 20), "range": (3, 1)}, [15, 100], "domain", "size below 0: row 1 (100)"),
        ({"domain": (0, 1)}, [1, 1e10], "domain", f"size above {FARTHEST:g}: row 1 (1e+10)"),
    ],
)
def test_flaws_of_sizes(fields, values, place, words):
    ((found, text),) = SizeRule(column="rain", **fields).flaws(None if values is None else np.array(values))
    assert found == place and words in text


@given(some, st.sampled_from(SCALES), st.sampled_from([None, (0.5, 9.0), (-4.0, 9.0), (0.0, 1.0)]),
       st.sampled_from(["down", "refuse"]), st.sampled_from([(0.0, 1.0), (0.2, 3.0), (2.0, 0.5)]))  # fmt: skip
@RANDOM
def test_sizes_without_flaws_are_usable(values, scale, domain, negative, range):
    """No size is below 0 unless its value is, and none is so with `refuse`."""
    values, rule = np.array(values), SizeRule(column="a", scale=scale, domain=domain, negative=negative)
    assume(not rule.flaws(values, range))
    found = rule.sizes(values, range)
    assert np.isfinite(found.size).all() and not np.isnan(found.slope).any()
    assert (values[found.size < 0] < 0).all() and not (negative == "refuse" and (found.size < 0).any())


# What a layer may have


def test_a_column_stands_for_a_rule():
    assert size_rule_of("rain") == SizeRule(column="rain") and size_rule_of(1.5) == 1.5
    assert color_rule_of("rain") == ColorRule(column="rain")
    assert color_rule_of("#ff8000") == (1, 128 / 255, 0) and color_rule_of("#08f") == (0, 136 / 255, 1)
    for name in ("tomato", "#1", "# of people", "#12345"):
        assert color_rule_of(name) == ColorRule(column=name)
    assert color_rule_of(None) is None and color_rule_of((0.1, 0.2, 0.3)) == (0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("spec", "raw"),
    [
        (ColorSpec, "rain"),
        (ColorSpec, None),
        (ColorSpec, [0.5, 0.25, 1.0]),
        (ColorSpec, {"column": "rain", "palette": "RdBu", "norm": "symmetric", "domain": [-1, 1]}),
        (ColorSpec, {"column": "rain", "palette": [[0, "navy"], [0.5, [1, 1, 1]], [1, "red"]], "bands": 4}),
        (ColorSpec, {"column": "rain", "palette": ["navy", [1, 1, 1]], "bands": [0, 1, 5], "under": "#fff"}),
        (SizeSpec, "rain"),
        (SizeSpec, 0),
        (SizeSpec, 2.5),
        (SizeSpec, {"column": "rain", "scale": "sqrt", "domain": [0, 1], "range": [0, 1], "negative": "refuse"}),
    ],
)
def test_specs_are_read_written_and_described(spec, raw):
    adapter = TypeAdapter(spec)
    found = adapter.validate_python(raw)
    assert adapter.validate_json(adapter.dump_json(found)) == found == adapter.validate_json(json.dumps(raw))
    written = json.loads(adapter.dump_json(found))
    assert raw == (written if not isinstance(raw, dict) else {k: written[k] for k in raw})
    if isinstance(raw, dict):
        hash(found)
        assert not found.flaws()
    fields = adapter.json_schema()["$defs"][(ColorRule if spec is ColorSpec else SizeRule).__name__]["properties"]
    assert set(fields) >= set(raw if isinstance(raw, dict) else ())


@pytest.mark.parametrize(
    ("spec", "raw"),
    [
        (ColorSpec, ""),
        (ColorSpec, 1),
        (ColorSpec, [0.1, 0.2]),
        (ColorSpec, [0, 0, 255]),
        (ColorSpec, {}),
        (ColorSpec, {"column": "rain", "palete": "jet"}),
        (ColorSpec, {"column": "rain", "norm": "lin"}),
        (ColorSpec, {"column": "rain", "palette": [1, 2]}),
        (ColorSpec, {"column": "rain", "domain": [0, float("nan")]}),
        (ColorSpec, {"column": "rain", "bands": 2.5}),
        (ColorSpec, {"column": "rain", "bands": True}),
        (SizeSpec, -1),
        (SizeSpec, True),
        (SizeSpec, [1]),
        (SizeSpec, {"column": "rain", "range": [-1, 1]}),
        (SizeSpec, {"column": "rain", "negative": "up"}),
    ],
)
def test_specs_of_a_wrong_form_are_refused(spec, raw):
    with pytest.raises(ValidationError):
        TypeAdapter(spec).validate_python(raw)
