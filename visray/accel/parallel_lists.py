"""Lists of rows for parallel rays: the shadow rays of a directional light, the rays of an orthographic camera.

A row is one object, or one triangle of a mesh, in the kernel's tables. A plane across the rays is cut into cells
(cells.py). Each cell lists the rows that a ray through it can meet. The depth of a point is its coordinate along
the direction `forward`.

The rays of a far point light are nearly parallel. They use such lists too, because seen from the light all rows have
nearly the same direction. Rows then are larger by the spread of the rays: the distance by which a ray deviates from a
parallel to the middle ray, on its way from the plane to the farthest row.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.cell_views import CellView, parallel_view
from visray.accel.cells import CellLists, ball_lists, triangle_lists
from visray.accel.culling import CrossingBounds
from visray.accel.lists import BUDGET, RowLists, Sheet, balls, entry_arrays, listed_balls, points
from visray.batches import Batch
from visray.geometry import UNIT_ROUNDOFF, gamma, l1_norm
from visray.pytree import evaluated
from visray.quantities import Arrays

# A point light is far if it is so many times as far away as the rows extend. Its rays are then nearly parallel.
FAR = 256.0


@dataclass(frozen=True)
class Place:
    """The place of parallel rays on the sheet of cells, in single precision.

    at: (x, y, 1): coordinates of the ray's origin along right and up
    depth: its depth
    squared_reach: square of a bound on the distance between the ray's origin and the rows
    """

    at: Any
    depth: Any
    squared_reach: Any


@dataclass(frozen=True)
class ParallelBallGuard:
    """The guard of a row in its bounding ball for parallel rays, in single precision.

    x, y: the ball's centre on the sheet
    radius: radius of the ball
    far: upper bound of the row's depth
    error: bound on the error of a distance on the sheet
    """

    x: Any
    y: Any
    radius: Any
    far: Any
    error: Any

    def _squared_distance(self, place: Place) -> Any:
        x, y = place.at.x - self.x, place.at.y - self.y
        return x * x + y * y

    def may_hit(self, place: Place, _: Any = None) -> Any:
        """Whether a ray may meet the ball."""
        return self._squared_distance(place) <= dr.square(self.radius * (1 + gamma(8, "single")) + self.error)

    def bounds(self, place: Place) -> CrossingBounds:
        """What is known of the first crossing with the ball itself; `high` is a depth."""
        radius = self.radius * (1 - gamma(8, "single")) - self.error
        sure = (radius > 0) & (self._squared_distance(place) < dr.square(radius))
        return CrossingBounds(sure, None, self.far)


@dataclass(frozen=True)
class ParallelTriangleGuard:
    """The guard of a triangle for parallel rays, in single precision.

    bc, ca, ab: the products of these vectors and (x, y, 1) are the barycentric coordinates of the point (x, y)
    margin: bound on the errors of these products in single; inf if the triangle is seen from its edge
    stretch: bound on the error of the exact test of these coordinates, for a ray of length 1. It grows with the square
        of the length
    far: upper bound of the triangle's depth
    """

    bc: Any
    ca: Any
    ab: Any
    margin: Any
    stretch: Any
    far: Any

    def _least(self, place: Place) -> Any:
        x, y, z = (dr.dot(n, place.at) for n in (self.bc, self.ca, self.ab))
        return dr.minimum(dr.minimum(x, y), z)

    def _error(self, place: Place) -> Any:
        return self.margin + self.stretch * place.squared_reach

    def may_hit(self, place: Place, _: Any = None) -> Any:
        """Whether a ray may meet the triangle."""
        return self._least(place) >= -self._error(place)

    def bounds(self, place: Place) -> CrossingBounds:
        """What is known of the crossing; `high` is a depth."""
        return CrossingBounds(self._least(place) >= self._error(place), None, self.far)


@dataclass(frozen=True)
class ParallelRowLists(RowLists):
    """The lists of one batch for parallel rays. error: as in ParallelBallGuard."""

    error: Any = None

    def guard(self, a: Arrays, row: Any) -> ParallelBallGuard | ParallelTriangleGuard:
        """The guard of a row of the batch, for each lane."""
        p = [dr.gather(a.Q32, packet, row) for packet in self.packets]
        if not self.triangular:
            return ParallelBallGuard(*p[0], self.error)
        vectors = (p[0].x, p[0].y, p[0].z), (p[0].w, p[1].x, p[1].y), (p[1].z, p[1].w, p[2].x)
        return ParallelTriangleGuard(*(a.V32(*v) for v in vectors), p[2].y, p[2].z, p[2].w)


@dataclass(frozen=True)
class ParallelLists:
    """The lists of all batches for parallel rays.

    batches: for each batch its lists; None for batches that are not in lists
    origin: the point that coordinates are relative to, in double
    right, up, forward: unit vectors of the sheet, in double
    size: bound on the distance between `origin` and all rows, plus the size of their coordinates; in single
    against: whether rays run against `forward`, from their origin to less depth
    distance: for rays to a point light, distance of the light from the plane, in double; None for parallel rays
    """

    batches: tuple[ParallelRowLists | None, ...]
    origin: Any
    right: Any
    up: Any
    forward: Any
    size: Any
    against: bool
    distance: Any = None

    def place(self, a: Arrays, o: Any) -> Place:
        """The place of rays that start at o, in double."""
        p = o - self.origin
        x, y, depth = (dr.dot(p, v) for v in (self.right, self.up, self.forward))
        if self.distance is not None:
            # Where the ray to the light meets the plane. In front of the light there is no such ray.
            scale = self.distance / dr.maximum(self.distance + depth, 2.0**-20 * self.distance)
            x, y = x * scale, y * scale
        x, y, depth = a.F32(x), a.F32(y), a.F32(depth)
        reach = a.F32(l1_norm(p)) + self.size
        return Place(a.V32(x, y, 1), depth, reach * reach * (1 + gamma(8, "single")))

    def farthest(self, place: Place, t: Any) -> Any:
        """The depth beyond which rows do not count for rays up to the distance t, in single."""
        if self.against:
            return place.depth
        return place.depth + t + gamma(4, "single") * (dr.abs(place.depth) + t)


def far_light(batches: tuple[Batch, ...], listed: tuple[int, ...], position: Any) -> tuple[Any, float] | None:
    """(direction from a point light to the middle of all rows in lists, distance of the middle) if the light is far
    from the rows, compared to their extent; else None."""
    if not listed:
        return None
    middle, extent = _extent(*listed_balls(batches, listed))
    to_middle = middle - points(position)[0]
    distance = np.linalg.norm(to_middle)
    return (to_middle, float(distance)) if distance > FAR * extent else None


def _extent(centre: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, float]:
    """(middle of n balls, greatest distance of their points from it)."""
    middle = 0.5 * ((centre - radius[:, None]).min(axis=0) + (centre + radius[:, None]).max(axis=0))
    return middle, float((np.linalg.norm(centre - middle, axis=1) + radius).max())


def parallel_lists(
    a: Arrays, batches: tuple[Batch, ...], listed: tuple[int, ...], direction: Any, against: bool,
    distance: float | None = None,
) -> ParallelLists | None:  # fmt: skip
    """The lists for rays in one direction; None if no batch is in lists.

    listed: numbers of the batches in lists
    direction: direction of depth. Shape: (3)
    against, distance: as in ParallelLists; `distance` is that of the middle of all rows
    """
    if not listed:
        return None
    centre, radius = listed_balls(batches, listed)
    spread = 0.0
    if distance is not None:
        # A row is at most `deep` away from the plane, and a ray deviates by at most the angle deep / distance.
        _, deep = _extent(centre, radius)
        spread = 2 * deep * deep / (distance - deep)
    view = parallel_view(direction, centre, radius + spread)
    size = np.abs(centre - view.origin).sum(axis=1).max(initial=0) + radius.max(initial=0) + np.abs(view.origin).sum()
    vectors = [a.put(a.W, np.asarray(v)[:, None]) for v in (view.origin, view.right, view.up, view.forward)]
    lists = tuple(_lists_of(a, b, view, vectors, size, spread) if i in listed else None for i, b in enumerate(batches))
    far = None if distance is None else dr.opaque(a.D, distance)
    return ParallelLists(lists, *vectors, dr.opaque(a.F32, float(size)), against, far)


def _lists_of(
    a: Arrays, batch: Batch, view: CellView, vectors: list, size: float, spread: float
) -> ParallelRowLists:  # fmt: skip
    """The lists of one batch.

    vectors: origin, right, up and forward of the view, in double
    size: as in ParallelLists
    spread: length by which rows are larger
    """
    triangular = batch.kind.triangular
    extent = float(max(np.abs(view.low).max(), np.abs(view.high).max()))
    error = 8 * UNIT_ROUNDOFF["single"] * extent + gamma(64) * size + spread
    centre, radius = balls(batch)
    if triangular:
        corners = batch.kind.corners(batch.placed)
        if spread:
            lists = ball_lists((view,), centre, radius + spread, BUDGET)
        else:
            lists = triangle_lists((view,), *(points(x) for x in corners), BUDGET)
        # As opaque data, so that other numbers compile no new kernel.
        sizes = (dr.opaque(a.D, float(x)) for x in (extent, spread))
        packets = _triangle_packets(a, corners, vectors, *sizes, lists)
    else:
        lists = ball_lists((view,), centre, radius + spread, BUDGET)
        p = batch.centre - vectors[0]
        radius = a.F32(batch.radius) + dr.zeros(a.F32, len(batch))
        four = (a.F32(dr.dot(p, vectors[1])), a.F32(dr.dot(p, vectors[2])), radius, a.put(a.F32, lists.far))
        packets = (dr.ravel(a.Q32(*four)),)
    sheet = replace(Sheet.of(a, lists), right=None, up=None, forward=None)
    error, screens = dr.opaque(a.F32, float(error)), triangular or batch.is_ball
    return evaluated(ParallelRowLists(sheet, *entry_arrays(a, lists), packets, triangular, screens, error))


def _triangle_packets(
    a: Arrays, corners: tuple, vectors: list, extent: Any, spread: Any, lists: CellLists
) -> tuple:  # fmt: skip
    """The numbers of ParallelTriangleGuard for all triangles, as three arrays of packets of four.

    Error: u is the unit roundoff of single. A product n . (x, y, 1) has at most 8 rounding errors of single, relative
    to |n.x| |x| + |n.y| |y| + |n.z|; the margin allows 16. The exact test computes the same signs from corners
    relative to the ray's origin, with an error of at most gamma(42) L^2 over the doubled area on the sheet, where L
    is a bound on the distance of the corners (triangle_guard). Rounding may hide the area if it is below 2^-23 times
    the square of the longest side; then the guard rejects nothing and is never sure. The spread of the rays changes a
    product by at most |n.x| + |n.y| times the spread.
    """
    origin, right, up, _ = vectors
    (ax, ay), (bx, by), (cx, cy) = ((dr.dot(v - origin, right), dr.dot(v - origin, up)) for v in corners)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    longest = dr.maximum(dr.maximum(dr.squared_norm(corners[1] - corners[0]), dr.squared_norm(corners[2] - corners[0])),
                         dr.squared_norm(corners[2] - corners[1]))  # fmt: skip
    hidden = ~(dr.abs(area) > 2.0**-23 * longest)
    scale = dr.rcp(dr.select(hidden, 1, area))
    rows, margin = [], dr.zeros(a.D, dr.width(area))
    for (px, py), (qx, qy) in (((bx, by), (cx, cy)), ((cx, cy), (ax, ay)), ((ax, ay), (bx, by))):
        n = [dr.select(hidden, 0, k * scale) for k in (py - qy, qx - px, px * qy - py * qx)]
        slope = dr.abs(n[0]) + dr.abs(n[1])
        bound = slope * extent + dr.abs(n[2])
        margin = dr.maximum(margin, 16 * UNIT_ROUNDOFF["single"] * bound + slope * spread)
        rows += [a.F32(k) for k in n]
    margin = a.F32(dr.select(hidden, dr.inf, margin * (1 + gamma(2, "single"))))
    stretch = a.F32(dr.select(hidden, 0, gamma(64) * dr.abs(scale)))
    rows += [margin, stretch, a.put(a.F32, lists.far)]
    return tuple(dr.ravel(a.Q32(*rows[k : k + 4])) for k in (0, 4, 8))
