"""The cameras: perspective, with a pinhole or a thin lens, and orthographic, whose rays are parallel."""

from dataclasses import dataclass, field, fields
from typing import Annotated, Any, ClassVar, Literal

import drjit as dr
from pydantic import ConfigDict, Field

from visray.geometry import gamma, l1_norm
from visray.quantities import Angle, Arrays, Direction, Length, LengthOrZero, Point, Real
from visray.records import record_kind


@dataclass(frozen=True)
class View:
    """A perspective camera prepared for kernels.

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


@dataclass(frozen=True)
class ParallelView:
    """An orthographic camera prepared for kernels. Its rays are parallel. They start on the sheet, the rectangle of the
    picture in the camera's plane. All numbers but `target_distance` are in double.

    o: the camera's origin, in the middle of the sheet
    pixel_right, pixel_down: vectors from a pixel to its right and to its lower neighbour, on the sheet
    corner: top left corner of the sheet, relative to o
    right, up: unit vectors along the sheet
    forward: unit direction of all rays
    half_width, half_height: half the extents of the sheet
    clearance: bound on the rounding error of the distance of a surface in the camera's plane. Crossings nearer than
        this are on the plane, and not in front of it
    target_distance: distance from o to the target
    """

    o: Any
    pixel_right: Any
    pixel_down: Any
    corner: Any
    right: Any
    up: Any
    forward: Any
    half_width: Any
    half_height: Any
    clearance: Any
    target_distance: Any


ShareOfFrame = Annotated[Real, Field(ge=-1, le=1)]


@record_kind
@dataclass(frozen=True, kw_only=True)
class Shutter:
    """When a camera's shutter is open: what moves in this time is blurred. Only animated scenes have motion blur.

    open, close: moments at which it opens and closes, as shares of the time from one frame to the next, counted from
        the time of the frame. A shutter angle of 180 degrees is 0.5 of a frame.
    moments: number of moments at which the scene is looked at while the shutter is open. The samples of each pixel are
        spread over them.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")
    open: ShareOfFrame = 0.0
    close: ShareOfFrame = 0.5
    moments: Annotated[int, Field(strict=True, ge=1, le=1024)] = 16

    def times(self, t: float, frame: float) -> list[float]:
        """The moments in seconds: the middles of equal parts of the time in which the shutter is open.

        t: time of the frame. frame: seconds from one frame to the next.
        """
        step = (self.close - self.open) / self.moments
        return [t + frame * (self.open + (i + 0.5) * step) for i in range(self.moments)]


