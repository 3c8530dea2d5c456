"""The passage of rays through meshes: whether a ray crosses its mesh between two distances, and its length inside.

Both follow from all crossings together, whatever their order. Exits count their distance once, entries count it
negatively, and the sum is the length inside.
"""

from typing import Any

import drjit as dr

from visray.primitives.mesh_line import TriangleCrossing
from visray.primitives.mesh_search import MeshSearch, SeenMesh
from visray.ray import KnownEnds, Ray


class Passage(MeshSearch):
    """The passage of each ray through its mesh. A crossing that may lie at a start on the mesh does not count.

    Parameters: as in Primitive.crossing.
    closed: whether the meshes are solids.
    """

    def __init__(self, seen: SeenMesh, ray: Ray, begin: Any, end: Any, known: KnownEnds, closed: bool):
        super().__init__(seen, ray, begin, end, known)
        self.closed = closed

    def _within(self, part: Any, x: TriangleCrossing) -> Any:
        """Whether a crossing counts."""
        return self.counts(part, x) & (x.t > self.begin) & ~self.at_start(x)

    def occludes(self) -> Any:
        """Mask of the rays that cross their mesh."""
        a = self.a

        def visit(state: tuple, part: Any, x: TriangleCrossing) -> tuple:
            return (state[0] | self._within(part, x),)

        def accepts(part: Any) -> Any:
            return self.accepts(part) & ~self.ends_on(part)

        start, end = (dr.full(a.B, False, self.lanes),), self.before_end(a.D(dr.inf))
        certain = self.certain(self.begin + self.zone, lambda _: (a.B(True),))
        return self.seen.visited(self.line, self.begin, start, visit, lambda _: end, lambda s: s[0], accepts, certain)[
            0
        ]

    def run(self) -> tuple[Any, Any, Any]:
        """(mask of the rays that cross their mesh, mask of those that both enter and leave it, length inside)."""
        a, n, known = self.a, self.lanes, self.known
        if not self.closed:
            hit = self.occludes()
            return hit, hit != hit, dr.zeros(a.D, n)

        def visit(state: tuple, part: Any, x: TriangleCrossing) -> tuple:
            first, starts_inside, balance, length = state
            counts = self._within(part, x)
            nearer = counts & (x.t < first)
            return (
                dr.select(nearer, x.t, first),
                dr.select(nearer, x.leaves, starts_inside),
                balance + dr.select(counts, dr.select(x.leaves, a.F32(-1), a.F32(1)), 0),
                length + dr.select(counts, dr.select(x.leaves, x.t, -x.t), 0),
            )

        start = dr.full(a.D, dr.inf, n), dr.full(a.B, False, n), dr.zeros(a.F32, n), dr.zeros(a.D, n)
        start = self.seen.visited(self.line, self.begin, start, visit, lambda _: self.before_end(a.D(dr.inf)))
        first, starts_inside, balance, length = start
        hit, none = first < dr.inf, dr.full(a.B, False, n)
        on_start = none if known.on_start is None else none | known.on_start
        on_end = none if known.on_end is None else none | known.on_end
        # `balance` is the number of entries minus that of exits. If it is 0, a ray ends as it starts.
        if known.on_end is not None:
            starts_inside = dr.select(on_end, known.inward, starts_inside)
        starts_inside = dr.select(balance == 0, starts_inside, balance < 0)
        if known.on_start is not None:
            starts_inside = dr.select(on_start, known.inside, starts_inside)
        ends_inside = dr.select(starts_inside, a.F32(1), a.F32(0)) + balance > 0
        length += dr.select(ends_inside, self.end, 0) - dr.select(starts_inside, self.begin, 0)
        passes = hit & (on_start | ~starts_inside) & (on_end | ~ends_inside)
        return hit, passes, dr.maximum(length, 0)
