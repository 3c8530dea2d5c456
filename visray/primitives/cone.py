"""The capped cone."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame
from visray.primitives.convex import Interval, slab
from visray.primitives.primitive import MitsubaShapes, Placed, scalars, to_world_matrix
from visray.primitives.revolved import Revolved, angle_u, axial_frame
from visray.quantities import Direction, Length, Point
from visray.records import record_kind
from visray.transforms import compose

# The parts of the surface.
WALL, BASE = range(2)


@record_kind
@dataclass(frozen=True, kw_only=True)
class Cone(Revolved):
    """A closed cone. Its base is a disk of `radius` about the point `base`. Its apex is `height` away along `axis`.

    uv: on the wall, u goes around the axis, counter-clockwise as seen from the apex, and v along the axis from 0 at the
    base to 1 at the apex. On the base, u and v go from 0 to 1 on the square around the disk.
    """

    parts = 2
    v_ends = True
    axis_fields = ("axis",)

    type: Literal["cone"] = "cone"
    base: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    axis: Direction = field(default=(0.0, 1.0, 0.0), kw_only=False)
    radius: Length = field(default=0.5, kw_only=False)
    height: Length = field(default=1.0, kw_only=False)

    def frame(self) -> Frame:
        middle = self.base + 0.5 * self.height * dr.normalize(self.axis)
        return axial_frame(middle, self.axis, self.radius, self.height)

    @staticmethod
    def canonical_volume(shape: tuple) -> Any:
        return 2 / 3 * dr.pi

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The interval inside the cone.

        The canonical cone has its base at z = -1 and its apex at z = 1. It is the set x^2 + y^2 <= w^2 with
        w = (1 - z)/2 >= 0, intersected with the slab -1 <= z <= 1.

        The origin is moved to the point of the line nearest to the apex, where no digits cancel, even if the line
        almost meets the apex. Along the line, x^2 + y^2 - w^2 is a t^2 + 2 b t + c. If a >= 0, the line is inside
        between the two roots; one of them is infinite if the line is parallel to the wall. If a < 0, the line is inside
        beyond one of the roots, on the side where w grows.
        """
        wall = dr.uint32_array_t(o.x)(WALL)
        shift = -(o.x * d.x + o.y * d.y + (o.z - 1) * d.z) * dr.rcp(squared)
        p = type(d)(o.x + shift * d.x, o.y + shift * d.y, (o.z - 1) + shift * d.z)
        w, dw = -0.5 * p.z, -0.5 * d.z
        a = d.x * d.x + d.y * d.y - dw * dw
        b = p.x * d.x + p.y * d.y - w * dw
        c = p.x * p.x + p.y * p.y - w * w
        disc = b * b - a * c
        root = dr.sqrt(dr.select((disc < 0) & (a < 0), 0, disc))
        q = -(b + dr.copysign(root, b))
        # q = 0 only if b = 0 and disc = 0. Then both roots are 0 if a != 0. If a = 0, the line runs along the wall; it
        # counts as a miss (NaN).
        first, second = dr.select(q == 0, 0, c / q), q / a
        low, high = dr.select(first < second, first, second), dr.select(first < second, second, first)
        forward = dw > 0
        near = dr.select(a >= 0, low, dr.select(forward, high, -dr.inf)) + shift
        far = dr.select(a >= 0, high, dr.select(forward, dr.inf, low)) + shift
        # The upper side of the slab touches the cone only at the apex, so a crossing there has the part WALL.
        return Interval(near, far, wall, wall).intersection(slab(o.z, d.z, BASE, WALL))

    @staticmethod
    def part_at(q: Any, shape: tuple) -> Any:
        """The part nearest to a point q of the surface: the part with the greatest signed distance from q."""
        u = dr.uint32_array_t(q.x)
        return dr.select(dr.sqrt(q.x * q.x + q.y * q.y) - 0.5 * (1 - q.z) >= -1 - q.z, u(WALL), u(BASE))

    @classmethod
    def inside(cls, placed: Placed, p: Any) -> Any:
        # The polynomial of the wall is negative beyond the apex too, in the mirror image of the cone.
        return super().inside(placed, p) & (placed.inverse.point(p).z < 1)

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        wall, w, zero = part == WALL, 0.5 * (1 - q.z), 0 * q.z
        f = dr.select(wall, 0.5 * (q.x * q.x + q.y * q.y - w * w), -1 - q.z)
        # At the apex the wall has no unique normal. The axis is the mean of all its normals.
        apex = (q.x == 0) & (q.y == 0)
        slope = type(q)(q.x, q.y, dr.select(apex, 1, 0.5 * w))
        return f, dr.select(wall, slope, type(q)(zero, zero, zero - 1))

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        wall = part == WALL
        return dr.select(wall, angle_u(q), 0.5 + 0.5 * q.x), dr.select(wall, 0.5 + 0.5 * q.z, 0.5 - 0.5 * q.y)

    def mitsuba(self) -> MitsubaShapes | str:
        return MitsubaShapes(
            [{"type": "cone", "to_world": to_world_matrix(scalars(self).frame(), compose(self.transform))}]
        )
