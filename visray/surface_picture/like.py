"""Formulas of known surfaces that people write out: the surface is then shown as the known one is."""

from collections.abc import Mapping
from fractions import Fraction
from functools import cache

from visray.polynomials import PolynomialError, exact_terms
from visray.polynomials.catalogue import SURFACES

# Least degree of a formula that is compared. Quadrics have so many forms that no view suits them better than a fitted
# one.
LEAST_DEGREE = 3
# Relative difference up to which coefficients are the same; irrational ones are rounded.
SAME = 1e-12

Terms = Mapping[tuple[int, int, int], Fraction]


def known_like(expression: str) -> str | None:
    """The name of the known surface of which a formula without parameters is a multiple; None if there is none."""
    terms = _terms(expression)
    if terms is None or max(map(sum, terms)) < LEAST_DEGREE:
        return None
    return next((name for name in SURFACES if _is_multiple(terms, _known_terms(name))), None)


@cache
def _known_terms(name: str) -> Terms | None:
    """The terms of a known surface with its usual parameters."""
    known = SURFACES[name]
    return _terms(known.expression, known.parameters)


def _terms(expression: str, parameters: Mapping[str, float] | None = None) -> Terms | None:
    """The terms of a polynomial; None if there are none, or too many."""
    try:
        return exact_terms(expression, dict(parameters or {})) or None
    except PolynomialError:
        return None


def _is_multiple(terms: Terms, other: Terms | None) -> bool:
    """Whether a polynomial is another one times a number."""
    if other is None or terms.keys() != other.keys():
        return False
    first = next(iter(terms))
    return all(
        abs(c * other[first] - other[e] * terms[first]) <= SAME * abs(c * other[first]) for e, c in terms.items()
    )
