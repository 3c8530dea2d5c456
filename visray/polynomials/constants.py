"""Values of expressions, above all of constants: as rational numbers, and in other arithmetics.

A constant is an expression without x, y and z.
"""

from collections.abc import Callable, Collection, Iterable
from fractions import Fraction
from functools import cache, lru_cache
from math import isqrt
from typing import Any

from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import (
    Axis,
    Expression,
    Function,
    NamedConstant,
    Negative,
    Number,
    Parameter,
    Power,
    Product,
    Root,
    Sum,
    fold,
    operands,
    outermost,
)

# Irrational constants are approximated by rationals with this many correct bits (77 decimal digits).
BITS = 256
# Numbers of bits, besides those asked for, with which a function is computed until two values agree. An argument of
# 1e301, the largest constant, takes 1000 more bits.
GUARD_BITS = (64, 128, 1 << 11, 1 << 12, 1 << 13)
# Greatest logarithm of base 2, in size, of a function's value.
MAX_SIZE = 1 << 15


def evaluate(
    node: Expression,
    parameter: Callable[[str], Any],
    number: Callable[[Fraction], Any],
    functions: Any = None,
    axes: tuple = (),
) -> Any:
    """The value of an expression in any arithmetic with + - * / and powers.

    parameter: function that returns the value of a parameter, by its name.
    number: function that converts a rational number to this arithmetic.
    functions: module or object with the functions of this arithmetic, such as `sqrt` and `sin`. It is needed only for
        roots and functions that contain a parameter. All others are computed as rationals with BITS correct bits.
    axes: values of x, y and z.
    """

    def leaf(n: Expression) -> Any:
        match n:
            case Axis(index):
                return axes[index]
            case Parameter(name):
                return parameter(name)
            case Root(of) | Function(of) if of.parametric:
                name = n.name if isinstance(n, Function) else "sqrt"
                if functions is None:
                    raise ValueError(f"{name} of a parameter needs functions")
                return getattr(functions, name)(evaluate(of, parameter, number, functions))
        return number(rational(n, {}))

    return fold(node, number, leaf)


def rational(
    node: Expression, parameters: dict[str, Fraction], point: tuple[Fraction, ...] = (), bits: int = BITS
) -> Fraction:
    """The value of an expression at a point, as a rational number.

    It is exact, except that pi, phi, square roots and functions are correct to `bits` bits only.

    point: values of x, y and z; not needed for constants.
    """
    return fold(node, Fraction, lambda leaf: _leaf(leaf, parameters, point, bits))


def _leaf(node: Expression, parameters: dict[str, Fraction], point: tuple[Fraction, ...], bits: int) -> Fraction:
    """The value of a leaf of an expression, such as a coordinate, pi or a square root; see `rational`."""
    match node:
        case Axis(index):
            return Fraction(point[index])
        case Parameter(name):
            return parameters[name]
        case NamedConstant("pi"):
            return _pi(bits)
        case NamedConstant():
            return (1 + square_root(Fraction(5), bits)) / 2
    value = _function if isinstance(node, Function) else _root
    return value(node, tuple(sorted(parameters.items())) if node.parametric else (), bits)


@lru_cache(maxsize=1024)
def _root(node: Root, parameters: tuple[tuple[str, Fraction], ...], bits: int) -> Fraction:
    """The square root of a constant, correct to `bits` bits. parameters: pairs (name, value)."""
    of, values = node.of, dict(parameters)
    value = rational(of, values, (), bits)
    # Rounding may leave a tiny number, perhaps a negative one, of a constant that is 0, such as sqrt(2)^2 - 2.
    return square_root(Fraction(0) if is_negligible(value, of, values, (), bits) else value, bits)


