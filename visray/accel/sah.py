"""Binned SAH: builds a hierarchy of boxes with up to four children per node, level by level, in NumPy.

The surface area heuristic (SAH) takes the ratio of surface areas as the probability that a ray which meets a node meets
its child. Every split gives a correct tree, so costs may be rounded. The boxes of nodes are exact: they are least and
greatest corners of the boxes below.

Source: Goldsmith and Salmon 1987; bins: Wald 2007; four children: Wald, Benthin, Boulos 2008.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

DEPTH = 32  # greatest depth of the binary tree; 2^DEPTH boxes fit, wherever they are
WIDTH = 4  # greatest number of children in the final tree
BINS = 16  # bins along each axis; a large node may be split between any two neighbouring bins
SWEPT = 16  # a node of at most this many boxes may be split between any two neighbouring boxes
CHUNK = 1 << 14  # boxes that are swept at once, so that they stay in the processor's cache


@dataclass(frozen=True)
class Hierarchy:
    """A hierarchy over boxes. Nodes are stored level by level; the first node is the root.

    low, high: boxes of the children. Shape: (nodes, children, 3).
    child: number of a node, or -1 - the number of a box, or NONE. Shape: (nodes, children).
    """

    low: np.ndarray
    high: np.ndarray
    child: np.ndarray


NONE = np.iinfo(np.int64).min


def build_binary(low: np.ndarray, high: np.ndarray) -> Hierarchy:
    """The binary hierarchy over n boxes. It has n - 1 nodes.

    Shapes: low, high (3, n), single.
    Domain: n >= 2; finite; low <= high.
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
    """The hierarchy with up to WIDTH children per node: again and again the largest child is replaced by its own two.

    Shapes: as Hierarchy. Where a node has fewer children, the box is (0, 0) and the child NONE.
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
    """Half the surface area of boxes; where `lines` holds, a quarter of the total length of their edges."""
    x, y, z = extents
    return np.where(lines, x + y + z, x * y + y * z + z * x)


class Level:
    """The nodes of one level. Each node holds a range of the boxes.

    low, high: the boxes, ordered by node. Shape: (3, boxes).
    ids: numbers of the boxes. Shape: (boxes).
    head, count: the first box of each node, and its number of boxes. Shape: (nodes).
    owner: the node of each box. Shape: (boxes).
    box_low, box_high: bounding box of each node. Shape: (3, nodes).
    middle: twice the middle of each box. Shape: (3, boxes).
    least, most: range of the middles in each node. Shape: (3, nodes).
    lines: nodes whose box has no area, so that lengths of edges are compared instead. Shape: (nodes).
    """

    def __init__(self, low: np.ndarray, high: np.ndarray, ids: np.ndarray, head: np.ndarray, count: np.ndarray):
        self.low, self.high, self.ids, self.head, self.count = low, high, ids, head, count
        self.box_low = np.minimum.reduceat(low, head, axis=1)
        self.box_high = np.maximum.reduceat(high, head, axis=1)

    @cached_property
    def owner(self) -> np.ndarray:
        return np.repeat(np.arange(len(self.count)), self.count)

    def next_level(self, right: np.ndarray) -> "Level":
        """The next level: the two children of each node with more than one box. right: boxes of the right children."""
        going = (self.count > 1)[self.owner]
        right, count = right[going], self.count[self.count > 1]
        head = np.cumsum(count) - count
        before = np.cumsum(~right) - ~right  # how many boxes before this one in its node go left
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

        room: a node with more boxes than this is cut into equal halves, to bound the depth of the tree.
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
        """Splits nodes between two neighbouring bins; the middle of a box decides its bin.

        Writes the nodes' entries of `right` and `least_cost`.
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
        """Splits nodes of at most `width` boxes between two neighbours along an axis.

        Writes the nodes' entries of `right` and `least_cost`.
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
        """Splits nodes into equal halves, along the axis on which the middles of their boxes differ most."""
        at = np.flatnonzero(nodes[self.owner])
        if not len(at):
            return
        owner = self.owner[at]
        axis = np.argmax(self.most - self.least, axis=0)
        order = np.lexsort((self.middle[axis[owner], at], owner))
        # `at` ascends by owner, so the boxes of a node take the same places in it as in the sorted order.
        right[at[order]] = 2 * (at - self.head[owner]) >= self.count[owner]


class BestCut:
    """For each of k nodes the cheapest cut so far: after column `cut` along `axis`, at `cost`; inf means no cut."""

    def __init__(self, k: int):
        self.cost, self.axis, self.cut = np.full(k, np.inf), np.zeros(k, int), np.zeros(k, int)

    def compare(self, axis: int, low: np.ndarray, high: np.ndarray, count: np.ndarray, lines: np.ndarray) -> None:
        """Compares all cuts along one more axis. Their cost is the measure of each half times its number of boxes.

        low, high: boxes of the columns; overwritten. Shape: (3, columns, nodes).
        count: number of boxes. Shape: (columns, nodes).
        lines: as in Level. Shape: (nodes).
        """
        total, all_low, all_high = count.sum(axis=0), low[:, -1].copy(), high[:, -1].copy()
        last = len(count) - 1
        behind = np.empty((last, len(lines)))
        for j in range(last, 0, -1):  # the half after each cut, from the last column on
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
