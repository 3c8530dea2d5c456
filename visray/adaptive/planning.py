"""Planning of adaptive sampling: how many samples the next round and the whole render should take."""

from dataclasses import dataclass, replace

import numpy as np

from visray.adaptive.allocation import LEAST_POWER, POWER, Allocation
from visray.adaptive.error_floor import Floor
from visray.adaptive.evidence import Evidence
from visray.adaptive.stopping import Goal

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
        error = f"an error of {100 * self.error:.2g} %" if self.error else "no noise is seen"
        return f"forecast: {error} with {self.spp:.0f} samples per pixel, after {self.seconds:.1f} s"


@dataclass
class Planner:
    """Plans samples by what is asked for and what the samples so far tell.

    goal: the error and the time that are asked for.
    evidence: what the samples so far tell.
    floor: error that more samples do not reduce.
    """

    goal: Goal
    evidence: Evidence
    floor: Floor

    def goal_reached(self) -> bool:
        """Whether the upper end of the picture's error, with the floor, is within the error that is asked for. If no
        error is asked for: whether there is no noise at all."""
        high = np.square(self.evidence.estimate.high * self.evidence.estimate.luminance)
        return bool(high <= self.goal.allowed_square(self.evidence.estimate, self.floor.high))

    def needs_cells(self) -> bool:
        """Whether the error of the pixels that are cut into cells is too large a part of the picture's error."""
        estimate, cells = self.evidence.estimate, self.evidence.buffer.cells
        if cells is None or cells.exhausted or not estimate.cells:
            return False
        allowed = 0.0
        if self.goal.error is not None:
            allowed = self.goal.allowed_square(estimate, self.floor.high) / (2 * estimate.factor)
        return estimate.cells > max(estimate.square - estimate.cells, allowed)

    def plan(self, allocation: Allocation, growth: float) -> tuple[int, float, float]:
        """Budget of the next round, and two numbers expected after this round: the mean number of samples of a lane,
        and the mean square error.

        growth: factor by which the round may increase the number of samples.

        The budget is the smallest that reaches the error of the goal, uses up the time of the goal, or increases the
        number of samples by `growth`.
        """
        estimate, counts = self.evidence.estimate, self.evidence.buffer.counts
        present, fewest = float(counts.mean()), int(counts.min())
        affordable = np.inf
        if self.goal.seconds is not None:
            rate = self.rate(allocation) * len(counts)
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

    def rate(self, allocation: Allocation) -> float:
        """Mean duration, in seconds, of the samples that are still to be taken. Most of these are in noisy pixels."""
        return allocation.weighted_mean(self.evidence.buffer.rates.reshape(2, -1).mean(0))

    def end(self, allocation: Allocation) -> tuple[float, float]:
        """Two numbers expected at the end of the render: the mean number of samples of a lane, and the mean square
        error."""
        if self.goal.error is None and not self.evidence.estimate.square:
            return self.evidence.buffer.counts.mean(), 0.0
        return self.plan(allocation, np.inf)[1:]

    def forecast(self, allocation: Allocation, limit: float) -> Forecast:
        """The forecast. It assumes that the error falls with the power measured in the pilot, at most POWER.

        limit: the most seconds that the render can take.
        """
        evidence, goal, power = self.evidence, self.goal, POWER
        counts, squares = evidence.buffer.counts, evidence.pilot_squares
        if len(squares) > 1 and all(squares.values()):
            (n, before), *_, (m, after) = squares.items()
            power = float(np.clip(np.log(before / after) / np.log(m / n), LEAST_POWER, POWER))
        cautious = replace(allocation, power=power, scale=0.0)
        cautious.update(evidence.estimate.square - evidence.estimate.cells, counts[: evidence.buffer.n])
        mean, square = self.end(cautious)
        missing = (mean - counts.mean()) * len(counts)
        seconds = goal.seconds_passed() + goal.reserve + evidence.buffer.pace.trace_seconds
        seconds += missing * self.rate(allocation)
        luminance = evidence.estimate.luminance
        error = float(np.sqrt(square + self.floor.square) / luminance) if luminance else 0.0
        return Forecast(2 * mean, error, min(seconds, limit))
