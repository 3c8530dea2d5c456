"""Writes tables as GeoJSON, with their outlines."""

from visray.data.geojson import ALTITUDE, LAT, LON
from visray.data.table import Table


def to_geojson(table: Table) -> dict:
    """GeoJSON from which from_geojson reads the same table: a feature for each row."""
    lines: dict[int, list] = {}
    for row, line in table.lines:
        lines.setdefault(row, []).append(line.tolist())
    axes = [table.columns[name] for name in (LON, LAT, ALTITUDE) if LON in table.names and name in table.names]
    kept = {name: table.columns[name].tolist() for name in table.names if not axes or name not in (LON, LAT, ALTITUDE)}
    features = []
    for row in range(len(table)):
        place = [float(axis[row]) for axis in axes if axis[row] == axis[row]]
        shape = {"type": "Point", "coordinates": place} if place else None
        if row in lines:
            shape = {"type": "MultiLineString", "coordinates": lines[row]}
        properties = {name: None if column[row] != column[row] else column[row] for name, column in kept.items()}
        features.append({"type": "Feature", "geometry": shape, "properties": properties})
    return {"type": "FeatureCollection", "features": features}
