"""Solids of revolution: the base of Cylinder and Cone, and helpers for shapes about an axis."""

from typing import Any

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.convex import ConvexSolid
from visray.primitives.primitive import half_extents


def angle_u(local: Any) -> Any:
    """Texture coordinate u: the angle about the z axis, eastwards, from 0 to 1.

    It is 0.5 at the x axis of the frame, as on the sphere.
    """
    return 0.5 + dr.atan2(local.y, local.x) * (0.5 / dr.pi)


def through_wall(o: Any, d: Any) -> tuple[Any, Any, Any, Any]:
    """The line o + t d in the infinite cylinder of radius 1 about z: (middle, half, parallel, inside).

    The line is inside from t = middle - half to middle + half; half is NaN where the line misses. The origin is moved
    to the point nearest to the axis, where no digits cancel. parallel: the line is parallel to the axis; then `inside`
    says whether it is inside the cylinder.
    """
    a = d.x * d.x + d.y * d.y
    scale = dr.rcp(a)
    middle = -(o.x * d.x + o.y * d.y) * scale
    x, y = o.x + middle * d.x, o.y + middle * d.y
    return middle, dr.sqrt((1 - (x * x + y * y)) * scale), a == 0, o.x * o.x + o.y * o.y <= 1


def axial_frame(middle: Any, axis: Any, radius: Any, height: Any) -> Frame:
    """The frame of a shape of revolution: canonical radius 1, and z from -1 to 1 along the axis."""
    n = dr.normalize(axis)
    s, t = tangents(n)
    return Frame(radius * s, radius * t, 0.5 * height * n, middle)


class Revolved(ConvexSolid):
    """A closed convex solid of revolution about the z axis of its frame: z from -1 to 1, radius at most 1."""

    @staticmethod
    def extents(to_world: Frame, shape: tuple) -> tuple[Any, Any]:
        x, y, z = to_world.x, to_world.y, to_world.z
        across, along = Frame(x, y, 0 * z, to_world.o).max_stretch(), dr.norm(z)
        # |p|^2 of a rim point is across^2 + along^2 where the axis is normal to the base. Otherwise the products of the
        # columns add at most 2 lean.
        lean = dr.abs(dr.dot(x, z)) + dr.abs(dr.dot(y, z))
        return dr.sqrt(across * across + along * along + 2 * lean), half_extents(to_world, "z", "xy")
