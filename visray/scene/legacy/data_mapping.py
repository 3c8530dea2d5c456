"""Where the data of a VisRayTrace scene lie: the fields of the base of a visray data scene.

VisRayTrace maps x and z of the data linearly from the rectangle `Real` to the rectangle `Virtual`. A map in visray has
an extent, the longitudes and latitudes of its own edges. So the extent is extrapolated from Real to the edges of the
base, and every place lies where VisRayTrace's formula puts it.

VisRayTrace puts the smallest z of the data at the smallest z of the scene, but there it also puts the first row of a
picture, which is the north of a map. So its data are mirrored. visray has the north at the smallest z of the scene.
With `compat` the data are mirrored as in VisRayTrace: their latitudes are mirrored within Real.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, hypot, log10
from typing import Any

from visray.scene.legacy.data_places import Axis, FlatPlacement
from visray.scene.legacy.entry import Entry, Log
from visray.scene.legacy.keys import EXTENT

CORNERS = '{"minPoint": [...], "maxPoint": [...]}'
# Largest latitude and longitude of an extent, and its largest width in degrees.
LARGEST_LATITUDE, LARGEST_LONGITUDE = 90.0, 360.0
# Relative rounding error of an extent.
ROUNDING = 1e-12
# Largest distance of two edges that count as the same, as a share of the size of the base: less than a pixel.
SAME = 1e-4


@dataclass(frozen=True)
class Corners:
    """Corners of the two rectangles of the file.

    real: minPoint and maxPoint of Real, each (x, z); None for a globe, which needs none.
    virtual: minPoint and maxPoint of Virtual, each (x, y, z).
    """

    real: tuple[tuple[float, ...], ...] | None
    virtual: tuple[tuple[float, ...], ...]


def corners(e: Entry, on_globe: bool) -> Corners | None:
    """The corners of Real and Virtual, or None with errors in the log.

    e: the scene file.
    """
    real = None if on_globe else _corners(e, "Real", 2)
    virtual = _corners(e, "Virtual", 3)
    return None if virtual is None or (real is None and not on_globe) else Corners(real, virtual)


def _corners(e: Entry, key: str, size: int) -> tuple[tuple[float, ...], ...] | None:
    """The corners under a key, or None with an error in the log.

    size: number of coordinates of a corner.
    """
    nested = e.nested(key, EXTENT)
    if nested is None:
        e.log.error(f"{e.at(key)}: the key is missing; it is {CORNERS}")
        return None
    found = nested.vector("minPoint", size=size), nested.vector("maxPoint", size=size)
    return None if None in found else found


def flat_placement(
    given: Corners, base: dict[str, Any], points: Sequence[tuple[float, float]], compat: bool, log: Log
) -> FlatPlacement | None:
    """Places on a map or on a plane; None with an error in the log if Real or Virtual is wrong.

    base: fields of visray's rectangle or plane, its height `y`, and whether it is `pictured`, that is, has a picture.
    points: x and z of all rows of the data.
    """
    virtual = tuple(corner[::2] for corner in given.virtual)
    axes = [_axis(letter, *ends, log) for letter, ends in zip("xz", zip(zip(*given.real), zip(*virtual)))]
    if None in axes:
        return None
    x, z = axes
    if x.reverse:
        told = (
            "the data are mirrored from east to west" if compat else "VisRayTrace mirrored the data from east to west"
        )
        log.warn(f"Virtual: its x runs against x of Real; {told}")
    (x0, x1), (z0, z1) = edges = _edges(base, x, z)
    if base["type"] == "rectangle" and base["pictured"]:
        _report_other_edges(edges, given.virtual, log)
    extent = x.eastward(x0), x.eastward(x1), z.northward(z1), z.northward(z0)
    divisor = _divisor(extent, FlatPlacement({}, x, z, compat, 1.0), points, log)
    fields = {
        "type": "map" if base["type"] == "rectangle" else "plane",
        "center": ((x0 + x1) / 2, base["y"], (z0 + z1) / 2),
        "extent": _within_earth(v / divisor for v in extent),
        "width": x1 - x0,
        "depth": z1 - z0,
        "outside": "shown",  # VisRayTrace showed all data, also beside its plane
    }
    return FlatPlacement(fields, x, z, compat, divisor)


def _edges(base: dict[str, Any], x: Axis, z: Axis) -> tuple[tuple[float, float], tuple[float, float]]:
    """Edges of the map along x and z, each as (low, high): those of a rectangle, or of Virtual on an infinite plane."""
    if base["type"] != "rectangle":
        return x.virtual, z.virtual
    cx, _, cz = base["center"]
    half_width, half_depth = base["width"][0] / 2, abs(base["height"][2]) / 2
    return (cx - half_width, cx + half_width), (cz - half_depth, cz + half_depth)


def _report_other_edges(
    edges: tuple[tuple[float, float], ...], virtual: tuple[tuple[float, ...], ...], log: Log
) -> None:
    """Warns if the picture on the base does not end where Virtual ends: then its places are not those of the data."""
    pairs = list(zip(edges, zip(*(corner[::2] for corner in virtual))))
    if all(hypot(a[0] - min(b), a[1] - max(b)) <= SAME * (a[1] - a[0]) for a, b in pairs):
        return
    (x0, x1), (z0, z1) = edges
    factors = " and ".join(f"{(a[1] - a[0]) / (max(b) - min(b)):.3g}" for a, b in pairs)
    low, high = virtual
    log.warn(
        f"base: its picture is {factors} times as large as Virtual in x and in z, so the data lie where the formula "
        f"puts them, not where the picture shows them; if the picture shows all of Real, write "
        f"Virtual.minPoint = [{x0:g}, {low[1]:g}, {z0:g}] and Virtual.maxPoint = [{x1:g}, {high[1]:g}, {z1:g}]"
    )


def _axis(letter: str, real: tuple[float, float], virtual: tuple[float, float], log: Log) -> Axis | None:
    """The map along x or z, or None with an error in the log. real, virtual: coordinates of minPoint and maxPoint."""
    for key, (a, b) in (("Real", real), ("Virtual", virtual)):
        if a == b:
            log.error(f"{key}: minPoint and maxPoint both have {letter} = {a:g}; they must differ")
            return None
    reverse = (real[0] > real[1]) != (virtual[0] > virtual[1])
    return Axis(tuple(sorted(real)), tuple(sorted(virtual)), reverse)


def _within_earth(extent: Iterable[float]) -> tuple[float, ...]:
    """The extent without what rounding errors added beyond the poles and beyond a full turn."""
    west, east, south, north = extent
    south, north = max(south, -LARGEST_LATITUDE), min(north, LARGEST_LATITUDE)
    west, east = max(west, -LARGEST_LONGITUDE), min(east, LARGEST_LONGITUDE)
    return west, min(east, west + LARGEST_LONGITUDE), south, north


def _divisor(
    extent: tuple[float, ...], undivided: FlatPlacement, points: Sequence[tuple[float, float]], log: Log
) -> float:
    """Power of ten by which coordinates must be divided to be longitudes and latitudes; 1 if they can be that.

    extent: west, east, south and north edge of the map, in units of the data.
    undivided: the places with the divisor 1.
    """
    west, east, south, north = extent
    lon, lat = undivided.places(*zip(*points)) if points else ([], [])
    lon = [west, east, *lon, *undivided.beside(lon, lat)]
    # Longitudes beyond the edges that are farther than half a turn from the middle of a map are shifted by a turn.
    far = max(abs(x - (west + east) / 2) for x in lon)
    widest = max(abs(v) for v in (south, north, *lat)) / LARGEST_LATITUDE
    excess = max(widest, *(abs(x) / LARGEST_LONGITUDE for x in lon), 2 * far / LARGEST_LONGITUDE)
    if excess <= 1 + ROUNDING:
        return 1.0
    divisor = 10.0 ** ceil(log10(excess))
    log.warn(
        f"Real: x and z of the base or of the data are beyond the longitudes and latitudes of the earth; in the data "
        f"of the visray scene they are divided by {divisor:g}"
    )
    return divisor
