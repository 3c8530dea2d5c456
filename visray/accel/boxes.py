"""Binned SAH: how boxes are split into a binary hierarchy, level by level, in NumPy.

Only where to split is decided here; any split gives a right tree. So costs may round as they like, while the nodes'
boxes, the least and greatest corners of the boxes below them, are exact.

SAH, the surface area heuristic, takes the ratio of their areas for the chance that a ray which meets a node meets a
child. Source: Goldsmith and Salmon 1987; bins: Wald 2007.
"""

from dataclasses import dataclass

import numpy as np

LEAF = 4  # rows a leaf holds at most
DEPTH = 32  # nodes on a way from the root to a leaf at most: 2^DEPTH rows fit, wherever they are
BINS = 16  # a large node may be split at as many places along each axis, less one
SWEPT = 32  # a node of so few rows may be split between any two
CHUNK = 1 << 15  # rows swept at once: what is read again then stays in the processor's cache
# What a test of a row costs, in visits of a node: decides when a leaf of several rows is cheaper than nodes above them.
ROW = 1.0


@dataclass(frozen=True)
class Split:
    """A hierarchy over n boxes: inner nodes with two children each, and leaves that are ranges of `order`.

    order (n): the boxes' numbers, those of a leaf side by side, and the leaves of a batch, batches ascending.
    low, high (nodes, 2, 3): the children's boxes. child (nodes, 2): the number of an inner node, or -1 - that of a
    leaf. first, count, batch (leaves): a leaf's range, and the batch of its boxes. A single leaf has no node above it.
    """

    order: np.ndarray
    low: np.ndarray
    high: np.ndarray
    child: np.ndarray
    first: np.ndarray
    count: np.ndarray
    batch: np.ndarray


def split(low: np.ndarray, high: np.ndarray, batch: np.ndarray) -> Split:
    """The hierarchy over boxes. Shapes: low, high (3, n) single; batch (n). Domain: n >= 1, finite, low <= high."""
    level = Level(low, high, batch, np.arange(low.shape[1]), np.array([0, low.shape[1]]))
    parent, side, nodes, leaves = np.empty(0, np.int64), np.empty(0, np.int64), 0, 0
    lows, highs, children, ends = [], [], [], []
    for depth in range(DEPTH + 1):
        right, share = level.halves(1 << max(0, DEPTH - 1 - depth))
        leaf = (level.count == 1) | level.pure & (level.count <= LEAF) & (ROW * level.count <= 1 + ROW * share)
        number = np.where(leaf, -leaves - np.cumsum(leaf), nodes + np.cumsum(~leaf) - 1)
        if depth:
            children[-1][parent, side] = number
            lows[-1][parent, side], highs[-1][parent, side] = level.box_low.T, level.box_high.T
        ends.append((level.ids[leaf[level.owner]], level.count[leaf], batch[level.ids[level.head[leaf]]]))
        leaves += leaf.sum()
        if leaf.all():
            break
        inner = ~leaf[level.owner]
        k = np.count_nonzero(~leaf)
        level = level.parted(inner, right[inner], level.count[~leaf])
        parent, side, nodes = np.repeat(np.arange(k), 2), np.tile([0, 1], k), nodes + k
        lows.append(np.empty((k, 2, 3), np.float32))
        highs.append(np.empty((k, 2, 3), np.float32))
        children.append(np.empty((k, 2), np.int64))
    return _joined(lows, highs, children, ends)


def _joined(lows: list, highs: list, children: list, ends: list) -> Split:
    """The levels one after the other, the leaves sorted by batch."""
    ids, count, batch = (np.concatenate(x) for x in zip(*ends))
    by_batch = np.argsort(batch, kind="stable")
    place = np.empty(len(batch), np.int64)
    place[by_batch] = np.arange(len(batch))
    order = ids[np.argsort(np.repeat(place, count), kind="stable")]
    count = count[by_batch]
    child = np.concatenate([np.empty((0, 2), np.int64), *children])
    child[child < 0] = -1 - place[-1 - child[child < 0]]
    none = np.empty((0, 2, 3), np.float32)
    low, high = np.concatenate([none, *lows]), np.concatenate([none, *highs])
    return Split(order, low, high, child, np.cumsum(count) - count, count, batch[by_batch])


