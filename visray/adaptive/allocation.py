"""Allocation of samples to pixels: pixels with more variance around them get more samples.

The square of a pixel's error is modelled as scale * weight^2 * samples^-power. A pixel's weight is the square root of
the mean variance of the samples in the pixels around it. Its own samples are left out: the number of samples of a pixel
must not depend on their values. Otherwise a pixel would stop early where its few samples happen to agree because they
have missed something, and its mean would be biased.

Pixels of equal weight and equal sample count form a class. Choices are made on the few classes, not on all pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from visray.adaptive.dual_buffer import window_sums

# A weight is rounded to a power of 2^(1 / STEPS) between 2^-WEIGHT_RANGE and 2^WEIGHT_RANGE.
STEPS, WEIGHT_RANGE = 8, 40
# A pixel has at most 2^LARGEST_LEVEL samples in each half, since they run one after the other.
LARGEST_LEVEL = 18
# error^2 ~ samples^-power. The power is 1 for independent samples, and larger for stratified ones. Before it is
# measured a steep one is assumed: to estimate the error once more takes less time than samples that were not needed.
POWER, LEAST_POWER, GREATEST_POWER = 1.5, 1.0, 1.8
# A pixel gets at least 2^-FLOOR_LEVELS of the mean sample count by weights alone, rounded down to a power of two. With
# fewer, most of the error is in isolated pixels whose surroundings have missed something, and so few pixels estimate it
# badly: on scenes/penumbra.json a floor of an eighth took 3.5 times as long to be sure of an error of 0.001, and it was
# faster on no scene.
FLOOR_LEVELS = 1
# Weights of a window of 5 x 5 pixels, along each side. Where a pixel's few samples miss a small object, samples of
# pixels nearby hit it.
WINDOW = np.array([1, 4, 6, 4, 1]) / 16
CENTER_WEIGHT = WINDOW[2] ** 2


# Classes of pixels: of each class the step of its weight, its level, and its number of pixels.
Classes = tuple[np.ndarray, np.ndarray, np.ndarray]


def neighbour_means(variances: np.ndarray) -> np.ndarray:
    """Weighted mean of the variances around each pixel, without its own; 1 for a picture of one pixel.
    Shapes: (H, W)."""
    total, mass = (window_sums(x, WINDOW) - CENTER_WEIGHT * x for x in (variances, np.ones(variances.shape)))
    return np.divide(np.maximum(total, 0), mass, out=np.ones(mass.shape), where=mass > 0)


@dataclass
class Allocation:
    """Samples of each pixel, in each half of the dual buffer.

    steps: logarithm of each pixel's weight, in steps of 1 / STEPS to base 2. Shape: (N).
    levels: logarithm to base 2 of the samples that each pixel has. Shape: (N).
    power, scale: of the model error^2 = scale * weight^2 * samples^-power, with the mean over all pixels.
    classes: pixels counted by step and level.

    One number for the whole picture, the budget, decides how many samples there are: by weight alone a pixel gets
    2^((steps + budget) / STEPS) of them.
    """

    steps: np.ndarray
    levels: np.ndarray
    power: float = POWER
    scale: float = 0.0
    classes: Classes = field(init=False)

    def __post_init__(self) -> None:
        self.classes = self._count(self.levels)

    @staticmethod
    def of(variances: np.ndarray, counts: np.ndarray) -> "Allocation":
        """Allocation by the variances around each pixel, relative to the picture's luminance. All pixels are alike if
        all variances are 0. Shapes: (N).

        counts: samples that each pixel has, powers of two.
        """
        variances = variances if variances.any() else np.ones_like(variances)
        with np.errstate(divide="ignore"):
            steps = np.rint(STEPS / 2 * np.log2(variances))
        largest = STEPS * WEIGHT_RANGE
        return Allocation(np.clip(steps, -largest, largest).astype(np.int32), _levels(counts))

    def update(self, square: float, counts: np.ndarray) -> None:
        """Fits the model to a measured mean square error. `counts`: samples of each pixel by now. Shape: (N)."""
        levels = _levels(counts)
        before, now = self.classes, self._count(levels)
        known = self.scale * self._relative_square(before, self.power)
        if 0 < square < known:
            powers = np.linspace(LEAST_POWER, GREATEST_POWER, 33)
            gains = [self._relative_square(before, p) / self._relative_square(now, p) for p in powers]
            self.power = float(powers[np.argmin(np.abs(np.log(gains) - np.log(known / square)))])
        total = self._relative_square(now, self.power)
        self.scale, self.levels, self.classes = (square / total if total > 0 else 0.0), levels, now

    def targets(self, budget: int) -> np.ndarray:
        """Samples of each pixel for a budget; never fewer than it has. Shape: (N)."""
        levels = np.maximum(self._levels_by_weight(self.steps, self.levels, budget), self._least_level(budget))
        return np.left_shift(1, levels, dtype=np.int64)

    def noisy(self) -> np.ndarray:
        """Mask of the pixels of largest weight that get half of all samples together. Shape: (N)."""
        steps, _, pixels = self.classes
        order = np.argsort(-steps)
        share = np.cumsum((pixels * 2.0 ** (steps / STEPS))[order])
        return self.steps >= steps[order][np.searchsorted(share, share[-1] / 2)]

    def weighted_mean(self, values: np.ndarray) -> float:
        """Mean of a value over pixels, weighted by the samples that they are to get. Shape: (N)."""
        weights = 2.0 ** (self.steps / STEPS)
        return float((weights * values).sum() / weights.sum())

    def smallest_budget(self, enough: Callable[[float, float, int], bool]) -> int:
        """Smallest budget that is enough, or the one that gives all pixels the most samples.

        enough: is called with the mean samples of a pixel, the mean square error expected with them, and the smallest
        number of samples of a pixel.
        """
        steps, levels, pixels = self.classes
        low, high = -STEPS * WEIGHT_RANGE, STEPS * (WEIGHT_RANGE + LARGEST_LEVEL)
        while low < high:
            middle = (low + high) // 2
            target = np.maximum(self._levels_by_weight(steps, levels, middle), self._least_level(middle))
            square = self.scale * self._relative_square((steps, target, pixels), self.power)
            good = enough(_mean_samples(target, pixels), square, 2 ** int(target.min()))
            low, high = (low, middle) if good else (middle + 1, high)
        return low

    def _levels_by_weight(self, steps: np.ndarray, levels: np.ndarray, budget: int) -> np.ndarray:
        """Levels for a budget by weight alone; never below `levels`."""
        by_weight = np.clip((steps + budget + STEPS // 2) // STEPS, 0, LARGEST_LEVEL)
        return np.maximum(np.where(steps > -STEPS * WEIGHT_RANGE, by_weight, 0), levels)

    def _least_level(self, budget: int) -> int:
        """Smallest level of any pixel: a pixel may vary although the pixels around it do not."""
        steps, levels, pixels = self.classes
        return int(np.log2(_mean_samples(self._levels_by_weight(steps, levels, budget), pixels))) - FLOOR_LEVELS

    def _count(self, levels: np.ndarray) -> Classes:
        """Classes of the pixels, given the level of each. Shape: levels (N)."""
        pixels = np.bincount((self.steps + STEPS * WEIGHT_RANGE) * (LARGEST_LEVEL + 1) + levels)
        used = np.flatnonzero(pixels)
        return used // (LARGEST_LEVEL + 1) - STEPS * WEIGHT_RANGE, used % (LARGEST_LEVEL + 1), pixels[used]

    @staticmethod
    def _relative_square(classes: Classes, power: float) -> float:
        """Mean of weight^2 samples^-power over all pixels: the mean square error over `scale`."""
        steps, levels, pixels = classes
        return float((pixels * 2.0 ** (2 * steps / STEPS - power * levels)).sum() / pixels.sum())


def _mean_samples(levels: np.ndarray, pixels: np.ndarray) -> float:
    """Mean samples of a pixel, where pixels[i] pixels have the level levels[i]."""
    return float((pixels * 2.0**levels).sum() / pixels.sum())


def _levels(counts: np.ndarray) -> np.ndarray:
    """Logarithms to base 2 of sample counts."""
    return np.rint(np.log2(counts)).astype(np.int32)
