"""Parallelogram light."""

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import drjit as dr
import numpy as np

from visray.lights.light import AreaLight
from visray.quantities import Point, Vector
from visray.records import record_kind


@record_kind
@dataclass(frozen=True, kw_only=True)
class RectangleLight(AreaLight):
    """A parallelogram with centre `position`. The vectors `width` and `height` are its sides. It shines both ways."""

    type: Literal["rectangle"] = "rectangle"
    position: Point = field(kw_only=False)
    width: Vector = field(default=(1.0, 0.0, 0.0), kw_only=False)
    height: Vector = field(default=(0.0, 0.0, 1.0), kw_only=False)

    shape: ClassVar = ("rectangle", {"center": "position", "width": "width", "height": "height"})

    def flaws(self) -> list[tuple[str, str]]:
        w, h = np.array(self.width), np.array(self.height)
        # The bound is that of rounding: three differences of products of components as large as the sides.
        parallel = np.linalg.norm(np.cross(w, h)) <= 8 * np.finfo(float).eps * np.linalg.norm(w) * np.linalg.norm(h)
        return [("height", "must not be parallel to width: the light would have no area")] if parallel else []

    def point_offset(self, w: Any, u: Any, v: Any) -> Any:
        return (u - 0.5) * w(self.width) + (v - 0.5) * w(self.height)

    def radius_bound(self) -> Any:
        return 0.5 * (dr.norm(self.width) + dr.norm(self.height))
