"""The dialect of a table in a text file: what separates the cells, and which lines come before the rows."""

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice, pairwise

from visray.data.numerals import MISSING, is_number

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
    notes, skipped, separator = [], 0, None
    if lines and (said := SEP.fullmatch(lines[0])):
        skipped, separator = 1, said[1]
    before = skipped
    while skipped < len(lines) and (not lines[skipped].strip() or lines[skipped].startswith("#")):
        skipped += 1
    comments = [i for i in range(before, skipped) if lines[i].startswith("#")]
    separator = _separator(lines[skipped:]) if separator is None else separator
    rows = _rows(lines[skipped:], separator)
    header = bool(rows) and not _is_data(rows)
    if comments and not header and len(rows) > 1:
        # A header may begin with #, as in "#lon,lat,rain".
        named = _rows([lines[comments[-1]].lstrip("# ")], separator)
        if named and len(named[0]) == len(rows[0]) > 1 and not _is_data(named):
            notes.append(f"line {comments[-1] + 1} is read as the header, although it begins with #")
            skipped, comments = comments[-1], comments[:-1]
            rows, header = [named[0], *rows], True
    if comments:
        notes.append(f"{len(comments)} comment {'line' if len(comments) == 1 else 'lines'} before the header skipped")
    if rows and not header:
        notes.append(
            f"line {skipped + 1} holds numbers: there is no header, and the columns are column 1, column 2, ..."
        )
    data = rows[1:] if header else rows
    numeric = [_fits(cell) for cell in data[0]] if data else []
    size = sum(len(line) for line in lines[skipped:]) / max(len(lines) - skipped, 1)
    return Dialect(separator, skipped, rows[0] if header else None, rows[0] if rows else [], numeric, size, notes)


def _rows(lines: list[str], separator: str) -> list[list[str]]:
    """The first rows of some lines, without empty ones."""
    rows = []
    try:
        for row in islice(reader(lines, separator), ROWS):
            if row:
                rows.append(row)
    except csv.Error:
        pass  # cut off, or damaged: the whole file is read with exact messages
    return rows


def _separator(lines: list[str]) -> str:
    """The character between the cells: the one that cuts the most rows into the same number of cells, of which the most
    are numbers. "" if none occurs."""
    found = {}
    for order, separator in enumerate(SEPARATORS):
        rows = _rows(lines, separator)
        counts = [len(row) for row in rows]
        if not counts or max(counts) < 2:
            continue
        same = sum(n == counts[0] for n in counts) / len(counts)
        cells = [cell for row in rows[1:] or rows for cell in row]
        clean = sum(map(_fits, cells)) / len(cells)
        found[separator] = (counts[0] > 1, round(same, 1), round(clean, 1), len(SEPARATORS) - order)
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
