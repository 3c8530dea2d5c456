"""The rows of a batch, as the bounding volume hierarchy (bvh.py) needs them."""

import numpy as np

from visray.accel.blocks import TreeRows
from visray.batches import Batch, boxes


def tree_rows(batch: Batch) -> TreeRows:
    """The rows of a batch for the tree."""
    corners = balls = rods = None
    if batch.kind.triangular:
        corners = np.stack([np.array(p, float).T for p in batch.kind.corners(batch.placed)], axis=1)
    elif batch.is_ball:
        balls = np.concatenate([np.array(batch.centre, float).T, np.array(batch.radius, float)[:, None]], axis=1)
    elif batch.kind.girth is not None:
        rods = rods_around(batch)
    return TreeRows(batch.first_row, *boxes(batch), corners, balls, rods)


# Frames whose volume is this part of the product of their sides, or less, are so skew that rounding matters; nothing is
# excluded by a radius of WIDEST, whose products are finite in single precision.
SKEW, WIDEST = 2.0**-10, 2.0**60


def rods_around(batch: Batch) -> np.ndarray:
    """An infinite cylinder around each row of a batch, as TreeRows has them. Domain: kinds with a girth."""
    inverse, n = batch.placed.inverse, len(batch)
    across = [np.broadcast_to(np.array(v, float), (3, n)) for v in (inverse.x, inverse.y, inverse.z)]
    normals = [np.cross(across[k - 2], across[k - 1], axis=0) for k in range(3)]
    volume = np.einsum("ij,ij->j", across[0], normals[0])
    x, y, z = (normal / volume for normal in normals)
    xx, xy, yy = (np.einsum("ij,ij->j", *pair) for pair in ((x, x), (x, y), (y, y)))
    # The spectral radius of the matrix of these numbers is at most its largest row sum, as in Frame.max_stretch.
    radius = batch.kind.girth * np.sqrt(np.maximum(xx, yy) + np.abs(xy))
    skew = np.abs(volume) <= SKEW * np.prod([np.linalg.norm(v, axis=0) for v in across], axis=0)
    middle = np.broadcast_to(np.array(inverse.o, float), (3, n))
    return np.concatenate([middle, np.where(skew, WIDEST, radius)[None], z / np.linalg.norm(z, axis=0)]).T
