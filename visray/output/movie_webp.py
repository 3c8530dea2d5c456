"""Animated WebP files, with all colours and with transparency."""

from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from visray.output.movie_spool import Spool, SpoolPicture, milliseconds

# Quality from 0 to 100, and effort from 0 (fast) to 6 (small).
QUALITY, EFFORT = 90, 4
# A frame is stored whole at least so often. Of frames that are stored as changes, traces of things that move remain.
WHOLE = 1


class WebP:
    """A WebP file that is being written.

    path: the file. width, height: size of a frame in pixels. fps: frames per second.
    """

    # What the size of a frame is a multiple of, and whether frames have alpha.
    multiple, has_alpha = 1, True
    # Longest frame in seconds: its milliseconds are in 24 bits.
    longest = (2**24 - 1) / 1000

    def __init__(self, path: Path, width: int, height: int, fps: float):
        self.path, self.fps, self.spool = path, fps, Spool(path.parent)

    @staticmethod
    def check(path: Path, fps: float) -> None:
        """Each speed is possible."""

    def add(self, pixels: np.ndarray) -> None:
        """Adds a frame. Shape: uint8 (H, W, 3), or (H, W, 4) with alpha."""
        self.spool.add(pixels)

    def finish(self) -> None:
        """Writes the file, which repeats forever."""
        frames = SpoolPicture(lambda number: Pillow.fromarray(self.spool[number]), len(self.spool))
        shown = milliseconds(len(self.spool), self.fps, 1)
        options = {"quality": QUALITY, "method": EFFORT, "kmin": 0, "kmax": WHOLE}
        frames.save(self.path, "webp", save_all=True, duration=shown, **options)

    def close(self) -> None:
        """Frees the frames."""
        self.spool.close()
