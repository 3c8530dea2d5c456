"""Formulas as people write them are read as the polynomials that they mean, or refused with the right column."""

# ruff: noqa: RUF001 - the letters and signs of formulas
import re
from decimal import Decimal, localcontext
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visray.polynomials import PolynomialError, exact_terms
from visray.polynomials.everyday import everyday
from visray.primitives import Polynomial

READ = {
    # formula: (the same in the strict grammar, its parameters)
    "x^2 + y^2 - z^2 - a": ("x^2+y^2-z^2-a", "a"),
    "4x^3y": ("4*x^3*y", ""),
    "2(x+1)(y-1)": ("2*(x+1)*(y-1)", ""),
    "x y z": ("x*y*z", ""),
    "x² + y² + z² = 1": ("x^2+y^2+z^2-1", ""),
    "x²³ + y⁽²⁾": ("x^23+y^2", ""),
    "x**2 + y**2": ("x^2+y^2", ""),
    "z = x^2 + y^2": ("z-x^2-y^2", ""),
    "y = -x^2 + z": ("y+x^2-z", ""),
    "0 = x^2 + y^2 - 1": ("x^2+y^2-1", ""),
    "x² + y² − 1 = 0": ("x^2+y^2-1", ""),
    "x == y": ("x-y", ""),
    "f(x,y,z) = x^2 + y^2 + z^2 - 1": ("x^2+y^2+z^2-1", ""),
    "F(x, y, z) = x^2 + y^2 + z^2 - 1 = 0": ("x^2+y^2+z^2-1", ""),
    "f(x,y) = x^2 - y^2": ("z-x^2+y^2", ""),
    "z(x, y) = xy": ("z-x*y", ""),
    "1/2x^2 + y": ("x^2/2+y", ""),
    "3/4 (x+y) z": ("3*(x+y)*z/4", ""),
    "x^{2} + y^{10} = r^{2}": ("x^2+y^10-r^2", "r"),
    r"\frac{x^2}{a^2} + \frac{1}{2}y = 1": ("x^2/a^2+y/2-1", "a"),
    r"\left(x - \frac{\frac{1}{2}}{3}\right)^3 \cdot y": ("(x-1/6)^3*y", ""),
    r"$\sqrt{2}\,x + \pi y + \varphi z = \alpha$": ("sqrt(2)*x+pi*y+phi*z-alpha", "alpha"),
    r"\[\mathrm{x}^2 = y\]": ("x^2-y", ""),
    "√2x + √(3)y + sqrt 5 z + √π": ("sqrt(2)*x+sqrt(3)*y+sqrt(5)*z+sqrt(pi)", ""),
    "2cos(2π/5)x + y ln(3) sin(1)^2": ("2*cos(2*pi/5)*x+y*log(3)*sin(1)^2", ""),
    "𝑥² + 𝒚² · ｚ": ("x^2+y^2*z", ""),
    "½x² + ¾y": ("x^2/2+3*y/4", ""),
    "[x + 1]{y - 1}": ("(x+1)*(y-1)", ""),
    "X² + Y² = Z": ("x^2+y^2-z", ""),
    "axy + bz": ("a*x*y+b*z", "a b"),
    "a1x + a_2 y + a₃z + r_{max}": ("a1*x+a_2*y+a_3*z+r_max", "a1 a_2 a_3 r_max"),
    "αx + Δy + βz": ("alpha*x+Delta*y+beta*z", "alpha Delta beta"),
    "lambda x + λ_1 y": ("lam*x+lam_1*y", "lam lam_1"),
    "ex + y e^2": ("e*x+y*e^2", ""),
    "xpi + phiy": ("x*pi+phi*y", ""),
    "4(φ²x²−y²)(φ²y²−z²)(φ²z²−x²)−(1+2φ)(x²+y²+z²−w²)²w² = 0": (
        "4*(phi^2*x^2-y^2)*(phi^2*y^2-z^2)*(phi^2*z^2-x^2)-(1+2*phi)*(x^2+y^2+z^2-w^2)^2*w^2",
        "w",
    ),
    "x\u200b²\u00a0+\u2009y": ("x^2+y", ""),
    "-x-(-y)": ("-x+y", ""),
    "2^nx + y": ("2^n*x+y", "n"),
    # what stands around a formula
    "x^2 + y^2 = 1.": ("x^2+y^2-1", ""),
    "E: 2x + y - z = 4": ("2*x+y-z-4", ""),
    "f := x + y": ("x+y", ""),
    "f = x + y": ("x+y", ""),
    "x : 2 + y": ("x/2+y", ""),
    "x_1 + 2x_2 = x₃": ("x+2*y-z", ""),
    r"\displaystyle {x^2 \over a}^2 + {\frac {y}{2}} = \sin(1)": ("(x^2/a)^2+y/2-sin(1)", "a"),
    r"\frac{\frac{1}{2}x}{{3 \over 4}}": ("x/2/(3/4)", ""),
    # fractions and square roots of x, y and z
    "z = 1/x": ("x*z-1", ""),
    "z = 1/(x^2 + y^2) - 2": ("(z+2)*(x^2+y^2)-1", ""),
    "x/y + y/z + z/x = a": ("x^2*z+x*y^2+y*z^2-a*x*y*z", "a"),
    "(x + 1/y)^2 = z⁻²": ("(x*y+1)^2*z^2-y^2", ""),
    "x^-1 + y^(-2)": ("y^2+x", ""),
    "1/(1/x + 1/y) = z": ("x*y-z*(x+y)", ""),
    "z = sqrt(x^2 + y^2)": ("z^2-x^2-y^2", ""),
    "z = ±√(1 − x² − y²)": ("z^2+x^2+y^2-1", ""),
    r"\left({\sqrt {x^{2}+y^{2}}}-R\right)^{2}+z^{2}=r^{2}": ("(x^2+y^2+z^2+R^2-r^2)^2-4*R^2*(x^2+y^2)", "R r"),
    "z^(3/2) = x": ("z^3-x^2", ""),
    "x^0.5 = y": ("x-y^2", ""),
    "1/√x = y": ("1-y^2*x", ""),
    "z = 2/sqrt(x^2 + y^2)": ("4-z^2*(x^2+y^2)", ""),
    "z = (1 + √x)^3": ("(z-1-3*x)^2-x*(3+x)^2", ""),
}


