"""PNG files: 8 bits a channel, for screens."""

import json
import os
from io import BytesIO
from typing import TYPE_CHECKING, Any

from PIL import Image as Pillow
from PIL.PngImagePlugin import PngInfo

from visray.output.files import replacing

if TYPE_CHECKING:
    from visray.output.image import Gamma, Image

# The keywords of the PNG specification for what has one; everything else is `visray/<key>`.
KEYWORDS = {"software": "Software", "owner": "Author", "comments": "Comment", "capDate": "Creation Time"}
# The chunk that says sRGB, perceptual intent.
SRGB_CHUNK = (b"sRGB", b"\0")


def write_png(image: "Image", path: str | os.PathLike[str], gamma: "Gamma" = "srgb", exposure: float = 0.0) -> None:
    """Writes the colour for a screen: curve, `exposure` in stops, and the provenance as text."""
    data = encode(image, gamma, exposure)
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def encode(image: "Image", gamma: "Gamma" = "srgb", exposure: float = 0.0) -> bytes:
    """The bytes of the PNG file. A picture with a plain gamma is not marked as sRGB, and has no gAMA: it is a look."""
    info = PngInfo()
    if gamma == "srgb":
        info.add(*SRGB_CHUNK)
    for key, value in {**image.provenance(), "gamma": gamma, "exposure": exposure}.items():
        info.add_text(KEYWORDS.get(key, f"visray/{key}"), _text(value))
    stream = BytesIO()
    Pillow.fromarray(image.display(gamma, exposure)).save(stream, "png", pnginfo=info)
    return stream.getvalue()


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
