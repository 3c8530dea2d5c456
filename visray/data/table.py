"""Tables of data: columns by name, and where their rows stand in the file."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from visray.data.numerals import AMBIGUOUS, read_column
from visray.errors import UserError
from visray.hints import hint
from visray.terminal import printable

# Number of faulty cells that a message lists, and of characters of a cell that it shows.
LISTED, SHOWN = 5, 30


@dataclass(frozen=True)
class Cell:
    """A cell that holds text where a number belongs.

    row: index of its row in the table, from 0
    line: number of its line in the file, from 1; None if the table is not from a file
    column: name of its column
    text: what the cell holds
    """

    row: int
    line: int | None
    column: str
    text: str

    def __str__(self) -> str:
        where = f"row {self.row}" if self.line is None else f"line {self.line}"
        return f"{where} {shown(self.text)}{_reason(self.text)}"


def shown(text: str) -> str:
    """A text in quotation marks, on one line, and cut if it is long."""
    return f'"{printable(text if len(text) <= SHOWN else text[: SHOWN - 3] + "...")}"'


def _reason(text: str) -> str:
    """What is peculiar about a text that is no number, in parentheses."""
    bare = text.strip()
    if bare.startswith(("=", "@")) or (bare[:1] in "+-" and bare[1:2].isalpha()):
        return " (a formula, not its result)"
    if bare[:1].isdecimal() and any(c in bare for c in "°º\u2032") and any(c in bare for c in "'\u2032\u2019"):
        return " (degrees and minutes; write decimal degrees)"
    if AMBIGUOUS.fullmatch(bare):
        return f" (it may mean {bare.replace(',', '').replace('.', '')} or {bare.replace(',', '.')})"
    if "_" in bare and bare.replace("_", "").isdecimal():
        return " (an underscore)"
    return ""


@dataclass(frozen=True)
class Problems:
    """The cells of a column that hold text where numbers belong. It is true if there are any.

    column: name of the column
    count: how many cells there are
    cells: the first LISTED of them
    """

    column: str
    count: int = 0
    cells: tuple[Cell, ...] = ()

    def __bool__(self) -> bool:
        return self.count > 0

    def __str__(self) -> str:
        """The problems as one sentence, without an address."""
        many = "1 cell holds" if self.count == 1 else f"{self.count:,} cells hold"
        more = f", and {self.count - len(self.cells):,} more" if self.count > len(self.cells) else ""
        listed = ", ".join(map(str, self.cells))
        what = f"column {shown(self.column)}: {many} text where numbers belong: {listed}{more}"
        return f"{what}; write numbers, or leave such cells empty"


@dataclass(frozen=True, eq=False)
class Table:
    """Columns by name.

    names: names of the columns, in order
    columns: the values of each column, read-only: float64, NaN where a value is missing, or objects of type str.
        Shape: (N,)
    where: number of the line of each row in the file, from 1; None if the table is not from a file. Shape: (N,)
    path: what messages call the table: the path of its file
    notes: sentences about what the reader did that is not plain, such as a decimal comma or skipped lines
    dialect: a sentence about how the file was read
    decimal: the decimal mark that the file's numbers show, "." or ","; "" if they show none, or both
    separator: the character between the cells of the file; "" if it has none
    lines: outlines, for lines and polygons: index of the row, and longitudes and latitudes in degrees. Shape: (n, 2)
    bare_rows: number of rows of a table without columns
    """

    names: list[str]
    columns: dict[str, np.ndarray]
    where: np.ndarray | None = None
    path: str = "the table"
    notes: list[str] = field(default_factory=list)
    dialect: str = ""
    decimal: str = ""
    separator: str = ""
    lines: list[tuple[int, np.ndarray]] = field(default_factory=list)
    bare_rows: int = 0

    def __post_init__(self) -> None:
        # Layers and derivatives share the columns of a file that is read once.
        for values in self.columns.values():
            values.flags.writeable = False

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.columns[self.names[0]]) if self.names else self.bare_rows

    def column(self, name: str) -> np.ndarray:
        """Values of a column. Raises a UserError with near names if there is no such column."""
        if name in self.columns:
            return self.columns[name]
        raise UserError(printable(f"{self.path}: there is no column {shown(name)}; {hint(name, self.names)}"))

    def numbers(self, name: str) -> tuple[np.ndarray, Problems]:
        """Numbers of a column, NaN where a value is missing or is no number, and the cells that hold text.

        Shape: (N,)
        """
        values = self.column(name)
        if values.dtype != object:
            if not (infinite := np.isinf(values)).any():
                return values, Problems(name)
            rows = np.flatnonzero(infinite).tolist()
            cells = tuple(Cell(row, self.line(row), name, repr(float(values[row]))) for row in rows[:LISTED])
            return np.where(infinite, np.nan, values), Problems(name, len(rows), cells)
        read = read_column(values.tolist(), self.decimal, self.separator)
        cells = tuple(Cell(row, self.line(row), name, values[row]) for row in read.bad[:LISTED].tolist())
        return read.values, Problems(name, len(read.bad), cells)

    def texts(self, name: str) -> np.ndarray:
        """Texts of a column, as objects of type str; "" where a number is missing. Shape: (N,)"""
        values = self.column(name)
        if values.dtype == object:
            return values
        return as_texts(map(_written, values.tolist()))

    def line(self, row: int) -> int | None:
        """Number of the line of a row in the file; None if the table is not from a file."""
        return None if self.where is None else int(self.where[row])

    def place(self, row: int) -> str:
        """Where a row stands, for messages: `line 12` of a file, or `row 12`, counted from 0."""
        return f"row {row}" if self.where is None else f"line {self.where[row]}"


def _written(number: float) -> str:
    """A number as text; "" for NaN."""
    if number != number:
        return ""
    return str(int(number)) if number.is_integer() and abs(number) < 2**53 else repr(number)


def as_texts(texts: Iterable[str]) -> np.ndarray:
    """Array of objects of type str. Shape: (N,)"""
    listed = list(texts)
    column = np.empty(len(listed), object)
    column[:] = listed
    return column
