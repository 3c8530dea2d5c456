"""Polynomial surfaces from text: exact values, factors, equal forms, and lines for what is wrong."""

import json
import math
import subprocess
import sys
from fractions import Fraction
from itertools import combinations_with_replacement
from math import isclose, prod, sqrt
from pathlib import Path

import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visray.camera import Camera
from visray.explaining import explain
from visray.polynomials import (
    PolynomialError,
    build,
    check_sizes,
    evaluate,
    exact_terms,
    interpret,
    magnitude_bounds,
    modular,
)
from visray.polynomials.constants import rational
from visray.polynomials.program import read, slope_flaw
from visray.primitives import Polynomial, Sphere
from visray.scene.scene import Scene
from visray.study.stability.exact.expressions import number

HEART = "(x^2+9/4*y^2+z^2-1)^3 - x^2*z^3 - 9/80*y^2*z^3"
SPHERE = "(x^2+y^2+z^2-1)"
CATALOGUE = Path(__file__).resolve().parents[2] / "shared" / "notes" / "surfaces.json"
SURFACES = json.loads(CATALOGUE.read_text())["surfaces"] if CATALOGUE.exists() else []
POINTS = [
    (Fraction(1, 3), Fraction(-2, 7), Fraction(5, 11)),
    (Fraction(-4, 3), Fraction(1, 5), Fraction(2, 9)),
    (Fraction(7, 4), Fraction(3, 2), Fraction(-8, 5)),
    (Fraction(0), Fraction(-5, 6), Fraction(9, 10)),
]


def value(terms, point):
    """A polynomial from `exact` at a point."""
    return sum((c * prod(v**n for v, n in zip(point, e)) for e, c in terms.items()), Fraction(0))


def factors_at(built, point, centre=(0, 0, 0)):
    q = [p - Fraction(c) for p, c in zip(point, centre)]
    return [interpret(f.code, built.exact_values, q) for f in built.program.factors]


def sign(v):
    return (v > 0) - (v < 0)


def agrees(source, parameters=None, centre=(0, 0, 0), points=POINTS):
    """Whether sign * the odd factors has the sign of f everywhere, and f and the factors vanish together."""
    built, terms = build(source, parameters, centre), exact_terms(source, parameters)
    for point in points:
        values = factors_at(built, point, centre)
        whole = value(terms, point)
        if all(values):
            odd = prod(sign(v) for v, f in zip(values, built.program.factors) if not f.even)
            assert built.program.sign * odd == sign(whole), (source, point)
        else:
            assert whole == 0
    return built


def shape(source, parameters=None):
    return [(f.degree, f.even) for f in agrees(source, parameters).program.factors]


def same(source, other, scale=1):
    """Whether the one factor of a polynomial is exactly `scale` times another polynomial."""
    built, terms = build(source), exact_terms(other)
    assert len(built.program.factors) == 1
    for point in POINTS:
        assert factors_at(built, point) == [scale * value(terms, point)]


# --- values --------------------------------------------------------------------------------------------------------


def test_the_heart_is_evaluated_as_it_is_written():
    built = build(HEART)
    for x, y, z in POINTS:
        g = x * x + Fraction(9, 4) * y * y + z * z - 1
        assert factors_at(built, (x, y, z)) == [g**3 - x * x * z**3 - Fraction(9, 80) * y * y * z**3]
    assert [f.degree for f in built.program.factors] == [6] and built.values == (2.25, -1.0, -9 / 80)
    assert sum(op[0] == "pow" and op[2] == 3 for op in built.program.factors[0].code) == 2


def test_numbers_are_read_exactly():
    assert exact_terms("0.1*x + .5*y - 1e-3*z + 1.25e2") == {
        (1, 0, 0): Fraction(1, 10),
        (0, 1, 0): Fraction(1, 2),
        (0, 0, 1): Fraction(-1, 1000),
        (0, 0, 0): Fraction(125),
    }
    assert exact_terms("x - r", {"r": 0.1})[0, 0, 0] == -Fraction(0.1)
    assert exact_terms("x/3 - 2/(3/4)")[1, 0, 0] == Fraction(1, 3)
    assert exact_terms("-x^2") == {(2, 0, 0): Fraction(-1)} and exact_terms("x**2 + x^0") == exact_terms("x^2 + 1")


def test_named_constants():
    terms = exact_terms("phi*x + pi*y + sqrt(2)*z - sqrt(9/4)")
    assert isclose(terms[1, 0, 0], (1 + sqrt(5)) / 2, rel_tol=1e-16)
    assert isclose(terms[0, 1, 0], np.pi, rel_tol=1e-16)
    assert abs(terms[0, 0, 1] ** 2 - 2) < Fraction(1, 10**60) and terms[0, 0, 0] == Fraction(-3, 2)
    assert exact_terms("(phi^2 - phi - 1)*x + y") == {(0, 1, 0): 1}


