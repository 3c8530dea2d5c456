"""The infinite plane."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.flat import Flat
from visray.primitives.primitive import MitsubaShapes, scalars, to_world_matrix
from visray.quantities import Direction, Point
from visray.transforms import compose


@dataclass(frozen=True, kw_only=True)
class Plane(Flat):
    """An infinite plane: all points p with normal . (p - point) = 0.

    uv: distances from `point` along two directions in the plane, in world units. On a floor, u grows eastwards (+x) and
    v northwards (-z).
    """

    bounded = False
    axis_fields = ("normal",)

    type: Literal["plane"] = "plane"
    point: Point = (0.0, 0.0, 0.0)
    normal: Direction = (0.0, 1.0, 0.0)

    def frame(self) -> Frame:
        n = dr.normalize(self.normal)
        return Frame(*tangents(n), n, self.point)

    @staticmethod
    def uv(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        local = placed.inverse.point(p)
        return local.x, local.y

    def mitsuba(self) -> MitsubaShapes | str:
        return MitsubaShapes(
            [{"type": "plane", "to_world": to_world_matrix(scalars(self).frame(), compose(self.transform))}]
        )
