"""A camera and lights that suit what is to be seen: all of it is in the picture.

Camera axes are three unit vectors of the world: to the right, upwards and forward in the picture.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from visray.camera import Camera
from visray.lights import SphereLight
from visray.lights.light import Light

# Vertical angle of view, in degrees: narrow, so that what is near the edge of the picture hardly leans.
FOV = 28.0
# Linear colour of a background: nearly white, like paper.
PAPER = (0.88, 0.9, 0.92)
# Numbers of the scene are rounded to this share of its size, so that a file is easy to read.
ROUNDED = 1 / 100_000


@dataclass(frozen=True)
class Window:
    """The part of a picture in which everything lies. The picture is from -1 to 1, from left to right and from the
    bottom to the top."""

    left: float = -0.94
    right: float = 0.94
    bottom: float = -0.94
    top: float = 0.94


@dataclass(frozen=True)
class Balls:
    """Balls that together contain what a picture must show. Shapes: centre (N, 3), radius (N)."""

    centre: np.ndarray
    radius: np.ndarray

    def joined(self, other: "Balls") -> "Balls":
        """These balls and others."""
        return Balls(np.concatenate([self.centre, other.centre]), np.concatenate([self.radius, other.radius]))

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """The low and the high corner of their bounding box. Shape: (3) each."""
        return self._box

    @cached_property
    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        """As box, which many cameras and lights ask for."""
        low, high = ((self.centre + s * self.radius[:, None]) for s in (-1, 1))
        return low.min(axis=0), high.max(axis=0)

    def middle(self) -> np.ndarray:
        """Middle of their bounding box. Shape: (3)."""
        low, high = self.box()
        return 0.5 * (low + high)

    def reach(self) -> float:
        """Radius of a ball about the middle that contains them all."""
        return self._reach

    @cached_property
    def _reach(self) -> float:
        """As reach, which many cameras and lights ask for."""
        return float((np.linalg.norm(self.centre - self.middle(), axis=1) + self.radius).max())


def fitted_view(
    shown: Balls,
    axes: np.ndarray,
    aspect: float,
    window: Window | None = None,
    share: float = ROUNDED,
    fov: float = FOV,
) -> Camera:
    """The nearest camera with given axes that sees all balls in a window of its picture.

    shown: what the picture shows.
    aspect: width of the picture divided by its height.
    window: the part of the picture for it; None leaves a small margin.
    share: of the size of what is shown to which numbers are rounded.
    fov: vertical angle of view, in degrees.
    """
    origin, z, depth = _place(shown, axes, aspect, window or Window(), fov)
    target = origin + axes[2] * float(np.median(depth) - z)
    rounded = _rounding(shown, share)
    return Camera(origin=rounded(origin), target=rounded(target), up=tuple(np.round(axes[1], 6).tolist()), fov=fov)


def fitted_origin(shown: Balls, axes: np.ndarray, aspect: float, window: Window, fov: float) -> tuple:
    """The origin of the camera of `fitted_view`, with the same arguments, in less time."""
    return _rounding(shown, ROUNDED)(_place(shown, axes, aspect, window, fov)[0])


def _place(
    shown: Balls, axes: np.ndarray, aspect: float, window: Window, fov: float
) -> tuple[np.ndarray, float, np.ndarray]:
    """The origin of the nearest camera, its depth along the view direction, and the depths of the balls' centres.
    Arguments: as in `fitted_view`. Shapes: (3), (), (N)."""
    w, slope = window, np.tan(np.radians(fov / 2))
    x, y, depth = axes @ shown.centre.T
    across = _Limits.of(x, depth, shown.radius, w.left * slope * aspect, w.right * slope * aspect)
    upwards = _Limits.of(y, depth, shown.radius, w.bottom * slope, w.top * slope)
    z = min(across.nearest(), upwards.nearest())
    return np.array([across.middle(z), upwards.middle(z), z]) @ axes, z, depth


@dataclass(frozen=True)
class _Limits:
    """Where a camera can be so that all balls lie between two planes through it, along one axis of the picture.

    A camera at x and depth z sees a point (X, Z) at the slope (X - x) / (Z - z). All balls have slopes between `low`
    and `high` if x - high z >= least and x - low z <= most.
    """

    low: float
    high: float
    least: float
    most: float

    @staticmethod
    def of(x: np.ndarray, z: np.ndarray, radius: np.ndarray, low: float, high: float) -> "_Limits":
        """The limits for balls with centres (x, z). low, high: slopes between which they must lie."""
        least = (x - high * z + radius * np.hypot(1, high)).max()
        most = (x - low * z - radius * np.hypot(1, low)).min()
        return _Limits(low, high, float(least), float(most))

    def nearest(self) -> float:
        """The greatest z of such a camera."""
        return (self.most - self.least) / (self.high - self.low)

    def middle(self, z: float) -> float:
        """The middle of the x that such a camera can have at z."""
        return 0.5 * (self.least + self.most + (self.low + self.high) * z)


def _rounding(shown: Balls, share: float) -> Any:
    """A function that rounds points to a share of the size of what is shown."""
    places = int(np.ceil(-np.log10(share * shown.reach())))
    # Adding 0 makes 0 of -0.
    return lambda point: tuple((np.round(point, places) + 0.0).tolist())


@dataclass(frozen=True)
class Rig:
    """Two lights, as they stand to the camera.

    key, fill: directions to the lights in camera axes, backwards in place of forward. The key light is at the upper
        left, so shadows fall to the right; the fill light is at the right.
    key_light, fill_light: their diffuse light.
    distance: of the lights from the middle of the scene, in radii of the scene.
    key_radius, fill_radius: their radii, in radii of the scene. Shadows of the key light are soft, and those of the
        fill light are so soft that they are hardly seen.
    key_samples, fill_samples: points of a light that each sample of a pixel asks.
    """

    key: tuple[float, float, float] = (-0.5, 0.3, 0.81)
    fill: tuple[float, float, float] = (0.7, -0.1, 0.7)
    key_light: float = 0.75
    fill_light: float = 0.15
    distance: float = 6.0
    key_radius: float = 0.8
    fill_radius: float = 4.0
    key_samples: int = 3
    fill_samples: int = 1


def fitted_lights(
    shown: Balls,
    axes: np.ndarray,
    rig: Rig = Rig(),
    share: float = ROUNDED,
) -> dict[str, Light]:
    """A key light with soft shadows and a weak fill light, by their names. share: as in `fitted_view`."""
    backwards = axes * np.array([[1.0], [1.0], [-1.0]])
    reach, rounded = shown.reach(), _rounding(shown, share)

    def light(toward: tuple, radius: float, brightness: float, samples: int, shine: float) -> SphereLight:
        position = shown.middle() + rig.distance * reach * (toward / np.linalg.norm(toward)) @ backwards
        return SphereLight(
            position=rounded(position), radius=rounded(radius * reach * np.ones(1))[0], samples=samples,
            Id=(brightness,) * 3, Is=(shine,) * 3,
        )  # fmt: skip

    key = light(rig.key, rig.key_radius, rig.key_light, rig.key_samples, 1.0)
    return {"key": key, "fill": light(rig.fill, rig.fill_radius, rig.fill_light, rig.fill_samples, 0.0)}
