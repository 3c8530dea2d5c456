"""The capsule."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.convex import ConvexSolid, Interval
from visray.primitives.primitive import MitsubaShapes, half_extents, scalars, to_world_matrix
from visray.primitives.revolved import angle_u, through_wall
from visray.quantities import FARTHEST, Length, Point
from visray.transforms import compose

# The parts of its surface.
WALL, CAP_A, CAP_B = range(3)


@dataclass(frozen=True, kw_only=True)
class Capsule(ConvexSolid):
    """All points within `radius` of the straight way from `a` to `b`: a cylinder with half balls at its ends.

    uv: u around the axis, as on the cylinder; v along the surface from 0 at the end beyond a to 1 at that beyond b, in
    equal steps of its length: it goes on smoothly from the wall to the caps.
    """

    parts = 3
    smooth = True

    type: Literal["capsule"] = "capsule"
    a: Point = (0.0, -0.5, 0.0)
    b: Point = (0.0, 0.5, 0.0)
    radius: Length = 0.5

    def flaws(self) -> list[tuple[str, str]]:
        near = max(abs(y - x) for x, y in zip(self.a, self.b)) < 1 / FARTHEST
        return [("b", "must be another point than a; where they are one, write a sphere")] if near else []

    def frame(self) -> Frame:
        """Radius 1 about z; the distance of the ends from the middle is left to `shape`."""
        n = dr.normalize(self.b - self.a)
        s, t = tangents(n)
        return Frame(self.radius * s, self.radius * t, self.radius * n, 0.5 * (self.a + self.b))

    def shape(self) -> tuple:
        """Half the way from a to b, in radii."""
        return (0.5 * dr.norm(self.b - self.a) / self.radius,)

    @staticmethod
    def extents(whole: Frame, shape: tuple) -> tuple[Any, Any]:
        (h,) = shape
        return h * dr.norm(whole.z) + whole.longest(), h * half_extents(whole, "z") + half_extents(whole, "", "xyz")

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The line in the endless cylinder, and where that ends beyond a cap, in the cap's ball: all of them recentred,
        where no digits cancel. A line that is in the cylinder beyond a cap meets the capsule only through it."""
        (h,), u = shape, dr.uint32_array_t(o.x)
        scale, (middle, half, along, inside) = dr.rcp(squared), through_wall(o, d)
        # A line along the axis is in the cylinder for ever or never. For any line it is enough to know beyond which
        # cap the cylinder is met; one that misses the cylinder (NaN) misses the ball as well.

        def end(sign: int) -> tuple[Any, Any]:
            wall = middle + sign * half
            z = dr.select(along, dr.select((d.z > 0) == (sign > 0), dr.inf, -dr.inf), o.z + wall * d.z)
            on_wall, upper = dr.abs(z) <= h, z > 0
            p = type(o)(o.x, o.y, o.z - dr.select(upper, h, -h))
            nearest_at = -dr.dot(p, d) * scale
            nearest = p + nearest_at * d
            ball = nearest_at + sign * dr.sqrt((1 - dr.squared_norm(nearest)) * scale)
            part = dr.select(on_wall, u(WALL), dr.select(upper, u(CAP_B), u(CAP_A)))
            return dr.select(on_wall, wall, ball), part

        (near, near_part), (far, far_part) = end(-1), end(1)
        return Interval(dr.select(along & ~inside, dr.nan, near), far, near_part, far_part)

    @staticmethod
    def part_at(q: Any, shape: tuple) -> Any:
        (h,), u = shape, dr.uint32_array_t(q.x)
        return dr.select(dr.abs(q.z) <= h, u(WALL), dr.select(q.z > 0, u(CAP_B), u(CAP_A)))

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        away = type(q)(q.x, q.y, _beyond(q, part, shape))
        return 0.5 * (dr.squared_norm(away) - 1), away

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        beyond = _beyond(q, part, shape)
        # The length of the surface from the middle, in radii.
        along = q.z - beyond + dr.atan2(beyond, dr.sqrt(q.x * q.x + q.y * q.y))
        return angle_u(q), 0.5 + along / (dr.pi + 2 * shape[0])

    def mitsuba(self) -> MitsubaShapes | str:
        thing = scalars(self)
        whole = to_world_matrix(thing.frame(), compose(self.transform))
        return MitsubaShapes([{"type": "capsule", "shape": float(thing.shape()[0]), "to_world": whole}])


def _beyond(q: Any, part: Any, shape: tuple) -> Any:
    """How far a point of a part is beyond the nearest point of the axis between a and b, along it."""
    (h,) = shape
    return dr.select(part == WALL, 0, q.z - dr.select(part == CAP_B, h, -h))
