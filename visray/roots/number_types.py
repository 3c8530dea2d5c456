"""Number types that a program is evaluated with: polynomials in s, size bounds, and dual numbers."""

from typing import Any

import drjit as dr

from visray.geometry import UNIT_ROUNDOFF


def roundoff(x: Any) -> float:
    """The unit roundoff of an array's type: that of double, or of single on backends without double."""
    return UNIT_ROUNDOFF["double" if dr.type_v(x) == dr.VarType.Float64 else "single"]


class Univariate:
    """A polynomial in s, the place along a chord. c: coefficients, the constant one first."""

    def __init__(self, *c: Any):
        self.c = c

    def __add__(self, other: "Univariate") -> "Univariate":
        n = min(len(self.c), len(other.c))
        return Univariate(*(x + y for x, y in zip(self.c, other.c)), *(self.c[n:] or other.c[n:]))

    def __sub__(self, other: "Univariate") -> "Univariate":
        return self + -other

    def __neg__(self) -> "Univariate":
        return Univariate(*(-x for x in self.c))

    def __mul__(self, other: "Univariate") -> "Univariate":
        if self is other:
            return self._squared()
        product: list[Any] = [None] * (len(self.c) + len(other.c) - 1)
        for i, x in enumerate(self.c):
            for j, y in enumerate(other.c):
                product[i + j] = x * y if product[i + j] is None else dr.fma(x, y, product[i + j])
        return Univariate(*product)

    def _squared(self) -> "Univariate":
        """The square, with each product of two different coefficients computed once."""
        c, n, square = self.c, len(self.c), []
        for k in range(2 * n - 1):
            pairs = [(i, k - i) for i in range(max(0, k - n + 1), (k + 1) // 2)]
            total = None
            for i, j in pairs:
                total = c[i] * c[j] if total is None else dr.fma(c[i], c[j], total)
            if total is not None:
                total = total + total
            if k % 2 == 0:
                half = c[k // 2]
                total = half * half if total is None else dr.fma(half, half, total)
            square.append(total)
        return Univariate(*square)

    def __call__(self, s: Any) -> Any:
        total = self.c[-1]
        for x in self.c[-2::-1]:
            total = dr.fma(total, s, x)
        return total

    def slope(self, s: Any) -> Any:
        """The derivative at s."""
        return Univariate(*(k * x for k, x in enumerate(self.c[1:], 1)))(s)


# The size of a polynomial with at most this many coefficients is summed up. For longer ones the size that follows from
# their operands is used.
FEW = 5


class BoundedPolynomial:
    """A polynomial in s with bounds that hold for |s| <= 1, by running error analysis.

    polynomial: the computed polynomial.
    error: bound on its error.
    size: bound on its absolute value.

    A coefficient of a product carries the errors of both operands, and one rounding per term.
    Source: Higham, section 3.3.
    """

    def __init__(self, polynomial: Univariate, error: Any, size: Any = None):
        self.polynomial, self.error = polynomial, error
        summed = size is None or len(polynomial.c) <= FEW
        self.size = sum(map(dr.abs, polynomial.c)) if summed else size

    def __add__(self, other: "BoundedPolynomial") -> "BoundedPolynomial":
        return self._rounded(self.polynomial + other.polynomial, other)

    def __sub__(self, other: "BoundedPolynomial") -> "BoundedPolynomial":
        return self._rounded(self.polynomial - other.polynomial, other)

    def _rounded(self, polynomial: Univariate, other: "BoundedPolynomial") -> "BoundedPolynomial":
        """A sum or difference of this and another polynomial, with its bounds."""
        size = self.size + other.size
        return BoundedPolynomial(polynomial, dr.fma(roundoff(size), size, self.error + other.error), size)

    def __neg__(self) -> "BoundedPolynomial":
        return BoundedPolynomial(-self.polynomial, self.error, self.size)

    def __mul__(self, other: "BoundedPolynomial") -> "BoundedPolynomial":
        polynomial = self.polynomial * (self.polynomial if self is other else other.polynomial)
        terms = min(len(self.polynomial.c), len(other.polynomial.c))
        rounds = (1 + terms) * roundoff(self.size)
        error = self.size * dr.fma(rounds, other.size, other.error) + self.error * (other.size + other.error)
        return BoundedPolynomial(polynomial, error, self.size * other.size)


class Magnitude:
    """A bound x on the sum of the sizes of all terms of a number. Its rounding error is relative to this bound."""

    def __init__(self, x: Any):
        self.x = x

    def __add__(self, other: "Magnitude") -> "Magnitude":
        return Magnitude(self.x + other.x)

    __sub__ = __add__

    def __neg__(self) -> "Magnitude":
        return self

    def __mul__(self, other: "Magnitude") -> "Magnitude":
        return Magnitude(self.x * other.x)


class DualNumber:
    """A number with its derivatives, for differentiation in forward mode.

    x: the value.
    slopes: derivatives by x, y and z; None where a derivative is zero by structure.
    """

    def __init__(self, x: Any, slopes: tuple):
        self.x, self.slopes = x, slopes

    def __add__(self, other: "DualNumber") -> "DualNumber":
        return DualNumber(self.x + other.x, tuple(map(_sum, self.slopes, other.slopes)))

    def __sub__(self, other: "DualNumber") -> "DualNumber":
        return DualNumber(self.x - other.x, tuple(_sum(p, None if q is None else -q) for p, q in self._pairs(other)))

    def __neg__(self) -> "DualNumber":
        return DualNumber(-self.x, tuple(None if p is None else -p for p in self.slopes))

    def __mul__(self, other: "DualNumber") -> "DualNumber":
        if self is other:
            return DualNumber(self.x * self.x, tuple(None if p is None else 2 * self.x * p for p in self.slopes))
        slopes = (_sum(_product(p, other.x), _product(q, self.x)) for p, q in self._pairs(other))
        return DualNumber(self.x * other.x, tuple(slopes))

    def _pairs(self, other: "DualNumber") -> zip:
        """Derivatives of both numbers, paired by axis."""
        return zip(self.slopes, other.slopes)


def _sum(p: Any, q: Any) -> Any:
    """p + q, where None is zero."""
    return q if p is None else p if q is None else p + q


def _product(p: Any, x: Any) -> Any:
    """p x, where None is zero."""
    return None if p is None else p * x
