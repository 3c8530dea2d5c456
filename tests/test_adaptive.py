"""Pictures to an error or in a time: the error is true, the goal met, no pixel has a bias, what cannot be is refused.

Chances of a false alarm are about 1e-6 in each test; seeds are fixed.
"""

import json
import re
import signal
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import inf, nan, sqrt
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest
from PIL import Image as Pillow
from test_render import compiled
from virtual import Machine

from visray import clock
from visray.adaptive import allocation, dual_buffer, lane_buffer
from visray.adaptive import loop as adaptive
from visray.adaptive.allocation import LARGEST_LEVEL, STEPS, WEIGHT_RANGE, Allocation
from visray.adaptive.depth_bias import depth_biases
from visray.adaptive.dual_buffer import QUANTILE, DualBuffer
from visray.adaptive.error_floor import ROUNDINGS, Files
from visray.adaptive.estimate import Estimate, ratio_quantile
from visray.adaptive.journal import Journal
from visray.adaptive.loop import AdaptiveRun
from visray.adaptive.stopping import Goal
from visray.camera import Camera
from visray.cli import main
from visray.errors import DepthWarning, GoalWarning, UserError
from visray.geometry import gamma as rounded
from visray.lights import PointLight, RectangleLight
from visray.materials import Material
from visray.output.curves import LUMINANCE, linear
from visray.output.image import Image
from visray.output.rounding import rounding
from visray.pass_timer import PassTimer
from visray.passes import empty_film, exposed_once, first_pass_samples
from visray.primitives import Cylinder, Plane, Rectangle, Sphere
from visray.progress import Bar, Interrupts
from visray.renderer import render
from visray.scene.load import load
from visray.scene.scene import Film, Scatter, Scene, Settings
from visray.setup import Prepared, prepare

SCENES = Path(__file__).resolve().parents[1] / "scenes"
# Edges, a thin rod, and a penumbra from one light sample a point.
EDGES = Scene(
    camera=Camera(origin=(0, 2, 8), target=(0, 0.6, 0), fov=35.0),
    film=Film(width=40, height=30),
    background=(0.05, 0.06, 0.1),
    ambient=(0.1, 0.1, 0.1),
    materials={"grey": Material(kd=(0.6, 0.6, 0.6)), "red": Material(kd=(0.8, 0.2, 0.1))},
    lights={"panel": RectangleLight(position=(-2, 4, 2), width=(1.5, 0, 0), height=(0, 0, 1.5), samples=1)},
    objects={
        "floor": Plane(material="grey"),
        "ball": Sphere(center=(-0.6, 0.8, 0), radius=0.8, material="red"),
        "rod": Cylinder(center=(1.2, 0.8, 0.5), radius=0.06, height=1.6, material="grey"),
    },
    settings=Settings(sampler="sobol"),
)
# Nothing in it differs from sample to sample.
FLAT = Scene(film=Film(width=40, height=30), background=(0.1, 0.7, 1 / 3), camera=Camera(), lights={})
SMALL = Film(width=24, height=18)
# Operations of a kernel that takes no samples, at most.
SMALL_KERNEL = 200
# What normal numbers exceed with a chance of 1e-6, to both sides and to one.
BOTH_SIDES, ONE_SIDE = 4.9, 4.76


def render_adaptively(scene: Scene, **more: Any) -> Image:
    return render(scene, progress=False, **{"layers": ("RGB", "A", "variance", "error", "samples")} | more)


def with_settings(scene: Scene, **settings: Any) -> Scene:
    return replace(scene, settings=replace(scene.settings, **settings))


def seeded(made: Prepared, seed: int) -> Prepared:
    """The same set-up with another seed."""
    return replace(made, scene=with_settings(made.scene, seed=seed))


def silent(_: object) -> None:
    """Takes a forecast and says nothing."""


def pursuit(
    made: Prepared, error: float | None = None, seconds: float | None = None, interrupts: Any = None
) -> AdaptiveRun:
    goal = Goal(error, seconds, clock.now())
    found = AdaptiveRun(made, goal, interrupts or Interrupts(), Bar("", 1, False), silent, Journal())
    found.run(Files())
    return found


# The estimate of the error


PIXELS, TRIALS = 1200, 2000


def even(rng: np.random.Generator) -> np.ndarray:
    """Alike from pixel to pixel, and from channel to channel: a grey picture."""
    return np.broadcast_to(0.1 * rng.normal(size=(2, 1, PIXELS)), (2, 3, PIXELS))


def uneven(rng: np.random.Generator) -> np.ndarray:
    """Standard deviations from 1e-3 to 1."""
    return np.geomspace(1e-3, 1, PIXELS) * rng.normal(size=(2, 3, PIXELS))


def shrunk(rng: np.random.Generator) -> np.ndarray:
    """One half has ten times the variance of the other."""
    return np.array([[[1.0]], [[sqrt(10)]]]) * rng.normal(size=(2, 3, PIXELS))


def heavy(rng: np.random.Generator) -> np.ndarray:
    """Student's distribution with 9 degrees of freedom, and variances as those of a few bright edges."""
    return np.where(np.arange(PIXELS) % 20 == 0, 1, 0.05) * rng.standard_t(9, size=(2, 1, PIXELS)) * np.ones((1, 3, 1))


def rare(rng: np.random.Generator) -> np.ndarray:
    """A twentieth of the pixels differ from black, as by a highlight: lopsided."""
    return ((rng.random((2, 1, PIXELS)) < 0.05) - 0.05) * np.ones((1, 3, 1))


@pytest.mark.parametrize("d", [1, 2, 4, 4.5, 30, 1000, 1e6])
def test_ratios_of_mean_squares(d: float) -> None:
    """By closed forms for 1 and 2 degrees of freedom, else by quantiles of two million random numbers."""
    if d <= 2:
        true = np.log(np.tan(0.975 * np.pi / 2) ** 2 if d == 1 else 39)
        assert np.log(ratio_quantile(d)) == pytest.approx(true, rel=1e-4)
    else:
        a, b = np.random.default_rng(5).chisquare(d, (2, 2 * 10**6))
        found = np.log(a / b)
        # As often as it should be, but for chance.
        share, n = (np.abs(found) > np.log(ratio_quantile(d))).mean(), found.size
        assert abs(share - 0.05) < BOTH_SIDES * sqrt(0.05 * 0.95 / n)


@pytest.mark.parametrize("pixels", [1, 2, 3, 8])
@pytest.mark.slow
def test_the_interval_holds_the_truth_with_few_pixels(pixels: int) -> None:
    """Grey ones, whose channels tell one number: 95 % at least, over 20,000 pictures."""
    rng, inside, n = np.random.default_rng(1), 0, 20_000
    for a, b in np.broadcast_to(rng.normal(size=(n, 2, 1, pixels)), (n, 2, 3, pixels)):
        found, square = Estimate.of(1e3 + a, 1e3 + b), np.square((a + b) / 2).mean()
        inside += found.low <= sqrt(square) / found.luminance <= found.high
    assert inside >= n * 0.95 - ONE_SIDE * sqrt(n * 0.95 * 0.05)


