"""Small pictures whose kernels are timed, and kernels that are in no cache."""

import secrets
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray import clock
from visray.pass_timer import HISTORY
from visray.passes import empty_film, exposed_once
from visray.quantities import Arrays
from visray.setup import Prepared

LONGEST_SIDE = 256  # pixels of the longer side of the film


def new_mark() -> int:
    """A random number that no kernel has contained before. It is larger than the number of any column of pixels."""
    return 2**31 + secrets.randbelow(2**31)


def marked_columns(a: Arrays, x: Any, mark: int) -> Any:
    """The columns x of pixels, unchanged, but computed by code that contains the mark."""
    # No column is equal to the mark (new_mark).
    return dr.select(x == a.U(mark), 0, x)


@dataclass(frozen=True)
class TimedPicture:
    """A prepared scene whose kernels are timed."""

    prepared: Prepared

    def kernels(self) -> list[dict[str, Any]]:
        """Renders the picture in one pass. Returns Dr.Jit's records of the kernels, a list of dicts."""
        film = empty_film(self.prepared)
        with HISTORY, dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            exposed_once(self.to_trace(), film, self.prepared.scene.settings.spp)
            return dr.kernel_history([dr.KernelType.JIT])

    def to_trace(self) -> Prepared:
        """The prepared scene as a kernel is traced from it."""
        return self.prepared

    def seconds(self) -> float:
        """Seconds that the kernels run in one rendering."""
        return clock.kernel_seconds(self.kernels())


@dataclass(frozen=True)
class UncachedPicture(TimedPicture):
    """A prepared scene whose kernel is in no cache before it is rendered.

    mark: a number that only the kernel of this picture contains
    """

    mark: int

    @staticmethod
    def of(prepared: Prepared) -> "UncachedPicture":
        return UncachedPicture(prepared, new_mark())

    def to_trace(self) -> Prepared:
        """The prepared scene, with columns of pixels that are marked. They are marked again in each call: if marked
        columns were stored, Dr.Jit would trace the next kernel in another order."""
        return replace(self.prepared, x=marked_columns(self.prepared.a, self.prepared.x, self.mark))

    def compiled(self) -> tuple[int, float]:
        """Renders the picture. Returns the number of operations and the compile seconds of its largest kernel.

        Domain: the first rendering, before the kernel is in a cache.
        """
        k = max(self.kernels(), key=lambda k: k["operation_count"])
        return k["operation_count"], (k["codegen_time"] + k["backend_time"]) / 1e3


def reduced_size(width: int, height: int, longest: int = LONGEST_SIDE) -> tuple[int, int]:
    """Width and height of a film, scaled down so that the longer side has at most `longest` pixels."""
    scale = longest / max(width, height, longest)
    return max(1, round(width * scale)), max(1, round(height * scale))
