"""Two halves of a picture with samples of their own, any number of them in each pixel, and the error that they tell.

The picture is (A + B) / 2. A pixel's halves are independent, as long as what decides how many samples it has does not
know them (allocation.py). Then (A - B)^2 / 4 is an unbiased estimate of its variance, whatever the sampler; the mean
over all pixels is a good one.
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

# Of the normal distribution, for 95 %.
QUANTILE = 1.959964
# Nothing seen in n tries: the chance is less than so much over n, with 95 %.
UNSEEN = 3.0
# A pass takes no more samples of a lane than this: they run one after the other, and a time or Ctrl-C waits for them.
LONGEST = 2**12


@dataclass(frozen=True)
class Estimate:
    """The error of a picture: the root of the mean square over pixels and channels, in linear light, over the picture's
    mean luminance; low and high: with a chance of 95 % the true one lies between them. square: its absolute square;
    factor: by which that of high is larger, but for `unseen`, what may be there and no sample has met."""

    error: float
    low: float
    high: float
    square: float
    luminance: float
    factor: float
    unseen: float

    @staticmethod
    def of(a: np.ndarray, b: np.ndarray, samples: float = np.inf) -> "Estimate":
        """From the halves' pixels, of so many samples together if that is to count. Shapes: (3, N)."""
        squares = np.square(a - b).mean(0) / 4
        sums = squares.sum(), np.square(squares).sum(), (LUMINANCE @ (a + b)).sum() / 2
        return Estimate.told(squares.size, *map(float, sums), samples)

    @staticmethod
    def told(n: int, squares: float, fourths: float, luminance: float, samples: float) -> "Estimate":
        """From sums over n pixels: of x = (a - b)^2 / 4, of x^2, of luminance; and the least samples of a pixel.

        With a and b as they are off the truth, ((a + b)^2 - (a - b)^2) / 4 = a b is what the truth is above the other
        in a pixel, and its mean square is at most twice that of x. Where few pixels have most of the error, neither is
        known well, nor how well: so the interval is one of factors. High: also what is the mean of no pixel yet, as
        bright as the picture, that would have been missed by all samples with a chance of 5 %. Where no sample has met
        light nothing is known.
        """
        square, light = squares / n, luminance / n
        # Of pixels that are no numbers this is none either, and whoever asks sees that.
        with np.errstate(invalid="ignore"):
            # As many degrees of freedom as pixels, if they are alike: then fourths n / squares^2 is 3 or less.
            factor = ratio_of_squares(max(2 * squares**2 / fourths - 1, 1.0)) if squares > 0 < fourths else 1.0
            unseen = UNSEEN * light**2 / (samples**2 * n)
            scale = 1 / light if light > 0 else 1.0
            error, low, high = (scale * np.sqrt([square, square / factor, square * factor + unseen])).tolist()
            high = 1.0 if light == 0 and samples < np.inf else high
            return Estimate(error, low, high, square, light, factor, unseen)


def ratio_of_squares(d: float) -> float:
    """What the ratio of two independent mean squares of normal numbers, with d degrees of freedom each, exceeds with a
    chance of 2.5 %. Its logarithm is distributed as cosh(x / 2)^-d. Domain: d >= 1. Error: below 1e-4, relative to the
    logarithm (tests/test_adaptive.py)."""
    # Far enough out for d = 1; of more the curve is narrower.
    x = np.linspace(0, 60 / np.sqrt(d), 4001)
    chance = np.exp(-d * (np.logaddexp(x / 2, -x / 2) - np.log(2)))
    total = np.concatenate([[0], np.cumsum(chance[1:] + chance[:-1])])
    return float(np.exp(np.interp(0.95, total / total[-1], x)))


