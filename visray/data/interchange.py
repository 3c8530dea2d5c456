"""Tables of data frames that offer only the dataframe interchange protocol (`__dataframe__`).

The protocol hands over the memory of each column, with a mask of what is missing:
https://data-apis.org/dataframe-protocol/latest/API.html
"""

import ctypes
from typing import Any

import numpy as np

# Numbers by which the protocol calls the kinds of columns, and NumPy's letters for those that are numbers.
NUMERIC = {0: "i", 1: "u", 2: "f"}
BOOLEAN, STRING, DATE, CATEGORICAL = 20, 21, 22, 23
# Numbers by which it calls the ways to mark what is missing: a value, a mask of bits, a mask of bytes.
SENTINEL, BITS, BYTES = 2, 3, 4
# Units of dates in the format strings of Apache Arrow, and in NumPy.
UNITS = {"s": "s", "m": "ms", "u": "us", "n": "ns"}


def from_interchange(obj: Any) -> list[tuple[str, np.ndarray]]:
    """Names and values of the columns of a data frame. Raises a ValueError if a column cannot be read."""
    frame = obj.__dataframe__(allow_copy=True)
    columns = []
    for name in frame.column_names():
        chunks = [_chunk(c) for c in frame.get_column_by_name(name).get_chunks()]
        columns.append((str(name), np.concatenate(chunks) if chunks else np.empty(0)))
    return columns


def _chunk(column: Any) -> np.ndarray:
    """Values of a column that is in one piece: numbers, dates, or objects; NaN, NaT or None is missing. Shape: (N,)"""
    kind, bits, form, _ = column.dtype
    buffers = column.get_buffers()
    raw, offset, size = buffers["data"][0], column.offset, column.size()
    if kind == STRING:
        values = _strings(raw, *buffers["offsets"], offset, size)
    elif kind == BOOLEAN:
        values = _bits(raw, offset, size) if bits == 1 else _array(raw, f"u{bits // 8}", offset, size) != 0
    elif kind == DATE and form == "tdD":
        values = _array(raw, "i4", offset, size).astype("M8[D]")
    elif kind == DATE and form[:2] == "ts" and form[2:3] in UNITS:
        values = _array(raw, "i8", offset, size).view(f"M8[{UNITS[form[2]]}]")
    elif kind == CATEGORICAL:
        # The type of a categorical column is that of its codes in some libraries; the buffer says it for certain.
        code_kind, code_bits, _, _ = buffers["data"][1]
        values = _array(raw, f"{NUMERIC[code_kind]}{code_bits // 8}", offset, size)
    elif kind in NUMERIC:
        values = _array(raw, f"{NUMERIC[kind]}{bits // 8}", offset, size)
    else:
        raise ValueError(f"a column has a type that visray does not read ({form})")
    missing = _missing(column, values)
    if kind == CATEGORICAL:
        return _categories(column, values, missing)
    if not missing.any():
        return values
    values = values.astype(values.dtype if values.dtype.kind in "fMO" else float if kind in NUMERIC else object)
    values[missing] = None if values.dtype == object else "NaT" if values.dtype.kind == "M" else np.nan
    return values


def _missing(column: Any, values: np.ndarray) -> np.ndarray:
    """Which values of a column are missing. Shape: (N,)"""
    how, mark = column.describe_null
    if how == SENTINEL:
        return (values.view("i8") if values.dtype.kind == "M" else values) == mark
    validity = column.get_buffers()["validity"]
    if how not in (BITS, BYTES) or validity is None:
        return np.zeros(len(values), bool)
    offset, size = column.offset, column.size()
    mask = _bits(validity[0], offset, size) if how == BITS else _array(validity[0], "u1", offset, size) != 0
    return mask == bool(mark)


def _categories(column: Any, codes: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Values of a column of categories, as objects; None is missing. Shape: (N,)"""
    listed = np.concatenate([_chunk(c) for c in column.describe_categorical["categories"].get_chunks()])
    values = np.empty(len(codes), object)
    given = np.flatnonzero(~missing & (codes >= 0))
    values[given] = listed.astype(object)[codes[given]]
    return values


def _strings(raw: Any, offsets: Any, offset_type: tuple, offset: int, size: int) -> np.ndarray:
    """Texts of a column, as objects. Shape: (size,)

    offsets, offset_type: buffer and type of the places where the texts begin, and where the last one ends.
    """
    places = _array(offsets, f"i{offset_type[1] // 8}", offset, size + 1)
    data = _array(raw, "u1", 0, int(places.max(initial=0))).tobytes()
    values = np.empty(size, object)
    values[:] = [data[a:b].decode("utf-8") for a, b in zip(places[:-1].tolist(), places[1:].tolist())]
    return values


def _array(buffer: Any, dtype: str, offset: int, size: int) -> np.ndarray:
    """A copy of a part of a buffer, as numbers. offset, size: the part, in numbers. Shape: (size,)"""
    dtype = np.dtype(dtype)
    if (offset + size) * dtype.itemsize > buffer.bufsize:
        raise ValueError(f"has a buffer of {buffer.bufsize} bytes, too few for {size} values")
    if not size:
        return np.empty(0, dtype)
    memory = (ctypes.c_char * buffer.bufsize).from_address(buffer.ptr)
    return np.frombuffer(memory, dtype, size, offset * dtype.itemsize).copy()


def _bits(buffer: Any, offset: int, size: int) -> np.ndarray:
    """A part of a buffer of bits, the lowest first. offset, size: the part, in bits. Shape: (size,)"""
    octets = _array(buffer, "u1", offset // 8, (offset + size + 7) // 8 - offset // 8)
    return np.unpackbits(octets, bitorder="little").astype(bool)[offset % 8 : offset % 8 + size]
