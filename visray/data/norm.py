"""Norms: where a value lies in the domain of a palette, as a share t from 0 to 1.

A norm maps its domain [lo, hi] to [0, 1]. If lo = hi, as for constant data, or if the two are too near for double
precision, each value has t = 1/2 and the slope 0.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Norm:
    """The linear norm: t = (v - lo) / (hi - lo). The others are its subclasses."""

    lo: float
    hi: float

    @property
    def constant(self) -> bool:
        """Whether the domain is one point, as for constant data."""
        return not self.span() > 0

    def share(self, values: np.ndarray) -> np.ndarray:
        """t of values. Values below lo have 0, above hi 1; NaN stays NaN. Shape: (N)."""
        v = np.clip(np.asarray(values, float), self.lo, self.hi)
        return 0 * v + 0.5 if self.constant else np.clip(self.inner(v), 0.0, 1.0)

    def slope(self, values: np.ndarray) -> np.ndarray:
        """Derivative of `share`; 0 outside the domain. The domain itself is held fixed. Shape: (N)."""
        v = np.asarray(values, float)
        if self.constant:
            return 0 * v
        inside = ~((v < self.lo) | (v > self.hi))
        # Near the largest numbers of double precision, the slope underflows to 0.
        with np.errstate(over="ignore", divide="ignore"):
            return np.where(inside, self.inner_slope(np.clip(v, self.lo, self.hi)), 0.0)

    def value(self, t: Any) -> np.ndarray:
        """The value that has the share t: the inverse of `share`. Domain: t from 0 to 1. Shape: (N)."""
        t = np.asarray(t, float)
        return 0 * t + self.lo if self.constant else np.clip(self.inverse(t), self.lo, self.hi)

    def moves_with(self, value: float) -> bool:
        """Whether the norm changes if a datum with this value does, for a domain that is that of the data."""
        # A symmetric domain is rounded: its end may be two roundings beyond the datum that sets it.
        rounding = 2 * np.spacing(max(abs(self.lo), abs(self.hi)))
        return self.constant or not self.lo + rounding < value < self.hi - rounding

    def span(self) -> float:
        """Size of the domain in the numbers that `inner` divides by; 0 if the domain is one point."""
        # Halves, because the difference of two finite numbers can overflow.
        return self.hi / 2 - self.lo / 2

    def inner(self, v: np.ndarray) -> np.ndarray:
        """`share`. Domain: lo <= v <= hi, not constant."""
        return (v / 2 - self.lo / 2) / self.span()

    def inner_slope(self, v: np.ndarray) -> np.ndarray:
        """Derivative of `inner`. Domain: lo <= v <= hi, not constant."""
        return 0 * v + 0.5 / self.span()

    def inverse(self, t: np.ndarray) -> np.ndarray:
        """Inverse of `inner`. Domain: 0 <= t <= 1, not constant."""
        return self.lo * (1 - t) + self.hi * t


class LogNorm(Norm):
    """The logarithmic norm: t = log(v / lo) / log(hi / lo). Domain: 0 < lo."""

    def span(self) -> float:
        return float(np.log(self.hi) - np.log(self.lo)) if self.lo > 0 else 0.0

    def inner(self, v: np.ndarray) -> np.ndarray:
        return (np.log(v) - np.log(self.lo)) / self.span()

    def inner_slope(self, v: np.ndarray) -> np.ndarray:
        return 1 / (v * self.span())

    def inverse(self, t: np.ndarray) -> np.ndarray:
        return np.exp(np.log(self.lo) * (1 - t) + np.log(self.hi) * t)


@dataclass(frozen=True, eq=False)
class PowerNorm(Norm):
    """The norm t = ((v - lo) / (hi - lo)) ^ exponent. With an exponent below 1 its slope at lo is infinite."""

    exponent: float

    def inner(self, v: np.ndarray) -> np.ndarray:
        return super().inner(v) ** self.exponent

    def inner_slope(self, v: np.ndarray) -> np.ndarray:
        return self.exponent * super().inner(v) ** (self.exponent - 1) * super().inner_slope(v)

    def inverse(self, t: np.ndarray) -> np.ndarray:
        return super().inverse(t ** (1 / self.exponent))


@dataclass(frozen=True, eq=False)
class QuantileNorm(Norm):
    """The norm in which t of the n-th of N data in ascending order is (n - 1) / (N - 1), linear between two data.

    Equal data have the mean of their shares; the smallest ones have 0 and the largest ones 1.

    knots: the data, ascending and all different. shares: t of each. Shapes: (K)
    """

    knots: np.ndarray
    shares: np.ndarray

    @staticmethod
    def of(values: np.ndarray) -> "QuantileNorm":
        """The norm of data. Domain: finite, at least one. Shape: (N)."""
        knots, counts = np.unique(values, return_counts=True)
        last = np.cumsum(counts) - 1
        shares = (last - (counts - 1) / 2) / max(len(values) - 1, 1)
        if len(knots) > 1:
            shares[0], shares[-1] = 0, 1
        return QuantileNorm(float(knots[0]), float(knots[-1]), knots, shares)

    def moves_with(self, value: float) -> bool:
        return True

    def inner(self, v: np.ndarray) -> np.ndarray:
        return np.interp(v, self.knots, self.shares)

    def inner_slope(self, v: np.ndarray) -> np.ndarray:
        """At a datum, the slope on its right."""
        i = np.clip(np.searchsorted(self.knots, v, "right") - 1, 0, len(self.knots) - 2)
        return (self.shares[i + 1] - self.shares[i]) / (self.knots[i + 1] - self.knots[i])

    def inverse(self, t: np.ndarray) -> np.ndarray:
        return np.interp(t, self.shares, self.knots)
