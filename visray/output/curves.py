"""Display curves: from linear light to the numbers that are sent to a screen, and back."""

from typing import Literal

import numpy as np

Gamma = float | Literal["srgb"]
# Weights of red, green and blue in the luminance of linear Rec. 709.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def curve(light: np.ndarray, gamma: Gamma) -> np.ndarray:
    """The numbers that are sent to a screen for linear light; both are from 0 to 1.

    gamma: "srgb", or an exponent: then the result is light^(1 / gamma).

    Source: IEC 61966-2-1 for sRGB.
    """
    if gamma == "srgb":
        return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.sqrt(light) if gamma == 2 else light ** (1 / gamma)


def linear(shown: np.ndarray, gamma: Gamma = "srgb") -> np.ndarray:
    """Linear light from the numbers that are sent to a screen; both are from 0 to 1. The inverse of `curve`."""
    if gamma == "srgb":
        return np.where(shown <= 0.04045, shown / 12.92, ((np.maximum(shown, 0) + 0.055) / 1.055) ** 2.4)
    return shown ** float(gamma)


def linear_slope(shown: np.ndarray) -> np.ndarray:
    """Derivative of `linear(shown)` for sRGB; where two pieces of the curve meet, that of the lower piece."""
    return np.where(shown <= 0.04045, 1 / 12.92, 2.4 / 1.055 * ((np.maximum(shown, 0) + 0.055) / 1.055) ** 1.4)
