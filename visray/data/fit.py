"""A camera, lights and a background that suit a data scene: everything is in the picture, north is up.

Camera axes are three unit vectors of the world: to the right, upwards and forward in the picture.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from visray.camera import Camera
from visray.data.base import Base, GlobeBase
from visray.lights import SphereLight
from visray.lights.light import Light

# Vertical angle of view, in degrees: narrow, so that bars near the edge of the picture hardly lean.
FOV = 28.0
# Elevation of the camera over a map, in degrees: with bars so steep that they hide little of what is behind them, and
# steeper without bars.
ELEVATION, ELEVATION_FLAT = 52.0, 66.0
# Angle from the camera over a globe northwards to the middle of the data, in degrees. Seen from straight above, bars
# would look like dots.
TILT = 28.0
# Latitudes of the camera over a globe, in degrees, between which north is up.
LATITUDES = (-45.0, 50.0)
# Data whose mean direction from the centre of a globe is shorter than this lie all around it, and have no middle.
SPREAD = 0.1
# The place that a camera looks at then: more people live on this side of the earth than on the other.
POPULATED = (30.0, 35.0)
# Directions to the lights in camera axes, backwards in place of forward. The key light is at the upper left, so shadows
# fall to the right; the fill light is at the right.
KEY, FILL = np.array([-0.5, 0.3, 0.81]), np.array([0.7, -0.1, 0.7])
# Diffuse light of both. Under them, a surface that faces upwards on a map has nearly its own colour, as in a legend, if
# its ka is AMBIENT times its kd.
KEY_LIGHT, FILL_LIGHT, AMBIENT = 0.75, 0.15, 0.3
# Distance of the lights from the middle of the scene, and their radii, in radii of the scene. Shadows of the key light
# are soft, and those of the fill light are so soft that they are hardly seen.
DISTANCE, KEY_RADIUS, FILL_RADIUS = 6.0, 0.8, 4.0
# Points of a light that each sample of a pixel asks.
KEY_SAMPLES, FILL_SAMPLES = 3, 1
# Linear colour of the background: nearly white, like paper.
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

    def middle(self) -> np.ndarray:
        """Middle of their bounding box. Shape: (3)."""
        low, high = ((self.centre + s * self.radius[:, None]) for s in (-1, 1))
        return 0.5 * (low.min(axis=0) + high.max(axis=0))

    def reach(self) -> float:
        """Radius of a ball about the middle that contains them all."""
        return float((np.linalg.norm(self.centre - self.middle(), axis=1) + self.radius).max())


def balls(base: Base, lon: Any, lat: Any, heights: Any = 0.0, radii: Any = 0.0) -> Balls:
    """What a picture of data must show: the base, and the foot and the top of each datum.

    heights: heights of the gizmos along the normal of the base, in world units; negative if they hang down. radii: how
        far they extend about their axes. A number stands for all.

    Shapes: lon, lat (N).
    """
    ground = base.place(lon, lat)
    heights, radii = (np.broadcast_to(np.asarray(x, float), len(ground.point)) for x in (heights, radii))
    tops = ground.point + heights[:, None] * ground.up
    return outline(base).joined(Balls(ground.point, radii)).joined(Balls(tops, radii))


def outline(base: Base) -> Balls:
    """A globe as one ball, or the four corners of a map."""
    if isinstance(base, GlobeBase):
        ends = base.place(np.array([0.0, 180.0]), np.zeros(2)).point
        return Balls(ends.mean(axis=0)[None], np.array([0.5 * base.size]))
    west, east, south, north = base.extent
    corners = base.place(np.array([west, east, west, east]), np.array([south, south, north, north]))
    return Balls(corners.point, np.zeros(4))


def middle_of(lon: Any, lat: Any, weights: Any = 1.0) -> tuple[float, float]:
    """(longitude, latitude) of the middle of places on a globe.

    weights: how much each place counts, >= 0; a number stands for all.

    Shapes: lon, lat (N).
    """
    up = GlobeBase().place(lon, lat).up
    weights = np.broadcast_to(np.asarray(weights, float), len(up))
    if not weights.sum() > 0:
        return POPULATED
    x, y, z = mean = np.average(up, axis=0, weights=weights)
    if np.linalg.norm(mean) < SPREAD:
        return POPULATED
    return float(np.degrees(np.arctan2(-z, x))), float(np.degrees(np.arctan2(y, np.hypot(x, z))))


def axes_over(base: Base, at: tuple[float, float] = POPULATED, elevation: float = ELEVATION) -> np.ndarray:
    """Axes of a camera over a base: over a map at a slant from the south, over a globe from the south of a place.

    at: longitude and latitude of that place.
    elevation: of the camera over a map, in degrees.

    Shape: (3, 3), an axis in each row.
    """
    globe = isinstance(base, GlobeBase)
    lon, lat = (at[0], float(np.clip(at[1] - TILT, *LATITUDES))) if globe else (0.0, 0.0)
    ground = base.place(np.array([lon]), np.array([lat]))
    slant = 0.0 if globe else np.radians(90 - elevation)
    normal, north = ground.up[0], ground.point_lat[0] / np.linalg.norm(ground.point_lat[0])
    forward = np.sin(slant) * north - np.cos(slant) * normal
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, north)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def fitted_view(shown: Balls, axes: np.ndarray, aspect: float, window: Window | None = None) -> Camera:
    """The nearest camera with given axes that sees all balls in a window of its picture.

    shown: what the picture shows.
    aspect: width of the picture divided by its height.
    window: the part of the picture for it; None leaves a small margin.
    """
    w, slope = window or Window(), np.tan(np.radians(FOV / 2))
    x, y, depth = axes @ shown.centre.T
    across = _Limits.of(x, depth, shown.radius, w.left * slope * aspect, w.right * slope * aspect)
    upwards = _Limits.of(y, depth, shown.radius, w.bottom * slope, w.top * slope)
    z = min(across.nearest(), upwards.nearest())
    origin = np.array([across.middle(z), upwards.middle(z), z]) @ axes
    target = origin + axes[2] * float(np.median(depth) - z)
    rounded = _rounding(shown)
    return Camera(origin=rounded(origin), target=rounded(target), up=tuple(np.round(axes[1], 6).tolist()), fov=FOV)


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


def _rounding(shown: Balls) -> Any:
    """A function that rounds points to a small share of the size of what is shown."""
    places = int(np.ceil(-np.log10(ROUNDED * shown.reach())))
    return lambda point: tuple(np.round(point, places).tolist())


def fitted_lights(shown: Balls, axes: np.ndarray) -> dict[str, Light]:
    """A key light with soft shadows and a weak fill light, by their names."""
    backwards = axes * np.array([[1.0], [1.0], [-1.0]])
    reach, rounded = shown.reach(), _rounding(shown)

    def light(toward: np.ndarray, radius: float, brightness: float, samples: int, shine: float) -> SphereLight:
        position = shown.middle() + DISTANCE * reach * (toward / np.linalg.norm(toward)) @ backwards
        return SphereLight(
            position=rounded(position), radius=rounded(radius * reach * np.ones(1))[0], samples=samples,
            Id=(brightness,) * 3, Is=(shine,) * 3,
        )  # fmt: skip

    key = light(KEY, KEY_RADIUS, KEY_LIGHT, KEY_SAMPLES, 1.0)
    return {"key": key, "fill": light(FILL, FILL_RADIUS, FILL_LIGHT, FILL_SAMPLES, 0.0)}
