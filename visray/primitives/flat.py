"""Flat primitives: a part of the plane z = 0 of their frame, chosen by `within`."""

from typing import Any

import drjit as dr

from visray.primitives.primitive import Primitive, Seen
from visray.ray import Crossing, KnownEnds, Ray


def clear(path: Any, slope: Any, squared: Any, error: Any) -> Any:
    """Whether a path along a ray, crossing a plane's normal n at n . d = slope, ends farther than `error` from the
    plane."""
    height = path * slope
    return (path > 0) & (height * height > error * error * squared)


class Flat(Primitive):
    """A flat shape. It is crossed once by a ray, and never by a ray that leaves it or ends on it."""

    smooth = True

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        return True

    @staticmethod
    def within(x: Any, y: Any) -> Any:
        """Whether a point of the plane belongs to the shape."""
        raise TypeError("no within")

    @classmethod
    def intersect_plane(cls, seen: Seen, d: Any) -> tuple[Any, Any, Any, Any]:
        """Where a line goes through the plane: (t, whether that is in the shape, d . n, n . n) for a normal n of any
        length. An unbounded shape is its whole plane."""
        local = seen.inverse.vector(d)
        # A ray in the plane has local.z = 0: t is then inf or NaN, both of which fail every comparison with a number.
        t = -seen.o.z / local.z
        inside = cls.within(seen.o.x + t * local.x, seen.o.y + t * local.y) if cls.bounded else True
        return t, inside, local.z, dr.squared_norm(seen.inverse.z)

    @classmethod
    def crossing(cls, seen: Any, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        t, within, slope, squared = cls.intersect_plane(seen, ray.d)
        met = (t > begin) & within
        if end is not None:
            # A plane nearer to the end than that is known to be is the plane that the end lies on.
            met &= clear(end - t, slope, squared, known.end_error)
        for here in (known.on_start, known.on_end):
            met = met if here is None else met & ~here
        return Crossing(met, dr.select(met, t, dr.inf), None, slope < 0)

    @staticmethod
    def surface_at(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        return placed.inverse.point(p).z, placed.inverse.z

    @staticmethod
    def uv(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        local = placed.inverse.point(p)
        return 0.5 + 0.5 * local.x, 0.5 + 0.5 * local.y
