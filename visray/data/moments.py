"""The moments of rows as numbers: dates of one form, or plain numbers such as years."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from visray.data import dates
from visray.data.column import Place
from visray.data.numerals import is_number
from visray.data.table import shown

# Forms of dates that may stand in one column: a day is then its midnight.
OF_DAYS = ("day", "minute", "second", "microsecond")
# Most decimals of a plain number that are shown.
MOST_DECIMALS = 6
# Number that are written as in 20200615: they are not linear in time.
_COMPACT = range(1000_01_01, 3000_01_01)
# Years that may stand behind the point of numbers such as 1.2024, which are months: the number of a month of 2020 has
# three decimals. Other moments with so many decimals do not all have such ones.
_YEARS, _YEAR_DECIMALS = range(1800, 2200), (3, 4)


@dataclass(frozen=True, eq=False)
class Moments:
    """The moments of rows.

    number: days since the beginning of 1970, or plain numbers; NaN where one is missing. Shape: (N)
    resolution: the unit of time that the dates are written in, or the number of decimals of plain numbers
    """

    number: np.ndarray
    resolution: str | int

    @property
    def calendar(self) -> bool:
        """Whether they are dates, and not plain numbers."""
        return isinstance(self.resolution, str)

    def text(self, number: float) -> str:
        """A moment as text, as fine as the data."""
        return dates.text(number, self.resolution)

    def end(self, number: float) -> float:
        """The end of the month, the day and so on that a date lies in; a plain number as it is."""
        return dates.end(number, self.resolution) if self.calendar else number


def moments_of_numbers(numbers: np.ndarray, place: Place) -> Moments:
    """The moments of plain numbers. Raises ValueError if they are dates without hyphens. place: of a row, in words"""
    given = numbers[~np.isnan(numbers)]
    if np.isinf(given).any():
        row = int(np.flatnonzero(np.isinf(numbers))[0])
        raise ValueError(f"has an infinite number in {place(row)}; leave this cell empty")
    if len(given) and all(_is_compact(x) for x in np.unique(given).tolist()):
        compact = f"{given[0]:.0f}"
        right = f"{compact[:4]}-{compact[4:6]}-{compact[6:]}"
        raise ValueError(f"has numbers that are dates, such as {compact}; write {right}")
    decimals = next((k for k in range(MOST_DECIMALS) if (np.round(given, k) == given).all()), MOST_DECIMALS)
    if decimals in _YEAR_DECIMALS and all(_month(x) for x in np.unique(given).tolist()):
        text = f"has months as 01.2024, which are no numbers; write {_month(given[0])} for {given[0]:07.4f}, and so on"
        raise ValueError(text)
    return Moments(numbers, decimals)


def _month(x: float) -> str | None:
    """The month that a number such as 1.2024 may stand for; None if it can be none."""
    month, _, year = f"{x:.4f}".partition(".")
    return dates.rewritten(f"{month}.{year}") if int(year) in _YEARS else None


def _is_compact(x: float) -> bool:
    """Whether a number is a date that is written as in 20200615."""
    if int(x) != x or int(x) not in _COMPACT:
        return False
    try:
        dates.parse(f"{int(x) // 10000}-{int(x) // 100 % 100:02}-{int(x) % 100:02}")
    except ValueError:
        return False
    return True


def moments_of_texts(texts: Sequence[str], place: Place) -> Moments:
    """The moments of texts. Raises ValueError if one of them is no date, or if they are written in several forms.

    place: of a row, in words
    """
    found: dict[str, tuple[float, str]] = {}
    first: dict[str, int] = {}  # row of the first date of each unit
    for row, text in enumerate(texts):
        if text in found or not text.strip():
            continue
        try:
            found[text] = dates.parsed(text)
        except ValueError as error:
            raise ValueError(f"{place(row)} {shown(text)} {_why(text, error)}") from None
        first.setdefault(found[text][1], row)
    units = list(first)
    if len(units) > 1 and not set(units) <= set(OF_DAYS):
        one, other = (f"{place(first[unit])} {shown(texts[first[unit]])}" for unit in units[:2])
        raise ValueError(f"its dates have several forms, as {one} and {other} have; write all in one form")
    nowhere = (np.nan, "")
    number = np.array([found.get(text, nowhere)[0] for text in texts], float)
    return Moments(number, _resolution(number, units))


def _why(text: str, error: ValueError) -> str:
    """What is wrong with a text that is no date."""
    if right := dates.rewritten(text):
        return f"is no date as it is read here; write {right}"
    return "is a number, and others are texts; write all in one form" if is_number(text.strip()) else str(error)


def _resolution(number: np.ndarray, units: Sequence[str]) -> str:
    """The finest unit of dates, but days if all are midnights. units: those in which they are written"""
    finest = max(units, key=dates.UNITS.index, default="day")
    given = number[~np.isnan(number)]
    return "day" if finest in OF_DAYS and (given == np.floor(given)).all() else finest
