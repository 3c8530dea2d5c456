"""A spool: frames that wait in a nameless file on the disk. Pillow reads them one after the other, like the frames of a
picture file."""

import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image as Pillow


class Spool:
    """Frames on the disk. The system removes the file when it is closed, also if the process is killed.

    folder: the folder of the file.
    """

    def __init__(self, folder: Path):
        self.file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - close() closes it
        self.shapes, self.starts = [], [0]

    def __len__(self) -> int:
        return len(self.shapes)

    def add(self, pixels: np.ndarray) -> None:
        """Adds a frame. Shape: uint8 (H, W, n)."""
        self.file.seek(self.starts[-1])
        self.file.write(np.ascontiguousarray(pixels).data)
        self.file.flush()
        self.shapes.append(pixels.shape)
        self.starts.append(self.starts[-1] + pixels.size)

    def __getitem__(self, number: int) -> np.ndarray:
        """A frame. Shape: uint8 (H, W, n)."""
        self.file.seek(self.starts[number])
        shape = self.shapes[number]
        return np.frombuffer(self.file.read(int(np.prod(shape))), np.uint8).reshape(shape)

    def close(self) -> None:
        """Removes the frames."""
        self.file.close()


class SpoolPicture(Pillow.Image):
    """The frames of a spool as one picture of Pillow with several frames. So they need not all be in memory.

    made: makes the picture of a frame from its number.
    count: number of frames.
    """

    def __init__(self, made: Callable[[int], Pillow.Image], count: int):
        super().__init__()
        self.made, self.n_frames = made, count
        self.encoderinfo: dict = {}
        self.seek(0)

    def seek(self, frame: int) -> None:
        """Turns to a frame. Raises an EOFError after the last."""
        if frame >= self.n_frames:
            raise EOFError
        picture = self.made(frame)
        self.number, self._mode, self._size = frame, picture.mode, picture.size
        self.im, self.palette = picture.im, picture.palette

    def tell(self) -> int:
        """The number of the frame."""
        return self.number


def milliseconds(count: int, fps: float, unit: int) -> list[int]:
    """How long each frame is shown, in milliseconds. Rounding does not add up.

    count: number of frames.
    unit: a multiple of so many milliseconds is what the format can say.
    """
    ends = [unit * round(1000 * k / (fps * unit)) for k in range(count + 1)]
    return [end - begin for begin, end in pairwise(ends)]
