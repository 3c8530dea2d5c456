"""Depth bias: the light that a picture lacks because paths end at settings.depth."""

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from visray.adaptive.dual_buffer import QUANTILE, DualBuffer, window_sums
from visray.passes import subset
from visray.setup import Prepared

# Number of test pixels, at most and at least; samples of each in each half, at most, and where test pixels are few.
PIXELS, LEAST_PIXELS, SAMPLES, MORE_SAMPLES = 2**13, 2**8, 16, 32
# Samples that search for pixels with continuing paths, at least and at most, and the side of the window of pixels
# around such a pixel that also counts.
LEAST_SEARCH, MOST_SEARCH, WINDOW = 2**12, 2**16, 5


@dataclass(frozen=True)
class DepthBias:
    """Estimated mean square of the depth bias over pixels and channels.

    depth: the depth at which paths end. square: the estimate. low, high: interval that contains the true mean square
    with a probability of 95 %.
    """

    depth: int
    square: float
    low: float
    high: float


def depth_biases(
    buffer: DualBuffer, depths: tuple[int, ...], reference_depth: int, seconds: float = np.inf, pixels: int = PIXELS,
    count: int | None = None,
) -> list[DepthBias]:  # fmt: skip
    """Bias of each of these depths, as the difference from `reference_depth`, estimated on test pixels.

    Half of the test pixels are random pixels whose paths continue beyond the smallest of the depths, as far as a quick
    search finds them; the other half are random pixels among the rest. If `seconds` are too few for the search, there
    are fewer test pixels, all of them random.

    Both depths use the same samples, so that only the bias differs. The product of the differences of the two halves
    estimates its square without bias, unlike the square of their mean.

    pixels: largest number of test pixels.
    count: samples of each in each half, by default as many as `buffer` has; more where few paths continue.
    """
    n, prepared = buffer.n, buffer.prepared
    count = count or min(int(buffer.counts.min()), SAMPLES)
    most, rate = pixels, buffer.pace.sample_seconds or 0.0
    if seconds < np.inf and rate:
        most = int(np.clip(seconds / (rate * 2 * count * (1 + len(depths))), LEAST_PIXELS, pixels))
    continues = np.zeros(n, bool)
    if rate * (n / 2 + 2 * _search_samples(n)) < seconds / 2:
        continues[_continuing(prepared, min(depths), reference_depth)] = True
    settings = prepared.scene.settings
    rng, weights, counts = np.random.default_rng(settings.seed), np.zeros(n), np.full(n, count)
    for group in map(np.flatnonzero, (continues, ~continues)):
        chosen = rng.permutation(group)[: most // 2 if continues.any() else most]
        weights[chosen] = len(group) / max(len(chosen), 1) / n
    if continues.any():
        counts[continues] = max(count, min(count * most // 2 // int(continues.sum()), MORE_SAMPLES))
    lanes = np.flatnonzero(weights)
    # Another seed than in the search: the samples that chose the pixels must not also estimate their bias.
    scene = replace(prepared.scene, settings=replace(settings, seed=(settings.seed + 2**31) % 2**32))
    tested = subset(replace(prepared, scene=scene), lanes)
    a, b = _means(tested, counts[lanes], reference_depth)
    biases = []
    for depth in depths:
        difference_a, difference_b = (u - v for u, v in zip((a, b), _means(tested, counts[lanes], depth)))
        products = (difference_a * difference_b).mean(0) * weights[lanes]
        square, spread = float(products.sum()), QUANTILE * np.sqrt(np.square(products).sum())
        biases.append(DepthBias(depth, square, square - spread, square + spread))
    return biases


def _continuing(prepared: Prepared, depth: int, reference_depth: int) -> np.ndarray:
    """Lanes near which paths continue beyond a depth.

    One sample of every fourth pixel finds where there are paths at all; then more samples there find where they
    continue. Such pixels may be few, and only few of a pixel's samples may continue.
    """
    n = len(prepared.order)
    lanes = np.arange(n)
    if depth:
        # Lanes are in tiles of 4 x 4 pixels, so every fourth lane is one column of each tile. One bounce more than
        # `depth` is compared, since the last bounce that is followed may show a black mirror.
        lanes = _differing(prepared, lanes[:: WINDOW - 1], (0, depth + 1), 1)
    samples = _search_samples(n)
    # Of very many lanes only some are searched; the window around these covers the others.
    searched = lanes[:: max(len(lanes) // samples, 1)]
    count = int(np.clip(samples // max(len(searched), 1), 1, MORE_SAMPLES))
    return _differing(prepared, searched, (depth, reference_depth), count)


def _search_samples(n: int) -> int:
    """Number of samples that search for continuing paths in a picture of n pixels; few compared with its own."""
    return int(np.clip(n // 16, LEAST_SEARCH, MOST_SEARCH))


def _differing(prepared: Prepared, lanes: np.ndarray, depths: tuple[int, int], count: int) -> np.ndarray:
    """Lanes in the window around one of these lanes whose mean of `count` samples differs between two depths."""
    if not len(lanes):
        return lanes
    film, tested = prepared.scene.film, subset(prepared, lanes)
    only_half_a = np.repeat([count, 0], len(lanes))
    shallow, deep = (_rendered(tested, depth, only_half_a).means()[0] for depth in depths)
    differs = np.zeros(len(prepared.order))
    differs[tested.order] = (shallow != deep).any(0)
    near = window_sums(differs.reshape(film.height, film.width), np.ones(WINDOW)) > 0
    return np.flatnonzero(near.ravel()[prepared.order])


def _means(prepared: Prepared, counts: np.ndarray, depth: int) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of both halves at another depth. `counts`: samples of each pixel in each half. Shapes: (N); (3, N)."""
    return _rendered(prepared, depth, np.tile(counts, 2)).means()


def _rendered(prepared: Prepared, depth: int, targets: np.ndarray) -> DualBuffer:
    """Dual buffer rendered at another depth. The depth is data of the kernel, so nothing is compiled."""
    limits = (dr.opaque(prepared.a.U, depth), prepared.kernel.bounce_limits[1])
    buffer = DualBuffer(replace(prepared, kernel=replace(prepared.kernel, bounce_limits=limits)))
    buffer.extend(targets)
    return buffer