def test_the_root_of_an_exact_zero_is_zero():
    zero = "(sqrt(2)^2 - 2)"
    for text in (f"x - sqrt({zero})*y", f"x + sqrt(sqrt({zero}))*y", f"x - sqrt(-3*{zero})*y", f"x + sqrt(a*{zero})*y"):
        parameters = {"a": 1.0} if "a" in text else {}
        assert exact_terms(text, parameters) == {(1, 0, 0): 1} and shape(text, parameters) == [(1, False)]
    assert exact_terms("x + sqrt(sqrt(9 + 4*sqrt(5)) - sqrt(5) - 2)*y") == {(1, 0, 0): 1}


def test_roots_of_differences_of_parameters():
    assert build("x + sqrt(a - b)*y - 1", {"a": -1.0, "b": -5.0}).values == (2.0, -1.0)


# Constant expressions, and their values in Python's arithmetic or equal constants without functions.
EXACT = {
    "cos(2*pi/5)": "(sqrt(5) - 1)/4",
    "sin(2*pi/5)": "sqrt(10 + 2*sqrt(5))/4",
    "cos(-pi/8)": "sqrt(2 + sqrt(2))/2",
    "tan(pi/12)": "2 - sqrt(3)",
    "sin(pi/16)^2": "1/2 - sqrt(2 + sqrt(2))/4",
    "2*cos(pi/17)*cos(4*pi/17)": "cos(3*pi/17) + cos(5*pi/17)",
    "exp(log(2)/2)": "sqrt(2)",
    "log(e^3)": "3",
    "4*atan(1)": "pi",
    "acos(1/2)": "pi/3",
    "asin(sqrt(2)^2/2)": "pi/2",
    "2^-2": "1/4",
    "(9/4)^(3/2)": "27/8",
    "5^0.5": "sqrt(5)",
    "2^(1 + 1)": "4",
    "sqrt(3)^-2": "1/3",
    "0^0.5": "0",
    "tan(pi)": "0",
}
ROUNDED = {
    "cos(2*pi/7)": math.cos(2 * math.pi / 7),
    "sin(1)": math.sin(1),
    "sin(2^900)": math.sin(2.0**900),
    "atan(2) + asin(0.25)": math.atan(2) + math.asin(0.25),
    "acos(1/3)/3": math.acos(1 / 3) / 3,
    "e": math.e,
    "exp(-2/3)": math.exp(-2 / 3),
    "log(10)": math.log(10),
    "exp(sin(cos(1)))": math.exp(math.sin(math.cos(1))),
    "2^(1/3)": 2 ** (1 / 3),
    "pi^e": math.pi**math.e,
    "exp(-40)": math.exp(-40),
    "100*sin(1e-8)": 100 * math.sin(1e-8),
}


@pytest.mark.parametrize("text", EXACT)
def test_functions_that_are_exact(text):
    assert exact_terms(f"x + ({text} - ({EXACT[text]}))*y") == {(1, 0, 0): 1}
    # Factors are found as for the other form: the difference of two equal squares is a product.
    assert shape(f"x^2*(2 + {text})^2 - (2 + {EXACT[text]})^2*y^2") == [(1, False)] * 2


@pytest.mark.parametrize("text", ROUNDED)
def test_functions_that_are_rounded(text):
    value = build(f"({text})*x - y").values
    assert isclose(value[0], ROUNDED[text], rel_tol=4e-16)
    assert shape(f"x^2 + 2*({text})*x*y + ({text})^2*y^2") == [(1, True)]


@pytest.mark.parametrize("text", [*EXACT, *ROUNDED])
def test_the_exact_study_has_the_same_constants(text):
    other, value = number(text), exact_terms(f"({text})*x + y").get((1, 0, 0), 0)
    assert abs(value - other) <= max(abs(other), 1) / 10**20


def test_functions_are_rounded_once_and_correctly():
    # Cases in which rounding twice, or the rounding of pi before the function, would change the last digit.
    with flint.ctx.workprec(400):
        for k in range(1, 40):
            expected = {"sin": flint.arb(k).sin(), "exp": (flint.arb(k) / 7).exp(), "log": (flint.arb(k) + 1).log()}
            text = {"sin": f"sin({k})", "exp": f"exp({k}/7)", "log": f"log({k}+1)"}
            for name, ball in expected.items():
                (value, _) = build(f"{text[name]}*x - 2*y").values
                m, e = ball.mid().man_exp()
                assert value == float(Fraction(int(m)) * Fraction(2) ** int(e)), text[name]


def test_functions_of_parameters():
    turned = "(cos(a)*x + sin(a)*y)^2/4 + (cos(a)*y - sin(a)*x)^2 + z^2 - exp(-a)"
    forms = {build(turned, {"a": a}).program for a in (0.0, 0.5, -2.0)}
    assert len(forms) == 1
    built = build(turned, {"a": 0.5})
    assert {math.cos(0.5), math.sin(0.5), -math.exp(-0.5)} <= {*built.values}
    constants = [evaluate(c, {"a": 0.5}.get, float, math) for c in built.constants]
    assert np.allclose(constants, built.values, rtol=1e-15)
    assert build("sin(a*pi)*x + y - 1", {"a": 1.0}).values == (0.0, -1.0)


