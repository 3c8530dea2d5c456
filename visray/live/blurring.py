"""Samples of pixels of a live picture while the shutter is open, taken by and by, so that no step is long."""

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from visray import clock
from visray.kernel_scene import KernelScene
from visray.live.grids import Grid
from visray.live.replay import Replays
from visray.moments import Moments
from visray.motion_blur import blurring
from visray.sampling import SamplePlan, pixel_key
from visray.setup import Prepared


class Blurring:
    """Samples of some pixels, up to a number of samples of each.

    moments: of the samples so far

    The bits are those of a render of the same moment with as many samples (renderer.py).
    """

    def __init__(self, prepared: Prepared, replays: Replays, grid: Grid, before: Moments, first: int, goal: int):
        """prepared: the scene, with its shutter open. before: moments of the pixels, which have `first` samples each.
        goal: number of samples that each will have."""
        self.prepared, self.replays, self.grid = prepared, replays, grid
        self.moments = Moments(*(type(x)(x) for x in before.arrays))
        self.first, self.goal = first, goal
        self._launches: Any = None

    def go_on(self, end: float, most: int) -> bool:
        """Takes more samples. Returns whether all are there.

        end: takes no more after this time (clock.now)
        most: number of samples of a launch, as long as pixels have more than one each
        """
        if self._launches is None:
            self._launches = self._begun(most)
        for _ in self._launches:
            dr.sync_thread()
            if clock.now() >= end:
                return False
        return True

    def _begun(self, most: int) -> Any:
        """Takes samples, and yields after each launch."""
        prepared, a, settings = self.prepared, self.prepared.a, self.prepared.scene.settings
        keys = np.array(pixel_key(SamplePlan.of(a, settings.seed, settings.spp, 0, 0), self.grid.x, self.grid.y))
        first = np.full(len(keys), self.first)
        return blurring(prepared, self.moments, keys, first, self.goal - first, self._launch, most)

    def _launch(
        self, scene: KernelScene, lanes: np.ndarray, first: np.ndarray, count: np.ndarray, before: Moments
    ) -> Moments:
        """The moments of some pixels after more samples at one moment of the scene.

        Pixels with the same numbers of samples are taken together: there are few such numbers, and so the kernel is
        that of the sharp picture, which is compiled already.
        """
        prepared, sums = replace(self.prepared, kernel=scene), Moments(*(type(x)(x) for x in before.arrays))
        both = first << 32 | count
        for pair in [int(both[0])] if (both == both[0]).all() else np.unique(both).tolist():
            begin, more = pair >> 32, pair & (2**32 - 1)
            among = np.flatnonzero(both == pair)
            # A single pixel would need a kernel of its own, so it is computed twice. Both write the same value.
            among = np.repeat(among, 2) if len(among) == 1 else among
            if more:
                self._add(prepared, sums, among, lanes[among], begin, more)
        return sums

    def _add(
        self, prepared: Prepared, sums: Moments, among: np.ndarray, lanes: np.ndarray, first: int, count: int
    ) -> None:
        """Takes samples of pixels that have `first` of them, and writes their moments into the rows `among` of `sums`.
        lanes: numbers of the pixels in the grid."""
        a = prepared.a
        index, here = (a.put(a.U, v.astype(np.uint32)) for v in (lanes, among))
        places = dr.gather(a.U, self.grid.x, index), dr.gather(a.U, self.grid.y, index)
        old = Moments(*(dr.gather(type(x), x, here) for x in sums.arrays))
        # What is recorded reads no memory of NumPy.
        dr.eval(places, old)
        new, _ = self.replays.sampled(prepared, *places, old, first, count)
        for x, part in zip(sums.arrays, new.arrays):
            dr.scatter(x, part, here)
