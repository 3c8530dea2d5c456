"""The knobs of a scene for an error or for a time: chosen by the model of its costs, checked at its own size.

The model is corrected (scaled.py) by renders of the scene as it is, of the fastest settings, and of what it chooses,
until it chooses nothing better. First it chooses samples and sampler alone, whose curves were measured, then all knobs:
what they do together is a guess. A pair of seeds tells the noise of a render: half of the mean square of their
difference. Accelerator, tolerance of roots and texture filter stay as they are, and so does precision where the error
that is asked for does not want another.
"""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field, replace
from math import ceil, isqrt, sqrt
from pathlib import Path
from typing import NoReturn

import numpy as np

from visray import clock
from visray.adaptive.dual_buffer import Estimate
from visray.adaptive.error_floor import LARGER, check_precision
from visray.errors import UserError
from visray.geometry import UNIT_ROUNDOFF
from visray.passes import empty_film, expose, exposed_once
from visray.progress import Interrupts
from visray.render import adjusted, check_numbers
from visray.scene.address import changed
from visray.scene.load import checked, load
from visray.scene.scene import Scene
from visray.setup import prepare
from visray.study.cost.knobs import DEPTH, MOST_SAMPLES, SAMPLER, SPP
from visray.study.cost.measuring import SMALLEST, TURNS, band, reduced
from visray.study.cost.model import Model, Prediction
from visray.study.cost.reasons import reasons, remains
from visray.study.cost.records import Band
from visray.study.cost.scaled import Scaled
from visray.study.cost.study import cost
from visray.study.cost.tuned import Measured, Settings, Target, Tuned

# Times that the model is asked, of samples and sampler and then of all knobs, and corrected by what its choice came to.
ROUNDS = 3
# What gains less is no gain, but the machine's noise.
GAIN = 0.9
# What another value of a knob gains less than, the scene's own value keeps its place.
WORTH = 1.03
# Renders are repeated, up to TURNS, until they took so many seconds together.
ENOUGH = 1.0


def tune(
    scene: Scene | str | Path, *, setup: str | Path | None = None, error: float | None = None,
    time: float | None = None, quick: bool = True, progress: bool = True, threads: int | None = None,
) -> Tuned:  # fmt: skip
    """The settings of a scene, or a scene file, that make its picture to an error in the least time, or as good as it
    can be in a time.

    error: the root of the mean square over pixels and channels, in linear light, over the picture's mean luminance, of
    which the chosen settings stay below with a chance of 95 %. time: seconds of one render at the scene's own size,
    with its kernels compiled. quick: of the study of its costs (study.py). Each choice is rendered at least twice.
    """
    target = Target.of(error, time)
    if error is not None:
        check_precision(error, "double")
    scene = checked(load(scene, setup) if isinstance(scene, (str, Path)) else scene)
    report = cost(scene, quick=quick, progress=progress, threads=threads, whole=False)
    if report.stopped:
        raise KeyboardInterrupt
    with Interrupts() as interrupts:
        return _Tuning(Scaled(scene, report), target, interrupts, progress).run()


