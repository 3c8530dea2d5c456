"""Fits a mesh to a size or into a box."""

from typing import Any

import numpy as np

from visray.meshes.triangle_mesh import TriangleMesh


def fit_transform(mesh: TriangleMesh, fit: Any) -> tuple[float, np.ndarray]:
    """The factor and the shift of the map p -> scale p + shift that fits a mesh.

    fit: a number: the longest side of the bounding box becomes this, and the box is centred at the origin; or the low
        and the high corner of a box: the mesh becomes as large as fits into it, and is centred in it.

    Shapes: shift (3).
    """
    used = mesh.vertices[np.unique(mesh.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    if np.ndim(fit) == 0:
        scale, centre = float(fit) / (high - low).max(), np.zeros(3)
    else:
        corner, opposite = np.asarray(fit, float)
        sides = high - low
        # A flat mesh has no extent along one axis, which then sets no limit.
        scale = min(room / side for room, side in zip(opposite - corner, sides) if side > 0)
        centre = (corner + opposite) / 2
    return float(scale), centre - scale * (low + high) / 2
