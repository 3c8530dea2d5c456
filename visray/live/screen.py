"""What a screen shows of a live picture: 8-bit colours of cells, which steps paint one after the other.

A cell is a square of pixels with one colour (grids.py).
"""

from functools import lru_cache
from typing import Any

import drjit as dr
import numpy as np

from visray.live.grids import Grid
from visray.moments import Moments
from visray.output.curves import curve
from visray.quantities import Arrays

# A table of 8-bit numbers has an entry for each of BINS parts of the light from 0 to 1. In each part the 8-bit number
# grows by one at most: the sRGB curve is nowhere steeper than 12.92, and 12.92 * 255 < BINS.
BINS = 4096
# Behind a transparent picture there are squares of two greys, in linear light. Their side in pixels.
DARK, LIGHT, SIDE = 0.35, 0.6, 12


def displayed(rgb: np.ndarray) -> np.ndarray:
    """Linear colours as they are shown on a screen, in 8 bits. Light that is not a number is shown black."""
    light = np.clip(np.nan_to_num(rgb, nan=0.0), 0, 1)
    return np.floor(curve(light, "srgb") * 255 + 0.5).astype(np.uint8)


@lru_cache(maxsize=4)
def _tables(a: Arrays) -> tuple[Any, Any]:
    """(8-bit number at the beginning of each part of the light, least light with a larger number than each)."""
    numbers = np.arange(255)
    low, high = np.zeros(255), np.ones(255)
    for _ in range(80):
        middle = (low + high) / 2
        is_larger = displayed(middle) > numbers
        low, high = np.where(is_larger, low, middle), np.where(is_larger, middle, high)
    first = displayed(np.arange(BINS + 1) / BINS).astype(np.uint32)
    return a.put(a.U, first), a.put(a.D, np.append(high, np.inf))


class Screen:
    """The colours of the cells of a picture, for a screen.

    a: array types
    size: width and height of the picture in pixels
    transparent: whether squares of grey are seen behind the picture
    grain: side of the cells that are shown, in pixels
    """

    def __init__(self, a: Arrays, size: tuple[int, int], transparent: bool):
        self.a, self.size, self.transparent = a, size, transparent
        self.grain, self.columns, self.rows = 1, *size
        self._colours: Any = None

    def begin(self, whole: Grid) -> None:
        """Goes on with the cells of another grid. Until they are painted, they have the colours of those before."""
        n = len(whole)
        if self._colours is None:
            colours = dr.opaque(self.a.U, 0, n)
        else:
            width, height = self.size
            x, y = (np.minimum(np.arange(k) * whole.grain, m - 1) // self.grain for k, m in (
                (whole.columns, width), (whole.rows, height)))  # fmt: skip
            old = np.array(self._colours).reshape(self.rows, self.columns)
            colours = self.a.put(self.a.U, np.ascontiguousarray(old[y[:, None], x]).ravel())
        dr.eval(colours)
        self._colours = colours
        self.grain, self.columns, self.rows = whole.grain, whole.columns, whole.rows

    def paint(self, grid: Grid, moments: Moments, count: int) -> Any:
        """Shows some cells, and returns their mean colours in double. Shape: (3, N).

        moments: moments of the samples of each of them, with the open block
        count: number of samples of each of them
        """
        a = self.a
        closed = moments.closed(a, dr.opaque(a.U, count))
        mean = shown = closed.mean
        if self.transparent:
            squares = ((grid.x // dr.opaque(a.U, SIDE)) + (grid.y // dr.opaque(a.U, SIDE))) & 1
            behind = dr.select(squares == 0, dr.opaque(a.D, DARK), dr.opaque(a.D, LIGHT))
            shown = mean + (1 - closed.coverage * dr.rcp(dr.opaque(a.D, float(count)))) * behind
        first, limits = _tables(a)
        packed = a.U(0)
        for channel, light in enumerate(shown):
            # Light that is not a number fails the comparison.
            light = dr.select(light >= 0, dr.minimum(light, 1), 0)
            number = dr.gather(a.U, first, a.U(light * BINS))
            number += dr.select(light >= dr.gather(a.D, limits, number), a.U(1), 0)
            packed |= number << (8 * channel)
        dr.scatter(self._colours, packed, grid.cells)
        dr.eval(mean, self._colours)
        return mean

    def rgb(self) -> np.ndarray:
        """The colours of all cells. Shape: uint8 (rows, columns, 3)."""
        colours = np.array(self._colours).view(np.uint8).reshape(self.rows, self.columns, 4)
        return np.ascontiguousarray(colours[..., :3])
