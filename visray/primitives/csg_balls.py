"""Balls around the operands of a loop, which tell the operands that a ray can meet at all.

A ray meets few of many operands. Which ones does not depend on the point of a walk. So this is decided once for each
ray, and kept as bits.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.geometry import UNIT_ROUNDOFF
from visray.primitives.csg_state import NO_LEAF
from visray.primitives.csg_table import Looped

# Number of bits of each loop. It is the same for all, so that the number of children makes no new kernel. Loops over
# more children have no bits; there are none, because clusters are smaller (csg_clusters.UNSPLIT).
BITS = 64


@dataclass(frozen=True)
class Met:
    """The children of a loop that the rays meet.

    bits: bit k belongs to child k.
    entry: as Walk.entry, for the children; None if they are meant outside of their balls.
    """

    bits: Any
    entry: tuple[Any, Any] | None


class BallTests:
    """Tests of balls, in single.

    o, d: origin and direction of the rays.
    size: size of the coordinates of both the origin and the operands.
    """

    def __init__(self, o: Any, d: Any, size: Any):
        v, f = dr.float32_array_t(type(d)), dr.float32_array_t(type(d.x))
        self.o, self.d, self.error = v(o), v(d), UNIT_ROUNDOFF["single"] * f(size)

    def ball(self, looped: Looped, row: Any, t: Any) -> tuple[Any, Any, Any]:
        """(whether rays are in a ball or before it at distance t, whether they are before it, the distance up to which
        they are).

        Error: as in accel/row_tests.test_ball, with p = o, so that e = u (|o|_1 + R), where R is the size of the
        largest operand. The distance of the point has one more rounding.
        """
        balls = looped.balls.value
        x, y, z, radius = dr.gather(balls.four, balls.numbers, row)
        to_centre, w, t = type(self.o)(x, y, z) - self.o, 32 * self.error, type(self.error)(t)
        middle = dr.dot(to_centre, self.d)
        squared = dr.square(radius + w) - dr.squared_norm(to_centre - middle * self.d)
        half, slack = dr.sqrt(dr.maximum(squared, 0)) + w, 4 * UNIT_ROUNDOFF["single"] * t
        near = (squared >= 0) & (middle + half >= t - slack)
        return near, near & (middle - half > t + slack), middle - half

    def met(self, looped: Looped, both: bool, outside: bool, begin: Any, active: Any) -> Met:
        """The children that rays meet from `begin` on.

        both: whether the children are intersected, in contrast to united.
        outside: as LeafSite.outside, for the children.
        active: mask of the rays that matter.
        """
        d, n = type(begin), dr.width(begin)
        u, u64 = dr.uint32_array_t(d), dr.uint64_array_t(d)

        def step(i: Any, entry: Any, bits: Any) -> tuple:
            near, ahead, distance = self.ball(looped, looped.first + i, begin)
            if entry is not None:
                # A ray that misses a child is outside of it without end.
                own = dr.select(near, dr.select(ahead, d(distance), -dr.inf), dr.inf)
                entry = dr.maximum(entry, own) if both else dr.minimum(entry, own)
            return i + 1, entry, dr.select(near, bits | (u64(1) << u64(i)), bits)

        entry = None if outside else dr.full(d, -dr.inf if both else dr.inf, n)
        start = dr.zeros(u, n), entry, dr.zeros(u64, n)
        more = lambda i, *_: active & (i < looped.count)  # noqa: E731 - condition
        _, entry, bits = dr.while_loop(start, more, step, label="balls")
        return Met(bits, None if entry is None else (entry, dr.full(u, NO_LEAF, n)))


def has_bits(part: Any) -> bool:
    """Whether the children of an entry of a table have bits."""
    return isinstance(part, Looped) and part.balls is not None and part.most <= BITS
