"""Sphere light."""

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from visray.lights.light import AreaLight
from visray.quantities import Length, Point
from visray.records import record_kind
from visray.warp import sphere


@record_kind
@dataclass(frozen=True, kw_only=True)
class SphereLight(AreaLight):
    """A sphere about `position`, with `radius`. All points of its surface shine; the sphere does not shadow its own
    light."""

    type: Literal["sphere"] = "sphere"
    position: Point = field(kw_only=False)
    radius: Length = field(default=1.0, kw_only=False)

    shape: ClassVar = ("sphere", {"center": "position", "radius": "radius"})

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        return type(u)(self.radius) * sphere(w, u, v)

    def radius_bound(self) -> Any:
        return self.radius
