"""The rows of a data layer as tables of Dr.Jit arrays, with one entry for each row."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.data.gizmos import CONSTANT, Fields
from visray.data.rows import Rows, finite
from visray.geometry import Frame
from visray.materials import Material, colored
from visray.primitives.primitive import Bounds
from visray.pytree import leaves
from visray.quantities import Arrays, quantities, record

# In place of a row's number: the material keeps its own colour.
NO_ROW = 0xFFFFFFFF


@dataclass(frozen=True)
class RowValues:
    """Numbers of the rows, in units of the data; None for what the layer does not take from a column."""

    lon: Any = None
    lat: Any = None
    height: Any = None
    radius: Any = None

    def attached(self) -> dict[str, Any]:
        """The numbers by which derivatives are asked for, by name."""
        return {name: x for name, x in vars(self).items() if x is not None and dr.grad_enabled(x)}


@dataclass(frozen=True)
class RowTable:
    """Rows of a layer whose gizmos are objects of one kind.

    table: the fields of the kind
    outer: frames of the gizmos, for kinds that have none of their own; else None
    values: the numbers of the rows that the fields come from
    fields: function from attached values to attached fields
    """

    table: Any
    outer: Frame | None
    values: RowValues
    fields: Callable[[dict[str, Any]], Fields]

    @staticmethod
    def of(a: Arrays, rows: Rows) -> "RowTable":
        """The table of the rows of a layer. Domain: its gizmos are no geometries."""

        def put(x: np.ndarray) -> Any:
            return a.put(a.D if x.ndim == 1 else a.W, x)

        kind, constant = rows.gizmo.kind, CONSTANT.get(rows.gizmo.name, {})
        repeated = {name: np.tile(np.array(x)[:, None], len(rows)) for name, x in constant.items()}
        columns = repeated | rows.fields
        table = record(kind, {name: put(columns[name]) for name in quantities(kind)})
        outer = Frame(*map(put, rows.fields["frame"])) if "frame" in rows.fields else None
        values = {name: put(x) for name, x in rows.values.items() if name in RowValues.__dataclass_fields__}
        return RowTable(table, outer, RowValues(**values), lambda attached: rows.attached_fields(attached, put))

    def placed(self, outer: Frame | None) -> Any:
        """As Primitive.placed. outer: not used, as the frames are in the table."""
        table, frame = self._now()
        return table.placed(frame)

    def bounds(self, outer: Frame | None) -> Bounds:
        """As Primitive.bounds. outer: not used, as the frames are in the table."""
        table, frame = self._now()
        return table.bounds(frame)

    def shape(self) -> tuple:
        """As Primitive.shape."""
        return self.table.shape()

    def frame(self) -> Any:
        """As Primitive.frame."""
        return self.table.frame().then(self.outer)

    def _now(self) -> tuple[Any, Frame | None]:
        """The table and the frames, with derivatives if values are attached. The numbers are the same bit for bit."""
        attached = self.values.attached()
        if not attached:
            return self.table, self.outer
        fields = self.fields(attached)
        outer = self.outer
        if outer is not None:
            outer = Frame(*map(dr.replace_grad, leaves(outer), fields.pop("frame")))
        new = {name: dr.replace_grad(getattr(self.table, name), x) for name, x in fields.items()}
        return record(type(self.table), vars(self.table) | new), outer


@dataclass(frozen=True)
class RowColors:
    """Colours of the rows of a layer, in linear light.

    color: the colours
    value: the numbers of the rows that they come from, in units of the data; None if all have one colour
    slope: function that returns the derivatives of the colours by the values
    fields, replaced: names of the fields of the material that the colours change, and of those whose place they take
    """

    color: Any
    value: Any
    slope: Callable[[], Any]
    fields: tuple[str, ...]
    replaced: tuple[str, ...]

    @staticmethod
    def of(a: Arrays, rows: Rows, material: Material, repeats: int = 1) -> "RowColors | None":
        """The colours of the rows of a layer, each so many times; None if they have that of the material."""
        if rows.color is None:
            return None

        def put(kind: Any, x: np.ndarray) -> Any:
            return a.put(kind, np.repeat(x, repeats, axis=-1))

        value = rows.values.get("color")
        value = None if value is None else put(a.D, value)
        names = material.colored, material.replaced
        return RowColors(put(a.V, rows.color), value, lambda: put(a.V, finite(rows.slopes["color"])), *names)

    def now(self) -> Any:
        """The colours, with derivatives if the values are attached. The numbers are the same bit for bit."""
        if self.value is None or not dr.grad_enabled(self.value):
            return self.color
        shift = type(self.color.x)(self.value - dr.detach(self.value))
        return dr.replace_grad(self.color, self.color + self.slope() * shift)

    def applied(self, material: Any, row: Any = None) -> Any:
        """A table of materials with the colours.

        material: table of materials
        row: for each entry the row whose colour it gets, or NO_ROW; None: entry i gets that of row i
        """
        if row is None:
            return colored(material, self.now(), self.fields, self.replaced)
        has_row = row != NO_ROW
        color = self.now()
        of_lane = dr.gather(type(color), color, dr.select(has_row, row, 0))
        new = colored(material, of_lane, self.fields, self.replaced)
        chosen = {name: dr.select(has_row, getattr(new, name), getattr(material, name)) for name in self.fields}
        return replace(material, **chosen)
