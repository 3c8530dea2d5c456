"""Texture lookup in kernels: the colour of a texture at (u, v), and what it changes in a material.

A lane is one entry of a Dr.Jit array: here one surface point. Each lane may look up another texture.
"""

from dataclasses import replace
from typing import Any

import drjit as dr

from visray.images import WRAPS, Atlas, Row
from visray.materials import Material
from visray.pytree import rows
from visray.quantities import Arrays


def coloured(
    a: Arrays, atlas: Atlas, material: Material, index: Any, textured: Any, uv: tuple, bilinear: bool
) -> Material:
    """The material at (u, v), with the colour of its texture as kd, and ka times this colour.

    index: number of the texture's row in the atlas, in each lane.
    textured: mask of the lanes whose material has a texture.
    uv: texture coordinates of the surface point.
    bilinear: as in `colour`.
    """
    index = dr.select(textured, index, 0)
    texture_colour = colour(a, atlas, index, *uv, bilinear)
    scales_ka = textured
    if atlas.rows.keeps_ka is not None:
        scales_ka = textured & (dr.gather(a.U, atlas.rows.keeps_ka, index) == 0)
    kd = dr.select(textured, texture_colour, material.kd)
    return replace(material, kd=kd, ka=dr.select(scales_ka, material.ka * texture_colour, material.ka))


def colour(a: Arrays, atlas: Atlas, index: Any, u: Any, v: Any, bilinear: bool) -> Any:
    """Colour of a texture at (u, v), as an array of type `a.V`.

    a: array types of the kernel.
    index: number of the texture's row in the atlas, in each lane.
    u, v: texture coordinates of the surface point.
    bilinear: whether any texture of the atlas blends neighbouring pixels. If not, the kernel has no code for blending.

    Domain: any u and v, in single or double precision. In lanes where u or v is not finite, the colour is that of any
    one pixel of the texture. A bilinear blend has derivatives by u and v; they jump at the centres of pixels. The
    nearest pixel and the checker have no derivatives.
    Error: the coordinates scale * (u, v) + offset have an error of at most 2^-52 (|scale u| + |offset|). A blend adds
    three roundings in the precision of shading.
    """
    row = rows(atlas.rows, index)
    x = _wrapped(row.scale_u * a.D(u) + row.offset_u, row.wrap_u)
    y = row.scale_v * a.D(v) + row.offset_v
    # Between the centres of two rows a blend has only these rows. So no row beyond a pole is blended in.
    y = _wrapped(y if row.lowest is None else dr.clip(y, row.lowest, row.highest), row.wrap_v)
    if atlas.texels is None:
        return _checker(row, x, y)
    image_colour = _image(a, atlas.texels, row, x, y, bilinear)
    return image_colour if row.a is None else dr.select(row.checker != 0, _checker(row, x, y), image_colour)


def _wrapped(x: Any, wrap: Any) -> Any:
    """Coordinate in [0, 1] that x is wrapped to; 0 or 1 in lanes where x is not finite.

    wrap: index into WRAPS.

    The result is computed with floor, because LLVM does not vectorise integer remainders. For a tiny negative x the
    result 1 + x may round to 1. So callers must accept 1, which belongs to the last pixel.
    """
    x = dr.select(wrap == WRAPS.index("clamp"), dr.clip(x, 0, 1), x)
    repeats = wrap == WRAPS.index("repeat")
    x = x - dr.select(repeats, 1, 2) * dr.floor(x * dr.select(repeats, 1, 0.5))
    # From 1 to 2 a mirrored image is reversed. fmax turns NaN into 0.
    return dr.select(x <= 1, x, dr.fmax(2 - x, 0))


def _checker(row: Row, x: Any, y: Any) -> Any:
    """Colour of a checker texture at (x, y) in [0, 1]^2."""
    return dr.select((x < 0.5) ^ (y < 0.5), row.b, row.a)


def _image(a: Arrays, texels: Any, row: Row, x: Any, y: Any, bilinear: bool) -> Any:
    """Colour of an image at (x, y) in [0, 1]^2: the colour of one pixel, or a blend of the four nearest pixels.

    texels: the texels of all images. row: parameters of the texture. bilinear: whether a texture blends pixels.
    """
    pitch = a.U(row.width)

    def texel(i: Any, j: Any) -> Any:
        rgb0 = dr.gather(a.Q32, texels, row.start + j * pitch + i)
        return a.V(rgb0.x, rgb0.y, rgb0.z)

    if not bilinear:
        return texel(_nearest(a, x, row.width), _nearest(a, y, row.height))
    left, right, s = around(a, x, row.width, row.wrap_u, row.smooth)
    below, above, t = around(a, y, row.height, row.wrap_v, row.smooth)
    low, high = (blend(texel(left, j), texel(right, j), s) for j in (below, above))
    return blend(low, high, t)


def blend(p: Any, q: Any, weight: Any) -> Any:
    """Linear blend: p at weight 0, q at weight 1. Exact if p = q."""
    return p + weight * (q - p)


def _nearest(a: Arrays, x: Any, size: Any) -> Any:
    """Index of the pixel that contains x, along one axis.

    x: coordinate in [0, 1]. size: number of pixels along the axis.
    """
    return a.U(dr.minimum(dr.floor(x * size), size - 1))


def around(a: Arrays, x: Any, size: Any, wrap: Any, smooth: Any) -> tuple[Any, Any, Any]:
    """The indices of two pixels along one axis, and the weight of the second pixel. x lies between their centres.

    If the texture does not blend pixels, the first pixel is the one that contains x, and the weight is 0.

    x: coordinate in [0, 1]. size: number of pixels along the axis. wrap: index into WRAPS. smooth: as in Row.
    """
    position = x * size - 0.5 * smooth
    low = dr.floor(position)
    weight = a.F((position - low) * smooth)
    last = size - 1
    # In a repeating image the pixel before the first is the last; at other edges a pixel is its own neighbour.
    before_first = dr.select(wrap == WRAPS.index("repeat"), last, 0)
    first_index = dr.select(low < 0, before_first, dr.minimum(low, last))
    second_index = dr.select(low >= last, last - before_first, low + 1)
    return a.U(first_index), a.U(second_index), weight
