"""Reads Radiance files (.hdr, .pic): pictures in which red, green and blue share an exponent (RGBE).

The format is that of Ward, "Real Pixels", Graphics Gems II (1991), and of Radiance's own `color.c`: a header of lines,
an empty line, the size, and rows of pixels of four bytes, flat or with run lengths of the old or the new kind.
"""

import re
from typing import BinaryIO

import numpy as np

from visray.errors import UserError
from visray.images.rows import check_size

# The first bytes of the file.
MAGIC = b"#?"
FORMAT = "32-bit_rle_rgbe"
# A header that is longer is none.
LONGEST_HEADER = 2**16
SIZE = re.compile(rb"([-+])Y (\d{1,9}) ([-+])X (\d{1,9})\s*")
# Rows of these widths may have run lengths of the new kind.
NEW_WIDTHS = range(8, 2**15)
# In the new kind, a byte above this begins a run: it is the run's length plus this.
RUN = 128
# Exponent of a pixel whose bytes are themselves its colour.
ZERO_EXPONENT = 128 + 8


def read_hdr(path: str) -> np.ndarray:
    """Linear light of a Radiance file, as float32. Shape: (H, W, 3), the top row first.

    A pixel (r, g, b, e) is the colour (r, g, b) 2^(e - 136), and black if e is 0. As the header's EXPOSURE and
    COLORCORR say by what the light was multiplied, it is divided by them. Raises UserError if the file is damaged or of
    another kind.
    """
    with open(path, "rb") as file:
        scale = _header(file)
        sign_y, height, sign_x, width = _size(file)
        check_size(width, height)
        data = file.read()
    rgbe = _pixels(data, width, height).reshape(height, width, 4)
    rgbe = rgbe[:: 1 if sign_y == b"-" else -1, :: 1 if sign_x == b"+" else -1]
    exponent = rgbe[..., 3:].astype(np.int32)
    light = np.ldexp(rgbe[..., :3].astype(np.float64), exponent - ZERO_EXPONENT) * (exponent > 0)
    # A quotient may overflow to infinity. Infinite numbers are refused later.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        return (light / scale).astype(np.float32)


def _header(file: BinaryIO) -> np.ndarray:
    """What the light was multiplied by: three numbers. The file is then at the line with the size."""
    scale, left = np.ones(3), LONGEST_HEADER
    while line := file.readline(left).rstrip(b"\r\n"):
        left -= len(line) + 1
        if left <= 0:
            raise UserError("is damaged: its header has no end; save it anew")
        name, _, value = line.decode("latin-1").partition("=")
        if name.strip() == "FORMAT" and value.strip() != FORMAT:
            raise UserError(f"has the FORMAT {value.strip()[:40]!r}; save it as {FORMAT}")
        if name.strip() in ("EXPOSURE", "COLORCORR"):
            scale = scale * _factors(line.decode("latin-1"), value)
    return scale


def _factors(line: str, value: str) -> np.ndarray:
    """The numbers of a line such as EXPOSURE=2.0 or COLORCORR=1 1 0.9."""
    try:
        factors = np.array([float(x) for x in value.split()])
    except ValueError:
        factors = np.zeros(0)
    if len(factors) not in (1, 3) or not (np.isfinite(factors) & (factors > 0)).all():
        raise UserError(f"has the line {line[:60]!r}; it must be a number > 0, or three")
    return factors


def _size(file: BinaryIO) -> tuple[bytes, int, bytes, int]:
    """The signs of y and x, and the numbers of rows and columns, as (sign of y, rows, sign of x, columns)."""
    line = file.readline(LONGEST_HEADER)
    found = SIZE.fullmatch(line)
    if found is None:
        shown = line.decode("latin-1").strip()[:40]
        raise UserError(
            f"has the size {shown!r}; it must be a line such as '-Y 512 +X 1024', as rows from left to right"
        )
    height, width = int(found[2]), int(found[4])
    if not (width and height):
        raise UserError(f"has {width} x {height} pixels; give a picture that has some")
    return found[1], height, found[3], width


def _pixels(data: bytes, width: int, height: int) -> np.ndarray:
    """The pixels, row by row. Shape: uint8 (height * width, 4)."""
    if width in NEW_WIDTHS and data[:2] == b"\2\2" and len(data) > 3 and data[2] < RUN:
        return _new_rows(data, width, height)
    return _old_rows(data, width * height)


def _new_rows(data: bytes, width: int, height: int) -> np.ndarray:
    """Rows with run lengths of the new kind: the four bytes of pixels one after the other, each with its own runs."""
    rows, at, start = [], 0, bytes((2, 2, width >> 8, width & 255))
    for row in range(height):
        if data[at : at + 4] != start:
            raise _damaged(row, height, at >= len(data))
        planes, at = [], at + 4
        for _ in range(4):
            pieces, left = [], width
            while left:
                if at + 1 >= len(data):
                    raise _damaged(row, height, True)
                code = data[at]
                count = code - RUN if code > RUN else code
                piece = data[at + 1 : at + 2] * count if code > RUN else data[at + 1 : at + 1 + count]
                if not 0 < len(piece) == count <= left:
                    raise _damaged(row, height, len(piece) < count)
                pieces.append(piece)
                at, left = at + (2 if code > RUN else 1 + count), left - count
            planes.append(b"".join(pieces))
        rows.append(np.frombuffer(b"".join(planes), np.uint8).reshape(4, width).T)
    return np.concatenate(rows)


def _old_rows(data: bytes, count: int) -> np.ndarray:
    """Pixels that are flat, or have run lengths of the old kind: a pixel (1, 1, 1, n) repeats the one before n times.
    Of several such pixels in a row each counts 256 times the one before."""
    stored = np.frombuffer(data[: len(data) // 4 * 4], np.uint8).reshape(-1, 4)
    repeats = (stored[:, :3] == 1).all(1)
    if not repeats.any() or not len(stored):
        if len(stored) < count:
            raise _damaged(len(stored), count, True)
        return stored[:count]
    if repeats[0]:
        raise UserError("is damaged: it repeats a pixel before the first one; save it anew")
    index = np.arange(len(stored))
    source = np.maximum.accumulate(np.where(repeats, -1, index))
    digit = np.minimum(index - source - 1, 4)
    times = np.where(repeats, np.minimum(stored[:, 3].astype(np.int64) << (8 * np.maximum(digit, 0)), count), 1)
    ends = np.cumsum(times)
    if ends[-1] < count:
        raise _damaged(int(ends[-1]), count, True)
    used = int(np.searchsorted(ends, count)) + 1
    return np.repeat(stored[source[:used]], times[:used], 0)[:count]


def _damaged(done: int, all: int, ends: bool) -> UserError:
    """The error about rows that are wrong after `done` of `all`. ends: whether the file ends there."""
    reason = "lacks rows" if ends else "has wrong run lengths"
    return UserError(
        f"is damaged: it {reason}, only {min(99, 100 * done // all)} % of its pixels are there; save it anew"
    )
