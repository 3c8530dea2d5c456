"""Flat primitives. In coordinates of the frame, such a shape is a region of the plane z = 0."""

from typing import Any

import drjit as dr

from visray.primitives.primitive import Primitive, Seen
from visray.ray import Crossing, KnownEnds, Ray


def farther_than(path: Any, slope: Any, squared: Any, error: Any) -> Any:
    """Whether a point of a ray lies behind a plane and farther than `error` from the plane.

    path: distance along the ray from its crossing with the plane to the point; negative if the point comes first.
    slope: n . d, for the direction d of the ray and a normal n of the plane, of any length.
    squared: |n|^2.
    """
    height = path * slope
    return (path > 0) & (height * height > error * error * squared)


class Flat(Primitive):
    """A flat shape. A ray crosses it at most once. A ray that starts or ends on the shape does not cross it."""

    smooth = True

    @staticmethod
    def never_rehit(inside: Any) -> Any:
        return True

    @staticmethod
    def within(x: Any, y: Any) -> Any:
        """Whether the point (x, y) of the frame's plane z = 0 belongs to the shape."""
        raise TypeError("no within")

    @classmethod
    def intersect_plane(cls, seen: Seen, d: Any) -> tuple[Any, Any, Any, Any]:
        """(t, inside, d . n, n . n): the intersection of lines through the ray origin with the plane of the shape.

        d: directions of the lines.
        t: distance of the intersection.
        inside: whether the intersection is in the shape; always True for an unbounded shape.
        n: a normal of the plane, of any length.
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
            # The end is known only to within end_error. If its distance from the plane is smaller, it may lie on the
            # plane, and does not count as behind it.
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
