"""How the reports of a study write numbers, durations, values and settings."""

from collections.abc import Callable
from math import isfinite
from typing import Any

from visray.study.cost.comparing import is_number
from visray.study.cost.records import Band, Record


def number(x: float | None, digits: int = 3) -> str:
    """A number as text; a dash for none. Large numbers have no exponent."""
    if x is None or not isfinite(x):
        return "-"
    # 999.7 rounds to 1,000, not to 1e+03.
    return f"{x:,.0f}" if abs(float(f"{x:.{digits}g}")) >= 10**digits else f"{x:.{digits}g}"


def hundredths(x: float) -> str:
    """A number with two decimals; what rounds to 0 has no sign."""
    return f"{round(x, 2) + 0.0:.2f}"


def percent(x: float, digits: int = 3) -> str:
    """A share in percent."""
    return f"{number(100 * x, digits)} %"


def times(factor: Band) -> str:
    """A multiple of the time with its interval: "3.8 times the time (3.1 to 4.7)"; in percent below 1."""
    if number(factor.middle, 2) == "1" and isfinite(factor.high):
        return f"the same time ({number(factor.low, 2)} to {number(factor.high, 2)} times)"
    write: Callable[[float], str] = (lambda x: number(100 * x, 2)) if factor.middle < 1 else (lambda x: number(x, 2))
    text = f"{write(factor.middle)} % of the time" if factor.middle < 1 else f"{write(factor.middle)} times the time"
    ends = f"{write(factor.low)} to {write(factor.high)}" if isfinite(factor.high) else f"at least {write(factor.low)}"
    return f"{text} ({ends})"


def interval(b: Band, write: Callable[[float], str] = number) -> str:
    """A number with its interval."""
    return f"{write(b.middle)} ({write(b.low).removesuffix(' %')} to {write(b.high)})"


def duration(seconds: float | Band | None) -> str:
    """Seconds as text, with their interval where they have one; in milliseconds below one second."""
    middle = seconds.middle if isinstance(seconds, Band) else seconds
    if middle is None or not isfinite(middle):
        return "-"
    factor, unit = (1e3, "ms") if float(f"{middle:.3g}") < 1 else (1, "s")
    scaled = lambda x: number(factor * x)  # noqa: E731 - a name for a row
    if isinstance(seconds, Band):
        return f"{scaled(middle)} {unit} ({scaled(seconds.low)} to {scaled(seconds.high)})"
    return f"{scaled(middle)} {unit}"


def written(value: Any) -> str:
    """The value of a setting or of an address as text."""
    if isinstance(value, bool) or value is None:
        return {True: "on", False: "off", None: "-"}[value]
    if isinstance(value, dict):
        return ", ".join(f"{k} {written(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(written, value))
    return number(value, 6) if is_number(value) else str(value)


def changes(record: Record, default: Record) -> dict[str, Any]:
    """The settings that differ from the scene's, by address."""
    before = default.settings
    return {a: v for a, v in record.settings.items() if a not in before or before[a] != v}
