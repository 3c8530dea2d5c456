"""The walk of rays through a bounding volume hierarchy (bvh.py).

A lane is one entry of a Dr.Jit array; here it is one ray. A packet is a group of lanes that the processor computes
together.

An inner loop walks through the blocks of the tree in single precision (bvh_step.py). A ray leaves it with a row that
must be tested in double, or because its walk has ended. The packet leaves it when no ray of the packet is left. Then an
outer loop tests the rows of all rays of the packet together, and the rays walk on. Few rows are tested in double: none
that single precision surely excludes, and none behind a certain hit.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr

from visray.accel.bvh_step import DECIDED, ENDED, NO_CANDIDATE, WAITS, Position, Search, Step
from visray.accel.tree_rays import TreeRays
from visray.accel.walk_stack import Stack


def walk(rays: TreeRays, state: tuple, search: Search, counted: bool = False) -> tuple[Any, ...]:
    """The state of a search after each ray has met every row that can change it.

    state: the state before the first row.
    counted: whether three counts per lane are added to the returned state, for studies: visited nodes, visited rows,
        and rows tested in double.

    Shapes: every array of the state has one entry per lane from the start.
    """
    a, u, n = rays.a, rays.a.U, max(rays.lanes, dr.width(state))
    size, none = len(state), dr.full(u, NO_CANDIDATE, n)

    def step(block: Any, limit: Any, *rest: Any) -> tuple:
        stack, rest = Stack.read(u, rest)
        state, counts = rest[:size], rest[size:]
        at = Position(block, limit, none, dr.zeros(a.F32, n), stack)
        at, counts = _blocks(Step(rays, search, state, n), at, counts)
        candidate = at.candidate
        if search.certain is not None and search.certain.decided is not None:
            decided = candidate == DECIDED
            state = tuple(dr.select(decided, x, y) for x, y in zip(search.certain.decided(*state), state))
            candidate = dr.select(decided, NO_CANDIDATE, candidate)
        has_candidate = candidate != NO_CANDIDATE
        state = dr.if_stmt(
            state, has_candidate, lambda *s: _tested(rays, candidate, s, search.visit), _same, label="exact"
        )
        if counted:
            counts = *counts[:2], counts[2] + dr.select(has_candidate, u(1), u(0))
        ended = (at.block == ENDED) | search.done(state)
        block = dr.select(ended, ENDED, at.block & (WAITS - 1))
        return block, rays.at_most(search.reach(state)), *at.stack.arrays, *state, *counts

    root = dr.zeros(u, n) if rays.tree.root is None else rays.tree.root
    block = dr.select(rays.finite & ~search.done(state), root, ENDED)
    limit = rays.at_most(search.reach(state)) + dr.zeros(a.F32, n)
    start = block, limit, *Stack.empty(u, n).arrays, *state, *[dr.zeros(u, n)] * (3 * counted)
    end = dr.while_loop(start, lambda block, *_: block != ENDED, step, label="tree")
    return Stack.read(u, end[2:])[1]


def _blocks(step: Step, at: Position, counts: tuple) -> tuple[Position, tuple]:
    """(where the rays are when all of them wait or have ended, the counts).

    counts: the counts of `walk`, or nothing.
    """
    u = step.a.U
    # Without certain hits of its rows, no step changes these. They are then no state of the loop, because Dr.Jit would
    # trace the whole loop once more to find that out.
    bounds = (at.limit, at.low) if step.search.certain is not None and not step.decides else ()

    def split(rest: tuple) -> tuple[tuple, Stack, tuple]:
        limit, low = rest[: len(bounds)] or (at.limit, at.low)
        return (limit, low), *Stack.read(u, rest[len(bounds) :])

    def body(block: Any, candidate: Any, *rest: Any) -> tuple:
        (limit, low), stack, counts = split(rest)
        at, is_node = step.taken(Position(block, limit, candidate, low, stack))
        if counts:
            nodes, rows = counts
            counts = nodes + dr.select(is_node, u(1), u(0)), rows + dr.select(is_node, u(0), u(1))
        moved = (at.limit, at.low) if bounds else ()
        return at.block, at.candidate, *moved, *at.stack.arrays, *counts

    start = at.block, at.candidate, *bounds, *at.stack.arrays, *counts[:2]
    block, candidate, *rest = dr.while_loop(start, lambda block, *_: block < WAITS, body, label="blocks")
    (limit, low), stack, inner_counts = split(tuple(rest))
    return Position(block, limit, candidate, low, stack), (*inner_counts, *counts[2:])


def _tested(rays: TreeRays, row: Any, state: tuple, visit: Callable) -> tuple:
    """The state after each lane tests one row in double. Each batch has its own branch.

    row: number of the row among all rows of the scene.
    visit: as in Search.
    """
    masks = rays.tree.masks(rays.a, row)
    if len(masks) == 1:
        return visit(masks[0][0], state, row, masks[0][1])
    for batch, in_batch in masks:

        def call(*state: Any, batch: int = batch, in_batch: Any = in_batch) -> tuple:
            return visit(batch, state, row, in_batch)

        state = dr.if_stmt(state, in_batch, call, _same, label="batch")
    return state


def _same(*state: Any) -> tuple:
    return state
