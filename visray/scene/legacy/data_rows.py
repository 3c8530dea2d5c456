"""Rows of a property of a VisRayTrace data scene: [x, z, value] or [x, z, value, value 2]."""

from dataclasses import dataclass
from math import isfinite
from typing import Any

from visray.scene.legacy.entry import Entry, is_number
from visray.scene.messages import line

# Number of wrong rows that are reported one by one.
REPORTED = 5
# VisRayTrace stored this number in place of a second value that a row does not have.
NO_SECOND_VALUE = -1
FORM = "a row is [x, z, value] or [x, z, value, value 2]"


@dataclass(frozen=True)
class DataRows:
    """Rows of a property, as columns.

    x, z: place of each row: longitude and latitude in degrees, or other coordinates.
    value: value of each row.
    second: second value of each row; None if the row has no second value.
    """

    x: tuple[float, ...]
    z: tuple[float, ...]
    value: tuple[float, ...]
    second: tuple[float | None, ...]

    def with_second(self) -> "DataRows":
        """The rows that have a second value."""
        return DataRows(*zip(*(row for row in self.rows() if row[3] is not None)))

    def rows(self) -> list[tuple]:
        """List of the rows (x, z, value, second)."""
        return list(zip(self.x, self.z, self.value, self.second))


def data_rows(e: Entry, compat: bool) -> DataRows | None:
    """Rows of a property, or None if it has none. Errors of rows are in the log: the first ones, and how many.

    Each row has its own number of values. In VisRayTrace, the last row of the file decided for all. With `compat`, a
    second value of -1 means that there is none, as in VisRayTrace.

    e: the property.
    """
    if not e.has("data"):
        e.log.error(f"{e.at('data')}: the key is missing; it is a list of rows, and {FORM}")
        return None
    written = e.items("data")
    if not isinstance(e.values["data"], list) or not _are_right(e, written):
        return None
    complete = [row for row in written if None not in row[:4]]
    if len(complete) < len(written):
        e.log.warn(f"{e.at('data')}: {_rows(len(written) - len(complete))} with null are left out")
    if not complete:
        e.log.warn(f"{e.at('data')}: there are no rows; nothing is drawn for this property")
        return None
    if surplus := sum(len(row) > 4 for row in complete):
        e.log.warn(f"{e.at('data')}: {_rows(surplus)} with more than 4 numbers; all after the fourth are ignored")
    second = [_second_value(row, compat) for row in complete]
    if odd := sum(value == NO_SECOND_VALUE for value in second):
        text = "VisRayTrace drew nothing for it, and neither does visray with --compat"
        e.log.warn(f"{e.at('data')}: {_rows(odd)} with the second value -1, which is drawn; {text}")
    return DataRows(*(tuple(float(row[i]) for row in complete) for i in range(3)), tuple(second))


def _second_value(row: list, compat: bool) -> float | None:
    """Second value of a row, or None."""
    if len(row) < 4 or (compat and row[3] == NO_SECOND_VALUE):
        return None
    return float(row[3])


def _are_right(e: Entry, written: list[Any]) -> bool:
    """Whether all rows have the right form. If not, the log gets errors about the first wrong ones."""
    wrong = [(i, flaw) for i, row in enumerate(written) if (flaw := _flaw(row))]
    for i, flaw in wrong[:REPORTED]:
        e.log.error(line(f"{e.at('data')}.{i}", written[i], flaw))
    if len(wrong) > REPORTED:
        e.log.error(f"{e.at('data')}: {len(wrong)} of {_rows(len(written))} are wrong; the first {REPORTED} are above")
    return not wrong


def _flaw(row: Any) -> str | None:
    """What is wrong with the form of a row, or None. Null stands for a missing number."""
    if not isinstance(row, list):
        return f"is not a row; {FORM}"
    if len(row) < 3:
        return f"has {len(row)} of 3 numbers; {FORM}"
    wrong = next((x for x in row if x is not None and not (is_number(x) and isfinite(x))), None)
    if wrong is None:
        return None
    return f"must be finite numbers; {FORM}" if is_number(wrong) else f"must be numbers, without quotes; {FORM}"


def _rows(count: int) -> str:
    """A number of rows in words."""
    return "1 row" if count == 1 else f"{count} rows"
