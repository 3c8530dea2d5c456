"""A picture to a given error, or as good as a given time allows: more samples where there is more noise.

A pilot gives each pixel of both halves (dual_buffer.py) equally many samples. By how much it varies around a pixel, the
pixel's share of all further samples is settled (allocation.py), and one number for the whole picture rises until the
error is met or the time is spent. So what a pixel's own samples say never decides how many it gets, but for that
number, which depends on all pixels alike: the picture has no bias but by that number, of order 1 / pixels.

Samples are powers of two of Owen-scrambled Sobol points: of a sequence that goes on, any first 2^k are stratified.

A picture to an error is the same bit for bit each time, with any number of threads: its decisions are taken by samples,
the clock only tells the forecast of seconds. In a time, and until Ctrl-C, as many samples are taken as there is time
for, so that pictures differ from run to run; but a lane that has equally many has the same bits. Error: none
(tests/test_same_bits.py).
"""

import sys
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from visray.adaptive.allocation import LEAST_POWER, POWER, Allocation, around
from visray.adaptive.depth_bias import DepthBias
from visray.adaptive.dual_buffer import DualBuffer, Estimate
from visray.adaptive.error_floor import Files, Floor, rounded_off, unavoidable
from visray.adaptive.stopping import Goal
from visray.errors import UserError
from visray.passes import first_pass_samples
from visray.progress import Bar, Interrupts
from visray.setup import Prepared

# The pilot goes on as long as it is no more than such a share of all samples, from so many of a lane to so many.
PILOT_SHARE, SHORTEST_PILOT, LONGEST_PILOT = 1 / 8, 4, 64
# Ctrl-C waits so many seconds for the first samples, and where they take longer, for none.
WAITED = 2.0
# Of an estimate that must not be above what is asked for.
MARGIN = 0.98


@dataclass(frozen=True)
class Forecast:
    """What is to be expected after a pilot: mean samples of a pixel, the error then, and all seconds until then."""

    spp: float
    error: float
    seconds: float

    def text(self) -> str:
        """In a sentence."""
        return f"forecast: error {self.error:.2g} with {self.spp:.0f} samples per pixel, after {self.seconds:.1f} s"


class NoNumber(Exception):
    """A pixel is not a number; `mean`: of all. Shape: (3, N)."""

    def __init__(self, mean: np.ndarray):
        super().__init__("a pixel is not a number")
        self.mean = mean


