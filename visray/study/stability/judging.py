"""The answers of a solver against the truth, as figures."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import sqrt
from typing import Any

import numpy as np

from visray.study.stability.exact.certified import JUMP, Exact
from visray.study.stability.exact.isolation import Chord
from visray.study.stability.exact.known_surface import Bundle, Surface
from visray.study.stability.exact.truth import Truth
from visray.study.stability.ray_sets import PARTS, Named

# Rays of which python-flint is asked whether they took another crossing, and how far wrong answers are from an edge.
MOST_ASKED, MOST_SHIFTED = 3000, 60
# The share of rays leaving a surface all around that may be shadowed by it, or not, against the truth.
MOST_LEFT = 60e-6
# What a root may be off, in units of what rounding makes of it, and 99.9 % of the normals in degrees.
LOOSE, TURNED = 64, 0.01


@dataclass(frozen=True)
class Row:
    """What was found for a surface and a set of rays.

    judged: rays whose answer counts. near_edge: those whose answer is not defined to the noise of double; open: not
    settled, as there were too many such. exact: settled by python-flint; checked: settled in NumPy, and asked again;
    truth_wrong: of those, how many differed, which is a fault of the study.

    false_misses, false_hits: hit or missed against the truth; of secondary rays they are leaks and false self-shadows.
    wrong_roots: off by more than 1e-3 of t, or nearer to another crossing. loose: off by more than LOOSE times what a
    shift of f by tau, and the rounding of places in the clip, make of t. errors_within: such errors are right if f is
    shifted by so many tau, looked for in steps of 2 for the first MOST_SHIFTED; gross: of how many of these not even a
    shift by 2^20 tau makes that. any_hit_differs: what is hit first, and whether anything is between, do not agree.
    ulps: |dt| in units of the last place of t; degrees: between normals.
    seconds: of a ray, on one thread. None: not asked, or not known.
    """

    surface: str
    degree: int
    rays: str
    judged: int = 0
    near_edge: int = 0
    open: int = 0
    exact: int = 0
    checked: int = 0
    truth_wrong: int = 0
    hits: int = 0
    false_misses: int = 0
    false_hits: int = 0
    wrong_roots: int = 0
    loose: int = 0
    nan: int = 0
    errors_within: int = 0
    gross: int = 0
    any_hit_differs: int | None = None
    unresolved: int | None = None
    ulps: tuple[float, float, float] | None = None
    degrees: tuple[float, float] | None = None
    seconds: float | None = None

    @property
    def secondary(self) -> bool:
        return self.rays in PARTS

    @property
    def errors(self) -> int:
        return self.false_misses + self.false_hits + self.wrong_roots + self.nan + (self.any_hit_differs or 0)

    @property
    def passed(self) -> bool:
        """Whether all is right that double can tell: every answer from eyes and from inside, with its distance and its
        normal, and none unresolved but near edges; of rays that leave the surface at most MOST_LEFT hidden or lit
        wrongly, and none at small angles; elsewhere no error but by rounding."""
        faults = self.truth_wrong, self.nan, self.gross, self.any_hit_differs
        if any(faults) or not self.judged:
            return False
        if self.secondary:
            most = 0 if self.rays == PARTS[1] else MOST_LEFT * self.judged
            return self.false_misses + self.false_hits <= most
        if self.rays not in ("camera", "inside"):
            return True
        turned = self.degrees is not None and self.degrees[0] > TURNED
        unresolved = (self.unresolved or 0) > self.near_edge + self.open
        return not (self.errors or self.loose or unresolved or turned)

    def per_million(self, count: int) -> tuple[float, float, float]:
        """A count per million rays, and its 95 % interval: the rule of three for none, else Wilson's."""
        n = self.judged
        if not n:
            return 0.0, 0.0, 1e6
        if not count:
            return 0.0, 0.0, min(3e6 / n, 1e6)
        z, share = 1.96, count / n
        middle, scale = share + z * z / (2 * n), 1 + z * z / n
        spread = z * sqrt(share * (1 - share) / n + z * z / (4 * n * n))
        return 1e6 * share, 1e6 * max(middle - spread, 0) / scale, 1e6 * (middle + spread) / scale

    def as_json(self) -> dict[str, Any]:
        counts = ("false_misses", "false_hits", "wrong_roots")
        rates = {f"{k}_per_million": self.per_million(getattr(self, k)) for k in counts}
        if self.secondary:
            names = {"false_misses": "leaks", "false_hits": "false_self_shadows"}
            rates |= {f"{new}_per_million": rates[f"{old}_per_million"] for old, new in names.items()}
        return asdict(self) | rates


