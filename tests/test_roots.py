"""Polynomials along chords against exact rationals: coefficients, bounds of rounding, the first crossing."""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import drjit as dr
import numpy as np
import pytest

from visray import polynomials
from visray.polynomials.catalogue import SURFACES, KnownSurface
from visray.quantities import Arrays
from visray.roots.chord import rounding_count
from visray.roots.isolation import IsolatedRoot, bernstein, conversion, isolate
from visray.roots.number_types import DualNumber, Magnitude, Univariate
from visray.roots.refinement import refine

A = Arrays.of()
D = A.D


class Exact:
    """A polynomial in s with rational coefficients, lowest first."""

    def __init__(self, *c: Any):
        self.c = [Fraction(x) for x in c]

    def __add__(self, other: "Exact") -> "Exact":
        n = max(len(self.c), len(other.c))
        return Exact(*(sum(p.c[i] for p in (self, other) if i < len(p.c)) for i in range(n)))

    def __neg__(self) -> "Exact":
        return Exact(*(-x for x in self.c))

    def __sub__(self, other: "Exact") -> "Exact":
        return self + -other

    def __mul__(self, other: "Exact") -> "Exact":
        found = [Fraction(0)] * (len(self.c) + len(other.c) - 1)
        for i, x in enumerate(self.c):
            for j, y in enumerate(other.c):
                found[i + j] += x * y
        return Exact(*found)

    def on(self, low: Fraction, high: Fraction) -> list[Fraction]:
        """Bernstein coefficients on [low, high], by the polynomial's polar form at low and high."""
        d, w = len(self.c) - 1, high - low
        shifted = [sum(c * math.comb(j, k) * low ** (j - k) for j, c in enumerate(self.c) if j >= k) * w**k
                   for k in range(d + 1)]  # fmt: skip
        return [sum(Fraction(math.comb(i, j), math.comb(d, j)) * shifted[j] for j in range(i + 1))
                for i in range(d + 1)]  # fmt: skip


