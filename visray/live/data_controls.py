"""Controls of data: the date, the domains of palettes, and the numbers of rows. Some of them are null in the scene, or
have no field there yet."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from visray.data import dates
from visray.data.color_rule import ColorRule
from visray.data.data_scene import Data
from visray.data.layer import DataLayer
from visray.data.resolve import timed_layer
from visray.data.resolved_colors import ResolvedColors
from visray.errors import UserError
from visray.live.controls import Control, made
from visray.live.ranges import Range, range_around, step_of
from visray.scene.address import value
from visray.scene.scene import Scene

DATE = "data.date"
PLACES = {"lon": Range(-180.0, 180.0, 0.1), "lat": Range(-90.0, 90.0, 0.1)}


def addresses(scene: Scene) -> Iterator[str]:
    """Yields the addresses of the date and of the domains that colours have. The scene itself may have null there."""
    if scene.data is None:
        return
    if any(layer.time is not None for layer in scene.data.layers.values()):
        yield DATE
    for name in scene.data.layers:
        if _color_rule(scene.data, name) is not None:
            yield f"data.layers.{name}.color.domain"


def control(scene: Scene, address: str) -> Control | None:
    """The control of an address of `addresses`, or of a number of a row; None for any other address."""
    parts = address.split(".")
    if scene.data is None or parts[0] != "data":
        return None
    if address == DATE:
        return _date(scene.data)
    if parts[1] == "layers" and parts[3:] == ["color", "domain"] and parts[2] in scene.data.layers:
        return _domain(scene.data, parts[2])
    return _row(scene, address) if parts[1] in scene.data.layers and len(parts) == 4 else None


def _date(data: Data) -> Control | None:
    """The control of the date, as a year with a fraction, or of the number that layers have instead of dates; None if
    no layer has a time."""
    layers = {name: timed_layer(x, data.base).timeline for name, x in data.layers.items() if x.time is not None}
    if not layers:
        return None
    shown = data.shown_date
    alike = [x for x in layers.values() if x.moments.calendar == shown.finest.calendar]
    ends = min(x.limits[0] for x in alike), max(x.limits[1] for x in alike)
    low, now, high = (_year(x) if shown.finest.calendar else x for x in (ends[0], shown.number, ends[1]))
    unit = "a year with a fraction" if shown.finest.calendar else "as in the data"
    # By a millionth of a year, because the rounding of a year must not leave the data.
    low, high = (low + 1e-6, high - 1e-6) if shown.finest.calendar and high - low > 1e-5 else (low, high)
    step = step_of(high - low) if high > low else 1.0
    return made(DATE, "number", float(np.clip(now, low, high)), Range(low, high, step), unit)


def _year(number: float) -> float:
    """The date of a number as a year with a fraction: the inverse of dates.of_year."""
    year = dates.moment_of(number).year
    start, end = dates.of_year(year), dates.of_year(year + 1)
    return year + (number - start) / (end - start)


def _color_rule(data: Data, name: str) -> ColorRule | dict[str, Any] | None:
    """The colour rule of a layer whose domain can be chosen, or the fields of the rule that it stands for; None if it
    has none, or if its bands say all."""
    layer: DataLayer = data.layers[name]
    if isinstance(layer.color, ColorRule):
        return None if np.iterable(layer.color.bands) or layer.color.norm == "quantile" else layer.color
    column = layer.color if layer.color is not None else layer.value
    if isinstance(column, str) and isinstance(data.rows[name].rules.get("color"), ResolvedColors):
        return {"column": column}
    return None


def _domain(data: Data, name: str) -> Control | None:
    """The control of the domain of a layer's colours."""
    rule = _color_rule(data, name)
    if rule is None:
        return None
    rows = data.rows[name]
    found: ResolvedColors = rows.rules["color"]
    known = rows.known("color") if "color" in rows.values else np.zeros(0)
    known = known[np.isfinite(known)]
    is_log = isinstance(rule, ColorRule) and rule.norm == "log"
    reach = range_around((float(min([found.lo, *known])), float(max([found.hi, *known]))), is_log)
    written = None if isinstance(rule, ColorRule) else (f"data.layers.{name}.color", tuple(rule.items()))
    return made(
        f"data.layers.{name}.color.domain",
        "range",
        (found.lo, found.hi),
        reach,
        "the values at the ends of the palette",
        rule=written,
        center=rule.center if isinstance(rule, ColorRule) and rule.norm == "symmetric" else None,
    )


def _row(scene: Scene, address: str) -> Control | None:
    """The control of a number of a row; None if there is no such number, or if it is missing."""
    try:
        now = float(value(scene, address))
    except UserError:
        return None
    _, layer, number, name = address.split(".")
    if np.isnan(now):
        return None
    rows = scene.data.rows[layer]
    title = "" if rows.texts is None else str(rows.texts[rows.index(int(number))])
    if name in PLACES:
        return made(address, "number", now, PLACES[name].containing(now), "degrees", title=title)
    known = rows.known(name)
    known = known[np.isfinite(known)]
    ends = float(known.min()), float(known.max())
    low, high = min(0.0, *ends, now), max(*ends, now)
    high = high if high > low else low + 1.0
    step = step_of(high - low)
    # A row whose gizmo has no size is not shown, and has no numbers any more.
    low = step if low == 0 and now >= step and name != "color" else low
    return made(address, "number", now, Range(low, high, step), "as in the data", title=title)
