"""Draws a plain map of a part of the earth: sea, land, and a graticule, the lines of equal longitude and latitude."""

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from visray.data.base import MERCATOR_LIMIT, Base, GlobeBase
from visray.data.land import land

# Distances between lines of the graticule, in degrees.
STEPS = (30.0, 15.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
# Number of lines across the longer side of a map, at least.
LINES = 5
# Widest map, in degrees, that is too small for the coasts of land.py: their error would be seen.
COARSE = 4.0
# A map is drawn so many times larger, and then shrunk; this smooths its edges.
FINER = 2
# A line of the map is this share of its width thick, but at least a pixel.
THIN = 1400


@dataclass(frozen=True)
class Colours:
    """Colours of a map, sRGB from 0 to 255."""

    sea: tuple[int, int, int] = (205, 214, 221)
    land: tuple[int, int, int] = (240, 238, 232)
    coast: tuple[int, int, int] = (150, 160, 168)
    lines: tuple[int, int, int] = (186, 196, 204)


def has_land(base: Base) -> bool:
    """Whether the map of a base shows land. A map of a few kilometres does not, because its coasts would be wrong."""
    if isinstance(base, GlobeBase):
        return True
    west, east, south, north = base.extent
    return max(east - west, north - south) > COARSE


def graticule_step(base: Base) -> float:
    """Distance between the lines of the graticule, in degrees."""
    west, east, south, north = _extent(base)
    longer = max(east - west, north - south)
    return next((step for step in STEPS if longer / step >= LINES), STEPS[-1])


def drawn(base: Base, width: int, colours: Colours | None = None) -> np.ndarray:
    """The map as a texture that fits the base.

    width: in pixels; the height follows from the base.

    Shape: uint8 (H, W, 3), sRGB.
    """
    c = colours or Colours()
    height = max(round(width * (0.5 if isinstance(base, GlobeBase) else base.true_depth / base.width)), 1)
    sheet = _Sheet(base, width * FINER, height * FINER)
    picture = Image.new("RGB", (sheet.width, sheet.height), c.sea if has_land(base) else c.land)
    draw, thickness = ImageDraw.Draw(picture), max(round(width / THIN), 1) * FINER
    for line in _graticule(base) if has_land(base) else ():
        draw.line(sheet.placed(line), c.lines, thickness)
    for ring in land() if has_land(base) else ():
        for points in sheet.copies(ring.points):
            draw.polygon(sheet.placed(points), c.sea if ring.water else c.land)
            draw.line(sheet.placed(points), c.coast, thickness, joint="curve")
    for line in () if has_land(base) else _graticule(base):
        draw.line(sheet.placed(line), c.lines, thickness)
    return np.array(picture.reduce(FINER))


def _extent(base: Base) -> tuple[float, float, float, float]:
    """West, east, south and north edge of the texture of a base."""
    return (-180.0, 180.0, -90.0, 90.0) if isinstance(base, GlobeBase) else base.extent


def _graticule(base: Base) -> list[np.ndarray]:
    """The lines of the graticule. Each has shape (2, 2): the longitudes and latitudes of its ends."""
    (west, east, south, north), step = _extent(base), graticule_step(base)
    meridians = np.arange(np.ceil(west / step), np.floor(east / step) + 1) * step
    parallels = np.arange(np.ceil(south / step), np.floor(north / step) + 1) * step
    lines = [np.array([[lon, south], [lon, north]]) for lon in meridians]
    return lines + [np.array([[west, lat], [east, lat]]) for lat in parallels]


@dataclass(frozen=True)
class _Sheet:
    """Where places lie on the picture of a map, in pixels."""

    base: Base
    width: int
    height: int

    def placed(self, points: np.ndarray) -> list[tuple[float, float]]:
        """Pixel coordinates of places. Longitudes are not wrapped."""
        west, east, south, north = _extent(self.base)
        ends, lat = np.array([south, north]), points[:, 1]
        if not isinstance(self.base, GlobeBase):
            lat = np.clip(lat, -MERCATOR_LIMIT, MERCATOR_LIMIT) if self.base.projection == "mercator" else lat
            ends, lat = self.base.northing(ends)[0], self.base.northing(lat)[0]
        u, v = (points[:, 0] - west) / (east - west), (lat - ends[0]) / (ends[1] - ends[0])
        return list(zip((u * self.width).tolist(), ((1 - v) * self.height).tolist()))

    def copies(self, points: np.ndarray) -> list[np.ndarray]:
        """Those copies of a ring, a turn around the earth apart, that are on the map."""
        west, east, south, north = _extent(self.base)
        low, high = points.min(axis=0), points.max(axis=0)
        if high[1] < south or low[1] > north:
            return []
        turns = [turn for turn in (-360.0, 0.0, 360.0) if high[0] + turn >= west and low[0] + turn <= east]
        return [points + np.array([turn, 0.0]) for turn in turns]
