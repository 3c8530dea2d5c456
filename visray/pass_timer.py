"""How long passes over a film take, and how long they should: tracing in Python, which each does once, must be little
of it, and Ctrl-C must not wait long."""

from dataclasses import dataclass
from math import inf
from typing import Any

import drjit as dr

from visray import clock

# A pass should run so many seconds, or so many times as long as it is traced, whichever is more.
PASS_SECONDS, TRACED = 0.5, 8
# A pass has at most so many times the samples of the one that told how long they take.
GROWTH = 64
# Of the seconds that are left a pass may take such a share: its samples may be dearer than those before.
SURE = 0.5


@dataclass
class PassTimer:
    """Seconds of tracing, which each pass does once, and of a sample, once one is known; told by so many samples."""

    trace_seconds: float = 0.0
    sample_seconds: float | None = None
    timed_samples: int = 0

    def evaluate(self, begun: float, samples: int, moments: Any) -> float:
        """Computes the moments of so many more samples, traced since `begun` (clock.now), and takes in
        how long both took. What compiles in between is neither. Returns the seconds that it ran."""
        self.trace_seconds = clock.now() - begun
        ran = timed_eval(moments)
        # What takes a small pass long is not its samples.
        if self.sample_seconds is None or 4 * samples >= self.timed_samples:
            self.sample_seconds, self.timed_samples = ran / samples, samples
        return ran

    def predicted_seconds(self, samples: float) -> float:
        """Of a pass of so many samples. Domain: one was made."""
        return self.trace_seconds + samples * self.sample_seconds

    def next_seconds(self, left: float = inf) -> float:
        """How many seconds the next pass should run; 0 where too few are left for one worth tracing."""
        if left < 2 * self.trace_seconds or left <= 0:
            return 0.0
        return min(max(PASS_SECONDS, TRACED * self.trace_seconds), SURE * (left - self.trace_seconds))

    def next_samples(self) -> float:
        """How many samples the next pass should have. Domain: one was made."""
        return min(
            self.next_seconds() / self.sample_seconds if self.sample_seconds else inf, GROWTH * self.timed_samples
        )


def timed_eval(arrays: Any) -> float:
    """Computes arrays; how many seconds their kernels ran. On one thread they run before dr.eval returns, and small
    ones do on many: so only Dr.Jit can tell that from compiling."""
    listened = dr.flag(dr.JitFlag.KernelHistory)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        if not listened:
            dr.kernel_history_clear()
        begun = clock.now()
        dr.eval(arrays)
        dr.sync_thread()
        if listened:
            # Reading the history would take it from whoever listens.
            return clock.now() - begun
        return clock.kernel_seconds(dr.kernel_history())
