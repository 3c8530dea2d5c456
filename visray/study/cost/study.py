"""What accuracy costs for a scene: all that is measured of it, together."""

from collections.abc import Sequence
from dataclasses import replace
from math import log
from pathlib import Path

import numpy as np

from visray import clock
from visray.adaptive.dual_buffer import QUANTILE
from visray.errors import UserError
from visray.progress import Interrupts
from visray.render import explain, set_threads
from visray.scene.load import checked, load
from visray.scene.scene import Scene
from visray.study.cost.errors import FEWEST as FEWEST_SEEDS
from visray.study.cost.errors import judged
from visray.study.cost.floors import floors
from visray.study.cost.frontier import frontier, halvings
from visray.study.cost.hits import geometry
from visray.study.cost.knobs import KEPT, Choice, Knob, default, knobs
from visray.study.cost.measuring import LONGEST, Studio, Taken, reduced
from visray.study.cost.model import Model
from visray.study.cost.records import Curve, Point
from visray.study.cost.slopes import slope
from visray.study.cost.standing import standing
from visray.study.cost.studied import Study
from visray.study.cost.truth import FINER, Truth, luminance, truth
from visray.study.cost.wording import STOPPED
from visray.study.machine import machine

LEAST_SEEDS, MOST_SEEDS = 16, 4096
# Quick and full: seconds that the kernels of all choices may run, those of the reference, and of the joint points.
BUDGETS = (16.0, 30.0, 8.0), (120.0, 150.0, 50.0)
# How many points of several knobs.
JOINT = 4, 8
# After Ctrl-C, what is measured is still to be judged: by a reference that is made in so many seconds.
HURRIED = 2.0
# Seeds of the reference lie so far from those that are measured.
APART = 2**31
# What these knobs turn may change what is hit; the others only how often it is looked.
OF_HITS = ("default", "precision", "roots", "accelerator")
FIXED = {
    "scatter": "settings.scatter.depth, {0.scatter.depth}, says which light there is: held fixed",
    "near occlusion": "settings.occlusion.distance, {0.occlusion.distance:g}, says which light there is: held fixed",
}


def cost(
    scene: Scene | str | Path, *, setup: str | Path | None = None, quick: bool = False, seeds: int = LEAST_SEEDS,
    progress: bool = True, threads: int | None = None, whole: bool = True,
) -> Study:  # fmt: skip
    """What accuracy costs for a scene, or a scene file, by its own knobs.

    quick: fewer positions of each knob, on smaller pictures. seeds: of each choice, from 16 to 4096. Ctrl-C keeps what
    is measured, where that is enough for errors with a spread, and raises KeyboardInterrupt where not. whole: else
    there are but the curves of the knobs, without FLIP, hits and points of several knobs: what `tune` needs.
    """
    begun = clock.now()
    name = str(scene) if isinstance(scene, (str, Path)) else "a scene given in Python"
    scene = checked(load(scene, setup) if isinstance(scene, (str, Path)) else scene)
    if not isinstance(seeds, int) or isinstance(seeds, bool) or not LEAST_SEEDS <= seeds <= MOST_SEEDS:
        raise UserError(f"seeds = {seeds}: must be a whole number from {LEAST_SEEDS} to {MOST_SEEDS}")
    if threads is not None:
        set_threads(threads)
    with Interrupts() as interrupts:
        report = _studied(scene, quick, seeds, progress, interrupts, whole)
    return replace(report, scene=name, seconds=clock.now() - begun)


def _studied(scene: Scene, quick: bool, count: int, progress: bool, interrupts: Interrupts, whole: bool) -> Study:
    small = reduced(scene, LONGEST[not quick])
    turned, budgets = knobs(small), BUDGETS[not quick]
    first, own = scene.settings.seed, default(small, turned)
    studio = Studio(small, [(first + i) % 2**32 for i in range(count)], interrupts, progress)
    others = [c for k in turned for c in k.choices(quick) if not c.own]
    studio, taken = _measured(studio, [own, *others], budgets[0])
    stopped, small = interrupts.requested, studio.scene
    zero = [address for k in turned if k.name == "roots" for address in k.all[0].settings]
    seeds = tuple((first + APART + i) % 2**32 for i in range(2))
    seconds = HURRIED if stopped else budgets[1]
    true = truth(small, zero, min(map(_noise, taken)), seeds, seconds, studio.mark, interrupts, progress)
    points = [_point(t, own, true, whole) for t in taken]
    same = all((p == taken[0].parts[0][0]).all() for p in taken[0].parts)
    curves = tuple(_curve(k, points, quick, not same) for k in turned)
    joint = () if stopped or same or not whole else _joint(studio, points[0], curves, taken[0], true, quick)
    every, ended = (*points, *joint), interrupts.requested
    # Without noise there is nothing that samples could halve.
    halved = [c for c in curves if not (same and c.kind == "sampling")]
    return Study(
        scene="",
        scene_hash=scene.hash(),
        width=small.film.width,
        height=small.film.height,
        seeds=len(points[0].squares),
        quick=quick,
        default=points[0],
        curves=curves,
        joint=joint,
        frontier=frontier(every),
        halvings=halvings(halved, points[0]),
        floors=floors(taken, true.reference),
        reference=true.reference,
        noiseless=same,
        stopped=ended,
        seconds=0.0,
        machine=machine(),
        notes=(*_notes(small, points[0], every, same), *true.notes, *[STOPPED] * ended),
    )


