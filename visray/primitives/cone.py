"""The capped cone."""

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
class Cone(Revolved):
    """A closed cone: a disk of `radius` about `base`, and the apex at `height` along `axis` from it.

    uv: u around the axis, eastwards; v along it from 0 at the base to 1 at the apex. On the base: the square around it.
    """

    type: Literal["cone"] = "cone"
    base: Point = (0.0, 0.0, 0.0)
    axis: Direction = (0.0, 1.0, 0.0)
    radius: Length = 0.5
    height: Length = 1.0

    def frame(self) -> Frame:
        middle = self.base + 0.5 * self.height * dr.normalize(self.axis)
        return axial_frame(middle, self.axis, self.radius, self.height)

    @staticmethod
    def interval(o: Any, d: Any, squared: Any) -> tuple[Any, Any]:
        """x^2 + y^2 <= w^2 with w = (1 - z)/2, cut by the slab, where w is not negative.

        Recentred at the line's point nearest to the apex: the cone is the same seen from there at every distance, so
        that no digits cancel even for a ray that all but meets the apex.
        a >= 0: inside between the roots, one of which is infinite for a ray parallel to the wall. a < 0: inside beyond
        one root, on the side to which w grows.
        """
        t0, t1 = slab(o.z, d.z)
        shift = -(o.x * d.x + o.y * d.y + (o.z - 1) * d.z) * dr.rcp(squared)
        p = type(d)(o.x + shift * d.x, o.y + shift * d.y, (o.z - 1) + shift * d.z)
        w, dw = -0.5 * p.z, -0.5 * d.z
        a = d.x * d.x + d.y * d.y - dw * dw
        b = p.x * d.x + p.y * d.y - w * dw
        c = p.x * p.x + p.y * p.y - w * w
        disc = b * b - a * c
        root = dr.sqrt(dr.select((disc < 0) & (a < 0), 0, disc))
        q = -(b + dr.copysign(root, b))
        # q = 0 only if b = 0 and disc = 0: both roots are 0 (a != 0), or the ray runs along the wall and misses (NaN).
        first, second = dr.select(q == 0, 0, c / q), q / a
        low, high = dr.select(first < second, first, second), dr.select(first < second, second, first)
        forward = dw > 0
        near = dr.select(a >= 0, low, dr.select(forward, high, -dr.inf)) + shift
        far = dr.select(a >= 0, high, dr.select(forward, dr.inf, low)) + shift
        return common((near, far), (t0, t1))

    @staticmethod
    def on_wall(p: Any) -> Any:
        """Whether a point of the surface is on the wall, not on the base: the face it is less deep under."""
        return dr.sqrt(p.x * p.x + p.y * p.y) - 0.5 * (1 - p.z) >= -1 - p.z

    @classmethod
    def depth(cls, p: Any) -> tuple[Any, Any]:
        wall, w, zero = cls.on_wall(p), 0.5 * (1 - p.z), 0 * p.z
        f = dr.select(wall, 0.5 * (p.x * p.x + p.y * p.y - w * w), -1 - p.z)
        # At the apex itself the wall has no normal: the axis is the mean of all of them.
        apex = (p.x == 0) & (p.y == 0)
        slope = type(p)(p.x, p.y, dr.select(apex, 1, 0.5 * w))
        return f, dr.select(wall, slope, type(p)(zero, zero, zero - 1))

    @classmethod
    def uv(cls, placed: Any, p: Any) -> tuple[Any, Any]:
        q = placed.point(p)
        wall = cls.on_wall(q)
        return dr.select(wall, around(q), 0.5 + 0.5 * q.x), dr.select(wall, 0.5 + 0.5 * q.z, 0.5 - 0.5 * q.y)

    def mitsuba(self) -> Twin | str:
        return Twin([{"type": "cone", "to_world": homogeneous(self.numbers().frame(), compose(self.transform))}])
