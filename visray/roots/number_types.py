"""Number types on which a program can run: polynomials in s, bounds on absolute values, and dual numbers.

A program is a list of operations that evaluate a polynomial f(x, y, z) (polynomials/program.py). The coordinate s, from
-1 to 1, gives a place on a chord, the part of a ray's line inside the ball or box that bounds the surface.
"""

from typing import Any

import drjit as dr

from visray.geometry import UNIT_ROUNDOFF


def roundoff(x: Any) -> float:
    """The unit roundoff of an array's type, which is double, or single on backends without double."""
    return UNIT_ROUNDOFF["double" if dr.type_v(x) == dr.VarType.Float64 else "single"]


class Univariate:
    """A polynomial in s. c: its coefficients, the constant one first."""

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
        """The square. Each product of two different coefficients is computed once and doubled."""
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


# If a polynomial has at most this many coefficients, its size is computed from them. Otherwise the bound that follows
# from the sizes of its operands is used, which is faster and less sharp.
FEW = 5


class BoundedPolynomial:
    """A polynomial in s with bounds for |s| <= 1. Each operation also computes the bounds (running error analysis).

    polynomial: the computed polynomial.
    error: bound on the error of its values.
    size: bound on the absolute values of its values. None: computed from the coefficients.

    The error of a product contains the errors of both operands, and one rounding for each term of a coefficient.
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
        """The same polynomial with its bounds. polynomial: the sum or the difference of `self` and `other`."""
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
    """A bound on the absolute value of a number. Running a program on bounds adds up the absolute values of all terms.

    The rounding error of the program's value is proportional to this sum.

    x: the bound.
    """

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
    slopes: derivatives by the coordinates x, y and z; None for a derivative that is zero in every lane.
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
        """Pairs (derivative of self, derivative of other), one pair per coordinate."""
        return zip(self.slopes, other.slopes)


def _sum(p: Any, q: Any) -> Any:
    """p + q; None stands for zero."""
    return q if p is None else p if q is None else p + q


def _product(p: Any, x: Any) -> Any:
    """The product p x; None stands for zero."""
    return None if p is None else p * x
