"""The footprints of triangles on a sheet of cells (footprints.py). The corners are subtracted from the view's origin in
double, and all that follows is computed in single."""

from dataclasses import dataclass

import numpy as np

from visray.accel.cell_views import CellView
from visray.accel.footprints import Boxes, Outline, ball_boxes, facing
from visray.accel.sheet_arithmetic import along, chunks, relative
from visray.geometry import gamma

# A corner of a triangle may lie so many sheets away from the sheet. If it lies farther away, or behind the plane of the
# sheet, the footprint of the triangle's ball replaces its own.
FARTHEST = 2.0**10
# If the depths of a triangle's corners differ by more than this factor, its distance is bounded by a search.
DEEP = 1.25
STEPS = 12  # steps of this search
# The square of a shorter vector loses digits in single, so v.w / |w| is replaced by the smaller bound v.w.
SHORT = 2.0**-40


class Triangles:
    """Triangles as rows, by their corners. Shape: (n, 3) each."""

    fill = 0.5  # share of its box that a footprint fills
    smallest = 2  # a box of less than so many columns or rows of cells is not cut to the row's outline

    def __init__(self, a: np.ndarray, b: np.ndarray, c: np.ndarray):
        self.corners = tuple(np.asarray(v, float) for v in (a, b, c))

    def __len__(self) -> int:
        return len(self.corners[0])

    def seen(self, views: tuple[CellView, ...]) -> tuple[np.ndarray, np.ndarray, list[Boxes]]:
        """(least, greatest distance of each row from the origin, boxes of the rows that each view sees). For parallel
        rays the distances are depths. Shapes: (n), (n)."""
        low, high = np.empty((2, len(self)), np.float32)
        nothing = np.zeros((3, 3, 0), np.float32)
        boxes = [[_projected(v, np.zeros(0, np.uint32), nothing, nothing[0, 0])] for v in views]
        origin = views[0].origin
        for at in chunks(len(self)):
            p = np.empty((3, 3, at.stop - at.start), np.float32)
            for k, corner in enumerate(self.corners):
                p[:, k] = relative(corner[at], origin)
            least, most = p.min(axis=1), p.max(axis=1)
            # The corners are known to within gamma(32) times their sizes in double. In what is computed here, a scalar
            # product of a corner and a unit vector has an error of at most 5 u times the corner's length, in single.
            size = np.maximum(-least, most).sum(axis=0)
            rounding = np.float32(gamma(64) * 2 * np.abs(origin).sum()) + np.float32(gamma(16, "single")) * size
            low[at], high[at] = _depths(views[0], p) if views[0].parallel else (_distance(p), size)
            low[at] -= rounding
            high[at] += rounding
            row = np.arange(at.start, at.stop, dtype=np.uint32)
            for view, parts in zip(views, boxes):
                if len(views) == 1:
                    parts.append(_projected(view, row, p, rounding))
                    continue
                near = np.flatnonzero(facing(view, least - rounding, most + rounding))
                parts.append(_projected(view, row[near], p[:, :, near], rounding[near]))
        return low, high, [Boxes.joined(parts) for parts in boxes]

    def outline(self, view: CellView, numbers: np.ndarray, grid: tuple[int, int]) -> "TriangleOutline":
        """The outlines of rows. numbers: as in Boxes.outline; grid: numbers of columns and of rows of cells."""
        x, y = numbers[:3] * np.float32(grid[0]), numbers[3:6] * np.float32(grid[1])
        for p, q in ((0, 1), (1, 2), (0, 1)):  # sorts the corners by y
            swap = y[p] > y[q]
            x[p], x[q] = np.where(swap, x[q], x[p]), np.where(swap, x[p], x[q])
            y[p], y[q] = np.minimum(y[p], y[q]), np.maximum(y[p], y[q])
        edges = [
            part
            for p, q in ((0, 2), (0, 1), (1, 2))
            for part in (x[q] - x[p], 1 / np.maximum(y[q] - y[p], np.float32(2.0**-100)))
        ]
        margin = numbers[6]
        return TriangleOutline(*x[:2], *y[:2], *edges, margin * np.float32(grid[0]), margin * np.float32(grid[1]))


