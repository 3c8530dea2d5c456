"""The first change of sign of f along rays, where NumPy is certain of it."""

from dataclasses import dataclass, replace
from fractions import Fraction
from math import comb, inf
from typing import Any

import numpy as np

from visray.study.stability.exact.known_surface import Bundle, Surface, certain_value
from visray.study.stability.exact.twofold import Twofold

U = 2.0**-53
NOISE = 4 * U


@dataclass(frozen=True)
class Chord:
    """The rays' ways through the clip: t = middle + half s, s from -1 to 1, from s = start on; the coefficients of f in
    s; tau; the Bernstein coefficients of f from start to 1, and a bound of their rounding, also that of `restricted`.
    In double or in what NumPy has beyond. Shapes: (N), (k, N)."""

    outside: np.ndarray
    doubtful: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    start: np.ndarray
    coefficients: np.ndarray
    tau: np.ndarray
    bernstein: np.ndarray
    rounding: np.ndarray

    def part(self, keep: Any) -> "Chord":
        """Those of some of the rays."""
        return Chord(**{k: v[..., keep] for k, v in vars(self).items()})

    @staticmethod
    def of(surface: Surface, rays: Bundle, real: type = float) -> "Chord":
        away = rays.o - np.array(surface.centre)
        squared = (rays.d**2).sum(1)
        middle = -(away * rays.d).sum(1) / squared
        nearest = away + middle[:, None] * rays.d
        free = surface.radius**2 - (nearest**2).sum(1)
        rounding = 64 * U * ((away**2).sum(1) + surface.radius**2 + (np.abs(surface.centre) ** 2).sum())
        half = np.sqrt(np.maximum(free, rounding) / squared)
        outside, doubtful = (free < -rounding) | (middle + half < -1e-12 * half), np.abs(free) <= rounding
        doubtful |= ~outside & (np.abs(middle + half) < 1e-12 * half)
        start = np.clip(-middle / half, -1, 1)
        p = [c + Twofold(np.stack([0 * half, half]), 0.0, 10**9) * Twofold(rays.d[:, i], 0.0, 10**9)
             for i, c in enumerate(rays.at(middle, limit=10**9))]  # fmt: skip
        f = surface.twofold(p)
        c = np.zeros((surface.degree + 1, len(rays)), real)
        c[: len(f.hi)] = f.hi[: len(c)].astype(real) + f.lo[: len(c)]
        total = np.abs(c).sum(0)
        tau = NOISE * total if rays.noise is None else np.maximum(NOISE * total, rays.noise)
        b = restricted(conversion(surface.degree, real) @ c, (start.astype(real) + 1) / 2, np.ones(len(rays), real))
        unit = np.finfo(real).eps / 2
        return Chord(
            outside, doubtful & ~outside, middle, half, start, c, tau, b, (8 + 10 * surface.degree) * unit * total
        )


def conversion(d: int, real: type = float) -> np.ndarray:
    """The matrix from coefficients of s^k, s from -1 to 1, to Bernstein coefficients. Shapes: (d + 1, d + 1)."""
    rows = [[Fraction(0)] * (d + 1) for _ in range(d + 1)]
    for k in range(d + 1):
        # s = 2 u - 1, expanded in u, then u^j = sum_i C(i, j) / C(d, j) B_i
        expanded = [comb(k, j) * 2**j * (-1) ** (k - j) for j in range(k + 1)]
        for i in range(d + 1):
            rows[i][k] = sum((Fraction(e * comb(i, j), comb(d, j)) for j, e in enumerate(expanded)), Fraction(0))
    return np.array([[real(float(q)) + real(float(q - Fraction(float(q)))) for q in row] for row in rows])


