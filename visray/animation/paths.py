"""Paths through points, at constant speed.

A path is given by its length at fine steps of a parameter. Between the steps, the parameter is a monotone cubic of the
length.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from visray.animation import interpolation

# Steps of the parameter from one point of a curve to the next.
STEPS = 256


@dataclass(frozen=True)
class Path:
    """A path.

    at_parameter: function that returns the point at a parameter
    parameters: increasing parameters
    lengths: lengths of the path up to each of these. Some may be equal, because they are rounded.
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
        return self.at_parameter(float(interpolation.cubic(*self._steps, share * self.lengths[-1])))

    @cached_property
    def _steps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lengths that increase, their parameters, and the change of the parameter with the length."""
        longer = np.concatenate([[True], np.diff(self.lengths) > 0])
        lengths, parameters = self.lengths[longer], self.parameters[longer]
        return lengths, parameters, interpolation.slopes(lengths, parameters)

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

    Domain: neighbouring points differ so much that the roots of their distances add up to increasing numbers.
    """
    if closed:
        around = np.vstack([points[-1:], points, points[:2]])
    else:
        around = np.vstack([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(around, axis=0), axis=1) ** 0.5)])

    def at(u: np.ndarray) -> np.ndarray:
        piece = np.clip(np.searchsorted(knots, u, side="right") - 2, 0, len(around) - 4)
        return _catmull_rom(
            [around[piece + k] for k in range(4)], [knots[piece + k, None] for k in range(4)], u[:, None]
        )

    parameters = np.linspace(knots[1:-2], knots[2:-1], STEPS, endpoint=False, axis=1).ravel()
    parameters = np.append(parameters, knots[-2])
    return Path(lambda u: at(np.array([u]))[0], parameters, _lengths(at(parameters)), STEPS)


def _lengths(points: np.ndarray) -> np.ndarray:
    """Length of the line through points, up to each of them."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _catmull_rom(p: list[np.ndarray], knots: list[np.ndarray], u: np.ndarray) -> np.ndarray:
    """The points at parameters u, each between the second and the third of its four knots (the pyramid of P. J. Barry
    and R. N. Goldman, 1988). Shapes: p four times (N, 3), knots four times (N, 1), u (N, 1)."""

    def mixed(a: np.ndarray, b: np.ndarray, i: int, j: int) -> np.ndarray:
        w = (u - knots[i]) / (knots[j] - knots[i])
        return (1 - w) * a + w * b

    lines = [mixed(p[i], p[i + 1], i, i + 1) for i in range(3)]
    curves = [mixed(lines[i], lines[i + 1], i, i + 2) for i in range(2)]
    return mixed(curves[0], curves[1], 1, 2)
