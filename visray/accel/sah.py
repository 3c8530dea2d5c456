"""Binned SAH: how boxes are split into a hierarchy of nodes with up to four children, level by level, in NumPy.

Only where to split is decided here; any split gives a right tree. So costs may round as they like, while the boxes of
nodes, the least and greatest corners of the boxes below them, are exact.

SAH, the surface area heuristic, takes the ratio of their areas for the chance that a ray which meets a node meets a
child. Sources: Goldsmith and Salmon 1987; bins: Wald 2007; four children: Wald, Benthin, Boulos 2008.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

DEPTH = 32  # nodes of two children on a way from the root to a box at most: 2^DEPTH boxes fit, wherever they are
WIDTH = 4  # children a node has at most in the end
BINS = 16  # a large node may be split at as many places along each axis, less one
SWEPT = 16  # a node of so few boxes may be split between any two
CHUNK = 1 << 14  # boxes swept at once: what is read again then stays in the processor's cache


@dataclass(frozen=True)
class Split:
    """A hierarchy over n boxes, level by level; its first node is the root.

    low, high (nodes, children, 3): the children's boxes. child (nodes, children): the number of a node, or -1 - that of
    a box, or NONE.
    """

    low: np.ndarray
    high: np.ndarray
    child: np.ndarray


NONE = np.iinfo(np.int64).min


def split(low: np.ndarray, high: np.ndarray) -> Split:
    """The hierarchy over boxes, n - 1 nodes of two children. Shapes: low, high (3, n) single.
    Domain: n >= 2, finite, low <= high."""
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
        right = level.halves(1 << max(0, DEPTH - 1 - depth))
        level, nodes = level.parted(right), nodes + k
    return Split(np.concatenate(lows), np.concatenate(highs), np.concatenate(children))


def widened(two: Split) -> Split:
    """The hierarchy with up to WIDTH children a node: of a node's children the largest gives way to its own two, again
    and again. Shapes: as Split; where a node has fewer, the box is (0, 0) and the child NONE."""
    child, area = two.child.ravel(), size((two.high - two.low).reshape(-1, 3).T, False)
    area = np.where(child >= 0, area, -1)  # what is no node has no children
    level, nodes, places, children = np.array([0]), 1, [], []
    while len(level):
        place, every = np.full((len(level), WIDTH), -1), np.arange(len(level))
        place[:, 0], place[:, 1] = 2 * level, 2 * level + 1
        for column in range(2, WIDTH):
            largest = np.argmax(np.where(place >= 0, area[place], -1), axis=1)
            opened = place[every, largest]
            rows = every[child[opened] >= 0]
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
    low, high = (np.where(place[..., None] >= 0, x.reshape(-1, 3)[place], 0) for x in (two.low, two.high))
    return Split(low, high, child)


def size(extents: np.ndarray, lines: np.ndarray | bool) -> np.ndarray:
    """Half the area of boxes, or a fourth of the length of all their edges where `lines` says so."""
    x, y, z = extents
    return np.where(lines, x + y + z, x * y + y * z + z * x)


class Level:
    """The nodes of one level: ranges of boxes, `count` each from `head` on.

    low, high (3, boxes), ids (boxes): the boxes in that order, and their numbers. owner (boxes): their nodes.
    box_low, box_high (3, nodes): around a node's boxes. middle (3, boxes): twice the middle of each; least, most (3,
    nodes): theirs. lines (nodes): whether the node's box has no area, so that lengths are compared instead.
    """

    def __init__(self, low: np.ndarray, high: np.ndarray, ids: np.ndarray, head: np.ndarray, count: np.ndarray):
        self.low, self.high, self.ids, self.head, self.count = low, high, ids, head, count
        self.box_low = np.minimum.reduceat(low, head, axis=1)
        self.box_high = np.maximum.reduceat(high, head, axis=1)

    @cached_property
    def owner(self) -> np.ndarray:
        return np.repeat(np.arange(len(self.count)), self.count)

    def parted(self, right: np.ndarray) -> "Level":
        """The next level: both halves of each node that has more than one box; those that go right come second."""
        going = (self.count > 1)[self.owner]
        right, count = right[going], self.count[self.count > 1]
        head = np.cumsum(count) - count
        before = np.cumsum(~right) - ~right  # how many of the same node go left before each
        before -= np.repeat(before[head], count)
        left = count - np.add.reduceat(right, head, dtype=np.int64)
        at, start = np.arange(len(right)), np.repeat(head, count)
        order = np.empty(len(right), np.int64)
        order[start + np.where(right, np.repeat(left, count) + at - start - before, before)] = np.flatnonzero(going)
        heads, counts = np.stack([head, head + left], axis=1), np.stack([left, count - left], axis=1)
        moved = (x[..., order] for x in (self.low, self.high, self.ids))
        return Level(*moved, heads.ravel(), counts.ravel())

    def halves(self, room: int) -> np.ndarray:
        """Which boxes go to the right child of their node. room: a node with more boxes is cut in equal halves, lest
        the tree be too deep."""
        self.middle = self.low + self.high
        self.least, self.most = (f.reduceat(self.middle, self.head, axis=1) for f in (np.minimum, np.maximum))
        self.lines = size(self.box_high - self.box_low, False) == 0
        right, cost = np.zeros(len(self.ids), bool), np.full(len(self.count), np.inf)
        apart = (self.count > 1) & (self.count <= room) & np.any(self.most > self.least, axis=0)
        with np.errstate(all="ignore"):  # empty bins have infinite boxes; what comes of them is not used
            self._binned(np.flatnonzero(apart & (self.count > SWEPT)), right, cost)
            few = np.flatnonzero(apart & (self.count <= SWEPT))
            for width in 1 << np.arange(1, SWEPT.bit_length()):
                alike = few[(self.count[few] <= width) & (2 * self.count[few] > width)]
                for k in range(0, len(alike), CHUNK // width):
                    self._swept(alike[k : k + CHUNK // width], width, right, cost)
        self._middle((self.count > 1) & np.isinf(cost), right)
        return right

    def _binned(self, nodes: np.ndarray, right: np.ndarray, least_cost: np.ndarray) -> None:
        """Splits the nodes between two bins, into which their boxes fall by their middles."""
        k = len(nodes)
        if not k:
            return
        new = np.full(len(self.count), -1)
        new[nodes] = np.arange(k)
        node = new[self.owner]
        at = slice(None) if k == len(new) else np.flatnonzero(node >= 0)
        node, low, high = node[at], self.low[:, at], self.high[:, at]
        best, bins = Cheapest(k), []
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
            best.see(axis, lows.reshape(3, BINS, k), highs.reshape(3, BINS, k), count, self.lines[nodes])
        right[at] = np.choose(best.axis[node], bins) > best.cut[node]
        least_cost[nodes] = best.cost

    def _swept(self, nodes: np.ndarray, width: int, right: np.ndarray, least_cost: np.ndarray) -> None:
        """Splits the nodes, of at most `width` boxes, between any two neighbours along an axis."""
        count, column = self.count[nodes], np.arange(width)[:, None]
        there = column < count
        at = self.head[nodes] + np.minimum(column, count - 1)
        best, orders = Cheapest(len(nodes)), []
        for axis in range(3):
            along = np.argsort(np.where(there, self.middle[axis, at], np.inf), axis=0, kind="stable")
            orders.append(np.take_along_axis(at, along, axis=0))
            low, high = self.low[:, orders[-1]], self.high[:, orders[-1]]
            low[:, ~there], high[:, ~there] = np.inf, -np.inf
            best.see(axis, low, high, there, self.lines[nodes])
        chosen = np.choose(best.axis, orders)
        right[chosen[there]] = (column > best.cut)[there]
        least_cost[nodes] = best.cost

    def _middle(self, nodes: np.ndarray, right: np.ndarray) -> None:
        """Splits the nodes in two equal halves, along the axis on which their middles differ most."""
        at = np.flatnonzero(nodes[self.owner])
        if not len(at):
            return
        owner = self.owner[at]
        axis = np.argmax(self.most - self.least, axis=0)
        order = np.lexsort((self.middle[axis[owner], at], owner))
        # `at` ascends by owner, so a node's boxes take the same places in it as in the sorted order.
        right[at[order]] = 2 * (at - self.head[owner]) >= self.count[owner]


class Cheapest:
    """For each of k nodes the cheapest cut seen so far: behind column `cut` along `axis`, at `cost`; inf: none."""

    def __init__(self, k: int):
        self.cost, self.axis, self.cut = np.full(k, np.inf), np.zeros(k, int), np.zeros(k, int)

    def see(self, axis: int, low: np.ndarray, high: np.ndarray, count: np.ndarray, lines: np.ndarray) -> None:
        """Compares the cuts along one more axis: the sizes of both halves, each times its number of boxes. low, high
        are overwritten. Shapes: low, high (3, columns, nodes), count (columns, nodes), lines (nodes)."""
        total, all_low, all_high = count.sum(axis=0), low[:, -1].copy(), high[:, -1].copy()
        last = len(count) - 1
        behind = np.empty((last, len(lines)))
        for j in range(last, 0, -1):  # what lies behind each cut, from the last column on
            behind[j - 1] = size(all_high - all_low, lines)
            np.minimum(all_low, low[:, j - 1], out=all_low)
            np.maximum(all_high, high[:, j - 1], out=all_high)
        left = np.zeros(len(lines), np.int64)
        for j in range(last):
            if j:
                np.minimum(low[:, j], low[:, j - 1], out=low[:, j])
                np.maximum(high[:, j], high[:, j - 1], out=high[:, j])
            left = left + count[j]
            cost = size(high[:, j] - low[:, j], lines) * left + behind[j] * (total - left)
            better = (left > 0) & (left < total) & (cost < self.cost)
            self.cost[better], self.axis[better], self.cut[better] = cost[better], axis, j
