"""MP4 files: H.264 in the colours of Rec. 709, written by ffmpeg, which the package imageio-ffmpeg brings."""

import errno
import os
import signal
import subprocess
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

from visray.errors import UserError

# Constant quality of x264: 0 loses nothing, 23 is its default, and from 17 down no loss is seen.
QUALITY = 16
# The bits of a file depend on the number of threads, so it is the same on all machines.
THREADS = 4
# What players need to know about the numbers: their colour space, and their range from 16 to 235.
COLOR = ",".join(
    [
        "scale=in_range=full:out_range=tv:out_color_matrix=bt709:flags=accurate_rnd+full_chroma_int",
        "setparams=range=tv:colorspace=bt709:color_primaries=bt709:color_trc=bt709",
    ]
)
# Without dates and versions in the file.
BIT_EXACT = ["-fflags", "+bitexact", "-flags:v", "+bitexact"]
# How ffmpeg says that the disk is full, and the signal that ends it where files have a largest size.
FULL_DISK, TOO_LARGE = os.strerror(errno.ENOSPC), getattr(signal, "SIGXFSZ", 0)


@cache
def _ffmpeg() -> str:
    """Path of the program ffmpeg. Raises a UserError if there is none."""
    try:
        import imageio_ffmpeg

        return imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        problem = "an MP4 file needs ffmpeg, which is not installed"
        raise UserError(f"{problem}: pip install 'visray[movie]'; GIF and WebP do without") from None


def seconds_of(path: Path) -> float:
    """How long an MP4 file lasts, in seconds. Raises RuntimeError if ffmpeg cannot read it."""
    _ffmpeg()
    import imageio_ffmpeg

    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    about = imageio_ffmpeg.read_frames(str(path))
    try:
        fps = next(about)["fps"]
        # ffmpeg says both with two decimals.
        return seconds if seconds > fps else frames / fps
    finally:
        about.close()


class Mp4:
    """An MP4 file that is being written.

    path: the file. width, height: size of a frame in pixels, even numbers. fps: frames per second.
    """

    # What the size of a frame is a multiple of, and whether frames have alpha.
    multiple, has_alpha = 2, False
    # Longest frame in seconds. Times are in 31 bits, ffmpeg takes less than 20,000 a second for slow movies, and a
    # frame may be shown two frames after it is decoded.
    longest = 2**31 / 20_000 / 2

    def __init__(self, path: Path, width: int, height: int, fps: float):
        source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", repr(fps), "-i", "-"]
        codec = ["-c:v", "libx264", "-crf", str(QUALITY), "-pix_fmt", "yuv420p", "-threads", str(THREADS)]
        result = ["-movflags", "+faststart", "-f", "mp4", str(path)]
        options = ["-loglevel", "error", "-nostdin", "-y", *source, "-vf", COLOR, *codec, *BIT_EXACT, *result]
        self.log = tempfile.TemporaryFile()  # noqa: SIM115 - close() closes it
        # In a session of its own, because Ctrl-C in a terminal goes to all processes of a session, and the movie of the
        # frames so far is to be completed.
        self.process = subprocess.Popen(
            [_ffmpeg(), *options], stdin=subprocess.PIPE, stderr=self.log, start_new_session=True
        )

    @staticmethod
    def check(path: Path, fps: float) -> None:
        """Raises a UserError if ffmpeg is not there."""
        try:
            _ffmpeg()
        except UserError as error:
            raise UserError(f"{path}: {error}") from None

    def add(self, pixels: np.ndarray) -> None:
        """Adds a frame. Shape: uint8 (H, W, 3)."""
        try:
            self.process.stdin.write(np.ascontiguousarray(pixels).data)
        except BrokenPipeError:
            self._fail()

    def finish(self) -> None:
        """Completes the file."""
        try:
            self.process.stdin.close()
        except BrokenPipeError:
            self._fail()
        if self.process.wait():
            self._fail()

    def close(self) -> None:
        """Ends ffmpeg, whether the file is complete or not."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        with suppress(BrokenPipeError):
            self.process.stdin.close()
        self.log.close()

    def _fail(self) -> None:
        """Raises an OSError with the reason why ffmpeg has ended."""
        code = self.process.wait()
        self.log.seek(0)
        said = self.log.read().decode(errors="replace").strip()
        if FULL_DISK in said:
            raise OSError(errno.ENOSPC, FULL_DISK)
        if TOO_LARGE and code == -TOO_LARGE:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        raise OSError(errno.EIO, f"ffmpeg says: {said.splitlines()[-1]}" if said else f"ffmpeg ended with code {code}")
