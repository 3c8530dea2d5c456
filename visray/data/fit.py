"""A camera for a data scene: what it must show, and from where, so that north is up.

Camera axes are three unit vectors of the world: to the right, upwards and forward in the picture.
"""

from typing import Any

import numpy as np

from visray.data.base import Base, GlobeBase
from visray.fitting import Balls

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
# Ambient light over a map: under the lights of fitting.py, a surface that faces upwards then has nearly
# its own colour, as in a legend.
AMBIENT = 0.3


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
