"""Dual buffer: two halves A and B of a picture with separate samples, and the error estimated from their difference.

The picture is (A + B) / 2. The values A and B of a pixel are independent, as long as the number of the pixel's samples
does not depend on the values of these samples (allocation.py). Then (A - B)^2 / 4 is an unbiased estimate of the
variance of (A + B) / 2, with any sampler. It is a poor estimate for one pixel, and a good one for the mean over all
pixels.

A lane is one entry of a Dr.Jit array: here one pixel in one half. N is the number of pixels.
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

# Quantile of the normal distribution: the interval from -QUANTILE to QUANTILE has a probability of 95 %.
QUANTILE = 1.959964
# Rule of three: if an event does not occur in n tries, its probability is below UNSEEN / n, with a confidence of 95 %.
UNSEEN = 3.0
# Largest number of samples of a lane in one pass. They run one after the other, and Ctrl-C waits for them.
MOST_SAMPLES = 2**12


@dataclass(frozen=True)
class Estimate:
    """Estimated error of a picture.

    error: root mean square error over pixels and channels, in linear light, divided by the picture's mean luminance.
    low, high: interval that contains the true error with a probability of 95 %.
    square: mean square error, not divided by the luminance.
    luminance: mean luminance of the picture.
    factor: upper bound of the true mean square error, without `unseen`, divided by `square`.
    unseen: mean square error by light that perhaps no sample has met; it is contained only in `high`.
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
        """Estimate from the colours of all pixels in both halves. Shapes: (3, N).

        samples: number of samples of each pixel, in both halves together. If infinite, no light is unseen.
        """
        squares = np.square(a - b).mean(0) / 4
        sums = squares.sum(), np.square(squares).sum(), (LUMINANCE @ (a + b)).sum() / 2
        return Estimate.from_sums(squares.size, *map(float, sums), samples)

    @staticmethod
    def from_sums(n: int, squares: float, fourths: float, luminance: float, samples: float) -> "Estimate":
        """Estimate from sums over n pixels.

        squares, fourths: sums of x and of x^2 over pixels (see below).
        luminance: sum of the luminance of the pixels.
        samples: smallest number of samples of a pixel, in both halves together.

        Let a and b be the errors of a pixel in the two halves. The true square error of the pixel is (a + b)^2 / 4. Its
        estimate is x = (a - b)^2 / 4, which needs only the difference of the two halves. The true square error and x
        differ by a b, and the mean square of a b is at most twice the mean square of x. If few pixels have most of the
        error, the sum of x is uncertain, and the estimate of its spread is uncertain too. So the ends of the interval
        are square / factor and square * factor, not square +- a difference.

        The upper end also contains `unseen`, the error by light that all samples may have missed. Two assumptions give
        its size. The light is so rare that, of all samples of the picture, only 3 (the constant UNSEEN) meet it on
        average; then the probability that all of them miss it is 5 %. And it is as bright as the picture is on average;
        then each sample that meets it changes one pixel by luminance / samples. If no sample has met any light, nothing
        is known about the error, and `high` is 1.
        """
        square, light = squares / n, luminance / n
        # If a pixel is not a number, the estimate is not a number either, and the caller reports it.
        with np.errstate(invalid="ignore"):
            # If all pixels have equal errors, there are about n degrees of freedom: n fourths / squares^2 is 3 or less.
            factor = ratio_quantile(max(2 * squares**2 / fourths - 1, 1.0)) if squares > 0 < fourths else 1.0
            unseen = UNSEEN * light**2 / (samples**2 * n)
            scale = 1 / light if light > 0 else 1.0
            error, low, high = (scale * np.sqrt([square, square / factor, square * factor + unseen])).tolist()
            high = 1.0 if light == 0 and samples < np.inf else high
            return Estimate(error, low, high, square, light, factor, unseen)


def ratio_quantile(d: float) -> float:
    """97.5 % quantile of the ratio of two independent mean squares, each of d normal random numbers.

    The density of x, the logarithm of the ratio, is proportional to cosh(x / 2)^-d.

    Domain: d >= 1.
    Error: the relative error of the logarithm of the quantile is below 1e-4 (tests/test_adaptive.py).
    """
    # The range is wide enough for d = 1. For larger d the density is narrower.
    x = np.linspace(0, 60 / np.sqrt(d), 4001)
    density = np.exp(-d * (np.logaddexp(x / 2, -x / 2) - np.log(2)))
    cumulative = np.concatenate([[0], np.cumsum(density[1:] + density[:-1])])
    return float(np.exp(np.interp(0.95, cumulative / cumulative[-1], x)))


