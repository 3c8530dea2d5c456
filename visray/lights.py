"""Lights. A new kind is one class here and its name in KINDS."""

from dataclasses import dataclass
from typing import Literal

from pydantic import ConfigDict

from visray.quantities import Color, Factor, Point


@dataclass(frozen=True, kw_only=True)
class PointLight:
    """A light that sends the same in every direction from one point.

    `Ia`, `Id`, `Is` are its ambient, diffuse and specular colours, all scaled by `intensity`. At distance d the diffuse
    and specular parts are weakened by 1 / (a + b d + c d^2); a = b = c = 0 means no attenuation.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    type: Literal["point"] = "point"
    position: Point
    intensity: Factor = 1.0
    Ia: Color = (0.0, 0.0, 0.0)
    Id: Color = (1.0, 1.0, 1.0)
    Is: Color = (1.0, 1.0, 1.0)
    a: Factor = 0.0
    b: Factor = 0.0
    c: Factor = 0.0


KINDS = (PointLight,)
