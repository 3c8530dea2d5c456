"""Flat primitives: the part of the plane z = 0 of their frame that `within` selects."""

from typing import Any

import drjit as dr

from visray.primitives.primitive import Primitive, Seen
from visray.ray import Crossing, KnownEnds, Ray


def farther_than(path: Any, slope: Any, squared: Any, error: Any) -> Any:
    """Whether a point lies beyond a plane, and farther than `error` from it.

    path: distance along a ray from its crossing with the plane to the point; negative if the point comes first.
    slope: n . d, for a plane normal n of any length.
    squared: |n|^2.
    """
    height = path * slope
    return (path > 0) & (height * height > error * error * squared)


class Flat(Primitive):
    """A flat shape. A ray crosses it at most once, and not at all if it starts or ends on the shape."""

    smooth = True

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        return True

    @staticmethod
    def within(x: Any, y: Any) -> Any:
        """Whether the point (x, y) of the plane belongs to the shape."""
        raise TypeError("no within")

    @classmethod
    def intersect_plane(cls, seen: Seen, d: Any) -> tuple[Any, Any, Any, Any]:
        """Intersection of a line with the shape's plane: (t, whether it is in the shape, d . n, n . n).

        The normal n has any length. An unbounded shape is its whole plane.
        """
        local = seen.inverse.vector(d)
        # A ray in the plane has local.z = 0. Then t is inf or NaN, and both fail every comparison with a number.
        t = -seen.o.z / local.z
        inside = cls.within(seen.o.x + t * local.x, seen.o.y + t * local.y) if cls.bounded else True
        return t, inside, local.z, dr.squared_norm(seen.inverse.z)

    @classmethod
    def crossing(cls, seen: Any, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        t, within, slope, squared = cls.intersect_plane(seen, ray.d)
        met = (t > begin) & within
        if end is not None:
            # The end is known only to within end_error. A plane that is nearer to it contains the end.
            met &= farther_than(end - t, slope, squared, known.end_error)
        for on_surface in (known.on_start, known.on_end):
            met = met if on_surface is None else met & ~on_surface
        return Crossing(met, dr.select(met, t, dr.inf), None, slope < 0)

    @staticmethod
    def surface_at(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        return placed.inverse.point(p).z, placed.inverse.z

    @staticmethod
    def uv(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        local = placed.inverse.point(p)
        return 0.5 + 0.5 * local.x, 0.5 + 0.5 * local.y
