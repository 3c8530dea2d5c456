"""Which row a ray meets. Detached from derivatives: interaction.py evaluates anew, attached, what is met here.

`brute_force=True` is the slow twin, without the tests that reject rows and without a tree, equal bit for bit
(tests/test_search.py).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.accel.culling import flush, rounding
from visray.accel.origin import Candidate, Query, RayOrigin
from visray.accel.ray_segment import RaySegment, length_inside, occludes
from visray.geometry import gamma
from visray.pytree import detached, leaves, rows
from visray.quantities import Arrays
from visray.ray import NO_ROW, Hit, Ray


def closest(origin: RayOrigin, ray: Ray, brute_force: bool = False, active: Any = True, within: Any = dr.inf) -> Hit:
    """The first row along each ray, nearer than `within`. Ties go to the row of the lowest number."""
    a, ray = origin.a, detached(ray)
    n = max(dr.width(ray.d), dr.width(origin.o))
    d32 = a.V32(ray.d)
    # What rays from a shared origin meet is looked at in double again, so they are all made exact.
    exact = ray.exact() if origin.shared else None
    has_parts = origin.geometry.has_parts
    # State is of full width from the start: a loop over rows must not mix widths.
    start = (dr.full(a.D, 0, n) + dr.detach(a.D(within)), dr.full(a.U, NO_ROW, n), *[dr.zeros(a.U, n)] * has_parts)

    def may_hit(c: Candidate, *_: Any) -> Any:
        if origin.shared and origin.batches[c.batch].radius is None:
            return a.B(active)  # a floor is met by most rays from the eye: to ask first costs more
        return origin.is_near(c, d32) & ~origin.never_rehit(c, ray) & c.present & active

    def intersect(c: Candidate, t: Any, row: Any, *part: Any, begun: tuple = (exact,)) -> tuple:
        # Other rays are read in here, so that a packet of rays that is not a candidate does not wait for it.
        whole, kind = begun[0] or ray.exact(), origin.batches[c.batch].kind
        known = origin.start(c, whole)
        x = kind.crossing(origin.seen_row(c), whole, whole.begin(known), None, known)
        nearer = x.t < t
        if c.present is not True:  # a tree gives the rows in no fixed order
            nearer |= (x.t == t) & (c.index < row) & (x.t < dr.inf)
        part = tuple(dr.select(nearer, a.U(0) if x.part is None else x.part, old) for old in part)
        return dr.select(nearer, x.t, t), dr.select(nearer, c.index, row), *part

    query = Query(may_hit, intersect, lambda state: state[0], lambda *_: ~(active | a.B(False)))
    return Hit(*origin.sweep(query, ray, start, brute_force))


@dataclass(frozen=True)
class Target:
    """Where rays end that ask what is between.

    distance: along the ray, inf for none. error: bound on the distance of that end from the true point.
    row, part: what it lies on, reached from within if `inward`, or None.
    loose: it is the point of a light, which may lie on rows without knowing it.
    slack: how much nearer the end is than `distance`, times `cosine`, or None; where a ray has a `way`, `distance` is
    the length of that, in single.
    """

    distance: Any
    error: Any
    row: Any = None
    inward: Any = None
    part: Any = None
    loose: bool = False
    slack: Any = None
    cosine: Any = None

    def exact(self, a: Arrays, ray: Ray) -> tuple[Ray, Any]:
        """The ray and the distance of its end in double."""
        whole = ray.exact()
        distance = a.D(self.distance) if ray.to_target is None else dr.dot(ray.to_target, whole.d)
        return whole, distance if self.slack is None else distance - a.D(a.F(self.slack) / self.cosine)


def occluded(origin: RayOrigin, ray: Ray, target: Target, active: Any, brute_force: bool = False) -> Any:
    """Whether a row lies between the origin and the target of each ray."""

    def stop(c: Candidate, piece: RaySegment, _: RaySegment | None, hidden: Any) -> tuple:
        return (hidden | occludes(piece),)

    start = (dr.full(origin.a.B, False, _width(origin, ray)),)
    search = _between(origin, ray, target, active, brute_force, start, stop, lambda hidden: hidden)
    return search[0] & active


def transmittance(
    origin: RayOrigin, ray: Ray, target: Target, active: Any, tints: tuple, attached: bool, brute_force: bool = False
) -> Any:
    """The share of light, a colour, that gets along each ray: 1 where nothing is between, 0 behind what is opaque.

    Each row in between multiplies it by kt (1 - min(d / dmax, 1)), d the way inside, or by kt where the ray enters it
    and does not leave it, or the other way round. tints: (kt, dmax) of each batch's rows. `attached`: with derivatives
    by these and by the way, for which it does without branches.
    """
    a = origin.a

    def tint(c: Candidate, piece: RaySegment, attached_piece: RaySegment | None, *state: Any) -> tuple:
        kt, dmax = rows(tints[c.batch] if attached else detached(tints[c.batch]), c.row)
        through, inside = length_inside(attached_piece or piece)
        share = a.F(dr.select(through, 1 - dr.minimum(inside / dmax, 1), 1))
        hit = occludes(piece)
        return tuple(dr.select(hit, old * k * share, old) for old, k in zip(state, kt))

    def dark(r: Any, g: Any, b: Any) -> Any:
        return (r == 0) & (g == 0) & (b == 0)

    start = tuple(dr.full(a.F, 1, _width(origin, ray)) for _ in range(3))
    return a.V(*_between(origin, ray, target, active, brute_force or attached, start, tint, dark))


def _width(origin: RayOrigin, ray: Ray) -> int:
    return max(dr.width(ray.d), dr.width(origin.o))


def _between(
    origin: RayOrigin, ray: Ray, target: Target, active: Any, brute_force: bool, start: tuple, change: Callable,
    finished: Callable,
) -> tuple:  # fmt: skip
    """The state after change(c, piece, attached piece, *state) for every row that may lie between a ray's origin and
    its target. The attached piece is None where nothing has derivatives. finished(*state): nothing changes it any more.
    """
    a, attached_ray, attached_target = origin.a, ray, target
    ray, target, active = detached(ray), detached(target), dr.detach(active)
    d32, reach = a.V32(ray.d), a.F32(target.distance)

    def arrives(c: Candidate) -> Any:
        return a.B(False) if target.row is None else target.row == c.index

    def may_hit(c: Candidate, *state: Any) -> Any:
        maybe = active & ~finished(*state) & c.present & ~origin.never_rehit(c, ray)
        maybe &= origin.is_near(c, d32, reach)
        if target.row is None:
            return maybe
        # The way back from the end would leave it so.
        return maybe & ~(arrives(c) & origin.batches[c.batch].kind.never_rehit(target.inward))

    def begin() -> tuple[Ray, Any]:
        return target.exact(a, ray)

    def piece(c: Candidate, whole: Ray, distance: Any) -> RaySegment:
        batch = origin.batches[c.batch]
        kind, one, seen = batch.kind, rows(batch.placed, c.row), origin.seen_row(c)
        on_end, inward = arrives(c), a.B(False) if target.inward is None else target.inward
        error = a.D(target.error)
        end_part = target.part if kind.uses_part else None
        if target.loose:
            end, row = whole.o + distance * whole.d, batch.rows_at(c.row)
            f, g = kind.surface_at(one, end)
            on_end = on_end | flush(row, f, g, end, error)
            near = rounding(row, end) + error
            inward = inward | kind.runs_inside(seen, whole, -dr.dot(g, whole.d), 0, distance, near)
            end_part = None
        elif target.row is None:
            on_end = inward = None
        known = replace(origin.start(c, whole), on_end=on_end, inward=inward, end_part=end_part, end_error=error)
        return RaySegment(kind, one, seen, whole, whole.begin(known), distance, known)

    def attached(c: Candidate, p: RaySegment) -> RaySegment | None:
        if p.kind.finds_roots:
            # Only what is opaque: gradients.py refuses the others. Its share is zero however long the way inside.
            return None
        placed = origin.geometry.batches[c.batch].placed
        if not dr.grad_enabled(leaves((placed, attached_ray))):
            return None
        one, (whole, end) = rows(placed, c.row), attached_target.exact(a, attached_ray)
        return replace(p, placed=one, seen=p.kind.seen(one, attached_ray.o), ray=whole, end=end)

    def intersect(c: Candidate, *state: Any, begun: tuple | None = None) -> tuple:
        p = piece(c, *(begun or begin()))
        return change(c, p, attached(c, p), *state)

    # In single the length of a way is off by a few roundings.
    farthest = a.D(target.distance) * (1 + gamma(16, "single"))
    query = Query(may_hit, intersect, lambda _: farthest, lambda *state: finished(*state) | ~active, begin)
    return origin.sweep(query, ray, start, brute_force)
