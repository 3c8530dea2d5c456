"""A segment of a ray, tested against one row: does it cross the row, and how long is its part inside the row?

A row is one object in the kernel's tables. The results are derived from the method `crossing` of the row's kind.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.primitives.primitive import Primitive
from visray.ray import Crossing, KnownEnds, Ray


@dataclass(frozen=True)
class RaySegment:
    """A segment of a ray, and the row that it is tested against.

    kind: the row's kind.
    placed, seen: the row's data, as returned by the kind's methods with these names.
    ray: the ray, in double.
    begin, end: distances from the ray origin to both ends of the segment.
    known: which ends of the segment are known to lie on the row's surface.
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
        """The segment with its direction reversed, in lanes where its end lies on the row; unchanged in other lanes.

        The search for roots can separate a known start from a crossing near that start, whatever the rounding. So the
        end that is known to lie on the row becomes the start.
        """
        known, on_start, begin = self.known, self.known.on_start, self.begin
        back = known.on_end & (self.end < dr.inf)
        length = dr.select(back, self.end, 0)
        o, d = self.ray.o + length * self.ray.d, dr.select(back, -self.ray.d, self.ray.d)
        end_part = known.end_part
        if on_start is None:
            turned = KnownEnds(back, known.inward, end_part)
        else:
            if end_part is None and known.start_part is not None and self.kind.composite:
                # Rays that start on the row keep the part on which they start.
                end_part = self.kind.part_at(self.placed, o, back)
            known_parts = end_part is not None and known.start_part is not None
            part = dr.select(back, end_part, known.start_part) if known_parts else None
            inside = dr.select(back, known.inward, known.inside)
            turned = KnownEnds(back | on_start, inside, part, back & on_start, known.inside, known.start_part)
        ends = dr.select(back, 0, begin), dr.select(back, self.end - begin, self.end)
        return replace(self, seen=self.kind.seen(self.placed, o), ray=Ray(o, d), begin=ends[0], end=ends[1],
                       known=turned)  # fmt: skip


def occludes(segment: RaySegment) -> Any:
    """Mask of the segments that cross the row's surface between their ends.

    An end that is known to lie on the surface does not count as a crossing.
    """
    if segment.kind.own_passage:
        return segment.kind.occludes(segment.seen, segment.ray, segment.begin, segment.end, segment.known)
    if segment.kind.turns_at_end and segment.known.on_end is not None:
        segment = segment.backwards()
    return segment.crossing().met


def passage(segment: RaySegment, attached_segment: RaySegment | None) -> tuple[Any, Any, Any]:
    """(mask of `occludes`, mask of `length_inside`, its length).

    attached_segment: the segment with derivatives, which the length then carries; None without derivatives.
    """
    if segment.kind.own_passage:
        return segment.kind.passage(segment.seen, segment.ray, segment.begin, segment.end, segment.known)
    return occludes(segment), *length_inside(attached_segment or segment)


def length_inside(segment: RaySegment) -> tuple[Any, Any]:
    """(mask of the segments that both enter and leave the row, length of each segment inside the row).

    A segment that starts on the row's surface counts as entering there, and one that ends on it counts as leaving.
    Kinds that are not closed have no inside; their result is (False, 0).
    """
    kind, known, end = segment.kind, segment.known, segment.end
    none, zero = end != end, dr.zeros(type(end), dr.width(end))
    if not kind.closed:
        return none, zero

    def next_crossing(begin: Any, at: Any, length: Any, known: KnownEnds) -> tuple:
        """The first crossing after the distance `begin`, and the length inside up to there.

        at: distance up to which the length inside was counted before.
        length: that length.

        The result is (crossing, distance of the crossing or else of the segment's end, whether there is a crossing,
        whether the ray is inside after it, length inside up to that distance).
        """
        c = replace(segment, begin=begin, known=known).crossing()
        to = dr.select(c.met, c.t, end)
        return c, to, c.met, ~(c.enters ^ c.met), length + dr.select(c.enters, 0, to - at)

    first, at, crossed, inside, length = next_crossing(segment.begin, segment.begin, zero, known)
    entered = first.enters & first.met
    if known.on_start is not None:
        entered |= known.on_start

    def after_crossing(inside: Any, part: Any) -> KnownEnds:
        """The known facts for a search that starts again at a crossing, on `part` of the surface.

        inside: whether the ray runs inside the row after the crossing.
        """
        return replace(known, on_start=~none, inside=inside, start_part=part)

    if kind.max_crossings <= 2:
        # If a line only touches the surface, both crossings have the same distance. So the search for the second one
        # does not start after the first one, but at `begin` again, with a known start.
        known_start = after_crossing(inside, first.part)
        _, _, _, last, more = next_crossing(segment.begin, at, zero, known_start)
        inside, length = dr.select(crossed, last, inside), length + dr.select(crossed, more, 0)
    else:
        # Rounding may add one crossing at each end of the segment, if that end lies on the surface.
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
        # Each array of a loop's state must have one entry per lane.
        at, length = (x + dr.zeros(type(x), n) for x in (at, length))
        inside, crossed = (x | dr.full(type(x), False, n) for x in (inside, crossed))
        state = (at, inside, length, part, dr.zeros(u, n), crossed)
        _, inside, length, _, _, _ = dr.while_loop(state, lambda *state: state[-1], step, label="length inside")
    left = ~inside if known.on_end is None else ~inside | known.on_end
    return entered & left, length
