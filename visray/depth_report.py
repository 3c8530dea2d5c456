"""The light that a picture lacks because paths end at settings.depth, found after its samples.

Some pixels are rendered once more, with the same samples and a much larger depth. No kernel is compiled for that,
because the depth is an input of the kernel. With an error that is asked for, adaptive/depth_bias.py says more.
"""

from dataclasses import dataclass, replace

import numpy as np

from visray.adaptive.depth_bias import deeper_than, depth_without_bias, with_depth
from visray.adaptive.dual_buffer import QUANTILE
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
# Largest number of further pairs of a stretch in which light is left out. All are about half as many as the first ones
# at most, since paths are long there.
MORE_PAIRS = 8
# They get at most one of so many of the picture's samples, or so many in all, which take no time to speak of.
WORK, LEAST_SAMPLES = 32, 2**14
# Error that is worth a warning, as a share of the mean luminance.
NOTABLE = 0.01


def depth_facts(prepared: Prepared, film: Film, progress: bool, interrupts: Interrupts) -> dict[str, float]:
    """A fact for the metadata, and a warning where it is large: `depth_error_at_least`, the least error that ends of
    paths at settings.depth cause. It is the root mean square over pixels and channels, divided by the mean luminance,
    with a confidence of 97.5 %. {} where it is not known: with motion blur, in a black picture, in one of few pixels,
    and after Ctrl-C.

    film: the finished film
    """
    depth, on, n = prepared.scene.settings.depth, prepared.features, len(film.counts)
    if not (on["reflection"] or on["refraction"]) or prepared.shutter or interrupts.requested or n < 2 * LEAST_PAIRS:
        return {}
    mean = np.array(film.mean)
    luminance = float((LUMINANCE @ mean).mean())
    if not 0 < luminance < np.inf:
        return {}
    with Bar("looking beyond settings.depth", 1, progress):
        look = _Look.at(prepared, mean, luminance, interrupts)
        error = look.least_error()
        remedy = ""
        for larger in deeper_than(depth) if error > NOTABLE and not interrupts.requested else ():
            left = look.error_of(larger)
            remedy = f"; with {larger} it is about {_percent(left)} %"
            if left < NOTABLE:
                break
    if interrupts.requested:
        return {}
    if error > NOTABLE:
        text = f"leaves out light, which is an error of at least {_percent(error)} %{remedy}"
        warn(f"settings.depth = {depth}: {text}", DepthWarning)
    return {"depth_error_at_least": error}


def _percent(share: float) -> str:
    """A share in percent, without the sign. In an animation, texts that differ only in numbers are said once."""
    return f"{100 * share:,.0f}" if share >= 1 else f"{round(100 * share, 2):.2g}"


@dataclass(frozen=True)
class _Look:
    """A look at some pixels of a picture with a depth that counts as free of bias.

    tested: the prepared scene with these pixels: pairs of neighbours, 2 i and 2 i + 1
    shallow, deepest: their colours as they are, and with that depth, divided by the mean luminance. Shapes: (3, pixels)
    share: share of the picture for which the pixels stand; beyond it, no light is known to be left out
    """

    tested: Prepared
    shallow: np.ndarray
    deepest: np.ndarray
    share: float
    luminance: float
    interrupts: Interrupts

    @staticmethod
    def at(prepared: Prepared, mean: np.ndarray, luminance: float, interrupts: Interrupts) -> "_Look":
        """A look at pixels of the whole picture; and if light is left out in some stretches of them only, at other
        pixels of these. What no pixel of a stretch has told is then missing, so errors are rather too small.

        mean: the picture's colours. Shape: (3, N)
        """
        settings = prepared.scene.settings
        stretches = _Stretches.of(len(prepared.order), settings.seed)

        def look(pairs: np.ndarray, share: float) -> _Look:
            lanes = _lanes(pairs, len(prepared.order))
            tested = _tested(prepared, lanes)
            deepest = _rendered(tested, depth_without_bias(settings.depth), interrupts)
            has_all = tested.scene.settings.spp == settings.spp
            shallow = mean[:, lanes] if has_all else _rendered(tested, settings.depth, interrupts)
            return _Look(tested, shallow / luminance, deepest / luminance, share, luminance, interrupts)

        first = look(stretches.pairs, 1.0)
        lacking = np.flatnonzero((first.left_out != 0).any(0).reshape(-1, 2).any(1))
        if interrupts.requested or not len(lacking) or not len(more := stretches.other_pairs(lacking)):
            return first
        return look(more, len(lacking) / len(stretches.pairs))

    @property
    def left_out(self) -> np.ndarray:
        """The light that is left out, with noise. Shape: (3, pixels)."""
        return self.deepest - self.shallow

    def least_error(self) -> float:
        """The least error of the picture (_least_square)."""
        return float(np.sqrt(self.share * _least_square(self.left_out)))

    def error_of(self, depth: int) -> float:
        """The error that the picture has with another depth. It is too large, by the noise in it."""
        left_out = self.deepest - _rendered(self.tested, depth, self.interrupts) / self.luminance
        return float(np.sqrt(self.share * np.square(left_out).mean()))


