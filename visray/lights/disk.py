"""Disk light."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr

from visray.geometry import tangents
from visray.lights.light import AreaLight
from visray.quantities import Direction, Length, Point
from visray.warp import disk


@dataclass(frozen=True, kw_only=True)
class DiskLight(AreaLight):
    """A disk about `position`, with `radius`, perpendicular to `normal`; it shines to both sides."""

    type: Literal["disk"] = "disk"
    position: Point
    normal: Direction = (0.0, 1.0, 0.0)
    radius: Length = 1.0

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        s, t = tangents(dr.normalize(self.normal))
        x, y = disk(u, v)
        return x * w(self.radius * s) + y * w(self.radius * t)

    def radius_bound(self) -> Any:
        return self.radius
