"""The walk of rays through CSG objects, from event to event, until the boolean expression changes.

An event is a crossing of a ray with the surface of an operand. Other ray tracers sort all events of a ray into a list.
Here is no list, so none can overflow. At a point of a ray, each operand tells its state (inside or outside) and its
next event. From these follow the state of the object, and a distance up to which it certainly stays as it is
(csg_state.py). The walk goes there at once, and skips all events that cannot change the object. It ends, because each
step goes forward to an event.

Two events count as one if the point of the first lies on the surface of the second to within rounding. So faces that
coincide leave no film and no crack, and the visible face is that of the leaf with the lower number.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import drjit as dr

from visray.geometry import UNIT_ROUNDOFF
from visray.primitives.csg_form import LeafSite
from visray.primitives.csg_leaves import LeafStates, Point
from visray.primitives.csg_state import NO_LEAF, State
from visray.primitives.csg_table import Looped
from visray.pytree import rows
from visray.ray import KnownEnds, Ray


class Walk(LeafStates):
    """A walk. Its parameters are those of LeafStates."""

    def __init__(self, bits: int, seen: Any, ray: Ray, begin: Any, known: KnownEnds):
        super().__init__(bits, seen, ray, begin, known)
        v32, f32 = dr.float32_array_t(type(ray.d)), dr.float32_array_t(type(ray.d.x))
        # Origin and direction in single, and the bound on the error of coordinates in single (`_by_ball`).
        self.single = v32(seen.o), v32(ray.d), UNIT_ROUNDOFF["single"] * f32(self.origin_size + seen.placed.size)

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

    def state(self, site: Any, table: Any, ready: Any, point: Point, needed: Any) -> State:
        """The state of the tree at a site.

        table: table of the site.
        ready: for leaves outside of loops, what `prepared` returns; None for others.
        needed: mask of the lanes whose state is needed. Others may get any state.
        """
        if isinstance(site, LeafSite):
            return self.leaf_state(site, table, ready, point, needed)
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

        def changing(state: State) -> tuple:
            """The arrays of a state that may change in the loop. Dr.Jit traces a loop again if one of them does not."""
            return state.arrays() if site.finds_roots else state.arrays()[:-1]

        def whole(*arrays: Any) -> State:
            """The state with these arrays."""
            return State(*arrays) if site.finds_roots else State(*arrays, result.unresolved)

        def step(i: Any, *arrays: Any) -> tuple:
            result = whole(*arrays)
            if looped.balls is None:
                return i + 1, *changing(self._with_child(result, both, site, child(i), None, point, needed))
            near, missed = self._by_ball(both, site, looped, looped.first + i, point)
            # The child is read inside the branch, because few lanes need it.
            new = dr.if_stmt(
                missed.arrays(), near, lambda *_: self.state(site, child(i), None, point, needed).arrays(),
                lambda *old: old, label="operand",
            )  # fmt: skip
            return i + 1, *changing(result.joined(State(*new), both))

        # The node is known as soon as no other child matters.
        start = dr.zeros(self.types.U, self.lanes), *changing(result)
        more = lambda i, *arrays: (i < looped.count) & needed & whole(*arrays).is_open(both)  # noqa: E731 - condition
        return whole(*dr.while_loop(start, more, step, label="operands")[1:])

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
            going: Any, first: Any, t: Any, event: Any, enters: Any, inside: Any, met: Any, owner: Any, *unresolved: Any
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
                *(x + s.unresolved for x in unresolved),
            )  # fmt: skip

        yes, no, none = dr.full(a.B, True, n), dr.full(a.B, False, n), dr.full(a.U, NO_LEAF, n)
        zero, finds_roots = dr.zeros(a.U, n), any(site.finds_roots for site in sites if site is not None)
        start = yes, yes, self.begin, none, no, no, no, none, *[zero] * finds_roots
        found = dr.while_loop(start, lambda going, *_: going, step, label="csg")
        _, _, t, _, _, inside, met, owner, unresolved = *found, *[zero] * (not finds_roots)
        return met, dr.select(met, t, dr.inf), owner, ~inside, unresolved