class AdaptiveRun:
    """Brings a picture to its goal. found: the error that it has reached; floor: what samples do not take away."""

    def __init__(
        self, prepared: Prepared, goal: Goal, interrupts: Interrupts, bar: Bar, say: Callable[[Forecast], None]
    ):
        self.goal, self.interrupts, self.bar, self.say = goal, interrupts, bar, say
        self.halves = DualBuffer(prepared)
        self.floor = Floor(DepthBias(prepared.scene.settings.depth, 0.0, 0.0, 0.0))
        # Samples of each lane, and the mean square error then, while all have equally many.
        self.seen: dict[int, float] = {}

    def run(self, files: Files) -> None:
        """All of it; raises UserError for goals that cannot be reached."""
        halves, goal = self.halves, self.goal
        if goal.seconds is not None:
            halves.compiled()
            if goal.left() <= 0:
                took = goal.passed() + goal.reserve
                raise UserError(
                    f"time = {goal.seconds:g}: loading, compiling and writing alone take {took:.2g} s; give more"
                )
        allocation = self._pilot()
        if not self.interrupts.requested:
            self.floor = unavoidable(halves, self.found, goal.error, files, goal.left())
        self._tell(allocation)
        # Without noise a time would be spent for nothing.
        while not self._reached() and (goal.error is not None or self.found.square > 0):
            # The error is looked at again when there are twice the samples, or four times, where that is soon: long
            # rounds are many samples too many, where the error falls faster than was expected.
            soon = 3 * halves.counts.sum() <= first_pass_samples(halves.prepared)
            targets = np.tile(allocation.targets(self._outlook(allocation, 4 if soon else 2)[0]), 2)
            if not (targets > halves.counts).any():
                return
            done = halves.extend(targets, self._left)
            self.found = self._estimate()
            # A file rounds a smooth picture otherwise than a noisy one.
            self.floor = replace(self.floor, rounding=rounded_off(halves, files)[0])
            if not done:
                return
            allocation.learn(self.found.square, halves.counts[: halves.n])
            self._expect(allocation)

    def _pilot(self) -> Allocation:
        """As many samples of each pixel as tell who needs how many more; and what they tell."""
        halves = self.halves
        # Whatever happens, each pixel has that: what takes a fraction of a second, or one sample.
        short = SHORTEST_PILOT * len(halves.counts) <= first_pass_samples(halves.prepared)
        count = SHORTEST_PILOT if short and self.goal.seconds is None else 1
        self.bar.total = count * len(halves.counts)
        halves.extend(np.full_like(halves.counts, count), self._first)
        if self.goal.seconds is None and count < SHORTEST_PILOT:
            count = SHORTEST_PILOT
            if not halves.extend(np.full_like(halves.counts, count), self._left):
                return self._allocation()
        while True:
            allocation = self._allocation()
            seconds = halves.pace.predicted_seconds(len(halves.counts) * count)
            # In little time a short pilot is better than none.
            share = PILOT_SHARE if count >= SHORTEST_PILOT else 1 / 2
            dark = self.found.luminance == 0
            done = self._reached() and not dark
            if count >= LONGEST_PILOT or done or seconds > share * self.goal.left():
                return allocation
            longest = LONGEST_PILOT if dark else 2 * count
            if count >= SHORTEST_PILOT and not dark:
                _, mean, _ = self._outlook(allocation, np.inf)
                longest = min(PILOT_SHARE * mean, LONGEST_PILOT)
            if longest < 2 * count:
                return allocation
            while 2 * count <= longest:
                count *= 2
            targets = np.full_like(halves.counts, count)
            if self.goal.seconds is not None:
                # Apart, as they take longer, and most of the time is to be theirs.
                noisy = np.tile(allocation.noisy(), 2)
                if not halves.extend(np.where(noisy, targets, halves.counts), self._left):
                    return self._allocation()
            if not halves.extend(targets, self._left):
                return self._allocation()

    def _first(self) -> float:
        """How many seconds there are for the first samples, without which there is no picture: as many as they take, or
        a UserError that says how many that is."""
        halves, goal = self.halves, self.goal
        self.bar.update(int(halves.counts.sum()))
        needed = np.count_nonzero(halves.counts == 0) * (halves.pace.sample_seconds or 0.0)
        if self.interrupts.requested and needed > WAITED:
            # There is nothing yet that could be kept.
            raise KeyboardInterrupt
        if needed > goal.left():
            took = goal.passed() + needed + goal.reserve
            raise UserError(
                f"time = {goal.seconds:g}: two samples of each pixel alone take about {took:.2g} s; give more, or make "
                "the picture smaller"
            )
        return np.inf

    def _allocation(self) -> Allocation:
        """By the samples that there are, as is the error that is found."""
        halves, film = self.halves, self.halves.prepared.scene.film
        self.found = self._estimate()
        order = halves.prepared.order
        picture = np.ones(film.height * film.width)
        if halves.counts.min() > 1:
            picture[order] = halves.spreads().reshape(2, -1).sum(0)
        if halves.counts.min() == halves.counts.max():
            self.seen[int(halves.counts[0])] = self.found.square
        # In the dark weights would be none.
        picture /= np.square(self.found.luminance) or 1.0
        near = around(picture.reshape(film.height, film.width)).ravel()[order]
        allocation = Allocation.of(near, halves.counts[: halves.n])
        allocation.learn(self.found.square, halves.counts[: halves.n])
        return allocation

    def _estimate(self) -> Estimate:
        """The error that there is; raises NoNumber where a pixel has none."""
        found = self.halves.estimate()
        if not np.isfinite(found.square):
            raise NoNumber(self.halves.mean())
        return found

    def _left(self) -> float:
        """How many seconds there are for another pass."""
        self.bar.update(int(self.halves.counts.sum()))
        return 0.0 if self.interrupts.requested else self.goal.left()

    def _reached(self) -> bool:
        found = self.found
        high = np.square(found.high * found.luminance)
        return bool(high <= self.goal.allowed(found, self.floor.high))

    def _outlook(self, allocation: Allocation, growth: float) -> tuple[int, float, float]:
        """The number of the whole picture that meets the goal, or makes so many times the samples there are; mean
        samples of a lane and mean square error that are expected then."""
        found, counts = self.found, self.halves.counts
        now, fewest = float(counts.mean()), int(counts.min())
        room = np.inf
        if self.goal.seconds is not None:
            room = now + self.goal.left() / (self._rate(allocation) * len(counts))
        allowed = MARGIN * self.goal.allowed(found, self.floor.high)
        good: list[tuple[float, float]] = []
        short: list[tuple[float, float]] = [(now, found.square)]

        def enough(mean: float, square: float, least: int) -> bool:
            high = square * found.factor + found.unseen * (fewest / least) ** 2
            yes = mean >= min(growth * now, room) or high <= allowed
            (good if yes else short).append((mean, square))
            return yes

        number = allocation.least(enough)
        # The search goes down as long as it is enough; where nothing is, it ends with the most samples.
        return number, *(good[-1] if good else max(short))

    def _rate(self, allocation: Allocation) -> float:
        """Seconds of a sample, of those to come: most of them are where there is most noise."""
        return allocation.mean(self.halves.rates.reshape(2, -1).mean(0))

    def _expect(self, allocation: Allocation) -> tuple[float, float]:
        """Mean samples of a lane and mean square error at the end."""
        counts, found = self.halves.counts, self.found
        idle = self.goal.error is None and not found.square
        mean, square = (counts.mean(), 0.0) if idle else self._outlook(allocation, np.inf)[1:]
        self.bar.total = int(mean * len(self.halves.counts))
        return mean, square

    def _tell(self, allocation: Allocation) -> None:
        """The forecast: the error falls as it did in the pilot, or as Allocation has it, whichever is slower."""
        counts, goal, power = self.halves.counts, self.goal, POWER
        if len(self.seen) > 1 and all(self.seen.values()):
            (n, before), *_, (m, after) = self.seen.items()
            power = float(np.clip(np.log(before / after) / np.log(m / n), LEAST_POWER, POWER))
        told = replace(allocation, power=power, scale=0.0)
        told.learn(self.found.square, counts[: self.halves.n])
        mean, square = self._expect(told)
        more = (mean - counts.mean()) * len(counts)
        seconds = goal.passed() + goal.reserve + self.halves.pace.trace_seconds + more * self._rate(allocation)
        seconds = seconds if goal.seconds is None else min(seconds, goal.seconds)
        total = square + self.floor.square
        error = float(np.sqrt(total) / self.found.luminance) if self.found.luminance else 0.0
        self.say(Forecast(2 * mean, error, seconds))


