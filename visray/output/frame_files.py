"""The files of an animation: sequences of pictures, movies, or both."""

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.output import png
from visray.output.curves import Gamma
from visray.output.files import check_place
from visray.output.image import Image, check_destination
from visray.output.lock import locked
from visray.output.movie import Movie, check_movie, is_movie, movie, seconds_of
from visray.output.sequence import FOLDER_HASHES, frame_file, patterns
from visray.output.up_to_date import MISSING, Wanted, outdated


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
        for path in (*sequences, *movies):
            if (*sequences, *movies).count(path) > 1:
                raise UserError(f"{path}: is an output twice; name each output once")
        return FrameFiles(sequences, movies, **more)

    @property
    def outputs(self) -> list[Path]:
        """Patterns of files, and movies."""
        return [*self.sequences, *self.movies]

    @property
    def are_kept(self) -> bool:
        """Whether a movie can be made again from files, or there is none."""
        return not self.movies or any(map(_is_png, self.sequences))

    def paths(self, number: int) -> list[Path]:
        """The files of a frame, without movies."""
        return [frame_file(pattern, number) for pattern in self.sequences]

    def check(self, numbers: Sequence[int]) -> None:
        """Makes the folders of the files. Raises UserError if a file of the frames with these numbers cannot be
        written."""
        for path in self.movies:
            check_movie(path, self.fps)
        for path in self.paths(numbers[0]):
            _make_folder(path.parent)
            check_destination(path, self.gamma, self.exposure)
        for path in (path for number in numbers for path in self.paths(number)):
            check_place(path)

    def existing(self, numbers: Sequence[int]) -> list[Path]:
        """Those movies, and those files of the frames with these numbers, that exist."""
        files = [*self.movies, *(path for number in numbers for path in self.paths(number))]
        return [path for path in files if path.exists()]

    def check_movies(self, numbers: Sequence[int]) -> None:
        """Raises UserError if a movie exists that would lose frames by being written again: because none of its frames
        is kept, or because it is longer. numbers: the frames that it would have."""
        lasts = len(numbers) / self.fps
        is_kept = any(_is_png(path) and path.exists() for number in numbers for path in self.paths(number))
        for path in filter(Path.exists, self.movies):
            if not is_kept:
                raise UserError(f"{path}: exists already, and none of its frames is kept; --overwrite renders it anew")
            if (found := seconds_of(path)) > lasts + 0.5 / self.fps:
                problem = f"lasts {found:g} s, and {lasts:g} s of it would be left"
                raise UserError(f"{path}: {problem}; choose all of its frames, write to another file, or --overwrite")

    def outdated(self, number: int, wanted: Wanted) -> str | None:
        """Why a frame must be rendered: MISSING, or what its files are in place of what is wanted. None if all of them
        are up to date."""
        wanted = replace(wanted, curve={"gamma": self.gamma, "exposure": self.exposure}, float32=self.float32)
        found = [outdated(path, wanted) for path in self.paths(number)] or [MISSING]
        return next((x for x in found if x not in (None, MISSING)), MISSING if MISSING in found else None)

    @contextmanager
    def opened(self, numbers: Sequence[int]) -> Iterator["FrameWriter"]:
        """Yields what writes the frames in a `with` block. Until its end, other processes cannot write them.

        numbers: the frames of the movies, in their order.
        """
        with ExitStack() as stack:
            for path in self.outputs:
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
