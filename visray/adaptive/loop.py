"""The loop of adaptive sampling: pilot, allocation and rounds of samples, until the error or the time is reached.

The pilot takes the same number of samples of each pixel, in both halves of the dual buffer (dual_buffer.py). The
variance around a pixel in the pilot determines the pixel's share of all further samples (allocation.py). Then the
budget, one number for the whole picture, rises in rounds until the error is reached or the time is used up.

The samples of a pixel influence the number of its samples only through the budget, which depends on all pixels equally.
The bias of the picture by this influence is of order 1 / number of pixels. There is no other bias.

Samples are Owen-scrambled Sobol points, and sample counts are powers of two, because the first 2^k points of such a
sequence are stratified for each k.

If a picture is rendered to a given error, it has the same bits in each run, with any number of threads: all decisions
depend on the samples, and only the seconds of the forecast depend on the clock. If it is rendered in a given time or
until Ctrl-C, the number of samples depends on the machine, and pictures differ from run to run. Even then, a pixel with
the same number of samples has the same bits (tests/test_same_bits.py).

A lane is one pixel in one half of the dual buffer.
"""

import warnings
from collections.abc import Callable
from dataclasses import astuple, replace

import numpy as np

from visray import clock
from visray.adaptive.allocation import Allocation
from visray.adaptive.depth_bias import DepthBias
from visray.adaptive.error_floor import Files, Floor, checked_floor, file_rounding
from visray.adaptive.evidence import Evidence
from visray.adaptive.journal import Journal
from visray.adaptive.planning import Forecast, Planner
from visray.adaptive.stopping import Goal
from visray.errors import GoalWarning
from visray.passes import first_pass_samples
from visray.progress import Bar, Interrupts
from visray.setup import Prepared

# The pilot takes at most PILOT_SHARE of all samples, and from SHORTEST_PILOT to LONGEST_PILOT samples of each lane.
PILOT_SHARE, SHORTEST_PILOT, LONGEST_PILOT = 1 / 8, 4, 64
# After Ctrl-C the first samples are finished if this takes at most so many seconds. Otherwise there is no picture.
FINISHING_SECONDS = 2.0


