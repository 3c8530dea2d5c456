"""Ray origins: the objects of a scene as seen from where rays start.

Most objects are far from most rays. A test in single precision against a ball around each object, its guard, rejects
them. The margin of a guard bounds its own rounding, so it never rejects an object that the exact test in double would
accept.
"""

from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.accel import policy
from visray.accel.bvh import Tree, build
from visray.accel.culling import BallGuard, DirectionCone, PlaneGuard, ball_guard, plane_guard, point_rounding, touches
from visray.batches import Batch, boxes
from visray.pytree import detached, evaluated, leaves, rows
from visray.quantities import Arrays
from visray.ray import KnownEnds, Ray


@dataclass(frozen=True)
class Geometry:
    """Everything that rays can hit.

    a: array types.
    batches: the batches of the scene.
    tree: bounding volume hierarchy over the rows that are too many to be unrolled, or None.
    accelerator: the setting.
    """

    a: Arrays
    batches: tuple[Batch, ...]
    tree: Tree | None
    accelerator: policy.Accelerator

    @staticmethod
    def of(a: Arrays, batches: tuple[Batch, ...], accelerator: policy.Accelerator = "auto") -> "Geometry":
        """The geometry of batches, with the tree that the policy asks for."""
        geometry = Geometry(a, batches, None, accelerator)
        # A batch that is in the tree for rays with a shared origin is also in it for all other rays.
        in_tree = geometry.plan(shared=False).tree
        if not in_tree:
            return geometry
        corners = [boxes(batches[i]) for i in in_tree]
        low, high = (np.concatenate(c) for c in zip(*corners))
        index = np.concatenate([batches[i].first_row + np.arange(len(batches[i])) for i in in_tree])
        batch = np.repeat(in_tree, [len(batches[i]) for i in in_tree])
        return replace(geometry, tree=evaluated(build(a, low, high, batch, index)))

    def plan(self, shared: bool) -> policy.Plan:
        """How rays find rows. shared: the rays share one origin."""
        sizes = [policy.BatchSize(len(b), b.kind.bounded) for b in self.batches]
        return policy.plan(sizes, self.accelerator, shared)

    @property
    def has_parts(self) -> bool:
        """Whether hits carry parts."""
        return any(b.kind.parts > 1 for b in self.batches)

    @property
    def uses_parts(self) -> bool:
        """Whether the crossings of some kind depend on the part that a ray starts or ends on."""
        return any(b.kind.uses_part for b in self.batches)


@dataclass(frozen=True)
class Candidate:
    """A row that rays may hit.

    batch: number of its batch, a Python number.
    row: its number in the batch.
    index: its number among all rows of the scene.
    present: mask of the lanes that test it.
    unrolled: its number in the batch as a Python number, where rows are unrolled; None elsewhere.
    """

    batch: int
    row: Any
    index: Any
    present: Any
    unrolled: int | None = None


def _touching(batch: Batch, o: Any) -> tuple[Any, Any] | None:
    """Rows of a batch on which the origin lies, to within rounding: (mask, gradients there). None if there is no row.

    A ray from such a row does not find the crossing at its origin again, whatever the sign of its computed distance.
    Whether there is such a row is part of the kernel's structure: a camera or a light that moves onto a surface needs a
    new kernel.
    """
    f, g = batch.kind.surface_at(batch.placed, o)
    on = touches(batch, f, g, o) & batch.kind.has_normal(batch.placed, o)
    return (on, g) if np.any(np.array(on)) else None


class RayOrigin:
    """All batches as seen from the origin of rays.

    shared: all rays start at one point. Then per-origin data of all unrolled rows is computed once and kernels read it.
        None: decided by whether the origin has one entry.
    may_reach: for each row of each unrolled batch, whether some ray of a cone may hit it; None without a cone.
    """

    def __init__(self, geometry: Geometry, o: Any, shared: bool | None = None):
        self.a, self.o, self.geometry = geometry.a, dr.detach(o), geometry
        self.batches = detached(geometry.batches)
        self.shared = dr.width(o) == 1 if shared is None else shared
        self.plan = geometry.plan(self.shared)
        unrolled = [i in self.plan.unrolled for i in range(len(self.batches))]
        self.may_reach: list[list[Any]] | None = None
        if self.shared:
            self.seen = tuple(
                b.kind.seen(b.placed, self.o) if prepared else None for b, prepared in zip(self.batches, unrolled)
            )
            self.guards = tuple(self._guard(b) if prepared else None for b, prepared in zip(self.batches, unrolled))
            # A loop reads a guard as a packet of four neighbouring floats, which is faster than four reads.
            self.guard_packets = tuple(g and dr.ravel(self.a.Q32(*leaves(g)[0], leaves(g)[1])) for g in self.guards)
            dr.eval(self.seen, self.guards, self.guard_packets)
            self.touching = tuple(_touching(b, self.o) for b in self.batches)
        else:
            # Computed here and not at their use, so that many rays from one point, in a loop, share them.
            self.row_guards = [
                [self._guard(b.rows_at(self.a.U(i))) for i in range(len(b) if prepared else 0)]
                for b, prepared in zip(self.batches, unrolled)
            ]

    def _guard(self, batch: Batch) -> BallGuard | PlaneGuard:
        """The guards of the rows of a batch."""
        if batch.radius is None:
            return plane_guard(self.a, batch, self.o)
        return ball_guard(self.a, batch.centre, batch.radius, self.o)

    def toward(self, cone: DirectionCone) -> "RayOrigin":
        """The same origin for rays in a cone. Unrolled rows that no ray of the cone can hit are marked in advance."""
        origin = copy(self)
        origin.may_reach = [[guard.may_hit_cone(cone) for guard in guards] for guards in self.row_guards]
        return origin

    def seen_row(self, c: Candidate) -> Any:
        """A row as seen from the origin: the record of its kind."""
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
        """Whether the guard of a row lets rays pass. Rows in the tree have none: their rays have entered their boxes.

        d: ray directions, in single.
        reach: length of the rays, in single; None for endless rays.
        """
        return self.a.B(True) if c.batch in self.plan.tree else self.guard(c).may_hit(d, reach)

    def _row(self, c: Candidate) -> Batch:
        """The row of a candidate, as a batch."""
        return self.batches[c.batch].rows_at(c.row)

    def never_rehit(self, c: Candidate, ray: Ray) -> Any:
        """Whether rays start on a row and can never hit it again."""
        if ray.row is None:
            return self.a.B(False)
        return (ray.row == c.index) & self.batches[c.batch].kind.never_rehit(ray.inside)

    def start(self, c: Candidate, ray: Ray) -> KnownEnds:
        """What is known about a row at the start of rays: from the ray itself, or because the shared origin touches the
        row."""
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
