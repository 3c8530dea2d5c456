"""The estimated error of a picture, and its interval, from the two halves of a dual buffer (dual_buffer.py)."""

from dataclasses import dataclass, replace

import numpy as np

from visray.adaptive.cell_buffer import FREEDOM, CellBuffer
from visray.output.curves import LUMINANCE

# Rule of three: if an event does not occur in n tries, its probability is below UNSEEN / n, with a confidence of 95 %.
UNSEEN = 3.0
# Degrees of freedom of a variance that is known as well as any.
CERTAIN = 1e6


@dataclass(frozen=True)
class Estimate:
    """Estimated error of a picture.

    error: root mean square error over pixels and channels, in linear light, divided by the picture's mean luminance.
    low, high: interval that contains the true error with a probability of 95 %.
    square: mean square error, not divided by the luminance.
    luminance: mean luminance of the picture.
    factor: upper bound of the true mean square error, without `unseen`, divided by `square`.
    unseen: mean square error by light that perhaps no sample has met; it is contained only in `high`.
    cells: the part of `square` by pixels that are cut into cells.
    guard: upper bound of the true mean square error, without `unseen`, by the variances of samples; 0 if there is no
        hidden light.
    """

    error: float
    low: float
    high: float
    square: float
    luminance: float
    factor: float
    unseen: float
    cells: float = 0.0
    guard: float = 0.0

    @staticmethod
    def of(
        a: np.ndarray, b: np.ndarray, samples: float = np.inf, cells: CellBuffer | None = None, hidden: float = 0.0
    ) -> "Estimate":
        """Estimate from the colours of all pixels in both halves. Shapes: (3, N).

        samples: number of samples of each pixel, in both halves together. If infinite, no light is unseen.
        cells: the cell buffer whose pixels are part of the colours; None if there is none.
        hidden: as in `from_sums`.
        """
        squares = np.square(a - b).mean(0) / 4
        own = np.zeros(0)
        if cells is not None:
            squares[cells.lanes], own = 0, cells.squares().mean(0)
        sums = squares.sum(), np.square(squares).sum(), (LUMINANCE @ (a + b)).sum() / 2
        return Estimate.from_sums(squares.size, *map(float, sums), samples, own, hidden)

    @staticmethod
    def from_sums(
        n: int, squares: float, fourths: float, luminance: float, samples: float, cells: np.ndarray | tuple = (),
        hidden: float = 0.0,
    ) -> "Estimate":  # fmt: skip
        """Estimate from sums over n pixels.

        squares, fourths: sums of x and of x^2 over pixels (see below), without those that are cut into cells.
        luminance: sum of the luminance of the pixels.
        samples: smallest number of samples of a pixel, in both halves together.
        cells: estimated square errors of the pixels that are cut into cells.
        hidden: brightness that light may have where few samples meet it (brightness.py); 0 if it is no more than that
            of the picture.

        Let a and b be the errors of a pixel in the two halves. The true square error of the pixel is (a + b)^2 / 4. Its
        estimate is x = (a - b)^2 / 4, which needs only the difference of the two halves. The true square error and x
        differ by a b, and the mean square of a b is at most twice the mean square of x. If few pixels have most of the
        error, the sum of x is uncertain, and the estimate of its spread is uncertain too. So the ends of the interval
        are square / factor and square * factor, not square +- a difference. The estimate for a pixel that is cut into
        cells is more certain, because it has FREEDOM degrees of freedom in place of one.

        The upper end also contains `unseen`, the error by light that all samples may have missed. Two assumptions give
        its size. The light is so rare that, of all samples of the picture, only 3 (the constant UNSEEN) meet it on
        average; then the probability that all of them miss it is 5 %. And it is as bright as the picture is on average;
        then each sample that meets it changes one pixel by luminance / samples. Light that may be brighter is assumed
        to be in a single pixel. If no sample has met any light, nothing is known about the error, and `high` is 1.
        """
        of_cells = float(np.sum(cells))
        square, light = (squares + of_cells) / n, luminance / n
        # If a pixel is not a number, the estimate is not a number either, and the caller reports it.
        with np.errstate(invalid="ignore"):
            low_factor, factor = _factors(squares + of_cells, fourths, float(np.square(cells).sum()))
            unseen = max(UNSEEN * light**2, (UNSEEN * hidden) ** 2) / (samples**2 * n)
            scale = 1 / light if light > 0 else 1.0
            low, high = square / low_factor, square * factor + unseen
            error, low, high = (scale * np.sqrt([square, low, high])).tolist()
            high = max(1.0, high) if light == 0 and samples < np.inf else high
            return Estimate(error, low, high, square, light, factor, unseen, of_cells / n)

    def guarded(self, variances: np.ndarray) -> "Estimate":
        """The estimate with an upper end that the variances of samples bound, too.

        If few samples meet something bright, in a single pixel, its two halves may agree by chance. The picture must
        not stop then. The variance of the samples does not vanish by chance, and samples that are better spread than
        independent ones only make the true error smaller.

        variances: mean square errors of the pixels if their samples were independent. Shape: (N).
        """
        total, fourths = float(variances.sum()), 3 * float(np.square(variances).sum())
        if not total > 0:
            return self
        d = max(2 * total**2 / fourths - 1, 1.0)
        guard = ratio_quantile(d, CERTAIN) * total / len(variances) + self.cells * self.factor
        scale = 1 / self.luminance if self.luminance > 0 else 1.0
        high = max(self.high, scale * float(np.sqrt(guard + self.unseen)))
        return replace(self, guard=guard, high=high)


