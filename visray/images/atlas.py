"""Texture atlas: all textures of a scene in a few arrays, from which a kernel reads colours (lookup.py).

A texel is a pixel of a texture's image.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.errors import UserError
from visray.images.reading import MOST_PIXELS, read_image
from visray.quantities import Arrays
from visray.textures import CheckerTexture, ImageTexture, Texture

WRAPS = ("repeat", "mirror", "clamp")


@dataclass(frozen=True)
class Row:
    """Parameters of textures. In the atlas, each field is an array with one entry per texture. In a lookup, each field
    has one entry per lane, that of the lane's texture.

    scale_u, scale_v, offset_u, offset_v: the texture's coordinates are scale * (u, v) + offset.
    width, height: size of the image in pixels; in double, because coordinates are multiplied by them.
    start: index of the image's first texel in Atlas.texels.
    wrap: index into WRAPS.
    smooth: 1 if neighbouring pixels are blended, else 0.
    checker: 1 for a checker texture, else 0.
    a, b: the two colours of a checker texture, or None if the scene has no checker texture.
    """

    scale_u: Any
    scale_v: Any
    offset_u: Any
    offset_v: Any
    width: Any
    height: Any
    start: Any
    wrap: Any
    smooth: Any
    checker: Any
    a: Any
    b: Any


@dataclass(frozen=True)
class Atlas:
    """All textures of a scene.

    texels: R, G, B and 0 of each texel, one image after the other, each with its bottom row first. None if no texture
        is an image.
    rows: parameters of the textures, in the order of the scene.
    """

    texels: Any
    rows: Row


def pack(a: Arrays, textures: dict[str, Texture]) -> Atlas | None:
    """Atlas of the textures, or None if there are no textures. Reads their image files.

    textures: the textures by name.

    An image that several textures share is stored once. Raises a UserError with one line for each file that cannot be
    read.
    """
    if not textures:
        return None
    images = _images(textures)
    distinct = _distinct(images)
    starts = np.cumsum([0] + [image.shape[0] * image.shape[1] for image in distinct])
    start_of = {id(image): start for image, start in zip(distinct, starts)}
    texels = np.zeros((starts[-1], 4), np.float32)
    for image, start in zip(distinct, starts):
        texels[start : start + image.shape[0] * image.shape[1], :3] = image[::-1].reshape(-1, 3)
    textures_in_order = list(textures.values())
    sizes = [(1, 1) if image is None else image.shape[:2] for image in images]
    checkers = [x if isinstance(x, CheckerTexture) else None for x in textures_in_order]

    def put(kind: Any, values: Sequence, number: type = float) -> Any:
        return a.put(kind, np.array(values, number).T)

    atlas = Atlas(
        texels=a.put(a.F32, texels.ravel()) if distinct else None,
        rows=Row(
            scale_u=put(a.D, [x.scale[0] for x in textures_in_order]),
            scale_v=put(a.D, [x.scale[1] for x in textures_in_order]),
            offset_u=put(a.D, [x.offset[0] for x in textures_in_order]),
            offset_v=put(a.D, [x.offset[1] for x in textures_in_order]),
            width=put(a.D, [width for _, width in sizes]),
            height=put(a.D, [height for height, _ in sizes]),
            start=put(a.U, [start_of.get(id(image), 0) for image in images], np.uint32),
            wrap=put(a.U, [WRAPS.index(getattr(x, "wrap", "repeat")) for x in textures_in_order], np.uint32),
            smooth=put(a.D, [getattr(x, "filter", "nearest") == "bilinear" for x in textures_in_order]),
            checker=put(a.U, [c is not None for c in checkers], np.uint32),
            a=put(a.V, [c.a if c else (0, 0, 0) for c in checkers]) if any(checkers) else None,
            b=put(a.V, [c.b if c else (0, 0, 0) for c in checkers]) if any(checkers) else None,
        ),
    )
    # Dr.Jit must copy the arrays now: NumPy's memory is freed when this function returns.
    dr.eval(atlas)
    return atlas


def _images(textures: dict[str, Texture]) -> list[np.ndarray | None]:
    """List of the images of all textures, with None for a texture without an image. Shapes: (H, W, 3) each."""
    images: list[np.ndarray | None] = []
    flaws: list[str] = []
    for name, texture in textures.items():
        images.append(None)
        if isinstance(texture, ImageTexture):
            try:
                images[-1] = read_image(texture.file, texture.encoding, f"textures.{name}.file")
            except UserError as error:
                flaws += error.lines
        if (pixels := sum(image.shape[0] * image.shape[1] for image in _distinct(images))) > MOST_PIXELS:
            flaws.append(f"textures: up to '{name}' they have {pixels} pixels; shrink some, visray holds {MOST_PIXELS}")
            break
    if flaws:
        raise UserError(*flaws)
    return images


def _distinct(images: list[np.ndarray | None]) -> list[np.ndarray]:
    """List of the different images. They are compared by identity, because read_image returns the same array for the
    same file."""
    return list({id(image): image for image in images if image is not None}.values())
