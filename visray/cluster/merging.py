"""The film of a picture whose parts come back from workers, in any order. Its bits are those of one machine."""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import numpy as np

from visray.cluster.part import Part
from visray.cluster.worker import Start
from visray.film import Film
from visray.moments import BLOCK, Moments
from visray.passes import spread_lanes
from visray.quantities import Arrays


class Canvas:
    """The picture so far.

    counts: number of samples of each lane
    order: the lanes that the parts name: those that need samples
    """

    def __init__(self, film: Film, spp: int):
        """film: film of the picture, to go on with. spp: samples per pixel"""
        self.film, self.spp, self.counts = film, spp, film.counts.copy()
        self.moments = [np.array(x) for x in film.moments.arrays]
        lanes = spread_lanes(len(self.counts))
        self.is_empty, self.order = not film.counts.any(), lanes[film.counts[lanes] < spp]
        self.waiting: list[tuple[Part, Sequence[np.ndarray | None]]] = []

    def start(self, part: Part) -> Start | None:
        """What a part goes on from; None if nothing has samples yet."""
        lanes = self.order[part.lanes]
        return None if self.is_empty else Start(lanes, self.counts[lanes], tuple(x[..., lanes] for x in self.moments))

    def add(self, part: Part, arrays: Sequence[np.ndarray | None]) -> None:
        """Adds the samples of a part. arrays: as in worker.Samples"""
        if part.is_tile:
            self._replace(part, arrays, self.spp)
            return
        # Blocks are joined in the order of their indices. Those that come too early wait.
        self.waiting.append((part, arrays))
        while ready := [pair for pair in self.waiting if self._is_next(pair[0])]:
            for pair in ready:
                self._join(*pair)
            self.waiting = [pair for pair in self.waiting if pair not in ready]

    def now(self) -> Film:
        """The film with the samples so far, as NumPy's arrays: to be kept, not to go on with."""
        return self.film.with_moments(Moments(*self.moments), self.counts)

    def finished(self) -> Film:
        """The film with the samples so far."""
        kinds = Moments.types(self.film.a)
        moments = Moments(*(self.film.a.put(kind, x) for kind, x in zip(kinds, self.moments)))
        return self.film.with_moments(moments, self.counts)

    def _is_next(self, part: Part) -> bool:
        """Whether all lanes of a part have just the samples before it."""
        return bool((self.counts[self.order[part.lanes]] == BLOCK * part.first_block).all())

    def _join(self, part: Part, sums: Sequence[np.ndarray | None]) -> None:
        """Joins sample blocks to those before."""
        lanes = self.order[part.lanes]
        before = [x[..., lanes] for x in self.moments]
        self._replace(part, joined(self.film.a, before, sums, part, self.spp), min(BLOCK * part.end_block, self.spp))

    def _replace(self, part: Part, arrays: Sequence[np.ndarray | None], count: int) -> None:
        """Gives the lanes of a part new moments and a number of samples."""
        lanes = self.order[part.lanes]
        for x, new in zip(self.moments, arrays):
            if new is not None:
                x[..., lanes] = new
        self.counts[lanes] = count


def joined(
    a: Arrays, before: Sequence[np.ndarray], sums: Sequence[np.ndarray | None], part: Part, spp: int
) -> list[np.ndarray | None]:
    """The moments of lanes after some blocks are joined to them, one after the other, as in a render of one machine.

    before: the moments of the lanes, without open block
    sums: sums of the blocks, as in worker.Samples
    spp: samples per pixel. A last block that is not full stays open.
    """
    kinds = Moments.types(a)
    blocks = [None if x is None else a.put(kind, x) for kind, x in zip(kinds[3:], sums)]
    start = [a.put(kind, x) for kind, x in zip(kinds, before)]
    if blocks[-1] is None:
        start[2] = start[-1] = None
    lane, n, first = dr.arange(a.U, len(before[2])), dr.opaque(a.U, len(before[2])), part.first_block
    end, samples = dr.opaque(a.U, first + part.blocks), dr.opaque(a.U, spp)
    first = dr.opaque(a.U, first)

    def step(block: Any, *moments: Any) -> tuple:
        row = (block - first) * n + lane
        own = [None if x is None else dr.gather(kind, x, row) for kind, x in zip(kinds[3:], blocks)]
        is_full = block * BLOCK + BLOCK <= samples
        return block + 1, *Moments(*moments[:3], *own).block_joined(a, is_full, block * BLOCK, BLOCK).arrays

    state = (first + 0 * lane, *start)
    _, *arrays = dr.while_loop(state, lambda block, *_: block < end, step, label="joined blocks")
    dr.eval([x for x in arrays if x is not None])
    return [None if x is None else np.array(x) for x in arrays]
