"""Ray origins: the data of rows that depends on the point where rays start, but not on their directions.

A row is one object in the kernel's tables. A batch is a set of rows of one kind, which share code. A lane is one entry
of a Dr.Jit array; here it is one ray.

A ray meets only few rows. The guard of a row is a test in single precision that rejects most other rays (culling.py).
It never rejects a ray that hits in the exact test, which is in double.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import drjit as dr
import numpy as np

from visray.accel import policy
from visray.accel.bvh import Tree, build
from visray.accel.bvh_rows import tree_rows
from visray.accel.cell_views import CellView
from visray.accel.culling import BallGuard, DirectionCone, PlaneGuard, ball_guard, plane_guard, point_rounding, touches
from visray.accel.lists import points, row_lists
from visray.accel.parallel_lists import ParallelLists, Place
from visray.batches import Batch
from visray.pytree import detached, evaluated, leaves, rows
from visray.quantities import Arrays
from visray.ray import KnownEnds, Ray


@dataclass(frozen=True)
class ListCache:
    """The lists of a geometry, so that a new frame builds only those of an origin or a direction that has moved.

    current: the lists that are in use. Key: what they were built for, as bytes.
    previous: the lists of the frame before.
    """

    current: dict[tuple, Any] = field(default_factory=dict)
    previous: dict[tuple, Any] = field(default_factory=dict)

    def get(self, build: Callable, *arguments: Any) -> Any:
        """The result of `build`, a function without arguments, from the cache if there is one.

        arguments: arrays and flags that determine the result
        """
        key = tuple(np.asarray(x).tobytes() for x in arguments)
        if key not in self.current:
            self.current[key] = self.previous[key] if key in self.previous else build()
        return self.current[key]


@dataclass(frozen=True)
class Geometry:
    """Everything that rays can hit.

    a: the Dr.Jit array types of the backend.
    batches: the batches of the scene.
    accelerator: the value of settings.accelerator.
    lists: the lists of rows that were built.
    """

    a: Arrays
    batches: tuple[Batch, ...]
    accelerator: policy.Accelerator = "auto"
    lists: ListCache = field(default_factory=ListCache)

    def with_looks(self, batches: tuple[Batch, ...]) -> "Geometry":
        """The same geometry for a new frame. batches: the same batches, whose materials may be others."""
        # Lists that nobody has asked for in this frame yet are those of the frame before.
        lists = ListCache(previous=self.lists.current or self.lists.previous)
        geometry = replace(self, batches=batches, lists=lists)
        if "tree" in vars(self):
            vars(geometry)["tree"] = self.tree
        return geometry

    @cached_property
    def searched(self) -> tuple[Batch, ...]:
        """The batches without derivatives, as rays search them."""
        return detached(self.batches)

    @cached_property
    def tree(self) -> Tree | None:
        """The bounding volume hierarchy over some of the batches (policy.Plan.tree); None if the plan puts no batch in
        it. It is built when it is first asked for, because many scenes have no rays that use it."""
        # Every batch that is in the tree for rays with a shared origin is also in the tree for other rays.
        in_tree = self.plan("nothing").tree
        if not in_tree:
            return None
        return evaluated(build(self.a, {i: tree_rows(self.batches[i]) for i in in_tree}))

    def plan(self, shared: policy.SharedBy) -> policy.Plan:
        """The plan of how rays find rows. shared: what all rays share."""
        sizes = [policy.BatchSize(len(b), b.kind.bounded) for b in self.batches]
        return policy.plan(sizes, self.accelerator, shared)

    @property
    def has_parts(self) -> bool:
        """Whether a hit needs a part number, because some kind has several parts."""
        return any(b.kind.parts > 1 for b in self.batches)


@dataclass(frozen=True)
class Candidate:
    """A row to be tested by each lane. Different lanes may have different rows of the same batch.

    batch: number of the row's batch, a Python number.
    row: number of the row in its batch.
    index: number of the row among all rows of the scene.
    present: mask of the lanes that have a row to test; True for all lanes.
    unrolled: number of the row in its batch as a Python number, if the test is unrolled and all lanes have the same
        row; else None.
    """

    batch: int
    row: Any
    index: Any
    present: Any
    unrolled: int | None = None


def _touching(batch: Batch, o: Any) -> tuple[Any, Any] | None:
    """The rows of a batch on whose surface the origin o lies, to within rounding.

    The result is (mask with one entry per row, gradients of all rows at o); None if o lies on no row.

    A ray from o does not find its crossing with such a row at o, whatever the sign of the computed distance. Whether
    the mask exists is part of the kernel's structure: if a camera or a light moves onto a surface, a new kernel is
    compiled.
    """
    f, g = batch.kind.surface_at(batch.placed, o)
    on = touches(batch, f, g, o) & batch.kind.has_normal(batch.placed, o)
    return (on, g) if np.any(np.array(on)) else None


class RayOrigin:
    """The origin of rays, with the data of all batches that depends on the origin.

    o: the origins. Shape: (3, 1), or (3, lanes).
    shared: whether all rays start at one point. Then the data of all unrolled rows is computed once, and kernels read
        it. The default None means: True if `o` has one entry.
    views: sheets that contain the directions of all rays; None for all directions. They are used only if all rays start
        at one point.
    far: whether all rays start at one point that is so far away that they use lists for parallel rays (`along`).
    lists: for each batch in lists (policy.Plan.lists), the lists of its rows; None for other batches.
    place: place of parallel rays on the sheet of their lists (`along`); None for other rays.
    may_reach: for each row of each unrolled batch, whether some ray of a cone may hit the row; None without a cone.
    """

    def __init__(
        self, geometry: Geometry, o: Any, shared: bool | None = None, views: tuple[CellView, ...] | None = None,
        far: bool = False,
    ):  # fmt: skip
        self.a, self.o, self.geometry = geometry.a, dr.detach(o), geometry
        self.batches = geometry.searched
        self.shared = dr.width(o) == 1 if shared is None else shared
        self.plan = geometry.plan("origin" if self.shared else "nothing")
        unrolled = [i in self.plan.unrolled for i in range(len(self.batches))]
        self.may_reach: list[list[Any]] | None = None
        self.place: Place | None = None
        if self.shared:
            self.seen = tuple(
                b.kind.seen(b.placed, self.o) if prepared else None for b, prepared in zip(self.batches, unrolled)
            )
            self.guards = tuple(self._guard(b) if prepared else None for b, prepared in zip(self.batches, unrolled))
            # A guard is four floats. They are stored side by side, so that a loop reads them at once.
            self.guard_packets = tuple(g and dr.ravel(self.a.Q32(*leaves(g)[0], leaves(g)[1])) for g in self.guards)
            evaluated((self.seen, self.guards, self.guard_packets))
            self.touching = tuple(_touching(b, self.o) for b in self.batches)
            listed = () if far else self.plan.lists
            sheets = [x for v in views or () for x in (v.right, v.up, v.forward, v.low, v.high)]
            build = partial(row_lists, self.a, self.batches, listed, self.o, views)
            self.lists = geometry.lists.get(build, "origin", points(self.o), listed, *sheets)
        else:
            # Guards are computed here and not for each ray, so that a loop over rays with this origin computes them
            # only once.
            self.row_guards = [
                [self._guard(b.rows_at(self.a.U(i))) for i in range(len(b) if prepared else 0)]
                for b, prepared in zip(self.batches, unrolled)
            ]

    def _guard(self, batch: Batch) -> BallGuard | PlaneGuard:
        """The guards of the rows of a batch."""
        if batch.radius is None:
            return plane_guard(self.a, batch, self.o)
        return ball_guard(self.a, batch.centre, batch.radius, self.o)

    def along(self, lists: ParallelLists | None, p: Any = None) -> "RayOrigin":
        """A copy of the origin, for parallel rays that find rows in lists. If `lists` is None, the origin itself.

        p: points that the rays reach, if they come from a far light; None: the rays start at their own origins
        """
        if lists is None:
            return self
        origin = copy(self)
        origin.plan, origin.lists = self.geometry.plan("direction"), lists.batches
        origin.parallel, origin.place = lists, lists.place(self.a, self.o if p is None else dr.detach(p))
        return origin

    def farthest(self, t: Any) -> Any:
        """The bound on `near` of rows in lists for rays up to the distance t, in single."""
        return t if self.place is None else self.parallel.farthest(self.place, t)

    def touches_rows(self, batch: int) -> bool:
        """Whether a shared origin lies on some row of a batch."""
        return self.shared and self.touching[batch] is not None

    def toward(self, cone: DirectionCone) -> "RayOrigin":
        """A copy of the origin, for rays whose directions lie in a cone. Its `may_reach` is set from the cone."""
        origin = copy(self)
        origin.may_reach = [[guard.may_hit_cone(cone) for guard in guards] for guards in self.row_guards]
        return origin

    def seen_row(self, c: Candidate) -> Any:
        """The record that the row's kind returns from `seen`: data of the row that depends on the origin."""
        if self.shared and self.seen[c.batch] is not None:
            return rows(self.seen[c.batch], c.row)
        batch = self.batches[c.batch]
        return batch.kind.seen(rows(batch.placed, c.row), self.o)

    def guard(self, c: Candidate) -> BallGuard | PlaneGuard:
        """The guard of a row."""
        if not self.shared:
            return self._guard(self._row(c)) if c.unrolled is None else self.row_guards[c.batch][c.unrolled]
        guards = self.guards[c.batch]
        if guards is None:
            return self._guard(self._row(c))
        if dr.width(c.row) == 1:
            return rows(guards, c.row)
        x, y, z, least = dr.gather(self.a.Q32, self.guard_packets[c.batch], c.row)
        return type(guards)(self.a.V32(x, y, z), least)

    def guard_passes(self, c: Candidate, d: Any, reach: Any = None) -> Any:
        """Mask of the rays that the guard of a row does not reject.

        It is True for rows in the tree: they need no guard, because the ray has already entered their bounding box.
        The guards of rows in lists are those of the lists.

        d: ray directions, in single.
        reach: length of the rays, in single; None for endless rays.
        """
        if c.batch in self.plan.tree:
            return self.a.B(True)
        if c.batch in self.plan.lists:
            return self.lists[c.batch].guard(self.a, c.row).may_hit(self.place or d)
        return self.guard(c).may_hit(d, reach)

    def _row(self, c: Candidate) -> Batch:
        """The row of a candidate, as a batch."""
        return self.batches[c.batch].rows_at(c.row)

    def never_rehit(self, c: Candidate, ray: Ray) -> Any:
        """Mask of the rays that start on the row and can never hit it again."""
        if ray.row is None:
            return self.a.B(False)
        return (ray.row == c.index) & self.batches[c.batch].kind.never_rehit(ray.inside)

    def start(self, c: Candidate, ray: Ray) -> KnownEnds:
        """The facts about the start of the rays that the test of a row needs: do they start on it, and on which part.

        A ray starts on the row if its own field `row` says so, or if the shared origin lies on the row.
        """
        kind = self.batches[c.batch].kind
        on_start, inside = (None, None) if ray.row is None else (ray.row == c.index, ray.inside)
        part = ray.part if kind.uses_part else None
        if self.shared and self.touching[c.batch] is not None:
            on, g = rows(self.touching[c.batch], c.row)
            error = point_rounding(self._row(c), self.o)
            into = kind.runs_inside(self.seen_row(c), ray, dr.dot(g, ray.d), 0, dr.inf, error)
            inside = into if inside is None else dr.select(on, into, inside)
            on_start, part = on if on_start is None else on_start | on, None
        return KnownEnds(on_start, inside, part)