@dataclass
class _Tuning:
    """A choice in the making. tried: what was measured, the scene as it is first, the latest last; predicted: for each
    that the model chose; base: what keeps its place where nothing is clearly better, the scene as it is, or that with
    one sample where it has no noise; fastest: the fastest settings that it knows, which are far from all others but in
    seconds, or the base, before they are measured."""

    scaled: Scaled
    target: Target
    interrupts: Interrupts
    progress: bool
    tried: list[Measured] = field(default_factory=list)
    predicted: list[Prediction] = field(default_factory=list)

    def run(self) -> Tuned:
        """All of it; Ctrl-C keeps the best that was tried, if anything was."""
        self.tried.append(self._measured(self.scaled.own))
        self.base = self.fastest = self.tried[0]
        if self.scaled.report.noiseless and self.base.noise > UNIT_ROUNDOFF["single"] ** 2:
            # Pixels of this size show what those of the study did not.
            self.scaled = Scaled(self.scaled.scene, replace(self.scaled.report, noiseless=False))
        try:
            if self.scaled.report.noiseless and self.scaled.own[SPP] > 1:
                self.tried.append(self._measured(self.scaled.own | {SPP: 1}))
                self.base = self.fastest = self.tried[-1]
            self._try()
        except KeyboardInterrupt:
            if not self.interrupts.requested:
                raise
        return self._told(self._best() or min(self._fewest(self.tried), key=self.target.missed))

    def _try(self) -> None:
        """Measures what the model chooses, until that is no better."""
        settings = self.scaled.kept(self.scaled.model).choices[0].settings
        if settings != self.base.settings:
            self.fastest = self._measured(settings)
        for alone in (True, False):
            for _ in range(ROUNDS):
                wanted, best = self._wanted(alone), self._best()
                gains = best is None or self._price(wanted) <= GAIN * self._price(best)
                if not gains or any(m.settings == wanted.settings for m in self.tried):
                    break
                self.predicted.append(wanted)
                self.tried.append(self._measured(wanted.settings))
        for _ in range(ROUNDS):
            if self.target.time is not None or self._best() is not None or (more := self._more()) is None:
                return
            self.tried.append(self._measured(more))

    def _more(self) -> Settings | None:
        """What came nearest to an error, with so many samples as it would need if they were independent: the model was
        wrong. None where samples do not do it."""
        nearest = min(self.tried, key=self.target.missed)
        n, bias = nearest.settings[SPP], self.scaled.bias(nearest.settings)
        noise, allowed = nearest.error.high**2 - bias, self.target.error**2 - bias
        if allowed <= 0 or n * noise > MOST_SAMPLES * allowed:
            return None
        spp = ceil(n * noise / allowed)
        if nearest.settings[SAMPLER] == "stratified":
            spp = ceil(sqrt(spp)) ** 2
        return nearest.settings | {SPP: spp} if spp > n else None

    def _whole(self) -> Model:
        return self.scaled.whole(self.tried, self.fastest)

    def _best(self) -> Measured | None:
        """Of what meets the target; the base, where nothing is clearly better."""
        price, met = self._price, self._fewest([m for m in self.tried if self.target.met(m)])
        best = min(met, key=price, default=None)
        return self.base if self.base in met and price(best) > GAIN * price(self.base) else best

    def _fewest(self, found: list[Measured]) -> list[Measured]:
        """Where there is no noise, those of one sample, if there are any: it takes no longer than more do, whatever a
        clock says of renders that are so short."""
        return [m for m in found if m.settings[SPP] == 1 and self.scaled.report.noiseless] or found

    def _price(self, found: Measured | Prediction) -> float:
        """What is to be small: the seconds where an error is asked for, the error where a time is, with as much as may
        be left whatever the samples, as the model has it."""
        if isinstance(found, Prediction):
            return found.seconds if self.target.time is None else found.error
        return found.seconds.middle if self.target.time is None else self._surely(found)

    def _surely(self, found: Measured) -> float:
        """The error of what was measured, with as much as may be left whatever the samples."""
        return sqrt(found.noise + self.scaled.bias(found.settings))

    def _wanted(self, alone: bool) -> Prediction:
        """What the model chooses now, of samples and sampler alone where they do it; raises UserError where there is
        nothing to choose."""
        target, latest, whole = self.target, self.tried[-1], self._whole()
        models = [self.scaled.kept(whole, alone=True)] * alone + [self.scaled.kept(whole), whole]
        if target.time is not None:
            settings = next((s for m in models[:-1] if (s := m.best(target.time))), None)
            if settings is None:
                if not target.met(self.fastest):
                    took = self.fastest.seconds.middle
                    raise UserError(f"time = {target.time:g}: the fastest of the settings measured takes {took:.2g} s")
                settings = self.fastest.settings
            settings = self._fitting(whole, settings, 1.0)
        else:
            # That much above the estimate lies what the true error may be.
            sure = self._surely(latest) / latest.error.high if latest.error.high else 1.0
            found = ((s, x) for x in (sure, 1.0) for m in models if (s := m.fastest(x * target.error)))
            settings, sure = next(found, None) or self._refuse(whole)
            settings = self._fitting(whole, settings, sure)
        settings = self._plainer(whole, settings)
        return Prediction(settings, whole.seconds(settings), whole.error(settings))

    def _fitting(self, model: Model, settings: Settings, sure: float) -> Settings:
        """The settings with as many samples as the target needs, or has time for: the model's own choice is among few
        counts, and where samples are too quick to be timed it takes the most. Up to twice as many, and squares where
        strata want them."""
        if self.scaled.report.noiseless:
            return settings | {SPP: 1}
        target, most = self.target, min(2 * settings[SPP], MOST_SAMPLES)
        strata = settings[SAMPLER] == "stratified"
        counts = [k * k for k in range(1, isqrt(most) + 1)] if strata else range(1, most + 1)
        if target.time is None:
            # Of more samples the error is no larger.
            enough = bisect_left(counts, True, key=lambda n: model.error(settings | {SPP: n}) <= sure * target.error)
            return settings | {SPP: counts[enough]} if enough < len(counts) else settings
        fit = bisect_right(counts, target.time, key=lambda n: model.seconds(settings | {SPP: n}))
        return settings | {SPP: counts[fit - 1]} if fit else settings

    def _refuse(self, model: Model) -> NoReturn:
        """No settings have so small an error."""
        least = min(model.choices, key=lambda c: c.error)
        text = f"error = {self.target.error:g}: the best of the settings measured makes {least.error:.2g}"
        left, depth = self.scaled.left(least.settings), self.scaled.at(least.settings, DEPTH)
        if sqrt(left.high) > self.target.error / 2:
            deep = self.scaled.cut[depth].high > left.high / 2
            whose = f"settings.depth = {depth}" if deep else "what is searched for and rounded"
            text += f", {remains(left)} of it whatever the samples, by {whose}"
        raise UserError(f"{text}; {LARGER}")

    def _plainer(self, model: Model, settings: Settings) -> Settings:
        """The settings, with the scene's own value of each knob that gains next to nothing by another."""
        seconds, error = model.seconds(settings), model.error(settings)
        for addresses in self.scaled.groups.values():
            if addresses == (SPP,) and self.scaled.report.noiseless:
                continue
            own = settings | {a: self.scaled.own[a] for a in addresses}
            late, off = model.seconds(own) / seconds, model.error(own) / error if error else 1.0
            # Of what is asked for nothing is given up.
            if (late <= WORTH and off <= 1) if self.target.time is None else (late <= 1 and off <= WORTH):
                settings = own
        return settings

    def _measured(self, settings: Settings) -> Measured:
        """Renders of two seeds, or more where they are short; Ctrl-C ends them."""
        chosen = changed(self.scaled.scene, self.scaled.changes(settings))
        _compiled(chosen)
        prepared, first = prepare(chosen), chosen.settings.seed
        pictures, times = [], []
        while len(times) < 2 or (len(times) < TURNS and sum(times) < ENOUGH):
            shot = replace(prepared, scene=adjusted(chosen, seed=(first + len(times)) % 2**32))
            begun = clock.now()
            film, _ = expose(shot, self.progress, self.interrupts)
            times.append(clock.now() - begun)
            if self.interrupts.requested:
                raise KeyboardInterrupt
            if len(pictures) < 2:
                pictures.append(np.array(film.mean))
                check_numbers(prepared, pictures[-1])
        # Of the mean of both the variance is half of each one's.
        pair = Estimate.of(*pictures)
        noise, left = (2 * np.square([pair.error, pair.low, pair.high])).tolist(), self.scaled.left(settings)
        error = Band(*(sqrt(n + x) for n, x in zip(noise, (left.middle, left.low, left.high))))
        return Measured(settings, band(times), error, noise[0])

    def _told(self, found: Measured) -> Tuned:
        """The outcome, with its reasons."""
        before, model, stopped = self.tried[0], self._whole(), self.interrupts.requested
        guess = Prediction(found.settings, model.seconds(found.settings), model.error(found.settings))
        guess = next((c for c in self.predicted if c.settings == found.settings), guess)
        changes = self.scaled.changes(found.settings)
        left = self.scaled.left(found.settings)
        # Of the error that it is chosen by, the estimate of it: as what was measured is told.
        expected = sqrt(max(guess.error**2 - left.high + left.middle, 0.0))
        met, why = self.target.met(found), [*reasons(self.scaled, model, found.settings)]
        if not met:
            why.append("no settings were found that do it: these come nearest")
        if stopped:
            why.append("stopped before its end: of what was tried until then these are the best")
        return Tuned(
            self.target, found.settings, changes, expected, guess.seconds, found.error, found.seconds, before, met,
            stopped, tuple(why), changed(self.scaled.scene, changes), self.scaled.report,
        )  # fmt: skip


def _compiled(scene: Scene) -> None:
    """Makes the kernels of a render, by a small picture: first passes and further ones."""
    prepared = prepare(reduced(scene, SMALLEST))
    film = empty_film(prepared)
    for count in (1, 2):
        film = exposed_once(prepared, film, count)
