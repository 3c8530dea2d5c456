"""The lights of a scene as kernels read them.

Lights are unrolled if the kernel contains code for each of them, and looped if the same code runs for one after the
other.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr
import numpy as np

from visray.accel import policy
from visray.accel.origin import Geometry, RayOrigin
from visray.accel.parallel_lists import ParallelLists, far_light, parallel_lists
from visray.features import Features
from visray.lights.light import Light
from visray.pack import LightColumns, Packed
from visray.pytree import detached, rows
from visray.quantities import Arrays
from visray.sampling import SampleSet

# Lights are unrolled if there are at most this many pairs of a light and a row; otherwise they are looped over. Shadow
# rays of unrolled lights are faster, but each pair takes 10 ms to compile.
MAX_UNROLLED_PAIRS = 96


@dataclass(frozen=True)
class PreparedLight:
    """One light as kernels read it.

    kind: class of the light
    light: numbers of the light: one row of the kind's table
    points: set of its sample points; None for lights without an area
    samples: number of its sample points, as a Python integer; 0 for looped lights
    number: number of the light in the scene; for looped lights, of the first light of their batch
    origin: its position as the origin of its shadow rays; None if its shadow rays start at the points that it lights
    lists: lists of rows for its shadow rays, if these are parallel or nearly so; else None
    """

    kind: type[Light]
    light: Any
    points: SampleSet | None
    samples: int
    number: int
    origin: RayOrigin | None
    lists: ParallelLists | None = None


@dataclass(frozen=True)
class LightBatch:
    """Lights of one kind that the kernel loops over.

    kind: class of the lights
    table: numbers of the lights
    points: sets of sample points of area lights; None for other lights
    count: number of lights, as opaque data
    number: number of the first light in the scene
    """

    kind: type[Light]
    table: Any
    points: SampleSet | None
    count: Any
    number: int


@dataclass(frozen=True)
class LightSteps:
    """All samples of some lights, one after the other, as a kernel with derivatives visits them (light_loop.py). Lights
    without an area have one sample.

    batches: the lights, kind by kind
    count: number of steps, as opaque data
    batch, row, j: for each step: number of the batch, row in its table, and number of the sample
    salt, number: for each step: what determines the random numbers of the light (direct.area_light)
    points: for each step, the set of sample points
    share: for each step, 1 / number of samples
    """

    batches: tuple[LightBatch, ...]
    count: Any
    batch: Any
    row: Any
    j: Any
    salt: Any
    number: Any
    points: SampleSet
    share: Any

    @staticmethod
    def of(a: Arrays, lights: list[LightColumns], looped: bool) -> "LightSteps":
        """The samples of `lights`. looped: whether lights of a kind are looped over in a kernel without derivatives,
        which then have other random numbers"""
        batches, steps, counts = [], [], []
        for k, columns in enumerate(lights):
            loops = looped and len(columns.samples) > 1
            first = columns.scene_index[0]
            batches.append(LightBatch(columns.kind, columns.numbers, None, None, first))
            for row, index in enumerate(columns.scene_index):
                n = columns.samples[row] if columns.kind.has_area else 1
                counts += [n] * n
                steps += [(k, row, j, row if loops else 0, first if loops else index) for j in range(n)]
        count = dr.opaque(a.U, len(steps))
        if len(steps) == 1:  # a table of one entry is another kernel
            steps, counts = 2 * steps, 2 * counts
        batch, row, j, salt, number = (a.put(a.U, x) for x in np.array(steps, np.uint32).T)
        share = a.put(a.F, 1 / np.array(counts, float))
        points = SampleSet.table(a, counts)
        return LightSteps(tuple(batches), count, batch, row, j, salt, number, points, share)


def too_many_lights(lights: int, sizes: Iterable[int]) -> bool:
    """Whether there are too many lights to unroll them.

    lights: number of lights
    sizes: number of rows in each batch. Of a large batch only the guards are unrolled, which takes a quarter of the
        compile time
    """
    sizes = [n for n in sizes if n <= policy.MAX_UNROLLED_SHARED]
    unrolled_rows = sum(n if n <= policy.MAX_UNROLLED else n // 4 for n in sizes)
    return lights > 2 and lights * (1 + unrolled_rows) > MAX_UNROLLED_PAIRS


def loops_lights(packed: Packed, geometry: Geometry) -> bool:
    """Whether lights of one kind are looped over, if there are several."""
    return too_many_lights(sum(len(l.names) for l in packed.lights), map(len, geometry.batches))


def prepared_lights(packed: Packed, geometry: Geometry, features: Features, a: Arrays) -> tuple:
    """Two tuples: the lights that are unrolled, and the batches of lights that are looped over."""
    loops = loops_lights(packed, geometry)
    unrolled, looped = {}, []
    for columns in packed.lights:
        kind, table, samples = columns.kind, columns.numbers, columns.samples
        if loops and len(samples) > 1:
            points = SampleSet.table(a, list(samples)) if kind.has_area else None
            looped.append(LightBatch(kind, table, points, dr.opaque(a.U, len(samples)), columns.scene_index[0]))
            continue
        for i, number in enumerate(columns.scene_index):
            light = rows(table, a.U(i))
            has_shared_origin = kind.has_position and not kind.has_area
            points = SampleSet.of(a, samples[i]) if kind.has_area else None
            origin = lists = None
            if has_shared_origin and features["shadows"]:
                listed = geometry.plan("direction").lists
                far = far_light(detached(geometry.batches), listed, dr.detach(light.position))
                origin = RayOrigin(geometry, light.position, far=far is not None)
                lists = far and parallel_lists_of(geometry, far[0], against=True, distance=far[1])
            elif not kind.has_position and features["shadows"]:
                lists = parallel_lists_of(geometry, np.array(light.direction, float)[:, 0], against=True)
            unrolled[number] = PreparedLight(kind, light, points, samples[i], number, origin, lists)
    return tuple(unrolled[number] for number in sorted(unrolled)), tuple(looped)


def light_steps(packed: Packed, geometry: Geometry, a: Arrays) -> tuple[LightSteps, ...]:
    """The samples of all lights with a position, and those of all others, if there are any."""
    looped = loops_lights(packed, geometry)
    groups = ([l for l in packed.lights if l.kind.has_position is wanted] for wanted in (True, False))
    return tuple(LightSteps.of(a, group, looped) for group in groups if group)


def parallel_lists_of(
    geometry: Geometry, direction: np.ndarray, against: bool, distance: float | None = None
) -> ParallelLists | None:
    """The lists for parallel rays. direction, against, distance: as in parallel_lists."""
    listed = geometry.plan("direction").lists
    build = partial(parallel_lists, geometry.a, detached(geometry.batches), listed, direction, against, distance)
    return geometry.lists.get(build, "direction", direction, against, distance or 0.0)


def ambient_of_lights(lights: tuple[LightColumns, ...], a: Arrays) -> Any:
    """Sum of the ambient light of all lights, a colour."""
    total = a.V(0)
    for table in (l.numbers for l in lights):
        colours = table.intensity * table.Ia
        total = total + a.V(*(dr.sum(c) for c in colours))
    return total
