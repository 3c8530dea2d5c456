"""What a study of costs makes of measured numbers: errors with bands, slopes, frontiers, a model of all knobs."""

from dataclasses import replace
from itertools import product
from math import comb, inf, isinf, log, sqrt
from typing import Any

import drjit as dr
import numpy as np
import pytest

from visray.quantities import Arrays
from visray.sampling import SamplePlan, SampleState, first_stratum, pixel_key
from visray.study.cost.errors import flip, judged, split, student
from visray.study.cost.frontier import frontier, halvings, overtaken, ranked, steps
from visray.study.cost.laws import PowerLaw, grid, nonnegative
from visray.study.cost.model import Model
from visray.study.cost.records import Band, Curve, Error, Halving, Point, Slope
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
    assert np.allclose(found.wrong, np.sqrt(((pictures - reference) ** 2).mean((0, 3))))


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
    assert np.array_equal(whole.wrong, again.wrong) and np.allclose(whole.squares, again.squares, rtol=1e-12)


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
    seconds: float, error: float, settings: dict | None = None, value: Any = 0, knob: str = "knob",
    bias: float = 0.0, width: float = 0.01,
) -> Point:  # fmt: skip
    nothing = np.zeros(1)
    noise = band(sqrt(max(error**2 - bias**2, 0)), width)
    parts = Error(band(error, width), band(bias, width), noise, 0.0, 0.0)
    return Point(knob, value, settings or {}, band(seconds, width), 0.0, 0, parts, nothing, nothing, nothing, nothing)


def test_a_frontier_has_what_nothing_beats() -> None:
    a, b, c = point(1, 0.5), point(2, 0.3), point(4, 0.1)
    beaten = [point(2.5, 0.3), point(3, 0.4), point(1, 0.6), point(5, 0.1), point(0.1, float("nan")), point(inf, 0.01)]
    twin = point(2, 0.3, knob="a name that comes first")
    assert frontier([*beaten, c, b, a]) == (a, b, c)
    for order in ([a, b, twin, c], [c, twin, b, a]):
        assert [p is q for p, q in zip(frontier(order), (a, twin, c))] == [True] * 3
    assert frontier([]) == ()


def test_the_same_choice_is_that_of_all_knobs_whatever_was_measured() -> None:
    default = point(2.0, 0.4, {"n": 4})
    again, other = replace(default, knob="n", value=4, seconds=band(2.1)), replace(default, settings={"n": 4, "way": 1})
    assert default.same_choice(again) and again.same_choice(default)
    for unlike in (other, point(2.0, 0.4, {"n": 5}), point(2.0, 0.4, {"n": 4, "m": 1}), point(2.0, 0.4)):
        assert not unlike.same_choice(default) and not default.same_choice(unlike)
    (step,) = steps([Curve("way", "step", (again, replace(other, value="other")))], default)
    assert step.value == "other"
    # Itself, measured again, is not a neighbour.
    cheap, dear = point(1.0, 0.8, {"n": 2}), point(4.0, 0.1, {"n": 8})
    share, *ends = overtaken([cheap, replace(again, error=point(2.1, 0.39).error), dear], default)
    assert ends == [cheap, dear] and abs(share - 4 ** (1 / 3) / 2) < 1e-12


def curve(name: str, kind: str, *rows: tuple[float, float, Any], width: float = 0.01) -> Curve:
    """Of seconds, error, value."""
    return Curve(name, kind, tuple(point(t, e, {name: v}, v, name, width=width) for t, e, v in rows))


