"""Which rows of a layer are shown on a base, and their sizes and colours."""

from dataclasses import replace
from typing import Any

import numpy as np

from visray import memory
from visray.data.base import Base, GlobeBase
from visray.data.color_rule import ColorRule
from visray.data.gizmos import GIZMOS
from visray.data.layer import DataLayer
from visray.data.layer_table import LayerTable
from visray.data.outlines import Segments
from visray.data.rows import COLORLESS, OUTSIDE
from visray.data.size_rule import SizeRule
from visray.output.curves import linear
from visray.quantities import FARTHEST

# Bytes of memory for each row while a picture is made. Measured with 1,000,000 rows: 1,330 for spheres, 1,410 for
# cones, 1,520 for boxes, 1,620 for cylinders with names, three columns and double precision.
BYTES_PER_ROW = 1600
# Sizes of gizmos that a layer does not give, as shares of the size of the base: ranges of rules, and constants.
RANGES = {"height": (0.0, 0.2), "radius": (0.0, 0.025)}
# The first size of a logarithmic scale, as a share of the last one.
LOG_LEAST = 0.1
CONSTANTS = {"height": 0.05, "radius": 0.005}
LINE_RADIUS = 0.0025
# What is said if most rows are outside of a map, and most would be on it with other names of columns or edges.
SWAPPED = "longitude and latitude seem to be swapped, in the data or in extent, which is west, east, south, north"


