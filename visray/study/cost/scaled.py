"""What turning knobs would cost at the scene's own size: the model of a study, corrected by a few renders.

The model knows a reduced picture (study.py). At the scene's own size a render takes a + b t seconds where the model
says t: b is for the pixels, which are more, and a for what each render does once. Noise is a mean over pixels, so their
number is nothing to it; but of more pixels fewer show edges. So its square is c times the model's: the square, because
those are what add up. Bias is the same at any size that shows the same things, but for what a depth leaves out, which
is in few pixels: that is measured again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from visray.adaptive.depth_bias import depth_biases
from visray.adaptive.dual_buffer import DualBuffer
from visray.adaptive.error_floor import DEEPEST
from visray.render import adjusted
from visray.scene.address import value
from visray.scene.scene import Scene
from visray.setup import prepare
from visray.study.cost.fitting import Laws, Sampler, Way
from visray.study.cost.knobs import DEPTH, KEPT, PRECISION, SAMPLER, SPP
from visray.study.cost.laws import nonnegative
from visray.study.cost.model import Model
from visray.study.cost.records import Band, Report
from visray.study.cost.tuned import Measured, Settings

# Samples per pixel that tell what a depth leaves out.
PILOT = 4


@dataclass(frozen=True)
class Scaled:
    """A scene, and what a study of its costs found on a reduced picture."""

    scene: Scene
    report: Report

    @cached_property
    def own(self) -> Settings:
        """The scene's own settings."""
        return self.report.default.settings

    @cached_property
    def model(self) -> Model:
        """Of the reduced picture."""
        curves = [c for c in self.report.curves if c.knob not in KEPT]
        if self.report.noiseless:
            # Samplers and counts differ in nothing but how fast the machine happened to be.
            curves = [c for c in curves if c.kind != "sampling" or c.knob == f"samples, {self.own[SAMPLER]}"]
        return Model.of(self.report.default, tuple(curves))

    @cached_property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """The addresses that are turned together, by the name of their knob."""
        laws, own, names = self.model.laws, self.own, {}
        for c in self.report.curves:
            names |= {a: c.knob for p in c.points for a in p.settings if p.settings[a] != own[a]}
        turned = [*(c.addresses for c in laws.counts), *(tuple(row[0].settings) for row in laws.ways)]
        return {"samples per pixel": (SPP,), "sampler": (SAMPLER,)} | {names[t[0]]: t for t in turned}

    def changes(self, settings: Settings) -> Settings:
        return {a: v for a, v in settings.items() if v != self.own[a]}

    def at(self, settings: Settings, address: str) -> Any:
        """The value there, also where the settings leave it out."""
        return settings[address] if address in settings else value(self.scene, address)

    def kept(self, model: Model, alone: bool = False) -> Model:
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

    def left(self, settings: Settings) -> Band:
        """What is off whatever the samples, relative and squared."""
        cut, single = self.cut[self.at(settings, DEPTH)], self._single * (self.at(settings, PRECISION) == "single")
        return Band(*(self._rest + single + x for x in (cut.middle, cut.low, cut.high)))

    def bias(self, settings: Settings) -> float:
        """As much of that as it may be: what must surely be met is chosen by it."""
        return self.left(settings).high

    @cached_property
    def cut(self) -> dict[int, Band]:
        """What each depth leaves out, relative and squared."""
        depths = tuple(p.value for c in self.report.curves if c.knob == "depth" for p in c.points)
        if not depths:
            return {self.scene.settings.depth: Band(0.0, 0.0, 0.0)}
        halves = DualBuffer(prepare(adjusted(self.scene, sampler="sobol")))
        halves.extend(np.full_like(halves.counts, PILOT))
        scale = (halves.estimate().luminance or 1.0) ** 2
        left = depth_biases(halves, depths, min(4 * max(depths) + 4, DEEPEST))
        return {t.depth: Band(*(max(x, 0.0) / scale for x in (t.square, t.low, t.high))) for t in left}

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

    def whole(self, tried: Sequence[Measured], fastest: Measured) -> Model:
        """The model at the scene's own size, by what was measured there, the latest last; of the latest with a sampler
        it says just that. fastest: far from all others, but only its seconds count."""
        model, known = self.model, (*tried, fastest)
        laws, here = model.laws, self.bias(self.own)
        seconds = np.array([m.seconds.middle for m in known])
        rows = np.array([[1, model.seconds(m.settings)] for m in known]) / seconds[:, None]
        a, b = nonnegative(rows, np.ones(len(rows))).tolist()
        clean = Model(model.default, replace(laws, bias=0.0, ways=_biased(laws, lambda w: 0.0)))
        samplers, fixed = {}, a + b * laws.fixed
        for name, s in laws.samplers.items():
            # Of a sampler that was not measured yet, as of the latest.
            m = next((m for m in reversed(tried) if m.settings[SAMPLER] == name), tried[-1])
            guessed, took = a + b * model.seconds(m.settings), m.seconds.middle
            slower = (took - fixed) / (guessed - fixed) if took > fixed < guessed else took / guessed
            noise = clean.error(m.settings) ** 2
            samplers[name] = Sampler(s.noise, slower * s.time, m.noise / noise if m.noise and noise else 1.0)
        counts = tuple(replace(n, cost=b * n.cost) for n in laws.counts)
        ways = _biased(laws, lambda w: self.bias(self.own | w.settings) - here)
        return Model(model.default, Laws(fixed, b * laws.base, here, samplers, counts, ways))


def _biased(laws: Laws, bias: Callable[[Way], float]) -> tuple[tuple[Way, ...], ...]:
    """The ways of the laws with another bias."""
    return tuple(tuple(replace(w, bias=bias(w)) for w in row) for row in laws.ways)