def test_halvings_by_hand() -> None:
    default = point(2.0, 0.4, width=0.01)
    curves = (
        # Error as time^-1/2: half of 0.4 at 4 times the time of 0.4, 8 s, between two points.
        curve("within", "sampling", (1.0, 0.2 * 8**0.5, 1), (4.0, 0.2 * 2**0.5, 4), (16.0, 0.2 * 0.5**0.5, 16)),
        # The same, where the points end before.
        curve("samples, sobol", "sampling", (0.25, 0.2 * 32**0.5, 1), (0.5, 0.8, 2), (1.0, 0.2 * 8**0.5, 4)),
        # The law would reach it after more than a decade.
        curve("too far", "sampling", (0.5, 0.8, 1), (0.6, 0.8 * (0.6 / 0.5) ** -0.5, 2)),
        curve("a floor", "sampling", (1.0, 0.5, 1), (4.0, 0.4, 4), (16.0, 0.39, 16)),
        # Both would reach it within a decade; but one bends, and the other may as well not fall.
        curve("samples, independent", "sampling", (0.5, 0.8, 1), (1.0, 0.5, 2), (4.0, 0.35, 8)),
        curve("samples, stratified", "sampling", (1.0, 0.45, 1), (1.2, 0.4, 2), width=0.2),
        curve("flat", "bias", (1.0, 0.41, 1), (2.0, 0.4, 2)),
        # Exactly 0 from a depth on.
        curve("depth", "bias", (1.0, 0.6, 1), (2.0, 0.4, 2), (3.0, 0.0, 4)),
        curve("tolerance", "bias", (4.0, 0.1, 0.0), (3.0, 0.2, 1e-9), (2.0, 0.4, 1e-3)),
        curve("choice", "step", (1.0, 0.1, "a")),
    )
    found = {h.knob: h for h in halvings(curves, default)}
    assert set(found) == {c.knob for c in curves} - {"choice"}
    for name, factor, value in (
        ("within", 4, 8),
        ("samples, sobol", 4, 32),
        ("depth", 1.5, 4),
        ("tolerance", 1.5, 1e-9),
    ):
        h = found[name]
        assert abs(h.factor.middle / factor - 1) < 1e-9 and h.value == value, name
        assert 0.8 * factor < h.factor.low < h.factor.middle < h.factor.high < 1.25 * factor
        assert h.beyond == (name == "samples, sobol")
    for name in ("too far", "a floor", "samples, independent", "samples, stratified", "flat"):
        assert isinf(found[name].factor.middle) and isinf(found[name].factor.high) and found[name].value is None
        assert not found[name].beyond
    shares = {"within": 0.5**1.5, "a floor": 0.975, "depth": 0, "samples, sobol": 2**0.5, "tolerance": 0.25}
    assert all(abs(found[name].least - share) < 1e-9 for name, share in shares.items())
    assert [h.rank for h in halvings(curves, default)] == [1, 1, 2, 2, 3, 3, 3, 3, 3]
    assert [h.knob for h in halvings(curves, default)][:4] == ["depth", "tolerance", "samples, sobol", "within"]
    assert halvings(curves, point(2.0, 0.0)) == ()


@pytest.mark.parametrize(("share", "value"), [(0.0, 32), (0.1, 48), (0.15, 68), (0.2, None), (0.3, None)])
def test_beyond_the_last_light_samples_error_falls_to_what_they_leave(share: float, value: int | None) -> None:
    """error^2 = a + b / n, of which a is this share of the default's square: half of the error is a quarter of it, and
    is reached at n = b / (1/4 - a) where that is within a decade. Samples of pixels take all noise away, whatever the
    last of them did, so that of them the power law holds: here that of the last two points."""
    error = lambda n: 0.4 * sqrt(share + (1 - share) * 8 / n)  # noqa: E731 - a name for a row
    rows = [(0.1 * n, error(n), n) for n in (2, 4, 8)]
    default = point(0.8, 0.4, {"light samples": 8}, 8, "light samples")
    (found,) = halvings([curve("light samples", "sampling", *rows, width=0.001)], default)
    (samples,) = halvings([curve("samples, sobol", "sampling", *rows, width=0.001)], default)
    assert found.value == value and found.beyond == (value is not None)
    if value:
        exact = 8 * (1 - share) / (0.25 - share)
        assert value == int(np.ceil(round(exact, 6))) and abs(found.factor.middle / (exact / 8) - 1) < 1e-9
    else:
        # 0.2: it would be at 128, more than a decade further.
        assert isinf(found.factor.middle) and isinf(found.factor.low)
    slope = log(error(4) / error(8)) / log(2)
    power = 8 * 2 ** (1 / slope)
    assert samples.value == (int(np.ceil(round(power, 6))) if power <= 80 else None)


