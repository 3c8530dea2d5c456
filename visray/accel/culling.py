"""What rejects most rays in single precision, before an object is looked at in double.

A guard never rejects what the exact test would accept: its margin is a bound of its own rounding.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.batches import Batch
from visray.geometry import UNIT_ROUNDOFF, gamma, l1_norm
from visray.quantities import Arrays


@dataclass(frozen=True)
class Cone:
    """All directions from an origin that are near an axis: those to a light, or a hemisphere. Single.

    axis: unit; sine and cosine: of the angle between the axis and the edge, at most a right angle; or 0 and -1 for all
    directions there are.
    """

    axis: Any
    sine: Any
    cosine: Any

    @staticmethod
    def around(a: Arrays, way: Any, radius: Any) -> "Cone":
        """The cone from the origin to a sphere about `way`; all directions where the origin may be in that sphere."""
        way, radius = a.V32(way), a.F32(radius)
        far = dr.norm(way)
        safe = dr.select(far > 0, far, 1)
        sine = radius / safe
        # The quotient is off by the conversions, the norm and itself.
        out = (sine < 1 - gamma(8, "single")) & (far > 0)
        # 1 - s^2 cancels no digits in this form.
        cosine = dr.select(out, dr.sqrt((1 - sine) * (1 + sine)), -1)
        return Cone(way / safe, dr.select(out, sine, 0), cosine)


@dataclass(frozen=True)
class Guard:
    """What rejects most rays before an object is looked at. Shapes: one entry an object, or one a lane.

    toward: the centre of the object's sphere minus the origin. least: how far along a ray the centre is at least where
    the ray meets the sphere, less its error: the length of a tangent, or -inf where the origin may be inside. Single.
    """

    toward: Any
    least: Any

    def candidate(self, d: Any, _: Any = None) -> Any:
        """Whether a ray in direction `d` (single) may meet the sphere around an object."""
        return dr.dot(self.toward, d) >= self.least

    def near(self, cone: Cone) -> Any:
        """Whether any ray of a cone may meet the sphere.

        With h and w the distances of its centre along and across the axis, the edge of the cone passes it at
        w cos - h sin. radius^2 is |toward|^2 - least^2, and as these are off by 32 roundings of |toward|^2 and the rest
        by fewer of |toward|, their slack is one of 8 sqrt(u) |toward|: where digits cancel the root doubles them.
        """
        h = dr.dot(self.toward, cone.axis)
        w = dr.norm(self.toward - h * cone.axis)
        squared = dr.squared_norm(self.toward)
        slack = 8 * UNIT_ROUNDOFF["single"] ** 0.5 * dr.sqrt(squared)
        radius = dr.sqrt(dr.maximum(squared - dr.square(self.least), 0))
        return (w * cone.cosine - h * cone.sine <= radius + slack) | (self.least < 0)


def guard(a: Arrays, centre: Any, radius: Any, o: Any) -> Guard:
    """The guard of the sphere around an object, for rays from `o`.

    A ray that meets the sphere has h = toward . d >= T with T^2 = |toward|^2 - radius^2: the centre is as far along it
    as a tangent is long. With u the roundoff of single, h is off by at most 10 u |toward|: a conversion and three
    roundings of sums, and 6 u for d, normalised in single (a conversion, 3.5 u for the reciprocal root of |d|^2, a
    product). What it is compared with is off by 1.5 u |toward| (a conversion before its root, the root). To take
    24 u |toward|^2 from the square takes (24 u |toward|^2) / (2 |toward|) = 12 u |toward| from the root, or more: what
    is left is for the exact test's own rounding, in double. 2^-124 covers underflow.
    """
    toward = centre - o
    squared = dr.squared_norm(toward)
    tangent = a.F32(squared - dr.square(radius) - 24 * UNIT_ROUNDOFF["single"] * squared - 2.0**-124)
    return Guard(a.V32(toward), dr.select(tangent > 0, dr.sqrt(tangent), -dr.inf))


@dataclass(frozen=True)
class Ground:
    """What rejects most rays before an unbounded flat object is looked at: those that run away from it, or end before
    it. Single.

    normal: its normal, turned to the side the origin is on, over the origin's height above it: a ray d reaches it at
    t = 1 / (-normal . d). margin: how far that slope may be off; on the plane inf, with a normal of 0.
    """

    normal: Any
    margin: Any

    def candidate(self, d: Any, reach: Any = None) -> Any:
        """Whether a ray in direction `d` (single), as long as `reach` (single) or endless, may meet the plane."""
        fall = self.margin - dr.dot(self.normal, d)
        # Difference, product and reach are off by eight roundings at most, where it was computed in single itself.
        return fall >= 0 if reach is None else fall * reach >= 1 - 16 * UNIT_ROUNDOFF["single"]

    def near(self, cone: Cone) -> Any:
        """Whether any ray of a cone may meet the plane: the least slope of all, a full margin for rounding more."""
        slope, size = dr.dot(self.normal, cone.axis), l1_norm(self.normal)
        least = dr.select(cone.cosine < 0, -size, slope * cone.cosine - size * cone.sine)
        return least <= self.margin + 8 * UNIT_ROUNDOFF["single"] * size


def ground(a: Arrays, batch: Batch, o: Any) -> Ground:
    """The guard of an unbounded flat object, for rays from `o`."""
    f, g = batch.kind.surface_at(batch.placed, o)
    on = flush(batch, f, g, o)
    normal = a.V32(g) * dr.select(on, 0, dr.rcp(a.F32(dr.select(on, 1, f))))
    # The slope in single is off by at most four roundings of the normal, the six of d in `guard` and three of sums, of
    # the sum of the sizes of its terms.
    return Ground(normal, dr.select(on, dr.inf, 16 * UNIT_ROUNDOFF["single"] * l1_norm(normal)))


def flush(batch: Batch, f: Any, g: Any, p: Any, error: Any = 0) -> Any:
    """Whether the points p, known to `error`, lie on rows to within rounding, by their f and g (Primitive.surface)."""
    return dr.abs(f) <= (rounding(batch, p) + error) * dr.norm(g)


def rounding(batch: Batch, p: Any) -> Any:
    """How far points near objects are off by rounding."""
    return gamma(32) * (l1_norm(p) + (l1_norm(batch.placed.inverse.o) if batch.radius is None else batch.radius))
