"""What reflections and refractions beyond the last that is followed would add to a picture."""

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from visray.halves import QUANTILE, Halves, moments

# Pixels that are looked at, and samples of each in each half at most.
PIXELS, SAMPLES = 2**14, 16


@dataclass(frozen=True)
class Truncation:
    """The mean square over pixels and channels of what is left out at `depth`, and between which two it lies with a
    chance of 95 %."""

    depth: int
    square: float
    low: float
    high: float


def truncation(halves: Halves, depths: tuple[int, ...], deep: int) -> list[Truncation]:
    """What is left out at each of these depths, against `deep`.

    The same samples are taken with either depth, so that they differ by what is left out alone; of the two halves, the
    product of the differences has no bias as a square of their mean.
    """
    n, made = halves.n, halves.made
    pixels = np.random.default_rng(made.scene.settings.seed).permutation(n)[:PIXELS]
    lanes = np.concatenate([np.sort(pixels), n + np.sort(pixels)])
    count = np.full(len(lanes), min(int(halves.counts.min()), SAMPLES))
    most = _means(halves, lanes, count, deep)
    found = []
    for depth in depths:
        a, b = np.split(most - _means(halves, lanes, count, depth), 2, axis=1)
        products = (a * b).mean(0)
        spread = QUANTILE * np.sqrt(np.square(products).sum()) / len(pixels)
        square = float(products.mean())
        found.append(Truncation(depth, square, square - spread, square + spread))
    return found


def _means(halves: Halves, lanes: np.ndarray, count: np.ndarray, depth: int) -> np.ndarray:
    """The lanes' pixels with another depth, which is data: no kernel is made. Shapes: (3, N)."""
    made = halves.made
    kept = made.stage.scenery
    stage = replace(made.stage, scenery=replace(kept, levels=(dr.opaque(made.a.U, depth), kept.levels[1])))
    found, *_ = moments(made, stage, lanes, 0 * count, count)
    return np.array(found.reference, float) + np.array(found.total, float) / count
