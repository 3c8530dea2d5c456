"""What reflections and refractions beyond the last that is followed would add to a picture."""

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from visray.halves import QUANTILE, Halves

# Pixels that are looked at, at most and at least, and samples of each in each half at most.
PIXELS, FEWEST, SAMPLES = 2**14, 2**8, 16


@dataclass(frozen=True)
class Truncation:
    """The mean square over pixels and channels of what is left out at `depth`, and between which two it lies with a
    chance of 95 %."""

    depth: int
    square: float
    low: float
    high: float


def truncation(halves: Halves, depths: tuple[int, ...], deep: int, seconds: float = np.inf) -> list[Truncation]:
    """What is left out at each of these depths, against `deep`; of fewer pixels where it would take more than so many
    seconds.

    The same samples are taken with either depth, so that they differ by what is left out alone; of the two halves, the
    product of the differences has no bias as a square of their mean.
    """
    n, made = halves.n, halves.made
    count = min(int(halves.counts.min()), SAMPLES)
    room = seconds / ((halves.rate or 0.0) * 2 * count * (1 + len(depths)) or np.inf) if seconds < np.inf else np.inf
    some = np.random.default_rng(made.scene.settings.seed).permutation(n)[: int(np.clip(room, FEWEST, PIXELS))]
    lanes = np.concatenate([np.sort(some), n + np.sort(some)])
    most = _means(halves, lanes, count, deep)
    found = []
    for depth in depths:
        a, b = np.split(most - _means(halves, lanes, count, depth), 2, axis=1)
        products = (a * b).mean(0)
        spread = QUANTILE * np.sqrt(np.square(products).sum()) / len(some)
        square = float(products.mean())
        found.append(Truncation(depth, square, square - spread, square + spread))
    return found


def _means(halves: Halves, lanes: np.ndarray, count: int, depth: int) -> np.ndarray:
    """The lanes' pixels with another depth, which is data: no kernel is made. Shapes: (3, N)."""
    made = halves.made
    kept = made.stage.scenery
    stage = replace(made.stage, scenery=replace(kept, levels=(dr.opaque(made.a.U, depth), kept.levels[1])))
    other = Halves(replace(made, stage=stage))
    other.take(lanes, np.full(2 * halves.n, count))
    return np.concatenate(other.means(), axis=1)[:, lanes]
