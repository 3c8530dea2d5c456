"""The exact first hits of rays with a polynomial surface.

Rays are doubles, hence rationals, and f is taken as written, with square roots of numbers to 2^-140. So the polynomial
along a ray is exact, and python-flint certifies its real roots (certified_roots.py). That takes a millisecond a ray. So
most rays are settled in NumPy where it is certain: the first sign change is isolated by Bernstein coefficients that
exceed their rounding and tau (root_isolation.py), and is confirmed in double-double. visray's kernels take no part.

A ray is judged only where its hit is defined to the noise of double precision. It is near an edge if the hit changes
when f is shifted by tau = 4 2^-53 sum |c_k|, with c_k the coefficients of the polynomial on the chord of the clip, s
from -1 to 1; or if the hit lies on the clip to within rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from visray.study.stability.exact.certified_roots import JUMP, CertifiedSolver
from visray.study.stability.exact.double_double import DoubleDouble
from visray.study.stability.exact.root_isolation import (
    ChordPolynomial,
    first_root_shifted,
    isolate_first_root,
    refine,
)
from visray.study.stability.exact.surface import RayBundle, Surface, certain_value


@dataclass
class Truth:
    """The exact first hits of rays. Shapes: (N).

    t, low: the distance is t + low, inf for none
    near_edge: whether the hit is undefined to the noise of double precision
    by_flint: whether python-flint settled the ray
    unsettled: whether nothing did, because too many rays needed python-flint
    side: the sign of f just before the hit, 0 if unknown
    checked: how many rays that NumPy settled were repeated by python-flint
    contradicted: how many of these came out differently
    """

    t: np.ndarray
    low: np.ndarray
    near_edge: np.ndarray
    by_flint: np.ndarray
    unsettled: np.ndarray
    side: np.ndarray
    checked: int = 0
    contradicted: int = 0

    @property
    def judged(self) -> np.ndarray:
        """Whether the ray's hit is known, and defined to the noise of double precision."""
        return ~self.near_edge & ~self.unsettled

    @property
    def hit(self) -> np.ndarray:
        return np.isfinite(self.t)

    @staticmethod
    def joined(a: "Truth", b: "Truth") -> "Truth":
        """The hits of both sets of rays."""
        fields = ("t", "low", "near_edge", "by_flint", "unsettled", "side")
        arrays = [np.concatenate([getattr(a, k), getattr(b, k)]) for k in fields]
        return Truth(*arrays, a.checked + b.checked, a.contradicted + b.contradicted)


def first_hits(
    surface: Surface, rays: RayBundle, sample: int, most: int, seed: int = 0, starts: Callable | None = None
) -> Truth:
    """The exact first hits of rays.

    sample: number of rays that python-flint repeats as a check, of those that NumPy settles
    most: largest number of other rays that python-flint settles
    starts: starts(i) is the exact origin of ray i, for rays that leave the surface
    """
    n, chord = len(rays), ChordPolynomial.of(surface, rays)
    exists, low, high, certain = isolate_first_root(chord, chord.tau + chord.rounding, rays.side)
    truth = Truth(np.full(n, inf), np.zeros(n), *(np.zeros(n, bool) for _ in range(3)), np.zeros(n))
    doubtful = np.flatnonzero(~certain & ~chord.doubtful)
    if len(doubtful) and rays.side is None:
        t, bracket, near_edge, settled = _with_more_digits(surface, rays.select(doubtful))
        truth.near_edge[doubtful] = settled & near_edge
        exists[doubtful], certain[doubtful] = np.isfinite(t), settled
        low[doubtful], high[doubtful] = bracket
    hits = exists & certain & ~truth.near_edge
    if hits.any():
        refined = refine(surface, rays.select(hits), chord.select(hits), low[hits], high[hits])
        truth.t[hits], truth.low[hits], confirmed, truth.side[hits] = refined
        certain[np.flatnonzero(hits)[~confirmed]] = False
    _settle_by_flint(surface, rays, chord.tau, truth, certain, sample, most, seed, starts)
    new = truth.by_flint & np.isfinite(truth.t) & ~truth.near_edge
    truth.side[new] = _sign_before(surface, rays.select(new), truth.t[new], truth.low[new])
    return truth


def _with_more_digits(
    surface: Surface, rays: RayBundle
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray]:
    """First roots in long double: (t, bracket, near_edge, settled), from f and from f shifted by tau either way."""
    chord = ChordPolynomial.of(surface, rays, np.longdouble)
    roots = [first_root_shifted(chord, k * chord.tau) for k in (0, 1, -1)]
    t, *bracket, _ = roots[0]
    settled, hit = np.logical_and.reduce([r[3] for r in roots]), np.isfinite(t)
    s = np.where(hit, (t - chord.middle) / chord.half, 0)
    derivative = np.polynomial.polynomial.polyder(chord.coefficients)
    slope = np.polynomial.polynomial.polyval(s, derivative, tensor=False)
    with np.errstate(invalid="ignore", divide="ignore"):
        # A root that moves as the slope says is still the same root. Where two roots are about to meet, the root moves
        # up to twice as far; such rays stay for python-flint.
        expected = 1.3 * chord.half * chord.tau / np.abs(slope)
        moves = [np.where(hit | np.isfinite(r[0]), np.abs(r[0] - t), 0) for r in roots[1:]]
        near_edge = np.logical_or.reduce([~(m <= np.where(hit, JUMP * t, 0)) for m in moves])
        settled &= near_edge | np.logical_and.reduce([~hit | (m <= expected) for m in moves])
    return t, (bracket[0], bracket[1]), near_edge, settled


def _settle_by_flint(
    surface: Surface,
    rays: RayBundle,
    tau: np.ndarray,
    truth: Truth,
    certain: np.ndarray,
    sample: int,
    most: int,
    seed: int,
    starts: Callable | None,
) -> None:
    """Settles rays by python-flint, at most `most`, and repeats a sample of those that are certain. Fills `truth`."""
    rng, solver = np.random.default_rng([seed, 7]), CertifiedSolver(surface)
    repeated = rng.permutation(np.flatnonzero(certain))[:sample]
    doubtful = rng.permutation(np.flatnonzero(~certain))
    truth.unsettled[doubtful[most:]] = True
    sides = np.full(len(rays), None) if rays.side is None else rays.side
    for i in np.concatenate([repeated, doubtful[:most]]):
        o = [float(x) for x in rays.o[i]] if starts is None else starts(i)
        t, low, near_edge, _ = solver.first_hit(o, rays.d[i], float(tau[i]), sides[i])
        if certain[i]:
            truth.checked += 1
            difference = 0.0 if t == truth.t[i] else abs(t - truth.t[i] + low - truth.low[i])
            same = near_edge == truth.near_edge[i] and (near_edge or difference <= 2.0**-54 * t)
            truth.contradicted += int(not same)
        else:
            truth.t[i], truth.low[i], truth.near_edge[i], truth.by_flint[i] = t, low, near_edge, True


def _sign_before(surface: Surface, rays: RayBundle, t: np.ndarray, low: np.ndarray) -> np.ndarray:
    """The sign of f just before hits, 0 where double-double leaves it uncertain. Shapes: (N)."""
    if not len(t):
        return np.zeros(0)
    return np.sign(certain_value(surface, rays, DoubleDouble(t, low) + DoubleDouble(-(2.0**-40) * np.abs(t))))
