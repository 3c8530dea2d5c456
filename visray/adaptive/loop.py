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
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from visray import clock, terminal
from visray.adaptive.allocation import LEAST_POWER, POWER, Allocation, neighbour_means
from visray.adaptive.brightness import Brightness
from visray.adaptive.cell_buffer import CellBuffer
from visray.adaptive.depth_bias import DepthBias
from visray.adaptive.dual_buffer import DualBuffer
from visray.adaptive.error_floor import Files, Floor, checked_floor, file_rounding
from visray.adaptive.estimate import Estimate
from visray.adaptive.small_objects import small_objects
from visray.adaptive.stopping import Goal
from visray.data.all_objects import address_of
from visray.errors import GoalWarning
from visray.passes import first_pass_samples
from visray.progress import Bar, Interrupts
from visray.setup import Prepared

# The pilot takes at most PILOT_SHARE of all samples, and from SHORTEST_PILOT to LONGEST_PILOT samples of each lane.
PILOT_SHARE, SHORTEST_PILOT, LONGEST_PILOT = 1 / 8, 4, 64
# After Ctrl-C the first samples are finished if this takes at most so many seconds. Otherwise there is no picture.
FINISHING_SECONDS = 2.0
# Light is hidden if it may be HIDDEN times as bright as the brightest pixels of the picture. Most pictures show a third
# of the greatest brightness that their lights and materials allow. The brightest pixels are a share of the picture, but
# at least and at most so many.
HIDDEN = 3.0
SHARE_OF_BRIGHTEST, FEWEST_BRIGHTEST, MOST_BRIGHTEST = 0.01, 4, 16
# A round aims at this share of the allowed mean square error, so that the error after the round is rarely too large.
MARGIN = 0.98


@dataclass(frozen=True)
class Forecast:
    """Forecast after the pilot.

    spp: mean number of samples of a pixel at the end.
    error: error of the picture at the end.
    seconds: duration of the whole render.
    """

    spp: float
    error: float
    seconds: float

    def text(self) -> str:
        """The forecast as a sentence."""
        return f"forecast: error {self.error:.2g} with {self.spp:.0f} samples per pixel, after {self.seconds:.1f} s"


class NotANumber(Exception):
    """Raised if a pixel is not a number. `mean`: colours of the picture's pixels. Shape: (3, N)."""

    def __init__(self, mean: np.ndarray):
        super().__init__("a pixel is not a number")
        self.mean = mean


