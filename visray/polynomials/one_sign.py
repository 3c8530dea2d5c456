"""Proofs that a polynomial never changes its sign, in all of space: it has no surface, at most curves or points.

Two proofs are tried. A sum of terms of one sign has this sign, where a term is a product of constants and even powers.
And a polynomial of degree 2 is a quadratic form in (x, y, z, 1), whose signs Gauss's elimination counts.
"""

from fractions import Fraction

from visray.polynomials.constants import BITS, rational
from visray.polynomials.expansion import TooLong, expand
from visray.polynomials.expression import Expression, Negative, Power, Product, Sum
from visray.polynomials.functions import value_of

# Greatest number of products of the expansion.
BUDGET = 50_000
# (sign, strict): the sign is 1 or -1, or 0 if the polynomial is 0. strict: whether it is nowhere 0.
Sign = tuple[int, bool]


def one_sign(expression: Expression, values: dict[str, Fraction]) -> Sign | None:
    """(sign, strict) of a polynomial that never changes its sign; None if that is not proved.

    sign: 1 if the polynomial is at least 0 everywhere, -1 if it is at most 0.
    strict: whether it is proved to be nowhere 0.
    values: values of the parameters.
    """
    written = _of_written(expression, values)
    if written and written[1]:
        return written
    try:
        terms = expand(expression, lambda node: {(0, 0, 0): rational(node, values)}, 3, BUDGET)
    except TooLong:
        return written
    largest = max(map(abs, terms.values()), default=Fraction(0))
    terms = {e: c for e, c in terms.items() if not expression.irrational or abs(c) * (1 << BITS // 2) > largest}
    found = [s for s in (written, _of_even_terms(terms), _of_quadric(terms)) if s]
    return max(found, key=lambda s: s[1], default=None)


def _of_written(node: Expression, values: dict[str, Fraction]) -> Sign | None:
    """The sign of an expression, from the form in which it is written; None if it is not known."""
    if not node.degree:
        value = value_of(node, values)
        return (value > 0) - (value < 0), value != 0
    match node:
        case Negative(of):
            inner = _of_written(of, values)
            return inner and (-inner[0], inner[1])
        case Power(of, exponent=n):
            inner = _of_written(of, values)
            if n % 2 == 0:
                return 1, inner is not None and inner[1]
            return inner
        case Product(parts):
            signs = [_of_written(p, values) for p in parts]
            if None in signs:
                return None
            sign = 1
            for s, _ in signs:
                sign *= s
            return sign, all(strict for _, strict in signs)
        case Sum(parts):
            return _added([_of_written(p, values) for p in parts])
    return None


def _added(signs: list[Sign | None]) -> Sign | None:
    """The sign of a sum of numbers with these signs; None if it is not known."""
    if None in signs:
        return None
    kinds = {s for s, _ in signs if s}
    if len(kinds) != 1:
        return None
    return kinds.pop(), any(strict for _, strict in signs)


def _of_even_terms(terms: dict) -> Sign | None:
    """The sign of a sum of terms, if all exponents are even and all coefficients have one sign."""
    if any(k % 2 for e in terms for k in e):
        return None
    return _added([((c > 0) - (c < 0), not any(e)) for e, c in terms.items()])


def _of_quadric(terms: dict) -> Sign | None:
    """The sign of a polynomial of degree 2, if it never changes."""
    if max(map(sum, terms), default=0) != 2:
        return None
    m = [[Fraction(0)] * 4 for _ in range(4)]
    for e, c in terms.items():
        i, j = ([k for k in range(3) for _ in range(e[k])] + [3, 3])[:2]
        m[i][j] += c / 2
        m[j][i] += c / 2
    sizes = [abs(x) for row in m for x in row]
    small = max(sizes) / (1 << BITS // 2)
    pivots: list[Fraction] = []
    left = [0, 1, 2, 3]
    while left:
        k = max(left, key=lambda i: abs(m[i][i]))
        if abs(m[k][k]) <= small:
            # A form with only zeros on its diagonal has both signs, unless it is 0.
            if any(abs(m[i][j]) > small for i in left for j in left):
                return None
            break
        left.remove(k)
        pivots.append(m[k][k])
        for i in left:
            share = m[i][k] / m[k][k]
            for j in left:
                m[i][j] -= share * m[k][j]
    kinds = {1 if p > 0 else -1 for p in pivots}
    return (kinds.pop(), not left) if len(kinds) == 1 else None
