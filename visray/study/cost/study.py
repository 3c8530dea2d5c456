"""Study of a scene: measures all choices, the reference, and the best values of all settings together."""

import json
import os
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from math import log
from pathlib import Path
from typing import Any

import numpy as np

from visray import clock
from visray.adaptive.dual_buffer import QUANTILE
from visray.animation.moment import still_at
from visray.arguments import checked_arguments
from visray.cluster.connecting import connected
from visray.errors import UserError
from visray.explaining import explain
from visray.output.files import write_text
from visray.progress import Interrupts
from visray.scene.load import checked, load
from visray.scene.scene import Scene
from visray.setup import set_threads
from visray.study.cost import comparing
from visray.study.cost.choices import (
    KEPT,
    MORE,
    MOST_SAMPLES,
    SAMPLER,
    SPP,
    TOGETHER,
    Choice,
    VariedSetting,
    default,
    sample_counts,
    varied_settings,
)
from visray.study.cost.errors import FEWEST as FEWEST_SEEDS
from visray.study.cost.errors import judged
from visray.study.cost.hits import geometry
from visray.study.cost.measuring import LONGEST, Elsewhere, Measurement, Studio, reduced
from visray.study.cost.on_workers import measured_on
from visray.study.cost.page import display, page
from visray.study.cost.records import Curve, Record, Report
from visray.study.cost.report import STOPPED, as_csv, as_json
from visray.study.cost.slopes import slope
from visray.study.cost.truth import Truth, floors, luminance, truth
from visray.study.cost.writing import duration, percent
from visray.study.machine import machine

SUFFIXES = (".html", ".json", ".csv")
LEAST_SEEDS, MOST_SEEDS = 16, 4096
# Seconds for the kernels of all choices, for the reference, and for the joint records: quick, full.
BUDGETS = (16.0, 30.0, 8.0), (120.0, 150.0, 50.0)
# Seconds for the reference after Ctrl-C.
HURRIED = 2.0
# Distance of the reference's seeds from those of the records.
APART = 2**31
# These settings may change hits; all others only change how many rays there are.
OF_HITS = ("scene", "precision", "roots", "accelerator")
FIXED = {
    "scatter": "settings.scatter.depth = {0.scatter.depth} says which light there is; it was not changed",
    "near occlusion": "settings.occlusion.distance = {0.occlusion.distance:g} says which light there is; it was not "
    "changed",
}


