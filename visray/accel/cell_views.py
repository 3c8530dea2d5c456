"""Sheets of cells: the directions from a point, or the positions of parallel rays, as points of a rectangle.

A ray that starts at a point is a point of a plane at distance 1 in front of it, and a ray with a fixed direction is a
point of a plane across that direction. A rectangle of such a plane, a sheet, is cut into cells (cells.py).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from visray.accel.sheet_arithmetic import along, chunks, relative, tangent_slopes
from visray.geometry import UNIT_ROUNDOFF, gamma

# Greatest slope of a pyramid that point_views chooses, as an angle. The pyramid's corners are then 2.3 times as far
# away as its middle. At greater angles the cells at its border become long and narrow.
WIDEST = np.radians(55)
# The axis of the pyramid is found from so many balls, and from those that were outermost in the tries before.
SAMPLE, TRIES = 512, 4
# Parallel rays may start up to so many times as far from the sheet's origin as the farthest point of a row. Farther
# starting points would need a greater margin, and so would fill more cells.
REACH = 64.0


@dataclass(frozen=True)
class CellView:
    """A sheet, a rectangle of directions or positions. Units: world.

    origin: apex of the pyramid of directions; for parallel rays, the point that positions are relative to. Shape: (3).
    right, up, forward: unit vectors, perpendicular to each other to within rounding. Shape: (3).
    low, high: corners of the sheet. A direction d has the coordinates (d.right / d.forward, d.up / d.forward), and a
        point p of a parallel ray has (p.right, p.up), where p is relative to the origin. Shape: (2).
    parallel: whether all rays have the direction `forward`.
    reach: for parallel rays, the greatest distance between `origin` and a point p from which the coordinates of a ray
        are computed in single precision. A ray that starts farther away must use another of its points, or compute its
        coordinates in double.
    """

    origin: np.ndarray
    right: np.ndarray
    up: np.ndarray
    forward: np.ndarray
    low: np.ndarray
    high: np.ndarray
    parallel: bool = False
    reach: float = np.inf

    @property
    def extent(self) -> np.ndarray:
        """Width and height of the sheet. Shape: (2)."""
        return self.high - self.low

    @property
    def error(self) -> np.ndarray:
        """Bound on the difference between the coordinates of a ray, computed in single, and its exact coordinates.

        Shape: (2).

        Error: u is the unit roundoff of single, X and Y are the greatest absolute coordinates of the sheet.
        A direction d is a unit vector whose components have up to 6 rounding errors. In d.right and d.forward, three
        roundings come from the products and sums, and one from the conversion of the axis. So both are within 10 u of
        their exact values. 1 / d.forward is at most W = sqrt(1 + X^2 + Y^2). A quotient x then has an error of at most
        10 u W (1 + X), and 5 u X more from the reciprocal (4 u) and the product. The rounding of the sheet's low corner
        adds u X.
        A point p of a parallel ray has a rounding error of the conversion. With the axis, the product and the sums
        these are 5 u |p|, and |p| is at most `reach`. The difference p - origin in double has an error of
        gamma(2) (|origin| + |p|) in double.
        """
        most = np.maximum(np.abs(self.low), np.abs(self.high))
        if self.parallel:
            double = gamma(8) * (np.abs(self.origin).sum() + self.reach)
            return gamma(6, "single") * self.reach + gamma(4, "single") * most + double
        return gamma(20, "single") * np.sqrt(1 + most @ most) * (1 + most)

    def slack(self, columns: int, rows_of_cells: int) -> np.ndarray:
        """Bound on the error of a ray's column and row in single, in cells, before they are rounded down. Shape: (2).

        The column is (x - low.x) * (columns / extent.x). The difference, the conversion of the factor and the product
        have a relative error of at most 3 u.
        """
        count = np.array([columns, rows_of_cells], float)
        return count * (self.error / self.extent + gamma(4, "single"))

    def finest(self) -> np.ndarray:
        """The greatest numbers of columns and of rows of cells for which the slack is at most a quarter of a cell. It
        is at least 1. Shape: (2)."""
        return np.maximum(0.25 / self.slack(1, 1), 1)


def camera_view(
    origin: np.ndarray, right: np.ndarray, up: np.ndarray, forward: np.ndarray, low: np.ndarray, high: np.ndarray
) -> CellView:
    """The sheet of a pinhole camera: rays from `origin` with slopes between `low` and `high`.

    Shapes: low and high (2,), all others (3,).
    """
    vectors = [np.array(v, float) for v in (origin, right, up, forward)]
    return _widened(CellView(*vectors, np.array(low, float), np.array(high, float)))


def point_views(origin: np.ndarray, centre: np.ndarray, radius: np.ndarray) -> tuple[CellView, ...]:
    """The sheets of all rays from a point that can meet some of n balls.

    The result is one pyramid if one was found in which all slopes are at most tan 55 degrees. Else it is the six faces
    of a cube, in the order +x, -x, +y, -y, +z, -z. A face is a sheet from -1 to 1; `right` and `up` are the two next
    axes in the cyclic order x, y, z, both positive. So on the faces +x and -x, `right` is +y and `up` is +z. A ray
    belongs to the face of the component of d with the greatest size.

    Shapes: origin (3,), centre (n, 3), radius (n).
    """
    origin, centre, radius = np.array(origin, float), np.asarray(centre, float), np.asarray(radius, float)
    sample = np.arange(0, len(radius), max(1, len(radius) // SAMPLE))
    for _ in range(TRIES):
        forward = _axis(*_grown(origin, centre[sample], radius[sample]))
        if forward is None:
            break
        view = CellView(origin, *_across(forward), forward, np.zeros(2), np.zeros(2))
        low, high, outermost = _bounds(view, centre, radius)
        if max(-low.min(), high.max()) <= np.tan(WIDEST):
            return (_widened(replace(view, low=low, high=high)),)
        sample = np.union1d(sample, outermost)
    return _cube(origin)


def parallel_view(direction: np.ndarray, centre: np.ndarray, radius: np.ndarray) -> CellView:
    """The sheet of all rays in one direction that can meet some of n balls.

    Shapes: direction (3,), centre (n, 3), radius (n).
    Domain: n >= 1; the direction is not zero.
    """
    centre, radius = np.asarray(centre, float), np.asarray(radius, float)
    forward = np.array(direction, float)
    forward /= np.linalg.norm(forward)
    origin = 0.5 * centre.min(axis=0) + 0.5 * centre.max(axis=0)
    view = CellView(origin, *_across(forward), forward, np.zeros(2), np.zeros(2), True, 1.0)
    low, high, _ = _bounds(view, centre, radius)
    far = max(np.sqrt((p * p).sum(axis=0)).max() + r.max() for p, r in _chunks(origin, centre, radius))
    return _widened(replace(view, low=low, high=high, reach=max(REACH * float(far), 2.0**-60)))


def _widened(view: CellView) -> CellView:
    """The view with a sheet that is greater by twice its own rounding error on each side. So it is never empty."""
    margin = 2 * view.error + gamma(64) * (1 + np.maximum(np.abs(view.low), np.abs(view.high)) ** 2)
    return replace(view, low=view.low - margin, high=view.high + margin)


def _grown(origin: np.ndarray, centre: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(centres relative to the origin, radii grown by the rounding bounds of both). Shapes: (3, m), (m)."""
    p = relative(centre, origin)
    return p, radius + gamma(64) * 2 * (np.abs(origin).sum() + np.abs(p).sum(axis=0) + radius)


