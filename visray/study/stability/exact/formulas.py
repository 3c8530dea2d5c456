"""Expressions as trees, which are computed in any ring, and python-flint.

Apart from visray.polynomials, so that the truth shares nothing with what it judges. f is taken as written: numbers are
exact, roots of numbers right to 2^-140.
"""

import ast
from fractions import Fraction
from math import isqrt
from typing import Any

from visray.errors import UserError

BITS = 140
PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798")


def flint() -> Any:
    """python-flint, or one line that says how to get it."""
    try:
        import flint as library
    except ImportError:
        raise UserError("python-flint is not installed: exact answers need it (pip install 'visray[test]')") from None
    return library


def rational(x: Any) -> Any:
    """A double or a Fraction as python-flint has it."""
    n, d = x.as_integer_ratio()
    return flint().fmpq(int(n), int(d))


def parsed(expression: str, parameters: dict[str, float] | None = None) -> tuple:
    """An expression as nested tuples: (operator, a, b), ("neg", a), ("x",), and Fractions, which are folded."""
    text = expression.replace("^", "**")
    try:
        return _tree(ast.parse(text.strip(), mode="eval").body, text.strip(), parameters or {})
    except (SyntaxError, KeyError, TypeError, ZeroDivisionError) as error:
        raise UserError(f"expression {expression!r}: is none that a polynomial can have ({error})") from None


def number(value: Any, parameters: dict[str, float] | None = None) -> Fraction:
    """A number, or an expression without x, y and z, exactly or to 2^-140."""
    return value if isinstance(value, Fraction) else parsed(str(value), parameters)


def _root(q: Fraction) -> Fraction:
    n, d = q.numerator, q.denominator
    return Fraction(isqrt(n * d << 2 * BITS), d << BITS)


def _tree(node: ast.AST, text: str, names: dict[str, float]) -> Any:
    match node:
        case ast.Constant():
            return Fraction(ast.get_source_segment(text, node))  # 0.9 is nine tenths
        case ast.Name(id="x" | "y" | "z" as name):
            return (name,)
        case ast.Name(id="phi"):
            return (1 + _root(Fraction(5))) / 2
        case ast.Name(id="pi"):
            return PI
        case ast.Name(id=name):
            return Fraction(names[name])
        case ast.Call(func=ast.Name(id="sqrt"), args=[of]):
            return _root(_tree(of, text, names))
        case ast.UnaryOp(op=ast.USub(), operand=of):
            a = _tree(of, text, names)
            return -a if isinstance(a, Fraction) else ("neg", a)
        case ast.UnaryOp(op=ast.UAdd(), operand=of):
            return _tree(of, text, names)
        case ast.BinOp(left=left, op=op, right=right):
            a, b = _tree(left, text, names), _tree(right, text, names)
            return _folded(type(op).__name__, a, b)
    raise TypeError(ast.unparse(node))


def _folded(op: str, a: Any, b: Any) -> Any:
    known = isinstance(a, Fraction) and isinstance(b, Fraction)
    match op:
        case "Add":
            return a + b if known else ("+", a, b)
        case "Sub":
            return a - b if known else ("-", a, b)
        case "Mult":
            return a * b if known else ("*", a, b)
        case "Div":
            return a / b if known else ("*", a, 1 / b)
        case "Pow" if isinstance(b, Fraction) and b.denominator == 1 and b >= (0 if not known else b):
            return a ** int(b) if known else ("^", a, int(b))
    raise TypeError(f"operator {op}")


def value(tree: Any, x: Any, y: Any, z: Any, number: Any) -> Any:
    """The expression in any ring; `number` makes a Fraction an element. What is written twice is computed once."""
    known: dict[Any, Any] = {("x",): x, ("y",): y, ("z",): z}

    def of(node: Any) -> Any:
        if node not in known:
            if isinstance(node, Fraction):
                known[node] = number(node)
            elif node[0] == "neg":
                known[node] = number(Fraction(-1)) * of(node[1])
            elif node[0] == "^":
                known[node] = power(node[1], node[2])
            else:
                a, b = of(node[1]), of(node[2])
                known[node] = a + b if node[0] == "+" else a - b if node[0] == "-" else a * b
        return known[node]

    def power(base: Any, n: int) -> Any:
        if n < 2:
            return of(base) if n else number(Fraction(1))
        half = of(("^", base, n // 2))
        return half * half if n % 2 == 0 else half * half * of(base)

    return of(tree)


def degree(tree: Any) -> int:
    """An upper bound of the total degree, exact unless leading terms cancel."""
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
