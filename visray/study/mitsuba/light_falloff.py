"""Attenuation of lights by distance, in NumPy: the reference of the kernels' attenuation."""

import numpy as np

from visray.lights.light import Light


def attenuation(light: Light, distance: np.ndarray) -> np.ndarray:
    """1 / (a + b d + c d^2) with d = distance, or 1 if a = b = c = 0. Shapes: (N) -> (N).

    If the light is infinitely far away, d is 0.
    """
    d = distance if light.has_position else np.zeros_like(distance)
    total = light.a + light.b * d + light.c * d**2
    return np.divide(1, total, out=np.ones_like(d), where=total > 0)
