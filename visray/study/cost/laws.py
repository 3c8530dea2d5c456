"""The laws that a model of costs is made of, each fitted to one curve."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

POWERS = np.linspace(0.5, 2, 31)  # of a variance over a count: from far worse than random to a smooth one's strata
REACH = 4  # times the last measured count: no law is asked further


@dataclass(frozen=True)
class PowerLaw:
    """y = floor + u (n / n0)^-p of a count n; all of it 0 or more."""

    floor: float
    u: float
    p: float
    n0: float

    @staticmethod
    def of(n: np.ndarray, y: np.ndarray, n0: float) -> "PowerLaw":
        """The law nearest to y in relative terms; 0 where there is nothing to fit. Domain: y > 0."""
        if len(y) == 0:
            return PowerLaw(0.0, 0.0, 1.0, n0)
        fits = []
        for p in POWERS:
            rows = np.stack([1 / y, (n / n0) ** -p / y], 1)
            found = nonnegative(rows, np.ones_like(y))
            fits.append((float(((rows @ found - 1) ** 2).sum()), p, found))
        # Where nothing tells the powers apart, that of independent samples.
        _, p, (floor, u) = min(fits, key=lambda fit: (fit[0], abs(fit[1] - 1)))
        return PowerLaw(float(floor), float(u), float(p), n0)

    def part(self, n: np.ndarray | float) -> np.ndarray | float:
        """What falls with n."""
        return self.u * (n / self.n0) ** -self.p


@dataclass(frozen=True)
class Through:
    """A power law from each point to the next; beyond the ends that of the last two, if y does not grow by it. x in
    order, y > 0, or 0 everywhere."""

    x: np.ndarray
    y: np.ndarray

    @staticmethod
    def of(points: list[tuple[float, float]]) -> "Through":
        """Through points in any order; of several with one x, their mean. A y of 0 counts where all are."""
        points = [p for p in points if p[1] > 0] or points
        x = sorted({p[0] for p in points})
        return Through(np.array(x), np.array([np.mean([b for a, b in points if a == at]) for at in x]))

    def at(self, x: np.ndarray | float) -> np.ndarray:
        if not self.y.all():
            return np.zeros_like(x, float)
        a, b, at = np.log(self.x), np.log(self.y), np.log(x)
        if len(a) == 1:
            return np.exp(b[0] - (at - a[0]))  # no slope is known: that of independent samples
        found = np.interp(at, a, b)
        for outside, i, j in ((at < a[0], 0, 1), (at > a[-1], -1, -2)):
            k = min(0.0, (b[j] - b[i]) / (a[j] - a[i]))
            found = np.where(outside, b[i] + k * (at - a[i]), found)
        return np.exp(found)


def nonnegative(rows: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The x >= 0 for which rows x is nearest to right. Shapes: rows (M, N), right (M), x (N). Source: Lawson, Hanson
    1974, chapter 23."""
    scale = np.sqrt((rows**2).sum(0))
    scale[scale == 0] = 1.0
    a, n = rows / scale, rows.shape[1]
    x, free = np.zeros(n), np.zeros(n, bool)
    # Below this a gradient is nothing but the rounding of its sum.
    nothing = len(right) * np.finfo(float).eps * np.linalg.norm(right)
    for _ in range(3 * n):
        gradient = np.where(free, -np.inf, a.T @ (right - a @ x))
        if gradient.max() <= nothing:
            break
        free[np.argmax(gradient)] = True
        while True:
            z = np.zeros(n)
            z[free] = np.linalg.lstsq(a[:, free], right, rcond=None)[0]
            wrong = free & (z <= 0)
            if not wrong.any():
                break
            way = np.full(n, np.inf)
            way[wrong] = x[wrong] / (x[wrong] - z[wrong])
            x += way.min() * (z - x)
            free &= way > way.min()
            x[~free] = 0.0
        x = z
    return x / scale


def grid(measured: list[float]) -> list[float]:
    """The counts to choose from: the measured ones, some between where they are more than doubled, and beyond them
    doubled up to REACH times the last. Whole numbers where all are; squares where all are, as strata want them. Domain:
    above 0."""
    roots = np.sqrt(measured)
    whole, square = (all(float(v).is_integer() for v in x) for x in (measured, roots))
    ends = sorted({float(v) for v in measured})
    found = [*ends, ends[-1] * 2, ends[-1] * REACH]
    for a, b in pairwise(ends):
        # So many doublings, and a little less is as good: from 9 to 36 it is two, not three.
        parts = max(1, round(np.log2(b / a)))
        found += [a * (b / a) ** (i / parts) for i in range(1, parts)]
    if square:
        return sorted({round(v**0.5) ** 2 for v in found})
    return sorted({round(v) if whole else v for v in found})


def lowest(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Which points no other is below in both, in the order of x; of equals the first."""
    order = np.lexsort((y, x))
    best = np.minimum.accumulate(np.concatenate([[np.inf], y[order][:-1]]))
    return order[y[order] < best]
