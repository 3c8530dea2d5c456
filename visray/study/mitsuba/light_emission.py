"""What lights send, in NumPy: by the same words as the kernels, in other arithmetic."""

import numpy as np

from visray.lights import SpotLight
from visray.lights.light import Light


def weight(light: Light, distance: np.ndarray) -> np.ndarray:
    """1 / (a + b d + c d^2), or 1 where a = b = c = 0; infinitely far away, d does not count. Shapes: (N) -> (N)."""
    d = distance if light.has_position else np.zeros_like(distance)
    total = light.a + light.b * d + light.c * d**2
    return np.divide(1, total, out=np.ones_like(d), where=total > 0)


def aim(light: Light, l: np.ndarray) -> np.ndarray:
    """The share of its light that a light sends against the unit directions l. Shapes: (N, 3) -> (N).

    Error: of a spot's cosines, whose difference is at least 1 - cos 0.01 degrees: 2^-52 / 1.5e-8 of the share.
    """
    if not isinstance(light, SpotLight):
        return np.ones(len(l))
    axis, edge = np.array(light.direction, float), np.cos(np.radians(light.angle))
    inside = -(l @ axis) / np.linalg.norm(axis) - edge
    lit = inside > 0
    return np.where(lit, np.where(lit, inside / (1 - edge), 1) ** light.exponent, 0)
