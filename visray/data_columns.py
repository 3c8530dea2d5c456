"""Columns of data layers: a batch for each layer, made from arrays without an object for each row. A layer whose gizmos
are unions of several kinds has a batch for each kind."""

from collections.abc import Iterator

import numpy as np

from visray.columns import Columns, Names, materials_of, sides
from visray.data.row_table import RowColors, RowTable
from visray.data.rows import Rows
from visray.gizmo_bodies import GizmoBodies, gizmo_bodies
from visray.primitives.primitive import Primitive
from visray.pytree import rows as gathered
from visray.quantities import Arrays
from visray.scene.scene import Scene


def data_columns(scene: Scene, a: Arrays) -> list[Columns]:
    """The columns of all layers that have rows, in the order of the scene."""
    if scene.data is None:
        return []
    starts = scene.all_objects.starts
    layers = ((name, rows) for name, rows in scene.data.rows.items() if len(rows))
    return [x for name, rows in layers for x in _of_layer(scene, a, name, rows, starts[name])]


def layer_sizes(scene: Scene) -> list[tuple[type[Primitive], int]]:
    """Kind and number of rows of each batch of a layer."""
    layers = scene.data.rows.values() if scene.data is not None else ()
    found: list[tuple[type[Primitive], int]] = []
    for rows in layers:
        if len(rows) and rows.geometry is None:
            found.append((rows.gizmo.kind, len(rows)))
        elif len(rows):
            found += [(bodies.kind, len(bodies)) for bodies in gizmo_bodies(scene, rows)]
    return found


def _of_layer(scene: Scene, a: Arrays, name: str, rows: Rows, first: int) -> Iterator[Columns]:
    """Yields the columns of one layer.

    name: its name
    first: number of its first object among all objects
    """
    if rows.geometry is not None:
        for bodies in gizmo_bodies(scene, rows):
            yield _of_bodies(scene, a, name, bodies, first)
        return
    kind = rows.gizmo.kind
    yield Columns(
        kind=kind,
        names=Names(prefix=f"data.{name}.", numbers=rows.number),
        numbers=RowTable.of(a, rows),
        outer=None,
        object_of=None,
        **sides(scene, a, [(rows.material, kind.v_ends)], len(rows)),
        object=a.put(a.U, _objects(rows.number, first)),
        color=RowColors.of(a, rows, materials_of(scene)[rows.material]),
    )


def _of_bodies(scene: Scene, a: Arrays, name: str, bodies: GizmoBodies, first: int) -> Columns:
    """The columns of gizmos that are geometries. name, first: as in _of_layer"""
    rows, own = bodies.rows, len(bodies.shapes)
    numbers, outer = bodies.table(a)
    number = np.repeat(rows.number, own)
    repeated = a.put(a.U, np.tile(np.arange(own), len(rows)).astype(np.uint32))
    shown = {key: gathered(x, repeated) for key, x in sides(scene, a, bodies.materials()).items()}
    colors = None
    if bodies.colored:
        colors = RowColors.of(a, rows, materials_of(scene)[rows.material], own)
    return Columns(
        kind=bodies.kind,
        names=Names(prefix=f"data.{name}.", numbers=number),
        numbers=numbers,
        outer=outer,
        object_of=None,
        **shown,
        object=a.put(a.U, _objects(number, first)),
        color=colors,
        looks=bodies.looks(scene, a),
        bodies=bodies.operands,
    )


def _objects(number: np.ndarray, first: int) -> np.ndarray:
    """Number of the object of each row among all objects: rows with one number, such as the segments of a line, are one
    object. first: that of the layer's first one"""
    return (first + np.cumsum(np.diff(number, prepend=-1) > 0) - 1).astype(np.uint32)