def terms(strict: str, parameters: tuple[str, ...]) -> dict:
    """The terms of a strict text, with another value for each parameter."""
    return exact_terms(strict, {name: k + 2.5 for k, name in enumerate(parameters)})


@pytest.mark.parametrize("text", READ)
def test_formulas_that_are_read(text):
    strict, parameters = READ[text]
    read = everyday(text)
    assert sorted(read.parameters) == sorted(parameters.split())
    if "^n" in text:
        assert read.expression == "2^n*x + y"  # no rational exponent has exact terms
    else:
        found, expected = (terms(t, read.parameters) for t in (read.expression, strict))
        # The surface is the same for -f.
        assert found in (expected, {e: -c for e, c in expected.items()})


def test_strict_texts_stay():
    text = "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3"
    assert everyday(text).expression == text and everyday(text).notes == ()


def test_known_names_stay_whole():
    assert everyday("ab x + radius y", ["radius", "ab"]).expression == "ab*x + radius*y"
    assert everyday("ab x", ["a"]).parameters == ("a", "b")
    assert everyday("a1 x + a2", ["a"]).parameters == ("a1", "a2")
    assert everyday("e x", ["e"]).parameters == ("e",) and everyday("e x").parameters == ()
    assert everyday("X x", ["X"]).parameters == ("X",)


def test_notes_tell_what_may_surprise():
    assert everyday("ab x").notes == ("ab is read as a*b; a parameter that is given as ab is one name",)
    assert everyday("X + Y").notes == ("capital X, Y and Z are read as x, y and z",)
    assert "2e-3" in everyday("x - 2e-3").notes[0] and everyday("x - 2.0e-3").notes == ()
    assert "graph z" in everyday("f(x, y) = x").notes[0]
    assert "sqrt(x) is squared away, so both signs" in everyday("z = √x").notes[0] and everyday("√2 x").notes == ()
    assert "multiplied by x + 1" in everyday("z = 1/(x + 1)").notes[0] and everyday("x/2").notes == ()
    assert "2.718" in everyday("ax + dy + ez").notes[0] and everyday("e^2 x").notes == ()
    assert "lam" in everyday("λx").notes[0] and everyday("lam x", ["lam"]).notes == ()


