"""Text such as "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3" as a tree. Nothing in it is ever executed."""

import ast
import re
from difflib import get_close_matches
from fractions import Fraction
from itertools import pairwise
from keyword import iskeyword

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
    Root,
    Sum,
    is_zero,
    rational,
    square_root,
)

MAX_DEGREE = 32
MAX_LENGTH = 20_000
MAX_DEPTH = 100
# Constants between 2^-1000 and 2^1000 (about 1e-301 and 1e301) are doubles with all their digits.
MAX_EXPONENT = 1000
# A constant is computed exactly while it has at most so many bits, and all constants of a text together.
MAX_BITS, MAX_ALL_BITS = 1 << 15, 1 << 18
IRRATIONAL_BITS = 600
AXES, CONSTANTS = ("x", "y", "z"), ("phi", "pi")
RESERVED = (*AXES, *CONSTANTS, "sqrt")
EXAMPLE = "write for example x^2 + y^2 + z^2 - 1"
_LITERAL = re.compile(r"(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_STRANGE = re.compile(r"[^A-Za-z0-9_+\-*/^(). \t\r\n]")
_TOKEN = re.compile(rf"[A-Za-z_][A-Za-z0-9_]*|(?P<number>{_LITERAL.pattern})|\S", re.IGNORECASE)
_HINTS = {
    "=": "write f = g as f - g",
    "<": "a surface is f = 0, without a comparison",
    ">": "a surface is f = 0, without a comparison",
    ",": "decimals have a point, as in 0.5",
    "²": "write x^2",
    "³": "write x^3",
    "·": "write * for a product",
    "×": "write * for a product",  # noqa: RUF001
    "−": "write - for minus",  # noqa: RUF001
    "√": "write sqrt(2)",
    "φ": "write phi",
    "π": "write pi",
}


def parse(text: str, parameters: dict[str, float]) -> Expression:
    """The tree of a polynomial in x, y, z and the parameters; PolynomialError says what it cannot be."""
    exact = known(parameters)
    if len(text) > MAX_LENGTH:
        raise PolynomialError(f"it is {len(text)} characters long; at most {MAX_LENGTH}")
    if not text.strip():
        raise PolynomialError(f"it is empty; {EXAMPLE}")
    if strange := _STRANGE.search(text):
        c = strange.group()
        hint = _HINTS.get(c, "only numbers, names and + - * / ^ ( ) have a meaning")
        raise PolynomialError(f"unexpected {c!r} at column {strange.start() + 1}; {hint}")
    tokens = list(_TOKEN.finditer(text))
    _refuse_stuck(tokens)
    _refuse_open(tokens)
    text = re.sub(r"\s", " ", text)
    lead = len(text) - len(text.lstrip())
    # Where each character of the text for Python stood in the text.
    place = [k for k, c in enumerate(text) for _ in range(2 if c == "^" else 1)][lead:]
    python = text.replace("^", "**").strip()
    try:
        body = ast.parse(python, mode="eval").body
    except SyntaxError as e:
        at = place[min(max((e.offset or 1) - 1, 0), len(place) - 1)]
        if "nested" in (e.msg or ""):
            raise _deep() from None
        raise PolynomialError(f"not understood at column {at + 1}, near {_near(text, at)}; {EXAMPLE}") from None
    except (RecursionError, MemoryError):
        raise _deep() from None
    whole = _Reader(python, exact).tree(body, 0)
    if whole.degree > MAX_DEGREE:
        raise too_high(whole.degree)
    return whole


def known(parameters: dict[str, float]) -> dict[str, Fraction]:
    """The parameters, exactly."""
    for name, value in parameters.items():
        if name in RESERVED:
            raise PolynomialError(
                f"a parameter cannot be called {name}, which has a meaning already; take another name"
            )
        if not name.isidentifier() or not name.isascii() or iskeyword(name):
            raise PolynomialError(f"{name!r} is no name of a parameter; it has letters, digits and _, as in r or r_1")
        if value and not 2.0**-MAX_EXPONENT <= abs(value) <= 2.0**MAX_EXPONENT:
            raise PolynomialError(f"the parameter {name} is {value:g}; it is 0 or between 1e-301 and 1e301 in size")
    return {name: Fraction(value) for name, value in parameters.items()}


def too_high(degree: int) -> PolynomialError:
    """The line for a degree over the limit."""
    shown = degree if degree < 10**6 else "over a million"
    return PolynomialError(f"its degree, as written, is {shown}; at most {MAX_DEGREE}")


def literal(text: str) -> Number | None:
    """The exact value of a decimal literal, or None where it is none."""
    found = _LITERAL.fullmatch(text)
    if not found:
        return None
    # Sizes are bounded before the number is made: 1e999999999 would not fit in memory.
    if len(found[1]) > MAX_EXPONENT or len(found[2] or "") > 5 or abs(int((found[2] or "e0")[1:])) > MAX_EXPONENT:
        raise PolynomialError(f"the number {_cut(text)} has too many digits; it is 0 or between 1e-301 and 1e301")
    value = Fraction(text)
    if value and not _fits(value):
        raise PolynomialError(f"the number {_cut(text)} is too large or too small; it is 0 or between 1e-301 and 1e301")
    return Number(value)


def _fits(value: Fraction) -> bool:
    return abs(abs(value.numerator).bit_length() - value.denominator.bit_length()) <= MAX_EXPONENT


def _cut(text: str) -> str:
    return text if len(text) <= 20 else text[:17] + "..."


def _near(text: str, at: int) -> str:
    return repr(text[max(0, at - 5) : at + 6].strip())


def _deep() -> PolynomialError:
    return PolynomialError(f"it is nested too deeply; at most {MAX_DEPTH} levels")


def _refuse_stuck(tokens: list[re.Match]):
    """2x and 2(x + 1), which Python would read as something else or not at all."""
    for token, after in pairwise(tokens):
        if not token["number"] or not re.match(r"[A-Za-z_(]", after[0]):
            continue
        number, name = token[0], after[0]
        if token.end() < after.start() or name in AXES or name == "(" or not re.match(r"[exbo_]", name, re.IGNORECASE):
            wanted = f"{number}*{name}" + ("...)" if name == "(" else "")
            raise PolynomialError(f"a sign is missing at column {after.start() + 1}; write {_cut(wanted)}")
        raise PolynomialError(f"{_cut(number + name)} is no number; write numbers as in 1000.5 or 1e3")


def _refuse_open(tokens: list[re.Match]):
    """Brackets without their partners, and an end that is none: Python does not say where."""
    opened = []
    for token in tokens:
        if token[0] == "(":
            opened.append(token.start() + 1)
        elif token[0] == ")":
            if not opened:
                raise PolynomialError(f"the bracket at column {token.start() + 1} was not opened; leave it out")
            opened.pop()
    if opened:
        raise PolynomialError(f"the bracket at column {opened[-1]} is not closed; add a )")
    if tokens[-1][0] in "+-*/^":
        raise PolynomialError(f"it breaks off after {tokens[-1][0]}; add what follows or leave it out")


class _Reader:
    """Reads Python's syntax tree of one text."""

    def __init__(self, text: str, parameters: dict[str, Fraction]):
        self.text = text
        self.parameters = parameters
        self.bits = 0

    def source(self, node: ast.expr) -> str:
        return self.text[node.col_offset : node.end_col_offset]

    def shown(self, node: ast.expr) -> str:
        return _cut(self.source(node).replace("**", "^"))

    def tree(self, node: ast.expr, depth: int) -> Expression:
        if depth > MAX_DEPTH:
            raise _deep()
        match node:
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self.checked(Sum(tuple(self.terms(node, depth))), node)
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                return self.checked(Product(tuple(self.factors(node, depth))), node)
            case ast.BinOp(op=ast.Pow()):
                return self.power(node, depth)
            case ast.UnaryOp(op=ast.UAdd()):
                return self.tree(node.operand, depth + 1)
            case ast.UnaryOp(op=ast.USub()):
                return Negative(self.tree(node.operand, depth + 1))
            case ast.Constant():
                if number := literal(self.source(node)):
                    return number
            case ast.Name(id=name):
                return self.named(name)
            case ast.Call():
                return self.root(node, depth)
        raise PolynomialError(
            f"{self.shown(node)!r} has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have"
        )

    def terms(self, node: ast.expr, depth: int) -> list[Expression]:
        # Python nests a sum to the left, once for each term: it is walked in a loop, not by recursion.
        found = []
        while isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
            term = self.tree(node.right, depth + 1)
            found.append(Negative(term) if isinstance(node.op, ast.Sub) else term)
            node = node.left
        found.append(self.tree(node, depth + 1))
        return found[::-1]

    def factors(self, node: ast.expr, depth: int) -> list[Expression]:
        found = []
        while isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Mult, ast.Div)):
            factor = self.tree(node.right, depth + 1)
            found.append(self.divisor(factor, node.right) if isinstance(node.op, ast.Div) else factor)
            node = node.left
        found.append(self.tree(node, depth + 1))
        return found[::-1]

    def divisor(self, of: Expression, node: ast.expr) -> Expression:
        if of.degree:
            raise PolynomialError(f"it divides by {self.shown(node)}; only division by constants leaves a polynomial")
        if not rational(of, self.parameters) or is_zero(of):
            raise PolynomialError(f"it divides by {self.shown(node)}, which is 0; divide by another number")
        return Reciprocal(of)

    def power(self, node: ast.BinOp, depth: int) -> Expression:
        of, exponent = self.tree(node.left, depth + 1), node.right
        written = self.source(exponent)
        if not (isinstance(exponent, ast.Constant) and written.isdecimal()):
            raise PolynomialError(f"the exponent {self.shown(exponent)} is not allowed; it is a whole number as in x^2")
        n = int(written) if len(written) < 10 else 10**9
        if of.degree:
            if of.degree * n > MAX_DEGREE:
                raise too_high(of.degree * n)
            return Power(of, n) if n else Number(Fraction(1))
        # log2 of the result, before it is computed.
        if n * _bits(of) > MAX_BITS:
            raise self.unwieldy(node)
        return self.checked(Power(of, n), node)

    def checked(self, made: Expression, node: ast.expr) -> Expression:
        """The tree, where it is a constant that can be computed."""
        if made.degree:
            return made
        bits = _bits(made)
        self.bits += bits
        if bits > MAX_BITS or self.bits > MAX_ALL_BITS:
            raise self.unwieldy(node)
        value = rational(made, self.parameters)
        if value and not is_zero(made) and not _fits(value):
            raise PolynomialError(
                f"{self.shown(node)} is too large or too small; a constant is 0 or between 1e-301 and 1e301"
            )
        return made

    def unwieldy(self, node: ast.expr) -> PolynomialError:
        return PolynomialError(f"{self.shown(node)} has too many digits to be computed exactly; write a shorter number")

    def named(self, name: str) -> Expression:
        if name in AXES:
            return Axis(AXES.index(name))
        if name in CONSTANTS:
            return NamedConstant(name)
        if name in self.parameters:
            return Parameter(name)
        if name == "sqrt":
            raise PolynomialError("sqrt stands without brackets; write sqrt(2)")
        if re.fullmatch(r"[xyzXYZ]\d+", name):
            hint = f"write {name[0].lower()}^{name[1:]}"
        elif re.fullmatch(r"[xyz]+", name):
            hint = f"write {'*'.join(name)}"
        else:
            hint = self.hint(name)
        raise PolynomialError(f"unknown name {_cut(name)}; {hint}")

    def hint(self, name: str) -> str:
        choices = [*RESERVED, *self.parameters]
        near = [c for c in choices if c.casefold() == name.casefold()] or get_close_matches(name, choices, 1)
        listed = f"one of {', '.join(choices)}"
        return f"did you mean {near[0]}? ({listed})" if near else listed

    def root(self, node: ast.Call, depth: int) -> Expression:
        function = node.func
        if not isinstance(function, ast.Name):
            raise PolynomialError(f"a sign is missing before a bracket in {self.shown(node)}; write * for a product")
        name = function.id
        if name in AXES or name in CONSTANTS or name in self.parameters:
            raise PolynomialError(f"a sign is missing in {self.shown(node)}; write {name}*(...)")
        if name != "sqrt":
            raise PolynomialError(f"unknown function {_cut(name)}; the only one is sqrt, of a constant")
        if len(node.args) != 1 or node.keywords:
            raise PolynomialError("sqrt takes one number; write sqrt(2)")
        of = self.tree(node.args[0], depth + 1)
        if of.degree:
            raise PolynomialError(
                f"sqrt of {self.shown(node.args[0])} is no polynomial; only constants have a sqrt here"
            )
        value = Fraction(0) if is_zero(of) else rational(of, self.parameters)
        if value < 0:
            raise PolynomialError(
                f"sqrt of {self.shown(node.args[0])}, which is negative; it takes a number of at least 0"
            )
        if not of.irrational and not of.parametric and (root := square_root(value)) ** 2 == value:
            return Number(root)
        return self.checked(Root(of), node)


def _bits(node: Expression) -> int:
    """About how many bits a constant has when it is computed."""
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
