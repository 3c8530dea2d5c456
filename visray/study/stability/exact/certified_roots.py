"""Exact first hits, one ray at a time: python-flint certifies the real roots of the ray's polynomial."""

from fractions import Fraction
from math import inf
from typing import Any

import numpy as np

from visray.study.stability.exact.expressions import flint, rational, value
from visray.study.stability.exact.root_isolation import UNIT_ROUNDOFF
from visray.study.stability.exact.surface import Surface

# If a shift of f by tau moves a root by more than JUMP * t, the moved root counts as another root. tau: see truth.py.
JUMP = 1e-3


class CertifiedSolver:
    """Exact intersections of single rays with a surface, by python-flint."""

    def __init__(self, surface: Surface):
        self.surface, self.flint = surface, flint()

    def polynomial(self, o: list[Any], d: np.ndarray) -> Any:
        """f along the ray o + t d: an exact polynomial in t. o: three exact numbers (floats or Fractions)."""
        p = [self.flint.fmpq_poly([rational(a), rational(float(b))]) for a, b in zip(o, d)]
        f = value(self.surface.tree, *p, rational)
        return f if isinstance(f, self.flint.fmpq_poly) else self.flint.fmpq_poly([f])

    def roots(self, p: Any) -> list[Any]:
        """The distinct real roots t > 0 of a polynomial, in ascending order, computed with 90 bits."""
        if p.degree() < 1:
            return []
        with self.flint.ctx.workprec(90):
            real_roots = [r.real for r, _ in p.numer().complex_roots() if r.imag == 0]
        return sorted((r for r in real_roots if r > 0), key=float)

    def clipped(self, o: list[Any], d: np.ndarray, roots: list[Any]) -> list[tuple[Any, bool]]:
        """The roots that lie inside the clip sphere or on it: a list of pairs (root, on_clip).

        on_clip: whether the point lies on the clip sphere to within the rounding of double precision
        """
        arb, s, inside = self.flint.arb, self.surface, []
        spread = max(abs(float(a)) for a in o) + s.radius + max(map(abs, s.centre))
        rounding = 64 * UNIT_ROUNDOFF * s.radius * spread
        with self.flint.ctx.workprec(192):
            for t in roots:
                p = [arb(rational(a)) + t * arb(rational(float(b))) - arb(c) for a, b, c in zip(o, d, s.centre)]
                level = float(sum(x * x for x in p) - arb(s.radius) ** 2)
                if level < rounding:
                    inside.append((t, level > -rounding))
        return inside

    def first_hit(
        self, o: list[Any], d: np.ndarray, tau: float, side: float | None
    ) -> tuple[float, float, bool, list[float]]:
        """The first hit of one ray.

        tau: the noise of double precision in f, see truth.py
        side: the sign of f on the side of the surface to which the ray starts, for a ray that starts on the surface;
            None: the ray starts anywhere

        Returns (t, low, near_edge, roots):
        t, low: the distance is t + low; inf without a hit
        near_edge: whether a shift of f by tau changes the hit
        roots: all roots in the clip
        """
        p = self.polynomial(o, d)
        if p.is_zero():
            return inf, 0.0, True, []
        if side is not None:
            # The ray starts on the surface to within 2^-190. So the constant term is only rounding, and is set to 0.
            p = self.flint.fmpq_poly([0, *p.coeffs()[1:]])
        hits = [self.clipped(o, d, self.roots(q)) for q in (p, *(p + rational(s * tau) for s in (1.0, -1.0)))]
        if side is not None:
            ahead, behind = (hits[1], hits[2]) if side > 0 else (hits[2], hits[1])
            hits[1:] = [ahead, behind[1:]]
        near_edge = any(on_clip for h in hits for _, on_clip in h[:1])
        if side is not None:
            # With the other shift the ray starts on the other side of the surface. It must cross the surface before
            # its first hit.
            near_edge |= not behind or (bool(hits[0]) and not bool(behind[0][0] < hits[0][0][0]))
        roots = [[r for r, _ in h] for h in hits]
        t = float(roots[0][0]) if roots[0] else inf
        low = float(roots[0][0] - self.flint.arb(t)) if roots[0] else 0.0
        return t, low, near_edge or self.first_root_moves(*roots), [float(r) for r in roots[0]]

    @staticmethod
    def first_root_moves(roots: list, *shifted: list) -> bool:
        """Whether the first root of f is another root when f is shifted by tau or by -tau.

        That is the case if no root is left, or if the first root moves by more than JUMP * t, or if two roots appear
        before it, or if it vanishes together with the next root.

        roots: roots of f in ascending order; shifted: two such lists, for f + tau and for f - tau
        """
        if not (roots and all(shifted)):
            return bool(roots or any(shifted))
        t = roots[0]
        if any(abs(float(s[0] - t)) > JUMP * float(t) for s in shifted):
            return True
        sooner, later = sorted(shifted, key=lambda s: float(s[0] - t))
        return any(t < r and r <= later[0] for r in roots[1:]) or sum(bool(r < t) for r in sooner) > 1

    def hit_point(self, o: np.ndarray, d: np.ndarray, t: float, low: float) -> list[Fraction]:
        """The hit point at the simple root near t + low, computed by Newton steps: three Fractions.

        Error: at most 2^-190.
        """
        p = self.polynomial([float(x) for x in o], d)
        slope, root = p.derivative(), rational(float(t)) + rational(float(low))
        for bits in (220, 440):
            root -= p(root) / slope(root)
            root = self.flint.fmpq(round(Fraction(int(root.p), int(root.q)) * 2**bits), 2**bits)
        distance = Fraction(int(root.p), int(root.q))
        return [Fraction(float(a)) + distance * Fraction(float(b)) for a, b in zip(o, d)]
