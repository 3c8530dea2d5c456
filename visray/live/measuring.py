"""What effects cost, measured in short pieces of work, between which the live picture goes on.

As in study/ablation.py, a small picture with all effects (the full picture) runs just before and just after one without
an effect. Only the time of the kernels counts, not that of Python. The picture is so small that a piece of work takes
about RENDER_SECONDS, but for those that compile.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import prod
from statistics import median

from visray.setup import Prepared
from visray.study.alternation import Alternation
from visray.study.leaving_out import less
from visray.study.spread import Spread
from visray.study.timed_picture import LONGEST_SIDE, TimedPicture, reduced_size

# Seconds that the kernel of a small picture should run, and samples per pixel that it has at most.
RENDER_SECONDS, MOST_SAMPLES = 0.05, 16
# Number of differences that are measured for each effect: the fewest of which the bounds of a Spread leave out the
# least and the largest, which other work of the machine may have made.
RUNS = 12
# Pixels of the longer side in the first trial, and how much larger than a trial a picture may be: a short time says
# little about a long one.
FIRST_SIDE, GROWTH = 24, 64


@dataclass(frozen=True)
class EffectCost:
    """What an effect costs.

    seconds: time of one sample of each pixel of the whole picture
    share: the same, as a share of the time with all effects
    along: names of the effects that are left out together with it
    """

    seconds: Spread
    share: Spread
    along: tuple[str, ...] = ()

    def text(self) -> str:
        """Text such as `2.1 ms (1.8 to 2.5), 14 % of the picture`."""
        if self.seconds.in_noise:
            most = max(-self.share.low, self.share.high)
            return f"in the noise, {milliseconds(self.seconds)}" + (f", < {_percent(most)}" if most < 1 else "")
        return f"{milliseconds(self.seconds)}, {_percent(self.share.middle)} of the picture"


class Measurement:
    """Measures what each effect of a prepared scene costs.

    prepared: the scene, with the camera and the size of the whole picture
    costs: the cost of each effect that is measured so far, by name
    total: seconds of one sample of each pixel with all effects; None before it is measured
    share_done: share of the work that is done
    doing: what is done now, as a text
    number: number of the effect that is measured now, from 1; 0 before the first
    """

    def __init__(self, prepared: Prepared):
        self.prepared, self.effects = prepared, prepared.features.names()
        self.costs: dict[str, EffectCost] = {}
        self.total: Spread | None = None
        self.share_done, self.doing, self.number = 0.0, "compiling", 0

    def pieces(self) -> Iterator[None]:
        """Does the work. Each item of the iterator is one piece."""
        small = sized(self.prepared, FIRST_SIDE, 1)
        for _ in range(2):
            full = TimedPicture(small)
            full.kernels()
            yield
            small = fitting(self.prepared, small, full.seconds())
            yield
        full, film = TimedPicture(small), self.prepared.scene.film
        full.kernels()
        yield
        scale = prod(film.raster) / samples_of(small)
        times: list[float] = []
        for number, effect in enumerate(self.effects):
            self.doing, self.share_done = f"compiling without {effect}", number / len(self.effects)
            self.number = number + 1
            # Said before it compiles.
            yield
            without = TimedPicture(less(small, effect))
            yield
            without.kernels()
            yield
            self.doing = f"measuring {effect}"
            turns = Alternation(full, {effect: without})
            yield from turns.runs(RUNS)
            times += turns.full_seconds
            whole, gone = median(turns.full_seconds), without.prepared.features
            along = tuple(e for e in self.effects if e != effect and not gone[e])
            differences = turns.differences[effect]
            seconds, share = (Spread.of([k * x for x in differences]) for k in (scale, 1 / whole))
            self.costs[effect] = EffectCost(seconds, share, along)
        if times:
            self.total = Spread.of([scale * x for x in times])
        self.doing, self.share_done = "", 1.0


def sized(prepared: Prepared, longest: int, spp: int) -> Prepared:
    """The prepared scene with a film of at most `longest` pixels a side, and `spp` samples per pixel."""
    scene = prepared.scene
    film = scene.film.resized(reduced_size(*scene.film.size, longest))
    settings = replace(scene.settings, spp=spp)
    return prepared.adjusted(replace(scene, film=film, settings=settings))


def samples_of(prepared: Prepared) -> int:
    """Number of samples of a picture, over all pixels."""
    return prod(prepared.scene.film.raster) * prepared.scene.settings.spp


def fitting(prepared: Prepared, trial: Prepared, seconds: float) -> Prepared:
    """The prepared scene with as large a picture as takes about RENDER_SECONDS.

    trial: the same scene with a smaller picture, whose kernels ran for `seconds`
    """
    known, film = samples_of(trial), prepared.scene.film
    room = int(min(known * RENDER_SECONDS / max(seconds, 1e-9), known * GROWTH))
    width, height = reduced_size(*film.size, LONGEST_SIDE)
    if room >= width * height:
        return sized(prepared, LONGEST_SIDE, min(room // (width * height), MOST_SAMPLES))
    shrunk = (room / (width * height)) ** 0.5
    return sized(prepared, max(int(max(width, height) * shrunk), 1), 1)


def milliseconds(spread: Spread) -> str:
    """A time with its uncertainty, in milliseconds."""
    low, middle, high = (1e3 * x for x in (spread.low, spread.middle, spread.high))
    if spread.in_noise:
        return f"< {_digits(max(-low, high), max(-low, high))} ms"
    error = min(high - middle, middle - low)
    return f"{_digits(middle, error)} ms ({_digits(low, error)} to {_digits(high, error)})"


def _digits(number: float, error: float) -> str:
    """A number with as many digits as its error allows."""
    return f"{number:.0f}" if error >= 2 else f"{number:.1f}" if error >= 0.2 else f"{number:.2f}"


def _percent(share: float) -> str:
    """A share as a percentage."""
    return f"{100 * share:.1f} %" if abs(share) < 0.095 else f"{100 * share:.0f} %"