WRONG = {
    # formula: (column, words of the message)
    "0,5x + y": (2, "decimals have a point"),
    "x, y": (2, "one formula"),
    "x + |y|": (5, "square it"),
    "y - sin(x)": (5, "is no polynomial; near 0, x - x^3/6"),
    "abs(x) + y": (1, "abs is no function here"),
    "x^n + y": (3, "a whole number"),
    "2^x": (3, "a number"),
    "y + x^(1/3)": (7, "a whole number"),
    "y + x^0.25": (7, "a whole number"),
    "x ± 1": (3, "before a square root"),
    "x_0 + x_1": (1, "coordinates are x, y and z"),
    "pow(x, 2)": (1, "write x^2"),
    "z + x/2y": (5, "x/2*y or x/(2*y)"),
    "z + x^2/2a": (5, "x^2/2*a or x^2/(2*a)"),
    "z + 3x 2/5 y": (6, "a product or a power"),
    "z + 3x*2/5y": (8, "2/5*y or 2/(5*y)"),
    "z + √x²": (5, "around all that is under the root"),
    "z + √xy": (5, "around all that is under the root"),
    "z + x cos α": (7, "cos(alpha)"),
    "z + (x + y)^2.0": (13, "a whole number"),
    "z + x/ab": (5, "x/a*b or x/(a*b)"),
    "x2 + y2": (1, "x^2 for the power"),
    "y + x 2": (5, "a product or a power"),
    "y + (x + 1)2": (11, "a product or a power"),
    "y + 1.5.2 x": (5, "one point"),
    "x = 1 = y": (7, "one ="),
    "x =": (3, "beside the ="),
    "= x": (1, "beside the ="),
    "(x = 1) y": (4, "in a bracket"),
    "x < 1": (3, "write ="),
    "y + (x": (5, "not closed"),
    "y + x)": (6, "not opened"),
    "y + x * / 2": (9, "nothing before the /"),
    "y + ()": (6, "an empty bracket"),
    "y + x²³^2": (8, "a second exponent"),
    "y + 2½": (6, "mixed numbers"),
    "y + hello": (5, "h*e*l*l*o"),
    "y + X": (5, "write x"),
    "x + у": (5, "cyrillic"),
    "x + é": (5, "letters from a to z"),
    "x + 5 % y": (7, "50 %"),
    r"x + \int y": (5, r"\int"),
    r"x + \frac12": (5, "(a)/(b)"),
    r"x + \sqrt[3]{2}": (5, "2^(1/3)"),
    "x + sin 3": (5, "sin(3)"),
    "x + _1": (5, "belongs to a letter"),
    "f(x,y) = z": (1, "f(x, y, z)"),
    "y = f(x, 2)": (8, "unexpected ','"),
}


@pytest.mark.parametrize("text", WRONG)
def test_formulas_that_are_refused(text):
    column, words = WRONG[text]
    with pytest.raises(PolynomialError) as error:
        everyday(text)
    message = str(error.value)
    assert re.search(r"at column (\d+)", message)[1] == str(column), message
    assert words in message and "\n" not in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it is empty; write for example x^2 + y^2 + z^2 - 1"),
        (" \u200b ", "it is empty; write for example x^2 + y^2 + z^2 - 1"),
        ("5", "it has no x, y or z, so it is no surface; write for example x^2 + y^2 + z^2 - 1"),
        ("0/x", "it has no x, y or z, so it is no surface; write for example x^2 + y^2 + z^2 - 1"),
        ("a = 5", "it has no x, y or z, so it is no surface; write for example x^2 + y^2 + z^2 - 1"),
        ("x +", "it breaks off after +; add what follows or leave it out"),
        ("x" * 20_001, "it is 20001 characters long; at most 20000"),
        ("x" * 20_000, "it is too long: 39999 characters with all signs; at most 20000"),
        ("x^99999999999999", "its degree, as written, is over a million; at most 32"),
        ("(x+y)" * 40, "its degree, as written, is 40; at most 32"),
        ("(1 + " * 300 + "x" + ")" * 300, "it is nested too deeply; at most 100 levels"),
        ("sqrt(x) + sqrt(y)", "it has two square roots, of x and of y; square the formula, so that one is left"),
        ("sqrt(1 + sqrt(x))", "it has a square root in a square root; square the formula, so that one is left"),
        ("z = (x + sqrt(y))^99", "its degree, as written, is 99; at most 32"),
        ("x/(a - 1)", "it divides by a - 1, which is 0; divide by another number (with a = 1)"),
    ],
)
def test_whole_formulas_that_are_refused(text, message):
    with pytest.raises(PolynomialError) as error:
        everyday(text)
    assert str(error.value) == message


