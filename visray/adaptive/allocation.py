"""Allocation of samples to pixels: pixels with more variance around them get more samples.

The model of a pixel's squared error is scale * weight^2 * samples^-power. The weight of a pixel is the square root of
the mean variance of the samples in the pixels around it. The pixel's own samples are left out, because the number of
its samples must not depend on their values. Otherwise a pixel whose first samples have all missed a bright object would
stop early, and the mean of its samples would be biased.

Weights are rounded to powers of 2^(1 / STEPS), and sample counts to powers of 2, so that there are few different ones:

    step    logarithm of a weight to base 2^(1 / STEPS), a whole number
    level   logarithm of a sample count to base 2, a whole number
    class   all pixels with the same step and the same level; computations run over the few classes, not over pixels
    budget  one whole number for the whole picture: by weight alone, a pixel gets 2^((step + budget) / STEPS) samples
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from visray.adaptive.dual_buffer import window_sums
from visray.adaptive.lane_buffer import LARGEST_LEVEL

# Weights are rounded to powers of 2^(1 / STEPS), and clamped to the range from 2^-WEIGHT_RANGE to 2^WEIGHT_RANGE.
STEPS, WEIGHT_RANGE = 8, 40
# error^2 is proportional to samples^-power. The power is 1 for independent samples, and larger for stratified samples.
# Before it is measured, it is assumed to be large. Then a round may take too few samples, and another round follows.
# That costs less time than too many samples.
POWER, LEAST_POWER, GREATEST_POWER = 1.5, 1.0, 1.8
# Each pixel gets at least a floor of samples: the mean count by weight alone, times 2^-FLOOR_LEVELS, rounded down to a
# power of two. With a lower floor, most of the error lies in a few isolated pixels whose neighbours have missed
# something, and so few pixels do not suffice to estimate the error. On scenes/penumbra.json a floor of an eighth took
# 3.5 times as long to ensure an error of 0.001, and it was faster on no scene.
FLOOR_LEVELS = 1
# Weights along each side of a window of 5 x 5 pixels. If the few samples of a pixel miss a small object, samples of
# nearby pixels hit it.
WINDOW = np.array([1, 4, 6, 4, 1]) / 16
CENTER_WEIGHT = WINDOW[2] ** 2


# Classes of pixels, as three arrays: step, level and number of pixels of each class.
Classes = tuple[np.ndarray, np.ndarray, np.ndarray]


def neighbour_means(variances: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
    """Weighted mean of the variances around each pixel, without the pixel's own variance; 1 if there is no other pixel.

    known: mask of the pixels whose variance is known; None if that is all.

    Shapes: (H, W).
    """
    known = np.ones(variances.shape) if known is None else known.astype(float)
    total, mass = (window_sums(x, WINDOW) - CENTER_WEIGHT * x for x in (variances * known, known))
    return np.divide(np.maximum(total, 0), mass, out=np.ones(mass.shape), where=mass > 0)


def weight_steps(variances: np.ndarray) -> np.ndarray:
    """Steps of the weights of pixels, from the variances around them. If all variances are 0, all weights are equal."""
    variances = variances if variances.any() else np.ones_like(variances)
    with np.errstate(divide="ignore"):
        steps = np.rint(STEPS / 2 * np.log2(variances))
    return np.clip(steps, -STEPS * WEIGHT_RANGE, STEPS * WEIGHT_RANGE).astype(np.int16)


@dataclass
class Allocation:
    """Number of samples of each pixel, now and for any budget. All counts are samples in one half of the dual buffer;
    the other half has the same.

    steps: step of each pixel's weight. Shape: (N).
    levels: level of the number of samples that each pixel has now. Shape: (N).
    power, scale: parameters of the model. The mean of scale * weight^2 * samples^-power over all pixels is the mean
        square error of the picture.
    classes: the classes of pixels.
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
        """Allocation with weights from variances.

        variances: mean variance around each pixel, divided by the square of the picture's luminance. Shape: (N).
        counts: number of samples that each pixel has, a power of two. Shape: (N).
        """
        return Allocation.of_steps(weight_steps(variances), counts)

    @staticmethod
    def of_steps(steps: np.ndarray, counts: np.ndarray) -> "Allocation":
        """Allocation with steps of the weights. counts: as for `of`."""
        return Allocation(steps.astype(np.int32), _levels(counts))

    def update(self, square: float, counts: np.ndarray) -> None:
        """Fits the model to a measured mean square error.

        square: the measured mean square error.
        counts: number of samples that each pixel has now. Shape: (N).
        """
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
        """Number of samples that each pixel should have at a budget (see the top of the module), but at least as many
        as it has already. Shape: (N)."""
        levels = np.maximum(self._levels_by_weight(self.steps, self.levels, budget), self._least_level(budget))
        return np.left_shift(1, levels, dtype=np.int64)

    def noisy(self) -> np.ndarray:
        """Mask of the noisy pixels: those of largest weight that together get at least half of all samples.
        Shape: (N)."""
        steps, _, pixels = self.classes
        order = np.argsort(-steps)
        share = np.cumsum((pixels * 2.0 ** (steps / STEPS))[order])
        return self.steps >= steps[order][np.searchsorted(share, share[-1] / 2)]

    def weighted_mean(self, values: np.ndarray) -> float:
        """Weighted mean of a value over all pixels. The weight of a pixel is its number of samples by weight alone.

        values: one value per pixel. Shape: (N).
        """
        weights = 2.0 ** (self.steps / STEPS)
        return float((weights * values).sum() / weights.sum())

    def smallest_budget(self, enough: Callable[[float, float, int], bool]) -> int:
        """Smallest budget that is enough. If none is, the largest one, which gives all pixels 2^LARGEST_LEVEL samples.

        enough: function that returns whether a budget is enough. It is called with three numbers for that budget: the
            mean number of samples of a pixel, the expected mean square error, and the smallest number of samples of a
            pixel.
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
        """Levels of pixels or classes at a budget by weight alone, without the floor; never below `levels`.

        steps, levels: step and present level of each pixel or class.
        """
        by_weight = np.clip((steps + budget + STEPS // 2) // STEPS, 0, LARGEST_LEVEL)
        return np.maximum(np.where(steps > -STEPS * WEIGHT_RANGE, by_weight, 0), levels)

    def _least_level(self, budget: int) -> int:
        """Level of the floor at a budget, the least level of any pixel. A pixel may be noisy although the pixels around
        it are not."""
        steps, levels, pixels = self.classes
        return int(np.log2(_mean_samples(self._levels_by_weight(steps, levels, budget), pixels))) - FLOOR_LEVELS

    def _count(self, levels: np.ndarray) -> Classes:
        """Classes of the pixels. `levels`: level of each pixel. Shape: levels (N)."""
        pixels = np.bincount((self.steps + STEPS * WEIGHT_RANGE) * (LARGEST_LEVEL + 1) + levels)
        used = np.flatnonzero(pixels)
        return used // (LARGEST_LEVEL + 1) - STEPS * WEIGHT_RANGE, used % (LARGEST_LEVEL + 1), pixels[used]

    @staticmethod
    def _relative_square(classes: Classes, power: float) -> float:
        """Mean of weight^2 * samples^-power over all pixels: the mean square error of the model, divided by `scale`."""
        steps, levels, pixels = classes
        return float((pixels * 2.0 ** (2 * steps / STEPS - power * levels)).sum() / pixels.sum())


def _mean_samples(levels: np.ndarray, pixels: np.ndarray) -> float:
    """Mean number of samples of a pixel if pixels[i] pixels have the level levels[i]."""
    return float((pixels * 2.0**levels).sum() / pixels.sum())


def _levels(counts: np.ndarray) -> np.ndarray:
    """Levels of sample counts: their logarithms to base 2."""
    return np.rint(np.log2(counts)).astype(np.int32)
