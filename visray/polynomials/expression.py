"""Expressions: polynomials in x, y and z as trees, in the form in which they were written.

A constant is an expression without x, y and z. It may contain parameters, pi, phi (the golden ratio), square roots, and
functions such as sin and exp.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any


class Expression:
    """A node of an expression tree. It is a constant if its degree is 0.

    degree: degree of the expression as it is written, even if its highest terms cancel.
    parametric: whether it contains a parameter.
    irrational: whether it contains pi, phi, a square root or a function.
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
class Function(_Unary):
    """A function of a constant, such as sin(1). Its exact value has no other form here.

    name: name of the function, as Python's module math has it.
    written: the text that it stands for, for messages.
    """

    name: str
    written: str = field(default="", compare=False)

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


def operands(node: Expression) -> tuple[Expression, ...]:
    """The operands of a node."""
    return node.parts if isinstance(node, _Nary) else (node.of,) if isinstance(node, _Unary) else ()


def outermost(nodes: Iterable[Expression], wanted: Callable[[Expression], bool]) -> Iterator[Expression]:
    """Yields the nodes in some expressions for which `wanted` is true. They are not searched for others inside them."""
    for node in nodes:
        if wanted(node):
            yield node
        else:
            yield from outermost(operands(node), wanted)


def fold(node: Expression, number: Callable[[Fraction], Any], leaf: Callable[[Expression], Any]) -> Any:
    """The value of an expression in another arithmetic, such as floats or numbers modulo a prime.

    number: function that converts a rational number to this arithmetic.
    leaf: function that returns the value of a coordinate, a parameter, pi, phi, a square root or a function.
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
