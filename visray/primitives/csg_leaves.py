"""The states of the operands of CSG objects at points of rays. The walk (csg_walk.py) joins them.

There are three sorts of operands. A convex one has an interval, which is computed once for each ray. Other solids
search for their next crossing at each point of the walk. A sheet, such as a disk, has no inside; it can only be the
first operand.

A code tells a leaf and a part of its surface, such as a triangle of a mesh: the leaf's number, followed by some bits
for the part.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.geometry import gamma, l1_norm
from visray.primitives.convex import Interval
from visray.primitives.csg_form import LeafSite
from visray.primitives.csg_state import NO_LEAF, State
from visray.primitives.csg_table import PlacedLeaf
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


class LeafStates:
    """The states of leaves. The parameters are those of Primitive.crossing.

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

    def prepared_leaf(self, site: LeafSite, leaf: PlacedLeaf, seen: Any) -> Any:
        """What a leaf needs at each point: the interval of a convex leaf, the seen data of any other.

        seen: seen data of the kind; None: it is computed.
        """
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

    def entry_of_leaf(self, leaf: PlacedLeaf, line: Interval) -> tuple[Any, Any]:
        """As Walk.entry, for a convex leaf. line: its interval."""
        near = line.near - self.begin > self._reach(leaf, self.begin)
        return dr.select(near, line.near, -dr.inf), self.code(leaf) + dr.zeros(self.types.U, self.lanes)

    def leaf_state(self, site: LeafSite, leaf: PlacedLeaf, ready: Any, point: Point, needed: Any) -> State:
        """The state of a leaf."""
        ready = ready or self.prepared_leaf(site, leaf, None)
        if not site.kind.closed:
            return self._sheet(site, leaf, ready, point)
        state = self._searched(site, leaf, ready, point, needed) if site.searches else self._convex(
            site, leaf, ready, point)  # fmt: skip
        return state.complement() if site.negated else state

    def _flush(self, leaf: PlacedLeaf, point: Point) -> Any:
        """Bound on the distance from a leaf at which the point counts as lying on it."""
        return FLUSH * (self.origin_size + point.t + leaf.size)

    def _reach(self, leaf: PlacedLeaf, t: Any) -> Any:
        """Distance along the ray within which a crossing may lie at the point at distance t. A point that is off by x
        from a surface with the radius of curvature r is off by up to sqrt(2 r x) along a ray that grazes it."""
        return FLUSH**0.5 * (self.origin_size + t + leaf.size)

    def _touches(self, site: LeafSite, leaf: PlacedLeaf, point: Point, p: Any, part: Any = None) -> tuple[Any, Any]:
        """(whether points p lie on a leaf to within rounding, whether they lie there or outside)."""
        f, g = site.kind.surface_at(leaf.placed, p, part)
        error = self._flush(leaf, point) * dr.norm(g)
        return dr.abs(f) <= error, f >= -error

    def _convex(self, site: LeafSite, leaf: PlacedLeaf, line: Interval, point: Point) -> State:
        """The state of a convex leaf: outside, inside and outside again, with the events `near` and `far`."""
        t, reach = point.t, self._reach(leaf, point.t)
        gaps = tuple(dr.abs(x - t) for x in (line.near, line.far))
        close, exact = tuple(gap <= reach for gap in gaps), tuple(gap == 0 for gap in gaps)

        def flush(*_: Any) -> tuple:
            """Which of both events lie at the point. If both are close, but the solid is thicker than rounding between
            them, only the nearer one does."""
            on = self._touches(site, leaf, point, point.p)[0]
            middle = 0.5 * (line.near + line.far)
            finite = dr.abs(middle) < dr.inf
            q = dr.fma(dr.select(finite, middle, 0), self.ray.d, self.o)
            thin = finite & self._touches(site, leaf, point, q)[1]
            return (
                close[0] & on & (thin | (gaps[0] <= gaps[1])),
                close[1] & on & (thin | (gaps[1] < gaps[0])),
            )

        # If the point is one of both events, the other is another one, however near it is.
        unsure = (close[0] | close[1]) & ~exact[0] & ~exact[1]
        here = dr.if_stmt(exact, unsure, flush, lambda *old: old, label="flush")
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
        reach = self._reach(leaf, point.t)
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
            here_part: Any, t: Any, next_part: Any, *unresolved: Any,
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
                *(x + c.unresolved for x in unresolved),
            )  # fmt: skip

        start = (
            needed & dr.full(a.B, True, n), dr.full(a.B, True, n), begin, known & dr.full(a.B, True, n),
            inside & dr.full(a.B, True, n), part, nothing.before, nothing.after, part, nothing.next, dr.zeros(a.U, n),
            *[nothing.unresolved] * kind.finds_roots,
        )  # fmt: skip
        # Dr.Jit traces a loop again if something in its state never changes.
        *_, before, after, here_part, t, own, unresolved = (
            *dr.while_loop(start, lambda going, *_: going, step, label="search"),
            *[nothing.unresolved] * (not kind.finds_roots),
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
