"""How long passes over a film take, and how long they should: tracing in Python, which each does once, must be little
of it, and Ctrl-C must not wait long."""

import time
from dataclasses import dataclass
from math import inf
from typing import Any

import drjit as dr

# A pass should run so many seconds, or so many times as long as it is traced, whichever is more.
PASS_SECONDS, TRACED = 0.5, 8
# A pass has at most so many times the samples of the one that told how long they take.
GROWTH = 64
# Of the time that is left a pass may take such a share: samples are not alike.
SURE = 0.85


@dataclass
class Pace:
    """Seconds of tracing, which each pass does once, and of a sample, once one is known; told by so many samples."""

    tracing: float = 0.0
    rate: float | None = None
    told_by: int = 0

    def evaluated(self, begun: float, samples: int, film: Any) -> None:
        """Computes a film with so many more samples, which was traced since `begun` (time.perf_counter), and takes in
        how long both took. What compiles in between is neither."""
        traced = time.perf_counter()
        dr.eval(film)
        launched = time.perf_counter()
        dr.sync_thread()
        # What takes a small pass long is not its samples.
        if self.rate is None or 4 * samples >= self.room():
            self.rate, self.told_by = (time.perf_counter() - launched) / samples, samples
        self.tracing = traced - begun

    def seconds(self, samples: float) -> float:
        """Of a pass of so many samples. Domain: one was made."""
        return self.tracing + samples * self.rate

    def room(self, left: float = inf) -> float:
        """How many samples the next pass should have; 0 where too few of these seconds are left for one worth tracing.
        Domain: one was made."""
        if left < 2 * self.tracing:
            return 0.0
        seconds = min(max(PASS_SECONDS, TRACED * self.tracing), SURE * (left - self.tracing))
        return max(min(seconds / self.rate if self.rate else inf, GROWTH * self.told_by), 0.0)
