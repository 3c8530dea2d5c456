"""Traversal: runs a query, such as the search for the closest hit, on every row that a ray may hit.

A row is one object in the kernel's tables. A batch is a set of rows of one kind, which share code. The state of a query
is a tuple of arrays with one entry per lane, for example the distance of the closest hit so far.

Guards (culling.py) in single precision select the candidates: rows that a ray may hit. The exact test in double costs
more. So it runs in a branch, and packets of rays without a candidate skip it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Any

import drjit as dr

from visray.accel import policy
from visray.accel.bvh_step import Search
from visray.accel.bvh_walk import walk
from visray.accel.origin import Candidate, RayOrigin
from visray.accel.tree_rays import TreeRays
from visray.batches import Batch
from visray.geometry import gamma
from visray.ray import Ray


@dataclass(frozen=True)
class Query:
    """A query of rays, as functions of its state. The argument c is the Candidate, the row to be tested.

    may_hit(c, *state): returns a mask of the rays that may hit the row, by a test in single.
    intersect(c, *state): returns the state after the exact test of the row, in double.
    t_max(state): returns a distance along each ray. Rows beyond it cannot change the state.
    finished(*state): returns a mask of the rays whose state no other row can change.
    begin(): returns data in double that all exact tests of a ray share. `intersect` then takes it as the argument
        `begun`. None if there is no such data.
    screen(lists, d, first, end, guarded, state): returns (first, end, state): the entries of a list that still need an
        exact test after guards in single precision have been asked, and the state after what they decide. `guarded`
        returns for an entry (mask of the rays that may hit its row, the row's guard, the candidate). None if guards
        decide nothing.
    certain(*begun): returns when a hit that is certain in single precision counts (bvh_step.Certain). None if every row
        that a ray may hit is tested in double.
    """

    may_hit: Callable
    intersect: Callable
    t_max: Callable
    finished: Callable
    begin: Callable | None = None
    screen: Callable | None = None
    certain: Callable | None = None


def traverse(origin: RayOrigin, query: Query, ray: Ray, state: tuple, brute_force: bool) -> tuple:
    """The state of the query after it has run on every row that a ray may hit.

    state: the state before.
    brute_force: whether the exact test runs on all rows, without guards and without the tree.
    """
    pending: list[Candidate] = []
    for number, batch in enumerate(origin.batches):
        n = len(batch)
        if number in (*origin.plan.lists, *origin.plan.tree) and not brute_force:
            continue
        if number in origin.plan.looped or (brute_force and n > policy.MAX_UNROLLED):
            state, pending = _inlined(query, pending, state), []
            state = _looped(origin, query, number, state, brute_force)
            continue
        candidates = [Candidate(number, origin.a.U(i), origin.a.U(batch.first_row + i), True, i) for i in range(n)]
        inlined = n <= policy.MAX_INLINED and not (n > 1 and batch.kind.walks)  # a walk is long to compile
        if origin.shared and inlined and not brute_force:
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
    if not brute_force:
        for number in origin.plan.lists:
            state = _listed(origin, query, number, ray, state)
    if not brute_force and origin.plan.tree:
        state = _in_tree(origin, query, ray, state)
    return state


def _inlined(query: Query, candidates: list[Candidate], state: tuple) -> tuple:
    """The state after the query has run on a few rows. The code of their guards and exact tests is unrolled.

    If the query has a function `begin`, all guards are tested first. Then the data of `begin` is computed only once,
    and only for rays that pass some guard.
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
    """The state after the query has run on at most 32 rows of a batch. The code of their guards is unrolled.

    Each lane stores the rows whose guards its ray passes as the bits of a number. Then a loop runs the exact test on
    these rows. So the exact test is compiled once, and different lanes can test different rows in one iteration.

    first: number of the first row in its batch; bit k stands for the row first + k.
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
    """The state after the query has run on all rows of the batch `number`, in a loop of the kernel."""
    batch = origin.batches[number]
    count = dr.opaque(origin.a.U, len(batch))

    def body(i: Any, *state: Any) -> tuple:
        c = Candidate(number, i, i + batch.first_row, True)
        if brute_force:
            return (i + 1, *query.intersect(c, *state))
        return (i + 1, *_where(query.may_hit(c, *state), state, lambda *s: query.intersect(c, *s), "intersect"))

    i = dr.zeros(origin.a.U, dr.width(state))
    return dr.while_loop((i, *state), lambda i, *_: i < count, body, label="rows")[1:]


def _listed(origin: RayOrigin, query: Query, number: int, ray: Ray, state: tuple) -> tuple:
    """The state after the query has run on the rows of a batch that the ray's cell lists.

    A ray looks for the next row that its guard does not reject, in an inner loop in single precision. Then all rays of
    a packet test their rows exactly at the same time. So a packet runs the exact test as often as the ray with the most
    such rows, and not once for each place in the lists.
    """
    a, lists, batch = origin.a, origin.lists[number], origin.batches[number]
    d32 = a.V32(ray.d) if origin.place is None else origin.place
    first, end = lists.span(a, d32 if origin.place is None else d32.at, ~query.finished(*state))

    def candidate(k: Any, present: Any) -> Candidate:
        row = dr.gather(a.U, lists.entries, k, present)
        return Candidate(number, row, row + batch.first_row, present)

    def next_candidate(k: Any, end: Any, state: tuple) -> Any:
        """The first place from k on whose row may be hit, or `end`."""

        def look(k: Any, looking: Any) -> tuple:
            within = dr.gather(a.F32, lists.near, k, looking) <= farthest
            may_hit = within & query.may_hit(candidate(k, looking), *state)
            k = dr.select(may_hit, k, dr.select(within, k + 1, end))
            return k, ~may_hit & (k < end)

        farthest = origin.farthest(a.F32(query.t_max(state) * (1 + gamma(4, "single"))))
        return dr.while_loop((k, k < end), lambda k, looking: looking, look, label="list")[0]

    if query.screen is not None and lists.screens and not origin.touches_rows(number):

        def guarded(k: Any, looking: Any) -> tuple:
            c = candidate(k, looking)
            return query.may_hit(c, *state), lists.guard(a, c.row), c

        k, end, state = query.screen(lists, d32, first, end, guarded, state)
    else:
        k = next_candidate(first, end, state)

    def test_all(k: Any, *state: Any) -> tuple:
        begun = {"begun": query.begin()} if query.begin else {}

        def step(k: Any, *state: Any) -> tuple:
            state = query.intersect(candidate(k, k < end), *state, **begun)
            k = dr.select(query.finished(*state), end, k + 1)
            return next_candidate(k, end, state), *state

        return dr.while_loop((k, *state), lambda k, *_: k < end, step, label="tests")

    return _where(k < end, (k, *state), test_all, "listed")[1:]


def _in_tree(origin: RayOrigin, query: Query, ray: Ray, state: tuple) -> tuple:
    """The state after the query has run on the rows in the tree that a ray may hit."""

    def candidate(number: int, index: Any, present: Any) -> Candidate:
        return Candidate(number, dr.select(present, index - origin.batches[number].first_row, 0), index, present)

    def accepts(number: int, state: tuple, index: Any, present: Any) -> Any:
        return query.may_hit(candidate(number, index, present), *state)

    def visit(number: int, state: tuple, index: Any, present: Any) -> tuple:
        return query.intersect(candidate(number, index, present), *state, begun=begun)

    # The walk through the tree needs the ray in double as well.
    begun = query.begin() if query.begin else (ray.exact(),)
    rays = TreeRays.along(origin.a, origin.geometry.tree, origin.o, begun[0].d)
    certain = query.certain and query.certain(*begun)
    return walk(rays, state, Search(visit, query.t_max, lambda state: query.finished(*state), accepts, certain))


def _where(mask: Any, state: tuple, change: Callable, label: str) -> tuple:
    """The state, replaced by change(*state) in lanes where `mask` is true.

    Packets of lanes in which the mask is nowhere true skip the computation.

    label: name of the branch in Dr.Jit's messages.
    """
    return dr.if_stmt(state, mask, change, lambda *state: state, label=label)
