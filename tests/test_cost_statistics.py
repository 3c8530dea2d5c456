"""Statistics of a study of costs: errors with bands, slopes, frontiers, prices, the best values together."""

from dataclasses import replace
from math import comb, inf, isinf, log, sqrt
from typing import Any

import drjit as dr
import numpy as np
import pytest

from visray.quantities import Arrays
from visray.sampling import SamplePlan, SampleState, first_stratum, pixel_key
from visray.study.cost.choices import sample_counts
from visray.study.cost.comparing import frontier, halvings, price, savings, together
from visray.study.cost.errors import flip, judged, split, student
from visray.study.cost.records import Band, Curve, Error, Record, Slope
from visray.study.cost.slopes import slope

A = Arrays.of("llvm", "single")
SIDE, SEEDS = 48, 16
# Student's t of 15 degrees of freedom goes beyond 7.9 with a chance of 1e-6; a band of 95 % goes to 2.13.
WIDE = 7.9 / student(SEEDS - 1)


def fewest(n: int, share: float) -> int:
    """The number that a binomial count falls below with a chance of 1e-6 at most."""
    tail = np.cumsum([comb(n, k) * share**k * (1 - share) ** (n - k) for k in range(n + 1)])
    return int(np.searchsorted(tail, 1e-6))


@pytest.mark.parametrize(
    ("dof", "value"), [(1, 12.7062), (2, 4.30265), (3, 3.18245), (7, 2.36462), (15, 2.13145), (30, 2.04227)]
)
def test_students_t_is_that_of_the_tables(dof: int, value: float) -> None:
    assert abs(student(dof) - value) < 1e-4


# Integrals over pixels whose error is known in closed form, by visray's own samplers


