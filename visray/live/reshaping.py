"""A state of a picture in a window of another shape, until there is one for the new shape."""

from dataclasses import replace

import numpy as np

from visray.live.frame import Frame
from visray.live.viewpoint import widening

# Shapes (width by height) that differ by less than this share are the same: sizes of pictures are rounded.
SAME = 0.01


def reshaped(frame: Frame, window: tuple[int, int], film: tuple[int, int]) -> Frame:
    """The state as a window shows it, with all things in their own shape. What it does not have is filled with the
    colours of its edges.

    window, film: width and height, in pixels
    """
    shape, wanted = (n[0] / n[1] for n in (frame.size, window))
    if abs(shape / wanted - 1) < SAME:
        return frame
    # Vertical extents, in units of that of the film.
    before, now = widening(film, frame.size), widening(film, window)
    height = frame.size[1] * now / before
    width = height * wanted
    rows, columns = (
        _middle(n, extent, count, frame.grain)
        for n, extent, count in zip(frame.size[::-1], (height, width), frame.rgb.shape)
    )
    size = max(round(width), 1), max(round(height), 1)
    return replace(frame, rgb=np.ascontiguousarray(frame.rgb[rows[:, None], columns]), size=size)


def _middle(pixels: int, extent: float, cells: int, grain: int) -> np.ndarray:
    """Numbers of the cells along one side of a part in the middle of a picture. It may be longer than the picture.

    pixels: length of the picture. extent: length of the part, in its pixels. cells: number of its cells.
    grain: side of a cell
    """
    count = max(-(-round(extent) // grain), 1)
    places = (pixels - extent) / 2 + (np.arange(count) + 0.5) * grain
    return np.clip(np.floor(places / grain).astype(int), 0, cells - 1)
