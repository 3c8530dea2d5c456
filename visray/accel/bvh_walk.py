"""The walk of rays through a bounding volume hierarchy.

No ray misses a box that it meets: see `Walk`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel.bvh import NOTHING, PACKET, ROW, STRIDE, Tree
from visray.accel.sah import DEPTH, WIDTH
from visray.geometry import UNIT_ROUNDOFF, gamma, l1_norm
from visray.quantities import Arrays
from visray.ray import unit

# Each node on the way down pushes at most all its other children on the stack. NOTHING lies below them.
STACK = (WIDTH - 1) * DEPTH + 1
# Pairs of children to compare in this order: a sorting network for four entries.
SORTED = ((0, 1), (2, 3), (0, 2), (1, 3), (1, 2))


@dataclass(frozen=True)
class Walk:
    """Rays on their walk through a tree.

    A walk starts at the point p where the ray comes near the tree, at the distance `skipped` from its origin. So single
    precision also suffices for origins that are far away. From p the ray meets the plane x = b at b / d.x - p.x / d.x.

    inverse: 1 / d, single.
    ahead: masks d > 0, one per axis.
    near, far: -p / d minus and plus the margin.
    skipped: distance from the ray origin to p.
    error: error bound of p in double, including that of a kind's test.
    start: the first word.

    Error: with u = 2^-24, p is within `error` of the exact ray in double, and within a further u |p| in single. The
    product p.x / d.x and its sum with the margin add one rounding each. The margin of 5 u |p| + error, divided by
    |d.x|, exceeds all of these; the rest covers its own roundings. The distance b / d.x has three relative errors: two
    from 1 / d.x, by conversion and reciprocal, and one from the sum. `enters` allows for them at both ends.
    Source: Ize 2013.
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
        """The walk of rays from o in direction d.

        d: unit vector in double, or in single and then exactly parallel to the ray.

        Shapes: o one or one per lane; d one per lane.
        Domain: rays that are not finite meet nothing.
        """
        d = d if type(d) is a.W else unit(d, a.W)
        q, ball = o - tree.centre, tree.ball
        # A ray meets no row before it enters the ball around the box of all rows.
        skipped = dr.maximum(-dr.dot(q, d) - ball, 0)
        p = q + skipped * d
        # The test of a kind has an error of gamma(32) times the size of its numbers (culling.point_rounding). That of p
        # is smaller.
        precision = "single" if a.D is a.F32 else "double"
        error = gamma(128, precision) * (l1_norm(o) + tree.size + skipped + ball)
        # A component of d below 2^-60 counts as 2^-60, so that no product is inf times 0. A ray goes no farther than
        # |p| + ball, where this changes it by less than 2 (2^-60) (|p| + ball). The bound l1_norm stands for |p|,
        # because it needs no root.
        least = 2.0**-60
        d32 = a.V32(d)
        inverse = dr.rcp(dr.select(dr.abs(d32) < least, dr.copysign(a.V32(least), d32), d32))
        margin = 5 * UNIT_ROUNDOFF["single"] * dr.abs(p) + error + 2 * least * (l1_norm(p) + ball)
        middle, margin = -a.V32(p) * inverse, a.V32(margin) * dr.abs(inverse)
        start = dr.select(dr.isfinite(dr.squared_norm(p) + dr.squared_norm(d)), tree.root, NOTHING)
        ahead = tuple(x > 0 for x in inverse)
        return Walk(a, tree, inverse, ahead, middle - margin, middle + margin, skipped, error, start)

    def enters(self, low: list, high: list, limit: Any) -> tuple[Any, Any]:
        """Whether rays enter a box before the distance `limit`, and the distance where they do."""
        near, far = self.a.F32(0), limit
        for axis in range(3):
            ahead, inverse = self.ahead[axis], self.inverse[axis]
            first = dr.fma(dr.select(ahead, low[axis], high[axis]), inverse, self.near[axis])
            last = dr.fma(dr.select(ahead, high[axis], low[axis]), inverse, self.far[axis])
            near, far = dr.select(first > near, first, near), dr.select(last < far, last, far)
        return near <= far * (1 + gamma(12, "single")), near

    def traverse(
        self, state: tuple, visit: Callable, reach: Callable, done: Callable, counted: bool = False
    ) -> tuple[Any, ...]:
        """The state after a visit to every row whose box a ray enters. Nearer boxes are mostly visited first.

        visit(batch, state, row, present): the state after a row. batch: a Python number. row: the number among all
            rows. present: mask of the lanes that visit it. The order of rows is not fixed, so of hits at equal distance
            `visit` must prefer the lowest row.
        reach(state): boxes beyond this distance are skipped; single or double.
        done(state): mask of rays that stop.
        counted: adds two counts per lane to the state, of visited nodes and of visited rows; for studies.

        Shapes: every array of the state has one entry per lane from the start.
        """
        a, u = self.a, self.a.U
        n = max(dr.width(self.inverse), dr.width(self.near), dr.width(state))
        counts = (dr.zeros(u, n), dr.zeros(u, n)) if counted else ()
        split_at = len(state)

        def node(word: Any, top: Any, stack: Any, limit: Any, *counts: Any) -> tuple:
            if counted:
                counts = (counts[0] + 1, counts[1])
            first, *farther = self._entered(word, limit)
            for child in reversed(farther):
                entered = child != NOTHING
                top = dr.select(entered, top + 1, top)
                stack.write(child, top, entered)
            nothing = first == NOTHING
            word = dr.select(nothing, stack.read(top), first)
            return word, dr.select(nothing, top - 1, top), stack, limit, *counts

        def row(word: Any, top: Any, stack: Any, limit: Any, *state: Any) -> tuple:
            state, counts = state[:split_at], state[split_at:]
            if counted:
                counts = (counts[0], counts[1] + 1)
            state = self._visit_row(word ^ ROW, state, visit)
            word = dr.select(done(state), NOTHING, stack.read(top))
            return word, top - 1, stack, self._limit(reach(state)), *state, *counts

        def same(*state: Any) -> tuple:
            return state

        def step(word: Any, top: Any, stack: Any, limit: Any, *state: Any) -> tuple:
            state, counts = state[:split_at], state[split_at:]
            # The two branches follow each other, so that a ray which reaches a row visits it in the same iteration.
            word, top, stack, limit, *counts = dr.if_stmt(
                (word, top, stack, limit, *counts), word < ROW, node, same, label="node"
            )
            at_row = (word >= ROW) & (word != NOTHING)
            return dr.if_stmt((word, top, stack, limit, *state, *counts), at_row, row, same, label="row")

        word = dr.select(done(state), NOTHING, self.start) | dr.zeros(u, n)
        stack = dr.alloc_local(u, STACK, value=dr.full(u, NOTHING, n))
        limit = self._limit(reach(state)) + dr.zeros(a.F32, n)
        start = (word, dr.zeros(u, n), stack, limit, *state, *counts)
        return dr.while_loop(start, lambda word, *_: word != NOTHING, step, label="tree")[4:]

    def _limit(self, reach: Any) -> Any:
        """A distance from the ray origin, converted to one from the start of the walk. Single, rounded upwards."""
        a = self.a
        if type(reach) is a.F32:  # it may have been rounded from double
            reach = a.D(reach) * (1 + gamma(2, "single"))
        return a.F32(reach - self.skipped + self.error) * (1 + gamma(2, "single"))

    def _entered(self, node: Any, limit: Any) -> list:
        """Words of the children that rays enter, nearest first, and NOTHING for all others."""
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

    def _visit_row(self, row: Any, state: tuple, visit: Callable) -> tuple:
        """The state after the visit to a row, by the code of the row's batch."""
        batches, begins = self.tree.batches, (None, *self.tree.begins, None)
        for batch, begin, end in zip(batches, begins, begins[1:]):
            in_batch = self.a.B(True)
            if begin is not None:
                in_batch &= row >= begin
            if end is not None:
                in_batch &= row < end

            def call(*state: Any, batch: int = batch, in_batch: Any = in_batch) -> tuple:
                return visit(batch, state, row, in_batch)

            state = (
                call(*state) if len(batches) == 1 else dr.if_stmt(state, in_batch, call, lambda *s: s, label="batch")
            )
        return state
