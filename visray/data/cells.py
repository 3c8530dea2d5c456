"""The cells of a column while a file is read: as numbers at once if all of them are plain, else as texts.

Plain numbers have digits, a decimal point and an exponent only. They need a tenth of the time and memory of texts.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from visray.data.numerals import Numbers, read_column
from visray.data.table import as_texts

# Characters of plain numbers, with a line feed between them, and of nothing else.
_PLAIN = b"0123456789eE+-.\n"
# Between line feeds: a code such as 007, and a whole number too long for a double.
_CODE = re.compile(r"\n[+-]?0\d+\n|\n[+-]?\d{16,}\n", re.ASCII)
# A point that is decimal for certain: the digits around it are no thousands.
_POINT = re.compile(r"\.(?!\d{3}\n)|\n[+-]?(?:0|\d{4,})?\.", re.ASCII)


@dataclass
class Column:
    """A column of a file that is being read.

    index: its place in the rows
    separator: the character between the cells of the file
    numbers: arrays of plain numbers, one for each part of the file
    texts: its cells, if the first part of the file shows that they are not plain; else None
    late: whether a later part shows this. Then the file is read again.
    point, unclear: whether some number shows that the point is decimal, and whether some point may separate thousands
    """

    index: int
    separator: str
    numbers: list[np.ndarray] = field(default_factory=list)
    texts: list[str] | None = None
    late: bool = False
    point: bool = False
    unclear: bool = False
    _same: dict[str, str] = field(default_factory=dict)

    def add(self, cells: Sequence[str]) -> None:
        """Adds the next cells."""
        if self.late:
            return
        if self.texts is None:
            if (values := self._plain(cells)) is not None:
                self.numbers.append(values)
                return
            if self.numbers:
                self.late, self.numbers = True, []
                return
            self.texts = []
        # Equal texts share one object: a column of countries has few.
        same = self._same
        self.texts += [same.setdefault(cell, cell) for cell in cells]

    def restart(self) -> None:
        """Begins anew, with texts."""
        self.numbers, self.texts, self.late = [], [], False

    def _plain(self, cells: Sequence[str]) -> np.ndarray | None:
        """The numbers of cells; None if they are not all plain."""
        joined = "\n".join(("", *cells, ""))
        if not joined.isascii() or joined.encode().translate(None, _PLAIN) or _CODE.search(joined):
            return None
        try:
            values = np.fromiter(map(float, [cell or "nan" for cell in cells]), float, len(cells))
        except ValueError:
            return None
        if np.isinf(values).any():
            return None
        if "." in joined:
            self.point = self.point or _POINT.search(joined) is not None
            self.unclear = self.unclear or not self.point
        return values


def columns_of(
    columns: list[Column], again: Callable[[list[Column]], None]
) -> tuple[list[np.ndarray], str, list[tuple[int, str]]]:
    """Values of all columns, the decimal mark that they show, and notes with the index of their column.

    again: function that reads the file once more for some columns.
    """
    _restart([c for c in columns if c.late], again)
    read = {c.index: read_column(c.texts, "", c.separator) for c in columns if c.texts is not None}
    decimal = _decimal(columns, read)
    if decimal == ",":
        # Points that may separate thousands do so where commas are decimal.
        unclear = [c for c in columns if c.texts is None and c.unclear and not c.point]
        _restart(unclear, again)
        read |= {c.index: read_column(c.texts, decimal, c.separator) for c in unclear}
    values, notes = [], []
    for column in columns:
        if column.texts is None:
            values.append(np.concatenate(column.numbers))
            continue
        known = read[column.index]
        if decimal and not known.shows:
            known = read_column(column.texts, decimal, column.separator)
        kept = known.bad or known.codes or (np.isnan(known.values).all() and any(column.texts))
        values.append(as_texts(column.texts) if kept else known.values)
        notes += [(column.index, text) for text in known.notes if len(known.bad) * 2 < len(column.texts)]
    return values, decimal, notes


def _restart(columns: list[Column], again: Callable[[list[Column]], None]) -> None:
    """Reads some columns once more, as texts."""
    for column in columns:
        column.restart()
    if columns:
        again(columns)


def _decimal(columns: list[Column], read: dict[int, Numbers]) -> str:
    """The decimal mark that the columns of a file show; "" if they show none, or both."""
    shown = {known.shows for known in read.values() if known.shows and 2 * len(known.bad) < len(known.values)}
    shown |= {"." for column in columns if column.texts is None and column.point}
    return shown.pop() if len(shown) == 1 else ""
