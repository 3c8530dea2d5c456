"""What a picture is asked for: an error, or a time."""

from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from visray import clock
from visray.adaptive.dual_buffer import Estimate
from visray.errors import UserError


@dataclass(frozen=True)
class Goal:
    """What is asked for: an error, seconds from `begun` on (clock.now), or whichever comes first. reserve:
    seconds that are needed at the end."""

    error: float | None
    seconds: float | None
    begun: float
    reserve: float = 0.0

    @staticmethod
    def asked(error: float | None, seconds: float | None, spp: int | None, begun: float) -> "Goal | None":
        """What the arguments of a render ask for; None where they ask for samples."""
        if error is None and seconds is None:
            return None
        for name, value, example in (("error", error, 0.01), ("time", seconds, 10)):
            check_target(name, value, example)
        if spp is not None:
            raise UserError(f"spp = {spp}: goes with neither error nor time, which choose it; leave it out")
        return Goal(error, seconds, begun)

    def left(self) -> float:
        """Seconds that are left for samples."""
        return np.inf if self.seconds is None else self.seconds - self.reserve - self.passed()

    def passed(self) -> float:
        """Seconds that have passed."""
        return clock.now() - self.begun

    def allowed(self, found: Estimate, bias: float) -> float:
        """The mean square error that may be left; none where no error is asked for. bias: the square of what samples
        do not take away, as large as it may be."""
        if self.error is None:
            return 0.0
        off = float(self.error) * found.luminance
        return off * off - bias


def check_target(name: str, value: Any, example: float) -> None:
    """Returns if a value is None or a finite number above 0, else raises a UserError."""
    number = isinstance(value, Real) and not isinstance(value, bool)
    if value is not None and not (number and 0 < value < np.finfo(float).max):
        raise UserError(f"{name} = {value!r}: must be a finite number above 0, such as {example}")
