"""The grammar of polynomials: parses text such as "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3".

Python's own parser makes a syntax tree of the text, and reader.py converts the tree. The text is never executed.
"""

import ast
import keyword
import re
from itertools import pairwise

from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import Expression
from visray.polynomials.literals import (
    EULER,
    LITERAL,
    MAX_DEGREE,
    RESERVED,
    exact_parameters,
    shortened,
    too_high,
)
from visray.polynomials.reader import Reader, too_deep

MAX_LENGTH = 20_000
# Length of a mended text up to which a message shows all of it.
LONGEST_MENDED = 1000
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
    _check_missing_signs(text, tokens)
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
            raise too_deep() from None
        raise PolynomialError(f"not understood at column {at + 1}, near {_near(text, at)}; {EXAMPLE}") from None
    except (RecursionError, MemoryError):
        raise too_deep() from None
    expression = Reader(python, exact).expression(body, 0)
    if expression.degree > MAX_DEGREE:
        raise too_high(expression.degree)
    return expression


def _near(text: str, at: int) -> str:
    """The text around the position `at`, for a message."""
    return repr(text[max(0, at - 5) : at + 6].strip())


def _check_missing_signs(text: str, tokens: list[re.Match]):
    """Raises PolynomialError for missing multiplication signs, as in 2x, x^2 y or (x + 1)(x - 1). The message has the
    whole text with all signs.

    Python's parser would not explain this error, or would read another number, such as the hexadecimal 0x1.
    """
    missing = []
    for token, after in pairwise(tokens):
        number, name = token[0], after[0]
        follows = re.match(r"[A-Za-z_(]", name) or after["number"]
        # A name before a bracket may be a function.
        ends = token["number"] or number == ")" or (re.match(r"[A-Za-z_]", number) and (name != "(" or number in "xyz"))
        if not (follows and ends) or (number in "xyz" and after["number"] and token.end() == after.start()):
            continue
        if keyword.iskeyword(number) or keyword.iskeyword(name):
            continue
        known = name == "(" or name in (*RESERVED, EULER)
        if not (token["number"] and token.end() == after.start() and not known and name[0] in "exboEXBO_"):
            missing.append(after.start())
            continue
        raise PolynomialError(f"{shortened(number + name)} is no number; write numbers as in 1000.5 or 1e3")
    if missing:
        parts = [text[a:b].rstrip() for a, b in pairwise([0, *missing, len(text)])]
        whole = " ".join("*".join(parts).split())
        whole = whole if len(whole) <= LONGEST_MENDED else f"{whole[:LONGEST_MENDED]}..."
        raise PolynomialError(f"a sign is missing at column {missing[0] + 1}; write {whole}")


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
