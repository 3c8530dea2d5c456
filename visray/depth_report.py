"""The light that a picture lacks because paths end at settings.depth, found after its samples.

Some pixels are rendered once more, with the same samples and a much larger depth. No kernel is compiled for that,
because the depth is an input of the kernel. With an error that is asked for, adaptive/depth_bias.py says more.
"""

import numpy as np

from visray.adaptive.depth_bias import deeper_than, depth_without_bias, with_depth
from visray.errors import DepthWarning
from visray.film import Film
from visray.output.curves import LUMINANCE
from visray.passes import expose, subset
from visray.progress import Bar, Interrupts
from visray.setup import Prepared
from visray.warn import warn

# Two of so many pixels are rendered again, but within these limits.
SHARE, LEAST_PIXELS, MOST_PIXELS = 128, 2**10, 2**13
# Error that is worth a warning, as a share of the mean luminance.
NOTABLE = 0.01
# Standard errors from the estimate to the end of an interval that holds with a probability of 97.5 %.
QUANTILE = 1.96


def depth_facts(prepared: Prepared, film: Film, progress: bool, interrupts: Interrupts) -> dict[str, float]:
    """A fact for the metadata, and a warning where it is large: `depth_error_at_least`, the least error that ends of
    paths at settings.depth cause. It is the root mean square over pixels and channels, divided by the mean luminance,
    with a confidence of 97.5 %. {} where it is not known: with motion blur, in a black picture, and after Ctrl-C.

    film: the finished film
    """
    settings, on = prepared.scene.settings, prepared.features
    if not (on["reflection"] or on["refraction"]) or prepared.shutter or interrupts.requested:
        return {}
    mean, lanes = np.array(film.mean), _chosen(len(film.counts), settings.seed)
    luminance, tested = float((LUMINANCE @ mean).mean()), subset(prepared, lanes)
    if luminance <= 0:
        return {}
    with Bar("looking beyond settings.depth", 1, progress):
        shallow, deepest = mean[:, lanes], _rendered(tested, depth_without_bias(settings.depth), interrupts)
        error = _least_error(deepest - shallow) / luminance
        remedy = ""
        for depth in deeper_than(settings.depth) if error > NOTABLE else ():
            # The root mean square is too large, by the noise in it.
            left = np.sqrt(np.square(deepest - _rendered(tested, depth, interrupts)).mean()) / luminance
            remedy = f"; with {depth} " + (f"it is about {100 * left:.2g} %" if left else "none is seen")
            if left < NOTABLE:
                break
    if interrupts.requested:
        return {}
    if error > NOTABLE:
        text = f"leaves out light, which is an error of at least {100 * error:.2g} %{remedy}"
        warn(f"settings.depth = {settings.depth}: {text}", DepthWarning)
    return {"depth_error_at_least": error}


def _chosen(n: int, seed: int) -> np.ndarray:
    """Numbers of the lanes that are rendered again, out of n: pairs of neighbours. Each stretch of lanes has a pair at
    random in it. A single lane is its own neighbour."""
    pairs = min(max(n // SHARE, LEAST_PIXELS // 2), MOST_PIXELS // 2, max(n // 2, 1))
    step = max(n // 2, 1) // pairs
    first = 2 * (np.arange(pairs) * step + np.random.default_rng(seed).integers(step, size=pairs))
    return np.minimum(first[:, None] + (0, 1), n - 1).ravel()


def _rendered(prepared: Prepared, depth: int, interrupts: Interrupts) -> np.ndarray:
    """Mean colours of the pixels, rendered with another depth. Shape: (3, N)."""
    return np.array(expose(with_depth(prepared, depth), interrupts=interrupts)[0].mean)


def _least_error(left_out: np.ndarray) -> float:
    """The least root mean square of the light that is left out, with a confidence of 97.5 %.

    left_out: that light in the pixels, with noise. Pixels 2 i and 2 i + 1 are neighbours. Shape: (3, N).

    The mean square of what is left out is at least the mean product of neighbours, since (u^2 + v^2) / 2 >= u v. Noise
    does not make that product larger, as it would make a square: the noise of two pixels is independent.
    """
    products = (left_out[:, ::2] * left_out[:, 1::2]).mean(0)
    low = products.mean() - QUANTILE * products.std() / np.sqrt(len(products))
    return float(np.sqrt(max(low, 0.0)))