def _chunks(origin: np.ndarray, centre: np.ndarray, radius: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """What _grown returns, for some balls at a time."""
    return (_grown(origin, centre[at], radius[at]) for at in chunks(len(radius)))


def _bounds(view: CellView, centre: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(low, high corner of the box around the footprints of balls, numbers of the balls at its sides).

    The box has infinite sides if a ball may reach behind the origin. Shapes: (2), (2), (4).
    """
    low, high, outermost, begin = np.full(2, np.inf), np.full(2, -np.inf), np.zeros(4, int), 0
    for p, r in _chunks(view.origin, centre, radius):
        z = along(p, view.forward)
        for k, axis in enumerate((view.right, view.up)):
            x = along(p, axis)
            first, last = (x - r, x + r) if view.parallel else tangent_slopes(x, z, r)
            if not view.parallel:
                first[z <= r], last[z <= r] = -np.inf, np.inf
            i, j = np.argmin(first), np.argmax(last)
            if first[i] < low[k]:
                low[k], outermost[k] = first[i], begin + i
            if last[j] > high[k]:
                high[k], outermost[2 + k] = last[j], begin + j
        begin += len(r)
    return low, high, outermost


def _cube(origin: np.ndarray) -> tuple[CellView, ...]:
    """The six faces of a cube around a point, in the order that point_views states."""
    axes = np.eye(3)
    ones = np.ones(2)
    return tuple(
        CellView(origin, axes[(k + 1) % 3], axes[(k + 2) % 3], sign * axes[k], -ones, ones)
        for k in range(3)
        for sign in (1.0, -1.0)
    )


def _axis(to_centre: np.ndarray, radius: np.ndarray) -> np.ndarray | None:
    """A direction from which all balls lie within the angle WIDEST, or None if none was found. Shape: (3).

    The direction is turned by ever smaller steps towards the ball that is farthest from it.
    Source: Badoiu and Clarkson 2003.

    Shapes: to_centre (3, m), radius (m).
    """
    distance = np.sqrt((to_centre * to_centre).sum(axis=0))
    if not len(radius) or not np.all(distance > radius):
        return None
    directions, half = to_centre / distance, np.arcsin(radius / distance)
    axis, best, least = directions.mean(axis=1), None, WIDEST
    for step in range(1, 33):
        length = np.linalg.norm(axis)
        if length < UNIT_ROUNDOFF["single"]:
            break
        axis = axis / length
        angle = np.arccos(np.clip(along(directions, axis), -1, 1)) + half
        farthest = int(np.argmax(angle))
        if angle[farthest] < least:
            best, least = axis, angle[farthest]
        axis = axis + (directions[:, farthest] - axis) / (step + 1)
    return best


def _across(forward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors right and up, perpendicular to a unit vector and to each other. Shape: (3) each."""
    least = np.zeros(3)
    least[np.argmin(np.abs(forward))] = 1
    right = np.cross(forward, least)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    return right, up / np.linalg.norm(up)
