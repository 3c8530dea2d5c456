"""Footprints: which part of a sheet of cells the rays to a ball or a triangle can pass.

A footprint is computed in double. It contains the exact footprint of the row, grown by the rounding bound of the row's
own exact test. The sheet's coordinates are scaled here so that the sheet is the square from 0 to 1.
"""

from dataclasses import dataclass

import numpy as np

from visray.accel.cell_views import CellView, tangent_slopes
from visray.geometry import gamma

CHUNK = 1 << 14  # number of rows that are worked on at once; so many fit in the processor's cache
# A corner of a triangle may lie so many sheets away from the sheet. If it lies farther away, or behind the plane of the
# sheet, the footprint of the triangle's ball replaces its own.
FARTHEST = 2.0**10


@dataclass(frozen=True)
class Boxes:
    """Boxes around the footprints of the rows that a sheet sees.

    row: numbers of the rows. Shape: (m).
    low, high: corners of the boxes, in single, rounded outwards; within -1 and 2. Shape: (2, m).
    projected: masks of the rows whose corners have all been projected; only triangles have such rows. Shape: (m).
    """

    row: np.ndarray
    low: np.ndarray
    high: np.ndarray
    projected: np.ndarray

    @staticmethod
    def of(row: np.ndarray, low: list, high: list, projected: np.ndarray) -> "Boxes":
        """The boxes that overlap the square from -1 to 2."""
        seen = (low[0] < 2) & (low[1] < 2) & (high[0] > -1) & (high[1] > -1)
        if not seen.all():
            row, projected = row[seen], projected[seen]
            low, high = [x[seen] for x in low], [x[seen] for x in high]
        outwards = 2 * gamma(2, "single")
        low = np.maximum(np.array(low), -1) - outwards
        high = np.minimum(np.array(high), 2) + outwards
        return Boxes(row.astype(np.uint32), low.astype(np.float32), high.astype(np.float32), projected)

    @staticmethod
    def joined(boxes: list["Boxes"]) -> "Boxes":
        """The boxes of several records as one."""
        return Boxes(
            np.concatenate([b.row for b in boxes]),
            np.concatenate([b.low for b in boxes], axis=1),
            np.concatenate([b.high for b in boxes], axis=1),
            np.concatenate([b.projected for b in boxes]),
        )


def no_boxes() -> Boxes:
    """No boxes at all."""
    return Boxes(np.zeros(0, np.uint32), *(np.zeros((2, 0), np.float32) for _ in range(2)), np.zeros(0, bool))


def rounded_down(x: np.ndarray) -> np.ndarray:
    """The greatest single-precision numbers below x, or x itself less one step."""
    return np.nextafter(x.astype(np.float32), np.float32(-np.inf))


def coordinates(view: CellView, p: np.ndarray) -> list[np.ndarray]:
    """Points relative to the view's origin, along right, up and forward. Shapes: p (m, 3), result three of (m)."""
    x, y, z = (np.subtract(p[:, k], view.origin[k]) for k in range(3))
    return [x * v[0] + y * v[1] + z * v[2] for v in (view.right, view.up, view.forward)]


@dataclass(frozen=True)
class Balls:
    """Balls as rows. Shapes: centre (n, 3), radius (n)."""

    centre: np.ndarray
    radius: np.ndarray
    fill = 0.8  # share of its box that a footprint fills, about pi / 4

    def __len__(self) -> int:
        return len(self.radius)

    def grown(self, view: CellView) -> np.ndarray:
        """The radii, grown by the rounding bound of the centres and radii (gamma(32) of their sizes) and of all that
        is computed from them here. Shape: (n)."""
        size = np.abs(self.centre).sum(axis=1) + self.radius + np.abs(view.origin).sum()
        return self.radius + gamma(64) * size

    def range(self, view: CellView) -> tuple[np.ndarray, np.ndarray]:
        """Bounds on the distance of the rows from the view's origin; for parallel rays on their depth. Shape: (n)."""
        x, y, z = coordinates(view, self.centre)
        middle = z if view.parallel else np.sqrt(x * x + y * y + z * z)
        radius = self.grown(view)
        return middle - radius, middle + radius

    def boxes(self, view: CellView) -> Boxes:
        """The boxes around the rows' footprints."""
        x, y, z = coordinates(view, self.centre)
        radius = self.grown(view)
        low, high, seen = ball_box(view, x, y, z, radius)
        row = np.flatnonzero(seen)
        low, high = [v[seen] for v in low], [v[seen] for v in high]
        return Boxes.of(row, low, high, np.zeros(len(row), bool))

    def spans(self, view: CellView, row: np.ndarray, projected: np.ndarray) -> None:
        """A ball has no footprint that is narrower than its box."""


def ball_box(view: CellView, x: np.ndarray, y: np.ndarray, z: np.ndarray, radius: np.ndarray) -> tuple:
    """The corners of the boxes around footprints of balls, and the mask of the balls that are not behind the view.

    x, y, z: centres along right, up and forward. Shape: (m).
    """
    low, high = [], []
    for k, v in enumerate((x, y)):
        first, last = (v - radius, v + radius) if view.parallel else tangent_slopes(v, z, radius)
        low.append((first - view.low[k]) / view.extent[k])
        high.append((last - view.low[k]) / view.extent[k])
    return low, high, np.ones(len(x), bool) if view.parallel else z + radius > 0


