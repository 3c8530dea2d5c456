"""The reference of a study, and errors that more samples do not reduce.

The reference is computed in double, with a large path depth, roots to the last digit and many samples. It is the mean
of two halves with different seeds, whose difference gives its noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from visray import clock
from visray.explaining import explain
from visray.geometry import UNIT_ROUNDOFF
from visray.output.curves import LUMINANCE
from visray.output.rounding import rounding
from visray.pass_timer import PASS_SECONDS
from visray.progress import Bar, Interrupts
from visray.scene.address import changed
from visray.scene.scene import DEEPEST, Scene
from visray.setup import Prepared, prepare
from visray.study.cost.choices import DEPTH, PRECISION, SAMPLER, SPP
from visray.study.cost.errors import split
from visray.study.cost.measuring import Measurement, blank, developed, exposed
from visray.study.cost.records import Reference

# The noise of the best record, over that of the reference.
FINER = 10
# Samples of each half at first, and of the pictures that find the depth.
FIRST, LOOK = 16, 4


@dataclass(frozen=True)
class Truth:
    """The reference, the prepared scene that made it, and notes for the reader."""

    reference: Reference
    prepared: Prepared
    notes: tuple[str, ...]


def luminance(picture: np.ndarray) -> float:
    """Mean luminance of a picture in linear Rec. 709. Shape: (H, W, 3)."""
    return float((picture.astype(float) @ LUMINANCE).mean())


def truth(
    scene: Scene, zero: Sequence[str], best: float, seeds: tuple[int, int], budget: float, mark: int,
    interrupts: Interrupts, progress: bool = False,
) -> Truth:  # fmt: skip
    """Computes the reference of a scene, until its noise is a tenth of `best`, or for `budget` seconds.

    zero: addresses of tolerances, which become 0
    best: least noise of the records, relative
    mark: as in Studio
    After Ctrl-C it keeps the samples so far, at least FIRST in each half.
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
            notes.append(f"the reference's depth of {settings[DEPTH]} still leaves out {left:.1g} of the light")
    prepared = prepare(deep)
    halves, count = _halves(prepared, seeds, target, budget, mark, interrupts, progress)
    picture, variance = halves.mean(0), ((halves[0] - halves[1]) / 2) ** 2
    mean = luminance(picture)
    if mean <= 0:
        mean = 1.0
        notes.append("the picture is black: errors are not relative to its luminance, but absolute")
    error = float(variance.mean() ** 0.5) / mean
    if error > target:
        share = (
            f"{100 * error / best:.0f} % of the least noise measured" if best else "more than single precision resolves"
        )
        why = "Ctrl-C ended it" if interrupts.requested else "it had no more time"
        notes.append(f"the reference's own error is {100 * error:.1g} %, {share}: {why}")
    settings[SPP] = 2 * count
    reference = Reference(settings, error, mean, clock.now() - begun, picture, variance)
    return Truth(reference, prepared, tuple(notes))


def _deep_enough(
    scene: Scene, seeds: tuple[int, int], target: float, mark: int, interrupts: Interrupts
) -> tuple[int, float]:
    """A depth whose double changes the picture by less than `target`, and that change.

    Both pictures have the same paths up to the smaller depth, so they differ by light, not by noise.
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
    """Pictures with a few samples. Shape: (seeds, H, W, 3)."""
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
    """Pictures of both halves, and the samples of each: a power of two, which suits Sobol's sequence."""
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
                # Longer steps need less tracing, but Ctrl-C waits for them.
                step *= 2 if now - before < PASS_SECONDS else 1
            pictures = developed(prepared, film, 2, np.float64)
            noise = float(np.sqrt((((pictures[0] - pictures[1]) / 2) ** 2).mean()))
            enough = noise <= target * (luminance(pictures.mean(0)) or 1.0)
            # The next doubling takes twice as long as the last one.
            if enough or interrupts.requested or 2 * (now - started) > budget - (now - begun):
                bar.update(bar.total)
                return pictures, done


def floors(measurements: list[Measurement], reference: Reference) -> dict[str, float]:
    """Errors that more samples do not reduce, by name, relative: of 8-bit output, and of precision and depth where they
    can be told from noise.

    measurements: of the scene as it is and of all choices, with the same seeds
    """
    limits = {"8-bit output": output(reference)}
    by = {(m.choice.setting, m.choice.value): m for m in measurements}
    own = by["scene", "as it is"]
    single, double = (by.get(("precision", x), own) for x in ("single", "double"))
    if (bias := difference(single, double, reference)) is not None:
        limits["single precision"] = bias
    depths = {m.choice.value: m for m in measurements if m.choice.setting == "depth"}
    depth = own.prepared.scene.settings.depth
    if depths and max(depths) > depth and (bias := difference(own, depths[max(depths)], reference)) is not None:
        limits[f"depth {depth}"] = bias
    return limits


def output(reference: Reference) -> float:
    """Relative error of rounding the reference to 8 bits in sRGB, where it can be displayed."""
    return rounding(reference.picture, ".png") / reference.luminance


def difference(one: Measurement, other: Measurement, reference: Reference) -> float | None:
    """Relative difference of the means over all seeds; None where it may be noise. Pictures of a seed have the same
    samples, so little of their difference is noise."""
    none = np.zeros_like(reference.picture)
    bias = split(one.pictures.astype(float) - other.pictures, none, none, reference.luminance).bias
    return bias.middle if bias.low > 0 else None
