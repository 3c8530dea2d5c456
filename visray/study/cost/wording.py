"""How numbers and settings are written in a report of costs."""

from math import isfinite
from typing import Any

import numpy as np

from visray.study.cost.records import Band, Point

# The note of a report that Ctrl-C has ended.
STOPPED = "stopped before its end: this is what was measured until then"


def number(x: float | None, digits: int = 3) -> str:
    """A number as text; a dash where there is none."""
    if x is None or not isfinite(x):
        return "-"
    # What rounds up to it counts too: 999.7 is 1,000, not 1e+03.
    return f"{x:,.0f}" if abs(float(f"{x:.{digits}g}")) >= 10**digits else f"{x:.{digits}g}"


def hundredths(x: float) -> str:
    """With two decimals; what rounds to 0 has no sign."""
    return f"{round(x, 2) + 0.0:.2f}"


def percent(x: float) -> str:
    return f"{number(100 * x)} %"


def band(b: Band, write: Any = number) -> str:
    return f"{write(b.middle)} [{write(b.low)}, {write(b.high)}]"


def duration(seconds: float | Band | None) -> str:
    """Seconds as text, with their band where they have one: in milliseconds below one second."""
    middle = seconds.middle if isinstance(seconds, Band) else seconds
    if middle is None or not isfinite(middle):
        return "-"
    factor, unit = (1e3, "ms") if float(f"{middle:.3g}") < 1 else (1, "s")
    scaled = lambda x: number(factor * x)  # noqa: E731 - a name for a row
    return f"{band(seconds, scaled) if isinstance(seconds, Band) else scaled(seconds)} {unit}"


def sampler(knob: str) -> str:
    """The sampler of a knob that is the number of its samples, as it is read; "" for another knob."""
    kind, _, name = knob.partition(", ")
    return ("Sobol" if name == "sobol" else name) if kind == "samples" else ""


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
