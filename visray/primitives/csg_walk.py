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

from visray.primitives.csg_balls import BallTests, Met, has_bits
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
        self.balls = BallTests(seen.o, ray.d, self.origin_size + seen.placed.size)

    def prepared(self, site: Any, table: Any, seen: Iterator) -> Any:
        """What the leaves of a site need at each point: a tree like the table. For a convex leaf it is its interval,
        for others the seen data of the kind, and for loops Met, or None if they have no bits.

        seen: seen data of all leaves that are not in loops, from the first one of this site on.
        """
        if isinstance(site, LeafSite):
            return self.prepared_leaf(site, table, next(seen))
        own = [
            None if isinstance(part, Looped) else tuple(self.prepared(group.site, x, seen) for x in part)
            for group, part in zip(site.groups, table)
        ]
        active = dr.full(self.types.B, True, self.lanes)
        for group, lines in zip(site.groups, own):
            if site.both and lines is not None and _is_convex(group.site):
                # An intersection is empty on rays that miss one of its sets.
                for line in lines:
                    active &= line.near < dr.inf
        return tuple(
            self.balls.met(part, site.both, group.site.outside, self.begin, active) if has_bits(part) else x
            for group, part, x in zip(site.groups, table, own)
        )

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
                met = None if ready is None else ready[g]
                result = self._looped(site.both, group.site, part, met, point, needed, result)
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

    def _looped(
        self, both: bool, site: Any, looped: Looped, met: Met | None, point: Point, needed: Any, result: State
    ) -> State:
        """The state of a node after the children of a group that is looped over. result: that before them."""

        def changing(state: State) -> tuple:
            """The arrays of a state that may change in the loop. Dr.Jit traces a loop again if one of them does not."""
            return state.arrays() if site.finds_roots else state.arrays()[:-1]

        def whole(*arrays: Any) -> State:
            """The state with these arrays."""
            return State(*arrays) if site.finds_roots else State(*arrays, result.unresolved)

        def child(i: Any, result: State) -> tuple:
            """The arrays of the state of the node after one more child."""
            row = looped.first + i
            if looped.balls is None:
                child = rows(looped.table.value, row)
                return changing(self._with_child(result, both, site, child, None, point, needed))
            near, missed = self._by_ball(both, site, looped, row, point)
            # The child is read inside the branch, because few lanes need it.
            new = dr.if_stmt(
                missed.arrays(), near,
                lambda *_: self.state(site, rows(looped.table.value, row), None, point, needed).arrays(),
                lambda *old: old, label="operand",
            )  # fmt: skip
            return changing(result.joined(State(*new), both))

        # The children that are left: the first one's number, or their bits.
        start = dr.zeros(self.types.U, self.lanes) if met is None else met.bits

        def step(left: Any, *arrays: Any) -> tuple:
            i, left = (left, left + 1) if met is None else (self.types.U(dr.tzcnt(left)), left & (left - 1))
            return left, *child(i, whole(*arrays))

        def more(left: Any, *arrays: Any) -> Any:
            """Whether children are left. The node is known as soon as no other child matters."""
            some = left < looped.count if met is None else left != 0
            return some & needed & whole(*arrays).is_open(both)

        return whole(*dr.while_loop((start, *changing(result)), more, step, label="operands")[1:])

    def _by_ball(self, both: bool, site: Any, looped: Looped, row: Any, point: Point) -> tuple[Any, State]:
        """(mask of the rays for which a child must be looked at, its state for the other rays). row: that of the child.

        Outside of a child's ball, a ray is outside of the child; or inside of it, if the ball contains its complement.
        A ray that misses the ball, or has left it, stays so. One that is before the ball stays so up to there. If
        solids are taken away, that is all that is needed, because the ray often ends here. If they are put together,
        the ray goes on to the first of them; so those ahead are looked at at once.
        """
        near, ahead, distance = self.balls.ball(looped, row, point.t)
        following = dr.full(self.types.D, dr.inf, self.lanes)
        if both and site.outside:
            near, following = near & ~ahead, dr.select(ahead, self.types.D(distance), following)
        return near, replace(State.constant(site.outside, self.types, self.lanes), next=following)

    def entry(self, site: Any, table: Any, ready: Any) -> tuple[Any, Any] | None:
        """(distance up to which the rays are certainly outside of the tree at a site, code of the leaf that is met
        there), from the intervals of convex leaves. The distance is -inf if the rays are not known to be outside at
        their start. None: nothing is known of any ray.

        ready: what `prepared` returns.
        """
        if isinstance(site, LeafSite):
            return self.entry_of_leaf(table, ready) if _is_convex(site) else None
        found: list[Any] = []
        for group, part, own in zip(site.groups, table, ready):
            if isinstance(part, Looped):
                found.append(own and own.entry)
            else:
                found += [self.entry(group.site, x, y) for x, y in zip(part, own)]
        known = [x for x in found if x is not None]
        if not known or (len(known) < len(found) and not site.both):
            return None
        t, event = known[0]
        for t_child, event_child in known[1:]:
            # An intersection begins after all of its sets, and a union with the first one.
            takes = (t_child > t) if site.both else (t_child < t)
            t, event = dr.select(takes, t_child, t), dr.select(takes, event_child, event)
        return t, event

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
        if not sheet and within is None and (entry := self.entry(sites[0], placed.surface, surface)) is not None:
            # Rays that are outside at first go on to where they may enter.
            t, event = entry
            far = t > self.begin
            going = ~far | (t < limit)
            start = (going, ~far, dr.select(far, t, self.begin), dr.select(far, event, none), far, *start[5:])
        found = dr.while_loop(start, lambda going, *_: going, step, label="csg")
        _, _, t, _, _, inside, met, owner, unresolved = *found, *[zero] * (not finds_roots)
        return met, dr.select(met, t, dr.inf), owner, ~inside, unresolved


def _is_convex(site: Any) -> bool:
    """Whether a place is one for the insides of convex solids."""
    return isinstance(site, LeafSite) and not site.searches and not site.negated
