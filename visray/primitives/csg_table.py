"""The numbers of CSG objects as arrays: a tree of tables with the shape of the objects' sites (csg_form.py).

The records of operands at a site are rows of one table. At a site that is written out, row i belongs to object i. At a
site inside a loop, the rows of an object, or of one turn of an outer loop, lie side by side.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import drjit as dr
import numpy as np

from visray.geometry import Frame, l1_norm
from visray.primitives.csg_bounds import Hull, Trees
from visray.primitives.csg_form import Form, Leaf, LeafSite, renumbered
from visray.primitives.csg_objects import Objects, Structure
from visray.primitives.primitive import Bounds
from visray.pytree import Packets, Shared, detached, evaluated
from visray.quantities import Arrays
from visray.transforms import composed


@dataclass(frozen=True)
class LeafTable:
    """Operands at one site.

    kind: class whose methods serve them.
    numbers: table of the kind.
    outer: their transforms; None if they have none, or if `numbers` contains them.
    number: numbers of the leaves.
    """

    kind: Any
    numbers: Any
    outer: Any
    number: Any

    @staticmethod
    def of(a: Arrays, site: LeafSite, leaves: Sequence[Leaf]) -> "LeafTable":
        """The table of several leaves at one site."""
        shapes: list = [leaf.shape for leaf in leaves]
        if site.kind.own_frames:
            shapes = [leaf.shape.body(leaf.steps) for leaf in leaves]
        outer = Frame.table(a, composed([leaf.steps for leaf in leaves])) if site.moved else None
        number = a.put(a.U, np.array([leaf.number for leaf in leaves], np.uint32))
        return LeafTable(site.kind, site.kind.table(a, shapes), outer, number)

    def placed(self) -> "PlacedLeaf":
        """The operands in the world."""
        placed, bounds = self.numbers.placed(self.outer), self.bounds
        if bounds is None:
            return PlacedLeaf(placed, self.number, dr.detach(l1_norm(placed.inverse.o)))
        return PlacedLeaf(placed, self.number, l1_norm(bounds.centre) + bounds.radius)

    @cached_property
    def bounds(self) -> Bounds | None:
        """As Primitive.bounds, without derivatives; None for unbounded kinds."""
        return evaluated(detached(self.numbers.bounds(self.outer))) if self.kind.bounded else None


@dataclass(frozen=True)
class PlacedLeaf:
    """Operands at one site, in the world.

    placed: placed data of the kind.
    number: as in LeafTable.
    size: size of world coordinates, from which rounding bounds are computed, as Batch.coordinate_bound.
    """

    placed: Any
    number: Any
    size: Any


@dataclass(frozen=True)
class Looped:
    """Children of a node that the kernel loops over.

    first, count: number of the first row, and of rows, in the table.
    most: the largest count.
    table: table of all children at this site.
    trees: the children, in Python: Trees.
    balls: balls that contain the children, or their complements: packets of centre and radius, in single. None before
        the children are placed, and for children that are unbounded, and so are their complements.
    """

    first: Any
    count: Any
    most: int
    table: Shared
    trees: Structure
    balls: Shared | None = None


def table_of(a: Arrays, site: Any, trees: Sequence[Any]) -> Any:
    """The table of several trees with one site. For a node it is a tuple with an entry for each group: a tuple of
    tables, or Looped."""
    if isinstance(site, LeafSite):
        return LeafTable.of(a, site, trees)
    groups: list[Any] = []
    for g, group in enumerate(site.groups):
        children = [tree.groups[g] for tree in trees]
        if group.size is None:
            counts = np.array([len(x) for x in children])
            firsts = np.cumsum(counts) - counts
            inner = [y for x in children for y in x]
            table = table_of(a, group.site, inner)
            numbers = (a.put(a.U, x.astype(np.uint32)) for x in (firsts, counts))
            groups.append(Looped(*numbers, int(counts.max()), Shared(table), Structure(Trees.of(inner))))
        else:
            groups.append(tuple(table_of(a, group.site, [x[k] for x in children]) for k in range(group.size)))
    return tuple(groups)


def placed_tree(a: Arrays, table: Any, hulls: Hull) -> Any:
    """The table of a site with all operands placed in the world. hulls: those of all leaves, by number."""
    if isinstance(table, LeafTable):
        return table.placed()
    if not isinstance(table, Looped):
        return tuple(placed_tree(a, x, hulls) for x in table)
    balls = packed_balls(a, table.trees.value.hulls(hulls))
    return replace(table, table=Shared(placed_tree(a, table.table.value, hulls)), balls=balls)


def packed_balls(a: Arrays, hulls: Hull) -> Shared | None:
    """The balls of children of one site, as in Looped."""
    if not np.isfinite(hulls.radius).all():
        return None
    return Shared(Packets.of(a.Q32, (a.put(a.V32, hulls.centre.T), a.put(a.F32, hulls.radius))))


def leaf_tables(table: Any) -> Iterator[Any]:
    """Yields the tables of all leaf sites in a table, in the order of `site.leaves`."""
    if isinstance(table, tuple):
        for part in table:
            yield from leaf_tables(part)
    elif isinstance(table, Looped):
        yield from leaf_tables(table.table.value)
    elif table is not None:
        yield table


@dataclass(frozen=True)
class CsgTable:
    """CSG objects of one kind, as arrays. Leaves are numbered through all objects.

    a: array types.
    objects: structures of the objects: Objects.
    surface, within: tables of the sites of the surface, and of the points at which it is kept; None if all of it is.
    site_of, row_of: for each leaf, the number of its site, and its row in the table of this site.
    """

    a: Arrays
    objects: Structure
    surface: Any
    within: Any
    site_of: Any
    row_of: Any

    @staticmethod
    def of(a: Arrays, forms: Sequence[Form]) -> "CsgTable":
        """The table of several objects with equal sites."""
        counts = np.array([len(form.leaves) for form in forms])
        firsts = (np.cumsum(counts) - counts).tolist()
        both = [
            None if trees[0] is None else [renumbered(tree, first) for tree, first in zip(trees, firsts)]
            for trees in ([form.surface for form in forms], [form.within for form in forms])
        ]
        surface, within = (trees and table_of(a, trees[0].site, trees) for trees in both)
        objects = Objects.of(forms, *both)
        site_of, row_of = np.zeros((2, counts.sum()), np.uint32)
        for site, table in enumerate(leaf_tables((surface, within))):
            numbers = np.array(table.number)
            site_of[numbers], row_of[numbers] = site, np.arange(len(numbers))
        return CsgTable(a, Structure(objects), surface, within, a.put(a.U, site_of), a.put(a.U, row_of))

    def placed(self, outer: None) -> "PlacedCsg":
        """The objects in the world. Their operands have transforms of their own, so `outer` is None."""
        hulls = self._hulls
        surface, within = (None if x is None else placed_tree(self.a, x, hulls) for x in (self.surface, self.within))
        number = dr.arange(self.a.U, len(self)) + dr.opaque(self.a.U, 0)
        largest = np.zeros(len(self.site_of))
        for leaf in leaf_tables((surface, within)):
            largest[np.array(leaf.number)] = np.array(leaf.size)
        size = self.a.put(self.a.D, np.maximum.reduceat(largest, self.objects.value.firsts()))
        return PlacedCsg(number, surface, within, size, Shared((surface, within)), Shared(self.site_of),
                         Shared(self.row_of), Shared(dr.opaque(self.a.U, len(self.site_of))))  # fmt: skip

    def leaf(self, row: int, number: int) -> tuple[LeafTable, int]:
        """The table that contains a leaf, and its row there.

        row: row of the object. number: the leaf's number in the object.
        """
        number += int(self.objects.value.firsts()[row])
        tables = list(leaf_tables((self.surface, self.within)))
        return tables[int(self.site_of[number])], int(self.row_of[number])

    def __len__(self) -> int:
        return len(self.objects.value.counts)

    @cached_property
    def _hulls(self) -> Hull:
        """The hulls of all leaves, by number."""
        hulls = Hull.everywhere(len(self.site_of))
        for table in leaf_tables((self.surface, self.within)):
            if (bounds := table.bounds) is not None:
                number = np.array(table.number)
                hulls.radius[number] = np.array(bounds.radius)
                for name in ("low", "high", "centre"):
                    # Component by component, because a whole matrix would compile a kernel for each number of rows.
                    for axis, x in enumerate(getattr(bounds, name)):
                        getattr(hulls, name)[number, axis] = np.array(x)
        return hulls

    def bounds(self, outer: None) -> Bounds:
        """As Primitive.bounds. An empty object has a box of one point."""
        objects, of_leaves = self.objects.value, self._hulls
        trees = [x for x in (objects.surface, objects.within) if x is not None]
        hull = Hull.beside([x.hulls(of_leaves, complements=False) for x in trees]).intersection()
        # An empty object has low > high. Its box is then one point.
        empty = hull.is_empty()[:, None]
        low, high = np.where(empty, hull.centre, hull.low), np.where(empty, hull.centre, hull.high)
        put = self.a.put
        return Bounds(*(put(self.a.W, x.T) for x in (low, high, hull.centre)), put(self.a.D, hull.radius))


@dataclass(frozen=True)
class PlacedCsg:
    """CSG objects in the world.

    number: number of the object.
    surface, within: tables of the sites, with their operands placed.
    size: as PlacedLeaf.size, of the largest operand.
    all: the tables once more, for lookups of operands by number.
    site_of, row_of: as in CsgTable.
    count: number of all leaves.
    """

    number: Any
    surface: Any
    within: Any
    size: Any
    all: Shared
    site_of: Shared
    row_of: Shared
    count: Shared
