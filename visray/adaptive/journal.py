"""The journal of an adaptive render: the results that it decided by, so that it goes on from a checkpoint to the same
bits.

All decisions follow from the scene and from a few results: estimates of the error, weights of pixels, the error floor.
The journal has them in the order in which they were needed. A render that goes on takes its decisions again: results
come from the journal, and samples are only counted, not taken. Where the journal ends, the films of the checkpoint take
their place, and the render goes on as if it had never stopped.
"""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from visray.checkpoint import Checkpoint
from visray.film import Film
from visray.passes import identity_of
from visray.progress import Interrupts
from visray.setup import Prepared


class Filmed(Protocol):
    """What has a film."""

    film: Film


class Journal:
    """Results of an adaptive render, and the buffers whose films are kept with them.

    results: the results so far, or those of the checkpoint.
    position: number of results that the render has asked for.
    buffers: the buffers by name.
    saved: films of the checkpoint by name, for buffers that do not have them yet.
    """

    def __init__(self, interrupts: Interrupts | None = None) -> None:
        self.interrupts = interrupts or Interrupts()
        self.results: list[np.ndarray] = []
        self.position = 0
        self.buffers: dict[str, Filmed] = {}
        self.saved: dict[str, Film] = {}
        self.checkpoint: Checkpoint | None = None

    @staticmethod
    def of(
        checkpoint: Checkpoint | None, prepared: Prepared, goal: dict[str, Any], interrupts: Interrupts
    ) -> "Journal":
        """The journal in a checkpoint. It is empty if there is no checkpoint, or nothing in it yet. Raises UserError if
        the checkpoint is of another picture or goal.

        goal: what is asked of the picture, by name.
        """
        journal = Journal(interrupts)
        if checkpoint is not None:
            journal.checkpoint, journal.goal = checkpoint, goal
            journal.identity = identity_of(prepared)
            with checkpoint.opened(journal.identity, journal.goal) as arrays:
                journal._read(prepared.a, dict(arrays or {}))
        return journal

    def _read(self, a: Any, arrays: dict[str, np.ndarray]) -> None:
        """Reads the results and the films of a checkpoint."""
        films = {name.split(".")[1] for name in arrays if name.startswith("film.")}
        for film in sorted(films):
            part = {k.removeprefix(f"film.{film}."): x for k, x in arrays.items() if k.startswith(f"film.{film}.")}
            self.saved[film] = Film.of_arrays(a, part, self.identity)
        numbers = sorted(int(name.split(".")[1]) for name in arrays if name.startswith("result."))
        self.results = [arrays[f"result.{number}"] for number in numbers]

    @property
    def replays(self) -> bool:
        """Whether the render takes decisions again that the checkpoint has."""
        return self.position < len(self.results)

    @property
    def is_kept(self) -> bool:
        """Whether there is a checkpoint."""
        return self.checkpoint is not None

    def result(self, compute: Callable[[], Any]) -> np.ndarray:
        """The next result: from the checkpoint, or computed now. compute: function that returns numbers."""
        if self.replays:
            self.position += 1
            return self.results[self.position - 1]
        self.restore()
        result = np.asarray(compute())
        # What is computed after Ctrl-C may be of fewer samples than the render would have taken by then.
        if not self.interrupts.requested:
            self.results.append(result)
            self.position += 1
        return result

    def add(self, name: str, buffer: Filmed) -> None:
        """Adds a buffer, whose film is kept."""
        self.buffers[name] = buffer
        if not self.replays:
            self.restore()

    def restore(self) -> None:
        """Gives the buffers their films of the checkpoint, if they do not have them yet."""
        for name in self.saved.keys() & self.buffers.keys():
            self.buffers[name].film = self.saved.pop(name)

    def keep(self, now: bool = False) -> None:
        """Writes the checkpoint, if there is one, and if it is time. now: whether it is written in any case."""
        if self.is_kept:
            self.checkpoint.write(self.identity, self.goal, self._arrays, now)

    def end(self, finished: bool) -> None:
        """Keeps a render that was stopped, or removes the checkpoint of one that is finished."""
        self.restore()
        if self.is_kept and finished:
            self.checkpoint.done()
        elif self.is_kept:
            self.keep(now=True)
            self.checkpoint.say_how_to_go_on()
        # The buffers know the journal too. Without this cycle, their films are freed at once.
        self.buffers.clear()

    def _arrays(self) -> dict[str, np.ndarray]:
        """All arrays of the checkpoint."""
        films = self.saved | {name: buffer.film for name, buffer in self.buffers.items() if name not in self.saved}
        arrays = {f"film.{name}.{key}": x for name, film in films.items() for key, x in film.arrays().items()}
        return arrays | {f"result.{number}": x for number, x in enumerate(self.results)}
