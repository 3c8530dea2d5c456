"""What follows from a kind's crossings: whether a row is in the way, and how long a ray is inside it."""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.primitives.primitive import Primitive
from visray.ray import Crossing, KnownEnds, Ray


@dataclass(frozen=True)
class RaySegment:
    """A ray from the distance `begin` to `end`, for one row of a kind, with what is known of its ends.

    placed, seen: the row's own, as its kind has them.
    """

    kind: type[Primitive]
    placed: Any
    seen: Any
    ray: Ray
    begin: Any
    end: Any
    known: KnownEnds

    def crossing(self) -> Crossing:
        """The first crossing on it."""
        return self.kind.crossing(self.seen, self.ray, self.begin, self.end, self.known)

    def backwards(self) -> "RaySegment":
        """The same way from its end, where that is known to lie on the row: crossings near a known beginning are told
        from it, whatever the rounding of the end."""
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


def occludes(piece: RaySegment) -> Any:
    """Whether the row is crossed between the ends."""
    if piece.kind.finds_roots and piece.known.on_end is not None:
        piece = piece.backwards()
    return piece.crossing().met


def length_inside(piece: RaySegment) -> tuple[Any, Any]:
    """Whether a ray both enters and leaves a row on its way, and how long it is inside. An end on the row's own surface
    counts as entered or left there. Kinds that are not closed have no inside."""
    kind, known, end = piece.kind, piece.known, piece.end
    none, zero = end != end, dr.zeros(type(end), dr.width(end))
    if not kind.closed:
        return none, zero

    def onwards(begin: Any, at: Any, length: Any, known: KnownEnds) -> tuple:
        c = replace(piece, begin=begin, known=known).crossing()
        to = dr.select(c.met, c.t, end)
        return c, to, c.met, ~(c.enters ^ c.met), length + dr.select(c.enters, 0, to - at)

    first, at, crossed, inside, length = onwards(piece.begin, piece.begin, zero, known)
    entered = first.enters & first.met
    if known.on_start is not None:
        entered |= known.on_start

    def beyond(inside: Any, part: Any) -> KnownEnds:
        """What is known after a crossing."""
        return replace(known, on_start=~none, inside=inside, start_part=part)

    if kind.max_crossings <= 2:
        # Of a line that only touches, both crossings are one: the second is looked for from the beginning.
        _, _, _, last, more = onwards(piece.begin, at, zero, beyond(inside, first.part))
        inside, length = dr.select(crossed, last, inside), length + dr.select(crossed, more, 0)
    else:
        # Where the ray leaves the surface, or comes to it, rounding may add a crossing.
        most = 2 + kind.max_crossings

        def step(at: Any, inside: Any, length: Any, part: Any, count: Any, going: Any) -> tuple:
            c, to, crossed, after, total = onwards(at, at, length, beyond(inside, part))
            now = (to, after, total, dr.uint32_array_t(to)(0) if c.part is None else c.part)
            old = (at, inside, length, part)
            state = tuple(dr.select(going, x, y) for x, y in zip(now, old))
            return *state, count + 1, going & crossed & (count < most)

        n = max(map(dr.width, (at, inside, length, crossed)))
        u = dr.uint32_array_t(at)
        part = dr.zeros(u, n) + (u(0) if first.part is None else first.part)
        wide = (x + dr.zeros(type(x), n) for x in (at, length))
        narrow = (x | dr.full(type(x), False, n) for x in (inside, crossed))
        (at, length), (inside, crossed) = wide, narrow
        state = (at, inside, length, part, dr.zeros(u, n), crossed)
        _, inside, length, _, _, _ = dr.while_loop(state, lambda *state: state[-1], step, label="way inside")
    left = ~inside if known.on_end is None else ~inside | known.on_end
    return entered & left, length
