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
class CrossingBounds:
    """What a guard knows of the first crossing of a ray with a row's surface, in single precision.

    sure: mask of the rays that surely cross the surface, in the exact test too
    low, high: bounds of the distance of the crossing, as the exact test finds it. Domain: rays that are sure
    """

    sure: Any
    low: Any
    high: Any


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

    def bounds(self, d: Any) -> CrossingBounds:
        """What is known of the first crossing with the ball itself. d: direction of the ray, in single.

        The crossing is at h - sqrt(x), for h = to_centre . d and x = h^2 - T^2 with the length T of the tangents.

        Error: u is the unit roundoff of single, and q = |to_centre|^2. The error of h is at most 10 u sqrt(q) (see
        ball_guard), so that of h^2 is at most 21 u q. The square of `least` is below T^2 by at most 30 u q. With the
        roundings of both squares and of the difference, x has an error of at most 64 u q. Where x is more than four
        times as large, its root has an error of at most 64 u q / sqrt(x). The bounds allow 16 u sqrt(q) for h and all
        that is left.
        """
        u = UNIT_ROUNDOFF["single"]
        h, q = dr.dot(self.to_centre, d), dr.squared_norm(self.to_centre)
        x = h * h - self.least * self.least
        root = dr.sqrt(dr.maximum(x, 0))
        error = 64 * u * q / root + 16 * u * dr.sqrt(q)
        low, high = h - root - error, h - root + error
        # The first two comparisons are false if the origin may be inside the ball, because `least` is then -inf.
        return CrossingBounds((self.least > 0) & (x > 256 * u * q) & (h > 0) & (low > 0), low, high)

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
    """The guard of a triangle for rays from one origin, in single precision. It rejects nearly all rays that miss the
    triangle, and knows of most others that they hit it, and where.

    Seen from the origin, the corners a, b, c of a triangle are a base of space. In this base, a direction d has the
    coordinates n . d, for three vectors n. A ray meets the triangle if none of them is negative; their sum is 1 / t.

    bc, ca, ab: the vectors n for the corners a, b and c: b x c, c x a and a x b, divided by the volume a . (b x c)
    margin: for each of the products n . d, a bound on its error, as a vector; inf if rounding may hide the volume
    """

    bc: Any
    ca: Any
    ab: Any
    margin: Any

    def coordinates(self, d: Any) -> tuple[Any, Any, Any]:
        """The coordinates of a direction d, in single."""
        return dr.dot(self.bc, d), dr.dot(self.ca, d), dr.dot(self.ab, d)

    def may_hit(self, d: Any, _: Any = None) -> Any:
        """Whether a ray may meet the triangle. d: direction of the ray, in single."""
        x, y, z = self.coordinates(d)
        return (x >= -self.margin.x) & (y >= -self.margin.y) & (z >= -self.margin.z)

    def bounds(self, d: Any) -> "CrossingBounds":
        """What is known of the crossing. d: direction of the ray, in single.

        Error: the sum of the coordinates has the errors of all three, and two roundings. 1 / t has one more.
        """
        x, y, z = self.coordinates(d)
        total, error = x + y + z, self.margin.x + self.margin.y + self.margin.z
        error += gamma(4, "single") * total
        sure = (x >= self.margin.x) & (y >= self.margin.y) & (z >= self.margin.z) & (total > 2 * error)
        low = dr.rcp(total + error) * (1 - gamma(8, "single"))
        high = dr.rcp(total - error) * (1 + gamma(8, "single"))
        return CrossingBounds(sure, low, high)

    def cosine(self, d: Any) -> Any:
        """Lower bound of the cosine of the angle between a direction d and the triangle's normal. Domain: the triangle
        is surely hit.

        The distance of the origin from the triangle's plane is 1 / |bc + ca + ab|, which is at least
        1 / (|bc| + |ca| + |ab|), and t times the cosine is this distance. Each margin is more than 16 u times the
        length of its vector.
        """
        lengths = (self.margin.x + self.margin.y + self.margin.z) / (16 * UNIT_ROUNDOFF["single"])
        x, y, z = self.coordinates(d)
        return (x + y + z) / lengths * (1 - gamma(8, "single"))

    def packets(self, a: Arrays) -> tuple[Any, Any, Any]:
        """The guards of all rows as three arrays of packets of four numbers, which a loop reads at once."""
        bc, ca, ab, margin = self.bc, self.ca, self.ab, self.margin
        fours = (bc.x, bc.y, bc.z, ca.x), (ca.y, ca.z, ab.x, ab.y), (ab.z, margin.x, margin.y, margin.z)
        return tuple(dr.ravel(a.Q32(*four)) for four in fours)

    @staticmethod
    def unpacked(a: Arrays, p: Any, q: Any, r: Any) -> "TriangleGuard":
        """The guard whose packets are p, q and r."""
        vectors = (p.x, p.y, p.z), (p.w, q.x, q.y), (q.z, q.w, r.x), (r.y, r.z, r.w)
        return TriangleGuard(*(a.V32(*v) for v in vectors))


