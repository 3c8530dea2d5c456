"""Binned SAH: builds a hierarchy of boxes with up to four children per node, level by level, in NumPy.

The surface area heuristic (SAH) estimates the probability that a ray which meets a node also meets a child of the node.
The estimate is the child's surface area divided by the node's. A split is chosen by its estimated cost. Any split gives
a correct tree, so costs may have rounding errors. The boxes of nodes have no rounding errors, because their coordinates
are minima and maxima of the coordinates of the boxes in the node.

Source: Goldsmith and Salmon 1987; bins: Wald 2007; four children: Wald, Benthin, Boulos 2008.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

DEPTH = 32  # greatest depth of the binary tree, which has room for 2^DEPTH boxes
WIDTH = 4  # greatest number of children in the final tree
BINS = 16  # bins along each axis; a large node may be split between any two neighbouring bins
SWEPT = 16  # a node of at most this many boxes may be split between any two neighbouring boxes
CHUNK = 1 << 14  # number of boxes that _swept works on at once; so many fit in the processor's cache


@dataclass(frozen=True)
class Hierarchy:
    """A hierarchy over boxes. Nodes are stored level by level; the first node is the root.

    low, high: corners of the children's boxes. Shape: (nodes, children, 3).
    child: the children. A child that is a node has that node's number. A child that is the box with the number b has
        the value -1 - b. A missing child has the value NONE. Shape: (nodes, children).
    """

    low: np.ndarray
    high: np.ndarray
    child: np.ndarray


NONE = np.iinfo(np.int64).min


def build_binary(low: np.ndarray, high: np.ndarray) -> Hierarchy:
    """The binary hierarchy over n boxes. It has n - 1 nodes.

    low, high: corners of the boxes, in single. Shape: (3, n).

    Domain: n >= 2; the corners are finite; low <= high.
    """
    n = low.shape[1]
    level, nodes = Level(low, high, np.arange(n), np.array([0]), np.array([n])), 0
    lows, highs, children = [], [], []
    for depth in range(DEPTH + 1):
        inner = level.count > 1
        k = np.count_nonzero(inner)
        if depth:
            number = np.where(inner, nodes + np.cumsum(inner) - 1, -1 - level.ids[level.head])
            children.append(number.reshape(-1, 2))
            lows.append(level.box_low.T.reshape(-1, 2, 3))
            highs.append(level.box_high.T.reshape(-1, 2, 3))
        if not k:
            break
        right = level.right_boxes(1 << max(0, DEPTH - 1 - depth))
        level, nodes = level.next_level(right), nodes + k
    return Hierarchy(np.concatenate(lows), np.concatenate(highs), np.concatenate(children))


def widen(binary: Hierarchy) -> Hierarchy:
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

    low, high: corners of the boxes. Shape: (3, boxes).
    ids: numbers of the boxes. Shape: (boxes).
    head: position of the first box of each node. Shape: (nodes).
    count: number of boxes of each node. Shape: (nodes).
    owner: number of the node that each box belongs to. Shape: (boxes).
    box_low, box_high: corners of each node's bounding box. Shape: (3, nodes).
    middle: sum of both corners of each box, which is twice its centre. Shape: (3, boxes).
    least, most: least and greatest `middle` in each node, per axis. Shape: (3, nodes).
    lines: mask of the nodes whose bounding box has no area; see surface_measure. Shape: (nodes).
    """

    def __init__(self, low: np.ndarray, high: np.ndarray, ids: np.ndarray, head: np.ndarray, count: np.ndarray):
        self.low, self.high, self.ids, self.head, self.count = low, high, ids, head, count
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
        return Level(*moved, heads.ravel(), counts.ravel())

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
            self._binned(np.flatnonzero(apart & (self.count > SWEPT)), right, cost)
            few = np.flatnonzero(apart & (self.count <= SWEPT))
            for width in 1 << np.arange(1, SWEPT.bit_length()):
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
        best, bins = BestCut(k), []
        for axis in range(3):
            least = self.least[axis, nodes]
            span = self.most[axis, nodes] - least
            scale = np.where(span > 0, BINS / np.where(span > 0, span, 1), 0).astype(np.float32)
            along = (self.middle[axis, at] - least[node]) * scale[node]
            bins.append(np.minimum(along.astype(np.int64), BINS - 1))
            key = bins[-1] * k + node
            count = np.bincount(key, minlength=k * BINS).reshape(BINS, k)
            lows = np.full((3, BINS * k), np.inf, np.float32)
            highs = np.full((3, BINS * k), -np.inf, np.float32)
            for c in range(3):
                np.minimum.at(lows[c], key, low[c])
                np.maximum.at(highs[c], key, high[c])
            best.compare(axis, lows.reshape(3, BINS, k), highs.reshape(3, BINS, k), count, self.lines[nodes])
        right[at] = np.choose(best.axis[node], bins) > best.cut[node]
        least_cost[nodes] = best.cost

    def _swept(self, nodes: np.ndarray, width: int, right: np.ndarray, least_cost: np.ndarray) -> None:
        """Splits nodes between two boxes that are neighbours when the boxes are sorted along an axis.

        nodes: numbers of the nodes; each has at most `width` boxes.
        right, least_cost: as in `_binned`.
        """
        count, column = self.count[nodes], np.arange(width)[:, None]
        present = column < count
        at = self.head[nodes] + np.minimum(column, count - 1)
        best, orders = BestCut(len(nodes)), []
        for axis in range(3):
            along = np.argsort(np.where(present, self.middle[axis, at], np.inf), axis=0, kind="stable")
            orders.append(np.take_along_axis(at, along, axis=0))
            low, high = self.low[:, orders[-1]], self.high[:, orders[-1]]
            low[:, ~present], high[:, ~present] = np.inf, -np.inf
            best.compare(axis, low, high, present, self.lines[nodes])
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
    axis: axis along which the node is split. Shape: (k).
    cut: number of the last column to the left of the cut. Shape: (k).
    """

    def __init__(self, k: int):
        self.cost, self.axis, self.cut = np.full(k, np.inf), np.zeros(k, int), np.zeros(k, int)

    def compare(self, axis: int, low: np.ndarray, high: np.ndarray, count: np.ndarray, lines: np.ndarray) -> None:
        """Compares all cuts along one more axis, and keeps those that are cheaper than the best so far.

        The cost of a cut is, summed over both sides, the surface measure of the side times its number of boxes.

        low, high: corners of the columns' bounding boxes; they are overwritten. Shape: (3, columns, nodes).
        count: number of boxes in each column. Shape: (columns, nodes).
        lines: as in Level. Shape: (nodes).
        """
        total, all_low, all_high = count.sum(axis=0), low[:, -1].copy(), high[:, -1].copy()
        last = len(count) - 1
        behind = np.empty((last, len(lines)))
        for j in range(last, 0, -1):  # measures of the right sides, from the last cut to the first
            behind[j - 1] = surface_measure(all_high - all_low, lines)
            np.minimum(all_low, low[:, j - 1], out=all_low)
            np.maximum(all_high, high[:, j - 1], out=all_high)
        left = np.zeros(len(lines), np.int64)
        for j in range(last):
            if j:
                np.minimum(low[:, j], low[:, j - 1], out=low[:, j])
                np.maximum(high[:, j], high[:, j - 1], out=high[:, j])
            left = left + count[j]
            cost = surface_measure(high[:, j] - low[:, j], lines) * left + behind[j] * (total - left)
            better = (left > 0) & (left < total) & (cost < self.cost)
            self.cost[better], self.axis[better], self.cut[better] = cost[better], axis, j
