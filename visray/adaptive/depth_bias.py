"""What reflections and refractions beyond the last that is followed would add to a picture."""

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from visray.adaptive.dual_buffer import QUANTILE, DualBuffer, windowed
from visray.passes import subset
from visray.setup import Prepared

# Pixels that are looked at, at most and at least, and samples of each in each half at most; where they are few, more.
PIXELS, FEWEST, SAMPLES, MORE = 2**13, 2**8, 16, 32
# Samples that look for where paths go on, and the side of the window of pixels around one where they do.
FEWEST_LOOKS, MOST_LOOKS, AROUND = 2**12, 2**16, 5


@dataclass(frozen=True)
class DepthBias:
    """The mean square over pixels and channels of what is left out at `depth`, and between which two it lies with a
    chance of 95 %."""

    depth: int
    square: float
    low: float
    high: float


def truncation(
    halves: DualBuffer, depths: tuple[int, ...], deep: int, seconds: float = np.inf, pixels: int = PIXELS,
    count: int | None = None,
) -> list[DepthBias]:  # fmt: skip
    """What is left out at each of these depths, against `deep`.

    Half of the pixels that are looked at, `pixels` at most, are where paths go on beyond the least of the depths, as
    far as that is seen beforehand, the others anywhere else; in so few `seconds` that this is too long, all are
    anywhere, and fewer. count: samples of each in each half, else as many as the halves have; more where there are few
    such pixels.

    The same samples are taken with either depth, so that they differ by what is left out alone; of the two halves, the
    product of the differences has no bias as a square of their mean.
    """
    n, prepared = halves.n, halves.prepared
    count = count or min(int(halves.counts.min()), SAMPLES)
    most, rate = pixels, halves.pace.sample_seconds or 0.0
    if seconds < np.inf and rate:
        most = int(np.clip(seconds / (rate * 2 * count * (1 + len(depths))), FEWEST, pixels))
    there = np.zeros(n, bool)
    if rate * (n / 2 + 2 * _looks(n)) < seconds / 2:
        there[_ends(prepared, min(depths), deep)] = True
    settings = prepared.scene.settings
    rng, share, counts = np.random.default_rng(settings.seed), np.zeros(n), np.full(n, count)
    for where in map(np.flatnonzero, (there, ~there)):
        some = rng.permutation(where)[: most // 2 if there.any() else most]
        share[some] = len(where) / max(len(some), 1) / n
    if there.any():
        counts[there] = max(count, min(count * most // 2 // int(there.sum()), MORE))
    some = np.flatnonzero(share)
    # What chose the pixels must not say what is found there.
    scene = replace(prepared.scene, settings=replace(settings, seed=(settings.seed + 2**31) % 2**32))
    looked = subset(replace(prepared, scene=scene), some)
    a, b = _means(looked, counts[some], deep)
    found = []
    for depth in depths:
        left, right = (u - v for u, v in zip((a, b), _means(looked, counts[some], depth)))
        products = (left * right).mean(0) * share[some]
        square, spread = float(products.sum()), QUANTILE * np.sqrt(np.square(products).sum())
        found.append(DepthBias(depth, square, square - spread, square + spread))
    return found


def _ends(prepared: Prepared, depth: int, deep: int) -> np.ndarray:
    """The lanes about which paths go on beyond a depth. One sample of each fourth pixel tells about which there are
    paths at all, and more of these about which they go on: such pixels may be few, and hardly any sample of them."""
    n = len(prepared.order)
    lanes = np.arange(n)
    if depth:
        # Of tiles of 4 x 4 pixels a column; one bounce more than are followed, as the last may show a black mirror.
        lanes = _differing(prepared, lanes[:: AROUND - 1], (0, depth + 1), 1)
    looks = _looks(n)
    # Where they are many, some of them: others are nearby.
    some = lanes[:: max(len(lanes) // looks, 1)]
    return _differing(prepared, some, (depth, deep), int(np.clip(looks // max(len(some), 1), 1, MORE)))


def _looks(n: int) -> int:
    """How many samples look for where paths go on, of a picture of n pixels: little of what it takes itself."""
    return int(np.clip(n // 16, FEWEST_LOOKS, MOST_LOOKS))


def _differing(prepared: Prepared, lanes: np.ndarray, depths: tuple[int, int], count: int) -> np.ndarray:
    """The lanes about which so many samples of these differ by depth."""
    if not len(lanes):
        return lanes
    film, looked = prepared.scene.film, subset(prepared, lanes)
    once = np.repeat([count, 0], len(lanes))
    shallow, whole = (_at(looked, depth, once).means()[0] for depth in depths)
    picture = np.zeros(len(prepared.order))
    picture[looked.order] = (shallow != whole).any(0)
    near = windowed(picture.reshape(film.height, film.width), np.ones(AROUND)) > 0
    return np.flatnonzero(near.ravel()[prepared.order])


def _means(prepared: Prepared, counts: np.ndarray, depth: int) -> tuple[np.ndarray, np.ndarray]:
    """The halves' pixels with another depth and so many samples each. Shapes: counts (N); (3, N)."""
    return _at(prepared, depth, np.tile(counts, 2)).means()


def _at(prepared: Prepared, depth: int, targets: np.ndarray) -> DualBuffer:
    """Both halves with so many samples, and another depth, which is data: no kernel is made."""
    levels = (dr.opaque(prepared.a.U, depth), prepared.kernel.bounce_limits[1])
    halves = DualBuffer(replace(prepared, kernel=replace(prepared.kernel, bounce_limits=levels)))
    halves.extend(targets)
    return halves
