"""Dual buffer: two halves A and B of a picture with separate samples, and the error estimated from their difference.

The picture is (A + B) / 2. The two halves of a pixel are independent, as long as its number of samples does not depend
on their values (allocation.py). Then (A - B)^2 / 4 is an unbiased estimate of the pixel's variance, whatever the
sampler. It is a poor estimate for one pixel and a good one for the mean over all pixels.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import clock, integrator
from visray import film as films
from visray.film import Film
from visray.moments import Moments
from visray.output.curves import LUMINANCE
from visray.pass_timer import PassTimer
from visray.passes import first_pass_samples
from visray.sampling import SamplePlan
from visray.setup import Prepared

# Quantile of the normal distribution for an interval of 95 %.
QUANTILE = 1.959964
# Rule of three: an event that does not occur in n tries has a probability below UNSEEN / n, with 95 % confidence.
UNSEEN = 3.0
# Most samples of a lane in one pass. They run one after the other, and the time limit or Ctrl-C waits for them.
MOST_SAMPLES = 2**12


@dataclass(frozen=True)
class Estimate:
    """Estimated error of a picture.

    error: root mean square error over pixels and channels, in linear light, divided by the picture's mean luminance.
    low, high: interval that contains the true error with a probability of 95 %.
    square: mean square error, not divided by the luminance.
    luminance: mean luminance of the picture.
    factor: ratio of the mean square errors at `high` and at `error`, without `unseen`.
    unseen: mean square error at `high` of light that no sample may have met.
    """

    error: float
    low: float
    high: float
    square: float
    luminance: float
    factor: float
    unseen: float

    @staticmethod
    def of(a: np.ndarray, b: np.ndarray, samples: float = np.inf) -> "Estimate":
        """Estimate from the pixels of both halves. Shapes: (3, N).

        samples: samples of each pixel in both halves together; infinite: no light is unseen.
        """
        squares = np.square(a - b).mean(0) / 4
        sums = squares.sum(), np.square(squares).sum(), (LUMINANCE @ (a + b)).sum() / 2
        return Estimate.from_sums(squares.size, *map(float, sums), samples)

    @staticmethod
    def from_sums(n: int, squares: float, fourths: float, luminance: float, samples: float) -> "Estimate":
        """Estimate from sums over n pixels.

        squares, fourths: sums of x = (a - b)^2 / 4 and of x^2. luminance: sum of luminance.
        samples: smallest number of samples of a pixel, in both halves together.

        Let a and b be the errors of the two halves of a pixel. Its true square error is (a + b)^2 / 4 and the estimate
        is x = (a - b)^2 / 4. They differ by a b, whose mean square is at most twice that of x. Where few pixels have
        most of the error, the sum of x is uncertain, and so is the estimate of its spread: hence an interval by a
        factor, not by a difference.

        The upper end also contains `unseen`, the error by light that all samples may have missed. On average UNSEEN
        samples of the whole picture would meet such light; all miss it with a probability of 5 %. Each of them would
        change one pixel by luminance / samples, if the light is as bright as the picture. Where no sample has met any
        light, nothing is known of the error, and `high` is 1.
        """
        square, light = squares / n, luminance / n
        # Pixels that are not numbers give an estimate that is not a number, which the caller reports.
        with np.errstate(invalid="ignore"):
            # Equal pixels give about n degrees of freedom, since then n fourths / squares^2 is 3 or less.
            factor = ratio_quantile(max(2 * squares**2 / fourths - 1, 1.0)) if squares > 0 < fourths else 1.0
            unseen = UNSEEN * light**2 / (samples**2 * n)
            scale = 1 / light if light > 0 else 1.0
            error, low, high = (scale * np.sqrt([square, square / factor, square * factor + unseen])).tolist()
            high = 1.0 if light == 0 and samples < np.inf else high
            return Estimate(error, low, high, square, light, factor, unseen)


def ratio_quantile(d: float) -> float:
    """97.5 % quantile of the ratio of two independent mean squares of normal numbers with d degrees of freedom each.

    The density of the ratio's logarithm x is proportional to cosh(x / 2)^-d.

    Domain: d >= 1.
    Error: below 1e-4, relative to the quantile's logarithm (tests/test_adaptive.py).
    """
    # Wide enough for d = 1; the density is narrower for larger d.
    x = np.linspace(0, 60 / np.sqrt(d), 4001)
    density = np.exp(-d * (np.logaddexp(x / 2, -x / 2) - np.log(2)))
    cumulative = np.concatenate([[0], np.cumsum(density[1:] + density[:-1])])
    return float(np.exp(np.interp(0.95, cumulative / cumulative[-1], x)))


class DualBuffer:
    """Film of both halves. Lanes 0 to N - 1 are the pixels of half A, lanes N to 2 N - 1 those of half B.

    Its bits depend on the seed and on the number of samples of each lane, not on the passes that took them.
    Error: none (tests/test_same_bits.py).

    pace: measured duration of samples, to choose the size of passes.
    rates: for each lane, seconds per sample in its last pass; noisier lanes take longer. Shape: (2 N).
    """

    def __init__(self, prepared: Prepared):
        self.prepared, self.n = prepared, len(prepared.order)
        films.check_memory(prepared.scene.film.width, prepared.scene.film.height, 2)
        self.film = Film.empty(prepared.a, np.tile(prepared.order, 2))
        self.pace = PassTimer()
        self.rates = np.zeros(2 * self.n)

    @property
    def counts(self) -> np.ndarray:
        """Number of samples of each lane. Shape: (2 N)."""
        return self.film.counts

    def compile(self) -> None:
        """Compiles the kernel of a pass, by a few samples that are discarded."""
        lanes = np.arange(min(2 * self.n, 32))
        DualBuffer(self.prepared).run_pass(lanes, np.ones(2 * self.n, np.int64))

    def extend(self, targets: np.ndarray, seconds_left: Callable[[], float] = lambda: np.inf) -> bool:
        """Takes samples in passes until each lane has its target. Lanes that lack most samples come first.

        targets: number of samples of each lane. Shape: (2 N).
        seconds_left: called before each pass; the pass must not take longer.

        Returns whether all lanes have their target.
        """
        while (targets > self.counts).any():
            if not self._extend(np.minimum(targets, self.counts + MOST_SAMPLES), seconds_left):
                return False
        return True

    def _extend(self, targets: np.ndarray, seconds_left: Callable[[], float]) -> bool:
        """Does the same as `extend`, where no lane lacks more samples than fit into one pass."""
        lanes = np.flatnonzero(targets > self.counts)
        # Neighbours in this list run side by side in vector lanes, so they should lack equally many samples. Lanes that
        # do stay in the order of pixel tiles.
        lanes = lanes[np.argsort((self.counts - targets)[lanes], kind="stable")]
        while len(lanes):
            span, pace = self.pace.next_seconds(seconds_left()), self.pace
            if span <= 0:
                return False
            missing = (targets - self.counts)[lanes]
            if pace.sample_seconds is None:
                fit = np.searchsorted(np.cumsum(missing), first_pass_samples(self.prepared), "right")
            else:
                seconds = np.cumsum(missing * np.where(self.rates[lanes] > 0, self.rates[lanes], pace.sample_seconds))
                limits = (np.cumsum(missing), pace.next_samples()), (seconds, span)
                fit = min(np.searchsorted(sums, limit, "right") for sums, limit in limits)
            pass_lanes, lanes = np.split(lanes, [max(int(fit), 1)])
            self.run_pass(pass_lanes, targets)
        return True

    def run_pass(self, lanes: np.ndarray, targets: np.ndarray) -> None:
        """Takes samples of some lanes in one pass, until each has its target. Shapes: lanes any; targets (2 N)."""
        begun = clock.now()
        # A single lane would need a kernel of its own; it is written twice with the same value.
        lanes = np.repeat(lanes, 2) if len(lanes) == 1 else lanes
        counts, moments = self.counts.copy(), self.film.moments
        before, counts[lanes] = counts[lanes], targets[lanes]
        added = counts[lanes] - before
        old, new, index = self._sample(lanes, before, added)
        for film_part, old_part, new_part in zip(moments.arrays, old.arrays, new.arrays):
            if new_part is not old_part:
                dr.scatter(film_part, new_part, index)
        samples = int(added.sum())
        self.rates[lanes] = self.pace.evaluate(begun, samples, moments) / samples
        self.film = self.film.with_moments(moments, counts)

    def _sample(self, lanes: np.ndarray, first: np.ndarray, count: np.ndarray) -> tuple[Moments, Moments, Any]:
        """Moments of some lanes before and after `count` more samples, and the lanes as a Dr.Jit array.

        first: number of each lane's first new sample. Shapes: lanes, first, count alike.
        """
        prepared, a, n = self.prepared, self.prepared.a, self.n
        index = a.put(a.U, lanes.astype(np.uint32))
        in_b = index >= dr.opaque(a.U, n)
        pixel = dr.select(in_b, index - dr.opaque(a.U, n), index)
        seed_a, seed_b = (dr.opaque(a.U, half_seed(prepared.scene.settings.seed, half)) for half in (0, 1))
        seeds = dr.select(in_b, seed_b, seed_a)
        x, y = (dr.gather(a.U, v, pixel) for v in (prepared.x, prepared.y))
        plan = SamplePlan.per_lane(a, seeds, *(a.put(a.U, v.astype(np.uint32)) for v in (first, count)))
        old = Moments(*(dr.gather(type(part), part, index) for part in self.film.moments.arrays))
        return old, integrator.sample(prepared.kernel, plan, x, y, old), index

    def means(self) -> tuple[np.ndarray, np.ndarray]:
        """Pixels of half A and of half B. Shapes: (3, N)."""
        mean = np.array(self.film.mean)
        return mean[:, : self.n], mean[:, self.n :]

    def mean(self) -> np.ndarray:
        """Pixels of the picture. Shape: (3, N)."""
        return sum(self.means()) / 2

    def estimate(self) -> Estimate:
        """Estimated error of the picture: that of Estimate.of, with the sums computed by Dr.Jit."""
        a, lanes = self.prepared.a, dr.arange(self.prepared.a.U, self.n)
        left, right = (dr.gather(a.W, self.film.mean, lanes + dr.opaque(a.U, i * self.n)) for i in (0, 1))
        squares = dr.squared_norm(left - right) / 12
        light = dr.dot(a.W(*LUMINANCE.tolist()), left + right) / 2
        sums = dr.sum(squares), dr.sum(dr.square(squares)), dr.sum(light)
        dr.eval(sums)
        return Estimate.from_sums(self.n, *(float(x[0]) for x in sums), 2 * int(self.counts.min()))

    def layers(self, names: Collection[str]) -> dict[str, np.ndarray]:
        """Layers of the picture, in the order of lanes: RGB and samples, and those of A, variance and error that are
        in `names`. Shapes: (3, N) or (N).

        error: standard error of a pixel. It is averaged over 3 x 3 pixels, since one pixel alone estimates it badly.
        """
        counts, film = self.counts.reshape(2, -1), self.prepared.scene.film
        layers = {"RGB": self.mean(), "samples": counts.sum(0)}
        if "A" in names:
            coverage = np.array(self.film.coverage).reshape(2, -1) / counts
            layers["A"] = coverage.mean(0) if film.transparent else np.ones(self.n)
        if "variance" in names and counts.min() > 1:
            layers["variance"] = np.array(self.film.squares).reshape(3, 2, -1).sum(1) / (counts - 1).sum(0)
        if "error" in names:
            shape, order = (film.height, film.width), self.prepared.order
            a, b = self.means()
            picture = np.empty((3, self.n))
            picture[:, order] = np.square(a - b) / 4
            layers["error"] = np.sqrt(np.stack([smoothed(x.reshape(shape)).ravel()[order] for x in picture]))
        return layers

    def variances(self) -> np.ndarray:
        """Variance of each lane's samples, summed over channels. Shape: (2 N)."""
        return np.array(self.film.squares).sum(0) / np.maximum(self.counts - 1, 1)


def half_seed(seed: int, half: int) -> int:
    """Seed of half A (0) or B (1): another one for each seed, and far from the small numbers that scenes use."""
    return (seed * 0x9E3779B1 + half * 0x7FEB352D + 0x85EBCA6B) % 2**32


def smoothed(x: np.ndarray) -> np.ndarray:
    """Mean over the 3 x 3 pixels around each pixel; at edges, over those inside the picture. Shapes: (H, W)."""
    return window_sums(x, np.ones(3)) / window_sums(np.ones(x.shape), np.ones(3))


def window_sums(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted sum over a window around each pixel; pixels outside the picture count as 0.

    weights: along each side of the window; an odd number of them. Shapes: x (H, W).
    """
    reach = len(weights) // 2
    for axis in (0, 1):
        padding, n = [(reach, reach) if i == axis else (0, 0) for i in (0, 1)], x.shape[axis]
        padded = np.pad(x, padding)
        x = sum(w * padded[(slice(None),) * axis + (slice(i, i + n),)] for i, w in enumerate(weights))
    return x
