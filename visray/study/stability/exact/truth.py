"""What is true of rays and a polynomial surface: first hits, by exact arithmetic.

Rays are doubles, hence rationals, and f is taken as written, with roots of numbers to 2^-140. The polynomial of a ray
is then exact, and python-flint certifies its real roots. That takes a millisecond. So most rays are settled first in
NumPy, where that is certain: the first change of sign is isolated by Bernstein coefficients clear of a margin that is
more than their rounding and `tau`, and confirmed in double-double. Truth does not depend on what a kernel does.

A ray's answer counts only where it is defined to the noise of double. `near`: it changes when f is shifted by tau =
4 2^-53 sum |c_k|, with c_k the coefficients of the ray polynomial on the chord of the clip, s from -1 to 1; or it lies
on the clip to within rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from visray.study.stability.exact.certified import JUMP, Exact
from visray.study.stability.exact.isolation import Chord, confirmed, isolated, shifted
from visray.study.stability.exact.known_surface import Bundle, Surface, certain_value
from visray.study.stability.exact.twofold import Twofold


@dataclass
class Truth:
    """First hits: t + low, inf where nothing is hit. near: not defined to the noise of double. exact: settled by
    python-flint; open: by nothing, as there were too many. side: the sign of f in front of the hit. checked, wrong: how
    many that NumPy settled were asked again, and of them differed. Shapes: (N)."""

    t: np.ndarray
    low: np.ndarray
    near: np.ndarray
    exact: np.ndarray
    open: np.ndarray
    side: np.ndarray
    checked: int = 0
    wrong: int = 0

    @property
    def good(self) -> np.ndarray:
        """Rays whose answer counts."""
        return ~self.near & ~self.open

    @property
    def hit(self) -> np.ndarray:
        return np.isfinite(self.t)

    @staticmethod
    def joined(a: "Truth", b: "Truth") -> "Truth":
        """That of both."""
        arrays = [np.concatenate([getattr(a, k), getattr(b, k)]) for k in ("t", "low", "near", "exact", "open", "side")]
        return Truth(*arrays, a.checked + b.checked, a.wrong + b.wrong)


def settled(
    surface: Surface, rays: Bundle, sample: int, most: int, seed: int = 0, starts: Callable | None = None
) -> Truth:
    """The first hits of rays. `sample` of those that NumPy settles are asked again of python-flint, and no more than
    `most` of the rest; starts(i): the exact origin of ray i, for rays that leave the surface."""
    n, chord = len(rays), Chord.of(surface, rays)
    found, low, high, certain = isolated(chord, chord.tau + chord.rounding, rays.side)
    truth = Truth(np.full(n, inf), np.zeros(n), *(np.zeros(n, bool) for _ in range(3)), np.zeros(n))
    doubtful = np.flatnonzero(~certain & ~chord.doubtful)
    if len(doubtful) and rays.side is None:
        # With more digits: f, and f shifted by tau either way.
        fine = Chord.of(surface, rays.part(doubtful), np.longdouble)
        answers = [shifted(fine, by * fine.tau) for by in (0, 1, -1)]
        t, *bracket, _ = answers[0]
        sure, there = np.logical_and.reduce([a[3] for a in answers]), np.isfinite(t)
        s = np.where(there, (t - fine.middle) / fine.half, 0)
        slope = np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(fine.coefficients), tensor=False)
        with np.errstate(invalid="ignore", divide="ignore"):
            # The same root, if it moves as the slope says; where two are about to meet, by up to twice as much.
            reach = 1.3 * fine.half * fine.tau / np.abs(slope)
            moves = [np.where(there | np.isfinite(a[0]), np.abs(a[0] - t), 0) for a in answers[1:]]
            near = np.logical_or.reduce([~(m <= np.where(there, JUMP * t, 0)) for m in moves])
            sure &= near | np.logical_and.reduce([~there | (m <= reach) for m in moves])
        truth.near[doubtful] = sure & near
        found[doubtful], certain[doubtful] = np.isfinite(t), sure
        low[doubtful], high[doubtful] = bracket
    hits = found & certain & ~truth.near
    if hits.any():
        t, rest, ok, before = confirmed(surface, rays.part(hits), chord.part(hits), low[hits], high[hits])
        truth.t[hits], truth.low[hits], truth.side[hits] = t, rest, before
        certain[np.flatnonzero(hits)[~ok]] = False
    rng, exact = np.random.default_rng([seed, 7]), Exact(surface)
    again = rng.permutation(np.flatnonzero(certain))[:sample]
    doubtful = rng.permutation(np.flatnonzero(~certain))
    truth.open[doubtful[most:]] = True
    sides = np.full(n, None) if rays.side is None else rays.side
    for i in np.concatenate([again, doubtful[:most]]):
        o = [float(x) for x in rays.o[i]] if starts is None else starts(i)
        t, rest, near, _ = exact.first(o, rays.d[i], float(chord.tau[i]), sides[i])
        if certain[i]:
            truth.checked += 1
            off = 0.0 if t == truth.t[i] else abs(t - truth.t[i] + rest - truth.low[i])
            truth.wrong += int(near != truth.near[i] or not (near or off <= 2.0**-54 * t))
        else:
            truth.t[i], truth.low[i], truth.near[i], truth.exact[i] = t, rest, near, True
    fresh = truth.exact & np.isfinite(truth.t) & ~truth.near
    truth.side[fresh] = _sign_before(surface, rays.part(fresh), truth.t[fresh], truth.low[fresh])
    return truth


def _sign_before(surface: Surface, rays: Bundle, t: np.ndarray, low: np.ndarray) -> np.ndarray:
    """The sign of f just in front of hits, 0 where double-double does not tell."""
    if not len(t):
        return np.zeros(0)
    return np.sign(certain_value(surface, rays, Twofold(t, low) + Twofold(-(2.0**-40) * np.abs(t))))
