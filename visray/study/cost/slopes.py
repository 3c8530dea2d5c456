"""How fast an error falls: the exponent of a power law through measured points.

A line in logarithms by least squares, each point weighted by its variance. What the points lie off a line beyond their
own noise counts as a scatter of the same size at each of them (DerSimonian, Laird 1986, here for a line): it takes part
in the weights, and widens the interval by a t of n - 2 degrees of freedom, which the noise of the points does not need.
"""

from collections.abc import Sequence
from math import hypot, sqrt

import numpy as np

from visray.study.cost.errors import student
from visray.study.cost.records import Slope

FEWEST = 3  # points: a line through two is no test of it
ROUNDS = 3  # the scatter of x counts times the slope, and the slope by weights that hold the scatter


def slope(x: Sequence[float], squares: Sequence[np.ndarray], spread: Sequence[float] | None = None) -> Slope | None:
    """The k of error ~ x^-k, and between which two it lies with a chance of 95 %.

    x: seconds or counts; squares: of each point its seeds' squared errors, independent of the other points'; spread:
    standard deviation of log x. None for fewer than 3 points, one x, or where an error cannot be told from 0.
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
    own = (deviations / means / 2) ** 2
    across = np.zeros(len(x)) if spread is None else np.asarray(spread, np.float64) ** 2
    if not (own + across).all():
        # Without noise each point counts the same, and all that they lie off the line is its own fault.
        equal = np.ones(len(x))
        k, lever = _line(position, height, equal)
        rest = _rest(position, height, equal, k)
        half = student(len(x) - 2) * sqrt((rest**2).sum() / (len(x) - 2) * (lever**2).sum())
        return Slope(-k, -k - half, -k + half, len(x))
    k = 0.0
    for _ in range(ROUNDS):
        noise = own + k**2 * across
        if not noise.all():  # before the slope is known, only that of x
            noise = own + across
        scatter = _scatter(position, height, noise)
        k, lever = _line(position, height, 1 / (noise + scatter))
    parts = lever**2 * noise
    # Satterthwaite's degrees of freedom of a sum of variances that are each known from a few seeds.
    dof = max(1, int(parts.sum() ** 2 / (parts**2 / dofs).sum()))
    half = hypot(student(dof) * sqrt(parts.sum()), student(len(x) - 2) * sqrt(scatter * (lever**2).sum()))
    return Slope(-k, -k - half, -k + half, len(x))


def _line(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[float, np.ndarray]:
    """The slope of the weighted line, and what it gains by a step of each y."""
    away = x - np.average(x, weights=weights)
    lever = weights * away / (weights * away**2).sum()
    return float((lever * y).sum()), lever


def _rest(x: np.ndarray, y: np.ndarray, weights: np.ndarray, k: float) -> np.ndarray:
    """What points lie off the line."""
    rest = y - k * x
    return rest - np.average(rest, weights=weights)


def _scatter(x: np.ndarray, y: np.ndarray, noise: np.ndarray) -> float:
    """The variance that points have about their line beyond their own: that by which chi-square is as it should be."""
    w = 1 / noise
    k, _ = _line(x, y, w)
    chi = (w * _rest(x, y, w, k) ** 2).sum()
    design = np.stack([np.ones_like(x), x - np.average(x, weights=w)], 1)
    taken = np.trace(np.linalg.solve(design.T @ (w[:, None] * design), design.T @ (w[:, None] ** 2 * design)))
    return max(0.0, float((chi - (len(x) - 2)) / (w.sum() - taken)))
