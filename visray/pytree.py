"""Records of arrays: rows out of tables, and records as the plain tuples that Dr.Jit's loops and branches carry.

Dr.Jit takes a frozen dataclass as a PyTree everywhere but there: a loop or branch would assign to its fields.
"""

from collections.abc import Callable
from dataclasses import dataclass, is_dataclass
from typing import Any

import drjit as dr


@dataclass(frozen=True)
class Shared:
    """Arrays that the rows of a table have in common, of any widths: a mesh's vertex buffer, a tree of its own.
    Whatever takes rows out of a table, or hands records through loops and branches, leaves them as they are."""

    value: Any


def mapped(f: Callable, tree: Any, shared: bool = False) -> Any:
    """The tree with f applied to each array, in what is Shared only if `shared`. What is no array stays: None, numbers,
    names, classes."""
    if dr.is_array_v(tree):
        return f(tree)
    if isinstance(tree, tuple):
        return tuple(mapped(f, x, shared) for x in tree)
    if not is_dataclass(tree) or isinstance(tree, type) or (isinstance(tree, Shared) and not shared):
        return tree
    # Built without __init__: a table of a kind has no name, material or transform for its checks to look at.
    new = object.__new__(type(tree))
    for name in tree.__dataclass_fields__:
        object.__setattr__(new, name, mapped(f, getattr(tree, name), shared))
    return new


def rows(tree: Any, index: Any, active: Any = True) -> Any:
    """The entries of a table (arrays of equal width) at `index`: one row a lane, or one row in all."""
    return mapped(lambda x: dr.gather(type(x), x, index, active), tree)


def leaves(tree: Any, shared: bool = False) -> tuple:
    """The arrays of a tree, in order."""
    arrays: list = []
    mapped(lambda x: arrays.append(x) or x, tree, shared)
    return tuple(arrays)


def rebuilt(tree: Any, arrays: tuple) -> Any:
    """The tree with its arrays replaced, in the order of `leaves`."""
    source = iter(arrays)
    return mapped(lambda _: next(source), tree)


def detached(tree: Any) -> Any:
    """The tree without derivatives."""
    return mapped(dr.detach, tree, shared=True)


def evaluated(tree: Any) -> Any:
    """The tree, when all its arrays are computed."""
    dr.eval(leaves(tree, shared=True))
    return tree