def restricted(b: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Bernstein coefficients on a part of the interval, by de Casteljau. Shapes: b (d + 1, N); low, high (N)."""
    b, d = b.copy(), len(b) - 1
    for k in range(1, d + 1):
        b[: d - k + 1] = (1 - low) * b[: d - k + 1] + low * b[1 : d - k + 2]
    v = np.clip((high - low) / np.where(low < 1, 1 - low, 1), 0, 1)
    for k in range(1, d + 1):
        b[k:] = (1 - v) * b[k - 1 : -1] + v * b[k:]
    return b


def isolated(
    chord: Chord, margin: np.ndarray, side: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The first root of each ray: (found, low, high, certain), in u from 0 at the start to 1 at the end of the chord.

    One walk from left to right. Where V = 0, f has no root in an interval, even if shifted by what the margin has above
    rounding; where V = 1 it has one. Elsewhere the interval is halved, and given up at 2^-30. Rays that leave the
    surface have a sign from the start: f must first come clear of the margin.
    """
    n = len(chord.half)
    a, w = np.zeros(n), np.ones(n)
    emerged = np.ones(n, bool) if side is None else np.zeros(n, bool)
    sign = np.sign(chord.bernstein[0]) if side is None else side.astype(float)
    found, certain = np.zeros(n, bool), chord.outside.copy()
    left = ~chord.outside & ~chord.doubtful
    for _ in range(150):
        live = np.flatnonzero(left)
        if not len(live):
            break
        b = restricted(chord.bernstein[:, live], a[live], np.minimum(a[live] + w[live], 1))
        turned = b * sign[live] * np.where(np.abs(b) > margin[live], 1, 0)
        same, other = turned > 0, turned < 0
        same[0] |= ~emerged[live]
        run = np.cumprod(same, 0).sum(0)
        end = np.cumprod(other[::-1], 0).sum(0)
        none = run == len(b)
        one = (run > 0) & (end > 0) & (run + end >= len(b) - 1) & emerged[live]
        found[live[one]] = certain[live[one]] = True
        left[live[one]] = False
        step, narrow = live[none], live[~none & ~one]
        emerged[step] = True
        a[step] += w[step]
        done = step[a[step] >= 1]
        certain[done], left[done] = True, False
        w[step] = np.minimum(2 * w[step], 1 - a[step])
        w[narrow] /= 2
        left[narrow[w[narrow] < 2.0**-30]] = False
    return found, a, np.minimum(a + w, 1), certain


def bisected(chord: Chord, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where f changes its sign between two s, and its sign before."""
    horner = lambda s: np.polynomial.polynomial.polyval(s, chord.coefficients, tensor=False)  # noqa: E731
    before = np.sign(horner(low))
    for _ in range(45):
        s = 0.5 * (low + high)
        ahead = np.sign(horner(s)) == before
        low, high = np.where(ahead, s, low), np.where(ahead, high, s)
    return 0.5 * (low + high), before.astype(float)


def shifted(chord: Chord, by: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(t, low, high, certain): the first root of f + by, inf where there is none, roughly, and its bracket."""
    c = chord.coefficients.copy()
    c[0] += by
    chord = replace(chord, coefficients=c, bernstein=chord.bernstein + by)
    found, low, high, certain = isolated(chord, chord.rounding)
    s, _ = bisected(chord, *(chord.start + u * (1 - chord.start) for u in (low, high)))
    certain &= ~found | ((s < 1 - 1e-12) & (s > chord.start))
    return np.where(found, chord.middle + chord.half * s, inf).astype(float), low, high, certain


def confirmed(surface: Surface, rays: Bundle, chord: Chord, low: np.ndarray, high: np.ndarray) -> tuple:
    """The roots in brackets (in u) as t + low in double-double, and which of them a change of sign confirms."""
    s0, s1 = (chord.start + u * (1 - chord.start) for u in (low, high))
    s, before = bisected(chord, s0, s1)
    t = Twofold(chord.middle) + Twofold(chord.half) * Twofold(s.astype(float))
    for _ in range(3):
        f = surface.twofold(rays.at(t.hi[0], t.lo[0], slope=True, limit=2))
        slope = np.broadcast_to(f.hi[1] if len(f.hi) > 1 else 0.0, t.hi[0].shape)
        with np.errstate(all="ignore"):
            step = np.where(slope != 0, f.hi[0] / np.where(slope != 0, slope, 1), 0)
        t = t + Twofold(np.where(np.isfinite(step), -step, 0))
    width = 2.0**-57 * np.abs(t.hi[0])
    ends = [t + Twofold(sign * width) for sign in (-1, 1)]
    values = [certain_value(surface, rays, e) for e in ends]
    ok = (values[0] * values[1] < 0) & (values[0] * before > 0)
    s = (t.hi[0] - chord.middle) / chord.half
    ok &= (s >= s0 - 1e-13) & (s <= s1 + 1e-13) & (s < 1 - 1e-12) & (t.hi[0] > 0)
    return t.hi[0], t.lo[0], ok, before
