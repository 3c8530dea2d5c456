"""Cameras of scenes, as poses of the camera of a web page, and back.

A page has a perspective camera that turns around the point it looks at. It knows neither lenses nor parallel rays: what
a scene's camera has beside its pose is kept here. A page shows an orthographic camera as one that is far away.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from visray.camera import OrthographicCamera

# Vertical angle of view, in degrees, of the page's camera that stands for an orthographic one.
FAR_AWAY_FOV = 4.0
# The page's distance from the camera to the point it looks at, at first. Keys move 2 of its units a second.
HOME_DISTANCE = 4.0
# A camera is no nearer to the point it looks at, in units of the page: from there its direction would be rounded.
NEAREST = 1e-6
# Two poses are the same if they differ by less than this share of their distance: rounding in the page is less.
SAME = 1e-7
# If the view is as close to the vertical as this (sine of the angle), `up` is made perpendicular to it.
STEEP = 0.02
# Bounds of the angle of view, in degrees, when a narrow window shows the whole width of a film.
WIDEST = 160.0


@dataclass(frozen=True)
class Pose:
    """Where the camera of a page is. Points are in units of the page.

    position: its place
    look_at: the point around which it turns
    up: the axis around which it turns. Any length
    true_up: upwards in the picture, perpendicular to the view
    """

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    up: tuple[float, float, float]
    true_up: tuple[float, float, float] | None = None

    @property
    def distance(self) -> float:
        """Distance from the camera to the point it looks at."""
        return math.dist(self.position, self.look_at)

    def is_valid(self) -> bool:
        """Whether a camera can be there."""
        numbers = (*self.position, *self.look_at, *self.up)
        return all(math.isfinite(x) and abs(x) < 1e12 for x in numbers) and self.distance > NEAREST and any(self.up)

    def is_same(self, other: "Pose") -> bool:
        """Whether it is another pose but for rounding."""
        near = SAME * max(self.distance, other.distance)
        directions = (np.divide(x.up, math.hypot(*x.up)) for x in (self, other))
        return (
            math.dist(self.position, other.position) < near
            and math.dist(self.look_at, other.look_at) < near
            and math.dist(*directions) < 10 * SAME
        )


@dataclass(frozen=True)
class Space:
    """Coordinates of pages: those of the scene from another origin and with another unit. So keys and handles of pages
    work for a molecule and for a galaxy.

    centre: the point of the scene at the page's origin
    unit: length of the page's unit, in world units
    """

    centre: tuple[float, float, float]
    unit: float

    @staticmethod
    def around(camera: Any) -> "Space":
        """The coordinates in which the target of a camera is the origin."""
        return Space(tuple(camera.target), math.dist(camera.origin, camera.target) / HOME_DISTANCE)

    def to_page(self, point: Any) -> tuple[float, float, float]:
        """A point of the scene, in coordinates of the page."""
        return tuple((float(x) - c) / self.unit for x, c in zip(point, self.centre))

    def to_world(self, point: Any) -> tuple[float, float, float]:
        """A point of the page, in coordinates of the scene."""
        return tuple(float(x) * self.unit + c for x, c in zip(point, self.centre))


def pose_of(camera: Any, space: Space) -> Pose:
    """The pose of a page that shows what a camera of the scene shows."""
    origin, target = (np.array(x, float) for x in (camera.origin, camera.target))
    if isinstance(camera, OrthographicCamera):
        back = (origin - target) / math.dist(origin, target)
        origin = target + back * (0.5 * camera.height / math.tan(math.radians(FAR_AWAY_FOV) / 2))
    return Pose(space.to_page(origin), space.to_page(target), tuple(camera.up))


def camera_at(base: Any, pose: Pose, space: Space) -> Any:
    """A camera of the scene at a pose of the page.

    base: camera of the scene; what a page does not know, such as the lens and the shutter, is as in it
    pose: domain: it is valid
    """
    if pose.is_same(pose_of(base, space)):
        return base
    origin, target = (np.array(space.to_world(x)) for x in (pose.position, pose.look_at))
    distance = math.dist(origin, target)
    up = tuple(float(x) for x in pose.up)
    back = (origin - target) / distance
    if math.hypot(*np.cross(back, up)) < STEEP * math.hypot(*up) and pose.true_up is not None:
        up = tuple(float(x) for x in pose.true_up)
    changes = {}
    if isinstance(base, OrthographicCamera):
        changes["height"] = float(2 * distance * math.tan(math.radians(FAR_AWAY_FOV) / 2))
        # The camera's plane is as far from the target as it was, so that what is before it stays so.
        origin = target + back * math.dist(base.origin, base.target)
    return replace(base, origin=_numbers(origin), target=_numbers(target), up=up, **changes)


def widening(film: tuple[int, int], window: tuple[int, int]) -> float:
    """Factor of the vertical extent of a picture in a window narrower than the film, so that the window shows the whole
    width of the film; 1 for all other windows.

    film, window: width and height in pixels
    """
    return max(1.0, (film[0] / film[1]) / (window[0] / window[1]))


def widened(camera: Any, factor: float) -> Any:
    """A camera whose picture has another vertical extent. factor: at least 1."""
    if factor == 1:
        return camera
    if isinstance(camera, OrthographicCamera):
        return replace(camera, height=camera.height * factor)
    return replace(camera, fov=_widened_angle(camera.fov, factor))


def page_fov(camera: Any, factor: float) -> float:
    """Vertical angle of view of the page that shows a camera, in degrees. factor: as for `widened`."""
    return _widened_angle(FAR_AWAY_FOV if isinstance(camera, OrthographicCamera) else camera.fov, factor)


def _widened_angle(fov: float, factor: float) -> float:
    """An angle of view, in degrees, whose picture is `factor` times as high."""
    if factor == 1:
        return fov
    return max(fov, min(math.degrees(2 * math.atan(math.tan(math.radians(fov) / 2) * factor)), WIDEST))


def _numbers(point: Any) -> tuple[float, float, float]:
    return tuple(float(x) for x in point)
