"""Relations between irrational constants that decide about factors, such as sin(1)^2 + cos(1)^2 = 1.

Factorization takes functions as independent variables, and nested square roots up to their signs. So it may overlook
that a factor is repeated, or that terms cancel. Both show along a line with the constants' values of 800 digits: there,
a number that is 0 is less than 10^-400 times what it is computed from.
"""

from collections.abc import Sequence
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext
from fractions import Fraction

from visray.polynomials.constants import rational
from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import Axis, Expression, Function, Root, fold, operands

DIGITS = 800
_TINY = Decimal(10) ** (-DIGITS // 2)
# A line on which no terms cancel by chance: (x, y, z) = start + t step.
_START, _STEP = (101, 257, -499), (619, -787, 911)


def check_relations(factors: Sequence[tuple[Expression, int]], parameters: dict[str, Fraction]):
    """Raises PolynomialError if relations of constants change a degree, or make a factor occur twice.

    factors: pairs (factor, degree). The product of the factors should be square-free.
    """
    if not any(_may_be_related(f) for f, _ in factors):
        return
    with localcontext(Context(prec=DIGITS, Emax=MAX_EMAX, Emin=MIN_EMIN)):
        product = [Decimal(1)]
        for factor, degree in factors:
            line = _along(factor, parameters)
            if len(line) - 1 != degree:
                raise PolynomialError(
                    f"its terms of degree {degree} cancel, as those of (sin(1)^2 + cos(1)^2 - 1)*x do; leave them out"
                )
            product = _product(product, line)
        if not _is_square_free(product):
            raise PolynomialError(
                "a factor in it is repeated if its constants are computed; write it as a power, (...)^2"
            )


def _may_be_related(node: Expression) -> bool:
    """Whether an expression contains a function, or a square root in a square root."""
    if isinstance(node, Function) or (isinstance(node, Root) and node.of.irrational):
        return True
    return node.irrational and any(map(_may_be_related, operands(node)))


def _along(factor: Expression, parameters: dict[str, Fraction]) -> list[Decimal]:
    """Coefficients of a factor along the line, the constant one first, by Newton's divided differences."""
    constants: dict[Expression, Decimal] = {}

    def number(value: Fraction) -> Decimal:
        return Decimal(value.numerator) / value.denominator

    def value_at(t: int) -> Decimal:
        def leaf(node: Expression) -> Decimal:
            if isinstance(node, Axis):
                return Decimal(_START[node.index] + t * _STEP[node.index])
            if node not in constants:
                constants[node] = number(rational(node, parameters, (), DIGITS * 10 // 3))
            return constants[node]

        return fold(factor, number, leaf)

    differences = [value_at(t) for t in range(factor.degree + 1)]
    for k in range(1, len(differences)):
        for j in range(len(differences) - 1, k - 1, -1):
            differences[j] = (differences[j] - differences[j - 1]) / k
    line: list[Decimal] = []
    for k in range(len(differences) - 1, -1, -1):
        line = [a - k * b for a, b in zip([Decimal(0), *line], [*line, Decimal(0)])]
        line[0] += differences[k]
    return _normalized(line)


def _normalized(line: list[Decimal]) -> list[Decimal]:
    """The polynomial times a number, so that its largest coefficient is 1, without leading coefficients that are 0."""
    largest = max(map(abs, line), default=Decimal(0))
    line = [c / largest for c in line] if largest else []
    while line and abs(line[-1]) < _TINY:
        line.pop()
    return line


def _product(a: list[Decimal], b: list[Decimal]) -> list[Decimal]:
    """The product of two polynomials."""
    product = [Decimal(0)] * (len(a) + len(b) - 1)
    for i, c in enumerate(a):
        for j, d in enumerate(b):
            product[i + j] += c * d
    return product


def _is_square_free(line: list[Decimal]) -> bool:
    """Whether a polynomial has no common factor with its derivative, by Euclid's algorithm."""
    a, b = _normalized(line), _normalized([k * c for k, c in enumerate(line)][1:])
    while len(b) > 1:
        a = list(a)
        for k in range(len(a) - len(b), -1, -1):
            factor = a[k + len(b) - 1] / b[-1]
            for j, c in enumerate(b):
                a[k + j] -= factor * c
        remainder = a[: len(b) - 1]
        if max(map(abs, remainder)) < _TINY:
            return False
        a, b = b, _normalized(remainder)
    return True
