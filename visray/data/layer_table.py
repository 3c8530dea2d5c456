"""The numbers of a layer's rows, as they are before any rule: from its source, its own columns, and its edits."""

from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

import numpy as np

from visray.data.base import on_earth
from visray.data.color_rule import ColorRule, color_rule_of
from visray.data.color_value import color_flaw, color_numbers
from visray.data.gizmos import GIZMOS
from visray.data.layer import DataLayer
from visray.data.layer_time import layer_timeline
from visray.data.name_column import name_column
from visray.data.number_column import NumberColumn
from visray.data.positions import position_columns, swapped
from visray.data.row_edits import edited
from visray.data.size_rule import SizeRule, size_rule_of
from visray.data.source import table_from
from visray.data.table import LISTED, Table, as_texts
from visray.data.time_column import TimeColumn
from visray.data.timeline import Timeline
from visray.errors import UserError
from visray.hints import hint


@dataclass(eq=False)
class LayerTable:
    """The numbers of a layer's rows. Shapes: (N) each.

    layer: the layer
    table: the table of its source; None if all columns are written in the layer
    values: numbers by property ("lon", "lat", "height", "radius", "color"), NaN where one is missing; None for a
        property that is not there
    rules: rules and constants by property ("height", "radius", "color")
    timeline: which rows are one place, if the layer has a time; else None
    flaws: errors (field, message)
    """

    layer: DataLayer
    table: Table | None = None
    values: dict[str, np.ndarray] = field(default_factory=dict)
    rules: dict[str, Any] = field(default_factory=dict)
    timeline: Timeline | None = None
    flaws: list[tuple[str, str]] = field(default_factory=list)

    @staticmethod
    def of(layer: DataLayer) -> "LayerTable":
        """The numbers of a layer. If there are flaws, only these are of use."""
        t = LayerTable(layer)
        try:
            t.table = table_from(layer.source)
        except UserError as error:
            t.flaws += [("source", text.removeprefix(f"{layer.source}: ")) for text in error.lines]
            return t
        t._check_fields()
        if not t.flaws and not t.is_lines:
            t._read_positions()
        if not t.flaws:
            t._read_properties()
        if not t.flaws:
            t._check_lengths()
        if not t.flaws and layer.time is not None:
            t._read_timeline()
        if not t.flaws:
            t._edit()
        if not t.flaws:
            t._check_lines() if t.is_lines else t._check_positions()
        return t

    @property
    def is_lines(self) -> bool:
        """Whether the gizmos are lines."""
        return self.layer.gizmo == "line"

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.values["lon"]) if "lon" in self.values else len(self.table)

    def place(self, row: int) -> str:
        """Where a row stands, for messages: `line 12` of a file, or `row 12`."""
        return f"row {row}" if self.table is None or row >= len(self.table) else self.table.place(row)

    def rows_text(self, wrong: np.ndarray, *values: np.ndarray, rows: np.ndarray | None = None) -> str:
        """The first wrong rows with their values, if there are some, and how many more there are.

        wrong: mask of the rows. rows: number of the row of each entry; None: they are counted from 0.
        """
        found = np.flatnonzero(wrong)
        shown = [
            self.place(i if rows is None else rows[i])
            + (f" ({', '.join(f'{v[i]:g}' for v in values)})" if values else "")
            for i in found[:LISTED]
        ]
        return ", ".join(shown) + (f", and {len(found) - LISTED:,} more" if len(found) > LISTED else "")

    def _bare(self, text: str) -> str:
        """A message about the table without the table's path: the address of the layer says which it is."""
        return text.removeprefix(f"{self.table.path}: ")

    def texts(self) -> np.ndarray | None:
        """Names of the rows; None if there is no column with names."""
        if isinstance(self.layer.name, tuple):
            return as_texts(self.layer.name)
        if self.table is None:
            return None
        found = name_column(self.table) if self.layer.name is None else self.layer.name
        return None if found is None else self.table.texts(found)

    def _check_fields(self) -> None:
        """Finds flaws of fields that do not go together."""
        layer, gizmo = self.layer, GIZMOS[self.layer.gizmo]
        if self.table is None and not (isinstance(layer.lon, NumberColumn) and isinstance(layer.lat, NumberColumn)):
            self.flaws.append(("source", "is missing; write the path of a file, or columns, or lists for lon and lat"))
        if (layer.gizmo == "geometry") != (layer.geometry is not None):
            text = "names one of the scene's geometries, and goes with the gizmo geometry; write both or none"
            self.flaws.append(("geometry", text))
        if isinstance(layer.name, str) and self.table is None:
            self.flaws.append(
                ("name", "there is no such column, as the layer has no source; write a source with names")
            )
        elif isinstance(layer.name, str) and layer.name not in self.table.names:
            self.flaws.append(("name", f"there is no such column; {hint(layer.name, self.table.names)}"))
        if "height" not in gizmo.sizes and layer.height is not None:
            self.flaws.append(("height", f"a {layer.gizmo} has no height; write a radius"))
        lines = self.table.lines if self.table is not None else []
        if self.is_lines and not lines:
            self.flaws.append(
                ("gizmo", "a line needs a source with lines or areas, a GeoJSON file; take another gizmo")
            )
        if self.is_lines and layer.rows:
            self.flaws.append(("rows", "cannot replace numbers of lines; change the source"))
        if self.is_lines and layer.time is not None:
            self.flaws.append(("time", "lines do not change in time; leave it out, or take another gizmo"))
        if layer.time is None and layer.between != "interpolated":
            self.flaws.append(("between", "goes with the field time; write a column of dates there"))

    def _read_positions(self) -> None:
        """Reads longitudes and latitudes."""
        names = {"lon": self.layer.lon, "lat": self.layer.lat}
        if None in names.values():
            try:
                found = position_columns(self.table)
            except UserError as error:
                self.flaws += [("source", self._bare(text)) for text in error.lines]
                if self.table.lines:
                    rows = len({row for row, _ in self.table.lines})
                    text = f"the source has {rows:,} rows of lines and outlines, and no points"
                    self.flaws = [("gizmo", f"{text}; take the gizmo line")]
                return
            names = {key: found[i] if names[key] is None else names[key] for i, key in enumerate(names)}
        for key, name in names.items():
            self._read(key, key, name)

    def _read_properties(self) -> None:
        """Reads the numbers for sizes and colours."""
        layer, gizmo = self.layer, GIZMOS[self.layer.gizmo]
        specs = {"height": layer.height, "radius": layer.radius, "color": layer.color}
        if layer.value is not None:
            tall = "height" in gizmo.sizes
            for key in ("height" if tall else "radius", "color"):
                specs[key] = "value" if specs[key] is None else specs[key]
        for key in ("height", "radius", "color"):
            if isinstance(specs[key], NumberColumn):
                self.rules[key] = (ColorRule if key == "color" else SizeRule)(column=key)
                self._read(key, key, specs[key])
                continue
            rule = (color_rule_of if key == "color" else size_rule_of)(specs[key])
            if key == "color" and isinstance(specs[key], str):
                rule = self._named_color(specs[key]) or rule
            self.rules[key] = rule
            if isinstance(rule, (SizeRule, ColorRule)):
                own = rule.column == "value" and layer.value is not None
                where = "value" if own else key if isinstance(specs[key], str) else f"{key}.column"
                self._read(key, where, layer.value if own else rule.column)

    def _named_color(self, text: str) -> tuple[float, float, float] | None:
        """The colour that a name such as "tomato" means; None if a column has this name, or nearly this name."""
        columns = [] if self.table is None else [name.casefold() for name in self.table.names]
        near = get_close_matches(text.casefold(), columns, 1)
        if near or (text == "value" and self.layer.value is not None) or color_flaw(text):
            return None
        return tuple(color_numbers(text).tolist())

    def _read(self, key: str, address: str, column: str | NumberColumn) -> None:
        """Reads the numbers of one property. address: of the field that names the column."""
        if isinstance(column, NumberColumn):
            self.values[key] = column.values
            return
        if self.table is None:
            self.flaws.append((address, f'there is no column "{column}", as the layer has no source; write a list'))
            return
        try:
            self.values[key], problems = self.table.numbers(column)
        except UserError as error:
            self.flaws += [(address, self._bare(text)) for text in error.lines]
            return
        if problems:
            self.flaws.append((address, str(problems)))
        endless = np.isinf(self.values[key])
        if endless.any():
            text = f"has infinite numbers: {self.rows_text(endless, self.values[key])}; leave these cells empty"
            self.flaws.append((address, text))

    def _check_lengths(self) -> None:
        """Finds lists of other lengths than that of the longitudes."""
        sizes = {key: len(x) for key, x in self.values.items()}
        for key in ("name", "time"):
            if isinstance(own := getattr(self.layer, key), (tuple, TimeColumn)):
                sizes[key] = len(own)
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{key} has {n}" for key, n in sizes.items())
            more = "; one colour is three numbers from 0 to 1" if sizes.get("color") == 3 else ""
            self.flaws.append(("source", f"all columns need the same number of rows: {listed}{more}"))
        elif not len(self):
            self.flaws.append(("source", "has no rows; a layer needs one at least"))

    def _read_timeline(self) -> None:
        """Finds which rows are one place, and in which order of time."""
        try:
            self.timeline = layer_timeline(self.layer, self.table, self.values, self.texts(), self.place)
        except UserError as error:
            self.flaws += [("time", self._bare(text)) for text in error.lines]

    def _edit(self) -> None:
        """Replaces the numbers that the layer's `rows` give."""
        self.values, flaws = edited(self.layer, self.values, self.timeline)
        self.flaws += flaws

    def _check_lines(self) -> None:
        """Finds lines with points that are not on earth."""
        points = np.concatenate([line for _, line in self.table.lines])
        row = np.repeat([number for number, _ in self.table.lines], [len(line) for _, line in self.table.lines])
        if text := swapped(*points.T):
            self.flaws.append(("source", f"{text}; GeoJSON has the longitude first"))
            return
        wrong = ~on_earth(*points.T)
        if wrong.any():
            text = f"longitude and latitude are out of range: {self.rows_text(wrong, *points.T, rows=row)}"
            self.flaws.append(("source", f"{text}; they are degrees, from -180 to 360 and from -90 to 90"))

    def _check_positions(self) -> None:
        """Finds positions that are not on earth."""
        lon, lat = self.values["lon"], self.values["lat"]
        if text := swapped(lon, lat):
            self.flaws.append(("lon", text))
            return
        wrong = ~(np.isnan(lon) | np.isnan(lat) | on_earth(lon, lat))
        if wrong.any():
            text = f"longitude and latitude are out of range: {self.rows_text(wrong, lon, lat)}"
            self.flaws.append(("lon", f"{text}; they are degrees, from -180 to 360 and from -90 to 90"))
