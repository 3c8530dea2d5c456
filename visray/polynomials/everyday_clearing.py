"""Clears fractions and square roots of x, y and z from a formula: z = 1/x becomes z*x - 1 = 0.

Each part of the formula is a number (a + b s) / d, where a, b and d are texts of polynomials, and s is the one square
root in the formula. Its square q is a polynomial. The formula is 0 where a + b s is 0; then a^2 - b^2 q is 0 too, also
where a - b s is 0.
"""

import ast
from dataclasses import dataclass
from fractions import Fraction

from visray.polynomials.error import PolynomialError
from visray.polynomials.grammar import MAX_LENGTH
from visray.polynomials.literals import AXES, MAX_DEGREE, shortened, too_high
from visray.polynomials.reader import too_deep


@dataclass(frozen=True)
class Part:
    """A part of a formula: (a + b s) / d. a, b, d: texts of polynomials, which may be "0" and "1"."""

    a: str
    b: str = "0"
    d: str = "1"


def cleared(expression: str) -> tuple[str, tuple[str, ...]]:
    """(text, notes): the text of a polynomial that is 0 where the expression is 0, and what was done.

    expression: text in the strict grammar, in which divisors and square roots may contain x, y and z.
    """
    clearing = _Clearing(expression.replace("^", "**"))
    try:
        part = clearing.formula()
    except (RecursionError, MemoryError):
        raise too_deep() from None
    if part.b == "0":
        text = part.a
    else:
        text = _squared(part, clearing.square)
        clearing.notes[f"sqrt({_shown(clearing.square)}) is squared away, so both signs of it are drawn"] = None
    return text.replace("**", "^"), tuple(clearing.notes)


def _squared(part: Part, square: str) -> str:
    """The polynomial a^2 - b^2 q of a part, without a factor q that is written in it. square: text of q."""
    if not is_sum(part.a.removeprefix("-")):
        factors = _factors(part.a.removeprefix("-"))
        written = next((f for f in factors if f in (square, f"({square})")), None)
        if written:
            factors.remove(written)
            return _minus(_times(_power("*".join(factors) or "1", 2), square), _power(part.b, 2))
    return _minus(_power(part.a, 2), _times(_power(part.b, 2), square))


class _Clearing:
    """Converts a syntax tree of Python to a Part.

    text: the text that Python parsed.
    square: text of the square of s; "" until a square root is found.
    notes: sentences about what was done.
    varying: the nodes of the tree that contain x, y or z.
    """

    def __init__(self, text: str):
        self.text, self.square, self.notes, self.varying = text, "", {}, set()

    def formula(self) -> Part:
        """The part that is the whole formula."""
        body = ast.parse(self.text, mode="eval").body
        # Operands come after the nodes to which they belong.
        for node in reversed(list(ast.walk(body))):
            operands = ast.iter_child_nodes(node)
            if (isinstance(node, ast.Name) and node.id in AXES) or any(n in self.varying for n in operands):
                self.varying.add(node)
        return self.part(body)

    def part(self, node: ast.expr) -> Part:
        """The part of the formula that belongs to a node."""
        if node not in self.varying:
            return Part(f"({self.source(node)})" if isinstance(node, ast.BinOp | ast.UnaryOp) else self.source(node))
        match node:
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self.sum(self.part(node.left), self.part(node.right), isinstance(node.op, ast.Sub))
            case ast.BinOp(op=ast.Mult()):
                return self.product(self.part(node.left), self.part(node.right))
            case ast.BinOp(op=ast.Div()) if node.right not in self.varying:
                of, by = self.part(node.left), self.part(node.right).a
                return Part(_over(of.a, by), _over(of.b, by), of.d)
            case ast.BinOp(op=ast.Div()):
                return self.product(self.part(node.left), self.inverse(self.part(node.right), node.right))
            case ast.BinOp(op=ast.Pow()):
                return self.power(self.part(node.left), Fraction(self.source(node.right).replace(" ", "")), node.left)
            case ast.UnaryOp(op=ast.USub()):
                inner = self.part(node.operand)
                return Part(_minus("0", inner.a), _minus("0", inner.b), inner.d)
            case ast.UnaryOp():
                return self.part(node.operand)
            case ast.Call():
                return self.root(self.part(node.args[0]))
        return Part(self.source(node))

    def source(self, node: ast.expr) -> str:
        """The piece of the parsed text that belongs to a node."""
        return self.text[node.col_offset : node.end_col_offset]

    def sum(self, left: Part, right: Part, minus: bool) -> Part:
        """The sum of two parts, or their difference."""
        add, d = _minus if minus else _plus, left.d
        if d != right.d:
            d = _times(d, right.d)
            left = Part(_times(left.a, right.d), _times(left.b, right.d), left.d)
            right = Part(*(_times(c, left.d) for c in (right.a, right.b)))
        return Part(_checked(add(left.a, right.a)), _checked(add(left.b, right.b)), _checked(d))

    def product(self, left: Part, right: Part) -> Part:
        """The product of two parts."""
        a = _plus(_times(left.a, right.a), _times(_times(left.b, right.b), self.square or "0"))
        b = _times("2", _times(left.a, left.b))
        if left != right:
            b = _plus(_times(left.a, right.b), _times(left.b, right.a))
        return Part(_checked(a), _checked(b), _checked(_times(left.d, right.d)))

    def inverse(self, part: Part, node: ast.expr) -> Part:
        """1 / part. node: its syntax tree, for the note."""
        written = _shown(self.source(node))
        self.notes[f"both sides are multiplied by {written}; where that is 0, more may be drawn"] = None
        if part.b == "0":
            return Part(part.d, "0", part.a)
        if part.a == "0":
            return Part("0", part.d, _times(part.b, self.square))
        norm = _minus(_power(part.a, 2), _times(_power(part.b, 2), self.square))
        return Part(_times(part.d, part.a), _minus("0", _times(part.d, part.b)), norm)

    def power(self, of: Part, exponent: Fraction, node: ast.expr) -> Part:
        """The power of a part. exponent: a multiple of 1/2. node: syntax tree of the part, for the note."""
        if exponent.denominator == 2:
            return self.power(self.root(of), 2 * exponent, node)
        if exponent < 0:
            return self.power(self.inverse(of, node), -exponent, node)
        n = int(exponent)
        if n > MAX_DEGREE:
            raise too_high(n)
        if of.b == "0":
            return Part(_power(of.a, n), "0", _power(of.d, n))
        result, base = Part("1"), of
        while n:
            if n % 2:
                result = self.product(result, base)
            n //= 2
            base = self.product(base, base) if n else base
        return result

    def root(self, of: Part) -> Part:
        """The square root of a part."""
        square = _times(of.a, of.d)
        if of.b != "0":
            raise PolynomialError("it has a square root in a square root; square the formula, so that one is left")
        if self.square not in ("", square):
            raise PolynomialError(
                f"it has two square roots, of {_shown(self.square)} and of {_shown(square)}; square the formula, so "
                "that one is left"
            )
        self.square = square
        return Part("0", "1", of.d)