def size(extents: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Half the area of boxes, or the length of all their edges over four where `lines` says so."""
    x, y, z = extents
    return np.where(lines, x + y + z, x * y + y * z + z * x)


class Level:
    """The nodes of one level: ranges of `ids` that begin at `head`, `count` boxes each.

    owner: the node of each id. box_low, box_high (3, nodes): around a node's boxes. middle (3, ids): twice the middle
    of each box; least, most (3, nodes): theirs. pure: whether all boxes of a node are of one batch. lines: whether the
    node's box has no area, so that lengths are compared instead.
    """

    def __init__(self, low, high, batch, ids, starts):
        self.low, self.high, self.batch, self.ids = low, high, batch, ids
        self.head, self.count = starts[:-1], np.diff(starts)
        self.owner = np.repeat(np.arange(len(self.count)), self.count)
        lows, highs = low[:, ids], high[:, ids]
        self.box_low = np.minimum.reduceat(lows, self.head, axis=1)
        self.box_high = np.maximum.reduceat(highs, self.head, axis=1)
        self.middle = lows + highs
        self.least, self.most = (f.reduceat(self.middle, self.head, axis=1) for f in (np.minimum, np.maximum))
        of = batch[ids]
        self.pure = np.minimum.reduceat(of, self.head) == np.maximum.reduceat(of, self.head)
        extents = self.box_high - self.box_low
        self.lines = size(extents, False) == 0
        self.whole = size(extents, self.lines)

    def parted(self, inner: np.ndarray, right: np.ndarray, count: np.ndarray) -> "Level":
        """The next level: in the range of each inner node those that go left come first. inner: whether an id goes on;
        right, count: of those that do, and of their nodes."""
        head = np.cumsum(count) - count
        before = np.cumsum(~right) - ~right  # how many of the same node go left before each
        before -= np.repeat(before[head], count)
        left = count - np.add.reduceat(right, head, dtype=np.int64)
        at = np.arange(len(right)) - np.repeat(head, count)
        place = np.repeat(head, count) + np.where(right, np.repeat(left, count) + at - before, before)
        ids = np.empty(len(right), np.int64)
        ids[place] = self.ids[inner]
        starts = np.append(np.stack([head, head + left], axis=1).ravel(), len(ids))
        return Level(self.low, self.high, self.batch, ids, starts)

    def halves(self, room: int) -> tuple[np.ndarray, np.ndarray]:
        """Which ids go to the right child of their node; and how many boxes a ray that meets a node meets on average in
        the children that it meets. room: a node with more boxes is cut in equal halves, lest the tree be too deep."""
        right, share = np.zeros(len(self.ids), bool), np.full(len(self.count), np.inf)
        apart = (self.count > 1) & (self.count <= room) & np.any(self.most > self.least, axis=0)
        with np.errstate(all="ignore"):  # empty bins have infinite boxes; what comes of them is not used
            self._binned(np.flatnonzero(apart & (self.count > SWEPT)), right, share)
            few = np.flatnonzero(apart & (self.count <= SWEPT))
            for width in 1 << np.arange(1, SWEPT.bit_length()):
                alike = few[(self.count[few] <= width) & (2 * self.count[few] > width)]
                for k in range(0, len(alike), CHUNK // width):
                    self._swept(alike[k : k + CHUNK // width], width, right, share)
        self._middle((self.count > 1) & np.isinf(share), right)
        return right, share

    def _binned(self, nodes: np.ndarray, right: np.ndarray, share: np.ndarray) -> None:
        """Splits the nodes between two bins, into which their boxes fall by their middles."""
        if not len(nodes):
            return
        k = len(nodes)
        new = np.full(len(self.count), -1)
        new[nodes] = np.arange(k)
        at = np.flatnonzero(new[self.owner] >= 0)
        node, ids, lines = new[self.owner[at]], self.ids[at], self.lines[nodes, None]
        lows, highs = self.low[:, ids], self.high[:, ids]
        best, axis_of, cut = np.full(k, np.inf), np.zeros(k, int), np.zeros(k, int)
        bins = np.empty((3, len(at)), np.int32)
        for axis in range(3):
            least = self.least[axis, nodes]
            span = self.most[axis, nodes] - least
            scale = np.where(span > 0, BINS / np.where(span > 0, span, 1), 0)
            bins[axis] = np.minimum((self.middle[axis, at] - least[node]) * scale[node], BINS - 1)
            key = node * BINS + bins[axis]
            count = np.bincount(key, minlength=k * BINS).reshape(k, BINS)
            low, high = np.full((3, k * BINS), np.inf, np.float32), np.full((3, k * BINS), -np.inf, np.float32)
            for c in range(3):
                np.minimum.at(low[c], key, lows[c])
                np.maximum.at(high[c], key, highs[c])
            cost = _costs(low.reshape(3, k, BINS), high.reshape(3, k, BINS), count, lines)
            self._keep(cost, axis, best, axis_of, cut)
        right[at] = bins[axis_of[node], np.arange(len(at))] > cut[node]
        share[nodes] = best / self.whole[nodes]

    def _swept(self, nodes: np.ndarray, width: int, right: np.ndarray, share: np.ndarray) -> None:
        """Splits the nodes, of at most `width` boxes, between any two neighbours along an axis."""
        k, column = len(nodes), np.arange(width)
        count = self.count[nodes, None]
        there, lines = column < count, self.lines[nodes, None]
        at = self.head[nodes, None] + np.minimum(column, count - 1)
        best, axis_of, cut = np.full(k, np.inf), np.zeros(k, int), np.zeros(k, int)
        orders = []
        for axis in range(3):
            along = np.argsort(np.where(there, self.middle[axis, at], np.inf), axis=1, kind="stable")
            orders.append(np.take_along_axis(at, along, axis=1))
            ids = self.ids[orders[-1]]
            low, high = np.where(there, self.low[:, ids], np.inf), np.where(there, self.high[:, ids], -np.inf)
            self._keep(_costs(low, high, there, lines), axis, best, axis_of, cut)
        chosen = np.array(orders)[axis_of, np.arange(k)]
        right[chosen[there]] = (column > cut[:, None])[there]
        share[nodes] = best / self.whole[nodes]

    def _keep(self, cost: np.ndarray, axis: int, best: np.ndarray, axis_of: np.ndarray, cut: np.ndarray) -> None:
        """Notes the cheapest place of this axis where it is cheaper than the best so far."""
        place = np.argmin(cost, axis=1)
        cost = np.take_along_axis(cost, place[:, None], axis=1)[:, 0]
        better = cost < best
        best[better], axis_of[better], cut[better] = cost[better], axis, place[better]

    def _middle(self, nodes: np.ndarray, right: np.ndarray) -> None:
        """Splits the nodes in two equal halves, by batch and then along the axis on which their middles differ most."""
        at = np.flatnonzero(nodes[self.owner])
        if not len(at):
            return
        owner = self.owner[at]
        axis = np.argmax(self.most - self.least, axis=0)
        order = np.lexsort((self.middle[axis[owner], at], self.batch[self.ids[at]], owner))
        # `at` is sorted by owner, so a node's ids take the same places in it as in the sorted order.
        rank = at - self.head[owner]
        right[at[order]] = 2 * rank >= self.count[owner]


def _costs(low: np.ndarray, high: np.ndarray, count: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """The size of both halves, each times its number of boxes, for a cut behind each column but the last. inf where a
    half would be empty. Shapes: low, high (3, nodes, columns), count (nodes, columns), lines (nodes, 1)."""
    left = np.cumsum(count, axis=1, dtype=np.int32)[:, :-1]
    rest = count.sum(axis=1, dtype=np.int32)[:, None] - left
    ahead = np.maximum.accumulate(high, axis=2) - np.minimum.accumulate(low, axis=2)
    back = np.maximum.accumulate(high[..., ::-1], axis=2) - np.minimum.accumulate(low[..., ::-1], axis=2)
    cost = size(ahead[..., :-1], lines) * left + size(back[..., -2::-1], lines) * rest
    return np.where((left > 0) & (rest > 0), cost, np.inf)
