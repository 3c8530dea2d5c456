"""The disk."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.flat import Flat
from visray.primitives.primitive import MitsubaShapes, half_extents, scalars, to_world_matrix
from visray.quantities import Direction, Length, Point
from visray.records import record_kind
from visray.transforms import compose


@record_kind
@dataclass(frozen=True, kw_only=True)
class Disk(Flat):
    """A disk of `radius` about `center`.

    uv: from 0 to 1 on the square around the disk. A texture has the same up direction as on a plane with this normal.
    """

    axis_fields = ("normal",)

    type: Literal["disk"] = "disk"
    center: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    normal: Direction = field(default=(0.0, 1.0, 0.0), kw_only=False)
    radius: Length = field(default=1.0, kw_only=False)

    def frame(self) -> Frame:
        n = dr.normalize(self.normal)
        s, t = tangents(n)
        return Frame(self.radius * s, self.radius * t, n, self.center)

    @staticmethod
    def extents(to_world: Frame, shape: tuple) -> tuple[Any, Any]:
        flat = Frame(to_world.x, to_world.y, 0 * to_world.z, to_world.o)
        return flat.max_stretch(), half_extents(to_world, "", "xy")

    @staticmethod
    def within(x: Any, y: Any) -> Any:
        return x * x + y * y <= 1

    def advice_for_solid(self) -> str:
        return "use a solid, such as a thin cylinder"

    def mitsuba(self) -> MitsubaShapes | str:
        return MitsubaShapes(
            [{"type": "disk", "to_world": to_world_matrix(scalars(self).frame(), compose(self.transform))}]
        )
