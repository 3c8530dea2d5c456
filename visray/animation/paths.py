"""Paths through points, at constant speed.

A path is given by its length at fine steps of a parameter. Between the steps, the length is interpolated.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# Steps of the parameter between two points of a curve. The speed is constant within the share of about 1 / STEPS^2.
STEPS = 256


@dataclass(frozen=True)
class Path:
    """A path.

    at_parameter: function that returns the point at a parameter
    parameters: increasing parameters
    lengths: lengths of the path up to each of these
    """

    at_parameter: Callable[[float], np.ndarray]
    parameters: np.ndarray
    lengths: np.ndarray

    def at(self, share: float) -> np.ndarray:
        """The point at a share of the length, from 0 to 1."""
        return self.at_parameter(float(np.interp(share * self.lengths[-1], self.lengths, self.parameters)))

    def shares(self) -> tuple[float, ...]:
        """Shares of the length at which the path is at its points."""
        whole = self.parameters == np.round(self.parameters)
        return tuple((self.lengths[whole] / self.lengths[-1]).tolist())


def polygon(points: np.ndarray, closed: bool) -> Path:
    """The path of straight lines through points. Shape: (N, 3)."""
    corners = np.vstack([points, points[:1]]) if closed else points
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])

    def at(u: float) -> np.ndarray:
        i = min(int(u), len(corners) - 2)
        return (1 - (u - i)) * corners[i] + (u - i) * corners[i + 1]

    return Path(at, np.arange(len(corners), dtype=float), lengths)


def spline(points: np.ndarray, closed: bool) -> Path:
    """The centripetal Catmull-Rom curve through points (C. Yuksel, S. Schaefer and J. Keyser, Parameterization and
    applications of Catmull-Rom curves, 2011). An open one goes on straight at its ends. Shape: (N, 3).

    Domain: neighbouring points differ.
    """
    if closed:
        around = np.vstack([points[-1:], points, points[:2]])
    else:
        around = np.vstack([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(around, axis=0), axis=1) ** 0.5)])

    def at(u: float) -> np.ndarray:
        i = min(int(u), len(around) - 4)
        return _catmull_rom(around[i : i + 4], knots[i : i + 4], u - i)

    parameters = np.linspace(0, len(around) - 3, (len(around) - 3) * STEPS + 1)
    line = np.array([at(u) for u in parameters])
    return Path(at, parameters, np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]))


def _catmull_rom(p: np.ndarray, knots: np.ndarray, share: float) -> np.ndarray:
    """The point at a share of the way from the second to the third of four points (the pyramid of P. J. Barry and R. N.
    Goldman, 1988)."""
    t = (1 - share) * knots[1] + share * knots[2]

    def mixed(a: np.ndarray, b: np.ndarray, i: int, j: int) -> np.ndarray:
        w = (t - knots[i]) / (knots[j] - knots[i])
        return (1 - w) * a + w * b

    lines = [mixed(p[i], p[i + 1], i, i + 1) for i in range(3)]
    curves = [mixed(lines[i], lines[i + 1], i, i + 2) for i in range(2)]
    return mixed(curves[0], curves[1], 1, 2)
