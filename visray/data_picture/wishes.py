"""What a user asks for who wants a picture of a table, checked and completed from the table."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

from visray.data.color_rule import NormName
from visray.data.describe import describe
from visray.data.gizmos import GIZMOS
from visray.data.layer_table import NAME_COLUMNS
from visray.data.positions import position_columns
from visray.data.table import Table
from visray.errors import UserError
from visray.hints import hint
from visray.terminal import printable

# Names of columns with numbers that are no quantities, in lower case: they are not shown unless the user asks for it.
NO_QUANTITY = re.compile(r"(id|.*[_ ]id|index|no|nr|num|rank|code|zip|postcode|year|jahr|any|month|day|date|time)")

# Norms of colours; bands need their number, which a scene file gives.
NORMS = tuple(name for name in get_args(NormName) if name != "banded")


# Largest number of rows whose names are written without being asked for.
FEW = 15


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """What a user asks for; None: it is chosen here.

    lon, lat, name, height, radius, color: columns
    palette, norm, gizmo: names
    base: "auto", "map" or "globe"
    image: path of the picture of the map
    extent: west, east, south and north edge of the map, in degrees
    title, source_line: texts of the legend
    places: names of the rows that are labelled; "auto": all, if they are few
    size: width and height of the picture, in pixels
    spp: samples per pixel
    """

    lon: str | None = None
    lat: str | None = None
    name: str | None = None
    height: str | None = None
    radius: str | None = None
    color: str | None = None
    palette: str | None = None
    norm: str | None = None
    gizmo: str | None = None
    base: str = "auto"
    image: str | None = None
    extent: tuple[float, float, float, float] | None = None
    title: str = ""
    source_line: str = ""
    places: Literal["auto", "none", "all"] | tuple[str, ...] = "auto"
    size: tuple[int, int] = (960, 540)
    spp: int | None = None


def checked(table: Table, wishes: Wishes) -> Wishes:
    """The wishes. Raises a UserError if a column or a gizmo does not exist, or wishes do not go together."""
    problems = []
    for option in ("lon", "lat", "name", "height", "radius", "color"):
        column = getattr(wishes, option)
        if column is not None and column not in table.columns:
            text = f"there is no such column in {table.path}; {hint(column, table.names)}"
            problems.append(printable(f'--{option} = "{column}": {text}'))
    names = [name for name in GIZMOS if name != "geometry"]
    if wishes.gizmo is not None and wishes.gizmo not in names:
        problems.append(printable(f'--gizmo = "{wishes.gizmo}": there is no such gizmo; {hint(wishes.gizmo, names)}'))
    elif wishes.gizmo and wishes.height and "height" not in GIZMOS[wishes.gizmo].sizes:
        problems.append(f"--height: a {wishes.gizmo} has no height; write --radius, or take another --gizmo")
    if wishes.extent is not None and wishes.base == "globe":
        problems.append("--extent: a globe shows the whole earth; leave it out, or write --base map")
    if wishes.image is not None and not Path(wishes.image).is_file():
        problems.append(printable(f'--map = "{wishes.image}": there is no such file; check the path'))
    elif wishes.image is not None and wishes.extent is None and wishes.base != "globe":
        text = "the edges of the picture are not known; write --extent WEST,EAST,SOUTH,NORTH in degrees"
        problems.append(f"--map: {text}, such as -180,180,-90,90")
    if wishes.norm is not None and wishes.norm not in NORMS:
        problems.append(printable(f'--norm = "{wishes.norm}": there is no such norm; {hint(wishes.norm, NORMS)}'))
    if problems:
        raise UserError(*problems)
    return wishes


def completed(table: Table, wishes: Wishes) -> Wishes:
    """The wishes with columns to show: without any, the first column of numbers that seems to be a quantity. A column
    that is shown as a size is shown as a colour, too, and the other way round."""
    if not table.lines and (wishes.lon is None or wishes.lat is None):
        try:
            lon, lat = position_columns(table)
        except UserError as error:
            raise UserError(*(text.replace("say which one", "write --lon and --lat") for text in error.lines)) from None
        wishes = replace(wishes, lon=wishes.lon or lon, lat=wishes.lat or lat)
    if wishes.places == "auto":
        few = len(table) <= FEW and not table.lines and (wishes.name or _names(table))
        wishes = replace(wishes, places="all" if few else "none")
    if wishes.places != "none" and wishes.name is None:
        wishes = replace(wishes, name=_names(table))
    if not (wishes.height or wishes.radius or wishes.color):
        record = _quantity(table, (wishes.lon, wishes.lat))
        first, least = (record["column"], record["min"]) if record else (None, None)
        # Bars of negative values would hang below the ground, where they are not seen.
        bars = wishes.gizmo is None and (least is None or least >= 0)
        tall = not table.lines and (bars or (wishes.gizmo is not None and "height" in GIZMOS[wishes.gizmo].sizes))
        wishes = replace(wishes, **({"height": first, "color": first} if tall else {"color": first}))
    return replace(wishes, color=wishes.color or wishes.height or wishes.radius)


def _quantity(table: Table, other: tuple[str | None, ...]) -> dict[str, Any] | None:
    """The first column that seems to be a quantity, as `describe` has it; None if there is none. A column with some
    texts is better than one of equal numbers: the texts will be refused, and the user learns of them.

    other: columns that are none.
    """
    records = [
        record
        for record in describe(table)
        if record["column"] not in other and not NO_QUANTITY.fullmatch(record["column"].casefold())
    ]
    varied = [r for r in records if r["kind"] == "numbers" and r["distinct"] > 1]
    mixed, equal = ([r for r in records if r["kind"] == kind] for kind in ("mixed", "numbers"))
    return next(iter([*varied, *mixed, *equal]), None)


def _names(table: Table) -> str | None:
    """The column with the names of rows: one with a usual name, or the first column of texts; None if there is none."""
    usual = {name.casefold(): name for name in reversed(table.names)}
    texts = [record["column"] for record in describe(table) if record["kind"] == "texts"]
    return next((usual[name] for name in NAME_COLUMNS if name in usual), next(iter(texts), None))
