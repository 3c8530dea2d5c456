"""The first sign change of f along rays, in NumPy. Each result says whether it is certain in spite of rounding.

f is the polynomial of a surface, the clip is the sphere that bounds the surface, and the chord is the part of a ray
inside the clip.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from math import comb, inf
from typing import Any

import numpy as np

from visray.study.stability.exact.double_double import DoubleDouble
from visray.study.stability.exact.surface import RayBundle, Surface, certain_value

UNIT_ROUNDOFF = 2.0**-53
NOISE = 4 * UNIT_ROUNDOFF


@dataclass(frozen=True)
class ChordPolynomial:
    """f along the chord of each ray, as a polynomial in s. Shapes: (N), or (k, N).

    The distance is t = middle + half s, where s runs from -1 to 1. All numbers are double or longdouble.

    outside: whether the ray misses the clip
    doubtful: whether rounding decides if the ray misses the clip
    middle, half: distance of the chord's middle, and half the length of the chord (world units)
    start: the s at which the ray starts; -1 if the ray starts before the chord
    coefficients: coefficients of s^k, (k, N)
    tau: noise of double precision in f, see truth.py
    bernstein: Bernstein coefficients of f on the interval from s = start to 1, (k, N)
    rounding: bound of the rounding errors of `bernstein`, and of what `restricted` computes from it
    """

    outside: np.ndarray
    doubtful: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    start: np.ndarray
    coefficients: np.ndarray
    tau: np.ndarray
    bernstein: np.ndarray
    rounding: np.ndarray

    def select(self, lanes: Any) -> "ChordPolynomial":
        """The polynomials of chosen rays. lanes: indices or mask of the rays."""
        return ChordPolynomial(**{k: v[..., lanes] for k, v in vars(self).items()})

    @staticmethod
    def of(surface: Surface, rays: RayBundle, real: type = float) -> "ChordPolynomial":
        """The polynomials of rays. real: type of the numbers, float or np.longdouble."""
        from_centre = rays.o - np.array(surface.centre)
        squared = (rays.d**2).sum(1)
        middle = -(from_centre * rays.d).sum(1) / squared
        nearest = from_centre + middle[:, None] * rays.d
        free = surface.radius**2 - (nearest**2).sum(1)
        size = (from_centre**2).sum(1) + surface.radius**2 + (np.abs(surface.centre) ** 2).sum()
        rounding = 64 * UNIT_ROUNDOFF * size
        half = np.sqrt(np.maximum(free, rounding) / squared)
        outside, doubtful = (free < -rounding) | (middle + half < -1e-12 * half), np.abs(free) <= rounding
        doubtful |= ~outside & (np.abs(middle + half) < 1e-12 * half)
        start = np.clip(-middle / half, -1, 1)
        p = [
            c + DoubleDouble(np.stack([0 * half, half]), 0.0, 10**9) * DoubleDouble(rays.d[:, i], 0.0, 10**9)
            for i, c in enumerate(rays.points(middle, limit=10**9))
        ]
        f = surface.double_double(p)
        c = np.zeros((surface.degree + 1, len(rays)), real)
        c[: len(f.hi)] = f.hi[: len(c)].astype(real) + f.lo[: len(c)]
        total = np.abs(c).sum(0)
        tau = NOISE * total if rays.noise is None else np.maximum(NOISE * total, rays.noise)
        b = restricted(conversion(surface.degree, real) @ c, (start.astype(real) + 1) / 2, np.ones(len(rays), real))
        unit = np.finfo(real).eps / 2
        return ChordPolynomial(
            outside, doubtful & ~outside, middle, half, start, c, tau, b, (8 + 10 * surface.degree) * unit * total
        )


def conversion(d: int, real: type = float) -> np.ndarray:
    """The matrix that turns coefficients of s^k into Bernstein coefficients on the interval of s from -1 to 1.

    d: degree of the polynomials
    Shapes: (d + 1, d + 1).
    """
    rows = [[Fraction(0)] * (d + 1) for _ in range(d + 1)]
    for k in range(d + 1):
        # s^k with s = 2 u - 1 is expanded in powers of u; and u^j = sum_i C(i, j) / C(d, j) B_i, where the B_i are the
        # Bernstein polynomials.
        expanded = [comb(k, j) * 2**j * (-1) ** (k - j) for j in range(k + 1)]
        for i in range(d + 1):
            rows[i][k] = sum((Fraction(e * comb(i, j), comb(d, j)) for j, e in enumerate(expanded)), Fraction(0))
    return np.array([[real(float(q)) + real(float(q - Fraction(float(q)))) for q in row] for row in rows])


def restricted(b: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Bernstein coefficients on the interval from low to high, by de Casteljau's algorithm.

    b: Bernstein coefficients on the interval from 0 to 1, (d + 1, N)
    low, high: ends of the new interval, (N)
    """
    b, d = b.copy(), len(b) - 1
    for k in range(1, d + 1):
        b[: d - k + 1] = (1 - low) * b[: d - k + 1] + low * b[1 : d - k + 2]
    v = np.clip((high - low) / np.where(low < 1, 1 - low, 1), 0, 1)
    for k in range(1, d + 1):
        b[k:] = (1 - v) * b[k - 1 : -1] + v * b[k:]
    return b


