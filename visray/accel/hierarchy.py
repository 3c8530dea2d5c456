"""The hierarchy of boxes with up to four children per node, in NumPy.

A large set of boxes is cut into clusters of near boxes (morton.py). A binary tree over each cluster, and one over all
clusters, are made by the surface area heuristic (sah.py). The joined binary tree becomes a tree of four children per
node. Source: Wald, Benthin, Boulos 2008.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from visray.accel.morton import clusters
from visray.accel.sah import DEPTH, BinaryTrees, Level, binary_trees, surface_measure

WIDTH = 4  # greatest number of children
MOST_LEVELS = 2 * DEPTH  # greatest number of nodes above a box
FEW = 1 << 15  # up to this number, each box is a cluster
CLUSTER = 32  # greatest number of boxes of a cluster, if there are more boxes
PART = 1 << 17  # number of boxes whose clusters are worked on at once; so many fit in the processor's cache


@dataclass(frozen=True)
class Hierarchy:
    """A hierarchy over boxes. The first node is the root, and nodes come after the nodes above them.

    low, high: corners of the children's boxes. Shape: (nodes, children, 3).
    child: the children. A child that is a node has that node's number. A child that is the box with the number b has
        the value -1 - b. A missing child has the value NONE. Shape: (nodes, children).
    """

    low: np.ndarray
    high: np.ndarray
    child: np.ndarray


NONE = np.iinfo(np.int64).min


def hierarchy(low: np.ndarray, high: np.ndarray) -> Hierarchy:
    """The hierarchy over n boxes.

    low, high: corners of the boxes, in single. Shape: (3, n).

    Domain: n >= 2; the corners are finite; low <= high.
    """
    return widened(binary(low, high))


def binary(low: np.ndarray, high: np.ndarray) -> Hierarchy:
    """The binary hierarchy over boxes: that of `hierarchy` before nodes are merged. It has n - 1 nodes."""
    n = low.shape[1]
    order, head, count = clusters(low, high, 1 if n <= FEW else CLUSTER)
    # Clusters are worked on in parts of about equal numbers of boxes.
    parts = np.searchsorted(head, np.arange(0, n, PART)).tolist()
    spans = [(a, b) for a, b in zip(parts, [*parts[1:], len(head)]) if a < b]

    def part(span: tuple[int, int]) -> tuple[BinaryTrees, np.ndarray, np.ndarray]:
        """(the trees of the clusters from the first to before the second number, corners of the clusters' boxes)."""
        heads, counts = head[slice(*span)], count[slice(*span)]
        ids = order[heads[0] : heads[-1] + counts[-1]]
        level = Level(low[:, ids], high[:, ids], ids, heads - heads[0], counts)
        return binary_trees(level), level.box_low, level.box_high

    with ThreadPoolExecutor() as pool:
        results = list(pool.map(part, spans))
    boxes = (np.concatenate(x, axis=1) for x in list(zip(*results))[1:])
    top = Level(*boxes, np.arange(len(head)), np.array([0]), np.array([len(head)]), count.astype(float))
    return _joined(binary_trees(top) if len(head) > 1 else None, [trees for trees, _, _ in results])


def _joined(top: BinaryTrees | None, parts: list[BinaryTrees]) -> Hierarchy:
    """The tree over clusters, in which each cluster is replaced by its own tree.

    top: the tree over the clusters; None if there is only one.
    parts: the trees over the boxes of the clusters, part by part.
    """
    sizes = [0 if top is None else len(top.child), *(len(x.child) for x in parts)]
    starts = np.cumsum(sizes)
    moved = lambda child, start: np.where(child >= 0, child + start, child)  # noqa: E731 - numbers of nodes after joining
    roots = np.concatenate([moved(x.roots, start) for x, start in zip(parts, starts)])
    children = [moved(x.child, start) for x, start in zip(parts, starts)]
    trees = [*parts]
    if top is not None:
        children.insert(0, np.where(top.child >= 0, top.child, roots[np.where(top.child < 0, -1 - top.child, 0)]))
        trees.insert(0, top)
    low, high = (np.concatenate([getattr(x, name) for x in trees]) for name in ("low", "high"))
    return Hierarchy(low, high, np.concatenate(children))


def widened(binary: Hierarchy) -> Hierarchy:
    """The hierarchy with up to WIDTH children per node, made from a binary hierarchy.

    In each node, the child node with the largest surface area is replaced by its own two children, again and again,
    until the node has WIDTH children or none of them is a node. A missing child has the value NONE, and both corners of
    its box are 0.
    """
    child, area = binary.child.ravel(), surface_measure((binary.high - binary.low).reshape(-1, 3).T, False)
    area = np.where(child >= 0, area, -1)  # a child that is a box cannot be replaced
    level, nodes, places, children = np.array([0]), 1, [], []
    while len(level):
        place, all_rows = np.full((len(level), WIDTH), -1), np.arange(len(level))
        place[:, 0], place[:, 1] = 2 * level, 2 * level + 1
        for column in range(2, WIDTH):
            largest = np.argmax(np.where(place >= 0, area[place], -1), axis=1)
            opened = place[all_rows, largest]
            rows = all_rows[child[opened] >= 0]
            within = 2 * child[opened[rows]]
            place[rows, largest[rows]], place[rows, column] = within, within + 1
        below = np.where(place >= 0, child[place], NONE)
        inner = below >= 0
        level = below[inner]
        below[inner] = nodes + np.arange(len(level))
        nodes += len(level)
        places.append(place)
        children.append(below)
    place, child = np.concatenate(places), np.concatenate(children)
    low, high = (np.where(place[..., None] >= 0, x.reshape(-1, 3)[place], 0) for x in (binary.low, binary.high))
    return Hierarchy(low, high, child)
