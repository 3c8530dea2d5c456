"""A layer with a time on a base: what is true of all dates, and from it the rows of each date.

Reading, sorting and the domains of rules are done once; a date takes a few operations for each place.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from visray.data.base import Base
from visray.data.color_rule import ColorRule
from visray.data.layer import DataLayer
from visray.data.resolved_colors import ResolvedColors
from visray.data.rows import OUTSIDE
from visray.data.series import Series
from visray.data.shown_rows import ShownRows
from visray.data.size_rule import SizeRule
from visray.data.timeline import Timeline
from visray.quantities import FARTHEST


@dataclass(frozen=True, eq=False)
class AtDate:
    """The places of a layer at a date. Shapes: (N) each, one entry for each place that is shown at any date.

    values: numbers by property, in units of the data; where one is not known, the nearest known one
    hidden: whether a place is not shown at this date
    sizes: signed sizes, in world units
    slopes: derivatives of sizes and colours by the values, by property
    color: colours in linear light; None for that of the material. Shape: (N, 3)
    notes: sentences about the date
    """

    values: dict[str, np.ndarray]
    hidden: np.ndarray
    sizes: dict[str, np.ndarray]
    slopes: dict[str, np.ndarray]
    color: np.ndarray | None
    notes: list[str]


class TimedLayer:
    """A layer with a time on a base.

    shown: rules, sizes and notes of all rows of the source; or the flaws of the layer
    """

    def __init__(self, layer: DataLayer, base: Base):
        self.layer, self.base = layer, base
        self.shown = ShownRows(layer, base)
        self.flaws = tuple(self.shown.flaws)
        self.counts: dict[str, int] = {}
        self.notes: list[str] = list(self.shown.notes)
        if not self.flaws:
            self.place = self._places()
            self._note()

    @property
    def timeline(self) -> Timeline:
        """Which rows are one place. Domain: no flaws."""
        return self.shown.t.timeline

    @cached_property
    def series(self) -> dict[str, Series]:
        """The numbers of all places in time, by property."""
        return {key: self.timeline.series(x, key == "lon") for key, x in self.shown.t.values.items()}

    @cached_property
    def texts(self) -> tuple[str, ...] | None:
        """Names of the places that are shown; None without names."""
        texts = self.shown.t.texts()
        return None if texts is None else tuple(texts[self.timeline.first[self.place]].tolist())

    @cached_property
    def largest(self) -> dict[str, np.ndarray]:
        """The largest number of each place that is shown, without its sign, by property. Shape: (N)."""
        return {key: self.timeline.largest(x)[self.place] for key, x in self.shown.t.values.items()}

    @cached_property
    def sizes(self) -> dict[str, np.ndarray]:
        """The largest size of each place that is shown, without its sign, by property. Shape: (N)."""
        return {key: self.timeline.largest(x)[self.place] for key, x in self.shown.sizes.items()}

    def _places(self) -> np.ndarray:
        """Numbers of the places that are shown at any date; others are counted. Shape: (N)."""
        time, values = self.timeline, self.shown.t.values
        kept = np.ones(len(time), bool)

        def leave_out(dropped: np.ndarray, reason: str) -> None:
            nonlocal kept
            if (kept & dropped).any():
                self.counts[reason] = int((kept & dropped).sum())
                kept &= ~dropped

        leave_out(~(self.series["lon"].known & self.series["lat"].known), "without a position")
        inside = self.base.inside(values["lon"], values["lat"])
        leave_out(time.largest(inside) == 0, OUTSIDE)
        for key, sizes in self.shown.sizes.items():
            if key in values:
                leave_out(~self.series[key].known, f"without a {key}")
            leave_out(time.largest(sizes) < 1 / FARTHEST, f"of {key} 0")
        if outside := self.counts.get(OUTSIDE):
            many = "1 place is" if outside == 1 else f"{outside:,} places are"
            self.notes.append(f"{many} outside of the map at all dates, and not shown")
        return np.flatnonzero(kept)

    def _note(self) -> None:
        """Notes what is peculiar about the dates."""
        time, values = self.timeline, self.shown.t.values
        if time.unused:
            rows = ", ".join(f"{n:,} {reason}" for reason, n in time.unused.items())
            self.notes.append(f"rows that are not used: {rows}")
        first, last = time.limits
        if first == last:
            self.notes.append(f"all rows have one date, {time.moments.text(first)}, so nothing changes in time")
            return
        gaps = {key: n for key, x in values.items() if (n := time.gaps(x))}
        filled = "the last known number holds" if time.held else "the numbers there are interpolated"
        self.notes += [
            f"{key} has {n:,} {'gap' if n == 1 else 'gaps'} between known numbers; {filled}" for key, n in gaps.items()
        ]
        single = int((np.diff(time.start)[self.place] == 1).sum())
        if single and not time.held:
            have, are = ("1 place has", "is") if single == 1 else (f"{single:,} places have", "are")
            text = f"one date only, and {are} shown at that moment alone"
            self.notes.append(f'{have} {text}; to keep such places, write "between": "held"')

    def at(self, moment: float) -> AtDate:
        """The places at a moment. Domain: no flaws, from the first moment of the timeline on."""
        moment = min(moment, self.timeline.limits[1])
        found = {key: x.at(moment) for key, x in self.series.items()}
        values = {key: x[self.place] for key, (x, _) in found.items()}
        known = {key: now[self.place] for key, (_, now) in found.items()}
        needed = [key for key in known if key != "color"]
        reasons = {"without numbers": ~np.logical_and.reduce([known[key] for key in needed])}
        reasons[OUTSIDE] = ~self.base.inside(values["lon"], values["lat"])
        sizes, slopes = {}, {}
        for key, size in self.shown.sizes.items():
            rule = self.shown.rules.get(key)
            if isinstance(rule, SizeRule):
                of_rule = rule.sizes(values[key], rule.range)
                sizes[key], slopes[key] = of_rule.size, of_rule.slope
            else:
                sizes[key] = np.full(len(self.place), size[0])
            reasons[f"of {key} 0"] = np.abs(sizes[key]) < 1 / FARTHEST
        color, rule = None, self.shown.rules.get("color")
        if isinstance(rule, ResolvedColors):
            values["color"] = np.where(known["color"], values["color"], np.nan)
            colours = rule.colours(values["color"])
            color, slopes["color"] = colours.linear, colours.slope
        elif self.shown.color is not None:
            color = np.tile(self.shown.color[:1], (len(self.place), 1))
        hidden = np.logical_or.reduce(list(reasons.values()))
        return AtDate(values, hidden, sizes, slopes, color, self._date_notes(moment, reasons, hidden, known))

    def _date_notes(
        self, moment: float, reasons: dict[str, np.ndarray], hidden: np.ndarray, known: dict[str, np.ndarray]
    ) -> list[str]:
        """Sentences about the places that a date does not show, or not in colour.

        reasons: which places are not shown, by reason. known: which numbers are known, by property
        """
        text, notes, total = self.timeline.moments.text(moment), [], len(hidden)
        if hidden.any():
            why = ", ".join(f"{int(x.sum()):,} {reason}" for reason, x in reasons.items() if x.any())
            notes.append(f"of {total:,} places, not shown on {text}: {why}")
        if isinstance(self.shown.t.rules["color"], ColorRule) and (grey := int((~known["color"] & ~hidden).sum())):
            have = "has" if grey == 1 else "have"
            notes.append(f"{grey:,} of {total:,} places {have} the colour of missing values on {text}")
        return notes
