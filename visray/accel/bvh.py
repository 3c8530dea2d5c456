"""The bounding volume hierarchy (BVH) over the bounded rows of several batches.

A row is one object in the kernel's tables. A batch is a set of rows of one kind, which share code. A row is bounded if
it has a bounding box.

A node has up to four children. Each child is another node or a single row. So a row is tested only by rays that enter
its own box, and no leaf contains rows of two batches. The boxes of the four children lie side by side in memory, so a
visit to a node reads seven packets of four floats. The tree does not depend on the ray origin.

Boxes are stored in single precision, relative to the middle of the scene, and rounded outwards. Rows are tested in
double precision. No ray misses a box that it meets (bvh_walk.py). So a search in the tree gives the same result as a
loop over all rows, bit for bit (tests/test_tree.py).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from visray.accel.sah import NONE, WIDTH, Hierarchy, build_binary, widen
from visray.geometry import gamma
from visray.quantities import Arrays

# A word is the 32-bit number of a child. It is the number of a node, or the number of a row with the bit ROW set, or
# NOTHING if the child is missing.
ROW = 1 << 31
NOTHING = 0xFFFFFFFF
# The box of a missing child has its low corner at OUT and its high corner at -OUT, so no ray enters it. The number is
# beyond all coordinates of a scene, and its products in single precision are still finite.
OUT = 2.0**60
PACKET = 4  # number of floats that are read at once
STRIDE = 8 * WIDTH  # floats per node: for each child six corner coordinates, one word and one unused float


@dataclass(frozen=True)
class Tree:
    """A BVH in the form in which kernels read it. Units: world.

    nodes: STRIDE single-precision floats per node: low corners of the node's children, their high corners, and their
        words (as bits). Shape: (STRIDE x nodes).
    root: word of the first node; if the tree has one row only, word of that row. Shape: (1).
    centre: the point that the boxes' coordinates are relative to, in double. Shape: (3, 1).
    ball: radius of a ball about `centre` that contains the boxes of all rows. Shape: (1).
    size: bound on |centre|. Shape: (1).
    begins: for each batch in the tree except the first, the lowest number of its rows. The rows of one batch have
        consecutive numbers. Shape: (1) each.
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

    low, high: corners of the rows' boxes in world space, in double. Shape: (n, 3).
    batch: number of each row's batch. Shape: (n).
    index: number of each row among all rows of the scene. Shape: (n).

    Domain: n >= 1. Corners are finite and their coordinates at most 1e9 in size; low <= high. An index is below
    2^31 - 1. All rows of a batch have greater indices than the rows of batches with lower numbers.
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
    """The corners minus the centre, in single precision. They are rounded upwards if `out` is 1, downwards if it is -1.

    Shapes: corner (n, 3), centre (3,).
    """
    # The subtraction adds one rounding error, and the addition that compensates for it adds another.
    exact = corner - centre
    exact += out * gamma(2) * np.abs(exact)
    return np.nextafter(exact.astype(np.float32), np.float32(out * np.inf))


def _packed(tree: Hierarchy, index: np.ndarray) -> np.ndarray:
    """The nodes as an array of floats in the layout of Tree.nodes. Shape: (nodes, STRIDE).

    index: number of the row that each box of the hierarchy belongs to. Shape: (boxes).
    """
    n, exists = len(tree.child), (tree.child != NONE)[..., None]
    row = ROW | index[np.where((tree.child < 0) & exists[..., 0], -1 - tree.child, 0)]
    words = np.where(exists[..., 0], np.where(tree.child >= 0, tree.child, row), NOTHING).astype(np.uint32)
    nodes = np.zeros((n, STRIDE), np.float32)
    corners = np.where(exists, tree.low, OUT), np.where(exists, tree.high, -OUT)
    nodes[:, : 6 * WIDTH] = np.concatenate([c.reshape(n, -1) for c in corners], axis=1)
    nodes[:, 6 * WIDTH : 7 * WIDTH] = words.view(np.float32)
    return nodes
