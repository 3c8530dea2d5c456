"""A polynomial as a product of factors without repeated parts, each as it was written wherever that is possible."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import count

from visray.polynomials import modular
from visray.polynomials.error import PolynomialError
from visray.polynomials.expansion import TooLong
from visray.polynomials.expression import Expression, Negative, Power, Product, is_negligible, rational, simplify
from visray.polynomials.symbolic import drop_cancelled_terms
from visray.polynomials.sympy_factors import multiplicity_parts, rational_factors, repeated_factor_error

# After so many primes a polynomial that none of them proves irreducible most likely is not.
PRIMES = 14


@dataclass(frozen=True)
class SquareFreeFactor:
    """A factor without repeated parts, its degree along a generic line, and whether its multiplicity is even."""

    tree: Expression
    degree: int
    even: bool


def factorize(tree: Expression, parameters: dict[str, Fraction]) -> tuple[tuple[SquareFreeFactor, ...], int]:
    """The factors, and a sign: sign * the product of those that are not even has the sign of the tree everywhere."""
    tree = simplify(tree)
    line = _along(tree, parameters)
    if not line:
        raise PolynomialError("it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0")
    if len(line) == 1:
        raise PolynomialError("it is a constant, nowhere 0; a surface has x, y or z in its polynomial")
    found: list[list] = []
    for factor, n in _written(tree):
        for part, m in _parts(factor, parameters):
            _add(found, part, n * m, parameters)
    found = _apart(found, parameters)
    parts = tuple(SquareFreeFactor(t, len(_along(t, parameters)) - 1, n % 2 == 0) for t, n in found)
    return parts, _sign(tree, parts, parameters)


def _along(tree: Expression, parameters: dict[str, Fraction], p: int = 0) -> list[int]:
    return modular.restrict_to_line(tree, parameters, p or _field(tree, parameters), 1)


def _field(tree: Expression, parameters: dict[str, Fraction]) -> int:
    try:
        return modular.suitable_prime(tree, parameters)
    except modular.UndefinedModulo:
        raise PolynomialError("it has too many different square roots; write some of them as decimal numbers") from None


def _written(tree: Expression) -> list[tuple[Expression, int]]:
    """The factors of a tree that is written as a product or a power, without constants."""
    match tree:
        case _ if not tree.degree:
            return []
        case Negative(of):
            return _written(of)
        case Power(of, exponent=n):
            return [(t, m * n) for t, m in _written(of)]
        case Product(parts):
            return [found for p in parts for found in _written(p)]
    return [(tree, 1)]


def _add(found: list[list], part: Expression, n: int, parameters: dict[str, Fraction]):
    """Adds a factor, or to the multiplicity of one that differs from it by a constant."""
    for entry in found:
        if entry[0] == part:
            entry[1] += n
            return
        both = Product((entry[0], part))
        p = _field(both, parameters)
        a, b = _along(entry[0], parameters, p), _along(part, parameters, p)
        if len(a) == len(b) and all((x * b[-1] - y * a[-1]) % p == 0 for x, y in zip(a, b)):
            entry[1] += n
            return
    found.append([part, n])


def _apart(found: list[list], parameters: dict[str, Fraction]) -> list[list]:
    """The factors where no two have a part in common: such a part exists only where roots are involved."""
    whole = Product(tuple(t for t, _ in found))
    p = _field(whole, parameters)
    if len(found) == 1 or modular.is_square_free(_along(whole, parameters, p), p):
        return found
    apart: list[list] = []
    tree = simplify(Product(tuple(Power(t, n) for t, n in found)))
    for part, n in multiplicity_parts(tree, parameters):
        _add(apart, part, n, parameters)
    return apart


def _parts(tree: Expression, parameters: dict[str, Fraction]) -> list[tuple[Expression, int]]:
    """The factors of one written factor, with their multiplicities."""
    p = _field(tree, parameters)
    line = _along(tree, parameters, p)
    degree = len(line) - 1
    if degree < 1:
        return []
    if degree < tree.degree:
        tree = drop_cancelled_terms(tree, parameters, degree)
    free = modular.is_square_free(line, p)
    if free and (degree == 1 or _irreducible(tree, parameters, degree)):
        return [(tree, 1)]
    try:
        factors = rational_factors(tree, parameters, needed=not free)
    except TooLong:
        if free:
            return [(tree, 1)]
        raise repeated_factor_error() from None
    if not free:
        return [found for t, n in factors for found in _checked(t, n, parameters)]
    return factors if len(factors) > 1 else [(tree, 1)]


def _checked(tree: Expression, n: int, parameters: dict[str, Fraction]) -> list[tuple[Expression, int]]:
    """A factor for all values of the constants, where at their own values it may still have repeated parts."""
    p = _field(tree, parameters)
    line = _along(tree, parameters, p)
    if len(line) < 2:
        return []
    if len(line) - 1 < tree.degree:
        tree = drop_cancelled_terms(tree, parameters, len(line) - 1)
    if modular.is_square_free(line, p):
        return [(tree, n)]
    return [(t, n * m) for t, m in multiplicity_parts(tree, parameters)]


def _irreducible(tree: Expression, parameters: dict[str, Fraction], degree: int) -> bool:
    """Whether some primes prove that the tree is no product: no degree could be that of a factor modulo all of them.

    A factor over the rationals is one modulo every prime and along every line along which the tree keeps its degree.
    """
    possible = (1 << degree + 1) - 1
    tried = 0
    for q in count(1009, 2):
        if tried == PRIMES:
            return False
        if not modular.is_prime(q):
            continue
        tried += 1
        try:
            line = modular.restrict_to_line(tree, parameters, q, q, free=True)
        except modular.UndefinedModulo:
            continue
        if len(line) - 1 != degree or not modular.is_square_free(line, q):
            continue
        sums = 1
        for d in modular.factor_degrees(line, q):
            sums |= sums << d
        possible &= sums
        if possible == 1 | 1 << degree:
            return True
    return False


def _sign(tree: Expression, parts: tuple[SquareFreeFactor, ...], parameters: dict[str, Fraction]) -> int:
    """The sign of the tree over that of the factors that change theirs, at a point where none is 0."""
    odd = [p.tree for p in parts if not p.even]
    for k in range(1, 100):
        point = (Fraction(3 * k, 7), Fraction(5, 11 * k), Fraction(-2 * k, 13))
        values = [(rational(t, parameters, point), t) for t in (tree, *odd)]
        if not any(is_negligible(v, t, parameters, point) for v, t in values):
            return (-1) ** sum(v < 0 for v, _ in values)
    raise PolynomialError("its sign is lost in the rounding of its irrational constants; write them as decimal numbers")