@pytest.mark.parametrize("noise", [even, uneven, shrunk, heavy, rare])
def test_the_estimate_is_unbiased_and_its_interval_holds_the_truth(noise: Callable) -> None:
    """For 95 % at least, over 2000 pictures; a share below 0.927 has a chance of 1e-6 if it is 0.95."""
    rng = np.random.default_rng(0)
    true = rng.uniform(0.2, 1, (3, PIXELS))
    off, inside = [], 0
    for _ in range(TRIALS):
        a, b = true + noise(rng)
        found = Estimate.of(a, b)
        square = np.square((a + b) / 2 - true).mean()
        off.append(found.square - square)
        luminance = (LUMINANCE @ (a + b)).mean() / 2
        assert found.luminance == pytest.approx(luminance) and found.error == pytest.approx(
            sqrt(found.square) / luminance
        )
        inside += found.low <= sqrt(square) / luminance <= found.high
    assert abs(np.mean(off)) <= BOTH_SIDES * np.std(off) / sqrt(TRIALS)
    assert inside / TRIALS >= 0.95 - ONE_SIDE * sqrt(0.95 * 0.05 / TRIALS)


def test_the_interval_is_not_too_wide() -> None:
    """Of few pixels that matter and tails that are heavy it holds the truth in no more than 99.9 %; where squares are
    nearly alike, its bound of the variance is at most three times too large."""
    rng, wide = np.random.default_rng(1), []
    for _ in range(TRIALS):
        a, b = even(rng)
        found = Estimate.of(a + 1, b + 1)
        wide.append((found.square - np.square((a + b) / 2).mean(), np.square(found.high * found.luminance)))
    off, high = np.array(wide).T
    spread = (high - 0.1**2 / 2).mean() / QUANTILE
    assert 1 <= spread / off.std() <= sqrt(3)


def test_a_picture_without_light_has_an_absolute_error() -> None:
    found = Estimate.of(np.zeros((3, 8)), np.zeros((3, 8)))
    assert (found.error, found.low, found.high, found.luminance) == (0, 0, 0, 0)


# The allocation


def slow_around(x: np.ndarray) -> np.ndarray:
    """As allocation.neighbour_means, pixel by pixel: binomial weights, without the pixel's own value."""
    weights = np.outer([1, 4, 6, 4, 1], [1, 4, 6, 4, 1]) / 256
    height, width = x.shape
    found = np.ones((height, width))
    for row in range(height):
        for column in range(width):
            total = mass = 0.0
            for v in range(max(row - 2, 0), min(row + 3, height)):
                for u in range(max(column - 2, 0), min(column + 3, width)):
                    if (v, u) != (row, column):
                        w = weights[v - row + 2, u - column + 2]
                        total, mass = total + w * x[v, u], mass + w
            if mass:
                found[row, column] = total / mass
    return found


