"""Motion blur: the samples of a pixel see the scene at several moments while the shutter is open.

While the shutter is open there are a number of moments (camera.Shutter). At each of them the scene is one of its own,
with the same kernel. So everything that an animation can move is blurred: objects, transforms, lights, colours,
parameters, data and the camera.

Samples are taken in sweeps. A sweep runs through all moments from the opening to the closing of the shutter. Its
samples are spread evenly over the moments, with a shift that differs from pixel to pixel: pixels with few samples get
noise in place of copies of the moving object. Which moment a sample sees depends only on its index, its pixel and the
seed. So the bits do not depend on how samples are divided into passes.

A lane is one entry of the arrays of a pass: one pixel, or one pixel in one half of the dual buffer (adaptive/).
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.animation.moment import assignments
from visray.errors import of_moment
from visray.kernel_scene import KernelScene
from visray.moments import Moments
from visray.pack import Packed
from visray.pytree import leaves
from visray.quantities import Arrays
from visray.sampling import hash32
from visray.scene.scene import Scene
from visray.setup import Prepared

# Number of samples of the first sweep with a sampler whose number of samples is open. Each later sweep doubles the
# number of samples of a pixel, as adaptive sampling does.
FIRST_SWEEP = 4
# The shift of a pixel is a whole number of so many parts of a sample.
PARTS = 2**16
# The scenes of all moments are kept if they have at most so many numbers that change. Otherwise each is made anew in
# each sweep.
MOST_KEPT = 2**24
# Values of an animation at one moment, by address.
Values = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class OpenShutter:
    """The moments of one frame in which the shutter is open.

    base: the prepared scene of the frame's own time.
    values: the values of the animation at each moment.
    time: the frame's own time in seconds.
    kernels: the scenes of the moments that are kept, by number.
    """

    base: Prepared
    values: tuple[Values, ...]
    time: float
    kernels: dict[int, KernelScene] = field(default_factory=dict)

    def kernel(self, number: int) -> KernelScene:
        """The scene of a moment, as kernels read it. number: number of the moment."""
        if number in self.kernels:
            return self.kernels[number]
        with of_moment(f"at {self.time:g} s, while the shutter is open"):
            made = self.base.updated(self.values[number])
        if len(self.values) * _changed(self.base.packed, made.packed) <= MOST_KEPT:
            self.kernels[number] = made.kernel
        return made.kernel

    def on(self, base: Prepared) -> "OpenShutter":
        """The same moments for a scene with other settings, or of another size."""
        return OpenShutter(base, self.values, self.time)

    def hash(self, scene: Scene) -> str:
        """Hash of a frame: that of the scene at its own time, and of the values at all moments."""
        return frame_hash(scene, self.values)


def opened(prepared: Prepared, scene: Scene, t: float, fps: float | None = None) -> Prepared:
    """The prepared scene with its shutter open, if anything moves while it is; else unchanged.

    prepared: the scene of the moment t, prepared.
    scene: the animated scene.
    t: time of the frame in seconds.
    fps: frames per second; None: those of the animation.
    """
    values = values_while_open(scene, t, fps)
    return replace(prepared, shutter=OpenShutter(prepared, values, t)) if values else prepared


def values_while_open(scene: Scene, t: float, fps: float | None = None) -> tuple[Values, ...]:
    """The values of an animated scene at each moment of the frame at time t; none if nothing moves, or there is no
    shutter. fps: as in `opened`."""
    if scene.camera.shutter is None:
        return ()
    values = tuple(assignments(scene, x) for x in scene.camera.shutter.times(t, 1 / (fps or scene.animation.fps)))
    now = assignments(scene, t)
    return values if any(x != now for x in values) else ()


def frame_hash(scene: Scene, values: tuple[Values, ...]) -> str:
    """Hash of a frame. scene: the scene at its own time. values: the values of the animation while the shutter is
    open; none without motion blur."""
    if not values:
        return scene.hash()
    text = scene.hash() + json.dumps(values, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def _changed(before: Packed, after: Packed) -> int:
    """Number of numbers in the arrays that two packed scenes do not share."""
    pairs = zip(leaves(before, shared=True), leaves(after, shared=True))
    return sum(dr.width(y) * max(dr.size_v(y), 1) for x, y in pairs if y is not x)


@dataclass(frozen=True)
class Sweeps:
    """How the samples of a pixel are spread over the moments.

    moments: number of moments.
    spp: number of samples of every sweep, if the sampler knows the number of samples; else None, and sweeps double.
    """

    moments: int
    spp: int | None

    @staticmethod
    def of(prepared: Prepared) -> "Sweeps":
        """The sweeps of a prepared scene whose shutter is open."""
        settings = prepared.scene.settings
        return Sweeps(len(prepared.shutter.values), settings.spp if settings.sampler == "stratified" else None)

    def ranges(self, end: int) -> Iterator[tuple[int, int]]:
        """Yields the first sample and the end of each sweep, up to the sample `end`."""
        first, last = 0, self.spp or FIRST_SWEEP
        while first < end:
            yield first, last
            first, last = last, last + (self.spp or last)

    def end_of(self, number: int, first: int, last: int, shift: np.ndarray) -> np.ndarray:
        """Index of the first sample in a sweep that comes after a moment.

        number: number of the moment.
        first, last: first sample and end of the sweep.
        shift: shift of each lane, from 0 to PARTS - 1. Shape: (N), also of the result.

        Sample i of n samples sees moment floor((i + shift / PARTS) moments / n), in whole numbers.
        """
        begin_of_next = (number + 1) * (last - first) * PARTS - shift * self.moments
        return first + -(-begin_of_next // (self.moments * PARTS))


# Takes samples: (scene, lanes, first sample and number of samples of each of these lanes, their moments before) to the
# moments after.
Launch = Callable[[KernelScene, np.ndarray, np.ndarray, np.ndarray, Moments], Moments]


def blurred(
    prepared: Prepared, before: Moments, keys: np.ndarray, first: np.ndarray, count: np.ndarray, launch: Launch
) -> Moments:
    """The moments of all lanes after more samples, each of which sees the scene at its own moment.

    prepared: the prepared scene, whose shutter is open.
    before: moments of the lanes.
    keys: hash of the pixel and the seed of each lane.
    first, count: index of the first new sample of each lane, and number of its new samples.
    launch: takes samples of some lanes.

    Shapes: (N) for keys, first, count.
    """
    sums = Moments(*(type(x)(x) for x in before.arrays))
    for _ in blurring(prepared, sums, keys, first, count, launch):
        pass
    return sums


def blurring(
    prepared: Prepared,
    sums: Moments,
    keys: np.ndarray,
    first: np.ndarray,
    count: np.ndarray,
    launch: Launch,
    most: int | None = None,
) -> Iterator[None]:
    """As `blurred`, but by and by: writes the moments after each launch into `sums`, and yields. When it ends, they are
    those of all samples.

    sums: moments of the lanes.
    most: number of samples of a launch, as long as lanes have more than one each; None: any.
    """
    sweeps, end = Sweeps.of(prepared), first + count
    for number, (start, last) in enumerate(sweeps.ranges(int(end.max()))):
        done, stop = np.clip(first, start, last), np.clip(end, start, last)
        if (stop == done).all():
            continue
        shift = (_hashed(keys, number) >> 16).astype(np.int64)
        for at in range(sweeps.moments):
            now = np.clip(sweeps.end_of(at, start, last, shift), done, stop)
            if (lanes := np.flatnonzero(now > done)).size:
                # A single lane would need a kernel of its own, so it is computed twice. Both write the same value.
                lanes = np.repeat(lanes, 2) if len(lanes) == 1 else lanes
                kernel, begin, each = prepared.shutter.kernel(at), done[lanes], int((now - done).max())
                each = max(min(each, (most or each * len(lanes)) // len(lanes)), 1)
                # All lanes stay, also those that have their samples: so the launches have one size.
                while (begin < now[lanes]).any():
                    reached = np.minimum(begin + each, now[lanes])
                    _add_samples(prepared.a, sums, kernel, lanes, begin, reached, launch)
                    begin = reached
                    yield
            done = now


def _add_samples(
    a: Arrays, sums: Moments, kernel: KernelScene, lanes: np.ndarray, done: np.ndarray, now: np.ndarray, launch: Launch
) -> None:
    """Takes the samples `done` to `now` - 1 of some lanes, and writes their moments into those of all lanes, `sums`."""
    index = a.put(a.U, lanes.astype(np.uint32))
    before = Moments(*(dr.gather(type(x), x, index) for x in sums.arrays))
    after = launch(kernel, lanes, done, now - done, before)
    for x, new in zip(sums.arrays, after.arrays):
        dr.scatter(x, new, index)
    dr.eval(sums)


def _hashed(keys: np.ndarray, number: int) -> np.ndarray:
    """A hash of each key and the number of a sweep. Shape: (N)."""
    return hash32(keys ^ hash32(np.full(1, number + 1, np.uint32)))
