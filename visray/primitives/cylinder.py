"""The capped cylinder."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame
from visray.primitives.primitive import Twin, homogeneous
from visray.primitives.revolved import Revolved, around, axial_frame
from visray.primitives.solid import common, slab
from visray.quantities import Direction, Length, Point
from visray.transforms import compose


@dataclass(frozen=True, kw_only=True)
class Cylinder(Revolved):
    """A closed cylinder about `axis`, `center` at the middle of its `height`.

    uv: u around the axis, eastwards; v along it from 0 to 1. On the caps: the square around the disk from 0 to 1.
    """

    type: Literal["cylinder"] = "cylinder"
    center: Point = (0.0, 0.0, 0.0)
    axis: Direction = (0.0, 1.0, 0.0)
    radius: Length = 0.5
    height: Length = 1.0

    def frame(self) -> Frame:
        return axial_frame(self.center, self.axis, self.radius, self.height)

    @staticmethod
    def interval(o: Any, d: Any, squared: Any) -> tuple[Any, Any]:
        """The wall's interval, recentred in the plane across the axis, cut by that of the caps."""
        a = d.x * d.x + d.y * d.y
        scale = dr.rcp(a)
        middle = -(o.x * d.x + o.y * d.y) * scale
        x, y = o.x + middle * d.x, o.y + middle * d.y
        half = dr.sqrt((1 - (x * x + y * y)) * scale)
        along = a == 0
        inside = o.x * o.x + o.y * o.y <= 1
        near = dr.select(along, dr.select(inside, -dr.inf, dr.inf), middle - half)
        far = dr.select(along, dr.select(inside, dr.inf, -dr.inf), middle + half)
        return common((near, far), slab(o.z, d.z))

    @staticmethod
    def on_wall(p: Any) -> Any:
        """Whether a point of the surface is on the wall, not on a cap: the face it is less deep under."""
        return dr.sqrt(p.x * p.x + p.y * p.y) >= dr.abs(p.z)

    @classmethod
    def depth(cls, p: Any) -> tuple[Any, Any]:
        wall, zero = cls.on_wall(p), 0 * p.z
        cap = dr.copysign(1 + zero, p.z)
        f = dr.select(wall, 0.5 * (p.x * p.x + p.y * p.y - 1), dr.abs(p.z) - 1)
        return f, dr.select(wall, type(p)(p.x, p.y, zero), type(p)(zero, zero, cap))

    @classmethod
    def uv(cls, placed: Any, p: Any) -> tuple[Any, Any]:
        q = placed.point(p)
        wall = cls.on_wall(q)
        up = dr.copysign(q.y, q.y * q.z)
        return dr.select(wall, around(q), 0.5 + 0.5 * q.x), dr.select(wall, 0.5 + 0.5 * q.z, 0.5 + 0.5 * up)

    def mitsuba(self) -> Twin | str:
        return Twin([{"type": "cylinder", "to_world": homogeneous(self.numbers().frame(), compose(self.transform))}])
