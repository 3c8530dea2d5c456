"""The dialect of a table in a text file: what separates the cells, and which lines come before the rows."""

import csv
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice, pairwise

from visray.data.numerals import MISSING, is_number
from visray.data.table import shown

# Characters that may separate cells, and their names. The first wins where several fit as well.
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
# Largest number of rows in which the dialect is looked for.
ROWS = 200
# What Excel writes into the first line for itself.
SEP = re.compile(r'"?sep=(.)"?\s*', re.IGNORECASE)
YEAR = re.compile(r"[12]\d{3}", re.ASCII)


@dataclass(frozen=True)
class Dialect:
    """How a table is written.

    separator: the character between cells; "" if there is only one column
    skipped: number of lines before the header, or before the first row if there is no header
    names: names of the columns, as they are written; None if there is no header
    first: the first row, or the header
    numeric: for each cell of the first row of data, whether it is a number or missing
    row_bytes: bytes of a row, roughly
    notes: sentences about what is not plain
    """

    separator: str
    skipped: int
    names: list[str] | None
    first: list[str]
    numeric: list[bool]
    row_bytes: float
    notes: list[str] = field(default_factory=list)


def reader(lines: Iterable[str], separator: str):
    """A reader of the csv module for lines with this separator. It raises csv.Error where quotes are not closed."""
    return csv.reader(lines, delimiter=separator or "\x1f", strict=True)


def dialect_of(lines: list[str]) -> Dialect:
    """The dialect of a table.

    lines: the first lines of its file, with their line breaks; the last one may be cut off.
    """
    said = SEP.fullmatch(lines[0]) if lines else None
    before = skipped = int(said is not None)
    while skipped < len(lines) and (not lines[skipped].strip() or lines[skipped].startswith("#")):
        skipped += 1
    comments = [i for i in range(before, skipped) if lines[i].startswith("#")]
    separator = said[1] if said else _separator(lines[skipped:])
    notes, rows = [], _rows(lines[skipped:], separator)
    header = bool(rows) and not _is_data(rows)
    if comments and rows and not header and (named := _commented(lines[comments[-1]], separator, len(rows[0]))):
        notes.append(f"line {comments[-1] + 1} is read as the header, although it begins with #")
        skipped, comments = comments[-1], comments[:-1]
        rows, header = [named, *rows], True
    elif title := _title(rows):
        count = _lines_of(title, lines[skipped:], separator)
        many = "1 line" if count == 1 else f"{count} lines"
        notes.append(f"{many} before the header skipped, beginning with {shown(rows[0][0])}")
        skipped, rows, header = skipped + count, rows[title:], True
    if comments:
        notes.append(f"{len(comments)} comment {'line' if len(comments) == 1 else 'lines'} before the header skipped")
    if rows and not header:
        what = "there is no header, and the columns are column 1, column 2, ..."
        notes.append(f"line {skipped + 1} holds numbers: {what}")
    data = rows[1:] if header else rows
    numeric = [_fits(cell) for cell in data[0]] if data else []
    size = sum(map(len, lines[skipped:])) / max(len(lines) - skipped, 1)
    return Dialect(separator, skipped, rows[0] if header else None, rows[0] if rows else [], numeric, size, notes)


def _commented(line: str, separator: str, width: int) -> list[str]:
    """The header in a line that begins with #, as in "#lon,lat,rain"; [] if it is none.

    width: number of cells of the rows
    """
    rows = _rows([line.lstrip("# ")], separator)
    is_header = rows and len(rows[0]) == width > 1 and not _is_data(rows) and not any(":" in cell for cell in rows[0])
    return rows[0] if is_header else []


def _title(rows: list[list[str]]) -> int:
    """Number of rows before the header: titles and sources, with half of its cells at most. 0 if a row before the first
    one of full width is longer, or if that row is no header."""
    width = _usual(rows)
    first = next((i for i, row in enumerate(rows) if len(row) == width), 0)
    filled = [sum(cell.strip() != "" for cell in row) for row in rows[:first]]
    is_title = first > 0 and 2 * max(filled) <= width and first < len(rows) - 1 and not _is_data(rows[first:])
    return first if is_title else 0


def _lines_of(count: int, lines: list[str], separator: str) -> int:
    """Number of lines that the first rows take, with the empty lines after them."""
    rows = reader(lines, separator)
    while count:
        count -= next(rows) != []
    place = rows.line_num
    while not lines[place].strip():
        place += 1
    return place


def _usual(rows: list[list[str]]) -> int:
    """The number of cells that the most rows have."""
    counts = [len(row) for row in rows]
    return max(sorted(set(counts)), key=counts.count, default=0)


def _rows(lines: list[str], separator: str) -> list[list[str]]:
    """The first rows of some lines, without empty ones."""
    rows = []
    # A row may be cut off, or damaged: the whole file is read with exact messages.
    with suppress(csv.Error):
        rows += (row for row in islice(reader(lines, separator), ROWS) if row)
    return rows


def _separator(lines: list[str]) -> str:
    """The character between the cells: the one that cuts the most rows, and the first one, into the same number of
    cells, of which the most are numbers. "" if none occurs."""
    found = {}
    for order, separator in enumerate(SEPARATORS):
        rows = _rows(lines, separator)
        if not rows or max(map(len, rows)) < 2:
            continue
        width = _usual(rows)
        same = sum(len(row) == width for row in rows) / len(rows)
        cells = [cell for row in rows[1:] or rows for cell in row]
        clean = sum(map(_fits, cells)) / len(cells)
        found[separator] = (width > 1, len(rows[0]) == width, round(same, 1), round(clean, 1), -order)
    return max(found, key=found.get) if found else ""


def _fits(cell: str) -> bool:
    """Whether a cell is a number or missing."""
    bare = cell.strip()
    return is_number(bare) or bare.casefold() in MISSING


def _is_data(rows: list[list[str]]) -> bool:
    """Whether the first row is data and no header: some cell is a number. Years side by side are names of columns."""
    first = [cell.strip() for cell in rows[0]]
    numbers = [cell for cell in first if is_number(cell)]
    if not numbers:
        return False
    years = [int(cell) for cell in numbers if YEAR.fullmatch(cell)]
    rising = len(years) > 1 and all(a < b for a, b in pairwise(years))
    return not (rising and len(years) == len(numbers) < len(first))
