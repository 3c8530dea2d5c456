"""Slope of an error: the exponent of a power law through measured points.

The fit is a line in logarithms by weighted least squares. Points that lie further from the line than their own noise
explains have an additional scatter, of the same size for all points (DerSimonian, Laird 1986, here for a line). The
scatter is part of the weights, and widens the interval by Student's t of n - 2 degrees of freedom.
"""

from collections.abc import Sequence
from math import hypot, sqrt

import numpy as np

from visray.study.cost.errors import student
from visray.study.cost.records import Slope

FEWEST = 3  # points: two always lie on a line
ROUNDS = 3  # of fits: the weights depend on the slope


def slope(x: Sequence[float], squares: Sequence[np.ndarray], spread: Sequence[float] | None = None) -> Slope | None:
    """The k of error ~ x^-k with its interval of 95 %. None for fewer than 3 points, a single x, or an error that may
    be 0.

    x: seconds or counts
    squares: squared errors of the seeds of each point; the points are independent
    spread: standard deviation of log x
    Shapes: x, spread (N), squares N times (S). Domain: x > 0, S >= 2.
    """
    if len(x) < FEWEST or len(set(x)) < 2:
        return None
    means = np.array([np.mean(s) for s in squares])
    deviations = np.array([np.std(s, ddof=1) / sqrt(len(s)) for s in squares])
    dofs = np.array([len(s) - 1 for s in squares])
    if any(m <= student(int(dof)) * d for m, d, dof in zip(means, deviations, dofs)):
        return None
    position, height = np.log(np.asarray(x, np.float64)), np.log(means) / 2
    # Variances of the logarithms: of the error, and of x.
    own = (deviations / means / 2) ** 2
    across = np.zeros(len(x)) if spread is None else np.asarray(spread, np.float64) ** 2
    if not (own + across).all():
        # Without noise all points have the same weight, and all distance from the line is scatter.
        equal = np.ones(len(x))
        k, lever = _line(position, height, equal)
        rest = _rest(position, height, equal, k)
        half = student(len(x) - 2) * sqrt((rest**2).sum() / (len(x) - 2) * (lever**2).sum())
        return Slope(-k, -k - half, -k + half, len(x))
    k = 0.0
    for _ in range(ROUNDS):
        noise = own + k**2 * across
        if not noise.all():  # only x has noise, and the slope is not known yet
            noise = own + across
        scatter = _scatter(position, height, noise)
        k, lever = _line(position, height, 1 / (noise + scatter))
    parts = lever**2 * noise
    # Satterthwaite's degrees of freedom of a sum of variances, each estimated from a few seeds.
    dof = max(1, int(parts.sum() ** 2 / (parts**2 / dofs).sum()))
    half = hypot(student(dof) * sqrt(parts.sum()), student(len(x) - 2) * sqrt(scatter * (lever**2).sum()))
    return Slope(-k, -k - half, -k + half, len(x))


def _line(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[float, np.ndarray]:
    """Slope of the weighted line, and its derivative by each y."""
    away = x - np.average(x, weights=weights)
    lever = weights * away / (weights * away**2).sum()
    return float((lever * y).sum()), lever


def _rest(x: np.ndarray, y: np.ndarray, weights: np.ndarray, k: float) -> np.ndarray:
    """Distances of the points from the line."""
    rest = y - k * x
    return rest - np.average(rest, weights=weights)


def _scatter(x: np.ndarray, y: np.ndarray, noise: np.ndarray) -> float:
    """Variance of points about their line beyond their own noise: with it chi-square has its expected value."""
    w = 1 / noise
    k, _ = _line(x, y, w)
    chi = (w * _rest(x, y, w, k) ** 2).sum()
    design = np.stack([np.ones_like(x), x - np.average(x, weights=w)], 1)
    taken = np.trace(np.linalg.solve(design.T @ (w[:, None] * design), design.T @ (w[:, None] ** 2 * design)))
    return max(0.0, float((chi - (len(x) - 2)) / (w.sum() - taken)))
