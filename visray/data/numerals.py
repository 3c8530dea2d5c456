"""Numbers as people write them in tables: a decimal point or comma, marks between thousands, units.

A column is read as a whole, because a cell alone may mean two things: 1,234 is 1234 where the point is decimal, and
1.234 where the comma is. What is not certain is not read as a number.

A number has digits, one decimal mark and an exponent (1e3), or none of them. Thousands are groups of three digits with
the same mark between them: a comma or a point (the one that is not decimal), a space, or an apostrophe. An underscore
(1_000), hexadecimal digits and infinities are text. If all numbers of a column have the same unit (%, $, 3 EUR is
none), it is left out: 12% is read as 12. Degrees may end in N, S, E or W; S and W are negative.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

# Cells that hold no value, in lower case.
MISSING = frozenset(("", "na", "n/a", "#n/a", "nan", "null", "none", "-", "\u2013", "\u2014", ".."))
# Signs before or after a number that may be its unit.
UNITS = "%\u2030\u00b0$\u20ac\u00a3\u00a5"
# Marks between thousands that are never decimal: space, no-break, thin, narrow and figure space, apostrophes.
NEUTRAL = " \u00a0\u2009\u202f\u2007'\u2019"
# How missing values are often written. Where they are written otherwise, a column is read more slowly.
OFTEN_MISSING = frozenset(("", "NA", "N/A", "#N/A", "NaN", "nan", "NULL", "null", "None", "-", ".."))
_MINUS = str.maketrans("\u2212\uff0b", "-+")
# Signs of degrees north, south, east and west.
COMPASS = {"N": 1.0, "S": -1.0, "E": 1.0, "W": -1.0}
# A number that means one thing if the comma separates thousands, and another if it is decimal.
AMBIGUOUS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
# What may come before the first digit of a number.
_NUMERIC = re.compile(rf"[-+.,{UNITS}{NEUTRAL}]*[0-9]")
DECIMAL_COMMA = "the comma is decimal"
# A note where the point may separate thousands in a file whose separator is that of countries with decimal commas.
DECIMAL_POINT = "each point has three digits after it; it is read as decimal: 1.234 is not 1234"
ELSEWHERE = (";", "\t")
# Numbers whose text says more than their value: codes such as 007, and whole numbers too long for a double.
CODE = re.compile(r"[+-]?0\d+|[+-]?\d{16,}", re.ASCII)


def _pattern(decimal: str) -> re.Pattern:
    """Pattern of a number with this decimal mark. Its first group is the mark between thousands.

    A number with such marks has no exponent: 1,234e5 is not 123 million.
    """
    marks = "," if decimal == "." else r"\."
    d = re.escape(decimal)
    grouped = rf"[1-9]\d{{0,2}}([{marks}{NEUTRAL}])\d{{3}}(?:\1\d{{3}})*(?:{d}\d*)?"
    return re.compile(rf"[+-]?(?:{grouped}|(?:\d+(?:{d}\d*)?|{d}\d+)(?:[eE][+-]?\d+)?)", re.ASCII)


PATTERNS = {decimal: _pattern(decimal) for decimal in ".,"}


@dataclass(frozen=True)
class Numbers:
    """What a column of texts holds.

    values: the numbers, NaN where a value is missing or is no number. Shape: (N,)
    bad: indices of the cells that are neither missing nor a number. Shape: (M,)
    notes: parts of sentences about how the numbers were read
    shows: the decimal mark that the cells themselves show; "" if they show none, or both
    codes: whether some number is a code, such as 007
    unclear: whether some number may mean two, such as 1,234. Else the other columns make no difference.
    """

    values: np.ndarray
    bad: np.ndarray
    notes: list[str] = field(default_factory=list)
    shows: str = ""
    codes: bool = False
    unclear: bool = False


class _Bodies(NamedTuple):
    """Cells of a column that begin like a number: indices, texts without unit, signs, and the unit."""

    index: list[int]
    text: list[str]
    sign: list[float]
    unit: str


def read_column(cells: Sequence[str], decimal: str = "", separator: str = "") -> Numbers:
    """The numbers of a column of texts.

    decimal: the decimal mark that other columns of the file show, or "".
    separator: the character between the cells of the file, or "".
    """
    # Equal cells are read once: a column of names may have a few countries for many rows.
    place = {cell: i for i, cell in enumerate(dict.fromkeys(cells))}
    index = np.fromiter(map(place.__getitem__, cells), int, len(cells))
    read = _read(list(place), decimal, separator)
    is_bad = np.zeros(len(place), bool)
    is_bad[read.bad] = True
    return replace(read, values=read.values[index], bad=np.flatnonzero(is_bad[index]))


def _read(cells: list[str], decimal: str, separator: str) -> Numbers:
    """The numbers of texts that are all different."""
    texts = [cell.strip() if cell.isascii() else cell.strip().translate(_MINUS) for cell in cells]
    bodies = _bodies(texts)
    point, comma = ([bool(PATTERNS[d].fullmatch(t)) for t in bodies.text] for d in ".,")
    unclear = [p and c and AMBIGUOUS.fullmatch(t) is not None for p, c, t in zip(point, comma, bodies.text)]
    points, commas = (sum(a and not b for a, b in zip(*pair)) for pair in ((point, comma), (comma, point)))
    notes = [f"the unit {bodies.unit} is left out"] if bodies.unit else []
    mark, readable = "." if points >= commas else ",", True
    shows = "" if bool(points) == bool(commas) else mark
    if any(unclear):
        first = next(t for t, u in zip(bodies.text, unclear) if u)
        mark, readable = _settled(first, points, commas, decimal, separator)
        # 1,234 and 1.234 in one column: one of them separates thousands, and nothing says which.
        readable = readable and (points or commas or len({"," in t for t, u in zip(bodies.text, unclear) if u}) == 1)
        if mark == "." and "." in first and separator in ELSEWHERE and not (points or commas or decimal):
            notes.append(DECIMAL_POINT)
        elif readable and not (points or commas) and (mark == "," or "," in first):
            notes.append(f"{first} is read as {_number(first, mark):g}")
    if shows == ",":
        notes.append(DECIMAL_COMMA)
    values = np.full(len(cells), np.nan)
    is_bad = np.array([t.casefold() not in MISSING for t in texts])
    for i, text, sign, fit, doubt in zip(
        bodies.index, bodies.text, bodies.sign, comma if mark == "," else point, unclear
    ):
        number = sign * _number(text, mark) if fit and (readable or not doubt) else np.nan
        if np.isfinite(number):
            values[i], is_bad[i] = number, False
    codes = any(map(CODE.fullmatch, bodies.text))
    return Numbers(values, np.flatnonzero(is_bad), notes, shows, codes, any(unclear))


def _settled(first: str, points: int, commas: int, decimal: str, separator: str) -> tuple[str, bool]:
    """The decimal mark of a column in which some cell is ambiguous, and whether such cells can be read.

    first: the first ambiguous cell.
    points, commas: how many cells show that the point, or the comma, is decimal.
    """
    if points and commas:
        return ("." if points >= commas else ","), False
    if points or commas:
        return ("." if points else ","), True
    if decimal:
        return decimal, True
    if "." in first:
        return ".", True
    if separator == ";":
        return ",", True
    return ".", separator == ","


def _bodies(texts: list[str]) -> _Bodies:
    """The cells that begin like a number, without the unit that all numbers share."""
    index = [i for i, t in enumerate(texts) if _NUMERIC.match(t)]
    held = [texts[i] for i in index]
    plain = _Bodies(index, held, [1.0] * len(held), "")
    signs = next((_unit(t) for t in held if _unit(t)), "")
    if not signs or any(map(is_number, held)):
        return plain
    if signs in COMPASS:
        pairs = [(t[:-1].rstrip(f"{UNITS[2]} "), COMPASS[t[-1]]) if _unit(t) in COMPASS else (t, 1.0) for t in held]
        return _Bodies(index, [text for text, _ in pairs], [sign for _, sign in pairs], "")
    return plain._replace(text=[t.strip(f"{signs}{NEUTRAL}") if _unit(t) == signs else t for t in held], unit=signs)


def _unit(text: str) -> str:
    """The unit before or after a number, or the direction after it; "" if there is none."""
    if text[:1] in UNITS and is_number(text[1:].lstrip(NEUTRAL)):
        return text[:1]
    if text[-1:] in UNITS and is_number(text[:-1].rstrip(NEUTRAL)):
        return text[-1:]
    if text[-1:] in COMPASS and is_number(text[:-1].rstrip(f"{UNITS[2]} ")) and text[0] not in "+-":
        return text[-1:]
    return ""


def is_number(text: str) -> bool:
    """Whether a text is a number, whichever mark is decimal."""
    return any(pattern.fullmatch(text) for pattern in PATTERNS.values())


def _number(text: str, decimal: str) -> float:
    """Value of a number with this decimal mark; infinite if it is too large."""
    other = "." if decimal == "," else ","
    return float(text.translate(str.maketrans(decimal, ".", other + NEUTRAL)))
