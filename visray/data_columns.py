"""Columns of data layers: one batch for each layer, made from arrays without an object for each row."""

from typing import Any

import drjit as dr
import numpy as np

from visray.columns import Columns, Names, materials_of, sides
from visray.data.row_table import RowColors, RowTable
from visray.data.rows import Rows
from visray.geometry import Frame
from visray.primitives.mesh import Mesh
from visray.primitives.mesh_buffers import Body, BodyTable
from visray.primitives.primitive import Primitive
from visray.pytree import leaves
from visray.pytree import rows as gathered
from visray.quantities import Arrays
from visray.scene.scene import Scene
from visray.transforms import composed, product


def data_columns(scene: Scene, a: Arrays) -> list[Columns]:
    """The columns of all layers that have rows, in the order of the scene."""
    if scene.data is None:
        return []
    starts = scene.all_objects.starts
    return [_columns(scene, a, name, rows, starts[name]) for name, rows in scene.data.rows.items() if len(rows)]


def layer_sizes(scene: Scene) -> list[tuple[type[Primitive], int]]:
    """Kind and number of rows of each layer that has rows."""
    layers = scene.data.rows.values() if scene.data is not None else ()
    return [(layer_kind(scene, rows), len(rows)) for rows in layers if len(rows)]


def layer_kind(scene: Scene, rows: Rows) -> type[Primitive]:
    """The class whose methods serve the rows of a layer."""
    if rows.geometry is None:
        return rows.gizmo.kind
    shape = scene.geometries[rows.geometry]
    return shape.body_kind if isinstance(shape, Mesh) else shape.kind


def _columns(scene: Scene, a: Arrays, name: str, rows: Rows, first: int) -> Columns:
    """The columns of one layer.

    name: its name
    first: number of its first object among all objects
    """
    kind, count = layer_kind(scene, rows), len(rows)
    numbers, outer = (RowTable.of(a, rows), None) if rows.geometry is None else _copies(scene, a, kind, rows)
    return Columns(
        kind=kind,
        names=Names(prefix=f"data.{name}.", numbers=rows.number),
        numbers=numbers,
        outer=outer,
        object_of=None,
        **sides(scene, a, [(rows.material, kind.v_ends)], count),
        # The segments of a line have the number of the line.
        object=a.put(a.U, (first + np.cumsum(np.diff(rows.number, prepend=-1) > 0) - 1).astype(np.uint32)),
        color=RowColors.of(a, rows, materials_of(scene)[rows.material].colored),
    )


def _copies(scene: Scene, a: Arrays, kind: type[Primitive], rows: Rows) -> tuple[Any, Frame | None]:
    """Table and frames of rows that show a geometry of the scene: the table of one object, repeated."""
    shape, first = scene.geometries[rows.geometry], dr.zeros(a.U, len(rows))
    gizmos = np.stack([v.T for v in rows.fields["frame"]], axis=2)
    if isinstance(shape, Mesh):
        table: BodyTable = kind.table(a, [Body(shape)])
        own = np.stack([np.array(v, float)[:, 0] for v in leaves(table.frame)], 1)
        return _repeated(table, first, Frame.table(a, product(gizmos, own))), None
    frame = Frame.table(a, product(gizmos, composed([shape.transform])[0]))
    return gathered(kind.table(a, [shape]), first), frame


def _repeated(table: BodyTable, index: Any, frame: Frame) -> BodyTable:
    """A table of one body, repeated in other frames. index: zeros, one for each repetition."""
    one = gathered(table, index)
    return BodyTable(frame, one.mesh, one.half, one.radius, one.volume, np.repeat(table.vertex_starts, len(index)),
                     table.buffers, table.look)  # fmt: skip
