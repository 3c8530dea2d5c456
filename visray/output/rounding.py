"""The rounding error of files: 8 bits in PNG, half or single precision in EXR."""

import os

import numpy as np

from visray.output.curves import Gamma, curve, linear
from visray.output.exr import LARGEST_HALF


def rounding(
    rgb: np.ndarray,
    path: str | os.PathLike[str],
    gamma: Gamma = "srgb",
    exposure: float = 0.0,
    float32: bool = False,
) -> float:
    """The root mean square of the rounding error of a file, over pixels and channels, in linear light.

    path: path of the file; its suffix tells the format.
    gamma, exposure: display curve and exposure in stops of a PNG file.
    float32: whether the colours of an EXR file are float, not half.

    Light that the file cannot store is clamped first and does not count: below 0 and above full scale in PNG files,
    beyond the range of half in EXR files.

    Shapes: rgb (H, W, 3).
    """
    if os.fspath(path).lower().endswith(".png"):
        light = np.clip(rgb * 2.0**exposure, 0, 1)
        # The nearest of the 256 levels of 8 bits.
        level = np.floor(curve(light, gamma) * 255 + 0.5)
        off = (linear(level / 255, gamma) - light) / 2.0**exposure
    elif float32:
        off = rgb.astype(np.float32).astype(float) - rgb
    else:
        light = np.clip(rgb, -LARGEST_HALF, LARGEST_HALF)
        off = light.astype(np.float16).astype(float) - light
    return float(np.sqrt(np.square(off).mean()))