class DualBuffer:
    """Both halves: their film, the lanes of A before those of B. Its bits depend on the seed and on how many samples
    each lane has, not on the passes that took them (tests/test_same_bits.py)."""

    def __init__(self, prepared: Prepared):
        self.prepared, self.n = prepared, len(prepared.order)
        films.check_memory(prepared.scene.film.width, prepared.scene.film.height, 2)
        self.film = Film.empty(prepared.a, np.tile(prepared.order, 2))
        self.pace = PassTimer()
        # Of each lane, seconds of a sample in the last pass that it was in: where there is more noise they take longer.
        self.rates = np.zeros(2 * self.n)

    @property
    def counts(self) -> np.ndarray:
        """The samples of each lane. Shape: (2 N)."""
        return self.film.counts

    def compiled(self) -> None:
        """Makes the kernel of a pass, with a few samples that are thrown away."""
        few = np.arange(min(2 * self.n, 32))
        DualBuffer(self.prepared).take(few, np.ones(2 * self.n, np.int64))

    def extend(self, targets: np.ndarray, left: Callable[[], float] = lambda: np.inf) -> bool:
        """Brings the lanes to so many samples, in passes; those that get most come first. `left` is asked before each
        pass how many seconds there are for it. Returns whether all were done."""
        while (targets > self.counts).any():
            if not self._extend(np.minimum(targets, self.counts + LONGEST), left):
                return False
        return True

    def _extend(self, targets: np.ndarray, left: Callable[[], float]) -> bool:
        """As extend, each lane by no more than fits into a pass."""
        lanes = np.flatnonzero(targets > self.counts)
        # Neighbours in the list run side by side, so they should take as long; else in the order of tiles.
        lanes = lanes[np.argsort((self.counts - targets)[lanes], kind="stable")]
        while len(lanes):
            span, pace = self.pace.next_seconds(left()), self.pace
            if span <= 0:
                return False
            more = (targets - self.counts)[lanes]
            if pace.sample_seconds is None:
                fit = np.searchsorted(np.cumsum(more), first_pass_samples(self.prepared), "right")
            else:
                seconds = np.cumsum(more * np.where(self.rates[lanes] > 0, self.rates[lanes], pace.sample_seconds))
                fit = min(
                    np.searchsorted(x, most, "right")
                    for x, most in ((np.cumsum(more), pace.next_samples()), (seconds, span))
                )
            some, lanes = np.split(lanes, [max(int(fit), 1)])
            self.take(some, targets)
        return True

    def take(self, lanes: np.ndarray, targets: np.ndarray) -> None:
        """Brings some lanes to so many samples, in one pass."""
        begun = clock.now()
        # Of one lane the kernel would be another.
        lanes = np.repeat(lanes, 2) if len(lanes) == 1 else lanes
        counts, moments = self.counts.copy(), self.film.moments
        before, counts[lanes] = counts[lanes], targets[lanes]
        count = counts[lanes] - before
        old, new, at = self._sampled(lanes, before, count)
        for whole, was, part in zip(moments.arrays, old.arrays, new.arrays):
            if part is not was:
                dr.scatter(whole, part, at)
        samples = int(count.sum())
        self.rates[lanes] = self.pace.evaluate(begun, samples, moments) / samples
        self.film = self.film.with_moments(moments, counts)

    def _sampled(self, lanes: np.ndarray, first: np.ndarray, count: np.ndarray) -> tuple[Moments, Moments, Any]:
        """The moments of lanes before and after `count` samples from `first` on, and the lanes as opaque numbers."""
        prepared, a, n = self.prepared, self.prepared.a, self.n
        at = a.put(a.U, lanes.astype(np.uint32))
        second = at >= dr.opaque(a.U, n)
        pixel = dr.select(second, at - dr.opaque(a.U, n), at)
        one, other = (dr.opaque(a.U, seed_of(prepared.scene.settings.seed, half)) for half in (0, 1))
        seeds = dr.select(second, other, one)
        x, y = (dr.gather(a.U, v, pixel) for v in (prepared.x, prepared.y))
        plan = SamplePlan.per_lane(a, seeds, *(a.put(a.U, v.astype(np.uint32)) for v in (first, count)))
        old = Moments(*(dr.gather(type(x), x, at) for x in self.film.moments.arrays))
        return old, integrator.sample(prepared.kernel, plan, x, y, old), at

    def means(self) -> tuple[np.ndarray, np.ndarray]:
        """The halves' pixels. Shapes: (3, N)."""
        mean = np.array(self.film.mean)
        return mean[:, : self.n], mean[:, self.n :]

    def mean(self) -> np.ndarray:
        """The picture's pixels. Shape: (3, N)."""
        return sum(self.means()) / 2

    def estimate(self) -> Estimate:
        """The error of the picture. Source: as Estimate.of, but summed where the pixels are."""
        a, lanes = self.prepared.a, dr.arange(self.prepared.a.U, self.n)
        left, right = (dr.gather(a.W, self.film.mean, lanes + dr.opaque(a.U, i * self.n)) for i in (0, 1))
        squares = dr.squared_norm(left - right) / 12
        light = dr.dot(a.W(*LUMINANCE.tolist()), left + right) / 2
        sums = dr.sum(squares), dr.sum(dr.square(squares)), dr.sum(light)
        dr.eval(sums)
        return Estimate.told(self.n, *(float(x[0]) for x in sums), 2 * int(self.counts.min()))

    def layers(self, wanted: Collection[str]) -> dict[str, np.ndarray]:
        """Colour of pixels and, where they are wanted, coverage, the variance of samples, the standard error of pixels
        (from the halves' differences over 3 x 3 pixels: of one alone it is known badly), how many samples they have. In
        the order of lanes."""
        counts, film = self.counts.reshape(2, -1), self.prepared.scene.film
        found = {"RGB": self.mean(), "samples": counts.sum(0)}
        if "A" in wanted:
            coverage = np.array(self.film.coverage).reshape(2, -1) / counts
            found["A"] = coverage.mean(0) if film.transparent else np.ones(self.n)
        if "variance" in wanted and counts.min() > 1:
            found["variance"] = np.array(self.film.squares).reshape(3, 2, -1).sum(1) / (counts - 1).sum(0)
        if "error" in wanted:
            shape, order = (film.height, film.width), self.prepared.order
            a, b = self.means()
            picture = np.empty((3, self.n))
            picture[:, order] = np.square(a - b) / 4
            found["error"] = np.sqrt(np.stack([smoothed(x.reshape(shape)).ravel()[order] for x in picture]))
        return found

    def spreads(self) -> np.ndarray:
        """The variance of a lane's samples, summed over channels. Shapes: (2 N)."""
        return np.array(self.film.squares).sum(0) / np.maximum(self.counts - 1, 1)


def seed_of(seed: int, half: int) -> int:
    """The seed of a half: far from the small ones that pictures have, another one for each seed."""
    return (seed * 0x9E3779B1 + half * 0x7FEB352D + 0x85EBCA6B) % 2**32


def smoothed(x: np.ndarray) -> np.ndarray:
    """The means over the 3 x 3 pixels about each pixel, of those that there are. Shapes: (H, W)."""
    return windowed(x, np.ones(3)) / windowed(np.ones(x.shape), np.ones(3))


def windowed(x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """The sums over a window about each pixel, weighted by the kernel along each side, of what is in the picture.
    Shapes: x (H, W), kernel (odd)."""
    reach = len(kernel) // 2
    for axis in (0, 1):
        ways, n = [(reach, reach) if i == axis else (0, 0) for i in (0, 1)], x.shape[axis]
        padded = np.pad(x, ways)
        x = sum(k * padded[(slice(None),) * axis + (slice(i, i + n),)] for i, k in enumerate(kernel))
    return x