def test_e_is_a_parameter_if_one_has_this_name():
    assert build("e*x - y", {"e": 0.5}).values == (0.5,) and build("e*x - y").values == (math.e,)


def test_nested_roots():
    tower = "2"
    for n in range(1, 99):
        tower = f"sqrt({tower})"
        if n in (1, 5, 40, 98):
            # The logarithm of the root is log(2) / 2^n.
            assert isclose(exact_terms(f"{tower}*x")[1, 0, 0] - 1, np.expm1(np.log(2) / 2**n), rel_tol=1e-15)
    assert build(f"{tower}*x - y").values == (1.0,)
    for size in ("1e-299", "3e299"):
        root = exact_terms(f"sqrt({size})*x")[1, 0, 0]
        assert abs(root**2 / Fraction(size) - 1) < Fraction(1, 10**70)


@pytest.mark.parametrize(
    ("monomial", "expected"),
    [
        ("+3x2", "3*x^2"),
        (".5x2", "x^2/2"),
        ("x12", "x^12"),
        ("2*x", "2*x"),
        ("xx2", "x^3"),
        ("1e-3x", "x/1000"),
        ("Y2", "y^2"),
        ("x^2", "x^2"),
        ("x**2", "x^2"),
        ("2 x2 y", "2*x^2*y"),
        ("-x", "-x"),
        ("x2y3z", "x^2*y^3*z"),
        ("-3y2", "-3*y^2"),
        ("- 0.25 z", "-z/4"),
        ("2.*x*y", "2*x*y"),
        ("X0z", "z"),
        ("2E1x", "20*x"),
    ],
)
def test_monomials_that_were_misread(monomial, expected):
    assert exact_terms([monomial, "-1"]) == exact_terms(f"{expected} - 1")


def test_monomials_are_a_sum():
    assert exact_terms(["0.9x2", "z2", "y4", "y3", "-3y2", "-1"]) == exact_terms(
        "0.9*x^2 + z^2 + y^4 + y^3 - 3*y^2 - 1"
    )


def test_any_arithmetic():
    built = build(HEART)
    code = built.program.factors[0].code
    x, y, z = 0.3, -0.2, 0.7
    expected = (x * x + 9 / 4 * y * y + z * z - 1) ** 3 - x * x * z**3 - 9 / 80 * y * y * z**3
    assert isclose(interpret(code, built.values, (x, y, z)), expected, rel_tol=1e-14)
    rows = interpret(code, built.values, (np.full(3, x), np.full(3, y), np.full(3, z)))
    assert np.allclose(rows, expected, rtol=1e-14)
    t = flint.fmpq_poly([0, 1])
    line = interpret(code, [flint.fmpq(w.numerator, w.denominator) for w in built.exact_values], (t, 2 * t, 3 * t))
    assert line.degree() == 6
    assert interpret(code, built.exact_values, POINTS[0], lambda v, n: v**n) == factors_at(built, POINTS[0])[0]


def test_constants_of_slots_in_other_arithmetics():
    built = build("x^2 + y^2 - a*sqrt(2)*z - 2*sqrt(a)", {"a": 2.0})
    constants = [evaluate(c, {"a": 2.0}.get, float, math) for c in built.constants]
    assert np.allclose(constants, built.values, rtol=1e-15)
    (h,) = [c for c in built.constants if c.parametric and "Root(of=Parameter" in repr(c)]
    with pytest.raises(ValueError, match="needs functions"):
        evaluate(h, {"a": 2.0}.get, float)
    assert rational(built.constants[0], {"a": Fraction(2)}) == built.exact_values[0]


# --- random expressions --------------------------------------------------------------------------------------------


@st.composite
def expressions(draw, depth=3):
    """A text and what it means, as a function of exact coordinates."""
    if depth == 0 or draw(st.integers(0, 5)) == 0:
        kind = draw(st.integers(0, 4))
        if kind < 3:
            return "xyz"[kind], lambda p: p[kind]
        n = draw(st.integers(0, 40))
        return (f"{n}", lambda p: Fraction(n)) if kind == 3 else (f"{n}.25", lambda p: n + Fraction(1, 4))
    (a, f), (b, g) = draw(expressions(depth - 1)), draw(expressions(depth - 1))
    n = draw(st.integers(1, 3))
    return draw(
        st.sampled_from(
            [
                (f"({a}) + ({b})", lambda p: f(p) + g(p)),
                (f"({a}) - {b}" if "+" not in b and "-" not in b else f"({a}) - ({b})", lambda p: f(p) - g(p)),
                (f"({a})*({b})", lambda p: f(p) * g(p)),
                (f"-({a})", lambda p: -f(p)),
                (f"({a})^{n}", lambda p: f(p) ** n),
                (f"({a})/{n} + {b}", lambda p: f(p) / n + g(p)),
            ]
        )
    )


