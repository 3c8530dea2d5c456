"""Checkpoints: files that keep the samples of an unfinished picture, so that a crash, or any other end of the process,
loses no more than the last half minute.

A checkpoint is written aside and renamed, so there is always a whole one. It is removed when its picture is finished.
While a process uses a checkpoint it holds a lock, which the operating system frees however the process ends.
"""

import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from visray import clock
from visray.array_file import opened_arrays, write_arrays
from visray.errors import CheckpointWarning, UserError
from visray.film import Film
from visray.output.files import check_writable
from visray.output.lock import locked
from visray.picture_identity import ANOTHER_SCENE, PictureIdentity, raster_of
from visray.quantities import Arrays

# Seconds between two writings, and the largest share of the time that they may take: a large film takes seconds.
EVERY, LARGEST_SHARE = 30.0, 0.05
# What is asked of a picture if its checkpoint holds a film alone.
SAMPLES = {"goal": "a number of samples"}


class StaleCheckpoint(UserError):
    """A checkpoint with which a picture cannot go on: it is of another one, or is damaged."""


class Checkpoint:
    """The file that keeps the samples of one picture, and its lock; a context manager.

    with Checkpoint(path, resume=True) as checkpoint:
        film = checkpoint.film(prepared.a, identity)
        film, spp = expose(prepared, film=film, keep=checkpoint.keep)
        ...  # the picture is written
        checkpoint.done()

    At the end of the block the file is removed if the picture is done and nothing was raised.

    path: the file
    resume: whether a picture is continued. If not, a file that exists is an error, so that no samples are lost.
    every: least seconds between two writings
    moment: the moment of an animated scene that the picture shows, in seconds; None for others
    found: samples per pixel that the file had when the picture went on; None if it began anew
    due: the moment of the next writing (clock.now)
    """

    every: ClassVar[float] = EVERY

    def __init__(self, path: str | os.PathLike[str], resume: bool = False):
        self.path, self.resume = Path(path), resume
        self.moment: float | None = None
        self.found: float | None = None
        self.due, self.is_done, self.has_failed = 0.0, False, False
        self.held = ExitStack()

    def __enter__(self) -> "Checkpoint":
        check_writable(self.path)
        with ExitStack() as stack:
            stack.enter_context(locked(self.path))
            if self.path.exists() and not self.resume:
                raise UserError(f"{self.path}: is there already; go on with --resume (resume=True), or delete it first")
            self.held = stack.pop_all()
        self.due = clock.now() + self.every
        return self

    def __exit__(self, error: type | None, *_: object) -> None:
        if error is None and self.is_done:
            self.path.unlink(missing_ok=True)
        self.held.close()

    @contextmanager
    def opened(self, identity: PictureIdentity, goal: dict[str, Any]) -> Iterator[Mapping[str, np.ndarray] | None]:
        """Yields the arrays in the file, to be read in a `with` block; None, with a warning, if there is no file.
        Raises UserError if the file is of another picture or goal, or is no checkpoint.

        goal: what is asked of the picture, by name
        """
        if not self.path.exists():
            if self.resume:
                text = f"{self.path}: is not there, so the picture begins anew"
                warnings.warn(text, CheckpointWarning, stacklevel=6)
            yield None
            return
        refusal = "is no checkpoint of visray, or is damaged; delete it to begin anew"
        with _refusals_are_stale(), opened_arrays(self.path, refusal) as (arrays, facts):
            asked = PictureIdentity(facts=_facts(identity, goal))
            if difference := asked.difference(PictureIdentity(facts=facts)):
                if difference == ANOTHER_SCENE and facts.get("moment", self.moment) != self.moment:
                    difference = f"is of the moment {facts['moment']} s, not {self.moment} s"
                raise UserError(
                    f"{self.path}: {difference}; ask for what it was begun with, or delete it to begin anew"
                )
            width, height = raster_of(facts)
            counts = [arrays[name].sum(dtype=float) for name in arrays if name.split(".")[-1] == "counts"]
            self.found = float(sum(counts) / (width * height))
            yield arrays

    def film(self, a: Arrays, identity: PictureIdentity, spp: int | None = None) -> Film | None:
        """The film to go on with; None if there is none. Raises UserError if the file holds something else.

        spp: number of samples that each pixel will have; an error if the film has more already
        """
        with self.opened(identity, SAMPLES) as arrays:
            film = None if arrays is None else Film.of_arrays(a, arrays, identity)
        if film is not None and spp is not None and (most := int(film.counts.max())) > spp:
            text = f"{self.path}: has {most} samples of a pixel, more than {spp}; ask for {most} or more"
            raise StaleCheckpoint(text)
        return film

    def keep(self, film: Film, now: bool = False) -> None:
        """Writes the film to the file, unless that was less than `every` seconds ago.

        now: whether it is written in any case
        """
        self.write(film.identity, SAMPLES, film.arrays, now)

    def write(
        self, identity: PictureIdentity, goal: dict[str, Any], arrays: Callable[[], Mapping[str, np.ndarray]], now: bool
    ) -> None:
        """Writes arrays to the file, unless that was less than `every` seconds ago. If they cannot be written, for
        example because the disk is full, the old file stays, and a warning says so once.

        arrays: function that returns the arrays. identity, goal, now: as for `opened` and `keep`.
        """
        if not now and clock.now() < self.due:
            return
        begun = clock.now()
        try:
            write_arrays(self.path, arrays(), _facts(identity, goal) | {"moment": self.moment})
        except UserError as error:
            if not self.has_failed:
                text = f"{error}; the render goes on, and a crash loses what came after the last checkpoint"
                warnings.warn(text, CheckpointWarning, stacklevel=2)
            self.has_failed = True
        self.due = clock.now() + max(self.every, (clock.now() - begun) / LARGEST_SHARE)

    def end(self, film: Film, finished: bool) -> None:
        """Keeps the film of a picture that was stopped, or removes the file of one that is finished."""
        if finished:
            self.done()
            return
        self.keep(film, now=True)
        self.say_how_to_go_on()

    def say_how_to_go_on(self) -> None:
        """Says that the picture was stopped, and how it is continued."""
        if self.path.exists():
            warnings.warn(
                f"{self.path}: keeps the samples; --resume goes on with them", CheckpointWarning, stacklevel=2
            )

    def done(self) -> None:
        """The picture is finished. At the end of the block, the file is removed."""
        self.is_done = True


