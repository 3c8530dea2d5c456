"""Lane buffer: a film whose lanes have different numbers of samples, taken in passes of a suitable duration.

A lane is one entry of a Dr.Jit array: here a pixel, or a part of one, with the samples of one seed.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np

from visray import clock, integrator
from visray.adaptive.journal import Journal
from visray.film import Film
from visray.integrator import Window
from visray.kernel_scene import KernelScene
from visray.moments import Moments
from visray.motion_blur import blurred
from visray.pass_timer import PassTimer
from visray.passes import first_pass_samples
from visray.pytree import rows
from visray.sampling import SamplePlan, pixel_key
from visray.setup import Prepared

# Largest number of samples of a lane in one pass. They run one after the other, and Ctrl-C waits for them.
MOST_SAMPLES = 2**12
# A lane has at most 2^LARGEST_LEVEL samples, because they run one after the other.
LARGEST_LEVEL = 18


class LaneBuffer:
    """Samples of lanes.

    Its bits depend on the seeds and on the number of samples of each lane. They do not depend on how the samples are
    divided into passes (tests/test_same_bits.py).

    prepared: the prepared scene.
    film: the samples of all lanes.
    pace: measured duration of samples, from which the size of a pass is chosen.
    journal: tells whether the samples are in a checkpoint already, and keeps them in one.
    rates: seconds per sample of each lane in its last pass. Noisy lanes take longer. Shape: (lanes).
    """

    def __init__(self, prepared: Prepared, pixels: np.ndarray, name: str, journal: Journal | None):
        """pixels: number (row * width + column) of each lane's pixel. Shape: (lanes).

        name: name of the buffer in the journal.
        journal: None if the samples are not kept.
        """
        self.prepared, self.journal = prepared, journal or Journal()
        self.film = Film.empty(prepared.a, pixels)
        self.pace = PassTimer()
        self.rates = np.zeros(len(pixels))
        if journal is not None:
            journal.add(name, self)

    @property
    def counts(self) -> np.ndarray:
        """Number of samples of each lane. Shape: (lanes)."""
        return self.film.counts

    def places(self, index: Any) -> tuple[Any, Any, Any, Window | None]:
        """(seeds, column and row of the pixel, part of the pixel) of some lanes.

        index: numbers of the lanes, a Dr.Jit array.
        """
        raise TypeError(f"{type(self).__name__} has no lanes")

    def extend(self, targets: np.ndarray, seconds_left: Callable[[], float] = lambda: np.inf) -> bool:
        """Takes samples in passes until each lane has the number of samples that `targets` says. Lanes that lack most
        samples come first. Returns whether all lanes have their targets.

        targets: number of samples of each lane. Shape: (lanes).
        seconds_left: function that is called before each pass, and returns how long this pass may take. If the time is
            too short for a pass, no more samples are taken.
        """
        if self.journal.replays:
            self.film = self.film.with_moments(self.film.moments, np.maximum(self.counts, targets))
            return True
        self.journal.restore()
        while (targets > self.counts).any():
            if not self._extend(np.minimum(targets, self.counts + MOST_SAMPLES), seconds_left):
                return False
        return True

    def _extend(self, targets: np.ndarray, seconds_left: Callable[[], float]) -> bool:
        """Does the same as `extend`. Domain: no lane lacks more than MOST_SAMPLES samples."""
        lanes = np.flatnonzero(targets > self.counts)
        # Neighbours in this list run at the same time in one vector register, so they should lack the same number of
        # samples. Lanes that lack the same number stay in the order of pixel tiles.
        lanes = lanes[np.argsort((self.counts - targets)[lanes], kind="stable")]
        while len(lanes):
            span, pace = self.pace.next_seconds(seconds_left()), self.pace
            if span <= 0:
                return False
            missing = (targets - self.counts)[lanes]
            if pace.sample_seconds is None:
                fit = np.searchsorted(np.cumsum(missing), first_pass_samples(self.prepared), "right")
            else:
                seconds = np.cumsum(missing * np.where(self.rates[lanes] > 0, self.rates[lanes], pace.sample_seconds))
                limits = (np.cumsum(missing), pace.next_samples()), (seconds, span)
                fit = min(np.searchsorted(sums, limit, "right") for sums, limit in limits)
            pass_lanes, lanes = np.split(lanes, [max(int(fit), 1)])
            self.run_pass(pass_lanes, targets)
            self.journal.keep()
        return True

    def run_pass(self, lanes: np.ndarray, targets: np.ndarray) -> None:
        """Takes samples of some lanes in one pass, until each of these lanes has its target.

        lanes: numbers of the lanes. targets: number of samples of each lane.

        Shapes: lanes (n), with any n; targets (lanes).
        """
        begun = clock.now()
        # A single lane would need a kernel of its own, so it is computed twice. Both write the same value.
        lanes = np.repeat(lanes, 2) if len(lanes) == 1 else lanes
        counts, moments = self.counts.copy(), self.film.moments
        before, counts[lanes] = counts[lanes], targets[lanes]
        added = counts[lanes] - before
        old, new, index = self._sample(lanes, before, added)
        for film_part, old_part, new_part in zip(moments.arrays, old.arrays, new.arrays):
            if new_part is not old_part:
                dr.scatter(film_part, new_part, index)
        samples = int(added.sum())
        self.rates[lanes] = self.pace.evaluate(begun, samples, moments) / samples
        self.film = self.film.with_moments(moments, counts)

    def _sample(self, lanes: np.ndarray, first: np.ndarray, count: np.ndarray) -> tuple[Moments, Moments, Any]:
        """Moments of some lanes before and after more samples, and the lanes as a Dr.Jit array.

        lanes: numbers of the lanes.
        first: index of the first new sample of each of these lanes.
        count: number of new samples of each of these lanes.

        Shapes: the same for all three.
        """
        prepared, a = self.prepared, self.prepared.a
        index = a.put(a.U, lanes.astype(np.uint32))
        seeds, x, y, window = self.places(index)
        old = Moments(*(dr.gather(type(part), part, index) for part in self.film.moments.arrays))

        def launch(s: KernelScene, among: np.ndarray | None, first: Any, count: Any, before: Moments) -> Moments:
            places = seeds, x, y, window
            if among is not None:
                places = rows(places, a.put(a.U, among.astype(np.uint32)))
            plan = SamplePlan.per_lane(a, places[0], *(a.put(a.U, v.astype(np.uint32)) for v in (first, count)))
            return integrator.sample(s, plan, *places[1:3], before, places[3])

        if not prepared.shutter:
            return old, launch(prepared.kernel, None, first, count, old), index
        keys = np.array(pixel_key(SamplePlan.per_lane(a, seeds, None, None), x, y))
        return old, blurred(prepared, old, keys, first, count, launch), index


def half_seed(seed: int, half: int) -> int:
    """Seed of the samples in one half. It differs between the halves and between seeds, and it is far from the small
    numbers that scenes use as seeds.

    seed: the scene's seed. half: 0 for A, 1 for B; larger numbers give seeds for other samples.
    """
    return (seed * 0x9E3779B1 + half * 0x7FEB352D + 0x85EBCA6B) % 2**32
