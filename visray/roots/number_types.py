"""What the structure of a polynomial is evaluated with: polynomials along a chord, bounds of sizes, slopes."""

from typing import Any

import drjit as dr

from visray.geometry import UNIT_ROUNDOFF


def roundoff(x: Any) -> float:
    """The unit roundoff of an array's numbers: of double, but on backends that have none."""
    return UNIT_ROUNDOFF["double" if dr.type_v(x) == dr.VarType.Float64 else "single"]


class Univariate:
    """A polynomial in s, the place along a chord: its coefficients from the constant one up."""

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
        found: list[Any] = [None] * (len(self.c) + len(other.c) - 1)
        for i, x in enumerate(self.c):
            for j, y in enumerate(other.c):
                found[i + j] = x * y if found[i + j] is None else dr.fma(x, y, found[i + j])
        return Univariate(*found)

    def _squared(self) -> "Univariate":
        c, n, found = self.c, len(self.c), []
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
            found.append(total)
        return Univariate(*found)

    def __call__(self, s: Any) -> Any:
        total = self.c[-1]
        for x in self.c[-2::-1]:
            total = dr.fma(total, s, x)
        return total

    def slope(self, s: Any) -> Any:
        """The derivative by s."""
        return Univariate(*(k * x for k, x in enumerate(self.c[1:], 1)))(s)


# Of polynomials of up to so many coefficients the size is added up; of others it is bounded by that of their parts.
FEW = 5


class BoundedPolynomial:
    """A polynomial in s, with bounds of its size and of how far off it is for |s| <= 1, by running error analysis.

    Source: Higham, section 3.3. A coefficient of a product is off by the errors of both and by a rounding a term.
    """

    def __init__(self, line: Univariate, error: Any, size: Any = None):
        self.line, self.error = line, error
        exact = size is None or len(line.c) <= FEW
        self.size = sum(map(dr.abs, line.c)) if exact else size

    def __add__(self, other: "BoundedPolynomial") -> "BoundedPolynomial":
        return self._rounded(self.line + other.line, other)

    def __sub__(self, other: "BoundedPolynomial") -> "BoundedPolynomial":
        return self._rounded(self.line - other.line, other)

    def _rounded(self, line: Univariate, other: "BoundedPolynomial") -> "BoundedPolynomial":
        size = self.size + other.size
        return BoundedPolynomial(line, dr.fma(roundoff(size), size, self.error + other.error), size)

    def __neg__(self) -> "BoundedPolynomial":
        return BoundedPolynomial(-self.line, self.error, self.size)

    def __mul__(self, other: "BoundedPolynomial") -> "BoundedPolynomial":
        line = self.line * (self.line if self is other else other.line)
        rounds = (1 + min(len(self.line.c), len(other.line.c))) * roundoff(self.size)
        error = self.size * dr.fma(rounds, other.size, other.error) + self.error * (other.size + other.error)
        return BoundedPolynomial(line, error, self.size * other.size)


class Magnitude:
    """A bound of the sizes of all that is added up to a number: what its rounding is relative to."""

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
    """A number with its derivatives by x, y and z, None where they are zero by structure."""

    def __init__(self, x: Any, slopes: tuple):
        self.x, self.slopes = x, slopes

    def __add__(self, other: "DualNumber") -> "DualNumber":
        return DualNumber(self.x + other.x, tuple(map(_sum, self.slopes, other.slopes)))

    def __sub__(self, other: "DualNumber") -> "DualNumber":
        return DualNumber(self.x - other.x, tuple(_sum(p, None if q is None else -q) for p, q in self._beside(other)))

    def __neg__(self) -> "DualNumber":
        return DualNumber(-self.x, tuple(None if p is None else -p for p in self.slopes))

    def __mul__(self, other: "DualNumber") -> "DualNumber":
        if self is other:
            return DualNumber(self.x * self.x, tuple(None if p is None else 2 * self.x * p for p in self.slopes))
        parts = (_sum(_product(p, other.x), _product(q, self.x)) for p, q in self._beside(other))
        return DualNumber(self.x * other.x, tuple(parts))

    def _beside(self, other: "DualNumber") -> zip:
        return zip(self.slopes, other.slopes)


def _sum(p: Any, q: Any) -> Any:
    return q if p is None else p if q is None else p + q


def _product(p: Any, x: Any) -> Any:
    return None if p is None else p * x
