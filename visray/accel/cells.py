"""Cell lists: for rays that share their origin or their direction, the rows that a ray can meet.

A row is one object in the kernel's tables. A sheet of directions (or of positions, for parallel rays) is cut into
cells (cell_views.py). The list of a cell contains every row that some ray through the cell can meet, nearest first.

The promise: let the column of a ray be computed in single precision, as (x - low.x) * (columns / extent.x), where x is
d.right / d.forward or p.right, and let the row of its cell be computed likewise. If both are between 0 and the number
of columns or rows of cells, or at most the slack beyond, they are rounded down and limited to the cells that exist.
Then the list of this cell contains all rows that the exact ray meets. The sheets of point_views and parallel_view are
wider than their rows by more than the slack. So a ray for which a number is beyond 0 or the number of cells meets no
row, and neither does a ray with d.forward <= 0 (tests/test_cells.py).

Source: Weghorst, Hooper, Greenberg 1984 (item buffer); Haines and Greenberg 1986 (light buffer).
"""

import time
from dataclasses import dataclass

import numpy as np

from visray.accel.cell_pairs import Spans, ordered, spans_of
from visray.accel.cell_views import CellView, camera_view, parallel_view, point_views
from visray.accel.footprints import Balls, Boxes
from visray.accel.triangle_footprints import Triangles
from visray.geometry import gamma

__all__ = ["CellLists", "CellView", "ball_lists", "camera_view", "parallel_view", "point_views", "triangle_lists"]

# A list is as short as it can be if it only contains rows that cover the whole cell. Cells are not cut finer where
# their lists are longer than that by less than this factor.
NEARLY_SHORTEST = 1.2


@dataclass(frozen=True)
class CellLists:
    """Lists of rows, one for each cell of each view.

    The number of a cell is (view * rows_of_cells + row) * columns + column.

    views: the sheets.
    columns, rows_of_cells: number of cells of each sheet along right and along up.
    slack: bound on the error of a ray's column and row in single, in cells; the greatest of all views. Shape: (2).
    offsets: for each cell the position of its first entry; at the end the number of entries. Shape: (cells + 1).
    entries: numbers of rows. In each cell they are sorted by `near`, and rows with equal `near` by their numbers.
    near: for each row a lower bound on its distance from the origin, in single; for parallel rays on its depth
        (p - origin) . forward. It is lower by the rounding errors of a distance or depth that is computed in single.
        Shape: (rows).
    far: for parallel rays, upper bounds on the depth in the same way; else None. Shape: (rows).
    seconds: time of the build.
    """

    views: tuple[CellView, ...]
    columns: int
    rows_of_cells: int
    slack: np.ndarray
    offsets: np.ndarray
    entries: np.ndarray
    near: np.ndarray
    far: np.ndarray | None
    seconds: float

    @property
    def bytes(self) -> int:
        """Size of offsets and entries in memory."""
        return self.offsets.nbytes + self.entries.nbytes


def ball_lists(
    views: tuple[CellView, ...], centre: np.ndarray, radius: np.ndarray, budget_bytes: int
) -> CellLists | None:
    """The lists of balls, or None if even one cell for each view exceeds the budget.

    centre, radius: the balls, exact to within gamma(32) times their sizes. Shapes: (n, 3), (n).
    budget_bytes: greatest size of offsets and entries together.
    """
    return _lists(views, Balls(centre, radius), budget_bytes)


def triangle_lists(
    views: tuple[CellView, ...], a: np.ndarray, b: np.ndarray, c: np.ndarray, budget_bytes: int
) -> CellLists | None:
    """The lists of triangles, or None if even one cell for each view exceeds the budget.

    a, b, c: corners of the triangles, exact to within gamma(32) times their sizes. Shape: (n, 3) each.
    budget_bytes: as in ball_lists.
    """
    return _lists(views, Triangles(a, b, c), budget_bytes)