@dataclass(frozen=True)
class Study(Report):
    """The cost of accuracy for a scene; it shows its figure in a notebook, and writes itself to a file."""

    def __repr__(self) -> str:
        error, seconds = percent(self.default.error.rmse.middle), duration(self.default.seconds.middle)
        size = f"{self.width} x {self.height} pixels, {self.seeds} seeds"
        return f"<Study of {self.scene}: {size}, error {error} in {seconds}{', stopped' if self.stopped else ''}>"

    def as_json(self) -> dict[str, Any]:
        """All numbers, without pictures, as a dict for json.dumps. None (null in JSON) stands for an infinite
        number."""
        return as_json(self)

    def as_csv(self) -> str:
        """A row for each record, with all settings."""
        return as_csv(self)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes an .html page that opens offline, or a .json or .csv file."""
        check_report(path)
        suffix = Path(path).suffix.lower()
        as_text = {".html": page, ".json": lambda r: json.dumps(as_json(r), indent=1) + "\n", ".csv": as_csv}
        write_text(path, as_text[suffix](self))

    def _repr_html_(self) -> str:
        return display(self)


def check_report(path: str | os.PathLike[str]) -> None:
    """Raises a UserError unless the end of the name says the format of a report."""
    if Path(path).suffix.lower() not in SUFFIXES:
        raise UserError(f"{path}: the name says no format of a report; end it in {', '.join(SUFFIXES)}")


@checked_arguments
def cost(
    scene: Scene | str | Path, *, setup: str | Path | None = None, quick: bool = False, seeds: int = LEAST_SEEDS,
    progress: bool = True, threads: int | None = None,
    allow_outside: bool = False, cluster: str | None = None,
) -> Study:  # fmt: skip
    """Measures what accuracy costs for a scene, or a scene file: error and time of each setting
    that trades one for the other.

    quick: fewer values of each setting, on smaller pictures
    seeds: pictures of each choice, from 16 to 4096
    allow_outside: whether a scene file may name files outside of its folder
    cluster: address of a Dask scheduler whose workers make the pictures, as in vr.render; the times are then theirs
    Ctrl-C keeps the complete turns, and raises KeyboardInterrupt where they are too few for an error with an interval.
    """
    begun = clock.now()
    name = str(scene) if isinstance(scene, (str, Path)) else "a scene given in Python"
    if isinstance(scene, (str, Path)):
        scene = load(scene, setup, allow_outside=allow_outside)
    scene = still_at(checked(scene), None)
    if not isinstance(seeds, int) or isinstance(seeds, bool) or not LEAST_SEEDS <= seeds <= MOST_SEEDS:
        raise UserError(f"seeds = {seeds}: must be a whole number from {LEAST_SEEDS} to {MOST_SEEDS}")
    if threads is not None:
        set_threads(threads)
    with connected(cluster, threads, progress) if cluster else nullcontext() as crew, Interrupts() as interrupts:
        elsewhere = partial(measured_on, crew) if crew else None
        report = studied(scene, quick, seeds, progress, interrupts, elsewhere=elsewhere)
    return replace(report, scene=name, seconds=clock.now() - begun)


def studied(
    scene: Scene,
    quick: bool,
    count: int,
    progress: bool,
    interrupts: Interrupts,
    for_tuning: bool = False,
    elsewhere: Elsewhere | None = None,
) -> Study:
    """The study of a scene with `count` seeds.

    for_tuning: leaves out what `tune` does not need: FLIP, hits, the joint records, and settings that it never
        changes
    elsewhere: what measures the turns; None: this process does
    """
    small = reduced(scene, LONGEST[not quick])
    varied, budgets = [s for s in varied_settings(small) if not (for_tuning and s.name in KEPT)], BUDGETS[not quick]
    first, own = scene.settings.seed, default(small, varied)
    studio = Studio(small, [(first + i) % 2**32 for i in range(count)], interrupts, progress, elsewhere)
    choices = [own, *(c for s in varied for c in s.choices(quick) if not c.own)]
    studio, measured = _measured(studio, choices, budgets[0])
    stopped, small = interrupts.requested, studio.scene
    # Tolerances become 0 in the reference, whether they are varied here or not.
    zero = [address for s in varied_settings(small) if s.name == "roots" for address in s.all[0].settings]
    seeds = tuple((first + APART + i) % 2**32 for i in range(2))
    seconds = HURRIED if stopped else budgets[1]
    true = truth(small, zero, min(map(_noise, measured)), seeds, seconds, studio.mark, interrupts, progress)
    points = [_record(m, own, true, not for_tuning) for m in measured]
    same = all((p == measured[0].parts[0][0]).all() for p in measured[0].parts)
    curves = tuple(_curve(s, points, quick, not same) for s in varied)
    joint = None if stopped or same or for_tuning else _joint(studio, points[0], curves, measured[0], true, quick)
    every = (*curves, joint) if joint else curves
    # Without noise there is nothing that samples could reduce.
    priced = [c for c in every if not (same and c.kind == "sampling")]
    records = (*points, *(joint.points if joint else ()))
    return Study(
        scene="",
        scene_hash=scene.hash(),
        width=small.film.raster[0],
        height=small.film.raster[1],
        seeds=len(points[0].squares),
        quick=quick,
        default=points[0],
        curves=curves,
        joint=joint.points if joint else (),
        frontier=comparing.frontier(records),
        savings=comparing.savings(priced, points[0]),
        halvings=comparing.halvings(priced, points[0]),
        floors=floors(measured, true.reference),
        reference=true.reference,
        noiseless=same,
        stopped=interrupts.requested,
        seconds=0.0,
        machine=machine(),
        notes=(*_notes(small), *true.notes, *[STOPPED] * interrupts.requested),
    )


def _measured(studio: Studio, choices: Sequence[Choice], budget: float) -> tuple[Studio, list[Measurement]]:
    """All choices, measured on pictures of a size that fits the budget, and the studio that made them."""
    studio, measurements = studio.fitting(studio.prepared(choices), budget)
    if len(measurements) < len(choices) or studio.measure(measurements) < FEWEST_SEEDS:
        raise KeyboardInterrupt
    return studio, measurements


def _joint(
    studio: Studio, own: Record, curves: tuple[Curve, ...], base: Measurement, true: Truth, quick: bool
) -> Curve | None:
    """The curve of samples per pixel with the best values of all other settings. None after Ctrl-C, if no choice
    fits into the budget, or if only the sampler would change: its curve exists already.

    The scene as it is is measured again in the same turns; it corrects for a change of the machine's speed.
    """
    best = comparing.together(curves, own)
    if set(best) <= {SAMPLER}:
        return None
    spp = own.settings[SPP]
    sampler = best.get(SAMPLER, own.settings[SAMPLER])
    counts = sorted({*sample_counts(sampler, quick), spp, min(MORE * spp, MOST_SAMPLES)})
    choices = [Choice(TOGETHER, n, best | {SPP: n}) for n in counts]
    again, *ready = studio.prepared([replace(base.choice, setting="again"), *choices]) or [None]
    # Times go up by factors of 4, so all together take less than twice as long as the longest.
    ready = [m for m in ready if m.expected * len(studio.seeds) * 2 <= BUDGETS[not quick][2]]
    if studio.interrupts.requested or not ready or studio.measure([again, *ready]) < FEWEST_SEEDS:
        return None
    pace = base.seconds.middle / again.seconds.middle
    for m in ready:
        m.times = [pace * seconds for seconds in m.times]
    return sloped(TOGETHER, "sampling", tuple(_record(m, base.choice, true, with_flip=True) for m in ready))


def _noise(measurement: Measurement) -> float:
    """Standard deviation of the pictures of a choice between seeds, over the mean luminance; 0 for a black picture."""
    pictures = measurement.pictures
    mean = luminance(pictures.mean(0))
    return float(pictures.var(0, ddof=1, dtype=float).mean() ** 0.5) / mean if mean > 0 else 0.0


def _record(measurement: Measurement, own: Choice, true: Truth, with_flip: bool) -> Record:
    """The record of a choice. with_flip: whether it has FLIP, and the comparison of hits where they may differ."""
    choice, r, pictures = measurement.choice, true.reference, measurement.pictures
    error, squares, error_map = judged(pictures, r.picture, r.variance, r.luminance, with_flip)
    hits = with_flip and choice.setting in OF_HITS
    return Record(
        setting=choice.setting,
        value=choice.value,
        settings=own.settings | choice.settings,
        seconds=measurement.seconds,
        compile_seconds=measurement.compile_seconds,
        operations=measurement.operations,
        error=error,
        times=np.array(measurement.times),
        squares=squares,
        picture=pictures[0],
        error_map=error_map,
        geometry=geometry(measurement.prepared, true.prepared, 0) if hits else None,
    )


def _curve(varied: VariedSetting, points: list[Record], quick: bool, noisy: bool) -> Curve:
    """The records of a setting, with the scene as it is among them. noisy: whether samples have noise to reduce."""
    by_value = {p.value: p for p in points if p.setting == varied.name}
    row = tuple(
        replace(points[0], setting=varied.name, value=c.value) if c.own else by_value[c.value]
        for c in varied.choices(quick)
    )
    if varied.kind == "sampling" and noisy:
        return sloped(varied.name, varied.kind, row)
    return Curve(varied.name, varied.kind, row)


def sloped(setting: str, kind: str, row: tuple[Record, ...]) -> Curve:
    """The curve of these records, with slopes."""
    times, squares = [p.seconds for p in row], [p.squares for p in row]
    spread = [log(t.high / t.low) / 2 / QUANTILE for t in times]
    by_time, by_count = slope([t.middle for t in times], squares, spread), slope([p.value for p in row], squares)
    return Curve(setting, kind, row, by_time, by_count)


def _notes(scene: Scene) -> list[str]:
    """Notes for the reader, a sentence each."""
    on = explain(scene)
    return [text.format(scene.settings) for effect, text in FIXED.items() if on[effect]]
