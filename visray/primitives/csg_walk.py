"""The walk of rays through CSG objects, from event to event, until the boolean expression changes.

An event is a crossing of a ray with the surface of an operand. Other ray tracers sort all events of a ray into a list.
Here is no list, so none can overflow. At a point of a ray, each operand tells its state (inside or outside) and its
next event. From these follow the state of the object, and a distance up to which it certainly stays as it is
(csg_state.py). The walk goes there at once, and skips all events that cannot change the object. It ends, because each
step goes forward to an event.

Two events count as one if the point of the first lies on the surface of the second to within rounding. So faces that
coincide leave no film and no crack, and the visible face is that of the leaf with the lower number.

There are three sorts of operands. A convex one has an interval, which is computed once for each ray. Other solids
search for their next crossing at each point of the walk. A sheet, such as a disk, has no inside; it can only be the
first operand.

A code tells a leaf and a part of its surface, such as a triangle of a mesh: the leaf's number, followed by some bits
for the part.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.geometry import UNIT_ROUNDOFF, gamma, l1_norm
from visray.primitives.convex import Interval
from visray.primitives.csg_form import LeafSite
from visray.primitives.csg_state import NO_LEAF, State
from visray.primitives.csg_table import Looped, PlacedLeaf
from visray.pytree import rows
from visray.ray import KnownEnds, Ray

# Bound on the error of the distance between a point of a ray and the surface of an operand, in units of the size of the
# coordinates: the point has 8 roundings (interaction.surface_of), and the surface 32 (culling.point_rounding).
FLUSH = gamma(64)


@dataclass(frozen=True)
class Types:
    """The array types of a walk, as Arrays has them."""

    D: Any
    U: Any
    B: Any


@dataclass(frozen=True)
class Point:
    """A point of each ray.

    t, p: its distance and position.
    first: whether it is the start of the walk.
    event, enters: the event at which the walk has arrived there, as in State.
    """

    t: Any
    p: Any
    first: Any
    event: Any
    enters: Any


class Walk:
    """A walk. Its parameters are those of Primitive.crossing.

    bits: number of low bits of a code that contain the leaf's own part. The others contain the number of the leaf.
    """

    def __init__(self, bits: int, seen: Any, ray: Ray, begin: Any, known: KnownEnds):
        self.bits, self.seen, self.ray, self.o = bits, seen, ray, seen.o
        d = type(ray.d.x)
        self.types = Types(d, dr.uint32_array_t(d), dr.mask_t(d))
        arrays = ray.d, seen.o, begin, known.on_start, seen.placed.number
        self.lanes = max(dr.width(x) for x in arrays if x is not None)
        self.begin = d(begin) + dr.zeros(d, self.lanes)
        self.origin_size = l1_norm(seen.o)
        v32, f32 = dr.float32_array_t(type(ray.d)), dr.float32_array_t(d)
        # Origin and direction in single, and the bound on the error of coordinates in single (`_by_ball`).
        self.single = v32(seen.o), v32(ray.d), UNIT_ROUNDOFF["single"] * f32(self.origin_size + seen.placed.size)
        # The leaf on whose surface the rays start, if it is known.
        self.start = None if known.start_part is None else known.on_start
        self.start_code, self.runs_inside = known.start_part, known.inside

    def number(self, code: Any) -> Any:
        """Number of the leaf with a code."""
        return code >> self.bits if self.bits else code

    def own_part(self, code: Any) -> Any:
        """The leaf's own part in a code."""
        return code & ((1 << self.bits) - 1)

    def code(self, leaf: PlacedLeaf, part: Any = None) -> Any:
        """The code of a leaf, and of its own part."""
        code = leaf.number << self.bits if self.bits else leaf.number
        return code if part is None or not self.bits else code | part

    def starts_on(self, leaf: PlacedLeaf) -> Any:
        """Mask of the rays that start on a leaf; None if no ray is known to start on any leaf."""
        return None if self.start is None else self.start & (self.number(self.start_code) == leaf.number)

    # The state of a tree at a point.

    def state(self, site: Any, table: Any, ready: Any, point: Point, needed: Any) -> State:
        """The state of the tree at a site.

        table: table of the site.
        ready: for leaves outside of loops, what `prepared` returns; None for others.
        needed: mask of the lanes whose state is needed. Others may get any state.
        """
        if isinstance(site, LeafSite):
            return self._leaf(site, table, ready, point, needed)
        result = State.constant(site.both, self.types, self.lanes)
        for g, (group, part) in enumerate(zip(site.groups, table)):
            if isinstance(part, Looped):
                result = self._looped(site.both, group.site, part, point, needed, result)
                continue
            for k, child in enumerate(part):
                own = None if ready is None else ready[g][k]
                result = self._with_child(result, site.both, group.site, child, own, point, needed)
        return result

    def _with_child(
        self, result: State, both: bool, site: Any, table: Any, ready: Any, point: Point, needed: Any
    ) -> State:
        """The state of a node after one more child. result: that before it."""
        needed = needed & result.is_open(both)
        state = self.state(site, table, ready, point, needed)
        if site.searches:
            state = state.where(needed, State.constant(both, self.types, self.lanes))
        return result.joined(state, both)

    def _looped(self, both: bool, site: Any, looped: Looped, point: Point, needed: Any, result: State) -> State:
        """The state of a node after the children of a group that is looped over. result: that before them."""

        def child(i: Any) -> Any:
            return rows(looped.table.value, looped.first + i)

        def step(i: Any, *arrays: Any) -> tuple:
            result = State(*arrays)
            if looped.balls is None:
                return i + 1, *self._with_child(result, both, site, child(i), None, point, needed).arrays()
            near, missed = self._by_ball(both, site, looped, looped.first + i, point)
            # The child is read inside the branch, because few lanes need it.
            new = dr.if_stmt(
                missed.arrays(), near, lambda *_: self.state(site, child(i), None, point, needed).arrays(),
                lambda *old: old, label="operand",
            )  # fmt: skip
            return i + 1, *result.joined(State(*new), both).arrays()

        # The node is known as soon as no other child matters.
        start = dr.zeros(self.types.U, self.lanes), *result.arrays()
        more = lambda i, *arrays: (i < looped.count) & needed & State(*arrays).is_open(both)  # noqa: E731 - condition
        return State(*dr.while_loop(start, more, step, label="operands")[1:])

    def _by_ball(self, both: bool, site: Any, looped: Looped, row: Any, point: Point) -> tuple[Any, State]:
        """(mask of the rays for which a child must be looked at, its state for the other rays). row: that of the child.

        Outside of a child's ball, a ray is outside of the child; or inside of it, if the ball contains its complement.
        A ray that misses the ball, or has left it, stays so. One that is before the ball stays so up to there. If
        solids are taken away, that is all that is needed, because the ray often ends here. If they are put together,
        the ray goes on to the first of them; so those ahead are looked at at once.

        Error: as in accel/row_tests.test_ball, with p = o, so that e = u (|o|_1 + R), where R is the size of the
        largest operand. The distance of the point has one more rounding.
        """
        balls, (o, d, error), n = looped.balls.value, self.single, self.lanes
        x, y, z, radius = dr.gather(balls.four, balls.numbers, row)
        to_centre, w, t = type(o)(x, y, z) - o, 32 * error, type(error)(point.t)
        middle = dr.dot(to_centre, d)
        squared = dr.square(radius + w) - dr.squared_norm(to_centre - middle * d)
        half, slack = dr.sqrt(dr.maximum(squared, 0)) + w, 4 * UNIT_ROUNDOFF["single"] * t
        near = (squared >= 0) & (middle + half >= t - slack)
        following = dr.full(self.types.D, dr.inf, n)
        if both and site.outside:
            ahead = near & (middle - half > t + slack)
            near, following = near & ~ahead, dr.select(ahead, self.types.D(middle - half), following)
        return near, replace(State.constant(site.outside, self.types, n), next=following)

    def _leaf(self, site: LeafSite, leaf: PlacedLeaf, ready: Any, point: Point, needed: Any) -> State:
        """The state of a leaf."""
        ready = ready or self.prepared_leaf(site, leaf, None)
        if not site.kind.closed:
            return self._sheet(site, leaf, ready, point)
        state = self._searched(site, leaf, ready, point, needed) if site.searches else self._convex(
            site, leaf, ready, point)  # fmt: skip
        return state.complement() if site.negated else state

    # What does not depend on the point.

    def prepared(self, site: Any, table: Any, seen: Iterator) -> Any:
        """What the leaves of a site need at each point: a tree like the table, with None for loops. For a convex leaf
        it is its interval, for others the seen data of the kind.

        seen: seen data of all leaves that are not in loops, from the first one of this site on.
        """

        def of(site: Any, table: Any) -> Any:
            if isinstance(table, Looped):
                return None
            if isinstance(site, LeafSite):
                return self.prepared_leaf(site, table, next(seen))
            return tuple(
                None if isinstance(part, Looped) else tuple(of(group.site, x) for x in part)
                for group, part in zip(site.groups, table)
            )

        return of(site, table)

    def prepared_leaf(self, site: LeafSite, leaf: PlacedLeaf, seen: Any) -> Any:
        """As `prepared`, for one leaf. seen: seen data of the kind; None: it is computed."""
        seen = site.kind.seen(leaf.placed, self.o) if seen is None else seen
        if site.searches:
            return seen
        line = site.kind.intervals(seen, self.ray.d)
        # An empty interval becomes one that is never reached.
        valid = line.near <= line.far
        near, far = (dr.select(valid, t, dr.inf) for t in (line.near, line.far))
        if (starts := self.starts_on(leaf)) is not None:
            # As in ConvexSolid.crossing: only a ray that runs inside meets the leaf again, at the far end.
            inside = starts & (self.runs_inside ^ site.negated) & (far > self.begin) & valid
            near = dr.select(starts, dr.select(inside, self.begin, dr.inf), near)
            far = dr.select(starts & ~inside, dr.inf, far)
        return Interval(near, far)

    # The state of a leaf at a point.

    def _flush(self, leaf: PlacedLeaf, point: Point) -> Any:
        """Bound on the distance from a leaf at which the point counts as lying on it."""
        return FLUSH * (self.origin_size + point.t + leaf.size)

    def _reach(self, leaf: PlacedLeaf, point: Point) -> Any:
        """Distance along the ray within which a crossing may lie at the point. A point that is off by x from a surface
        with the radius of curvature r is off by up to sqrt(2 r x) along a ray that grazes it."""
        return FLUSH**0.5 * (self.origin_size + point.t + leaf.size)

    def _touches(self, site: LeafSite, leaf: PlacedLeaf, point: Point, p: Any, part: Any = None) -> tuple[Any, Any]:
        """(whether points p lie on a leaf to within rounding, whether they lie there or outside)."""
        f, g = site.kind.surface_at(leaf.placed, p, part)
        error = self._flush(leaf, point) * dr.norm(g)
        return dr.abs(f) <= error, f >= -error

    def _convex(self, site: LeafSite, leaf: PlacedLeaf, line: Interval, point: Point) -> State:
        """The state of a convex leaf: outside, inside and outside again, with the events `near` and `far`."""
        t, reach = point.t, self._reach(leaf, point)
        gaps = tuple(dr.abs(x - t) for x in (line.near, line.far))
        close, exact = tuple(gap <= reach for gap in gaps), tuple(gap == 0 for gap in gaps)

        def flush(*_: Any) -> tuple:
            """Which of both events lie at the point. If the point is one of them, the other is another one, however
            near it is. If both are close, but the solid is thicker than rounding between them, only the nearer one
            does."""
            on = self._touches(site, leaf, point, point.p)[0]
            middle = 0.5 * (line.near + line.far)
            finite = dr.abs(middle) < dr.inf
            q = dr.fma(dr.select(finite, middle, 0), self.ray.d, self.o)
            thin = finite & self._touches(site, leaf, point, q)[1]
            return (
                exact[0] | (close[0] & ~exact[1] & on & (thin | (gaps[0] <= gaps[1]))),
                exact[1] | (close[1] & ~exact[0] & on & (thin | (gaps[1] < gaps[0]))),
            )

        none = dr.full(self.types.B, False, self.lanes)
        here = dr.if_stmt((none, none), close[0] | close[1], flush, lambda *old: old, label="flush")
        past = tuple((x <= t) & ~h for x, h in zip((line.near, line.far), here))
        before = past[0] & ~past[1]
        entered, left = past[0] | here[0], past[1] | here[1]
        after, code = entered & ~left, self.code(leaf) + dr.zeros(self.types.U, self.lanes)
        following = dr.select(entered, dr.select(left, dr.inf, line.far), line.near)
        owner = dr.select(before == after, NO_LEAF, code)
        return State(before, after, owner, following, code, ~after, dr.zeros(self.types.U, self.lanes))

    def _searched(self, site: LeafSite, leaf: PlacedLeaf, seen: Any, point: Point, needed: Any) -> State:
        """The state of a leaf whose crossings are searched for. The search begins a little before the point, unless the
        ray is known to lie on the leaf there."""
        a, kind, n = self.types, site.kind, self.lanes
        reach = self._reach(leaf, point)
        begin = dr.select(point.t - reach > self.begin, point.t - reach, self.begin)
        arrived = ~point.first & (self.number(point.event) == leaf.number)
        known, inside, part = arrived, point.enters, point.event
        if (starts := self.starts_on(leaf)) is not None:
            starts &= ~arrived & (begin <= self.begin)
            known, inside = arrived | starts, dr.select(starts, self.runs_inside ^ site.negated, inside)
            part = dr.select(starts, self.start_code, part)
        part = self.own_part(part) if self.bits else dr.zeros(a.U, n)
        begin = dr.select(arrived, point.t, begin)
        nothing = State.constant(site.negated, a, n)

        def step(
            going: Any, first: Any, begin: Any, known: Any, inside: Any, part: Any, before: Any, after: Any,
            here_part: Any, t: Any, next_part: Any, unresolved: Any,
        ) -> tuple:  # fmt: skip
            """Goes to the next crossing, if it lies at the point or before it."""
            facts = KnownEnds(known, inside, part if kind.uses_part else None)
            c = kind.crossing(seen, self.ray, begin, None, facts)
            now = dr.select(known, inside, ~c.enters)
            before, after = dr.select(first, dr.select(arrived, ~now, now), before), now
            own = dr.zeros(a.U, n) + (0 if c.part is None else c.part)
            close = c.met & (c.t - point.t <= reach)
            here = dr.if_stmt(
                (dr.full(a.B, False, n),), close,
                lambda *_: (self._touches(site, leaf, point, point.p, None if c.part is None else own)[0],),
                lambda *old: old, label="flush",
            )[0] & close  # fmt: skip
            past = close & ~here & (c.t <= point.t)
            turns = here | past
            return (
                turns, dr.full(a.B, False, n), dr.select(turns, c.t, begin), known | turns,
                dr.select(turns, ~now, inside), dr.select(turns, own, part), before ^ past, after ^ turns,
                dr.select(here, own, here_part), c.t, own,
                unresolved + c.unresolved,
            )  # fmt: skip

        start = (
            needed & dr.full(a.B, True, n), dr.full(a.B, True, n), begin, known & dr.full(a.B, True, n),
            inside & dr.full(a.B, True, n), part, nothing.before, nothing.after, part, nothing.next, dr.zeros(a.U, n),
            nothing.unresolved,
        )  # fmt: skip
        *_, before, after, here_part, t, own, unresolved = dr.while_loop(
            start, lambda going, *_: going, step, label="search"
        )
        here, code = (self.code(leaf, x) + dr.zeros(a.U, n) for x in (here_part, own))
        return State(before, after, dr.select(before == after, NO_LEAF, here), t, code, ~after, unresolved)

    def _sheet(self, site: LeafSite, leaf: PlacedLeaf, seen: Any, point: Point) -> State:
        """The state of a leaf that has no inside. It counts as outside before each crossing and as inside behind it."""
        a, kind, n = self.types, site.kind, self.lanes
        arrived = ~point.first & (self.number(point.event) == leaf.number)
        known, inside, part = arrived, point.enters, point.event
        if (starts := self.starts_on(leaf)) is not None:
            starts &= point.t == self.begin
            known, inside = arrived | starts, dr.select(starts, self.runs_inside, inside)
            part = dr.select(starts, self.start_code, part)
        facts = KnownEnds(known, inside, self.own_part(part) if kind.uses_part else None)
        c = kind.crossing(seen, self.ray, point.t, None, facts)
        none = dr.full(a.B, False, n)
        code = self.code(leaf, c.part) + dr.zeros(a.U, n)
        owner = dr.select(arrived, point.event, NO_LEAF)
        return State(
            none, arrived | none, owner, c.t + dr.zeros(a.D, n), code, c.enters | none, dr.zeros(a.U, n) + c.unresolved
        )

    # The walk.

    def run(self, sites: tuple[Any, Any], end: Any) -> tuple[Any, Any, Any, Any, Any]:
        """(mask of the rays with a crossing before `end`, distance, code of the leaf that is seen there, whether the
        ray is outside before, number of unresolved pieces).

        sites: those of the surface, and of the points at which it is kept; None if all of it is.
        """
        a, n, placed = self.types, self.lanes, self.seen.placed
        limit = dr.inf if end is None else end
        seen = iter(self.seen.leaves)
        surface, within = (
            None if site is None else self.prepared(site, table, seen)
            for site, table in zip(sites, (placed.surface, placed.within))
        )
        sheet = isinstance(sites[0], LeafSite) and not sites[0].kind.closed

        def step(
            going: Any, first: Any, t: Any, event: Any, enters: Any, inside: Any, met: Any, owner: Any, unresolved: Any
        ) -> tuple:
            """Goes to the next event."""
            point = Point(t, dr.fma(t, self.ray.d, self.o), first, event, enters)
            s = self.state(sites[0], placed.surface, surface, point, going)
            changed, following = (s.before != s.after) & ~first, (s.next, s.event, s.enters)
            if within is None:
                changed = (s.after != inside) & ~first
            else:
                w = self.state(sites[1], placed.within, within, point, going)
                changed &= w.after
                waits = ~w.after & (w.next > s.next)
                following = (dr.select(waits, x, y) for x, y in zip((w.next, w.event, w.enters), following))
            t_next, event_next, enters_next = following
            seen = dr.select(s.owner == NO_LEAF, event, s.owner)
            was_inside = ~enters if sheet else dr.select(first, s.after, inside)
            going = ~changed & (t_next < limit)
            # If the object changes here, the ray was on the other side before.
            kept = dr.select(changed, was_inside, s.after) if not sheet else was_inside
            return (
                going, dr.full(a.B, False, n), dr.select(changed, t, t_next), dr.select(changed, event, event_next),
                dr.select(changed, enters, enters_next), kept, changed, dr.select(changed, seen, owner),
                unresolved + s.unresolved,
            )  # fmt: skip

        yes, no, none = dr.full(a.B, True, n), dr.full(a.B, False, n), dr.full(a.U, NO_LEAF, n)
        start = yes, yes, self.begin, none, no, no, no, none, dr.zeros(a.U, n)
        _, _, t, _, _, inside, met, owner, unresolved = dr.while_loop(start, lambda going, *_: going, step, label="csg")
        return met, dr.select(met, t, dr.inf), owner, ~inside, unresolved
