"""Disk light."""

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import drjit as dr

from visray.geometry import tangents
from visray.lights.light import AreaLight
from visray.quantities import Direction, Length, Point
from visray.records import record_kind
from visray.warp import disk


@record_kind
@dataclass(frozen=True, kw_only=True)
class DiskLight(AreaLight):
    """A disk about `position`, with `radius`, perpendicular to `normal`; it shines to both sides."""

    type: Literal["disk"] = "disk"
    position: Point = field(kw_only=False)
    normal: Direction = field(default=(0.0, 1.0, 0.0), kw_only=False)
    radius: Length = field(default=1.0, kw_only=False)

    shape: ClassVar = ("disk", {"center": "position", "normal": "normal", "radius": "radius"})

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        s, t = tangents(dr.normalize(self.normal))
        x, y = disk(u, v)
        return x * w(self.radius * s) + y * w(self.radius * t)

    def radius_bound(self) -> Any:
        return self.radius
