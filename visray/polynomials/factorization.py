"""Factorization of a polynomial into square-free factors, with their multiplicities.

A polynomial is square-free if no factor occurs in it twice. The multiplicity of a factor is the number of times that it
occurs in the polynomial. A factor keeps the form in which it is written, if that is possible.

Most questions are decided along a random line and modulo a prime (modular.py): there, a polynomial is a short list of
numbers.
"""

from collections.abc import Collection
from dataclasses import dataclass
from fractions import Fraction
from itertools import count
from random import Random

from visray.polynomials import modular
from visray.polynomials.constants import is_negligible, rational
from visray.polynomials.error import PolynomialError
from visray.polynomials.expansion import TooLong
from visray.polynomials.expression import Expression, Negative, Power, Product
from visray.polynomials.relations import check_relations
from visray.polynomials.simplify import simplify
from visray.polynomials.symbolic import drop_cancelled_terms
from visray.polynomials.sympy_factors import multiplicity_parts, rational_factors, repeated_factor_error

# If this many primes do not prove that a polynomial is irreducible, it very probably has proper factors.
PRIMES = 14


@dataclass(frozen=True)
class SquareFreeFactor:
    """A square-free factor of a polynomial.

    expression: the factor.
    degree: total degree of the factor, after cancellation of terms.
    multiplicity: how often it occurs in the polynomial.
    """

    expression: Expression
    degree: int
    multiplicity: int

    @property
    def even(self) -> bool:
        """Whether the multiplicity is even. Then the factor does not change the sign of f."""
        return self.multiplicity % 2 == 0


def factorize(
    expression: Expression, values: dict[str, Fraction], varied: Collection[str] = ()
) -> tuple[tuple[SquareFreeFactor, ...], int]:
    """(factors, sign): the square-free factors of a polynomial f, and a sign, 1 or -1.

    Wherever f is not 0, f has the same sign as `sign` times the product of the factors of odd multiplicity.

    values: values of the parameters.
    varied: names of parameters. The factors are those of f for almost all of their values: none is left out, and no
        term of a factor, because a value makes it constant or zero.
    """
    expression = simplify(expression)
    line = _along(expression, values)
    if not line:
        raise PolynomialError("it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0")
    if len(line) == 1:
        raise PolynomialError("it is a constant, nowhere 0; a surface has x, y or z in its polynomial")
    parameters = values | {name: _nearby(values[name], Random(name)) for name in sorted(varied)}
    factors: list[list] = []
    for written, n in _written_factors(expression):
        for factor, m in _square_free_factors(written, parameters):
            _add(factors, factor, n * m, parameters)
    factors = _coprime(factors, parameters)
    square_free = tuple(SquareFreeFactor(f, len(_along(f, parameters)) - 1, n) for f, n in factors)
    check_relations([(f.expression, f.degree) for f in square_free], parameters)
    return square_free, _sign(expression, square_free, values)


def are_square_free(expressions: list[Expression], parameters: dict[str, Fraction]) -> bool:
    """Whether no factor occurs twice in the product of the expressions."""
    product = Product(tuple(expressions))
    p = _prime(product, parameters)
    return modular.is_square_free(_along(product, parameters, p), p)


def _nearby(value: Fraction, random: Random) -> Fraction:
    """A random number that is larger than `value` by at most a millionth of its size, or by a millionth if it is 0. No
    polynomial with short coefficients is 0 there, and roots and reciprocals that exist at `value` exist there too."""
    return value + (abs(value) or 1) * Fraction(random.randrange(1 << 39, 1 << 40), 10**6 << 40)


def _along(expression: Expression, parameters: dict[str, Fraction], p: int = 0) -> list[int]:
    """Coefficients of the expression along a random line, modulo the prime p. If p is 0, a suitable prime is chosen."""
    return modular.restrict_to_line(expression, parameters, p or _prime(expression, parameters), 1)


def _prime(expression: Expression, parameters: dict[str, Fraction]) -> int:
    """A prime modulo which all constants of the expression are defined."""
    try:
        return modular.suitable_prime(expression, parameters)
    except modular.UndefinedModulo:
        raise PolynomialError("it has too many different square roots; write some of them as decimal numbers") from None


def _written_factors(expression: Expression) -> list[tuple[Expression, int]]:
    """Pairs (factor, multiplicity) of an expression that is written as a product or a power. Constants are left out."""
    match expression:
        case _ if not expression.degree:
            return []
        case Negative(of):
            return _written_factors(of)
        case Power(of, exponent=n):
            return [(f, m * n) for f, m in _written_factors(of)]
        case Product(parts):
            return [factor for p in parts for factor in _written_factors(p)]
    return [(expression, 1)]


