"""Cell buffer: the samples of the pixels that show small objects (small_objects.py).

Each cell is sampled in REPLICATES lanes with separate seeds. So a pixel has REPLICATES independent values: the sums of
the means of its cells, weighted by their areas. Half of them belong to half A of the picture, the others to half B. The
spread of all of them tells the error of the pixel far better than the difference of the two halves.

How many samples a cell gets depends on the scene, and on one number for the whole picture, the `level`; it does not
depend on the samples of the cell.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np

from visray.adaptive.journal import Journal
from visray.adaptive.lane_buffer import LARGEST_LEVEL, LaneBuffer, half_seed
from visray.adaptive.small_objects import Cells
from visray.integrator import Window
from visray.setup import Prepared

# Independent values of a pixel, and the degrees of freedom of the variance of their mean.
REPLICATES = 16
FREEDOM = REPLICATES - 1
# Numbers of the cells of a pixel are below this number.
MOST_CELLS = 8


class CellBuffer(LaneBuffer):
    """Lane k C + c is cell c in replicate k, for C cells. Shapes: P pixels.

    cells: the cells.
    lanes: lane of each pixel in the picture (Prepared.order). Shape: (P).
    level: each step of it doubles the samples of the most important pixels.
    """

    def __init__(self, prepared: Prepared, cells: Cells, brightness: np.ndarray, journal: Journal | None = None):
        """brightness: greatest brightness of the small objects of each pixel. Shape: (P)."""
        super().__init__(prepared, np.tile(cells.pixels[cells.pixel], REPLICATES), "cells", journal)
        self.cells, self.level = cells, -1
        lane_of = np.empty(len(prepared.order), np.int64)
        lane_of[prepared.order] = np.arange(len(prepared.order))
        self.lanes = lane_of[cells.pixels]
        self.floor = _power_of_two(np.maximum(cells.samples / REPLICATES, 1))
        first = np.unique(cells.pixel, return_index=True)[1]
        # The first cell of a pixel is around its small objects.
        importance = cells.areas[first] * brightness
        top = int(np.argmax(importance))
        share = importance / max(importance[top], 1e-300)
        self.share = (share * self.floor[first][top] / self.floor[first])[cells.pixel] * self.floor
        self._inputs = self._lane_inputs()

    def _lane_inputs(self) -> tuple:
        """Seed, column, row and window of each lane, as Dr.Jit arrays."""
        cells, a = self.cells, self.prepared.a
        film, seed = self.prepared.scene.film, self.prepared.scene.settings.seed
        y, x = np.divmod(cells.pixels[cells.pixel], film.raster[0])
        x, y = x + film.corner[0], y + film.corner[1]
        number = np.arange(len(cells.pixel)) - np.searchsorted(cells.pixel, cells.pixel)
        seeds = [half_seed(seed, 2 + k * MOST_CELLS + int(i)) for k in range(REPLICATES) for i in number]
        integers = (a.put(a.U, np.tile(v, REPLICATES).astype(np.uint32)) for v in (x, y))
        sides = (a.put(a.F, np.tile(v, REPLICATES)) for v in cells.windows.T)
        return a.put(a.U, np.array(seeds, np.uint32)), *integers, Window(*sides)

    def places(self, index: Any) -> tuple[Any, Any, Any, Window | None]:
        seeds, x, y, window = self._inputs
        seeds, x, y = (dr.gather(type(v), v, index) for v in (seeds, x, y))
        parts = (window.left, window.top, window.width, window.height)
        return seeds, x, y, Window(*(dr.gather(type(v), v, index) for v in parts))

    def rise(self, seconds_left: Callable[[], float]) -> bool:
        """Raises the level by one, and takes the samples of the new level. Returns whether all of them were taken."""
        self.level += 1
        return self._extend_to(_power_of_two(self.share * 2.0**self.level), seconds_left)

    def keep_up(self, samples: int, seconds_left: Callable[[], float]) -> bool:
        """Takes samples until they are as dense as those of pixels with this number of samples. Returns whether all of
        them were taken."""
        return self._extend_to(_power_of_two(self.cells.areas * (samples / REPLICATES)), seconds_left)

    def _extend_to(self, wanted: np.ndarray, seconds_left: Callable[[], float]) -> bool:
        """Takes samples until each lane of each cell has as many as are wanted. Shape: wanted (C)."""
        targets = np.tile(np.minimum(np.maximum(wanted, self.floor), 2**LARGEST_LEVEL), REPLICATES)
        return self.extend(np.maximum(targets, self.counts), seconds_left)

    def density(self) -> float:
        """Smallest number of samples per area of any cell; the area of a pixel is 1."""
        samples = self.counts.reshape(REPLICATES, -1).sum(0)
        return float((samples / self.cells.areas).min())

    @property
    def exhausted(self) -> bool:
        """Whether the cells have all the samples that they can have."""
        return bool(self.counts.max(initial=0) >= 2**LARGEST_LEVEL)

    def per_pixel(self, values: np.ndarray, areas: bool = True) -> np.ndarray:
        """Sums over the cells of each pixel, in each replicate.

        values: one value of each lane. areas: whether values are weighted by the areas of the cells.

        Shapes: values (lanes); result (REPLICATES, P).
        """
        weighted = values.reshape(REPLICATES, -1) * (self.cells.areas if areas else 1.0)
        n = len(self.cells.pixels)
        return np.stack([np.bincount(self.cells.pixel, row, n) for row in weighted])

    def colours(self) -> np.ndarray:
        """Colours of the pixels in each replicate. Shape: (3, REPLICATES, P)."""
        return np.stack([self.per_pixel(channel) for channel in np.array(self.film.mean)])

    def halves(self) -> tuple[np.ndarray, np.ndarray]:
        """Colours of the pixels in half A and in half B. Shapes: (3, P) each."""
        colours = self.colours()
        return colours[:, : REPLICATES // 2].mean(1), colours[:, REPLICATES // 2 :].mean(1)

    def squares(self) -> np.ndarray:
        """Estimated square errors of the pixels' colours. Shape: (3, P)."""
        return self.colours().var(1, ddof=1) / REPLICATES

    def samples(self) -> np.ndarray:
        """Numbers of samples of the pixels. Shape: (P)."""
        return self.per_pixel(self.counts.astype(float), areas=False).sum(0).astype(np.int64)

    def coverage(self) -> np.ndarray:
        """Shares of the pixels that objects cover. Shape: (P)."""
        return self.per_pixel(np.array(self.film.coverage) / self.counts).mean(0)


def _power_of_two(x: np.ndarray) -> np.ndarray:
    """The nearest powers of two above or at numbers, in proportion; at least 1. Shape: that of x."""
    return 2 ** np.ceil(np.log2(np.maximum(x, 1))).astype(np.int64)
