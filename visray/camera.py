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
    pixel_right, pixel_down: vectors from a pixel to its right and to its lower neighbour, on the image plane at
        distance 1
    corner: top left corner of the picture on that plane, relative to o
    forward: unit direction of the view
    lens_right, lens_up: vectors from the centre of the lens to its right edge and to its upper edge
    inverse_focus: 1 / distance of the plane in focus
    target_distance: distance from o to the target
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

    `aperture` is the diameter of the lens. With aperture 0 everything is sharp; otherwise only points at distance
    `focus` along the view are sharp. `focus` 0 means the distance of the target.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    origin: Point = (0.0, 1.0, 6.0)
    target: Point = (0.0, 0.0, 0.0)
    up: Direction = (0.0, 1.0, 0.0)
    fov: Angle = 40.0
    aperture: LengthOrZero = 0.0
    focus: LengthOrZero = 0.0

    def axes(self) -> tuple[Any, Any, Any, Any]:
        """Unit directions to the right, up and forward in the picture, and the distance of the target. The camera's
        fields hold Dr.Jit arrays or Dr.Jit scalars here."""
        # One difference serves both results, because in forward mode Dr.Jit refuses a derivative that no output uses.
        view = self.target - self.origin
        forward, target_distance = dr.normalize(view), dr.norm(view)
        right = dr.normalize(dr.cross(forward, self.up))
        return right, dr.cross(right, forward), forward, target_distance

    def view(self, width: int, height: int, a: Arrays) -> View:
        """The camera prepared for a picture of width x height pixels. The camera's fields hold Dr.Jit arrays here."""
        right, up, forward, target_distance = self.axes()
        columns, rows = (dr.opaque(a.D, float(x)) for x in (width, height))
        pixel = 2 * dr.tan(self.fov * (0.5 * dr.pi / 180)) / rows
        corner = forward - (0.5 * pixel * columns) * right + (0.5 * pixel * rows) * up
        focus = dr.select(self.focus > 0, self.focus, target_distance)
        lens = (0.5 * self.aperture) * right, (0.5 * self.aperture) * up
        steps = (a.V(v) for v in (pixel * right, -pixel * up, corner, forward))
        return View(self.origin, *steps, *lens, dr.rcp(focus), a.F(target_distance))
