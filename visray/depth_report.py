"""The light that a picture lacks because paths end at settings.depth, found after its samples.

Some pixels are rendered once more, with the same samples and a much larger depth. No kernel is compiled for that,
because the depth is an input of the kernel. With an error that is asked for, adaptive/depth_bias.py says more.
"""

from dataclasses import replace

import numpy as np

from visray.adaptive.depth_bias import deeper_than, depth_without_bias, with_depth
from visray.errors import DepthWarning
from visray.film import Film
from visray.output.curves import LUMINANCE
from visray.passes import expose, subset
from visray.progress import Bar, Interrupts
from visray.records import altered
from visray.setup import Prepared
from visray.warn import warn

# Two of so many pixels are rendered again, but within these limits.
SHARE, LEAST_PIXELS, MOST_PIXELS = 128, 2**10, 2**13
# Pairs of a picture below which nothing is said: the interval needs that many products to hold.
LEAST_PAIRS = 32
# They get at most one of so many of the picture's samples, or so many in all, which take no time to speak of.
WORK, LEAST_SAMPLES = 32, 2**14
# Error that is worth a warning, as a share of the mean luminance.
NOTABLE = 0.01
# Standard errors from the estimate to the end of an interval that holds with a probability of 97.5 %.
QUANTILE = 1.96


def depth_facts(prepared: Prepared, film: Film, progress: bool, interrupts: Interrupts) -> dict[str, float]:
    """A fact for the metadata, and a warning where it is large: `depth_error_at_least`, the least error that ends of
    paths at settings.depth cause. It is the root mean square over pixels and channels, divided by the mean luminance,
    with a confidence of 97.5 %. {} where it is not known: with motion blur, in a black picture, in one of few pixels,
    and after Ctrl-C.

    film: the finished film
    """
    settings, on, n = prepared.scene.settings, prepared.features, len(film.counts)
    if not (on["reflection"] or on["refraction"]) or prepared.shutter or interrupts.requested or n < 2 * LEAST_PAIRS:
        return {}
    mean, lanes = np.array(film.mean), _chosen(n, settings.seed)
    luminance, tested = float((LUMINANCE @ mean).mean()), _tested(prepared, lanes)
    if not 0 < luminance < np.inf:
        return {}

    def rendered(depth: int) -> np.ndarray:
        return _rendered(tested, depth, interrupts) / luminance

    with Bar("looking beyond settings.depth", 1, progress):
        deepest, has_all = rendered(depth_without_bias(settings.depth)), tested.scene.settings.spp == settings.spp
        error = _least_error(deepest - (mean[:, lanes] / luminance if has_all else rendered(settings.depth)))
        remedy = ""
        for depth in deeper_than(settings.depth) if error > NOTABLE else ():
            # The root mean square is too large, by the noise in it.
            left = float(np.sqrt(np.square(deepest - rendered(depth)).mean()))
            remedy = f"; with {depth} it is about {_percent(left)} %"
            if left < NOTABLE:
                break
    if interrupts.requested:
        return {}
    if error > NOTABLE:
        text = f"leaves out light, which is an error of at least {_percent(error)} %{remedy}"
        warn(f"settings.depth = {settings.depth}: {text}", DepthWarning)
    return {"depth_error_at_least": error}


def _percent(share: float) -> str:
    """A share in percent, without the sign. In an animation, texts that differ only in numbers are said once."""
    return f"{100 * share:,.0f}" if share >= 1 else f"{round(100 * share, 2):.2g}"


def _tested(prepared: Prepared, lanes: np.ndarray) -> Prepared:
    """The prepared scene with only these lanes. They have the picture's samples, or only some if all of them would take
    long beside the picture, which has few pixels then."""
    settings = prepared.scene.settings
    samples = max(len(prepared.order) * settings.spp // WORK, LEAST_SAMPLES)
    few = altered(settings, {"spp": min(max(samples // len(lanes), 1), settings.spp)})
    return subset(replace(prepared, scene=altered(prepared.scene, {"settings": few})), lanes)


def _chosen(n: int, seed: int) -> np.ndarray:
    """Numbers of the lanes that are rendered again, out of n: pairs of neighbours. Each stretch of lanes has a pair at
    random in it. A single lane is its own neighbour.

    Stretches differ by a pair in length, so they begin at a random lane: else some lanes would be chosen more often.
    """
    all_pairs = max(n // 2, 1)
    pairs, rng = min(max(n // SHARE, LEAST_PIXELS // 2), MOST_PIXELS // 2, all_pairs), np.random.default_rng(seed)
    ends = rng.integers(all_pairs) + np.arange(pairs + 1) * all_pairs // pairs
    first = 2 * np.sort(rng.integers(ends[:-1], ends[1:]) % all_pairs)
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
