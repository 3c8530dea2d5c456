"""The exact first hits of rays with a polynomial surface.

f is the polynomial of the surface, and the clip is the sphere that bounds the surface. The numbers of a ray are
doubles, so they are rational. f is taken as written, with square roots of numbers to within 2^-140. So the polynomial
along a ray is exact, and python-flint certifies its real roots (certified_roots.py). That takes a millisecond a ray.
Therefore NumPy settles all rays for which its result is certain: the first sign change is isolated by Bernstein
coefficients that are larger than their rounding error plus tau (root_isolation.py), and is confirmed in double-double.
Code of visray's kernels is not used.

Double precision does not define the hits of all rays: a small change of f may change the hit. Such a ray is "near an
edge", and is not judged. The small change is tau = 4 * 2^-53 * sum |c_k|. The c_k are the coefficients of f along the
chord (the part of the ray inside the clip) as a polynomial in s, which runs from -1 to 1 on the chord. A ray is near an
edge if a shift of f by tau or -tau changes its hit, or if its hit lies on the clip to within rounding.
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

    t, low: the distance is t + low; inf without a hit
    near_edge: whether the hit is not defined in double precision (see the top of the module)
    by_flint: whether python-flint settled the ray
    unsettled: whether the ray was not settled at all, because too many rays needed python-flint
    side: the sign of f just before the hit, 0 if unknown
    checked: number of rays that NumPy settled and python-flint repeated
    contradicted: number of these rays for which NumPy and python-flint differ
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
        """Whether the ray's hit is known, and is defined in double precision."""
        return ~self.near_edge & ~self.unsettled

    @property
    def hit(self) -> np.ndarray:
        return np.isfinite(self.t)

    @staticmethod
    def joined(a: "Truth", b: "Truth") -> "Truth":
        """The hits of both sets of rays, those of a first."""
        fields = ("t", "low", "near_edge", "by_flint", "unsettled", "side")
        arrays = [np.concatenate([getattr(a, k), getattr(b, k)]) for k in fields]
        return Truth(*arrays, a.checked + b.checked, a.contradicted + b.contradicted)


def first_hits(
    surface: Surface, rays: RayBundle, sample: int, most: int, seed: int = 0, starts: Callable | None = None
) -> Truth:
    """The exact first hits of rays. NumPy or python-flint settles a ray, that is, finds the exact hit (see the module).

    sample: number of the rays settled by NumPy that python-flint repeats as a check
    most: largest number of other rays that python-flint settles
    seed: seed of the random choice of rays for python-flint
    starts: function from the number of a ray to its exact origin, for rays that start on the surface; None: all rays
        start at rays.o
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
    """First roots in long double, computed for f, f + tau and f - tau.

    Returns (t, bracket, near_edge, settled): the distances, inf without a root; a pair (low, high) as
    isolate_first_root returns it; whether the ray is near an edge; and whether these results are certain.
    """
    chord = ChordPolynomial.of(surface, rays, np.longdouble)
    roots = [first_root_shifted(chord, k * chord.tau) for k in (0, 1, -1)]
    t, *bracket, _ = roots[0]
    settled, hit = np.logical_and.reduce([r[3] for r in roots]), np.isfinite(t)
    s = np.where(hit, (t - chord.middle) / chord.half, 0)
    derivative = np.polynomial.polynomial.polyder(chord.coefficients)
    slope = np.polynomial.polynomial.polyval(s, derivative, tensor=False)
    with np.errstate(invalid="ignore", divide="ignore"):
        # A root that moves by about tau / slope is still the same root. If two roots almost meet, the root moves up to
        # twice as far; such rays are left to python-flint.
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
    """Settles uncertain rays by python-flint, and checks a sample of the certain ones. Writes the results to `truth`.

    tau: noise of double precision in f, (N)
    certain: mask of the rays that NumPy settled, (N)
    sample, most, seed, starts: see `first_hits`
    """
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
    """The sign of f just before the hits at t + low; 0 in lanes where it is uncertain in double-double. Shapes: (N)."""
    if not len(t):
        return np.zeros(0)
    return np.sign(certain_value(surface, rays, DoubleDouble(t, low) + DoubleDouble(-(2.0**-40) * np.abs(t))))
