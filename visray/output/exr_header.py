"""The header of an EXR file, read before any pixels are: the size of the picture, and whether all its rows are there.

OpenEXR takes memory for the whole picture before it finds out that a file is damaged.
"""

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from visray import memory
from visray.errors import UserError

# Length of the longest attribute name in an EXR header, in bytes.
LONGEST_NAME = 255
# Number of rows in a block, for each compression by its number; a block is the unit in which pixels are stored.
ROWS = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256, 10: 256, 11: 32}
# Bits of the version number: tiles in place of rows, and several parts.
TILED, PARTS = 0x200, 0x1000
# Bytes of memory that reading takes for a number of a channel, and for a pixel besides. Measured for 3000 x 3000 pixels
# with four channels: 42 a pixel.
BYTES_PER_NUMBER, BYTES_PER_PIXEL = 8, 16


@dataclass(frozen=True)
class ExrHeader:
    """What the header of a file of one part says.

    width, height: size in pixels.
    channels: number of channels.
    data, display: the data window and the display window: left, top, right and bottom, the last two inclusive.
    missing: number of blocks that the file lacks; None if that is not known.
    """

    width: int
    height: int
    channels: int
    data: tuple[int, int, int, int]
    display: tuple[int, int, int, int]
    missing: int | None

    @property
    def needed_memory(self) -> int:
        """Bytes of memory that reading the picture takes."""
        return self.width * self.height * (BYTES_PER_NUMBER * self.channels + BYTES_PER_PIXEL)


def read_header(path: str | os.PathLike[str]) -> ExrHeader | None:
    """The header of a file; None if it has several parts. Raises UserError if it is damaged."""
    try:
        with open(path, "rb") as file:
            version = struct.unpack("<4xI", file.read(8))[0]
            if version & PARTS:
                return None
            values = dict(_attributes(file))
            data = left, top, right, bottom = struct.unpack("<4i", values[b"dataWindow"])
            display = struct.unpack("<4i", values.get(b"displayWindow", values[b"dataWindow"]))
            width, height = right - left + 1, bottom - top + 1
            if width < 1 or height < 1:
                raise UserError("is damaged: its header states no size; save it anew")
            channels = _channel_count(values[b"channels"])
            missing = None if version & TILED else _missing(file, height, values[b"compression"])
    except (KeyError, struct.error, ValueError):
        raise UserError("is damaged: its header states no size; save it anew") from None
    return ExrHeader(width, height, channels, data, display, missing)


def check_header(path: str | os.PathLike[str]) -> None:
    """Raises UserError, without a path, if the file lacks rows, or if its pixels do not fit into memory."""
    header = read_header(path)
    if header is None:
        return
    if header.missing:
        raise UserError(f"is damaged: {header.missing} of its blocks of rows are missing; save it anew")
    free = memory.free()
    if free is not None and header.needed_memory > free.size:
        needed = f"{header.needed_memory / 2**30:.1f} GiB"
        raise UserError(
            f"has {header.width} x {header.height} pixels, which take about {needed}; {free}; make the picture smaller"
        )


def _attributes(file: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """Yields the name and the value of each attribute of a header. Values of more than 64 KiB are left out."""
    # An attribute is a name and a type, each followed by a zero byte, then the size of the value, and the value.
    while name := _zero_ended(file):
        _zero_ended(file)
        size = struct.unpack("<I", file.read(4))[0]
        if size < 2**16:
            yield name, file.read(size)
        else:
            file.seek(size, os.SEEK_CUR)


def _zero_ended(file: BinaryIO) -> bytes:
    """Bytes of a file up to the next zero byte or the end of the file, and at most LONGEST_NAME + 1 of them."""
    name = b""
    while len(name) <= LONGEST_NAME and (byte := file.read(1)) not in (b"\0", b""):
        name += byte
    return name


def _channel_count(listed: bytes) -> int:
    """Number of channels in a list of channels: each is a name, a zero byte, and 16 bytes."""
    count, at = 0, 0
    while at < len(listed) and listed[at]:
        at = listed.index(b"\0", at) + 17
        count += 1
    return count


def _missing(file: BinaryIO, height: int, compression: bytes) -> int | None:
    """Number of blocks of rows that the file lacks: those without a place in the file, or that it cuts off; None if the
    compression is unknown. The table of places follows the header, 8 bytes for each block."""
    rows = ROWS.get(compression[0])
    if rows is None:
        return None
    blocks, size = -(-height // rows), os.fstat(file.fileno()).st_size
    present, start, last = 0, file.tell() + 8 * blocks, 0
    while blocks > present and start <= size:
        table = file.read(min(8 * (blocks - present), 2**20))
        places = struct.unpack(f"<{len(table) // 8}Q", table)
        if not places or not all(start <= place < size for place in places):
            missing = sum(not start <= place < size for place in places)
            return missing + blocks - present - len(places)
        present, last = present + len(places), max(last, *places)
    return blocks - present or int(not _is_whole(file, last, size))


def _is_whole(file: BinaryIO, place: int, size: int) -> bool:
    """Whether the block of rows at a place is in a file of `size` bytes to its end. A block is its first row, the
    number of its bytes, and these."""
    file.seek(place)
    head = file.read(8)
    return len(head) == 8 and place + 8 + struct.unpack("<4xI", head)[0] <= size
