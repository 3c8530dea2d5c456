"""Flat primitives: a part of the plane z = 0 of their frame, chosen by `within`."""

from typing import Any

import drjit as dr

from visray.primitives.primitive import Primitive, Seen
from visray.ray import Ray


def clear(path: Any, slope: Any, squared: Any, error: Any) -> Any:
    """Whether a path along a ray, crossing a plane's normal n at n . d = slope, ends farther than `error` from the
    plane."""
    height = path * slope
    return (path > 0) & (height * height > error * error * squared)


class Flat(Primitive):
    """A flat shape. It is crossed once by a ray, and never by a ray that leaves it."""

    @staticmethod
    def gone(inside: Any) -> Any:
        return True

    @staticmethod
    def within(x: Any, y: Any) -> Any:
        """Whether a point of the plane belongs to the shape."""
        raise TypeError("no within")

    @classmethod
    def crossing(cls, seen: Seen, d: Any) -> tuple[Any, Any, Any, Any]:
        """(t, inside the shape, d . n, n . n) for a normal n of any length."""
        local = seen.inverse.vector(d)
        # A ray in the plane has local.z = 0: t is then inf or NaN, both of which fail every comparison with a number.
        t = -seen.o.z / local.z
        inside = cls.within(seen.o.x + t * local.x, seen.o.y + t * local.y)
        return t, inside, local.z, dr.squared_norm(seen.inverse.z)

    @classmethod
    def first(cls, seen: Seen, ray: Ray, leaving: Any, inside: Any) -> Any:
        t, within, slope, squared = cls.crossing(seen, ray.d)
        met = within & (t > (0 if ray.start is None else ray.start))
        if ray.error is not None:
            met &= clear(t, slope, squared, ray.error)
        if leaving is not None:
            met &= ~leaving
        return dr.select(met, t, dr.inf)

    @classmethod
    def blocks(cls, seen: Seen, ray: Ray, length: Any, arrives: Any, inward: Any, leaving: Any, inside: Any) -> Any:
        t, within, slope, squared = cls.crossing(seen, ray.d)
        free = arrives if leaving is None else arrives | leaving
        # The end point is known to ray.error; a plane nearer to it than that is the plane the point lies on.
        near = 0 if ray.start is None else ray.start
        return within & (t > near) & clear(length - t, slope, squared, ray.error) & ~free

    @staticmethod
    def level(placed: Any, p: Any) -> tuple[Any, Any]:
        return placed.point(p).z, placed.z

    @staticmethod
    def uv(placed: Any, p: Any) -> tuple[Any, Any]:
        local = placed.point(p)
        return 0.5 + 0.5 * local.x, 0.5 + 0.5 * local.y
