"""A ray at a time, in exact arithmetic: its real roots, certified by python-flint."""

from fractions import Fraction
from math import inf
from typing import Any

import numpy as np

from visray.study.stability.exact.formulas import flint, rational, value
from visray.study.stability.exact.isolation import U
from visray.study.stability.exact.known_surface import Surface

JUMP = 1e-3  # of t: an answer that a shift by tau moves by more is another one


class Exact:
    """A surface's answers by python-flint, a ray at a time."""

    def __init__(self, surface: Surface):
        self.surface, self.flint = surface, flint()

    def polynomial(self, o: list[Any], d: np.ndarray) -> Any:
        """f along o + t d, exactly."""
        p = [self.flint.fmpq_poly([rational(a), rational(float(b))]) for a, b in zip(o, d)]
        f = value(self.surface.tree, *p, rational)
        return f if isinstance(f, self.flint.fmpq_poly) else self.flint.fmpq_poly([f])

    def roots(self, p: Any) -> list[Any]:
        """The real roots with t > 0 in order, each once, to 90 bits."""
        if p.degree() < 1:
            return []
        with self.flint.ctx.workprec(90):
            found = [r.real for r, _ in p.numer().complex_roots() if r.imag == 0]
        return sorted((r for r in found if r > 0), key=float)

    def clipped(self, o: list[Any], d: np.ndarray, roots: list[Any]) -> list[tuple[Any, bool]]:
        """The roots in the clip or on its surface to within rounding, and whether they are on it."""
        arb, s, kept = self.flint.arb, self.surface, []
        spread = max(abs(float(a)) for a in o) + s.radius + max(map(abs, s.centre))
        doubt = 64 * U * s.radius * spread
        with self.flint.ctx.workprec(192):
            for t in roots:
                away = [arb(rational(a)) + t * arb(rational(float(b))) - arb(c) for a, b, c in zip(o, d, s.centre)]
                level = float(sum(x * x for x in away) - arb(s.radius) ** 2)
                if level < doubt:
                    kept.append((t, level > -doubt))
        return kept

    def first(self, o: list[Any], d: np.ndarray, tau: float, side: float | None) -> tuple[float, float, bool, list]:
        """(t, low, near, roots) of one ray; roots: all in the clip, as doubles."""
        p = self.polynomial(o, d)
        if p.is_zero():
            return inf, 0.0, True, []
        if side is not None:
            p = self.flint.fmpq_poly([0, *p.coeffs()[1:]])  # the start is on the surface: what is left is 2^-190
        answers = [self.clipped(o, d, self.roots(q)) for q in (p, *(p + rational(s * tau) for s in (1.0, -1.0)))]
        if side is not None:
            ahead, behind = (answers[1], answers[2]) if side > 0 else (answers[2], answers[1])
            answers[1:] = [ahead, behind[1:]]
        near = any(on for a in answers for _, on in a[:1])
        if side is not None:  # a surface that is pushed back by tau must first be left
            near |= not behind or (bool(answers[0]) and not bool(behind[0][0] < answers[0][0][0]))
        kept = [[r for r, _ in a] for a in answers]
        t = float(kept[0][0]) if kept[0] else inf
        low = float(kept[0][0] - self.flint.arb(t)) if kept[0] else 0.0
        return t, low, near or self.moved(*kept), [float(r) for r in kept[0]]

    @staticmethod
    def moved(roots: list, *shifted: list) -> bool:
        """Whether f shifted by tau, either way, has its first root elsewhere: none, by more than 1e-3 of t, or not as
        the continuation of that of f, as two others come or go before it."""
        if not (roots and all(shifted)):
            return bool(roots or any(shifted))
        t = roots[0]
        if any(abs(float(s[0] - t)) > JUMP * float(t) for s in shifted):
            return True
        sooner, later = sorted(shifted, key=lambda s: float(s[0] - t))
        return any(t < r and r <= later[0] for r in roots[1:]) or sum(bool(r < t) for r in sooner) > 1

    def point(self, o: np.ndarray, d: np.ndarray, t: float, low: float) -> list[Fraction]:
        """The point of a simple root near t + low, moved to within 2^-190 of it by Newton's steps."""
        p = self.polynomial([float(x) for x in o], d)
        slope, at = p.derivative(), rational(float(t)) + rational(float(low))
        for bits in (220, 440):
            at -= p(at) / slope(at)
            at = self.flint.fmpq(round(Fraction(int(at.p), int(at.q)) * 2**bits), 2**bits)
        whole = Fraction(int(at.p), int(at.q))
        return [Fraction(float(a)) + whole * Fraction(float(b)) for a, b in zip(o, d)]
