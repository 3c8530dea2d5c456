"""The blocks of a bounding volume hierarchy: its nodes and its rows, as kernels read them.

A row is one object, or one triangle of a mesh, in the kernel's tables. A block has BLOCK words of 32 bits, which fill
one line of the processor's cache. It is a node of the hierarchy or a single row. A visit of a ray reads one block, and
does not need to know in advance which of the two it is. The children of a node are blocks side by side.

All numbers are in single precision and relative to the centre of the tree. The last word says what a block is:

    NODE      words 0 to 2: low corner of the box around all children; 3 to 5: steps; 6: number of the first child's
              block; 7: number of children; 8 to 10 and 11 to 13: low and high corners of the children's boxes along x,
              y and z, in steps from that corner, one byte for each of the WIDTH children
    TRIANGLE  words 0 to 3, 4 to 7 and 8 to 11: three planes (row_tests.py); 12: number of the row; 13: greatest sum of
              the sizes of a plane's components
    BALL      words 0 to 2: centre; 3: radius; 12: number of the row
    ROD       words 0 to 2: a point of the axis; 3: radius; 4 to 6: unit vector along the axis; 12: number of the row.
              The row lies inside the infinite cylinder of this radius about this axis
    ROW       word 12: number of the row. The row has no test in single precision
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from visray.accel.hierarchy import NONE, WIDTH, Hierarchy

BLOCK = 16
NODE, TRIANGLE, BALL, ROD, ROW = range(5)
CORNER, STEP, FIRST_CHILD, CHILDREN, LOW, HIGH, NUMBER, SLOPE, KIND = 0, 3, 6, 7, 8, 11, 12, 13, 15
STEPS = 255  # greatest number of steps of a corner
# A stack entry has 24 bits for the number of a block (bvh_walk.py).
MOST_BLOCKS = 2**24 - 2
BAND = 1 << 14  # number of nodes or rows that are worked on at once; so many fit in the processor's cache
# A triangle whose height is this part of its longest side, or less, is tested in double at once.
FLATTEST = 2.0**-20
# Greatest size of the components of a plane. Products of such numbers are finite in single precision.
STEEPEST = 2.0**60


@dataclass(frozen=True)
class TreeRows:
    """Rows of one batch for the tree. Units: world.

    first: number of the first row among all rows of the scene; the others follow.
    low, high: corners of their boxes, in double. Shape: (rows, 3).
    corners: the corners of each row, if the rows are triangles; else None. Shape: (rows, 3, 3), corner by corner.
    balls: centre and radius of each row, if the rows are balls; else None. Shape: (rows, 4).
    rods: point, radius and unit direction of an infinite cylinder around each row; else None. Shape: (rows, 7).
    """

    first: int
    low: np.ndarray
    high: np.ndarray
    corners: np.ndarray | None = None
    balls: np.ndarray | None = None
    rods: np.ndarray | None = None

    @property
    def block_kind(self) -> int:
        """TRIANGLE, BALL, ROD or ROW."""
        data = ((TRIANGLE, self.corners), (BALL, self.balls), (ROD, self.rods))
        return next((kind for kind, values in data if values is not None), ROW)


def packed(tree: Hierarchy | None, batches: Sequence[TreeRows], centre: np.ndarray) -> np.ndarray:
    """All blocks of a hierarchy. The first block is its root. Shape: (blocks, BLOCK).

    tree: hierarchy over the boxes of all rows, batch after batch; None if there is only one row.
    centre: the point that coordinates are relative to. Shape: (3).

    Each node is followed by the blocks of its children, then by all blocks below its first child, and so on. So blocks
    that a ray visits one after the other are near each other in memory.
    """
    if tree is None:
        blocks = np.zeros((1, BLOCK), np.float32)
        block_of_row = np.array([0])
    else:
        first = _first_children(tree)
        exists, count = tree.child != NONE, (tree.child != NONE).sum(axis=1)
        blocks = np.zeros((1 + count.sum(), BLOCK), np.float32)
        block_of_child = first[:, None] + np.arange(WIDTH)
        is_row = exists & (tree.child < 0)
        block_of_node = np.zeros(len(count), np.int64)
        block_of_node[tree.child[exists & ~is_row]] = block_of_child[exists & ~is_row]
        _in_bands(len(count), lambda band: _write_nodes(blocks, block_of_node, tree, first, count, band))
        block_of_row = np.empty(np.count_nonzero(is_row), np.int64)
        block_of_row[-1 - tree.child[is_row]] = block_of_child[is_row]
    start = 0
    for batch in batches:
        at, start = block_of_row[start : start + len(batch.low)], start + len(batch.low)
        _in_bands(len(at), lambda band, at=at, batch=batch: _write_rows(blocks, at, batch, centre, band))
    return blocks


def moved_blocks(blocks: np.ndarray, first_block: int, first_row: int) -> np.ndarray:
    """A copy of the blocks of a tree, as a part of the blocks of several trees.

    first_block, first_row: numbers that are added to the numbers of blocks and of rows.
    """
    moved = blocks.copy()
    words = moved.view(np.uint32)
    is_node = words[:, KIND] == NODE
    words[is_node, FIRST_CHILD] += np.uint32(first_block)
    words[~is_node, NUMBER] += np.uint32(first_row)
    return moved


def _in_bands(n: int, work: Callable[[slice], None]) -> None:
    """Calls `work` for slices of n entries, in several threads."""
    with ThreadPoolExecutor() as pool:
        for _ in pool.map(work, (slice(k, k + BAND) for k in range(0, n, BAND))):
            pass


def _first_children(tree: Hierarchy) -> np.ndarray:
    """The number of the block of each node's first child. Shape: (nodes)."""
    exists, is_node = tree.child != NONE, tree.child >= 0
    level, levels = np.array([0]), []
    while len(level):
        levels.append(level)
        level = tree.child[level][is_node[level]]
    below = exists.sum(axis=1)  # number of blocks below each node
    for level in reversed(levels):
        below[level] += np.where(is_node[level], below[np.where(is_node[level], tree.child[level], 0)], 0).sum(axis=1)
    first = np.empty(len(exists), np.int64)
    first[0] = 1
    for level in levels:
        inner = is_node[level]
        sizes = np.where(inner, below[np.where(inner, tree.child[level], 0)], 0)
        starts = (first[level] + exists[level].sum(axis=1))[:, None] + np.cumsum(sizes, axis=1) - sizes
        first[tree.child[level][inner]] = starts[inner]
    return first