def test_a_tolerance_ends_at_0() -> None:
    """There is no smaller one, however steeply the error falls before."""
    rows = ((4.0, 0.21, 0.0), (3.0, 0.3, 1e-9), (2.0, 0.4, 1e-3))
    (found,) = halvings([curve("roots", "bias", *rows)], point(2.0, 0.4, value=1e-3))
    assert isinf(found.factor.middle) and found.value is None


def test_in_a_rank_what_gets_there_comes_first() -> None:
    """And of both kinds the order is that of the alphabet."""
    never = Band(inf, 1.9, inf)
    found = [Halving(name, never, 0.6, None, 0) for name in "ca"]
    found += [Halving(name, Band(x, 1.8, 3.0), 0.3, 9, 0) for name, x in (("d", 2.0), ("b", 2.1))]
    assert [(h.knob, h.rank) for h in ranked(found)] == [("b", 1), ("d", 1), ("a", 1), ("c", 1)]


@pytest.mark.slow
def test_what_is_reached_does_not_depend_on_how_fast_the_machine_was() -> None:
    """Of a knob that levels off, as rays of an effect do beside other noise (heart), and of samples, which do not: with
    seconds that differ by 5 % from study to study the one is never reached, the other always."""
    rng, found = np.random.default_rng(5), []
    for _ in range(200):
        s = np.exp(0.05 * rng.normal(size=4)) * [0.0398, 0.0450, 0.0560, 0.0768]
        rows = [(x, e, n) for x, e, n in zip(s, (0.01616, 0.01207, 0.00986, 0.00865), (1, 2, 4, 8))]
        rays = curve("rays", "sampling", *rows, width=0.03)
        samples = curve("samples", "sampling", *((x, 0.02 / n**0.5, n) for x, n in zip(s, (1, 2, 4, 8))), width=0.03)
        default = point(s[2], 0.00986, value=4)
        found.append({h.knob: np.isfinite(h.factor.middle) for h in halvings([rays, samples], default)})
    assert all(f == {"rays": False, "samples": True} for f in found)


def test_bands_of_halvings_hold_the_truth() -> None:
    """Points of a power law, each off by what its band says: half of the error takes 4 times the seconds."""
    rng, n, width, held = np.random.default_rng(8), 100, 0.05, 0
    for _ in range(n):
        off = np.exp(np.log(1 + width) / 1.96 * rng.standard_normal((4, 2)))
        rows = [(4.0**i * off[i, 0], 0.8 * 2.0**-i * off[i, 1], 4**i) for i in range(4)]
        c = curve("knob", "sampling", *rows, width=width)
        factor = halvings([c], c.points[1])[0].factor
        held += factor.low <= 4 <= factor.high
    assert held >= fewest(n, 0.9)


def test_ranks_do_not_change_by_noise_within_the_bands() -> None:
    rng, kept = np.random.default_rng(9), set()
    true = {"c": 2.0, "a": 2.02, "b": 1.98, "e": 6.0, "d": 6.1, "never": inf, "nor": inf}
    for _ in range(200):
        found = []
        for name in rng.permutation(list(true)):
            middle = true[name] * (1 + 0.02 * rng.uniform(-1, 1))
            found.append(Halving(str(name), Band(middle, middle * 0.9, middle * 1.1), 1.0, None, 0))
        kept.add(tuple((h.knob, h.rank) for h in ranked(found)))
    assert kept == {(("a", 1), ("b", 1), ("c", 1), ("d", 2), ("e", 2), ("never", 3), ("nor", 3))}


def test_steps_say_what_a_choice_changes() -> None:
    default = point(2.0, 0.4, {"precision": "single"}, "single")
    rows = (default, point(2.6, 0.4, {"precision": "double"}, "double"), point(2.0, 0.2, {"precision": "x"}, "x"))
    same, other = steps([Curve("precision", "step", rows), curve("n", "sampling", (1.0, 0.1, 1))], default)
    assert (same.value, same.changes, other.value, other.changes) == ("double", False, "x", True)
    assert abs(same.seconds.middle - 1.3) < 1e-12 and same.seconds.low > 1.25 and same.seconds.high < 1.35
    assert abs(other.error.middle - 0.5) < 1e-12
    exact, off = point(2.0, 0.0, {"n": 1}), point(2.0, 0.1, {"n": 2})
    for default, ratio, changes in ((exact, inf, True), (replace(exact, settings={}), 1, False)):
        (step,) = steps([Curve("n", "step", (off if changes else exact,))], default)
        assert (step.error.middle, step.changes) == (ratio, changes)


