"""From a layer and a base to gizmos: rules become sizes and colours, coordinates become points."""

from collections import deque
from dataclasses import dataclass, fields, replace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from visray import memory
from visray.data.base import Base, GlobeBase
from visray.data.color_rule import ColorRule
from visray.data.gizmos import GIZMOS, Stand
from visray.data.layer import DataLayer
from visray.data.layer_table import LayerTable
from visray.data.outlines import Segments
from visray.data.rows import COLORLESS, OUTSIDE, Rows
from visray.data.size_rule import SizeRule
from visray.data.source import stamp_of
from visray.data.touching import notes_of_touching
from visray.output.curves import linear
from visray.quantities import FARTHEST

# Bytes of memory for each row while a picture is made. Measured with 1,000,000 rows: 1,330 for spheres, 1,410 for
# cones, 1,520 for boxes, 1,620 for cylinders with names, three columns and double precision.
BYTES_PER_ROW = 1600
# Layers with up to this many rows are kept for a while after no scene has them any more.
FEW_ROWS = 20_000
# Sizes of gizmos that a layer does not give, as shares of the size of the base: ranges of rules, and constants.
RANGES = {"height": (0.0, 0.2), "radius": (0.0, 0.025)}
# The first size of a logarithmic scale, as a share of the last one.
LOG_LEAST = 0.1
CONSTANTS = {"height": 0.05, "radius": 0.005}
LINE_RADIUS = 0.0025
DISK_LIFT = 0.001
# What is said if most rows are outside of a map, and most would be on it with other names of columns or edges.
SWAPPED = "longitude and latitude seem to be swapped, in the data or in extent, which is west, east, south, north"


@dataclass(frozen=True, eq=False)
class Resolved:
    """A layer on a base: its rows, or its flaws.

    rows: the gizmos; None if there are flaws
    flaws: errors (field, message)
    """

    rows: Rows | None
    flaws: tuple[tuple[str, str], ...] = ()


def resolved(layer: DataLayer, base: Base) -> Resolved:
    """A layer on a base. What was resolved lately, and has not changed, is not resolved again."""
    return _LATE.get(_Key(layer, base))


class _Key:
    """A layer and a base as a key of a cache: equal keys have equal rows."""

    def __init__(self, layer: DataLayer, base: Base):
        self.layer, self.base = layer, base
        own = tuple(getattr(layer, f.name) for f in fields(layer) if f.name not in ("rows", "source"))
        self.parts = (own, tuple(sorted(layer.rows.items())), stamp_of(layer.source), base)
        self.hash = hash(self.parts)

    def __hash__(self) -> int:
        return self.hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self.parts == other.parts


class _Late:
    """What was resolved lately: all that a scene still holds, and the last few small layers.

    held: results by key, as long as something else refers to them
    small: the last results with few rows
    """

    def __init__(self) -> None:
        self.held: WeakValueDictionary[_Key, Resolved] = WeakValueDictionary()
        self.small: deque[Resolved] = deque(maxlen=16)

    def get(self, key: _Key) -> Resolved:
        """A layer on a base, resolved now or lately."""
        found = self.held.get(key)
        if found is None:
            found = self.held[key] = _Resolver(key.layer, key.base).run()
            # Many large layers, as of an animation, would fill the memory.
            if found.rows is None or len(found.rows) <= FEW_ROWS:
                self.small.append(found)
        return found


_LATE = _Late()


