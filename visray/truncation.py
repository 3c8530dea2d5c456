"""What reflections and refractions beyond the last that is followed would add to a picture."""

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from visray.exposure import Set
from visray.halves import QUANTILE, Halves, windowed

# Pixels that are looked at, at most and at least, and samples of each in each half at most; where they are few, more.
PIXELS, FEWEST, SAMPLES, MORE = 2**13, 2**8, 16, 256
# Samples that look for where paths go on, and the side of the window of pixels around one where they do.
LOOKS, AROUND = 2**18, 5


@dataclass(frozen=True)
class Truncation:
    """The mean square over pixels and channels of what is left out at `depth`, and between which two it lies with a
    chance of 95 %."""

    depth: int
    square: float
    low: float
    high: float


def truncation(
    halves: Halves, depths: tuple[int, ...], deep: int, seconds: float = np.inf, pixels: int = PIXELS,
    count: int | None = None,
) -> list[Truncation]:  # fmt: skip
    """What is left out at each of these depths, against `deep`.

    Only where paths go on beyond the least of the depths can anything be left out, and there it is looked for: in
    `pixels` at most, with `count` samples of each in each half, else as many as the halves have, and more where pixels
    are few. In so few `seconds` that this is too long, in fewer pixels, anywhere.

    The same samples are taken with either depth, so that they differ by what is left out alone; of the two halves, the
    product of the differences has no bias as a square of their mean.
    """
    n, made = halves.n, halves.made
    count = count or min(int(halves.counts.min()), SAMPLES)
    most, rate = pixels, halves.pace.rate or 0.0
    if seconds < np.inf and rate:
        most = int(np.clip(seconds / (rate * 2 * count * (1 + len(depths))), FEWEST, pixels))
    settings = made.scene.settings
    where = _ends(made, min(depths), deep) if rate * (2 * n + 2 * LOOKS) < seconds / 2 else np.arange(n)
    some = np.sort(np.random.default_rng(settings.seed).permutation(where)[:most])
    if not len(some):
        return [Truncation(depth, 0.0, 0.0, 0.0) for depth in depths]
    count = max(count, min(count * most // len(some), MORE))
    # What chose the pixels must not say what is found there.
    scene = replace(made.scene, settings=replace(settings, seed=(settings.seed + 2**31) % 2**32))
    part = _part(replace(made, scene=scene), some)
    a, b = _means(part, count, deep)
    found, share = [], len(where) / n
    for depth in depths:
        products = np.multiply(*(u - v for u, v in zip((a, b), _means(part, count, depth)))).mean(0)
        spread = share * QUANTILE * np.sqrt(np.square(products).sum()) / len(some)
        square = share * float(products.mean())
        found.append(Truncation(depth, square, square - spread, square + spread))
    return found


def _ends(made: Set, depth: int, deep: int) -> np.ndarray:
    """The lanes about which paths go on beyond a depth. One sample of each pixel tells about which there are paths at
    all, and more of these about which they go on: such pixels may be few, and hardly any sample of them."""
    lanes = np.arange(len(made.order))
    if depth:
        lanes = _differing(made, lanes, (0, deep), 1)
    return _differing(made, lanes, (depth, deep), int(np.clip(LOOKS // max(len(lanes), 1), 1, MORE)))


def _differing(made: Set, lanes: np.ndarray, depths: tuple[int, int], count: int) -> np.ndarray:
    """The lanes about which so many samples of these differ by depth."""
    if not len(lanes):
        return lanes
    film, part = made.scene.film, _part(made, lanes)
    once = np.repeat([count, 0], len(lanes))
    shallow, whole = (_at(part, depth, once).means()[0] for depth in depths)
    picture = np.zeros(len(made.order))
    picture[part.order] = (shallow != whole).any(0)
    near = windowed(picture.reshape(film.height, film.width), np.ones(AROUND)) > 0
    return np.flatnonzero(near.ravel()[made.order])


def _part(made: Set, some: np.ndarray) -> Set:
    """A set of some of the lanes."""
    x, y = (made.a.put(made.a.U, np.array(v)[some]) for v in (made.x, made.y))
    return replace(made, order=made.order[some], x=x, y=y)


def _means(made: Set, count: int, depth: int) -> tuple[np.ndarray, np.ndarray]:
    """The halves' pixels with another depth. Shapes: (3, N)."""
    return _at(made, depth, np.full(2 * len(made.order), count)).means()


def _at(made: Set, depth: int, targets: np.ndarray) -> Halves:
    """Halves with so many samples, and another depth, which is data: no kernel is made."""
    kept = made.stage.scenery
    stage = replace(made.stage, scenery=replace(kept, levels=(dr.opaque(made.a.U, depth), kept.levels[1])))
    found = Halves(replace(made, stage=stage))
    found.extend(targets)
    return found