def _lists(views: tuple[CellView, ...], rows: Balls | Triangles, budget_bytes: int) -> CellLists | None:
    """The lists of rows, in the finest cells that pay and that the budget allows."""
    start = time.perf_counter()
    low, high, boxes = rows.seen(views)
    near, far = _with_margins(views[0], low, high)
    rank, order = _ranks(near)
    side = _side(views, boxes, rows, budget_bytes)
    while True:
        columns, rows_of_cells = grid = _grid(views, side)
        cells = len(views) * columns * rows_of_cells
        spans = [
            spans_of(v, b, rows, rank, grid, k * columns * rows_of_cells) for k, (v, b) in enumerate(zip(views, boxes))
        ]
        size = 4 * (sum(int(s.length.sum()) for s in spans) + cells + 1)
        if size <= budget_bytes:
            break
        if side <= 1:
            return None
        side = max(1.0, side * min(0.9, (budget_bytes / size) ** 0.5))
    offsets, entries = ordered(Spans.joined(spans), order, cells, columns)
    slack = np.max([v.slack(columns, rows_of_cells) for v in views], axis=0)
    far = far if views[0].parallel else None
    return CellLists(
        tuple(views), columns, rows_of_cells, slack, offsets, entries, near, far, time.perf_counter() - start
    )


def _with_margins(view: CellView, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds on the distances or depths of rows, with a margin for all that a kernel computes in single. Shape: (n).

    Error: a depth in single has an error of at most 5 u reach. A distance in single has a relative error of at most 8 u
    (u of a conversion, 6 u of the unit direction).
    """
    if view.parallel:
        margin = gamma(8, "single") * view.reach
        return _rounded_down(low - margin), -_rounded_down(-high - margin)
    margin = gamma(16, "single")
    return np.maximum(_rounded_down(low * (1 - margin)), np.float32(0)), -_rounded_down(-high * (1 + margin))


def _rounded_down(x: np.ndarray) -> np.ndarray:
    """Single-precision numbers that are less than x."""
    return np.nextafter(x.astype(np.float32), np.float32(-np.inf))


def _ranks(near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(position of each row in the order by `near`, rows in this order). Shape: (n) each."""
    n = len(near)
    bits = (near + np.float32(0)).view(np.int32)  # + 0 turns -0 into 0
    ascending = np.where(bits < 0, ~bits.view(np.uint32), bits.view(np.uint32) | np.uint32(1 << 31))
    key = (ascending.astype(np.uint64) << np.uint64(32)) | np.arange(n, dtype=np.uint64)
    order = np.sort(key).astype(np.uint32)
    rank = np.empty(n, np.uint32)
    rank[order] = np.arange(n, dtype=np.uint32)
    return rank, order


def _grid(views: tuple[CellView, ...], side: float) -> tuple[int, int]:
    """Numbers of columns and of rows of cells, for about side^2 nearly square cells in each view."""
    aspect = np.clip(views[0].extent[0] / views[0].extent[1], 1 / 64, 64) ** 0.5
    finest = np.min([v.finest() for v in views], axis=0)
    columns, rows_of_cells = np.clip(np.round([side * aspect, side / aspect]), 1, finest).astype(int)
    return int(columns), int(rows_of_cells)


def _side(views: tuple[CellView, ...], boxes: list[Boxes], rows: Balls | Triangles, budget_bytes: int) -> float:
    """The square root of a good number of cells for each view.

    A box of width w and height h overlaps about (w side + 1) (h side + 1) cells. The lists shall have about 64 entries
    for each row if there are few rows; beyond 8192 rows they grow with the square root of the number of rows. So a
    build takes a fraction of a second.
    """
    n = len(rows)
    size = [np.clip(b.high, 0, 1) - np.clip(b.low, 0, 1) for b in boxes]
    area = rows.fill * sum(float((s[0] * s[1]).sum(dtype=float)) for s in size)
    edges = sum(float(s.sum(dtype=float)) for s in size)
    count = sum(len(b.row) for b in boxes)
    wanted = max(2 * n, 64 * n * min(1, (8192 / max(n, 1)) ** 0.5))
    side = np.unique(np.round(2.0 ** np.arange(0, 12.25, 0.25)))
    cells = len(views) * side * side
    entries = area * side * side + edges * side + count
    fits = (entries <= wanted) & (4 * (entries + cells + 1) <= budget_bytes) & (cells <= min(16 * wanted, 1 << 22))
    best = side[fits][-1] if fits.any() else 1.0
    short = entries <= NEARLY_SHORTEST * area * side * side
    return float(min(best, side[short][0])) if short.any() else float(best)
