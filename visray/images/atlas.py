"""The textures of a scene as arrays, for texturing.colour to look up."""

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
    """What a kernel knows of each texture. Shapes: one entry a texture.

    width, height: pixels, in double as they are multiplied with places; start: the number of the first of them among
    all texels; wrap: place in WRAPS; smooth: 1 where neighbours are blended, else 0. checker: 1 or 0; a, b: its
    colours, or None where no texture is one.
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
    """All textures of a scene. texels: R, G, B and 0 of each pixel, image after image, each from its bottom row up; or
    None where no texture is an image. rows: in the order of the scene."""

    texels: Any
    rows: Row


def pack(a: Arrays, textures: dict[str, Texture]) -> Atlas | None:
    """The textures as arrays, an entry each in their order, or None where there are none; reads their files.

    Raises UserError, a line for each file that cannot be read. An image that several textures show is held once.
    """
    if not textures:
        return None
    images = _images(textures)
    distinct = _distinct(images)
    starts = np.cumsum([0] + [image.shape[0] * image.shape[1] for image in distinct])
    first = {id(image): start for image, start in zip(distinct, starts)}
    texels = np.zeros((starts[-1], 4), np.float32)
    for image, start in zip(distinct, starts):
        texels[start : start + image.shape[0] * image.shape[1], :3] = image[::-1].reshape(-1, 3)
    things = list(textures.values())
    sizes = [(1, 1) if image is None else image.shape[:2] for image in images]
    checkers = [x if isinstance(x, CheckerTexture) else None for x in things]

    def put(kind: Any, values: Sequence, number: type = float) -> Any:
        return a.put(kind, np.array(values, number).T)

    atlas = Atlas(
        texels=a.put(a.F32, texels.ravel()) if distinct else None,
        rows=Row(
            scale_u=put(a.D, [x.scale[0] for x in things]),
            scale_v=put(a.D, [x.scale[1] for x in things]),
            offset_u=put(a.D, [x.offset[0] for x in things]),
            offset_v=put(a.D, [x.offset[1] for x in things]),
            width=put(a.D, [width for _, width in sizes]),
            height=put(a.D, [height for height, _ in sizes]),
            start=put(a.U, [first.get(id(image), 0) for image in images], np.uint32),
            wrap=put(a.U, [WRAPS.index(getattr(x, "wrap", "repeat")) for x in things], np.uint32),
            smooth=put(a.D, [getattr(x, "filter", "nearest") == "bilinear" for x in things]),
            checker=put(a.U, [c is not None for c in checkers], np.uint32),
            a=put(a.V, [c.a if c else (0, 0, 0) for c in checkers]) if any(checkers) else None,
            b=put(a.V, [c.b if c else (0, 0, 0) for c in checkers]) if any(checkers) else None,
        ),
    )
    # The copies are made now: NumPy's memory goes when this returns.
    dr.eval(atlas)
    return atlas


def _images(textures: dict[str, Texture]) -> list[np.ndarray | None]:
    """The picture of each texture, or None where it is no image. Shapes: (H, W, 3)."""
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
    """Each image once, by identity: of a file that did not change, read_image gives the same array."""
    return list({id(image): image for image in images if image is not None}.values())
