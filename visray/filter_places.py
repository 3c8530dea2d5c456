"""Places of samples in a pixel, drawn from a reconstruction filter (filters.py), as kernels compute them."""

from dataclasses import dataclass
from typing import Any, ClassVar

import drjit as dr

# Number of parts of a table. A part has the same share of the samples as any other.
PARTS = 2**12


@dataclass(frozen=True)
class Line:
    """The inverse distribution of a box, for kernels: places are begin + width u."""

    is_signed: ClassVar[bool] = False
    begin: Any
    width: Any

    def places(self, u: Any, v: Any, turn: Any) -> tuple[Any, Any]:
        """The place in the pixel: x and y, from 0 to 1 if it is inside.

        u, v: random numbers from 0 to 1, for x and for y
        turn: as in Table.weight
        """
        return self.begin + self.width * u, self.begin + self.width * v


@dataclass(frozen=True)
class Roof:
    """The inverse distribution of a tent with this radius, for kernels."""

    is_signed: ClassVar[bool] = False
    radius: Any

    def places(self, u: Any, v: Any, turn: Any) -> tuple[Any, Any]:
        """As Line.places."""
        return self._place(u), self._place(v)

    def _place(self, u: Any) -> Any:
        centred = 2 * u - 1
        return 0.5 + dr.copysign(self.radius * (1 - dr.sqrt(1 - dr.abs(centred))), centred)


@dataclass(frozen=True)
class Table:
    """The inverse distribution of a symmetric function, for kernels.

    table: places at equal steps of the distribution on one side of the centre. Between them it is linear
    positive: share of the distribution where the function is positive; that is nearest to the centre
    chance: probability of places with a negative weight
    both: probability of places where the functions of x and of y are negative, so that the weight is positive
    above, below: weight of the places with a positive weight, and with a negative one
    size: absolute value of all weights, if u and v choose the signs
    is_signed: whether the function may be negative
    """

    table: Any
    positive: Any
    chance: Any
    both: Any
    above: Any
    below: Any
    size: Any
    is_signed: bool

    def places(self, u: Any, v: Any, turn: Any) -> tuple[Any, Any]:
        """As Line.places."""
        x, y = 2 * u - 1, 2 * v - 1
        if not self.is_signed or turn is None:
            return self._place(dr.abs(x), x), self._place(dr.abs(y), y)
        lobes = self._negative(u, v, turn)
        return tuple(self._place(self._in_lobe(dr.abs(p), lobe), p) for p, lobe in zip((x, y), lobes))

    def _in_lobe(self, along: Any, is_negative: Any) -> Any:
        """A number from 0 to 1 that belongs to a place where the function is negative, or where it is positive."""
        rest = 1 - self.positive
        return dr.select(is_negative, self.positive + rest * along, self.positive * along)

    def _place(self, along: Any, side: Any) -> Any:
        """Place with a share of the distribution nearer to the centre. side: of the centre, by its sign"""
        along *= PARTS
        part = dr.minimum(dr.uint32_array_t(type(along))(along), PARTS - 1)
        a, b = (dr.gather(type(along), self.table, part + k) for k in (0, 1))
        return 0.5 + dr.copysign(a + (b - a) * (along - type(along)(part)), side)

    def _negative(self, u: Any, v: Any, turn: Any) -> tuple[Any, Any]:
        """Whether the function is negative at the place, along x and along y."""
        if turn is None:
            return tuple(dr.abs(2 * p - 1) >= self.positive for p in (u, v))
        both = (turn >= self.chance) & (turn < self.chance + self.both)
        half = 0.5 * self.chance
        return (turn < half) | both, ((turn >= half) & (turn < self.chance)) | both

    def weight(self, u: Any, v: Any, turn: Any) -> Any:
        """The weight of a place.

        u, v: as in Line.places
        turn: number from 0 to 1 that chooses the signs of both functions. The turns of a pixel's samples are evenly
            spread, so that the mean of their weights is 1 if their number is even. None: u and v choose the signs
        """
        if turn is not None:
            return dr.select(turn < self.chance, self.below, self.above)
        across, down = self._negative(u, v, turn)
        return dr.select(across ^ down, -self.size, self.size)
