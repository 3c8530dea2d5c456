"""Reads GeoJSON (RFC 7946): properties become columns, points become rows, lines and polygons become outlines.

A feature gives one row for each of its points, and one row for its lines and outlines together.
"""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from visray.data.table import Table, shown
from visray.data.values import column_of_values
from visray.errors import UserError
from visray.terminal import printable

# Names of the columns that geometries give.
LON, LAT, ALTITUDE = "lon", "lat", "altitude"
# Types of geometries: how deep their positions are nested, and the smallest number of positions in each list of them.
GEOMETRIES = {
    "Point": (0, 1),
    "MultiPoint": (1, 0),
    "LineString": (1, 2),
    "MultiLineString": (2, 2),
    "Polygon": (2, 4),
    "MultiPolygon": (3, 4),
}
# Last parts of the names of WGS 84. In GeoJSON the longitude comes first, whatever EPSG says.
WGS84 = ("crs84", "crs84h", "4326", "4979", "wgs84")
REPROJECT = "visray reads longitudes and latitudes of WGS 84: ogr2ogr -t_srs EPSG:4326 NEW.geojson OLD.geojson"


def is_geojson(raw: Any) -> bool:
    """Whether the content of a JSON file is GeoJSON."""
    return isinstance(raw, dict) and raw.get("type") in (
        "FeatureCollection",
        "Feature",
        "GeometryCollection",
        *GEOMETRIES,
    )


def from_geojson(raw: dict, path: str) -> Table:
    """The table of GeoJSON. Raises a UserError that names the address of what is wrong.

    path: what messages call it.
    """
    return _Reading(path).table(raw)


