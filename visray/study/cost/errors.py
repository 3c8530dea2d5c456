"""Error of the pictures of many seeds, split into bias (the same for all seeds) and noise (different for each).

Let d_s be the difference of the picture of seed s from the reference, over the luminance, and a.b the mean over pixels
and channels of a product. The squared error is the mean of d_s.d_s; the squared bias is the mean of d_s.d_t over pairs
of different seeds. Both contain the noise of the reference, whose mean is subtracted. All results come from the S x S
matrix of d_s.d_t. Only the seeds are taken as independent, so pixels may depend on each other.

Intervals are those of the squares, by the jackknife over seeds and Student's t. A bootstrap would be wrong: a seed that
is drawn twice makes a pair that agrees completely, and adds its noise to the bias. Without a bias the jackknife finds
twice the variance of the mean over pairs; this known part is subtracted. Source: Efron, Stein 1981.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import atan, cos, pi, sin, sqrt

import numpy as np

from visray.output.curves import curve
from visray.study.cost.records import Band, Error

FEWEST = 4  # seeds: fewer do not tell the noise of pairs from the noise of seeds
FLIP_PICTURES = 4
DENSITY = 67.0  # pixels per degree, FLIP's default: a screen 0.7 m wide with 3840 pixels, seen from 0.7 m
BLOCK = 4_000_000  # numbers of all pictures that are in double at a time


@lru_cache
def student(dof: int) -> float:
    """Two-sided 95 % quantile of Student's t. Domain: dof >= 1. Source: Abramowitz, Stegun 26.7.3 and 26.7.4, by
    bisection."""

    def inside(t: float) -> float:
        angle = atan(t / sqrt(dof))
        c, odd = cos(angle), dof % 2
        term, total = (c if odd else 1.0), 0.0
        for i in range(odd, dof - 1, 2):
            total += term
            term *= (i + 1) / (i + 2) * c * c
        return 2 / pi * (angle + sin(angle) * total) if odd else sin(angle) * total

    low, high = 1.9, 13.0
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if inside(middle) < 0.95 else (low, middle)
    return (low + high) / 2


@dataclass(frozen=True)
class Split:
    """Relative error and its parts.

    rmse, bias, deviation: as in Error
    squares: squared error of each seed, shape (S); unbiased, so it may be below 0
    error_map: root mean square over seeds and channels, with the noise of the reference, shape (H, W)
    """

    rmse: Band
    bias: Band
    deviation: Band
    squares: np.ndarray
    error_map: np.ndarray


@dataclass(frozen=True)
class _Sums:
    """Means over pixels and channels. Let e_s be the difference of seed s from the mean of all seeds, and m the
    difference of that mean from the reference.

    apart: e_s.e_t, shape (S, S)
    along: e_s.m, shape (S)
    shared: m.m
    noise: variance of the reference
    unsure: variance of a squared error that the noise of the reference causes
    error_map: as in Split
    """

    apart: np.ndarray
    along: np.ndarray
    shared: float
    noise: float
    unsure: float
    error_map: np.ndarray

    @staticmethod
    def of(pictures: np.ndarray, reference: np.ndarray, variance: np.ndarray, luminance: float) -> "_Sums":
        seeds, height, width, _ = pictures.shape
        apart, along, shared, unsure, rms = np.zeros((seeds, seeds)), np.zeros(seeds), 0.0, np.zeros(2), []
        rows = max(1, BLOCK // (seeds * width * 3))
        noise = (variance.astype(np.float64) / luminance**2).mean(-1)
        for y in range(0, height, rows):
            part = slice(y, y + rows)
            d = (pictures[:, part].astype(np.float64) - reference[part]) / luminance
            mean = d.mean(0)
            # Products of d itself would cancel to rounding noise where seeds hardly differ.
            e = d - mean
            flat = e.reshape(seeds, -1)
            apart += flat @ flat.T
            along += flat @ mean.ravel()
            shared += (mean**2).sum()
            rms.append(np.sqrt((d**2).mean((0, 3))))
            own = (e**2).sum(0).mean(-1) / (seeds - 1)
            bias = (mean**2).mean(-1) - own / seeds - noise[part]
            unsure += [(noise[part] ** 2).sum(), (noise[part] * bias).sum()]
        n, pixels = reference.size, height * width
        # For normal noise, with channels taken as one: variance of its mean square and of its product with the bias.
        spread = (2 * unsure[0] + 4 * max(unsure[1], 0)) / pixels**2
        return _Sums(apart / n, along / n, float(shared) / n, float(noise.mean()), spread, np.concatenate(rms))


def split(pictures: np.ndarray, reference: np.ndarray, variance: np.ndarray, luminance: float) -> Split:
    """Error of pictures and its parts. Where a squared bias or error comes out below 0, it is given as 0, and the upper
    end of its interval says how large it may be. Then rmse may be a little smaller than deviation.

    variance: variance of the reference, estimated independently of the pictures; only its means over pixels count
    Shapes: pictures (S, H, W, 3), reference and variance (H, W, 3). Domain: S >= 4, luminance > 0.
    """
    s = len(pictures)
    if s < FEWEST:
        raise ValueError(f"{s} pictures: a band needs at least {FEWEST} seeds")
    sums = _Sums.of(pictures, reference, variance, luminance)
    alone = np.diag(sums.apart) + 2 * sums.along + sums.shared
    own = np.trace(sums.apart) / (s - 1)
    pairs = sums.shared - own / s
    # Mean over the pairs of each seed, and the change of the means over all pairs and seeds when it is left out.
    rows = (s * (sums.along + sums.shared) - alone) / (s - 1)
    less = 2 * (pairs - rows) / (s - 2)
    less_own = (alone.mean() - alone) / (s - 1) - less
    # The part of a pair's product that is not the sum of parts of its seeds: without a bias it is all there is.
    shift = (s - 1) / (s - 2) * (rows - pairs)
    product = sums.apart + sums.along[:, None] + sums.along + sums.shared
    rest = (product - shift[:, None] - shift - pairs)[np.triu_indices(s, 1)]
    pure = (rest**2).sum() / (s * (s - 3) / 2)
    least = 2 * pure / (s * (s - 1))
    by_pairs = max(_jackknife(less) - 4 * pure / (s * (s - 2)) + least, least)
    squares = alone - sums.noise
    return Split(
        rmse=_rooted(squares.mean(), squares.var(ddof=1) / s + sums.unsure, s - 1),
        bias=_rooted(pairs - sums.noise, by_pairs + sums.unsure, s - 1),
        deviation=_rooted(own, _jackknife(less_own), s - 1),
        squares=squares,
        error_map=sums.error_map,
    )


def judged(
    pictures: np.ndarray, reference: np.ndarray, variance: np.ndarray, luminance: float, with_flip: bool = True
) -> tuple[Error, np.ndarray, np.ndarray]:
    """Error of pictures in linear light, squared error of each seed, and error map, as `split` has them.

    mrse and flip contain the noise of the reference. flip is the mean of the first 4 pictures; it takes about 1.2 µs a
    pixel on two threads, and is NaN unless `with_flip`. Shapes: as of `split`; (S), (H, W).
    """
    parts = split(pictures, reference, variance, luminance)
    scale = 1 / (reference.astype(np.float64) + 0.01)
    mrse = float(np.mean([(((x - reference) * scale) ** 2).mean() for x in pictures]))
    visible = float(np.mean([flip(x, reference) for x in pictures[:FLIP_PICTURES]])) if with_flip else np.nan
    return Error(parts.rmse, parts.bias, parts.deviation, mrse, visible), parts.squares, parts.error_map


def flip(picture: np.ndarray, reference: np.ndarray, density: float = DENSITY) -> float:
    """Mean FLIP, the visible difference of two pictures shown in turn, 0 to 1. Pictures are in linear light, displayed
    in sRGB. density: pixels per degree. Shapes: (H, W, 3). Source: Andersson et al. 2020, NVIDIA's library."""
    import flip_evaluator  # slow to load

    displayed = (curve(np.clip(x, 0, 1).astype(np.float64), "srgb").astype(np.float32) for x in (reference, picture))
    return float(flip_evaluator.evaluate(*displayed, "LDR", True, False, True, {"ppd": density})[1])


def _jackknife(less: np.ndarray) -> float:
    """Variance of an estimate, from its changes when each seed is left out."""
    return (len(less) - 1) / len(less) * float((less**2).sum())


def _rooted(square: float, variance: float, dof: int) -> Band:
    """The root of a squared estimate, with its interval. variance: that of the square."""
    half = student(dof) * sqrt(variance)
    return Band(*(sqrt(max(float(x), 0.0)) for x in (square, square - half, square + half)))
