"""Expressions: polynomials in x, y and z as trees, in the form in which they were written.

A constant is an expression without x, y and z. It may contain parameters, pi, phi (the golden ratio) and square roots.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from math import isqrt
from typing import Any

PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798")
# Irrational constants are approximated by rationals with this many correct bits (77 decimal digits).
BITS = 256


class Expression:
    """A node of an expression tree. It is a constant if its degree is 0.

    degree: degree of the expression as it is written, even if its highest terms cancel.
    parametric: whether it contains a parameter.
    irrational: whether it contains pi, phi or a square root.
    """

    degree = 0
    parametric = False
    irrational = False


@dataclass(frozen=True)
class Number(Expression):
    """A rational number."""

    value: Fraction


@dataclass(frozen=True)
class NamedConstant(Expression):
    """One of the constants pi and phi, by its name. phi is the golden ratio (1 + sqrt(5)) / 2."""

    name: str
    irrational = True


@dataclass(frozen=True)
class Parameter(Expression):
    """A parameter, by its name. Its value is stored apart from the expression."""

    name: str
    parametric = True


@dataclass(frozen=True)
class Axis(Expression):
    """A coordinate: x, y or z if the index is 0, 1 or 2."""

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
    """A power of an expression. The exponent is a natural number."""

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
    """Sets the fields degree, parametric and irrational of a node. parts: the operands of the node."""
    object.__setattr__(node, "degree", degree)
    object.__setattr__(node, "parametric", any(p.parametric for p in parts))
    object.__setattr__(node, "irrational", any(p.irrational for p in parts))


ONE = Product(())  # the coefficient of a monomial that is written without a coefficient


def fold(node: Expression, number: Callable[[Fraction], Any], leaf: Callable[[Expression], Any]) -> Any:
    """The value of an expression in another arithmetic, such as floats or numbers modulo a prime.

    number: function that converts a rational number to this arithmetic.
    leaf: function that returns the value of a coordinate, a parameter, pi, phi or a square root.
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

    parameter: function that returns the value of a parameter, by its name.
    number: function that converts a rational number to this arithmetic.
    sqrt: function that returns a square root in this arithmetic. It is needed only for roots that contain a parameter.
        All other roots are computed as rationals with BITS correct bits.
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
    """The value of an expression at a point, as a rational number.

    It is exact, except that pi, phi and square roots are correct to BITS bits only.

    point: values of x, y and z; not needed for constants.
    """

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
    """The square root of a rational number. It is exact if it is rational, and correct to BITS bits otherwise."""
    n, d = value.numerator, value.denominator
    if isqrt(n) ** 2 == n and isqrt(d) ** 2 == d:
        return Fraction(isqrt(n), isqrt(d))
    k = BITS + max(0, d.bit_length() - n.bit_length())
    return Fraction(isqrt(n * d << 2 * k), d << k)


def is_zero(node: Expression) -> bool:
    """Whether a constant is 0 and contains no parameter."""
    return not node.parametric and is_negligible(rational(node, {}), node, {})


def is_negligible(value: Fraction, node: Expression, parameters: dict[str, Fraction], point: tuple = ()) -> bool:
    """Whether `value` is 0, up to the rounding of irrational constants. It is the value of `node` at `point`."""
    if not value or not node.irrational:
        return not value
    # Irrational constants are correct to BITS bits. If a sum of them is 0, its computed value is tiny: less than
    # 2^(-BITS/2) times the sum of the absolute values of its terms.
    sizes = {name: abs(v) for name, v in parameters.items()}
    return abs(value) < rational(_positive(node), sizes, tuple(map(abs, point))) / (1 << BITS // 2)


def _positive(node: Expression) -> Expression:
    """The expression with every minus replaced by a plus. Its value bounds the sum of all terms' absolute values."""
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
