"""The footprints of triangles on a sheet of cells (footprints.py). The corners are subtracted from the view's origin in
double, and all that follows is computed in single."""

from dataclasses import dataclass

import numpy as np

from visray.accel.cell_views import CellView
from visray.accel.footprints import Boxes, Outline, ball_boxes, facing
from visray.accel.sheet_arithmetic import along, chunks, relative, taken, triangle_distance
from visray.geometry import gamma

# A corner of a triangle may lie so many sheets away from the sheet. If it lies farther away, or behind the plane of the
# sheet, only a box around its footprint is known.
FARTHEST = 2.0**10


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
        parts = [self._seen(views, at) for at in chunks(max(1, len(self)))]
        low, high = (np.concatenate([p[k] for p in parts]) for k in range(2))
        return low, high, [Boxes.joined([p[2][k] for p in parts]) for k in range(len(views))]

    def _seen(self, views: tuple[CellView, ...], at: slice) -> tuple[np.ndarray, np.ndarray, list[Boxes]]:
        """What `seen` returns for some rows."""
        origin, row = views[0].origin, np.arange(at.start, min(at.stop, len(self)), dtype=np.uint32)
        p = np.empty((3, 3, len(row)), np.float32)
        for k, corner in enumerate(self.corners):
            p[:, k] = relative(corner[at], origin)
        least, most = p.min(axis=1), p.max(axis=1)
        # The corners are known to within gamma(32) times their sizes in double. In what is computed here, a scalar
        # product of a corner and a unit vector has an error of at most 5 u times the corner's length, in single.
        size = np.maximum(-least, most).sum(axis=0)
        rounding = np.float32(gamma(64) * 2 * np.abs(origin).sum()) + np.float32(gamma(16, "single")) * size
        low, high = _depths(views[0], p) if views[0].parallel else (triangle_distance(p), size)
        low, high = low - rounding, high + rounding
        if len(views) == 1:
            return low, high, [_boxes(views[0], row, p, rounding, low)]
        boxes = []
        for view in views:
            to = np.flatnonzero(facing(view, least - rounding, most + rounding))
            boxes.append(_boxes(view, row[to], taken(p, to), rounding[to], low[to]))
        return low, high, boxes

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


def _boxes(view: CellView, row: np.ndarray, p: np.ndarray, rounding: np.ndarray, near: np.ndarray) -> Boxes:
    """The boxes around the footprints of triangles.

    p: corners relative to the view's origin. Shape: (3 axes, 3 corners, m).
    rounding: bound on the errors of the corners. Shape: (m).
    near: lower bound on the triangles' distances. Shape: (m).
    """
    x, y, z, margin = _projected(view, p, rounding)
    ends = [[f(v, axis=0) for v in (x, y)] for f in (np.min, np.max)]
    low, high, margin = np.array(ends[0]), np.array(ends[1]), margin.max(axis=0)
    inside = (z.min(axis=0) > 0) & (np.maximum(-low, high).max(axis=0) <= FARTHEST) & (margin <= 1 / 16)
    outline = np.concatenate([x, y, margin[None]])
    if inside.all():
        return Boxes.of(row, low - margin, high + margin, inside, outline)
    at, others = np.flatnonzero(inside), np.flatnonzero(~inside)
    margin = margin[at]
    boxes = Boxes.of(row[at], taken(low, at) - margin, taken(high, at) + margin, inside[at], taken(outline, at))
    return Boxes.joined([boxes, _clipped(view, row[others], taken(p, others), rounding[others], near[others])])