@dataclass(frozen=True)
class AdaptiveResult:
    """A picture that was brought to its goal: its layers in the order of lanes, (3, N) or (N), and what it says of
    itself."""

    layers: dict[str, np.ndarray]
    facts: dict[str, Any]


def render_adaptively(
    prepared: Prepared, goal: Goal, files: Files, layers: Collection[str], progress: bool, interrupts: Interrupts
) -> AdaptiveResult:
    """The picture that comes nearest to the goal, with these of its layers. Ctrl-C keeps what is done."""
    forecasts: list[Forecast] = []

    def say(forecast: Forecast) -> None:
        forecasts.append(forecast)
        if progress:
            sys.stderr.write(f"visray: {forecast.text()}\n")

    with Bar("rendering", 1, progress) as bar:
        pursuit = AdaptiveRun(prepared, goal, interrupts, bar, say)
        pursuit.run(files)
        if not interrupts.requested:
            bar.update(bar.total)
    halves, found, counts = pursuit.halves, pursuit.found, pursuit.halves.counts.reshape(2, -1)
    scale = 1 / found.luminance if found.luminance > 0 else 1.0
    # What samples do not take away is in the error, and in both of its ends.
    floor = pursuit.floor
    noise, rest = (found.error, found.low, found.high), (floor.square, floor.low, floor.high)
    total = [float(np.hypot(x, scale * np.sqrt(y))) for x, y in zip(noise, rest)]
    parts = {"depth_error": max(floor.depth.square, 0.0), "file_error": floor.rounding}
    spp = counts.sum(0)
    facts = {
        "sampler": prepared.scene.settings.sampler,
        "spp": round(float(spp.mean()), 2),
        "spp_least": int(spp.min()),
        "spp_most": int(spp.max()),
        **dict(zip(("error", "error_low", "error_high"), total)),
        **{name: float(scale * np.sqrt(square)) for name, square in parts.items()},
        "forecast_error": forecasts[-1].error,
        "forecast_spp": round(forecasts[-1].spp, 2),
        "forecast_seconds": round(forecasts[-1].seconds, 2),
    }
    facts |= {} if goal.error is None else {"error_asked": float(goal.error)}
    facts |= {} if goal.seconds is None else {"time_asked": float(goal.seconds)}
    return AdaptiveResult(halves.layers(layers), facts)