def _value(value: Any) -> str:
    """A value as JSON, on one line, and cut if it is long."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else text[:57] + "..."


@dataclass
class _Reading:
    """The reading of one file.

    points: longitude, latitude and altitude of each row; NaN if it has none
    feature_of: index of the feature of each row
    properties, ids: properties and id of each feature
    lines: index of the row, and longitudes and latitudes in degrees
    """

    path: str
    points: list[list[float]] = field(default_factory=list)
    feature_of: list[int] = field(default_factory=list)
    properties: list[dict] = field(default_factory=list)
    ids: list[Any] = field(default_factory=list)
    lines: list[tuple[int, np.ndarray]] = field(default_factory=list)
    open_rings: int = 0
    without: int = 0

    def table(self, raw: dict) -> Table:
        """The table of a file's content."""
        self._check_crs(raw.get("crs"))
        if raw["type"] == "FeatureCollection":
            features = raw.get("features")
            if not isinstance(features, list):
                self._fail("features", features, "must be a list of features")
            if not features:
                self._fail("features", features, "the file has no features; it must have at least one")
            for i, feature in enumerate(features):
                self._feature(feature, f"features.{i}")
        elif raw["type"] == "Feature":
            self._feature(raw, "")
        else:
            self._row(raw, {}, None, "")
        return self._table()

    def _fail(self, address: str, value: Any, text: str) -> None:
        """Raises a UserError about a value."""
        where = f"{address} = " if address else ""
        raise UserError(printable(f"{self.path}: {where}{_value(value)}: {text}"))

    def _check_crs(self, crs: Any) -> None:
        """Raises a UserError if the file says that its coordinates are not those of WGS 84."""
        if crs is None:
            return
        properties = crs.get("properties") if isinstance(crs, dict) else None
        name = properties.get("name") if isinstance(properties, dict) else None
        if not isinstance(name, str) or re.split("[:/#]", name.casefold().replace(" ", ""))[-1] not in WGS84:
            self._fail("crs", name if isinstance(name, str) else crs, REPROJECT)

    def _feature(self, feature: Any, address: str) -> None:
        """Adds the rows of a feature."""
        dot = f"{address}." if address else ""
        if not isinstance(feature, dict) or feature.get("type") != "Feature":
            self._fail(address, feature, 'must be an object with "type": "Feature"')
        properties = feature.get("properties")
        if properties is not None and not isinstance(properties, dict):
            self._fail(f"{dot}properties", properties, "must be an object or null")
        if "geometry" not in feature:
            self._fail(address, feature, 'must have a "geometry"; it may be null')
        self._row(feature["geometry"], properties or {}, feature.get("id"), f"{dot}geometry")

    def _row(self, geometry: Any, properties: dict, identity: Any, address: str) -> None:
        """Adds the rows of a geometry with its properties."""
        index = len(self.properties)
        self.properties.append(properties)
        self.ids.append(identity)
        points, lines = [], []
        if isinstance(geometry, dict) and geometry.get("type") == "Point" and _is_position(geometry.get("coordinates")):
            points, geometry = [geometry["coordinates"][:3]], None  # most files hold nothing else
        for kind, positions, is_ring in self._parts(geometry, address):
            if kind == "point":
                points += positions[:, :3].tolist()
            else:
                lines.append(self._closed(positions[:, :2]) if is_ring else positions[:, :2])
        self.points += [[*point, *[np.nan] * (3 - len(point))] for point in points]
        if lines or not points:
            self.lines += [(len(self.points), line) for line in lines]
            self.points.append([np.nan] * 3)
            self.without += not lines
        self.feature_of += [index] * (len(self.points) - len(self.feature_of))

    def _closed(self, ring: np.ndarray) -> np.ndarray:
        """A ring that ends where it begins. Shape: (n, 2)"""
        if (ring[0] == ring[-1]).all():
            return ring
        self.open_rings += 1
        return np.vstack([ring, ring[:1]])

    def _parts(self, geometry: Any, address: str) -> Iterator[tuple[str, np.ndarray, bool]]:
        """Yields the lists of positions of a geometry: `point` or `line`, the positions, and whether it is a ring."""
        if geometry is None:
            return
        kind = geometry.get("type") if isinstance(geometry, dict) else None
        dot = f"{address}." if address else ""
        if kind == "GeometryCollection":
            members = geometry.get("geometries")
            if not isinstance(members, list):
                self._fail(f"{dot}geometries", members, "must be a list of geometries")
            for i, member in enumerate(members):
                yield from self._parts(member, f"{dot}geometries.{i}")
            return
        if not isinstance(kind, str) or kind not in GEOMETRIES:
            known = ", ".join((*GEOMETRIES, "GeometryCollection"))
            self._fail(
                f"{dot}type" if isinstance(geometry, dict) else address, kind or geometry, f"must be one of {known}"
            )
        depth, least = GEOMETRIES[kind]
        coordinates = geometry.get("coordinates")
        if coordinates == []:
            return  # RFC 7946, 3.1: as if there were no geometry
        for positions, where in self._lists(coordinates, depth, f"{dot}coordinates"):
            if len(positions) < least:
                ring = "a ring of a polygon" if least > 2 else "a line"
                self._fail(where, positions, f"{ring} must have at least {least} positions")
            if positions:
                array = self._positions(positions, where if depth else "", where)
                yield "point" if "Point" in kind else "line", array, "Polygon" in kind

    def _lists(self, value: Any, depth: int, address: str) -> Iterator[tuple[list, str]]:
        """Yields the lists of positions in coordinates that are nested this deep, and their addresses."""
        if depth == 0:
            yield [value], address
        elif not isinstance(value, list):
            self._fail(address, value, "must be a list of positions" if depth == 1 else "must be a list of lists")
        elif depth == 1:
            yield value, address
        else:
            for i, part in enumerate(value):
                yield from self._lists(part, depth - 1, f"{address}.{i}")

    def _positions(self, positions: list, parent: str, address: str) -> np.ndarray:
        """Positions as an array; NaN where some have an altitude and others have none. Shape: (n, 2) or (n, 3 or more)

        parent: address of the list of positions; "" if there is only one position.
        address: address of that position.
        """
        for i, position in enumerate(positions):
            if not _is_position(position):
                where = f"{parent}.{i}" if parent else address
                self._fail(where, position, "must be a list of two finite numbers, longitude and latitude, or three")
        return np.array([[*map(float, p[:3]), np.nan][:3] for p in positions])

    def _table(self) -> Table:
        """The table of what was read."""
        notes, columns = [], {}
        points = np.array(self.points, float).reshape(-1, 3)
        if np.isfinite(points[:, 0]).any():
            columns |= {LON: points[:, 0], LAT: points[:, 1]}
        if np.isfinite(points[:, 2]).any():
            columns[ALTITUDE] = points[:, 2]
        properties = [self.properties[i] for i in self.feature_of]
        names = list(dict.fromkeys(key for p in self.properties for key in p))
        if "id" not in names and any(i is not None for i in self.ids):
            names.append("id")
            properties = [{"id": self.ids[i]} | p for i, p in zip(self.feature_of, properties)]
        for name in names:
            free = name
            while free in columns:
                free += " (property)"
            if free != name:
                notes.append(f"the property {shown(name)} is the column {shown(free)}: points have {shown(name)}, too")
            columns[free], more = column_of_values([p.get(name) for p in properties])
            notes += [printable(f"column {shown(free)}: {text}") for text in more]
        if self.without:
            notes.append(f"{self.without:,} {'feature has' if self.without == 1 else 'features have'} no geometry")
        if self.open_rings:
            notes.append(
                f"{self.open_rings:,} {'ring is' if self.open_rings == 1 else 'rings are'} open; visray closes them"
            )
        return Table(list(columns), columns, None, self.path, notes, "GeoJSON", lines=self.lines, bare_rows=len(points))


def _is_position(position: Any) -> bool:
    """Whether a value is a list of two finite numbers or more."""
    return (
        isinstance(position, list)
        and len(position) >= 2
        and all(type(v) in (int, float) and abs(v) < np.inf for v in position)
    )
