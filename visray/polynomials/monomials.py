"""Parses lists of monomials such as ["0.9x2", "-3y2", "-1"]. Their sum is the polynomial: 0.9 x^2 - 3 y^2 - 1."""

import re

from visray.polynomials.error import PolynomialError
from visray.polynomials.expression import Axis, Expression, Negative, Power, Product, Sum
from visray.polynomials.literals import AXES, MAX_DEGREE, literal, too_high

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
_FACTOR = r"([xyz])(?:\s*(?:\^|\*\*)\s*(\d+)|(\d+))?"
_MONOMIAL = re.compile(rf"\s*([+-])?\s*({_NUMBER})?((?:\s*\*?\s*{_FACTOR})*)\s*", re.IGNORECASE | re.ASCII)
_FACTORS = re.compile(_FACTOR, re.IGNORECASE | re.ASCII)
MAX_ENTRIES = 10_000


def parse(entries: list[str]) -> Expression:
    """The sum of the monomials, as an expression. The `part` of a PolynomialError is the index of the wrong entry."""
    if not entries:
        raise PolynomialError('there is no monomial; write for example ["x2", "y2", "z2", "-1"]')
    if len(entries) > MAX_ENTRIES:
        raise PolynomialError(f"there are {len(entries)} monomials; at most {MAX_ENTRIES}")
    return Sum(tuple(_monomial(entry, k) for k, entry in enumerate(entries)))


def _monomial(entry: str, part: int) -> Expression:
    """The expression of one monomial. part: its index in the list, for errors."""
    match = _MONOMIAL.fullmatch(entry)
    # An exponent must follow its letter directly or after ^, because "x 2" could also mean a product.
    if not match or not (match[2] or match[3]) or (not match[2] and match[3].lstrip().startswith("*")):
        raise PolynomialError(
            'is not a monomial; write a number and then powers of x, y and z, as in "-0.5x2y"; '
            "a sum has one entry for each of its terms",
            part,
        )
    try:
        parts: list[Expression] = [literal(match[2])] if match[2] else []
    except PolynomialError as e:
        raise PolynomialError(str(e), part) from None
    for letter, *exponents in _FACTORS.findall(match[3]):
        written = exponents[0] or exponents[1] or "1"
        n = int(written) if len(written) < 10 else 10**9
        if n > MAX_DEGREE:
            raise PolynomialError(str(too_high(n)), part)
        if n:
            axis = Axis(AXES.index(letter.lower()))
            parts.append(Power(axis, n) if n > 1 else axis)
    product = Product(tuple(parts))
    if product.degree > MAX_DEGREE:
        raise PolynomialError(str(too_high(product.degree)), part)
    return Negative(product) if match[1] == "-" else product
