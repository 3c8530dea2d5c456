"""Running moments of samples: for each lane (one pixel) mean, squared differences and coverage. The bits do not depend
on how the samples are divided into passes.

Samples are summed in blocks of BLOCK consecutive indices, in the precision of shading, as differences from the block's
first sample; so no digits cancel in a pixel that hardly varies. Full blocks are joined in double, in the order of
indices. The block that is not yet full is the open block. A pass may begin and end inside a block; the sums of the open
block are carried along unchanged.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import drjit as dr

from visray.quantities import Arrays

# A power of two: its reciprocal is exact, and the position in a block is a mask of the index. Longer blocks would round
# more in single precision; shorter ones would be joined more often.
BLOCK = 16


def index_in_block(index: Any) -> Any:
    """Position of a sample in its block; 0 for the first one. index: index of the sample in its pixel."""
    return index & (BLOCK - 1)


@dataclass(frozen=True)
class Moments:
    """Sums over the samples of each lane. A sample is covered if it hits an object. Shapes: (N) for both coverages, (3,
    N) for all others.

    mean: mean colour of the samples in full blocks, in double
    squares: sum of squared differences of these samples from the mean, in double
    coverage: number of covered samples in full blocks, in double; None in kernels that do not count them
    reference: first sample of the open block; in the precision of shading, as all fields below
    total: sum of differences of the open block's samples from the reference
    open_squares: sum of squares of these differences
    open_coverage: number of covered samples in the open block; None in kernels that do not count them
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
        """The types of all arrays, in the order of the fields."""
        return a.W, a.W, a.D, a.V, a.V, a.V, a.F

    @staticmethod
    def empty(a: Arrays, n: int) -> "Moments":
        """Moments of n lanes without samples. The arrays are evaluated, as they are after each pass, so that the first
        pass has the same kernel as later ones."""
        moments = Moments(*(dr.opaque(kind, 0, n) for kind in Moments.types(a)))
        dr.eval(moments)
        return moments

    def with_sample(self, first: Any, colour: Any, covered: Any) -> "Moments":
        """The moments with one more sample.

        first: mask of the lanes in which the sample is the first of a block
        colour: colour of the sample
        covered: 1 if the sample is covered, else 0
        """
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
        """The moments after the open block is joined to the full blocks, and a new block is opened.

        where: mask of the lanes in which this happens; all others are unchanged
        before: number of samples in full blocks
        count: number of samples in the open block
        Domain: count > 0.
        Source: Chan, Golub, LeVeque 1979.
        """
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
        """The moments of all samples: the open block is joined as if it were full. The result is only read; further
        samples are added to the moments with the open block.

        counts: number of samples of each lane
        """
        k = index_in_block(counts)
        joined = self.block_joined(a, k > 0, counts - k, dr.maximum(k, 1))
        return Moments(joined.mean, joined.squares, joined.coverage, None, None, None, None)
