"""Places of the data of a VisRayTrace scene as longitudes and latitudes on the base of a visray data scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, atan2, cos, degrees, pi, radians, sin
from typing import Any

# The second gizmo of a row stands this far beside the first, in world units.
BESIDE = 0.3
# Digits after the point of coordinates that are computed; more of them would be rounding errors.
DIGITS = 12


@dataclass(frozen=True)
class Axis:
    """The linear map of VisRayTrace from coordinates of the data to those of the scene, along x or along z.

    real, virtual: the two ranges that are mapped to each other, each as (low, high).
    reverse: whether the file maps the low end of one range to the high end of the other.
    """

    real: tuple[float, float]
    virtual: tuple[float, float]
    reverse: bool

    @property
    def unit(self) -> float:
        """Units of the data for each unit of the scene."""
        return (self.real[1] - self.real[0]) / (self.virtual[1] - self.virtual[0])

    def share(self, v: float) -> float:
        """Position of v in the virtual range: 0 at its low end, 1 at its high end."""
        return (v - self.virtual[0]) / (self.virtual[1] - self.virtual[0])

    def eastward(self, v: float) -> float:
        """Coordinate of the data at v in the scene if both grow in the same direction."""
        t = self.share(v)
        return (1 - t) * self.real[0] + t * self.real[1]

    def northward(self, v: float) -> float:
        """Coordinate of the data at v in the scene if they grow in opposite directions."""
        t = self.share(v)
        return (1 - t) * self.real[1] + t * self.real[0]

    def mirrored(self, x: float) -> float:
        """x mirrored within the real range."""
        return self.real[0] + self.real[1] - x


@dataclass(frozen=True)
class FlatPlacement:
    """Places on a map or on a plane.

    base: fields of visray's base, except its material.
    x, z: the map along each axis.
    compat: whether data are mirrored as in VisRayTrace.
    divisor: number by which coordinates of the data are divided. It is 1 for longitudes and latitudes.
    """

    base: dict[str, Any]
    x: Axis
    z: Axis
    compat: bool
    divisor: float

    def places(self, x: Sequence[float], z: Sequence[float]) -> tuple[list[float], list[float]]:
        """(longitudes, latitudes) of rows of the data."""
        lon = [self.x.mirrored(v) if self.compat and self.x.reverse else v for v in x]
        lat = [self.z.mirrored(v) if self.compat and not self.z.reverse else v for v in z]
        return [round(v / self.divisor, DIGITS) for v in lon], [round(v / self.divisor, DIGITS) for v in lat]

    def beside(self, lon: Sequence[float], lat: Sequence[float]) -> list[float]:
        """Longitudes of the second gizmos of rows."""
        return [round(v + BESIDE * self.x.unit / self.divisor, DIGITS) for v in lon]


@dataclass(frozen=True)
class GlobePlacement:
    """Places on a globe.

    base: fields of visray's base, except its material.
    """

    base: dict[str, Any]

    def places(self, x: Sequence[float], z: Sequence[float]) -> tuple[list[float], list[float]]:
        """(longitudes, latitudes) of rows of the data. A place beyond a pole is also written in degrees of the earth:
        latitude 100 is latitude 80 on the other side."""
        places = [_on_earth(lon, lat) for lon, lat in zip(x, z)]
        return [lon for lon, _ in places], [lat for _, lat in places]

    def beside(self, lon: Sequence[float], lat: Sequence[float]) -> list[float]:
        """Longitudes of the second gizmos of rows. They stand to the east, at the same latitude, and at most at the
        opposite side of the globe."""
        circles = [self.base["radius"] * cos(radians(v)) for v in lat]
        turns = [degrees(BESIDE / circle) if circle * pi > BESIDE else 180.0 for circle in circles]
        return [v + turn if v + turn <= 360 else v + turn - 360 for v, turn in zip(lon, turns)]


def _on_earth(lon: float, lat: float) -> tuple[float, float]:
    """The same place with a longitude of at most 360 degrees and a latitude of at most 90."""
    if abs(lat) <= 90:
        return (lon if abs(lon) <= 360 else lon % 360), lat
    a, b = radians(lon), radians(lat)
    x, y, z = cos(b) * cos(a), sin(b), cos(b) * sin(a)
    return degrees(atan2(z, x)), degrees(asin(y))