@settings(derandomize=True, deadline=None, max_examples=150)
@given(expressions(), st.sampled_from([(0, 0, 0), (1, 0, -2.5), (1000, 0.1, 0)]))
def test_random_expressions(expression, centre):
    text, f = expression
    try:
        terms = exact_terms(text)
    except PolynomialError as e:
        assert "degree" in str(e)
        return
    assert all(value(terms, p) == f(p) for p in POINTS)
    if not any(any(e) for e in terms):
        with pytest.raises(PolynomialError, match=r"everywhere|nowhere"):
            build(text, centre=centre)
        return
    built = agrees(text, None, centre)
    degree = max(map(sum, terms))
    assert sum(factor.degree for factor in built.program.factors) <= degree
    if len(built.program.factors) == 1 and built.program.factors[0].degree == degree:
        ratios = [f(p) / v for p in POINTS if (v := factors_at(built, p, centre)[0])]
        assert len(set(ratios)) <= 1


# --- factors -------------------------------------------------------------------------------------------------------


def expanded(text):
    terms = exact_terms(text)
    return " + ".join(f"({c})*x^{e[0]}*y^{e[1]}*z^{e[2]}" for e, c in terms.items())


FIVE = "*".join(f"(x^2+y^2+z^2-{k * k}/25)" for k in range(1, 6))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"{SPHERE}^2", [(2, True)]),
        (f"-3*{SPHERE}^3", [(2, False)]),
        (expanded(f"{SPHERE}^2"), [(2, True)]),
        (expanded(f"-{SPHERE}^3"), [(2, False)]),
        (f"{SPHERE}^2*(1-x^2-y^2-z^2)*x", [(2, False), (1, False)]),
        (f"{SPHERE}*(2-2*x^2-2*y^2-2*z^2)", [(2, True)]),
        ("x^2 - y^2*z^2", [(2, False)] * 2),
        (FIVE, [(2, False)] * 5),
        (expanded(FIVE), [(2, False)] * 5),
        ("(x^2-y^2)*(x-y)", [(1, True), (1, False)]),
        ("x^2+2*phi*x*y+(phi+1)*y^2", [(1, True)]),
        ("pi*x^2+2*pi*phi*x*y+pi*(phi+1)*y^2", [(1, True)]),
        ("(x^2-2*y^2)*(x-sqrt(2)*y)", [(1, False), (1, True)]),
        (f"{SPHERE}^2*x^2 - {SPHERE}^2*y^2", [(1, False), (1, False), (2, True)]),
        ("(x-1)^2 - x^2 + y", [(1, False)]),
        ("(phi^2-phi-1)*x^3 + y^2 + z^2 - 1", [(2, False)]),
        ("x^8 + y^8 + z^8 - 1", [(8, False)]),
        ("x^2 + y^2", [(2, False)]),
        ("-2*x^2*y", [(1, True), (1, False)]),
    ],
)
def test_factors(text, expected):
    assert shape(text) == expected


def test_factors_hold_for_all_values_of_a_parameter():
    text = "(x^2+y^2+z^2-1)^2 - e^2"
    built = build(text, {"e": 0.01})
    assert shape(text, {"e": 0.01}) == [(2, False)] * 2
    assert all(c.parametric for c in built.constants)
    assert build(text, {"e": 0.25}).program == built.program
    # A square at one value only is split there, and nowhere else.
    assert shape("(x^2+y^2+z^2-1)^2 - e", {"e": 0.0}) == [(2, True)]
    assert shape("(x^2+y^2+z^2-1)^2 - e", {"e": 0.25}) == [(4, False)]
    assert shape("e*x^3 + y^2 + z^2 - 1", {"e": 0.0}) == [(2, False)]


def test_expanded_sums_are_in_horner_form():
    (factor,) = build("8*x^4 - 8*x^2 + 8*y^4 - 8*y^2 + 8*z^4 - 8*z^2 + 4").program.factors
    powers = [op for op in factor.code if op[0] == "pow"]
    assert len(powers) == 3 and {op[2] for op in powers} == {2}
    assert sum(op[0] == "mul" for op in factor.code) == 6
    (factor,) = build("x^8+y^8+z^8-1").program.factors
    assert [op[0] for op in factor.code].count("pow") == 3 and not any(op[0] == "mul" for op in factor.code)
    same("x^3 + x*y - x*z^2 + 2*x^2*y^2 - 7", "x^3 + x*y - x*z^2 + 2*x^2*y^2 - 7")


