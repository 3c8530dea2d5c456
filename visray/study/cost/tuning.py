"""Choice of the settings of a scene for an error or for a time.

A study measures the curves of all settings on reduced pictures. The candidate takes the best measured value of each
setting, if that value is better beyond the noise (comparing.together). Its path depth is the least that leaves out far
less than the error, measured at the scene's own size. Its precision becomes double only if single cannot reach the
error. Accelerator, root tolerance and texture filter stay.

Samples per pixel are not chosen here: the adaptive sampler chooses them (visray/adaptive). It renders the scene to the
target at its own size, with the scene's own settings and with the candidate, and estimates both errors without bias.
The candidate is taken only if its render was better.
"""

from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path

import numpy as np

from visray import clock
from visray.adaptive.depth_bias import deeper_than, depth_biases, depth_without_bias
from visray.adaptive.dual_buffer import DualBuffer
from visray.adaptive.error_floor import LARGER, ROOM, Files, check_precision
from visray.adaptive.evidence import NotANumber
from visray.adaptive.result import adaptive_sampler, render_adaptively
from visray.adaptive.stopping import Goal
from visray.animation.moment import still_at
from visray.arguments import checked_arguments
from visray.errors import UserError
from visray.picture_layers import check_numbers
from visray.progress import Interrupts
from visray.scene.address import changed
from visray.scene.adjusted import adjusted
from visray.scene.load import checked, load
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare, set_threads
from visray.study.cost import study
from visray.study.cost.choices import DEPTH, PRECISION, SAMPLER, SPP
from visray.study.cost.comparing import GAIN, own_samples, together
from visray.study.cost.measuring import band
from visray.study.cost.records import Band, Report, Settings
from visray.study.cost.tuned import Measured, Target, Tuned
from visray.study.cost.writing import duration, interval, number, percent

# The squared bias of a depth or of single precision is at most this share of the squared error.
BELOW = 1 / 16
# Samples per pixel, in each half, that measure what a depth leaves out.
PILOT = 4
# Renders with the same settings are repeated, by turns, up to RENDERS times until they took so many seconds together.
RENDERS, ENOUGH = 5, 2.0
# Samples per pixel that an error may take; a larger number would take hours, even for a small picture.
MOST_SPP = 2**18


@checked_arguments
def tune(
    scene: Scene | str | Path, *, setup: str | Path | None = None, error: float | None = None,
    time: float | None = None, quick: bool = True, progress: bool = True, threads: int | None = None,
    allow_outside: bool = False,
) -> Tuned:  # fmt: skip
    """Chooses the settings of a scene, or a scene file, with which `render(scene, error=error)` takes the least time,
    or `render(scene, time=time)` has the least error.

    error: root mean square over pixels and channels in linear light, over the mean luminance
    time: seconds of one render at the scene's own size, with its kernels compiled
    quick: whether the study is the quick one
    allow_outside: whether a scene file may name files outside of its folder
    """
    target = Target.of(error, time)
    if error is not None:
        check_precision(error, "double")
    if isinstance(scene, (str, Path)):
        scene = load(scene, setup, allow_outside=allow_outside)
    given = checked(scene)
    scene = still_at(given, None)
    if threads is not None:
        set_threads(threads)
    with Interrupts() as interrupts:
        report = study.studied(scene, quick, study.LEAST_SEEDS, progress, interrupts, for_tuning=True)
        if report.stopped:
            raise KeyboardInterrupt
        tuned = _Tuner(scene, report, target, interrupts, progress).run()
        # An animated scene was tuned at its beginning, and keeps its animation.
        return replace(tuned, scene=changed(given, tuned.changed)) if given.animation else tuned


