"""The laws of a scene's knobs, from the curve of each."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from itertools import product
from math import exp, log
from typing import Any

import numpy as np

from visray.study.cost.knobs import SAMPLER, SPP
from visray.study.cost.laws import PowerLaw, Through, grid, nonnegative
from visray.study.cost.records import Band, Curve, Point

Settings = dict[str, Any]


@dataclass(frozen=True)
class Count:
    """A knob that counts samples. addresses: what it turns, together; its count is their sum. noise: over the count;
    cost: seconds of one more, for each sample of all pixels. values: to choose from."""

    addresses: tuple[str, ...]
    noise: PowerLaw
    values: tuple[Settings, ...]
    cost: float = 0.0

    def count(self, settings: Settings) -> float:
        return sum(settings[a] for a in self.addresses)

    def part(self, settings: Settings) -> float:
        """What of the noise falls with the count."""
        return float(self.noise.part(self.count(settings)))


@dataclass(frozen=True)
class Way:
    """One value of any other knob, against the default: time and noise are so many times, the squared bias so much
    more."""

    settings: Settings
    time: float = 1.0
    noise: float = 1.0
    bias: float = 0.0

    def __or__(self, other: "Way") -> "Way":
        """Both at once."""
        together = self.settings | other.settings
        return Way(together, self.time * other.time, self.noise * other.noise, self.bias + other.bias)


@dataclass(frozen=True)
class Sampler:
    """A sampler's noise over spp, and its seconds against those of the default's. scale: of all noise that settings
    with it have, as renders at another size told."""

    noise: Through
    time: float = 1.0
    scale: float = 1.0


@dataclass(frozen=True)
class Laws:
    """fixed: seconds whatever the samples; base: of each sample of all pixels, without what counts add. bias: squared,
    of the default. ways: of each other knob, the default's value first."""

    fixed: float
    base: float
    bias: float
    samplers: dict[Any, Sampler]
    counts: tuple[Count, ...]
    ways: tuple[tuple[Way, ...], ...]


@dataclass(frozen=True)
class _Sorted:
    """Points by what their knob turns, with all their settings. A knob that turns no setting is left out."""

    sampled: list[tuple[Point, Settings]]
    counted: dict[tuple[str, ...], list[tuple[Point, Settings]]]
    others: dict[tuple[str, ...], list[tuple[Point, Settings]]]

    @staticmethod
    def of(default: Point, curves: Iterable[Curve]) -> "_Sorted":
        own, found = default.settings, _Sorted([(default, default.settings)], {}, {})
        for curve in curves:
            pairs = [(p, own | p.settings) for p in curve.points]
            turned = tuple(a for a in own if any(s[a] != own[a] for _, s in pairs))
            if not turned:
                continue
            pairs = [(p, s) for p, s in pairs if any(s[a] != own[a] for a in turned)]
            if set(turned) <= {SPP, SAMPLER}:
                found.sampled.extend(pairs)
            elif curve.kind == "sampling":
                found.counted[turned] = [(default, own), *pairs]
            else:
                found.others[turned] = pairs
        knobs = [a for turned in (*found.counted, *found.others) for a in turned]
        if len(knobs) != len(set(knobs)):
            raise ValueError(f"two curves turn the same setting, of {', '.join(sorted(knobs))}")
        return found


def fitted(default: Point, curves: Iterable[Curve]) -> Laws:
    """The laws that the curves follow. A point differs from the default by its own knob alone."""
    points = _Sorted.of(default, curves)
    counts = [_count(default, *item) for item in points.counted.items()]
    own = default.settings.get(SAMPLER)
    measured = [pair for pair in points.sampled if pair[1].get(SAMPLER) == own]
    measured += [pair for pairs in points.counted.values() for pair in pairs[1:]]
    # Seconds of all these by the same weights: relative ones.
    rows = np.array([[1, s[SPP], *(s[SPP] * c.count(s) for c in counts)] for _, s in measured], float)
    seconds = np.array([p.seconds.middle for p, _ in measured])
    fixed, base, *costs = nonnegative(rows / seconds[:, None], np.ones(len(seconds))).tolist()
    counts = [Count(c.addresses, c.noise, c.values, cost) for c, cost in zip(counts, costs)]
    each = base + sum(c.cost * c.count(default.settings) for c in counts)
    ways = tuple(_ways(default, turned, pairs, fixed) for turned, pairs in points.others.items())
    samplers = _samplers(default, points.sampled, fixed, each)
    return Laws(fixed, base, default.error.bias.middle**2, samplers, tuple(counts), ways)