def isolate_first_root(
    chord: ChordPolynomial, margin: np.ndarray, side: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The first root of f along each ray, isolated by the signs of Bernstein coefficients.

    The search walks once along the ray. V is the number of sign changes of the Bernstein coefficients on an interval.
    If V = 0, f has no root in the interval; this stays true if f is shifted by `margin` minus the rounding error. If
    V = 1, f has exactly one root there. Otherwise the interval is halved. At a width of 2^-30 the search gives up.

    margin: the sign of a coefficient is certain if the coefficient is larger than the margin or less than -margin, (N)
    side: the sign of f at the start, for rays that start on the surface, (N). The search for a root begins only after f
        exceeds the margin with this sign. None: rays that start anywhere.

    Returns (exists, low, high, certain), (N) each: whether there is a root; the ends of an interval that contains the
    root, in u, which is 0 at the start of the ray in the clip and 1 at the end; and whether the result is certain.
    """
    n = len(chord.half)
    a, w = np.zeros(n), np.ones(n)
    emerged = np.ones(n, bool) if side is None else np.zeros(n, bool)
    sign = np.sign(chord.bernstein[0]) if side is None else side.astype(float)
    exists, certain = np.zeros(n, bool), chord.outside.copy()
    active = ~chord.outside & ~chord.doubtful
    for _ in range(150):
        live = np.flatnonzero(active)
        if not len(live):
            break
        b = restricted(chord.bernstein[:, live], a[live], np.minimum(a[live] + w[live], 1))
        signed = b * sign[live] * np.where(np.abs(b) > margin[live], 1, 0)
        same, opposite = signed > 0, signed < 0
        same[0] |= ~emerged[live]
        same_at_start = np.cumprod(same, 0).sum(0)
        opposite_at_end = np.cumprod(opposite[::-1], 0).sum(0)
        no_root = same_at_start == len(b)
        one_root = (same_at_start > 0) & (opposite_at_end > 0) & emerged[live]
        one_root &= same_at_start + opposite_at_end >= len(b) - 1
        exists[live[one_root]] = certain[live[one_root]] = True
        active[live[one_root]] = False
        step, narrow = live[no_root], live[~no_root & ~one_root]
        emerged[step] = True
        a[step] += w[step]
        finished = step[a[step] >= 1]
        certain[finished], active[finished] = True, False
        w[step] = np.minimum(2 * w[step], 1 - a[step])
        w[narrow] /= 2
        active[narrow[w[narrow] < 2.0**-30]] = False
    return exists, a, np.minimum(a + w, 1), certain


def bisect(chord: ChordPolynomial, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The s between low and high at which f changes its sign, and the sign of f before that. Shapes: (N)."""

    def f(s: np.ndarray) -> np.ndarray:
        return np.polynomial.polynomial.polyval(s, chord.coefficients, tensor=False)

    before = np.sign(f(low))
    for _ in range(45):
        s = 0.5 * (low + high)
        ahead = np.sign(f(s)) == before
        low, high = np.where(ahead, s, low), np.where(ahead, high, s)
    return 0.5 * (low + high), before.astype(float)


def first_root_shifted(chord: ChordPolynomial, shift: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The first root of f + shift: (t, low, high, certain), (N) each.

    t: distance, not exact; inf without a root. The other results are those of isolate_first_root.
    """
    c = chord.coefficients.copy()
    c[0] += shift
    chord = replace(chord, coefficients=c, bernstein=chord.bernstein + shift)
    exists, low, high, certain = isolate_first_root(chord, chord.rounding)
    s, _ = bisect(chord, *(chord.start + u * (1 - chord.start) for u in (low, high)))
    certain &= ~exists | ((s < 1 - 1e-12) & (s > chord.start))
    return np.where(exists, chord.middle + chord.half * s, inf).astype(float), low, high, certain


def refine(
    surface: Surface, rays: RayBundle, chord: ChordPolynomial, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The root of f between low and high on each ray, by Newton steps in double-double.

    low, high: in u, as isolate_first_root returns them, (N)

    Returns (t, t_low, confirmed, before), (N) each: the distance is t + t_low; whether a sign change of f around t
    confirms the root; and the sign of f before the root.
    """
    s0, s1 = (chord.start + u * (1 - chord.start) for u in (low, high))
    s, before = bisect(chord, s0, s1)
    t = DoubleDouble(chord.middle) + DoubleDouble(chord.half) * DoubleDouble(s.astype(float))
    for _ in range(3):
        f = surface.double_double(rays.points(t.hi[0], t.lo[0], slope=True, limit=2))
        slope = np.broadcast_to(f.hi[1] if len(f.hi) > 1 else 0.0, t.hi[0].shape)
        with np.errstate(all="ignore"):
            step = np.where(slope != 0, f.hi[0] / np.where(slope != 0, slope, 1), 0)
        t = t + DoubleDouble(np.where(np.isfinite(step), -step, 0))
    width = 2.0**-57 * np.abs(t.hi[0])
    ends = [t + DoubleDouble(sign * width) for sign in (-1, 1)]
    values = [certain_value(surface, rays, e) for e in ends]
    confirmed = (values[0] * values[1] < 0) & (values[0] * before > 0)
    s = (t.hi[0] - chord.middle) / chord.half
    confirmed &= (s >= s0 - 1e-13) & (s <= s1 + 1e-13) & (s < 1 - 1e-12) & (t.hi[0] > 0)
    return t.hi[0], t.lo[0], confirmed, before
