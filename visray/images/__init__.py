"""Images of textures: read from files, packed for kernels, and looked up."""

from visray.images.atlas import WRAPS, Atlas, Row, pack
from visray.images.reading import read_image

__all__ = ["WRAPS", "Atlas", "Row", "pack", "read_image"]
