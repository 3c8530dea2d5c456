"""A measured number with its uncertainty, by the sign test."""

from dataclasses import dataclass
from math import comb
from statistics import median

# The bounds in a Spread miss the true median with a probability of at most CHANCE. For that the sign test needs at
# least FEWEST_RUNS values.
CHANCE, FEWEST_RUNS = 0.01, 8


def sign_test_trims(n: int, chance: float) -> list[int]:
    """An ascending list of all k such that the k least and the k largest of n values may be dropped.

    The true median lies outside the values that are left with a probability of at most `chance`, by the sign test. The
    list is empty if n values are too few.
    """
    beyond = [sum(comb(n, i) for i in range(k + 1)) / 2**n for k in range(n // 2)]
    return [k for k, missed in enumerate(beyond) if 2 * missed <= chance]


@dataclass(frozen=True)
class Spread:
    """A measured number with its uncertainty.

    middle: the median of the measured values
    low, high: bounds between which the true median lies
    """

    middle: float
    low: float
    high: float

    @staticmethod
    def of(values: list[float]) -> "Spread":
        """The median of values. Two of the values are the bounds, chosen by the sign test."""
        ordered, k = sorted(values), max(sign_test_trims(len(values), CHANCE))
        return Spread(median(values), ordered[k], ordered[-1 - k])

    @property
    def in_noise(self) -> bool:
        """Whether the true median may be 0."""
        return self.low <= 0 <= self.high

    def text(self, scale: float = 1) -> str:
        """Text for the terminal: the median times `scale` and its error; if in_noise, only an upper bound on its
        absolute value."""
        low, middle, high = (scale * x for x in (self.low, self.middle, self.high))
        if self.in_noise:
            return f"< {max(-low, high):.2f}"
        return f"{middle:.2f} ± {max(high - middle, middle - low):.2f}"
