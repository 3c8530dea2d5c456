"""Comparison of measured choices: the frontier, and the time that an error takes with each setting.

In all functions `default` is the record of the scene as it is.
"""

from collections.abc import Iterable
from math import inf, isfinite, log
from typing import Any

import numpy as np

from visray.adaptive.dual_buffer import QUANTILE
from visray.study.cost.choices import KEPT, SAMPLER, SPP, is_samples
from visray.study.cost.records import Band, Curve, Price, Record, Settings

HALF = 0.5
DRAWS, SEED = 1000, 1  # random draws from the bands of the records, which give the bands of prices
FURTHEST = log(10)  # how far a slope is carried on beyond the last point, in logarithms of seconds
GAIN = 0.9  # a smaller saving of time is not worth a change


def frontier(records: Iterable[Record]) -> tuple[Record, ...]:
    """The records of which no other is as fast and as accurate, in the order of seconds. Of equal ones the first by
    setting and value stays; a record with a number that is not finite is left out."""
    front: list[Record] = []
    for p in sorted(records, key=lambda p: (p.seconds.middle, p.error.rmse.middle, p.setting, str(p.value))):
        finite = isfinite(p.seconds.middle) and isfinite(p.error.rmse.middle)
        if finite and (not front or p.error.rmse.middle < front[-1].error.rmse.middle):
            front.append(p)
    return tuple(front)


def price(curve: Curve, default: Record, share: float) -> Price:
    """The time in which a curve comes down to a share of the scene's error.

    Between two points error and seconds follow a power law. Beyond the last point, samples per pixel follow the
    measured slope for up to ten times the seconds; nothing else is carried on, because other rays and samples do not
    remove all noise. The band comes from 1000 draws of the bands of points and slope.
    """
    points = curve.points
    if points[-1].seconds.middle < points[0].seconds.middle:
        points = points[::-1]  # a smaller tolerance takes more time
    n, same = len(points), next((i for i, p in enumerate(points) if p.same_choice(default)), len(curve.points))
    records = points if same < n else (*points, default)
    normal = np.random.default_rng(SEED).standard_normal((DRAWS + 1, 2, len(records)))
    normal[0] = 0  # the first draw is the estimate itself
    time = _logs([p.seconds for p in records], normal[:, 0])
    error = _logs([p.error.rmse for p in records], normal[:, 1])
    k = np.full(DRAWS + 1, inf)
    if is_samples(curve.setting) and curve.by_time is not None and curve.by_time.low > 0:
        half = (curve.by_time.high - curve.by_time.low) / 2 / QUANTILE
        k = np.maximum(curve.by_time.k + half * normal[:, 0, -1], curve.by_time.low / 2)
    reached = [_reached(t[:n], e[:n], e[same] + log(share), x) for t, e, x in zip(time, error, k)]
    factors = np.exp([seconds - t[same] for (_, seconds), t in zip(reached, time)])
    low, high = np.quantile(factors[1:], [0.025, 0.975], method="inverted_cdf")
    factor, place = float(factors[0]), reached[0][0]
    base = default.error.rmse.middle
    return Price(
        setting=curve.setting,
        share=share,
        factor=Band(factor, min(factor, float(low)), max(factor, float(high))),
        least=min(p.error.rmse.middle for p in points) / base,
        value=_value(points, place, curve, share * base),
        beyond=bool(n - 1 < place < inf),
    )


def halvings(curves: Iterable[Curve], default: Record) -> tuple[Price, ...]:
    """The price of half of the scene's error by each setting of the kind sampling or bias, cheapest first."""
    asked = [c for c in curves if c.kind in ("sampling", "bias") and c.points and default.error.rmse.middle > 0]
    prices = [price(c, default, HALF) for c in asked]
    return tuple(sorted(prices, key=lambda p: (p.factor.middle, p.least, p.setting)))


def savings(curves: Iterable[Curve], default: Record) -> tuple[Price, ...]:
    """The measured choices that are surely faster or surely more accurate than the scene as it is, and not worse in the
    other respect; the best one by time times squared error first. Their `share` is their own error, as a share of the
    scene's."""
    prices, own = [], default.error.rmse
    for p in (p for c in curves if c.setting not in KEPT and own.middle > 0 for p in c.points):
        factor, share, error = _ratio(p.seconds, default.seconds), p.error.rmse.middle / own.middle, p.error.rmse
        better = error.high < own.low and share <= GAIN
        if (_surely_faster(factor) and error.middle <= own.high) or (
            better and p.seconds.middle <= default.seconds.high
        ):
            prices.append(Price(p.setting, share, factor, share, p.value))
    return tuple(sorted(prices, key=lambda p: (p.factor.middle * p.share**2, p.factor.middle, p.setting)))


