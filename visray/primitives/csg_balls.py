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

WORD = 32
# Most children of a loop that have bits.
MOST = 4 * WORD


@dataclass(frozen=True)
class Met:
    """The children of a loop that the rays meet.

    words: bits, in words of WORD bits; bit k of word w belongs to child WORD w + k.
    entry: as Walk.entry, for the children; None if they are meant outside of their balls.
    """

    words: tuple
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
        d, u = type(begin), dr.uint32_array_t(type(begin))
        n = dr.width(begin)

        def step(i: Any, entry: Any, *words: Any) -> tuple:
            near, ahead, distance = self.ball(looped, looped.first + i, begin)
            if entry is not None:
                # A ray that misses a child is outside of it without end.
                own = dr.select(near, dr.select(ahead, d(distance), -dr.inf), dr.inf)
                entry = dr.maximum(entry, own) if both else dr.minimum(entry, own)
            bit = dr.select(near, u(1) << (i & (WORD - 1)), 0)
            marked = (w | (dr.select(i // WORD == k, bit, 0) if len(words) > 1 else bit) for k, w in enumerate(words))
            return i + 1, entry, *marked

        entry = None if outside else dr.full(d, -dr.inf if both else dr.inf, n)
        start = dr.zeros(u, n), entry, *(dr.zeros(u, n) for _ in range(-(-looped.most // WORD)))
        more = lambda i, *_: active & (i < looped.count)  # noqa: E731 - condition
        _, entry, *words = dr.while_loop(start, more, step, label="balls")
        return Met(tuple(words), None if entry is None else (entry, dr.full(u, NO_LEAF, n)))


def has_bits(part: Any) -> bool:
    """Whether the children of an entry of a table have bits."""
    return isinstance(part, Looped) and part.balls is not None and part.most <= MOST


def any_bit(words: tuple) -> Any:
    """Whether any bit is set."""
    found = words[0]
    for w in words[1:]:
        found = found | w
    return found != 0


def first_bit(words: tuple) -> tuple[Any, tuple]:
    """(number of the first bit that is set, the words without it). Domain: some bit is set."""
    number, rest, done = type(words[0])(0), [], False
    for k, w in enumerate(words):
        takes = (w != 0) & ~dr.mask_t(w)(done)
        number = dr.select(takes, dr.tzcnt(w) + WORD * k, number)
        rest.append(dr.select(takes, w & (w - 1), w))
        done = takes | done
    return number, tuple(rest)
