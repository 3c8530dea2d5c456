"""Depth bias: the light that a picture lacks because paths end at settings.depth.

It is estimated on test pixels, a small random choice of the picture's pixels. They are rendered with two depths, the
depth in question and a much larger one, the reference depth. Each is rendered in the two halves of a dual buffer
(dual_buffer.py).
"""

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from visray.adaptive.dual_buffer import QUANTILE, DualBuffer, window_sums
from visray.passes import subset
from visray.scene.scene import DEEPEST
from visray.setup import Prepared

# Largest and smallest number of test pixels. Largest number of samples of a test pixel in each half; also if few paths
# continue.
PIXELS, LEAST_PIXELS, SAMPLES, MORE_SAMPLES = 2**13, 2**8, 16, 32
# Smallest and largest number of samples in the search for pixels whose paths continue. The search also chooses all
# pixels in a window around each pixel that it finds; WINDOW is the side of this window.
LEAST_SEARCH, MOST_SEARCH, WINDOW = 2**12, 2**16, 5


@dataclass(frozen=True)
class DepthBias:
    """Estimated mean square of the depth bias over pixels and channels.

    depth: depth at which paths end.
    square: the estimate. It may be slightly negative.
    low, high: interval that contains the true mean square with a probability of 95 %.
    """

    depth: int
    square: float
    low: float
    high: float


def depth_without_bias(depth: int) -> int:
    """The depth of the pictures with which those of a depth are compared."""
    return min(8 * depth + 8, 2 * DEEPEST)


def deeper_than(depth: int) -> tuple[int, ...]:
    """Larger depths that may be recommended in place of a depth, in order. () for the largest one."""
    return tuple(sorted({min(n, DEEPEST) for n in (2 * depth + 2, 4 * depth + 4)} - {depth}))


def with_depth(prepared: Prepared, depth: int) -> Prepared:
    """The prepared scene with another settings.depth in its kernel. No kernel is compiled, because the depth is an
    input of the kernel."""
    limits = (dr.opaque(prepared.a.U, depth), prepared.kernel.bounce_limits[1])
    return replace(prepared, kernel=replace(prepared.kernel, bounce_limits=limits))


def depth_biases(
    buffer: DualBuffer, depths: tuple[int, ...], reference_depth: int, seconds: float = np.inf, pixels: int = PIXELS,
    count: int | None = None,
) -> list[DepthBias]:  # fmt: skip
    """Estimated bias of each of several depths, as a list.

    buffer: dual buffer with a pilot of the picture.
    depths: the depths.
    reference_depth: depth that counts as free of bias.
    seconds: time that the estimate may take.
    pixels: largest number of test pixels.
    count: number of samples of a test pixel in each half; by default as many as `buffer` has, at most SAMPLES. If few
        paths continue, a pixel with such paths gets more.

    A quick search finds pixels with paths that continue beyond the smallest of the depths. Half of the test pixels are
    drawn at random from these pixels, and the other half from the rest. If the time is short, there are fewer test
    pixels. If it is too short for the search, all test pixels are drawn from the whole picture.

    The two depths are rendered with the same samples, so that the difference of a pixel contains only the bias. The
    product of the differences in the two halves is an unbiased estimate of the squared bias. The square of their mean
    would not be unbiased.
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
    # The seed is not that of the search, because the samples that chose a pixel must not estimate its bias as well.
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
    """Numbers of the lanes of pixels near which paths continue beyond a depth.

    The search has two steps, because such pixels may be few, and only few samples of such a pixel may continue. First,
    one sample of every fourth pixel finds where paths have any reflection or refraction. Then more samples of these
    pixels find the paths that continue beyond the depth.
    """
    n = len(prepared.order)
    lanes = np.arange(n)
    if depth:
        # Lanes are in tiles of 4 x 4 pixels, so every fourth lane is one column of each tile. The depth 0 is compared
        # with depth + 1, not with depth, because the last surface of a path may be a mirror, which looks black.
        lanes = _differing(prepared, lanes[:: WINDOW - 1], (0, depth + 1), 1)
    samples = _search_samples(n)
    # If there are very many lanes, only some are searched. The windows around these lanes cover the others.
    searched = lanes[:: max(len(lanes) // samples, 1)]
    count = int(np.clip(samples // max(len(searched), 1), 1, MORE_SAMPLES))
    return _differing(prepared, searched, (depth, reference_depth), count)


def _search_samples(n: int) -> int:
    """Number of samples for the search in a picture of n pixels. They are few compared with the picture's samples."""
    return int(np.clip(n // 16, LEAST_SEARCH, MOST_SEARCH))


def _differing(prepared: Prepared, lanes: np.ndarray, depths: tuple[int, int], count: int) -> np.ndarray:
    """Numbers of the lanes in the windows around those of the given lanes whose colour differs between two depths.

    count: number of samples of each given lane.
    """
    if not len(lanes):
        return lanes
    film, tested = prepared.scene.film, subset(prepared, lanes)
    only_half_a = np.repeat([count, 0], len(lanes))
    shallow, deep = (_rendered(tested, depth, only_half_a).means()[0] for depth in depths)
    differs = np.zeros(len(prepared.order))
    differs[tested.order] = (shallow != deep).any(0)
    near = window_sums(differs.reshape(film.raster[::-1]), np.ones(WINDOW)) > 0
    return np.flatnonzero(near.ravel()[prepared.order])


def _means(prepared: Prepared, counts: np.ndarray, depth: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean colours of the pixels in both halves, rendered with another depth.

    counts: number of samples of each pixel in each half.

    Shapes: counts (N); result (3, N) twice.
    """
    return _rendered(prepared, depth, np.tile(counts, 2)).means()


def _rendered(prepared: Prepared, depth: int, targets: np.ndarray) -> DualBuffer:
    """Dual buffer, rendered with another depth.

    targets: number of samples of each lane of the dual buffer. Shape: (2 N).
    """
    buffer = DualBuffer(with_depth(prepared, depth))
    buffer.extend(targets)
    return buffer
