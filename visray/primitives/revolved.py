"""Solids of revolution: the base class of Cylinder and Cone, and functions for shapes about an axis."""

from typing import Any

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.convex import ConvexSolid
from visray.primitives.primitive import half_extents


def angle_u(local: Any) -> Any:
    """Texture coordinate u of a point: its angle about the z axis of the frame, growing eastwards from 0 to 1.

    u is 0.5 in the direction of the frame's x axis, as on the sphere.
    """
    return 0.5 + dr.atan2(local.y, local.x) * (0.5 / dr.pi)


def through_wall(o: Any, d: Any) -> tuple[Any, Any, Any, Any]:
    """(middle, half, parallel, inside) of the line o + t d and the infinite cylinder of radius 1 about the z axis.

    The line is inside the cylinder from t = middle - half to t = middle + half; half is NaN if the line misses it.
    parallel: whether the line is parallel to the axis. Then `inside` says whether it is inside the cylinder, and middle
        and half have no meaning.

    The origin is moved to the point of the line nearest to the axis, where no digits cancel.
    """
    a = d.x * d.x + d.y * d.y
    scale = dr.rcp(a)
    middle = -(o.x * d.x + o.y * d.y) * scale
    x, y = o.x + middle * d.x, o.y + middle * d.y
    return middle, dr.sqrt((1 - (x * x + y * y)) * scale), a == 0, o.x * o.x + o.y * o.y <= 1


def axial_frame(middle: Any, axis: Any, radius: Any, height: Any) -> Frame:
    """The frame of a solid of revolution whose canonical shape has radius 1 and goes from z = -1 to z = 1.

    middle: the middle of the axis.
    axis: direction of the axis, a vector of any length.
    radius, height: size of the solid.
    """
    n = dr.normalize(axis)
    s, t = tangents(n)
    return Frame(radius * s, radius * t, 0.5 * height * n, middle)


class Revolved(ConvexSolid):
    """A closed convex solid of revolution about the z axis of its frame.

    Its canonical shape goes from z = -1 to z = 1, and its radius is at most 1.
    """

    girth = 1.0

    @staticmethod
    def extents(to_world: Frame, shape: tuple) -> tuple[Any, Any]:
        x, y, z = to_world.x, to_world.y, to_world.z
        across, along = Frame(x, y, 0 * z, to_world.o).max_stretch(), dr.norm(z)
        # If the axis is perpendicular to the base, |p|^2 of a point of the rim is at most across^2 + along^2. A
        # transform can tilt the axis; this adds at most 2 lean.
        lean = dr.abs(dr.dot(x, z)) + dr.abs(dr.dot(y, z))
        return dr.sqrt(across * across + along * along + 2 * lean), half_extents(to_world, "z", "xy")
