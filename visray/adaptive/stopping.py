"""Stopping criterion of adaptive sampling: an error, a time, or both."""

from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from visray import clock
from visray.adaptive.estimate import Estimate
from visray.errors import UserError


@dataclass(frozen=True)
class Goal:
    """Goal of an adaptive render: an error, a time, or both. With both, the render ends when the first is reached.

    error: largest error, relative to the picture's mean luminance, or None.
    seconds: time from `begun` to the end of the render, or None.
    begun: moment when the time starts (clock.now).
    reserve: seconds at the end that are kept for other work than samples, such as writing files.
    """

    error: float | None
    seconds: float | None
    begun: float
    reserve: float = 0.0

    @staticmethod
    def from_arguments(error: float | None, seconds: float | None, spp: int | None, begun: float) -> "Goal | None":
        """Goal from the arguments of vr.render, or None if neither an error nor a time is given."""
        if error is None and seconds is None:
            return None
        for name, value, example in (("error", error, 0.01), ("time", seconds, 10)):
            check_target(name, value, example)
        if spp is not None:
            raise UserError(f"spp = {spp}: goes with neither error nor time, which choose it; leave it out")
        return Goal(error, seconds, begun)

    def seconds_left(self) -> float:
        """Seconds left for samples; infinite if the goal has no time."""
        return np.inf if self.seconds is None else self.seconds - self.reserve - self.seconds_passed()

    def seconds_passed(self) -> float:
        """Seconds since `begun`."""
        return clock.now() - self.begun

    def allowed_square(self, estimate: Estimate, floor: float) -> float:
        """Largest mean square error by noise with which the goal is reached; 0 if the goal has no error.

        estimate: estimated error, for the luminance of the picture.
        floor: upper bound of the mean square error that more samples do not reduce.
        """
        if self.error is None:
            return 0.0
        absolute = float(self.error) * estimate.luminance
        return absolute * absolute - floor


def check_target(name: str, value: Any, example: float) -> None:
    """Raises a UserError unless the value of an argument is None or a finite number above 0.

    name: name of the argument. example: a valid value, for the message.
    """
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if value is not None and not (is_number and 0 < value < np.finfo(float).max):
        raise UserError(f"{name} = {value!r}: must be a finite number above 0, such as {example}")
