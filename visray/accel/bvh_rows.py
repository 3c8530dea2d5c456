"""The rows of a batch, as the bounding volume hierarchy (bvh.py) needs them."""

import numpy as np

from visray.accel.blocks import TreeRows
from visray.batches import Batch, boxes


def tree_rows(batch: Batch) -> TreeRows:
    """The rows of a batch for the tree."""
    corners = balls = None
    if batch.kind.triangular:
        corners = np.stack([np.array(p, float).T for p in batch.kind.corners(batch.placed)], axis=1)
    elif batch.is_ball:
        balls = np.concatenate([np.array(batch.centre, float).T, np.array(batch.radius, float)[:, None]], axis=1)
    return TreeRows(batch.first_row, *boxes(batch), corners, balls)