@contextmanager
def _refusals_are_stale() -> Iterator[None]:
    """Makes a UserError in a `with` block a StaleCheckpoint."""
    try:
        yield
    except UserError as error:
        raise StaleCheckpoint(*error.lines) from error.__cause__


def set_aside(path: Path, stale: StaleCheckpoint) -> None:
    """Renames a checkpoint with which a picture cannot go on, so that the picture begins anew, and says so."""
    kept = path.with_name(f"{path.name}.old")
    os.replace(path, kept)
    problem = str(stale).partition(";")[0]
    text = f"{problem}; it is kept as {kept.name}, and the picture begins anew"
    warnings.warn(text, CheckpointWarning, stacklevel=3)


def _facts(identity: PictureIdentity, goal: dict[str, Any]) -> dict[str, Any]:
    """The facts of a checkpoint. Those that differ most come first: the version of visray, and the goal."""
    return {"visray": identity.facts["visray"]} | goal | identity.facts


def held(checkpoint: str | Path | Checkpoint | None, resume: bool = False) -> AbstractContextManager[Checkpoint | None]:
    """A context manager that holds a checkpoint for a render. A Checkpoint stays with the caller, who holds it.

    checkpoint: path of the file; None for none. resume: whether a picture is continued.
    """
    if checkpoint is None or isinstance(checkpoint, Checkpoint):
        return nullcontext(checkpoint)
    return Checkpoint(checkpoint, resume)