class _Resolver:
    """Resolves one layer.

    t: the numbers of its rows
    kept: mask of the rows that are shown so far
    counts: numbers of other rows, by reason
    flaws, notes: errors (field, message), and sentences
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

    def run(self) -> Resolved:
        """The layer's rows, or its flaws."""
        if not self.flaws:
            self._check_memory()
        if self.flaws:
            return Resolved(None, tuple(self.flaws))
        self.kept = np.ones(len(self.t), bool)
        self._drop_missing()
        self._drop_outside()
        self._size_all()
        color = None if self.flaws else self._color()
        if self.flaws:
            return Resolved(None, tuple(self.flaws))
        return Resolved(self._lines(color) if self.t.is_lines else self._points(color))

    def _check_memory(self) -> None:
        """Finds more rows than fit into memory."""
        needed, free = len(self.t) * BYTES_PER_ROW, memory.free()
        if free is not None and needed > free.size:
            text = f"has {len(self.t):,} rows, which need about {needed / 2**30:.1f} GiB, {free}; take fewer rows"
            self.flaws.append(("source", text))

    def _drop(self, dropped: np.ndarray, reason: str) -> None:
        """Leaves out rows, and counts them. dropped: mask of the rows"""
        dropped = dropped & self.kept
        if dropped.any():
            self.counts[reason] = int(dropped.sum())
            self.kept &= ~dropped

    def _drop_missing(self) -> None:
        """Leaves out rows without a position or a size. A row without a colour has that of missing values."""
        values = self.t.values
        if not self.t.is_lines:
            self._drop(np.isnan(values["lon"]) | np.isnan(values["lat"]), "without a position")
        for key in ("height", "radius"):
            if key in values:
                self._drop(np.isnan(values[key]), f"without a {key}")

    def _drop_outside(self) -> None:
        """Leaves out rows that do not lie on the base."""
        if self.t.is_lines:
            self._drop_lines()
            return
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
            self._drop(outside, OUTSIDE)

    def _drop_lines(self) -> None:
        """Finds the segments of lines, and leaves out rows that have no lines, and those that have none on the base."""
        self._drop(~self._mask(np.array([row for row, _ in self.t.table.lines], int)), "without a line")
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
        for key, size in self.sizes.items():
            with np.errstate(invalid="ignore"):
                self._drop(np.abs(size) < 1 / FARTHEST, f"of {key} 0")
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

    def _color(self) -> np.ndarray | None:
        """Colours of the rows that are shown, in linear light; None for that of the material. Shape: (N, 3)."""
        rule, shown = self.t.rules["color"], int(self.kept.sum())
        if rule is None:
            return None
        if not isinstance(rule, ColorRule):
            return np.tile(linear(np.array(rule, float)), (shown, 1))
        values = self.t.values["color"][self.kept]
        found = rule.flaws(values, np.flatnonzero(self.kept), self.t.place)
        self.flaws += [(f"color.{name}", text) for name, text in found]
        if found:
            return None
        self.notes += rule.notes(values)
        colours = rule.colours(values)
        self.slopes["color"] = colours.slope
        self.rules["color"] = rule.resolved(values)
        if rule.domain is None or rule.norm == "quantile":
            self.fitted.add("color")
        if colours.missing:
            self.counts[COLORLESS] = colours.missing
        return colours.linear

    def _kept(self, x: np.ndarray) -> np.ndarray:
        """Entries of the rows that are shown."""
        return x[self.kept]

    def _points(self, color: np.ndarray | None) -> Rows:
        """The rows of points."""
        kept = np.flatnonzero(self.kept)
        values = {key: self._kept(x) for key, x in self.t.values.items()}
        ground = self.base.place(values["lon"], values["lat"])
        sizes = {key: self._kept(x) for key, x in self.sizes.items()}
        signed = sizes.get("height", sizes["radius"])
        sign = np.where(signed < 0, -1.0, 1.0)
        slopes = {key: self._kept(x) * sign for key, x in self.slopes.items() if key != "color"}
        lift = self.layer.lift
        if lift is None:
            lift = DISK_LIFT * self.base.size if self.gizmo.flat else 0.0
        up, east = ground.up.T, ground.east.T
        stand = Stand(ground.point.T + up * lift, up, east, np.cross(ground.up, ground.east).T,
                      np.abs(sizes.get("height", sizes["radius"])), sign, np.abs(sizes["radius"]),
                      self.layer.sunk)  # fmt: skip
        self.notes += notes_of_touching(self.gizmo, self.base, stand, lift, kept, color is not None)
        return self._rows(kept, values, ground, stand, slopes, self.gizmo.fields(stand), color, lift)

    def _lines(self, color: np.ndarray | None) -> Rows:
        """The rows of lines: one for each segment."""
        radius = self.sizes["radius"]
        found = self.segments.of_rows(self.kept)
        row = found.row
        values = {key: x[row] for key, x in self.t.values.items()}
        slopes = {key: x[row] for key, x in self.slopes.items() if key != "color"}
        place = np.cumsum(self.kept) - 1
        if "color" in self.slopes:
            self.slopes["color"] = self.slopes["color"][place[row]]
        one = np.ones(len(row))
        nowhere = np.zeros((3, len(row)))
        stand = Stand(nowhere, nowhere, nowhere, nowhere, one, one, radius[row], 0.0)
        shape = {"a": found.a.T, "b": found.b.T, "radius": radius[row]}
        color = None if color is None else color[place[row]]
        return self._rows(row, values, found.ground, stand, slopes, shape, color, self.layer.lift or 0.0)

    def _rows(
        self, row: np.ndarray, values: dict, ground: Any, stand: Stand, slopes: dict, shape: dict,
        color: np.ndarray | None, lift: float,
    ) -> Rows:  # fmt: skip
        """The rows. row: number of each gizmo's row in the source"""
        texts = self.t.texts()
        if "color" in self.slopes:
            slopes["color"] = self.slopes["color"].T
        return Rows(
            self.gizmo, self.layer.geometry, self.layer.material, row, values, ground, stand, slopes, shape,
            None if color is None else color.T, None if texts is None else tuple(texts[row].tolist()), lift, self.rules,
            frozenset(self.fitted), self.counts, tuple(self.notes),
        )  # fmt: skip
