"""Dual buffer: two halves A and B of a picture with separate samples, and the error estimated from their difference.

The picture is (A + B) / 2. The values A and B of a pixel are independent, as long as the number of the pixel's samples
does not depend on the values of these samples (allocation.py). Then (A - B)^2 / 4 is an unbiased estimate of the
variance of (A + B) / 2, with any sampler. It is a poor estimate for one pixel, and a good one for the mean over all
pixels.

A lane is one entry of a Dr.Jit array: here one pixel in one half. N is the number of pixels.
"""

from collections.abc import Collection
from typing import Any

import drjit as dr
import numpy as np

from visray import film as films
from visray.adaptive.cell_buffer import CellBuffer
from visray.adaptive.estimate import Estimate
from visray.adaptive.journal import Journal
from visray.adaptive.lane_buffer import LaneBuffer, half_seed
from visray.integrator import Window
from visray.output.curves import LUMINANCE
from visray.setup import Prepared

# Quantile of the normal distribution: the interval from -QUANTILE to QUANTILE has a probability of 95 %.
QUANTILE = 1.959964


class DualBuffer(LaneBuffer):
    """Film of both halves. Lanes 0 to N - 1 are the pixels in half A, lanes N to 2 N - 1 the pixels in half B.

    n: number of pixels, N.
    cells: the pixels that show small objects, which are cut into cells; None if there are none. Their colours replace
        those of the lanes.
    hidden: brightness that light may have where few samples meet it; 0 if it is no more than that of the picture.
    """

    def __init__(self, prepared: Prepared, journal: Journal | None = None):
        self.n, self.hidden = len(prepared.order), 0.0
        self.cells: CellBuffer | None = None
        films.check_memory(*prepared.scene.film.raster, 2)
        super().__init__(prepared, np.tile(prepared.order, 2), "pixels", journal)

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
        halves = mean[:, : self.n], mean[:, self.n :]
        if self.cells is not None:
            for half, own in zip(halves, self.cells.halves()):
                half[:, self.cells.lanes] = own
        return halves

    def mean(self) -> np.ndarray:
        """Colours of the pixels in the picture: the mean of both halves. Shape: (3, N)."""
        return sum(self.means()) / 2

    def estimate(self) -> Estimate:
        """Estimated error of the picture. It is the same as by Estimate.of, but Dr.Jit computes the sums, unless there
        are cells or hidden light."""
        samples = 2 * int(self.counts.min())
        if self.cells is None and not self.hidden:
            return self._quick_estimate(samples)
        least = samples if self.cells is None else min(samples, self.cells.density())
        estimate = Estimate.of(*self.means(), least, self.cells, self.hidden)
        if not self.hidden or samples < 4:
            return estimate
        variances = (self.variances() / (3 * self.counts)).reshape(2, -1).sum(0) / 4
        return estimate.guarded(variances if self.cells is None else np.delete(variances, self.cells.lanes))

    def _quick_estimate(self, samples: int) -> Estimate:
        """The estimate of a picture without cells and hidden light. samples: smallest number of samples of a pixel."""
        a, lanes = self.prepared.a, dr.arange(self.prepared.a.U, self.n)
        left, right = (dr.gather(a.W, self.film.mean, lanes + dr.opaque(a.U, i * self.n)) for i in (0, 1))
        squares = dr.squared_norm(left - right) / 12
        light = dr.dot(a.W(*LUMINANCE.tolist()), left + right) / 2
        sums = dr.sum(squares), dr.sum(dr.square(squares)), dr.sum(light)
        dr.eval(sums)
        return Estimate.from_sums(self.n, *(float(x[0]) for x in sums), samples)

    def samples(self) -> np.ndarray:
        """Number of samples of each pixel, in both halves together. Shape: (N)."""
        samples = self.counts.reshape(2, -1).sum(0)
        if self.cells is not None:
            samples[self.cells.lanes] = self.cells.samples()
        return samples

    def layers(self, names: Collection[str]) -> dict[str, np.ndarray]:
        """Dict of layers of the picture by name, with pixels in the order of lanes. Shapes: (3, N) or (N) each.

        names: names of the layers that are wanted. RGB and samples are always present. A, variance and error are
            present only if they are wanted; variance needs at least two samples of each pixel in each half.

        The layer `error` is the standard error of a pixel. Its square is averaged over 3 x 3 pixels, because a single
        pixel gives a poor estimate.
        """
        counts, film = self.counts.reshape(2, -1), self.prepared.scene.film
        cells, samples = self.cells, self.samples()
        layers = {"RGB": self.mean(), "samples": samples}
        if "A" in names:
            coverage = np.array(self.film.coverage).reshape(2, -1) / counts
            layers["A"] = coverage.mean(0) if film.transparent else np.ones(self.n)
            if cells is not None and film.transparent:
                layers["A"][cells.lanes] = cells.coverage()
        if "variance" in names and counts.min() > 1:
            layers["variance"] = np.array(self.film.squares).reshape(3, 2, -1).sum(1) / (counts - 1).sum(0)
            if cells is not None:
                # The variance that independent samples of the whole pixel would have for the same error.
                layers["variance"][:, cells.lanes] = cells.squares() * samples[cells.lanes]
        if "error" in names:
            shape, order = film.raster[::-1], self.prepared.order
            a, b = self.means()
            picture = np.empty((3, self.n))
            squares = np.square(a - b) / 4
            if cells is not None:
                squares[:, cells.lanes] = cells.squares()
            picture[:, order] = squares
            layers["error"] = np.sqrt(np.stack([smoothed(x.reshape(shape)).ravel()[order] for x in picture]))
        return layers

    def variances(self) -> np.ndarray:
        """Variance of each lane's samples, summed over channels. Shape: (2 N)."""
        return np.array(self.film.squares).sum(0) / np.maximum(self.counts - 1, 1)


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
