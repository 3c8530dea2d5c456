"""Polynomials in x, y and z as trees, as they were written."""

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from math import isqrt
from typing import Any

PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798")
# Irrational constants are rationals good to this many bits (77 digits), far beyond the doubles they end as.
BITS = 256


class Expression:
    """A node. A tree is a constant where its degree, as written, is 0."""

    degree = 0
    parametric = False  # has a parameter in it
    irrational = False  # has pi, phi or a square root in it


@dataclass(frozen=True)
class Number(Expression):
    """A number literal, exactly."""

    value: Fraction


@dataclass(frozen=True)
class NamedConstant(Expression):
    """pi or phi."""

    name: str
    irrational = True


@dataclass(frozen=True)
class Parameter(Expression):
    """A number that has a name and is given apart."""

    name: str
    parametric = True


@dataclass(frozen=True)
class Axis(Expression):
    """x, y or z."""

    index: int
    degree = 1


@dataclass(frozen=True)
class _Unary(Expression):
    of: Expression
    degree: int = field(init=False, compare=False, repr=False)
    parametric: bool = field(init=False, compare=False, repr=False)
    irrational: bool = field(init=False, compare=False, repr=False)

    def __post_init__(self):
        _know(self, self.of.degree, (self.of,))


@dataclass(frozen=True)
class Root(_Unary):
    """The square root of a constant."""

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "irrational", True)


@dataclass(frozen=True)
class Reciprocal(_Unary):
    """1 / a constant."""


@dataclass(frozen=True)
class Negative(_Unary):
    """- a tree."""


@dataclass(frozen=True)
class Power(_Unary):
    """A tree to a whole power."""

    exponent: int

    def __post_init__(self):
        _know(self, self.of.degree * self.exponent, (self.of,))


@dataclass(frozen=True)
class _Nary(Expression):
    parts: tuple[Expression, ...]
    degree: int = field(init=False, compare=False, repr=False)
    parametric: bool = field(init=False, compare=False, repr=False)
    irrational: bool = field(init=False, compare=False, repr=False)


@dataclass(frozen=True)
class Sum(_Nary):
    """A sum of trees."""

    def __post_init__(self):
        _know(self, max((p.degree for p in self.parts), default=0), self.parts)


@dataclass(frozen=True)
class Product(_Nary):
    """A product of trees."""

    def __post_init__(self):
        _know(self, sum(p.degree for p in self.parts), self.parts)


def _know(node: Expression, degree: int, parts: tuple[Expression, ...]):
    object.__setattr__(node, "degree", degree)
    object.__setattr__(node, "parametric", any(p.parametric for p in parts))
    object.__setattr__(node, "irrational", any(p.irrational for p in parts))


ONE = Product(())  # the coefficient that is not written


def fold(node: Expression, number: Callable[[Fraction], Any], leaf: Callable[[Expression], Any]) -> Any:
    """The tree in another arithmetic: `number` takes literals there, `leaf` axes, parameters, pi, phi and roots."""
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
            whole = fold(parts[0], number, leaf) if parts else number(Fraction(1))
            for p in parts[1:]:
                whole = whole * fold(p, number, leaf)
            return whole
    return leaf(node)


def evaluate(
    node: Expression,
    parameter: Callable[[str], Any],
    number: Callable[[Fraction], Any],
    sqrt: Callable[[Any], Any] | None = None,
    axes: tuple = (),
) -> Any:
    """The tree in any arithmetic with + - * / and whole powers.

    Roots of numbers are taken exactly; only a root with a parameter in it asks for `sqrt`.
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
    """The tree as a rational at a point: exact, or good to BITS where it is irrational."""

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
    """Exact for squares of rationals, else good to BITS."""
    n, d = value.numerator, value.denominator
    if isqrt(n) ** 2 == n and isqrt(d) ** 2 == d:
        return Fraction(isqrt(n), isqrt(d))
    k = BITS + max(0, d.bit_length() - n.bit_length())
    return Fraction(isqrt(n * d << 2 * k), d << k)


def is_zero(node: Expression) -> bool:
    """Whether a constant is 0 whatever the parameters are."""
    return not node.parametric and is_negligible(rational(node, {}), node, {})


def is_negligible(value: Fraction, node: Expression, parameters: dict[str, Fraction], point: tuple = ()) -> bool:
    """Whether a value of the tree is 0, or no more than the rounding of its irrational constants."""
    if not value or not node.irrational:
        return not value
    # These are known to BITS; half of that bounds what is left of them where they cancel in a sum.
    sizes = {name: abs(v) for name, v in parameters.items()}
    return abs(value) < rational(_positive(node), sizes, tuple(map(abs, point))) / (1 << BITS // 2)


def _positive(node: Expression) -> Expression:
    """The tree with all signs +."""
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


def simplify(node: Expression) -> Expression:
    """The tree with nested sums and products as one, their constants merged and signs pulled out, nothing expanded."""
    if node.degree == 0:
        return node
    match node:
        case Negative(of):
            return negate(simplify(of))
        case Power(of, exponent=n):
            return _power(simplify(of), n)
        case Sum(parts):
            return _sum([simplify(p) for p in parts])
        case Product(parts):
            return _product([simplify(p) for p in parts])
    return node


def negate(node: Expression) -> Expression:
    match node:
        case Negative(of):
            return of
        case Product((first, *rest)) if first.degree == 0:
            return Product((negate(first), *rest))
        case Number(value):
            return Number(-value)
    return Negative(node)


def _power(of: Expression, n: int) -> Expression:
    if n == 1:
        return of
    match of:
        case Negative(inner):
            return _power(inner, n) if n % 2 == 0 else negate(_power(inner, n))
        case Power(inner, exponent=m):
            return Power(inner, m * n)
    return Power(of, n)


def _sum(parts: list[Expression]) -> Expression:
    terms, constants = [], []
    for p in parts:
        inner = [p]
        if isinstance(p, Sum):
            inner = p.parts
        elif isinstance(p, Negative) and isinstance(p.of, Sum):
            inner = [negate(t) for t in p.of.parts]
        for t in inner:
            (terms if t.degree else constants).append(t)
    if constants:
        constant = constants[0] if len(constants) == 1 else Sum(tuple(constants))
        if not terms or not is_zero(constant):
            terms.append(constant)
    return terms[0] if len(terms) == 1 else Sum(tuple(terms))


def _product(parts: list[Expression]) -> Expression:
    factors, constants, minus = [], [], False
    for p in parts:
        if isinstance(p, Negative) and p.degree:
            minus, p = not minus, p.of
        for t in p.parts if isinstance(p, Product) else [p]:
            (factors if t.degree else constants).append(t)
    constants = [c for c in constants if c != ONE]
    if constants:
        constant = constants[0] if len(constants) == 1 else Product(tuple(constants))
        if is_zero(constant):
            return Number(Fraction(0))
        return Product((negate(constant) if minus else constant, *factors)) if factors else constant
    whole = factors[0] if len(factors) == 1 else Product(tuple(factors))
    return Negative(whole) if minus else whole


def translate(node: Expression, centre: tuple[Fraction, Fraction, Fraction]) -> Expression:
    """The tree about a centre: each x in it becomes x + centre's x, where that is not 0."""
    match node:
        case Axis(index) if centre[index]:
            return Sum((node, Number(centre[index])))
        case Sum(parts):
            return Sum(tuple(translate(p, centre) for p in parts))
        case Product(parts):
            return Product(tuple(translate(p, centre) for p in parts))
        case Negative(of):
            return Negative(translate(of, centre))
        case Power(of, exponent=n):
            return Power(translate(of, centre), n)
    return node
