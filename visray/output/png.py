"""PNG files: 8 bits a channel, for screens."""

import json
import os
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image as Pillow
from PIL.PngImagePlugin import PngInfo

from visray.output.files import replacing

# The keywords of the PNG specification for what has one; everything else is `visray/<key>`.
KEYWORDS = {"software": "Software", "owner": "Author", "comments": "Comment", "capDate": "Creation Time"}
# The chunk that says sRGB, perceptual intent.
SRGB_CHUNK = (b"sRGB", b"\0")


def write_png(path: str | os.PathLike[str], data: bytes) -> None:
    """Writes the bytes of a PNG file."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def encode(pixels: np.ndarray, facts: dict[str, Any], srgb: bool) -> bytes:
    """The bytes of the PNG file of uint8 `pixels`, with the metadata as text.

    A picture with a plain gamma is not marked as sRGB, and has no gAMA: it is a look.
    """
    info = PngInfo()
    if srgb:
        info.add(*SRGB_CHUNK)
    for key, value in facts.items():
        info.add_text(KEYWORDS.get(key, f"visray/{key}"), _text(value))
    stream = BytesIO()
    Pillow.fromarray(pixels).save(stream, "png", pnginfo=info)
    return stream.getvalue()


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
