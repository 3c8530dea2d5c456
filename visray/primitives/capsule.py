"""The capsule."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr
import numpy as np

from visray.geometry import Frame, tangents
from visray.primitives.convex import ConvexSolid, Interval
from visray.primitives.primitive import MitsubaShapes, half_extents, scalars, to_world_matrix
from visray.primitives.revolved import angle_u, through_wall
from visray.quantities import FARTHEST, Length, Point
from visray.records import record_kind
from visray.transforms import compose

# The parts of the surface.
WALL, CAP_A, CAP_B = range(3)


@record_kind
@dataclass(frozen=True, kw_only=True)
class Capsule(ConvexSolid):
    """A cylinder with hemispherical caps: all points within `radius` of the segment from `a` to `b`.

    uv: u goes around the axis, as on the cylinder. v is proportional to the length along the surface, from 0 at the tip
    near a to 1 at the tip near b. So v has no jump between the wall and the caps.
    """

    parts = 3
    smooth = True
    v_ends = True
    girth = 1.0
    axis_fields = ("a", "b")

    type: Literal["capsule"] = "capsule"
    a: Point = field(default=(0.0, -0.5, 0.0), kw_only=False)
    b: Point = field(default=(0.0, 0.5, 0.0), kw_only=False)
    radius: Length = field(default=0.5, kw_only=False)

    def flaws(self) -> list[tuple[str, str]]:
        same = max(abs(y - x) for x, y in zip(self.a, self.b)) < 1 / FARTHEST
        return [("b", "must be another point than a; where they are one, write a sphere")] if same else []

    def frame(self) -> Frame:
        """The frame of the canonical capsule, which has radius 1 and its segment on the z axis."""
        n = dr.normalize(self.b - self.a)
        s, t = tangents(n)
        return Frame(self.radius * s, self.radius * t, self.radius * n, 0.5 * (self.a + self.b))

    def shape(self) -> tuple:
        """(h,): half the length of the segment from a to b, in units of the radius."""
        return (0.5 * dr.norm(self.b - self.a) / self.radius,)

    @staticmethod
    def reshaped(q: np.ndarray, was: tuple, now: tuple) -> np.ndarray:
        """As Primitive.reshaped. A point keeps its share of the length along the surface, as v does."""
        (h,), (new,) = was, now
        x, y, z = q.T
        radius, beyond = np.hypot(x, y), np.maximum(np.abs(z) - h, 0)
        along = np.minimum(np.abs(z), h) + np.arctan2(beyond, radius)
        along *= (new + np.pi / 2) / (h + np.pi / 2)
        angle = np.maximum(along - new, 0)
        factor = np.cos(angle) / np.where(radius > 0, radius, 1)
        return np.stack([x * factor, y * factor, np.copysign(np.minimum(along, new) + np.sin(angle), z)], axis=1)

    @staticmethod
    def extents(to_world: Frame, shape: tuple) -> tuple[Any, Any]:
        (h,) = shape
        radius = h * dr.norm(to_world.z) + to_world.max_stretch()
        return radius, h * half_extents(to_world, "z") + half_extents(to_world, "", "xyz")

    @staticmethod
    def canonical_volume(shape: tuple) -> Any:
        return 2 * dr.pi * shape[0] + 4 / 3 * dr.pi

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The interval inside the capsule.

        First the interval inside the infinite cylinder is found. If one of its ends lies above or below the wall, the
        line can only cross the cap on that side. Then this end is replaced by the crossing with the ball of this cap.
        Both quadratic equations are solved with the origin moved to the point of the line nearest to the axis, or to
        the ball's centre. There, no digits cancel.
        """
        (h,), u = shape, dr.uint32_array_t(o.x)
        scale, (middle, half, along, inside) = dr.rcp(squared), through_wall(o, d)
        # A line parallel to the axis is inside the infinite cylinder everywhere or nowhere; it crosses both caps. A
        # line that misses the cylinder also misses both balls; its ends are NaN.

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
        from_axis = type(q)(q.x, q.y, _beyond(q, part, shape))
        return 0.5 * (dr.squared_norm(from_axis) - 1), from_axis

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        beyond = _beyond(q, part, shape)
        # Length along the surface, counted from the middle of the wall, in units of the radius.
        along = q.z - beyond + dr.atan2(beyond, dr.sqrt(q.x * q.x + q.y * q.y))
        return angle_u(q), 0.5 + along / (dr.pi + 2 * shape[0])

    def mitsuba(self) -> MitsubaShapes | str:
        capsule = scalars(self)
        matrix = to_world_matrix(capsule.frame(), compose(self.transform))
        return MitsubaShapes([{"type": "capsule", "shape": float(capsule.shape()[0]), "to_world": matrix}])


def _beyond(q: Any, part: Any, shape: tuple) -> Any:
    """z coordinate of a point on a cap, relative to the centre of the cap's ball; zero for a point on the wall."""
    (h,) = shape
    return dr.select(part == WALL, 0, q.z - dr.select(part == CAP_B, h, -h))
