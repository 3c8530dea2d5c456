"""Expanded polynomials: what the factoring works on, and Horner's scheme for what is written expanded."""

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
    negate,
    rational,
)

Exponents = tuple[int, ...]
Terms = dict[Exponents, Any]


class TooLong(Exception):
    """An expansion over its budget."""


def expand(tree: Expression, constant: Callable[[Expression], Terms], size: int, budget: int) -> Terms:
    """The terms of a tree over `size` variables, x, y and z first, with at most `budget` products of two terms.

    `constant` gives the terms of each largest part without x, y and z.
    """
    spent = 0

    def times(a: Terms, b: Terms) -> Terms:
        nonlocal spent
        spent += len(a) * len(b)
        if spent > budget:
            raise TooLong
        found: Terms = {}
        for i, c in a.items():
            for j, d in b.items():
                e = tuple(map(int.__add__, i, j))
                found[e] = found[e] + c * d if e in found else c * d
        return found

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
                found = base
                for _ in range(n - 1):
                    found = times(found, base)
                return found
            case Sum(parts):
                found = {}
                for p in parts:
                    for e, c in terms(p).items():
                        found[e] = found[e] + c if e in found else c
                return found
        found = terms(node.parts[0])
        for p in node.parts[1:]:
            found = times(found, terms(p))
        return found

    return {e: c for e, c in terms(tree).items() if c}


Coefficients = dict[tuple[int, int, int], Expression]


def monomial_terms(tree: Expression) -> Coefficients | None:
    """The monomials of a simplify tree that is written as a plain sum of them, or None; like ones are added."""
    found: dict[tuple[int, int, int], list[Expression]] = {}
    for term in tree.parts if isinstance(tree, Sum) else [tree]:
        one = _monomial(term)
        if one is None:
            return None
        found.setdefault(one[0], []).append(one[1])
    return _without_zeros({e: c[0] if len(c) == 1 else Sum(tuple(c)) for e, c in found.items()})


def _without_zeros(terms: Coefficients) -> Coefficients:
    return {e: c for e, c in terms.items() if not is_zero(c)}


def _monomial(term: Expression) -> tuple[tuple[int, int, int], Expression] | None:
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
    """The terms in p - centre: each x^n becomes (x + centre's x)^n, multiplied out where that is not 0."""
    for axis, c in enumerate(centre):
        if not c:
            continue
        found: dict[tuple[int, int, int], list[Expression]] = {}
        for e, coefficient in terms.items():
            n = e[axis]
            # Rational coefficients are numbers at once: trees of sums of sums would be evaluated again and again.
            plain = not coefficient.parametric and not coefficient.irrational
            value = rational(coefficient, {}) if plain and n else Fraction(0)
            for k in range(n):
                factor = comb(n, k) * c ** (n - k)
                part = Number(factor * value) if plain else Product((Number(factor), coefficient))
                found.setdefault((*e[:axis], k, *e[axis + 1 :]), []).append(part)
            found.setdefault(e, []).append(coefficient)
        terms = _without_zeros({e: parts[0] if len(parts) == 1 else _added(parts) for e, parts in found.items()})
    return terms


def _added(parts: list[Expression]) -> Expression:
    plain = [p for p in parts if not p.parametric and not p.irrational]
    others = [p for p in parts if p.parametric or p.irrational]
    if plain:
        others.append(Number(sum((rational(p, {}) for p in plain), Fraction(0))))
    return others[0] if len(others) == 1 else Sum(tuple(others))


def horner(terms: Coefficients) -> Expression:
    """The variable in most terms is taken out of them, by its least power there; and so on in what is left."""
    often, axis = max((sum(e[k] > 0 for e in terms), -k) for k in range(3))
    axis = -axis
    if often < 2:
        parts = [_term(e, c) for e, c in terms.items()]
        return parts[0] if len(parts) == 1 else Sum(tuple(parts))
    inside = {e: c for e, c in terms.items() if e[axis]}
    least = min(e[axis] for e in inside)
    inner = horner({(*e[:axis], e[axis] - least, *e[axis + 1 :]): c for e, c in inside.items()})
    whole = Product((_power(axis, least), inner))
    rest = {e: c for e, c in terms.items() if not e[axis]}
    return Sum((whole, horner(rest))) if rest else whole


def _power(axis: int, n: int) -> Expression:
    return Power(Axis(axis), n) if n > 1 else Axis(axis)


def _term(exponents: tuple[int, int, int], coefficient: Expression) -> Expression:
    powers = tuple(_power(k, n) for k, n in enumerate(exponents) if n)
    if coefficient == negate(ONE):
        return Negative(Product(powers)) if powers else coefficient
    return Product((coefficient, *powers)) if powers else coefficient