class ShownRows:
    """The rows of a layer that are shown on a base, with their sizes and colours; or the flaws of the layer.

    Of a layer with a time, all rows that have a date and a place count, and the domains of rules are those of all
    dates. Which gizmos are shown depends on the date (timed_layer.py).

    t: the numbers of its rows
    kept: mask of the rows that are shown so far
    segments: segments of all lines, if gizmos are lines
    sizes: signed sizes of all rows by property, in world units; NaN for rows that are not shown
    slopes: derivatives of sizes and colours by the values, by property
    color: colours of the rows that are shown, in linear light; None for that of the material. Shape: (N, 3)
    rules: rules with the domain and range that the data give them, by property
    fitted: properties whose rules have their domain from the data
    counts: numbers of other rows, by reason
    flaws, notes: errors (field, message), and sentences. With flaws, the rest is of no use
    """

    def __init__(self, layer: DataLayer, base: Base):
        self.layer, self.base, self.gizmo = layer, base, GIZMOS[layer.gizmo]
        self.t = LayerTable.of(layer)
        self.flaws, self.notes = list(self.t.flaws), []
        self.counts: dict[str, int] = {}
        self.sizes: dict[str, np.ndarray] = {}
        self.slopes: dict[str, np.ndarray] = {}
        self.rules: dict[str, Any] = {}
        self.fitted: set[str] = set()
        self.color: np.ndarray | None = None
        self.kept = np.ones(0 if self.flaws else len(self.t), bool)
        self.timed = self.t.timeline is not None
        for step in (self._check_memory, self._drop, self._size_all, self._color_all):
            if not self.flaws:
                step()

    def _check_memory(self) -> None:
        """Finds more rows than fit into memory."""
        count = len(self.t.timeline) if self.timed else len(self.t)
        needed, free = count * BYTES_PER_ROW, memory.free()
        if free is not None and needed > free.size:
            text = f"has {count:,} rows, which need about {needed / 2**30:.1f} GiB, {free}; take fewer rows"
            self.flaws.append(("source", text))

    def _leave_out(self, dropped: np.ndarray, reason: str) -> None:
        """Leaves out rows, and counts them. dropped: mask of the rows"""
        dropped = dropped & self.kept
        if dropped.any():
            self.counts[reason] = int(dropped.sum())
            self.kept &= ~dropped

    def _drop(self) -> None:
        """Leaves out all rows that cannot be shown."""
        if self.timed:
            self.kept = self.t.timeline.used
            return
        self._drop_missing()
        if self.t.is_lines:
            self._drop_lines()
        else:
            self._drop_outside()

    def _drop_missing(self) -> None:
        """Leaves out rows without a position or a size. A row without a colour has that of missing values."""
        values = self.t.values
        if not self.t.is_lines:
            self._leave_out(np.isnan(values["lon"]) | np.isnan(values["lat"]), "without a position")
        for key in ("height", "radius"):
            if key in values:
                self._leave_out(np.isnan(values[key]), f"without a {key}")

    def _drop_outside(self) -> None:
        """Leaves out rows that do not lie on the base."""
        lon, lat = self.t.values["lon"], self.t.values["lat"]
        inside = self.base.inside(lon, lat)
        outside = self.kept & ~inside
        if outside.any():
            shown, turned = (int(x[self.kept].sum()) for x in (inside, self.base.inside(lat, lon)))
            more = f"; {SWAPPED}" if 2 * shown < int(self.kept.sum()) < 2 * turned else ""
            rows = self.t.rows_text(outside, lon, lat)
            one = outside.sum() == 1
            many, are = ("1 row lies", "is") if one else (f"{int(outside.sum()):,} rows lie", "are")
            self.notes.append(f"{many} outside of the map and {are} not shown: {rows}{more}")
            self._leave_out(outside, OUTSIDE)

    def _drop_lines(self) -> None:
        """Finds the segments of lines, and leaves out rows that have no lines, and those that have none on the base."""
        self._leave_out(~self._mask(np.array([row for row, _ in self.t.table.lines], int)), "without a line")
        self.segments = Segments.of(self.t.table.lines, self.base, self.layer.lift or 0.0)
        self.counts |= self.segments.counts
        self.kept &= self._mask(self.segments.row)

    def _mask(self, rows: np.ndarray) -> np.ndarray:
        """Mask of some rows. rows: their numbers"""
        mask = np.zeros(len(self.t), bool)
        mask[rows] = True
        return mask

    def _size_all(self) -> None:
        """Computes heights and radii, signed, for all rows; those that are not shown have NaN."""
        for key in self.gizmo.sizes:
            rule = self.t.rules[key]
            share = (LINE_RADIUS if self.t.is_lines else CONSTANTS[key]) * self.base.size
            if isinstance(rule, SizeRule):
                self._size(key, rule)
            else:
                self.sizes[key] = np.full(len(self.t), share if rule is None else rule, float)
        if self.flaws:
            return
        upright = "height" in self.gizmo.sizes
        if (upright or self.t.is_lines) and (self.sizes["radius"][self.kept] < 0).any():
            wrong = self.kept & (self.sizes["radius"] < 0)
            text = f"must not be negative: {self.t.rows_text(wrong, self.t.values['radius'])}"
            self.flaws.append(("radius", f"{text}; take another column, or leave these cells empty"))
        for key, size in self.sizes.items() if not self.timed else ():
            with np.errstate(invalid="ignore"):
                self._leave_out(np.abs(size) < 1 / FARTHEST, f"of {key} 0")
        self._note_hanging("height" if upright else "radius")

    def _note_hanging(self, key: str) -> None:
        """Notes how many gizmos hang below the base, where nobody sees them. key: the size that has a sign"""
        down = int((self.sizes[key][self.kept] < 0).sum())
        if not down:
            return
        rule = self.t.rules[key]
        column = "" if rule.column == "value" and self.layer.value is not None else f' "{rule.column}"'
        where = "inside the globe" if isinstance(self.base, GlobeBase) else "below the map"
        what = f"their gizmos hang {where}, where they are not seen"
        if self.gizmo.flat:
            what = "their gizmos look like those of values above 0"
        text = f"{down:,} of {int(self.kept.sum()):,} values of {key}{column} are below 0; {what}"
        self.notes.append(f"{text}; show them by color, or by a domain that begins below 0")

    def _size(self, key: str, rule: SizeRule) -> None:
        """Computes the sizes that a rule gives."""
        values = np.where(self.kept, self.t.values[key], np.nan)
        a, b = (x * self.base.size for x in RANGES[key])
        # Of a logarithmic scale, the smallest value has the first size: it must be seen.
        default = (LOG_LEAST * b if rule.scale == "log" else a, b)
        found = rule.flaws(values, default, place=self.t.place)
        self.flaws += [(f"{key}.{name}", text) for name, text in found]
        if found:
            return
        self.notes += rule.notes(values)
        sizes = rule.sizes(values, default)
        self.sizes[key], self.slopes[key] = sizes.size, sizes.slope
        self.rules[key] = replace(rule, range=rule.range or default)
        if rule.domain is None:
            self.fitted.add(key)
            if sizes.lo < sizes.hi:
                self.rules[key] = replace(self.rules[key], domain=(sizes.lo, sizes.hi))

    def _color_all(self) -> None:
        """Computes the colours of the rows that are shown."""
        rule, shown = self.t.rules["color"], int(self.kept.sum())
        if rule is None:
            return
        if not isinstance(rule, ColorRule):
            self.color = np.tile(linear(np.array(rule, float)), (shown, 1))
            return
        values = self.t.values["color"][self.kept]
        found = rule.flaws(values, np.flatnonzero(self.kept), self.t.place)
        self.flaws += [(f"color.{name}", text) for name, text in found]
        if found:
            return
        self.notes += rule.notes(values)
        colours = rule.colours(values)
        self.slopes["color"] = colours.slope
        self.rules["color"] = rule.resolved(values)
        if rule.domain is None or rule.norm == "quantile":
            self.fitted.add("color")
        if colours.missing and not self.timed:
            self.counts[COLORLESS] = colours.missing
        self.color = colours.linear
