"""A map that suits places on earth, and how far apart the places are on it."""

from typing import Literal

import numpy as np

from visray.data.base import Base, GlobeBase, MapBase

# Free space around the data on each side of a map, as a share of their longer side.
MARGIN = 0.08
# A map is no narrower and no lower than this share of its other side. Both sides are measured in the middle of the map.
SLIMMEST = 0.45
# Data that leave less than this free from west to east, in degrees, get a map of the whole earth.
FREE = 150.0
# Latitudes of a map of the whole earth, unless there are data beyond them.
WORLD = (-58.0, 80.0)
# From this height on, in degrees, a map is in Mercator's projection: in the other one, shapes in the north and in the
# south would be distorted. Mercator's maps end at MERCATOR_END, where lengths are twice those in the middle of Europe.
TALL, MERCATOR_END = 10.0, 75.0
# Height of the map around a single place, in degrees: enough for coasts to show where it is. Places that are no
# farther apart than METRE, in degrees, count as one.
ALONE, METRE = 12.0, 1 / 100_000
# Edges of maps of more than this many degrees are whole degrees.
WHOLE = 10.0
# Width of maps and diameter of globes, in world units.
SIZE = 10.0
# Number of points whose nearest neighbours are looked for, at most and at least, and of distances in between.
MOST_ASKED, LEAST_ASKED, DISTANCES = 1000, 16, 20_000_000


def fitted_base(lon: np.ndarray, lat: np.ndarray, kind: Literal["auto", "map", "globe"] = "auto") -> Base:
    """A globe, or a map with all places and some space around them. `auto` is a map, because a globe hides half of the
    earth.

    Shapes: lon, lat (N), N > 0, in degrees.
    """
    if kind == "globe":
        return GlobeBase(radius=SIZE / 2)
    west, east = longitudes_of(lon)
    south, north = float(lat.min()), float(lat.max())
    if 360 - (east - west) < FREE:
        extent = (-180.0, 180.0, *_framed(south, north))
        return MapBase(extent=extent, width=SIZE)
    shrink = np.cos(np.radians(0.5 * (south + north)))
    # A degree of longitude is `shrink` degrees of latitude long.
    sides = np.array([(east - west) * shrink, north - south])
    if not sides.max() > METRE:
        sides = np.array([ALONE, ALONE])
    sides = np.maximum(sides + 2 * MARGIN * sides.max(), SLIMMEST * (1 + 2 * MARGIN) * sides.max())
    half_lon, half_lat = min(0.5 * sides[0] / shrink, 180.0), 0.5 * sides[1]
    middle_lon, middle_lat = 0.5 * (west + east), 0.5 * (south + north)
    south, north = max(middle_lat - half_lat, -90.0), min(middle_lat + half_lat, 90.0)
    extent = _rounded(middle_lon - half_lon, middle_lon + half_lon, south, north)
    tall = extent[3] - extent[2] > TALL and max(-extent[2], extent[3]) <= MERCATOR_END
    return MapBase(extent=extent, width=SIZE, projection="mercator" if tall else "equirectangular")


def longitudes_of(lon: np.ndarray) -> tuple[float, float]:
    """West and east end of the shortest arc that contains all longitudes: west is from -180 to 180, and east, which is
    not less, may be beyond 180. Shape: (N), N > 0."""
    turned = np.unique(np.where(lon >= 180, lon - 360, lon))
    gaps = np.diff(turned, append=turned[0] + 360)
    last = int(np.argmax(gaps))
    if last == len(turned) - 1:
        return float(turned[0]), float(turned[-1])
    return float(turned[last + 1]), float(turned[last]) + 360


def _framed(south: float, north: float) -> tuple[float, float]:
    """Latitudes of a map of the whole earth with data from `south` to `north`."""
    low, high = np.floor(south - 5), np.ceil(north + 5)
    return max(min(float(low), WORLD[0]), -90.0), min(max(float(high), WORLD[1]), 90.0)


def _rounded(west: float, east: float, south: float, north: float) -> tuple[float, float, float, float]:
    """The extent with edges moved outwards to round numbers: whole degrees, or a hundredth of the height of a smaller
    map."""
    height = north - south
    places = 0 if height > WHOLE else int(np.ceil(-np.log10(height / 100)))
    step = 10.0**-places
    low, high = (round(float(f(x / step)) * step, places + 1) for f, x in ((np.floor, south), (np.ceil, north)))
    left, right = (round(float(f(x / step)) * step, places + 1) for f, x in ((np.floor, west), (np.ceil, east)))
    if right - left > 360:
        left, right = -180.0, 180.0
    turn = 360.0 if left < -360 else -360.0 if right > 360 else 0.0
    return left + turn, right + turn, max(low, -90.0), min(high, 90.0)


def spacing(points: np.ndarray) -> float:
    """Median distance from a point to the nearest one in another place. 0 if all points are in one place.

    Shape: (N, 3).
    Error: with many points, the median is that of some of them (MOST_ASKED).
    """
    count = len(points)
    asked = np.random.default_rng(0).permutation(count)[: max(min(MOST_ASKED, DISTANCES // max(count, 1)), LEAST_ASKED)]
    x, y, z = np.ascontiguousarray(points.T)
    nearest = []
    for i in asked.tolist():
        squares = (x - x[i]) ** 2
        squares += (y - y[i]) ** 2
        squares += (z - z[i]) ** 2
        squares[squares == 0] = np.inf
        nearest.append(squares.min())
    # If all points are in one place, no distance is finite.
    distances = np.array(nearest)[np.isfinite(nearest)]
    return float(np.sqrt(np.median(distances))) if len(distances) else 0.0
