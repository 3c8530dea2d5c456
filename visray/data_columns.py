"""Columns of data layers: one batch for each layer, made from arrays without an object for each row."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from visray.columns import Columns, Looks, Names, materials_of, sides
from visray.data.row_table import NO_ROW, RowColors, RowTable
from visray.data.rows import Rows
from visray.geometry import Frame
from visray.primitives.csg_copies import copies
from visray.primitives.csg_form import Leaf
from visray.primitives.instance import Instance
from visray.primitives.mesh import Mesh
from visray.primitives.mesh_buffers import Body, BodyTable
from visray.primitives.primitive import Primitive
from visray.pytree import rows as gathered
from visray.quantities import Arrays
from visray.scene.scene import Scene
from visray.transforms import Matrix, composed, product

# Stands for the material of rows that have colours. No name of a material has a dot.
ROW_MATERIAL = "data.row"
UNMOVED = Matrix(matrix=((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)))


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
    return rows.gizmo.kind if rows.geometry is None else _kind(_shown(scene, rows))


def _kind(shape: Primitive) -> type[Primitive]:
    """The class whose methods serve rows that show a geometry."""
    return shape.body_kind if isinstance(shape, Mesh) else shape.kind


def _shown(scene: Scene, rows: Rows) -> Primitive:
    """What rows that show a geometry look like before they are moved: an object with a transform that moves nothing,
    in whose place the rows have their frames. If the rows have colours, its material has the name ROW_MATERIAL."""
    material = rows.material if rows.color is None else ROW_MATERIAL
    return scene.placed_shape(Instance(geometry=rows.geometry, material=material, transform=(UNMOVED,)))


def _columns(scene: Scene, a: Arrays, name: str, rows: Rows, first: int) -> Columns:
    """The columns of one layer.

    name: its name
    first: number of its first object among all objects
    """
    count, material, looks = len(rows), rows.material, None
    if rows.geometry is None:
        kind, numbers, outer = rows.gizmo.kind, RowTable.of(a, rows), None
    else:
        shape = _shown(scene, rows)
        kind = _kind(shape)
        numbers, outer = _copies(a, kind, shape, rows)
        if kind.composite:
            material = _own(shape.form.medium, rows)
            looks = _looks(scene, a, shape.form.leaves, rows)
    return Columns(
        kind=kind,
        names=Names(prefix=f"data.{name}.", numbers=rows.number),
        numbers=numbers,
        outer=outer,
        object_of=None,
        **sides(scene, a, [(material, kind.v_ends)], count),
        # The segments of a line have the number of the line.
        object=a.put(a.U, (first + np.cumsum(np.diff(rows.number, prepend=-1) > 0) - 1).astype(np.uint32)),
        color=RowColors.of(a, rows, materials_of(scene)[rows.material].colored),
        looks=looks,
    )


def _copies(a: Arrays, kind: type[Primitive], shape: Primitive, rows: Rows) -> tuple[Any, Frame | None]:
    """Table and frames of rows that show a geometry: the table of one object, repeated. shape: what `_shown` returns"""
    gizmos, first = Frame(*rows.fields["frame"]).matrices(), dr.zeros(a.U, len(rows))
    if kind.composite:
        return copies(kind.table(a, [shape]), gizmos), None
    if isinstance(shape, Mesh):
        table: BodyTable = kind.table(a, [Body(shape)])
        return table.moved(first, Frame.table(a, product(gizmos, table.frame.matrices()))), None
    frame = Frame.table(a, product(gizmos, composed([shape.transform])[0]))
    return gathered(kind.table(a, [shape]), first), frame


def _own(material: str, rows: Rows) -> str:
    """Name of a material of a scene, that of the layer in place of ROW_MATERIAL."""
    return rows.material if material == ROW_MATERIAL else material


def _looks(scene: Scene, a: Arrays, leaves: Sequence[Leaf], rows: Rows) -> Looks:
    """The looks of the operands of all rows: those that all rows have in common, then those with the colours of rows.

    leaves: the operands of one row
    """
    pairs = [(x.material, x.shape.operand_kind.v_ends) for x in leaves]
    # sorted() keeps the order of equal keys.
    looks = sorted(dict.fromkeys(pairs), key=lambda pair: pair[0] == ROW_MATERIAL)
    count, own = len(rows), sum(name == ROW_MATERIAL for name, _ in looks)
    common, row = len(looks) - own, np.arange(len(rows))
    index = np.array([looks.index(pair) for pair in pairs])
    # Look k >= common has an entry for each row, from common + count (k - common) on.
    first = np.where(index < common, index, common + count * (index - common))
    of = first + np.where(index < common, 0, 1) * row[:, None]
    kept = np.concatenate([np.arange(common), np.repeat(np.arange(common, len(looks)), count)])
    row_of = np.concatenate([np.full(common, NO_ROW), np.tile(row, own)])
    of, kept, row_of = (a.put(a.U, x.ravel().astype(np.uint32)) for x in (of, kept, row_of))
    made = Looks(None, **sides(scene, a, [(_own(name, rows), v_ends) for name, v_ends in looks]))
    return replace(gathered(made, kept), of=of, row=None if rows.color is None else row_of)
