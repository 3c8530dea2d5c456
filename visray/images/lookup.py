"""Texture lookup in kernels: the colour of a texture at (u, v)."""

from typing import Any

import drjit as dr

from visray.images import WRAPS, Atlas, Row
from visray.pytree import rows
from visray.quantities import Arrays


def colour(a: Arrays, atlas: Atlas, index: Any, u: Any, v: Any, bilinear: bool) -> Any:
    """Colour of texture `index` at (u, v), as a V. Each lane has its own index.

    bilinear: whether any texture of the atlas blends neighbouring pixels; else the kernel has no code for it.

    Domain: any u and v, in single or double precision. Where they are not finite, the colour is that of some pixel.
    A bilinear blend has derivatives by u and v, except for the kinks between pixels; a nearest pixel and a checker
    have none.

    Error: (u, v) in the texture is off by at most 2^-52 (|scale u| + |offset|). A blend adds three roundings of the
    shading precision.
    """
    row = rows(atlas.rows, index)
    x = _wrapped(row.scale_u * a.D(u) + row.offset_u, row.wrap)
    y = _wrapped(row.scale_v * a.D(v) + row.offset_v, row.wrap)
    if atlas.texels is None:
        return _checker(row, x, y)
    image_colour = _image(a, atlas.texels, row, x, y, bilinear)
    return image_colour if row.a is None else dr.select(row.checker != 0, _checker(row, x, y), image_colour)


def _wrapped(x: Any, wrap: Any) -> Any:
    """Texture coordinate in [0, 1] after wrapping x; 0 where x is not finite.

    It uses floor instead of an integer remainder, which LLVM does not vectorise. For a tiny negative x, 1 + x may round
    to 1, so callers accept 1 and take the last pixel there.
    """
    x = dr.select(wrap == WRAPS.index("clamp"), dr.clip(x, 0, 1), x)
    repeats = wrap == WRAPS.index("repeat")
    x = x - dr.select(repeats, 1, 2) * dr.floor(x * dr.select(repeats, 1, 0.5))
    # From 1 to 2 a mirrored image runs backwards. fmax turns NaN into 0.
    return dr.select(x <= 1, x, dr.fmax(2 - x, 0))


def _checker(row: Row, x: Any, y: Any) -> Any:
    """Colour of a checker texture at (x, y) in [0, 1]^2."""
    return dr.select((x < 0.5) ^ (y < 0.5), row.b, row.a)


def _image(a: Arrays, texels: Any, row: Row, x: Any, y: Any, bilinear: bool) -> Any:
    """Colour of an image at (x, y) in [0, 1]^2: that of one pixel, or the blend of the four pixels around it."""
    pitch = a.U(row.width)

    def texel(i: Any, j: Any) -> Any:
        rgb0 = dr.gather(a.Q32, texels, row.start + j * pitch + i)
        return a.V(rgb0.x, rgb0.y, rgb0.z)

    if not bilinear:
        return texel(_nearest(a, x, row.width), _nearest(a, y, row.height))
    left, right, s = _around(a, x, row.width, row)
    below, above, t = _around(a, y, row.height, row)
    low, high = (_blend(texel(left, j), texel(right, j), s) for j in (below, above))
    return _blend(low, high, t)


def _blend(p: Any, q: Any, weight: Any) -> Any:
    """Linear blend: p at weight 0, q at weight 1. Exact where p = q."""
    return p + weight * (q - p)


def _nearest(a: Arrays, x: Any, size: Any) -> Any:
    """Index of the pixel that contains x in [0, 1], along one axis of `size` pixels."""
    return a.U(dr.minimum(dr.floor(x * size), size - 1))


def _around(a: Arrays, x: Any, size: Any, row: Row) -> tuple[Any, Any, Any]:
    """The two pixels along one axis whose centres enclose x in [0, 1], and the weight of the second.

    For a texture that is not smooth: the pixel that contains x, with a weight of 0 for the second.
    """
    position = x * size - 0.5 * row.smooth
    low = dr.floor(position)
    weight = a.F((position - low) * row.smooth)
    last = size - 1
    # In a repeating image the pixel before the first is the last; at other edges a pixel is its own neighbour.
    before_first = dr.select(row.wrap == WRAPS.index("repeat"), last, 0)
    first_index = dr.select(low < 0, before_first, dr.minimum(low, last))
    second_index = dr.select(low >= last, last - before_first, low + 1)
    return a.U(first_index), a.U(second_index), weight
