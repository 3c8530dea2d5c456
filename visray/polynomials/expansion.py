"""Expansion of polynomials into terms, for factorization, and Horner's scheme for polynomials written as terms."""

from collections.abc import Callable
from fractions import Fraction
from math import comb
from typing import Any

from visray.polynomials.expression import (
    ONE,
    Axis,
    Expression,
    Negative,
    Number,
    Power,
    Product,
    Sum,
    is_zero,
    rational,
)
from visray.polynomials.simplify import negate

Exponents = tuple[int, ...]
Terms = dict[Exponents, Any]


class TooLong(Exception):
    """An expansion exceeds its budget."""


def expand(expression: Expression, constant: Callable[[Expression], Terms], size: int, budget: int) -> Terms:
    """The terms of an expression: a dict from exponents to coefficients.

    constant: gives the terms of a subexpression without x, y and z.
    size: number of variables; x, y and z come first.
    budget: most products of two terms. Raises TooLong beyond it.
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
    """The terms of a simplified expression that is written as a sum of monomials; None if it is not.

    Equal monomials are added.
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
    """(exponents, coefficient) of a monomial; None if the term is no monomial."""
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
    """The terms in coordinates q = p - centre: x^n becomes (x + centre's x)^n, expanded."""
    for axis, c in enumerate(centre):
        if not c:
            continue
        coefficients: dict[tuple[int, int, int], list[Expression]] = {}
        for e, coefficient in terms.items():
            n = e[axis]
            # Rational coefficients become numbers at once, because nested sums would be evaluated again and again.
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
    """The sum of constants, with all rational ones as one number."""
    plain = [p for p in parts if not p.parametric and not p.irrational]
    summands = [p for p in parts if p.parametric or p.irrational]
    if plain:
        summands.append(Number(sum((rational(p, {}) for p in plain), Fraction(0))))
    return summands[0] if len(summands) == 1 else Sum(tuple(summands))


def horner(terms: Coefficients) -> Expression:
    """The terms as an expression in Horner's scheme.

    The variable that occurs in most terms is factored out, by its least power there; and so on for the rest.
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
    """x^n, y^n or z^n."""
    return Power(Axis(axis), n) if n > 1 else Axis(axis)


def _term(exponents: tuple[int, int, int], coefficient: Expression) -> Expression:
    """A monomial as an expression."""
    powers = tuple(_power(k, n) for k, n in enumerate(exponents) if n)
    if coefficient == negate(ONE):
        return Negative(Product(powers)) if powers else coefficient
    return Product((coefficient, *powers)) if powers else coefficient
