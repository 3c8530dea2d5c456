"""The bounding volume hierarchy (BVH) over the bounded rows of all batches.

A node has up to four children. Their boxes lie side by side in memory, so a visit reads eight packets of four floats. A
child is another node or a single row. So a row is tested only by rays that enter its own box, the test of each kind
stands in the kernel once, and no leaf belongs to two batches. The tree does not depend on the ray origin.

Boxes are stored in single, relative to the middle of the scene, and rounded outwards. Rows are tested in double. No ray
misses a box that it meets (bvh_walk.py). So the answer is that of a loop over all rows, bit for bit
(tests/test_tree.py).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from visray.accel.sah import NONE, WIDTH, Hierarchy, build_binary, widen
from visray.geometry import gamma
from visray.quantities import Arrays

# A word describes a child: the number of a node, or the number of a row with this bit set, or NOTHING.
ROW = 1 << 31
NOTHING = 0xFFFFFFFF
# A missing child has a box that is inside out and beyond all coordinates. Its products are still finite.
OUT = 2.0**60
PACKET = 4  # floats per read
STRIDE = 8 * WIDTH  # floats per node: six corner components and one word per child, and as many unused floats as words


@dataclass(frozen=True)
class Tree:
    """A BVH as kernels read it. Units: world.

    nodes: STRIDE floats per node, single: low corners of its children, high corners, and words (as bits).
        Shape: (STRIDE x nodes).
    root: word of the first node, or of the only row. Shape: (1).
    centre: origin of the boxes' coordinates, in double. Shape: (3, 1).
    ball: radius of the ball around the box of all rows. Shape: (1).
    size: bound on |centre|. Shape: (1).
    begins: the least row number of each batch except the first; rows of one batch have consecutive numbers.
        Shape: (1) each.
    batches: numbers of the batches in the tree, ascending.
    """

    nodes: Any
    root: Any
    centre: Any
    ball: Any
    size: Any
    begins: tuple[Any, ...]
    batches: tuple[int, ...]


def build(a: Arrays, low: np.ndarray, high: np.ndarray, batch: np.ndarray, index: np.ndarray) -> Tree:
    """Builds the tree over n rows.

    low, high: boxes in world space, in double. Shape: (n, 3).
    batch, index: number of each row's batch, and the row's number among all rows. Shape: (n).

    Domain: n >= 1; finite; coordinates up to 1e9; low <= high; index below 2^31 - 1, and greater for a batch with a
    greater number.
    """
    low, high, batch, index = (np.asarray(x) for x in (low, high, batch, index))
    centre = 0.5 * low.min(axis=0) + 0.5 * high.max(axis=0)
    lows, highs = outwards(low, centre, -1), outwards(high, centre, 1)
    if len(index) == 1:
        nodes, root = np.zeros((1, STRIDE), np.float32), ROW | int(index[0])
    else:
        nodes, root = _packed(widen(build_binary(lows.T.copy(), highs.T.copy())), index), 0
    batches, first = np.unique(batch, return_inverse=True)
    begins = np.full(len(batches), NOTHING)
    np.minimum.at(begins, first, index)
    half = np.maximum(-lows.min(axis=0), highs.max(axis=0)).astype(float)
    return Tree(
        a.put(a.F32, nodes.ravel()),
        a.put(a.U, np.array([root], np.uint32)),
        a.put(a.W, centre[:, None]),
        a.put(a.D, np.array([np.linalg.norm(half)])),
        a.put(a.D, np.array([np.abs(centre).sum()])),
        tuple(a.put(a.U, begins[k : k + 1].astype(np.uint32)) for k in range(1, len(begins))),
        tuple(int(b) for b in batches),
    )


def outwards(corner: np.ndarray, centre: np.ndarray, out: int) -> np.ndarray:
    """Corners relative to a centre, in single, rounded beyond the exact ones: upwards for out = 1, downwards for -1."""
    # The difference carries one rounding, and so does the addition that compensates for it.
    exact = corner - centre
    exact += out * gamma(2) * np.abs(exact)
    return np.nextafter(exact.astype(np.float32), np.float32(out * np.inf))


def _packed(tree: Hierarchy, index: np.ndarray) -> np.ndarray:
    """Nodes in their memory layout. index: the row of each box. Shapes: index (boxes); result (nodes, STRIDE)."""
    n, exists = len(tree.child), (tree.child != NONE)[..., None]
    row = ROW | index[np.where((tree.child < 0) & exists[..., 0], -1 - tree.child, 0)]
    words = np.where(exists[..., 0], np.where(tree.child >= 0, tree.child, row), NOTHING).astype(np.uint32)
    nodes = np.zeros((n, STRIDE), np.float32)
    corners = np.where(exists, tree.low, OUT), np.where(exists, tree.high, -OUT)
    nodes[:, : 6 * WIDTH] = np.concatenate([c.reshape(n, -1) for c in corners], axis=1)
    nodes[:, 6 * WIDTH : 7 * WIDTH] = words.view(np.float32)
    return nodes
