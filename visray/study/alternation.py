"""Times of a picture with all effects (the full picture) and of pictures without one, taken by turns."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from visray.study.timed_picture import TimedPicture


@dataclass
class Alternation:
    """Runs the full picture just before and just after each picture without an effect.

    full: the full picture
    without: the pictures without an effect, by the name of the effect
    full_seconds: times of the full picture so far
    differences: for each effect, the differences so far. One is the mean of the times of the full picture just before
        and just after, minus the time of the picture without the effect
    """

    full: TimedPicture
    without: dict[str, TimedPicture]
    full_seconds: list[float] = field(default_factory=list)
    differences: dict[str, list[float]] = field(default_factory=dict)

    def pictures(self, count: int) -> int:
        """Number of pictures that `runs` renders. Domain: before the first run."""
        return 2 * count * len(self.without) + 1 if self.without else count

    def runs(self, count: int) -> Iterator[None]:
        """Runs each picture without an effect `count` times. One picture is rendered for each item of the iterator."""
        for _ in range(count):
            if not (self.full_seconds and self.without):
                self.full_seconds.append(self.full.seconds())
                yield
            for effect, picture in self.without.items():
                seconds = picture.seconds()
                yield
                self.full_seconds.append(self.full.seconds())
                more = (self.full_seconds[-2] + self.full_seconds[-1]) / 2 - seconds
                self.differences.setdefault(effect, []).append(more)
                yield
