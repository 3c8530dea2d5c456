"""What rays can meet, as seen from where they start, and how a query is put to those rows that a ray may meet.

Most rows are far from most rays. A test in single precision against a ball around each row rejects them; its margin is
a bound of its own rounding, so that it never rejects what the exact test in double would accept. The exact test then
runs in a branch, for packets of rays that need it: double costs what single does.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import reduce
from operator import or_
from typing import Any

import drjit as dr
import numpy as np

from visray.accel import policy
from visray.accel.bvh import Tree, Walk, build
from visray.accel.culling import Cone, Ground, Guard, flush, ground, guard, rounding
from visray.batches import Batch, boxes
from visray.pytree import detached, evaluated, leaves, rows
from visray.quantities import Arrays
from visray.ray import KnownEnds, Ray


@dataclass(frozen=True)
class Geometry:
    """All that rays can meet: the batches of a scene, the tree over those rows that are too many to be written out,
    and the setting that says how rows are found."""

    a: Arrays
    batches: tuple[Batch, ...]
    tree: Tree | None
    accelerator: policy.Accelerator

    @staticmethod
    def of(a: Arrays, batches: tuple[Batch, ...], accelerator: policy.Accelerator = "auto") -> "Geometry":
        """The batches with the tree that the policy asks for."""
        geometry = Geometry(a, batches, None, accelerator)
        # What is in the tree for rays that share an origin is in it for all.
        numbers = geometry.plan(shared=False).tree
        if not numbers:
            return geometry
        corners = [boxes(batches[i]) for i in numbers]
        low, high = (np.concatenate(c) for c in zip(*corners))
        index = np.concatenate([batches[i].first_row + np.arange(len(batches[i])) for i in numbers])
        number = np.repeat(numbers, [len(batches[i]) for i in numbers])
        return replace(geometry, tree=evaluated(build(a, low, high, number, index)))

    def plan(self, shared: bool) -> policy.Plan:
        """How rays find rows. shared: they share their origin."""
        sizes = [policy.BatchSize(len(b), b.kind.bounded) for b in self.batches]
        return policy.plan(sizes, self.accelerator, shared)

    @property
    def has_parts(self) -> bool:
        """Whether hits carry parts."""
        return any(b.kind.parts > 1 for b in self.batches)

    @property
    def uses_parts(self) -> bool:
        """Whether a ray's crossings depend on the part that it leaves or ends on."""
        return any(b.kind.uses_part for b in self.batches)


@dataclass(frozen=True)
class Candidate:
    """A row that rays may meet: its batch, its number there and in all; lanes where `present` is false are not
    concerned. written: its number in the batch as Python knows it, where rows are written out one by one."""

    batch: int
    row: Any
    index: Any
    present: Any
    unrolled: int | None = None


@dataclass(frozen=True)
class Query:
    """What a search asks of rows, with a state that the answers change.

    may_hit(c, *state): which rays a test in single cannot rule out; intersect(c, *state): the state after the exact
    answer; t_max(state): no row farther than that is of interest; finished(*state): none at all. begin(): what
    intersect needs to know in double about rays that may meet anything, and takes as `begun`; None: nothing more than
    it is given.
    """

    may_hit: Callable
    intersect: Callable
    t_max: Callable
    finished: Callable
    begin: Callable | None = None


def _touching(batch: Batch, o: Any) -> tuple[Any, Any] | None:
    """Which rows of a batch the origin lies on to within rounding, with their gradients there; None if it is on none.

    From such a row the crossing at the origin is not seen again, whatever sign rounding gives its distance. That there
    is one is structure: a camera or light that comes to lie on a surface compiles anew.
    """
    f, g = batch.kind.surface_at(batch.placed, o)
    on = flush(batch, f, g, o) & batch.kind.has_normal(batch.placed, o)
    return (on, g) if np.any(np.array(on)) else None


