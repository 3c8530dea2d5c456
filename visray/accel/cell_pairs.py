"""Pairs of a cell and a row that a ray through the cell can meet, and their order by cells.

Pairs are found as spans: a span is one row, and neighbouring cells of one row of cells.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from visray.accel.cell_views import CellView
from visray.accel.footprints import Balls, Boxes, Outline
from visray.accel.sheet_arithmetic import chunks, taken
from visray.accel.triangle_footprints import Triangles
from visray.geometry import gamma

TALLEST = 16  # rows that overlap up to so many rows of cells are worked on together with others of their height
MANY = 256  # number of rows of one height from which this pays
SPANS = 1 << 13  # number of spans that are worked on at once; so many fit in the processor's cache
BAND = 1 << 19  # number of pairs that are sorted at once


@dataclass(frozen=True)
class Spans:
    """Spans of rows over cells.

    cell: number of the first cell. Shape: (m).
    length: number of cells; may be 0. Shape: (m).
    rank: place of the row in the order by distance. Shape: (m).
    """

    cell: np.ndarray
    length: np.ndarray
    rank: np.ndarray

    @staticmethod
    def joined(parts: list["Spans"]) -> "Spans":
        """The spans of one or more records as one."""
        return Spans(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("cell", "length", "rank")))


def spans_of(
    view: CellView, boxes: Boxes, rows: Balls | Triangles, rank: np.ndarray, grid: tuple[int, int], first_cell: int
) -> Spans:
    """The spans of all rows that a view sees.

    rank: place of each row in the order by distance. Shape: (rows).
    grid: numbers of columns and of rows of cells.
    first_cell: number of the view's first cell.

    Error: the column of a ray has an error of at most the slack, and rays up to the slack beyond the sheet's border
    belong to its outermost cells. So footprints are dilated by twice the slack, and what still is beyond the border is
    left out. The margin for products and sums in single is added to that.
    """
    counts = np.array(grid, np.float32)[:, None]
    slack = (2 * view.slack(*grid)[:, None] + gamma(16, "single") * counts).astype(np.float32)
    first = np.clip(np.floor(boxes.low * counts - slack), 0, counts).astype(np.int32)
    last = np.clip(np.floor(boxes.high * counts + slack), -1, counts - 1).astype(np.int32)
    size = np.maximum(last - first + 1, 0)
    seen = (size > 0).all(axis=0)
    cut = seen & boxes.outlined & (size >= rows.smallest).all(axis=0)
    at = np.flatnonzero(seen & ~cut)
    parts = [_whole(taken(first, at), taken(size, at), rank[boxes.row[at]], grid)]
    at = np.flatnonzero(cut)
    if len(at):
        group = _groups(size[1, at])
        order = np.argsort(group, kind="stable")
        at, group = at[order], group[order]
        numbers, bottom, height, rank = taken(boxes.outline, at), first[1, at], size[1, at], rank[boxes.row[at]]
        for part, j, to_part in _parts(bottom, height, group):
            outline, part_rank = rows.outline(view, numbers[:, part], grid), rank[part]
            if to_part is not None:
                outline, part_rank = outline.at(to_part), part_rank[to_part]
            parts.append(_cut(outline, j, part_rank, grid[0], slack[:, 0]))
    spans = Spans.joined(parts)
    spans.cell[:] += np.uint32(first_cell)
    return spans


def _groups(height: np.ndarray) -> np.ndarray:
    """For each row its height, if many rows share it, or else TALLEST + 1. Shape: (m)."""
    group = np.minimum(height, TALLEST + 1).astype(np.uint8)
    few = np.bincount(group, minlength=TALLEST + 2) < MANY
    return np.where(few[group], np.uint8(TALLEST + 1), group)


def _whole(first: np.ndarray, size: np.ndarray, rank: np.ndarray, grid: tuple[int, int]) -> Spans:
    """The spans of whole boxes. Shapes: first and size (2, m), rank (m)."""
    cell, height = first[1] * grid[0] + first[0], size[1]
    if (height == 1).all():
        return Spans(cell.astype(np.uint32), size[0], rank)
    above = np.arange(height.sum()) - np.repeat(np.cumsum(height) - height, height)
    cell = np.repeat(cell, height) + above * grid[0]
    return Spans(cell.astype(np.uint32), np.repeat(size[0], height), np.repeat(rank, height))


def _parts(bottom: np.ndarray, height: np.ndarray, group: np.ndarray) -> Iterator[tuple]:
    """Parts of rows that are worked on together: (slice of the rows, rows of cells j, positions in the part).

    In a part of rows of equal height, j has the shape (height, m), and the third entry is None. In other parts, j has
    one entry per span, and the third entry says which row of the part it belongs to.

    bottom, height: first row of cells, and number of rows of cells. Shape: (m).
    group: as in _groups, ascending. Shape: (m).
    """
    begins = np.searchsorted(group, np.arange(TALLEST + 2, dtype=np.uint8))
    for h in range(1, TALLEST + 1):
        begin, end = begins[h], begins[h + 1]
        for at in chunks(int(end - begin), SPANS // h):
            part = slice(begin + at.start, begin + at.stop)
            yield part, bottom[part] + np.arange(h, dtype=np.int32)[:, None], None
    k = int(begins[TALLEST + 1])
    ends = np.cumsum(height)
    while k < len(ends):
        before = ends[k] - height[k]
        part = slice(k, max(k + 1, int(np.searchsorted(ends, before + SPANS))))
        owner = np.repeat(np.arange(part.stop - k), height[part])
        above = np.arange(len(owner)) - (ends[part] - height[part] - before)[owner]
        yield part, bottom[part][owner] + above, owner
        k = part.stop


def _cut(outline: Outline, j: np.ndarray, rank: np.ndarray, columns: int, slack: np.ndarray) -> Spans:
    """The spans of rows in the rows of cells j, cut to the rows' outlines."""
    lower, upper = j.astype(np.float32) - slack[1], j.astype(np.float32) + (1 + slack[1])
    low, high = outline.across(lower, upper)
    first = np.maximum(np.minimum(np.floor(low - slack[0]), columns), 0).astype(np.int32)
    last = np.minimum(np.maximum(np.floor(high + slack[0]), -1), columns - 1).astype(np.int32)
    cell = (j * columns + np.minimum(first, columns - 1)).astype(np.uint32)
    length = np.maximum(last - first + 1, 0)
    return Spans(cell.ravel(), length.ravel(), np.broadcast_to(rank, j.shape).ravel())