@lru_cache(maxsize=1024)
def _function(node: Function, parameters: tuple[tuple[str, Fraction], ...], bits: int) -> Fraction:
    """The value of a function of a constant, correct to `bits` bits. parameters: pairs (name, value).

    It is computed with more and more bits, until two values agree. PolynomialError is raised for an infinite value, and
    for one outside the range of constants.
    """
    values, last = dict(parameters), None
    for more in GUARD_BITS:
        working = bits + more
        of = rational(node.of, values, (), working)
        if is_negligible(of, node.of, values, (), working):
            of = Fraction(0)
        value = _by_mpmath(node, of, working)
        if last is not None and abs(value - last) * (1 << bits) <= abs(value):
            return value
        last = value
    # Values that never agree shrink to 0, as those of sin(pi) do, or they grow beyond all bounds.
    if abs(last) * (1 << GUARD_BITS[-1] // 2) < 1:
        return Fraction(0)
    raise PolynomialError(f"{node.written} is infinite, or cannot be computed to the last digit; write another number")


def _by_mpmath(node: Function, of: Fraction, bits: int) -> Fraction:
    """The value of a function at `of`, with a relative error of about 2^-bits from the function itself."""
    import mpmath

    if node.name in ("asin", "acos"):
        of = max(Fraction(-1), min(Fraction(1), of))
    with mpmath.workprec(bits):
        value = getattr(mpmath, node.name)(mpmath.mpf(of.numerator) / of.denominator)
        # The size is checked before the number is computed, because exp(1e9) does not fit in memory.
        if value and not (mpmath.isfinite(value) and abs(mpmath.mag(value)) <= MAX_SIZE):
            raise PolynomialError(
                f"{node.written} is too large or too small; a constant is 0 or between 1e-301 and 1e301"
            )
        return Fraction(*map(int, mpmath.libmp.to_rational(value._mpf_)))


def square_root(value: Fraction, bits: int = BITS) -> Fraction:
    """The square root of a rational number. It is exact if it is rational, and correct to `bits` bits otherwise.

    Domain: value >= 0.
    """
    n, d = value.numerator, value.denominator
    if isqrt(n) ** 2 == n and isqrt(d) ** 2 == d:
        return Fraction(isqrt(n), isqrt(d))
    # Half the number of bits by which the value is shifted, so that its root has `bits` bits before the point.
    half = bits + (d.bit_length() - n.bit_length()) // 2 + 1
    shifted = (n << 2 * half) // d if half > 0 else n // (d << -2 * half)
    return Fraction(isqrt(shifted)) / (Fraction(2) ** half)


@cache
def _pi(bits: int) -> Fraction:
    """The number pi, correct to `bits` bits, by Machin's formula: pi / 4 = 4 arctan(1/5) - arctan(1/239)."""
    unit = 1 << bits + 16  # each of the bits / 2 terms is rounded down by less than 1 / unit

    def arctan_of_reciprocal(n: int) -> int:
        total = power = unit // n
        k = 1
        while power:
            power //= -n * n
            k += 2
            total += power // k
        return total

    return Fraction(4 * (4 * arctan_of_reciprocal(5) - arctan_of_reciprocal(239)), unit)


def has_zero_root(node: Expression, parameters: dict[str, Fraction], varied: Collection[str]) -> bool:
    """Whether the expression contains a square root that is 0 and contains one of the parameters `varied`. An arc sine
    or cosine of 1 or -1 counts as one, because its slope is infinite too."""
    if isinstance(node, Root | Function) and _has_parameter(node.of, varied):
        if isinstance(node, Root) and not rational(node, parameters):
            return True
        if isinstance(node, Function) and node.name in ("asin", "acos") and abs(rational(node.of, parameters)) == 1:
            return True
    return any(has_zero_root(x, parameters, varied) for x in operands(node))


def _has_parameter(node: Expression, names: Collection[str]) -> bool:
    """Whether the expression contains one of the named parameters."""
    if isinstance(node, Parameter):
        return node.name in names
    return any(_has_parameter(x, names) for x in operands(node))


def inexact(constants: Iterable[Expression]) -> tuple[str, ...]:
    """Texts of the functions in the constants, each once: they have no form in numbers and square roots."""
    functions = outermost(constants, lambda node: isinstance(node, Function))
    return tuple(dict.fromkeys(function.written for function in functions))


def is_zero(node: Expression) -> bool:
    """Whether a constant is 0 and contains no parameter."""
    return not node.parametric and is_negligible(rational(node, {}), node, {})


def is_negligible(
    value: Fraction,
    node: Expression,
    parameters: dict[str, Fraction],
    point: tuple[Fraction, ...] = (),
    bits: int = BITS,
) -> bool:
    """Whether `value` is 0, up to the rounding of irrational constants. It is the value of `node` at `point`.

    bits: number of correct bits of the irrational constants in `value`.
    """
    if not value or not node.irrational:
        return not value
    # If a sum of irrational constants is 0, its computed value is tiny: less than 2^(-bits/2) times the sum of the
    # absolute values of its terms.
    sizes = _sizes(node, parameters, point, bits)
    return abs(value) < rational(sizes, {}) / (1 << bits // 2)


def _sizes(node: Expression, parameters: dict[str, Fraction], point: tuple[Fraction, ...], bits: int) -> Expression:
    """The expression with the absolute values of its leaves, and with a plus for every minus.

    Its value is a bound on the sum of the absolute values of all terms.
    """

    def sizes(n: Expression) -> Expression:
        return _sizes(n, parameters, point, bits)

    match node:
        case Number(value):
            return Number(abs(value))
        case Negative(of):
            return sizes(of)
        case Power(of, exponent=n):
            return Power(sizes(of), n)
        case Sum(parts):
            return Sum(tuple(map(sizes, parts)))
        case Product(parts):
            return Product(tuple(map(sizes, parts)))
    return Number(abs(rational(node, parameters, point, bits)))
