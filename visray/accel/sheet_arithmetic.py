"""Arithmetic of sheets of cells (cell_views.py): points relative to an origin, scalar products, slopes of tangents."""

from collections.abc import Iterator

import numpy as np

from visray.geometry import gamma

CHUNK = 1 << 13  # number of rows that are worked on at once; so many fit in the processor's cache


def chunks(n: int, size: int = CHUNK) -> Iterator[slice]:
    """Slices of at most `size` entries that cover n entries."""
    return (slice(k, min(k + size, n)) for k in range(0, n, size))


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
