"""A bounding volume hierarchy over the bounded rows of all batches of a scene.

A node has up to four children, their boxes side by side, so that a visit is eight reads of four neighbours. A child is
another node or one row: a row is asked only by rays that enter its own box, each kind's test stands in the kernel once,
and no leaf is of two batches. Nothing is prepared for an origin.

Boxes are single, relative to the middle of all, and rounded outwards; rows are tested in double. No ray misses a box
that it meets: see `Walk`. So the answer is that of the loop over all rows, bit for bit (tests/test_tree.py).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.sah import DEPTH, NONE, WIDTH, Split, split, widened
from visray.geometry import UNIT_ROUNDOFF, gamma, l1_norm
from visray.quantities import Arrays
from visray.ray import unit

# A word says what a child is: the number of a node, or a row's number with this bit, or nothing.
ROW = 1 << 31
NOTHING = 0xFFFFFFFF
# A child that is not there has its box inside out: beyond all coordinates, but its products are no infinities.
OUT = 2.0**60
PACKET = 4  # floats that are read at once
STRIDE = 8 * WIDTH  # floats a node: six corners' components and a word for each child, and as many unused as words
# Every node on the way down leaves all its other children on the stack; below them is one NOTHING.
STACK = (WIDTH - 1) * DEPTH + 1
# Pairs compared to sort four children.
SORTED = ((0, 1), (2, 3), (0, 2), (1, 3), (1, 2))


@dataclass(frozen=True)
class Tree:
    """A tree in a kernel's memory.

    nodes: single, STRIDE a node: the low corners of its children, the high ones, their words (as bits).
    root: the word of the first node, or of the only row. centre: what boxes are relative to, in double.
    ball: the radius of the ball around the box of all rows. size: a bound of |centre|.
    batches: the numbers of the batches in the tree, ascending.
    begins: the least row number of each batch but the first: rows of a batch are numbered in a row.
    Shapes: nodes (STRIDE x nodes); root, ball, size, each of begins (1); centre (3, 1). Units: of the world.
    """

    nodes: Any
    root: Any
    centre: Any
    ball: Any
    size: Any
    begins: tuple[Any, ...]
    batches: tuple[int, ...]


def build(a: Arrays, low: np.ndarray, high: np.ndarray, batch: np.ndarray, index: np.ndarray) -> Tree:
    """The tree over rows: their boxes in the world, in double, their batches, and their numbers among all rows.

    Shapes: low, high (n, 3); batch, index (n). Domain: n >= 1; finite, up to 1e9, low <= high; index below 2^31 - 1,
    and greater for a batch of a greater number.
    """
    low, high, batch, index = (np.asarray(x) for x in (low, high, batch, index))
    centre = 0.5 * low.min(axis=0) + 0.5 * high.max(axis=0)
    lows, highs = outwards(low, centre, -1), outwards(high, centre, 1)
    if len(index) == 1:
        nodes, root = np.zeros((1, STRIDE), np.float32), ROW | int(index[0])
    else:
        nodes, root = _packed(widened(split(lows.T.copy(), highs.T.copy())), index), 0
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
    """Corners relative to a centre, in single, beyond the exact ones: above them for out = 1, below for -1."""
    # The difference is off by one rounding, and so is what is added for that.
    exact = corner - centre
    exact += out * gamma(2) * np.abs(exact)
    return np.nextafter(exact.astype(np.float32), np.float32(out * np.inf))


def _packed(s: Split, index: np.ndarray) -> np.ndarray:
    """Nodes as they lie in memory. Shapes: index (boxes), the row of each box; result (nodes, STRIDE)."""
    n, there = len(s.child), (s.child != NONE)[..., None]
    row = ROW | index[np.where((s.child < 0) & there[..., 0], -1 - s.child, 0)]
    words = np.where(there[..., 0], np.where(s.child >= 0, s.child, row), NOTHING).astype(np.uint32)
    nodes = np.zeros((n, STRIDE), np.float32)
    corners = np.where(there, s.low, OUT), np.where(there, s.high, -OUT)
    nodes[:, : 6 * WIDTH] = np.concatenate([c.reshape(n, -1) for c in corners], axis=1)
    nodes[:, 6 * WIDTH : 7 * WIDTH] = words.view(np.float32)
    return nodes


@dataclass(frozen=True)
class Walk:
    """Rays on their way through a tree.

    They begin where they come near it, `skipped` from their origins: so single is as good for origins that are far
    away. There a ray is at p, and meets the plane x = b at b / d.x - p.x / d.x.

    Error: off the exact ray are p, in double and with what a kind's test in double is off, by `error`; p in single by
    u |p|, with u = 2^-24; and the product p.x / d.x, and the sum with the margin, by one rounding each. The margin of
    5 u |p| + error, in time over |d.x|, is larger; its own roundings are the rest. Relative errors of the time are two
    of 1 / d.x, by conversion and reciprocal, and one of the sum: `enters` allows for them at both ends (Ize 2013).

    inverse: 1 / d, single. ahead: masks, d > 0. near, far: -p / d less and plus the margin. start: the first word.
    """

    a: Arrays
    tree: Tree
    inverse: Any
    ahead: tuple[Any, Any, Any]
    near: Any
    far: Any
    skipped: Any
    error: Any
    start: Any

    @staticmethod
    def along(a: Arrays, tree: Tree, o: Any, d: Any) -> "Walk":
        """Rays from o in direction d, a unit vector in double, or in single and then exactly parallel to the ray.

        Shapes: o one in all or one a lane, d one a lane. Domain: what is not finite meets nothing.
        """
        d = d if type(d) is a.W else unit(d, a.W)
        q, ball = o - tree.centre, tree.ball
        # Before it comes into the ball around the box of all rows a ray meets none.
        skipped = dr.maximum(-dr.dot(q, d) - ball, 0)
        p = q + skipped * d
        # Kinds are off by gamma(32) of the size of what they compute with (culling.rounding), this by less.
        precision = "single" if a.D is a.F32 else "double"
        error = gamma(128, precision) * (l1_norm(o) + tree.size + skipped + ball)
        # A component below 2^-60 counts as 2^-60, so that no product is inf times 0. A ray goes no further than
        # |p| + ball, and is then off by less than twice that share of it. No root is taken where a bound does.
        least = 2.0**-60
        d32 = a.V32(d)
        inverse = dr.rcp(dr.select(dr.abs(d32) < least, dr.copysign(a.V32(least), d32), d32))
        margin = 5 * UNIT_ROUNDOFF["single"] * dr.abs(p) + error + 2 * least * (l1_norm(p) + ball)
        middle, margin = -a.V32(p) * inverse, a.V32(margin) * dr.abs(inverse)
        start = dr.select(dr.isfinite(dr.squared_norm(p) + dr.squared_norm(d)), tree.root, NOTHING)
        ahead = tuple(x > 0 for x in inverse)
        return Walk(a, tree, inverse, ahead, middle - margin, middle + margin, skipped, error, start)

    def enters(self, low: list, high: list, limit: Any) -> tuple[Any, Any]:
        """Whether rays enter a box before `limit`, and where."""
        near, far = self.a.F32(0), limit
        for axis in range(3):
            ahead, inverse = self.ahead[axis], self.inverse[axis]
            first = dr.fma(dr.select(ahead, low[axis], high[axis]), inverse, self.near[axis])
            last = dr.fma(dr.select(ahead, high[axis], low[axis]), inverse, self.far[axis])
            near, far = dr.select(first > near, first, near), dr.select(last < far, last, far)
        return near <= far * (1 + gamma(12, "single")), near

    def through(
        self, state: tuple, visit: Callable, reach: Callable, done: Callable, counted: bool = False
    ) -> tuple[Any, ...]:
        """`state` after visit(batch, state, row, present) for every row whose box a ray enters before reach(state).

        The nearest box comes first, but not strictly: of hits at one distance the lowest row must win in `visit`. batch
        is a number in Python, row the global one; lanes where `present` is false are not concerned. reach(state): a
        distance, single or double. done(state): rays that go no further. counted: for studies, two counts a lane are
        added to the state: of nodes visited and of rows.
        Shapes: every array of the state is one a lane, from the start.
        """
        a, u = self.a, self.a.U
        n = max(dr.width(self.inverse), dr.width(self.near), dr.width(state))
        counts = (dr.zeros(u, n), dr.zeros(u, n)) if counted else ()
        split_at = len(state)

        def node(word: Any, top: Any, stack: Any, limit: Any, *counts: Any) -> tuple:
            if counted:
                counts = (counts[0] + 1, counts[1])
            first, *others = self._entered(word, limit)
            for other in reversed(others):
                there = other != NOTHING
                top = dr.select(there, top + 1, top)
                stack.write(other, top, there)
            nothing = first == NOTHING
            word = dr.select(nothing, stack.read(top), first)
            return word, dr.select(nothing, top - 1, top), stack, limit, *counts

        def row(word: Any, top: Any, stack: Any, limit: Any, *state: Any) -> tuple:
            state, counts = state[:split_at], state[split_at:]
            if counted:
                counts = (counts[0], counts[1] + 1)
            state = self._asked(word ^ ROW, state, visit)
            word = dr.select(done(state), NOTHING, stack.read(top))
            return word, top - 1, stack, self._limit(reach(state)), *state, *counts

        def same(*state: Any) -> tuple:
            return state

        def step(word: Any, top: Any, stack: Any, limit: Any, *state: Any) -> tuple:
            state, counts = state[:split_at], state[split_at:]
            # One after the other: a ray that comes to a row asks it in the same round.
            word, top, stack, limit, *counts = dr.if_stmt(
                (word, top, stack, limit, *counts), word < ROW, node, same, label="node"
            )
            asks = (word >= ROW) & (word != NOTHING)
            return dr.if_stmt((word, top, stack, limit, *state, *counts), asks, row, same, label="row")

        word = dr.select(done(state), NOTHING, self.start) | dr.zeros(u, n)
        stack = dr.alloc_local(u, STACK, value=dr.full(u, NOTHING, n))
        limit = self._limit(reach(state)) + dr.zeros(a.F32, n)
        start = (word, dr.zeros(u, n), stack, limit, *state, *counts)
        return dr.while_loop(start, lambda word, *_: word != NOTHING, step, label="tree")[4:]

    def _limit(self, reach: Any) -> Any:
        """A distance from the origin as one from where the walk begins, in single, not less."""
        a = self.a
        if type(reach) is a.F32:  # it may be a rounded one
            reach = a.D(reach) * (1 + gamma(2, "single"))
        return a.F32(reach - self.skipped + self.error) * (1 + gamma(2, "single"))

    def _entered(self, node: Any, limit: Any) -> list:
        """The words of the children that rays enter, the nearest first; then NOTHING."""
        packets = STRIDE // PACKET
        f = [x for k in range(packets - 1) for x in dr.gather(self.a.Q32, self.tree.nodes, packets * node + k)]
        children = []
        for k in range(WIDTH):
            low, high = (f[3 * at : 3 * at + 3] for at in (k, k + WIDTH))
            entered, near = self.enters(low, high, limit)
            word = dr.reinterpret_array(self.a.U, f[6 * WIDTH + k])
            children.append((dr.select(entered, near, dr.inf), dr.select(entered, word, NOTHING)))
        for i, j in SORTED:
            (near, word), (far, other) = children[i], children[j]
            swap = far < near
            children[i] = dr.select(swap, far, near), dr.select(swap, other, word)
            children[j] = dr.select(swap, near, far), dr.select(swap, word, other)
        return [word for _, word in children]

    def _asked(self, row: Any, state: tuple, visit: Callable) -> tuple:
        """`state` after the visit of a row, in the code of its batch."""
        batches, begins = self.tree.batches, (None, *self.tree.begins, None)
        for batch, begin, end in zip(batches, begins, begins[1:]):
            here = self.a.B(True)
            if begin is not None:
                here &= row >= begin
            if end is not None:
                here &= row < end

            def call(*state: Any, batch: int = batch, here: Any = here) -> tuple:
                return visit(batch, state, row, here)

            state = call(*state) if len(batches) == 1 else dr.if_stmt(state, here, call, lambda *s: s, label="batch")
        return state