def triangle_guard(a: Arrays, corners: tuple[Any, Any, Any], o: Any) -> TriangleGuard:
    """The guards of triangles for rays that start at o.

    corners: the corners a, b, c of each triangle, in double.

    Error: u is the unit roundoff of single. The exact test (Triangle.intersect_plane) computes k d . (b x c) in double
    for corners relative to o, where k is the largest component of d, at least 1 / sqrt(3). Its products of two
    differences have an error of at most gamma(12) 2 |b| |c|. So at a crossing d . (b x c) is at least
    -gamma(42) |b| |c|. The product b x c has an error of at most gamma(8) |b| |c| here. Together this is the second
    part of the margin, gamma(64) |b| |c| over the volume. In single, n . d has 4 u |n| from a conversion and three
    roundings, and 6 u |n| from d (see ball_guard); the code allows 16 u |n|, which also covers the volume's relative
    error.
    The volume is a . ((b - a) x (c - a)), whose error is at most gamma(16) |a| |b - a| |c - a|. Rounding may hide it if
    it is not 2^24 times as large. The exact test takes t as a mean of the corners' distances, whose weights have an
    error of gamma(42) |b| |c| over the projected area, and improves it by one step to the plane. It is within u t of
    the true one if the triangle is seen at an angle of at least 2^-23 across its narrowest side. Otherwise the guard
    rejects nothing and is never sure.
    """
    p, q, r = (x - o for x in corners)
    e, f = q - p, r - p
    volume = dr.dot(p, dr.cross(e, f))
    sizes = dr.norm(p), dr.norm(q), dr.norm(r)
    farthest = dr.maximum(dr.maximum(sizes[0], sizes[1]), sizes[2])
    sides = dr.norm(e), dr.norm(f)
    hidden = ~(dr.abs(volume) > gamma(16) * 2.0**24 * farthest * sides[0] * sides[1])
    hidden |= ~(dr.abs(volume) > 2.0**-23 * dr.maximum(sides[0], sides[1]) * dr.square(farthest))
    scale = dr.rcp(dr.select(hidden, 1, volume))
    vectors, margins = [], []
    for x, y, size in ((q, r, sizes[1] * sizes[2]), (r, p, sizes[2] * sizes[0]), (p, q, sizes[0] * sizes[1])):
        n = dr.select(hidden, 0, dr.cross(x, y) * scale)
        margin = 16 * UNIT_ROUNDOFF["single"] * dr.norm(n) + gamma(64) * size * dr.abs(scale)
        vectors.append(a.V32(n))
        margins.append(a.F32(dr.select(hidden, dr.inf, margin * (1 + gamma(2, "single")))))
    return TriangleGuard(*vectors, a.V32(*margins))


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
    if batch.kind.composite:
        # No plane: nothing is rejected.
        zero = dr.zeros(a.F32, dr.width(batch.placed.number))
        return PlaneGuard(a.V32(zero), zero + dr.inf)
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
    if batch.kind.composite:
        size = batch.placed.size
    else:
        size = l1_norm(batch.placed.inverse.o) if batch.radius is None else batch.radius
    return gamma(32) * (l1_norm(p) + size)