class RayOrigin:
    """All batches as seen from where rays start; where all rays share that, it is computed once for all rows that are
    written out, and kernels read it.

    shared: whether they do; None: as the origin has one entry or one a lane.
    """

    def __init__(self, geometry: Geometry, o: Any, shared: bool | None = None):
        self.a, self.o, self.geometry = geometry.a, dr.detach(o), geometry
        self.batches = detached(geometry.batches)
        self.shared = dr.width(o) == 1 if shared is None else shared
        self.plan = geometry.plan(self.shared)
        written = [i in self.plan.unrolled for i in range(len(self.batches))]
        self.may_reach: list[list[Any]] | None = None
        if self.shared:
            self.seen = tuple(
                b.kind.seen(b.placed, self.o) if there else None for b, there in zip(self.batches, written)
            )
            self.guards = tuple(self._guard(b) if there else None for b, there in zip(self.batches, written))
            # A loop reads a guard as a packet of four neighbours, which is faster than four reads.
            self.packets = tuple(g and dr.ravel(self.a.Q32(*leaves(g)[0], leaves(g)[1])) for g in self.guards)
            dr.eval(self.seen, self.guards, self.packets)
            self.touching = tuple(_touching(b, self.o) for b in self.batches)
        else:
            # Here and not where they are used: many rays from one point, in a loop, then share them.
            self.near = [
                [self._guard(b.rows_at(self.a.U(i))) for i in range(len(b) if there else 0)]
                for b, there in zip(self.batches, written)
            ]

    def _guard(self, batch: Batch) -> Guard | Ground:
        """The guard of one row, or of all rows of a batch."""
        if batch.radius is None:
            return ground(self.a, batch, self.o)
        return guard(self.a, batch.centre, batch.radius, self.o)

    def toward(self, cone: Cone) -> "RayOrigin":
        """The same origin for rays in a cone: of the rows that are written out, those that none can meet are marked
        before the rays are drawn."""
        origin = copy(self)
        origin.may_reach = [[g.near(cone) for g in near] for near in self.near]
        return origin

    def seen_row(self, c: Candidate) -> Any:
        """A row as its kind sees it from the origin."""
        if self.shared and self.seen[c.batch] is not None:
            return rows(self.seen[c.batch], c.row)
        batch = self.batches[c.batch]
        return batch.kind.seen(rows(batch.placed, c.row), self.o)

    def guard(self, c: Candidate) -> Guard | Ground:
        """The guard of a row."""
        if not self.shared:
            return self._guard(self._row(c)) if c.unrolled is None else self.near[c.batch][c.unrolled]
        guards = self.guards[c.batch]
        if guards is None:
            return self._guard(self._row(c))
        if dr.width(c.row) == 1:
            return rows(guards, c.row)
        x, y, z, least = dr.gather(self.a.Q32, self.packets[c.batch], c.row)
        return type(guards)(self.a.V32(x, y, z), least)

    def is_near(self, c: Candidate, d: Any, reach: Any = None) -> Any:
        """Whether rays in direction `d`, as long as `reach` or endless (both single), may meet a row. In the tree they
        have come into its box."""
        return self.a.B(True) if c.batch in self.plan.tree else self.guard(c).candidate(d, reach)

    def _row(self, c: Candidate) -> Batch:
        return self.batches[c.batch].rows_at(c.row)

    def never_rehit(self, c: Candidate, ray: Ray) -> Any:
        """Whether rays leave a row so that they never meet it again."""
        if ray.row is None:
            return self.a.B(False)
        return (ray.row == c.index) & self.batches[c.batch].kind.never_rehit(ray.inside)

    def start(self, c: Candidate, ray: Ray) -> KnownEnds:
        """What is known of a row where rays start: a ray says so itself, or the shared origin lies on the row."""
        kind = self.batches[c.batch].kind
        on_start, inside = (None, None) if ray.row is None else (ray.row == c.index, ray.inside)
        part = ray.part if kind.uses_part else None
        if self.shared and self.touching[c.batch] is not None:
            on, g = rows(self.touching[c.batch], c.row)
            near = rounding(self._row(c), self.o)
            into = kind.runs_inside(self.seen_row(c), ray, dr.dot(g, ray.d), 0, dr.inf, near)
            inside = into if inside is None else dr.select(on, into, inside)
            on_start, part = on if on_start is None else on_start | on, None
        return KnownEnds(on_start, inside, part)

    def sweep(self, query: Query, ray: Ray, state: tuple, brute_force: bool) -> tuple:
        """`state` after the query is put to every row that a ray may meet; `brute_force`: to all rows."""
        few: list[Candidate] = []
        for number, batch in enumerate(self.batches):
            n = len(batch)
            if number in self.plan.tree and not brute_force:
                continue
            if number in self.plan.looped or (brute_force and n > policy.MAX_UNROLLED):
                state, few = self._few(query, few, state), []
                state = self._looped(query, batch, number, state, brute_force)
                continue
            each = [Candidate(number, self.a.U(i), self.a.U(batch.first_row + i), True, i) for i in range(n)]
            if self.shared and n <= policy.MAX_INLINED and not brute_force:
                few += each
                continue
            state, few = self._few(query, few, state), []
            if brute_force:
                for c in each:
                    state = query.intersect(c, *state)
            else:
                # Those that pass are gathered as the bits of a number, and then looked at in one loop. So what looks at
                # them is compiled once, and each lane goes on to its own next one.
                for first in range(0, n, 32):
                    state = self._gathered(query, batch, each[first : first + 32], first, state)
        state = self._few(query, few, state)
        if not brute_force and self.plan.tree:
            state = self._walked(query, ray, state)
        return state

    def _few(self, query: Query, each: list[Candidate], state: tuple) -> tuple:
        """The state after few rows that are written out. Where rays are known in double only when they come near
        something, it is asked first whether they come near any: then that is computed once for all."""
        if query.begin is None:
            for c in each:
                state = _where(query.may_hit(c, *state), state, lambda *s, c=c: query.intersect(c, *s), "intersect")
            return state
        if not each:
            return state
        near = [query.may_hit(c, *state) for c in each]

        def look(*state: Any) -> tuple:
            begun = query.begin()
            for c, there in zip(each, near):
                open_ = there & ~query.finished(*state)
                state = _where(open_, state, lambda *s, c=c: query.intersect(c, *s, begun=begun), "intersect")
            return state

        return _where(reduce(or_, near), state, look, "near any")

    def _gathered(self, query: Query, batch: Batch, each: list[Candidate], first: int, state: tuple) -> tuple:
        """The state after rows from number `first` on, at most 32, whose guards are written out."""
        u, number = self.a.U, each[0].batch
        bits = dr.zeros(u, dr.width(state))
        for c in each:

            def add(bits: Any, c: Candidate = c) -> tuple:
                return (bits | dr.select(query.may_hit(c, *state), u(1 << (c.unrolled - first)), 0),)

            reached = None if self.may_reach is None else self.may_reach[number][c.unrolled]
            bits = add(bits)[0] if reached is None else _where(reached, (bits,), add, "may reach")[0]

        def step(bits: Any, *state: Any) -> tuple:
            i = dr.tzcnt(bits) + first
            state = query.intersect(Candidate(number, i, i + batch.first_row, True), *state)
            return (dr.select(query.finished(*state), 0, bits & (bits - 1)), *state)

        return dr.while_loop((bits, *state), lambda bits, *_: bits != 0, step, label="gathered")[1:]

    def _looped(self, query: Query, batch: Batch, number: int, state: tuple, brute_force: bool) -> tuple:
        last = dr.opaque(self.a.U, len(batch))

        def body(i: Any, *state: Any) -> tuple:
            c = Candidate(number, i, i + batch.first_row, True)
            if brute_force:
                return (i + 1, *query.intersect(c, *state))
            return (i + 1, *_where(query.may_hit(c, *state), state, lambda *s: query.intersect(c, *s), "intersect"))

        i = dr.zeros(self.a.U, dr.width(state))
        return dr.while_loop((i, *state), lambda i, *_: i < last, body, label="rows")[1:]

    def _walked(self, query: Query, ray: Ray, state: tuple) -> tuple:
        """The state after the rows in the tree."""

        def visit(number: int, state: tuple, index: Any, present: Any) -> tuple:
            c = Candidate(number, dr.select(present, index - self.batches[number].first_row, 0), index, present)
            return _where(query.may_hit(c, *state), state, lambda *s: query.intersect(c, *s, begun=begun), "intersect")

        # The way through the tree needs the ray in double as well.
        begun = query.begin() if query.begin else (ray.exact(),)
        walk = Walk.along(self.a, self.geometry.tree, self.o, begun[0].d)
        return walk.through(state, visit, query.t_max, lambda state: query.finished(*state))


def _where(mask: Any, state: tuple, change: Callable, label: str) -> tuple:
    """change(*state) in lanes where the mask holds, by packets that have one."""
    return dr.if_stmt(state, mask, change, lambda *state: state, label=label)
