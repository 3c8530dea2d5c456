"""PNG files, with 8 bits per channel."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Pillow
from PIL.PngImagePlugin import PngInfo

from visray.errors import UserError
from visray.output.files import replacing

# Metadata with a keyword of the PNG specification. All others have PREFIX and their key.
KEYWORDS = {"software": "Software", "owner": "Author", "comments": "Comment", "capDate": "Creation Time"}
PREFIX = "visray/"
# The PNG chunk that marks a file as sRGB, with perceptual intent.
SRGB_CHUNK = (b"sRGB", b"\0")
# The last chunk of a file: its length, its name and its checksum.
END_CHUNK = b"\0\0\0\0IEND\xaeB`\x82"


def write_png(path: str | os.PathLike[str], data: bytes) -> None:
    """Writes the bytes of a PNG file."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def read_png(path: str | os.PathLike[str]) -> np.ndarray:
    """The pixels of a PNG file that visray has written. Shape: uint8 (H, W, 3 or 4)."""
    with _opened(path) as picture:
        return np.array(picture)


def read_facts(path: str | os.PathLike[str]) -> dict[str, str]:
    """The metadata of a PNG file by key, as text. Those of other programs are left out. No pixels are decoded, but
    their checksums are compared. Raises UserError if the file is damaged or has no end."""
    with _opened(path) as picture:
        texts = list(picture.info.items())
        picture.verify()
    # Pillow does not ask for the checksum of the last chunk.
    if not Path(path).read_bytes().endswith(END_CHUNK):
        raise UserError(f"{os.fspath(path)}: the PNG file has no end; write it anew")
    return {key.removeprefix(PREFIX): text for key, text in texts if str(key).startswith(PREFIX)}


@contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[Pillow.Image]:
    """Opens a file for a `with` block. Raises UserError if it cannot be read."""
    try:
        with Pillow.open(path) as picture:
            yield picture
    except (OSError, SyntaxError) as error:
        raise UserError(f"{os.fspath(path)}: the PNG file cannot be read ({error}); write it anew") from error


def encode(pixels: np.ndarray, facts: dict[str, Any], srgb: bool) -> bytes:
    """The bytes of a PNG file, with metadata as text.

    facts: metadata by key.
    srgb: whether the file is marked as sRGB. A picture with another display curve has neither this mark nor a gAMA
        chunk, because viewers should show its numbers as they are.

    Shapes: pixels uint8 (H, W, 3 or 4).
    """
    info = PngInfo()
    if srgb:
        info.add(*SRGB_CHUNK)
    for key, value in facts.items():
        info.add_text(KEYWORDS.get(key, PREFIX + key), as_text(value))
    stream = BytesIO()
    Pillow.fromarray(pixels).save(stream, "png", pnginfo=info)
    return stream.getvalue()


def as_text(value: Any) -> str:
    """A value of the metadata as text. A string stays as it is; other values are written as JSON."""
    return value if isinstance(value, str) else json.dumps(value)
