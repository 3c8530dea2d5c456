"""A bounding volume hierarchy over the bounded rows of all batches of a scene."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.boxes import DEPTH, LEAF, split
from visray.geometry import UNIT_ROUNDOFF, extent, gamma
from visray.quantities import Arrays
from visray.ray import unit

NOTHING = 0xFFFFFFFF
LEAF_BIT = 1 << 31
FIRST_BITS = 28
VARIANT = set(os.environ.get("TREE", "").split(","))


@dataclass(frozen=True)
class Tree:
    nodes: Any
    rows: Any
    root: Any
    centre: Any
    half: Any
    begins: tuple[Any, ...]
    batches: tuple[int, ...]


def build(a: Arrays, low: np.ndarray, high: np.ndarray, batch: np.ndarray, index: np.ndarray) -> Tree:
    centre = 0.5 * low.min(axis=0) + 0.5 * high.max(axis=0)
    lows, highs = (_outwards(c, centre, out) for c, out in ((low, -1), (high, 1)))
    s = split(lows.T.copy(), highs.T.copy(), batch)
    words = LEAF_BIT | (s.count - 1) << FIRST_BITS | s.first
    child = np.where(s.child >= 0, s.child, words[np.where(s.child >= 0, 0, -1 - s.child)]).astype(np.uint32)
    nodes = np.zeros((len(child), 16), np.float32)
    nodes[:, 0:6] = s.low.reshape(-1, 6)
    nodes[:, 6:12] = s.high.reshape(-1, 6)
    nodes[:, 12:14] = child.view(np.float32)
    if not len(nodes):
        nodes = np.zeros((1, 16), np.float32)
    root = 0 if len(child) else int(words[0])
    batches, starts = np.unique(s.batch, return_index=True)
    begins = s.first[starts][1:]
    half = np.maximum(-lows.min(axis=0), highs.max(axis=0)).astype(float)
    put = lambda kind, x: a.put(kind, np.asarray(x))
    return Tree(
        put(a.F32, nodes.ravel()),
        put(a.U, index[s.order].astype(np.uint32)),
        put(a.U, [root]),
        put(a.W, centre[:, None]),
        put(a.W, half[:, None]),
        tuple(put(a.U, [b]) for b in begins),
        tuple(int(b) for b in batches),
    )


def _outwards(corner: np.ndarray, centre: np.ndarray, out: int) -> np.ndarray:
    exact = corner - centre
    exact = exact + out * gamma(2) * (np.abs(corner) + np.abs(centre))
    return np.nextafter(exact.astype(np.float32), np.float32(out * np.inf))


@dataclass(frozen=True)
class Walk:
    a: Arrays
    tree: Tree
    inverse: Any
    near: Any
    far: Any
    skipped: Any
    slack: Any
    start: Any

    @staticmethod
    def along(a: Arrays, tree: Tree, o: Any, d: Any) -> "Walk":
        d = d if type(d) is a.W else unit(d, a.W)
        to = o - tree.centre
        ball = dr.norm(tree.half)
        skipped = dr.maximum(-dr.dot(to, d) - ball, 0)
        p = to + skipped * d
        double = gamma(64) * (extent(o) + extent(tree.centre) + skipped + ball)
        least = 2.0**-60
        d32 = a.V32(d)
        inverse = dr.rcp(dr.select(dr.abs(d32) < least, dr.copysign(a.V32(least), d32), d32))
        u = UNIT_ROUNDOFF["single"]
        off = a.V32(5 * u * dr.abs(p) + double + 2.0**-58 * (ball + dr.norm(p)))
        middle, off = -a.V32(p) * inverse, off * dr.abs(inverse)
        finite = dr.abs(dr.dot(p, p) + dr.dot(d, d)) < dr.inf
        start = dr.select(finite, tree.root, NOTHING)
        return Walk(a, tree, inverse, middle - off, middle + off, skipped, double, start)

    def limit(self, reach: Any) -> Any:
        return self.a.F32(self.a.D(reach) - self.skipped + self.slack) * (1 + gamma(2, "single"))

    def enters(self, low: list, high: list, limit: Any) -> tuple[Any, Any]:
        near, far = self.a.F32(0), limit
        for axis in range(3):
            ahead = self.inverse[axis] > 0
            first = dr.fma(dr.select(ahead, low[axis], high[axis]), self.inverse[axis], self.near[axis])
            last = dr.fma(dr.select(ahead, high[axis], low[axis]), self.inverse[axis], self.far[axis])
            near, far = dr.select(first > near, first, near), dr.select(last < far, last, far)
        return near <= far * (1 + gamma(12, "single")), near

    def children(self, node: Any, limit: Any) -> tuple:
        a = self.a
        if "x16" in VARIANT:
            f = dr.gather(dr.array_t(dr.zeros(a.F32, 1)) and _x(a), self.tree.nodes, node, shape=(16, dr.width(node)))
        else:
            f = [c for k in range(4) for c in dr.gather(a.Q32, self.tree.nodes, 4 * node + k)]
        left = self.enters(f[0:3], f[6:9], limit)
        right = self.enters(f[3:6], f[9:12], limit)
        words = [dr.reinterpret_array(a.U, f[k]) for k in (12, 13)]
        return (*left, words[0], *right, words[1])

    def through(self, state: tuple, visit: Callable, reach: Callable, done: Callable, count: bool = False) -> tuple:
        a, u, tree = self.a, self.a.U, self.tree
        n = max(dr.width(self.inverse), dr.width(state))
        nothing = u(NOTHING)
        stack = dr.alloc_local(u, DEPTH + 1, value=dr.full(u, NOTHING, n))

        def at_node(word: Any, top: Any, stack: Any, limit: Any) -> tuple:
            in_l, near_l, left, in_r, near_r, right = self.children(word, limit)
            both, swap = in_l & in_r, near_r < near_l
            go = dr.select(in_l & ~(both & swap), left, right)
            top = dr.select(both, top + 1, top)
            stack.write(dr.select(swap, left, right), top, both)
            missed = ~(in_l | in_r)
            word = dr.select(missed, stack.read(top), go)
            top = dr.select(missed, top - 1, top)
            return word, top, stack, limit

        def rows(word: Any, *state: Any) -> tuple:
            first = word & ((1 << FIRST_BITS) - 1)
            more = (word >> FIRST_BITS) & 7
            for k, batch in enumerate(tree.batches):
                inside = dr.full(a.B, True, n)
                if k > 0:
                    inside &= first >= tree.begins[k - 1]
                if k < len(tree.batches) - 1:
                    inside &= first < tree.begins[k]

                def each(*state: Any, batch: int = batch) -> tuple:
                    if "loop" in VARIANT:
                        def step(at, left, *state):
                            row = dr.gather(u, tree.rows, at)
                            state = visit(batch, state, row, True)
                            return (at + 1, dr.select(done(state), 0, left - 1), *state)
                        return dr.while_loop((first + 0, more + 1, *state), lambda at, left, *_: left > 0, step, label="rows")[2:]
                    for slot in range(LEAF):
                        there = more >= slot
                        row = dr.gather(u, tree.rows, first + slot, there)
                        state = visit(batch, state, row, there)
                    return state

                if len(tree.batches) == 1:
                    state = each(*state)
                else:
                    state = dr.if_stmt(state, inside, each, lambda *s: s, label="batch")
            return state

        def at_leaf(word: Any, top: Any, stack: Any, limit: Any, *state: Any) -> tuple:
            if "cursor" in VARIANT:
                first = word & ((1 << FIRST_BITS) - 1)
                more = (word >> FIRST_BITS) & 7
                row = dr.gather(u, tree.rows, first)
                for k, batch in enumerate(tree.batches):
                    inside = dr.full(a.B, True, n)
                    if k > 0:
                        inside &= first >= tree.begins[k - 1]
                    if k < len(tree.batches) - 1:
                        inside &= first < tree.begins[k]
                    call = lambda *s, batch=batch: visit(batch, s, row, inside)
                    state = call(*state) if len(tree.batches) == 1 else dr.if_stmt(state, inside, call, lambda *s: s, label="batch")
                last = more == 0
                nxt = dr.select(last, stack.read(top), word + 1 - (1 << FIRST_BITS))
                top = dr.select(last, top - 1, top)
            else:
                state = rows(word, *state)
                nxt = stack.read(top)
                top = top - 1
            word = dr.select(done(state), nothing, nxt)
            return word, top, stack, self.limit(reach(state)), *state

        def is_leaf(word):
            return (word >> 31) != 0

        def body_if(word: Any, top: Any, stack: Any, limit: Any, *state: Any) -> tuple:
            return dr.if_stmt(
                (word, top, stack, limit, *state), is_leaf(word), at_leaf, lambda w, t, s, l, *st: (*at_node(w, t, s, l), *st), label="node"
            )

        def body_while(word: Any, top: Any, stack: Any, limit: Any, *state: Any) -> tuple:
            word, top, stack, limit = dr.while_loop(
                (word, top, stack, limit), lambda w, *_: ~is_leaf(w), at_node, label="nodes"
            )
            return dr.if_stmt((word, top, stack, limit, *state), word != NOTHING, at_leaf, lambda *s: s, label="leaf")

        begin = dr.select(done(state), nothing, self.start) + dr.zeros(u, n)
        limit = self.limit(reach(state)) + dr.zeros(a.F32, n)
        body = body_while if "while" in VARIANT else body_if
        start = (begin, dr.zeros(u, n), stack, limit, *state)
        return dr.while_loop(start, lambda w, *_: w != NOTHING, body, label="tree")[4:]


def _x(a):
    import drjit.llvm.ad as L
    return L.ArrayXf
