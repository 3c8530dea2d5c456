"""Traversal: a query is put to every row that a ray may hit.

Guards in single precision select the candidates. The exact test in double runs in a branch, for the packets of rays
that need it, because double costs more than single.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Any

import drjit as dr

from visray.accel import policy
from visray.accel.bvh_walk import Walk
from visray.accel.origin import Candidate, RayOrigin
from visray.batches import Batch
from visray.ray import Ray


@dataclass(frozen=True)
class Query:
    """What rays ask of rows, as functions of a state that the answers change.

    may_hit(c, *state): mask of rays that a test in single cannot exclude.
    intersect(c, *state): the state after the exact test of a row.
    t_max(state): rows beyond this distance cannot change the state.
    finished(*state): mask of rays whose state no row can change.
    begin(): data in double, for rays that may hit something. `intersect` takes it as the argument `begun`. None: there
        is no such data.
    """

    may_hit: Callable
    intersect: Callable
    t_max: Callable
    finished: Callable
    begin: Callable | None = None


def traverse(origin: RayOrigin, query: Query, ray: Ray, state: tuple, brute_force: bool) -> tuple:
    """The state after the query is put to every row that a ray may hit. brute_force: to all rows."""
    pending: list[Candidate] = []
    for number, batch in enumerate(origin.batches):
        n = len(batch)
        if number in origin.plan.tree and not brute_force:
            continue
        if number in origin.plan.looped or (brute_force and n > policy.MAX_UNROLLED):
            state, pending = _inlined(query, pending, state), []
            state = _looped(origin, query, number, state, brute_force)
            continue
        candidates = [Candidate(number, origin.a.U(i), origin.a.U(batch.first_row + i), True, i) for i in range(n)]
        if origin.shared and n <= policy.MAX_INLINED and not brute_force:
            pending += candidates
            continue
        state, pending = _inlined(query, pending, state), []
        if brute_force:
            for c in candidates:
                state = query.intersect(c, *state)
        else:
            for first in range(0, n, 32):
                state = _gathered(origin, query, batch, candidates[first : first + 32], first, state)
    state = _inlined(query, pending, state)
    if not brute_force and origin.plan.tree:
        state = _in_tree(origin, query, ray, state)
    return state


def _inlined(query: Query, candidates: list[Candidate], state: tuple) -> tuple:
    """The state after a few rows whose guards and exact tests are both unrolled.

    If the query has `begin`, all guards are tested first, so that its data is computed once for all rows, and only for
    rays that pass some guard.
    """
    if query.begin is None:
        for c in candidates:
            state = _where(query.may_hit(c, *state), state, lambda *s, c=c: query.intersect(c, *s), "intersect")
        return state
    if not candidates:
        return state
    may_hit = [query.may_hit(c, *state) for c in candidates]

    def test_all(*state: Any) -> tuple:
        begun = query.begin()
        for c, passes in zip(candidates, may_hit):
            active = passes & ~query.finished(*state)
            state = _where(active, state, lambda *s, c=c: query.intersect(c, *s, begun=begun), "intersect")
        return state

    return _where(reduce(or_, may_hit), state, test_all, "near any")


def _gathered(
    origin: RayOrigin, query: Query, batch: Batch, candidates: list[Candidate], first: int, state: tuple
) -> tuple:
    """The state after at most 32 rows, from row `first` on, whose guards are unrolled.

    The rows that pass are collected as the bits of a number, and a loop tests them. So the exact test is compiled once,
    and each lane goes on to its own next row.
    """
    u, number = origin.a.U, candidates[0].batch
    bits = dr.zeros(u, dr.width(state))
    for c in candidates:

        def add(bits: Any, c: Candidate = c) -> tuple:
            return (bits | dr.select(query.may_hit(c, *state), u(1 << (c.unrolled - first)), 0),)

        reached = None if origin.may_reach is None else origin.may_reach[number][c.unrolled]
        bits = add(bits)[0] if reached is None else _where(reached, (bits,), add, "may reach")[0]

    def step(bits: Any, *state: Any) -> tuple:
        i = dr.tzcnt(bits) + first
        state = query.intersect(Candidate(number, i, i + batch.first_row, True), *state)
        return (dr.select(query.finished(*state), 0, bits & (bits - 1)), *state)

    return dr.while_loop((bits, *state), lambda bits, *_: bits != 0, step, label="gathered")[1:]


def _looped(origin: RayOrigin, query: Query, number: int, state: tuple, brute_force: bool) -> tuple:
    """The state after all rows of batch `number`, in a loop."""
    batch = origin.batches[number]
    count = dr.opaque(origin.a.U, len(batch))

    def body(i: Any, *state: Any) -> tuple:
        c = Candidate(number, i, i + batch.first_row, True)
        if brute_force:
            return (i + 1, *query.intersect(c, *state))
        return (i + 1, *_where(query.may_hit(c, *state), state, lambda *s: query.intersect(c, *s), "intersect"))

    i = dr.zeros(origin.a.U, dr.width(state))
    return dr.while_loop((i, *state), lambda i, *_: i < count, body, label="rows")[1:]


def _in_tree(origin: RayOrigin, query: Query, ray: Ray, state: tuple) -> tuple:
    """The state after the rows in the tree."""

    def visit(number: int, state: tuple, index: Any, present: Any) -> tuple:
        row = dr.select(present, index - origin.batches[number].first_row, 0)
        c = Candidate(number, row, index, present)
        return _where(query.may_hit(c, *state), state, lambda *s: query.intersect(c, *s, begun=begun), "intersect")

    # The walk through the tree needs the ray in double as well.
    begun = query.begin() if query.begin else (ray.exact(),)
    walk = Walk.along(origin.a, origin.geometry.tree, origin.o, begun[0].d)
    return walk.traverse(state, visit, query.t_max, lambda state: query.finished(*state))


def _where(mask: Any, state: tuple, change: Callable, label: str) -> tuple:
    """change(*state) in lanes where the mask holds. Packets without such a lane skip it."""
    return dr.if_stmt(state, mask, change, lambda *state: state, label=label)
