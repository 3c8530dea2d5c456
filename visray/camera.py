"""The camera: a pinhole or a thin lens."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
from pydantic import ConfigDict

from visray.quantities import Angle, Arrays, Direction, LengthOrZero, Point


@dataclass(frozen=True)
class View:
    """The camera prepared for kernels.

    o: origin
    pixel_right, pixel_down: steps from a pixel to its neighbours, on the image plane at distance 1
    corner: top left corner of the picture on that plane, relative to o
    forward: unit direction of the view
    lens_right, lens_up: radius of the lens to the right and up
    inverse_focus: 1 over the distance of focus
    target_distance: distance of the target
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
    """Looks from `origin` to `target`; `up` points upwards in the picture; `fov` is the vertical angle of view.

    `aperture` is the diameter of the lens. Points not at distance `focus` along the view (0: the distance of the
    target) are blurred. With aperture 0 everything is sharp.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    origin: Point = (0.0, 1.0, 6.0)
    target: Point = (0.0, 0.0, 0.0)
    up: Direction = (0.0, 1.0, 0.0)
    fov: Angle = 40.0
    aperture: LengthOrZero = 0.0
    focus: LengthOrZero = 0.0

    def axes(self) -> tuple[Any, Any, Any, Any]:
        """Unit directions right, up and forward in the picture, and the distance of the target. Fields are Dr.Jit
        arrays here, or scalars."""
        # One difference for both results: in forward mode Dr.Jit refuses a derivative that reaches no output.
        view = self.target - self.origin
        forward, target_distance = dr.normalize(view), dr.norm(view)
        right = dr.normalize(dr.cross(forward, self.up))
        return right, dr.cross(right, forward), forward, target_distance

    def view(self, width: int, height: int, a: Arrays) -> View:
        """The camera for a picture of width x height pixels. Fields are Dr.Jit arrays here."""
        right, up, forward, target_distance = self.axes()
        columns, rows = (dr.opaque(a.D, float(x)) for x in (width, height))
        pixel = 2 * dr.tan(self.fov * (0.5 * dr.pi / 180)) / rows
        corner = forward - (0.5 * pixel * columns) * right + (0.5 * pixel * rows) * up
        focus = dr.select(self.focus > 0, self.focus, target_distance)
        lens = (0.5 * self.aperture) * right, (0.5 * self.aperture) * up
        steps = (a.V(v) for v in (pixel * right, -pixel * up, corner, forward))
        return View(self.origin, *steps, *lens, dr.rcp(focus), a.F(target_distance))
