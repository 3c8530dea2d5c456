"""Converts Python's syntax tree of a polynomial to an expression."""

import ast
import re
from difflib import get_close_matches
from fractions import Fraction

from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import (
    Axis,
    Expression,
    NamedConstant,
    Negative,
    Number,
    Parameter,
    Power,
    Product,
    Reciprocal,
    Sum,
)
from visray.polynomials.functions import function_of, power_of, root_of, value_of
from visray.polynomials.literals import (
    AXES,
    CONSTANTS,
    EULER,
    FUNCTIONS,
    MAX_DEGREE,
    RESERVED,
    is_allowed_size,
    literal,
    shortened,
    too_high,
)

MAX_DEPTH = 100
# Greatest number of bits of one exact constant, and of all constants in one text together.
MAX_BITS, MAX_ALL_BITS = 1 << 15, 1 << 18
IRRATIONAL_BITS = 600
_ALIASES = {"ln": "log(...)", "cbrt": "(...)^(1/3)", "abs": "the number without its sign", "arctan": "atan(...)"}
_ALIASES |= {"arcsin": "asin(...)", "arccos": "acos(...)", "pow": "a^b", "root": "a^(1/n)"}


def too_deep() -> PolynomialError:
    """The error for a text that is nested more deeply than MAX_DEPTH."""
    return PolynomialError(f"it is nested too deeply; at most {MAX_DEPTH} levels")


