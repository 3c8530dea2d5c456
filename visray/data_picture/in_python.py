"""`vr.data_scene`: what `visray data` makes of a table, as a scene for Python."""

import os
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any

from pydantic import TypeAdapter, ValidationError

from visray.arguments import checked_arguments, python_number, shown
from visray.data.shown_date import Date
from visray.data.source import TableValue
from visray.data_picture.drawn_map import passing_map, write_own_map
from visray.data_picture.picture import TEXTURE, data_picture
from visray.data_picture.wishes import Wishes
from visray.errors import UserError
from visray.scene.adjusted import adjusted
from visray.scene.check import checked
from visray.scene.scene import Scene
from visray.scene.source import wrong_texts
from visray.terminal import printable

BASES = ("auto", "map", "globe")
DATE = TypeAdapter(Date | None)
EDGES = "west, east, south and north in degrees, such as (-10, 30, 35, 60)"
# How messages that name options of the command name the arguments instead.
REWORDED = (
    (r"--extent WEST,EAST,SOUTH,NORTH", "extent=(WEST, EAST, SOUTH, NORTH)"),
    (r"--map IMAGE", "map=IMAGE"),
    (r"--(lon|lat) (\".*?\") --(lon|lat)", r"\1=\2 and --\3"),
    (r"--(\w+) (\".*?\")", r"\1=\2"),
    (r"--(norm|base|gizmo) (quantile|map|globe|sphere)", r'\1="\2"'),
    (r"--time-column (\w+)", r'time_column="\1"'),
    (r"--time-column", "time_column"),
    (r"--(\w+)", r"\1"),
)


@checked_arguments
def data_scene(
    table: Any,
    *,
    height: str | None = None,
    radius: str | None = None,
    color: str | None = None,
    lon: str | None = None,
    lat: str | None = None,
    time_column: str | None = None,
    date: Any = None,
    held: bool = False,
    animate: float | None = None,
    turns: float | None = None,
    palette: str | None = None,
    norm: str | None = None,
    domain: Sequence | None = None,
    bands: int | None = None,
    labels: Mapping | None = None,
    units: Mapping | None = None,
    gizmo: str | None = None,
    base: str = "auto",
    map: str | os.PathLike | None = None,
    extent: Sequence | None = None,
    title: str = "",
    source_line: str = "",
    name: str | None = None,
    places: str | Sequence = "auto",
    size: tuple[int, int] | None = None,
    spp: int | None = None,
    map_file: str | os.PathLike | None = None,
) -> Scene:
    """A scene that shows a table as bars, spheres or lines on a map or a globe. Map, camera, lights and legend are
    fitted to the data, as the command `visray data` does. The scene is like any other: change it with vr.replaced or
    dataclasses.replace, and render it with vr.render.

    table: path of a .csv, .tsv, .txt or GeoJSON file, or a dict of columns, a list of records, a data frame, and so on.
    height, radius, color: columns shown as the height of bars, the size of spheres or the width of bars, and colours.
        Without any, the first column with quantities is shown.
    lon, lat, name: columns of longitudes, latitudes and names; by default found by their names.
    time_column: column of dates or other moments: rows of one name are then one place. date: the one that is shown, a
        date such as "2020-06-15", or a number; by default the first one. held: whether numbers are held between dates,
        and not interpolated.
    animate: seconds of an animation that goes through all dates, as vr.animate renders it; on a globe, the earth turns
        `turns` times, by default once. The camera sees all dates and turns.
    palette, norm: of the colours. domain: values at their two ends. bands: number of their steps.
    labels, units: texts in place of the names of columns, and units, each by column: {"rain": "mm"}.
    gizmo: shape of a datum, such as "cylinder" or "sphere".
    base: "map", "globe", or "auto", a map around the data.
    map: path of a picture of the map; on a map, it needs `extent`. By default, a plain map is drawn.
    extent: west, east, south and north edge of the map, in degrees.
    title, source_line: texts of the legend.
    places: rows whose names are written at their places: "none", "all", or a list of names. "auto": all, if there are
        at most 15 rows.
    size: width and height of the picture in pixels; by default (960, 540). spp: samples per pixel.
    map_file: path of a PNG file for the map that is drawn, if the scene is to be kept, such as by vr.dump. A map that
        was drawn there before is replaced, and any other file is an error. By default, the map is in a folder of the
        system that is removed when Python ends.

    What the picture does not show is told by warnings. Raises a UserError, with one line for each mistake.
    """
    wishes = Wishes(
        lon=lon, lat=lat, name=name, height=height, radius=radius, color=color, palette=palette, norm=norm,
        time_column=time_column, date=_date(date), held=held,
        animate=_number("animate", animate), turns=_number("turns", turns),
        domain=_numbers("domain", domain, "must be two numbers, such as (0, 100)", 2), bands=_bands(bands),
        labels=_texts("labels", labels), units=_texts("units", units),
        gizmo=gizmo, base=_base(base), image=None if map is None else os.fspath(map),
        extent=_numbers("extent", extent, f"must be {EDGES}", 4),
        title=title, source_line=source_line, places=_places(places),
    )  # fmt: skip
    if wrong := wrong_texts(
        {"title": title, "source_line": source_line, "places": wishes.places}
        | {"labels": wishes.labels, "units": wishes.units}
    ):
        raise UserError(*wrong)
    if map is not None and map_file is not None:
        raise UserError("map_file: goes with a map that is drawn; leave out map or map_file")
    if size is not None or spp is not None:
        sized = adjusted(Scene(), size=size, spp=spp)
        wishes = replace(wishes, size=sized.film.size, spp=spp)
    try:
        made = data_picture(_source(table), wishes, "map.png")
    except UserError as error:
        raise UserError(*in_python(error.lines)) from None
    scene = made.scene
    if made.drawn is not None:
        path = passing_map(made.drawn) if map_file is None else os.fspath(map_file)
        scene = replace(scene, textures={TEXTURE: replace(scene.textures[TEXTURE], file=path)})
    scene = checked(scene)
    if made.drawn is not None and map_file is not None:
        write_own_map(made.drawn, os.fspath(map_file))
    for text in in_python(made.notes):
        warnings.warn(text, stacklevel=3)
    return scene


