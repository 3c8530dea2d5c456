"""The date that data with a time show: the moment of each layer, and the text of the legend."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from visray.data import dates
from visray.data.moments import Moments
from visray.data.timeline import Timeline
from visray.quantities import Real


def _written(given: Any) -> Any:
    """A date of Python or NumPy as text; other values as they are."""
    if type(given).__name__ == "datetime64":
        return str(given)
    return given.isoformat() if hasattr(given, "isoformat") else given


# What is a moment before the end of a month, in days: more than the spacing of numbers of all dates.
MOMENT = 1e-4 / 86_400
# A date as text, or a number.
Date = Annotated[Real | Annotated[str, Field(strict=True, min_length=1)], BeforeValidator(_written)]


@dataclass(frozen=True)
class ShownDate:
    """The date that is shown.

    moments: number of the moment of each layer with a time, by the name of the layer
    finest: the moments of the layer with the finest dates, which says how the date is written; None without layers
    number: the date as a number of that layer; at the end of the last month, day and so on, a moment before
    flaw: what is wrong with the date; None if nothing is
    """

    moments: dict[str, float]
    finest: Moments | None = None
    number: float = 0.0
    flaw: str | None = None

    @staticmethod
    def of(timelines: Mapping[str, Timeline], date: float | str | None) -> "ShownDate":
        """The date of layers with a time. date: None: the first date of all layers; of layers with dates, and of those
        with plain numbers."""
        if not timelines:
            text = "no layer has a time; give a layer the field time, or leave date out"
            return ShownDate({}, flaw=None if date is None else text)
        firsts = {name: _limits(timelines, x)[0] for name, x in timelines.items()}
        finest = max((x.moments for x in timelines.values()), key=_fineness)
        start = next(firsts[name] for name, x in timelines.items() if x.moments is finest)
        if date is None:
            return ShownDate(firsts, finest, start)
        moments = {}
        try:
            for name, timeline in timelines.items():
                moments[name] = _number(timeline.moments, date, name)
        except ValueError as error:
            return ShownDate(firsts, finest, start, str(error))
        for name, timeline in timelines.items():
            if flaw := _outside(timelines, timeline, moments[name]):
                return ShownDate(firsts, finest, start, flaw)
        own = next(name for name, x in timelines.items() if x.moments is finest)
        return ShownDate(moments, finest, _before_end(timelines, timelines[own], moments[own]))

    def text(self, form: bool | str) -> str:
        """The date as the legend shows it. form: True, or a format such as "%B %Y". Domain: there is a layer; a format
        goes with dates."""
        return dates.written(self.number, form) if isinstance(form, str) else self.finest.text(self.number)

    def form_flaw(self, form: bool | str) -> str | None:
        """What is wrong with the form of the date in the legend; None if nothing is."""
        if not isinstance(form, str):
            return None
        if self.finest is not None and not self.finest.calendar:
            return "is a format of dates, and the times are numbers; write true or false"
        return dates.pattern_flaw(form)


def _fineness(moments: Moments) -> tuple:
    """How fine moments are; dates come before plain numbers."""
    if moments.calendar:
        return 1, dates.UNITS.index(moments.resolution)
    return 0, moments.resolution


def _limits(timelines: Mapping[str, Timeline], of: Timeline) -> tuple[float, float]:
    """The first and the last moment of all layers whose moments are dates, or plain numbers, as those of a layer."""
    found = [x.limits for x in _alike(timelines, of)]
    return min(first for first, _ in found), max(last for _, last in found)


def _alike(timelines: Mapping[str, Timeline], of: Timeline) -> list[Timeline]:
    """The layers whose moments are dates, or plain numbers, as those of a layer."""
    return [x for x in timelines.values() if x.moments.calendar == of.moments.calendar]


def _end(timelines: Mapping[str, Timeline], of: Timeline) -> float:
    """The last moment that may be shown: the end of the last month, day and so on; of plain numbers, the last one."""
    return max(x.moments.end(x.limits[1]) for x in _alike(timelines, of))


def _before_end(timelines: Mapping[str, Timeline], of: Timeline, moment: float) -> float:
    """A moment; the end of the last month, day and so on is a moment before, which is still a part of it."""
    is_end = moment > _limits(timelines, of)[1] and moment == _end(timelines, of)
    return moment - MOMENT if is_end else moment


def _number(moments: Moments, date: float | str, name: str) -> float:
    """The number of a date among the moments of a layer. Raises ValueError if it is none. name: of the layer"""
    if isinstance(date, str) and moments.calendar:
        return dates.parse(date)
    if isinstance(date, str):
        try:
            return float(date)
        except ValueError:
            raise ValueError(f"must be a number, as the times of data.layers.{name} are numbers") from None
    # A plain number, such as 2020, is a year.
    return dates.of_year(date) if moments.calendar else date


def _outside(timelines: Mapping[str, Timeline], timeline: Timeline, moment: float) -> str | None:
    """What is wrong with a moment before the first date or after the last one of all layers; None if nothing is. The
    last month, day and so on is part of the data with its end."""
    (first, last), end = _limits(timelines, timeline), _end(timelines, timeline)
    if first <= moment <= end:
        return None
    moments = max((x.moments for x in _alike(timelines, timeline)), key=_fineness)
    start, stop = moments.text(first), moments.text(last)
    at_most = stop if end == last else f"{moments.text(end)}, the end of {stop},"
    return f"is outside of the dates of the data, from {start} to {stop}; write {start} at least and {at_most} at most"
