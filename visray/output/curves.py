"""Display curves: from linear light to what a screen is sent, and back."""

from typing import Literal

import numpy as np

Gamma = float | Literal["srgb"]
# Weights of red, green and blue in the luminance of linear Rec. 709.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def curve(light: np.ndarray, gamma: Gamma) -> np.ndarray:
    """The fraction of full scale to display, for linear light from 0 to 1.

    Source: IEC 61966-2-1 for sRGB; light^(1/gamma) for a number.
    """
    if gamma == "srgb":
        return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.sqrt(light) if gamma == 2 else light ** (1 / gamma)


def linear(shown: np.ndarray, gamma: Gamma = "srgb") -> np.ndarray:
    """Linear light from fractions of full scale, from 0 to 1: the inverse of `curve`."""
    if gamma == "srgb":
        return np.where(shown <= 0.04045, shown / 12.92, ((np.maximum(shown, 0) + 0.055) / 1.055) ** 2.4)
    return shown ** float(gamma)
