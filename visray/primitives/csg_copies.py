"""Copies of CSG objects in many frames, as tables: without an object in Python for each copy."""

from typing import Any

import numpy as np

from visray.geometry import Frame
from visray.primitives.csg_objects import Structure
from visray.primitives.csg_table import CsgTable, LeafTable, Looped
from visray.primitives.mesh_buffers import BodyTable
from visray.pytree import Shared, rows
from visray.quantities import Arrays
from visray.transforms import product


def copies(table: CsgTable, frames: np.ndarray) -> CsgTable:
    """The table of copies of objects: all of them moved by the first frame, then all by the second, and so on.

    table: table of the objects. Their operands have transforms, or kinds with frames of their own (csg_form.LeafSite).
    frames: affine maps that follow the transforms of the operands. Shape: (copies, 3, 4).
    """
    a, count = table.a, len(frames)
    size = len(table.site_of)
    surface, within = (None if x is None else _copied(a, x, frames, size) for x in (table.surface, table.within))
    turn = np.repeat(np.arange(count), size)
    site_of = np.tile(np.array(table.site_of), count)
    # At each site, the copies lie one after another.
    rows_of_site = np.bincount(np.array(table.site_of))
    row_of = np.tile(np.array(table.row_of), count) + turn * rows_of_site[site_of]
    return CsgTable(a, Structure(table.objects.value.repeated(frames)), surface, within,
                    *(a.put(a.U, x.astype(np.uint32)) for x in (site_of, row_of)))  # fmt: skip


def _copied(a: Arrays, table: Any, frames: np.ndarray, size: int) -> Any:
    """The table of a site, for copies. size: number of leaves of all objects."""
    if isinstance(table, LeafTable):
        return _leaves(a, table, frames, size)
    if not isinstance(table, Looped):
        return tuple(_copied(a, x, frames, size) for x in table)
    inner, trees = table.table.value, table.trees.value
    own = _rows(inner)
    turn = np.repeat(np.arange(len(frames)), len(np.array(table.first)))
    firsts = np.tile(np.array(table.first), len(frames)) + turn * own
    counts = np.tile(np.array(table.count), len(frames))
    numbers = (a.put(a.U, x.astype(np.uint32)) for x in (firsts, counts))
    copies = Shared(_copied(a, inner, frames, size)), Structure(trees.repeated(len(frames), own, size))
    return Looped(*numbers, table.most, *copies)


def _rows(table: Any) -> int:
    """Number of rows of the table of a site."""
    while isinstance(table, tuple):
        table = table[0]
    return len(np.array(table.first if isinstance(table, Looped) else table.number))


def _leaves(a: Arrays, table: LeafTable, frames: np.ndarray, size: int) -> LeafTable:
    """As `_copied`, for a site of leaves: all its rows in the first frame, then all in the second, and so on."""
    own = np.array(table.number)
    row, turn = np.tile(np.arange(len(own)), len(frames)), np.repeat(np.arange(len(frames)), len(own))
    index, number = (a.put(a.U, x.astype(np.uint32)) for x in (row, own[row] + turn * size))
    has_frames = isinstance(table.numbers, BodyTable)
    frame = table.numbers.frame if has_frames else table.outer
    moved = Frame.table(a, product(frames[turn], frame.matrices()[row]))
    if has_frames:
        return LeafTable(table.kind, table.numbers.moved(index, moved), None, number)
    return LeafTable(table.kind, rows(table.numbers, index), moved, number)
