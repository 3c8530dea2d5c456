"""Facts about formulas: degree, factors, and whether there is a surface. Proofs are compared with exact values."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from visray.polynomials import PolynomialError, exact_terms
from visray.polynomials.catalogue import SURFACES
from visray.polynomials.formula_facts import FormulaFacts, formula_facts
from visray.primitives.clips import Ball, Block

BALL, FAR_BOX = Ball(radius=3.0), Block(min=(3.0, 3.0, 3.0), max=(4.0, 4.0, 5.0))


def shape(facts: FormulaFacts) -> list[tuple]:
    """Text, multiplicity and points of each factor."""
    return [(f.text, f.multiplicity, f.points) for f in facts.factors]


@pytest.mark.parametrize(
    ("expression", "degree", "factors"),
    [
        ("x^2 + y^2 + z^2 - 1", 2, [("x^2 + y^2 + z^2 - 1", 1, "found")]),
        ("(x^2 + y^2 + z^2 - 1)^2", 4, [("x^2 + y^2 + z^2 - 1", 2, "found")]),
        ("x^2 + 2*x*y + y^2", 2, [("x + y", 2, "found")]),
        ("3 - 3*x", 1, [("3*x - 3", 1, "found")]),
        ("x*y*z", 3, [("x", 1, "found"), ("y", 1, "found"), ("z", 1, "found")]),
        ("(x - a)^2*(x^2 + a)", 4, [("x - a", 2, "found"), ("x^2 + a", 1, "none")]),
        ("x^2 - 2*a*x + a^2 + z^2", 2, [("x^2 + z^2 - 2*a*x + a^2", 1, "thin")]),
        ("sqrt(2)*x^2 + y - pi/3", 2, [("sqrt(2)*x^2 + y - 1/3*pi", 1, "found")]),
        ("(x + 2*y - z + 1)^16 - z", 16, [("a polynomial of degree 16", 1, "found")]),
    ],
)
def test_factors(expression, degree, factors):
    facts = formula_facts(expression, {"a": 1.0} if "a" in expression else {}, BALL)
    assert (facts.degree, shape(facts)) == (degree, factors)


@pytest.mark.parametrize(
    ("expression", "clip", "points", "everywhere"),
    [
        ("x^2 + y^2 + z^2 + 1", None, "none", True),
        ("-x^4 - y^2 - 0.001", None, "none", True),
        ("x^2 + x*y + y^2 + z^2 - x + 1", BALL, "none", True),  # a quadric, by elimination
        ("(x^2 - y*z)^2 + (x - 1)^4 + 1/1000", BALL, "none", True),
        ("x^2 + y^2", BALL, "thin", True),
        ("x^2 + y^2 + z^2", BALL, "thin", True),
        ("x^2 - x*y + y^2", BALL, "thin", True),
        ("(x^2 + y^2 - 1)^2 + z^2", BALL, "thin", True),
        ("(x^2 + y^2)*(z^2 + 1)", BALL, "thin", True),
        ("x^2 + y^2", FAR_BOX, "none", False),
        ("x^2 + y^2 + z^2 - 1", FAR_BOX, "none", False),  # by bounds in boxes
        ("x^4 - x + 1 + y^2", None, "none", False),
        ("x^4 + y^4 + z^4 + 1 - x*y*z", BALL, "none", False),
        ("x^4*y^2 + x^2*y^4 - 3*x^2*y^2 + 1", BALL, "unknown", False),  # Motzkin's, 0 at (1, 1), no sum of squares
        ("(x - 1)^2 + (y - 2)^2 + (z - 1)^2 - 1e-4", BALL, "found", False),  # small
        ("(x - 30)^2 + y^2 + z^2 - 0.01", None, "found", False),  # small and far away
        ("(x - 1)*(x^2 + y^2)", BALL, "found", False),
        ("x^2 - 2*y^2", BALL, "found", False),
    ],
)
def test_points(expression, clip, points, everywhere):
    facts = formula_facts(expression, {}, clip)
    assert (facts.points, facts.everywhere) == (points, everywhere)
    assert (facts.nothing is None) == (points == "found")


def test_sentences():
    assert formula_facts("-x^2 - 1", {}, BALL).nothing == "it has no real points: f is below 0 everywhere"
    assert "no real points in the clip: f is above 0 there" in formula_facts("x*y + 1", {}, FAR_BOX).nothing
    assert "at most curves or points" in formula_facts("x^2 + y^2", {}, BALL).nothing
    notes = formula_facts("(x - 1)^2*y^3*(x^2 + 1)", {}, BALL).notes
    assert notes == (
        "f is a product: its surface is that of x - 1 and of y and of x^2 + 1, together",
        "x - 1 occurs 2 times in f; it is drawn once",
        "y occurs 3 times in f; it is drawn once",
        "nothing is seen of the factor x^2 + 1: it is above 0 everywhere",
    )
    assert formula_facts("x^2 + y - 1", {}, BALL).notes == ()


@pytest.mark.parametrize("name", ["heart", "barth-sextic", "klein-bottle", "kummer", "whitney-umbrella"])
def test_known_surfaces_are_found(name):
    known = SURFACES[name]
    facts = formula_facts(known.expression, known.parameters, Ball(center=known.centre, radius=known.radius))
    assert facts.points == "found" and facts.nothing is None and facts.notes == ()


def test_what_is_no_surface():
    for text, words in {"5": "a constant", "x - x": "0 everywhere", "(x + 1)^2 - x^2 - 2*x": "a constant"}.items():
        with pytest.raises(PolynomialError, match=words):
            formula_facts(text, {}, BALL)


_POWERS = st.tuples(st.integers(0, 4), st.integers(0, 2), st.integers(0, 2)).filter(any)
_COEFFICIENTS = st.integers(-3, 3).filter(bool)


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(_POWERS, _COEFFICIENTS, min_size=1, max_size=5), st.integers(-3, 9), st.booleans())
def test_proofs_agree_with_exact_values(terms, constant, square):
    text = " + ".join(f"{c}*x^{i}*y^{j}*z^{k}" for (i, j, k), c in terms.items())
    text = f"({text})^2 + {constant}" if square else f"{text} + {constant}"
    exact = exact_terms(text)
    assume(any(any(e) for e in exact))
    facts = formula_facts(text, {}, BALL)
    rng = np.random.default_rng(0)
    q = rng.normal(size=(300, 3))
    q *= 3 * rng.uniform(0, 1, (300, 1)) / np.linalg.norm(q, axis=1, keepdims=True)
    points = [tuple(Fraction(round(1024 * c), 1024) for c in 0.999 * p) for p in q]
    values = [sum(c * x**i * y**j * z**k for (i, j, k), c in exact.items()) for x, y, z in points]
    if facts.points == "none":
        assert all(v > 0 for v in values) or all(v < 0 for v in values)
    if facts.points == "thin":
        assert all(v >= 0 for v in values) or all(v <= 0 for v in values)
    if min(values) < 0 < max(values):
        assert facts.points == "found"
