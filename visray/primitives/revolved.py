"""Solids of revolution: what cylinder and cone share."""

from typing import Any

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.convex import ConvexSolid
from visray.primitives.primitive import half_extents


def angle_u(local: Any) -> Any:
    """The angle about the axis, from 0 to 1, eastwards; 0.5 along the frame's first axis, as on the sphere."""
    return 0.5 + dr.atan2(local.y, local.x) * (0.5 / dr.pi)


def through_wall(o: Any, d: Any) -> tuple[Any, Any, Any, Any]:
    """Where the line o + t d is in the endless cylinder of radius 1 about z: at middle - half to middle + half (NaN
    where it misses), recentred at its point nearest to the axis; whether it is parallel to the axis, and then inside.
    """
    a = d.x * d.x + d.y * d.y
    scale = dr.rcp(a)
    middle = -(o.x * d.x + o.y * d.y) * scale
    x, y = o.x + middle * d.x, o.y + middle * d.y
    return middle, dr.sqrt((1 - (x * x + y * y)) * scale), a == 0, o.x * o.x + o.y * o.y <= 1


def axial_frame(middle: Any, axis: Any, radius: Any, height: Any) -> Frame:
    """The frame of a shape of revolution: z along the axis from -1 to 1, radius 1."""
    n = dr.normalize(axis)
    s, t = tangents(n)
    return Frame(radius * s, radius * t, 0.5 * height * n, middle)


class Revolved(ConvexSolid):
    """A closed solid about the z axis of its frame, between z = -1 and z = 1, nowhere wider than 1."""

    @staticmethod
    def extents(whole: Frame, shape: tuple) -> tuple[Any, Any]:
        across = Frame(whole.x, whole.y, 0 * whole.z, whole.o).longest()
        along = dr.norm(whole.z)
        # Upright cylinders reach the corner of their section; leaning the axis adds at most the plain sum.
        lean = dr.abs(dr.dot(whole.x, whole.z)) + dr.abs(dr.dot(whole.y, whole.z))
        return dr.sqrt(across * across + along * along + 2 * lean), half_extents(whole, "z", "xy")
