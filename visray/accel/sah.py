"""Binned SAH: splits boxes in two, again and again, level by level, in NumPy.

The surface area heuristic (SAH) estimates the probability that a ray which meets a node also meets a child of the node.
The estimate is the child's surface area divided by the node's. A split is chosen by its estimated cost. Any split gives
a correct tree, so costs may have rounding errors. The boxes of nodes have no rounding errors, because their coordinates
are minima and maxima of the coordinates of the boxes in the node.

Source: Goldsmith and Salmon 1987; bins: Wald 2007.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

DEPTH = 24  # greatest depth of a binary tree, which has room for 2^DEPTH boxes
BINS = 16  # bins along each axis; a large node may be split between any two neighbouring bins
SWEPT = 16  # a node of at most this many boxes may be split between any two boxes that are neighbours along an axis
SWEPT_IN_ORDER = 32  # the same for neighbours in the order of the boxes (Level.weight)
CHUNK = 1 << 14  # number of boxes that _swept works on at once; so many fit in the processor's cache


@dataclass(frozen=True)
class BinaryTrees:
    """Binary trees over boxes. Nodes are stored level by level.

    roots: the root of each tree: the number of a node, or -1 - b if the tree is the box with the number b.
    low, high: corners of the children's boxes. Shape: (nodes, 2, 3).
    child: the children, as in `roots`. Shape: (nodes, 2).
    """

    roots: np.ndarray
    low: np.ndarray
    high: np.ndarray
    child: np.ndarray


def binary_trees(level: "Level") -> BinaryTrees:
    """The binary trees over the nodes of a level. A tree over n boxes has n - 1 nodes."""
    nodes, lows, highs, children = 0, [np.zeros((0, 2, 3), np.float32)], [np.zeros((0, 2, 3), np.float32)], []
    for depth in range(DEPTH + 1):
        inner = level.count > 1
        k = np.count_nonzero(inner)
        children.append(np.where(inner, nodes + np.cumsum(inner) - 1, -1 - level.ids[level.head]))
        if depth:
            lows.append(level.box_low.T.reshape(-1, 2, 3))
            highs.append(level.box_high.T.reshape(-1, 2, 3))
        if not k:
            break
        right = level.right_boxes(1 << max(0, DEPTH - 1 - depth))
        level, nodes = level.next_level(right), nodes + k
    child = np.concatenate([np.zeros(0, np.int64), *children[1:]]).reshape(-1, 2)
    return BinaryTrees(children[0], np.concatenate(lows), np.concatenate(highs), child)


def surface_measure(extents: np.ndarray, lines: np.ndarray | bool) -> np.ndarray:
    """The size of boxes in the cost of a split: half the surface area. Shape: one entry per box.

    extents: lengths of the edges along x, y and z. Shape: (3, boxes).
    lines: mask of the boxes for which the sum of the three edge lengths is taken instead. It marks boxes of nodes that
        have no area, such as boxes along a line; their areas would all be 0.
    """
    x, y, z = extents
    return np.where(lines, x + y + z, x * y + y * z + z * x)


class Level:
    """All nodes of one level of the binary tree. Boxes are ordered by node, so each node has a range of the boxes.

    low, high: corners of the boxes, in single. Shape: (3, boxes).
    ids: numbers of the boxes. Shape: (boxes).
    head: position of the first box of each node. Shape: (nodes).
    count: number of boxes of each node. Shape: (nodes).
    weight: for each box, the number that it counts in the cost of a split, if boxes stand for clusters of boxes; None:
        each box counts 1, boxes are in an order in which neighbours are near each other (morton.py), and a node of few
        boxes is split between two neighbours in that order. Shape: (boxes).
    owner: number of the node that each box belongs to. Shape: (boxes).
    box_low, box_high: corners of each node's bounding box. Shape: (3, nodes).
    middle: sum of both corners of each box, which is twice its centre. Shape: (3, boxes).
    least, most: least and greatest `middle` in each node, per axis. Shape: (3, nodes).
    lines: mask of the nodes whose bounding box has no area; see surface_measure. Shape: (nodes).
    """

    def __init__(
        self,
        low: np.ndarray,
        high: np.ndarray,
        ids: np.ndarray,
        head: np.ndarray,
        count: np.ndarray,
        weight: np.ndarray | None = None,
    ):
        self.low, self.high, self.ids, self.head, self.count, self.weight = low, high, ids, head, count, weight
        self.box_low = np.minimum.reduceat(low, head, axis=1)
        self.box_high = np.maximum.reduceat(high, head, axis=1)

    @cached_property
    def owner(self) -> np.ndarray:
        return np.repeat(np.arange(len(self.count)), self.count)

    def next_level(self, right: np.ndarray) -> "Level":
        """The next level. Its nodes are the two children of each node that has more than one box.

        right: mask of the boxes that go to the right child of their node; the other boxes go to the left child.
        """
        going = (self.count > 1)[self.owner]
        right, count = right[going], self.count[self.count > 1]
        head = np.cumsum(count) - count
        before = np.cumsum(~right) - ~right  # for each box, how many boxes of its node before it go left
        before -= np.repeat(before[head], count)
        left = count - np.add.reduceat(right, head, dtype=np.int64)
        at, start = np.arange(len(right)), np.repeat(head, count)
        order = np.empty(len(right), np.int64)
        order[start + np.where(right, np.repeat(left, count) + at - start - before, before)] = np.flatnonzero(going)
        heads, counts = np.stack([head, head + left], axis=1), np.stack([left, count - left], axis=1)
        moved = (x[..., order] for x in (self.low, self.high, self.ids))
        return Level(*moved, heads.ravel(), counts.ravel(), None if self.weight is None else self.weight[order])

    def right_boxes(self, room: int) -> np.ndarray:
        """Mask of the boxes that go to the right child of their node.

        room: greatest number of boxes of a node whose split is free. A node with more boxes is split into two children
            with equal numbers of boxes, because the depth of the tree is limited.
        """
        self.middle = self.low + self.high
        self.least, self.most = (f.reduceat(self.middle, self.head, axis=1) for f in (np.minimum, np.maximum))
        self.lines = surface_measure(self.box_high - self.box_low, False) == 0
        right, cost = np.zeros(len(self.ids), bool), np.full(len(self.count), np.inf)
        apart = (self.count > 1) & (self.count <= room) & np.any(self.most > self.least, axis=0)
        with np.errstate(all="ignore"):  # empty bins have infinite boxes, whose costs are not used
            most = SWEPT_IN_ORDER if self.weight is None else SWEPT
            self._binned(np.flatnonzero(apart & (self.count > most)), right, cost)
            few = np.flatnonzero(apart & (self.count <= most))
            for width in 1 << np.arange(1, most.bit_length()):
                alike = few[(self.count[few] <= width) & (2 * self.count[few] > width)]
                for k in range(0, len(alike), CHUNK // width):
                    self._swept(alike[k : k + CHUNK // width], width, right, cost)
        self._middle((self.count > 1) & np.isinf(cost), right)
        return right

    def _binned(self, nodes: np.ndarray, right: np.ndarray, least_cost: np.ndarray) -> None:
        """Splits nodes between two neighbouring bins of an axis. A box belongs to the bin in which its centre lies.

        nodes: numbers of the nodes.
        right, least_cost: the results are written to these arrays: the mask of boxes that go right, and the cost of
            each node's split.
        """
        k = len(nodes)
        if not k:
            return
        new = np.full(len(self.count), -1)
        new[nodes] = np.arange(k)
        node = new[self.owner]
        at = slice(None) if k == len(new) else np.flatnonzero(node >= 0)
        node, low, high = node[at], self.low[:, at], self.high[:, at]
        best, bins, weight = BestCut(k), [], None if self.weight is None else self.weight[at]
        for axis in range(3):
            least = self.least[axis, nodes]
            span = self.most[axis, nodes] - least
            scale = np.where(span > 0, BINS / np.where(span > 0, span, 1), 0).astype(np.float32)
            along = (self.middle[axis, at] - least[node]) * scale[node]
            bins.append(np.minimum(along.astype(np.int64), BINS - 1))
            key = bins[-1] * k + node
            count = np.bincount(key, weight, minlength=k * BINS).reshape(BINS, k)
            lows = np.full((3, BINS * k), np.inf, np.float32)
            highs = np.full((3, BINS * k), -np.inf, np.float32)
            for c in range(3):
                np.minimum.at(lows[c], key, low[c])
                np.maximum.at(highs[c], key, high[c])
            best.compare(axis, lows.reshape(3, BINS, k), highs.reshape(3, BINS, k), count, self.lines[nodes])
        right[at] = np.choose(best.axis[node], bins) > best.cut[node]
        least_cost[nodes] = best.cost

    def _swept(self, nodes: np.ndarray, width: int, right: np.ndarray, least_cost: np.ndarray) -> None:
        """Splits nodes between two neighbouring boxes: neighbours along an axis, or in the order of the level.

        nodes: numbers of the nodes; each has at most `width` boxes.
        right, least_cost: as in `_binned`.
        """
        count, column = self.count[nodes], np.arange(width)[:, None]
        present = column < count
        at = self.head[nodes] + np.minimum(column, count - 1)
        best, orders = BestCut(len(nodes)), [at]
        if self.weight is not None:
            by_centre = (np.argsort(np.where(present, x[at], np.inf), axis=0, kind="stable") for x in self.middle)
            orders = [np.take_along_axis(at, along, axis=0) for along in by_centre]
        for number, order in enumerate(orders):
            low, high = self.low[:, order], self.high[:, order]
            low[:, ~present], high[:, ~present] = np.inf, -np.inf
            count = present if self.weight is None else np.where(present, self.weight[order], 0)
            best.compare(number, low, high, count, self.lines[nodes])
        chosen = np.choose(best.axis, orders)
        right[chosen[present]] = (column > best.cut)[present]
        least_cost[nodes] = best.cost

    def _middle(self, nodes: np.ndarray, right: np.ndarray) -> None:
        """Splits nodes into two children with equal numbers of boxes, along the axis on which the centres differ most.

        nodes: mask of the nodes.
        right: as in `_binned`.
        """
        at = np.flatnonzero(nodes[self.owner])
        if not len(at):
            return
        owner = self.owner[at]
        axis = np.argmax(self.most - self.least, axis=0)
        order = np.lexsort((self.middle[axis[owner], at], owner))
        # Both `at` and `at[order]` list the boxes node by node. So their entries k belong to the same node, and at[k]
        # minus the node's head is the rank of the box at[order][k] among the sorted boxes of its node.
        right[at[order]] = 2 * (at - self.head[owner]) >= self.count[owner]


class BestCut:
    """The cheapest split of each of k nodes among the splits compared so far.

    A column is a bin, or a box in sorted order. A cut is a place between two columns.

    cost: cost of the split; inf if there is none. Shape: (k).
    axis: number of the axis along which the node is split, or of the order of boxes. Shape: (k).
    cut: number of the last column to the left of the cut. Shape: (k).
    """

    def __init__(self, k: int):
        self.cost, self.axis, self.cut = np.full(k, np.inf), np.zeros(k, int), np.zeros(k, int)

    def compare(self, axis: int, low: np.ndarray, high: np.ndarray, count: np.ndarray, lines: np.ndarray) -> None:
        """Compares all cuts along one more axis, and keeps those that are cheaper than the best so far.

        The cost of a cut is, summed over both sides, the surface measure of the side times its number of boxes.

        low, high: corners of the columns' bounding boxes; they are overwritten. Shape: (3, columns, nodes).
        count: number of boxes in each column, or the sum of their weights. Shape: (columns, nodes).
        lines: as in Level. Shape: (nodes).
        """
        total, all_low, all_high = count.sum(axis=0), low[:, -1].copy(), high[:, -1].copy()
        last = len(count) - 1
        behind = np.empty((last, len(lines)))
        for j in range(last, 0, -1):  # measures of the right sides, from the last cut to the first
            behind[j - 1] = surface_measure(all_high - all_low, lines)
            np.minimum(all_low, low[:, j - 1], out=all_low)
            np.maximum(all_high, high[:, j - 1], out=all_high)
        left = np.zeros(len(lines), total.dtype)
        for j in range(last):
            if j:
                np.minimum(low[:, j], low[:, j - 1], out=low[:, j])
                np.maximum(high[:, j], high[:, j - 1], out=high[:, j])
            left = left + count[j]
            cost = surface_measure(high[:, j] - low[:, j], lines) * left + behind[j] * (total - left)
            better = (left > 0) & (left < total) & (cost < self.cost)
            self.cost[better], self.axis[better], self.cut[better] = cost[better], axis, j