def test_common_cases_do_without_sympy():
    program = (
        "import sys; from visray.polynomials import build\n"
        f"build({HEART!r}); build({SPHERE + '^2'!r}); build(['x2', 'y2', 'z2', '-1'])\n"
        "assert 'sympy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


# --- forms ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("a", "b", "equal"),
    [
        ("3*x^2 + y^2 - 2", "-1.5*x^2 + y^2 + 7/9", True),
        ("3*x^2 + y^2 - 2", "sqrt(2)*x^2 + y^2 - pi", True),
        ("3*x^2 + y^2 - 2", "1*x^2 + y^2 - 1", True),
        ("3*x^2 + y^2 - 2", "3*x^2 - y^2 - 2", False),
        ("3*x^2 + y^2 - 2", "3*x^2 + y^4 - 2", False),
        ("3*x^2 + y^2 - 2", "3*x^2 + z^2 - 2", False),
        ("3*x^2 + y^2 - 2", "x^2 + y^2 - 2", False),
        ("3*x^2 + y^2 - 2", "3*x^2 + y^2", False),
        (HEART, HEART.replace("9/80", "0.2").replace("9/4", "2"), True),
        (f"{SPHERE}^2", SPHERE, False),
    ],
)
def test_equal_forms(a, b, equal):
    assert (build(a).program == build(b).program) == equal
    assert not equal or hash(build(a).program) == hash(build(b).program)


def test_parameters_are_slots_also_at_1_and_0():
    text = "a*x^2 + y^2 + b*z^2 - a"
    forms = {
        build(text, {"a": a, "b": b}).program for a, b in combinations_with_replacement((0.0, 0.5, 1.0, -1.0), 2) if a
    }
    assert len(forms) == 1 and build(text, {"a": 2.0, "b": 1.0}).program.constant_count == 3


def test_names_share_slots_and_equal_sums_are_one():
    assert build("a*x^2 + a*y^2 + sqrt(2)*x + sqrt(2)*z - 1", {"a": 2.0}).program.constant_count == 3
    assert build("2*x^2 + 2*y^2 - 1").program.constant_count == 3
    (factor,) = build("(x^2+y^2+z^2-1)^3 - z^3*(x^2+y^2+z^2-1) + 7").program.factors
    assert [op[0] for op in factor.code].count("constant") == 2


def test_far_centres_are_exact():
    built = build("(x - 1000)^2 + y^2 + (z - 0.1)^2 - 1/4", centre=(1000.0, 0.0, 0.1))
    x, y, z, r = Fraction(1, 3), Fraction(2, 7), Fraction(1, 5), Fraction(1, 10) - Fraction(0.1)
    assert factors_at(built, (x, y, z)) == [x**2 + y**2 + (z - r) ** 2 - Fraction(1, 4)]
    assert build("(x - 1000)^2 + y^2 - 4", centre=(1000, 0, 0)).program == build("x^2 + y^2 - 4").program
    far = "x^2 - 2000*x + y^2 + z^2 - 4000*z + 4999999.5"
    built = build(far, centre=(1000, 0, 2000))
    assert built.values == (-0.5,) and built.program == build("x^2 + y^2 + z^2 - 0.5").program
    agrees(far, None, (1000, 0, 2000))


def test_sizes():
    assert magnitude_bounds(build("3*x^2 - y - 2"), 10) == (312.0,)
    check_sizes(build(HEART), 2)
    with pytest.raises(
        PolynomialError, match=r"^its values reach inf, too large for doubles; write it in a larger unit$"
    ):
        check_sizes(build("1e300*x^2 + y"), 1e10)
    with pytest.raises(
        PolynomialError, match=r"^its values reach only 2e-290, too small for doubles; multiply it by a large"
    ):
        check_sizes(build("1e-290*x^2 + 1e-290*y"), 1)


# --- the catalogue -------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not SURFACES, reason="the catalogue is not there")
@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: s["name"])
def test_catalogue(surface):
    text = surface["expression"]
    centre = surface["centre"] or (0, 0, 0)
    terms = exact_terms(text)
    assert max(map(sum, terms)) == surface["degree"]
    agrees(text, None, centre)
    expected = {(i, j, k): Fraction(c) for i, j, k, c in surface["monomials"]} if surface["monomials"] else None
    if surface["coefficients_rational"] and "sqrt" not in text:
        assert terms == expected
    elif expected:
        # Stored to 40 digits where they are irrational.
        assert terms.keys() == expected.keys()
        assert all(abs(terms[e] - c) <= abs(c) / 10**36 for e, c in expected.items())


# --- what is wrong -------------------------------------------------------------------------------------------------