def _shown(text: str) -> str:
    """A polynomial's text, shortened, for a message."""
    return shortened(text.replace("**", "^"))


def _checked(text: str) -> str:
    """The text. Raises PolynomialError if it is too long."""
    if len(text) > MAX_LENGTH:
        raise PolynomialError("it is too long without its fractions and roots; write it as a polynomial")
    return text


def is_sum(text: str) -> bool:
    """Whether a text has a + or - outside of all brackets."""
    depth = 0
    for c in text:
        depth += (c == "(") - (c == ")")
        if c in "+-" and not depth:
            return True
    return False


def _factors(text: str) -> list[str]:
    """The texts between the signs * outside of all brackets."""
    factors, depth, last = [], 0, 0
    for i, c in enumerate(text):
        depth += (c == "(") - (c == ")")
        if c == "*" and not depth and "**" not in (text[i : i + 2], text[i - 1 : i + 1]):
            factors.append(text[last:i])
            last = i + 1
    return [*factors, text[last:]]


def _bracketed(text: str) -> str:
    """The text of a polynomial as a factor."""
    return f"({text})" if is_sum(text) else text


def _plus(a: str, b: str) -> str:
    """The sum of two polynomials."""
    return a if b == "0" else b if a == "0" else f"{a} + {b}"


def _minus(a: str, b: str) -> str:
    """The difference of two polynomials."""
    if b == "0":
        return a
    return f"-{_bracketed(b)}" if a == "0" else f"{a} - {_bracketed(b)}"


def _times(a: str, b: str) -> str:
    """The product of two polynomials."""
    if "0" in (a, b):
        return "0"
    if a == b:
        return _power(a, 2)
    return b if a == "1" else a if b == "1" else f"{_bracketed(a)}*{_bracketed(b)}"


def _over(a: str, constant: str) -> str:
    """A polynomial divided by a constant. constant: a name, a number, a call or a text in brackets."""
    return a if a == "0" else f"{_bracketed(a)}/{constant}"


def _power(a: str, n: int) -> str:
    """The power of a polynomial. Domain: n >= 0."""
    if n == 0:
        return "1"
    if n % 2 == 0 and a[0] == "-" and not is_sum(a[1:]):
        a = a[1:]
    simple = a.isalnum() or (a.startswith("(") and a.endswith(")") and a.count("(") == 1)
    return a if n == 1 or a in ("0", "1") else f"{a}**{n}" if simple else f"({a})**{n}"