def _add(factors: list[list], factor: Expression, n: int, parameters: dict[str, Fraction]):
    """Adds a factor of multiplicity n to `factors`, a list of [factor, multiplicity].

    If the list already contains this factor, perhaps times a constant, the multiplicity in the list is increased by n.
    """
    for entry in factors:
        if entry[0] == factor:
            entry[1] += n
            return
        both = Product((entry[0], factor))
        p = _prime(both, parameters)
        a, b = _along(entry[0], parameters, p), _along(factor, parameters, p)
        if len(a) == len(b) and all((x * b[-1] - y * a[-1]) % p == 0 for x, y in zip(a, b)):
            entry[1] += n
            return
    factors.append([factor, n])


def _coprime(factors: list[list], parameters: dict[str, Fraction]) -> list[list]:
    """The list of [factor, multiplicity], divided further so that no two factors have a common factor.

    Usually only factors that contain square roots can have a common factor here.
    """
    product = Product(tuple(f for f, _ in factors))
    p = _prime(product, parameters)
    if len(factors) == 1 or modular.is_square_free(_along(product, parameters, p), p):
        return factors
    coprime: list[list] = []
    expression = simplify(Product(tuple(Power(f, n) for f, n in factors)))
    for factor, n in multiplicity_parts(expression, parameters):
        _add(coprime, factor, n, parameters)
    return coprime


def _square_free_factors(expression: Expression, parameters: dict[str, Fraction]) -> list[tuple[Expression, int]]:
    """Pairs (square-free factor, multiplicity) of one factor of the written polynomial."""
    p = _prime(expression, parameters)
    line = _along(expression, parameters, p)
    degree = len(line) - 1
    if degree < 1:
        return []
    if degree < expression.degree:
        expression = drop_cancelled_terms(expression, parameters, degree)
    square_free = modular.is_square_free(line, p)
    if square_free and (degree == 1 or _irreducible(expression, parameters, degree)):
        return [(expression, 1)]
    try:
        factors = rational_factors(expression, parameters, needed=not square_free)
    except TooLong:
        if square_free:
            return [(expression, 1)]
        raise repeated_factor_error() from None
    if not square_free:
        return [checked for f, n in factors for checked in _checked(f, n, parameters)]
    return factors if len(factors) > 1 else [(expression, 1)]


def _checked(expression: Expression, n: int, parameters: dict[str, Fraction]) -> list[tuple[Expression, int]]:
    """Pairs (square-free factor, multiplicity) of a factor with multiplicity n.

    The factor was found while irrational constants and parameters were treated as variables. With their actual values,
    it may have repeated factors or a lower degree.
    """
    p = _prime(expression, parameters)
    line = _along(expression, parameters, p)
    if len(line) < 2:
        return []
    if len(line) - 1 < expression.degree:
        expression = drop_cancelled_terms(expression, parameters, len(line) - 1)
    if modular.is_square_free(line, p):
        return [(expression, n)]
    return [(f, n * m) for f, m in multiplicity_parts(expression, parameters)]


def _irreducible(expression: Expression, parameters: dict[str, Fraction], degree: int) -> bool:
    """Whether the tested primes prove that the expression has no proper factor over the rationals.

    A factor over the rationals is also a factor modulo a prime and along a line, if the expression keeps its degree
    there. So each prime allows only some degrees for a factor. If no degree except 0 and `degree` is allowed by all
    primes, there is no proper factor.

    degree: degree of the expression.
    """
    possible = (1 << degree + 1) - 1  # bit k: a factor of degree k is possible
    tried = 0
    for q in count(1009, 2):
        if tried == PRIMES:
            return False
        if not modular.is_prime(q):
            continue
        tried += 1
        try:
            line = modular.restrict_to_line(expression, parameters, q, q, free=True)
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


def _sign(expression: Expression, factors: tuple[SquareFreeFactor, ...], parameters: dict[str, Fraction]) -> int:
    """The sign (1 or -1) of the quotient of the polynomial and the product of its factors of odd multiplicity.

    It is found at one point where neither the polynomial nor one of these factors is 0.
    """
    odd = [f.expression for f in factors if not f.even]
    for k in range(1, 100):
        point = (Fraction(3 * k, 7), Fraction(5, 11 * k), Fraction(-2 * k, 13))
        values = [(rational(t, parameters, point), t) for t in (expression, *odd)]
        if not any(is_negligible(v, t, parameters, point) for v, t in values):
            return (-1) ** sum(v < 0 for v, _ in values)
    raise PolynomialError("its sign is lost in the rounding of its irrational constants; write them as decimal numbers")
