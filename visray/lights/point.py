"""Point light."""

from dataclasses import dataclass, field
from typing import Literal

from visray.lights.light import Light
from visray.quantities import Point
from visray.records import record_kind


@record_kind
@dataclass(frozen=True, kw_only=True)
class PointLight(Light):
    """A light that sends the same light in every direction from one point."""

    type: Literal["point"] = "point"
    position: Point = field(kw_only=False)
