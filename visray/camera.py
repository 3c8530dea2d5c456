"""The camera, at `origin`: a pinhole, or a thin lens."""

from dataclasses import dataclass

from pydantic import ConfigDict

from visray.quantities import Angle, Breadth, Direction, Point


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Looks from `origin` to `target`; `up` is upwards in the picture; `fov` is the vertical angle of view.

    `aperture` is the diameter of the lens: what is not at the distance `focus` (along the view; 0 means that of the
    target) is blurred. With 0 everything is sharp.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    origin: Point = (0.0, 1.0, 6.0)
    target: Point = (0.0, 0.0, 0.0)
    up: Direction = (0.0, 1.0, 0.0)
    fov: Angle = 40.0
    aperture: Breadth = 0.0
    focus: Breadth = 0.0
