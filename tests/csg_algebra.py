"""Operands of CSG that are polynomials, in 80-bit floats: the torus, and a polynomial in its clip."""

from functools import cache, cached_property
from typing import Any

import numpy as np
import sympy
from csg_leaves import Algebraic
from csg_sets import IN, OUT, UNKNOWN
from samples import Real, dot, norm, real, unit

from visray.geometry import gamma
from visray.primitives import Box, Polynomial, Sphere
from visray.primitives.clips import Ball

# Roundings of the value of a polynomial in a kernel. Its terms are bounded by those of all points of the clip.
ROUNDINGS = 64


def product(*factors: np.ndarray) -> np.ndarray:
    """The product of polynomials in s, coefficients lowest first. Shapes: (n, N)."""
    total = factors[0]
    for f in factors[1:]:
        longer = np.zeros((len(total) + len(f) - 1, *np.broadcast_shapes(total.shape[1:], f.shape[1:])), Real)
        for i, c in enumerate(f):
            longer[i : i + len(total)] += c * total
        total = longer
    return total


def added(*terms: np.ndarray) -> np.ndarray:
    total = np.zeros((max(map(len, terms)), *np.broadcast_shapes(*(t.shape[1:] for t in terms))), Real)
    for term in terms:
        total[: len(term)] += term
    return total


class Tube(Algebraic):
    """A torus: (|w|^2 + R^2 - r^2)^2 < 4 R^2 |w x n|^2, where w is the way from its centre and n its unit axis."""

    def ball(self) -> tuple[np.ndarray, float]:
        return np.array(self.thing.center), float(self.thing.major) + float(self.thing.minor)

    def along(self, o: np.ndarray, d: np.ndarray, sign: int, slack: np.ndarray) -> np.ndarray:
        n, major, minor = unit(self.thing.axis), real(self.thing.major), np.maximum(self.thing.minor + sign * slack, 0)
        squared = np.stack([dot(o, o), 2 * dot(o, d), dot(d, d)])
        x, y = np.cross(o, n), np.cross(d, n)
        aside = np.stack([dot(x, x), 2 * dot(x, y), dot(y, y)])
        even = added(squared, (major**2 - minor**2)[None])
        return added(product(even, even), -4 * major**2 * aside)


@cache
def terms(source: str, parameters: tuple, centre: tuple) -> dict[tuple[int, int, int], sympy.Rational]:
    """The coefficients of a polynomial about a centre. Numbers are exact, but those of roots have 40 digits."""
    x, y, z = sympy.symbols("x y z")
    names = {"x": x, "y": y, "z": z, "phi": sympy.GoldenRatio}
    names |= {name: sympy.Rational(value) for name, value in parameters}
    f = sympy.sympify(source.replace("^", "**"), names, rational=True)
    moved = f.subs({v: v + sympy.Rational(float(c)) for v, c in zip((x, y, z), centre)}, simultaneous=True)
    return {k: c.evalf(40) for k, c in sympy.Poly(sympy.expand(moved), x, y, z).as_dict().items()}


class Level(Algebraic):
    """All points of a ball where a polynomial is less than 0. Its clip is an operand of its own."""

    @cached_property
    def terms(self) -> dict[tuple[int, int, int], Any]:
        found = terms(self.thing.expression, tuple(self.thing.parameters.items()), tuple(self.ball()[0].tolist()))
        return {k: Real(str(c)) for k, c in found.items()}

    def hull(self) -> tuple[np.ndarray, float]:
        return self.ball()

    def ball(self) -> tuple[np.ndarray, float]:
        clip = self.thing.clip
        if isinstance(clip, Ball):
            return np.array(clip.center), clip.radius
        low, high = np.array(clip.min), np.array(clip.max)
        return (low + high) / 2, float(np.linalg.norm(high - low) / 2)

    def noise(self, slack: np.ndarray) -> np.ndarray:
        """By how much rounding changes the value: its own, and that of a ray that passes `slack` from the true one."""
        reach = real(self.ball()[1])

        def size(r: Any) -> Any:
            return sum(np.abs(c) * r ** sum(k) for k, c in self.terms.items())

        return gamma(ROUNDINGS) * size(reach) + size(reach + slack) - size(reach)

    def along(self, o: np.ndarray, d: np.ndarray, sign: int, slack: np.ndarray) -> np.ndarray:
        powers = []
        for x, y in zip(o.T, d.T):
            powers.append([np.ones((1, len(o)), Real)])
            for _ in range(max(max(k) for k in self.terms)):
                powers[-1].append(product(powers[-1][-1], np.stack([x, y])))
        parts = [c * product(*(p[i] for p, i in zip(powers, k))) for k, c in self.terms.items()]
        return added(*parts, -sign * self.noise(slack)[None])

    def surface(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        f, g = self.value(p), np.zeros_like(p)
        w = (p - real(self.ball()[0])).T
        for k, c in self.terms.items():
            for i in range(3):
                lower = [e - (i == j) for j, e in enumerate(k)]
                if lower[i] >= 0:
                    g[:, i] += c * k[i] * np.prod([x**e for x, e in zip(w, lower)], 0)
        slope = norm(g)
        safe = np.where(slope == 0, 1, slope)
        return f / safe, g / safe[:, None]

    def value(self, p: np.ndarray) -> np.ndarray:
        w = (p - real(self.ball()[0])).T
        return sum(c * np.prod([x**e for x, e in zip(w, k)], 0) for k, c in self.terms.items())

    def crease(self, p: np.ndarray) -> np.ndarray:
        return np.full(len(p), np.inf)

    def state(self, p: np.ndarray) -> np.ndarray:
        local = self.local_point(p)
        f, noise = self.value(local), self.noise(self.slack(local, np.zeros_like(local), 0.0))
        return np.where(f < -noise, IN, np.where(f > noise, OUT, UNKNOWN))


def clip_of(s: Polynomial) -> Sphere | Box:
    """The clip of a polynomial as a solid."""
    clip = s.clip
    return Sphere(center=clip.center, radius=clip.radius) if isinstance(clip, Ball) else Box(min=clip.min, max=clip.max)
