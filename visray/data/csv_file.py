"""Reads tables from text files: CSV, and the same with semicolons, tabs or bars."""

import csv
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from visray import memory
from visray.data.cells import Column, columns_of
from visray.data.column_names import column_names
from visray.data.dialect import SEPARATORS, Dialect, dialect_of, reader
from visray.data.encoding import Encoding, encoding_of, misread
from visray.data.numerals import is_number
from visray.data.table import LISTED, Table, shown
from visray.errors import UserError
from visray.scene.garbage import uncollected
from visray.terminal import printable

# Number of rows that are read at once.
CHUNK = 50_000
# Number of characters of a file in which its dialect is looked for.
SAMPLE = 1 << 18
# Bytes that a cell of text takes while a column is searched for numbers, if all of its cells are different.
TEXT_BYTES = 160
_BREAK = re.compile(r"\r\n|\r|\n")


def read_csv(path: Path) -> Table:
    """The table of a text file. Raises a UserError that names the file, and the line where that helps."""
    encoding = encoding_of(path)
    with open(path, encoding=encoding.codec, newline="") as file:
        head = file.read(SAMPLE)
    start = head.lstrip()[:9].lower()
    if not start:
        raise UserError(f"{path}: the file is empty; it must hold a header and rows")
    if start[0] in "{[":
        raise UserError(f"{path}: looks like JSON; name the file .geojson if it is GeoJSON")
    if start.startswith(("<!doctype", "<html", "<?xml")):
        raise UserError(f"{path}: is a web page or XML, not a table; save the data as CSV")
    lines = list(io.StringIO(head, newline=""))
    if spaced := _spaced(lines):
        raise UserError(f"{path}: {spaced}")
    dialect = dialect_of(lines[:-1] if len(head) == SAMPLE and len(lines) > 1 else lines)
    return _Reading(path, encoding, dialect).table()


