"""Constants as numbers of sympy, and back.

sympy knows many functions of constants exactly, such as cos(2*pi/5) = (sqrt(5) - 1)/4. It is imported only when it is
needed, because its import takes 0.4 s.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import (
    Expression,
    Function,
    NamedConstant,
    Negative,
    Number,
    Parameter,
    Power,
    Product,
    Reciprocal,
    Root,
    Sum,
    operands,
)
from visray.polynomials.literals import FUNCTIONS

if TYPE_CHECKING:
    import sympy

# cos(pi/n) consists of square roots for n = 2^k, and for the products of 2^k and different ones of the primes 3, 5, 17.
MAX_PARTS, FERMAT = 255, 3 * 5 * 17
# Greatest number of square roots, one in the other or side by side, that replace one function.
MAX_ROOTS = 12
MAX_POWER = 32
# Greatest number of bits of the numerators and denominators in constants that sympy is asked about.
MAX_NUMBER_BITS = 64


def to_sympy(
    node: Expression, parameters: dict[str, Fraction], leaf: Callable[[Expression], Any] | None = None
) -> sympy.Expr:
    """A constant as a number of sympy.

    leaf: function that returns the number for pi or for a function, or None for the number itself.
    """
    import sympy

    def value(n: Expression) -> sympy.Expr:
        if leaf is not None and isinstance(n, NamedConstant | Function) and (given := leaf(n)) is not None:
            return given
        match n:
            case Number(v):
                return sympy.Rational(v.numerator, v.denominator)
            case Parameter(name):
                return sympy.Rational(parameters[name].numerator, parameters[name].denominator)
            case NamedConstant("pi"):
                return sympy.pi
            case NamedConstant():
                return (1 + sympy.sqrt(5)) / 2
            case Root(of):
                return sympy.sqrt(value(of))
            case Function(of, name=name):
                return getattr(sympy, name)(value(of))
            case Reciprocal(of):
                return 1 / value(of)
            case Negative(of):
                return -value(of)
            case Power(of, exponent=k):
                return value(of) ** k
            case Sum(parts):
                return sympy.Add(*map(value, parts))
        return sympy.Mul(*map(value, n.parts))

    return value(node)


def simplest(function: Function) -> Expression:
    """An equal constant in which as many functions as possible are replaced by numbers, pi and square roots.

    The functions that are left take arguments in a canonical form: cos(-9*pi/7) becomes -cos(2*pi/7). Raises
    PolynomialError if the function is infinite. Domain: functions without parameters that are real.
    """
    import sympy

    if not _is_simple(function.of):
        return function
    try:
        number = to_sympy(function, {})
        tangent = lambda n: sympy.sin(n.args[0]) / sympy.cos(n.args[0])  # noqa: E731 - used once
        number = number.replace(lambda n: isinstance(n, sympy.tan), tangent)
        number = number.replace(lambda n: isinstance(n, sympy.sin | sympy.cos), _in_roots)
    except Exception:
        # Whatever sympy fails at, it has no exact form.
        return function
    if number.has(sympy.zoo, sympy.oo, -sympy.oo, sympy.nan):
        raise PolynomialError(f"{function.written} is infinite; write another number")
    expression = _from_sympy(number, function.written)
    return function if expression is None else expression


def _is_simple(node: Expression) -> bool:
    """Whether sympy surely finds a form of a function of this constant in a short time: the constant has short numbers
    and at most one function. Others have an exact form only in contrived cases."""
    functions, nodes = 0, [node]
    while nodes:
        n = nodes.pop()
        functions += isinstance(n, Function)
        if isinstance(n, Number) and max(map(int.bit_length, n.value.as_integer_ratio())) > MAX_NUMBER_BITS:
            return False
        nodes += operands(n)
    return functions <= 1


def _in_roots(of: sympy.Expr) -> sympy.Expr:
    """The sine or cosine `of` a rational multiple of pi in square roots, if that takes at most MAX_ROOTS of them."""
    import sympy

    turn = of.args[0] / sympy.pi
    if not turn.is_Rational:
        return of
    odd = turn.q
    while odd % 2 == 0:
        odd //= 2
    if turn.q > MAX_PARTS or FERMAT % odd:
        return of
    quarter = 0 if isinstance(of, sympy.cos) else sympy.pi / 2
    roots = sympy.cos(of.args[0] - quarter).rewrite(sympy.sqrt)
    return roots if roots.count(lambda n: n.is_Pow and not n.exp.is_Integer) <= MAX_ROOTS else of


def _from_sympy(number: sympy.Expr, written: str) -> Expression | None:
    """A number of sympy as an expression; None if it contains what expressions cannot express.

    written: text of which the number is the value.
    """
    import sympy

    def part(n: sympy.Expr) -> Expression | None:
        return _from_sympy(n, written)

    match number:
        case sympy.Rational():
            return Number(Fraction(int(number.p), int(number.q)))
        case sympy.pi:
            return NamedConstant("pi")
        case sympy.E:
            return Function(Number(Fraction(1)), "exp", written)
        case sympy.Add() | sympy.Mul():
            parts = tuple(map(part, number.args))
            kind = Sum if isinstance(number, sympy.Add) else Product
            return None if None in parts else kind(parts)
        case sympy.exp():
            return _exponential(number.exp, written)
        case sympy.Pow():
            return _power(number, written)
    if type(number).__name__ in FUNCTIONS and (of := part(number.args[0])) is not None:
        return Function(of, type(number).__name__, written)
    return None


def _exponential(exponent: sympy.Expr, written: str) -> Expression | None:
    """The constant exp(exponent). For a rational number, it is a power of the exponential of the number's unit part."""
    of, n = exponent, 1
    if exponent.is_Rational and abs(exponent.p) <= MAX_POWER:
        of, n = exponent / exponent.p, int(exponent.p)
    of = _from_sympy(of, written)
    if of is None:
        return None
    base = Function(of, "exp", written)
    base = Power(base, abs(n)) if abs(n) > 1 else base
    return Reciprocal(base) if n < 0 else base


def _power(number: sympy.Pow, written: str) -> Expression | None:
    """The power of a constant, as an expression: of powers, square roots, or exp and log."""
    base, exponent = number.args
    if exponent.is_Rational and exponent.q <= 2 and abs(exponent.p) <= MAX_POWER:
        of = _from_sympy(base, written)
        if of is None:
            return None
        of = Root(of) if exponent.q == 2 else of
        of = Power(of, int(abs(exponent.p))) if abs(exponent.p) > 1 else of
        return Reciprocal(of) if exponent.p < 0 else of
    import sympy

    logarithm = _from_sympy(exponent * sympy.log(base, evaluate=False), written)
    return logarithm and Function(logarithm, "exp", written)