def _count(default: Point, turned: tuple[str, ...], pairs: list[tuple[Point, Settings]]) -> Count:
    n = np.array([sum(s[a] for a in turned) for _, s in pairs], float)
    y = np.array([_noise(p.error.deviation) for p, _ in pairs])
    law = PowerLaw.of(n[y > 0], y[y > 0], float(n[0]))
    # Of each address, so many times the default's; a square, where all that were measured are, as strata want it.
    squares = {a: all(float(s[a] ** 0.5).is_integer() for _, s in pairs) for a in turned}
    values = [{a: s[a] for a in turned} for _, s in pairs]
    for v in grid(n.tolist()):
        wanted = {a: max(1, default.settings[a] * v / n[0]) for a in turned}
        values.append({a: round(w**0.5) ** 2 if squares[a] else round(w) for a, w in wanted.items()})
    return Count(turned, law, tuple({tuple(v.values()): v for v in values}.values()))


def _ways(
    default: Point, turned: tuple[str, ...], pairs: list[tuple[Point, Settings]], fixed: float
) -> tuple[Way, ...]:
    """Noise that cannot be told from the default's is taken as the same."""
    base, found = default.error, [Way({a: default.settings[a] for a in turned})]
    for p, settings in pairs:
        a, b = p.error.deviation, base.deviation
        apart = (a.low > b.high or a.high < b.low) and _noise(b) > 0
        found.append(
            Way(
                {address: settings[address] for address in turned},
                _against(p.seconds.middle, default.seconds.middle, fixed),
                _noise(a) / _noise(b) if apart else 1.0,
                p.error.bias.middle**2 - base.bias.middle**2,
            )
        )
    return tuple(found)


def _samplers(default: Point, sampled: list[tuple[Point, Settings]], fixed: float, each: float) -> dict[Any, Sampler]:
    own, found = default.settings.get(SAMPLER), {}
    for name in dict.fromkeys(s.get(SAMPLER) for _, s in sampled):
        pairs = [(p, s[SPP]) for p, s in sampled if s.get(SAMPLER) == name]
        law = Through.of([(n, _noise(p.error.deviation)) for p, n in pairs])
        ratios = [log(_against(p.seconds.middle, fixed + n * each, fixed)) for p, n in pairs]
        found[name] = Sampler(law, 1.0 if name == own else exp(float(np.mean(ratios))))
    return found


def undominated(knobs: Iterable[tuple[Way, ...]]) -> list[Way]:
    """The ways to combine one value of each knob, but for those that others beat in time, noise and bias alike."""
    every = [reduce(Way.__or__, combined, Way({})) for combined in product(*knobs)]
    figures = np.array([(w.time, w.noise, w.bias) for w in every])
    kept: list[int] = []
    # In this order none is beaten by a later one, and of equals the first stays.
    for i in np.lexsort(figures.T[::-1]):
        if not kept or not (figures[kept] <= figures[i]).all(1).any():
            kept.append(int(i))
    return [every[i] for i in kept]


def _against(seconds: float, other: float, fixed: float) -> float:
    """The ratio of what samples take."""
    parts = seconds - fixed, other - fixed
    return parts[0] / parts[1] if min(parts) > 0 else seconds / other


def _noise(band: Band) -> float:
    """Squared; where it cannot be told from 0, what it may be at most."""
    return (band.middle or band.high) ** 2
