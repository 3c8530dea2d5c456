"""What a user asks for who wants a picture of a table, checked and completed from the table."""

import re
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import Any, Literal, get_args

from visray.animation.animation import LONGEST
from visray.animation.track import MOST_TURNS
from visray.data.color_rule import NormName
from visray.data.color_value import color_flaw
from visray.data.describe import describe
from visray.data.gizmos import GIZMOS
from visray.data.name_column import name_column
from visray.data.palette import palette_flaw
from visray.data.positions import position_columns
from visray.data.table import Table
from visray.errors import UserError
from visray.hints import hint
from visray.terminal import printable

# Names of columns with numbers that are no quantities, in lower case: they are not shown unless the user asks for it.
NO_QUANTITY = re.compile(r"(id|.*[_ ]id|index|no|nr|num|rank|code|zip|postcode|year|jahr|any|month|day|date|time)")

# Norms of colours; bands need their number, which a scene file gives.
NORMS = tuple(name for name in get_args(NormName) if name != "banded")

# Other words for gizmos, without the s of the plural.
CALLED = {
    "cylinder": ("bar", "column", "pillar", "tube"),
    "sphere": ("ball", "bubble", "point", "dot", "globe"),
    "disk": ("circle", "disc"),
    "box": ("cube", "block", "square", "boxe"),
    "cone": ("pyramid", "spike"),
    "line": ("path", "outline", "route", "polygon", "area"),
}