def pixels(sampler: str, spp: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the samples of all pixels fall. Shapes: (spp, SIDE^2) each."""
    plan, n = SamplePlan.of(A, seed, spp, 0, spp), SIDE * SIDE
    i, p = A.U(np.repeat(np.arange(spp, dtype=np.uint32), n)), dr.tile(dr.arange(A.U, n), spp)
    key = pixel_key(plan, p % SIDE, p // SIDE)
    cell = (first_stratum(plan, key, A.F) + i * plan.step) % int(plan.strata[0])
    u, v = SampleState(sampler, A.F, plan, key, i, cell).pixel()
    return tuple(np.array(w, np.float64).reshape(spp, n) for w in (u, v))


# Edges anywhere in a pixel: so evenly that the mean of t (1 - t), t where an edge is in its stratum, is 1/6 to 1e-4.
EDGES = np.random.default_rng(0).permutation(SIDE * SIDE) / (SIDE * SIDE) + 0.5 / (SIDE * SIDE)


def integrated(what: str, sampler: str, spp: int) -> np.ndarray:
    """Pictures of all seeds. linear: x + y, 2 x, and 1 + x - y; edges: x < c, y < c and x > c. Shape: (S, H, W, 3)."""
    found = []
    for seed in range(SEEDS):
        x, y = pixels(sampler, spp, seed)
        three = (x + y, 2 * x, 1 + x - y) if what == "linear" else (x < EDGES, y < EDGES, x > EDGES)
        found.append(np.stack([f.mean(0) for f in three], -1).reshape(SIDE, SIDE, 3))
    return np.array(found)


def exact(what: str) -> np.ndarray:
    three = (np.ones_like(EDGES),) * 3 if what == "linear" else (EDGES, EDGES, 1 - EDGES)
    return np.stack(three, -1).reshape(SIDE, SIDE, 3)


# Of the variance over the number of samples. An edge crosses a row of sqrt(n) strata, and in each leaves t (1 - t);
# strata of side h leave a linear function its slope times h^2 / 12. Sobol's points have one in each of n columns, and
# in each of n rows: less than a column's is left at an edge along it, and of a sum of functions of x and of y.
POWERS = {
    ("linear", "independent"): 1, ("linear", "stratified"): 2, ("linear", "sobol"): 3,
    ("edges", "independent"): 1, ("edges", "stratified"): 1.5, ("edges", "sobol"): 2,
}  # fmt: skip


def variance(what: str, sampler: str, n: int) -> float:
    """Of the mean of n samples, over the three integrands. Domain: n a power of 4."""
    one = (2 + 4 + 2) / 12 / 3 if what == "linear" else 1 / 6
    return one / n ** POWERS[what, sampler]


COUNTS = (4, 16, 64)


@pytest.mark.parametrize(("what", "sampler"), POWERS)
def test_errors_and_slopes_of_samplers_are_those_of_theory(what: str, sampler: str) -> None:
    luminance, squares = 0.5, []
    for n in COUNTS:
        found = split(integrated(what, sampler, n), exact(what), np.zeros((SIDE, SIDE, 3)), luminance)
        squares.append(found.squares)
        true = variance(what, sampler, n) / luminance**2
        for band in (found.deviation, found.rmse):
            half = (band.high**2 - band.low**2) / 2 * WIDE
            assert abs(band.middle**2 - true) < half < 0.1 * true
        # No bias, as far as 16 seeds can tell: their noise leaves 1 / 16 of its square, known to 1 % of that square.
        assert found.bias.low < 0.1 * found.deviation.middle and found.bias.high < 0.2 * found.deviation.middle
    k = slope(COUNTS, squares)
    # The logarithms of two errors, each to a deviation of 1 % at most, over a factor of 16.
    assert abs(k.k - POWERS[what, sampler] / 2) < 5 * 0.01 * sqrt(2) / log(16)
    assert k.points == 3 and k.low < k.k < k.high and k.high - k.low < 0.1


# Synthetic pictures of known bias and noise


def synthetic(
    rng: np.random.Generator, seeds: int, bias: float, noise: float, truth: float, size: int = 12
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pictures, reference and its variance, of these squared bias and variances; most noise in the middle, the same in
    all channels. The reference is of 4 pictures, and its variance of what these differ by."""
    shape = (size, size, 1)
    where = np.exp(-8 * (np.linspace(-0.5, 0.5, size)[:, None, None] ** 2)) * np.ones((size, size, 3))
    where /= sqrt((where**2).mean())
    pattern = np.random.default_rng(7).standard_normal((size, size, 3))
    pattern /= sqrt((pattern**2).mean())
    four = 1 + sqrt(4 * truth) * where * rng.standard_normal((4, *shape))
    pictures = 1 + sqrt(bias) * pattern + sqrt(noise) * where * rng.standard_normal((seeds, *shape))
    return pictures, four.mean(0), four.var(0, ddof=1) / 4


@pytest.mark.parametrize("seeds", [4, 16])
@pytest.mark.parametrize(
    ("bias", "noise", "truth"), [(0.0, 1.0, 0.01), (0.05, 1.0, 0.05), (1.0, 1.0, 0.01), (1.0, 0.01, 0.0)]
)
def test_bands_hold_the_truth_as_often_as_they_say(seeds: int, bias: float, noise: float, truth: float) -> None:
    rng, n = np.random.default_rng([seeds, round(100 * bias)]), 400
    held, squares, wide = np.zeros(3, int), [], []
    for _ in range(n):
        found = split(*synthetic(rng, seeds, bias, noise, truth), 1.0)
        for i, (band, true) in enumerate(((found.rmse, bias + noise), (found.bias, bias), (found.deviation, noise))):
            held[i] += band.low**2 <= true <= band.high**2
        squares.append(found.squares.mean())
        wide.append(found.deviation.high / found.deviation.low if found.deviation.low else inf)
    assert (held >= fewest(n, 0.93)).all(), held
    # The reference's noise is out of it, and not by chance: without that the mean would be off by `truth`.
    assert abs(np.mean(squares) - bias - noise) < 5 * np.std(squares) / sqrt(n)
    # And a band says something: 16 pictures of 144 pixels give a deviation to some 3 %, and 4 to 6 % times t of 3.
    assert np.median(wide) < (1.6 if seeds == 4 else 1.2)


def test_the_noise_of_the_reference_is_taken_out() -> None:
    """A reference as noisy as the pictures doubles their squared error, but for that."""
    rng, size = np.random.default_rng(3), 64
    pictures, reference, var = synthetic(rng, SEEDS, 0.0, 0.1, 0.1, size)
    found = split(pictures, reference, var, 1.0)
    naive = ((pictures - reference) ** 2).mean()
    # 4096 pixels, half of them with most of the noise.
    assert abs(naive / 0.2 - 1) < 0.15 and abs(found.squares.mean() / 0.1 - 1) < 0.3
    assert found.bias.middle**2 < 0.03 < found.bias.high**2 + 0.03 and found.rmse.low**2 < 0.1 < found.rmse.high**2
    assert np.allclose(found.error_map, np.sqrt(((pictures - reference) ** 2).mean((0, 3))))


def test_pictures_that_are_all_alike_have_a_bias_and_nothing_else() -> None:
    reference = np.random.default_rng(1).random((9, 7, 3))
    alike = np.repeat((reference + 0.3)[None].astype(np.float32), 5, 0)
    found = split(alike, reference, np.zeros_like(reference), 2.0)
    assert found.deviation == Band(0, 0, 0)
    for band in (found.bias, found.rmse):
        assert all(abs(x - 0.15) < 1e-6 for x in (band.low, band.middle, band.high))
    assert np.allclose(found.squares, 0.15**2)
    with pytest.raises(ValueError, match="at least 4"):
        split(alike[:3], reference, np.zeros_like(reference), 2.0)


def test_large_pictures_are_taken_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    parts = synthetic(np.random.default_rng(2), 5, 0.1, 1.0, 0.1)
    whole = split(*parts, 0.7)
    monkeypatch.setattr("visray.study.cost.errors.BLOCK", 5 * 12 * 3 * 5)
    again = split(*parts, 0.7)
    for name in ("rmse", "bias", "deviation"):
        a, b = (getattr(s, name) for s in (whole, again))
        assert np.allclose([a.middle, a.low, a.high], [b.middle, b.low, b.high], rtol=1e-12, atol=1e-12)
    assert np.array_equal(whole.error_map, again.error_map) and np.allclose(whole.squares, again.squares, rtol=1e-12)


def test_flip_and_mrse() -> None:
    pytest.importorskip("flip_evaluator")
    black, white = np.zeros((64, 64, 3)), np.ones((64, 64, 3))
    noisy = np.random.default_rng(1).random((64, 64, 3)).astype(np.float32)
    assert flip(noisy, noisy) == 0 and 0.95 < flip(white, black) <= 1
    # Brighter than the screen is white.
    assert flip(7 * white, white) == 0
    pictures = np.stack([noisy, noisy + 0.1, noisy, noisy, noisy + 9], dtype=np.float32)
    error, squares, wrong = judged(pictures, noisy, 0 * noisy, 0.5)
    assert squares.shape == (5,) and wrong.shape == (64, 64)
    assert abs(error.flip - flip(noisy + 0.1, noisy) / 4) < 1e-6
    exact = ((0.1**2 + 9**2) / (noisy + 0.01) ** 2).mean() / 5
    assert abs(error.mrse / exact - 1) < 1e-5
    assert abs(error.rmse.middle**2 / ((0.1**2 + 9**2) / 5 / 0.25) - 1) < 1e-5


# Slopes


def power(
    rng: np.random.Generator, k: float, noise: float, scatter: float, timing: float, n: int = 5
) -> tuple[list[float], list[np.ndarray]]:
    x = 4.0 ** np.arange(n)
    real = x * np.exp(timing * rng.standard_normal(n))
    means = real ** (-2 * k) * np.exp(2 * scatter * rng.standard_normal(n))
    return list(x), [m * (1 + noise * rng.standard_normal(SEEDS)) for m in means]


@pytest.mark.parametrize(
    ("noise", "scatter", "timing"), [(0.05, 0, 0), (0.05, 0.1, 0), (0.01, 0, 0.02), (0.01, 0.05, 0)]
)
def test_intervals_of_slopes_hold_the_truth_whatever_the_points_are_off_by(
    noise: float, scatter: float, timing: float
) -> None:
    rng, n, held = np.random.default_rng(5), 400, 0
    for _ in range(n):
        x, squares = power(rng, 0.75, noise, scatter, timing)
        found = slope(x, squares, [timing] * len(x) if timing else None)
        held += found.low <= 0.75 <= found.high
    assert held >= fewest(n, 0.93)


def test_slopes_of_too_little_are_none() -> None:
    x, squares = power(np.random.default_rng(6), 0.5, 0.05, 0, 0)
    assert slope(x[:2], squares[:2]) is None and slope([2, 2, 2], squares[:3]) is None
    assert slope(x, [*squares[:-1], np.zeros(SEEDS)]) is None
    # 16 squared errors about 0: not told from it.
    assert slope(x, [*squares[:-1], np.tile([1.0, -1.0], SEEDS // 2)]) is None
    law = [np.full(SEEDS, v**-1.0) for v in x]
    assert slope(x, law) == Slope(pytest.approx(0.5), pytest.approx(0.5), pytest.approx(0.5), 5)


# Points by hand


def band(x: float, width: float = 0.0) -> Band:
    return Band(x, x / (1 + width), x * (1 + width))


def point(
    seconds: float, error: float, settings: dict | None = None, value: Any = 0, setting: str = "setting",
    bias: float = 0.0, width: float = 0.01,
) -> Record:  # fmt: skip
    nothing = np.zeros(1)
    noise = band(sqrt(max(error**2 - bias**2, 0)), width)
    parts = Error(band(error, width), band(bias, width), noise, 0.0, 0.0)
    return Record(setting, value, settings or {}, band(seconds, width), 0.0, 0, parts, *4 * [nothing])


def test_a_frontier_has_what_nothing_beats() -> None:
    a, b, c = point(1, 0.5), point(2, 0.3), point(4, 0.1)
    beaten = [point(2.5, 0.3), point(3, 0.4), point(1, 0.6), point(5, 0.1), point(0.1, float("nan")), point(inf, 0.01)]
    twin = point(2, 0.3, setting="a name that comes first")
    assert frontier([*beaten, c, b, a]) == (a, b, c)
    for order in ([a, b, twin, c], [c, twin, b, a]):
        assert [p is q for p, q in zip(frontier(order), (a, twin, c))] == [True] * 3
    assert frontier([]) == ()


def test_the_same_choice_is_that_of_all_settings_whatever_was_measured() -> None:
    default = point(2.0, 0.4, {"n": 4})
    again = replace(default, setting="n", value=4, seconds=band(2.1))
    assert default.same_choice(again) and again.same_choice(default)
    for unlike in (point(2.0, 0.4, {"n": 5}), point(2.0, 0.4, {"n": 4, "m": 1}), point(2.0, 0.4)):
        assert not unlike.same_choice(default) and not default.same_choice(unlike)


def curve(name: str, kind: str, *rows: tuple[float, float, Any], width: float = 0.01) -> Curve:
    """Of seconds, error, value; a slope through three points or more without noise of their own."""
    points = tuple(point(t, e, {name: v}, v, name, width=width) for t, e, v in rows)
    squares = [np.full(SEEDS, e**2) for _, e, _ in rows]
    sampled = kind == "sampling" and len(rows) > 2
    slopes = [slope([row[i] for row in rows], squares) if sampled else None for i in (0, 2)]
    return Curve(name, kind, points, *slopes)


def test_halvings_by_hand() -> None:
    default = point(2.0, 0.4, width=0.01)
    curves = (
        # Error as time^-1/2: half of 0.4 at 4 times the time of 0.4, 8 s, between two points.
        curve("within", "sampling", (1.0, 0.2 * 8**0.5, 1), (4.0, 0.2 * 2**0.5, 4), (16.0, 0.2 * 0.5**0.5, 16)),
        # The same, where the points end before: by the slope of the samples.
        curve("samples, sobol", "sampling", (0.25, 0.2 * 32**0.5, 1), (0.5, 0.8, 2), (1.0, 0.2 * 8**0.5, 4)),
        # The slope would reach it after more than a decade.
        curve("samples, independent", "sampling", *((0.1 * n, 0.8 * (4 / n) ** 0.5, n) for n in (1, 2, 4))),
        # No other setting is carried on.
        curve("light samples", "sampling", (0.25, 0.2 * 32**0.5, 1), (0.5, 0.8, 2), (1.0, 0.2 * 8**0.5, 4)),
        curve("flat", "bias", (1.0, 0.41, 1), (2.0, 0.4, 2)),
        # Exactly 0 from a depth on.
        curve("depth", "bias", (1.0, 0.6, 1), (2.0, 0.4, 2), (3.0, 0.0, 4)),
        curve("tolerance", "bias", (4.0, 0.1, 0.0), (3.0, 0.2, 1e-9), (2.0, 0.4, 1e-3)),
        curve("choice", "step", (1.0, 0.1, "a")),
    )
    found = {h.setting: h for h in halvings(curves, default)}
    assert set(found) == {c.setting for c in curves} - {"choice"}
    reached = (("within", 4, 8), ("samples, sobol", 4, 32), ("depth", 1.5, 4), ("tolerance", 1.5, 1e-9))
    for name, factor, value in reached:
        h = found[name]
        assert abs(h.factor.middle / factor - 1) < 1e-9 and h.value == value, name
        assert 0.8 * factor < h.factor.low < h.factor.middle < h.factor.high < 1.25 * factor
        assert h.beyond == (name == "samples, sobol")
    for name in ("samples, independent", "light samples", "flat"):
        assert isinf(found[name].factor.middle) and isinf(found[name].factor.high) and found[name].value is None
        assert not found[name].beyond
    shares = {"within": 0.5**1.5, "flat": 1.0, "depth": 0, "samples, sobol": 2**0.5, "tolerance": 0.25}
    assert all(abs(found[name].least - share) < 1e-9 for name, share in shares.items())
    order = [h.setting for h in halvings(curves, default)]
    assert set(order[:2]) == {"depth", "tolerance"} and set(order[2:4]) == {"samples, sobol", "within"}
    assert halvings(curves, point(2.0, 0.0)) == ()


def test_bands_of_prices_hold_the_truth() -> None:
    """Points of a power law, each off by what its band says: half of the error takes 4 times the seconds."""
    rng, n, width, held = np.random.default_rng(8), 100, 0.05, 0
    for _ in range(n):
        off = np.exp(np.log(1 + width) / 1.96 * rng.standard_normal((4, 2)))
        rows = [(4.0**i * off[i, 0], 0.8 * 2.0**-i * off[i, 1], 4**i) for i in range(4)]
        c = curve("setting", "sampling", *rows, width=width)
        factor = price(c, c.points[1], 0.5).factor
        held += factor.low <= 4 <= factor.high
    assert held >= fewest(n, 0.9)


OWN = {"settings.sampler": "stratified", "settings.spp": 16}


def samples(sampler: str, time: float, k: float, width: float = 0.01) -> Curve:
    """Error n^-k of n samples; 16 stratified ones take 16 s and have an error of 1/4."""
    points = tuple(
        point(time * n, n**-k, {"settings.sampler": sampler, "settings.spp": n}, n, f"samples, {sampler}", 0, width)
        for n in sample_counts(sampler, True)
    )
    squares = [np.full(SEEDS, p.error.rmse.middle**2) for p in points]
    return Curve(f"samples, {sampler}", "sampling", points, *[slope([p.value for p in points], squares)] * 2)


def test_savings_are_surely_faster_or_more_accurate_and_in_no_respect_worse() -> None:
    own = samples("stratified", 1.0, 0.5)
    default = own.points[2]
    best, *others = savings([own, samples("sobol", 1.2, 0.75)], default)
    assert not others
    # n^-3/4 = 1/4 at n = 6.3, and 8 is the next count that was measured.
    assert best.setting == "samples, sobol" and abs(best.factor.middle - 1.2 * 8 / 16) < 1e-9
    assert best.value == 8 and best.share == best.least == pytest.approx(8**-0.75 / 0.25)
    # As fast, and more accurate: 16 points in 16 s, and 8 points in 8 s. By time times squared error 16 are better.
    first, second, *others = savings([own, samples("sobol", 1.0, 0.75)], default)
    assert (first.value, second.value, others) == (16, 8, [])
    assert first.share == pytest.approx(1 / 2) and first.factor.middle == pytest.approx(1)
    # Not where the bands are wide, and not by settings that change more than the error shows.
    assert savings([own, samples("sobol", 1.2, 0.75, width=2.0)], default) == ()
    faster = point(8.0, 0.25, OWN | {"x": 1}, 1, "depth")
    assert [p.factor.middle for p in savings([Curve("depth", "bias", (faster,))], default)] == [pytest.approx(0.5)]
    for worse in (point(8.0, 0.27, OWN | {"x": 1}, 1), point(15.9, 0.25, OWN | {"x": 1}, 1)):
        assert savings([Curve("depth", "bias", (worse,))], default) == ()
    assert savings([Curve("accelerator", "step", (faster,))], default) == ()


def test_the_best_values_together() -> None:
    own = samples("stratified", 1.0, 0.5)
    default = replace(own.points[2], settings=OWN | {"light": 8, "depth": 4})

    def varied(name: str, kind: str, *rows: tuple[float, float, dict]) -> Curve:
        return Curve(name, kind, tuple(point(t, e, default.settings | s, 0, name) for t, e, s in rows))

    # With a slope of 1/2, time x error^2 decides: 4 light samples take 0.6 x 1.21 of the time, 2 take 0.5 x 2.
    light = varied("light samples", "sampling", (9.6, 0.275, {"light": 4}), (8.0, 0.25 * 2**0.5, {"light": 2}))
    depth = varied("depth", "bias", (8.0, 0.25, {"depth": 3}), (4.0, 0.3, {"depth": 1}))
    curves = [own, samples("sobol", 1.2, 0.75), light, depth]
    assert together(curves, default) == {"settings.sampler": "sobol", "light": 4, "depth": 3}
    assert together([own], default) == {}
