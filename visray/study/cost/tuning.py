"""The knobs of a scene for an error or for a time: chosen by the model of its costs, checked at its own size.

The model knows a reduced picture (study.py). At the scene's own size a render takes a + b t seconds where the model
says t: b is for the pixels, which are more, and a for what each render does once. Noise is a mean over pixels, so their
number is nothing to it; but of more pixels fewer show edges. So its square is c times the model's: the square, because
those are what add up. Bias is the same at any size that shows the same things, but for what a depth leaves out, which
is in few pixels: that is measured again.

a, b and c come from renders at the scene's own size: of the scene as it is, of the fastest settings, and of what the
model chooses, until it chooses nothing better. First it chooses samples and sampler alone, whose curves were measured,
then all knobs: what they do together is a guess. A pair of seeds tells the noise of a render: half of the mean square
of their difference. Accelerator, tolerance of roots and texture filter stay as they are, and so does precision where
the error that is asked for does not want another.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isqrt, sqrt
from pathlib import Path
from time import perf_counter
from typing import Any, NoReturn

import numpy as np

from visray.errors import UserError
from visray.exposure import expose, exposed_once, set_up
from visray.film import Film
from visray.halves import Estimate, Halves
from visray.progress import Patience
from visray.reachable import DEEPEST
from visray.render import adjusted, check_numbers
from visray.scene.address import changed, value
from visray.scene.load import checked, load
from visray.scene.scene import Scene
from visray.study.cost.fitting import Laws, Sampler, Way
from visray.study.cost.knobs import DEPTH, KEPT, MOST_SAMPLES, PRECISION, SAMPLER, SPP
from visray.study.cost.laws import Through, nonnegative
from visray.study.cost.measuring import SMALLEST, TURNS, band, reduced
from visray.study.cost.model import Choice, Model
from visray.study.cost.records import Band, Report
from visray.study.cost.study import cost
from visray.study.cost.tuned import Goal, Measured, Settings, Tuned
from visray.truncation import truncation

# Times that the model is asked, of samples and sampler and then of all knobs, and corrected by what its choice came to.
ROUNDS = 3
# What gains less is no gain, but the machine's noise.
GAIN = 0.9
# What another value of a knob gains less than, the scene's own value keeps its place.
WORTH = 1.03
# Renders are repeated, up to TURNS, until they took so many seconds together.
ENOUGH = 1.0
# Samples per pixel that tell what a depth leaves out.
PILOT = 4


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
    goal = Goal.asked(error, time)
    scene = checked(load(scene, setup) if isinstance(scene, (str, Path)) else scene)
    report = cost(scene, quick=quick, progress=progress, threads=threads)
    if report.stopped:
        raise KeyboardInterrupt
    with Patience() as patience:
        return _Tuning(scene, goal, report, patience, progress).run()


@dataclass
class _Tuning:
    """A choice in the making. tried: what was measured, the scene as it is first, the latest last; predicted: for each
    that the model chose; fastest: the fastest settings that it knows, which are far from all others but in seconds."""

    scene: Scene
    goal: Goal
    report: Report
    patience: Patience
    progress: bool
    tried: list[Measured] = field(default_factory=list)
    predicted: list[Choice] = field(default_factory=list)

    def run(self) -> Tuned:
        self.tried.append(self._measured(self.own))
        settings = self._kept(self.model).choices[0].settings
        self.fastest = self._measured(settings) if settings != self.own else self.tried[0]
        for alone in (True, False):
            for _ in range(ROUNDS):
                wanted, best = self._wanted(alone), self._best()
                gains = best is None or self.goal.price(wanted) <= GAIN * self.goal.price(best)
                if not gains or any(m.settings == wanted.settings for m in self.tried):
                    break
                self.predicted.append(wanted)
                self.tried.append(self._measured(wanted.settings))
        return self._told(self._best() or min(self.tried, key=self.goal.missed))

    def _best(self) -> Measured | None:
        """Of what meets the goal; the scene as it is, where nothing is clearly better."""
        price, met = self.goal.price, [m for m in self.tried if self.goal.met(m)]
        best = min(met, key=price, default=None)
        return self.tried[0] if self.tried[0] in met and price(best) > GAIN * price(self.tried[0]) else best

    def _wanted(self, alone: bool) -> Choice:
        """What the model chooses now, of samples and sampler alone where they do it; raises UserError where there is
        nothing to choose."""
        goal, latest, whole = self.goal, self.tried[-1], self._scaled()
        models = [self._kept(whole, alone=True)] * alone + [self._kept(whole), whole]
        if goal.time is not None:
            settings = next((s for m in models[:-1] if (s := m.best(goal.time))), None)
            if settings is None:
                if not goal.met(self.fastest):
                    took = self.fastest.seconds.middle
                    raise UserError(f"time = {goal.time:g}: the fastest of the settings measured takes {took:.2g} s")
                settings = self.fastest.settings
            settings = self._fitting(whole, settings, 1.0)
        else:
            # That much above the estimate lies what the true error may be.
            sure = latest.error.middle / latest.error.high if latest.error.high else 1.0
            found = ((s, x) for x in (sure, 1.0) for m in models if (s := m.fastest(x * goal.error)))
            settings, sure = next(found, None) or self._refuse(whole)
            settings = self._fitting(whole, settings, sure)
        settings = self._plainer(whole, settings)
        return Choice(settings, whole.seconds(settings), whole.error(settings))

    def _fitting(self, model: Model, settings: Settings, sure: float) -> Settings:
        """The settings with as many samples as the goal needs, or has time for: the model's own choice is among few
        counts, and where samples are too quick to be timed it takes the most. Up to twice as many, and squares where
        strata want them."""
        n, goal = settings[SPP], self.goal
        while goal.time is None and n > 1 and model.error(settings | {SPP: n // 2}) <= sure * goal.error:
            n //= 2
        if settings[SAMPLER] == "stratified":
            counts = [k * k for k in range(1, isqrt(2 * n) + 1) if 2 * k * k >= n]
        else:
            counts = list(range(-(-n // 2), 2 * n + 1))
        every = [settings | {SPP: min(k, MOST_SAMPLES)} for k in counts]
        if goal.time is None:
            return next((s for s in every if model.error(s) <= sure * goal.error), settings)
        return next((s for s in reversed(every) if model.seconds(s) <= goal.time), settings)

    def _refuse(self, model: Model) -> NoReturn:
        """No settings have so small an error."""
        least = min(model.choices, key=lambda c: c.error)
        text = f"error = {self.goal.error:g}: the best of the settings measured makes {least.error:.2g}"
        left, depth = self._bias(least.settings), self._at(least.settings, DEPTH)
        if sqrt(left) > self.goal.error / 2:
            whose = f"settings.depth = {depth}" if self._cut[depth] > left / 2 else "what is searched for and rounded"
            text += f", {sqrt(left):.2g} of it whatever the samples, by {whose}"
        raise UserError(text)

    def _plainer(self, model: Model, settings: Settings) -> Settings:
        """The settings, with the scene's own value of each knob that gains next to nothing by another."""
        seconds, error = model.seconds(settings), model.error(settings)
        for addresses in self._groups.values():
            own = settings | {a: self.own[a] for a in addresses}
            late, off = model.seconds(own) / seconds, model.error(own) / error if error else 1.0
            # Of what is asked for nothing is given up.
            if (late <= WORTH and off <= 1) if self.goal.time is None else (late <= 1 and off <= WORTH):
                settings = own
        return settings

    @cached_property
    def own(self) -> Settings:
        return self.report.default.settings

    @cached_property
    def model(self) -> Model:
        """Of the reduced picture."""
        curves = [c for c in self.report.curves if c.knob not in KEPT]
        if self.report.noiseless:
            # Samplers and counts differ in nothing but how fast the machine happened to be.
            curves = [c for c in curves if c.kind != "sampling" or c.knob == f"samples, {self.own[SAMPLER]}"]
        return Model.of(self.report.default, tuple(curves))

    def _kept(self, model: Model, alone: bool = False) -> Model:
        """The model with no other precision than the scene's; alone: where samples and sampler alone are turned."""
        own, laws = self.own, model.laws
        ways = tuple(
            tuple(w for w in row if w.settings.get(PRECISION, own[PRECISION]) == own[PRECISION]) for row in laws.ways
        )
        if not alone:
            return Model(model.default, replace(laws, ways=ways))
        counts = tuple(replace(c, values=({a: own[a] for a in c.addresses},)) for c in laws.counts)
        # Of each knob the scene's own value comes first.
        return Model(model.default, replace(laws, ways=tuple(row[:1] for row in ways), counts=counts))

    @cached_property
    def _groups(self) -> dict[str, tuple[str, ...]]:
        """The addresses that are turned together, by the name of their knob."""
        laws, own, names = self.model.laws, self.own, {}
        for c in self.report.curves:
            names |= {a: c.knob for p in c.points for a in p.settings if p.settings[a] != own[a]}
        turned = [*(c.addresses for c in laws.counts), *(tuple(row[0].settings) for row in laws.ways)]
        return {"samples per pixel": (SPP,), "sampler": (SAMPLER,)} | {names[t[0]]: t for t in turned}

    def _at(self, settings: Settings, address: str) -> Any:
        return settings[address] if address in settings else value(self.scene, address)

    @cached_property
    def _cut(self) -> dict[int, float]:
        """What each depth leaves out, relative and squared: as much as it may be, with a chance of 95 %."""
        depths = tuple(p.value for c in self.report.curves if c.knob == "depth" for p in c.points)
        if not depths:
            return {self.scene.settings.depth: 0.0}
        halves = Halves(set_up(adjusted(self.scene, sampler="sobol")))
        halves.extend(np.full_like(halves.counts, PILOT))
        scale = (halves.estimate().luminance or 1.0) ** 2
        left = truncation(halves, depths, min(4 * max(depths) + 4, DEEPEST))
        return {t.depth: max(t.high, 0.0) / scale for t in left}

    @cached_property
    def _single(self) -> float:
        """The squared error of single precision, where it shows."""
        return self.report.floors.get("single precision", 0.0) ** 2

    @cached_property
    def _rest(self) -> float:
        """The squared bias of the scene as it is that is neither its depth's nor its precision's."""
        bias, depth = self.report.default.error.bias, f"depth {self.scene.settings.depth}"
        known = self.report.floors.get(depth, 0.0) ** 2 + self._single
        return max(bias.middle**2 - known, 0.0) if bias.low > 0 else 0.0

    def _bias(self, settings: Settings) -> float:
        """Squared, at the scene's own size."""
        single = self._single * (self._at(settings, PRECISION) == "single")
        return self._rest + self._cut[self._at(settings, DEPTH)] + single

    def _scaled(self) -> Model:
        """The model at the scene's own size; of the latest that was measured with a sampler it says just that."""
        model, known = self.model, (*self.tried, self.fastest)
        laws, here = model.laws, self._bias(self.own)
        seconds = np.array([m.seconds.middle for m in known])
        rows = np.array([[1, model.seconds(m.settings)] for m in known]) / seconds[:, None]
        a, b = nonnegative(rows, np.ones(len(rows))).tolist()
        clean = Model(model.default, replace(laws, bias=0.0, ways=_biased(laws, lambda w: 0.0)))
        samplers, fixed = {}, a + b * laws.fixed
        for name, s in laws.samplers.items():
            # Of a sampler that was not measured yet, as of the latest.
            m = next((m for m in reversed(self.tried) if m.settings[SAMPLER] == name), self.tried[-1])
            guessed, took = a + b * model.seconds(m.settings), m.seconds.middle
            slower = (took - fixed) / (guessed - fixed) if took > fixed < guessed else took / guessed
            noise = clean.error(m.settings) ** 2
            c = m.noise / noise if m.noise and noise else 1.0
            samplers[name] = Sampler(Through(s.noise.x, c * s.noise.y), slower * s.time)
        c = samplers[self.own[SAMPLER]].noise.y[0] / (laws.samplers[self.own[SAMPLER]].noise.y[0] or 1.0)
        counts = tuple(replace(n, cost=b * n.cost, noise=replace(n.noise, u=c * n.noise.u)) for n in laws.counts)
        ways = _biased(laws, lambda w: self._bias(self.own | w.settings) - here)
        return Model(model.default, Laws(fixed, b * laws.base, here, samplers, counts, ways))

    def _changes(self, settings: Settings) -> Settings:
        return {a: v for a, v in settings.items() if v != self.own[a]}

    def _measured(self, settings: Settings) -> Measured:
        """Renders of two seeds, or more where they are short; Ctrl-C ends them."""
        chosen = changed(self.scene, self._changes(settings))
        _compiled(chosen)
        made, first = set_up(chosen), chosen.settings.seed
        pictures, times = [], []
        while len(times) < 2 or (len(times) < TURNS and sum(times) < ENOUGH):
            shot = replace(made, scene=adjusted(chosen, seed=(first + len(times)) % 2**32))
            begun = perf_counter()
            film, _ = expose(shot, self.progress, self.patience)
            times.append(perf_counter() - begun)
            if self.patience.asked:
                raise KeyboardInterrupt
            if len(pictures) < 2:
                pictures.append(np.array(film.mean))
                check_numbers(made, pictures[-1])
        # Of the mean of both the variance is half of each one's.
        pair = Estimate.of(*pictures)
        squares, bias = (2 * np.square([pair.error, pair.low, pair.high])).tolist(), self._bias(settings)
        return Measured(settings, band(times), Band(*(sqrt(s + bias) for s in squares)), squares[0])

    def _told(self, found: Measured) -> Tuned:
        """The outcome, with its reasons."""
        before, model = self.tried[0], self._scaled()
        guess = Choice(found.settings, model.seconds(found.settings), model.error(found.settings))
        guess = next((c for c in self.predicted if c.settings == found.settings), guess)
        changes = self._changes(found.settings)
        return Tuned(
            self.goal, found.settings, changes, guess.error, guess.seconds, found.error, found.seconds, before,
            self.goal.met(found), tuple(self._reasons(model, found)), changed(self.scene, changes), self.report,
        )  # fmt: skip

    def _reasons(self, model: Model, found: Measured) -> Iterator[str]:
        """Why the knobs are turned, a sentence each."""
        laws, new = model.laws, found.settings
        noise = model.error(self.own) ** 2 - self._bias(self.own)
        both = {a: new[a] for a in (SPP, SAMPLER)}
        if any(self.own[a] != both[a] for a in both) and not self.report.noiseless:
            turned = self.own | both
            less = (model.error(turned) ** 2 - self._bias(turned)) / noise if noise > 0 else 1.0
            time = model.seconds(turned) / model.seconds(self.own)
            told = [f"{s[SPP]} {s[SAMPLER]}" for s in (self.own, new)]
            yield f"samples {told[0]} -> {told[1]}: variance x {less:.2g}, time x {time:.2g}"
        for name, addresses in self._groups.items():
            old, now = ([s[a] for a in addresses] for s in (self.own, new))
            if old == now or (set(addresses) <= {SPP, SAMPLER} and not self.report.noiseless):
                continue
            count = next((c for c in laws.counts if c.addresses == addresses), None)
            turned = self.own | {a: new[a] for a in addresses}
            time = model.seconds(turned) / model.seconds(self.own)
            if count:
                cost = self.own[SPP] * count.cost * count.count(self.own) / model.seconds(self.own)
                part = min(count.part(self.own) / noise, 1.0) if noise > 0 else 0.0
                yield f"{name} {sum(old)} -> {sum(now)}: they are {cost:.0%} of the time and {part:.0%} of the variance"
            elif addresses == (SPP,) and self.report.noiseless:
                yield f"{name} {old[0]} -> {now[0]}: the picture has no noise, one sample does; time x {time:.2g}"
            else:
                left = f"{sqrt(self._bias(turned)):.2g} is left whatever the samples"
                yield f"{name} {old[0]} -> {now[0]}: {left}, time x {time:.2g}"
        if new == self.own:
            yield "the scene's own settings: none that were measured are clearly better"
        if self.report.noiseless and new[SPP] == self.own[SPP]:
            yield "the picture has no noise: one sample does"
        if not self.goal.met(found):
            yield "no settings were found that do it: these come nearest"


def _biased(laws: Laws, bias: Callable[[Way], float]) -> tuple[tuple[Way, ...], ...]:
    """The ways of the laws with another bias."""
    return tuple(tuple(replace(w, bias=bias(w)) for w in row) for row in laws.ways)


def _compiled(scene: Scene) -> None:
    """Makes the kernels of a render, by a small picture: first passes and further ones."""
    made = set_up(reduced(scene, SMALLEST))
    film = Film.blank(made.a, len(made.order))
    for done in range(2):
        film = exposed_once(made, film, made.scene.settings, done, 1)
