"""The bounding volume hierarchy (BVH) over the bounded rows of several batches.

A row is one object, or one triangle of a mesh, in the kernel's tables. A batch is a set of rows of one kind, which
share code. A row is bounded if it has a bounding box.

A node has up to four children. Each child is another node or a single row. So a row is tested only by rays that enter
its own box. A ray that visits a node or a row reads one block of memory (blocks.py). The tree does not depend on the
ray origin.

Boxes are stored in single precision, relative to the middle of the scene, and rounded outwards. Rows are tested in
double precision. No ray misses a box that it meets (bvh_walk.py). So a search in the tree gives the same result as a
loop over all rows, bit for bit (tests/test_tree.py).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from visray.accel.blocks import MOST_BLOCKS, TreeRows, moved_blocks, packed
from visray.accel.hierarchy import hierarchy
from visray.errors import UserError
from visray.geometry import gamma
from visray.quantities import Arrays


@dataclass(frozen=True)
class Tree:
    """A BVH in the form in which kernels read it. Units: world.

    blocks: nodes and rows, the root first. Shape: (BLOCK x blocks).
    centre: the point that the blocks' coordinates are relative to, in double. Shape: (3, 1).
    ball: radius of a ball about `centre` that contains the boxes of all rows. Shape: (1).
    size: bound on |centre|. Shape: (1).
    begins: for each batch in the tree except the first, the lowest number of its rows. The rows of one batch have
        consecutive numbers. Shape: (1) each.
    batches: numbers of the batches in the tree, ascending.
    block_kinds: for each batch, the kind of the blocks of its rows.
    root: number of the block of the root; None if it is the first block.

    Lanes may walk through trees of their own, whose blocks are joined (`joined`). Then centre, ball, size and root have
    one entry per lane.
    """

    blocks: Any
    centre: Any
    ball: Any
    size: Any
    begins: tuple[Any, ...]
    batches: tuple[int, ...]
    block_kinds: tuple[int, ...]
    root: Any = None

    def masks(self, a: Arrays, row: Any) -> list[tuple[int, Any]]:
        """Pairs of a batch of the tree and a mask of the lanes whose row belongs to it.

        row: number of the row among all rows of the scene, in each lane.
        """
        begins, pairs = (None, *self.begins, None), []
        for batch, begin, end in zip(self.batches, begins, begins[1:]):
            in_batch = a.B(True) if begin is None else row >= begin
            pairs.append((batch, in_batch if end is None else in_batch & (row < end)))
        return pairs


def build(a: Arrays, batches: dict[int, TreeRows]) -> Tree:
    """Builds the tree over the rows of some batches.

    batches: the rows, by the number of their batch; the numbers ascend.

    Domain: there is a row; corners are finite and their coordinates at most 1e9 in size; low <= high. All rows of a
    batch have greater numbers than the rows of batches with lower numbers; numbers are below 2^31. Raises UserError if
    there are too many rows.
    """
    plan = planned(list(batches.values()))
    return Tree(
        a.put(a.F32, plan.blocks.ravel()),
        a.put(a.W, plan.centre[:, None]),
        a.put(a.D, np.array([plan.ball])),
        a.put(a.D, np.array([np.abs(plan.centre).sum()])),
        tuple(a.put(a.U, np.array([rows.first], np.uint32)) for rows in list(batches.values())[1:]),
        tuple(batches),
        tuple(rows.block_kind for rows in batches.values()),
    )


@dataclass(frozen=True, eq=False)
class TreePlan:
    """A tree before it becomes arrays of kernels.

    blocks: as in Tree. Shape: (blocks, BLOCK).
    centre, ball: as in Tree.
    """

    blocks: np.ndarray
    centre: np.ndarray
    ball: float


def planned(batches: list[TreeRows]) -> TreePlan:
    """The tree over the rows of some batches. Domain: as in `build`."""
    low, high = (np.concatenate(x) for x in zip(*((rows.low, rows.high) for rows in batches)))
    _check_number(len(low))
    centre = 0.5 * low.min(axis=0) + 0.5 * high.max(axis=0)
    lows, highs = outwards(low, centre, -1).T.copy(), outwards(high, centre, 1).T.copy()
    half = np.maximum(-lows.min(axis=1), highs.max(axis=1)).astype(float)
    tree = hierarchy(lows, highs) if len(low) > 1 else None
    return TreePlan(packed(tree, batches, centre), centre, float(np.linalg.norm(half)))


def joined(plans: list[TreePlan], firsts: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """(the blocks of several trees one after the other, the number of the block of each root). Raises UserError if
    there are too many rows.

    firsts: for each tree, the number that is added to the numbers of its rows.
    """
    sizes = np.array([len(plan.blocks) for plan in plans])
    _check_number(3 * int(sizes.sum()) // 4)
    roots = np.cumsum(sizes) - sizes
    moved = [moved_blocks(plan.blocks, root, first) for plan, root, first in zip(plans, roots.tolist(), firsts)]
    return np.concatenate(moved), roots


def _check_number(rows: int) -> None:
    """Raises UserError if there are too many rows."""
    if 4 * rows > 3 * MOST_BLOCKS:
        raise UserError(f"objects: {rows} objects and triangles are too many; at most {3 * MOST_BLOCKS // 4} fit")


def outwards(corner: np.ndarray, centre: np.ndarray, out: int) -> np.ndarray:
    """The corners minus the centre, in single precision. They are rounded upwards if `out` is 1, downwards if it is -1.

    Shapes: corner (n, 3), centre (3,).
    """
    # The subtraction adds one rounding error, and the addition that compensates for it adds another.
    exact = corner - centre
    exact += out * gamma(2) * np.abs(exact)
    return np.nextafter(exact.astype(np.float32), np.float32(out * np.inf))
