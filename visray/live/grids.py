"""Which pixels a state of a live picture consists of.

A coarse state consists of squares, each with the colour of one pixel in it. The grain is the side of the squares in
pixels. A cell is one of the squares; with grain 1 each pixel is a cell.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import drjit as dr
import numpy as np

from visray.film import tile_order
from visray.live.seeing import lanes
from visray.passes import PACKET
from visray.quantities import Arrays

# Grains that states may have, the coarsest first.
GRAINS = (32, 24, 16, 12, 8, 6, 4, 3, 2, 1)


@dataclass(frozen=True, eq=False)
class Grid:
    """The cells of a state, in an order in which neighbours are near each other.

    grain: side of a cell in pixels
    columns, rows: number of cells across and down
    cells: number (row * columns + column) of each cell. Shape: (N)
    x, y: column and row of each cell's pixel. Shapes: (N)
    """

    grain: int
    columns: int
    rows: int
    cells: Any
    x: Any
    y: Any

    def __len__(self) -> int:
        return self.columns * self.rows


@lru_cache(maxsize=48)
def grid(a: Arrays, width: int, height: int, grain: int) -> Grid:
    """The cells of a state of a picture of width x height pixels."""
    columns, rows = -(-width // grain), -(-height // grain)
    if grain == 1:
        order, x, y = lanes(a, width, height)
        return Grid(1, columns, rows, _put(a, order), x, y)
    order = tile_order(columns, rows)
    row, column = np.divmod(order, columns)
    x, y = (np.minimum(k * grain + grain // 2, n - 1) for k, n in ((column, width), (row, height)))
    return Grid(grain, columns, rows, *(_put(a, v) for v in (order, x, y)))


@lru_cache(maxsize=16)
def grains(width: int, height: int) -> tuple[int, ...]:
    """Grains that states of a picture of width x height pixels may have, the coarsest first; the last is 1.
    With fewer cells than a processor computes together, a state would take as long as with more."""
    cells = {g: -(-width // g) * -(-height // g) for g in GRAINS}
    return tuple(g for g in GRAINS if g == 1 or cells[g] >= PACKET)


def parts_of(a: Arrays, whole: Grid, lanes_of: list[np.ndarray]) -> list[Grid]:
    """Parts of a grid, as grids of as many columns and rows. lanes_of: numbers of the lanes of each part."""
    arrays = [np.array(v) for v in (whole.cells, whole.x, whole.y)]
    return [Grid(whole.grain, whole.columns, whole.rows, *(_put(a, v[lanes]) for v in arrays)) for lanes in lanes_of]


def _put(a: Arrays, numbers: np.ndarray) -> Any:
    """Whole numbers as an array of Dr.Jit."""
    array = a.put(a.U, numbers.astype(np.uint32))
    # NumPy's memory is no longer read then.
    dr.eval(array)
    return array
