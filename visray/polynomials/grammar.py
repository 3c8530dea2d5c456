"""The grammar of polynomials: parses text such as "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3".

Python's own parser makes a syntax tree of the text, and `_Reader` converts the tree. The text is never executed.
"""

import ast
import re
from difflib import get_close_matches
from fractions import Fraction
from itertools import pairwise

from visray.polynomials.constants import is_negligible, rational, square_root
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
)
from visray.polynomials.literals import (
    AXES,
    CONSTANTS,
    LITERAL,
    MAX_DEGREE,
    RESERVED,
    exact_parameters,
    is_allowed_size,
    literal,
    shortened,
    too_high,
)

MAX_LENGTH = 20_000
MAX_DEPTH = 100
# Greatest number of bits of one exact constant, and of all constants in one text together.
MAX_BITS, MAX_ALL_BITS = 1 << 15, 1 << 18
IRRATIONAL_BITS = 600
EXAMPLE = "write for example x^2 + y^2 + z^2 - 1"
_STRANGE = re.compile(r"[^A-Za-z0-9_+\-*/^(). \t\r\n]")
_TOKEN = re.compile(rf"[A-Za-z_][A-Za-z0-9_]*|(?P<number>{LITERAL.pattern})|\S", re.IGNORECASE)
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
    """The expression of a polynomial in x, y, z and the parameters, from its text.

    If the text is wrong, PolynomialError is raised. Its message says where, and what would be right.
    """
    exact = exact_parameters(parameters)
    if len(text) > MAX_LENGTH:
        raise PolynomialError(f"it is {len(text)} characters long; at most {MAX_LENGTH}")
    if not text.strip():
        raise PolynomialError(f"it is empty; {EXAMPLE}")
    if strange := _STRANGE.search(text):
        c = strange.group()
        hint = _HINTS.get(c, "only numbers, names and + - * / ^ ( ) have a meaning")
        raise PolynomialError(f"unexpected {c!r} at column {strange.start() + 1}; {hint}")
    tokens = list(_TOKEN.finditer(text))
    _check_missing_signs(tokens)
    _check_brackets(tokens)
    text = re.sub(r"\s", " ", text)
    lead = len(text) - len(text.lstrip())
    # Python parses a changed text, in which ** stands for ^. For each of its characters: the position in the original.
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
    expression = _Reader(python, exact).expression(body, 0)
    if expression.degree > MAX_DEGREE:
        raise too_high(expression.degree)
    return expression


def _near(text: str, at: int) -> str:
    """The text around the position `at`, for a message."""
    return repr(text[max(0, at - 5) : at + 6].strip())


def _deep() -> PolynomialError:
    """The error for a text that is nested more deeply than MAX_DEPTH."""
    return PolynomialError(f"it is nested too deeply; at most {MAX_DEPTH} levels")


def _check_missing_signs(tokens: list[re.Match]):
    """Raises PolynomialError for a missing multiplication sign after a number, as in 2x or 2(x + 1).

    Python's parser would not explain this error, or would read another number, such as the hexadecimal 0x1.
    """
    for token, after in pairwise(tokens):
        if not token["number"] or not re.match(r"[A-Za-z_(]", after[0]):
            continue
        number, name = token[0], after[0]
        if token.end() < after.start() or name in AXES or name == "(" or not re.match(r"[exbo_]", name, re.IGNORECASE):
            wanted = f"{number}*{name}" + ("...)" if name == "(" else "")
            raise PolynomialError(f"a sign is missing at column {after.start() + 1}; write {shortened(wanted)}")
        raise PolynomialError(f"{shortened(number + name)} is no number; write numbers as in 1000.5 or 1e3")


def _check_brackets(tokens: list[re.Match]):
    """Raises PolynomialError for a bracket without a partner, and for a text that ends with an operator.

    Python's parser does not say where such an error is.
    """
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
            raise _deep()
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
                return self.root(node, depth)
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
        if is_negligible(rational(of, self.parameters), of, self.parameters):
            raise PolynomialError(f"it divides by {self.shown(node)}, which is 0; divide by another number")
        return Reciprocal(of)

    def power(self, node: ast.BinOp, depth: int) -> Expression:
        """The expression of a power. PolynomialError is raised if the exponent is not a whole number."""
        of, exponent = self.expression(node.left, depth + 1), node.right
        written = self.source(exponent)
        if not (isinstance(exponent, ast.Constant) and written.isdecimal()):
            raise PolynomialError(f"the exponent {self.shown(exponent)} is not allowed; it is a whole number as in x^2")
        n = int(written) if len(written) < 10 else 10**9
        if of.degree:
            if of.degree * n > MAX_DEGREE:
                raise too_high(of.degree * n)
            return Power(of, n) if n else Number(Fraction(1))
        # The bits of the result are checked before it is computed.
        if n * _bits(of) > MAX_BITS:
            raise self.unwieldy(node)
        return self.checked(Power(of, n), node)

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
        value = rational(expression, self.parameters)
        if not is_negligible(value, expression, self.parameters) and not is_allowed_size(value):
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
        if name == "sqrt":
            raise PolynomialError("sqrt stands without brackets; write sqrt(2)")
        if re.fullmatch(r"[xyzXYZ]\d+", name):
            hint = f"write {name[0].lower()}^{name[1:]}"
        elif re.fullmatch(r"[xyz]+", name):
            hint = f"write {'*'.join(name)}"
        else:
            hint = self.hint(name)
        raise PolynomialError(f"unknown name {shortened(name)}; {hint}")

    def hint(self, name: str) -> str:
        """Text for a message about an unknown name: the most similar known name, and all known names."""
        choices = [*RESERVED, *self.parameters]
        near = [c for c in choices if c.casefold() == name.casefold()] or get_close_matches(name, choices, 1)
        listed = f"one of {', '.join(choices)}"
        return f"did you mean {near[0]}? ({listed})" if near else listed

    def root(self, node: ast.Call, depth: int) -> Expression:
        """The expression of a square root. PolynomialError is raised unless its argument is a constant >= 0."""
        function = node.func
        if not isinstance(function, ast.Name):
            raise PolynomialError(f"a sign is missing before a bracket in {self.shown(node)}; write * for a product")
        name = function.id
        if name in AXES or name in CONSTANTS or name in self.parameters:
            raise PolynomialError(f"a sign is missing in {self.shown(node)}; write {name}*(...)")
        if name != "sqrt":
            raise PolynomialError(f"unknown function {shortened(name)}; the only one is sqrt, of a constant")
        if len(node.args) != 1 or node.keywords:
            raise PolynomialError("sqrt takes one number; write sqrt(2)")
        of = self.expression(node.args[0], depth + 1)
        if of.degree:
            raise PolynomialError(
                f"sqrt of {self.shown(node.args[0])} is no polynomial; only constants have a sqrt here"
            )
        value = rational(of, self.parameters)
        if is_negligible(value, of, self.parameters):
            value = Fraction(0)
        if value < 0:
            raise PolynomialError(
                f"sqrt of {self.shown(node.args[0])}, which is negative; it takes a number of at least 0"
            )
        if not of.parametric and (not of.irrational or not value) and (root := square_root(value)) ** 2 == value:
            return Number(root)
        return self.checked(Root(of), node)


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
