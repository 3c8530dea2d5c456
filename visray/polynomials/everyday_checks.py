"""Checks of formulas as people write them: the order of their tokens, and what is no polynomial.

A formula that can be read in two ways is an error too. All columns in messages are those of the user's text.
"""

import re
from fractions import Fraction

from visray.polynomials.error import PolynomialError
from visray.polynomials.everyday_characters import wrong
from visray.polynomials.everyday_tokens import UNKNOWN_FUNCTIONS, Token
from visray.polynomials.literals import AXES, CONSTANTS

ENDS = ("number", "name", ")", "exponent")
STARTS = ("number", "name", "function", "(")
OPERATORS = ("+", "-", "*", "/", "^")
_EXPONENT = re.compile(r"[+-]?\d{1,30}(/[1-9]\d{0,5}|\.\d{0,6})?")


def check_brackets(tokens: list[Token]):
    """Raises PolynomialError for a bracket without a partner."""
    opened: list[Token] = []
    for token in tokens:
        if token.kind == "(":
            opened.append(token)
        elif token.kind == ")":
            if not opened:
                raise PolynomialError(f"the bracket at column {token.at + 1} was not opened; leave it out")
            opened.pop()
        elif token.kind == "=" and opened:
            raise wrong("= in a bracket", token.at, f"close the bracket of column {opened[-1].at + 1} before it")
    if opened:
        raise PolynomialError(f"the bracket at column {opened[-1].at + 1} is not closed; add a )")


def check_order(side: list[Token], text: str) -> bool:
    """Whether there are fractions or roots of x, y or z, which everyday_clearing.py has to clear.

    PolynomialError is raised where two tokens cannot follow one another, and for what is no polynomial.
    text: the user's text.
    """
    clear = False
    partner = _partners(side)
    before: Token | None = None
    for k, token in enumerate(side):
        ends = before is not None and before.kind in ENDS
        if token.kind == ",":
            decimal = before and before.kind == "number" and before.end == token.at and text[token.end : token.end + 1]
            advice = "decimals have a point, as in 0.5" if decimal and decimal.isdigit() else "write one formula"
            raise wrong("unexpected ','", token.at, advice)
        if token.kind == "number" and ends:
            shown = text[before.at : token.end]
            advice = "write 0.5 with one point" if token.text[0] == "." else "write * for a product or ^ for a power"
            raise wrong(f"{shown!r} may be a product or a power", before.at, advice)
        if (token.kind in ("*", "/", "^", ")") and not ends) or (token.kind == "exponent" and before is None):
            what = "an empty bracket" if token.kind == ")" and before and before.kind == "(" else None
            raise wrong(what or f"nothing before the {token.text}", token.at, "add what is missing or leave it out")
        if token.text == "±":
            root = side[k + 1 : k + 2]
            if not root or root[0].text != "sqrt" or not _check_function(side, k + 1, partner):
                raise wrong("unexpected '±'", token.at, "it stands before a square root of x, y or z; write + or -")
        if token.kind == "function":
            clear |= _check_function(side, k, partner)
        if token.kind == "^" and k + 1 < len(side):
            clear |= _check_power(side, k, partner, text)
        before = token
    if before and before.kind in (*OPERATORS, "function"):
        raise PolynomialError(f"it breaks off after {before.text}; add what follows or leave it out")
    return _check_divisors(side, partner, text) or clear


def _partners(side: list[Token]) -> dict[int, int]:
    """For each bracket, the index of the other one of its pair."""
    partner, opened = {}, []
    for k, token in enumerate(side):
        if token.kind == "(":
            opened.append(k)
        elif token.kind == ")":
            partner[k] = opened.pop()
            partner[partner[k]] = k
    return partner


def _varies(tokens: list[Token]) -> bool:
    """Whether x, y or z is among the tokens."""
    return any(t.kind == "name" and t.text in AXES for t in tokens)


def _source(tokens: list[Token], text: str) -> str:
    """The user's text of some tokens."""
    shown = text[tokens[0].at : tokens[-1].end]
    return shown if len(shown) <= 20 else f"{shown[:17]}..."


