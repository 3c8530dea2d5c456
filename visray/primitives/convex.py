"""Closed convex solids: a line is inside them on one interval."""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.primitives.primitive import Placed, Primitive, Seen
from visray.ray import Crossing, KnownEnds, Ray


@dataclass(frozen=True)
class Interval:
    """The interval of a line that is inside a convex shape; empty if near > far or if either is NaN.

    near, far: distances where the line enters and leaves.
    near_part, far_part: parts of the surface that are crossed there; None where the surface has one part.
    """

    near: Any
    far: Any
    near_part: Any = None
    far_part: Any = None

    def intersection(self, other: "Interval") -> "Interval":
        """The intersection of two intervals; (inf, -inf) where this one is empty or NaN."""
        missed = ~(self.near <= self.far)
        later, sooner = self.near > other.near, self.far < other.far
        near, far = dr.select(later, self.near, other.near), dr.select(sooner, self.far, other.far)
        parts = None, None
        if self.near_part is not None:
            parts = (
                dr.select(later, self.near_part, other.near_part),
                dr.select(sooner, self.far_part, other.far_part),
            )
        return Interval(dr.select(missed, dr.inf, near), dr.select(missed, -dr.inf, far), *parts)


def slab(z: Any, dz: Any, low_part: Any = None, high_part: Any = None) -> Interval:
    """The interval of t where -1 <= z + t dz <= 1. A line parallel to the slab is inside everywhere or nowhere.

    low_part, high_part: parts of the surface at -1 and at 1.
    """
    inverse, inside = dr.rcp(dz), dr.abs(z) <= 1
    middle, half = -z * inverse, dr.abs(inverse)
    near = dr.select(dz == 0, dr.select(inside, -dr.inf, dr.inf), middle - half)
    far = dr.select(dz == 0, dr.select(inside, dr.inf, -dr.inf), middle + half)
    if low_part is None:
        return Interval(near, far)
    up, u = dz > 0, dr.uint32_array_t(z)
    return Interval(near, far, *(dr.select(up, u(x), u(y)) for x, y in ((low_part, high_part), (high_part, low_part))))


class ConvexSolid(Primitive):
    """A closed convex solid, given by the interval of a line inside its canonical shape.

    A ray that starts on the surface of a convex solid crosses it again only if it starts into the solid, and then at
    the far end of the interval.
    """

    closed = True
    max_crossings = 2

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        return ~inside

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The interval of the line o + t d inside the canonical shape. squared: |d|^2.

        The callers test `near <= far`, which NaN fails.
        """
        raise TypeError("no interval")

    @staticmethod
    def part_at(q: Any, shape: tuple) -> Any:
        """The part of the canonical surface nearest to a point; None where the surface has one part."""
        return None

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        """(f, g) for one part of the canonical surface: f is zero there and negative inside; g is its gradient."""
        raise TypeError("no depth")

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        """Texture coordinates of a point on a part of the canonical surface."""
        raise TypeError("no uv")

    @classmethod
    def intervals(cls, seen: Seen, d: Any) -> Interval:
        """The interval of the line along each world direction d inside the object."""
        local = seen.inverse.vector(d)
        return cls.interval(seen.o, local, seen.inverse.squared_length(local), seen.shape)

    @classmethod
    def crossing(cls, seen: Seen, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        line = cls.intervals(seen, ray.d)
        entering = line.near > begin
        if known.on_start is not None:
            entering &= ~known.on_start
        t = dr.select(entering, line.near, line.far)
        ahead = (line.near <= line.far) & (t > begin)
        if known.on_start is not None:
            ahead &= ~known.on_start | known.inside
        met = ahead if end is None else ahead & (t < end)
        if known.on_end is not None:
            # One of the two crossings is the end itself.
            met = dr.select(known.on_end, ahead & entering & known.inward, met)
        part = None if line.near_part is None else dr.select(entering, line.near_part, line.far_part)
        return Crossing(met, dr.select(met, t, dr.inf), part, entering | ~ahead)

    @classmethod
    def runs_inside(cls, seen: Seen, ray: Ray, slope: Any, begin: Any, end: Any, error: Any) -> Any:
        """As Primitive.runs_inside, but decided by the depth of the segment's middle: an edge has no unique normal."""
        line = cls.intervals(seen, ray.d)
        first, last = dr.select(line.near > begin, line.near, begin), dr.select(line.far < end, line.far, end)
        middle = 0.5 * (first + last)
        valid = (line.near <= line.far) & (dr.abs(middle) < dr.inf)
        q = seen.o + dr.select(valid, middle, 0) * seen.inverse.vector(ray.d)
        f, g = cls.depth(q, cls.part_at(q, seen.shape), seen.shape)
        return valid & (f < -error * dr.norm(seen.inverse.normal(g)))

    @classmethod
    def surface_at(cls, placed: Placed, p: Any, part: Any = None) -> tuple[Any, Any]:
        q = placed.inverse.point(p)
        f, g = cls.depth(q, cls.part_at(q, placed.shape) if part is None else part, placed.shape)
        return f, placed.inverse.normal(g)

    @classmethod
    def uv(cls, placed: Placed, p: Any, part: Any = None) -> tuple[Any, Any]:
        q = placed.inverse.point(p)
        return cls.uv_of(q, cls.part_at(q, placed.shape) if part is None else part, placed.shape)
