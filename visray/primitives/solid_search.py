"""The search for the crossings of rays with meshes that are solids.

A solid is entered and left by turns. Near an edge, rounding may put two crossings in the wrong order, or a crossing
behind the point from which the ray starts, although the point lies before it. So the search keeps the first crossing of
each direction, into the solid and out of it, and chooses the one that follows from the state of the ray: inside or
outside. Each crossing has a bound on its error (mesh_line.py). The state is known if the ray starts on the mesh. If it
is not, and both directions come first to within their errors, the crossings along the whole ray are counted.
"""

from typing import Any

import drjit as dr

from visray.primitives.mesh_line import TriangleCrossing
from visray.primitives.mesh_search import MeshSearch, SeenMesh
from visray.ray import Crossing, KnownEnds, Ray


class SolidSearch(MeshSearch):
    """The search in solids. Each ray looks for a crossing in one direction: out of the solid if it is known to start on
    the mesh and to run inside, else into the solid. Crossings in the other direction are called the others.

    What is found is a tuple: t, slack and part of the first crossing that is looked for; the same of the first other
    crossing; and, if a ray may start on the mesh, t and part of the crossing that is looked for nearest to the start,
    among those that may lie at the start to within rounding.
    """

    def __init__(self, seen: SeenMesh, ray: Ray, begin: Any, end: Any, known: KnownEnds):
        super().__init__(seen, ray, begin, end, known)
        a, n = self.a, self.lanes
        self.on_start, self.outwards = dr.full(a.B, False, n), dr.full(a.B, False, n)
        if known.on_start is not None:
            self.on_start |= known.on_start
            self.outwards |= known.on_start & known.inside

    def run(self, every: bool = False) -> Crossing:
        """The first crossing. every: whether all triangles are tested, without the tree."""
        a, n = self.a, self.lanes

        def nothing() -> tuple:
            return dr.full(a.D, dr.inf, n), dr.zeros(a.D, n), dr.zeros(a.U, n)

        found = *nothing(), *nothing()
        if self.known.on_start is not None:
            found = *found, dr.full(a.D, dr.inf, n), dr.zeros(a.U, n)

        def walk(active: Any, counting: Any, balance: Any, *found: Any) -> tuple:
            """One walk through the tree. In the second walk, `balance` becomes the number of exits minus entries."""

            def visit(state: tuple, part: Any, x: TriangleCrossing) -> tuple:
                balance, *found = state
                counted = balance + dr.select(x.leaves, a.F32(1), a.F32(-1))
                balance = dr.select(counting & x.hit & (x.t > self.begin), counted, balance)
                return balance, *self._with_triangle(tuple(found), part, x)

            def reach(state: tuple) -> Any:
                return dr.select(counting, dr.inf, self._limit(state[1:]))

            # A certain hit excludes all others behind it only if the ray looks for the first crossing of any direction.
            certain = self.certain(dr.select(counting | self.on_start, dr.inf, self.begin))
            begin = self.begin - self.zone
            state = self.seen.visited(
                self.line, begin, (balance, *found), visit, reach, None, self.accepts, certain, every
            )
            unclear = ~counting & self._is_unclear(state[1:])
            return unclear, counting | unclear, *state

        start = dr.full(a.B, True, n), dr.full(a.B, False, n), dr.zeros(a.F32, n), *found
        _, counted, balance, *found = dr.while_loop(start, lambda active, *_: active, walk, label="mesh")
        return self._chosen(tuple(found), counted, balance)

    def _with_triangle(self, found: tuple, part: Any, x: TriangleCrossing) -> tuple:
        """What is found after one more triangle."""
        looked_for, counts = ~(x.leaves ^ self.outwards), self.counts(part, x)
        near, rest = None, ()
        if self.known.on_start is not None:
            distance, near = dr.abs(x.t - self.begin), self.at_start(x)
            rest = found[6:]
            nearer = counts & near & looked_for & (distance < dr.abs(rest[0] - self.begin))
            rest = tuple(dr.select(nearer, new, old) for new, old in zip((x.t, part), rest))
        counts &= x.t > self.begin if near is None else (x.t > self.begin) & ~near

        def first(found: tuple, counts: Any) -> tuple:
            t, _, old_part = found
            nearer = counts & ((x.t < t) | ((x.t == t) & (part < old_part)))
            return tuple(dr.select(nearer, new, old) for new, old in zip((x.t, x.slack, part), found))

        return *first(found[:3], counts & looked_for), *first(found[3:6], counts & ~looked_for), *rest

    def _limit(self, found: tuple) -> Any:
        """Distance beyond which no triangle changes the result."""
        t, slack, _, other_t, other_slack, _ = found[:6]
        limit, other = t + slack, other_t + other_slack
        return self.before_end(dr.select(self.on_start | (limit < other), limit, other))

    def _is_unclear(self, found: tuple) -> Any:
        """Whether the state at the start is unknown, and crossings of both directions come first to within rounding."""
        t, slack, _, other_t, other_slack, _ = found[:6]
        return ~self.on_start & (t < dr.inf) & (other_t < dr.inf) & (dr.abs(t - other_t) <= slack + other_slack)

    def _chosen(self, found: tuple, counted: Any, balance: Any) -> Crossing:
        """The first crossing. balance: exits minus entries along the whole ray, where they are counted."""
        t, slack, part, other_t, other_slack, other_part, *near = found
        other_is_first = ~self.on_start & dr.select(counted, balance > 0, other_t < t)
        if near:
            # If the ray is known to run inside, and the next clear crossing leads into the solid, or there is none,
            # then the ray has left the solid at its start. The same holds with both directions exchanged.
            overtaken = other_t + other_slack < t - slack
            endless = True if self.end is None else self.end == dr.inf
            overtaken |= self.outwards & ~(t < dr.inf) & endless
            use_near = self.on_start & overtaken & (near[0] < dr.inf)
            t = dr.select(use_near, dr.maximum(near[0], self.begin), t)
            part = dr.select(use_near, near[1], part)
        t, part = dr.select(other_is_first, other_t, t), dr.select(other_is_first, other_part, part)
        met, outside = t < dr.inf, ~self.outwards
        if self.known.on_end is not None:
            outside = dr.select(met | self.on_start | ~self.known.on_end, outside, ~self.known.inward)
        return Crossing(met, t, part, outside ^ other_is_first)
