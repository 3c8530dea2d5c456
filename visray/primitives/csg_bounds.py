"""Bounding boxes of CSG objects, in NumPy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from visray.primitives.csg_form import Form, Leaf
from visray.primitives.primitive import scalars, transform_frame


@dataclass(frozen=True)
class Hull:
    """A box and a ball that contain an object.

    low, high: corners of the box; infinite where the object is unbounded, and low > high in some axis if it is empty.
    centre, radius: the ball.
    """

    low: np.ndarray
    high: np.ndarray
    centre: np.ndarray
    radius: float

    @staticmethod
    def of_box(low: np.ndarray, high: np.ndarray) -> "Hull":
        """The hull of a box."""
        if not np.isfinite([low, high]).all():
            return Hull(low, high, np.zeros(3), np.inf)
        return Hull(low, high, 0.5 * (low + high), float(np.linalg.norm(np.maximum(0.5 * (high - low), 0))))

    @property
    def is_empty(self) -> bool:
        """Whether the box is empty."""
        return bool((self.low > self.high).any())

    def with_ball(self, centre: np.ndarray, radius: float) -> "Hull":
        """The same box with another ball, if this is smaller."""
        return Hull(self.low, self.high, centre, radius) if radius < self.radius else self

    def intersection(self, other: "Hull") -> "Hull":
        """A hull of the intersection of what two hulls contain."""
        hull = Hull.of_box(np.maximum(self.low, other.low), np.minimum(self.high, other.high))
        return hull.with_ball(self.centre, self.radius).with_ball(other.centre, other.radius)

    @staticmethod
    def union(hulls: Sequence["Hull"]) -> "Hull":
        """A hull of the union of what some hulls contain."""
        hulls = [hull for hull in hulls if not hull.is_empty] or list(hulls[:1])
        hull = Hull.of_box(np.min([h.low for h in hulls], axis=0), np.max([h.high for h in hulls], axis=0))
        if not np.isfinite(hull.radius):
            return hull
        return hull.with_ball(hull.centre, max(np.linalg.norm(h.centre - hull.centre) + h.radius for h in hulls))


EVERYWHERE = Hull.of_box(np.full(3, -np.inf), np.full(3, np.inf))


def hull_of(form: Form) -> Hull:
    """The hull of an object."""
    return joined_hull(form, {leaf.number: leaf_hull(leaf) for leaf in form.leaves})


def joined_hull(form: Form, hulls: Mapping[int, Hull]) -> Hull:
    """As `hull_of`. hulls: those of the bounded operands, by the numbers of their leaves."""
    hulls = [EVERYWHERE if tree is None or tree.site.outside else hull_of_tree(tree, hulls)
             for tree in (form.surface, form.within)]  # fmt: skip
    return hulls[0].intersection(hulls[1])


def hull_of_tree(tree: Any, hulls: Mapping[int, Hull]) -> Hull:
    """The hull of a tree; that of its complement, if points far away are meant."""
    if isinstance(tree, Leaf):
        return hulls.get(tree.number, EVERYWHERE)
    outside = tree.site.outside
    inner = [hull_of_tree(x, hulls) for x in tree.children if x.site.outside == outside]
    return reduce(Hull.intersection, inner) if tree.both != outside else Hull.union(inner)


def leaf_hull(leaf: Leaf) -> Hull:
    """The hull of an operand."""
    shape = leaf.shape.with_fields(transform=leaf.steps)
    if not shape.bounded:
        return EVERYWHERE
    bounds = scalars(shape).bounds(transform_frame(shape))
    low, high, centre = (np.array(x, float) for x in (bounds.low, bounds.high, bounds.centre))
    return Hull(low, high, centre, float(bounds.radius))
