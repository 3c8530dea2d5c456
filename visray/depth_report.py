"""The light that a picture lacks because paths end at settings.depth, found after its samples.

Some pixels are rendered once more, with the same samples and a much larger depth. No kernel is compiled for that,
because the depth is an input of the kernel. With an error that is asked for, adaptive/depth_bias.py says more.
"""

import numpy as np

from visray.adaptive.depth_bias import deeper_than, depth_without_bias, with_depth
from visray.film import Film
from visray.output.curves import LUMINANCE
from visray.passes import expose, subset
from visray.progress import Bar, Interrupts
from visray.setup import Prepared
from visray.warn import warn

# One of so many pixels is rendered again, but within these limits.
SHARE, LEAST_PIXELS, MOST_PIXELS = 64, 2**10, 2**13
# Error that is worth a warning, as a share of the mean luminance.
NOTABLE = 0.01
# Standard errors to the end of an interval that holds with a probability of 97.5 %.
QUANTILE = 1.96


class DepthWarning(UserWarning):
    """Warning that settings.depth ends paths that carry light."""


def depth_facts(prepared: Prepared, film: Film, progress: bool, interrupts: Interrupts) -> dict[str, float]:
    """A fact for the metadata, and a warning where it is large: `depth_error_at_least`, the least error that ends of
    paths at settings.depth cause. It is the root mean square over pixels and channels, divided by the mean luminance,
    with a confidence of 97.5 %. {} where it is not known.

    film: the finished film. It tells nothing with a single sample of each pixel, since noise is not known then. Nothing
    is known either of motion blur, and of colours that a filter with negative weights has made.
    """
    settings, on, places = prepared.scene.settings, prepared.features, prepared.kernel.filter
    if not (on["reflection"] or on["refraction"]) or prepared.shutter or (places is not None and places.is_signed):
        return {}
    mean = np.array(film.mean)
    luminance = float((LUMINANCE @ mean).mean())
    if settings.spp < 2 or interrupts.requested or luminance <= 0:
        return {}
    lanes = _chosen(len(film.counts), settings.seed)
    tested, depth = subset(prepared, lanes), settings.depth
    with Bar("looking beyond settings.depth", 1, progress):
        deepest = _rendered(tested, depth_without_bias(depth), interrupts)
        if interrupts.requested:
            return {}
        shallow = mean[:, lanes], np.array(film.squares)[:, lanes] / (settings.spp - 1)
        error = _least_error(shallow, deepest, settings.spp) / luminance
        if error > NOTABLE:
            remedy = ""
            for larger in deeper_than(depth):
                left = _rms(_rendered(tested, larger, interrupts)[0] - deepest[0]) / luminance
                remedy = f"; with {larger} it is about {100 * left:.2g} %"
                if left < NOTABLE or interrupts.requested:
                    break
            text = f"leaves out light, which is an error of at least {100 * error:.2g} %{remedy}"
            warn(f"settings.depth = {depth}: {text}", DepthWarning)
    return {"depth_error_at_least": error}


def _chosen(n: int, seed: int) -> np.ndarray:
    """Numbers of the lanes that are rendered again, out of n: one at random of each stretch of neighbours."""
    step = n // min(max(n // SHARE, LEAST_PIXELS, 1), MOST_PIXELS, n)
    first = np.arange(0, n - step + 1, step)
    return first + np.random.default_rng(seed).integers(step, size=len(first))


def _rendered(prepared: Prepared, depth: int, interrupts: Interrupts) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of the samples of each pixel, rendered with another depth. Shapes: (3, N) twice."""
    film, _ = expose(with_depth(prepared, depth), interrupts=interrupts)
    return np.array(film.mean), np.array(film.squares) / (prepared.scene.settings.spp - 1)


def _least_error(shallow: tuple, deep: tuple, spp: int) -> float:
    """The least root mean square error of the shallow picture, with a confidence of 97.5 %.

    shallow, deep: mean and variance of the same samples S of each pixel with two depths. The deep ones are S + X. The
    light X that the depth leaves out is not negative, nor is S.

    The squared difference of the means, d, is too large by the variance of X / spp. That variance is not known, but
    Var(S + X) = Var(S) + Var(X) + 2 Cov(S, X), and Cov(S, X) >= -E(S) E(X), as E(S X) >= 0. So it is at most Var(S + X)
    - Var(S) + 2 E(S) E(X). Taking this away leaves a square that is too small rather than too large.
    """
    (mean, variance), (deep_mean, deep_variance) = shallow, deep
    difference = deep_mean - mean
    noise = np.maximum(deep_variance - variance + 2 * mean * difference, 0) / spp
    squares = (difference**2 - noise).mean(0)
    low = squares.mean() - QUANTILE * squares.std() / np.sqrt(len(squares))
    return float(np.sqrt(max(low, 0.0)))


def _rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.square(values).mean()))
