"""Dual buffer: two halves A and B of a picture with separate samples, and the error estimated from their difference.

The picture is (A + B) / 2. The values A and B of a pixel are independent, as long as the number of the pixel's samples
does not depend on the values of these samples (allocation.py). Then (A - B)^2 / 4 is an unbiased estimate of the
variance of (A + B) / 2, with any sampler. It is a poor estimate for one pixel, and a good one for the mean over all
pixels.

A lane is one entry of a Dr.Jit array: here one pixel in one half. N is the number of pixels.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import film as films
from visray.adaptive.lane_buffer import LaneBuffer
from visray.integrator import Window
from visray.output.curves import LUMINANCE
from visray.setup import Prepared

# Quantile of the normal distribution: the interval from -QUANTILE to QUANTILE has a probability of 95 %.
QUANTILE = 1.959964
# Rule of three: if an event does not occur in n tries, its probability is below UNSEEN / n, with a confidence of 95 %.
UNSEEN = 3.0


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


class DualBuffer(LaneBuffer):
    """Film of both halves. Lanes 0 to N - 1 are the pixels in half A, lanes N to 2 N - 1 the pixels in half B.

    n: number of pixels, N.
    """

    def __init__(self, prepared: Prepared):
        self.n = len(prepared.order)
        films.check_memory(prepared.scene.film.width, prepared.scene.film.height, 2)
        super().__init__(prepared, np.tile(prepared.order, 2))

    def compile(self) -> None:
        """Compiles the kernel of a pass: takes a few samples and discards them."""
        lanes = np.arange(min(2 * self.n, 32))
        DualBuffer(self.prepared).run_pass(lanes, np.ones(2 * self.n, np.int64))

    def places(self, index: Any) -> tuple[Any, Any, Any, Window | None]:
        prepared, a, n = self.prepared, self.prepared.a, self.n
        in_b = index >= dr.opaque(a.U, n)
        pixel = dr.select(in_b, index - dr.opaque(a.U, n), index)
        seed_a, seed_b = (dr.opaque(a.U, half_seed(prepared.scene.settings.seed, half)) for half in (0, 1))
        x, y = (dr.gather(a.U, v, pixel) for v in (prepared.x, prepared.y))
        return dr.select(in_b, seed_b, seed_a), x, y, None

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