# Largest number of rows whose names are written without being asked for.
FEW = 15


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """What a user asks for; None: it is chosen here.

    lon, lat, name, height, radius, color, time_column: columns
    date: the date that is shown, as text or number
    held: whether numbers are held between dates, and not interpolated
    animate: seconds of an animation that goes through all dates
    turns: how often a globe turns in it
    palette, norm, gizmo: names
    domain: values at the two ends of the colours
    bands: number of steps of the colours
    labels, units: texts in place of the names of columns, and their units, by column
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
    time_column: str | None = None
    date: str | float | None = None
    held: bool = False
    animate: float | None = None
    turns: float | None = None
    name: str | None = None
    height: str | None = None
    radius: str | None = None
    color: str | None = None
    palette: str | None = None
    norm: str | None = None
    domain: tuple[float, float] | None = None
    bands: int | None = None
    labels: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
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
    for option in ("lon", "lat", "name", "height", "radius", "color", "time_column"):
        column = getattr(wishes, option)
        if column is not None and column not in table.columns:
            text = f"there is no such column in {table.path}; {hint(column, table.names)}"
            if option == "color" and color_flaw(column) is None:
                text += f'; to give all rows one colour, write "color": "{column}" into the layer of the scene'
            problems.append(printable(f'--{option.replace("_", "-")} = "{column}": {text}'))
    animated = wishes.animate is not None
    for option, given in (("date", wishes.date is not None), ("held", wishes.held), ("animate", animated)):
        if given and wishes.time_column is None:
            text = "goes with dates of rows; name their column, as in --time-column date"
            problems.append(f"--{option}: {text}")
    problems += _animation_problems(wishes)
    if wishes.gizmo is not None and (wishes.gizmo not in GIZMOS or wishes.gizmo == "geometry"):
        problems.append(printable(f'--gizmo = "{wishes.gizmo}": there is no such gizmo; {gizmo_hint(wishes.gizmo)}'))
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
    for option in ("labels", "units"):
        for column in getattr(wishes, option):
            if column not in table.columns:
                text = f"there is no such column in {table.path}; {hint(column, table.names)}"
                problems.append(printable(f'--{option} = "{column}": {text}'))
    if wishes.palette is not None and (flaw := palette_flaw(wishes.palette)):
        problems.append(printable(f'--palette = "{wishes.palette}": {flaw[1]}'))
    if problems:
        raise UserError(*problems)
    return wishes


def _animation_problems(wishes: Wishes) -> list[str]:
    """What is wrong with the wishes for an animation, each a sentence."""
    if wishes.animate is None:
        return [] if wishes.turns is None else ["--turns: goes with --animate, the length of the animation in seconds"]
    problems = []
    if not 0 < wishes.animate <= LONGEST:
        text = f"must be a number of seconds greater than 0, such as 10, and at most {LONGEST}"
        problems.append(f"--animate = {wishes.animate:g}: {text}")
    if wishes.turns is not None and not abs(wishes.turns) <= MOST_TURNS:
        problems.append(f"--turns = {wishes.turns:g}: must be a number of turns, such as 1, or -1 for the other way")
    if wishes.date is not None:
        problems.append("--date: changes during --animate; leave one of them out")
    return problems


def gizmo_hint(word: str) -> str:
    """Hint at the gizmo that a wrong word may mean: `cylinder` for `bars`."""
    names = [name for name in GIZMOS if name != "geometry"]
    single = word.casefold().removesuffix("s")
    return hint(next((name for name, words in CALLED.items() if single in words), single), names)


def shows_lines(table: Table, gizmo: str | None) -> bool:
    """Whether the lines of a table are shown, and not its points. gizmo: None if the user names none."""
    return bool(table.lines) and gizmo in (None, "line")


def completed(table: Table, wishes: Wishes) -> Wishes:
    """The wishes with columns to show: without any, the first column of numbers that seems to be a quantity. A column
    that is shown as a size is shown as a colour, too, and the other way round."""
    lines = shows_lines(table, wishes.gizmo)
    if not lines and (wishes.lon is None or wishes.lat is None):
        try:
            lon, lat = position_columns(table, wishes.lon, wishes.lat)
        except UserError as error:
            raise UserError(*(_with_options(text, wishes) for text in error.lines)) from None
        wishes = replace(wishes, lon=wishes.lon or lon, lat=wishes.lat or lat)
    if wishes.places == "auto":
        few = not lines and _has_few_names(table, wishes)
        wishes = replace(wishes, places="all" if few else "none")
    if wishes.places != "none" and wishes.name is None:
        wishes = replace(wishes, name=name_column(table))
    if not (wishes.height or wishes.radius or wishes.color):
        record = _quantity(table, (wishes.lon, wishes.lat, wishes.time_column))
        first, least = (record["column"], record["min"]) if record else (None, None)
        # Bars of negative values would hang below the ground, where they are not seen.
        bars = wishes.gizmo is None and (least is None or least >= 0)
        tall = not lines and (bars or (wishes.gizmo is not None and "height" in GIZMOS[wishes.gizmo].sizes))
        wishes = replace(wishes, **({"height": first, "color": first} if tall else {"color": first}))
    return replace(wishes, color=wishes.color or wishes.height or wishes.radius)


def _with_options(text: str, wishes: Wishes) -> str:
    """A text about a missing column of positions, with the options that say it, and with what a table without places
    can do."""
    missing = [f"--{key}" for key in ("lon", "lat") if getattr(wishes, key) is None]
    asked = f"write {' and '.join(missing)}"
    needs = "; each row stands at a place on a map or a globe, so a table needs both"
    return text.replace("say which one", asked) + needs * ("no column is named" in text)


def _has_few_names(table: Table, wishes: Wishes) -> bool:
    """Whether there are few rows, or few places if these have dates, with names."""
    column = wishes.name or name_column(table)
    if column is None:
        return False
    return (len(table) if wishes.time_column is None else len(set(table.texts(column).tolist()))) <= FEW


def passed_over(table: Table, wishes: Wishes) -> list[str]:
    """Sentences about columns that would have been chosen, but hold some texts. wishes: the completed ones, of a user
    who names no column to show"""
    other, shown = (wishes.lon, wishes.lat, wishes.time_column), wishes.color
    records = {record["column"]: record for record in _quantities(table, other)}
    if shown not in records or records[shown]["kind"] == "mixed":
        return []
    before = takewhile(lambda name: name != shown, records)
    return [
        printable(f'"{shown}" is shown, as the {records[name]["problem"]}')
        for name in before
        if records[name]["kind"] == "mixed"
    ]


def _quantity(table: Table, other: tuple[str | None, ...]) -> dict[str, Any] | None:
    """The first column that seems to be a quantity, as `describe` has it; None if there is none. A column with some
    texts is better than one of equal numbers: the texts will be refused, and the user learns of them.

    other: columns that are none.
    """
    records = _quantities(table, other)
    varied = [r for r in records if r["kind"] == "numbers" and r["distinct"] > 1]
    mixed, equal = ([r for r in records if r["kind"] == kind] for kind in ("mixed", "numbers"))
    return next(iter([*varied, *mixed, *equal]), None)


def _quantities(table: Table, other: tuple[str | None, ...]) -> list[dict[str, Any]]:
    """The columns whose names may be those of quantities, as `describe` has them. other: columns that are none"""
    return [
        record
        for record in describe(table)
        if record["column"] not in other and not NO_QUANTITY.fullmatch(record["column"].casefold())
    ]
