"""Double-double numbers, and polynomials with such coefficients, in NumPy.

A double-double number is the sum hi + lo of two doubles, where lo is the rounding error of hi. It has about 106 bits.
"""

from fractions import Fraction
from typing import Any

import numpy as np


class DoubleDouble:
    """Polynomials in one variable with double-double coefficients, one polynomial for each ray.

    hi, lo: the coefficients are hi + lo, lowest power first, (k, N)
    limit: largest number of coefficients; products drop higher powers. With limit 1 the polynomials are numbers.

    Error: at most 2^-100 times the size of the operands, for each operation (test_double_double).
    Source: Dekker, "A floating-point technique for extending the available precision", 1971.
    """

    def __init__(self, hi: Any, lo: Any = 0.0, limit: int = 1):
        self.hi, self.lo, self.limit = np.atleast_2d(hi), np.atleast_2d(lo) + 0 * np.atleast_2d(hi), limit

    @staticmethod
    def number(q: Fraction) -> "DoubleDouble":
        """The constant q, the same for all rays."""
        hi = float(q)
        return DoubleDouble([[hi]], [[float(q - Fraction(hi))]], 10**9)

    def _padded(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """hi and lo with k coefficients; the added ones are 0."""
        zeros = ((0, k - len(self.hi)), (0, 0))
        return np.pad(self.hi, zeros), np.pad(self.lo, zeros)

    def __neg__(self) -> "DoubleDouble":
        return DoubleDouble(-self.hi, -self.lo, self.limit)

    def __add__(self, other: "DoubleDouble") -> "DoubleDouble":
        k = max(len(self.hi), len(other.hi))
        (a, al), (b, bl) = self._padded(k), other._padded(k)
        s = a + b
        r = s - a
        return DoubleDouble(*_normalised(s, (a - (s - r)) + (b - r) + al + bl), min(self.limit, other.limit))

    def __sub__(self, other: "DoubleDouble") -> "DoubleDouble":
        return self + -other

    def __mul__(self, other: "DoubleDouble") -> "DoubleDouble":
        limit = min(self.limit, other.limit)
        short, long = (self, other) if len(self.hi) <= len(other.hi) else (other, self)
        total = None
        for i in range(min(len(short.hi), limit)):
            terms = min(len(long.hi), limit - i)
            hi, lo = _product(short.hi[i], short.lo[i], long.hi[:terms], long.lo[:terms])
            shift = ((i, 0), (0, 0))
            product = DoubleDouble(np.pad(hi, shift), np.pad(lo, shift), limit)
            total = product if total is None else total + product
        return total


def _normalised(s: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """s + e as a double-double (hi, lo). Domain: |e| <= |s|."""
    hi = s + e
    return hi, e - (hi - s)


def _split(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A double as a sum of two numbers (high, low) with at most 26 bits each. Source: Veltkamp, in Dekker, 1971."""
    big = 134217729.0 * a
    high = big - (big - a)
    return high, a - high


def _product(a: Any, al: Any, b: Any, bl: Any) -> tuple[np.ndarray, np.ndarray]:
    """The product of a + al and b + bl as a double-double (hi, lo)."""
    p = a * b
    (a1, a2), (b1, b2) = _split(a), _split(b)
    e = ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2
    return _normalised(p, e + (a * bl + al * b))


class Magnitude:
    """The sum of the absolute values of an expression's terms.

    The rounding error of the expression is at most a small multiple of this sum times the relative rounding error.
    """

    def __init__(self, v: Any):
        self.v = v

    def __add__(self, other: "Magnitude") -> "Magnitude":
        return Magnitude(self.v + other.v)

    __sub__ = __add__

    def __mul__(self, other: "Magnitude") -> "Magnitude":
        return Magnitude(self.v * other.v)
