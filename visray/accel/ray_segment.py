"""A segment of a ray against one row: whether the row occludes it, and the length inside the row.

Both follow from the crossings of the row's kind.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.primitives.primitive import Primitive
from visray.ray import Crossing, KnownEnds, Ray


@dataclass(frozen=True)
class RaySegment:
    """The segment of a ray between the distances `begin` and `end`, against one row.

    kind: the row's kind.
    placed, seen: the row's data, as the kind's methods of these names return them.
    known: which ends are known to lie on the row.
    """

    kind: type[Primitive]
    placed: Any
    seen: Any
    ray: Ray
    begin: Any
    end: Any
    known: KnownEnds

    def crossing(self) -> Crossing:
        """The first crossing on the segment."""
        return self.kind.crossing(self.seen, self.ray, self.begin, self.end, self.known)

    def backwards(self) -> "RaySegment":
        """The segment traversed from its end, in lanes where the end lies on the row; unchanged in other lanes.

        A known start is told apart from a crossing near it, whatever the rounding. So the known end becomes the start.
        """
        known, on_start, begin = self.known, self.known.on_start, self.begin
        back = known.on_end & (self.end < dr.inf)
        length = dr.select(back, self.end, 0)
        o, d = self.ray.o + length * self.ray.d, dr.select(back, -self.ray.d, self.ray.d)
        if on_start is None:
            turned = KnownEnds(back, known.inward, known.end_part)
        else:
            known_parts = known.end_part is not None and known.start_part is not None
            part = dr.select(back, known.end_part, known.start_part) if known_parts else None
            inside = dr.select(back, known.inward, known.inside)
            turned = KnownEnds(back | on_start, inside, part, back & on_start, known.inside, known.start_part)
        ends = dr.select(back, 0, begin), dr.select(back, self.end - begin, self.end)
        return replace(self, seen=self.kind.seen(self.placed, o), ray=Ray(o, d), begin=ends[0], end=ends[1],
                       known=turned)  # fmt: skip


def occludes(segment: RaySegment) -> Any:
    """Whether the segment crosses the row."""
    if segment.kind.finds_roots and segment.known.on_end is not None:
        segment = segment.backwards()
    return segment.crossing().met


def length_inside(segment: RaySegment) -> tuple[Any, Any]:
    """The passage of a segment through a row: (whether it both enters and leaves, its length inside).

    An end that lies on the row's surface counts as entering or leaving there. Kinds that are not closed have no inside:
    (False, 0).
    """
    kind, known, end = segment.kind, segment.known, segment.end
    none, zero = end != end, dr.zeros(type(end), dr.width(end))
    if not kind.closed:
        return none, zero

    def next_crossing(begin: Any, at: Any, length: Any, known: KnownEnds) -> tuple:
        """The first crossing after `begin`: (crossing, its distance, met, inside after it, length inside so far).

        at: distance up to which `length` was counted.
        """
        c = replace(segment, begin=begin, known=known).crossing()
        to = dr.select(c.met, c.t, end)
        return c, to, c.met, ~(c.enters ^ c.met), length + dr.select(c.enters, 0, to - at)

    first, at, crossed, inside, length = next_crossing(segment.begin, segment.begin, zero, known)
    entered = first.enters & first.met
    if known.on_start is not None:
        entered |= known.on_start

    def after_crossing(inside: Any, part: Any) -> KnownEnds:
        """What is known when the search starts again at a crossing."""
        return replace(known, on_start=~none, inside=inside, start_part=part)

    if kind.max_crossings <= 2:
        # The two crossings of a line that only touches are one. So the search for the second starts at `begin` again.
        known_start = after_crossing(inside, first.part)
        _, _, _, last, more = next_crossing(segment.begin, at, zero, known_start)
        inside, length = dr.select(crossed, last, inside), length + dr.select(crossed, more, 0)
    else:
        # At each end of the segment that lies on the surface, rounding may add a crossing.
        most = 2 + kind.max_crossings

        def step(at: Any, inside: Any, length: Any, part: Any, count: Any, going: Any) -> tuple:
            c, to, crossed, after, total = next_crossing(at, at, length, after_crossing(inside, part))
            new = (to, after, total, dr.uint32_array_t(to)(0) if c.part is None else c.part)
            old = (at, inside, length, part)
            state = tuple(dr.select(going, x, y) for x, y in zip(new, old))
            return *state, count + 1, going & crossed & (count < most)

        n = max(map(dr.width, (at, inside, length, crossed)))
        u = dr.uint32_array_t(at)
        part = dr.zeros(u, n) + (u(0) if first.part is None else first.part)
        # The state of a loop must have full width.
        at, length = (x + dr.zeros(type(x), n) for x in (at, length))
        inside, crossed = (x | dr.full(type(x), False, n) for x in (inside, crossed))
        state = (at, inside, length, part, dr.zeros(u, n), crossed)
        _, inside, length, _, _, _ = dr.while_loop(state, lambda *state: state[-1], step, label="length inside")
    left = ~inside if known.on_end is None else ~inside | known.on_end
    return entered & left, length
