"""Movies: .mp4 files by ffmpeg, .gif and .webp files by Pillow. Frames are added one after the other.

The file is written aside and takes its name when the movie is complete. The same frames give the same bytes.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from PIL import ImageSequence

from visray.animation.animation import MOST_FPS
from visray.arguments import shown
from visray.errors import RangeWarning, UserError
from visray.output import files, movie_mp4
from visray.output.movie_gif import Gif
from visray.output.movie_mp4 import Mp4
from visray.output.movie_webp import WebP
from visray.warn import warn

# The class that writes the files with a suffix.
FORMATS = {".mp4": Mp4, ".gif": Gif, ".webp": WebP}
# Names of formats, for messages.
ALL = f"{', '.join(list(FORMATS)[:-1])} or {list(FORMATS)[-1]}"


def is_movie(path: Path) -> bool:
    """Whether the name of a file is that of a movie."""
    return path.suffix.lower() in FORMATS


def check_movie(path: Path, fps: float) -> None:
    """Raises a UserError if no movie can be written at `path`. Call this before a long render.

    fps: frames per second.
    """
    if not is_movie(path):
        raise UserError(f"{path}: the name says no kind of movie that visray writes; end it in {ALL}")
    if isinstance(fps, bool) or not (isinstance(fps, int | float) and 0 < fps < inf):
        raise UserError(f"fps = {shown(fps)}: must be a number of frames per second greater than 0, such as 25")
    kind = FORMATS[path.suffix.lower()]
    if fps > MOST_FPS:
        raise UserError(f"fps = {shown(fps)}: must be at most {MOST_FPS:g}")
    if 1 / fps > kind.longest:
        problem = f"a frame would last {1 / fps:g} s, and at most {kind.longest:g} s fit into such a file"
        raise UserError(f"{path}: {problem}; give at least {1 / kind.longest:.2g} frames per second")
    kind.check(path, fps)
    files.check_writable(path)


def seconds_of(path: Path) -> float:
    """How long a movie lasts, in seconds. Raises UserError if the file is no movie that can be read."""
    try:
        if path.suffix.lower() == ".mp4":
            return movie_mp4.seconds_of(path)
        with Pillow.open(path) as picture:
            return sum(_duration(frame) for frame in ImageSequence.Iterator(picture)) / 1000
    except (OSError, SyntaxError, RuntimeError) as error:
        raise UserError(f"{path}: is no movie that can be read; --overwrite replaces it") from error


def _duration(frame: Pillow.Image) -> int:
    """How long a frame of a movie is shown, in milliseconds. Pillow knows it once the frame is loaded."""
    frame.load()
    return frame.info.get("duration", 0)


class Movie:
    """A movie that is being written.

    path: the file, for messages.
    aside: the file that is written.
    fps: frames per second.
    count: number of frames so far.
    """

    def __init__(self, path: Path, aside: Path, fps: float):
        self.path, self.aside, self.fps, self.count = path, aside, fps, 0
        self.encoder, self.shape = None, (0, 0)

    def add(self, pixels: np.ndarray) -> None:
        """Adds a frame, in the numbers for a screen (Image.display).

        Shapes: uint8 (H, W, 3), or (H, W, 4) with alpha.
        """
        if self.encoder is None:
            self._begin(pixels)
        if pixels.shape[:2] != self.shape:
            (height, width), (h, w) = self.shape, pixels.shape[:2]
            raise UserError(f"{self.path}: its frames have {width} x {height} pixels, and this one has {w} x {h}")
        kind = type(self.encoder)
        if pixels.shape[2] == 4 and not kind.has_alpha:
            pixels = _over_black(pixels)
        rows, columns = _padded(self.shape, kind)
        padding = ((0, rows - self.shape[0]), (0, columns - self.shape[1]), (0, 0))
        self.encoder.add(np.pad(pixels, padding, mode="edge"))
        self.count += 1

    def finish(self) -> None:
        """Completes the file."""
        if self.encoder is None:
            raise UserError(f"{self.path}: a movie has at least one frame")
        self.encoder.finish()

    def close(self) -> None:
        """Frees what the encoder holds, whether the file is complete or not."""
        if self.encoder is not None:
            self.encoder.close()

    def _begin(self, pixels: np.ndarray) -> None:
        """Starts the encoder with the size of the first frame, and says what the format changes."""
        self.shape = height, width = pixels.shape[:2]
        kind = FORMATS[self.path.suffix.lower()]
        rows, columns = _padded(self.shape, kind)
        if (rows, columns) != (height, width):
            text = f"{width} x {height} pixels are padded to {columns} x {rows}, because an MP4 file has even sizes"
            warn(f"{self.path}: {text}", RangeWarning)
        if pixels.shape[2] == 4 and not kind.has_alpha:
            text = "has no transparency: what lets the background through is shown over black; WebP keeps it"
            warn(f"{self.path}: {text}", RangeWarning)
        self.encoder = kind(self.aside, columns, rows, self.fps)


def _padded(shape: tuple[int, int], kind: type) -> tuple[int, int]:
    """Height and width of the frames in a file of a format."""
    height, width = (size + -size % kind.multiple for size in shape)
    return height, width


def _over_black(pixels: np.ndarray) -> np.ndarray:
    """A frame over a black background. Shapes: uint8 (H, W, 4); result (H, W, 3)."""
    return ((pixels[..., :3].astype(np.uint16) * pixels[..., 3:] + 127) // 255).astype(np.uint8)


@contextmanager
def movie(path: str | os.PathLike[str], fps: float) -> Iterator[Movie]:
    """Writes a movie: yields the Movie that frames are added to. At the end of the `with` block the file is complete.
    If the block is left by an error, an old file remains.

    fps: frames per second.
    """
    path = Path(path)
    check_movie(path, fps)
    with files.replacing(path) as aside:
        writer = Movie(path, aside, float(fps))
        try:
            yield writer
            writer.finish()
        finally:
            writer.close()
