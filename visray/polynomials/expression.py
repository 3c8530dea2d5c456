"""Expressions: polynomials in x, y and z as trees, in the form in which they were written."""

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from math import isqrt
from typing import Any

PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798")
# Irrational constants are approximated by rationals to this many bits (77 digits), far more than a double has.
BITS = 256


class Expression:
    """A node of an expression. It is a constant if its degree, as written, is 0."""

    degree = 0
    parametric = False  # contains a parameter
    irrational = False  # contains pi, phi or a square root


@dataclass(frozen=True)
class Number(Expression):
    """A rational number."""

    value: Fraction


@dataclass(frozen=True)
class NamedConstant(Expression):
    """One of the constants pi and phi."""

    name: str
    irrational = True


@dataclass(frozen=True)
class Parameter(Expression):
    """A named number whose value is given separately."""

    name: str
    parametric = True


@dataclass(frozen=True)
class Axis(Expression):
    """A coordinate: x, y or z for the index 0, 1 or 2."""

    index: int
    degree = 1


@dataclass(frozen=True)
class _Unary(Expression):
    """A node with one operand."""

    of: Expression
    degree: int = field(init=False, compare=False, repr=False)
    parametric: bool = field(init=False, compare=False, repr=False)
    irrational: bool = field(init=False, compare=False, repr=False)

    def __post_init__(self):
        _set_facts(self, self.of.degree, (self.of,))


@dataclass(frozen=True)
class Root(_Unary):
    """The square root of a constant."""

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "irrational", True)


@dataclass(frozen=True)
class Reciprocal(_Unary):
    """The reciprocal of a constant."""


@dataclass(frozen=True)
class Negative(_Unary):
    """The negative of an expression."""


@dataclass(frozen=True)
class Power(_Unary):
    """An expression to a power that is a natural number."""

    exponent: int

    def __post_init__(self):
        _set_facts(self, self.of.degree * self.exponent, (self.of,))


@dataclass(frozen=True)
class _Nary(Expression):
    """A node with any number of operands."""

    parts: tuple[Expression, ...]
    degree: int = field(init=False, compare=False, repr=False)
    parametric: bool = field(init=False, compare=False, repr=False)
    irrational: bool = field(init=False, compare=False, repr=False)


@dataclass(frozen=True)
class Sum(_Nary):
    """A sum of expressions."""

    def __post_init__(self):
        _set_facts(self, max((p.degree for p in self.parts), default=0), self.parts)


@dataclass(frozen=True)
class Product(_Nary):
    """A product of expressions."""

    def __post_init__(self):
        _set_facts(self, sum(p.degree for p in self.parts), self.parts)


def _set_facts(node: Expression, degree: int, parts: tuple[Expression, ...]):
    """Sets the degree of a node, and what it contains according to its operands."""
    object.__setattr__(node, "degree", degree)
    object.__setattr__(node, "parametric", any(p.parametric for p in parts))
    object.__setattr__(node, "irrational", any(p.irrational for p in parts))


ONE = Product(())  # the coefficient of a monomial that is written without one


def fold(node: Expression, number: Callable[[Fraction], Any], leaf: Callable[[Expression], Any]) -> Any:
    """The value of an expression in another arithmetic.

    number: converts a rational number.
    leaf: gives the value of a coordinate, a parameter, pi, phi or a square root.
    """
    match node:
        case Number(value):
            return number(value)
        case Negative(of):
            return -fold(of, number, leaf)
        case Reciprocal(of):
            return number(Fraction(1)) / fold(of, number, leaf)
        case Power(of, exponent=n):
            return fold(of, number, leaf) ** n
        case Sum(parts):
            total = fold(parts[0], number, leaf) if parts else number(Fraction(0))
            for p in parts[1:]:
                total = total + fold(p, number, leaf)
            return total
        case Product(parts):
            product = fold(parts[0], number, leaf) if parts else number(Fraction(1))
            for p in parts[1:]:
                product = product * fold(p, number, leaf)
            return product
    return leaf(node)


def evaluate(
    node: Expression,
    parameter: Callable[[str], Any],
    number: Callable[[Fraction], Any],
    sqrt: Callable[[Any], Any] | None = None,
    axes: tuple = (),
) -> Any:
    """The value of an expression in any arithmetic with + - * / and powers.

    parameter: gives the value of a parameter by its name.
    number: converts a rational number.
    sqrt: takes the square root of a value that contains a parameter. Other roots are computed here, to BITS.
    axes: values of x, y and z.
    """

    def leaf(n: Expression) -> Any:
        match n:
            case Axis(index):
                return axes[index]
            case Parameter(name):
                return parameter(name)
            case Root(of) if of.parametric:
                if sqrt is None:
                    raise ValueError("a square root of a parameter needs sqrt")
                return sqrt(evaluate(of, parameter, number, sqrt))
        return number(rational(n, {}))

    return fold(node, number, leaf)


def rational(node: Expression, parameters: dict[str, Fraction], point: tuple = ()) -> Fraction:
    """The value of an expression at a point as a rational: exact, or correct to BITS if it is irrational."""

    def leaf(n: Expression) -> Fraction:
        match n:
            case Axis(index):
                return Fraction(point[index])
            case Parameter(name):
                return parameters[name]
            case NamedConstant("pi"):
                return PI
            case NamedConstant():
                return (1 + square_root(Fraction(5))) / 2
        return square_root(rational(n.of, parameters))

    return fold(node, Fraction, leaf)


def square_root(value: Fraction) -> Fraction:
    """The square root of a rational: exact for squares of rationals, else correct to BITS."""
    n, d = value.numerator, value.denominator
    if isqrt(n) ** 2 == n and isqrt(d) ** 2 == d:
        return Fraction(isqrt(n), isqrt(d))
    k = BITS + max(0, d.bit_length() - n.bit_length())
    return Fraction(isqrt(n * d << 2 * k), d << k)


def is_zero(node: Expression) -> bool:
    """Whether a constant is 0 for all values of the parameters."""
    return not node.parametric and is_negligible(rational(node, {}), node, {})


def is_negligible(value: Fraction, node: Expression, parameters: dict[str, Fraction], point: tuple = ()) -> bool:
    """Whether a value of an expression is 0, up to the rounding of its irrational constants."""
    if not value or not node.irrational:
        return not value
    # Irrational constants are correct to BITS. Where they cancel in a sum, the rest is below half as many bits.
    sizes = {name: abs(v) for name, v in parameters.items()}
    return abs(value) < rational(_positive(node), sizes, tuple(map(abs, point))) / (1 << BITS // 2)


def _positive(node: Expression) -> Expression:
    """The expression with all signs positive."""
    match node:
        case Number(value):
            return Number(abs(value))
        case Negative(of):
            return _positive(of)
        case Power(of, exponent=n):
            return Power(_positive(of), n)
        case Sum(parts):
            return Sum(tuple(map(_positive, parts)))
        case Product(parts):
            return Product(tuple(map(_positive, parts)))
    return node