NAMES = "x, y, z, phi, pi, sqrt, sin, cos, tan, asin, acos, atan, exp, log, e, huge, r"
BAD = {
    "": "it is empty; write for example x^2 + y^2 + z^2 - 1",
    "   ": "it is empty; write for example x^2 + y^2 + z^2 - 1",
    "x +": "it breaks off after +; add what follows or leave it out",
    "(x": "the bracket at column 1 is not closed; add a )",
    "x)": "the bracket at column 2 was not opened; leave it out",
    "x***2": "not understood at column 4, near 'x***2'; write for example x^2 + y^2 + z^2 - 1",
    "x y": "a sign is missing at column 3; write x*y",
    "2x": "a sign is missing at column 2; write 2*x",
    "2 x": "a sign is missing at column 3; write 2*x",
    "2(x+1)": "a sign is missing at column 2; write 2*(x+1)",
    "x2": "unknown name x2; write x^2",
    "xy": "unknown name xy; write x*y",
    "X+1": f"unknown name X; did you mean x? (one of {NAMES})",
    "x(y+1)": "a sign is missing at column 2; write x*(y+1)",
    "(x+1)(y+1)": "a sign is missing at column 6; write (x+1)*(y+1)",
    "x^2 y": "a sign is missing at column 5; write x^2*y",
    "2x^2 y + 3 y z(x+1)(x-1) - 1 z\n": "a sign is missing at column 2; write 2*x^2*y + 3*y*z*(x+1)*(x-1) - 1*z",
    "(x+1)*2y": "a sign is missing at column 8; write (x+1)*2*y",
    "1/x": "it divides by x; only division by constants leaves a polynomial",
    "x/(2-2)": "it divides by 2-2, which is 0; divide by another number",
    "x/(sqrt(2)^2-2)": "it divides by sqrt(2)^2-2, which is 0; divide by another number",
    "x/(r*sqrt(2)^2-2*r)": "it divides by r*sqrt(2)^2-2*r, which is 0; divide by another number",
    "x/(y-y)": "it divides by y-y; only division by constants leaves a polynomial",
    "x^-2": "the exponent -2 is not allowed; it is a whole number as in x^2",
    "x^2.5": "the exponent 2.5 is not allowed; it is a whole number as in x^2",
    "x^y": "the exponent y is not allowed; it is a whole number as in x^2",
    "x^(1/2)": "the exponent 1/2 is not allowed; it is a whole number as in x^2",
    "x^r": "the exponent r is not allowed; it is a whole number as in x^2",
    "x^33": "its degree, as written, is 33; at most 32",
    "(x^8)^8": "its degree, as written, is 64; at most 32",
    "x^999999999999": "its degree, as written, is over a million; at most 32",
    "x^20*y^20": "its degree, as written, is 40; at most 32",
    "9^9^9*x": "9^9^9 has too many digits to be computed exactly; write a shorter number",
    "2^x": "the exponent x is not allowed; it is a whole number as in x^2",
    "0^-1*x": "0^-1 divides by 0; write another number",
    "(-8)^(1/3)*x": "(-8)^(1/3) has a negative base, -8; only a whole exponent is possible there",
    "9^999999*x": "9^999999 has too many digits to be computed exactly; write a shorter number",
    "((2^900)^900)*x": "(2^900)^900 has too many digits to be computed exactly; write a shorter number",
    "(2^900)*(2^900)*x+y": "its constants multiply to a number beyond the doubles; write it in another unit",
    "x*(1/2^900)*(1/2^900)+y": "its constants multiply to a number beyond the doubles; write it in another unit",
    "1e999999999*x": "the number 1e999999999 has too many digits; it is 0 or between 1e-301 and 1e301",
    "1e999*x": "the number 1e999 is too large or too small; it is 0 or between 1e-301 and 1e301",
    "0."
    + "0" * 2000
    + "1*x": "the number 0.000000000000000... has too many digits; it is 0 or between 1e-301 and 1e301",
    "fi*x": f"unknown name fi; one of {NAMES}",
    "hug*x": f"unknown name hug; did you mean huge? (one of {NAMES})",
    "sin(x)": "sin of x is no polynomial; only constants have a sin here",
    "cos(2*y)": "cos of 2*y is no polynomial; only constants have a cos here",
    "sinh(1)*x": "unknown function sinh; one of sqrt, sin, cos, tan, asin, acos, atan, exp, log, of a constant",
    "ln(2)*x": "unknown function ln; write log(...), of a constant",
    "log(0)*x": "log of 0, which is not above 0; it takes a number above 0",
    "log(sqrt(2)^2-2)*x": "log of sqrt(2)^2-2, which is not above 0; it takes a number above 0",
    "log(1-2*r)*x": "log of 1-2*r, which is not above 0; it takes a number above 0",
    "tan(pi/2)*x": "tan(pi/2) is infinite; write another number",
    "tan(r*pi/2)*x": "tan(r*pi/2) is infinite, or cannot be computed to the last digit; write another number",
    "acos(-1.5)*x": "acos of -1.5; it takes a number from -1 to 1",
    "exp(1000)*x": "exp(1000) is too large or too small; a constant is 0 or between 1e-301 and 1e301",
    "exp(-1e300)*x": "exp(-1e300) is too large or too small; a constant is 0 or between 1e-301 and 1e301",
    "exp(exp(exp(9)))": "exp(exp(9)) is too large or too small; a constant is 0 or between 1e-301 and 1e301",
    "x-" + "sin(" * 9 + "1" + ")" * 9: "sin(sin(sin(sin(s... has too many functions in one another; at most 8",
    "2e*x": "a sign is missing at column 2; write 2*e*x",
    "e(x)": "a sign is missing in e(x); write e*(...)",
    "exp*x": "exp stands without brackets; write exp(2)",
    "(x-sin(1)^2-cos(1)^2)*(x-1)": "a factor in it is repeated if its constants are computed; write it as a power, "
    "(...)^2",
    "(x-sqrt((1-sqrt(2))^2))*(x+1-sqrt(2))": "a factor in it is repeated if its constants are computed; write it as "
    "a power, (...)^2",
    "x^2*2^(1/3)*2^(2/3)-2*x^2+y": "its terms of degree 2 cancel, as those of (sin(1)^2 + cos(1)^2 - 1)*x do; leave "
    "them out",
    "sqrt(x)": "sqrt of x is no polynomial; only constants have a sqrt here",
    "sqrt(-2)*x": "sqrt of -2, which is negative; it takes a number of at least 0",
    "sqrt(2-3*r)*x": "sqrt of 2-3*r, which is negative; it takes a number of at least 0",
    "sqrt": "sqrt stands without brackets; write sqrt(2)",
    "sqrt()": "sqrt takes one number; write sqrt(2)",
    "sqrt(2)(x)": "a sign is missing at column 8; write sqrt(2)*(x)",
    "x.real": "'x.real' has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have",
    "x = 1": "unexpected '=' at column 3; write f = g as f - g",
    "x < 1": "unexpected '<' at column 3; a surface is f = 0, without a comparison",
    "x, y": "unexpected ',' at column 2; decimals have a point, as in 0.5",
    "0,5*x": "unexpected ',' at column 2; decimals have a point, as in 0.5",
    "x²": "unexpected '²' at column 2; write x^2",
    "x # y": "unexpected '#' at column 3; only numbers, names and + - * / ^ ( ) have a meaning",
    "'x'": 'unexpected "\'" at column 1; only numbers, names and + - * / ^ ( ) have a meaning',
    "lambda: x": "unexpected ':' at column 7; only numbers, names and + - * / ^ ( ) have a meaning",
    "lambda": "not understood at column 1, near 'lambda'; write for example x^2 + y^2 + z^2 - 1",
    "x if y else z": "'x if y else z' has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have",
    "x and y": "'x and y' has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have",
    "not x": "'not x' has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have",
    "x // 2": "'x // 2' has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have",
    "x % 2": "unexpected '%' at column 3; only numbers, names and + - * / ^ ( ) have a meaning",
    "0x10*x": "0x10 is no number; write numbers as in 1000.5 or 1e3",
    "1_000*x": "1_000 is no number; write numbers as in 1000.5 or 1e3",
    "1j*x": "a sign is missing at column 2; write 1*j*x",
    "True": "'True' has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have",
    "None*x": "'None' has no meaning in a polynomial; only numbers, names and + - * / ^ ( ) have",
    "a.__class__('true')": 'unexpected "\'" at column 13; only numbers, names and + - * / ^ ( ) have a meaning',
    "x-x": "it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0",
    "x*0": "it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0",
    "(x+y)^2-x^2-2*x*y-y^2": "it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0",
    "3": "it is a constant, nowhere 0; a surface has x, y or z in its polynomial",
    "r": "it is a constant, nowhere 0; a surface has x, y or z in its polynomial",
    "(x+1)^2-x^2-2*x": "it is a constant, nowhere 0; a surface has x, y or z in its polynomial",
    "sqrt(12)*x-2*sqrt(3)*x": "it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0",
    "-" * 5000 + "x": "it is nested too deeply; at most 100 levels",
    "(" * 300 + "x" + ")" * 300: "it is nested too deeply; at most 100 levels",
    "+".join(["x"] * 9999): "it is nested too deeply; at most 100 levels",
    "x+" * 10001: "it is 20002 characters long; at most 20000",
    "x\n+\ny +": "it breaks off after +; add what follows or leave it out",
}


