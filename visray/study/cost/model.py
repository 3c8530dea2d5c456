"""What any choice of knobs would cost and be off, from the curves of single knobs.

Seconds = fixed + spp (base + sum of c n) f: c of each counting knob (light samples, rays), by least squares; f of the
sampler, and of every other choice, as it was measured against the default.

Squared error = bias + noise. The noise of a sampler is D(spp), a power law from point to point; in it each counting
knob has a part u (n / n0)^-p, fitted to its curve, that falls as 1 / spp, because the samples of a pixel draw their
lots apart from each other; with Sobol points they do not, and it keeps its share. Where the parts would be more than D,
they are all of it. Other choices multiply the noise, and add to the bias, as they did on their own: what two of them do
together is not known, which is why what the model proposes has to be measured.
"""

from dataclasses import dataclass
from functools import cached_property, reduce
from math import inf
from typing import Any

import numpy as np

from visray.study.cost.fitting import SAMPLER, SPP, Laws, Sampler, Settings, Way, fitted, undominated
from visray.study.cost.laws import grid, lowest
from visray.study.cost.records import Curve, Point

MOST = 2000  # combinations of counts that are kept on the way; of more, some between are left out


@dataclass(frozen=True)
class Prediction:
    """Settings on the frontier that the model predicts, and what it predicts for them."""

    settings: Settings
    seconds: float
    error: float


@dataclass(frozen=True)
class Model:
    """A scene's default, and the laws that turning its knobs follows."""

    default: Point
    laws: Laws

    @staticmethod
    def of(default: Point, curves: tuple[Curve, ...]) -> "Model":
        """The model of a report's curves. A point differs from the default by its own knob alone; a knob of kind
        "sampling" other than spp is one that counts, from 1 on. Settings that no curve turns stay as they are."""
        return Model(default, fitted(default, curves))

    def seconds(self, settings: Settings) -> float:
        """Of a picture with these settings; those left out are the default's."""
        s = self.default.settings | settings
        factor = self.laws.samplers[s.get(SAMPLER)].time * self._way(s).time
        return float(self._seconds(s[SPP], factor, sum(c.cost * c.count(s) for c in self.laws.counts)))

    def error(self, settings: Settings) -> float:
        """The relative error of a picture with these settings; those left out are the default's."""
        s = self.default.settings | settings
        sampler = self.laws.samplers[s.get(SAMPLER)]
        return float(self._error(sampler, s[SPP], self._way(s), sum(c.part(s) for c in self.laws.counts)))

    def candidates(self) -> tuple[tuple[Settings, ...], ...]:
        """The values of each knob to choose from, sampler and spp as one knob: counts up to 4 times the measured, of
        all others what was measured."""
        samples = []
        for name, sampler in self.laws.samplers.items():
            named = {} if name is None else {SAMPLER: name}
            samples += [{**named, SPP: n} for n in grid(sampler.noise.x.tolist())]
        others = (tuple(w.settings for w in ways) for ways in self.laws.ways)
        return tuple(samples), *(c.values for c in self.laws.counts), *others

    def fastest(self, error: float) -> Settings | None:
        """The fastest of the candidates with no more than this error; None where there are none."""
        return next((c.settings for c in self.choices if c.error <= error), None)

    def best(self, seconds: float) -> Settings | None:
        """The candidate of least error that takes no more than these seconds; None where there are none."""
        return next((c.settings for c in reversed(self.choices) if c.seconds <= seconds), None)

    def ladder(self, n: int, longest: float = inf) -> tuple[Settings, ...]:
        """At most n settings along the predicted frontier, from the cheapest to the dearest of no more than `longest`
        seconds, as near to equal factors of seconds as it has them."""
        choices = [c for c in self.choices if c.seconds <= longest]
        if len(choices) <= n:
            return tuple(c.settings for c in choices)
        times = np.log([c.seconds for c in choices])
        at = {int(np.abs(times - t).argmin()) for t in np.linspace(times[0], times[-1], n)}
        return tuple(choices[i].settings for i in sorted(at))

    @cached_property
    def choices(self) -> tuple[Prediction, ...]:
        """The candidates of which no other is as fast and as accurate by the model, cheapest first."""
        costs, parts, picked = self._combined()
        ways, found = undominated(self.laws.ways), []
        for sample in self.candidates()[0]:
            sampler = self.laws.samplers[sample.get(SAMPLER)]
            for way in ways:
                t = self._seconds(sample[SPP], sampler.time * way.time, costs)
                e = self._error(sampler, sample[SPP], way, parts)
                found += [(t[i], e[i], sample | way.settings, picked[i]) for i in lowest(t, e)]
        kept = [found[i] for i in lowest(*(np.array([f[k] for f in found]) for k in (0, 1)))]
        return tuple(Prediction(self._settings(some, indices), float(t), float(e)) for t, e, some, indices in kept)

    def _settings(self, some: Settings, indices: np.ndarray) -> Settings:
        """All settings, with some of them, and of each count the value of this index."""
        counts = (c.values[i] for c, i in zip(self.laws.counts, indices))
        return reduce(dict.__or__, counts, self.default.settings | some)

    def _combined(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of the combinations of counts that no other beats: their cost, their part of the noise, and which value each
        count has. Shapes: (N), (N), (N, counts)."""
        cost, part, picked = np.zeros(1), np.zeros(1), np.zeros((1, 0), int)
        for c in self.laws.counts:
            more, noise = (np.array([f(v) for v in c.values]) for f in (c.count, c.part))
            cost, part = ((a[:, None] + b).ravel() for a, b in ((cost, c.cost * more), (part, noise)))
            old, new = (i.ravel() for i in np.indices((len(picked), len(more))))
            kept = lowest(cost, part)
            if len(kept) > MOST:
                kept = kept[np.linspace(0, len(kept) - 1, MOST).round().astype(int)]
            cost, part, picked = cost[kept], part[kept], np.column_stack([picked[old], new])[kept]
        return cost, part, picked

    def _seconds(self, spp: float, factor: float, costs: Any) -> Any:
        return self.laws.fixed + spp * factor * (self.laws.base + costs)

    def _error(self, sampler: Sampler, spp: float, way: Way, parts: Any) -> Any:
        noise, whole, own = sampler.noise.at(spp), sum(c.noise.u for c in self.laws.counts), self.default.settings
        # Where the scene's own points are Sobol's, the lots of a pixel's samples are one sequence: their part falls
        # with the rest.
        one = own.get(SAMPLER) == "sobol"
        falling = noise * whole / self._whole if one and self._whole > 0 else whole * own[SPP] / spp
        falling = min(falling, noise)
        noise = noise - falling + falling * (parts / whole if whole > 0 else np.ones_like(parts))
        return np.sqrt(max(self.laws.bias + way.bias, 0) + sampler.scale * way.noise * noise)

    @cached_property
    def _whole(self) -> float:
        """The noise of the scene as it is."""
        own = self.default.settings
        return float(self.laws.samplers[own.get(SAMPLER)].noise.at(own[SPP]))

    def _way(self, settings: Settings) -> Way:
        """The values of the other knobs together. Domain: of each what was measured, else a ValueError."""
        found = Way({})
        for ways in self.laws.ways:
            fits = [w for w in ways if all(settings[a] == v for a, v in w.settings.items())]
            if not fits:
                raise ValueError(f"{', '.join(ways[0].settings)}: this value was not measured")
            found |= fits[0]
        return found
