"""GIF files: 256 colours, one palette for all frames, and an ordered dither that stands still between frames."""

from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from visray.errors import RangeWarning
from visray.output.movie_spool import Spool, SpoolPicture, milliseconds
from visray.warn import warn

# Unit of times in a GIF file. Programs show a frame for no less than two of them; they take shorter times for mistakes.
UNIT = 10
MOST_FPS = 1000 / (2 * UNIT)
# The palette is chosen from at most so many pixels of all frames.
PALETTE_PIXELS = 2**20
COLORS = 256
# Bayer's matrix: thresholds whose neighbours differ as much as possible.
BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
# Height of the dither, in levels of 255. Of 8, 12, 16 and 24 this changes pictures least.
DITHER = 8
# The palette is refined in so many rounds, on colours of so many bits.
ROUNDS, REFINED_BITS = 8, 5
# The nearest colour of the palette is looked up in a table, by so many bits of red, green and blue.
BITS = 6


class Gif:
    """A GIF file that is being written.

    path: the file. width, height: size of a frame in pixels. fps: frames per second.
    """

    # What the size of a frame is a multiple of, and whether frames have alpha.
    multiple, has_alpha = 1, False
    # Longest frame in seconds: its time is in 16 bits.
    longest = UNIT * (2**16 - 1) / 1000

    def __init__(self, path: Path, width: int, height: int, fps: float):
        self.path, self.fps, self.spool = path, fps, Spool(path.parent)
        tiles = np.tile((BAYER + 0.5) / BAYER.size - 0.5, (-(-height // 4), -(-width // 4)))[:height, :width]
        self.dither = np.round(DITHER * tiles).astype(np.int16)[..., None]

    @staticmethod
    def check(path: Path, fps: float) -> None:
        """Warns if frames follow faster than programs show them."""
        if fps > MOST_FPS:
            text = f"{fps:g} frames per second: programs show a GIF slower than that; {MOST_FPS:g} or an MP4 is right"
            warn(f"{path}: {text}", RangeWarning)

    def add(self, pixels: np.ndarray) -> None:
        """Adds a frame. Shape: uint8 (H, W, 3)."""
        self.spool.add(pixels)

    def finish(self) -> None:
        """Writes the file, which repeats forever. Frames that are equal become one that is shown longer."""
        palette = self._palette()
        nearest = _nearest(palette)

        def made(number: int) -> Pillow.Image:
            cells = np.clip(self.spool[number] + self.dither, 0, 255).astype(np.uint8) >> (8 - BITS)
            picture = Pillow.fromarray(nearest[cells[..., 0], cells[..., 1], cells[..., 2]])
            picture.putpalette(palette.tobytes())
            return picture

        frames = SpoolPicture(made, len(self.spool))
        shown = milliseconds(len(self.spool), self.fps, UNIT)
        frames.save(self.path, "gif", save_all=True, duration=shown, loop=0, optimize=False)

    def close(self) -> None:
        """Frees the frames."""
        self.spool.close()

    def _palette(self) -> np.ndarray:
        """The palette, chosen from some of the pixels of all frames. Shape: uint8 (n, 3)."""
        step = -(-sum(np.prod(shape[:2]) for shape in self.spool.shapes) // PALETTE_PIXELS)
        pixels = np.concatenate([self.spool[k].reshape(-1, 3)[k % step :: step] for k in range(len(self.spool))])
        return _chosen(pixels)


def _chosen(pixels: np.ndarray) -> np.ndarray:
    """The colours that are nearest to those of pixels: by median cut, then by rounds of k-means, in which each colour
    becomes the mean of those that are nearest to it.

    The pixels of a cell of red, green and blue are one colour. It counts as the root of their number, because else a
    large background takes all colours, and small objects get visible bands.

    Shapes: pixels uint8 (N, 3); result uint8 (n, 3).
    """
    shifts = np.arange(3) * REFINED_BITS
    cell = ((pixels >> (8 - REFINED_BITS)).astype(np.int64) << shifts).sum(1)
    counts, sums = _sums(cell, np.ones(len(pixels)), pixels, 8**REFINED_BITS)
    means, weights = sums[counts > 0] / counts[counts > 0, None], np.sqrt(counts[counts > 0])
    first = Pillow.fromarray(np.round(means).astype(np.uint8)[None]).quantize(COLORS, Pillow.Quantize.MEDIANCUT)
    palette = np.array(first.getpalette(), np.float64).reshape(-1, 3)
    for _ in range(ROUNDS):
        nearest = ((palette**2).sum(1) - 2 * means @ palette.T).argmin(1)
        totals, sums = _sums(nearest, weights, means, len(palette))
        palette = np.divide(sums, totals[:, None], out=palette.copy(), where=totals[:, None] > 0)
    return np.round(palette).astype(np.uint8)


def _sums(group: np.ndarray, weights: np.ndarray, colors: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """For each group, the sum of the weights of its colours, and of the weighted colours.

    Shapes: group, weights (N), colors (N, 3); results (count), (count, 3).
    """
    sums = [np.bincount(group, weights * colors[:, i], count) for i in range(3)]
    return np.bincount(group, weights, count), np.stack(sums, -1)


def _nearest(palette: np.ndarray) -> np.ndarray:
    """Number of the palette's colour that is nearest to the middle of each cell of red, green and blue.

    Shapes: palette (n, 3); result uint8 (64, 64, 64) for 6 bits.
    """
    middles = (np.arange(2**BITS) + 0.5) * 2 ** (8 - BITS) - 0.5
    colors = palette.astype(np.float64)
    # |x - p|^2 without |x|^2, which is the same for all colours p.
    by_channel = [colors[:, i] ** 2 - 2 * np.multiply.outer(middles, colors[:, i]) for i in range(3)]
    plane = by_channel[1][:, None] + by_channel[2][None]
    return np.stack([(red + plane).argmin(2).astype(np.uint8) for red in by_channel[0]])