@pytest.mark.parametrize("text", BAD)
def test_bad_texts(text):
    with pytest.raises(PolynomialError) as e:
        build(text, {"r": 1.0, "huge": 2.0})
    assert str(e.value) == BAD[text] and e.value.part is None


NO_MONOMIAL = (
    'is not a monomial; write a number and then powers of x, y and z, as in "-0.5x2y"; '
    "a sum has one entry for each of its terms"
)
BAD_MONOMIALS = {
    "": NO_MONOMIAL,
    "*x": NO_MONOMIAL,
    "x+y": NO_MONOMIAL,
    "x 2": NO_MONOMIAL,
    "x*2": NO_MONOMIAL,
    "w2": NO_MONOMIAL,
    "-": NO_MONOMIAL,
    "--x": NO_MONOMIAL,
    "2**x": NO_MONOMIAL,
    "sqrt(2)x": NO_MONOMIAL,
    "x99": "its degree, as written, is 99; at most 32",
    "x20y20": "its degree, as written, is 40; at most 32",
    "x99999999999999": "its degree, as written, is over a million; at most 32",
    "1e9999x": "the number 1e9999 has too many digits; it is 0 or between 1e-301 and 1e301",
    "1/2x": NO_MONOMIAL,
    "x²": NO_MONOMIAL,
}


