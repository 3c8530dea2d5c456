"""Double-double numbers, and polynomials of them, in NumPy."""

from fractions import Fraction
from typing import Any

import numpy as np


class Twofold:
    """Polynomials in s, a ray each, with double-double coefficients: hi + lo, shapes (k, N), no more than `limit` of
    them. Every operation is right to 2^-100 of the sizes of its operands (Dekker)."""

    def __init__(self, hi: Any, lo: Any = 0.0, limit: int = 1):
        self.hi, self.lo, self.limit = np.atleast_2d(hi), np.atleast_2d(lo) + 0 * np.atleast_2d(hi), limit

    @staticmethod
    def number(q: Fraction) -> "Twofold":
        hi = float(q)
        return Twofold([[hi]], [[float(q - Fraction(hi))]], 10**9)

    def _padded(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        more = ((0, k - len(self.hi)), (0, 0))
        return np.pad(self.hi, more), np.pad(self.lo, more)

    def __neg__(self) -> "Twofold":
        return Twofold(-self.hi, -self.lo, self.limit)

    def __add__(self, other: "Twofold") -> "Twofold":
        k = max(len(self.hi), len(other.hi))
        (a, al), (b, bl) = self._padded(k), other._padded(k)
        s = a + b
        r = s - a
        return Twofold(*_quick(s, (a - (s - r)) + (b - r) + al + bl), min(self.limit, other.limit))

    def __sub__(self, other: "Twofold") -> "Twofold":
        return self + -other

    def __mul__(self, other: "Twofold") -> "Twofold":
        limit = min(self.limit, other.limit)
        short, long = (self, other) if len(self.hi) <= len(other.hi) else (other, self)
        total = None
        for i in range(min(len(short.hi), limit)):
            keep = min(len(long.hi), limit - i)
            hi, lo = _times(short.hi[i], short.lo[i], long.hi[:keep], long.lo[:keep])
            shifted = ((i, 0), (0, 0))
            part = Twofold(np.pad(hi, shifted), np.pad(lo, shifted), limit)
            total = part if total is None else total + part
        return total


def _quick(s: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    hi = s + e
    return hi, e - (hi - s)


def _split(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    big = 134217729.0 * a
    high = big - (big - a)
    return high, a - high


def _times(a: Any, al: Any, b: Any, bl: Any) -> tuple[np.ndarray, np.ndarray]:
    p = a * b
    (a1, a2), (b1, b2) = _split(a), _split(b)
    e = ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2
    return _quick(p, e + (a * bl + al * b))


class Size:
    """How large the terms of an expression are: no rounding of it is more than a few units of that."""

    def __init__(self, v: Any):
        self.v = v

    def __add__(self, other: "Size") -> "Size":
        return Size(self.v + other.v)

    __sub__ = __add__

    def __mul__(self, other: "Size") -> "Size":
        return Size(self.v * other.v)
