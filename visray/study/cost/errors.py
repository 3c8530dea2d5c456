"""How far pictures of many seeds are off: the error, split into what all seeds share and what each has of its own.

Of seed s, d_s is the difference from the reference over the luminance, and a.b the mean over pixels and channels of
the product. The mean of d_s.d_s is the squared error, that of d_s.d_t over pairs of unlike seeds the squared bias; both
with the reference's own noise in them, whose mean is taken off. Nothing else is needed: all figures come from the S x S
matrix of d_s.d_t, and the seeds are what varies in them, so that pixels may depend on each other.

Bands are of the squares, by the jackknife over seeds and Student's t. A bootstrap is no good here: a seed drawn twice
is a pair that agrees entirely, and adds its noise to the bias. Without a bias the jackknife finds twice the variance of
the mean over pairs; that much is known and taken off. Source: Efron, Stein 1981.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import atan, cos, pi, sin, sqrt

import numpy as np

from visray.output.curves import curve
from visray.study.cost.records import Band, Error

FEWEST = 4  # seeds: with fewer, pairs cannot be told from what their seeds share
SEEN = 4  # pictures that FLIP is taken of
DENSITY = 67.0  # pixels per degree, FLIP's own default: a screen 0.7 m wide, 3840 pixels, from 0.7 m
BLOCK = 4_000_000  # numbers of all pictures that are held in double at a time


@lru_cache
def student(dof: int) -> float:
    """The number that Student's t exceeds in size with a chance of 5 %. Domain: dof >= 1. Source: Abramowitz, Stegun
    26.7.3 and 26.7.4, by bisection."""

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
    """The parts of the error, relative. squares: of each seed, unbiased, so that they may fall below 0. wrong: root
    mean square over seeds and channels, with the reference's noise. Shapes: squares (S), wrong (H, W)."""

    rmse: Band
    bias: Band
    deviation: Band
    squares: np.ndarray
    wrong: np.ndarray


@dataclass(frozen=True)
class _Sums:
    """Means over pixels and channels. apart: of the products of what seeds differ from their mean by; along: of these
    with the mean's own difference from the reference; shared: the square of that. noise: of the reference, squared;
    unsure: the variance that it gives to a squared error. wrong: as in Split. Shapes: apart (S, S), along (S)."""

    apart: np.ndarray
    along: np.ndarray
    shared: float
    noise: float
    unsure: float
    wrong: np.ndarray

    @staticmethod
    def of(pictures: np.ndarray, reference: np.ndarray, variance: np.ndarray, luminance: float) -> "_Sums":
        seeds, height, width, _ = pictures.shape
        apart, along, shared, unsure, wrong = np.zeros((seeds, seeds)), np.zeros(seeds), 0.0, np.zeros(2), []
        rows = max(1, BLOCK // (seeds * width * 3))
        noise = (variance.astype(np.float64) / luminance**2).mean(-1)
        for y in range(0, height, rows):
            part = slice(y, y + rows)
            d = (pictures[:, part].astype(np.float64) - reference[part]) / luminance
            mean = d.mean(0)
            # Not d itself: where seeds hardly differ, its products would cancel to nothing but rounding.
            e = d - mean
            flat = e.reshape(seeds, -1)
            apart += flat @ flat.T
            along += flat @ mean.ravel()
            shared += (mean**2).sum()
            wrong.append(np.sqrt((d**2).mean((0, 3))))
            own = (e**2).sum(0).mean(-1) / (seeds - 1)
            bias = (mean**2).mean(-1) - own / seeds - noise[part]
            unsure += [(noise[part] ** 2).sum(), (noise[part] * bias).sum()]
        n, pixels = reference.size, height * width
        # Normal noise, its channels taken as one: variances of its mean square, and of its product with the bias.
        spread = (2 * unsure[0] + 4 * max(unsure[1], 0)) / pixels**2
        return _Sums(apart / n, along / n, float(shared) / n, float(noise.mean()), spread, np.concatenate(wrong))


def split(pictures: np.ndarray, reference: np.ndarray, variance: np.ndarray, luminance: float) -> Split:
    """The parts of the error of pictures. Of bias and rmse, 0 stands for a squared one that came out below 0; the high
    end says what may be there still. Then rmse may be less than deviation, by what the bias is unsure.

    variance: of the reference, as a mean that is independent of the pictures; of it only means over pixels count.
    Shapes: pictures (S, H, W, 3), reference and variance (H, W, 3). Domain: S >= 4, luminance > 0.
    """
    s = len(pictures)
    if s < FEWEST:
        raise ValueError(f"{s} pictures: a band needs at least {FEWEST} seeds")
    sums = _Sums.of(pictures, reference, variance, luminance)
    alone = np.diag(sums.apart) + 2 * sums.along + sums.shared
    own = np.trace(sums.apart) / (s - 1)
    pairs = sums.shared - own / s
    # The mean over the pairs of each seed, and what leaving it out does to the mean over all pairs, and to its own.
    rows = (s * (sums.along + sums.shared) - alone) / (s - 1)
    less = 2 * (pairs - rows) / (s - 2)
    less_own = (alone.mean() - alone) / (s - 1) - less
    # What a pair has that neither of its seeds brings along: without a bias there is nothing else.
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
        wrong=sums.wrong,
    )


def judged(
    pictures: np.ndarray, reference: np.ndarray, variance: np.ndarray, luminance: float, whole: bool = True
) -> tuple[Error, np.ndarray, np.ndarray]:
    """The error of pictures in linear light, the squared one of each seed, and where it is; all as `split` has them.

    mrse has the reference's noise in it, and flip too, which is the mean over the first 4 pictures: it takes about
    1.2 µs a pixel on two threads, and is not a number unless `whole`. Shapes: as of `split`; (S), (H, W).
    """
    parts = split(pictures, reference, variance, luminance)
    scale = 1 / (reference.astype(np.float64) + 0.01)
    mrse = float(np.mean([(((x - reference) * scale) ** 2).mean() for x in pictures]))
    seen = float(np.mean([flip(x, reference) for x in pictures[:SEEN]])) if whole else np.nan
    return Error(parts.rmse, parts.bias, parts.deviation, mrse, seen), parts.squares, parts.wrong


def flip(picture: np.ndarray, reference: np.ndarray, density: float = DENSITY) -> float:
    """How unlike the two look by turns, 0 to 1: mean FLIP of pictures in linear light, displayed in sRGB. density:
    pixels per degree. Shapes: (H, W, 3). Source: Andersson et al. 2020, NVIDIA's own library."""
    import flip_evaluator  # it takes a while to load

    shown = (curve(np.clip(x, 0, 1).astype(np.float64), "srgb").astype(np.float32) for x in (reference, picture))
    return float(flip_evaluator.evaluate(*shown, "LDR", True, False, True, {"ppd": density})[1])


def _jackknife(less: np.ndarray) -> float:
    """The variance of a figure, by what leaving out each of its seeds does to it."""
    return (len(less) - 1) / len(less) * float((less**2).sum())


def _rooted(square: float, variance: float, dof: int) -> Band:
    """The band of the root of a figure that has this variance."""
    half = student(dof) * sqrt(variance)
    return Band(*(sqrt(max(float(x), 0.0)) for x in (square, square - half, square + half)))
