"""How numbers and settings are written in a report of costs."""

from math import isfinite
from typing import Any

import numpy as np

from visray.study.cost.records import Point


def number(x: float | None, digits: int = 3) -> str:
    """A number as text; a dash where there is none."""
    if x is None or not isfinite(x):
        return "-"
    return f"{x:,.0f}" if abs(x) >= 10**digits else f"{x:.{digits}g}"


def percent(x: float) -> str:
    return f"{number(100 * x)} %"


def written(value: Any) -> str:
    """A knob's value, or a setting, as text."""
    if isinstance(value, bool) or value is None:
        return {True: "on", False: "off", None: "-"}[value]
    if isinstance(value, dict):
        return ", ".join(f"{k} {written(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(written, value))
    return number(value, 6) if is_number(value) else str(value)


def changes(point: Point, default: Point) -> dict[str, Any]:
    """The settings that are not the default's, by address."""
    before = default.settings
    return {k: v for k, v in point.settings.items() if k not in before or before[k] != v}


def is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool) and isfinite(value)
