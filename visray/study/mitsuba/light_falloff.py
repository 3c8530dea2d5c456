"""Attenuation and spot falloff of lights: a reference implementation in NumPy.

The formulas are those of the kernels; the arithmetic is independent of them.
"""

import numpy as np

from visray.lights import SpotLight
from visray.lights.light import Light


def attenuation(light: Light, distance: np.ndarray) -> np.ndarray:
    """1 / (a + b d + c d^2), or 1 where a = b = c = 0. Shapes: (N) -> (N).

    For lights that are infinitely far away, d counts as 0.
    """
    d = distance if light.has_position else np.zeros_like(distance)
    total = light.a + light.b * d + light.c * d**2
    return np.divide(1, total, out=np.ones_like(d), where=total > 0)


def spot_falloff(light: Light, l: np.ndarray) -> np.ndarray:
    """The share of its light that a light sends along -l; 1 for lights that are no spots. Shapes: (N, 3) -> (N).

    l: unit directions towards the light.

    Error: 2^-52 / 1.5e-8 of the share, from the difference of a spot's cosines, which is at least 1 - cos 0.01 degrees.
    """
    if not isinstance(light, SpotLight):
        return np.ones(len(l))
    axis, edge = np.array(light.direction, float), np.cos(np.radians(light.angle))
    inside = -(l @ axis) / np.linalg.norm(axis) - edge
    lit = inside > 0
    return np.where(lit, np.where(lit, inside / (1 - edge), 1) ** light.exponent, 0)
