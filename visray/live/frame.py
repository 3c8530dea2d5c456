"""One state of a live picture, as browsers show it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Frame:
    """One state of a live picture.

    rgb: colours for the screen, which a browser scales to the size of the picture. Shape: uint8 (h, w, 3)
    size: width and height of the whole picture, in pixels
    grain: side in pixels of the squares that the state consists of; 1: every pixel has its colour
    samples: mean number of samples of a pixel
    error: root mean square error, divided by the mean luminance, as for --error; None while it is not known. The true
        error is this or smaller, on average (closeness.py)
    finished: whether the error is as small as was asked for
    seconds: from the change that the state shows until it was ready
    change: number of the change that it shows (Engine.changes)
    share: share of the squares that have their new colour; the others still have that of the state before
    note: what users should know, such as that the scene takes long; "" if there is nothing
    """

    rgb: np.ndarray
    size: tuple[int, int]
    grain: int
    samples: float
    error: float | None
    finished: bool
    seconds: float = 0.0
    change: int = 0
    share: float = 1.0
    note: str = ""
