"""Dates as numbers, and numbers as dates: days since the beginning of 1970, in UTC, without leap seconds.

A date is written as in ISO 8601: `2020`, `2020-06`, `2020-06-15`, `2020-06-15T12:30` or `2020-06-15T12:30:15.5Z`. It is
the beginning of its year, month, day, minute or second. A time without a zone is in UTC. Years are from 1 to 9999, in
the calendar of today.
"""

import re
from datetime import UTC, datetime, timedelta
from decimal import ROUND_FLOOR, Decimal
from math import floor, ulp
from typing import Any

# Units of time that dates are written in, the longest first.
UNITS = ("year", "month", "day", "minute", "second", "microsecond")
# What messages say of a text that is no date.
RIGHT = "write a date such as 2020-06-15, 2020-06 or 2020-06-15T12:30"
EPOCH = datetime(1970, 1, 1)
DAY = 86_400 * 10**6  # microseconds
_TIME = r"[T ]\d\d:\d\d(?P<second>:\d\d(?P<microsecond>[.,]\d{1,9})?)?(?P<zone>Z|[+-]\d\d:?\d\d)?"
_DATE = re.compile(rf"\d{{4}}(?P<month>-\d\d(?P<day>-\d\d(?P<minute>{_TIME})?)?)?", re.ASCII)
_DOTTED = re.compile(r"((?P<day>\d\d?)\.)?(?P<month>\d\d?)\.(?P<year>\d{4})", re.ASCII)
_FORMATS = {
    "year": "%Y", "month": "%Y-%m", "day": "%Y-%m-%d", "minute": "%Y-%m-%d %H:%M", "second": "%Y-%m-%d %H:%M:%S",
    "microsecond": "%Y-%m-%dT%H:%M:%S.%f",
}  # fmt: skip
# The parts of a date that a format may contain.
DIRECTIVES = "YmdHMSBbAaj%"
# A number is rounded to this share of its last decimal before the rest is cut off: sums of a track are rounded too.
_ROUNDED = 6


def parse(text: str) -> float:
    """The number of a date. Raises ValueError if the text is none."""
    return parsed(text)[0]


def number(value: Any) -> float:
    """The number of a date, or a number as it is. Raises ValueError if the value is a text, and no date."""
    return parse(value) if isinstance(value, str) else float(value)


def parsed(text: str) -> tuple[float, str]:
    """The number of a date, and the unit that it is written in. Raises ValueError if the text is no date."""
    bare = text.strip()
    found = _DATE.fullmatch(bare)
    if found is None:
        raise ValueError(f"is no date; {RIGHT}")
    unit = next((unit for unit in reversed(UNITS[1:]) if found[unit]), "year")
    # Python reads no date without a day, and no fraction of more than six digits.
    whole = bare + {"year": "-01-01", "month": "-01"}.get(unit, "")
    if unit == "microsecond":
        digits = found["microsecond"][1:]
        whole = whole.replace(found["microsecond"], f".{digits[:6]:0<6}")
    try:
        moment = datetime.fromisoformat(whole)
        moment = moment if moment.tzinfo is None else moment.astimezone(UTC).replace(tzinfo=None)
    except (ValueError, OverflowError):
        raise ValueError("is no date of the calendar") from None
    return (moment - EPOCH) / timedelta(days=1), unit


def rewritten(text: str) -> str | None:
    """A date such as 15.06.2020 or 06.2020 as it is read here; None if the text is no such date."""
    found = _DOTTED.fullmatch(text.strip())
    if found is None:
        return None
    right = f"{found['year']}-{int(found['month']):02}" + (f"-{int(found['day']):02}" if found["day"] else "")
    try:
        parse(right)
    except ValueError:
        return None
    return right


def moment_of(number: float) -> datetime:
    """The date of a number, to the microsecond, or to 10 or 100 of them where double precision tells no less. Domain:
    the years from 1 to 9999."""
    # Rounded, because a minute must not end a microsecond early.
    spacing = ulp(number) * DAY
    step = next(step for step in (1, 10, 100) if spacing <= step)
    days = floor(number)
    return EPOCH + timedelta(days=days, microseconds=round((number - days) * DAY / step) * step)


def text(number: float, resolution: str | int) -> str:
    """A number as text: the date to a unit, as in "2020-06" for month, or a number with so many decimals. What is finer
    is cut off. `parse` reads the date again, and as "microsecond" to a microsecond.

    resolution: one of UNITS, or a number of decimals
    """
    if isinstance(resolution, str):
        return written(number, _FORMATS[resolution])
    rounded = round(number, resolution + _ROUNDED)
    return f"{Decimal(repr(rounded)).quantize(Decimal(1).scaleb(-resolution), ROUND_FLOOR):f}"


def written(number: float, pattern: str) -> str:
    """The date of a number in a format such as "%B %Y". Domain: `pattern_flaw` finds nothing."""
    moment = moment_of(number)
    # Not every system writes the year 987 with four digits.
    return moment.strftime(re.sub(r"%(Y|%)", lambda m: f"{moment.year:04}" if m[1] == "Y" else "%%", pattern))


def pattern_flaw(pattern: str) -> str | None:
    """What is wrong with a format of dates; None if nothing is."""
    parts = re.findall("%(.?)", pattern.replace("%%", ""), re.DOTALL)
    if not parts:
        return 'has no part of a date; write one, such as "%B %Y", or true'
    wrong = next((part for part in parts if not part or part not in DIRECTIVES), None)
    listed = ", ".join(f"%{c}" for c in DIRECTIVES)
    return None if wrong is None else f'"%{wrong}" is no part of a date; one of {listed}'


def beginning(number: float, unit: str) -> float:
    """The number of the beginning of the unit of time that a date lies in."""
    return number if unit == "microsecond" else parse(text(number, unit))


def end(number: float, unit: str) -> float:
    """The number of the end of the unit of time that a date lies in, which is the beginning of the next one. The end of
    a microsecond is the date itself, and that of the year 9999 is its last second."""
    if unit == "microsecond":
        return number
    start = moment_of(beginning(number, unit))
    months = 12 * start.year + start.month - 1 + (12 if unit == "year" else 1)
    try:
        if unit in ("year", "month"):
            after = datetime(months // 12, months % 12 + 1, 1)
        else:
            after = start + timedelta(**{f"{unit}s": 1})
    except (ValueError, OverflowError):
        after = datetime(9999, 12, 31, 23, 59, 59)
    return (after - EPOCH) / timedelta(days=1)


def of_year(year: float) -> float:
    """The number of a date that is a year with a fraction: 1987.5 is the middle of 1987. Raises ValueError for years
    that are not from 1 to 9999."""
    whole = int(year // 1)
    if not 1 <= whole <= 9998:
        raise ValueError("must be a year from 1 to 9998")
    start, end = (datetime(y, 1, 1) for y in (whole, whole + 1))
    return (start - EPOCH + (year - whole) * (end - start)) / timedelta(days=1)