def _measured(studio: Studio, choices: Sequence[Choice], budget: float) -> tuple[Studio, list[Taken]]:
    """All choices, measured on pictures of a size that fits the budget; the studio that they were made in."""
    studio, taken = studio.fitting(studio.prepared(choices), budget)
    if len(taken) < len(choices) or studio.measure(taken) < FEWEST_SEEDS:
        raise KeyboardInterrupt
    return studio, taken


def _joint(
    studio: Studio, base: Point, curves: tuple[Curve, ...], own: Taken, true: Truth, quick: bool
) -> tuple[Point, ...]:
    """Points where several knobs are turned, as a model of the curves suggests; none after Ctrl-C.

    The default is measured again by turns with them, and tells how much faster or slower the machine is now.
    """
    # They go up by equal factors: together they take less than three times as long as the longest.
    longest = BUDGETS[not quick][2] / len(studio.seeds) / 3
    model = Model.of(base, tuple(c for c in curves if c.knob not in KEPT))
    # The truth has to be that much better than they are.
    known = FINER * true.reference.error
    ladder = [s for s in model.ladder(JOINT[not quick], longest) if model.error(s) >= known]
    choices = [Choice("joint", f"joint {i}", settings) for i, settings in enumerate(ladder, 1)]
    taken = studio.prepared([replace(own.choice, knob="again"), *choices])
    if studio.interrupts.requested or len(taken) < 2 or studio.measure(taken) < FEWEST_SEEDS:
        return ()
    pace = own.seconds.middle / taken[0].seconds.middle
    for t in taken:
        t.times = [pace * seconds for seconds in t.times]
    return tuple(_point(t, own.choice, true, whole=True) for t in taken[1:])


def _noise(taken: Taken) -> float:
    """The standard deviation between seeds, relative to the mean; 0 for a black picture."""
    pictures = taken.pictures
    mean = luminance(pictures.mean(0))
    return float(pictures.var(0, ddof=1, dtype=float).mean() ** 0.5) / mean if mean > 0 else 0.0


def _point(taken: Taken, own: Choice, true: Truth, whole: bool) -> Point:
    """A choice, judged; `whole` as in cost."""
    choice, r, pictures = taken.choice, true.reference, taken.pictures
    error, squares, wrong = judged(pictures, r.picture, r.variance, r.luminance, whole)
    return Point(
        knob=choice.knob,
        value=choice.value,
        settings=own.settings | choice.settings,
        seconds=taken.seconds,
        compile_seconds=taken.compile_seconds,
        operations=taken.operations,
        error=error,
        times=np.array(taken.times),
        squares=squares,
        picture=pictures[0],
        wrong=wrong,
        geometry=geometry(taken.prepared, true.prepared, 0) if whole and choice.knob in OF_HITS else None,
    )


def _curve(knob: Knob, points: list[Point], quick: bool, noisy: bool) -> Curve:
    """The points of a knob; where it is as the scene has it, the default. Slopes are those of noise."""
    found = {p.value: p for p in points if p.knob == knob.name}
    row = tuple(
        replace(points[0], knob=knob.name, value=c.value) if c.own else found[c.value] for c in knob.choices(quick)
    )
    by_time = by_count = None
    if knob.kind == "sampling" and noisy:
        times, squares = [p.seconds for p in row], [p.squares for p in row]
        spread = [log(t.high / t.low) / 2 / QUANTILE for t in times]
        by_time = slope([t.middle for t in times], squares, spread)
        by_count = slope([p.value for p in row], squares)
    return Curve(knob.name, knob.kind, row, by_time, by_count)


def _notes(scene: Scene, base: Point, points: tuple[Point, ...], noiseless: bool) -> tuple[str, ...]:
    """What a reader must know, a sentence each."""
    on, film = explain(scene), scene.film
    size = f"on pictures of {film.width} x {film.height} pixels"
    lines = [
        f"seconds are those that compiled kernels run, {size}, without tracing them in Python",
        standing(points, base),
    ]
    lines += [text.format(scene.settings) for effect, text in FIXED.items() if on[effect]]
    if noiseless:
        lines.append("all seeds give the same picture: there is no noise that samples could lessen")
    return tuple(lines)