class AdaptiveRun:
    """One adaptive render.

    goal: the error and the time that are asked for.
    interrupts: whether Ctrl-C was pressed.
    bar: the progress bar.
    report: function that is called with the forecast.
    buffer: the dual buffer that samples are added to.
    estimate: error that is estimated from the samples so far.
    floor: error that more samples do not reduce.
    pilot_squares: mean square errors in the pilot, as a dict by the number of samples that all lanes had.
    time_missed: why the time of the goal is too short for any picture; None if it is not.
    hidden: brightness of light that samples may have missed, and what it is. The small objects that got no samples of
        their own are part of it.
    """

    def __init__(
        self, prepared: Prepared, goal: Goal, interrupts: Interrupts, bar: Bar, report: Callable[[Forecast], None]
    ):
        self.goal, self.interrupts, self.bar, self.report = goal, interrupts, bar, report
        self.buffer = DualBuffer(prepared)
        self.floor = Floor(DepthBias(prepared.scene.settings.depth, 0.0, 0.0, 0.0))
        self.pilot_squares: dict[int, float] = {}
        self.time_missed: str | None = None
        self.hidden: tuple[float, str] = 0.0, ""
        self.compile_seconds = 0.0

    def run(self, files: Files) -> None:
        """Renders the picture. Raises UserError if the goal cannot be reached.

        files: files that the picture will be written to.
        """
        buffer, goal = self.buffer, self.goal
        if goal.seconds is not None:
            begun = clock.now()
            buffer.compile()
            self.compile_seconds = clock.now() - begun
            if goal.seconds_left() <= 0:
                took = goal.seconds_passed() + goal.reserve
                self._miss_time(f"loading, compiling and writing alone take {took:.2g} s")
        allocation = self._run_pilot()
        if not self.interrupts.requested:
            self.floor = checked_floor(buffer, self.estimate, goal.error, files, goal.seconds_left())
        self._report_forecast(allocation)
        # Without noise, more samples until a time limit would change nothing.
        while not self._goal_reached() and (goal.error is not None or self.estimate.square > 0):
            # A round at most doubles the number of samples, or quadruples it while this is quick. Then the error is
            # estimated again. With longer rounds, far too many samples are taken if the error falls faster than
            # expected.
            if self._needs_cells():
                complete = buffer.cells.rise(self._seconds_left)
                self.estimate = self._checked_estimate()
                if not complete:
                    return
                continue
            quick = 3 * buffer.counts.sum() <= first_pass_samples(buffer.prepared)
            targets = np.tile(allocation.targets(self._plan(allocation, 4 if quick else 2)[0]), 2)
            if not (targets > buffer.counts).any():
                return
            complete = buffer.extend(targets, self._seconds_left)
            if complete and buffer.cells is not None:
                complete = buffer.cells.keep_up(2 * int(buffer.counts.min()), self._seconds_left)
            self.estimate = self._checked_estimate()
            # The rounding error of a file changes as the picture becomes less noisy.
            self.floor = replace(self.floor, rounding=file_rounding(buffer, files)[0])
            if not complete:
                return
            allocation.update(self.estimate.square - self.estimate.cells, buffer.counts[: buffer.n])
            self._expect_end(allocation)

    def _run_pilot(self) -> Allocation:
        """Takes the samples of the pilot, the same number of each pixel. Returns the allocation by their variance."""
        buffer = self.buffer
        # Each lane gets these first samples even after Ctrl-C: SHORTEST_PILOT if that is quick, else one.
        quick = SHORTEST_PILOT * len(buffer.counts) <= first_pass_samples(buffer.prepared)
        count = SHORTEST_PILOT if quick and self.goal.seconds is None else 1
        self.bar.total = count * len(buffer.counts)
        buffer.extend(np.full_like(buffer.counts, count), self._seconds_for_first_samples)
        self.interrupts.has_results = True
        if self.goal.seconds is None and count < SHORTEST_PILOT:
            count = SHORTEST_PILOT
            if not buffer.extend(np.full_like(buffer.counts, count), self._seconds_left):
                return self._new_allocation()
        self._look_at_small_objects()
        while True:
            allocation = self._new_allocation()
            seconds = buffer.pace.predicted_seconds(len(buffer.counts) * count)
            # If time is short, a short pilot is better than none.
            share = PILOT_SHARE if count >= SHORTEST_PILOT else 1 / 2
            dark = self.estimate.luminance == 0
            done = self._goal_reached() and not dark
            if count >= LONGEST_PILOT or done or seconds > share * self.goal.seconds_left():
                return allocation
            longest = LONGEST_PILOT if dark else 2 * count
            if count >= SHORTEST_PILOT and not dark:
                _, mean, _ = self._plan(allocation, np.inf)
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
                    return self._new_allocation()
            if not buffer.extend(targets, self._seconds_left):
                return self._new_allocation()

    def _look_at_small_objects(self) -> None:
        """Gives the pixels that show small objects samples of their own. Small objects that cannot have these are
        hidden light."""
        buffer, prepared = self.buffer, self.buffer.prepared
        cells, brightness = small_objects(prepared), Brightness.of(prepared)
        self.hidden = brightness.hidden, brightness.cause
        names, materials = list(prepared.scene.all_objects), prepared.scene.materials_of_objects()

        def bright(number: int) -> float:
            return max(brightness.objects[name] for name in materials[number])

        missed = list(cells.missed)
        if len(cells.pixels):
            own = CellBuffer(prepared, cells, np.array([bright(k) for k in cells.objects]))
            # The cells have a kernel of their own, which takes about as long to compile as that of the pixels.
            if self._seconds_left() > 2 * self.compile_seconds and own.rise(self._seconds_left):
                buffer.cells = own
            else:
                missed += list(cells.objects)
        if missed:
            brightest = max(missed, key=bright)
            if bright(brightest) > self.hidden[0]:
                self.hidden = bright(brightest), f"{address_of(names[brightest])}, smaller than a pixel"

    def _needs_cells(self) -> bool:
        """Whether the error of the pixels that are cut into cells is too large a part of the picture's error."""
        estimate, cells = self.estimate, self.buffer.cells
        if cells is None or cells.exhausted or not estimate.cells:
            return False
        allowed = 0.0
        if self.goal.error is not None:
            allowed = self.goal.allowed_square(estimate, self.floor.high) / (2 * estimate.factor)
        return estimate.cells > max(estimate.square - estimate.cells, allowed)

    def _seconds_for_first_samples(self) -> float:
        """Seconds that a pass of the first samples may take: infinite, because without these there is no picture.

        Raises KeyboardInterrupt if they would take too long after Ctrl-C.
        """
        buffer, goal = self.buffer, self.goal
        self.bar.update(int(buffer.counts.sum()))
        needed = np.count_nonzero(buffer.counts == 0) * (buffer.pace.sample_seconds or 0.0)
        if self.interrupts.requested and needed > FINISHING_SECONDS:
            # There is no complete picture yet to keep.
            raise KeyboardInterrupt
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
            text = (
                f"time = {self.goal.seconds:g}: {cause}; the picture gets the fewest samples there can be, two a pixel"
            )
            warnings.warn(text, GoalWarning, stacklevel=6)

    def _new_allocation(self) -> Allocation:
        """Allocation by the variance of the samples so far. Updates `estimate` and `pilot_squares` too."""
        buffer, film = self.buffer, self.buffer.prepared.scene.film
        self.estimate = self._checked_estimate()
        order = buffer.prepared.order
        variances = np.ones(film.height * film.width)
        if buffer.counts.min() > 1:
            variances[order] = buffer.variances().reshape(2, -1).sum(0)
        if buffer.counts.min() == buffer.counts.max():
            self.pilot_squares[int(buffer.counts[0])] = self.estimate.square
        # A black picture has no luminance to divide by.
        variances /= np.square(self.estimate.luminance) or 1.0
        known = np.ones(variances.shape, bool)
        if buffer.cells is not None:
            known[order[buffer.cells.lanes]] = False
        shape = film.height, film.width
        nearby = neighbour_means(variances.reshape(shape), known.reshape(shape)).ravel()[order]
        allocation = Allocation.of(nearby, buffer.counts[: buffer.n])
        allocation.update(self.estimate.square - self.estimate.cells, buffer.counts[: buffer.n])
        return allocation

    def _checked_estimate(self) -> Estimate:
        """Estimated error of the samples so far. Raises NotANumber if a pixel is not a number."""
        self.buffer.hidden = 0.0
        if self.hidden[0]:
            brightness = np.sqrt(np.square(self.buffer.mean()).mean(0))
            if self.buffer.cells is not None:
                brightness = np.delete(brightness, self.buffer.cells.lanes)
            k = int(np.clip(SHARE_OF_BRIGHTEST * len(brightness), FEWEST_BRIGHTEST, MOST_BRIGHTEST))
            shown = np.sort(brightness)[-k:][0] if len(brightness) else 0.0
            self.buffer.hidden = self.hidden[0] if self.hidden[0] > HIDDEN * shown else 0.0
        estimate = self.buffer.estimate()
        if not np.isfinite(estimate.square):
            raise NotANumber(self.buffer.mean())
        return estimate

    def _seconds_left(self) -> float:
        """Seconds left for another pass; 0 after Ctrl-C. Updates the progress bar too."""
        self.bar.update(int(self.buffer.counts.sum()))
        return 0.0 if self.interrupts.requested else self.goal.seconds_left()

    def _goal_reached(self) -> bool:
        """Whether the upper end of the picture's error, with the floor, is within the error that is asked for. If no
        error is asked for: whether there is no noise at all."""
        high = np.square(self.estimate.high * self.estimate.luminance)
        return bool(high <= self.goal.allowed_square(self.estimate, self.floor.high))

    def _plan(self, allocation: Allocation, growth: float) -> tuple[int, float, float]:
        """Budget of the next round, and two numbers expected after this round: the mean number of samples of a lane,
        and the mean square error.

        growth: factor by which the round may increase the number of samples.

        The budget is the smallest that reaches the error of the goal, uses up the time of the goal, or increases the
        number of samples by `growth`.
        """
        estimate, counts = self.estimate, self.buffer.counts
        present, fewest = float(counts.mean()), int(counts.min())
        affordable = np.inf
        if self.goal.seconds is not None:
            rate = self._rate(allocation) * len(counts)
            affordable = present + self.goal.seconds_left() / rate if rate > 0 else np.inf
        allowed = MARGIN * self.goal.allowed_square(estimate, self.floor.high)
        sufficient: list[tuple[float, float]] = []
        insufficient: list[tuple[float, float]] = [(present, estimate.square)]

        def enough(mean: float, square: float, least: int) -> bool:
            square += estimate.cells
            high = max(square * estimate.factor, estimate.guard * present / mean)
            high += estimate.unseen * (fewest / least) ** 2
            is_enough = mean >= min(growth * present, affordable) or high <= allowed
            (sufficient if is_enough else insufficient).append((mean, square))
            return is_enough

        budget = allocation.smallest_budget(enough)
        # The last budget that was sufficient is the smallest such budget. If none was, the search returns the largest.
        return budget, *(sufficient[-1] if sufficient else max(insufficient))

    def _rate(self, allocation: Allocation) -> float:
        """Mean duration, in seconds, of the samples that are still to be taken. Most of these are in noisy pixels."""
        return allocation.weighted_mean(self.buffer.rates.reshape(2, -1).mean(0))

    def _expect_end(self, allocation: Allocation) -> tuple[float, float]:
        """Two numbers expected at the end of the render: the mean number of samples of a lane, and the mean square
        error. Updates the progress bar too."""
        counts = self.buffer.counts
        no_noise = self.goal.error is None and not self.estimate.square
        mean, square = (counts.mean(), 0.0) if no_noise else self._plan(allocation, np.inf)[1:]
        self.bar.total = int(mean * len(counts))
        return mean, square

    def _report_forecast(self, allocation: Allocation) -> None:
        """Reports the forecast. It assumes that the error falls with the power measured in the pilot, at most POWER."""
        counts, goal, power = self.buffer.counts, self.goal, POWER
        if len(self.pilot_squares) > 1 and all(self.pilot_squares.values()):
            (n, before), *_, (m, after) = self.pilot_squares.items()
            power = float(np.clip(np.log(before / after) / np.log(m / n), LEAST_POWER, POWER))
        cautious = replace(allocation, power=power, scale=0.0)
        cautious.update(self.estimate.square - self.estimate.cells, counts[: self.buffer.n])
        mean, square = self._expect_end(cautious)
        missing = (mean - counts.mean()) * len(counts)
        seconds = (
            goal.seconds_passed() + goal.reserve + self.buffer.pace.trace_seconds + missing * self._rate(allocation)
        )
        if goal.seconds is not None and self.time_missed is None:
            seconds = min(seconds, goal.seconds)
        total = square + self.floor.square
        error = float(np.sqrt(total) / self.estimate.luminance) if self.estimate.luminance else 0.0
        self.report(Forecast(2 * mean, error, seconds))