@dataclass
class _Tuner:
    """The search for the settings that `tune` returns.

    scene: the scene
    report: the report of the study
    target: the error or the time to reach
    interrupts, progress: Ctrl-C, and whether progress is shown
    """

    scene: Scene
    report: Report
    target: Target
    interrupts: Interrupts
    progress: bool = False

    @property
    def own(self) -> Settings:
        """The scene's own settings, without samples per pixel."""
        return {a: v for a, v in self.report.default.settings.items() if a != SPP}

    def run(self) -> Tuned:
        """The result. Ctrl-C raises KeyboardInterrupt before the first render is complete. After it, the better of the
        settings that were rendered is the result."""
        self._refuse_far_targets()
        error = self.target.error or self.report.default.error.rmse.middle
        candidate = self.own | self._together() | self._depth(error) | self._precision(error)
        choices = [self.own] if candidate == self.own else [self.own, candidate]
        before, after = (*self._rendered(choices), None)[:2]
        if after is None or (before is not None and not self._better(after, before)):
            after = before
        return self._result(before, after)

    def _refuse_far_targets(self) -> None:
        """Raises a UserError if an error would take more than MOST_SPP samples per pixel, by the slope of the
        scene's own sampler. Adaptive samples are fewer than that, but not by orders of magnitude."""
        curve = own_samples(self.report.curves, self.report.default)
        last, k = curve.points[-1], float(np.clip(curve.by_count.k, 0.5, 1.5)) if curve.by_count else 0.5
        error = self.target.error or np.inf
        if (samples := last.value * (last.error.deviation.low / error) ** (1 / k)) > MOST_SPP:
            raise UserError(f"error = {error:g}: it would take about {samples:.1g} samples per pixel; {LARGER}")

    def _better(self, one: Measured, other: Measured) -> bool:
        """Whether one render is clearly better than another: faster for an error, more accurate for a time."""
        if self.target.met(one) != self.target.met(other):
            return self.target.met(one)
        if self.target.error is not None:
            return one.seconds.middle < GAIN * other.seconds.middle
        # An error falls as time^-1/2 or faster.
        return one.error.middle < sqrt(GAIN) * other.error.middle

    def _together(self) -> Settings:
        """The best measured values of the sampler and of the numbers of light samples and rays."""
        best = together(self.report.curves, self.report.default)
        settings = {a: v for a, v in best.items() if a not in (SPP, SAMPLER, DEPTH, PRECISION)}
        # The adaptive sampler takes Sobol points in place of stratified ones.
        sampler, own = (adaptive_sampler(x) for x in (best.get(SAMPLER, self.own[SAMPLER]), self.own[SAMPLER]))
        return settings | ({SAMPLER: sampler} if sampler != own else {})

    def _precision(self, error: float) -> Settings:
        """Double precision, if single is off by too much for an error; else nothing."""
        single = self.report.floors.get("single precision", 0.0)
        too_rough = self.target.error is not None and single**2 > BELOW * error**2
        return {PRECISION: "double"} if too_rough and self.own[PRECISION] == "single" else {}

    def _depth(self, error: float) -> Settings:
        """The least depth that leaves out far less than an error and is faster than the scene's own; a larger one if
        the scene's own leaves out more; nothing if no depth is better."""
        if DEPTH not in self.own:
            return {}
        own, biases = self.own[DEPTH], self.depth_biases()
        points = {p.value: p for c in self.report.curves if c.setting == "depth" for p in c.points}
        # If no depth leaves out so little, one that leaves room for noise.
        for share in (BELOW, ROOM):
            for depth in sorted(biases):
                faster = depth in points and points[depth].seconds.high < self.report.default.seconds.low
                if biases[depth].high <= share * error**2 and (depth >= own or (faster and share == BELOW)):
                    return {DEPTH: depth}
        return {}

    def depth_biases(self) -> dict[int, Band]:
        """Squared relative bias of each depth of the study, and of larger ones, at the scene's own size."""
        depths = tuple(p.value for c in self.report.curves if c.setting == "depth" for p in c.points)
        depths += deeper_than(max(depths))
        buffer = DualBuffer(prepare(adjusted(self.scene, sampler="sobol")))
        buffer.extend(np.full_like(buffer.counts, PILOT))
        scale = (buffer.estimate().luminance or 1.0) ** 2
        biases = depth_biases(buffer, depths, depth_without_bias(max(depths)))
        return {b.depth: Band(*(max(x, 0.0) / scale for x in (b.square, b.low, b.high))) for b in biases}

    def _rendered(self, choices: list[Settings]) -> list[Measured | None]:
        """Renders to the target with each of these settings, by turns and with new seeds. None stands for settings that
        cannot reach the target, or that Ctrl-C left without a render; raises the error if all of them are such."""
        scenes = [changed(self.scene, self._changes(settings)) for settings in choices]
        prepared = [prepare(adjusted(s, sampler=adaptive_sampler(s.settings.sampler))) for s in scenes]
        renders: list[list[Measured]] = [[] for _ in choices]
        refusals: dict[int, UserError] = {}
        for p in prepared:
            DualBuffer(p).compile()
        try:
            for number in range(RENDERS):
                for i, (settings, p) in enumerate(zip(choices, prepared)):
                    if i not in refusals:
                        try:
                            renders[i].append(self._render(settings, p, number))
                        except UserError as error:
                            refusals[i] = error
                if sum(m.seconds.middle for row in renders for m in row) >= ENOUGH * len(choices):
                    break
        except KeyboardInterrupt:
            if not (self.interrupts.requested and any(renders)):
                raise
        if not any(renders):
            raise refusals[len(choices) - 1]
        return [_median(row) if row else None for row in renders]

    def _render(self, settings: Settings, prepared: Prepared, number: int) -> Measured:
        """One adaptive render to the target. number: of the render; each has its own seed, and the first one shows
        its progress."""
        seed = (prepared.scene.settings.seed + number) % 2**32
        prepared = prepared.adjusted(adjusted(prepared.scene, seed=seed))
        goal, progress = Goal(self.target.error, self.target.time, clock.now()), self.progress and number == 0
        try:
            facts = render_adaptively(prepared, goal, Files(), ("RGB",), progress, self.interrupts).facts
        except NotANumber as error:
            check_numbers(prepared, error.mean)
            raise
        if self.interrupts.requested:
            raise KeyboardInterrupt
        if "time_missed" in facts:
            raise UserError(f"time = {self.target.time:g}: {facts['time_missed']}; give more")
        seconds = goal.seconds_passed()
        error = Band(facts["error"], facts["error_low"], facts["error_high"])
        return Measured(settings, Band(seconds, seconds, seconds), error, facts["spp"])

    def _changes(self, settings: Settings) -> Settings:
        """Those of the settings that differ from the scene's own."""
        return {a: v for a, v in settings.items() if v != self.own[a]}

    def _result(self, before: Measured | None, best: Measured) -> Tuned:
        """The result with its reasons."""
        changes, met, option = self._changes(best.settings), self.target.met(best), self.target.option
        reasons = [f"{a.removeprefix('settings.')} {self.own[a]} -> {v}" for a, v in changes.items()]
        if not changes:
            reasons.append("the scene's own settings: nothing that was measured is clearly better")
        reached = f"error {interval(best.error, percent)} in {duration(best.seconds.middle)}"
        reasons.append(f"rendered at full size with {option}: {reached}, {number(best.spp)} samples per pixel")
        if changes and before is not None:
            old = f"error {percent(before.error.middle)} in {duration(before.seconds.middle)}"
            reasons.append(f"with the scene's own settings: {old}, {number(before.spp)} samples per pixel")
        if not met:
            reasons.append("the target was missed: these settings come nearest")
        if self.interrupts.requested:
            reasons.append("stopped before its end: not all renders were made")
        more = "" if self.target.time is None else " and some seconds more: there, loading and compiling count"
        reasons.append(f"to get this picture, render the scene with {option}{more}")
        return Tuned(
            target=self.target,
            settings=best.settings,
            changed=changes,
            after=best,
            before=before,
            met=met,
            stopped=self.interrupts.requested,
            reasons=tuple(reasons),
            scene=changed(self.scene, changes),
            report=self.report,
        )


def _median(renders: list[Measured]) -> Measured:
    """The render of median error, with the median and the interval of all seconds."""
    middle = sorted(renders, key=lambda m: m.error.high)[len(renders) // 2]
    return Measured(middle.settings, band([m.seconds.middle for m in renders]), middle.error, middle.spp)