def ordered(spans: Spans, order: np.ndarray, cells: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """(offsets, entries) of the lists of all cells. order: the rows in the order by distance. Shape: (rows).

    Pairs are sorted by a number, the cell and then the rank of the row. They are cut into bands, neighbouring rows of
    cells, which several threads sort. The numbers are all different, so the result does not depend on the threads.
    """
    along = spans.cell // np.uint32(columns)
    count = np.bincount(along, weights=spans.length, minlength=cells // columns)
    before = np.cumsum(count) - count
    band_of = (before // BAND).astype(np.uint16)
    begins = np.searchsorted(band_of, np.arange(band_of[-1] + 2))
    band = band_of[along]
    counts, entries = np.empty(cells, np.int64), np.empty(int(count.sum()), np.uint32)

    def fill(k: int) -> None:
        first, last = begins[k] * columns, begins[k + 1] * columns
        at = np.flatnonzero(band == k)
        part = Spans(spans.cell[at] - np.uint32(first), spans.length[at], spans.rank[at])
        place = slice(int(before[begins[k]]), int(before[begins[k]]) + int(part.length.sum())) if len(at) else slice(0)
        counts[first:last], entries[place] = _sorted(part, order, int(last - first))

    with ThreadPoolExecutor() as pool:
        list(pool.map(fill, range(len(begins) - 1)))
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32), entries


def _sorted(spans: Spans, order: np.ndarray, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """(number of pairs in each cell, row of each pair in the order of the lists)."""
    bits = len(order).bit_length()
    number, index = (np.uint32, np.int32) if bits + cells.bit_length() < 32 else (np.uint64, np.int64)
    ends = np.cumsum(spans.length, dtype=number)
    # A span's numbers grow with its cells. If their common part is repeated, adding the place of each pair among all
    # pairs counts the cells. Differences may be negative; they wrap around, and so do the sums.
    common = ((spans.cell.astype(number) - (ends - spans.length.astype(number))) << number(bits)) + spans.rank
    keys = np.repeat(common, spans.length)
    place = np.arange(len(keys), dtype=number)
    place <<= number(bits)
    keys += place
    keys.sort()
    entries = order[np.bitwise_and(keys, number((1 << bits) - 1), out=place).view(index)]
    keys >>= number(bits)
    return np.bincount(keys.view(index), minlength=cells), entries
