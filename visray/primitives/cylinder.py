"""The capped cylinder."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame
from visray.primitives.convex import Interval, slab
from visray.primitives.primitive import MitsubaShapes, scalars, to_world_matrix
from visray.primitives.revolved import Revolved, angle_u, axial_frame, through_wall
from visray.quantities import Direction, Length, Point
from visray.records import record_kind
from visray.transforms import compose

# The parts of the surface.
WALL, BOTTOM, TOP = range(3)


@record_kind
@dataclass(frozen=True, kw_only=True)
class Cylinder(Revolved):
    """A closed cylinder with flat caps. `center` is its centre, and `height` its length along `axis`.

    uv: on the wall, u goes eastwards around the axis, and v along the axis from 0 to 1. On the caps, u and v go from 0
    to 1 on the square around the disk.
    """

    parts = 3
    axis_fields = ("axis",)

    type: Literal["cylinder"] = "cylinder"
    center: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    axis: Direction = field(default=(0.0, 1.0, 0.0), kw_only=False)
    radius: Length = field(default=0.5, kw_only=False)
    height: Length = field(default=1.0, kw_only=False)

    def frame(self) -> Frame:
        return axial_frame(self.center, self.axis, self.radius, self.height)

    @staticmethod
    def canonical_volume(shape: tuple) -> Any:
        return 2 * dr.pi

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The interval inside the infinite cylinder, intersected with the interval in the slab between the caps."""
        wall = dr.uint32_array_t(o.x)(WALL)
        middle, half, along, inside = through_wall(o, d)
        near = dr.select(along, dr.select(inside, -dr.inf, dr.inf), middle - half)
        far = dr.select(along, dr.select(inside, dr.inf, -dr.inf), middle + half)
        return Interval(near, far, wall, wall).intersection(slab(o.z, d.z, BOTTOM, TOP))

    @staticmethod
    def part_at(q: Any, shape: tuple) -> Any:
        """The part nearest to a point q of the surface: the part with the greatest signed distance from q."""
        u = dr.uint32_array_t(q.x)
        wall = dr.sqrt(q.x * q.x + q.y * q.y) >= dr.abs(q.z)
        return dr.select(wall, u(WALL), dr.select(q.z < 0, u(BOTTOM), u(TOP)))

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        wall, zero = part == WALL, 0 * q.z
        f = dr.select(wall, 0.5 * (q.x * q.x + q.y * q.y - 1), dr.select(part == TOP, q.z, -q.z) - 1)
        cap = dr.select(part == TOP, 1 + zero, -1)
        return f, dr.select(wall, type(q)(q.x, q.y, zero), type(q)(zero, zero, cap))

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        wall = part == WALL
        up = dr.select(part == TOP, q.y, -q.y)
        return dr.select(wall, angle_u(q), 0.5 + 0.5 * q.x), dr.select(wall, 0.5 + 0.5 * q.z, 0.5 + 0.5 * up)

    def mitsuba(self) -> MitsubaShapes | str:
        return MitsubaShapes(
            [{"type": "cylinder", "to_world": to_world_matrix(scalars(self).frame(), compose(self.transform))}]
        )
