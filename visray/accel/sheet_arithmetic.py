"""Arithmetic of sheets of cells (cell_views.py): points relative to an origin, scalar products, slopes of tangents, and
distances of triangles."""

from collections.abc import Iterator

import numpy as np

from visray.geometry import gamma

CHUNK = 1 << 13  # number of rows that are worked on at once; so many fit in the processor's cache
# If the depths of a triangle's corners differ by more than this factor, its distance is bounded by a search.
DEEP = 1.25
STEPS = 12  # steps of this search
# The square of a shorter vector loses digits in single, so v.w / |w| is replaced by the smaller bound v.w.
SHORT = 2.0**-40


def chunks(n: int, size: int = CHUNK) -> Iterator[slice]:
    """Slices of at most `size` entries that cover n entries."""
    return (slice(k, min(k + size, n)) for k in range(0, n, size))


def taken(v: np.ndarray, index: np.ndarray) -> np.ndarray:
    """v[..., index], contiguous in memory. NumPy's own result is not, which slows all that follows."""
    return np.take(v, index, axis=-1)


def relative(p: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Points minus the origin. Shapes: p (m, 3), result (3, m)."""
    result = np.empty((3, len(p)))
    for k in range(3):
        np.subtract(p[:, k], origin[k], out=result[k])
    return result


def along(v: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Scalar products of vectors and an axis, in the vectors' precision. Shapes: v (3, ...), axis (3)."""
    products = [v[k] * v.dtype.type(axis[k]) for k in range(3) if axis[k]]
    return sum(products[1:], start=products[0])


def tangent_slopes(x: np.ndarray, z: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest slope x / z of the points with z > 0 of discs in the plane of x and z. Shape: (n) each.

    The tangents from (0, 0) to a disc have the directions of (x, z), turned by an angle with the tangent radius / L,
    where L^2 = x^2 + z^2 - radius^2. A slope is -inf or inf where the disc reaches behind z = 0 on that side.

    Error: L is rounded downwards, which makes the angle greater. Then a slope s has an error of at most
    gamma(8) (1 + s^2) in double.
    Domain: z + radius > 0; the result means nothing for other discs.
    """
    square = (x * x + z * z) * (1 - gamma(8))
    length = np.sqrt(np.maximum(square - radius * radius, 0))
    around = square <= radius * radius
    xl, zl, xr, zr = x * length, z * length, x * radius, z * radius
    below, above = zl + xr, zl - xr
    with np.errstate(divide="ignore", invalid="ignore"):
        low = np.where((below > 0) & ~around, (xl - zr) / below, -np.inf)
        high = np.where((above > 0) & ~around, (xl + zr) / above, np.inf)
    return low, high


def triangle_distance(p: np.ndarray) -> np.ndarray:
    """Lower bounds on the distances of triangles from the origin. Shapes: p (3 axes, 3 corners, m), result
    (m).

    For any vector w, no point of a triangle is nearer than the least v.w / |w| of its corners v. The vector to the
    middle of the triangle gives a good bound if the triangle is small, and the vector to its nearest point the best.
    The rounding of v.w / |w| is relative to |v|.
    """
    w = p.sum(axis=1)
    heights = (p * w[:, None]).sum(axis=0)
    least = heights.min(axis=0)
    length = np.sqrt((w * w).sum(axis=0))
    bound = least / np.where(length > SHORT, length, np.float32(1))
    deep = np.flatnonzero(np.float32(DEEP) * least < heights.max(axis=0))
    if len(deep):
        bound[deep] = np.maximum(bound[deep], searched_distance(taken(p, deep)))
    return np.maximum(bound, 0)


def searched_distance(p: np.ndarray) -> np.ndarray:
    """As triangle_distance, with vectors w to points that approach the nearest point of each triangle.

    In each step w moves towards the corner with the least v.w, to the nearest point of the line between both.
    Source: Gilbert 1966; Frank and Wolfe 1956.
    """
    each = np.arange(p.shape[2])
    w, best = p[:, np.argmin((p * p).sum(axis=0), axis=0), each], np.zeros(p.shape[2], np.float32)
    for _ in range(STEPS):
        heights = (p * w[:, None]).sum(axis=0)
        corner = np.argmin(heights, axis=0)
        length = np.sqrt((w * w).sum(axis=0))
        best = np.maximum(best, heights[corner, each] / np.where(length > SHORT, length, np.float32(1)))
        step = p[:, corner, each] - w
        squared = (step * step).sum(axis=0)
        share = -(w * step).sum(axis=0) / np.where(squared > 0, squared, np.float32(1))
        w = w + np.clip(share, 0, 1) * step
    return best
