"""Paths through points, at constant speed.

A path is given by its length at fine steps of a parameter. Between the steps, the parameter is a monotone cubic of the
length.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from visray.animation import interpolation

# Steps of the parameter from one point of a curve to the next.
STEPS = 256


@dataclass(frozen=True)
class Path:
    """A path.

    at_parameter: function that returns the point at a parameter
    parameters: increasing parameters
    lengths: lengths of the path up to each of these
    every: number of parameters from one point of the path to the next
    """

    at_parameter: Callable[[float], np.ndarray]
    parameters: np.ndarray
    lengths: np.ndarray
    every: int

    def at(self, share: float) -> np.ndarray:
        """The point at a share of the length, from 0 to 1.

        Error: the speed is constant to the second order of the steps: its error is the square of the share by which it
            changes, at even steps of the parameter, from one step to the next.
        """
        length = share * self.lengths[-1]
        return self.at_parameter(float(interpolation.cubic(self.lengths, self.parameters, self._slopes, length)))

    @cached_property
    def _slopes(self) -> np.ndarray:
        """Change of the parameter with the length."""
        return interpolation.slopes(self.lengths, self.parameters)

    def shares(self) -> tuple[float, ...]:
        """Shares of the length at which the path is at its points."""
        return tuple((self.lengths[:: self.every] / self.lengths[-1]).tolist())


def polygon(points: np.ndarray, closed: bool) -> Path:
    """The path of straight lines through points. Its parameter is its length. Shape: (N, 3)."""
    corners = np.vstack([points, points[:1]]) if closed else points
    lengths = _lengths(corners)
    return Path(lambda s: interpolation.linear(lengths, corners, s), lengths, lengths, 1)


def spline(points: np.ndarray, closed: bool) -> Path:
    """The centripetal Catmull-Rom curve through points (C. Yuksel, S. Schaefer and J. Keyser, Parameterization and
    applications of Catmull-Rom curves, 2011). An open one begins and ends toward the point beside. Shape: (N, 3).

    Domain: neighbouring points differ.
    """
    if closed:
        around = np.vstack([points[-1:], points, points[:2]])
    else:
        around = np.vstack([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(around, axis=0), axis=1) ** 0.5)])

    def at(u: float) -> np.ndarray:
        i = min(max(int(np.searchsorted(knots, u, side="right")) - 2, 0), len(around) - 4)
        return _catmull_rom(around[i : i + 4], knots[i : i + 4], u)

    pieces = [np.linspace(a, b, STEPS, endpoint=False) for a, b in pairwise(knots[1:-1])]
    parameters = np.concatenate([*pieces, knots[-2:-1]])
    return Path(at, parameters, _lengths(np.array([at(u) for u in parameters])), STEPS)


def _lengths(points: np.ndarray) -> np.ndarray:
    """Length of the line through points, up to each of them."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _catmull_rom(p: np.ndarray, knots: np.ndarray, u: float) -> np.ndarray:
    """The point at the parameter u, which is between the second and the third of four knots (the pyramid of P. J. Barry
    and R. N. Goldman, 1988)."""

    def mixed(a: np.ndarray, b: np.ndarray, i: int, j: int) -> np.ndarray:
        w = (u - knots[i]) / (knots[j] - knots[i])
        return (1 - w) * a + w * b

    lines = [mixed(p[i], p[i + 1], i, i + 1) for i in range(3)]
    curves = [mixed(lines[i], lines[i + 1], i, i + 2) for i in range(2)]
    return mixed(curves[0], curves[1], 1, 2)