def judged(
    named: Named, rays: Bundle, truth: Truth, t: np.ndarray, n: np.ndarray | None, starts: Callable | None = None
) -> dict[str, Any]:
    """The figures of distances, and normals where they are given, against the truth."""
    good, nan = truth.good, np.isnan(t)
    mine, hit = np.isfinite(t), truth.hit
    both = good & hit & mine
    dt = np.where(both, np.abs((t - np.where(hit, truth.t, 0)) - truth.low), 0)
    wrong = both & (dt > JUMP * truth.t)
    for i in np.flatnonzero(both & ~wrong & (dt > 1e-9 * truth.t))[:MOST_ASKED]:
        wrong[i] = rays.side is None and another_root(named.surface, rays.o[i], rays.d[i], t[i], truth.t[i])
    found = {
        "judged": int(good.sum()), "near_edge": int((truth.near & ~truth.open).sum()), "open": int(truth.open.sum()),
        "exact": int(truth.exact.sum()), "checked": truth.checked, "truth_wrong": truth.wrong, "hits": int(both.sum()),
        "false_misses": int((good & hit & ~mine & ~nan).sum()), "false_hits": int((good & ~hit & mine).sum()),
        "wrong_roots": int(wrong.sum()), "nan": int((good & nan).sum()),
    }  # fmt: skip
    errors = np.flatnonzero((good & (hit != mine) & ~nan) | wrong)
    if len(errors):
        shifts = [shift_of(named.surface, rays, i, starts) for i in errors[:MOST_SHIFTED]]
        found |= {"gross": shifts.count(0), "errors_within": max(shifts)}
    right = np.flatnonzero(both & ~wrong)
    if rays.side is not None or not len(right):
        return found
    off = dt[right] / np.spacing(truth.t[right])
    part = rays.part(right)
    slope = np.abs((named.surface.gradient(part.at(truth.t[right], truth.low[right])) * part.d).sum(1))
    places = 2.0**-52 * (np.abs(part.o).max(1) + truth.t[right] + 2 * named.surface.radius)
    with np.errstate(divide="ignore"):
        bound = LOOSE * (Chord.of(named.surface, part).tau / slope + places)
    found["loose"] = int((dt[right] > bound).sum())
    found["ulps"] = (float(np.median(off)), float(np.quantile(off, 0.999)), float(off.max()))
    if n is not None:
        found |= turned(named.surface, rays.part(right), truth.t[right], truth.low[right], n[right])
    return found


def shift_of(surface: Surface, rays: Bundle, i: int, starts: Callable | None) -> int:
    """The least power of 2, times tau, by which f must be shifted for another answer; 0: more than 2^20."""
    one = rays.part([i])
    o, tau = starts(i) if starts else [float(x) for x in rays.o[i]], float(Chord.of(surface, one).tau[0])
    exact, side = Exact(surface), None if rays.side is None else rays.side[i]

    def near(k: int) -> bool:
        return exact.first(o, rays.d[i], 2.0**k * tau, side)[2]

    return next(2**k for k in range(1, 21) if k == 20 or near(k)) if near(20) else 0


def another_root(surface: Surface, o: np.ndarray, d: np.ndarray, t: float, first: float) -> bool:
    """Whether t is nearer to another crossing of the ray than to its first."""
    roots = Exact(surface).first([float(x) for x in o], d, 0.0, None)[3]
    return any(abs(r - t) < abs(first - t) for r in roots[1:])


def turned(surface: Surface, rays: Bundle, t: np.ndarray, low: np.ndarray, n: np.ndarray) -> dict[str, Any]:
    """The angles between normals and the true ones at the true points, where there are any."""
    g = surface.gradient(rays.at(t, low))
    length = np.linalg.norm(g, axis=1)
    nan = int(np.isnan(n).any(1).sum())
    ok = (length > 0) & ~np.isnan(n).any(1)
    if not ok.any():
        return {"nan": nan}
    true = g[ok] / length[ok, None]
    cosine, sine = (true * n[ok]).sum(1), np.linalg.norm(np.cross(true, n[ok]), axis=1)
    angle = np.degrees(np.arctan2(sine, np.abs(cosine) if surface.radical else cosine))
    return {"nan": nan, "degrees": (float(np.quantile(angle, 0.999)), float(angle.max()))}
