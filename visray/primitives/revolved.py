"""Solids of revolution: what cylinder and cone share."""

from typing import Any

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.primitive import half_box
from visray.primitives.solid import Solid


def around(local: Any) -> Any:
    """The angle about the axis, from 0 to 1, eastwards; 0.5 along the frame's first axis, as on the sphere."""
    return 0.5 + dr.atan2(local.y, local.x) * (0.5 / dr.pi)


def axial_frame(middle: Any, axis: Any, radius: Any, height: Any) -> Frame:
    """The frame of a shape of revolution: z along the axis from -1 to 1, radius 1."""
    n = dr.normalize(axis)
    s, t = tangents(n)
    return Frame(radius * s, radius * t, 0.5 * height * n, middle)


class Revolved(Solid):
    """A closed solid about the z axis of its frame, between z = -1 and z = 1, nowhere wider than 1."""

    @staticmethod
    def extents(whole: Frame, shape: tuple) -> tuple[Any, Any]:
        across = Frame(whole.x, whole.y, 0 * whole.z, whole.o).longest()
        along = dr.norm(whole.z)
        # Upright cylinders reach the corner of their section; leaning the axis adds at most the plain sum.
        lean = dr.abs(dr.dot(whole.x, whole.z)) + dr.abs(dr.dot(whole.y, whole.z))
        return dr.sqrt(across * across + along * along + 2 * lean), half_box(whole, "z", "xy")
