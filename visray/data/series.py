"""Numbers that change in time, for many places at once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

# Longitudes that differ by so many degrees are the same.
TURN = 360.0


@dataclass(frozen=True, eq=False)
class Series:
    """The known numbers of P places, in M moments altogether: those of a place one after another, in order of time.

    moment, value: the moments and the numbers. Shapes: (M) each
    start: index of the first number of each place, and M. Shape: (P + 1)
    held: whether a number stays what it is until the next one; else it changes linearly
    cyclic: whether the numbers are longitudes, which go the short way
    """

    moment: np.ndarray
    value: np.ndarray
    start: np.ndarray
    held: bool
    cyclic: bool = False

    @cached_property
    def known(self) -> np.ndarray:
        """Whether each place has any number. Shape: (P)."""
        return np.diff(self.start) > 0

    def at(self, moment: float) -> tuple[np.ndarray, np.ndarray]:
        """The numbers at a moment, and whether they are known then. Where a number is not known, the nearest known one
        of the place is in its place, or NaN if there is none. Shapes: (P) each.

        A number is known from the first moment of its place on; one that is not held, up to the last moment.

        Accuracy: a known number of the data is exact at its moment, and between two moments the result is between their
        numbers.
        """
        if not len(self.moment):
            return np.full(len(self.known), np.nan), self.known
        passed = np.concatenate([[0], np.cumsum(self.moment <= moment)])
        count = np.diff(passed[self.start])
        first, last = self.start[:-1], self.start[1:] - 1
        most = len(self.moment) - 1
        low = np.clip(first + count - 1, first, np.minimum(last, most)).clip(0, most)
        high = np.clip(low + 1, None, np.maximum(last, 0))
        after = self.known & (count > 0)
        now = after if self.held else after & (moment <= self.moment[last.clip(0)])
        value = self.value[low]
        if not self.held:
            value = np.where(after, self._between(low, high, moment), value)
        return np.where(self.known, value, np.nan), now

    def _between(self, low: np.ndarray, high: np.ndarray, moment: float) -> np.ndarray:
        """The numbers between those of the indices `low` and `high`. Shape: (P)."""
        a, b, begin, end = self.value[low], self.value[high], self.moment[low], self.moment[high]
        span = np.where(end > begin, end - begin, 1.0)
        share = np.clip((moment - begin) / span, 0.0, 1.0)
        if self.cyclic:
            # The short way may lead over the date line.
            way = (b - a + TURN / 2) % TURN - TURN / 2
            across = (a + share * way + TURN / 2) % TURN - TURN / 2
            crosses = (np.abs(b - a) > TURN / 2) & (share > 0)
            a, b = np.where(crosses, across, a), np.where(crosses, across, b)
        # Products do not overflow where the difference of two large numbers would.
        return np.clip(a * (1 - share) + b * share, np.minimum(a, b), np.maximum(a, b))