class Reader:
    """Converts a syntax tree of Python to an expression.

    text: the text that Python parsed.
    parameters: values of the parameters, by name.
    bits: sum of the numbers of bits of all constants converted so far.
    """

    def __init__(self, text: str, parameters: dict[str, Fraction]):
        self.text = text
        self.parameters = parameters
        self.bits = 0

    def source(self, node: ast.expr) -> str:
        """The piece of the parsed text that belongs to a node."""
        return self.text[node.col_offset : node.end_col_offset]

    def shown(self, node: ast.expr) -> str:
        """The piece of text that belongs to a node, shortened and with ^ for **, for a message."""
        return shortened(self.source(node).replace("**", "^"))

    def expression(self, node: ast.expr, depth: int) -> Expression:
        """The expression of a node. depth: number of levels above the node; at most MAX_DEPTH are allowed."""
        if depth > MAX_DEPTH:
            raise too_deep()
        match node:
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self.checked(Sum(tuple(self.terms(node, depth))), node)
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                return self.checked(Product(tuple(self.factors(node, depth))), node)
            case ast.BinOp(op=ast.Pow()):
                return self.power(node, depth)
            case ast.UnaryOp(op=ast.UAdd()):
                return self.expression(node.operand, depth + 1)
            case ast.UnaryOp(op=ast.USub()):
                return Negative(self.expression(node.operand, depth + 1))
            case ast.Constant():
                if number := literal(self.source(node)):
                    return number
            case ast.Name(id=name):
                return self.named(name)
            case ast.Call():
                return self.call(node, depth)
        raise PolynomialError(
            f"{self.shown(node)!r} has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have"
        )

    def terms(self, node: ast.expr, depth: int) -> list[Expression]:
        """The terms of a sum, as expressions.

        In Python's tree, a sum of n terms has n - 1 levels. A loop goes down these levels, so they do not count as
        depth.
        """
        terms = []
        while isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
            term = self.expression(node.right, depth + 1)
            terms.append(Negative(term) if isinstance(node.op, ast.Sub) else term)
            node = node.left
        terms.append(self.expression(node, depth + 1))
        return terms[::-1]

    def factors(self, node: ast.expr, depth: int) -> list[Expression]:
        """The factors of a product, as expressions. A divisor becomes the factor 1 / divisor."""
        factors = []
        while isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Mult, ast.Div)):
            factor = self.expression(node.right, depth + 1)
            factors.append(self.divisor(factor, node.right) if isinstance(node.op, ast.Div) else factor)
            node = node.left
        factors.append(self.expression(node, depth + 1))
        return factors[::-1]

    def divisor(self, of: Expression, node: ast.expr) -> Expression:
        """The expression 1 / of. PolynomialError is raised unless `of` is a constant other than 0.

        node: syntax tree of the divisor.
        """
        if of.degree:
            raise PolynomialError(f"it divides by {self.shown(node)}; only division by constants leaves a polynomial")
        if not value_of(of, self.parameters):
            raise PolynomialError(f"it divides by {self.shown(node)}, which is 0; divide by another number")
        return Reciprocal(of)

    def power(self, node: ast.BinOp, depth: int) -> Expression:
        """The expression of a power. PolynomialError is raised if the exponent is not a whole number.

        The exponent of a constant may be any constant.
        """
        of, exponent = self.expression(node.left, depth + 1), node.right
        written = self.source(exponent)
        if not (isinstance(exponent, ast.Constant) and written.isdecimal()):
            by = self.expression(exponent, depth + 1) if not of.degree else None
            if by is None or by.degree:
                raise PolynomialError(
                    f"the exponent {self.shown(exponent)} is not allowed; it is a whole number as in x^2"
                )
            return self.constant_power(of, by, node)
        n = int(written) if len(written) < 10 else 10**9
        if of.degree:
            if of.degree * n > MAX_DEGREE:
                raise too_high(of.degree * n)
            return Power(of, n) if n else Number(Fraction(1))
        # The bits of the result are checked before it is computed.
        if n * _bits(of) > MAX_BITS:
            raise self.unwieldy(node)
        return self.checked(Power(of, n), node)

    def constant_power(self, of: Expression, exponent: Expression, node: ast.BinOp) -> Expression:
        """The power of a constant with a constant as its exponent. node: syntax tree of the power."""
        size = value_of(exponent, self.parameters)
        # The bits of a rational result are checked before it is computed.
        if exponent.irrational or exponent.parametric or abs(size) * _bits(of) <= MAX_BITS:
            power = power_of(of, exponent, self.parameters, self.shown(node.left), self.shown(node))
            return self.checked(power, node)
        raise self.unwieldy(node)

    def checked(self, expression: Expression, node: ast.expr) -> Expression:
        """Returns the expression unchanged. Raises PolynomialError for a constant that is too long, large or small.

        node: syntax tree of the expression, for the message.
        """
        if expression.degree:
            return expression
        bits = _bits(expression)
        self.bits += bits
        if bits > MAX_BITS or self.bits > MAX_ALL_BITS:
            raise self.unwieldy(node)
        value = value_of(expression, self.parameters)
        if value and not is_allowed_size(value):
            raise PolynomialError(
                f"{self.shown(node)} is too large or too small; a constant is 0 or between 1e-301 and 1e301"
            )
        return expression

    def unwieldy(self, node: ast.expr) -> PolynomialError:
        """The error for a constant that has too many bits. node: its syntax tree."""
        return PolynomialError(f"{self.shown(node)} has too many digits to be computed exactly; write a shorter number")

    def named(self, name: str) -> Expression:
        """The coordinate, constant or parameter with this name, as an expression. Raises PolynomialError for other
        names."""
        if name in AXES:
            return Axis(AXES.index(name))
        if name in CONSTANTS:
            return NamedConstant(name)
        if name in self.parameters:
            return Parameter(name)
        if name == EULER:
            return function_of("exp", Number(Fraction(1)), {}, "1", EULER)
        if name == "sqrt" or name in FUNCTIONS:
            raise PolynomialError(f"{name} stands without brackets; write {name}(2)")
        if re.fullmatch(r"[xyzXYZ]\d+", name):
            hint = f"write {name[0].lower()}^{name[1:]}"
        elif re.fullmatch(r"[xyz]+", name):
            hint = f"write {'*'.join(name)}"
        else:
            hint = self.hint(name)
        raise PolynomialError(f"unknown name {shortened(name)}; {hint}")

    def hint(self, name: str) -> str:
        """Text for a message about an unknown name: the most similar known name, and all known names."""
        choices = [*RESERVED, EULER, *self.parameters]
        near = [c for c in choices if c.casefold() == name.casefold()] or get_close_matches(name, choices, 1)
        listed = f"one of {', '.join(choices)}"
        return f"did you mean {near[0]}? ({listed})" if near else listed

    def call(self, node: ast.Call, depth: int) -> Expression:
        """The expression of a function of a constant, such as sqrt(2). Raises PolynomialError for other calls."""
        function = node.func
        if not isinstance(function, ast.Name):
            raise PolynomialError(f"a sign is missing before a bracket in {self.shown(node)}; write * for a product")
        name = function.id
        if name in AXES or name in CONSTANTS or name in self.parameters or name == EULER:
            raise PolynomialError(f"a sign is missing in {self.shown(node)}; write {name}*(...)")
        if name != "sqrt" and name not in FUNCTIONS:
            known = f"write {_ALIASES[name]}" if name in _ALIASES else f"one of sqrt, {', '.join(FUNCTIONS)}"
            raise PolynomialError(f"unknown function {shortened(name)}; {known}, of a constant")
        if len(node.args) != 1 or node.keywords:
            raise PolynomialError(f"{name} takes one number; write {name}(2)")
        of, argument = self.expression(node.args[0], depth + 1), self.shown(node.args[0])
        if of.degree:
            raise PolynomialError(f"{name} of {argument} is no polynomial; only constants have a {name} here")
        if name == "sqrt":
            return self.checked(root_of(of, self.parameters, argument), node)
        return self.checked(function_of(name, of, self.parameters, argument, self.shown(node)), node)


def _bits(node: Expression) -> int:
    """Estimate of how many bits a constant has when it is computed exactly."""
    match node:
        case Number(value):
            return value.numerator.bit_length() + value.denominator.bit_length()
        case Sum(parts) | Product(parts):
            return sum(map(_bits, parts))
        case Power(of, exponent=n):
            return n * _bits(of)
        case Negative(of) | Reciprocal(of):
            return _bits(of)
        case Parameter():
            return 64
    return IRRATIONAL_BITS
