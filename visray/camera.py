"""The camera, at `origin`: a pinhole, or a thin lens."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
from pydantic import ConfigDict

from visray.quantities import Angle, Arrays, Direction, LengthOrZero, Point


@dataclass(frozen=True)
class View:
    """The camera, ready for rays.

    o: origin. right, down, corner: the steps of one pixel and the top left corner of the picture, at the distance 1
    along the view. forward: the unit direction of the view.
    aside, above: the lens's radius to the right and up. sharp: 1 over the distance of focus. middle: the distance of
    the target.
    """

    o: Any
    pixel_right: Any
    pixel_down: Any
    corner: Any
    forward: Any
    lens_right: Any
    lens_up: Any
    inverse_focus: Any
    target_distance: Any


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
    aperture: LengthOrZero = 0.0
    focus: LengthOrZero = 0.0

    def axes(self) -> tuple[Any, Any, Any, Any]:
        """The unit directions to the right, up and forward in the picture, and the distance of the target. Fields are
        Dr.Jit arrays here, or scalars."""
        # One difference for both: in forward mode Dr.Jit wants no way from the origin that leads to nothing in the
        # picture.
        view = self.target - self.origin
        forward, middle = dr.normalize(view), dr.norm(view)
        right = dr.normalize(dr.cross(forward, self.up))
        return right, dr.cross(right, forward), forward, middle

    def view(self, width: int, height: int, a: Arrays) -> View:
        """The camera for a picture of so many pixels. Fields are Dr.Jit arrays here."""
        right, up, forward, middle = self.axes()
        across, down = (dr.opaque(a.D, float(x)) for x in (width, height))
        pixel = 2 * dr.tan(self.fov * (0.5 * dr.pi / 180)) / down
        corner = forward - (0.5 * pixel * across) * right + (0.5 * pixel * down) * up
        focus = dr.select(self.focus > 0, self.focus, middle)
        lens = (0.5 * self.aperture) * right, (0.5 * self.aperture) * up
        steps = (a.V(v) for v in (pixel * right, -pixel * up, corner, forward))
        return View(self.origin, *steps, *lens, dr.rcp(focus), a.F(middle))