class DualBuffer:
    """Film of both halves. Lanes 0 to N - 1 are the pixels in half A, lanes N to 2 N - 1 the pixels in half B.

    Its bits depend on the seed and on the number of samples of each lane. They do not depend on how the samples are
    divided into passes (tests/test_same_bits.py).

    prepared: the prepared scene.
    n: number of pixels, N.
    film: the samples of all lanes.
    pace: measured duration of samples, from which the size of a pass is chosen.
    rates: seconds per sample of each lane in its last pass. Noisy lanes take longer. Shape: (2 N).
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
        """Compiles the kernel of a pass: takes a few samples and discards them."""
        lanes = np.arange(min(2 * self.n, 32))
        DualBuffer(self.prepared).run_pass(lanes, np.ones(2 * self.n, np.int64))

    def extend(self, targets: np.ndarray, seconds_left: Callable[[], float] = lambda: np.inf) -> bool:
        """Takes samples in passes until each lane has the number of samples that `targets` says. Lanes that lack most
        samples come first. Returns whether all lanes have their targets.

        targets: number of samples of each lane. Shape: (2 N).
        seconds_left: function that is called before each pass, and returns how long this pass may take. If the time is
            too short for a pass, no more samples are taken.
        """
        while (targets > self.counts).any():
            if not self._extend(np.minimum(targets, self.counts + MOST_SAMPLES), seconds_left):
                return False
        return True

    def _extend(self, targets: np.ndarray, seconds_left: Callable[[], float]) -> bool:
        """Does the same as `extend`. Domain: no lane lacks more than MOST_SAMPLES samples."""
        lanes = np.flatnonzero(targets > self.counts)
        # Neighbours in this list run at the same time in one vector register, so they should lack the same number of
        # samples. Lanes that lack the same number stay in the order of pixel tiles.
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
        """Takes samples of some lanes in one pass, until each of these lanes has its target.

        lanes: numbers of the lanes. targets: number of samples of each lane.

        Shapes: lanes (n), with any n; targets (2 N).
        """
        begun = clock.now()
        # A single lane would need a kernel of its own, so it is computed twice. Both write the same value.
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
        """Moments of some lanes before and after more samples, and the lanes as a Dr.Jit array.

        lanes: numbers of the lanes.
        first: index of the first new sample of each of these lanes.
        count: number of new samples of each of these lanes.

        Shapes: the same for all three.
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
        """Mean colours of the pixels in half A and in half B. Shapes: (3, N) each."""
        mean = np.array(self.film.mean)
        return mean[:, : self.n], mean[:, self.n :]

    def mean(self) -> np.ndarray:
        """Colours of the pixels in the picture: the mean of both halves. Shape: (3, N)."""
        return sum(self.means()) / 2

    def estimate(self) -> Estimate:
        """Estimated error of the picture. It is the same as by Estimate.of, but Dr.Jit computes the sums."""
        a, lanes = self.prepared.a, dr.arange(self.prepared.a.U, self.n)
        left, right = (dr.gather(a.W, self.film.mean, lanes + dr.opaque(a.U, i * self.n)) for i in (0, 1))
        squares = dr.squared_norm(left - right) / 12
        light = dr.dot(a.W(*LUMINANCE.tolist()), left + right) / 2
        sums = dr.sum(squares), dr.sum(dr.square(squares)), dr.sum(light)
        dr.eval(sums)
        return Estimate.from_sums(self.n, *(float(x[0]) for x in sums), 2 * int(self.counts.min()))

    def layers(self, names: Collection[str]) -> dict[str, np.ndarray]:
        """Dict of layers of the picture by name, with pixels in the order of lanes. Shapes: (3, N) or (N) each.

        names: names of the layers that are wanted. RGB and samples are always present. A, variance and error are
            present only if they are wanted; variance needs at least two samples of each pixel in each half.

        The layer `error` is the standard error of a pixel. Its square is averaged over 3 x 3 pixels, because a single
        pixel gives a poor estimate.
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
    """Seed of the samples in one half. It differs between the halves and between seeds, and it is far from the small
    numbers that scenes use as seeds.

    seed: the scene's seed. half: 0 for A, 1 for B.
    """
    return (seed * 0x9E3779B1 + half * 0x7FEB352D + 0x85EBCA6B) % 2**32


def smoothed(x: np.ndarray) -> np.ndarray:
    """Mean over the 3 x 3 pixels around each pixel, at edges over those inside the picture. Shapes: (H, W)."""
    return window_sums(x, np.ones(3)) / window_sums(np.ones(x.shape), np.ones(3))


def window_sums(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted sum over a square window around each pixel. Pixels outside the picture count as 0.

    x: one number per pixel.
    weights: weights of the columns, and of the rows, of the window. The weight of a pixel is the product of both.

    Shapes: x (H, W); weights (n), with n odd; result (H, W).
    """
    reach = len(weights) // 2
    for axis in (0, 1):
        padding, n = [(reach, reach) if i == axis else (0, 0) for i in (0, 1)], x.shape[axis]
        padded = np.pad(x, padding)
        x = sum(w * padded[(slice(None),) * axis + (slice(i, i + n),)] for i, w in enumerate(weights))
    return x
