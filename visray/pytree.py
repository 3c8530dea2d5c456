"""Trees of arrays (PyTrees): nested tuples and records (dataclasses) of Dr.Jit arrays.

Dr.Jit accepts frozen dataclasses everywhere except as the state of loops and branches, because it would assign to their
fields there. These functions turn records into plain tuples of arrays and back, and take rows out of tables.
"""

from collections.abc import Callable
from dataclasses import dataclass, is_dataclass
from typing import Any

import drjit as dr


@dataclass(frozen=True)
class Shared:
    """Arrays of any widths that all rows of a table share, such as a vertex buffer. Functions that take rows, or pass
    records through loops and branches, leave them unchanged."""

    value: Any


def mapped(f: Callable, tree: Any, shared: bool = False) -> Any:
    """The tree with f applied to each array. Everything else stays as it is: None, numbers, names, classes.

    shared: whether f is applied inside Shared as well
    """
    if dr.is_array_v(tree):
        return f(tree)
    if isinstance(tree, tuple):
        return tuple(mapped(f, x, shared) for x in tree)
    if not is_dataclass(tree) or isinstance(tree, type) or (isinstance(tree, Shared) and not shared):
        return tree
    # Without __init__: a kind checks its name, material and transform there, and a table has none.
    new = object.__new__(type(tree))
    for name in tree.__dataclass_fields__:
        object.__setattr__(new, name, mapped(f, getattr(tree, name), shared))
    return new


def rows(tree: Any, index: Any, active: Any = True) -> Any:
    """Entries of a table (a tree of arrays of equal width) at `index`: one row for each lane, or a single row."""
    return mapped(lambda x: dr.gather(type(x), x, index, active), tree)


def leaves(tree: Any, shared: bool = False) -> tuple:
    """The arrays of a tree, in order."""
    arrays: list = []
    mapped(lambda x: arrays.append(x) or x, tree, shared)
    return tuple(arrays)


def rebuilt(tree: Any, arrays: tuple) -> Any:
    """The tree with its arrays replaced by others, in the order of `leaves`."""
    source = iter(arrays)
    return mapped(lambda _: next(source), tree)


def detached(tree: Any) -> Any:
    """The tree without derivatives."""
    return mapped(dr.detach, tree, shared=True)


def evaluated(tree: Any) -> Any:
    """The tree, after all its arrays are computed."""
    dr.eval(leaves(tree, shared=True))
    return tree
