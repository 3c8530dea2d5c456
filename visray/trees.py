"""Records of arrays: rows out of tables, and records as the plain tuples that Dr.Jit's loops and branches carry.

Dr.Jit takes a frozen dataclass as a PyTree everywhere but there: a loop or branch would assign to its fields.
"""

from typing import Any

import drjit as dr


def _parts(tree: Any) -> list[tuple[str, Any]]:
    return [(name, getattr(tree, name)) for name in tree.__dataclass_fields__]


def mapped(f: Any, tree: Any) -> Any:
    """The tree with f applied to each array; None stays None."""
    if tree is None or isinstance(tree, int):
        return tree
    if dr.is_array_v(tree):
        return f(tree)
    if isinstance(tree, tuple):
        return tuple(mapped(f, x) for x in tree)
    # Built without __init__: a table of a kind has no name, material or transform for its checks to look at.
    new = object.__new__(type(tree))
    for name, part in _parts(tree):
        object.__setattr__(new, name, mapped(f, part))
    return new


def rows(tree: Any, index: Any, active: Any = True) -> Any:
    """The entries of a table (arrays of equal width) at `index`: one row a lane, or one row in all."""
    return mapped(lambda x: dr.gather(type(x), x, index, active), tree)


def leaves(tree: Any) -> tuple:
    """The arrays of a tree, in order."""
    found: list = []
    mapped(found.append, tree)
    return tuple(found)


def rebuilt(tree: Any, arrays: tuple) -> Any:
    """The tree with its arrays replaced, in the order of `leaves`."""
    source = iter(arrays)
    return mapped(lambda _: next(source), tree)


def detached(tree: Any) -> Any:
    """The tree without derivatives."""
    return mapped(dr.detach, tree)
