"""Square roots, powers and functions of constants, from their operands to expressions.

A constant is an expression without x, y and z. A result is exact if it consists of rational numbers and square roots.
All other results keep the function, and are computed to the last digit.
"""

from fractions import Fraction

from visray.polynomials.constants import is_negligible, rational, square_root
from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import (
    Expression,
    Function,
    Negative,
    Number,
    Power,
    Product,
    Reciprocal,
    Root,
    Sum,
    operands,
)
from visray.polynomials.sympy_constants import simplest

# Greatest number of functions in one another, as in sin(cos(1)).
MAX_NESTED = 8
_ONE = Fraction(1)


def value_of(constant: Expression, parameters: dict[str, Fraction]) -> Fraction:
    """The value of a constant; 0 if it is 0 up to rounding."""
    value = rational(constant, parameters)
    return Fraction(0) if is_negligible(value, constant, parameters) else value


def root_of(of: Expression, parameters: dict[str, Fraction], argument: str) -> Expression:
    """The square root of a constant. argument: text of the constant, for messages."""
    value = value_of(of, parameters)
    if value < 0:
        raise PolynomialError(f"sqrt of {argument}, which is negative; it takes a number of at least 0")
    if not of.parametric and (not of.irrational or not value) and (root := square_root(value)) ** 2 == value:
        return Number(root)
    return Root(of)


def function_of(name: str, of: Expression, parameters: dict[str, Fraction], argument: str, written: str) -> Expression:
    """The function `name` of a constant.

    argument, written: texts of the constant and of the whole function, for messages.
    """
    if _nesting(of) >= MAX_NESTED:
        raise PolynomialError(f"{written} has too many functions in one another; at most {MAX_NESTED}")
    if name == "log" and value_of(of, parameters) <= 0:
        raise PolynomialError(f"log of {argument}, which is not above 0; it takes a number above 0")
    if name in ("asin", "acos"):
        for bound in (Sum((of, Number(-_ONE))), Negative(Sum((of, Number(_ONE))))):
            if value_of(bound, parameters) > 0:
                raise PolynomialError(f"{name} of {argument}; it takes a number from -1 to 1")
    function = Function(of, name, written)
    return function if of.parametric else simplest(function)


def power_of(
    base: Expression, exponent: Expression, parameters: dict[str, Fraction], argument: str, written: str
) -> Expression:
    """The power of a constant whose exponent is a constant that is not written as a whole number.

    argument, written: texts of the base and of the whole power, for messages.
    """
    value, n = value_of(base, parameters), value_of(exponent, parameters)
    if not value and n <= 0:
        raise PolynomialError(f"{written} divides by 0; write another number")
    if not value and not base.parametric:
        return Number(Fraction(0))
    exact = not exponent.irrational and not exponent.parametric
    if exact and n.denominator == 1:
        power = Power(base, abs(int(n))) if n else Number(_ONE)
        return Reciprocal(power) if n < 0 else power
    if value < 0:
        raise PolynomialError(f"{written} has a negative base, {argument}; only a whole exponent is possible there")
    if exact and n.denominator == 2:
        return power_of(root_of(base, parameters, argument), Number(2 * n), parameters, argument, written)
    if not value:
        return Root(base)  # which is 0 too, has no derivative either, and keeps the parameters
    logarithm = function_of("log", base, parameters, argument, written)
    return function_of("exp", Product((exponent, logarithm)), parameters, argument, written)


def _nesting(node: Expression) -> int:
    """The number of functions in one another in an expression."""
    return max(map(_nesting, operands(node)), default=0) + isinstance(node, Function)