# The model


def test_least_squares_without_negative_numbers_are_the_best() -> None:
    """By the conditions of Karush, Kuhn and Tucker, which hold at the minimum alone."""
    rng = np.random.default_rng(10)
    for _ in range(200):
        m, n = int(rng.integers(3, 12)), int(rng.integers(1, 6))
        rows, right = rng.standard_normal((m, n)), rng.standard_normal(m)
        x = nonnegative(rows, right)
        gradient = rows.T @ (right - rows @ x)
        assert (x >= 0).all() and (gradient < 1e-9).all() and np.abs(gradient[x > 0]).max(initial=0) < 1e-9


def test_laws_and_grids() -> None:
    n = np.array([1.0, 4, 16, 64])
    law = PowerLaw.of(n, 0.3 + 2.0 * n**-1.5, 4.0)
    assert abs(law.floor - 0.3) < 1e-9 and law.p == 1.5 and abs(law.u - 2 * 4**-1.5) < 1e-9
    assert grid([1, 4, 16]) == [1, 4, 9, 16, 36, 64] and grid([3, 6, 12]) == [3, 6, 12, 24, 48]
    assert grid([2, 16]) == [2, 4, 8, 16, 32, 64] and grid([9]) == [9, 16, 36]


DEFAULT = {
    "settings.spp": 16, "settings.sampler": "stratified", "lights.a.samples": 4, "lights.b.samples": 16,
    "settings.occlusion.sky": 4, "settings.depth": 4, "settings.precision": "single", "left.alone": "x",
}  # fmt: skip


def true_seconds(s: dict) -> float:
    each = 1.0 + 0.05 * (s["lights.a.samples"] + s["lights.b.samples"]) + 0.2 * s["settings.occlusion.sky"]
    ways = {1: 0.5, 2: 0.7, 4: 1.0, 8: 1.1}[s["settings.depth"]] * (1.3 if s["settings.precision"] == "double" else 1)
    return 0.5 + s["settings.spp"] * each * ways * (1.2 if s["settings.sampler"] == "sobol" else 1)


def true_error(s: dict) -> float:
    spp, light = s["settings.spp"], (s["lights.a.samples"] + s["lights.b.samples"]) / 20
    edges = {"stratified": 40 * spp**-1.5, "sobol": 30 * spp**-1.6, "independent": 20 / spp}[s["settings.sampler"]]
    parts = (8 * light**-1.5 + 6 * (s["settings.occlusion.sky"] / 4) ** -1.0) / spp
    return 0.01 * sqrt(edges + parts + 4.0 ** (2 - s["settings.depth"]))


def turned(name: str, kind: str, *values: dict) -> Curve:
    points = []
    for i, value in enumerate(values):
        s = DEFAULT | value
        bias = 0.01 * 2.0 ** (2 - s["settings.depth"])
        points.append(point(true_seconds(s), true_error(s), s, i, name, bias))
    return Curve(name, kind, tuple(points))


CURVES = (
    *(
        turned(f"samples, {k}", "sampling", *({"settings.sampler": k, "settings.spp": 4**i} for i in range(5)))
        for k in ("stratified", "sobol", "independent")
    ),
    turned("light samples", "sampling", *({"lights.a.samples": n, "lights.b.samples": 4 * n} for n in (1, 4, 16))),
    turned("sky rays", "sampling", *({"settings.occlusion.sky": n} for n in (1, 4, 16, 64))),
    turned("depth", "bias", *({"settings.depth": n} for n in (1, 2, 4, 8))),
    turned("precision", "step", {"settings.precision": "single"}, {"settings.precision": "double"}),
    turned("accelerator", "step", {}, {}),
)
MODEL = Model.of(point(true_seconds(DEFAULT), true_error(DEFAULT), DEFAULT, bias=0.01 * 2.0**-2), CURVES)