def _source(table: Any) -> str | TableValue:
    """The source of the layer: the path of a file, or the table itself."""
    if isinstance(table, (str, os.PathLike)):
        return os.fspath(table)
    # The readers are imported where they are needed.
    from visray.data.frames import table_of

    try:
        return TableValue(table_of(table))
    except UserError as error:
        raise UserError(*(text.replace("; give a dict", "; give a path, a dict") for text in error.lines)) from None


def _date(date: Any) -> str | float | None:
    """The date that is shown. Raises a UserError if it is none."""
    try:
        return DATE.validate_python(python_number(date))
    except ValidationError:
        raise UserError(f'date = {shown(date)}: must be a date such as "2020-06-15", or a number') from None


def _number(name: str, given: Any) -> float | None:
    """The number of an argument. Raises a UserError if it is none."""
    number = python_number(given)
    if number is not None and (isinstance(number, bool) or not isinstance(number, int | float)):
        raise UserError(f"{name} = {shown(given)}: must be a number")
    return None if number is None else float(number)


def _base(base: str) -> str:
    """The kind of the base. Raises a UserError if there is none of this name."""
    if base not in BASES:
        raise UserError(f"base = {shown(base)}: there is no such base; one of {', '.join(BASES)}")
    return base


def _numbers(name: str, given: Sequence | None, form: str, count: int) -> tuple[float, ...] | None:
    """The numbers of an argument. Raises a UserError if they are not so many. form: what they must be, in words"""
    if given is None:
        return None
    numbers = [python_number(x) for x in given]
    if len(numbers) != count or not all(isinstance(x, (int, float)) and isfinite(x) for x in numbers):
        raise UserError(f"{name} = {shown(given)}: {form}")
    return tuple(map(float, numbers))


def _bands(bands: Any) -> int | None:
    """The number of steps of the colours. Raises a UserError if it is no whole number."""
    if bands is not None and (isinstance(bands, bool) or not isinstance(bands, int)):
        raise UserError(f"bands = {shown(bands)}: must be a whole number")
    return bands


def _texts(name: str, given: Mapping | None) -> dict[str, str]:
    """Texts by column. Raises a UserError if there are others."""
    texts = dict(given or {})
    if not all(isinstance(x, str) for pair in texts.items() for x in pair):
        raise UserError(f"{name} = {shown(given)}: must be a dict of texts, such as {{'rain': 'mm'}}")
    return texts


def _places(places: str | Sequence) -> str | tuple[str, ...]:
    """Which rows have their names written. One name stands for itself."""
    if isinstance(places, str):
        return places if places in ("auto", "none", "all") else (places,)
    names = tuple(places)
    if not all(isinstance(x, str) and x for x in names):
        raise UserError(f'places = {shown(places)}: must be "auto", "none", "all", or a list of names')
    return names


def in_python(texts: Sequence[str]) -> list[str]:
    """Messages in which options of the command have become arguments."""
    texts = list(texts)
    for pattern, new in REWORDED:
        texts = [re.sub(pattern, new, text) for text in texts]
    return [printable(text) for text in texts]
