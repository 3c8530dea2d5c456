"""Point light."""

from dataclasses import dataclass
from typing import Literal

from visray.lights.light import Light
from visray.quantities import Point


@dataclass(frozen=True, kw_only=True)
class PointLight(Light):
    """A light that sends the same light in every direction from one point."""

    type: Literal["point"] = "point"
    position: Point
