"""The kernel's side of CSG objects: one class for each structure (csg_form.py)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import drjit as dr
import numpy as np

from visray.primitives.csg_form import Form, Group, LeafSite
from visray.primitives.csg_leaves import FLUSH
from visray.primitives.csg_table import CsgTable, Looped, PlacedCsg, PlacedLeaf, leaf_tables
from visray.primitives.csg_walk import Walk
from visray.primitives.primitive import Primitive
from visray.pytree import detached, leaves, rows
from visray.quantities import Arrays
from visray.ray import Crossing, KnownEnds, Ray

# Number of points that measure a volume.
VOLUME_POINTS = 2**18


@dataclass(frozen=True)
class SeenCsg:
    """CSG objects, and the ray origin o in world space.

    leaves: seen data of all leaves that are not in loops, in the order of their sites.
    """

    placed: PlacedCsg
    o: Any
    leaves: tuple


class CsgBody(Primitive):
    """CSG objects with one structure. The part of a hit is a code: the number of the leaf, followed by `bits` bits of
    the leaf's own part.

    Facts about a kind, besides those of Primitive:
    sites: sites of the surface, and of the points at which it is kept; None if all of it is.
    bits: number of bits of a code for the leaf's own part.
    """

    composite = True
    own_frames = True
    walks = True
    turns_at_end = True
    uses_part = True
    parts = 1 << 31
    max_crossings = 1 << 16
    # They have no type annotations, because an annotation would make them fields of the scene.
    sites = bits = None

    @staticmethod
    def kind_of(form: Form) -> "type[CsgBody]":
        """The class of all objects with the structure of a form."""
        return _kind(form.surface.site, None if form.within is None else form.within.site, form.closed, form.part_bits)

    @classmethod
    def leaf_sites(cls) -> tuple[LeafSite, ...]:
        """All places for leaves, in order."""
        return tuple(leaf for site in cls.sites if site is not None for leaf in site.leaves)

    @staticmethod
    def table(a: Arrays, objects: list) -> CsgTable:
        return CsgTable.of(a, [x.form for x in objects])

    @classmethod
    def seen(cls, placed: PlacedCsg, o: Any) -> SeenCsg:
        found: list[Any] = []

        def visit(site: Any, table: Any) -> None:
            if isinstance(site, LeafSite):
                found.append(site.kind.seen(table.placed, o))
                return
            for group, part in zip(site.groups, table):
                for x in () if isinstance(part, Looped) else part:
                    visit(group.site, x)

        for site, table in zip(cls.sites, (placed.surface, placed.within)):
            if site is not None:
                visit(site, table)
        return SeenCsg(placed, o, tuple(found))

    @classmethod
    def crossing(cls, seen: SeenCsg, ray: Ray, begin: Any, end: Any, known: KnownEnds) -> Crossing:
        if known.on_start is not None and known.start_part is None:
            p = dr.fma(begin, ray.d, seen.o)
            known = replace(known, start_part=cls.part_at(seen.placed, p, known.on_start))
        met, t, part, enters, unresolved = Walk(cls.bits, seen, ray, begin, known).run(cls.sites, end)
        if known.on_end is not None:
            # A crossing that lies at the end to within rounding is the end itself.
            distance = dr.select(known.on_end, end, 0)
            f, g = cls.surface_at(seen.placed, dr.fma(distance, ray.d, seen.o), dr.select(met, part, 0))
            error = FLUSH * (distance + seen.placed.size) + (0 if known.end_error is None else known.end_error)
            near_end = dr.select(met, end - t, dr.inf) <= error**0.5
            met &= ~(known.on_end & near_end & (dr.abs(f) <= error * dr.norm(g)))
        return Crossing(met, dr.select(met, t, dr.inf), part, enters, unresolved)

    @classmethod
    def inside(cls, placed: PlacedCsg, p: Any) -> Any:
        def of(site: LeafSite, leaf: PlacedLeaf) -> tuple:
            return (site.kind.inside(leaf.placed, p) ^ site.negated,)

        def join(both: bool, x: tuple, y: tuple) -> tuple:
            return (x[0] & y[0] if both else x[0] | y[0],)

        lanes, b = cls._lanes(placed, p), dr.mask_t(p.x)
        return _folded(cls.sites[0], placed.surface, of, join, lambda both: (dr.full(b, both, lanes),))[0]

    @classmethod
    def surface_at(cls, placed: PlacedCsg, p: Any, part: Any = None) -> tuple[Any, Any]:
        return cls._of_leaf(placed, p, part, lambda site, leaf, own: _surface_at(site, leaf, p, own))

    @classmethod
    def uv(cls, placed: PlacedCsg, p: Any, part: Any = None) -> tuple[Any, Any]:
        return cls._of_leaf(placed, p, part, lambda site, leaf, own: site.kind.uv(leaf, p, own))

    @classmethod
    def shading_normal(cls, placed: PlacedCsg, p: Any, part: Any = None) -> Any:
        def normal(site: LeafSite, leaf: Any, own: Any) -> tuple:
            if not site.kind.bends_normals:
                return (dr.normalize(_surface_at(site, leaf, p, own)[1]),)
            n = site.kind.shading_normal(leaf, p, own)
            return (-n if site.negated else n,)

        return cls._of_leaf(placed, p, part, normal)[0]

    @classmethod
    def part_at(cls, placed: PlacedCsg, p: Any, active: Any = True) -> Any:
        """The part of the surface that is nearest to a point p. Its own part of a mesh is no triangle.

        active: mask of the lanes that need it. Others get 0, and packets without an active lane visit no operand.
        """
        placed, p = detached((placed, p))
        if active is True:
            return cls._nearest_part(placed, p)
        lanes = max(cls._lanes(placed, p), dr.width(active))
        nothing = dr.zeros(dr.uint32_array_t(p.x), lanes)
        return dr.if_stmt(
            (nothing,), active, lambda *_: (cls._nearest_part(placed, p) + nothing,), lambda *old: old, label="part"
        )[0]

    @classmethod
    def _nearest_part(cls, placed: PlacedCsg, p: Any) -> Any:
        """As part_at, for all lanes."""
        d, lanes = type(p.x), cls._lanes(placed, p)
        u = dr.uint32_array_t(d)

        def of(site: LeafSite, leaf: PlacedLeaf) -> tuple:
            f, g = _surface_at(site, leaf.placed, p, None)
            if site.kind.own_frames:
                own = u((1 << cls.bits) - 1)
            else:
                own = site.kind.nearest_part(leaf.placed, p) if site.kind.uses_part else u(0)
            if site.kind.closed:
                # f has the right sign only near the surface: a cone has a mirror image, and a mesh is endlessly far.
                inside = site.kind.inside(leaf.placed, p) ^ site.negated
                f = dr.select(inside, -dr.abs(f), dr.abs(f))
            return f / dr.norm(g), (leaf.number << cls.bits) | own

        def join(both: bool, x: tuple, y: tuple) -> tuple:
            takes_x = x[0] > y[0] if both else x[0] < y[0]
            return tuple(dr.select(takes_x, a, b) for a, b in zip(x, y))

        def neutral(both: bool) -> tuple:
            return dr.full(d, -dr.inf if both else dr.inf, lanes), dr.zeros(u, lanes)

        return _folded(cls.sites[0], placed.surface, of, join, neutral)[1]

    @classmethod
    def leaf_number(cls, part: Any) -> Any:
        """Number of the leaf of a hit, among the leaves of the batch. part: the part of the hit."""
        return part >> cls.bits if cls.bits else part

    @classmethod
    def volumes(cls, table: CsgTable, outer: None) -> tuple[Any, Any]:
        """As Primitive.volumes: the share of points of the bounding box that are inside. Objects that differ by their
        transforms alone are measured once.

        Error: five standard errors of as many random points. The points are more even than random ones
        (tests/test_nesting.py).
        """
        if not cls.bounded:
            endless = np.full(len(table), np.inf)
            return endless, np.zeros_like(endless)
        a, placed, bounds = table.a, detached(table.placed(None)), table.bounds(None)
        low, side = bounds.low, bounds.high - bounds.low
        point = a.put(a.W, even_points(VOLUME_POINTS).T)
        originals, factors = table.objects.value.originals(), table.objects.value.factors
        share = np.zeros(len(table))
        for i in np.unique(originals):
            row = dr.opaque(a.U, int(i), VOLUME_POINTS)
            p = rows(low, row) + rows(side, row) * point
            share[i] = dr.mean(dr.select(cls.inside(rows(placed, row), p), a.D(1), 0))[0]
        # Two points inside and two outside are added, so that the error is not 0 if there are none of one kind.
        likely = (share * VOLUME_POINTS + 2) / (VOLUME_POINTS + 4)
        box = np.array(side.x * side.y * side.z)
        error = 5 * np.sqrt(likely * (1 - likely) / VOLUME_POINTS)
        scale = factors / factors[originals]
        return tuple((x * box)[originals] * scale for x in (share, error))

    @staticmethod
    def _lanes(placed: PlacedCsg, p: Any) -> int:
        """Number of lanes of a query at points p."""
        return max(dr.width(p), dr.width(placed.number))

    @classmethod
    def _of_leaf(cls, placed: PlacedCsg, p: Any, part: Any, value: Callable) -> tuple:
        """The values of one leaf for each lane, a tuple of arrays.

        p: a point of the surface.
        part: the part on which it lies; None for the nearest part.
        value(site, placed, own): function that returns the values of a leaf. own: the leaf's own part; None for the
            nearest one.
        """
        nearest = part is None
        part = cls.part_at(placed, p) if nearest else part
        number, sites = cls.leaf_number(part), cls.leaf_sites()
        number = dr.select(number < placed.count.value, number, 0)
        u = type(number)
        site_of, row_of = (dr.gather(u, x.value, number) for x in (placed.site_of, placed.row_of))
        found, attached = None, dr.grad_enabled(leaves((placed, p), shared=True))
        for k, (site, table) in enumerate(zip(sites, leaf_tables(placed.all.value))):
            there = site_of == k

            def of(*_: Any, site: LeafSite = site, table: Any = table, there: Any = there) -> tuple:
                leaf = rows(table.placed, dr.select(there, row_of, 0))
                # Parts of other leaves may be none of this one: there, memory behind its triangles would be read.
                own = None if nearest or not site.kind.uses_part else dr.select(there, part & ((1 << cls.bits) - 1), 0)
                return tuple(value(site, leaf, own))

            if found is None:
                found = of()
            elif attached or dr.grad_enabled(found):
                # Branches do not carry derivatives of values from outside of a loop (interaction.py).
                found = tuple(dr.select(there, new, old) for new, old in zip(of(), found))
            else:
                found = dr.if_stmt(found, there, of, lambda *old: old, label="operand")
        return found


def _surface_at(site: LeafSite, placed: Any, p: Any, own: Any) -> tuple[Any, Any]:
    """As Primitive.surface_at, for a leaf; turned where its complement is meant. own: its own part, or None."""
    f, g = site.kind.surface_at(placed, p, own)
    return (-f, -g) if site.negated else (f, g)


def _folded(site: Any, table: Any, of: Callable, join: Callable, neutral: Callable) -> tuple:
    """The values of a tree, a tuple of arrays.

    of(site, leaf): function that returns the values of a leaf.
    join(both, x, y): function that returns the values of the intersection of two sets if `both`, else of their union.
    neutral(both): function that returns the values that `join` leaves out.
    """
    if isinstance(site, LeafSite):
        return of(site, table)
    found = neutral(site.both)
    for group, part in zip(site.groups, table):
        if not isinstance(part, Looped):
            for x in part:
                found = join(site.both, found, _folded(group.site, x, of, join, neutral))
            continue

        def step(i: Any, *found: Any, group: Group = group, part: Looped = part) -> tuple:
            child = rows(part.table.value, part.first + i)
            return i + 1, *join(site.both, found, _folded(group.site, child, of, join, neutral))

        start = dr.zeros(type(part.first), max(map(dr.width, found))), *found
        more = lambda i, *_, part=part: i < part.count  # noqa: E731 - the condition
        found = dr.while_loop(start, more, step, label="operands")[1:]
    return found


def even_points(count: int) -> np.ndarray:
    """Points that fill the unit cube evenly. Shape: (count, 3).

    Source: Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018: multiples of powers of 1 / g, where
    g is the root of g^4 = g + 1.
    """
    g = 1.2207440846057596
    return (0.5 + np.arange(1, count + 1)[:, None] / g ** np.arange(1, 4)) % 1


@cache
def _kind(surface: Any, within: Any, closed: bool, bits: int) -> type[CsgBody]:
    """The class of objects with these sites. The arguments are facts about the kind (CsgBody)."""
    kinds = [leaf.kind for site in (surface, within) if site is not None for leaf in site.leaves]
    facts = {
        "sites": (surface, within),
        "closed": closed,
        "bits": bits,
        "bounded": any(site is not None and site.localized and not site.outside for site in (surface, within)),
        "finds_roots": any(kind.finds_roots for kind in kinds),
        "bends_normals": any(kind.bends_normals for kind in kinds),
        "v_ends": any(kind.v_ends for kind in kinds),
    }
    return type("CsgBody", (CsgBody,), facts)
