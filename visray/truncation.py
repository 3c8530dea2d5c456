"""What reflections and refractions beyond the last that is followed would add to a picture."""

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from visray.exposure import Set
from visray.halves import QUANTILE, Halves

# Pixels that are looked at, at most and at least, and samples of each in each half at most.
PIXELS, FEWEST, SAMPLES = 2**13, 2**8, 16


@dataclass(frozen=True)
class Truncation:
    """The mean square over pixels and channels of what is left out at `depth`, and between which two it lies with a
    chance of 95 %."""

    depth: int
    square: float
    low: float
    high: float


def truncation(
    halves: Halves, depths: tuple[int, ...], deep: int, seconds: float = np.inf, pixels: int = PIXELS,
    count: int | None = None,
) -> list[Truncation]:  # fmt: skip
    """What is left out at each of these depths, against `deep`, as some of the pixels tell: of so many at most, and of
    fewer where they would take more than so many seconds. count: samples of each in each half, else as many as the
    halves have.

    The same samples are taken with either depth, so that they differ by what is left out alone; of the two halves, the
    product of the differences has no bias as a square of their mean.
    """
    n, made = halves.n, halves.made
    count = count or min(int(halves.counts.min()), SAMPLES)
    most = pixels
    if seconds < np.inf and halves.pace.rate:
        most = int(np.clip(seconds / (halves.pace.rate * 2 * count * (1 + len(depths))), FEWEST, pixels))
    some = np.sort(np.random.default_rng(made.scene.settings.seed).permutation(n)[:most])
    x, y = (made.a.put(made.a.U, np.array(v)[some]) for v in (made.x, made.y))
    part = replace(made, order=made.order[some], x=x, y=y)
    a, b = _means(part, count, deep)
    found = []
    for depth in depths:
        # The picture itself has the scene's depth.
        known = depth == made.scene.settings.depth and (halves.counts == count).all()
        others = (v[:, some] for v in halves.means()) if known else _means(part, count, depth)
        products = np.multiply(*(u - v for u, v in zip((a, b), others))).mean(0)
        spread = QUANTILE * np.sqrt(np.square(products).sum()) / len(some)
        square = float(products.mean())
        found.append(Truncation(depth, square, square - spread, square + spread))
    return found


def _means(made: Set, count: int, depth: int) -> tuple[np.ndarray, np.ndarray]:
    """The halves' pixels with another depth, which is data: no kernel is made. Shapes: (3, N)."""
    kept = made.stage.scenery
    stage = replace(made.stage, scenery=replace(kept, levels=(dr.opaque(made.a.U, depth), kept.levels[1])))
    other = Halves(replace(made, stage=stage))
    other.extend(np.full_like(other.counts, count))
    return other.means()
