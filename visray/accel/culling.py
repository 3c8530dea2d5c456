"""What rejects most rays in single precision, before an object is looked at in double.

A guard never rejects what the exact test would accept: its margin is a bound of its own rounding.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.batches import Batch
from visray.geometry import UNIT_ROUNDOFF, extent, gamma
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

    toward: the centre of the object's sphere minus the origin. margin: |toward|^2 - radius^2, less its error. Single.
    """

    toward: Any
    margin: Any

    def candidate(self, d: Any) -> Any:
        """Whether a ray in direction `d` (single) may meet the sphere around an object."""
        along = dr.dot(self.toward, d)
        return (along * along >= self.margin) & ((along > 0) | (self.margin < 0))

    def near(self, cone: Cone) -> Any:
        """Whether any ray of a cone may meet the sphere.

        With h and w the distances of its centre along and across the axis, the edge of the cone passes it at
        w cos - h sin. radius^2 is |toward|^2 - margin, and as these are off by 16 roundings of |toward|^2 and the rest
        by fewer of |toward|, their slack is one of 8 sqrt(u) |toward|: where digits cancel the root doubles them.
        """
        h = dr.dot(self.toward, cone.axis)
        w = dr.norm(self.toward - h * cone.axis)
        squared = dr.squared_norm(self.toward)
        slack = 8 * UNIT_ROUNDOFF["single"] ** 0.5 * dr.sqrt(squared)
        radius = dr.sqrt(dr.maximum(squared - self.margin, 0))
        return (w * cone.cosine - h * cone.sine <= radius + slack) | (self.margin < 0)


def guard(a: Arrays, centre: Any, radius: Any, o: Any) -> Guard:
    """The guard of the sphere around an object, for rays from `o`."""
    toward = centre - o
    squared = dr.squared_norm(toward)
    # With u the roundoff of single: the dot product of toward and d is off by at most 6 u |toward| (two conversions,
    # five operations), its square by 13 u |toward|^2, and the margin's own conversion by u |toward|^2. 2^-124 covers
    # underflow.
    margin = squared - dr.square(radius) - 16 * UNIT_ROUNDOFF["single"] * squared - 2.0**-124
    return Guard(a.V32(toward), a.F32(margin))


@dataclass(frozen=True)
class Ground:
    """What rejects most rays before an unbounded flat object is looked at: those that run away from it. Single.

    normal: its normal, turned to the side the origin is on. margin: how far a slope may be off; inf on the plane.
    """

    normal: Any
    margin: Any

    def candidate(self, d: Any) -> Any:
        """Whether a ray in direction `d` (single) may meet the plane."""
        return dr.dot(self.normal, d) <= self.margin

    def near(self, cone: Cone) -> Any:
        """Whether any ray of a cone may meet the plane: the least slope of all, a full margin for rounding more."""
        slope, size = dr.dot(self.normal, cone.axis), extent(self.normal)
        least = dr.select(cone.cosine < 0, -size, slope * cone.cosine - size * cone.sine)
        return least <= self.margin + 8 * UNIT_ROUNDOFF["single"] * size


def ground(a: Arrays, batch: Batch, o: Any) -> Ground:
    """The guard of an unbounded flat object, for rays from `o`."""
    f, g = batch.kind.surface_at(batch.placed, o)
    # The slope in single is off by two conversions and five operations at most, of the sum of the sizes of its terms.
    margin = 8 * UNIT_ROUNDOFF["single"] * extent(g)
    on = flush(batch, f, g, o)
    return Ground(a.V32(dr.select(f < 0, -g, g)), a.F32(dr.select(on, dr.inf, margin)))


def flush(batch: Batch, f: Any, g: Any, p: Any, error: Any = 0) -> Any:
    """Whether the points p, known to `error`, lie on rows to within rounding, by their f and g (Primitive.surface)."""
    return dr.abs(f) <= (rounding(batch, p) + error) * dr.norm(g)


def rounding(batch: Batch, p: Any) -> Any:
    """How far points near objects are off by rounding."""
    return gamma(32) * (extent(p) + (extent(batch.placed.inverse.o) if batch.radius is None else batch.radius))
