"""Who gets how many samples: the more a pixel varies, the more of them.

The square of a pixel's error is taken to be scale * weight^2 * samples^-power. Its weight is the root of the variance
that samples around it have, without its own: what decides how often a pixel is sampled must not know what its own
samples say. A pixel that stops when its own samples agree stops where it has missed something, and its mean is biased.

Pixels are counted by classes of equal weight and equal samples, so that choices cost nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from visray.adaptive.dual_buffer import windowed

# Weights are told apart by an eighth of a factor of 2, from 2^-LOWEST to 2^LOWEST.
STEPS, LOWEST = 8, 40
# Samples of a pixel in each half: at most 2^MOST, as they run one after the other.
MOST = 18
# error^2 ~ samples^-power: 1 for independent samples, more for stratified ones. Where nothing is known yet it is taken
# to be steep: another look at the error takes less time than samples that were not needed.
POWER, LEAST_POWER, GREATEST_POWER = 1.5, 1.0, 1.8
# No pixel has less than 2^-FLOOR of the mean samples that weights alone ask for, to a power of two. With less, lone
# pixels that were missed around have most of the error, and so few tell it badly: on scenes/penumbra.json an eighth
# took 3.5 times as long to be sure of 0.001, and on no scene was it faster.
FLOOR = 1
# A window of 5 x 5 pixels, along each side. A small thing that a pixel's few samples have missed has been hit nearby.
KERNEL = np.array([1, 4, 6, 4, 1]) / 16
OWN = KERNEL[2] ** 2


# Of each class its steps, its level, and how many pixels it has.
Classes = tuple[np.ndarray, np.ndarray, np.ndarray]


def around(variances: np.ndarray) -> np.ndarray:
    """The mean of the variances around each pixel, without its own; 1 for a pixel alone. Shapes: (H, W)."""
    total, mass = (windowed(x, KERNEL) - OWN * x for x in (variances, np.ones(variances.shape)))
    return np.divide(np.maximum(total, 0), mass, out=np.ones(mass.shape), where=mass > 0)


@dataclass
class Allocation:
    """The samples of pixels, in each half. steps: of a pixel's weight, in eighths of a factor of 2; levels: logarithms
    to base 2 of the samples that there are. Shapes: (N). classes: of pixels that have these in common."""

    steps: np.ndarray
    levels: np.ndarray
    power: float = POWER
    scale: float = 0.0
    classes: Classes = field(init=False)

    def __post_init__(self) -> None:
        self.classes = self._classes(self.levels)

    @staticmethod
    def of(variances: np.ndarray, counts: np.ndarray) -> "Allocation":
        """By the variances around pixels, relative to the picture's light; where all are 0, all alike."""
        variances = variances if variances.any() else np.ones_like(variances)
        with np.errstate(divide="ignore"):
            steps = np.rint(STEPS / 2 * np.log2(variances))
        return Allocation(np.clip(steps, -STEPS * LOWEST, STEPS * LOWEST).astype(np.int32), _levels(counts))

    def learn(self, square: float, counts: np.ndarray) -> None:
        """Takes in that the mean square error is `square` with so many samples."""
        levels = _levels(counts)
        before, now = self.classes, self._classes(levels)
        known = self.scale * self._sum(before, self.power)
        if 0 < square < known:
            powers = np.linspace(LEAST_POWER, GREATEST_POWER, 33)
            gains = [self._sum(before, p) / self._sum(now, p) for p in powers]
            self.power = float(powers[np.argmin(np.abs(np.log(gains) - np.log(known / square)))])
        total = self._sum(now, self.power)
        self.scale, self.levels, self.classes = (square / total if total > 0 else 0.0), levels, now

    def targets(self, number: int) -> np.ndarray:
        """The samples of each pixel for the number of the whole picture, in eighths of a factor of 2; never fewer than
        there are."""
        wanted = np.maximum(self._wanted(self.steps, self.levels, number), self._floor(number))
        return np.left_shift(1, wanted, dtype=np.int64)

    def noisy(self) -> np.ndarray:
        """The pixels that vary most, and get half of all samples together. Shape: (N)."""
        steps, _, pixels = self.classes
        order = np.argsort(-steps)
        share = np.cumsum((pixels * 2.0 ** (steps / STEPS))[order])
        return self.steps >= steps[order][np.searchsorted(share, share[-1] / 2)]

    def mean(self, values: np.ndarray) -> float:
        """Of what pixels have, weighted by the samples that they are to get. Shapes: (N)."""
        weights = 2.0 ** (self.steps / STEPS)
        return float((weights * values).sum() / weights.sum())

    def least(self, enough: Callable[[float, float, int], bool]) -> int:
        """The least number for which enough(mean samples of a pixel, mean square error expected then, fewest samples of
        a pixel) holds, or the one that gives all pixels the most."""
        steps, levels, pixels = self.classes
        low, high = -STEPS * LOWEST, STEPS * (LOWEST + MOST)
        while low < high:
            middle = (low + high) // 2
            wanted = np.maximum(self._wanted(steps, levels, middle), self._floor(middle))
            square = self.scale * self._sum((steps, wanted, pixels), self.power)
            good = enough(_mean(wanted, pixels), square, 2 ** int(wanted.min()))
            low, high = (low, middle) if good else (middle + 1, high)
        return low

    def _wanted(self, steps: np.ndarray, levels: np.ndarray, number: int) -> np.ndarray:
        """Levels for the number of the whole picture, by weight alone."""
        wanted = np.clip((steps + number + STEPS // 2) // STEPS, 0, MOST)
        return np.maximum(np.where(steps > -STEPS * LOWEST, wanted, 0), levels)

    def _floor(self, number: int) -> int:
        """The level that no pixel stays below: what nothing tells of around a pixel may be in it."""
        steps, levels, pixels = self.classes
        return int(np.log2(_mean(self._wanted(steps, levels, number), pixels))) - FLOOR

    def _classes(self, levels: np.ndarray) -> Classes:
        """Pixels by their steps and levels: these two, and how many are alike."""
        pixels = np.bincount((self.steps + STEPS * LOWEST) * (MOST + 1) + levels)
        found = np.flatnonzero(pixels)
        return found // (MOST + 1) - STEPS * LOWEST, found % (MOST + 1), pixels[found]

    @staticmethod
    def _sum(classes: Classes, power: float) -> float:
        """The mean of weight^2 samples^-power."""
        steps, levels, pixels = classes
        return float((pixels * 2.0 ** (2 * steps / STEPS - power * levels)).sum() / pixels.sum())


def _mean(levels: np.ndarray, pixels: np.ndarray) -> float:
    """The mean samples of so many pixels of each level."""
    return float((pixels * 2.0**levels).sum() / pixels.sum())


def _levels(counts: np.ndarray) -> np.ndarray:
    return np.rint(np.log2(counts)).astype(np.int32)