def together(curves: Iterable[Curve], default: Record) -> Settings:
    """The best measured values of all settings but samples per pixel, where they are better beyond the noise.

    A sampler is better where it takes less time for the scene's error. A number of samples or rays is better where it
    takes less time for the same noise: samples per pixel make up for the change of noise, and how many of them are
    needed follows from the slope of the scene's own sampler. Other values are better where they
    are faster and the error cannot be told from the scene's.
    """
    curves = [c for c in curves if c.points and c.setting not in KEPT]
    own = own_samples(curves, default)
    power = float(np.clip(own.by_count.k if own and own.by_count else 0.5, 0.5, 1.0))
    best: Settings = {}
    samplers = [price(c, default, 1.0) for c in curves if is_samples(c.setting) and default.error.rmse.middle > 0]
    samplers = [p for p in samplers if _surely_faster(p.factor)]
    if samplers:
        best[SAMPLER] = min(samplers, key=lambda p: p.factor.middle).setting.removeprefix("samples, ")
    for c in curves:
        if is_samples(c.setting):
            continue
        ratios = [(_efficiency(p, default, c.kind, power), p) for p in c.points if not p.same_choice(default)]
        sure = [(r.middle, i) for i, (r, _) in enumerate(ratios) if _surely_faster(r)]
        if sure:
            chosen = ratios[min(sure)[1]][1].settings
            best |= {a: v for a, v in chosen.items() if v != default.settings[a] and a not in (SPP, SAMPLER)}
    return {a: v for a, v in best.items() if v != default.settings.get(a)}


def own_samples(curves: Iterable[Curve], default: Record) -> Curve | None:
    """The curve of samples per pixel with the scene's own sampler; None if it was not measured."""
    return next((c for c in curves if c.setting == f"samples, {default.settings.get(SAMPLER)}"), None)


def _surely_faster(factor: Band) -> bool:
    """Whether a multiple of the scene's time is below 1 beyond the noise, by enough to be worth a change."""
    return factor.high < 1 and factor.middle <= GAIN


def _efficiency(p: Record, default: Record, kind: str, power: float) -> Band:
    """Time for the scene's own error, as a multiple of the scene's time; inf where that cannot be said.

    kind: as in Curve
    power: k of noise ~ (samples per pixel)^-k
    """
    seconds = _ratio(p.seconds, default.seconds)
    if kind != "sampling":
        return seconds if p.error.rmse.middle <= default.error.rmse.high else Band(inf, inf, inf)
    noise = _ratio(p.error.deviation, default.error.deviation)
    # Samples that divide the noise by x take x^(1 / power) times the time.
    middle = seconds.middle * noise.middle ** (1 / power)
    if not 0 < middle < inf or not isfinite(noise.high):
        return Band(inf, inf, inf)
    half = float(np.hypot(log(seconds.high / seconds.middle), log(noise.high / noise.middle) / power))
    return Band(middle, middle * float(np.exp(-half)), middle * float(np.exp(half)))


def _reached(time: np.ndarray, error: np.ndarray, target: float, k: float) -> tuple[float, float]:
    """The place along the points where the error first comes down to the target, and the log of seconds there; inf
    where it does not. The place counts points: 1.25 is a quarter of the way from the second to the third. k: the slope
    beyond the last point. All in logarithms."""
    below = np.flatnonzero(error <= target)
    if len(below):
        i = int(below[0])
        if i == 0:
            return 0.0, float(time[0])
        # An error of 0 is on no line: it is reached at its point.
        part = (error[i - 1] - target) / (error[i - 1] - error[i]) if isfinite(error[i]) else 1.0
        return i - 1 + part, float(time[i - 1] + part * (time[i] - time[i - 1]))
    more = (error[-1] - target) / k
    if not isfinite(k) or more > FURTHEST:
        return inf, inf
    return len(time) - 1 + more, float(time[-1] + more)


def _value(points: tuple[Record, ...], place: float, curve: Curve, error: float) -> Any:
    """The value of a setting at a place among its points, None at inf; a whole number is rounded up."""
    if not isfinite(place):
        return None
    last, i = points[-1], int(place)
    if place <= len(points) - 1:
        a, b = points[i].value, points[min(i + 1, len(points) - 1)].value
        if place == i or not (is_number(a) and is_number(b)):
            return a if place == i else b
        between = a * (b / a) ** (place - i) if min(a, b) > 0 else a + (b - a) * (place - i)
    else:
        k = curve.by_count.k if curve.by_count else 0.5
        a = b = last.value
        between = last.value * (last.error.rmse.middle / error) ** (1 / k)
    # A power makes 16 to 16.000000000000004.
    return int(np.ceil(round(between, 6))) if isinstance(a, int) and isinstance(b, int) else float(between)


def is_number(x: Any) -> bool:
    """Whether x is a finite number. True and False do not count as numbers."""
    return isinstance(x, int | float | np.number) and not isinstance(x, bool) and isfinite(x)


def _logs(bands: list[Band], normal: np.ndarray) -> np.ndarray:
    """Logarithms of the middles, moved by so many standard deviations of their bands; -inf for 0."""
    middle, low, high = (np.array([getattr(b, end) for b in bands]) for end in ("middle", "low", "high"))
    with np.errstate(divide="ignore", invalid="ignore"):
        # A band that reaches 0 has no logarithm there; its upper half gives the width.
        half = np.where(low > 0, np.log(high / low) / 2, np.log(high / middle)) / QUANTILE
        return np.log(middle) + np.where(middle > 0, half, 0.0) * normal


def _ratio(a: Band, b: Band) -> Band:
    """The ratio of two independent numbers; high is inf where b may be 0."""
    if b.middle <= 0 or a.middle <= 0 or min(a.low, b.low) <= 0:
        return Band(a.middle / b.middle if b.middle > 0 else inf, 0.0, inf)
    middle = a.middle / b.middle
    half = float(np.hypot(*(np.log(x.high / x.low) / 2 for x in (a, b))))
    return Band(middle, middle * float(np.exp(-half)), middle * float(np.exp(half)))