def _check_function(side: list[Token], k: int, partner: dict[int, int]) -> bool:
    """Whether a function is a square root of x, y or z.

    PolynomialError is raised for another function of x, y or z, and for one without brackets.
    """
    function, name = side[k], side[k].text
    if k + 1 == len(side):
        raise wrong(f"{name} of nothing", function.at, f"write {name}(2)")
    after = side[k + 1]
    inside = side[k + 2 : partner[k + 1]] if after.kind == "(" else [after]
    if name in UNKNOWN_FUNCTIONS:
        advice = {"pow": "write x^2", "sqr": "write x^2", "cbrt": "write 2^(1/3)"}.get(name, "a polynomial has none")
        raise wrong(f"{name} is no function here", function.at, advice)
    if _varies(inside) and name != "sqrt":
        advice = {
            "sin": "near 0, x - x^3/6 + x^5/120 is like sin x",
            "cos": "near 0, 1 - x^2/2 + x^4/24 is like cos x",
            "exp": "near 0, 1 + x + x^2/2 + x^3/6 is like exp x",
        }.get(name, "take a polynomial that is near it")
        raise PolynomialError(f"{name} of x, y or z at column {function.at + 1} is no polynomial; {advice}")
    if after.kind not in ("number", "name") if name == "sqrt" and after.kind != "(" else after.kind != "(":
        raise wrong(
            f"{name} without brackets", function.at, f"write {name}({after.text if after.text[0].isalnum() else 2})"
        )
    power = k + 2 < len(side) and side[k + 2].kind in ("^", "(", "name", "function")
    if after.kind != "(" and power and not (after.kind == "number" and side[k + 2].kind != "^"):
        raise wrong("a root without brackets", function.at, f"write {name}(...) around all that is under the root")
    return _varies(inside)


def _base(side: list[Token], k: int, partner: dict[int, int]) -> list[Token]:
    """The tokens of the operand that ends before index k."""
    end = k - 1
    start = partner[end] if side[end].kind == ")" else end
    if start and side[start - 1].kind == "function":
        start -= 1
    return side[start : end + 1]


def _check_power(side: list[Token], k: int, partner: dict[int, int], text: str) -> bool:
    """Whether the exponent of x, y or z is negative or a half. k: index of the sign ^.

    PolynomialError is raised if it is no number, or another fraction.
    """
    base, after = _base(side, k, partner), side[k + 1]
    if k >= 2 and side[k - 2].kind == "^" and (side[k - 1].kind == "exponent" or after.kind == "exponent"):
        raise wrong("a second exponent", side[k].at, "write (x^2)^3, or one exponent")
    exponent = side[k + 2 : partner[k + 1]] if after.kind == "(" else side[k + 1 : k + 2]
    if after.kind in ("+", "-"):
        exponent = side[k + 1 : k + 3]
    if exponent and _varies(exponent):
        raise wrong(f"the exponent {_source(exponent, text)}", after.at, "an exponent is a number, as in x^2")
    if not _varies(base):
        return False
    written = "".join(t.text for t in exponent)
    value = Fraction(written) if _EXPONENT.fullmatch(written) else None
    whole = value is not None and value >= 0 and value.denominator == 1
    if value is None or value.denominator > 2 or (whole and not written.isdecimal()):
        shown = f"the exponent {_source(exponent or [after], text)} of {_source(base, text)}"
        raise wrong(shown, after.at, "write a whole number, as in x^2")
    return not whole


def _check_divisors(side: list[Token], partner: dict[int, int], text: str) -> bool:
    """Whether there is a divisor with x, y or z.

    PolynomialError is raised for a product without a sign after a divisor, which is read in two ways. Only 1/2x is half
    of x for everybody.
    """
    found = False
    for k, token in enumerate(side):
        if token.kind != "/":
            continue
        end = _operand_end(side, k + 1, partner)
        divisor, more = side[k + 1 : end], side[end : end + 1]
        found |= _varies(divisor)
        # What is above the line: all of the product before it, of which a message shows the last factor.
        above, last_above = _product(side, k, partner), _powered(side, k, partner)
        if more and more[0].kind in STARTS and _varies_or_named(above + divisor):
            last = _source(side[end : _operand_end(side, end, partner)], text)
            a, b = _source(last_above, text), _source(divisor, text)
            shown = f"{a}/{b} {last}" if last[0].isdigit() else f"{a}/{b}{last}"
            raise wrong(
                f"{shown} can be read in two ways", last_above[0].at, f"write {a}/{b}*{last} or {a}/({b}*{last})"
            )
    return found


def _powered(side: list[Token], k: int, partner: dict[int, int]) -> list[Token]:
    """The tokens of the operand, with its power, that ends before index k."""
    base = _base(side, k, partner)
    before = k - len(base) - 1
    return [*_powered(side, before, partner), side[before], *base] if before > 0 and side[before].kind == "^" else base


def _product(side: list[Token], k: int, partner: dict[int, int]) -> list[Token]:
    """The tokens of the product that ends before index k."""
    start = k
    while start and side[start - 1].kind not in ("+", "-", "("):
        start = partner[start - 1] if side[start - 1].kind == ")" else start - 1
    return side[start:k]


def _varies_or_named(tokens: list[Token]) -> bool:
    """Whether there is a name other than a constant among the tokens."""
    return any(t.kind == "name" and t.text not in CONSTANTS for t in tokens)


def _operand_end(side: list[Token], k: int, partner: dict[int, int]) -> int:
    """The index behind the operand that begins at k, with its power."""
    while k < len(side) and side[k].kind in ("+", "-", "function"):
        k += 1
    k = partner[k] + 1 if k < len(side) and side[k].kind == "(" else k + 1
    return _operand_end(side, k + 1, partner) if k < len(side) and side[k].kind == "^" else k