def test_names_of_parameters_that_clash():
    for name in ("x", "pi", "sqrt", "1a", "lambda", "ä"):
        with pytest.raises(PolynomialError, match=name):
            everyday("x + y", [name])


def test_values_of_parameters_count():
    assert everyday("x/(a - 1)", {"a": 3.0}).parameters == ("a",)
    with pytest.raises(PolynomialError, match="divides by a - 3"):
        everyday("x/(a - 3)", {"a": 3.0})


# A tree of an expression: a name, a number, or (operation, operands...).
_LEAVES = st.sampled_from(["x", "y", "z", "a", "b", "mu", "pi", "7", "2.5", "12"])
_TREES = st.recursive(
    _LEAVES,
    lambda inner: st.one_of(
        st.tuples(st.sampled_from("+-"), inner, inner),
        st.tuples(st.just("*"), inner, inner, inner),
        st.tuples(st.just("^"), inner, st.integers(2, 3)),
    ),
    max_leaves=8,
)


def strict(tree) -> str:
    """The strict text of a tree, with all brackets."""
    if isinstance(tree, str):
        return tree
    if tree[0] == "^":
        return f"({strict(tree[1])})^{tree[2]}"
    return "(" + tree[0].join(strict(t) for t in tree[1:]) + ")"


def written(tree, draw) -> str:
    """The text of a tree as people may write it."""
    if isinstance(tree, str):
        return draw(st.sampled_from(["π", "pi"])) if tree == "pi" else tree
    if tree[0] == "^":
        base = written(tree[1], draw)
        base = base if isinstance(tree[1], str) else bracketed(base, draw)
        return base + draw(st.sampled_from([f"^{tree[2]}", f"**{tree[2]}", "⁰¹²³"[tree[2]], f"^{{{tree[2]}}}"]))
    parts = [(written(t, draw), t) for t in tree[1:]]
    if tree[0] in "+-":
        left, right = (p for p, _ in parts)
        right = bracketed(right, draw) if isinstance(parts[1][1], tuple) and parts[1][1][0] in "+-" else right
        return left + draw(st.sampled_from([tree[0], f" {tree[0]} ", {"+": "+", "-": "−"}[tree[0]]])) + right
    text = ""
    for part, t in parts:
        part = bracketed(part, draw) if isinstance(t, tuple) and t[0] in "+-" else part
        # A number stands first, or after a sign. A letter that is there already begins a new word.
        words = set(text.split(" ")[-1]) & {"a", "b", "m", "u", "p", "i"} if part[0].isalpha() else set()
        signs = ["*", "·", " × "] + ([] if part[0].isdigit() else [" "] + ([] if words else [""]))
        text += (draw(st.sampled_from(signs)) if text else "") + part
    return text


def bracketed(text: str, draw) -> str:
    """The text in brackets of any kind."""
    return draw(st.sampled_from(["({})", "[{}]", r"\left({}\right)"])).format(text)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_written_and_read(data):
    left, right = data.draw(_TREES), data.draw(st.one_of(st.none(), _TREES))
    text, exact = written(("+", left, "x"), data.draw), f"{strict(left)}+x"
    if right is not None:
        text, exact = f"{text} = {written(right, data.draw)}", f"{exact}-{strict(right)}"
    try:
        read = everyday(text, ["mu"])
    except PolynomialError as error:
        assert "degree" in str(error) or "digits" in str(error), text
        return
    values = {"a": 2.5, "b": -3.0, "mu": 0.75}
    expected = exact_terms(exact, {n: v for n, v in values.items() if n in exact})
    assert exact_terms(read.expression, {n: values[n] for n in read.parameters}) == expected