def chords(rng: np.random.Generator, radius: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Chords l + s e of a ball. Shapes: (3, n)."""
    l, d = rng.normal(size=(2, 3, n))
    l *= radius * rng.uniform(size=n) ** (1 / 3) / np.linalg.norm(l, axis=0)
    d /= np.linalg.norm(d, axis=0)
    l = l - (l * d).sum(0) * d
    return l, np.sqrt(radius**2 - (l * l).sum(0)) * d


def array(x: np.ndarray) -> Any:
    return A.put(D, x)


POWERS = {
    "x^20": KnownSurface("", "x^20 + y^20 + z^20 - 1", 1.75, "", True),
    "ball^10": KnownSurface("", "(x^2 + y^2 + z^2 - 1/2)^10 - 1/1000000", 1.5, "", True),
    "x^32": KnownSurface("", "x^32 + x*y^31 - z^3", 1.2, "", False),
}
ALL = SURFACES | POWERS


@pytest.mark.parametrize("name", ALL)
@pytest.mark.slow
def test_coefficients_are_off_by_less_than_the_noise(name: str) -> None:
    """On parts of random chords, Bernstein's coefficients in double against exact ones of the same chord."""
    classic, rng, n = ALL[name], np.random.default_rng(1), 24
    built = polynomials.build(classic.expression, classic.parameters, classic.centre)
    l, e = chords(rng, classic.radius, n)
    low = np.where(np.arange(n) < 8, -1, rng.uniform(-1, 1, n))
    high = low + (1 - low) * 2.0 ** -np.where(np.arange(n) < 4, 0, rng.integers(0, 8, n))
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    constants = [D(v) for v in built.values]
    for factor in built.program.factors:
        axes = [(array(x), array(y)) for x, y in zip(l, e)]
        line = polynomials.interpret(factor.code, list(map(Univariate, constants)), [Univariate(x, y) for x, y in axes])
        r = array(np.abs(middle) + half)
        reach = [Magnitude(dr.abs(x) + dr.abs(y) * r) for x, y in axes]
        size = polynomials.interpret(factor.code, [Magnitude(dr.abs(x)) for x in constants], reach).x
        noise = rounding_count(factor.code) * 2.0**-53 * np.broadcast_to(np.array(size), n)
        assert len(line.c) == factor.degree + 1
        found = [np.broadcast_to(np.array(b), n) for b in bernstein(line.c, array(middle), array(half))]
        for k in range(n):
            lines = [Exact(x, y) for x, y in zip(l[:, k], e[:, k])]
            exact = polynomials.interpret(factor.code, list(map(Exact, built.values)), lines)
            a, h = Fraction(middle[k]), Fraction(half[k])
            wanted = exact.on(a - h, a + h)
            assert max(abs(Fraction(b[k]) - x) for b, x in zip(found, wanted)) <= noise[k]


@pytest.mark.parametrize("d", range(3, 33))
def test_no_power_grows_in_the_conversion(d: int) -> None:
    """Each power of s lies between -1 and 1, and so do its coefficients; they sum to the power."""
    m = np.array(conversion(d))
    assert np.abs(m).max() == 1
    s = np.linspace(-1, 1, 9)
    basis = np.array([math.comb(d, i) * ((1 + s) / 2) ** i * ((1 - s) / 2) ** (d - i) for i in range(d + 1)])
    assert np.allclose(basis.T @ m, s[:, None] ** np.arange(d + 1), rtol=0, atol=1e-14)


def test_slopes_are_those_of_exact_arithmetic() -> None:
    """Product and chain rule on a form, against differences of exact values that are exact for a cubic in one step."""
    built = polynomials.build("(2*x - 3*y*z)^2*x - 5*(y - 1)^3*z - x*y")
    p = [Fraction(1, 3), Fraction(-2, 7), Fraction(5, 4)]
    factor = built.program.factors[0]
    axes = [DualNumber(float(x), tuple(1.0 if i == j else None for j in range(3))) for i, x in enumerate(p)]
    found = polynomials.interpret(factor.code, [DualNumber(v, (None,) * 3) for v in built.values], axes)

    def f(q: list) -> Fraction:
        return polynomials.interpret(factor.code, [Fraction(v) for v in built.values], q)

    assert found.x == pytest.approx(float(f(p)), rel=1e-14)
    for i in range(3):
        # Of a polynomial of degree 4 the five-point rule gives the exact derivative.
        at = [f([x + (k if j == i else 0) for j, x in enumerate(p)]) for k in (-2, -1, 1, 2)]
        assert found.slopes[i] == pytest.approx(float((at[0] - 8 * at[1] + 8 * at[2] - at[3]) / 12), rel=1e-13)


def plainly(c: tuple, noise: Any) -> Callable:
    """What is asked for where coefficients are blurred, without more care."""
    return lambda middle, half: (bernstein(c, middle, half), noise)


def with_roots(rng: np.random.Generator, d: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (d + 1, n), lowest first, of polynomials whose real roots in [-1, 1] are known; roots (r, n)."""
    count = int(rng.integers(0, d + 1))
    roots = np.sort(rng.uniform(-1, 1, (count, n)), axis=0)
    c = np.zeros((1, n)) + 1
    for root in roots:
        c = np.vstack([np.zeros((1, n)), c]) - root * np.vstack([c, np.zeros((1, n))])
    while len(c) < d + 1:
        if d + 1 - len(c) >= 2:
            a, b = rng.uniform(-1, 1, n), rng.uniform(0.3, 1, n)
            square = [a * a + b * b, -2 * a, 1 + 0 * a]
        else:
            square = [rng.uniform(1.2, 3, n), 1 + np.zeros(n)]
        c = sum(np.vstack([np.zeros((k, n)), q * c, np.zeros((len(square) - 1 - k, n))]) for k, q in enumerate(square))
    return c, roots


@pytest.mark.parametrize("seed", range(24))
def test_the_first_crossing_is_found(seed: int) -> None:
    """Polynomials of degree 3 to 12 with roots that are known: the first of those, to the conditioning of the root."""
    rng = np.random.default_rng(seed)
    d, n = int(rng.integers(3, 13)), 2000
    c, roots = with_roots(rng, d, n)
    sign = np.where(sum(x * (-1.0) ** k for k, x in enumerate(c)) < 0, -1, 1)
    c = c * sign
    line = Univariate(*map(array, c))
    noise = array(8 * 2.0**-53 * np.abs(c).sum(0))
    part = isolate(line.c, lambda r: noise, plainly(line.c, noise), D(-1), D(1), A.B(True))
    s = np.array(refine(line, part, line(part.low), line(part.high), (-1, 1)))
    found = np.array(part.exists)
    if not len(roots):
        assert not found.any() and not np.array(part.unresolved).any()
        return
    # A root is as well known as the noise over the slope there; nearly equal ones are not told apart.
    slope = np.abs(sum(k * c[k] * roots[0] ** (k - 1) for k in range(1, d + 1)))
    gap = np.diff(roots, axis=0, append=2)[0]
    off = np.array(noise) / np.maximum(slope, 1e-300)
    clear = off < 0.02 * np.minimum(gap, roots[0] + 1)
    assert clear.mean() > 0.9
    assert found[clear].all() and not np.array(part.unresolved)[clear].any()
    assert (np.abs(s - roots[0]) <= 4 * off + 2.0**-50)[clear].all()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-6, 1e-9, 1e-12, 1e-300])
def test_a_root_is_no_farther_off_than_the_tolerance(tolerance: float) -> None:
    """2000 parts of any width, the root anywhere in them: never off by more, for the fewer evaluations the looser; at
    an end that the function does not confirm, which is then moved, as well."""
    rng, n = np.random.default_rng(30), 2000
    r, w = rng.uniform(-0.9, 0.9, n), 10 ** rng.uniform(-8, -1, n)
    share = rng.uniform(0, 1, n) ** 3
    # Of every fourth the function's root is a little before the part, of every other fourth a little behind it.
    out = 1e-6 * np.select([np.arange(n) % 4 == 0, np.arange(n) % 4 == 2], [-1, 1], 0) * rng.uniform(0, 1, n)
    share = np.where(out < 0, 0, np.where(out > 0, 1, share))
    low = r - out - share * w
    part = IsolatedRoot(array(low), array(low + w), dr.full(A.B, True, n), dr.zeros(A.U, n))
    calls = dr.zeros(A.U, 1)

    def f(s: Any) -> Any:
        gap = array(r) - s
        dr.scatter_add(calls, A.U(1), A.U(0), gap == gap)
        return gap * (1 + 3 * gap * gap)

    high = -array(np.full(n, 0.1))
    s = np.array(refine(f, part, -high, high, (-1, 1), None, dr.opaque(D, tolerance)))
    loose = np.array(calls)[0]
    assert np.abs(s - r).max() <= max(tolerance, 2.0**-52)
    dr.eval(calls)
    calls = dr.zeros(A.U, 1)
    exact = np.array(refine(f, part, -high, high, (-1, 1)))
    assert np.abs(exact - r).max() <= 2.0**-52
    assert loose <= np.array(calls)[0] * (0.5 if tolerance >= 1e-2 else 1.2)


@pytest.mark.parametrize("m", [1, 3, 5])
def test_a_crossing_of_odd_multiplicity_is_found_once(m: int) -> None:
    """(r - s)^m (s^2 + 1), with roots all over the chord: found, to the m-th root of the noise."""
    r = np.linspace(-0.99, 0.99, 1001)
    c = np.zeros((1, len(r))) + 1
    for _ in range(m):
        c = r * np.vstack([c, 0 * r]) - np.vstack([0 * r, c])
    c = np.vstack([c, 0 * r, 0 * r]) + np.vstack([0 * r, 0 * r, c])
    noise = array(8 * 2.0**-53 * np.abs(c).sum(0))
    part = isolate(tuple(map(array, c)), lambda r: noise, plainly(tuple(map(array, c)), noise), D(-1), D(1), A.B(True))

    def structured(s: Any) -> Any:
        gap = array(r) - s
        return gap**m * (s * s + 1)

    assert np.array(part.exists).all() and not np.array(part.unresolved).any()
    found = refine(structured, part, structured(part.low), structured(part.high), (-1, 1))
    assert np.abs(np.array(found) - r).max() <= 2.0**-52


@pytest.mark.parametrize("crosses", [False, True])
def test_the_rounding_error_of_a_known_root_costs_no_steps(crosses: bool) -> None:
    """(s + 1) q(s) with a rounding error of either sign: the search starts at the root -1. It takes as many steps as
    without the error, asks for no accurate coefficients, and finds the root of q, or none."""
    r = np.linspace(-0.9, 0.9, 501)
    q = np.array([r, -1 + 0 * r, 0 * r] if crosses else [r * r + 0.3, -2 * r, 1 + 0 * r])
    c = np.vstack([q, 0 * r]) + np.vstack([0 * r, q])
    noise = array(8 * 2.0**-53 * np.abs(c).sum(0))
    steps = []
    for error in (-4, 0, 4):
        shifted = tuple(map(array, [c[0] + error * 2.0**-53 * np.abs(c).sum(0), *c[1:]]))
        calls = dr.zeros(A.U, 1)

        def bound(r: Any, calls: Any = calls) -> Any:
            dr.scatter_add(calls, A.U(1), A.U(0), r == r)
            return noise

        def accurate_bernstein(*_: Any) -> tuple:
            return [-D(1)] * 4, noise

        part = isolate(shifted, bound, accurate_bernstein, D(-1), D(1), A.B(True), A.B(True))
        low, high = np.array(part.low), np.array(part.high)
        assert not np.array(part.unresolved).any() and (np.array(part.exists) == crosses).all()
        assert not crosses or ((low <= r) & (r <= high)).all()
        steps.append(int(np.array(calls)[0]))
    assert steps[0] == steps[1] == steps[2] < 8 * len(r)


def test_touching_is_no_crossing() -> None:
    """(s - r)^2 touches zero: left behind, and counted, as rounding could make two crossings of it."""
    r = np.linspace(-0.9, 0.9, 501)
    c = tuple(map(array, (r * r, -2 * r, 1 + 0 * r, 0 * r)))
    noise = array(8 * 2.0**-53 * (1 + np.abs(r)) ** 2)
    part = isolate(c, lambda _: noise, plainly(c, noise), D(-1), D(1), A.B(True))
    assert not np.array(part.exists).any()
    assert np.isin(np.array(part.unresolved), [0, 1]).all() and np.array(part.unresolved).mean() > 0.5
