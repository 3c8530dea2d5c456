"""The colour of a texture at (u, v), in kernels."""

from typing import Any

import drjit as dr

from visray.images import WRAPS, Atlas, Row
from visray.pytree import rows
from visray.quantities import Arrays


def colour(a: Arrays, atlas: Atlas, index: Any, u: Any, v: Any, bilinear: bool) -> Any:
    """The colour of texture `index`, one a lane, at (u, v), as a V.

    bilinear: whether any texture of the atlas blends neighbours; where not, the kernel has no code for it. u, v: single
    or double, any number; not finite: the colour of some pixel. Blends have derivatives by u and v, and lack those of
    their corners; nearest pixels and checkers have none.

    Error: (u, v) itself is used as given; in the texture it is off by 2^-52 (|scale u| + |offset|). A blend adds three
    roundings of the shading precision.
    """
    row = rows(atlas.rows, index)
    x = _inside(row.scale_u * a.D(u) + row.offset_u, row.wrap)
    y = _inside(row.scale_v * a.D(v) + row.offset_v, row.wrap)
    if atlas.texels is None:
        return _squares(row, x, y)
    seen = _image(a, atlas.texels, row, x, y, bilinear)
    return seen if row.a is None else dr.select(row.checker != 0, _squares(row, x, y), seen)


def _inside(x: Any, wrap: Any) -> Any:
    """The place in [0, 1] that x stands for beyond the edges; 0 where x is not finite.

    By floor and not by a remainder of whole numbers, which LLVM takes lane by lane. A step back to 0 of a tiny negative
    x may round up to 1: which is why callers take the last pixel there.
    """
    x = dr.select(wrap == WRAPS.index("clamp"), dr.clip(x, 0, 1), x)
    once = wrap == WRAPS.index("repeat")
    x = x - dr.select(once, 1, 2) * dr.floor(x * dr.select(once, 1, 0.5))
    # The way back of a mirror, and what fmax makes of NaN.
    return dr.select(x <= 1, x, dr.fmax(2 - x, 0))


def _squares(row: Row, x: Any, y: Any) -> Any:
    return dr.select((x < 0.5) ^ (y < 0.5), row.b, row.a)


def _image(a: Arrays, texels: Any, row: Row, x: Any, y: Any, bilinear: bool) -> Any:
    """The pixel at (x, y) in [0, 1]^2, or the blend of the four whose centres are around it."""
    pitch = a.U(row.width)

    def texel(i: Any, j: Any) -> Any:
        found = dr.gather(a.Q32, texels, row.start + j * pitch + i)
        return a.V(found.x, found.y, found.z)

    if not bilinear:
        return texel(_nearest(a, x, row.width), _nearest(a, y, row.height))
    left, right, s = _around(a, x, row.width, row)
    below, above, t = _around(a, y, row.height, row)
    low, high = (_blend(texel(left, j), texel(right, j), s) for j in (below, above))
    return _blend(low, high, t)


def _blend(p: Any, q: Any, weight: Any) -> Any:
    """p where the weight is 0; exact where p = q."""
    return p + weight * (q - p)


def _nearest(a: Arrays, x: Any, size: Any) -> Any:
    return a.U(dr.minimum(dr.floor(x * size), size - 1))


def _around(a: Arrays, x: Any, size: Any, row: Row) -> tuple[Any, Any, Any]:
    """The pixels of one axis whose centres are before and behind x in [0, 1], and the weight of the latter.

    Where the texture is not smooth: the pixel at x, and a weight of 0.
    """
    place = x * size - 0.5 * row.smooth
    low = dr.floor(place)
    weight = a.F((place - low) * row.smooth)
    last = size - 1
    # Of a picture that repeats, the pixel before the first is the last; at other edges, a pixel is its own neighbour.
    beyond = dr.select(row.wrap == WRAPS.index("repeat"), last, 0)
    before = dr.select(low < 0, beyond, dr.minimum(low, last))
    behind = dr.select(low >= last, last - beyond, low + 1)
    return a.U(before), a.U(behind), weight
