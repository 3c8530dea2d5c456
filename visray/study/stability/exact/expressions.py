"""Polynomial expressions as trees that can be evaluated in any ring; and access to python-flint.

This module does not use visray.polynomials, so that the exact results share no code with the code under test.
Expressions are taken as they are written: decimal numbers are exact, square roots and functions of numbers have an
error of about 2^-140.
"""

import ast
from fractions import Fraction
from math import isqrt
from typing import Any

from visray.errors import UserError

BITS = 140
FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log")
PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798")


def flint() -> Any:
    """The module python-flint. If it is not installed, raises a UserError that says how to install it."""
    try:
        import flint as library
    except ImportError:
        raise UserError("python-flint is not installed: exact answers need it (pip install 'visray[test]')") from None
    return library


def rational(x: Any) -> Any:
    """A double or a Fraction as a python-flint rational."""
    n, d = x.as_integer_ratio()
    return flint().fmpq(int(n), int(d))


def parsed(expression: str, parameters: dict[str, float] | None = None) -> tuple:
    """The tree of an expression: (operator, a, b), ("neg", a), ("x",), or a Fraction.

    An operation on two constants is replaced by its result, a Fraction.

    parameters: values of the other names in the expression
    """
    text = expression.replace("^", "**")
    try:
        return _tree(ast.parse(text.strip(), mode="eval").body, text.strip(), parameters or {})
    except (SyntaxError, KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise UserError(
            f"expression {expression!r}: is not a polynomial ({error}); right would be one such as x^2 + y^2 - 1"
        ) from None


def number(value: Any, parameters: dict[str, float] | None = None) -> Fraction:
    """The value of an expression without x, y and z.

    value: a number, an expression, or a Fraction, which is returned unchanged
    parameters: values of the names in the expression
    Error: 0, or about 2^-140 for each square root and function.
    """
    return value if isinstance(value, Fraction) else parsed(str(value), parameters)


def _square_root(q: Fraction) -> Fraction:
    """The square root, rounded down to a multiple of 2^-BITS / q.denominator.

    Numbers that rounding made negative count as 0.
    """
    if -Fraction(1, 1 << BITS // 2) < q < 0:
        q = Fraction(0)
    n, d = q.numerator, q.denominator
    return Fraction(isqrt(n * d << 2 * BITS), d << BITS)


def _function(name: str, q: Fraction) -> Fraction:
    """A function of a number, from python-flint's balls."""
    with flint().ctx.workprec(4 * BITS + abs(q.numerator).bit_length()):
        mantissa, exponent = getattr(flint().arb(rational(q)), name)().mid().man_exp()
    return int(mantissa) * Fraction(2) ** int(exponent)


def _power(a: Fraction, b: Fraction) -> Fraction:
    """The power of a constant."""
    if b.denominator == 1:
        return a ** int(b)
    return _function("exp", b * _function("log", a)) if a else a


def _tree(node: ast.AST, text: str, names: dict[str, float]) -> Any:
    """The tree of a node of Python's syntax tree. text: the expression; names: values of parameters."""
    match node:
        case ast.Constant():
            return Fraction(ast.get_source_segment(text, node))  # 0.9 is nine tenths, not the nearest double
        case ast.Name(id="x" | "y" | "z" as name):
            return (name,)
        case ast.Name(id="phi"):
            return (1 + _square_root(Fraction(5))) / 2
        case ast.Name(id="pi"):
            return PI
        case ast.Name(id="e") if "e" not in names:
            return _function("exp", Fraction(1))
        case ast.Name(id=name):
            return Fraction(names[name])
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
            return _square_root(_tree(argument, text, names))
        case ast.Call(func=ast.Name(id=name), args=[argument]) if name in FUNCTIONS:
            return _function(name, _tree(argument, text, names))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            a = _tree(operand, text, names)
            return -a if isinstance(a, Fraction) else ("neg", a)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _tree(operand, text, names)
        case ast.BinOp(left=left, op=op, right=right):
            a, b = _tree(left, text, names), _tree(right, text, names)
            return _folded(type(op).__name__, a, b)
    raise TypeError(ast.unparse(node))


def _folded(op: str, a: Any, b: Any) -> Any:
    """The tree of an operation, or its result if both operands are Fractions. op: name of Python's syntax node."""
    constant = isinstance(a, Fraction) and isinstance(b, Fraction)
    match op:
        case "Add":
            return a + b if constant else ("+", a, b)
        case "Sub":
            return a - b if constant else ("-", a, b)
        case "Mult":
            return a * b if constant else ("*", a, b)
        case "Div":
            return a / b if constant else ("*", a, 1 / b)
        case "Pow" if constant:
            return _power(a, b)
        case "Pow" if isinstance(b, Fraction) and b.denominator == 1 and b >= 0:
            return ("^", a, int(b))
    raise TypeError(f"operator {op}")


def value(tree: Any, x: Any, y: Any, z: Any, number: Any) -> Any:
    """The value of a tree in any ring (numbers, arrays, polynomials). Equal subtrees are evaluated once.

    x, y, z: the ring's elements that replace x, y and z
    number: function from a Fraction to an element of the ring
    """
    values: dict[Any, Any] = {("x",): x, ("y",): y, ("z",): z}

    def evaluate(node: Any) -> Any:
        if node not in values:
            if isinstance(node, Fraction):
                values[node] = number(node)
            elif node[0] == "neg":
                values[node] = number(Fraction(-1)) * evaluate(node[1])
            elif node[0] == "^":
                values[node] = power(node[1], node[2])
            else:
                a, b = evaluate(node[1]), evaluate(node[2])
                values[node] = a + b if node[0] == "+" else a - b if node[0] == "-" else a * b
        return values[node]

    def power(base: Any, n: int) -> Any:
        if n < 2:
            return evaluate(base) if n else number(Fraction(1))
        half = evaluate(("^", base, n // 2))
        return half * half if n % 2 == 0 else half * half * evaluate(base)

    return evaluate(tree)


def degree(tree: Any) -> int:
    """An upper bound of the total degree of a tree. It is the degree itself unless leading terms cancel."""
    if isinstance(tree, Fraction):
        return 0
    match tree:
        case (_,):
            return 1
        case ("neg", a):
            return degree(a)
        case ("^", a, n):
            return n * degree(a)
        case ("*", a, b):
            return degree(a) + degree(b)
        case (_, a, b):
            return max(degree(a), degree(b))
