"""The infinite plane."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.convex import ConvexSolid, Interval
from visray.primitives.flat import Flat
from visray.primitives.primitive import MitsubaShapes, scalars, to_world_matrix
from visray.quantities import Arrays, Direction, Point, quantities, stacked
from visray.records import record_kind
from visray.transforms import compose


@record_kind
@dataclass(frozen=True, kw_only=True)
class Plane(Flat):
    """An infinite plane: all points p with normal . (p - point) = 0.

    uv: distances from `point` along two directions in the plane, in world units. On a floor, u grows eastwards (+x) and
    v northwards (-z).
    """

    bounded = False
    axis_fields = ("normal",)

    type: Literal["plane"] = "plane"
    point: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    normal: Direction = field(default=(0.0, 1.0, 0.0), kw_only=False)

    def frame(self) -> Frame:
        n = dr.normalize(self.normal)
        return Frame(*tangents(n), n, self.point)

    @property
    def operand_kind(self) -> Any:
        return HalfSpace

    @staticmethod
    def uv(placed: Any, p: Any, part: Any = None) -> tuple[Any, Any]:
        local = placed.inverse.point(p)
        return local.x, local.y

    def mitsuba(self) -> MitsubaShapes | str:
        return MitsubaShapes(
            [{"type": "plane", "to_world": to_world_matrix(scalars(self).frame(), compose(self.transform))}]
        )


class HalfSpace(ConvexSolid, Plane):
    """A plane as an operand of CSG: all points on the side that the normal points away from. Its surface is the
    plane."""

    @classmethod
    def table(cls, a: Arrays, objects: list[Plane]) -> Plane:
        return stacked(a, Plane, objects)

    @classmethod
    def columns(cls, primitive: Plane, table: Plane) -> dict[str, Any]:
        return {name: getattr(table, name) for name in quantities(Plane)}

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The interval of all t with z <= 0."""
        # A line in the plane has d.z = 0; then t is inf or NaN, and is not used.
        t, below = -o.z / d.z, dr.select(o.z <= 0, -dr.inf, dr.inf)
        near = dr.select(d.z < 0, t, dr.select(d.z > 0, -dr.inf, below))
        return Interval(near, dr.select(d.z > 0, t, dr.select(d.z < 0, dr.inf, -below)))

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        return q.z, type(q)(0, 0, 1)

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        return q.x, q.y