def everything() -> list[dict]:
    """All candidates."""
    return [{k: v for part in parts for k, v in part.items()} for parts in product(*MODEL.candidates())]


def test_a_model_knows_its_points_and_predicts_others() -> None:
    for p in (p for c in CURVES for p in c.points):
        assert abs(MODEL.seconds(p.settings) / p.seconds.middle - 1) < 1e-6
        # The noise of a sampler is exact; a power is one of a grid.
        assert abs(MODEL.error(p.settings) / p.error.rmse.middle - 1) < 1e-6
    every = everything()
    # Squares: 5 measured ones of each sampler, 3 between (none between 1 and 4) and 2 beyond; 3 + 2 + 2 and 4 + 2 + 2.
    assert len(every) == 3 * 10 * 7 * 8 * 4 * 2
    seconds, error = (np.array([f(s) for s in every]) for f in (MODEL.seconds, MODEL.error))
    full = [DEFAULT | s for s in every]
    assert np.allclose(seconds, [true_seconds(s) for s in full], rtol=1e-6)
    off = np.abs(np.log(error / [true_error(s) for s in full]))
    # What is between and beyond the points: a sum of two powers is taken for one, and the samplers' parts for alike.
    # Worst is the far corner, beyond all points at once.
    assert np.median(off) < 1e-6 and np.quantile(off, 0.99) < 0.1 and off.max() < 0.5


def test_what_a_model_chooses_is_the_best_of_all() -> None:
    every = everything()
    seconds, error = (np.array([f(s) for s in every]) for f in (MODEL.seconds, MODEL.error))
    for target in np.geomspace(error.min() * 1.0001, error.max(), 25):
        fastest, least = MODEL.fastest(target), seconds[error <= target].min()
        assert MODEL.error(fastest) <= target * (1 + 1e-12) and abs(MODEL.seconds(fastest) / least - 1) < 1e-12
    for budget in np.geomspace(seconds.min() * 1.0001, seconds.max(), 25):
        best, least = MODEL.best(budget), error[seconds <= budget].min()
        assert MODEL.seconds(best) <= budget * (1 + 1e-12) and abs(MODEL.error(best) / least - 1) < 1e-12
    assert MODEL.fastest(error.min() * 0.999) is None and MODEL.best(seconds.min() * 0.999) is None


def test_a_ladder_climbs_the_frontier() -> None:
    ladder = MODEL.ladder(8)
    seconds, error = [MODEL.seconds(s) for s in ladder], [MODEL.error(s) for s in ladder]
    assert len(ladder) == 8 and seconds == sorted(seconds) and error == sorted(error, reverse=True)
    assert all(s.keys() == DEFAULT.keys() and s["left.alone"] == "x" for s in ladder)
    assert MODEL.best(seconds[3] * (1 + 1e-12)) == ladder[3]
    # By equal factors: none is more than twice as far as the others on the mean.
    gaps = np.diff(np.log(seconds))
    assert gaps.max() < 2 * gaps.mean()
    short = MODEL.ladder(8, longest=seconds[4])
    assert len(short) == 8 and max(map(MODEL.seconds, short)) <= seconds[4] * (1 + 1e-12)


def test_a_model_without_noise_or_curves() -> None:
    default = point(1.0, 0.1, DEFAULT, bias=0.1, width=0.0)
    quiet = [replace(default, settings=DEFAULT | {"settings.spp": n}, seconds=band(n / 16)) for n in (1, 4, 16)]
    model = Model.of(default, (Curve("samples, stratified", "sampling", tuple(quiet)),))
    assert model.ladder(4) == (DEFAULT | {"settings.spp": 1},) and abs(model.error({}) - 0.1) < 1e-12
    assert Model.of(point(1.0, 0.1, DEFAULT), ()).ladder(3)[0]["lights.a.samples"] == 4
    with pytest.raises(ValueError, match="not measured"):
        MODEL.seconds({"settings.depth": 3})
