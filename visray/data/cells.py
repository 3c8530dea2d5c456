"""The cells of a column while a file is read: as numbers at once if all of them are plain, else as texts.

Plain numbers have digits, a decimal point and an exponent only. They need a tenth of the time and memory of texts.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from visray.data.numerals import DECIMAL_COMMA, DECIMAL_POINT, ELSEWHERE, OFTEN_MISSING, Numbers, read_column
from visray.data.table import as_texts

# Characters of plain numbers, with a line feed between them, and of nothing else.
_PLAIN = b"0123456789eE+-.,\n"
_WORDS = OFTEN_MISSING - {""}
# Equal texts of a column share one object, up to about this many different ones: a column of countries has few.
FEW = 100_000
# Between line feeds: a code such as 007, and a whole number too long for a double.
_CODE = re.compile(r"\n[+-]?0\d+\n|\n[+-]?\d{16,}\n", re.ASCII)
# A mark that is decimal for certain: the digits around it are no thousands.
_CERTAIN = {m: re.compile(rf"[{m}](?!\d{{3}}\n)|\n[+-]?(?:0\d*|\d{{4,}})?[{m}]", re.ASCII) for m in ".,"}


@dataclass
class Column:
    """A column of a file that is being read.

    index: its place in the rows
    separator: the character between the cells of the file
    numbers: arrays of plain numbers, one for each part of the file
    texts: its cells, if the first part of the file shows that they are not plain; else None
    late: whether a later part shows this. Then the file is read again.
    mark: the decimal mark of its plain numbers; "" if none has any
    certain: whether some plain number shows that this mark is decimal, and does not separate thousands
    words: whether missing values are written, such as NA, and not left empty
    """

    index: int
    separator: str
    numbers: list[np.ndarray] = field(default_factory=list)
    texts: list[str] | None = None
    late: bool = False
    mark: str = ""
    certain: bool = False
    words: bool = False
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
        same = self._same
        self.texts += cells if len(same) > FEW else [same.setdefault(cell, cell) for cell in cells]

    def restart(self) -> None:
        """Begins anew, with texts."""
        self.numbers, self.texts, self.late = [], [], False

    def _plain(self, cells: Sequence[str]) -> np.ndarray | None:
        """The numbers of cells; None if they are not all plain, or if they have both marks."""
        if words := not _WORDS.isdisjoint(cells):
            cells = ["" if cell in OFTEN_MISSING else cell for cell in cells]
        joined = "\n".join(("", *cells, ""))
        mark = "," if "," in joined else "." if "." in joined else ""
        if (mark and self.mark and mark != self.mark) or (mark == "," and "." in joined):
            return None
        if not joined.isascii() or joined.encode().translate(None, _PLAIN) or _CODE.search(joined):
            return None
        if mark == ",":
            cells = joined[1:-1].replace(",", ".").split("\n")
        try:
            values = np.fromiter(map(float, [cell or "nan" for cell in cells]), float, len(cells))
        except ValueError:
            return None
        if np.isinf(values).any():
            return None
        self.mark, self.words = self.mark or mark, self.words or words
        self.certain = self.certain or (mark != "" and _CERTAIN[mark].search(joined) is not None)
        return values

    def is_certain(self, decimal: str) -> bool:
        """Whether its plain numbers are read rightly.

        decimal: the decimal mark that the columns of the file show, or "".
        """
        if self.words and all(np.isnan(values).all() for values in self.numbers):
            return False  # such as a column of the country NA alone
        return self.certain or not self.mark or (self.mark == "." and decimal != ",")

    def notes(self, decimal: str) -> list[str]:
        """Notes about its plain numbers, as read_column has them. decimal: as in is_certain."""
        if self.mark == ",":
            return [DECIMAL_COMMA]
        is_doubtful = self.mark == "." and not self.certain and not decimal and self.separator in ELSEWHERE
        return [DECIMAL_POINT] if is_doubtful else []


def columns_of(
    columns: list[Column], again: Callable[[list[Column]], None]
) -> tuple[list[np.ndarray], str, list[tuple[int, str]]]:
    """Values of all columns, the decimal mark that they show, and notes with the index of their column.

    again: function that reads the file once more for some columns.
    """
    _restart([c for c in columns if c.late], again)
    read = {c.index: read_column(c.texts, "", c.separator) for c in columns if c.texts is not None}
    decimal = _decimal(columns, read)
    unclear = [c for c in columns if c.texts is None and not c.is_certain(decimal)]
    _restart(unclear, again)
    values, notes = [], []
    for column in columns:
        if column.texts is None:
            values.append(np.concatenate(column.numbers))
            column.numbers.clear()
            notes += [(column.index, text) for text in column.notes(decimal)]
            continue
        known = read.get(column.index)
        if known is None or (decimal and known.unclear and not known.shows):
            known = read_column(column.texts, decimal, column.separator)
        kept = len(known.bad) or known.codes or (np.isnan(known.values).all() and any(column.texts))
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
    shown |= {column.mark for column in columns if column.texts is None and column.certain}
    return shown.pop() if len(shown) == 1 else ""