def _write_nodes(
    blocks: np.ndarray, at: np.ndarray, tree: Hierarchy, first: np.ndarray, count: np.ndarray, band: slice
) -> None:
    """Writes the nodes of a band to their blocks.

    at: number of each node's block.
    first, count: number of the block of each node's first child, and number of its children.

    The boxes in steps contain the true boxes, except for the rounding of the sum in double.
    """
    at, exists, words = at[band], tree.child[band] != NONE, blocks.view(np.uint32)
    words[at, KIND], words[at, FIRST_CHILD], words[at, CHILDREN] = NODE, first[band], count[band]
    for axis in range(3):
        low, high = tree.low[band, :, axis].astype(float), tree.high[band, :, axis].astype(float)
        low[~exists], high[~exists] = np.inf, -np.inf
        corner = low.min(axis=1)
        extent = high.max(axis=1) - corner
        step = np.nextafter((extent / STEPS).astype(np.float32), np.float32(np.inf)).astype(float)
        blocks[at, CORNER + axis], blocks[at, STEP + axis] = corner, step
        # Missing children have no box: the node says how many children it has.
        lows = np.where(exists, np.floor((low - corner[:, None]) / step[:, None]), 0)
        lows -= corner[:, None] + lows * step[:, None] > low
        highs = np.where(exists, np.ceil((high - corner[:, None]) / step[:, None]), 0)
        highs += corner[:, None] + highs * step[:, None] < high
        for word, steps in ((LOW, lows), (HIGH, highs)):
            words[at, word + axis] = steps.clip(0, STEPS).astype(np.uint8).view(np.uint32)[:, 0]


def _write_rows(blocks: np.ndarray, at: np.ndarray, rows: TreeRows, centre: np.ndarray, band: slice) -> None:
    """Writes the rows of a band of one batch to their blocks.

    at: number of each row's block.
    """
    words, at = blocks.view(np.uint32), at[band]
    words[at, KIND], words[at, NUMBER] = rows.block_kind, rows.first + band.start + np.arange(len(at))
    if rows.corners is not None:
        blocks[at, :12], blocks[at, SLOPE] = triangle_planes(rows.corners[band], centre)
    elif rows.balls is not None:
        blocks[at, 0:3], blocks[at, 3] = rows.balls[band, :3] - centre, rows.balls[band, 3]
    elif rows.rods is not None:
        blocks[at, 0:3], blocks[at, 3:7] = rows.rods[band, :3] - centre, rows.rods[band, 3:]


def triangle_planes(corners: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(planes, greatest sum of the sizes of a plane's components) of triangles. Shapes: (n, 12), (n).

    A plane is a normal n and a number c. The first plane has n . p + c equal to the height of the point p above the
    triangle. The second and the third give the weights of the corners b and c of a point of the triangle: 1 at their
    own corner, and 0 at both others. In triangles that are nearly a line, all numbers are 0.

    corners: as in TreeRows.
    centre: the point that the result is relative to.
    """
    a = corners[:, 0]
    ab, ac = corners[:, 1] - a, corners[:, 2] - a
    normal = np.cross(ab, ac)
    squared = np.einsum("ij,ij->i", normal, normal)
    longest = np.maximum(np.einsum("ij,ij->i", ab, ab), np.einsum("ij,ij->i", ac, ac))
    with np.errstate(all="ignore"):
        inverse = (1 / squared)[:, None]
        normals = np.stack(
            [normal * np.sqrt(inverse), np.cross(ac, normal) * inverse, np.cross(normal, ab) * inverse], 1
        )
        offsets = -np.einsum("ijk,ik->ij", normals, a - centre)
        slope = np.maximum(
            np.abs(normals[:, 1:]).sum(axis=2).max(axis=1), np.abs(normals[:, 1] + normals[:, 2]).sum(axis=1)
        )
        # |normal| is the height times the side.
        usable = (np.sqrt(squared) > FLATTEST * longest) & (slope < STEEPEST)
    planes = np.concatenate([normals, offsets[..., None]], axis=2).reshape(-1, 12)
    return np.where(usable[:, None], planes, 0), np.where(usable, slope, 0)
