"""Longitudes and latitudes of a table: which columns hold them, and whether they can be right."""

import re
from collections.abc import Sequence

import numpy as np

from visray.data.table import Table, shown
from visray.errors import UserError
from visray.hints import hint
from visray.terminal import printable

# Usual names of the columns, in lower case, without spaces and punctuation: the more certain ones first.
LONGITUDES = (
    (
        "longitude", "lon", "lng", "long", "longitud", "longitudine", "länge", "laenge", "längengrad", "lengtegraad",
        "længdegrad", "lengdegrad", "pituusaste", "boylam", "долгота", "经度", "經度", "経度", "경도",
    ),
    (
        "decimallongitude", "longitudedecimal", "longitudedeg", "longitudedegrees", "londeg", "londd", "longdd",
        "longitudedd", "lonwgs84", "longwgs84", "geolon", "geolng", "geolongitude", "intptlon", "intptlong",
    ),
    ("xcoord", "coordx", "xcoordinate", "coordenadax", "pointx"),
    ("x",),
)  # fmt: skip
LATITUDES = (
    (
        "latitude", "lat", "latitud", "latitudine", "breite", "breitengrad", "breedtegraad", "breddegrad",
        "leveysaste", "enlem", "широта", "纬度", "緯度", "위도",
    ),
    (
        "decimallatitude", "latitudedecimal", "latitudedeg", "latitudedegrees", "latdeg", "latdd", "latitudedd",
        "latwgs84", "geolat", "geolatitude", "intptlat",
    ),
    ("ycoord", "coordy", "ycoordinate", "coordenaday", "pointy"),
    ("y",),
)  # fmt: skip
# A text that holds both coordinates of a point.
BOTH = re.compile(r"(?:SRID=\d+;)?\s*POINT\s*Z?\s*\(.*|\(?[+-]?\d+\.\d+\s*[,;/ ]\s*[+-]?\d+\.\d+\)?", re.IGNORECASE)
# Longitudes up to 360 degrees are accepted: some grids begin at Greenwich.
WEST, EAST, NORTH = -180.0, 360.0, 90.0


def position_columns(table: Table, lon: str | None = None, lat: str | None = None) -> tuple[str, str]:
    """Names of the columns with longitudes and latitudes, found by usual names. Raises a UserError that lists the
    columns if there is none, or more than one.

    lon, lat: names that are known
    """
    return lon or _found(table, LONGITUDES, "longitude"), lat or _found(table, LATITUDES, "latitude")


def _found(table: Table, groups: Sequence[Sequence[str]], what: str) -> str:
    """The column whose name is in the first group of names that has any."""
    bare = {name: "".join(c for c in name.casefold() if c.isalnum()) for name in table.names}
    for group in groups:
        fitting = [name for name in table.names if bare[name] in group]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            several = " and ".join(map(shown, fitting))
            raise UserError(printable(f"{table.path}: the columns {several} may hold the {what}; say which one"))
    missing = f"{table.path}: no column is named like a {what}"
    for name in table.names:
        text = next((text for text in table.texts(name).tolist() if text.strip()), "")
        if table.columns[name].dtype == object and BOTH.fullmatch(text.strip()):
            both = f"the column {shown(name)} holds both coordinates in one text, {shown(text)}"
            raise UserError(printable(f"{missing}; {both}; write them in two columns"))
    raise UserError(printable(f"{missing}; say which one ({hint(what, table.names)})"))


def swapped(lon: np.ndarray, lat: np.ndarray) -> str:
    """A sentence if longitudes and latitudes look swapped: some latitude is beyond a pole, and none would be if they
    were swapped. Else "".

    Shapes: lon and lat (N,), in degrees.
    """
    beyond = np.flatnonzero(np.abs(lat) > NORTH)
    if not len(beyond) or (np.abs(lon) > NORTH).any() or (lat[beyond] < WEST).any() or (lat[beyond] > EAST).any():
        return ""
    reach = lat[beyond[np.abs(lat[beyond]).argmax()]]
    return f"longitudes and latitudes look swapped: latitudes reach {reach:g} degrees, and no longitude is beyond 90"


def position_notes(table: Table) -> list[str]:
    """Sentences about the positions of a table: the columns that hold them, and what cannot be right there."""
    if table.lines and "lon" not in table.names:
        return [f"{len(table.lines):,} lines and outlines, no points"]
    try:
        lon_name, lat_name = position_columns(table)
    except UserError as error:
        return [text.removeprefix(f"{table.path}: ") for text in error.lines]
    (lon, lon_problems), (lat, lat_problems) = table.numbers(lon_name), table.numbers(lat_name)
    notes = [f"longitudes are in the column {shown(lon_name)}, latitudes in {shown(lat_name)}"]
    notes += [str(problems) for problems in (lon_problems, lat_problems) if problems]
    wrong = swapped(lon, lat)
    return [printable(text) for text in notes] + ([wrong] if wrong else out_of_range(table, lon, lat))


def out_of_range(table: Table, lon: np.ndarray, lat: np.ndarray) -> list[str]:
    """Sentences about coordinates that no place on earth has: for longitudes and for latitudes, the first rows and how
    many there are.

    Shapes: lon and lat (N,), in degrees.
    """
    return [
        text
        for values, low, high, what in ((lon, WEST, EAST, "longitude"), (lat, -NORTH, NORTH, "latitude"))
        if (text := _outside(table, values, low, high, what))
    ]


def _outside(table: Table, values: np.ndarray, low: float, high: float, what: str) -> str:
    """A sentence about the values that are not between two bounds; "" if there are none."""
    rows = np.flatnonzero((values < low) | (values > high))
    if not len(rows):
        return ""
    listed = ", ".join(f"{table.place(row)} has {values[row]:g}" for row in rows[:5].tolist())
    more = f", and {len(rows) - 5:,} more" if len(rows) > 5 else ""
    many = f"1 {what} is" if len(rows) == 1 else f"{len(rows):,} {what}s are"
    hint = "; they look projected, in metres; write degrees" if np.nanmax(np.abs(values)) > 1000 else "; write degrees"
    return f"{many} not between {low:g} and {high:g}: {listed}{more}{hint}"
