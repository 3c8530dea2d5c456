"""Names, numbers and limits that the two text forms of a polynomial share (grammar.py and monomials.py)."""

import re
from fractions import Fraction
from keyword import iskeyword

from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import Number

MAX_DEGREE = 32
# The size of a constant is 0 or between 2^-1000 and 2^1000 (about 1e-301 and 1e301). There, doubles have full accuracy.
MAX_EXPONENT = 1000
AXES, CONSTANTS = ("x", "y", "z"), ("phi", "pi")
FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log")
RESERVED = (*AXES, *CONSTANTS, "sqrt", *FUNCTIONS)
# The base of natural logarithms, unless a parameter has this name.
EULER = "e"
LITERAL = re.compile(r"(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)


def exact_parameters(parameters: dict[str, float]) -> dict[str, Fraction]:
    """The parameters as rational numbers. Raises PolynomialError for a name or a value that is not allowed."""
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
    """The error for a polynomial whose degree is above MAX_DEGREE."""
    shown = degree if degree < 10**6 else "over a million"
    return PolynomialError(f"its degree, as written, is {shown}; at most {MAX_DEGREE}")


def literal(text: str) -> Number | None:
    """The exact value of a decimal number such as 1.5e3; None if the text is not a decimal number."""
    match = LITERAL.fullmatch(text)
    if not match:
        return None
    # The size is checked before the number is computed, because a number such as 1e999999999 does not fit in memory.
    if len(match[1]) > MAX_EXPONENT or len(match[2] or "") > 5 or abs(int((match[2] or "e0")[1:])) > MAX_EXPONENT:
        raise PolynomialError(f"the number {shortened(text)} has too many digits; it is 0 or between 1e-301 and 1e301")
    value = Fraction(text)
    if value and not is_allowed_size(value):
        raise PolynomialError(
            f"the number {shortened(text)} is too large or too small; it is 0 or between 1e-301 and 1e301"
        )
    return Number(value)


def is_allowed_size(value: Fraction) -> bool:
    """Whether the size of a constant is between 2^-MAX_EXPONENT and 2^MAX_EXPONENT, roughly. Domain: value != 0."""
    return abs(abs(value.numerator).bit_length() - value.denominator.bit_length()) <= MAX_EXPONENT


def shortened(text: str) -> str:
    """The text, cut to at most 20 characters for a message."""
    return text if len(text) <= 20 else text[:17] + "..."
