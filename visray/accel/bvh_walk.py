"""The walk of rays through a bounding volume hierarchy (bvh.py).

A lane is one entry of a Dr.Jit array; here it is one ray. No ray misses a box that it meets: the docstring of `Walk`
has the proof.
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

# Size of the stack. A ray goes on to one child of a node and pushes at most the WIDTH - 1 other children. The lowest
# entry is NOTHING, which ends the walk.
STACK = (WIDTH - 1) * DEPTH + 1
# A sorting network for four children: these pairs are compared and swapped, in this order.
SORTED = ((0, 1), (2, 3), (0, 2), (1, 3), (1, 2))


@dataclass(frozen=True)
class Walk:
    """Rays that walk through a tree. All walks start at points near the tree, even if the ray origins are far away.

    The walk of a ray starts at the point p of the ray, at the distance `skipped` from the ray origin. No part of the
    ray before p is in a box. Coordinates of p are relative to the tree's centre, so single precision suffices for them.
    Counted from p, the ray meets the plane x = b at the distance b / d.x - p.x / d.x.

    inverse: 1 / d, in single.
    ahead: masks of d > 0, one per axis.
    near, far: -p / d, minus and plus an error margin.
    skipped: distance from the ray origin to p.
    error: bound on the error of p in double, and on the error of the exact test of a row.
    start: word of the tree's root; NOTHING in lanes whose ray is not finite.

    Error: let u = 2^-24. In double, p is within `error` of the exact ray. The conversion of p to single adds at most
    u |p|. The product p.x / d.x and its sum with the margin add one rounding each. The margin (5 u |p| + error) / |d.x|
    is greater than all of these errors together, and what is left covers the rounding of the margin. The distance
    b / d.x has three relative errors: two from 1 / d.x (a conversion and a reciprocal) and one from the sum. `enters`
    allows for them at both ends of the interval.
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
        """The walk of rays from the origin o in the direction d.

        d: unit vector, in double or in single. A single-precision d is taken as the ray's direction, and normalised in
            double.

        Shapes: o has one entry, or one entry per lane; d has one entry per lane.
        Domain: a ray with an infinite or NaN component meets no row.
        """
        d = d if type(d) is a.W else unit(d, a.W)
        q, ball = o - tree.centre, tree.ball
        # A ray meets no row before it enters the ball around the box of all rows.
        skipped = dr.maximum(-dr.dot(q, d) - ball, 0)
        p = q + skipped * d
        # The exact test of a row has an error of gamma(32) times the size of its numbers (culling.point_rounding). The
        # error of p is smaller.
        precision = "single" if a.D is a.F32 else "double"
        error = gamma(128, precision) * (l1_norm(o) + tree.size + skipped + ball)
        # A component of d below 2^-60 is replaced by 2^-60, so that no product is inf times 0. Inside the ball around
        # all rows, at distances up to |p| + ball, this moves the ray by less than 2 (2^-60) (|p| + ball). The bound
        # l1_norm(p) replaces |p|, because it needs no square root.
        least = 2.0**-60
        d32 = a.V32(d)
        inverse = dr.rcp(dr.select(dr.abs(d32) < least, dr.copysign(a.V32(least), d32), d32))
        margin = 5 * UNIT_ROUNDOFF["single"] * dr.abs(p) + error + 2 * least * (l1_norm(p) + ball)
        middle, margin = -a.V32(p) * inverse, a.V32(margin) * dr.abs(inverse)
        start = dr.select(dr.isfinite(dr.squared_norm(p) + dr.squared_norm(d)), tree.root, NOTHING)
        ahead = tuple(x > 0 for x in inverse)
        return Walk(a, tree, inverse, ahead, middle - margin, middle + margin, skipped, error, start)

    def enters(self, low: list, high: list, limit: Any) -> tuple[Any, Any]:
        """(whether a ray enters a box before `limit`, the distance where it enters), for each lane.

        Both distances count from the start of the walk; a ray that starts inside the box enters it at 0.

        low, high: coordinates of the box's corners, one array per axis.
        """
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
        """The state (a tuple of arrays) after each ray has visited every row whose box it enters.

        Nearer boxes are usually visited first, but the order of the rows is not fixed. So if two hits have the same
        distance, `visit` must prefer the row with the lower number.

        state: the state before the first visit.
        visit(batch, state, row, present): function that returns the state after the visit to one row. batch: number of
            the row's batch, a Python number. row: number of the row among all rows of the scene. present: mask of the
            lanes that visit a row of this batch.
        reach(state): function that returns a distance from the ray origin, in single or double. Boxes beyond it are
            skipped.
        done(state): function that returns a mask of the rays that stop.
        counted: whether two counts per lane are added to the returned state, for studies: visited nodes, visited rows.

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
            # The branch for rows comes after the branch for nodes, so that a ray whose next word is a row visits this
            # row in the same iteration.
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
        """A distance from the ray origin, converted to a distance from the start of the walk.

        The result is in single, and rounded upwards.
        """
        a = self.a
        if type(reach) is a.F32:  # the distance may have been rounded from double to single
            reach = a.D(reach) * (1 + gamma(2, "single"))
        return a.F32(reach - self.skipped + self.error) * (1 + gamma(2, "single"))

    def _entered(self, node: Any, limit: Any) -> list:
        """WIDTH words: the children of a node that a ray enters, nearest first, and then NOTHING for each other child.

        node: word of the node in each lane.
        limit: distance from the start of the walk beyond which boxes are skipped.
        """
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
        """The state after each lane visits one row. Each batch has its own branch, and a lane takes its row's branch.

        row: number of the row among all rows of the scene.
        visit: as in `traverse`.
        """
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