@dataclass
class _Reading:
    """The reading of one file.

    where: numbers of the lines of the rows, for each chunk
    wrong: the first rows with too few or too many cells, as parts of a sentence, and how many there are
    empty, longer: how many rows without any value were skipped, and how many had empty cells beyond the header
    """

    path: Path
    encoding: Encoding
    dialect: Dialect
    names: list[str] = field(init=False)
    notes: list[str] = field(init=False)
    where: list[np.ndarray] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    wrong_count: int = 0
    empty: int = 0
    longer: int = 0

    def __post_init__(self) -> None:
        width = len(self.dialect.first)
        self.names, notes = column_names(self.dialect.names, width)
        self.notes = [*self.encoding.notes, *self.dialect.notes, *notes]
        self._check_memory()

    @uncollected()
    def table(self) -> Table:
        """The table of the file."""
        columns = [Column(i, self.dialect.separator) for i in range(len(self.names))]
        for rows in self._chunks(keep=True):
            for column, cells in zip(columns, zip(*rows)):
                column.add(cells)
        if self.wrong:
            raise UserError(self._wrong())
        if not self.where:
            raise UserError(f"{self.path}: {self._header()} and no rows; add rows below it")
        values, decimal, notes = columns_of(columns, self._again)
        notes += [(c.index, text) for c in columns if c.texts is not None and (text := misread(c.texts))]
        where = np.concatenate(self.where)
        self.notes += [printable(f"column {shown(self.names[i])}: {text}") for i, text in notes]
        for count, text in ((self.empty, "without any value skipped"), (self.longer, "with empty cells at the end")):
            if count:
                self.notes.append(f"{count:,} {'row' if count == 1 else 'rows'} {text}")
        columns = dict(zip(self.names, values))
        separator = self.dialect.separator
        return Table(self.names, columns, where, str(self.path), self.notes, self._dialect(decimal), decimal, separator)

    def _again(self, wanted: list[Column]) -> None:
        """Reads the file once more, and adds its cells to some columns."""
        for rows in self._chunks(keep=False):
            for column in wanted:
                column.add([row[column.index] for row in rows])

    def _chunks(self, keep: bool) -> Iterator[list[list[str]]]:
        """Yields the rows of the file, some thousands at once, each with as many cells as the header.

        keep: whether line numbers and faults are kept.
        """
        with open(self.path, encoding=self.encoding.codec, newline="") as file:
            before = sum(1 for _ in islice(file, self.dialect.skipped))
            rows = reader(file, self.dialect.separator)
            if self.dialect.names is not None:
                next(rows)
            while True:
                first = before + rows.line_num + 1
                try:
                    chunk = list(islice(rows, CHUNK))
                except csv.Error as error:
                    raise UserError(self._broken(error)) from None
                if not chunk:
                    return
                lines = _lines(chunk, first, before + rows.line_num)
                width = len(self.names)
                if set(map(len, chunk)) != {width} or not all(map(any, chunk)):
                    chunk, lines = self._fitted(chunk, lines, keep)
                if chunk:
                    if keep:
                        self.where.append(lines)
                    yield chunk

    def _fitted(self, rows: list[list[str]], lines: np.ndarray, keep: bool) -> tuple[list[list[str]], np.ndarray]:
        """The rows that hold values, with as many cells as the header, and their lines. Faults are counted."""
        width, fitted, kept = len(self.names), [], []
        empty = longer = 0
        for row, line in zip(rows, lines.tolist()):
            if not any(cell.strip() for cell in row):
                empty += len(row) > 1
                continue
            if len(row) > width and not any(cell.strip() for cell in row[width:]):
                row, longer = row[:width], longer + 1
            if len(row) != width:
                self.wrong_count += keep
                if keep and len(self.wrong) < LISTED:
                    self.wrong.append(f"line {line} has {len(row)} ({shown(self.dialect.separator.join(row))})")
                continue
            fitted.append(row)
            kept.append(line)
        if keep:
            self.empty, self.longer = self.empty + empty, self.longer + longer
        return fitted, np.array(kept, int)

    def _wrong(self) -> str:
        """Message about rows with too few or too many cells."""
        count = self.wrong_count
        many = f"{count:,} rows do" if count > 1 else "1 row does"
        of = "header" if self.dialect.names is not None else "first row"
        more = f", and {count - LISTED:,} more" if count > LISTED else ""
        fix = "write as many cells in each row, with quotes around a cell that holds a separator"
        width, listed = len(self.names), ", ".join(self.wrong)
        return printable(f"{self.path}: {many} not have the {width} cells of the {of}: {listed}{more}; {fix}")

    def _broken(self, error: csv.Error) -> str:
        """Message about a file that the csv module does not read."""
        with open(self.path, encoding=self.encoding.codec, newline="") as file:
            before = sum(1 for _ in islice(file, self.dialect.skipped))
            rows = reader(file, self.dialect.separator)
            begin = 0
            try:
                while True:
                    begin = rows.line_num
                    next(rows)
            except (csv.Error, StopIteration):
                pass
        if "expected after" in str(error):
            what = "text follows a closing quote; double the quotes inside of a cell"
        elif "field larger" in str(error):
            what = f"a cell has more than {csv.field_size_limit():,} characters; a quote may be missing"
        else:
            what = "a quote is opened and never closed; close it, or double it"
        return f"{self.path}: line {before + begin + 1}: {what}"

    def _header(self) -> str:
        return f"has a header ({', '.join(self.names[:LISTED])})" if self.dialect.names is not None else "has no header"

    def _dialect(self, decimal: str) -> str:
        """A sentence about how the file was read."""
        cells = f"cells separated by {_named(self.dialect.separator)}" if self.dialect.separator else "one column"
        header = "no header" if self.dialect.names is None else f"header in line {self.dialect.skipped + 1}"
        comma = ", decimal comma" if decimal == "," else ""
        return f"{self.encoding.name}, {cells}, {header}{comma}"

    def _check_memory(self) -> None:
        """Raises a UserError if the table does not fit into the memory that is free, as far as its first rows tell."""
        size, row = self.path.stat().st_size, self.dialect.row_bytes
        wide = {"utf-16": 2, "utf-32": 4}.get(self.encoding.codec, 1)
        count = max(size / (row * wide) - 1, 0) if row else 0
        numbers = sum(self.dialect.numeric)
        # Numbers are needed twice while the parts of a column are put together.
        need = count * (16 * (numbers + 1) + TEXT_BYTES * (len(self.names) - numbers)) + CHUNK * (
            row + 70 * len(self.names)
        )
        free = memory.free()
        if free is not None and need > free.size:
            what = f"about {count:,.0f} rows of {len(self.names)} columns take about {need / 2**30:.1f} GiB"
            raise UserError(f"{self.path}: {what}, and {free}; leave out columns or rows")


def _lines(rows: list[list[str]], first: int, last: int) -> np.ndarray:
    """Number of the line at which each of some rows begins.

    first, last: the first line of the first row, and the last line of the last row.
    """
    if last - first + 1 == len(rows):
        return np.arange(first, last + 1)
    # Cells in quotes may hold line breaks.
    spans = [1 + sum(len(_BREAK.findall(cell)) for cell in row if "\n" in cell or "\r" in cell) for row in rows]
    return first + np.cumsum([0, *spans[:-1]])


def _spaced(lines: list[str]) -> str:
    """What is wrong if cells are separated by spaces only; "" if they are not."""
    header, row = next(([a.split(), b.split()] for a, b in pairwise(lines) if a.strip()), [[], []])
    separated = any(
        separator in "".join(header + row) or "\t" in line for separator in SEPARATORS for line in lines[:9]
    )
    is_table = not separated and len(header) == len(row) > 1 and not any(map(is_number, header))
    if not is_table or sum(map(is_number, row)) < 2:
        return ""
    return "the cells are separated by spaces; save it with commas, semicolons, tabs or bars between them"


def _named(separator: str) -> str:
    """Name of a character that separates cells."""
    return SEPARATORS.get(separator, shown(separator))
