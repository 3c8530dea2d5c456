"""Columns of Python values, and of NumPy arrays of any type, as numbers or texts."""

import json
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np

from visray.data.table import as_texts

# Names of the types of pandas for missing values. They cannot be compared.
_MISSING = ("NAType", "NaTType", "MaskedConstant")
# Whole numbers from here on are not all doubles.
EXACT = 2**53


def column_of_values(values: Sequence[Any]) -> tuple[np.ndarray, list[str]]:
    """A column of Python values: numbers if all values are numbers or missing, else texts. And notes about it.

    None, NaN and the missing values of pandas are missing: NaN, or "". True is 1, false is 0. Shape: (N,)
    """
    kinds = {type(v) for v in values}
    if kinds <= {float}:
        return np.array(values, float), []
    held = [None if _is_missing(v) else v for v in values]
    given = [v for v in held if v is not None]
    if all(_is_number(v) for v in given):
        if any(type(v) is int and abs(v) >= EXACT for v in given):
            return as_texts("" if v is None else str(v) for v in held), []
        notes = ["true is read as 1, and false as 0"] if bool in kinds else []
        return np.array([np.nan if v is None else float(v) for v in held], float), notes
    mixed = next((v for v in given if _is_number(v)), None)
    notes = []
    if mixed is not None:
        row = next(i for i, v in enumerate(held) if v is not None and not _is_number(v))
        notes = [f"it holds numbers and other values, such as {_text(held[row])[:30]!r} in row {row}; all are texts"]
    return as_texts(map(_text, held)), notes


def column_of_array(array: Any) -> tuple[np.ndarray, list[str]]:
    """A column of an array: numbers if its type is numeric, else texts. And notes about it.

    Raises a ValueError if it has not one dimension, or if its type is neither. Shape: (N,)
    """
    if isinstance(array, (list, tuple)):
        return column_of_values(array)
    if isinstance(array, np.ma.MaskedArray):
        values, notes = column_of_array(array.data)
        values = values.copy()
        values[np.ma.getmaskarray(array)] = "" if values.dtype == object else np.nan
        return values, notes
    array = np.asarray(array)
    if array.ndim != 1:
        single = "" if array.ndim else ": it is a single value"
        raise ValueError(f"has the shape {array.shape}{single}; give a list with one value for each row")
    if array.dtype.kind in "iu" and len(array) and max(abs(int(array.min())), abs(int(array.max()))) >= EXACT:
        return as_texts(map(str, array.tolist())), []
    if array.dtype.kind in "iuf":
        return array.astype(np.float64), []
    if array.dtype.kind == "b":
        return array.astype(np.float64), ["true is read as 1, and false as 0"]
    if array.dtype.kind in "mM":
        texts = _coarse(array).astype(str)
        return as_texts("" if t == "NaT" else t for t in texts.tolist()), []
    if array.dtype.kind in "OUST":
        return column_of_values(array.tolist())
    raise ValueError(f"has the type {array.dtype}; give numbers or texts")


def _coarse(dates: np.ndarray) -> np.ndarray:
    """Dates as days or seconds if nothing is lost. Shape: (N,)"""
    for unit in "Ds" if dates.dtype.kind == "M" else "":
        coarse = dates.astype(f"M8[{unit}]")
        if ((coarse == dates) | np.isnat(dates)).all():
            return coarse
    return dates


def _is_missing(value: Any) -> bool:
    """Whether a value stands for a missing one."""
    return value is None or type(value).__name__ in _MISSING or (isinstance(value, Real) and bool(value != value))


def _is_number(value: Any) -> bool:
    """Whether a value is a real number."""
    # Decimal is no Real, but it is one.
    return isinstance(value, (Real, np.bool_)) or type(value).__name__ == "Decimal"


def _text(value: Any) -> str:
    """A value as text; "" if it is missing."""
    if value is None:
        return ""
    if isinstance(value, str):
        # Half a character, which Python can hold and no file can.
        return value if value.isascii() else value.encode("utf-8", "backslashreplace").decode("utf-8")
    if isinstance(value, bytes):
        return value.decode("utf-8", "backslashreplace")
    if isinstance(value, (bool, Mapping, list)):
        return json.dumps(value, ensure_ascii=False, default=str)
    return value.isoformat() if hasattr(value, "isoformat") else str(value)
