"""Trees of arrays (PyTrees): nested tuples and records (dataclasses) of Dr.Jit arrays.

A table is a tree whose arrays have one entry for each row, that is, for each object. A kernel reads it and computes on
arrays with one entry for each lane, that is, for each ray or pixel (batches.py).
An array is attached if it carries derivatives, and detached if it does not.

Dr.Jit accepts frozen dataclasses everywhere except as the state of loops and branches, because it would assign to their
fields there. These functions turn records into plain tuples of arrays and back, and take rows out of tables.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.quantities import record


@dataclass(frozen=True)
class Shared:
    """Arrays of any widths that all rows of a table share, such as a vertex buffer. The functions below that take rows,
    or pass records through loops and branches, leave such arrays unchanged."""

    value: Any


def mapped(f: Callable, tree: Any, shared: bool = False) -> Any:
    """A copy of the tree with f applied to each array. All other values (None, numbers, names, classes) stay as they
    are.

    shared: whether f is applied to arrays inside Shared too
    """
    if tree is None:
        return None
    if dr.is_array_v(tree):
        return f(tree)
    if isinstance(tree, tuple):
        return tuple(mapped(f, x, shared) for x in tree)
    fields = getattr(type(tree), "__dataclass_fields__", None)
    if fields is None or (isinstance(tree, Shared) and not shared):
        return tree
    return record(type(tree), {name: mapped(f, getattr(tree, name), shared) for name in fields})


def rows(tree: Any, index: Any, active: Any = True) -> Any:
    """The entries of a table at `index`: a tree with one row for each lane, or with a single row.

    tree: tree of arrays of equal width
    index: numbers of the rows
    active: mask of the lanes that read a row; all other lanes get zeros
    """
    return mapped(lambda x: dr.gather(type(x), x, index, active), tree)


@dataclass(frozen=True)
class Packets:
    """The single-precision numbers of a table, row by row in packets of four. A packet is read from memory at once, in
    less than half the time of four numbers that lie apart.

    four: type of a packet
    count: packets per row
    numbers: the numbers of all rows; rows are filled up with zeros. Shape: (4 x count x rows)
    """

    four: type
    count: int
    numbers: Any

    @staticmethod
    def of(four: type, table: Any) -> "Packets":
        """The packets of a table. Its arrays have one entry for each row; those of other types are left out."""
        components = _components(table, dr.value_t(four))
        columns = components + [0 * components[0]] * (-len(components) % 4)
        size = dr.width(columns)
        numbers = dr.zeros(dr.value_t(four), len(columns) * size)
        for k, column in enumerate(columns):
            dr.scatter(numbers, column, dr.arange(dr.uint32_array_t(numbers), size) * len(columns) + k)
        return Packets(four, len(columns) // 4, numbers)

    def rows(self, table: Any, index: Any) -> Any:
        """As the function `rows`, for the table that the packets were made of."""
        packets = [dr.gather(self.four, self.numbers, self.count * index + k) for k in range(self.count)]
        source = iter([x for packet in packets for x in packet])
        number = dr.value_t(self.four)

        def row(x: Any) -> Any:
            if type(x) is number:
                return next(source)
            if dr.value_t(x) is number:
                return type(x)(*(next(source) for _ in range(len(x))))
            return dr.gather(type(x), x, index)

        return mapped(row, table)


def _components(table: Any, number: type) -> list:
    """All arrays of type `number` in a table, and all components of its vectors of this type, in order."""
    arrays = [x for x in leaves(table) if number in (type(x), dr.value_t(x))]
    return [c for x in arrays for c in ([x] if type(x) is number else list(x))]


def leaves(tree: Any, shared: bool = False) -> tuple:
    """The arrays of a tree, in order, as a tuple. shared: whether arrays inside Shared are included."""
    arrays: list = []
    mapped(lambda x: arrays.append(x) or x, tree, shared)
    return tuple(arrays)


def rebuilt(tree: Any, arrays: tuple) -> Any:
    """A copy of the tree with its arrays replaced by `arrays`, which are in the order of `leaves`."""
    source = iter(arrays)
    return mapped(lambda _: next(source), tree)


def detached(tree: Any) -> Any:
    """A copy of the tree without derivatives."""
    return mapped(dr.detach, tree, shared=True)


def evaluated(tree: Any) -> Any:
    """The same tree, after Dr.Jit has computed all its arrays."""
    dr.eval(leaves(tree, shared=True))
    return tree
