"""Sphere light."""

from dataclasses import dataclass
from typing import Any, Literal

from visray.lights.light import AreaLight
from visray.quantities import Length, Point
from visray.warp import sphere


@dataclass(frozen=True, kw_only=True)
class SphereLight(AreaLight):
    """A sphere about `position`, with `radius`. All points of its surface shine; the sphere does not shadow its own
    light."""

    type: Literal["sphere"] = "sphere"
    position: Point
    radius: Length = 1.0

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        return type(u)(self.radius) * sphere(w, u, v)

    def radius_bound(self) -> Any:
        return self.radius
