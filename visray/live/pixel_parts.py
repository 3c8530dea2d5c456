"""Parts of a live picture: pixels that take samples together, in one launch."""

from dataclasses import dataclass, field
from functools import lru_cache

import drjit as dr
import numpy as np

from visray.film import Film
from visray.live.closeness import Closeness
from visray.live.grids import Grid, parts_of
from visray.moments import Moments
from visray.passes import PACKET, empty_film, spread_lanes
from visray.quantities import Arrays
from visray.setup import Prepared

# Number of pixels of which moments without samples are kept, 50 MB.
MOST_SHARED = 2**19


@dataclass
class Part:
    """Pixels that take samples together. moments: of their samples. count: number of samples of each."""

    grid: Grid
    moments: Moments
    count: int = 0
    closeness: Closeness = field(default_factory=Closeness)


def new_parts(a: Arrays, whole: Grid, room: int) -> list[Part]:
    """Parts of a grid, without samples. room: about the largest number of cells of a part."""
    grids, n = [whole], len(whole)
    if n > room:
        # Every part is spread over the whole picture. None has a single lane, which would need its own kernel.
        grids = parts_of(a, whole, np.array_split(spread_lanes(n), min(-(-n // room), n // PACKET)))
    return [Part(g, nothing(a, dr.width(g.x))) for g in grids]


def film_of(prepared: Prepared, parts: list[Part]) -> Film:
    """The film of all samples of the parts of a picture."""
    empty = empty_film(prepared)
    lane_of = np.empty(len(empty.pixels), np.int64)
    lane_of[empty.pixels] = np.arange(len(lane_of))
    a, counts, arrays = empty.a, empty.counts, [np.array(x) for x in empty.moments.arrays]
    for part in parts:
        lanes = lane_of[np.array(part.grid.cells)]
        counts[lanes] = part.count
        for x, own in zip(arrays, part.moments.arrays):
            x[..., lanes] = np.array(own)
    return empty.with_moments(Moments(*(a.put(k, x) for k, x in zip(Moments.types(a), arrays))), counts)


def nothing(a: Arrays, n: int) -> Moments:
    """Moments of n pixels without samples. The first states of all pictures share those of a size, unless they need
    much memory; nothing changes them."""
    return _shared(a, n) if n <= MOST_SHARED else Moments.empty(a, n)


_shared = lru_cache(maxsize=4)(Moments.empty)