@dataclass(frozen=True)
class TriangleOutline(Outline):
    """Outlines of triangles, in cells, in single. The corners are sorted by y.

    x0, x1, y0, y1: the first two corners.
    dx02, dx01, dx12: differences in x of two corners.
    slope02, slope01, slope12: 1 over their differences in y.
    margin_x, margin_y: bounds on the errors of the corners and of all that is computed from them here.
    """

    x0: np.ndarray
    x1: np.ndarray
    y0: np.ndarray
    y1: np.ndarray
    dx02: np.ndarray
    slope02: np.ndarray
    dx01: np.ndarray
    slope01: np.ndarray
    dx12: np.ndarray
    slope12: np.ndarray
    margin_x: np.ndarray
    margin_y: np.ndarray

    def across(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As in Outline. The leftmost and the rightmost points of a part lie on the parts of the edges.

        Error: the three roundings of a place on an edge are as if y were shifted by 3 u (y - y0). `margin_y` contains
        this, and `margin_x` the rounding of x.
        """
        lower, upper = lower - self.margin_y, upper + self.margin_y

        def ends(x: np.ndarray, y: np.ndarray, dx: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            first, last = (x + np.minimum(np.maximum((v - y) * slope, 0), 1) * dx for v in (lower, upper))
            return np.minimum(first, last), np.maximum(first, last)

        low, high = ends(self.x0, self.y0, self.dx02, self.slope02)
        first, last = ends(self.x0, self.y0, self.dx01, self.slope01)
        meets = lower <= self.y1
        low, high = np.where(meets, np.minimum(low, first), low), np.where(meets, np.maximum(high, last), high)
        first, last = ends(self.x1, self.y1, self.dx12, self.slope12)
        meets = upper >= self.y1
        low, high = np.where(meets, np.minimum(low, first), low), np.where(meets, np.maximum(high, last), high)
        return low - self.margin_x, high + self.margin_x


def _projected(view: CellView, row: np.ndarray, p: np.ndarray, rounding: np.ndarray) -> Boxes:
    """The boxes around the footprints of triangles.

    p: corners relative to the view's origin. Shape: (3 axes, 3 corners, m).
    rounding: bound on the errors of the corners. Shape: (m).

    Error: x is the quotient of two scalar products of a corner with an axis. Let A bound the length of the numerator's
    axis. The products have errors of at most A `rounding` and `rounding`. So x has an error of at most
    (A + |x|) rounding / (z - rounding). It is limited to 1/16, so `rounding` is less than z / 2. The second term of the
    margin is for the conversion of x to single, and for the roundings of TriangleOutline: 8 u times the greatest |x|.
    """
    numerators, length = [], np.float32((1 + np.abs(view.low)).max() / view.extent.min())
    for axis, low, extent in zip((view.right, view.up), view.low, view.extent):
        if view.parallel:
            numerators.append(along(p, axis / extent) - np.float32(low / extent))
        else:
            numerators.append(along(p, axis / extent - (low / extent) * view.forward))
    with np.errstate(all="ignore"):  # corners in or behind the plane of the sheet
        if view.parallel:
            x, y, error = *numerators, rounding
        else:
            z = along(p, view.forward)
            inverse = 1 / z
            x, y = (v * inverse for v in numerators)
            nearest = z.min(axis=0)
            error = 2 * rounding / nearest
        low, high = (np.array([f(v, axis=0) for v in (x, y)]) for f in (np.min, np.max))
        farthest = np.maximum(np.maximum(-low.min(axis=0), high.max(axis=0)), 1)
        margin = error * (length + farthest) + np.float32(gamma(16, "single")) * farthest
        inside = (farthest <= FARTHEST) & (margin <= 1 / 16)
        if not view.parallel:
            inside &= nearest > 0
    outline = np.concatenate([x, y, margin[None]])
    if inside.all():
        return Boxes.of(row, low - margin, high + margin, inside, outline)
    at, others = np.flatnonzero(inside), np.flatnonzero(~inside)
    margin = margin[at]
    boxes = Boxes.of(row[at], low[:, at] - margin, high[:, at] + margin, inside[at], outline[:, at])
    return Boxes.joined([boxes, _balls(view, row[others], p[:, :, others], rounding[others])])


def _balls(view: CellView, row: np.ndarray, p: np.ndarray, rounding: np.ndarray) -> Boxes:
    """The boxes around the footprints of the triangles' balls. Parameters as in _projected."""
    middle = 0.5 * p.min(axis=1) + 0.5 * p.max(axis=1)
    radius = np.sqrt(((p - middle[:, None]) ** 2).sum(axis=0).max(axis=0))
    boxes = ball_boxes(view, row, middle, radius + rounding)
    m = len(boxes.row)
    return Boxes(boxes.row, boxes.low, boxes.high, np.zeros(m, bool), np.zeros((7, m), np.float32))


def _depths(view: CellView, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest depth of triangles. Shapes: p as in _projected, results (m)."""
    z = along(p, view.forward)
    return z.min(axis=0), z.max(axis=0)


def _distance(p: np.ndarray) -> np.ndarray:
    """Lower bounds on the distances of triangles from the origin. Shapes: p as in _projected, result (m).

    For any vector w, no point of a triangle is nearer than the least v.w / |w| of its corners v. The vector to the
    middle of the triangle gives a good bound if the triangle is small, and the vector to its nearest point the best.
    The rounding of v.w / |w| is relative to |v|.
    """
    w = p.sum(axis=1)
    heights = (p * w[:, None]).sum(axis=0)
    least = heights.min(axis=0)
    length = np.sqrt((w * w).sum(axis=0))
    bound = least / np.where(length > SHORT, length, np.float32(1))
    deep = np.flatnonzero(np.float32(DEEP) * least < heights.max(axis=0))
    if len(deep):
        bound[deep] = np.maximum(bound[deep], _searched_distance(p[:, :, deep]))
    return np.maximum(bound, 0)


def _searched_distance(p: np.ndarray) -> np.ndarray:
    """As _distance, with vectors w to points that approach the nearest point of each triangle.

    In each step w moves towards the corner with the least v.w, to the nearest point of the line between both.
    Source: Gilbert 1966; Frank and Wolfe 1956.
    """
    each = np.arange(p.shape[2])
    w, best = p[:, np.argmin((p * p).sum(axis=0), axis=0), each], np.zeros(p.shape[2], np.float32)
    for _ in range(STEPS):
        heights = (p * w[:, None]).sum(axis=0)
        corner = np.argmin(heights, axis=0)
        length = np.sqrt((w * w).sum(axis=0))
        best = np.maximum(best, heights[corner, each] / np.where(length > SHORT, length, np.float32(1)))
        step = p[:, corner, each] - w
        squared = (step * step).sum(axis=0)
        share = -(w * step).sum(axis=0) / np.where(squared > 0, squared, np.float32(1))
        w = w + np.clip(share, 0, 1) * step
    return best
