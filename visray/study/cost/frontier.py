"""What is worth its time: the points that no other beats, and what half of the error costs by one knob alone."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, isfinite, log
from typing import Any

import numpy as np

from visray.adaptive.dual_buffer import QUANTILE
from visray.study.cost.records import Band, Curve, Halving, Point
from visray.study.cost.wording import sampler

SHARE = 0.5  # of the default's error
NEAR = 0.25  # of the last step between points: so far a law goes on in any case
FURTHEST = log(10)  # of a knob's value, beyond the last point: further than a decade no line is believed
STEADY = 0.75  # of the steepness before: what falls less is levelling off
DRAWS, SEED = 2000, 1


@dataclass(frozen=True)
class Step:
    """A choice against the default's: the ratios of the error and of the seconds. changes: whether the two errors can
    be told apart."""

    knob: str
    value: Any
    error: Band
    seconds: Band
    changes: bool


def frontier(points: Iterable[Point]) -> tuple[Point, ...]:
    """The points of which no other is as fast and as accurate, in the order of seconds. Of equals the first by knob and
    value is kept; points with a number that is not finite are left out."""
    found: list[Point] = []
    for p in sorted(points, key=lambda p: (p.seconds.middle, p.error.rmse.middle, p.knob, str(p.value))):
        known = isfinite(p.seconds.middle) and isfinite(p.error.rmse.middle)
        if known and (not found or p.error.rmse.middle < found[-1].error.rmse.middle):
            found.append(p)
    return tuple(found)


def overtaken(points: Iterable[Point], default: Point) -> tuple[float, Point, Point] | None:
    """The share of the default's seconds in which the others have its error, on the line of logarithms between the two
    points of their frontier that are next to it, and these two; None where there are no such two."""
    line = frontier(p for p in points if not p.same_choice(default))
    error = default.error.rmse.middle
    for a, b in pairwise(line):
        high, low = a.error.rmse.middle, b.error.rmse.middle
        if high >= error > low > 0:
            part = log(high / error) / log(high / low)
            seconds = a.seconds.middle * (b.seconds.middle / a.seconds.middle) ** part
            return seconds / default.seconds.middle, a, b
    return None


def halvings(curves: Iterable[Curve], default: Point) -> tuple[Halving, ...]:
    """What half of the default's error costs by each knob of kind "sampling" or "bias", cheapest first.

    Error and seconds are taken as a power law from point to point. Beyond the last one the law of the last two goes on
    for a decade of the knob's value, if their error surely falls, and about as steeply as before them, and else for a
    quarter of their step; of light samples and rays, which do not take away all noise, only down to what is left.
    Bands: of 2000 draws from the bands of the points.
    """
    asked = [c for c in curves if c.kind in ("sampling", "bias") and c.points]
    return ranked([_halving(c, default) for c in asked if default.error.rmse.middle > 0])


def steps(curves: Iterable[Curve], default: Point) -> tuple[Step, ...]:
    """What each choice of the knobs of kind "step" does, in the order of the curves and their points."""
    found = []
    for curve in curves:
        for p in curve.points if curve.kind == "step" else ():
            if not p.same_choice(default):
                error, base = p.error.rmse, default.error.rmse
                apart = error.low > base.high or error.high < base.low
                found.append(Step(curve.knob, p.value, _ratio(error, base), _ratio(p.seconds, default.seconds), apart))
    return tuple(found)


def ranked(found: Iterable[Halving]) -> tuple[Halving, ...]:
    """In the order of factor, with ranks: one ends before the knob whose low end is above the high end of the rank's
    first. Knobs of a rank are in the order of the alphabet, so that noise in what cannot be told apart moves none; but
    those that get there come first."""
    groups: list[list[Halving]] = []
    for h in sorted(found, key=lambda h: (h.factor.middle, h.factor.high, h.knob)):
        if not groups or h.factor.low > groups[-1][0].factor.high or _cannot(h) > _cannot(groups[-1][0]):
            groups.append([])
        groups[-1].append(h)
    return tuple(
        replace(h, rank=rank)
        for rank, group in enumerate(groups, 1)
        for h in sorted(group, key=lambda h: (not isfinite(h.factor.middle), h.knob))
    )


def _cannot(h: Halving) -> bool:
    """Whether the knob alone surely does not get there, as far as was measured."""
    return not isfinite(h.factor.low)


def _halving(curve: Curve, default: Point) -> Halving:
    points, base = curve.points, default.error.rmse.middle
    if points[-1].seconds.middle < points[0].seconds.middle:
        points = points[::-1]  # of a tolerance less is more: from the cheap end in any case
    time, error = _logs([p.seconds for p in points], 0), _logs([p.error.rmse for p in points], 0)
    t0, e0 = (float(_logs([b], 0)[0]) for b in (default.seconds, default.error.rmse))
    further, ratio = _further(points), _ratio_of_counts(curve, points)
    place, seconds = _reached(time, error, e0 + log(SHARE), further, ratio)
    found = _drawn(points, default, further, ratio)
    # One of the draws itself, as nothing is between a finite one and inf.
    low, high = np.quantile(found, [0.025, 0.975], method="inverted_cdf")
    factor = float(np.exp(seconds - t0))
    return Halving(
        knob=curve.knob,
        factor=Band(factor, min(factor, float(low)), max(factor, float(high))),
        least=min(p.error.rmse.middle for p in points) / base,
        value=_value(points, place),
        rank=0,
        beyond=len(points) - 1 < place < inf,
    )


def _drawn(points: tuple[Point, ...], default: Point, further: float, ratio: float) -> np.ndarray:
    """Factors for points and default drawn from their bands; where one of the points is the default, both are one."""
    rng = np.random.default_rng(SEED)
    same = next((i for i, p in enumerate(points) if p.same_choice(default)), len(points))
    every = (*points, default)[: len(points) + (same == len(points))]
    n, shape = len(points), (DRAWS, len(every))
    times = _logs([p.seconds for p in every], rng.standard_normal(shape))
    errors = _logs([p.error.rmse for p in every], rng.standard_normal(shape))
    found = [_reached(t[:n], e[:n], e[same] + log(SHARE), further, ratio)[1] - t[same] for t, e in zip(times, errors)]
    return np.exp(found)


def _further(points: tuple[Point, ...]) -> float:
    """How many steps the law of the last two points may go on beyond them: for a decade of the knob's value where their
    error surely falls, and over the value no less than STEADY times as steeply as before them; else NEAR. Not at all
    where it ends at 0, as tolerances do. By errors and values alone: seconds differ from study to study, and would move
    a knob from what is reached to what is not."""
    values = [p.value for p in points[-3:]]
    if _is_number(values[-1]) and values[-1] <= 0:
        return 0.0
    if len(points) < 2 or not all(_is_number(v) and v > 0 for v in values):
        return NEAR
    last, *before = ((a, b, abs(log(b.value / a.value))) for a, b in reversed(list(pairwise(points[-3:]))))

    def steepness(a: Point, b: Point, gone: float) -> float:
        return float(_logs([a.error.rmse], 0)[0] - _logs([b.error.rmse], 0)[0]) / gone

    surely = 0 < last[1].error.rmse.high < last[0].error.rmse.low
    steady = not before or steepness(*last) >= STEADY * steepness(*before[0])
    return max(FURTHEST / last[2], NEAR) if surely and steady else NEAR


def _ratio_of_counts(curve: Curve, points: tuple[Point, ...]) -> float:
    """How many times as many light samples or rays the last point has as the one before; inf for other knobs, of
    samples of pixels too, of which all noise falls, and for one point."""
    counts = curve.kind == "sampling" and not sampler(curve.knob) and len(points) > 1
    return points[-1].value / points[-2].value if counts else inf


def _reached(
    time: np.ndarray, error: np.ndarray, target: float, further: float, ratio: float = inf
) -> tuple[float, float]:
    """Where along the points the error first comes down to the target, and the log of seconds there; inf if nowhere,
    up to so many steps further than the last.

    The place is a number of points, 1.25 a quarter of the way from the second to the third. All in logarithms, but for
    `ratio`: of the last two numbers of samples, if it is finite. Then the square of the error falls no faster than
    a + b / number does through the last two points, where it did not do so between them either: a is what these samples
    do not take away.
    """
    if error[0] <= target:
        return 0.0, float(time[0])
    below = np.flatnonzero(error <= target)
    if len(below):
        i = int(below[0])
        # An error of 0 is on no line: it is reached at its point.
        part = (error[i - 1] - target) / (error[i - 1] - error[i]) if isfinite(error[i]) else 1.0
        return i - 1 + part, float(time[i - 1] + part * (time[i] - time[i - 1]))
    if len(error) < 2 or error[-1] >= error[-2] or time[-1] <= time[-2]:
        return inf, inf
    part = (error[-1] - target) / (error[-2] - error[-1])
    if isfinite(ratio):
        before, last, asked = np.exp(2 * (np.array([error[-2], error[-1], target]) - error[-2]))
        b = (before - last) / (1 - 1 / ratio)
        rest = asked - (before - b)
        part = max(part, log(b / rest) / log(ratio) - 1) if rest > 0 else inf
    seconds = float(part * (time[-1] - time[-2]))
    return (len(time) - 1 + part, time[-1] + seconds) if part <= further else (inf, inf)


def _value(points: tuple[Point, ...], place: float) -> Any:
    """The value of a knob at a place among its points, None at inf; a whole number is rounded up."""
    if not isfinite(place):
        return None
    values = [p.value for p in points]
    if place == int(place) < len(values):
        return values[int(place)]
    i = min(int(place), len(values) - 2)
    a, b = values[i], values[i + 1]
    if not (_is_number(a) and _is_number(b)):
        return b
    part = place - i
    between = a * (b / a) ** part if min(a, b) > 0 else a + (b - a) * part
    # The 16 that a power makes 16.000000000000004 is still 16.
    return int(np.ceil(round(between, 6))) if isinstance(a, int) and isinstance(b, int) else float(between)


def _is_number(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool)


def _logs(bands: list[Band], normal: Any) -> np.ndarray:
    """Logarithms of the middles, moved by so many standard deviations of their bands; -inf for 0."""
    middle, low, high = (np.array([getattr(b, end) for b in bands]) for end in ("middle", "low", "high"))
    with np.errstate(divide="ignore", invalid="ignore"):
        # A band that goes down to 0 has no logarithm there; its upper half says how wide it is.
        half = np.where(low > 0, np.log(high / low) / 2, np.log(high / middle)) / QUANTILE
        return np.log(middle) + np.where(middle > 0, half, 0.0) * normal


def _ratio(a: Band, b: Band) -> Band:
    """Of two independent numbers; high is inf, where b may be 0; 0 of 0 counts as 1."""
    if b.middle <= 0 or a.middle <= 0:
        middle = a.middle / b.middle if b.middle else inf if a.middle else 1.0
        return Band(middle, a.low / b.high if b.high else 0.0, inf)
    middle = a.middle / b.middle
    half = QUANTILE * float(np.hypot(*(np.log(x.high / x.low) / 2 / QUANTILE if x.low > 0 else inf for x in (a, b))))
    return Band(middle, middle * float(np.exp(-half)), middle * float(np.exp(half)))