@pytest.mark.parametrize("monomial", BAD_MONOMIALS)
def test_bad_monomials(monomial):
    with pytest.raises(PolynomialError) as e:
        build(["x2", monomial])
    assert str(e.value) == BAD_MONOMIALS[monomial] and e.value.part == 1


def test_no_monomials():
    with pytest.raises(PolynomialError, match=r"^there is no monomial; write for example"):
        build([])


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("x", 1.0, "a parameter cannot be called x, which has a meaning already; take another name"),
        ("sqrt", 1.0, "a parameter cannot be called sqrt, which has a meaning already; take another name"),
        ("a b", 1.0, "'a b' is no name of a parameter; it has letters, digits and _, as in r or r_1"),
        ("lambda", 1.0, "'lambda' is no name of a parameter; it has letters, digits and _, as in r or r_1"),
        ("r", float("nan"), "the parameter r is nan; it is 0 or between 1e-301 and 1e301 in size"),
        ("r", float("inf"), "the parameter r is inf; it is 0 or between 1e-301 and 1e301 in size"),
        ("r", 1e-310, "the parameter r is 1e-310; it is 0 or between 1e-301 and 1e301 in size"),
    ],
)
def test_bad_parameters(name, value, text):
    with pytest.raises(PolynomialError) as e:
        build("x + y - 1", {name: value})
    assert str(e.value) == text


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "exec(x)",
        "print(x)",
        "open(x)",
        "(lambda: x)()",
        "x.__class__",
        "[x for x in y]",
        "{x}",
        "x if print(y) else z",
        "(x := y)",
        "f'{x}'",
        "breakpoint()",
        "await_(x)",
        "sqrt(exit())",
    ],
)
def test_nothing_is_executed(text, monkeypatch, capsys):
    def called(*_, **__):
        raise AssertionError("executed")

    for name in ("exec", "open", "print", "breakpoint", "exit", "__import__"):
        monkeypatch.setattr(f"builtins.{name}", called, raising=False)
    try:
        with pytest.raises(PolynomialError):
            read(text, {})
    finally:
        monkeypatch.undo()
    assert not capsys.readouterr().out


# --- prime fields --------------------------------------------------------------------------------------------------


def test_primes():
    assert [n for n in range(60) if modular.is_prime(n)] == [n for n in range(60) if flint.fmpz(n).is_prime()]
    rows = [(1 << 61) - 1, (1 << 61) + 1, 3215031751, 3825123056546413051, 341550071728321]
    assert [modular.is_prime(n) for n in rows] == [bool(flint.fmpz(n).is_prime()) for n in rows]


def test_degrees_of_factors_modulo_primes():
    for p, coefficients in [
        (1009, [3, 1, 4, 1, 5, 9, 2, 6, 5, 1]),
        (1013, [2, 7, 1, 8, 2, 8, 1]),
        (1019, [1, 0, 0, 0, 1]),
    ]:
        factors = flint.nmod_poly(coefficients, p).factor()[1]
        assert all(n == 1 for _, n in factors)
        assert sorted(modular.factor_degrees(coefficients, p)) == sorted(f.degree() for f, _ in factors)


def test_functions_that_are_rounded_are_named():
    def named(text, parameters=None):
        return Polynomial(expression=text, parameters=parameters or {}).rounded_constants()

    assert named("cos(2*pi/5)*x^2 + sqrt(2)*y^2 - 1") == ()
    assert named("sin(1)*x^2 + exp(1/2)*y^2 - sin(1)*2^(1/3)") == ("sin(1)", "exp(1/2)", "2^(1/3)")
    scene = Scene(
        objects={"p": Polynomial(expression="x^2 + y^2 - log(a)", parameters={"a": 2.0}), "q": Sphere()},
        camera=Camera(),
        lights={},
    )
    assert explain(scene).notes == ("objects.p: log(a) is rounded to 53 bits, the nearest double",)


@pytest.mark.parametrize("text", ["x - acos(a)", "x - asin(a)*y - 1", "x - asin(-a)^2 + 1", "x - sqrt(1 - a)"])
def test_infinite_slopes_are_refused(text):
    assert "slope infinite" in slope_flaw(text, {"a": 1.0}, frozenset({"a"}))
    assert slope_flaw(text, {"a": 0.5}, frozenset({"a"})) is None


def test_sympy_is_not_asked_what_it_cannot_answer_quickly():
    """Both took minutes: sympy judged the sign of a nested constant, and factored numbers of 1000 bits."""
    assert build("(1 + asin(acos(sqrt(2)^(1e-300))))*x + y").values == (1.0,)
    text = "exp(acos(-1))*x^3 + atan((1/3)^0.5)*1e-290*x*y*z - sin(1e300)*x^2*y + cos(1e299)*x*z^2 - pi*x"
    assert sum(f.degree for f in build(text).program.factors) == 3
