"""Guards: tests in single precision that reject most rays before an object is tested in double.

A guard never rejects a ray that the exact test would accept, because its margin bounds its own rounding error.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.batches import Batch
from visray.geometry import UNIT_ROUNDOFF, gamma, l1_norm
from visray.quantities import Arrays


@dataclass(frozen=True)
class DirectionCone:
    """A cone of directions from an origin, such as those to a light, or a hemisphere. In single precision.

    axis: unit vector.
    sine, cosine: of the half angle, which is at most a right angle; 0 and -1 for all directions.
    """

    axis: Any
    sine: Any
    cosine: Any

    @staticmethod
    def around(a: Arrays, to_centre: Any, radius: Any) -> "DirectionCone":
        """The cone from the origin to a ball. All directions where the origin may be inside the ball.

        to_centre: vector from the origin to the centre of the ball.
        """
        to_centre, radius = a.V32(to_centre), a.F32(radius)
        distance = dr.norm(to_centre)
        divisor = dr.select(distance > 0, distance, 1)
        sine = radius / divisor
        # The quotient carries the roundings of the conversions, the norm and the division.
        outside = (sine < 1 - gamma(8, "single")) & (distance > 0)
        # 1 - sine^2 loses no digits in this form.
        cosine = dr.select(outside, dr.sqrt((1 - sine) * (1 + sine)), -1)
        return DirectionCone(to_centre / divisor, dr.select(outside, sine, 0), cosine)


@dataclass(frozen=True)
class BallGuard:
    """The guard of a bounded object, by its bounding ball. In single precision.

    Shapes: an entry per object or per lane.

    to_centre: vector from the ray origin to the centre of the ball.
    least: a ray that meets the ball has to_centre . d >= least. It is the length of a tangent from the origin, less its
        error; -inf where the origin may be inside the ball.
    """

    to_centre: Any
    least: Any

    def may_hit(self, d: Any, _: Any = None) -> Any:
        """Whether a ray in direction d (single) may meet the ball."""
        return dr.dot(self.to_centre, d) >= self.least

    def may_hit_cone(self, cone: DirectionCone) -> Any:
        """Whether some ray of a cone may meet the ball.

        With h and w the distances of the centre along and across the axis, the edge of the cone passes the centre at
        the distance w cos - h sin.
        Error: radius^2 is |to_centre|^2 - least^2. Both are within 32 roundings of |to_centre|^2, and all else is
        within fewer roundings of |to_centre|. A slack of 8 sqrt(u) |to_centre| bounds them: where digits cancel, the
        square root halves the number of correct digits.
        """
        h = dr.dot(self.to_centre, cone.axis)
        w = dr.norm(self.to_centre - h * cone.axis)
        squared = dr.squared_norm(self.to_centre)
        slack = 8 * UNIT_ROUNDOFF["single"] ** 0.5 * dr.sqrt(squared)
        radius = dr.sqrt(dr.maximum(squared - dr.square(self.least), 0))
        return (w * cone.cosine - h * cone.sine <= radius + slack) | (self.least < 0)


def ball_guard(a: Arrays, centre: Any, radius: Any, o: Any) -> BallGuard:
    """The guard of a bounding ball, for rays from o.

    A ray meets the ball only if h = to_centre . d >= T, where T^2 = |to_centre|^2 - radius^2 is the squared length of a
    tangent.

    Error: u is the unit roundoff of single. h is within 10 u |to_centre|: a conversion and three roundings of sums, and
    6 u for d, which is normalised in single (a conversion, 3.5 u for the reciprocal root of |d|^2, a product). T is
    within 1.5 u |to_centre| (a conversion before its root, the root). Taking 24 u |to_centre|^2 from T^2 takes at least
    (24 u |to_centre|^2) / (2 |to_centre|) = 12 u |to_centre| from T. The rest covers the rounding of the exact test, in
    double. 2^-124 covers underflow.
    """
    to_centre = centre - o
    squared = dr.squared_norm(to_centre)
    tangent = a.F32(squared - dr.square(radius) - 24 * UNIT_ROUNDOFF["single"] * squared - 2.0**-124)
    return BallGuard(a.V32(to_centre), dr.select(tangent > 0, dr.sqrt(tangent), -dr.inf))


@dataclass(frozen=True)
class PlaneGuard:
    """The guard of an unbounded flat object: it rejects rays that run away from the plane or end before it.

    In single precision.

    normal: the plane's normal, turned to the side of the ray origin and divided by the origin's height above the plane.
        A ray d reaches the plane at t = 1 / (-normal . d). Zero for an origin on the plane.
    margin: error bound of normal . d; inf for an origin on the plane.
    """

    normal: Any
    margin: Any

    def may_hit(self, d: Any, reach: Any = None) -> Any:
        """Whether a ray in direction d (single) may meet the plane. reach: its length (single); None if endless."""
        fall = self.margin - dr.dot(self.normal, d)
        # The difference, the product and `reach`, if it was computed in single, carry at most eight roundings.
        return fall >= 0 if reach is None else fall * reach >= 1 - 16 * UNIT_ROUNDOFF["single"]

    def may_hit_cone(self, cone: DirectionCone) -> Any:
        """Whether some ray of a cone may meet the plane: the least slope in the cone, with twice the margin."""
        slope, size = dr.dot(self.normal, cone.axis), l1_norm(self.normal)
        least = dr.select(cone.cosine < 0, -size, slope * cone.cosine - size * cone.sine)
        return least <= self.margin + 8 * UNIT_ROUNDOFF["single"] * size


def plane_guard(a: Arrays, batch: Batch, o: Any) -> PlaneGuard:
    """The guards of a batch of unbounded flat objects, for rays from o.

    Error: normal . d in single is within four roundings of the normal, six of d (see ball_guard) and three of the sums,
    relative to the sum of the sizes of its terms.
    """
    f, g = batch.kind.surface_at(batch.placed, o)
    on = touches(batch, f, g, o)
    normal = a.V32(g) * dr.select(on, 0, dr.rcp(a.F32(dr.select(on, 1, f))))
    return PlaneGuard(normal, dr.select(on, dr.inf, 16 * UNIT_ROUNDOFF["single"] * l1_norm(normal)))


def touches(batch: Batch, f: Any, g: Any, p: Any, error: Any = 0) -> Any:
    """Whether the points p lie on rows of a batch, to within rounding.

    f, g: the rows' values at p, as Primitive.surface_at returns them.
    error: error bound of the points.
    """
    return dr.abs(f) <= (point_rounding(batch, p) + error) * dr.norm(g)


def point_rounding(batch: Batch, p: Any) -> Any:
    """Bound on the rounding error of points p near the rows of a batch."""
    return gamma(32) * (l1_norm(p) + (l1_norm(batch.placed.inverse.o) if batch.radius is None else batch.radius))