@dataclass(frozen=True)
class AdaptiveResult:
    """Result of an adaptive render.

    layers: dict of the picture's layers by name, with pixels in the order of lanes. Shapes: (3, N) or (N) each.
    facts: metadata of the picture: samples, error and forecast.
    """

    layers: dict[str, np.ndarray]
    facts: dict[str, Any]


def adaptive_sampler(sampler: str) -> str:
    """The sampler of an adaptive render, for the sampler that a scene asks for: Sobol points in place of stratified
    samples, which need their number beforehand."""
    return "sobol" if sampler == "stratified" else sampler


def render_adaptively(
    prepared: Prepared, goal: Goal, files: Files, layers: Collection[str], progress: bool, interrupts: Interrupts
) -> AdaptiveResult:
    """Renders a picture until a goal is reached.

    files: files that the picture will be written to.
    layers: names of the layers to make.
    progress: whether the forecast and a progress bar are shown.
    interrupts: after Ctrl-C, the picture consists of the samples so far.
    """
    forecasts: list[Forecast] = []

    def report(forecast: Forecast) -> None:
        forecasts.append(forecast)
        if progress:
            terminal.say(forecast.text())

    with Bar("rendering", 1, progress, before="compiling") as bar:
        run = AdaptiveRun(prepared, goal, interrupts, bar, report)
        run.run(files)
        if not interrupts.requested:
            bar.update(bar.total)
    return AdaptiveResult(run.buffer.layers(layers), _facts(run, forecasts[-1]))


