"""Closed convex solids. A line is inside such a solid on a single interval.

The canonical shape of a kind is its simplest member, such as the unit sphere. A frame maps it to the object. A part is
one smooth piece of the surface, such as a face of a box.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.primitives.primitive import Placed, Primitive, Seen
from visray.ray import Crossing, KnownEnds, Ray


@dataclass(frozen=True)
class Interval:
    """The interval in which a line is inside a convex shape. It is empty if near > far, or if one of them is NaN.

    near, far: distances at which the line enters and leaves the shape.
    near_part, far_part: parts of the surface that are crossed there; None if the surface has a single part.
    """

    near: Any
    far: Any
    near_part: Any = None
    far_part: Any = None

    def intersection(self, other: "Interval") -> "Interval":
        """The intersection of two intervals. It is (inf, -inf) in lanes where `self` is empty."""
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
    """The interval of all t with -1 <= z + t dz <= 1. If dz is 0, it contains all numbers or none.

    low_part, high_part: parts of the surface at -1 and at 1; None if the surface has a single part.
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
    """A closed convex solid. A kind defines the interval of a line inside its canonical shape.

    A ray that starts on the surface of a convex solid crosses the surface again only if it runs into the solid. This
    crossing is the far end of the interval.
    """

    closed = True
    max_crossings = 2

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        return ~inside

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The interval of the line o + t d inside the canonical shape.

        If the line misses the shape, near > far, or one of them is NaN; callers test `near <= far`.

        squared: |d|^2.
        shape: parameters of the canonical shape, as Primitive.shape returns them.
        """
        raise TypeError("no interval")

    @staticmethod
    def part_at(q: Any, shape: tuple) -> Any:
        """The part of the canonical surface that is nearest to the point q; None if the surface has a single part."""
        return None

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        """(f, g) at the point q, for one part of the canonical surface.

        f: a function that is zero on this part and negative inside the shape.
        g: the gradient of f.
        """
        raise TypeError("no depth")

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        """(u, v): texture coordinates of the point q on a part of the canonical surface."""
        raise TypeError("no uv")

    @classmethod
    def intervals(cls, seen: Seen, d: Any) -> Interval:
        """For each lane, the interval in which the line through the ray origin along d is inside the object.

        d: directions in world space.
        """
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
            # If the ray ends on the surface, one of the two crossings is the end itself, which does not count. So the
            # near crossing counts only if the end is the far one: the ray reaches it from inside.
            met = dr.select(known.on_end, ahead & entering & known.inward, met)
        part = None if line.near_part is None else dr.select(entering, line.near_part, line.far_part)
        return Crossing(met, dr.select(met, t, dr.inf), part, entering | ~ahead)

    @classmethod
    def runs_inside(cls, seen: Seen, ray: Ray, slope: Any, begin: Any, end: Any, error: Any) -> Any:
        """As Primitive.runs_inside, but without the slope, because there is no unique normal on an edge.

        Instead, the middle of the ray's piece inside the object must be more than `error` below the surface.
        """
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
