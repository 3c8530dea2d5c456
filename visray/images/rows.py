"""Size and completeness of PNG and JPEG files, found out before memory is taken for their pixels.

A file may state a size that its rows do not fill. Decoders take memory for the stated size, and leave rows that are
missing black.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO

from visray import memory
from visray.errors import UserError

# Largest number of pixels in all images of a scene together: 4 GiB in a kernel. Above 2^30, 32-bit indices would fail.
MOST_PIXELS = 2**28
# Bytes of memory that a pixel takes while an image is read and packed for a kernel. Measured for 3000 x 3000 pixels.
BYTES_PER_PIXEL = 48
# Numbers in a pixel of a PNG file, by its colour type: grey, RGB, palette, grey and alpha, RGB and alpha.
NUMBERS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
# The seven passes of an interlaced PNG file: column and row of the first pixel, and the steps to the next.
PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
SIGNATURE = 8
STEP = 2**20


def check_size(width: int, height: int) -> None:
    """Raises a UserError if an image has too many pixels for visray, or for the memory that there is."""
    pixels, free = width * height, memory.free()
    if pixels > MOST_PIXELS:
        raise UserError(f"has {width} x {height} pixels; visray reads up to {MOST_PIXELS}, such as 16384 x 16384")
    if free is not None and pixels * BYTES_PER_PIXEL > free.size:
        needed = f"{pixels * BYTES_PER_PIXEL / 2**30:.1f} GiB"
        raise UserError(f"has {width} x {height} pixels, which take about {needed}; {free}; make the picture smaller")


def check_png_rows(path: str) -> None:
    """Raises a UserError if a PNG file lacks rows. Its data are decompressed piece by piece and counted."""
    with open(path, "rb") as file:
        file.seek(SIGNATURE)
        chunks = _chunks(file)
        kind, header = next(chunks, (b"", b""))
        if kind != b"IHDR" or len(header) != 13:
            return  # Pillow refuses such a file.
        needed, present = _png_bytes(header), 0
        stream = zlib.decompressobj()
        try:
            for kind, data in chunks:
                while kind == b"IDAT" and data:
                    present += len(stream.decompress(data, STEP))
                    data = b"" if stream.eof else stream.unconsumed_tail
        except zlib.error:
            pass
    if present < needed:
        share = f"{min(100 * present / needed, 99):.2g} %"
        raise UserError(f"is damaged: it lacks rows, only {share} of its pixels are there; save it anew")


def _chunks(file: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """Yields the type and the data of each chunk of a PNG file; data of more than STEP bytes in several pieces."""
    while len(start := file.read(8)) == 8:
        size, kind = struct.unpack(">I4s", start)
        if not size:
            yield kind, b""
        while size and (data := file.read(min(size, STEP))):
            yield kind, data
            size -= len(data)
        file.seek(4, os.SEEK_CUR)


def _png_bytes(header: bytes) -> int:
    """Number of bytes of a PNG file's rows, each with the byte that names its filter. header: its chunk IHDR."""
    width, height, bits, colour, _, _, interlaced = struct.unpack(">IIBBBBB", header)
    bits *= NUMBERS.get(colour, 0)
    sizes = [(-(-(width - x) // dx), -(-(height - y) // dy)) for x, y, dx, dy in PASSES]
    sizes = [size for size in sizes if min(size) > 0] if interlaced else [(width, height)]
    return sum(h * (1 + -(-w * bits // 8)) for w, h in sizes)


def check_jpeg_rows(path: str, width: int, height: int) -> None:
    """Raises a UserError if a JPEG file is too small for its size: each block of 8 x 8 pixels takes a bit at least."""
    blocks, size = -(-width // 8) * -(-height // 8), os.path.getsize(path)
    if 8 * size < blocks:
        raise UserError(f"is damaged: {size} bytes cannot hold {width} x {height} pixels; save it anew")