@dataclass(frozen=True)
class Triangles:
    """Triangles as rows, by their corners. Shape: (n, 3) each."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    fill = 0.5  # share of its box that a footprint fills

    def __len__(self) -> int:
        return len(self.a)

    def range(self, view: CellView) -> tuple[np.ndarray, np.ndarray]:
        """Bounds on the distance of the rows from the view's origin; for parallel rays on their depth. Shape: (n).

        A point of a triangle is the sum of its corners v with weights w that add up to 1. So its squared distance is
        the sum of w |v|^2, less the sum over the edges of the product of two weights and the edge's squared length.
        The weights' products add up to at most 1/3. So the squared distance is at least the least |v|^2 minus a third
        of the longest edge's squared length.
        """
        low, high = np.empty(len(self)), np.empty(len(self))
        for begin in range(0, len(self), CHUNK):
            at = slice(begin, begin + CHUNK)
            low[at], high[at] = self._range(view, at)
        return low, high

    def _range(self, view: CellView, at: slice) -> tuple[np.ndarray, np.ndarray]:
        corners = [coordinates(view, v[at]) for v in (self.a, self.b, self.c)]
        depth = [v[2] for v in corners]
        least, most = np.minimum.reduce(depth), np.maximum.reduce(depth)
        squares = [x * x + y * y + z * z for x, y, z in corners]
        farthest = np.sqrt(np.maximum.reduce(squares))
        rounding = gamma(64) * (2 * np.abs(view.origin).sum() + 2 * farthest)
        if view.parallel:
            return least - rounding, most + rounding
        edges = [
            (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2
            for p, q in zip(corners, corners[1:] + corners[:1])
        ]
        square = np.minimum.reduce(squares) - np.maximum.reduce(edges) / 3
        near = np.sqrt(np.maximum(square - gamma(16) * farthest * farthest, 0))
        return np.maximum(near, least) - rounding, farthest + rounding

    def boxes(self, view: CellView) -> Boxes:
        """The boxes around the rows' footprints."""
        parts = [self._boxes(view, k) for k in range(0, len(self), CHUNK)]
        return Boxes.joined(parts) if parts else no_boxes()

    def _boxes(self, view: CellView, begin: int) -> Boxes:
        row = np.arange(begin, min(begin + CHUNK, len(self)))
        x, y, margin, projected = projected_corners(view, *(v[row] for v in (self.a, self.b, self.c)))
        with np.errstate(invalid="ignore"):
            low = [np.minimum.reduce(v) - m for v, m in zip((x, y), margin)]
            high = [np.maximum.reduce(v) + m for v, m in zip((x, y), margin)]
        if projected.all():
            return Boxes.of(row, low, high, projected)
        low, high = [v[projected] for v in low], [v[projected] for v in high]
        boxes = Boxes.of(row[projected], low, high, projected[projected])
        return Boxes.joined([boxes, self._ball_boxes(view, row[~projected])])

    def _ball_boxes(self, view: CellView, row: np.ndarray) -> Boxes:
        """The boxes of the balls around rows."""
        corners = [v[row] for v in (self.a, self.b, self.c)]
        middle = 0.5 * np.minimum.reduce(corners) + 0.5 * np.maximum.reduce(corners)
        radius = np.sqrt(np.max([((v - middle) ** 2).sum(axis=1) for v in corners], axis=0))
        boxes = Balls(middle, radius * (1 + gamma(8))).boxes(view)
        return Boxes(row[boxes.row].astype(np.uint32), boxes.low, boxes.high, boxes.projected)

    def spans(self, view: CellView, row: np.ndarray, projected: np.ndarray) -> tuple:
        """The corners of projected rows on the sheet, and their rounding bounds: (x, y, margin).

        x, y: coordinates of the three corners. Shape: (3, m).
        margin: bounds on the errors of x and of y. Shape: (2, m).
        """
        x, y, margin, _ = projected_corners(view, *(v[row] for v in (self.a, self.b, self.c)))
        return np.array(x), np.array(y), np.array(margin)


def projected_corners(view: CellView, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple:
    """The corners of triangles on the sheet, from 0 to 1: (x, y, margin, projected).

    x, y: coordinates of the three corners. Shape: three of (m).
    margin: bounds on the errors of the coordinates x and y, which include those of the corners. Shape: two of (m).
    projected: mask of the triangles for which this makes sense: all corners are well in front of the origin and not too
        far from the sheet. Shape: (m).

    Error: a corner is known to within e = gamma(64) times its size. A slope x / z then has an error of at most
    e (1 + |x / z|) / (z - e).
    """
    corners = [coordinates(view, v) for v in (a, b, c)]
    size = np.abs(view.origin).sum()
    if view.parallel:
        along = [[v[k] for v in corners] for k in range(2)]
        most = np.maximum.reduce([np.abs(v[0]) + np.abs(v[1]) + np.abs(v[2]) for v in corners])
        error = gamma(64) * (2 * size + 2 * most)
        projected = np.ones(len(a), bool)
    else:
        least, most = (f.reduce([v[2] for v in corners]) for f in (np.minimum, np.maximum))
        with np.errstate(all="ignore"):
            along = [[v[k] / v[2] for v in corners] for k in range(2)]
            steepest = np.maximum.reduce([np.abs(v) for slopes in along for v in slopes])
            error = gamma(64) * (2 * size + 2 * most * (1 + 2 * steepest))
            projected = least > 2.0**10 * error
            error = 2 * error * (1 + steepest) / least
    x, y = ([(v - view.low[k]) / view.extent[k] for v in along[k]] for k in range(2))
    projected &= np.maximum.reduce([np.abs(v) for v in x + y]) <= FARTHEST
    return x, y, [error / extent for extent in view.extent], projected
