"""What counts as truth: in double, deep, with roots to the last digit, and so many samples that little noise is left.

Two halves with seeds of their own are doubled by turns; by what they differ, the noise of their mean is known.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from visray import clock
from visray.adaptive.error_floor import DEEPEST
from visray.geometry import UNIT_ROUNDOFF
from visray.output.curves import LUMINANCE
from visray.pass_timer import PASS_SECONDS
from visray.progress import Bar, Interrupts
from visray.render import explain
from visray.scene.address import changed
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare
from visray.study.cost.knobs import DEPTH, PRECISION, SAMPLER, SPP
from visray.study.cost.measuring import blank, developed, exposed
from visray.study.cost.records import Reference

# How much less noise the truth has than the best point that is measured against it.
FINER = 10
# Samples of each half to begin with, and for a look at how deep is deep enough.
FIRST, LOOK = 16, 4


@dataclass(frozen=True)
class Truth:
    """The reference, the set that made it, and what a reader must know of it."""

    reference: Reference
    prepared: Prepared
    notes: tuple[str, ...]


def luminance(picture: np.ndarray) -> float:
    """The mean luminance of a picture in linear Rec. 709. Shape: (H, W, 3)."""
    return float((picture.astype(float) @ LUMINANCE).mean())


def truth(
    scene: Scene, zero: Sequence[str], best: float, seeds: tuple[int, int], budget: float, mark: int,
    interrupts: Interrupts, progress: bool = False,
) -> Truth:  # fmt: skip
    """The truth of a scene, with noise of at most a tenth of `best` or as little as `budget` seconds give.

    zero: the addresses of tolerances; best: the least deviation of what is measured, relative. After Ctrl-C it is as
    good as it is then, with FIRST samples in each half at least.
    """
    begun = clock.now()
    settings: dict[str, Any] = {PRECISION: "double", SAMPLER: "sobol"} | dict.fromkeys(zero, 0.0)
    deep = changed(scene, settings)
    on = explain(scene)
    notes: list[str] = []
    target = max(best / FINER, UNIT_ROUNDOFF["single"])
    if on["reflection"] or on["refraction"]:
        settings[DEPTH], left = _deep_enough(deep, seeds, target, mark, interrupts)
        deep = changed(scene, settings)
        if left > target:
            notes.append(f"depth {settings[DEPTH]} of the reference still leaves out {left:.1g} of the light")
    prepared = prepare(deep)
    halves, count = _halves(prepared, seeds, target, budget, mark, interrupts, progress)
    picture, variance = halves.mean(0), ((halves[0] - halves[1]) / 2) ** 2
    mean = luminance(picture)
    if mean <= 0:
        mean = 1.0
        notes.append("the reference is black: errors are absolute")
    error = float(variance.mean() ** 0.5) / mean
    if error > target:
        share = f"{error / best:.2f} of the best point's" if best else "more than single precision resolves"
        why = "it was cut short by Ctrl-C" if interrupts.requested else "that is what its seconds allowed"
        notes.append(f"the reference's own error is {error:.1g}, {share}: {why}")
    settings[SPP] = 2 * count
    found = Reference(settings, error, mean, clock.now() - begun, picture, variance)
    return Truth(found, prepared, tuple(notes))


def _deep_enough(
    scene: Scene, seeds: tuple[int, int], target: float, mark: int, interrupts: Interrupts
) -> tuple[int, float]:
    """A depth such that twice as much changes the picture by less than `target`, and by how much it does.

    Beyond what both follow, their pictures have the same paths: what they differ by is light, not noise.
    """
    depth = min(max(2 * scene.settings.depth, 2), DEEPEST)
    before, left = _look(scene, depth, seeds, mark), 0.0
    while depth < DEEPEST:
        deeper = min(2 * depth, DEEPEST)
        after = _look(scene, deeper, seeds, mark)
        left = float(((after - before) ** 2).mean() ** 0.5) / (luminance(after.mean(0)) or 1.0)
        if left <= target or interrupts.requested:
            break
        depth, before = deeper, after
    return depth, left


def _look(scene: Scene, depth: int, seeds: Sequence[int], mark: int) -> np.ndarray:
    """Pictures of a few samples. Shape: (seeds, H, W, 3)."""
    prepared = prepare(changed(scene, {DEPTH: depth, SPP: LOOK}))
    film, _ = exposed(prepared, blank(prepared, len(seeds)), seeds, 0, LOOK, mark)
    return developed(prepared, film, len(seeds), np.float64)


def _halves(
    prepared: Prepared,
    seeds: tuple[int, int],
    target: float,
    budget: float,
    mark: int,
    interrupts: Interrupts,
    progress: bool,
) -> tuple[np.ndarray, int]:  # fmt: skip
    """Both halves, and the samples of each: a power of two, as Sobol's sequence wants it."""
    film, done, step, begun = blank(prepared, 2), 0, FIRST, clock.now()
    pictures = None
    with Bar("reference", round(budget), progress) as bar:
        while True:
            goal, started = max(2 * done, FIRST), clock.now()
            while done < goal:
                if pictures is not None and interrupts.requested:
                    return pictures, goal // 2
                before = clock.now()
                step = min(step, goal - done)
                film, _ = exposed(prepared, film, seeds, done, step, mark)
                done += step
                now = clock.now()
                bar.update(min(round(now - begun), round(budget) - 1))
                # Longer steps are traced less often; but Ctrl-C waits for them.
                step *= 2 if now - before < PASS_SECONDS else 1
            pictures = developed(prepared, film, 2, np.float64)
            noise = float(np.sqrt((((pictures[0] - pictures[1]) / 2) ** 2).mean()))
            enough = noise <= target * (luminance(pictures.mean(0)) or 1.0)
            # The next doubling takes twice as long as the last one.
            if enough or interrupts.requested or 2 * (now - started) > budget - (now - begun):
                bar.update(bar.total)
                return pictures, done
