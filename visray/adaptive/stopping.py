"""Stopping criterion of adaptive sampling: an error, a time, or both."""

from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from visray import clock
from visray.adaptive.dual_buffer import Estimate
from visray.errors import UserError


@dataclass(frozen=True)
class Goal:
    """Goal of an adaptive render: an error, a time, or whichever is reached first.

    error: largest error, relative to the picture's mean luminance, or None.
    seconds: time from `begun` to the end, or None.
    begun: start of the render (clock.now).
    reserve: seconds at the end that are not for samples, such as those for writing files.
    """

    error: float | None
    seconds: float | None
    begun: float
    reserve: float = 0.0

    @staticmethod
    def from_arguments(error: float | None, seconds: float | None, spp: int | None, begun: float) -> "Goal | None":
        """Goal from the arguments of a render; None where neither an error nor a time is asked for."""
        if error is None and seconds is None:
            return None
        for name, value, example in (("error", error, 0.01), ("time", seconds, 10)):
            check_target(name, value, example)
        if spp is not None:
            raise UserError(f"spp = {spp}: goes with neither error nor time, which choose it; leave it out")
        return Goal(error, seconds, begun)

    def seconds_left(self) -> float:
        """Seconds left for samples; infinite without a time."""
        return np.inf if self.seconds is None else self.seconds - self.reserve - self.seconds_passed()

    def seconds_passed(self) -> float:
        """Seconds since the start."""
        return clock.now() - self.begun

    def allowed_square(self, estimate: Estimate, floor: float) -> float:
        """Largest mean square error of the samples that meets the goal; 0 without an error.

        floor: upper bound of the mean square error that samples do not reduce.
        """
        if self.error is None:
            return 0.0
        absolute = float(self.error) * estimate.luminance
        return absolute * absolute - floor


def check_target(name: str, value: Any, example: float) -> None:
    """Raises a UserError unless a value is None or a finite number above 0."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if value is not None and not (is_number and 0 < value < np.finfo(float).max):
        raise UserError(f"{name} = {value!r}: must be a finite number above 0, such as {example}")