@pytest.mark.parametrize("shape", [(7, 9), (1, 6), (6, 1), (2, 3), (1, 1), (3, 2), (5, 5)])
def test_weights_around_a_pixel_are_the_means_of_all_others(shape: tuple[int, int]) -> None:
    x = np.random.default_rng(0).lognormal(0, 2, shape)
    np.testing.assert_allclose(allocation.neighbour_means(x), slow_around(x), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("shape", [(7, 9), (1, 6)])
def test_a_pixel_s_own_value_does_not_count(shape: tuple[int, int]) -> None:
    """In whole numbers, which no sum rounds: bit for bit. The neighbours' weights do change."""
    before = np.random.default_rng(1).integers(0, 100, shape).astype(float)
    for y, x in [(0, 0), (0, shape[1] - 1), (shape[0] // 2, shape[1] // 2)]:
        after = before.copy()
        after[y, x] += 4096
        old, new = allocation.neighbour_means(before), allocation.neighbour_means(after)
        assert new[y, x] == old[y, x]
        beside = max(x - 1, 0) if x else 1
        assert new[y, beside] > old[y, beside]


def test_means_of_3_by_3_pixels_at_borders() -> None:
    for shape in [(4, 5), (1, 5), (5, 1), (1, 1)]:
        x = np.random.default_rng(0).random(shape)
        wide = np.pad(x, 1, constant_values=np.nan)
        slow = [[np.nanmean(wide[i : i + 3, j : j + 3]) for j in range(shape[1])] for i in range(shape[0])]
        np.testing.assert_allclose(dual_buffer.smoothed(x), slow, rtol=1e-12)


def lanes(seed: int, n: int = 500) -> tuple[np.ndarray, np.ndarray]:
    """Variances over ten decades, some zero, and samples that lanes have."""
    rng = np.random.default_rng(seed)
    variances = 10 ** rng.uniform(-10, 0, n)
    variances[rng.random(n) < 0.1] = 0
    return variances, 2 ** rng.integers(2, 6, n)


def slow_targets(variances: np.ndarray, counts: np.ndarray, number: int) -> np.ndarray:
    """Pixel by pixel: the power of two that is nearest to weight * 2^(number / STEPS), in logarithms; no less than half
    of their mean, rounded down to a power of two."""
    found = []
    for variance, count in zip(variances.tolist(), counts.tolist()):
        wanted = 1
        if variance > 0:
            step = round(STEPS * np.log2(variance) / 2)
            wanted = 2 ** int(np.clip(np.floor((step + number) / STEPS + 0.5), 0, LARGEST_LEVEL))
        found.append(max(wanted, count))
    return np.maximum(found, int(2 ** (np.floor(np.log2(np.mean(found))) - 1)))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_targets_are_powers_of_two_that_never_fall(seed: int) -> None:
    variances, counts = lanes(seed)
    found = Allocation.of(variances, counts)
    before = counts
    for number in range(-40, 400, 3):
        targets = found.targets(number)
        assert np.array_equal(targets, slow_targets(variances, counts, number))
        assert (targets >= before).all() and (targets & (targets - 1) == 0).all()
        # Where nothing varies around a pixel, something may yet be in it.
        assert targets.min() >= targets.mean() / 8
        before = targets
    assert before.max() == 2**LARGEST_LEVEL


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.slow
def test_the_least_number_is_the_least(seed: int) -> None:
    """And what it is told of samples and error is the mean over lanes."""
    variances, counts = lanes(seed)
    found = Allocation.of(variances, counts)
    found.update(1e-3, counts)
    weights = np.where(variances > 0, 2 ** (np.rint(STEPS / 2 * np.log2(np.maximum(variances, 1e-300))) / STEPS), 0)
    scale = 1e-3 / np.mean(weights**2 * counts.astype(float) ** -found.power)

    numbers = range(-STEPS * WEIGHT_RANGE, STEPS * (WEIGHT_RANGE + LARGEST_LEVEL) + 1)
    targets = {n: slow_targets(variances, counts, n) for n in numbers}
    expected = {
        n: (k.mean(), scale * np.mean(weights**2 * k.astype(float) ** -found.power), k.min())
        for n, k in targets.items()
    }
    for limit in (9e-4, 1e-4, 1e-5):
        told: list[tuple[float, float, int]] = []

        def enough(mean: float, square: float, least: int, limit: float = limit, told: list = told) -> bool:
            told.append((mean, square, least))
            return square <= limit

        number = found.smallest_budget(enough)
        slow = next(n for n in numbers if expected[n][1] <= limit)
        assert np.array_equal(targets[number], targets[slow])
        every = np.array(list(expected.values()))
        for heard in told:
            assert np.isclose(every, heard, rtol=1e-9, atol=0).all(1).any()
    # By samples: the first number that has as many on average.
    number = found.smallest_budget(lambda mean, *_: mean >= 100)
    assert expected[number][0] >= 100 > expected[number - 1][0]
    # What cannot be had is answered with the most samples of all.
    assert (found.targets(found.smallest_budget(lambda *_: False))[variances > 0] == 2**LARGEST_LEVEL).all()


@pytest.mark.parametrize("power", [1.0, 1.25, 1.5])
def test_the_power_is_learned(power: float) -> None:
    """Of squares that fall as they do, to a step of the table; what it then expects is right to a few percent."""
    variances, counts = lanes(3)
    weights = np.where(variances > 0, variances, 0)
    square = lambda n: float(np.mean(weights * n.astype(float) ** -power))  # noqa: E731
    found = Allocation.of(variances, counts)
    found.update(square(counts), counts)
    targets = found.targets(40)
    found.update(square(targets), targets)
    assert found.power == pytest.approx(power, abs=0.03)
    more = found.targets(56)
    heard = []
    found.smallest_budget(lambda mean, expected, _: heard.append((mean, expected)) or mean >= more.mean())
    mean, expected = min(heard, key=lambda pair: abs(pair[0] - more.mean()))
    assert mean == more.mean() and expected == pytest.approx(square(more), rel=0.05)


@pytest.mark.parametrize(("chance", "lone"), [(0.5, False), (0.1, False), (0.1, True)])
def test_neither_picture_nor_estimate_has_a_bias(chance: float, lone: bool) -> None:
    """Of samples that are 1 with a chance and else 0, after a pilot of 4, also where pixels are lopsided and lone: what
    the halves' pilots find next to a pixel says nothing of its own samples."""
    rng, shape, pilot = np.random.default_rng(0), (18, 24), 4
    chances = np.full(shape, chance)
    if lone:
        chances[:] = 0
        chances[2::6, 2::6] = chance
    told, true, off = [], [], []
    for _ in range(1000):
        hits = rng.binomial(pilot, np.stack([chances] * 2))
        variances = hits / pilot * (1 - hits / pilot) * pilot / (pilot - 1)
        around = allocation.neighbour_means(variances.sum(0)).ravel()
        counts = Allocation.of(around, np.full(chances.size, pilot)).targets(48).reshape(shape)
        a, b = (hits + rng.binomial(counts - pilot, chances, hits.shape)) / counts
        told.append((np.square(a - b) / 4).mean())
        true.append(np.square((a + b) / 2 - chances).mean())
        off.append(((a + b) / 2 - chances).mean())
    assert abs(np.mean(off)) <= BOTH_SIDES * np.std(off) / sqrt(len(off))
    differences = np.subtract(told, true)
    assert abs(differences.mean()) <= BOTH_SIDES * differences.std() / sqrt(len(told))
    assert BOTH_SIDES * differences.std() / sqrt(len(told)) < 0.1 * np.mean(true)  # or it would say nothing


# The halves


def one_pass(monkeypatch: pytest.MonkeyPatch, samples: int) -> Callable[[DualBuffer, np.ndarray], bool]:
    """Extends by one pass of so many samples at most, as if there were time for no more."""
    monkeypatch.setattr(lane_buffer, "first_pass_samples", lambda made: samples)

    def extend(h: DualBuffer, targets: np.ndarray) -> bool:
        h.pace, left = PassTimer(), iter([np.inf])
        return h.extend(targets, lambda: next(left, 0.0))

    return extend


def some_counts(h: DualBuffer) -> np.ndarray:
    return 2 ** np.random.default_rng(0).integers(0, 6, 2 * h.n)


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_passes_in_any_order_make_the_same_film(sampler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one pass; in passes that are broken off; and lanes in steps and in another order. Bit for bit."""
    made = prepare(with_settings(replace(EDGES, film=SMALL), sampler=sampler))
    whole = DualBuffer(made)
    targets = some_counts(whole)
    assert whole.extend(targets) and np.array_equal(whole.counts, targets)
    broken, stepped = DualBuffer(made), DualBuffer(made)
    step = one_pass(monkeypatch, 700)
    passes = 0
    while not step(broken, targets):
        passes += 1
        # Lanes are done or not begun.
        assert np.isin(broken.counts, np.unique(targets)).sum() + (broken.counts == 0).sum() == 2 * whole.n
    assert passes > 10
    rng = np.random.default_rng(1)
    while (stepped.counts < targets).any():
        stepped.extend(np.minimum(targets, stepped.counts + rng.integers(0, 9, 2 * whole.n)))
    for other in (broken, stepped):
        assert np.array_equal(other.counts, targets)
        for part, own in zip(whole.film.moments.arrays, other.film.moments.arrays):
            assert np.array_equal(np.array(part), np.array(own))


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_lanes_have_the_samples_of_the_uniform_renderer(sampler: str) -> None:
    """Each half those of its own seed, the first so many of each lane: bit for bit."""
    made = prepare(with_settings(replace(EDGES, film=SMALL), sampler=sampler, seed=77))
    h = DualBuffer(made)
    targets = some_counts(h)
    h.extend(targets)
    means, squares = np.array(h.film.mean), np.array(h.film.squares)
    for half in (0, 1):
        for count in np.unique(targets):
            film = exposed_once(seeded(made, dual_buffer.half_seed(77, half)), empty_film(made), int(count))
            here = half * h.n + np.flatnonzero(targets[half * h.n :][: h.n] == count)
            for own, uniform in ((means, film.mean), (squares, film.squares)):
                assert np.array_equal(own[:, here], np.array(uniform)[:, here - half * h.n])


def samplers_compiled(work: Callable[[], object]) -> list[int]:
    """The operations of the kernels that take samples and are compiled, or read from the disk, for a piece of work; the
    small ones that merge and read films have fewer."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        work()
        kernels = dr.kernel_history([dr.KernelType.JIT])
    made = [k["operation_count"] for k in kernels if not k["cache_hit"] or k["cache_disk"]]
    return [n for n in made if n > SMALL_KERNEL]


def test_no_count_seed_or_subset_compiles() -> None:
    made = prepare(replace(EDGES, film=SMALL))
    DualBuffer(made).compile()
    DualBuffer(made).extend(np.full(2 * len(made.order), 2))

    def others() -> None:
        for seed in (3, 2**31 - 1):
            h = DualBuffer(seeded(made, seed))
            rng = np.random.default_rng(seed)
            for share in (1.0, 0.5, 0.02):
                h.extend(h.counts + rng.integers(1, 40, 2 * h.n) * (rng.random(2 * h.n) < share))

    assert compiled(others) == 0


def test_a_lane_alone_compiles_nothing() -> None:
    """Dr.Jit makes another kernel for arrays of one entry; a pass may have one lane left."""
    made = prepare(replace(EDGES, film=SMALL, objects=EDGES.objects | {"more": Sphere(radius=0.1)}))
    h = DualBuffer(made)
    h.compile()
    h.extend(np.full(2 * h.n, 2))
    assert samplers_compiled(lambda: h.extend(np.where(np.arange(2 * h.n) == 5, 16, 2))) == []


def test_the_kernel_that_is_made_first_is_that_of_passes() -> None:
    """After it, seconds tell how long samples take, and nothing else."""
    more = {"more": Sphere(radius=0.1), "yet more": Rectangle()}
    h = DualBuffer(prepare(replace(EDGES, film=SMALL, objects=EDGES.objects | more)))
    assert len(samplers_compiled(h.compile)) >= 1
    assert samplers_compiled(lambda: h.extend(np.full(2 * h.n, 2))) == []
    assert samplers_compiled(lambda: h.extend(some_counts(h) + 2)) == []


def test_what_depth_leaves_out_compiles_nothing() -> None:
    """Nor does the number of pixels, or a depth."""
    for size in ((31, 21), (23, 17)):
        h = DualBuffer(prepare(with_settings(hall(3, *size), sampler="sobol")))
        h.compile()
        h.extend(np.full(2 * h.n, 2))
        assert samplers_compiled(lambda h=h: depth_biases(h, (3, 7, 9), 20)) == []


def test_a_second_picture_compiles_nothing() -> None:
    render_adaptively(EDGES, error=0.03)
    assert compiled(lambda: render_adaptively(EDGES, error=0.03)) == 0
    assert compiled(lambda: render_adaptively(EDGES, error=0.01, seed=5)) == 0


# No bias


@dataclass(frozen=True)
class Bias:
    """How far means of pictures are from the truth: the sum over pixels of squares in standard errors, what is expected
    of it, and its standard deviation."""

    found: float
    expected: float
    deviation: float

    @staticmethod
    def of(pictures: list[np.ndarray], true: np.ndarray, off: np.ndarray) -> "Bias":
        """Of luminances, by their own spread, which is known from n - 1 others: Student's t, whose square has the mean
        v / (v - 2). true, off: the truth, and the variance that it has. Shapes: (N)."""
        v = len(pictures) - 1
        variance = np.var(pictures, axis=0, ddof=1) / len(pictures) + off
        # Where nothing varies, samples are all alike.
        noisy = variance > 1e-14
        error = np.mean(pictures, axis=0) - true
        assert np.abs(error[~noisy]).max(initial=0) <= 1e-5
        k = int(noisy.sum())
        single = 2 * v**2 * (v - 1) / ((v - 2) ** 2 * (v - 4))
        return Bias(float((error[noisy] ** 2 / variance[noisy]).sum()), k * v / (v - 2), sqrt(k * single))

    def seen(self) -> bool:
        """Whether it is no chance. Pixels that are hit rarely are lopsided, so that the sum spreads more than that of
        normal numbers: 6 deviations."""
        return self.found > self.expected + 6 * self.deviation


def luminance(h: DualBuffer) -> np.ndarray:
    return LUMINANCE @ np.mean(h.means(), axis=0)


def naive(made: Prepared, tolerance: float) -> DualBuffer:
    """A picture by the rule that must not be: each pixel has its samples doubled until its own halves agree."""
    h = DualBuffer(made)
    busy = np.ones(h.n, bool)
    for count in (4, 8, 16, 32, 64):
        h.extend(np.where(np.tile(busy, 2), count, h.counts))
        a, b = h.means()
        busy &= np.abs(a - b).max(0) > tolerance
    return h


@pytest.mark.slow
def test_no_pixel_has_a_bias() -> None:
    """The mean of many pictures whose pixels have from 4 to 64 samples in a half is the converged one; by a rule that
    lets each pixel stop when its own samples agree it is not, and fewer pictures show that."""
    scene = replace(EDGES, film=SMALL)
    made = prepare(scene)
    uniform = [
        render(scene, spp=8192, seed=10**6 + i, layers=("RGB",), progress=False)["RGB"] @ LUMINANCE for i in range(6)
    ]
    true = np.mean(uniform, axis=0).ravel()[made.order]
    off = (np.var(uniform, axis=0, ddof=1) / len(uniform)).ravel()[made.order]
    found = [pursuit(seeded(made, 1 + i), error=0.02).evidence.buffer for i in range(300)]
    counts = np.array([h.counts for h in found])
    assert counts.min() <= 4 and counts.max() >= 32 and len(np.unique(counts[0])) >= 3
    assert not Bias.of([luminance(h) for h in found], true, off).seen()
    wrong = [luminance(naive(seeded(made, 1 + i), 0.05)) for i in range(100)]
    assert Bias.of(wrong, true, off).seen()


# The goal is met


@pytest.mark.parametrize("error", [0.1, 0.03, 0.01, 0.003])
def test_an_error_is_met(error: float) -> None:
    """Of the interval, its upper end; and near enough that the samples are not wasted: not by far below. The layers
    tell the same as the metadata."""
    image = render_adaptively(EDGES, error=error)
    facts, samples = image.metadata, image["samples"]
    assert 0 <= facts["error_low"] <= facts["error"] <= facts["error_high"] <= error == facts["error_asked"]
    assert facts["error_high"] >= error / 3
    assert samples.dtype == np.uint32 and samples.shape == (30, 40)
    assert facts["spp"] == pytest.approx(samples.mean(), abs=0.005)
    assert (facts["spp_least"], facts["spp_most"]) == (samples.min(), samples.max())
    assert facts["sampler"] == "sobol" and facts["depth_error"] == 0 and facts["interrupted"] == 0
    assert "time_asked" not in facts and facts["forecast_spp"] > 0 <= facts["forecast_seconds"]
    # Where a pixel and its neighbours vary, both layers say so; more samples go where there is more noise.
    assert (image["error"][(image["error"] > 0) | (image["variance"] > 1e-6)] > 0).mean() > 0.9
    assert np.isfinite(image["error"]).all() and (image["error"] >= 0).all()
    mean = np.sqrt(np.square(image["error"]).mean()) / (image["RGB"] @ LUMINANCE).mean()
    # Means over 3 x 3 pixels weigh borders a little differently.
    assert mean == pytest.approx(facts["error"], rel=0.3)


def test_more_samples_go_where_there_is_more_noise() -> None:
    image = render_adaptively(EDGES, error=0.003)
    noisy = image["variance"].sum(-1) > np.quantile(image["variance"].sum(-1), 0.9)
    assert image["samples"][noisy].mean() > 3 * image["samples"][~noisy].mean()


def test_the_error_is_true() -> None:
    """Against a converged picture: within the interval, made as wide as a chance of 1e-6 is."""
    true = render(EDGES, spp=16384, seed=99, layers=("RGB",), progress=False)["RGB"].astype(float)
    for error, seed in [(0.1, 0), (0.03, 1), (0.01, 2)]:
        image = render_adaptively(EDGES, error=error, seed=seed)
        facts = image.metadata
        off = np.sqrt(np.square(image["RGB"] - true).mean()) / (true @ LUMINANCE).mean()
        square, high = facts["error"] ** 2, facts["error_high"] ** 2
        assert abs(off**2 - square) <= BOTH_SIDES / QUANTILE * (high - square)


def test_a_file_keeps_error_samples_and_facts(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    image = render(EDGES, error=0.02, progress=False)
    image.write(path)
    back = Image.read(path)
    for name in ("error", "samples", "variance"):
        assert back[name].dtype == image[name].dtype
        assert np.array_equal(back[name], image[name])
    for name in ("error_asked", "spp", "spp_least", "forecast_error", "depth_error"):
        assert back.metadata[name] == pytest.approx(image.metadata[name], rel=1e-6), name
    assert back.metadata["sampler"] == "sobol"


@pytest.mark.parametrize(("kind", "gamma", "exposure"), [("exr", "srgb", 0), ("png", "srgb", 0), ("png", 2.2, -1)])
@pytest.mark.slow
def test_a_file_adds_its_rounding_to_the_error(tmp_path: Path, kind: str, gamma: Any, exposure: float) -> None:
    """Of a picture that was made for no file; once, and with a warning where it is more than was asked for."""
    path = tmp_path / f"a.{kind}"
    image = render(EDGES, error=0.0004, progress=False)
    facts, rgb = image.metadata, image["RGB"].astype(float)
    assert facts["file_error"] == 0 and facts["error_high"] <= 0.0004
    with pytest.warns(GoalWarning, match="alone is off by"):
        image.write(path, gamma=gamma, exposure=exposure)
    if kind == "exr":
        back = Image.read(path)
        told, off = back.metadata, back["RGB"].astype(float) - rgb
        back.write(tmp_path / "b.exr")
        assert Image.read(tmp_path / "b.exr").metadata["error"] == told["error"]
    else:
        with Pillow.open(path) as found:
            told = {k.removeprefix("visray/"): float(v) for k, v in found.text.items() if "error" in k}
            shown = np.asarray(found) / 255
        off = (linear(shown, gamma) - np.clip(rgb * 2.0**exposure, 0, 1)) / 2.0**exposure
    rounded_off = sqrt(np.square(off).mean()) / (rgb @ LUMINANCE).mean()
    assert told["file_error"] == pytest.approx(rounded_off, rel=1e-5) and rounded_off > 1e-4
    for end in ("error", "error_low", "error_high"):
        assert told[end] == pytest.approx(np.hypot(facts[end], rounded_off), rel=1e-5)


def test_samplers_are_kept_but_for_strata() -> None:
    """Strata need the number of samples beforehand."""
    for asked, used in [("independent", "independent"), ("sobol", "sobol"), ("stratified", "sobol")]:
        image = render_adaptively(with_settings(EDGES, sampler=asked), error=0.05)
        assert image.metadata["sampler"] == used and image.metadata["error_high"] <= 0.05


def test_coverage_of_a_transparent_film() -> None:
    """A white ball that shines by itself before nothing: each channel is the coverage."""
    scene = Scene(
        film=Film(width=40, height=30, transparent=True),
        camera=Camera(origin=(0, 0, 6), target=(0, 0, 0), fov=40.0),
        ambient=(1.0, 1.0, 1.0),
        materials={"white": Material(ka=(1.0, 1.0, 1.0), kd=(0.0, 0.0, 0.0))},
        objects={"ball": Sphere(material="white")},
        lights={},
    )
    image = render_adaptively(scene, error=0.01)
    assert 0 < image["A"].mean() < 1 and image["A"].min() == 0 and image["A"].max() == 1
    assert ((image["A"] > 0) & (image["A"] < 1)).any()
    np.testing.assert_allclose(image["RGB"], np.repeat(image["A"][..., None], 3, 2), rtol=0, atol=1e-6)
    # All is true: the share of the film that the ball covers.
    sine = 1 / 6
    radius = sine / sqrt(1 - sine**2) / np.tan(np.radians(20)) * 15
    assert image["A"].sum() == pytest.approx(np.pi * radius**2, rel=5 * 0.01)


def test_without_noise_the_pilot_is_all(machine: Machine) -> None:
    image = render_adaptively(FLAT, error=0.01)
    facts = image.metadata
    # What no sample has met may be there all the same, but not in more than 3 of all of them.
    assert facts["error"] == facts["error_low"] == 0 and facts["error_high"] == pytest.approx((3 / 1200) ** 0.5 / 8)
    assert facts["spp_most"] <= 2 * adaptive.SHORTEST_PILOT and not image["error"].any()
    assert np.array_equal(np.unique(image["RGB"].reshape(-1, 3), axis=0), np.float32([[0.1, 0.7, 1 / 3]]))
    # Nor does a time go on for nothing.
    begun = machine.now
    assert (
        render_adaptively(FLAT, time=60).metadata["spp_most"] <= 2 * adaptive.LONGEST_PILOT and machine.now - begun < 1
    )


@pytest.mark.parametrize("light", [1.0, 1e-9, 1e-15, 1e-30])
def test_what_no_sample_has_met_is_looked_for(light: float) -> None:
    """Without noise, and in the dark: the error that is asked for is reached by more samples, not missed."""
    assert render_adaptively(FLAT, error=0.001).metadata["error_high"] <= 0.001
    panel = replace(EDGES.lights["panel"], intensity=light)
    dark = replace(EDGES, background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0), lights={"panel": panel}, film=SMALL)
    facts = render_adaptively(dark, error=0.05).metadata
    assert facts["error_high"] <= 0.05
    # Squares of 1e-30 are none in single precision: there all pixels are alike.
    assert facts["spp_most"] > facts["spp_least"] or light < 1e-15


def test_small_things_alone_are_found() -> None:
    """Balls far smaller than a pixel before an even background: around such a pixel nothing varies, and yet its samples
    grow with those of the picture, which is as good as it says."""
    rng = np.random.default_rng(3)
    balls = {
        f"star{i}": Sphere(center=(float(x), float(y), 0.0), radius=0.02, material="light")
        for i, (x, y) in enumerate(rng.uniform(-3, 3, (12, 2)))
    }
    white = {"light": Material(ka=(1.0, 1.0, 1.0), kd=(0.0, 0.0, 0.0))}
    camera = Camera(origin=(0.0, 0.0, 9.0), fov=40.0)
    scene = Scene(
        film=Film(width=48, height=48),
        camera=camera,
        materials=white,
        objects=balls,
        background=(0.01, 0.01, 0.01),
        lights={},
    )
    image = render_adaptively(scene, error=0.05)
    facts, true = image.metadata, render(scene, spp=2**14, layers=("RGB",), seed=9, progress=False)["RGB"]
    off = sqrt(np.square(image["RGB"] - true).mean()) / (true @ LUMINANCE).mean()
    assert facts["error_high"] <= 0.05 and off <= 0.05
    assert facts["spp_least"] >= facts["spp"] / 8


@pytest.mark.slow
def test_the_error_is_within_its_interval_and_as_asked() -> None:
    """Over 60 pictures of other samples: with 95 % each, fewer than 48 within has a chance of 1e-6."""
    scene = replace(EDGES, film=Film(width=32, height=24))
    true = render(scene, spp=2**14, layers=("RGB",), seed=10**6, progress=False)["RGB"]
    luminance, inside, met = (true @ LUMINANCE).mean(), 0, 0
    for i in range(60):
        image = render_adaptively(with_settings(scene, seed=i), error=0.02)
        off = sqrt(np.square(image["RGB"] - true).mean()) / luminance
        inside += image.metadata["error_low"] <= off <= image.metadata["error_high"]
        met += off <= 0.02
    assert inside >= 48 and met >= 48


def test_a_black_picture_ends() -> None:
    """And says that nothing is known: there may be light that no sample met."""
    with pytest.warns(GoalWarning, match="no sample met any light"):
        facts = render_adaptively(replace(FLAT, background=(0.0, 0.0, 0.0)), error=0.01).metadata
    assert facts["error"] == 0 and facts["error_high"] == 1 and facts["spp"] == 2 * adaptive.LONGEST_PILOT


def test_any_error_can_be_asked_for() -> None:
    assert render_adaptively(EDGES, error=1e300).metadata["spp_most"] <= 2 * adaptive.SHORTEST_PILOT


@pytest.mark.parametrize("spread", [0, 0.3, 0.6], ids=lambda x: f"spread {x}")
@pytest.mark.parametrize("seconds", [0.05, 0.3, 1.5, 6])
@pytest.mark.slow
def test_a_time_ends_with_a_whole_picture(monkeypatch: pytest.MonkeyPatch, seconds: float, spread: float) -> None:
    """Also where passes take times as much as those before, up to several: two of them in a thousand are 6.4 times as
    slow as they should be, if they spread by 0.6."""
    rng = np.random.default_rng(7)
    machine = Machine(monkeypatch, slow=lambda: float(rng.lognormal(0, spread)))
    begun = machine.now
    image = render_adaptively(EDGES, time=seconds)
    took, facts = machine.now - begun, image.metadata
    assert image["samples"].min() >= 2 and facts["time_asked"] == seconds and "error_asked" not in facts
    assert 0 < facts["error"] < 1 and np.isfinite(image["RGB"]).all()
    # Of too little time for another pass nothing is made.
    assert seconds - 3 * 0.01 - 0.05 * seconds < took < 1.1 * seconds
    assert facts["forecast_seconds"] == pytest.approx(took, rel=0.3, abs=0.05)


@pytest.mark.slow
def test_a_time_too_short_for_the_first_samples_gives_the_fewest(monkeypatch: pytest.MonkeyPatch) -> None:
    """And says so as soon as that is known, not when all pixels have their first samples."""
    machine, warned = Machine(monkeypatch, rate=2e-4), []
    monkeypatch.setattr(lane_buffer, "first_pass_samples", lambda made: 2**14)
    monkeypatch.setattr(adaptive.warnings, "warn", lambda text, *_, **__: warned.append((text, machine.now - begun)))
    begun, scene = machine.now, replace(EDGES, film=Film(width=400, height=300))
    image = render_adaptively(scene, time=20)
    ((text, moment),) = warned
    assert text.startswith("time = 20: two samples of each pixel alone take about") and moment < 10
    assert np.unique(image["samples"]).tolist() == [2] and machine.now - begun > 20
    assert image.metadata["time_missed"] in text and image.metadata["forecast_seconds"] > 20


@pytest.mark.parametrize(("rate", "kept"), [(1e-6, True), (2e-4, False)])
def test_ctrl_c_waits_for_first_samples_that_are_soon_there(
    monkeypatch: pytest.MonkeyPatch, rate: float, kept: bool
) -> None:
    Machine(monkeypatch, rate=rate)
    monkeypatch.setattr(lane_buffer, "first_pass_samples", lambda made: 2**12)
    made = prepare(replace(EDGES, film=Film(width=200, height=150)))
    if kept:
        assert set(pursuit(made, error=0.01, interrupts=Asked(0)).evidence.buffer.counts) == {adaptive.SHORTEST_PILOT}
    else:
        with pytest.raises(KeyboardInterrupt):
            pursuit(made, error=0.01, interrupts=Asked(0))


def test_first_passes_of_dear_samples_are_short() -> None:
    made = prepare(with_settings(EDGES, scatter=Scatter(rays=512)))
    assert 0 < first_pass_samples(made) <= 2**15 and first_pass_samples(prepare(EDGES)) > 2**20


def test_a_forecast_of_a_time_without_noise_is_what_the_pilot_has(machine: Machine) -> None:
    facts = render_adaptively(FLAT, time=30).metadata
    assert facts["forecast_spp"] == facts["spp"] and facts["forecast_seconds"] < 1


def test_noisy_pixels_get_half_of_all_samples() -> None:
    rng = np.random.default_rng(4)
    found = Allocation.of(np.exp(rng.normal(0, 2, 10_000)), np.ones(10_000, int))
    weights, noisy = 2.0 ** (found.steps / STEPS), found.noisy()
    assert weights[noisy].min() > weights[~noisy].max()
    assert weights[noisy].sum() == pytest.approx(weights.sum() / 2, rel=0.1)
    assert Allocation.of(np.ones(9), np.ones(9, int)).noisy().all()


def test_each_seed_has_samples_of_its_own() -> None:
    seeds = [0, 1, 2, 3, 2**31, 2**31 + 1, 2**32 - 1]
    found = {dual_buffer.half_seed(seed, half) for seed in seeds for half in (0, 1)}
    assert len(found) == 2 * len(seeds) and not found & set(seeds)
    one, other = (render_adaptively(with_settings(EDGES, seed=seed), error=0.1)["RGB"] for seed in (0, 2**31))
    assert (one != other).any()


def test_of_error_and_time_what_comes_first(machine: Machine) -> None:
    begun = machine.now
    loose = render_adaptively(EDGES, error=0.1, time=60).metadata
    assert loose["error_high"] <= 0.1 and loose["spp"] < 100 and machine.now - begun < 1
    begun = machine.now
    hurried = render_adaptively(EDGES, error=1e-5, time=1.0).metadata
    assert hurried["error_high"] > 1e-5 and hurried["spp"] >= 1000 and 0.9 < machine.now - begun < 1.1
    # The forecast is of what can be had: of the time, not of the error.
    assert hurried["forecast_spp"] == pytest.approx(hurried["spp"], rel=0.5) and hurried["forecast_error"] > 1e-4


@dataclass
class Asked:
    """Interrupts that end after so many questions."""

    questions: int

    @property
    def requested(self) -> bool:
        self.questions -= 1
        return self.questions < 0


@pytest.mark.parametrize("questions", [0, 1, 2, 3, 5])
def test_interrupted_a_picture_is_kept(questions: int) -> None:
    """At any pass: with at least one sample of each lane, and with the error that it has."""
    made = prepare(EDGES)
    found = pursuit(made, error=2e-4, interrupts=Asked(questions))
    h = found.evidence.buffer
    assert h.counts.min() >= 1 and h.counts.max() <= 2**LARGEST_LEVEL
    layers = h.layers(("RGB", "error"))
    assert np.isfinite(layers["RGB"]).all() and np.isfinite(layers["error"]).all()
    assert found.evidence.estimate == h.estimate() and found.evidence.estimate.error > 2e-4


def test_an_interrupted_render_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C in the first pass: that one is finished, and no other begun."""
    whole, passes = DualBuffer.run_pass, []

    def interrupted(h: DualBuffer, *more: Any) -> None:
        whole(h, *more)
        passes.append(more)
        if len(passes) == 1:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(DualBuffer, "run_pass", interrupted)
    image = render_adaptively(EDGES, error=0.002)
    assert image.metadata["interrupted"] == 1 and image.metadata["error"] > 0.002
    assert 2 <= image.metadata["spp_least"] == image.metadata["spp_most"] <= 2 * adaptive.SHORTEST_PILOT


# What is refused


NO_NUMBERS = [0, 0.0, -1, -1e-3, float("nan"), float("inf"), True, False, "0.01", [0.01], (), 1j]


@pytest.mark.parametrize("name", ["error", "time"])
@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
def test_what_is_no_number_above_0_is_refused(name: str, value: Any) -> None:
    with pytest.raises(UserError, match=rf"^{name} = .*must be a finite number above 0"):
        render_adaptively(EDGES, **{name: value})


@pytest.mark.parametrize("goal", [{"error": 0.1}, {"time": 1.0}, {"error": 0.1, "time": 1.0}])
def test_samples_go_with_no_goal(goal: dict) -> None:
    with pytest.raises(UserError, match=r"^spp = 4: goes with neither error nor time"):
        render_adaptively(EDGES, spp=4, **goal)


@pytest.mark.parametrize("seconds", [1e-6, 0.01])
def test_too_little_time_gives_the_best_that_can_be_had(seconds: float) -> None:
    """Two samples of each pixel, with an error that holds the truth."""
    with pytest.warns(GoalWarning, match=f"^time = {seconds:g}: loading, compiling and writing alone .*2 per pixel"):
        image = render_adaptively(EDGES, time=seconds, begun=clock.now() - seconds)
    facts, true = image.metadata, render(EDGES, spp=4096, seed=99, layers=("RGB",), progress=False)["RGB"]
    off = sqrt(np.square(image["RGB"] - true).mean()) / (true @ LUMINANCE).mean()
    assert np.unique(image["samples"]).tolist() == [2] and facts["error_low"] <= off <= facts["error_high"]
    assert facts["time_missed"].startswith("loading, compiling") and facts["time_asked"] == seconds


def test_two_threads_make_the_pictures_of_one() -> None:
    """To an error, bit for bit; in a time, both are made."""
    scene = replace(EDGES, film=SMALL)
    alone = [render_adaptively(scene, error=0.02, seed=seed)["RGB"] for seed in (0, 1)]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda seed: render_adaptively(scene, error=0.02, seed=seed)["RGB"], (0, 1)))
        timed = list(pool.map(lambda seed: render_adaptively(scene, time=0.5, seed=seed).metadata, (0, 1, 2, 3)))
    assert all(np.array_equal(x, y) for x, y in zip(alone, together))
    assert all(facts["error"] > 0 for facts in timed)


@pytest.mark.parametrize("seconds", [0, -1, inf, nan, "1"])
def test_times_that_are_none_are_refused(seconds: Any) -> None:
    with pytest.raises(UserError, match=r"^time = .*: must be a finite number above 0, such as 10$"):
        render_adaptively(EDGES, time=seconds)


@pytest.mark.parametrize(
    ("precision", "right"), [("single", "ask for a larger error, or use double"), ("double", "ask for a larger error")]
)
def test_errors_below_rounding_are_refused(precision: str, right: str) -> None:
    error = rounded(ROUNDINGS, precision) / 2
    with pytest.raises(UserError, match=rf"^error = .*{precision} precision is off by .*; {right}"):
        render_adaptively(with_settings(EDGES, precision=precision), error=error)


# Depth


def hall(depth: int, width: int = 48, height: int = 32) -> Scene:
    """Two mirrors that face each other."""
    scene = with_settings(load(SCENES / "mirror-hall.json"), depth=depth)
    return replace(scene, film=Film(width=width, height=height))


def test_a_depth_that_leaves_out_too_much_is_refused_with_one_that_does() -> None:
    with pytest.raises(
        UserError, match=r"^error = 0\.04: settings\.depth = 2 alone leaves out 0\.\d+ to 0\.\d+ "
    ) as refused:
        render_adaptively(hall(2), error=0.04)
    found = str(refused.value)
    assert "settings.depth = " in found.split(";")[1] and "would do" in found, found
    depth = int(found.split(";")[1].split(" = ")[1].split()[0])
    assert depth > 2
    facts = render_adaptively(hall(depth), error=0.04).metadata
    assert facts["error_high"] <= 0.04 and facts["depth_error"] < 0.02


def test_without_a_small_depth_that_is_known_to_do_the_one_that_counts_as_enough_is_named() -> None:
    with pytest.raises(UserError, match=r"settings.depth = 1 alone leaves out .*; settings.depth = 16 would do, or"):
        render_adaptively(hall(1), error=0.005)


def test_a_depth_that_leaves_little_room_for_noise_is_told_with_one_that_needs_fewer_samples() -> None:
    with pytest.warns(DepthWarning, match=r"settings.depth = 6: alone makes up to .* % of the error 5 %;") as told:
        facts = render_adaptively(hall(6), error=0.05).metadata
    assert 0.02 < facts["depth_error"] <= facts["error"] <= 0.05
    depth = int(str(told[0].message).split("; with ")[1].split()[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error", DepthWarning)
        deeper = render_adaptively(hall(depth), error=0.05).metadata
    assert deeper["spp"] < facts["spp"] and deeper["depth_error"] < 0.5 * facts["depth_error"]


@pytest.mark.slow
def test_what_depth_leaves_out_is_in_the_error(machine: Machine) -> None:
    """Too little to be refused, but seen: in the error and both its ends."""
    facts = render_adaptively(hall(6), error=0.2).metadata
    assert 0 < facts["depth_error"] <= facts["error"] <= facts["error_high"] <= 0.2
    assert 0 < facts["error_low"] <= facts["error"]
    # A time has no error that could be refused.
    facts = render_adaptively(hall(2), time=2).metadata
    assert facts["depth_error"] > 0.02 and facts["error_low"] > 0.02


@pytest.mark.slow
def test_what_is_left_out_is_the_difference_of_converged_pictures() -> None:
    """Of equal seeds, so that nearly all of their noise is the same; the interval is made as wide as 1e-6."""
    size = 192, 128
    made = prepare(with_settings(hall(2, *size), sampler="sobol"))
    h = DualBuffer(made)
    h.extend(np.full(2 * h.n, 16))
    depths, deep = (1, 2, 4), 16

    def converged(depth: int, seed: int) -> np.ndarray:
        return render(hall(depth, *size), spp=64, seed=seed, layers=("RGB",), progress=False)["RGB"].astype(float)

    pictures = {depth: [converged(depth, seed) for seed in (8, 9)] for depth in (*depths, deep)}
    for found in depth_biases(h, depths, deep):
        one, two = (last - here for last, here in zip(pictures[deep], pictures[found.depth]))
        # No bias, as the seeds differ; what is looked at there are all pixels, here a random part of them.
        true, off = (one * two).mean(), np.square(one - two).mean() / sqrt(one.size)
        slack = BOTH_SIDES / QUANTILE * (found.high - found.square) + BOTH_SIDES * off
        assert found.low < found.square < found.high
        assert abs(found.square - true) <= slack < true


@pytest.mark.slow
def test_what_few_pixels_leave_out_is_found(machine: Machine) -> None:
    """Two balls, in which a path goes on in a few pixels of the picture: what is left out there is in the error,
    whatever the seed."""
    mirror = {"mirror": Material(ka=(0.0,) * 3, kd=(0.0,) * 3, ks=(0.0,) * 3, kr=(1.0, 1.0, 1.0))}
    balls = {name: Sphere(center=(x, 0, 0), radius=0.1, material="mirror") for name, x in (("a", -0.11), ("b", 0.11))}
    scene = Scene(
        film=Film(width=200, height=160), camera=Camera(origin=(0, 0, 10), fov=40.0), materials=mirror, objects=balls,
        background=(0.5, 0.5, 0.5), settings=Settings(depth=1, sampler="sobol"), lights={},
    )  # fmt: skip
    deep, shallow = (
        render(with_settings(scene, depth=d), spp=1024, seed=77, layers=("RGB",), progress=False)["RGB"].astype(float)
        for d in (20, 1)
    )
    left = sqrt(np.square(deep - shallow).mean()) / (deep @ LUMINANCE).mean()
    assert 1e-3 < left < 1e-2 and ((deep != shallow).any(-1)).sum() < 100
    for seed in range(6):
        facts = render_adaptively(with_settings(scene, seed=seed), error=3 * left).metadata
        assert facts["depth_error"] == pytest.approx(left, rel=0.25) and facts["error_high"] > 0.8 * left
        with pytest.raises(UserError, match=r"settings\.depth = 1 alone leaves out"):
            render_adaptively(with_settings(scene, seed=seed), error=left / 2)


def test_without_mirrors_nothing_is_left_out() -> None:
    made = prepare(EDGES)
    h = DualBuffer(made)
    h.extend(np.full(2 * h.n, 2))
    assert [(t.square, t.low, t.high) for t in depth_biases(h, (0, 3), 8)] == [(0, 0, 0)] * 2
    assert render_adaptively(with_settings(EDGES, depth=0), error=0.05).metadata["depth_error"] == 0


# Rounding of files


def screen(light: float, gamma: Any) -> float:
    """The number from 0 to 1 that a screen is sent, by the definition."""
    if gamma != "srgb":
        return light ** (1 / gamma)
    return 12.92 * light if light <= 0.0031308 else 1.055 * light ** (1 / 2.4) - 0.055


def light_of(sent: float, gamma: Any) -> float:
    if gamma != "srgb":
        return sent**gamma
    return sent / 12.92 if sent <= 0.04045 else ((sent + 0.055) / 1.055) ** 2.4


@pytest.mark.parametrize("gamma", ["srgb", 2.2, 2, 1.0])
@pytest.mark.parametrize("exposure", [0.0, 1.5, -2.0])
def test_what_eight_bits_round_off(gamma: Any, exposure: float) -> None:
    """Number by number; light beyond what a screen shows is not the file's fault."""
    rgb = np.random.default_rng(0).lognormal(-1.5, 1.5, (6, 5, 3))
    rgb[0, 0] = 0, 1, 30
    total = 0.0
    for x in rgb.ravel().tolist():
        light = min(x * 2**exposure, 1)
        total += ((light_of(int(screen(light, gamma) * 255 + 0.5) / 255, gamma) - light) / 2**exposure) ** 2
    # The two sides of sRGB's curves do not quite meet.
    assert rounding(rgb, "a.PNG", gamma, exposure) == pytest.approx(sqrt(total / rgb.size), rel=1e-6)


def test_what_half_precision_rounds_off() -> None:
    """Normal halves are within 2^-11 of the number, and off by a third of that square on average, more or less."""
    rgb = np.random.default_rng(0).uniform(1, 2, (50, 60, 3))
    expected = 2.0**-10 / sqrt(12)
    assert rounding(rgb, "a.exr") == pytest.approx(expected, rel=0.05)
    assert rounding(rgb.astype(np.float16).astype(float), "a.exr") == 0
    assert rounding(rgb, "a.exr", "srgb", 3.0) == rounding(rgb, "a.exr")


def test_a_png_file_alone_is_refused_and_an_exr_beside_it_helps() -> None:
    with pytest.raises(UserError, match=r"^error = 0\.001: 8-bit output as PNG alone is off by 0\.\d+; write an"):
        render_adaptively(EDGES, error=0.001, files=Files(["x.png"]))
    assert render_adaptively(EDGES, error=0.004, files=Files(["x.png", "x.exr"])).metadata["error_high"] <= 0.004
    loose = render_adaptively(EDGES, error=0.05, files=Files(["x.png"])).metadata
    assert loose["error_high"] <= 0.05


def test_half_precision_is_refused() -> None:
    with pytest.raises(
        UserError,
        match=r"^error = 1e-05: half precision of EXR alone is off by .*; write float colours .*, or ask",
    ):
        render_adaptively(EDGES, error=1e-5, files=Files(["x.png", "x.exr"]))


def test_exposure_and_gamma_of_the_file_count() -> None:
    """Dark by eight stops, eight bits tell less: what full exposure would do is refused."""
    render_adaptively(EDGES, error=0.02, files=Files(["x.png"]))
    with pytest.raises(UserError, match="8-bit output as PNG alone is off"):
        render_adaptively(EDGES, error=0.02, files=Files(["x.png"], "srgb", -8.0))


def test_the_rounding_of_the_best_file_is_part_of_the_error(machine: Machine, tmp_path: Path) -> None:
    """A PNG file alone keeps to the error that is asked for, and says how much of it is its own."""
    true = render(EDGES, spp=16384, seed=99, layers=("RGB",), progress=False)["RGB"].astype(float)
    luminance = (true @ LUMINANCE).mean()
    paths = {kind: str(tmp_path / f"a.{kind}") for kind in ("png", "exr")}
    both, png, exr = (
        render(EDGES, error=0.006, files=Files(files), progress=False).metadata
        for files in (list(paths.values()), [paths["png"]], [paths["exr"]])
    )
    assert both["file_error"] == exr["file_error"] < 3e-4
    floor = rounding(true, paths["png"]) / luminance
    assert png["file_error"] == pytest.approx(floor, rel=0.05) and 0.002 < floor < 0.006
    assert png["error_high"] <= 0.006 and png["spp"] > exr["spp"]
    image = render(EDGES, error=0.006, files=Files([paths["png"]]), progress=False)
    image.write(paths["png"])
    shown = linear(np.asarray(Pillow.open(paths["png"]).convert("RGB")) / 255)
    off = sqrt(np.square(shown - true).mean()) / luminance
    noise = sqrt(np.square(image["RGB"] - true).mean()) / luminance
    assert noise < off <= 0.006 and image.metadata["error_low"] <= off


# The command line


def said(capsys: pytest.CaptureFixture, *tokens: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    code = main(list(tokens))
    return code, *capsys.readouterr()


@pytest.fixture
def scene_file(tmp_path: Path) -> str:
    from visray.scene.load import dump

    path = tmp_path / "edges.json"
    path.write_text(dump(EDGES))
    return str(path)


def test_a_command_to_an_error(scene_file: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    out = str(tmp_path / "a.exr")
    code, text, _ = said(capsys, "render", scene_file, "-o", out, "--error", "0.03", "--json")
    facts = json.loads(text)
    assert code == 0 and facts["error_high"] <= 0.03 == facts["error_asked"] and not facts["stopped"]
    assert facts["spp_least"] <= facts["spp"] <= facts["spp_most"] and facts["sampler"] == "sobol"
    assert Image.read(out)["samples"].sum() == pytest.approx(facts["spp"] * 1200, abs=6)
    code, text, err = said(capsys, "render", scene_file, "-o", out, "--error", "0.03")
    samples = f"{facts['spp']:.3g} samples per pixel ({facts['spp_least']} to {facts['spp_most']})"
    assert code == 0 and "pixels in " in text and text.endswith(f", {samples}\n")
    assert re.search(r", error \d[.\d]* % \([.\d]+ to [.\d]+ %", text), text
    assert "forecast: an error of " in err and " % with " in err


def test_a_command_in_a_time(scene_file: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The time counts from the start of the process, which is the tests' own here."""
    out = str(tmp_path / "a.exr")
    code, text, err = said(capsys, "render", scene_file, "-o", out, "--time", "1e-3")
    assert code == 0 and "note: time = 0.001: loading, compiling and writing alone take" in err and ", error " in text
    code, text, _ = said(capsys, "render", scene_file, "-o", out, "--time", "1e-3", "--json")
    facts = json.loads(text)
    assert code == 0 and facts["time_missed"].startswith("loading, compiling") and facts["seconds"] > 1e-3
    assert np.unique(Image.read(out)["samples"]).tolist() == [2]


@pytest.mark.parametrize(
    ("tokens", "why"),
    [
        (("--error", "0"), "error = '0': must be an error above 0"),
        (("--time", "-3"), "time = -3"),
        (("--error", "nan"), "error = 'nan': must be an error above 0"),
        (("--error", "0.1", "--spp", "4"), "goes with neither"),
        (("--error", "1e-4"), "8-bit output as PNG"),
    ],
)
def test_a_command_refuses(
    scene_file: str, tmp_path: Path, capsys: pytest.CaptureFixture, tokens: tuple[str, ...], why: str
) -> None:
    out = tmp_path / "a.png"
    code, _, err = said(capsys, "render", scene_file, "-o", str(out), *tokens, "--quiet")
    assert code != 0 and why in err and len(err.strip().splitlines()) == 1
    assert not out.exists()


# Twins that are never off


def test_facing_walls_that_reflect_nothing_leave_nothing_out() -> None:
    """A mirror before nothing: no reflection is followed by another, whatever the depth."""
    scene = Scene(
        film=SMALL,
        camera=Camera(origin=(0, 1, 4), target=(0, 1, 0), fov=40.0),
        materials={"mirror": Material(ka=(0.0, 0.0, 0.0), kd=(0.0, 0.0, 0.0), kr=(0.9, 0.9, 0.9))},
        lights={"key": PointLight(position=(0, 5, 5))},
        objects={"mirror": Rectangle(center=(0, 1, 0), width=(1, 0, 0), height=(0, 1, 0), material="mirror")},
        settings=Settings(depth=1),
    )
    assert render_adaptively(scene, error=0.05).metadata["depth_error"] == 0
