"""Bounding boxes of CSG objects, in NumPy, for many objects at once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.geometry import Frame
from visray.primitives.csg_form import Form, Leaf
from visray.primitives.primitive import scalars
from visray.transforms import composed

_FIELDS = ("low", "high", "centre", "radius")


@dataclass(frozen=True)
class Hull:
    """Boxes and balls that contain objects: arrays with an entry for each object. Shapes: (..., 3), radius (...).

    low, high: corners of the boxes; infinite where an object is unbounded, and low > high in some axis if it is empty.
    centre, radius: the balls.
    """

    low: np.ndarray
    high: np.ndarray
    centre: np.ndarray
    radius: np.ndarray

    @staticmethod
    def everywhere(*shape: int) -> "Hull":
        """The hulls of unbounded objects."""
        infinite = np.full((*shape, 3), np.inf)
        return Hull(-infinite, infinite, np.zeros((*shape, 3)), np.full(shape, np.inf))

    @staticmethod
    def of_box(low: np.ndarray, high: np.ndarray) -> "Hull":
        """The hulls of boxes."""
        bounded = np.isfinite(low).all(axis=-1) & np.isfinite(high).all(axis=-1)
        a, b = (np.where(bounded[..., None], x, 0.0) for x in (low, high))
        radius = np.linalg.norm(np.maximum(0.5 * (b - a), 0), axis=-1)
        return Hull(low, high, 0.5 * (a + b), np.where(bounded, radius, np.inf))

    @staticmethod
    def beside(hulls: Sequence["Hull"]) -> "Hull":
        """Several hulls of equal shapes along a new last axis."""
        return Hull(*(np.stack([getattr(x, k) for x in hulls], axis=a) for k, a in zip(_FIELDS, (-2, -2, -2, -1))))

    def mapped(self, f: Any) -> "Hull":
        """The hulls with a function applied to each array; the radius is given to it with a last axis of size 1."""
        return Hull(f(self.low), f(self.high), f(self.centre), f(self.radius[..., None])[..., 0])

    def where(self, mask: np.ndarray, other: "Hull") -> "Hull":
        """These hulls where the mask is true, and the others elsewhere."""
        box = mask[..., None]
        low, high, centre = (np.where(box, getattr(self, k), getattr(other, k)) for k in ("low", "high", "centre"))
        return Hull(low, high, centre, np.where(mask, self.radius, other.radius))

    def is_empty(self) -> np.ndarray:
        """Mask of the empty boxes."""
        return (self.low > self.high).any(axis=-1)

    def intersection(self) -> "Hull":
        """Hulls of the intersections of what the hulls along the last axis contain. Domain: two axes."""
        hull = Hull.of_box(self.low.max(axis=1), self.high.min(axis=1))
        least = np.arange(len(self.radius)), self.radius.argmin(axis=1)
        ball = self.mapped(lambda x: x[least])
        return replace(ball, low=hull.low, high=hull.high).where(ball.radius < hull.radius, hull)

    def union(self) -> "Hull":
        """Hulls of the unions of what the hulls along the last axis contain."""
        left_out = self.is_empty()
        left_out[..., 0] &= ~left_out.all(axis=-1)
        low, high = (np.where(left_out[..., None], x, y) for x, y in ((np.inf, self.low), (-np.inf, self.high)))
        hull = Hull.of_box(low.min(axis=-2), high.max(axis=-2))
        reach = np.linalg.norm(self.centre - hull.centre[..., None, :], axis=-1) + self.radius
        return replace(hull, radius=np.minimum(hull.radius, np.where(left_out, 0.0, reach).max(axis=-1)))


@dataclass(frozen=True)
class Trees:
    """Trees of several objects. Equal trees, apart from the numbers of their leaves, are stored once.

    groups: for each different tree: the tree, the numbers of the objects that have it, and for each of these what is
        added to the numbers of the leaves.
    """

    groups: tuple[tuple[Any, np.ndarray, np.ndarray], ...]

    @staticmethod
    def of(trees: Sequence[Any]) -> "Trees":
        """The trees of several objects, in order."""
        found: dict[Any, tuple[Any, list[int], list[int]]] = {}
        for i, tree in enumerate(trees):
            first = _first_leaf(tree)
            tree, objects, starts = found.setdefault(_pattern(tree, first), (tree, [], []))
            objects.append(i)
            starts.append(first - _first_leaf(tree))
        return Trees(tuple((tree, np.array(i), np.array(starts)) for tree, i, starts in found.values()))

    def repeated(self, count: int, trees: int, leaves: int) -> "Trees":
        """All trees so many times, one sequence after the other. trees, leaves: number of trees and of leaves of one
        sequence."""
        turn = np.arange(count)[:, None]
        return Trees(tuple((t, (turn * trees + i).ravel(), (turn * leaves + s).ravel()) for t, i, s in self.groups))

    def hulls(self, of_leaves: Hull, complements: bool = True) -> Hull:
        """The hulls of the trees.

        of_leaves: those of all operands, by the numbers of their leaves.
        complements: whether trees that mean points far away have the hulls of their complements. Otherwise they are
            unbounded.
        """
        found = Hull.everywhere(sum(len(objects) for _, objects, _ in self.groups))
        for tree, objects, starts in self.groups:
            if complements or not tree.site.outside:
                hull = _hulls(tree, starts, of_leaves)
                for name, x in vars(found).items():
                    x[objects] = getattr(hull, name)
        return found


def _first_leaf(tree: Any) -> int:
    """Number of one leaf of a tree, the same one for equal trees."""
    while not isinstance(tree, Leaf):
        tree = tree.groups[0][0]
    return tree.number


def _pattern(tree: Any, first: int) -> tuple:
    """A tuple that is the same for trees that differ only in what is added to the numbers of their leaves. first: the
    number of one leaf, subtracted from all."""
    if isinstance(tree, Leaf):
        return tree.number - first, tree.negated
    return tree.both, *(_pattern(x, first) for x in tree.children)


def _hulls(tree: Any, starts: np.ndarray, of_leaves: Hull) -> Hull:
    """The hulls of equal trees; those of their complements, if points far away are meant.

    starts: numbers that are added to those of the leaves.
    of_leaves: as in Trees.hulls.
    """
    if isinstance(tree, Leaf):
        return of_leaves.mapped(lambda x: x[starts + tree.number])
    outside = tree.site.outside
    chosen = [x for x in tree.children if x.site.outside == outside]
    leaves = np.array([x.number for x in chosen if isinstance(x, Leaf)], int)
    inner = [_hulls(x, starts, of_leaves).mapped(lambda y: y[:, None]) for x in chosen if not isinstance(x, Leaf)]
    parts = [*inner, of_leaves.mapped(lambda x: x[starts[:, None] + leaves])]
    children = Hull(*(np.concatenate([getattr(x, k) for x in parts], axis=1) for k in _FIELDS))
    return children.intersection() if tree.both != outside else children.union()


def hull_of(form: Form) -> Hull:
    """The hull of one object. Shapes: (3) and ()."""
    of_leaves, start = hulls_of(form.leaves), np.zeros(1, int)
    trees = [x for x in (form.surface, form.within) if x is not None and not x.site.outside]
    hulls = [_hulls(x, start, of_leaves) for x in trees] or [Hull.everywhere(1)]
    hull = hulls[0] if len(hulls) == 1 else Hull.beside(hulls).intersection()
    return hull.mapped(lambda x: x[0])


def hulls_of(leaves: Sequence[Leaf]) -> Hull:
    """The hulls of operands."""
    matrices = composed([leaf.steps for leaf in leaves])
    return Hull.beside([_leaf_hull(leaf, matrix) for leaf, matrix in zip(leaves, matrices)])


def _leaf_hull(leaf: Leaf, matrix: np.ndarray) -> Hull:
    """The hull of an operand. matrix: that of its steps. Shapes: (3) and ()."""
    shape = leaf.shape.with_fields(transform=leaf.steps)
    if not shape.bounded:
        return Hull.everywhere()
    outer = Frame(*(dr.scalar.Array3f64(*column) for column in matrix.T)) if leaf.steps else None
    bounds = scalars(shape).bounds(outer)
    low, high, centre = (np.array(x, float) for x in (bounds.low, bounds.high, bounds.centre))
    return Hull(low, high, centre, np.array(float(bounds.radius)))
