"""Closed convex solids: a ray is inside them on one interval."""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.primitives.primitive import Placed, Primitive, Seen
from visray.ray import Crossing, KnownEnds, Ray


@dataclass(frozen=True)
class Interval:
    """Where a line is inside a convex shape: from `near` to `far`, nowhere if near > far or either is NaN; and the
    parts of the surface that it passes there, None where it has one only."""

    near: Any
    far: Any
    near_part: Any = None
    far_part: Any = None

    def intersection(self, other: "Interval") -> "Interval":
        """What two intervals have in common; (inf, -inf) where this one is empty or NaN."""
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
    """The interval of z + t dz between -1 and 1; a ray parallel to the slab is in it for ever or never. The parts of
    its two sides."""
    inverse, inside = dr.rcp(dz), dr.abs(z) <= 1
    middle, half = -z * inverse, dr.abs(inverse)
    near = dr.select(dz == 0, dr.select(inside, -dr.inf, dr.inf), middle - half)
    far = dr.select(dz == 0, dr.select(inside, dr.inf, -dr.inf), middle + half)
    if low_part is None:
        return Interval(near, far)
    up, u = dz > 0, dr.uint32_array_t(z)
    return Interval(near, far, *(dr.select(up, u(x), u(y)) for x, y in ((low_part, high_part), (high_part, low_part))))


class ConvexSolid(Primitive):
    """A closed convex solid, known by the interval of a ray inside it.

    A ray that leaves the surface of a convex solid meets it again only if it runs into it, and then at the far end.
    """

    closed = True
    max_crossings = 2

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        return ~inside

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The line o + t d in the canonical shape. `squared` is |d|^2. The test is always `near <= far`, which NaN
        fails."""
        raise TypeError("no interval")

    @staticmethod
    def part_at(q: Any, shape: tuple) -> Any:
        """The part of the canonical shape's surface that is nearest to a point; None where it has one only."""
        return None

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        """(f, g) on the canonical shape, for one part of its surface: f zero there and negative inside, g its
        gradient."""
        raise TypeError("no depth")

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        """Texture coordinates of a point of a part of the canonical shape's surface."""
        raise TypeError("no uv")

    @classmethod
    def intervals(cls, seen: Seen, d: Any) -> Interval:
        """Where the whole line is inside."""
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
            # One of its two crossings is the end itself.
            met = dr.select(known.on_end, ahead & entering & known.inward, met)
        part = None if line.near_part is None else dr.select(entering, line.near_part, line.far_part)
        return Crossing(met, dr.select(met, t, dr.inf), part, entering | ~ahead)

    @classmethod
    def runs_inside(cls, seen: Seen, ray: Ray, slope: Any, begin: Any, end: Any, error: Any) -> Any:
        """By the depth of the middle: an edge has more than one normal."""
        line = cls.intervals(seen, ray.d)
        first, last = dr.select(line.near > begin, line.near, begin), dr.select(line.far < end, line.far, end)
        middle = 0.5 * (first + last)
        there = (line.near <= line.far) & (dr.abs(middle) < dr.inf)
        q = seen.o + dr.select(there, middle, 0) * seen.inverse.vector(ray.d)
        f, g = cls.depth(q, cls.part_at(q, seen.shape), seen.shape)
        return there & (f < -error * dr.norm(seen.inverse.normal(g)))

    @classmethod
    def surface_at(cls, placed: Placed, p: Any, part: Any = None) -> tuple[Any, Any]:
        q = placed.inverse.point(p)
        f, g = cls.depth(q, cls.part_at(q, placed.shape) if part is None else part, placed.shape)
        return f, placed.inverse.normal(g)

    @classmethod
    def uv(cls, placed: Placed, p: Any, part: Any = None) -> tuple[Any, Any]:
        q = placed.inverse.point(p)
        return cls.uv_of(q, cls.part_at(q, placed.shape) if part is None else part, placed.shape)
