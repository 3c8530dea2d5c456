"""Linear light as a screen is sent it, and back."""

from typing import Literal

import numpy as np

Gamma = float | Literal["srgb"]
# Of linear light with the primaries of Rec. 709, as the pictures have them.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def curve(light: np.ndarray, gamma: Gamma) -> np.ndarray:
    """Linear light from 0 to 1 as the fraction of full scale to display: sRGB (IEC 61966-2-1) or light^(1/gamma)."""
    if gamma == "srgb":
        return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.sqrt(light) if gamma == 2 else light ** (1 / gamma)


def linear(shown: np.ndarray, gamma: Gamma = "srgb") -> np.ndarray:
    """Linear light of fractions of full scale, from 0 to 1: the inverse of `curve`."""
    if gamma == "srgb":
        return np.where(shown <= 0.04045, shown / 12.92, ((np.maximum(shown, 0) + 0.055) / 1.055) ** 2.4)
    return shown ** float(gamma)
