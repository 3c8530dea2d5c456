"""Closed convex solids: a ray is inside them on one interval."""

from typing import Any

import drjit as dr

from visray.primitives.primitive import Primitive, Seen
from visray.ray import Ray


def slab(z: Any, dz: Any) -> tuple[Any, Any]:
    """The interval of z + t dz between -1 and 1; a ray parallel to the slab is in it for ever or never."""
    inverse, inside = dr.rcp(dz), dr.abs(z) <= 1
    middle, half = -z * inverse, dr.abs(inverse)
    near = dr.select(dz == 0, dr.select(inside, -dr.inf, dr.inf), middle - half)
    far = dr.select(dz == 0, dr.select(inside, dr.inf, -dr.inf), middle + half)
    return near, far


def common(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    """What two intervals have in common; (inf, -inf) where the first is empty or NaN."""
    (near, far), (t0, t1) = a, b
    missed = ~(near <= far)
    first, last = dr.select(near > t0, near, t0), dr.select(far < t1, far, t1)
    return dr.select(missed, dr.inf, first), dr.select(missed, -dr.inf, last)


class Solid(Primitive):
    """A closed convex solid, known by the interval of a ray inside it.

    A ray that leaves the surface of a convex solid meets it again only if it runs into it, and then at the far end.
    """

    closed = True

    @staticmethod
    def gone(inside: Any) -> Any:
        return ~inside

    @staticmethod
    def interval(o: Any, d: Any, squared: Any) -> tuple[Any, Any]:
        """Entry and exit (t0, t1) of the line o + t d through the canonical shape; t0 > t1 or NaN where it misses.

        `squared` is |d|^2. The test is always `t0 <= t1`, which NaN fails.
        """
        raise TypeError("no interval")

    @staticmethod
    def depth(p: Any) -> tuple[Any, Any]:
        """(f, g) on the canonical shape: f zero on the surface and negative inside, g its gradient."""
        raise TypeError("no depth")

    @classmethod
    def intervals(cls, seen: Seen, d: Any) -> tuple[Any, Any]:
        """Entry and exit of the whole line; no entry where t0 > t1."""
        local = seen.inverse.vector(d)
        return cls.interval(seen.o, local, seen.inverse.squared_length(local))

    @classmethod
    def first(cls, seen: Seen, ray: Ray, leaving: Any, inside: Any) -> Any:
        t0, t1 = cls.intervals(seen, ray.d)
        near = 0 if ray.start is None else ray.start
        t = dr.select(t0 > near, t0, t1)
        if leaving is not None:
            t = dr.select(leaving, dr.select(inside, t1, dr.inf), t)
            # From its own far side the ray may be as near as it likes.
            near = near if ray.start is None else dr.select(leaving, 0, near)
        return dr.select((t0 <= t1) & (t > near), t, dr.inf)

    @classmethod
    def blocks(cls, seen: Seen, ray: Ray, length: Any, arrives: Any, inward: Any, leaving: Any, inside: Any) -> Any:
        t0, t1 = cls.intervals(seen, ray.d)
        near = 0 if ray.start is None else ray.start
        enters, leaves = t0 > near, t1 > near
        if leaving is not None:
            enters, leaves = enters & ~leaving, dr.select(leaving, inside, leaves)
        other = (enters & (t0 < length)) | (leaves & (t1 < length))
        return (t0 <= t1) & dr.select(arrives, inward & enters, other)

    @classmethod
    def runs_within(cls, seen: Seen, ray: Ray, outwards: Any, begin: Any, end: Any, error: Any) -> Any:
        """By the depth of the middle: an edge has more than one normal."""
        t0, t1 = cls.intervals(seen, ray.d)
        middle = 0.5 * (dr.select(t0 > begin, t0, begin) + dr.select(t1 < end, t1, end))
        there = (t0 <= t1) & (dr.abs(middle) < dr.inf)
        f, g = cls.depth(seen.o + dr.select(there, middle, 0) * seen.inverse.vector(ray.d))
        return there & (f < -error * dr.norm(seen.inverse.normal(g)))

    @classmethod
    def passage(cls, seen: Seen, ray: Ray, length: Any, arrives: Any, leaving: Any) -> tuple[Any, Any]:
        t0, t1 = cls.intervals(seen, ray.d)
        near = 0 if ray.start is None else ray.start
        entered, left = t0 > near, arrives | (t1 < length)
        if leaving is not None:
            entered |= leaving
        return entered & left, dr.select(t1 < length, t1, length) - dr.select(t0 > 0, t0, 0)

    @classmethod
    def level(cls, placed: Any, p: Any) -> tuple[Any, Any]:
        f, g = cls.depth(placed.point(p))
        return f, placed.normal(g)