def _tested(prepared: Prepared, lanes: np.ndarray) -> Prepared:
    """The prepared scene with only these lanes. They have the picture's samples, or only some if all of them would take
    long beside the picture, which has few pixels then."""
    settings = prepared.scene.settings
    samples = max(len(prepared.order) * settings.spp // WORK, LEAST_SAMPLES)
    few = altered(settings, {"spp": min(max(samples // len(lanes), 1), settings.spp)})
    return subset(replace(prepared, scene=altered(prepared.scene, {"settings": few})), lanes)


@dataclass(frozen=True)
class _Stretches:
    """Stretches of the pairs of neighbouring lanes, with a pair at random in each.

    They differ by a pair in length, so they begin at a random lane: else some lanes would be chosen more often.

    rng: a generator of random numbers
    begins: number of the first pair of each stretch, before it is wrapped around at `count`
    least: number of pairs in the shortest stretch
    pairs: number of the random pair of each stretch, before it is wrapped around
    count: number of all pairs
    """

    rng: np.random.Generator
    begins: np.ndarray
    least: int
    pairs: np.ndarray
    count: int

    @staticmethod
    def of(n: int, seed: int) -> "_Stretches":
        """The stretches of n lanes."""
        count, rng = max(n // 2, 1), np.random.default_rng(seed)
        number = min(max(n // SHARE, LEAST_PIXELS // 2), MOST_PIXELS // 2, count)
        ends = rng.integers(count) + np.arange(number + 1) * count // number
        return _Stretches(rng, ends[:-1], count // number, rng.integers(ends[:-1], ends[1:]), count)

    def other_pairs(self, chosen: np.ndarray) -> np.ndarray:
        """Further pairs at random in some stretches, all of them different. chosen: numbers of the stretches"""
        each = min(MORE_PAIRS, self.least - 1, max(len(self.pairs) // (2 * len(chosen)), 1))
        places = np.tile(np.arange(self.least - 1), (len(chosen), 1))
        found = self.begins[chosen, None] + self.rng.permuted(places, axis=1)[:, :each]
        # Sorted, as neighbours in the picture are rendered faster side by side.
        return np.sort(found + (found >= self.pairs[chosen, None]), axis=None)


def _lanes(pairs: np.ndarray, n: int) -> np.ndarray:
    """Numbers of the lanes of some pairs, in order. n: number of all lanes. A single lane is its own neighbour."""
    first = 2 * (pairs % max(n // 2, 1))
    return np.minimum(first[:, None] + (0, 1), n - 1).ravel()


def _rendered(prepared: Prepared, depth: int, interrupts: Interrupts) -> np.ndarray:
    """Mean colours of the pixels, rendered with another depth. Shape: (3, N)."""
    return np.array(expose(with_depth(prepared, depth), interrupts=interrupts)[0].mean)


def _least_square(left_out: np.ndarray) -> float:
    """The least mean square of the light that is left out, with a confidence of 97.5 %.

    left_out: that light in the pixels, with noise. Pixels 2 i and 2 i + 1 are neighbours. Shape: (3, N).

    The mean square of what is left out is at least the mean product of neighbours, since (u^2 + v^2) / 2 >= u v. Noise
    does not make that product larger, as it would make a square: the noise of two pixels is independent.
    """
    products = (left_out[:, ::2] * left_out[:, 1::2]).mean(0)
    return max(float(products.mean() - QUANTILE * products.std() / np.sqrt(len(products))), 0.0)
