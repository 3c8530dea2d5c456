"""Guards: tests in single precision that reject most rays before a row is tested in double.

A row is one object in the kernel's tables. A guard never rejects a ray that hits in the exact test (in double), because
the guard has a margin that is greater than its own rounding error.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.batches import Batch
from visray.geometry import UNIT_ROUNDOFF, gamma, l1_norm
from visray.quantities import Arrays


@dataclass(frozen=True)
class DirectionCone:
    """A cone of directions from an origin, in single precision: for example the directions to a light, or a hemisphere.

    axis: unit vector in the middle of the cone.
    sine, cosine: sine and cosine of the angle between the axis and the edge of the cone. The angle is at most a right
        angle. The values 0 and -1 stand for the cone of all directions.
    """

    axis: Any
    sine: Any
    cosine: Any

    @staticmethod
    def around(a: Arrays, to_centre: Any, radius: Any) -> "DirectionCone":
        """The cone of all directions from the origin to the points of a ball.

        In lanes where the origin may be inside the ball, it contains all directions.

        to_centre: vector from the origin to the centre of the ball.
        radius: radius of the ball.
        """
        to_centre, radius = a.V32(to_centre), a.F32(radius)
        distance = dr.norm(to_centre)
        divisor = dr.select(distance > 0, distance, 1)
        sine = radius / divisor
        # The quotient has the rounding errors of the conversions, the norm and the division.
        outside = (sine < 1 - gamma(8, "single")) & (distance > 0)
        # 1 - sine^2 loses no digits in this form.
        cosine = dr.select(outside, dr.sqrt((1 - sine) * (1 + sine)), -1)
        return DirectionCone(to_centre / divisor, dr.select(outside, sine, 0), cosine)


@dataclass(frozen=True)
class BallGuard:
    """The guard of a bounded row: a test of rays against the row's bounding ball, in single precision.

    Every field has one entry per row, or one entry per lane.

    to_centre: vector from the ray origin to the centre of the ball.
    least: number such that every ray that meets the ball has to_centre . d >= least. It is the length of the tangents
        from the origin to the ball, less an error bound; -inf if the origin may be inside the ball.
    """

    to_centre: Any
    least: Any

    def may_hit(self, d: Any, _: Any = None) -> Any:
        """Whether a ray may meet the ball.

        d: direction of the ray, in single. The second parameter is not used; it is there because PlaneGuard has it.
        """
        return dr.dot(self.to_centre, d) >= self.least

    def may_hit_cone(self, cone: DirectionCone) -> Any:
        """Whether some ray of a cone may meet the ball.

        Let h be the distance of the ball's centre from the origin along the cone's axis, and w its distance from the
        axis. Then the distance of the centre from the edge of the cone is w cosine - h sine, which is
        negative inside the cone. If it is at most the radius of the ball, some ray may meet the ball.

        Error: u is the unit roundoff of single. The radius is computed from radius^2 = |to_centre|^2 - least^2. Both
        squares have an error of at most 32 u |to_centre|^2. If they are nearly equal, the error of the radius can reach
        the square root of both errors together, 8 sqrt(u) |to_centre|. The slack has this size. All other errors are
        much smaller.
        """
        h = dr.dot(self.to_centre, cone.axis)
        w = dr.norm(self.to_centre - h * cone.axis)
        squared = dr.squared_norm(self.to_centre)
        slack = 8 * UNIT_ROUNDOFF["single"] ** 0.5 * dr.sqrt(squared)
        radius = dr.sqrt(dr.maximum(squared - dr.square(self.least), 0))
        return (w * cone.cosine - h * cone.sine <= radius + slack) | (self.least < 0)


def ball_guard(a: Arrays, centre: Any, radius: Any, o: Any) -> BallGuard:
    """The guard of a bounding ball, for rays that start at o.

    A ray meets the ball only if h >= T. Here h = to_centre . d, and T is the length of a tangent from o to the ball:
    T^2 = |to_centre|^2 - radius^2.

    Error: u is the unit roundoff of single. The error of h is at most 10 u |to_centre|: 4 u from a conversion and three
    roundings of the scalar product, and 6 u from d, which is normalised in single (a conversion, 3.5 u for the
    reciprocal root of |d|^2, a product). The error of T is at most 1.5 u |to_centre| (a conversion before the root, and
    the root).
    The code subtracts 24 u |to_centre|^2 from T^2. This makes T smaller by at least
    (24 u |to_centre|^2) / (2 |to_centre|) = 12 u |to_centre|, which is more than both errors together. The rest covers
    the rounding of the exact test in double. The term 2^-124 covers underflow.
    """
    to_centre = centre - o
    squared = dr.squared_norm(to_centre)
    tangent = a.F32(squared - dr.square(radius) - 24 * UNIT_ROUNDOFF["single"] * squared - 2.0**-124)
    return BallGuard(a.V32(to_centre), dr.select(tangent > 0, dr.sqrt(tangent), -dr.inf))


@dataclass(frozen=True)
class TriangleGuard:
    """The guard of a triangle for rays from one origin, in single precision. It rejects rays that pass an edge on the
    outer side, and so nearly all rays that miss the triangle.

    The three planes through the origin and the edges bound the pyramid of the rays that meet the triangle.

    bc, ca, ab: unit normals of these planes, which point into the pyramid.
    margin: bound on the error of the products of a unit direction and these normals; inf if the origin lies in the
        plane of the triangle to within rounding.
    """

    bc: Any
    ca: Any
    ab: Any
    margin: Any

    def may_hit(self, d: Any, _: Any = None) -> Any:
        """Whether a ray may meet the triangle. d: direction of the ray, in single."""
        least = -self.margin
        return (dr.dot(self.bc, d) >= least) & (dr.dot(self.ca, d) >= least) & (dr.dot(self.ab, d) >= least)

    def packets(self, a: Arrays) -> tuple[Any, Any, Any]:
        """The guards of all rows as three arrays of packets of four numbers, which a loop reads at once."""
        bc, ca, ab, margin = self.bc, self.ca, self.ab, self.margin
        fours = (bc.x, bc.y, bc.z, ca.x), (ca.y, ca.z, ab.x, ab.y), (ab.z, margin, margin, margin)
        return tuple(dr.ravel(a.Q32(*four)) for four in fours)

    @staticmethod
    def unpacked(a: Arrays, p: Any, q: Any, r: Any) -> "TriangleGuard":
        """The guard whose packets are p, q and r."""
        return TriangleGuard(a.V32(p.x, p.y, p.z), a.V32(p.w, q.x, q.y), a.V32(q.z, q.w, r.x), r.y)


def triangle_guard(a: Arrays, corners: tuple[Any, Any, Any], o: Any) -> TriangleGuard:
    """The guards of triangles for rays that start at o.

    corners: the corners a, b, c of each triangle, in double.

    Error: u is the unit roundoff of single. The exact test (Triangle.intersect_plane) computes k d . (b x c) in double
    for corners relative to o, where k is the largest component of d, at least 1 / sqrt(3). Its products of two
    differences have an error of at most gamma(12) 2 |b| |c|. So at a crossing d . (b x c) is at least
    -gamma(42) |b| |c|. The product b x c has an error of at most gamma(8) |b| |c| here. So the unit normal n satisfies
    n . d >= -gamma(64) |b| |c| / |b x c| at a crossing. In single, n . d has 4 u from a conversion and three roundings,
    and 6 u from d (see ball_guard); the code allows 16 u.
    The volume a . (b x c) gives the side of the triangle on which o lies. If rounding hides its sign, o lies in the
    plane of the triangle, and the guard rejects nothing.
    """
    p, q, r = (x - o for x in corners)
    bc, ca, ab = dr.cross(q, r), dr.cross(r, p), dr.cross(p, q)
    volume = dr.dot(p, bc)
    lengths = dr.norm(p), dr.norm(q), dr.norm(r)
    hidden = dr.abs(volume) <= gamma(32) * lengths[0] * lengths[1] * lengths[2]
    side = dr.select(volume < 0, -1.0, 1.0)
    margin, normals = a.D(16 * UNIT_ROUNDOFF["single"]), []
    for n, x, y in ((bc, 1, 2), (ca, 2, 0), (ab, 0, 1)):
        length = dr.norm(n)
        hidden |= length == 0
        scale = side / dr.select(length > 0, length, 1)
        normals.append(a.V32(n * scale))
        own = 16 * UNIT_ROUNDOFF["single"] + gamma(64) * lengths[x] * lengths[y] * dr.abs(scale)
        margin = dr.maximum(margin, own)
    margin = a.F32(dr.select(hidden, dr.inf, margin * (1 + gamma(2, "single"))))
    return TriangleGuard(*normals, margin)


@dataclass(frozen=True)
class PlaneGuard:
    """The guard of a plane, in single precision. It rejects rays that run away from the plane or end before it.

    normal: the plane's unit normal, divided by the signed height of the ray origin above the plane. So a ray with
        direction d reaches the plane at t = 1 / (-normal . d). The zero vector if the origin lies on the plane.
    margin: bound on the error of normal . d; inf if the origin lies on the plane.
    """

    normal: Any
    margin: Any

    def may_hit(self, d: Any, reach: Any = None) -> Any:
        """Whether a ray may meet the plane.

        d: direction of the ray, in single.
        reach: length of the ray, in single; None if the ray is endless.
        """
        fall = self.margin - dr.dot(self.normal, d)
        # The difference, the product, and `reach` (if it was computed in single) have at most eight rounding errors.
        return fall >= 0 if reach is None else fall * reach >= 1 - 16 * UNIT_ROUNDOFF["single"]

    def may_hit_cone(self, cone: DirectionCone) -> Any:
        """Whether some ray of a cone may meet the plane. The ray with the least normal . d decides."""
        slope, size = dr.dot(self.normal, cone.axis), l1_norm(self.normal)
        least = dr.select(cone.cosine < 0, -size, slope * cone.cosine - size * cone.sine)
        return least <= self.margin + 8 * UNIT_ROUNDOFF["single"] * size


def plane_guard(a: Arrays, batch: Batch, o: Any) -> PlaneGuard:
    """The guards of all rows of a batch of planes, for rays that start at o.

    Error: normal . d in single has at most 13 rounding errors: four of the normal, six of d (see ball_guard) and three
    of the products and sums. Each is relative to the sum of the sizes of the three products, so a margin of 16 is
    enough.
    """
    f, g = batch.kind.surface_at(batch.placed, o)
    on = touches(batch, f, g, o)
    normal = a.V32(g) * dr.select(on, 0, dr.rcp(a.F32(dr.select(on, 1, f))))
    return PlaneGuard(normal, dr.select(on, dr.inf, 16 * UNIT_ROUNDOFF["single"] * l1_norm(normal)))


def touches(batch: Batch, f: Any, g: Any, p: Any, error: Any = 0) -> Any:
    """Whether the points p lie on the surfaces of rows of a batch, to within rounding.

    f, g: what Primitive.surface_at returns for the rows at p.
    error: bound on the distance between each point p and the true point.
    """
    return dr.abs(f) <= (point_rounding(batch, p) + error) * dr.norm(g)


def point_rounding(batch: Batch, p: Any) -> Any:
    """Bound on the rounding error of the distance between points p and the surfaces of rows of a batch."""
    return gamma(32) * (l1_norm(p) + (l1_norm(batch.placed.inverse.o) if batch.radius is None else batch.radius))
