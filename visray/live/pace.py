"""How long steps of a live picture take, and so how many samples a step may have."""

from dataclasses import dataclass


@dataclass
class Pace:
    """How long steps take. One for all pictures of a viewer, so that each knows what those before have learned.

    fixed: seconds that every step takes, whatever its number of samples
    per_sample: seconds that one sample of one pixel takes; None before the first measurement
    before: seconds before the first step of a picture, in which the camera is placed
    grain: grain of the first state of the picture before; None before the first picture
    """

    fixed: float = 0.0
    per_sample: float | None = None
    before: float = 0.0
    grain: int | None = None

    def learn(self, samples: int, seconds: float, ran: float) -> None:
        """Learns from a step without compilation. seconds: how long it took; ran: how long its kernels ran."""
        self.per_sample = _mixed(self.per_sample, max(ran, 1e-9) / samples)
        self.fixed = _mixed(self.fixed, max(seconds - ran, 0.0))

    def placed(self, seconds: float) -> None:
        """Learns how long it took to place the camera for a picture."""
        self.before = _mixed(self.before, seconds)

    def samples(self, seconds: float, first: bool = False) -> float:
        """Number of samples for which there is time in a step. Domain: after a first measurement.

        first: whether it is the first step of a picture
        """
        spent = self.fixed + (self.before if first else 0.0)
        return max(seconds - spent, seconds / 4) / self.per_sample


def _mixed(old: float | None, new: float) -> float:
    """A measured time after one more measurement. Other programs make single steps slower but never faster, so a longer
    time counts less than a shorter one."""
    if not old:
        return new
    return old + (new - old) * (0.5 if new < old else 0.2)