def _facts(run: AdaptiveRun, forecast: Forecast) -> dict[str, Any]:
    """Metadata of a finished render, as a dict."""
    estimate, floor, goal = run.estimate, run.floor, run.goal
    scale = 1 / estimate.luminance if estimate.luminance > 0 else 1.0
    # The error floor is part of the error and of both ends of its interval.
    noise, squares = (estimate.error, estimate.low, estimate.high), (floor.square, floor.low, floor.high)
    errors = [float(np.hypot(x, scale * np.sqrt(square))) for x, square in zip(noise, squares)]
    floor_parts = {"depth_error": max(floor.depth.square, 0.0), "file_error": floor.rounding}
    spp = run.buffer.samples()
    facts = {
        "sampler": run.buffer.prepared.scene.settings.sampler,
        "spp": round(float(spp.mean()), 2),
        "spp_least": int(spp.min()),
        "spp_most": int(spp.max()),
        **dict(zip(("error", "error_low", "error_high"), errors)),
        **{name: float(scale * np.sqrt(square)) for name, square in floor_parts.items()},
        "forecast_error": forecast.error,
        "forecast_spp": round(forecast.spp, 2),
        "forecast_seconds": round(forecast.seconds, 2),
    }
    if run.buffer.hidden:
        facts |= {"unseen_error": float(scale * np.sqrt(estimate.unseen)), "unseen": run.hidden[1]}
    if run.buffer.cells is not None:
        facts |= {"small_object_pixels": len(run.buffer.cells.lanes)}
    facts |= {} if goal.error is None else {"error_asked": float(goal.error)}
    facts |= {} if goal.seconds is None else {"time_asked": float(goal.seconds)}
    facts |= {} if run.time_missed is None else {"time_missed": run.time_missed}
    return facts