class AdaptiveRun:
    """One adaptive render.

    goal: the error and the time that are asked for.
    interrupts: whether Ctrl-C was pressed.
    bar: the progress bar.
    report: function that is called with the forecast.
    journal: the results that it decides by.
    evidence: the samples, and what they tell.
    planner: plans further samples; knows the error floor.
    time_missed: why the time of the goal is too short for any picture; None if it is not.
    """

    def __init__(
        self,
        prepared: Prepared,
        goal: Goal,
        interrupts: Interrupts,
        bar: Bar,
        report: Callable[[Forecast], None],
        journal: Journal,
    ):
        self.journal, self.goal, self.interrupts, self.bar, self.report = journal, goal, interrupts, bar, report
        self.evidence = Evidence(prepared, journal)
        self.planner = Planner(goal, self.evidence, Floor(DepthBias(prepared.scene.settings.depth, 0.0, 0.0, 0.0)))
        self.time_missed: str | None = None
        self.compile_seconds = 0.0

    def run(self, files: Files) -> None:
        """Renders the picture. Raises UserError if the goal cannot be reached.

        files: files that the picture will be written to.
        """
        evidence, goal, planner = self.evidence, self.goal, self.planner
        if goal.seconds is not None:
            self._compile()
        allocation = self._run_pilot()
        if not self.interrupts.requested:
            planner.floor = self._floor(files)
        self._report_forecast(allocation)
        # Without noise, more samples until a time limit would change nothing.
        while not planner.goal_reached() and (goal.error is not None or evidence.estimate.square > 0):
            if not (self._raise_cells() if planner.needs_cells() else self._run_round(allocation, files)):
                return

    def _floor(self, files: Files) -> Floor:
        """The error floor. Raises UserError if the error of the goal cannot be reached."""

        def found() -> tuple[float, ...]:
            buffer, estimate = self.evidence.buffer, self.evidence.estimate
            floor = checked_floor(buffer, estimate, self.goal.error, files, self.goal.seconds_left())
            return *astuple(floor.depth), floor.rounding

        depth, *squares, rounding = self.journal.result(found).tolist()
        return Floor(DepthBias(int(depth), *squares), rounding)

    def _compile(self) -> None:
        """Compiles the kernel before the pilot, so that its time is known. Warns if no time is left then."""
        begun = clock.now()
        self.evidence.buffer.compile()
        self.compile_seconds = clock.now() - begun
        if self.goal.seconds_left() <= 0:
            took = self.goal.seconds_passed() + self.goal.reserve
            self._miss_time(f"loading, compiling and writing alone take {took:.2g} s")

    def _raise_cells(self) -> bool:
        """Takes more samples of the pixels that are cut into cells. Returns whether all of them were taken."""
        complete = self.evidence.buffer.cells.rise(self._seconds_left)
        self.evidence.look()
        return complete

    def _run_round(self, allocation: Allocation, files: Files) -> bool:
        """Takes the samples of one round. Returns whether all of them were taken, and another round may follow.

        A round at most doubles the number of samples, or quadruples it while this is quick. Then the error is estimated
        again. With longer rounds, far too many samples are taken if the error falls faster than expected.
        """
        evidence, buffer = self.evidence, self.evidence.buffer
        quick = 3 * buffer.counts.sum() <= first_pass_samples(buffer.prepared)
        targets = np.tile(allocation.targets(self.planner.plan(allocation, 4 if quick else 2)[0]), 2)
        if not (targets > buffer.counts).any():
            return False
        complete = buffer.extend(targets, self._seconds_left)
        if complete and buffer.cells is not None:
            complete = buffer.cells.keep_up(2 * int(buffer.counts.min()), self._seconds_left)
        evidence.look()
        # The rounding error of a file changes as the picture becomes less noisy.
        rounding = float(self.journal.result(lambda: file_rounding(buffer, files)[0]))
        self.planner.floor = replace(self.planner.floor, rounding=rounding)
        if complete:
            allocation.update(evidence.estimate.square - evidence.estimate.cells, buffer.counts[: buffer.n])
            self.bar.total = int(self.planner.end(allocation)[0] * len(buffer.counts))
        return complete

    def _run_pilot(self) -> Allocation:
        """Takes the samples of the pilot, the same number of each pixel. Returns the allocation by their variance."""
        evidence, buffer = self.evidence, self.evidence.buffer
        # Each lane gets these first samples even after Ctrl-C: SHORTEST_PILOT if that is quick, else one.
        quick = SHORTEST_PILOT * len(buffer.counts) <= first_pass_samples(buffer.prepared)
        count = SHORTEST_PILOT if quick and self.goal.seconds is None else 1
        self.bar.total = count * len(buffer.counts)
        buffer.extend(np.full_like(buffer.counts, count), self._seconds_for_first_samples)
        self.interrupts.has_results = True
        if self.goal.seconds is None and count < SHORTEST_PILOT:
            count = SHORTEST_PILOT
            if not buffer.extend(np.full_like(buffer.counts, count), self._seconds_left):
                return evidence.allocation()
        evidence.look_at_small_objects(self._has_time, self._seconds_left)
        while True:
            allocation = evidence.allocation()
            # If time is short, a short pilot is better than none.
            share = PILOT_SHARE if count >= SHORTEST_PILOT else 1 / 2
            dark = evidence.estimate.luminance == 0
            done = self.planner.goal_reached() and not dark
            if count >= LONGEST_PILOT or done or self._takes_more(len(buffer.counts) * count, share):
                return allocation
            longest = LONGEST_PILOT if dark else 2 * count
            if count >= SHORTEST_PILOT and not dark:
                _, mean, _ = self.planner.plan(allocation, np.inf)
                longest = min(PILOT_SHARE * mean, LONGEST_PILOT)
            if longest < 2 * count:
                return allocation
            while 2 * count <= longest:
                count *= 2
            targets = np.full_like(buffer.counts, count)
            if self.goal.seconds is not None:
                # Noisy pixels are in separate passes, so that the duration of their samples is measured. It is longer
                # than for other pixels, and most of the later samples will be in noisy pixels.
                noisy = np.tile(allocation.noisy(), 2)
                if not buffer.extend(np.where(noisy, targets, buffer.counts), self._seconds_left):
                    return evidence.allocation()
            if not buffer.extend(targets, self._seconds_left):
                return evidence.allocation()

    def _takes_more(self, samples: int, share: float) -> bool:
        """Whether samples take more than a share of the time left."""
        if self.goal.seconds is None:
            return False
        return self.evidence.buffer.pace.predicted_seconds(samples) > share * self.goal.seconds_left()

    def _seconds_for_first_samples(self) -> float:
        """Seconds that a pass of the first samples may take: infinite, because without these there is no picture.

        Raises KeyboardInterrupt if they would take too long after Ctrl-C.
        """
        buffer, goal = self.evidence.buffer, self.goal
        self.bar.update(int(buffer.counts.sum()))
        needed = np.count_nonzero(buffer.counts == 0) * (buffer.pace.sample_seconds or 0.0)
        if self.interrupts.requested and needed > FINISHING_SECONDS:
            # There is no complete picture yet to keep.
            self.journal.end(finished=False)
            raise KeyboardInterrupt(*["stopped before there was a picture"] * self.journal.is_kept)
        if needed > goal.seconds_left():
            took = goal.seconds_passed() + needed + goal.reserve
            self._miss_time(f"two samples of each pixel alone take about {took:.2g} s")
        return np.inf

    def _miss_time(self, cause: str) -> None:
        """Warns, once and as soon as it is known, that the time of the goal is too short for any picture. The picture
        then gets the fewest samples that it can have.

        cause: what takes longer than the time.
        """
        if self.time_missed is None:
            self.time_missed = cause
            text = f"time = {self.goal.seconds:g}: {cause}; the picture gets the fewest samples possible, 2 per pixel"
            warnings.warn(text, GoalWarning, stacklevel=7)

    def _seconds_left(self) -> float:
        """Seconds left for another pass; 0 after Ctrl-C. Updates the progress bar too."""
        self.bar.update(int(self.evidence.buffer.counts.sum()))
        return 0.0 if self.interrupts.requested else self.goal.seconds_left()

    def _has_time(self) -> bool:
        """Whether there is time to compile another kernel, which takes about as long as that of the pixels."""
        return self._seconds_left() > 2 * self.compile_seconds

    def _report_forecast(self, allocation: Allocation) -> None:
        """Reports the forecast, and shows in the progress bar how many samples are expected."""
        is_limit = self.goal.seconds is not None and self.time_missed is None
        limit = self.goal.seconds if is_limit else np.inf
        forecast = Forecast(*self.journal.result(lambda: astuple(self.planner.forecast(allocation, limit))).tolist())
        self.bar.total = int(forecast.spp / 2 * len(self.evidence.buffer.counts))
        self.report(forecast)
