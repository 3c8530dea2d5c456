"""The files of an animation: sequences of pictures, movies, or both."""

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.output import exr, png
from visray.output.curves import Gamma
from visray.output.image import Image, check_destination
from visray.output.layers import BY_NAME
from visray.output.lock import locked
from visray.output.movie import Movie, check_movie, is_movie, movie
from visray.output.sequence import FOLDER_HASHES, frame_file, patterns

# Layers that are in every picture for which they are asked.
ALWAYS = ("film", "first hit")


@dataclass(frozen=True)
class FrameFiles:
    """Where the frames of an animation are written to.

    sequences: patterns of files.
    movies: files of movies.
    fps: frames per second of the movies.
    gamma, exposure: display curve and exposure in stops of PNG files and movies.
    float32: whether colours of EXR files are float.
    """

    sequences: tuple[Path, ...]
    movies: tuple[Path, ...]
    fps: float
    gamma: Gamma = "srgb"
    exposure: float = 0.0
    float32: bool = False

    @staticmethod
    def of(outputs: Sequence[Path], stem: str, keeps: bool, **more: Any) -> "FrameFiles":
        """The files for outputs as they are written on the command line.

        stem: beginning of the names of files in a folder.
        keeps: whether the frames of movies are kept as PNG files, in a folder beside the first movie.
        more: all other fields.
        """
        movies = tuple(path for path in outputs if is_movie(path) and not path.is_dir())
        sequences = tuple(x for path in outputs if path not in movies for x in patterns(path, stem))
        if keeps and movies and not any(map(_is_png, sequences)):
            folder = movies[0].with_name(f"{movies[0].name}.frames")
            sequences = (*sequences, folder / f"{stem}.{FOLDER_HASHES}.png")
        return FrameFiles(sequences, movies, **more)

    def paths(self, number: int) -> list[Path]:
        """The files of a frame, without movies."""
        return [frame_file(pattern, number) for pattern in self.sequences]

    def check(self, number: int) -> None:
        """Makes the folders of the files. Raises UserError if the files cannot be written. number: of any frame."""
        for path in self.movies:
            check_movie(path, self.fps)
        for path in self.paths(number):
            _make_folder(path.parent)
            check_destination(path, self.gamma, self.exposure)

    def existing(self, numbers: Sequence[int]) -> list[Path]:
        """Those files of the frames with these numbers that exist."""
        return [path for number in numbers for path in self.paths(number) if path.exists()]

    def are_made(self, number: int, facts: dict[str, Any], layers: Sequence[str]) -> bool:
        """Whether all files of a frame exist and are up to date.

        facts: what their metadata must say; None for what they must not have.
        layers: names of the layers that EXR files must have.
        """
        return bool(self.sequences) and all(self._is_made(path, facts, layers) for path in self.paths(number))

    def _is_made(self, path: Path, facts: dict[str, Any], layers: Sequence[str]) -> bool:
        """Whether a file of a frame exists and is up to date."""
        if not path.exists():
            return False
        try:
            if _is_png(path):
                found = png.read_facts(path)
                wanted = facts | {"gamma": self.gamma, "exposure": self.exposure}
                return all(found.get(k) == (None if v is None else png.as_text(v)) for k, v in wanted.items())
            found, channels = exr.read_facts(path)
        except UserError:
            return False
        wanted = facts | {"float32": 1 if self.float32 else None}
        asked = (BY_NAME[name] for name in layers)
        needed = {c for layer in asked if layer.source in ALWAYS and layer.name != "variance" for c in layer.channels}
        return all(found.get(key) == value for key, value in wanted.items()) and needed <= channels

    @contextmanager
    def opened(self, numbers: Sequence[int]) -> Iterator["FrameWriter"]:
        """Yields what writes the frames in a `with` block. Until its end, other processes cannot write them.

        numbers: the frames of the movies, in their order.
        """
        with ExitStack() as stack:
            for path in (*self.sequences, *self.movies):
                stack.enter_context(locked(path))
            movies = [stack.enter_context(movie(path, self.fps)) for path in self.movies]
            yield FrameWriter(self, movies, list(numbers))


class FrameWriter:
    """Writes frames. Movies get them in their order, whatever the order in which they come.

    has_frames: whether there is a frame to keep: in each movie, or in files.
    waiting: for frames whose turn in the movies has not come, their pixels; None if their PNG file has them.
    """

    def __init__(self, files: FrameFiles, movies: list[Movie], numbers: list[int]):
        self.files, self.movies, self.left = files, movies, numbers[::-1]
        self.waiting: dict[int, np.ndarray | None] = {}
        self.has_frames = False

    def write(self, number: int, image: Image) -> None:
        """Writes a frame."""
        files = self.files
        for path in files.paths(number):
            image.write(path, files.gamma, files.exposure, float32=files.float32)
        self._add(number, image.display(files.gamma, files.exposure) if self.movies else None)

    def keep(self, number: int) -> None:
        """Takes a frame whose files are made already."""
        self._add(number, None)

    def _add(self, number: int, pixels: np.ndarray | None) -> None:
        """Gives a frame to the movies when its turn comes."""
        if not self.movies:
            self.has_frames = True
            return
        self.waiting[number] = pixels
        while self.left and self.left[-1] in self.waiting:
            number = self.left.pop()
            pixels = self.waiting.pop(number)
            if pixels is None:
                pixels = png.read_png(next(filter(_is_png, self.files.paths(number))))
            for one in self.movies:
                one.add(pixels)
            self.has_frames = True


def _is_png(path: Path) -> bool:
    """Whether a file is a PNG file, by its name."""
    return path.suffix.lower() == ".png"


def _make_folder(folder: Path) -> None:
    """Makes a folder, unless it is there. Its own folder must exist."""
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{os.fspath(folder)}: is a file, not a folder; give another name")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(f"{os.fspath(folder)}: cannot be made, {error.strerror}; make the folder first") from error
