"""Durations of passes, and how long the next pass should be. A pass takes some samples for the pixels of a film.

Python traces each pass once, that is, records its operations for the kernel. This must take a small share of the pass's
time, so a pass must not be short. Ctrl-C waits for a pass to end, so a pass must not be long.
"""

import threading
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

import drjit as dr

from visray import clock

# A pass should run PASS_SECONDS, or RUN_PER_TRACE times as long as its tracing takes, whichever is longer. But a user
# waits for its end after Ctrl-C: at most LONGEST_PASS, or twice its tracing if that is longer.
PASS_SECONDS, RUN_PER_TRACE, LONGEST_PASS = 0.5, 8, 1.5
# A pass takes at most this many times the samples of the pass that was measured.
GROWTH = 64
# A pass is planned for at most this share of the seconds left, because its samples may take longer than those before.
SAFE_SHARE = 0.5
# Dr.Jit has one history of kernels for the whole process. A thread that records its kernels holds this lock, so that
# another thread neither clears the history nor adds to it. Kernels use all cores anyway.
HISTORY = threading.Lock()


@dataclass
class PassTimer:
    """Measured durations of passes.

    trace_seconds: seconds that tracing a pass takes
    sample_seconds: seconds that one sample of one pixel takes; None before the first measurement
    timed_samples: number of samples in the pass that `sample_seconds` was measured on, over all pixels
    compile_seconds: seconds that compiling the kernels of all passes took
    """

    trace_seconds: float = 0.0
    sample_seconds: float | None = None
    timed_samples: int = 0
    compile_seconds: float = 0.0

    def evaluate(self, begun: float, samples: int, moments: Any) -> float:
        """Computes the moments of one pass, and records how long tracing and running took. Compiling counts as neither.
        Returns the seconds that the pass ran.

        begun: when tracing began (clock.now)
        samples: number of samples in the pass, over all pixels
        moments: the pass's result, traced but not yet computed
        """
        self.trace_seconds = clock.now() - begun
        evaluated = clock.now()
        ran = timed_eval(moments)
        self.compile_seconds += max(clock.now() - evaluated - ran, 0.0)
        # A much smaller pass is not measured, because other costs than its samples dominate there.
        if self.sample_seconds is None or 4 * samples >= self.timed_samples:
            self.sample_seconds, self.timed_samples = ran / samples, samples
        return ran

    def predicted_seconds(self, samples: float) -> float:
        """Seconds that a pass of this many samples will take. Domain: after a first pass."""
        return self.trace_seconds + samples * self.sample_seconds

    def next_seconds(self, left: float = inf) -> float:
        """Seconds that the next pass should run; 0 if the time left is too short for a pass that is worth tracing.

        left: seconds left for all further passes; inf if there is no limit
        """
        if left < 2 * self.trace_seconds or left <= 0:
            return 0.0
        seconds = min(max(PASS_SECONDS, RUN_PER_TRACE * self.trace_seconds), max(LONGEST_PASS, 2 * self.trace_seconds))
        return min(seconds, SAFE_SHARE * (left - self.trace_seconds))

    def next_samples(self) -> float:
        """Number of samples that the next pass should take, over all pixels. Domain: after a first pass."""
        return min(
            self.next_seconds() / self.sample_seconds if self.sample_seconds else inf, GROWTH * self.timed_samples
        )


class Compilations:
    """Counts the kernels that are new to this process, whether they are compiled or come from a cache on the disk. A
    context manager: only kernels in its block are counted. One at a time may be used.

    count: number of new kernels so far
    seconds: running time of all kernels so far
    """

    current: ClassVar["Compilations | None"] = None

    def __init__(self) -> None:
        self.count, self.seconds = 0, 0.0
        self.flag = dr.scoped_set_flag(dr.JitFlag.KernelHistory)

    def __enter__(self) -> "Compilations":
        Compilations.current = self
        self.flag.__enter__()
        dr.kernel_history_clear()
        return self

    def __exit__(self, *error: Any) -> None:
        self.read()
        self.flag.__exit__(*error)
        Compilations.current = None

    def read(self) -> list[dict[str, Any]]:
        """Counts the kernels that ran since the last call, and returns their entries of Dr.Jit's history."""
        kernels = dr.kernel_history([dr.KernelType.JIT])
        self.count += sum(not k["cache_hit"] or k["cache_disk"] for k in kernels)
        self.seconds += clock.kernel_seconds(kernels)
        return kernels


def timed_eval(arrays: Any) -> float:
    """Computes arrays, and returns the seconds that their kernels ran.

    Kernels may already run inside dr.eval, together with compilation. Only Dr.Jit's own history of kernels can separate
    the two. If the caller already records this history, the result includes compilation.
    """
    log = Compilations.current
    if log is None and dr.flag(dr.JitFlag.KernelHistory):
        # Reading the history clears it, and the caller who records it would lose it.
        return _wall_seconds(arrays)
    with HISTORY, dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        if log is not None:
            log.read()
        dr.kernel_history_clear()
        passed = _wall_seconds(arrays)
        kernels = dr.kernel_history() if log is None else log.read()
    # If other code of the process has read the history meanwhile, it is empty.
    return clock.kernel_seconds(kernels) if kernels else passed


def _wall_seconds(arrays: Any) -> float:
    """Computes arrays, and returns the seconds that passed."""
    begun = clock.now()
    dr.eval(arrays)
    dr.sync_thread()
    return clock.now() - begun
