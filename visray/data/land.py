"""The land of the earth, for maps that are drawn without a picture of the user's.

Source: Natural Earth, 1:50 million, land (naturalearthdata.com), which is in the public domain; simplified by
reference/make_land.py.
Error: coasts lie within 0.06 degrees of the source's; islands and lakes smaller than 0.02 square degrees are left out.
"""

import zlib
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

FILE = Path(__file__).with_name("land.bin")
# Coordinates in the file are whole numbers of this many degrees.
UNIT = 0.025


class Ring(NamedTuple):
    """A closed line.

    points: longitudes and latitudes in degrees, the first one again at the end. In a ring across the date line,
        longitudes go on beyond 180. Shape: (N, 2).
    water: whether it encloses water within land, such as the Caspian Sea.
    """

    points: np.ndarray
    water: bool


def encode(rings: list[Ring]) -> bytes:
    """Content of the file: for each ring 2 N + water, and N pairs of differences between one point and the next. Whole
    numbers are written with 7 bits in a byte, the lowest first; a byte above 127 is followed by another of its number.
    """
    data = bytearray()
    for points, water in rings:
        steps = np.diff(np.round(points / UNIT).astype(int), axis=0, prepend=[[0, 0]]).ravel()
        # Numbers that may be negative alternate: 0, -1, 1, -2, ...
        for number in (2 * len(points) + water, *np.where(steps >= 0, 2 * steps, -2 * steps - 1).tolist()):
            while number > 127:
                data.append(number & 127 | 128)
                number >>= 7
            data.append(number)
    return zlib.compress(bytes(data), 9)


def decode(content: bytes) -> list[Ring]:
    """The rings in the content of a file."""
    numbers = _numbers(np.frombuffer(zlib.decompress(content), np.uint8).astype(int))
    rings, at = [], 0
    while at < len(numbers):
        count, water = divmod(int(numbers[at]), 2)
        coded = numbers[at + 1 : at + 1 + 2 * count].reshape(count, 2)
        rings.append(Ring(np.cumsum(np.where(coded % 2, -(coded + 1) // 2, coded // 2), axis=0) * UNIT, bool(water)))
        at += 1 + 2 * count
    return rings


def _numbers(data: np.ndarray) -> np.ndarray:
    """The whole numbers that bytes of 7 bits encode."""
    last = data < 128
    ends = np.flatnonzero(last)
    starts = np.concatenate([[0], ends[:-1] + 1])
    place = np.arange(len(data)) - np.repeat(starts, ends - starts + 1)
    return np.add.reduceat((data & 127) << (7 * place), starts)


@cache
def land() -> tuple[Ring, ...]:
    """The coasts of the earth. A ring of water comes after the land around it."""
    return tuple(decode(FILE.read_bytes()))