def _projected(view: CellView, p: np.ndarray, rounding: np.ndarray) -> tuple[np.ndarray, ...]:
    """(x, y, depth, margin) of points on the sheet. The depth is 1 for parallel rays.

    p: points relative to the view's origin. Shape: (3 axes, k, m).
    rounding: bound on the errors of the points. Shape: (m).
    margin: bound on the errors of x and y, if the depth is positive and the bound at most 1/4. Shape: (k, m).

    Error: x is the quotient of two scalar products of a point with an axis. Let A bound the length of the numerator's
    axis. The products have errors of at most A `rounding` and `rounding`. So x has an error of at most
    (A + |x|) rounding / (z - rounding), which is at most twice as much with z in place of z - rounding. The second term
    of the margin is for the roundings of x, also those in TriangleOutline: 8 u times the greatest |x|.
    """
    length = np.float32((1 + np.abs(view.low)).max() / view.extent.min())
    z = np.ones_like(p[0]) if view.parallel else along(p, view.forward)
    result = []
    with np.errstate(all="ignore"):  # corners in or behind the plane of the sheet
        inverse = 1 / z
        for axis, low, extent in zip((view.right, view.up), view.low, view.extent):
            if view.parallel:
                result.append(along(p, axis / extent) - np.float32(low / extent))
            else:
                result.append(along(p, axis / extent - (low / extent) * view.forward) * inverse)
        farthest = np.maximum(np.abs(result[0]), np.abs(result[1]))
        margin = 2 * rounding * inverse * (length + farthest) + np.float32(gamma(16, "single")) * (1 + farthest)
    return *result, z, margin


def _clipped(view: CellView, row: np.ndarray, p: np.ndarray, rounding: np.ndarray, near: np.ndarray) -> Boxes:
    """The boxes around the footprints of triangles that reach behind the plane of the sheet. Parameters as in _boxes.

    A direction within half a sheet of the sheet has d.forward >= 1 / W, where W = sqrt(1 + X^2 + Y^2). So the triangle
    can be met only at depths of at least near / W, and the part before that depth is cut off.

    Error: the point where an edge is cut has the depth of the cut to within 4 `rounding`, and an error of 2 `rounding`
    across the edge. So the cut is made earlier by 4 `rounding`. If that leaves nothing, the triangle's ball is taken.
    """
    most = np.maximum(np.abs(view.low), np.abs(view.high)) + view.extent / 2
    cut = near / np.float32(np.sqrt(1 + most @ most) * (1 + gamma(4, "single"))) - 4 * rounding
    clear = (cut > 32 * rounding) & (not view.parallel)
    at, others = np.flatnonzero(clear), np.flatnonzero(~clear)
    balls = _balls(view, row[others], taken(p, others), rounding[others])
    p, cut, rounding = taken(p, at), cut[at], rounding[at]
    q, z = p[:, [1, 2, 0]], along(p, view.forward)
    ahead = z >= cut
    crosses = ahead != ahead[[1, 2, 0]]
    fall = np.where(crosses, z - z[[1, 2, 0]], 1)
    points = np.concatenate([p, p + np.clip((z - cut) / fall, 0, 1) * (q - p)], axis=1)
    x, y, _, margin = _projected(view, points, 2 * rounding)
    real = np.concatenate([ahead, crosses])
    # A point that is left out may be infinitely far away.
    x, y, margin = (np.where(real, v, 0) for v in (x, y, margin))
    low = np.array([np.where(real, v - margin, np.inf).min(axis=0) for v in (x, y)])
    high = np.array([np.where(real, v + margin, -np.inf).max(axis=0) for v in (x, y)])
    nothing = np.zeros((7, len(at)), np.float32)
    return Boxes.joined([balls, Boxes.of(row[at], low, high, np.zeros(len(at), bool), nothing)])


def _balls(view: CellView, row: np.ndarray, p: np.ndarray, rounding: np.ndarray) -> Boxes:
    """The boxes around the footprints of the triangles' balls. Parameters as in _boxes."""
    p = p.astype(float)
    middle = 0.5 * p.min(axis=1) + 0.5 * p.max(axis=1)
    radius = np.sqrt(((p - middle[:, None]) ** 2).sum(axis=0).max(axis=0))
    boxes = ball_boxes(view, row, middle, radius + rounding)
    m = len(boxes.row)
    return Boxes(boxes.row, boxes.low, boxes.high, np.zeros(m, bool), np.zeros((7, m), np.float32))


def _depths(view: CellView, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest depth of triangles. Shapes: p as in _projected, results (m)."""
    z = along(p, view.forward)
    return z.min(axis=0), z.max(axis=0)