def _factors(squares: float, fourths: float, fourths_of_cells: float) -> tuple[float, float]:
    """(low, high): the interval of the true mean square error is from the estimated one divided by `low` to the
    estimated one times `high`.

    squares: sum of the estimated square errors of all pixels.
    fourths: sum of their squares, for the pixels that are not cut into cells. fourths_of_cells: for the others.

    If all pixels have equal errors, there are about n degrees of freedom: n fourths / squares^2 is 3 or less. For a
    pixel that is cut into cells, it is 1 + 2 / FREEDOM.
    """
    if not (squares > 0 < fourths + fourths_of_cells):
        return 1.0, 1.0
    if not fourths_of_cells:
        factor = ratio_quantile(max(2 * squares**2 / fourths - 1, 1.0))
        return factor, factor
    true, stated = (
        max(2 * squares**2 / (fourths + share * fourths_of_cells) - 1, 1.0) for share in (3.0, 3.0 / FREEDOM)
    )
    return ratio_quantile(stated, true), ratio_quantile(true, stated)


def ratio_quantile(d: float, below: float | None = None) -> float:
    """97.5 % quantile of the ratio of two independent mean squares, of d and of `below` normal random numbers; by
    default, both of d.

    The density of x, the logarithm of the ratio, is proportional to cosh(x / 2)^-d if both have d.

    Domain: d >= 1, below >= 1.
    Error: the relative error of the logarithm of the quantile is below 1e-4 (tests/test_adaptive.py).
    """
    if below is None:
        # The range is wide enough for d = 1. For larger d the density is narrower.
        x = np.linspace(0, 60 / np.sqrt(d), 4001)
        density = np.exp(-d * (np.logaddexp(x / 2, -x / 2) - np.log(2)))
        cumulative = np.concatenate([[0], np.cumsum(density[1:] + density[:-1])])
        return float(np.exp(np.interp(0.95, cumulative / cumulative[-1], x)))
    widest = 60 / np.sqrt(min(d, below))
    x = np.linspace(-widest, widest, 8001)
    log_density = d * x / 2 - (d + below) / 2 * np.logaddexp(0, x + np.log(d / below))
    density = np.exp(log_density - log_density.max())
    cumulative = np.concatenate([[0], np.cumsum(density[1:] + density[:-1])])
    return float(np.exp(np.interp(0.975, cumulative / cumulative[-1], x)))
