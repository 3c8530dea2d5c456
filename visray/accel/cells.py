"""Cell lists: for rays that share their origin or their direction, the rows that a ray can meet.

A row is one object in the kernel's tables. A sheet of directions (or of positions, for parallel rays) is cut into
cells (cell_views.py). The list of a cell contains every row that some ray through the cell can meet, nearest first.

The promise: let the column of a ray be computed in single precision, as (x - low.x) * (columns / extent.x), where x is
d.right / d.forward or p.right, and let the row of its cell be computed likewise. If both are between -slack and the
number of columns or rows of cells, plus slack, they are rounded down and limited to the cells that exist. Then the list
of this cell contains all rows that the exact ray meets. If one of them is not, the ray meets no row that the views
cover. The same holds for a ray with d.forward <= 0, if no other view contains it.

Source: Weghorst, Hooper, Greenberg 1984 (item buffer); Haines and Greenberg 1986 (light buffer).
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from visray.accel.cell_views import CellView, camera_view, parallel_view, point_views
from visray.accel.footprints import Balls, Boxes, Triangles, rounded_down
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
    return _lists(views, Balls(np.asarray(centre, float), np.asarray(radius, float)), budget_bytes)


def triangle_lists(
    views: tuple[CellView, ...], a: np.ndarray, b: np.ndarray, c: np.ndarray, budget_bytes: int
) -> CellLists | None:
    """The lists of triangles, or None if even one cell for each view exceeds the budget.

    a, b, c: corners of the triangles, exact to within gamma(32) times their sizes. Shape: (n, 3) each.
    budget_bytes: as in ball_lists.
    """
    return _lists(views, Triangles(*(np.asarray(v, float) for v in (a, b, c))), budget_bytes)


def _lists(views: tuple[CellView, ...], rows: Balls | Triangles, budget_bytes: int) -> CellLists | None:
    """The lists of rows, in the finest cells that pay and that the budget allows."""
    start = time.perf_counter()
    near, far = _range(views[0], rows)
    rank, order = _ranks(near)
    boxes = [rows.boxes(view) for view in views]
    side = _side(views, boxes, rows, budget_bytes)
    while True:
        columns, rows_of_cells = _grid(views, side)
        cells = len(views) * columns * rows_of_cells
        parts = [_Pairs(v, b, rows, columns, rows_of_cells) for v, b in zip(views, boxes)]
        size = 4 * (sum(p.count for p in parts) + cells + 1)
        if size <= budget_bytes:
            break
        if side <= 1:
            return None
        side = max(1.0, side * min(0.9, (budget_bytes / size) ** 0.5))
    offsets, entries = _sorted(parts, rank, order, cells)
    slack = np.max([v.slack(columns, rows_of_cells) for v in views], axis=0)
    far = far if views[0].parallel else None
    return CellLists(
        tuple(views), columns, rows_of_cells, slack, offsets, entries, near, far, time.perf_counter() - start
    )


def _range(view: CellView, rows: Balls | Triangles) -> tuple[np.ndarray, np.ndarray]:
    """Bounds on the distances or depths of rows, with a margin for all that a kernel computes in single. Shape: (n).

    Error: a depth in single has an error of at most 5 u reach. A distance in single has a relative error of at most 8 u
    (u of a conversion, 6 u of the unit direction).
    """
    low, high = rows.range(view)
    if view.parallel:
        margin = gamma(8, "single") * view.reach
        return rounded_down(low - margin), -rounded_down(-high - margin)
    margin = gamma(16, "single")
    return np.maximum(rounded_down(low * (1 - margin)), np.float32(0)), -rounded_down(-high * (1 + margin))


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


class _Pairs:
    """All pairs of a cell and a row of one view, as spans: one row, and neighbouring cells of one row of cells.

    count: number of pairs.
    """

    def __init__(self, view: CellView, boxes: Boxes, rows: Balls | Triangles, columns: int, rows_of_cells: int):
        self.columns, self.rows_of_cells = columns, rows_of_cells
        grid = np.array([columns, rows_of_cells], np.float32)[:, None]
        # Products of the boxes' corners and the numbers of cells are rounded in single, and the footprints in double.
        slack = view.slack(columns, rows_of_cells)[:, None] + gamma(16, "single") * grid
        self.slack = slack
        low, high = boxes.low * grid - slack.astype(np.float32), boxes.high * grid + slack.astype(np.float32)
        seen = np.all((high >= -slack) & (low <= grid + slack), axis=0)
        first = np.clip(np.floor(low), 0, grid - 1).astype(np.int32)[:, seen]
        last = np.clip(np.floor(high), 0, grid - 1).astype(np.int32)[:, seen]
        self.row, self.projected = boxes.row[seen], boxes.projected[seen]
        self.first, self.size = first, last - first + 1
        self._span(view, rows)
        self.count = int(self.length.sum())

    def _span(self, view: CellView, rows: Balls | Triangles) -> None:
        height = self.size[1]
        owner = np.repeat(np.arange(len(height)), height)
        j = self.first[1][owner] + np.arange(len(owner)) - np.repeat(np.cumsum(height) - height, height)
        begin, length = self.first[0][owner], self.size[0][owner]
        cut = self.projected & (self.size[0] > 1) & (self.size[1] > 1)
        at = np.flatnonzero(cut[owner])
        if len(at):
            new = np.cumsum(cut) - 1
            begin[at], length[at] = self._cut(view, rows, np.flatnonzero(cut), new[owner[at]], j[at])
        self.owner, self.begin, self.length = owner, j * self.columns + begin, length

    def _cut(self, view: CellView, rows: Triangles, which: np.ndarray, owner: np.ndarray, j: np.ndarray) -> tuple:
        """Columns that triangles overlap in rows of cells: (first column, number of columns), one entry per span."""
        x, y, margin = rows.spans(view, self.row[which], None)
        x, y = x * self.columns, y * self.rows_of_cells
        margin_x, margin_y = self.slack[0] + margin[0] * self.columns, self.slack[1] + margin[1] * self.rows_of_cells
        lower = np.where(j == 0, -np.inf, j - margin_y[owner])
        upper = np.where(j == self.rows_of_cells - 1, np.inf, j + 1 + margin_y[owner])
        first, last = np.full(len(j), np.inf), np.full(len(j), -np.inf)
        x, y = x[:, owner], y[:, owner]
        for k in range(3):
            xp, yp, xq, yq = x[k], y[k], x[(k + 1) % 3], y[(k + 1) % 3]
            dy = yq - yp
            dy[dy == 0] = 2.0**-1000
            x0 = xp + np.clip((lower - yp) / dy, 0, 1) * (xq - xp)
            x1 = xp + np.clip((upper - yp) / dy, 0, 1) * (xq - xp)
            meets = (np.maximum(yp, yq) >= lower) & (np.minimum(yp, yq) <= upper)
            first = np.where(meets, np.minimum(first, np.minimum(x0, x1)), first)
            last = np.where(meets, np.maximum(last, np.maximum(x0, x1)), last)
        first, last = first - margin_x[owner], last + margin_x[owner]
        seen = (last >= -self.slack[0]) & (first <= self.columns + self.slack[0])
        first = np.clip(np.floor(first), 0, self.columns - 1).astype(np.int32)
        last = np.clip(np.floor(last), 0, self.columns - 1).astype(np.int32)
        return first, np.where(seen, last - first + 1, 0)

    def keys(self, rank: np.ndarray, base: int) -> Iterator[np.ndarray]:
        """For each pair a number: the cell, and in the lower 32 bits the row's rank."""
        cell = (self.begin + base).astype(np.uint64)
        ends = np.cumsum(self.length)
        step = np.uint64(32)
        key = (cell << step) + rank[self.row[self.owner]] - ((ends - self.length).astype(np.uint64) << step)
        yield np.repeat(key, self.length) + (np.arange(self.count, dtype=np.uint64) << step)


def _sorted(parts: list[_Pairs], rank: np.ndarray, order: np.ndarray, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """(offsets, entries) of all pairs."""
    each = cells // len(parts)
    keys = np.concatenate([k for v, p in enumerate(parts) for k in p.keys(rank, v * each)])
    keys.sort()
    entries = order[keys.astype(np.uint32)]
    count = np.bincount((keys >> np.uint64(32)).astype(np.int64), minlength=cells)
    return np.concatenate([[0], np.cumsum(count)]).astype(np.uint32), entries