@settings(max_examples=300, deadline=None)
@given(st.text("xyzabe0123.,+-*/^()= ²³√π|<_\\{}[]sqrtinf½ñ", max_size=30))
def test_any_text_is_read_or_refused_in_one_line(text):
    try:
        read = everyday(text)
    except PolynomialError as error:
        assert "\n" not in str(error) and "; " in str(error)
    else:
        assert set(read.parameters).isdisjoint("xyz") and any(c in read.expression for c in "xyz")


_PLANE = st.sampled_from(["x", "y", "2", "(x - y + 3)", "sqrt(x^2 + 5)", "x^2"])
_GRAPHS = st.recursive(
    _PLANE,
    lambda inner: st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*"), inner),
        st.builds("({}/({}))".format, inner, inner),
        st.builds("({})^{}".format, inner, st.integers(2, 3)),
    ),
    max_leaves=5,
)


@settings(max_examples=100, deadline=None)
@given(_GRAPHS, st.integers(1, 40), st.integers(1, 40))
def test_graphs_with_fractions_and_roots(graph, x, y):
    try:
        text = everyday(f"z = {graph}").expression
    except PolynomialError as error:
        assert re.search("degree|divides by", str(error))
        return
    with localcontext(prec=100):
        point = {"x": Decimal(x) / 7, "y": Decimal(y) / 11, "sqrt": Decimal.sqrt, "D": Decimal}
        try:
            point["z"] = eval(decimals(graph), point)
        except ArithmeticError:
            return  # it divides by 0 there
        value = eval(decimals(text), point)
        sizes = eval(decimals(text).replace("-", "+"), {**point, "z": abs(point["z"])})
        assert abs(value) <= Decimal(10) ** -60 * sizes
        # It is the graph, and not 0 everywhere.
        others = [eval(decimals(text), {**point, "z": point["z"] + k}) for k in range(1, 40)]
        assert max(map(abs, others)) > 0


def decimals(text: str) -> str:
    """A formula as Python evaluates it in decimal numbers of many digits."""
    return re.sub(r"\d+", r"D(\g<0>)", text.replace("^", "**"))


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("x² + y² = 1", "unexpected '²' at column 2; write x^2 + y^2 - 1"),
        ("2ax = y", "unexpected '=' at column 5; write 2*a*x - y"),
        ("2ax", "a sign is missing at column 2; write 2*a*x"),
        # No reading is offered that is wrong, or may surprise.
        ("x =", "unexpected '=' at column 3; write f = g as f - g"),
        ("ax = 1/x", "unexpected '=' at column 4; write f = g as f - g"),
        ("ax = b", "unexpected '=' at column 4; write f = g as f - g"),
        ("a*x < 1", "unexpected '<' at column 5; a surface is f = 0, without a comparison"),
        ("a*x - a*x", "it is 0 everywhere; a surface is where a polynomial that is not 0 everywhere is 0"),
    ],
)
def test_scene_files_are_strict_and_tell_the_reading(expression, message):
    assert Polynomial(expression=expression, parameters={"a": 2.0} if "a" in expression else {}).flaws() == [
        ("expression", message)
    ]


def test_the_page_shows_what_is_read():
    page = (Path(__file__).parents[1] / "docs" / "polynomial-surfaces.md").read_text()
    table = page.split("| you write | it is read as |")[1].split("\n\n")[0]
    rows = [[re.findall(r"`([^`]*)`", cell) for cell in row.split(" | ")] for row in table.splitlines()[2:]]
    in_words = ("ax^2 + by", "ab x", "1/2x", "(sqrt(x^2+y^2) - R)^2 + z^2 = r^2")
    shown = [(left, right) for left, right in rows if left[0] not in in_words]
    assert len(shown) == 8 == len(rows) - len(in_words)
    for left, right in shown:
        assert [*dict.fromkeys(everyday(text).expression for text in left)] == right
