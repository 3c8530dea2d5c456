"""Scores of a solver: the solver's hits are compared with the exact hits.

exact/truth.py explains tau and rays near an edge. A shift of f explains an error of the solver if the shift changes the
exact hit of the ray.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import sqrt
from typing import Any

import numpy as np

from visray.study.stability.exact.certified_roots import JUMP, CertifiedSolver
from visray.study.stability.exact.root_isolation import ChordPolynomial
from visray.study.stability.exact.surface import RayBundle, Surface
from visray.study.stability.exact.truth import Truth
from visray.study.stability.ray_sets import SECONDARY_SETS, NamedSurface

# Largest numbers of rays that python-flint examines. MOST_EXAMINED: whether the solver took another root. MOST_SHIFTED:
# which shift of f explains an error.
MOST_EXAMINED, MOST_SHIFTED = 3000, 60
# Largest fraction of the secondary rays over the hemisphere that may be wrongly occluded or wrongly unoccluded.
MOST_WRONG_SECONDARY = 60e-6
# LOOSE: largest error of a root, in units of the error that rounding causes. MOST_DEGREES: largest error of 99.9 % of
# the normals (degrees).
LOOSE, MOST_DEGREES = 64, 0.01


@dataclass(frozen=True)
class Score:
    """The score of a solver for one surface and one set of rays.

    surface, degree, rays: name and degree of the surface, and name of the set of rays

    Counts of rays:
    judged: rays whose exact hit is known, and is defined in double precision
    near_edge: rays whose hit is not defined in double precision
    open: rays that were not settled, because too many needed python-flint
    exact: rays that python-flint settled
    checked: rays that NumPy settled and python-flint repeated
    truth_wrong: checked rays for which NumPy and python-flint differ; more than 0 is an error of the study
    hits: judged rays that hit, both by the solver and exactly
    false_misses: judged rays that hit, but not by the solver; for secondary rays these are light leaks
    false_hits: judged rays that hit by the solver only; for secondary rays these are false self-shadows
    wrong_roots: hits with an error of more than 1e-3 t, or nearer to another root of the ray than to the first root
    loose: hits with an error of more than LOOSE times the error that rounding causes (a shift of f by tau, and rounded
        coordinates)
    nan: results that are not a number
    gross: of the first MOST_SHIFTED errors, those that no shift of f by up to 2^20 tau explains
    any_hit_differs: rays whose first hit and occlusion contradict each other; None: not tested
    unresolved: rays for which the solver reports that rounding hides the result; None: the solver makes no reports

    Other figures:
    errors_within: least power of 2, times tau, by which a shift of f explains all errors that are not gross; only the
        first MOST_SHIFTED errors are tested
    ulps: median, 99.9 % quantile and maximum of the error of t, in units of the last place of t
    degrees: 99.9 % quantile and maximum of the angle between the solver's and the true normal (degrees)
    seconds: time of one ray, on one thread; None: not measured
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
        return self.rays in SECONDARY_SETS

    @property
    def errors(self) -> int:
        return self.false_misses + self.false_hits + self.wrong_roots + self.nan + (self.any_hit_differs or 0)

    @property
    def passed(self) -> bool:
        """Whether the solver is as right as double precision allows.

        All sets: there is no NaN, no contradiction, and no error that rounding does not explain.
        camera and inside: every hit, distance and normal is right, and no more rays are unresolved than not judged.
        secondary, hemisphere: at most the fraction MOST_WRONG_SECONDARY of the rays is wrongly occluded or unoccluded.
        secondary, grazing (the skimming rays): no ray is wrongly occluded or unoccluded.
        """
        faults = self.truth_wrong, self.nan, self.gross, self.any_hit_differs
        if any(faults) or not self.judged:
            return False
        if self.secondary:
            most = 0 if self.rays == SECONDARY_SETS[1] else MOST_WRONG_SECONDARY * self.judged
            return self.false_misses + self.false_hits <= most
        if self.rays not in ("camera", "inside"):
            return True
        wrong_normals = self.degrees is not None and self.degrees[0] > MOST_DEGREES
        unresolved = (self.unresolved or 0) > self.near_edge + self.open
        return not (self.errors or self.loose or unresolved or wrong_normals)

    def per_million(self, count: int) -> tuple[float, float, float]:
        """A count per million judged rays: (rate, low, high), with a 95 % interval from low to high.

        The interval follows the rule of three if the count is 0, otherwise it is Wilson's.
        """
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
        """The score as a dict for json.dumps, with rates per million rays."""
        counts = ("false_misses", "false_hits", "wrong_roots")
        rates = {f"{k}_per_million": self.per_million(getattr(self, k)) for k in counts}
        if self.secondary:
            names = {"false_misses": "leaks", "false_hits": "false_self_shadows"}
            rates |= {f"{new}_per_million": rates[f"{old}_per_million"] for old, new in names.items()}
        return asdict(self) | rates


