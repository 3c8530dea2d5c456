"""Images of textures: reading from files, packing for kernels, and lookup in kernels."""

from visray.images.atlas import WRAPS, Atlas, Row, pack
from visray.images.reading import read_image

__all__ = ["WRAPS", "Atlas", "Row", "pack", "read_image"]
