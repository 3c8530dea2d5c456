"""How far a scene as it is stands from the frontier of what was measured, as one sentence for every report of it."""

from collections.abc import Iterable

from visray.study.cost.frontier import frontier, overtaken
from visray.study.cost.records import Point
from visray.study.cost.wording import changes, number, written


def standing(points: Iterable[Point], default: Point) -> str:
    """The sentence, without a capital or a full stop. points: all that were measured, the default among them or not."""
    every = [default, *points]
    line, error = frontier(every), default.error.rmse
    better = [p for p in line if p.error.rmse.middle <= error.middle and p.seconds.middle < default.seconds.middle]
    if not line:
        return "there is no frontier yet: too little was measured"
    if better:
        # On a frontier the fastest comes first.
        p = better[0]
        share = number(p.seconds.middle / default.seconds.middle, 2)
        text = f"the same error could be had in {share} of the time by {_named(p, default)}"
        unsure = p.seconds.high >= default.seconds.low or p.error.rmse.high > error.high
        return text + ("; the bands of the two overlap: it may be chance" if unsure else "")
    text = "nothing that was measured is both faster and more accurate than the scene as it is"
    beside = overtaken(every, default)
    if beside is None or round(beside[0], 2) >= 1:
        return f"{text}: it is on the frontier"
    share, *ends = beside
    names = " and ".join(f"({_named(p, default)})" for p in ends)
    text += f"; but interpolating between the two points beside it on the frontier, {names}, its error would take"
    return f"{text} {number(share, 2)} of its time"


def _named(p: Point, default: Point) -> str:
    """What a point has that the default has not; where that is no setting, its knob and the value of it."""
    told = (f"{a.removeprefix('settings.')} {written(v)}" for a, v in changes(p, default).items())
    return ", ".join(told) or f"{p.knob} {written(p.value)}"