def score(
    named: NamedSurface,
    rays: RayBundle,
    truth: Truth,
    t: np.ndarray,
    n: np.ndarray | None,
    starts: Callable | None = None,
) -> dict[str, Any]:
    """The fields of Score for the results of a solver, as a dict.

    truth: the exact hits of the rays
    t: the solver's distances, inf without a hit, (N)
    n: the solver's normals, (N, 3); None: no normals
    starts: see truth.first_hits
    """
    judged, nan = truth.judged, np.isnan(t)
    solver_hit, true_hit = np.isfinite(t), truth.hit
    both_hit = judged & true_hit & solver_hit
    dt = np.where(both_hit, np.abs((t - np.where(true_hit, truth.t, 0)) - truth.low), 0)
    wrong_root = both_hit & (dt > JUMP * truth.t)
    for i in np.flatnonzero(both_hit & ~wrong_root & (dt > 1e-9 * truth.t))[:MOST_EXAMINED]:
        wrong_root[i] = rays.side is None and is_another_root(named.surface, rays.o[i], rays.d[i], t[i], truth.t[i])
    figures = {
        "judged": int(judged.sum()),
        "near_edge": int((truth.near_edge & ~truth.unsettled).sum()),
        "open": int(truth.unsettled.sum()),
        "exact": int(truth.by_flint.sum()),
        "checked": truth.checked,
        "truth_wrong": truth.contradicted,
        "hits": int(both_hit.sum()),
        "false_misses": int((judged & true_hit & ~solver_hit & ~nan).sum()),
        "false_hits": int((judged & ~true_hit & solver_hit).sum()),
        "wrong_roots": int(wrong_root.sum()),
        "nan": int((judged & nan).sum()),
    }
    errors = np.flatnonzero((judged & (true_hit != solver_hit) & ~nan) | wrong_root)
    if len(errors):
        shifts = [explaining_shift(named.surface, rays, i, starts) for i in errors[:MOST_SHIFTED]]
        figures |= {"gross": shifts.count(0), "errors_within": max(shifts)}
    right = np.flatnonzero(both_hit & ~wrong_root)
    if rays.side is not None or not len(right):
        return figures
    ulps = dt[right] / np.spacing(truth.t[right])
    right_rays = rays.select(right)
    points = right_rays.points(truth.t[right], truth.low[right])
    slope = np.abs((named.surface.gradient(points) * right_rays.d).sum(1))
    coordinates = 2.0**-52 * (np.abs(right_rays.o).max(1) + truth.t[right] + 2 * named.surface.radius)
    with np.errstate(divide="ignore"):
        bound = LOOSE * (ChordPolynomial.of(named.surface, right_rays).tau / slope + coordinates)
    figures["loose"] = int((dt[right] > bound).sum())
    figures["ulps"] = (float(np.median(ulps)), float(np.quantile(ulps, 0.999)), float(ulps.max()))
    if n is not None:
        figures |= normal_errors(named.surface, right_rays, truth.t[right], truth.low[right], n[right])
    return figures


def explaining_shift(surface: Surface, rays: RayBundle, i: int, starts: Callable | None) -> int:
    """The least power k of 2 such that a shift of f by k tau changes the hit of ray i; 0 if no k up to 2^20 does.

    starts: see truth.first_hits
    """
    ray = rays.select([i])
    o, tau = starts(i) if starts else [float(x) for x in rays.o[i]], float(ChordPolynomial.of(surface, ray).tau[0])
    solver, side = CertifiedSolver(surface), None if rays.side is None else rays.side[i]

    def changes(k: int) -> bool:
        return solver.first_hit(o, rays.d[i], 2.0**k * tau, side)[2]

    return next(2**k for k in range(1, 21) if k == 20 or changes(k)) if changes(20) else 0


def is_another_root(surface: Surface, o: np.ndarray, d: np.ndarray, t: float, first: float) -> bool:
    """Whether t is nearer to another root on the ray than to the first root. o, d: origin and direction of one ray."""
    roots = CertifiedSolver(surface).first_hit([float(x) for x in o], d, 0.0, None)[3]
    return any(abs(r - t) < abs(first - t) for r in roots[1:])


def normal_errors(surface: Surface, rays: RayBundle, t: np.ndarray, low: np.ndarray, n: np.ndarray) -> dict[str, Any]:
    """The fields `nan` and `degrees` of Score: the solver's normals n are compared with the true normals.

    t, low: the true hit points are at distance t + low, (N). Points with gradient 0 have no normal and are left out.
    """
    g = surface.gradient(rays.points(t, low))
    length = np.linalg.norm(g, axis=1)
    nan = int(np.isnan(n).any(1).sum())
    defined = (length > 0) & ~np.isnan(n).any(1)
    if not defined.any():
        return {"nan": nan}
    true = g[defined] / length[defined, None]
    cosine, sine = (true * n[defined]).sum(1), np.linalg.norm(np.cross(true, n[defined]), axis=1)
    degrees = np.degrees(np.arctan2(sine, np.abs(cosine) if surface.has_multiple_factors else cosine))
    return {"nan": nan, "degrees": (float(np.quantile(degrees, 0.999)), float(degrees.max()))}
