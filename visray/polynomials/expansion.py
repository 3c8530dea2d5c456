"""Expansion of polynomials into terms, which factorization needs, and Horner's scheme for sums of terms.

A term is a product of powers of the variables with a coefficient. Terms are stored in a dict from exponents to
coefficients: {(2, 0, 1): 5} is 5 x^2 z. A constant is an expression without x, y and z.
"""

from collections.abc import Callable
from fractions import Fraction
from math import comb
from typing import Any

from visray.polynomials.constants import is_zero, rational
from visray.polynomials.expression import (
    ONE,
    Axis,
    Expression,
    Negative,
    Number,
    Power,
    Product,
    Sum,
)
from visray.polynomials.simplify import negate

Exponents = tuple[int, ...]
Terms = dict[Exponents, Any]


class TooLong(Exception):
    """The error for an expansion that takes too many products, or has too many terms."""


def expand(expression: Expression, constant: Callable[[Expression], Terms], size: int, budget: int) -> Terms:
    """The terms of an expression, a dict from exponents to coefficients.

    constant: function that returns the terms of a constant.
    size: number of variables; x, y and z come first.
    budget: greatest number of products of two terms. If more are needed, TooLong is raised.
    """
    spent = 0

    def times(a: Terms, b: Terms) -> Terms:
        nonlocal spent
        spent += len(a) * len(b)
        if spent > budget:
            raise TooLong
        product: Terms = {}
        for i, c in a.items():
            for j, d in b.items():
                e = tuple(map(int.__add__, i, j))
                product[e] = product[e] + c * d if e in product else c * d
        return product

    def terms(node: Expression) -> Terms:
        if not node.degree:
            return constant(node)
        match node:
            case Axis(k):
                return {tuple(int(j == k) for j in range(size)): Fraction(1)}
            case Negative(of):
                return {e: -c for e, c in terms(of).items()}
            case Power(of, exponent=n):
                base = terms(of)
                if len(base) == 1:
                    return {tuple(n * i for i in e): c**n for e, c in base.items()}
                power = base
                for _ in range(n - 1):
                    power = times(power, base)
                return power
            case Sum(parts):
                total = {}
                for p in parts:
                    for e, c in terms(p).items():
                        total[e] = total[e] + c if e in total else c
                return total
        product = terms(node.parts[0])
        for p in node.parts[1:]:
            product = times(product, terms(p))
        return product

    return {e: c for e, c in terms(expression).items() if c}


Coefficients = dict[tuple[int, int, int], Expression]


def monomial_terms(expression: Expression) -> Coefficients | None:
    """The terms of a simplified expression, a dict from exponents to coefficients.

    The result is None if the expression is not written as a sum of monomials. The coefficients of equal monomials are
    added.
    """
    coefficients: dict[tuple[int, int, int], list[Expression]] = {}
    for term in expression.parts if isinstance(expression, Sum) else [expression]:
        monomial = _monomial(term)
        if monomial is None:
            return None
        coefficients.setdefault(monomial[0], []).append(monomial[1])
    return _without_zeros({e: c[0] if len(c) == 1 else Sum(tuple(c)) for e, c in coefficients.items()})


def _without_zeros(terms: Coefficients) -> Coefficients:
    """The terms whose coefficient is not 0."""
    return {e: c for e, c in terms.items() if not is_zero(c)}


def _monomial(term: Expression) -> tuple[tuple[int, int, int], Expression] | None:
    """(exponents, coefficient) of a term; None if the term is not a monomial."""
    if isinstance(term, Negative) and term.degree:
        inner = _monomial(term.of)
        return inner and (inner[0], negate(inner[1]))
    coefficient, exponents = ONE, [0, 0, 0]
    for factor in term.parts if isinstance(term, Product) and term.degree else [term]:
        match factor:
            case Axis(k):
                exponents[k] += 1
            case Power(Axis(k), exponent=n):
                exponents[k] += n
            case _ if not factor.degree:
                coefficient = factor
            case _:
                return None
    return tuple(exponents), coefficient


def recentre(terms: Coefficients, centre: tuple[Fraction, Fraction, Fraction]) -> Coefficients:
    """The terms of the same polynomial in coordinates q = p - centre.

    Each x^n becomes the expanded form of (x + c)^n, where c is the x coordinate of the centre. The same is done for y
    and z.
    """
    for axis, c in enumerate(centre):
        if not c:
            continue
        coefficients: dict[tuple[int, int, int], list[Expression]] = {}
        for e, coefficient in terms.items():
            n = e[axis]
            # Rational coefficients are computed at once. As nested sums they would have to be evaluated many times.
            plain = not coefficient.parametric and not coefficient.irrational
            value = rational(coefficient, {}) if plain and n else Fraction(0)
            for k in range(n):
                factor = comb(n, k) * c ** (n - k)
                part = Number(factor * value) if plain else Product((Number(factor), coefficient))
                coefficients.setdefault((*e[:axis], k, *e[axis + 1 :]), []).append(part)
            coefficients.setdefault(e, []).append(coefficient)
        terms = _without_zeros({e: parts[0] if len(parts) == 1 else _added(parts) for e, parts in coefficients.items()})
    return terms


def _added(parts: list[Expression]) -> Expression:
    """The sum of constants, as an expression. All rational numbers among them are added to one number."""
    plain = [p for p in parts if not p.parametric and not p.irrational]
    summands = [p for p in parts if p.parametric or p.irrational]
    if plain:
        summands.append(Number(sum((rational(p, {}) for p in plain), Fraction(0))))
    return summands[0] if len(summands) == 1 else Sum(tuple(summands))


def horner(terms: Coefficients) -> Expression:
    """The sum of the terms as an expression in Horner's scheme, which needs few multiplications.

    Take the variable that occurs in the most terms. Its lowest power in these terms is factored out of them. The same
    is done with what is left inside, and with the other terms.
    """
    often, axis = max((sum(e[k] > 0 for e in terms), -k) for k in range(3))
    axis = -axis
    if often < 2:
        parts = [_term(e, c) for e, c in terms.items()]
        return parts[0] if len(parts) == 1 else Sum(tuple(parts))
    inside = {e: c for e, c in terms.items() if e[axis]}
    least = min(e[axis] for e in inside)
    inner = horner({(*e[:axis], e[axis] - least, *e[axis + 1 :]): c for e, c in inside.items()})
    factored = Product((_power(axis, least), inner))
    rest = {e: c for e, c in terms.items() if not e[axis]}
    return Sum((factored, horner(rest))) if rest else factored


def _power(axis: int, n: int) -> Expression:
    """The expression x^n, y^n or z^n, for the axis 0, 1 or 2."""
    return Power(Axis(axis), n) if n > 1 else Axis(axis)


def _term(exponents: tuple[int, int, int], coefficient: Expression) -> Expression:
    """A monomial as an expression. exponents: the powers of x, y and z."""
    powers = tuple(_power(k, n) for k, n in enumerate(exponents) if n)
    if coefficient == negate(ONE):
        return Negative(Product(powers)) if powers else coefficient
    return Product((coefficient, *powers)) if powers else coefficient
