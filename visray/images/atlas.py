"""Texture atlas: all textures of a scene in a few arrays, from which a kernel reads colours (lookup.py).

A texel is a pixel of a texture's image.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.errors import UserError
from visray.geometry import gamma
from visray.images.reading import read_image
from visray.images.rows import MOST_PIXELS
from visray.quantities import Arrays
from visray.textures import USES, CheckerTexture, ImageTexture, Texture

WRAPS = ("repeat", "mirror", "clamp")


@dataclass(frozen=True)
class Row:
    """Parameters of textures. In the atlas, each field is an array with one entry per texture. In a lookup, each field
    has one entry per lane, that of the lane's texture.

    scale_u, scale_v, offset_u, offset_v: the texture's coordinates are scale * (u, v) + offset.
    width, height: size of the image in pixels; in double, because coordinates are multiplied by them.
    start: index of the image's first texel in Atlas.texels.
    wrap_u, wrap_v: indices into WRAPS.
    lowest, highest: limits of the coordinate along v, at the centres of the first and the last row of pixels between
        the poles of the surface; infinite if its v does not end at poles. None if no surface has poles.
    smooth: 1 if neighbouring pixels are blended, else 0.
    checker: 1 for a checker texture, else 0.
    keeps_ka: 1 if the texture leaves ka of its material as it is; None if no texture does.
    a, b: the two colours of a checker texture, or None if the scene has no checker texture.
    """

    scale_u: Any
    scale_v: Any
    offset_u: Any
    offset_v: Any
    width: Any
    height: Any
    start: Any
    wrap_u: Any
    wrap_v: Any
    lowest: Any
    highest: Any
    smooth: Any
    checker: Any
    keeps_ka: Any
    a: Any
    b: Any


@dataclass(frozen=True)
class Atlas:
    """All textures of a scene.

    texels: R, G, B and 0 of each texel, one image after the other, each with its bottom row first. None if no texture
        is an image.
    rows: parameters of the textures: one row for each texture and each way in which it is used (textures.row_number).
    """

    texels: Any
    rows: Row


def pack(a: Arrays, textures: dict[str, Texture], v_ends: bool = False, keeps_ka: bool = False) -> Atlas | None:
    """Atlas of the textures, or None if there are no textures. Reads their image files.

    textures: the textures by name.
    v_ends: whether some object of the scene is of a kind whose v ends at poles.
    keeps_ka: whether some material of the scene has a texture that leaves ka as it is.

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
    uses = USES if keeps_ka else USES[: 1 + v_ends]
    listed = [(*texture, *use) for use in uses for texture in zip(textures.values(), images)]
    atlas = Atlas(
        texels=a.put(a.F32, texels.ravel()) if distinct else None,
        rows=_rows(a, listed, start_of, v_ends, keeps_ka),
    )
    # Dr.Jit must copy the arrays now: NumPy's memory is freed when this function returns.
    dr.eval(atlas)
    return atlas


def _rows(a: Arrays, listed: list[tuple], start_of: dict[int, int], v_ends: bool, keeps_ka: bool) -> Row:
    """Parameters of textures as arrays.

    listed: for each row, its texture, the image, and the two words of its use (textures.row_number).
    start_of: for each image, by its id(), the index of its first texel.
    v_ends, keeps_ka: as in `pack`.
    """
    textures, images, *_ = zip(*listed)
    sizes = [(1, 1) if image is None else image.shape[:2] for image in images]
    ends = [_ends(t, size[0]) if x else (-np.inf, np.inf) for (t, _, x, _), size in zip(listed, sizes)]
    wraps = [getattr(t, "wraps", ("repeat", "repeat")) for t in textures]
    checkers = [t if isinstance(t, CheckerTexture) else None for t in textures]

    def put(kind: Any, values: Iterable, number: type = float) -> Any:
        return a.put(kind, np.array(list(values), number).T)

    return Row(
        scale_u=put(a.D, (t.scale[0] for t in textures)),
        scale_v=put(a.D, (t.scale[1] for t in textures)),
        offset_u=put(a.D, (t.offset[0] for t in textures)),
        offset_v=put(a.D, (t.offset[1] for t in textures)),
        width=put(a.D, (width for _, width in sizes)),
        height=put(a.D, (height for height, _ in sizes)),
        start=put(a.U, (start_of.get(id(image), 0) for image in images), np.uint32),
        wrap_u=put(a.U, (WRAPS.index(wrap) for wrap, _ in wraps), np.uint32),
        wrap_v=put(a.U, (WRAPS.index(wrap) for _, wrap in wraps), np.uint32),
        lowest=put(a.D, (low for low, _ in ends)) if v_ends else None,
        highest=put(a.D, (high for _, high in ends)) if v_ends else None,
        smooth=put(a.D, (getattr(t, "filter", "nearest") == "bilinear" for t in textures)),
        checker=put(a.U, (c is not None for c in checkers), np.uint32),
        keeps_ka=put(a.U, (keeps for *_, keeps in listed), np.uint32) if keeps_ka else None,
        a=put(a.V, (c.a if c else (0, 0, 0) for c in checkers)) if any(checkers) else None,
        b=put(a.V, (c.b if c else (0, 0, 0) for c in checkers)) if any(checkers) else None,
    )


def _ends(texture: Texture, height: int) -> tuple[float, float]:
    """Limits of the coordinate along v between the poles v = 0 and v = 1: the centres of the first and the last row of
    pixels that lie between them.

    height: height of the texture's image in pixels; not used for a checker texture, which has two rows of squares.

    A row counts unless it touches the pole to within the rounding error of the pole's coordinate.
    """
    size = 2 if isinstance(texture, CheckerTexture) else height
    poles = texture.offset[1], texture.offset[1] + texture.scale[1]
    error = gamma(3) * size * (abs(texture.offset[1]) + abs(texture.scale[1]))
    first = np.floor(min(poles) * size + error)
    last = max(first, np.ceil(max(poles) * size - error) - 1)
    return (first + 0.5) / size, (last + 0.5) / size


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
