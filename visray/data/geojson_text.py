"""Writes tables as GeoJSON, with their outlines."""

import numpy as np

from visray.data.geojson import ALTITUDE, LAT, LON
from visray.data.table import Table


def to_geojson(table: Table) -> dict:
    """GeoJSON from which from_geojson reads the same table: a feature for each row."""
    lines: dict[int, list] = {}
    for row, line in table.lines:
        lines.setdefault(row, []).append(line.tolist())
    axes = _axes(table, list(lines))
    kept = {name: table.columns[name].tolist() for name in table.names if name not in axes}
    features = []
    for row in range(len(table)):
        place = [float(axis[row]) for axis in axes.values() if axis[row] == axis[row]]
        shape = {"type": "Point", "coordinates": place} if place else None
        if row in lines:
            shape = {"type": "MultiLineString", "coordinates": lines[row]}
        properties = {name: None if column[row] != column[row] else column[row] for name, column in kept.items()}
        features.append({"type": "Feature", "geometry": shape, "properties": properties})
    return {"type": "FeatureCollection", "features": features}


def _axes(table: Table, outlined: list[int]) -> dict[str, np.ndarray]:
    """The columns with the coordinates of points, by name; empty if there are none, and such columns are properties.

    outlined: rows with lines. They have no point.
    """
    names = [name for name, axis in zip(table.names, (LON, LAT, ALTITUDE)) if name == axis]
    axes = {name: table.columns[name] for name in names}
    if names[:2] != [LON, LAT] or any(axis.dtype == object for axis in axes.values()):
        return {}
    missing = {name: np.isnan(axis) for name, axis in axes.items()}
    both = (missing[LON] == missing[LAT]).all() and missing[LON][outlined].all()
    # An altitude goes with a point.
    return axes if both and (missing[LON] <= missing.get(ALTITUDE, True)).all() else {}