@dataclass(frozen=True, kw_only=True)
class Viewpoint:
    """The camera is at `origin` and looks at `target`; `up` points upwards in the picture. `shutter`: when it is open,
    for motion blur; null: for an instant."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    # By the name of a field that only another type of camera has: what is right instead.
    MISPLACED: ClassVar[dict[str, str]] = {}

    origin: Point = field(default=(0.0, 1.0, 6.0), kw_only=False)
    target: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    up: Direction = (0.0, 1.0, 0.0)
    shutter: Shutter | None = None

    def axes(self) -> tuple[Any, Any, Any, Any]:
        """Unit directions to the right, up and forward in the picture, and the vector to the target. The camera's
        fields hold Dr.Jit arrays or Dr.Jit scalars here."""
        view = self.target - self.origin
        forward = dr.normalize(view)
        right = dr.normalize(dr.cross(forward, self.up))
        return right, dr.cross(right, forward), forward, view


@record_kind
@dataclass(frozen=True, kw_only=True)
class Camera(Viewpoint):
    """A perspective camera: its rays start at one point, or on a lens around it. `fov` is the vertical angle of view.

    `aperture` is the diameter of the lens. With aperture 0 everything is sharp; otherwise only points at distance
    `focus` along the view are sharp. `focus` 0 means the distance of the target.
    """

    MISPLACED: ClassVar[dict[str, str]] = {
        "height": 'a perspective camera has none; write fov, or "type": "orthographic"'
    }

    type: Literal["perspective"] = "perspective"
    fov: Angle = 40.0
    aperture: LengthOrZero = 0.0
    focus: LengthOrZero = 0.0

    def view(self, size: tuple[int, int], reach: float, a: Arrays) -> View:
        """The camera prepared for a picture. The camera's fields hold Dr.Jit arrays here.

        size: width and height of the picture in pixels
        reach: how far rays start or aim beyond the edges of the picture, in pixels
        """
        right, up, forward, to_target = self.axes()
        columns, rows = (dr.opaque(a.D, float(x)) for x in size)
        pixel = 2 * dr.tan(self.fov * (0.5 * dr.pi / 180)) / rows
        corner = forward - (0.5 * pixel * columns) * right + (0.5 * pixel * rows) * up
        # The distance of the target is computed twice, because in forward mode Dr.Jit refuses to follow a number that a
        # kernel reads to other numbers that it does not read.
        focus = dr.select(self.focus > 0, self.focus, dr.norm(to_target))
        lens = (0.5 * self.aperture) * right, (0.5 * self.aperture) * up
        steps = (a.V(v) for v in (pixel * right, -pixel * up, corner, forward))
        return View(self.origin, *steps, *lens, dr.rcp(focus), a.F(dr.norm(to_target)))


@record_kind
@dataclass(frozen=True, kw_only=True)
class OrthographicCamera(Viewpoint):
    """An orthographic camera: its rays are parallel, so that parallel lines stay parallel and distance makes nothing
    smaller. `height` is the vertical extent of the picture. What lies behind the camera's plane is not seen."""

    MISPLACED: ClassVar[dict[str, str]] = {
        "fov": "an orthographic camera has none; write height, the vertical extent of the picture in world units",
        "aperture": "an orthographic camera has no lens; leave it out",
        "focus": "an orthographic camera has no lens; leave it out",
    }
    # No field: parallel rays pass no lens.
    aperture: ClassVar[float] = 0.0

    type: Literal["orthographic"] = "orthographic"
    height: Length = 4.0

    def view(self, size: tuple[int, int], reach: float, a: Arrays) -> ParallelView:
        """The camera prepared for a picture. The camera's fields hold Dr.Jit arrays here.

        size, reach: as in Camera.view
        Error: the distance of a surface in the camera's plane has the roundings of a surface's distance from a point
            (culling.point_rounding) for points of the sheet. Numbers of the surface are assumed to be at most as large
            as those of the sheet and the target's distance.
        """
        right, up, forward, to_target = self.axes()
        columns, rows = (dr.opaque(a.D, float(x)) for x in size)
        pixel, half_height = self.height / rows, 0.5 * self.height
        half_width = half_height * columns / rows
        corner = half_height * up - half_width * right
        extent = l1_norm(self.origin) + l1_norm(corner) + dr.detach(dr.norm(to_target))
        if reach:
            extent += reach * (l1_norm(pixel * right) + l1_norm(pixel * up))
        return ParallelView(
            o=self.origin,
            pixel_right=pixel * right,
            pixel_down=-pixel * up,
            corner=corner,
            right=right,
            up=up,
            forward=forward,
            half_width=half_width,
            half_height=half_height,
            clearance=dr.detach(gamma(32) * extent),
            target_distance=a.F(dr.norm(to_target)),
        )


KINDS = (Camera, OrthographicCamera)
BY_TYPE = {kind.type: kind for kind in KINDS}


def retyped(camera: dict[str, Any], type: str) -> dict[str, Any]:
    """The fields of a camera that becomes one of another type. Those that both types have are kept; all others have
    their default values.

    camera: fields of the camera as plain values
    type: name of a type of camera
    """
    defaults = {f.name: f.default for f in fields(BY_TYPE[type])}
    return defaults | {name: value for name, value in camera.items() if name in defaults and name != "type"}
