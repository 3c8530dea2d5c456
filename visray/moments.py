"""Running moments of samples, lane by lane: the same bits however the samples were cut into passes.

Samples are summed in blocks of BLOCK by their index, in the precision of shading, as differences from the block's
first sample: no digits cancel where a pixel hardly varies. A full block is joined to the moments of those before it in
double, in the order of indices. A pass may begin and end within a block: the open block is carried along as it is.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import drjit as dr

from visray.quantities import Arrays

# A power of two: its reciprocal is exact, and the place in a block is a mask of the index. Longer blocks would round
# more in single precision, shorter ones would be joined more often.
BLOCK = 16


def index_in_block(index: Any) -> Any:
    """The place of a sample in its block: 0 for the first one."""
    return index & (BLOCK - 1)


@dataclass(frozen=True)
class Moments:
    """Sums over the samples of each lane.

    mean, squares, coverage: mean colour, sum of squared differences from it, and covered samples of all full blocks, in
    double. reference, total, open_squares, open_coverage: of the open block the first sample, the sums of differences
    from that and of their squares, and covered samples, in the precision of shading.
    Shapes: (3, N), but (N) for coverage, which may be None within a kernel that needs none.
    """

    mean: Any
    squares: Any
    coverage: Any
    reference: Any
    total: Any
    open_squares: Any
    open_coverage: Any

    @property
    def arrays(self) -> tuple:
        """All arrays, in the order of the fields."""
        return tuple(getattr(self, f.name) for f in fields(self))

    @staticmethod
    def types(a: Arrays) -> tuple:
        """The types of all arrays."""
        return a.W, a.W, a.D, a.V, a.V, a.V, a.F

    @staticmethod
    def empty(a: Arrays, n: int) -> "Moments":
        """No samples, for n lanes. Evaluated, as later ones are: a first pass has the kernel of all others."""
        moments = Moments(*(dr.opaque(kind, 0, n) for kind in Moments.types(a)))
        dr.eval(moments)
        return moments

    def with_sample(self, first: Any, colour: Any, covered: Any) -> "Moments":
        """The moments with one sample more; `first`: where it is the first one of a block."""
        reference = dr.select(first, colour, self.reference)
        delta = colour - reference
        return replace(
            self,
            reference=reference,
            total=self.total + delta,
            open_squares=self.open_squares + dr.square(delta),
            open_coverage=None if self.open_coverage is None else self.open_coverage + covered,
        )

    def block_joined(self, a: Arrays, where: Any, before: Any, count: Any) -> "Moments":
        """The moments with the open block's `count` samples, which follow `before` others, joined to the full ones, and
        another block opened. Domain: count > 0. Source: Chan, Golub, LeVeque 1979."""
        n, k = a.D(before), a.D(count)
        inverse = dr.rcp(k)
        shift = a.W(self.total) * inverse
        delta = a.W(self.reference) + shift - self.mean
        spread = a.W(self.open_squares) - dr.square(shift) * k
        share = k / (n + k)
        squares = self.squares + dr.maximum(spread, 0) + dr.square(delta) * (n * share)
        return Moments(
            dr.select(where, self.mean + delta * share, self.mean),
            dr.select(where, squares, self.squares),
            None if self.coverage is None else dr.select(where, self.coverage + a.D(self.open_coverage), self.coverage),
            self.reference,
            *(None if sums is None else dr.select(where, 0, sums) for sums in self.arrays[4:]),
        )

    def closed(self, a: Arrays, counts: Any) -> "Moments":
        """The moments of all samples, `counts` of each lane, with the open block joined as if it were full, and none
        open. For reading alone: samples that follow belong to moments that are not closed."""
        k = index_in_block(counts)
        joined = self.block_joined(a, k > 0, counts - k, dr.maximum(k, 1))
        return Moments(joined.mean, joined.squares, joined.coverage, None, None, None, None)
