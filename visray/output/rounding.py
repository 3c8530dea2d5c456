"""How much a file changes a picture: eight bits of PNG, the half precision of EXR."""

import os

import numpy as np

from visray.output.curves import Gamma, curve, linear
from visray.output.exr import LARGEST_HALF


def rounding(rgb: np.ndarray, path: str | os.PathLike[str], gamma: Gamma = "srgb", exposure: float = 0.0) -> float:
    """The root of the mean square over pixels and channels by which a file is off, in linear light; of a PNG file only
    what a screen can show, light from 0 to full scale. Shapes: rgb (H, W, 3)."""
    if os.fspath(path).lower().endswith(".png"):
        light = np.clip(rgb * 2.0**exposure, 0, 1)
        # What 8 bits stand for; between them numbers are rounded to the nearest.
        bits = np.floor(curve(light, gamma) * 255 + 0.5)
        off = (linear(bits / 255, gamma) - light) / 2.0**exposure
    else:
        # Light beyond the range of half is no matter of rounding.
        light = np.clip(rgb, -LARGEST_HALF, LARGEST_HALF)
        off = light.astype(np.float16).astype(float) - light
    return float(np.sqrt(np.square(off).mean()))
