"""The camera: a pinhole at `origin`."""

from dataclasses import dataclass

from pydantic import ConfigDict

from visray.quantities import Angle, Direction, Point


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Looks from `origin` to `target`; `up` is upwards in the picture; `fov` is the vertical angle of view."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    origin: Point = (0.0, 1.0, 6.0)
    target: Point = (0.0, 0.0, 0.0)
    up: Direction = (0.0, 1.0, 0.0)
    fov: Angle = 40.0
