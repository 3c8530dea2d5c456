"""Bounding boxes of CSG objects, in NumPy."""

from dataclasses import replace
from typing import Any

import numpy as np

from visray.primitives.csg_form import Form, Leaf
from visray.primitives.primitive import bounding_box

EVERYWHERE = np.full(3, -np.inf), np.full(3, np.inf)


def box_of(form: Form) -> tuple[np.ndarray, np.ndarray]:
    """(low, high) corner of the bounding box of an object; low > high in some axis if the object is empty.

    Error: rounding.
    """
    boxes = {leaf.number: _leaf_box(leaf) for leaf in form.leaves}
    return joined_box(form, boxes)


def joined_box(form: Form, boxes: dict[int, tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """As `box_of`. boxes: those of the operands, by the numbers of their leaves."""
    low, high = _box(form.surface, boxes)
    if form.within is not None:
        inner_low, inner_high = _box(form.within, boxes)
        low, high = np.maximum(low, inner_low), np.minimum(high, inner_high)
    return low, high


def _box(tree: Any, boxes: dict) -> tuple[np.ndarray, np.ndarray]:
    """The box of a tree."""
    if isinstance(tree, Leaf):
        return EVERYWHERE if tree.negated or not tree.shape.operand_kind.bounded else boxes[tree.number]
    low, high = (np.array(x) for x in zip(*(_box(x, boxes) for x in tree.children)))
    return (low.max(0), high.min(0)) if tree.both else (low.min(0), high.max(0))


def _leaf_box(leaf: Leaf) -> tuple[np.ndarray, np.ndarray]:
    """The box of an operand."""
    return bounding_box(replace(leaf.shape, transform=leaf.steps)) or EVERYWHERE
