"""The rounding error of files: 8 bits in PNG, half precision in EXR."""

import os

import numpy as np

from visray.output.curves import Gamma, curve, linear
from visray.output.exr import LARGEST_HALF


def rounding(rgb: np.ndarray, path: str | os.PathLike[str], gamma: Gamma = "srgb", exposure: float = 0.0) -> float:
    """The root mean square, over pixels and channels, of a file's rounding error, in linear light.

    For a PNG file, only light that a screen can show counts: from 0 to full scale.

    Shapes: rgb (H, W, 3).
    """
    if os.fspath(path).lower().endswith(".png"):
        light = np.clip(rgb * 2.0**exposure, 0, 1)
        # The nearest of the 256 levels.
        level = np.floor(curve(light, gamma) * 255 + 0.5)
        off = (linear(level / 255, gamma) - light) / 2.0**exposure
    else:
        # Light beyond the range of half is clamped; that is not counted as rounding.
        light = np.clip(rgb, -LARGEST_HALF, LARGEST_HALF)
        off = light.astype(np.float16).astype(float) - light
    return float(np.sqrt(np.square(off).mean()))
