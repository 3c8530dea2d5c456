"""Ray queries: the closest hit, occlusion, and transmittance through coloured objects.

A row is one object in the kernel's tables. A batch is a set of rows of one kind, which share code. A lane is one entry
of a Dr.Jit array; here it is one ray.

Queries search without derivatives. interaction.py then evaluates a hit again, with derivatives, and light_loop.py the
rows that tint a shadow, with `tint_of_row`.
With `brute_force=True` every row is tested, without guards and without a tree; the results are equal bit for bit
(tests/test_search.py).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from visray.accel.bvh_step import Certain
from visray.accel.culling import CrossingBounds, TriangleGuard, point_rounding, touches
from visray.accel.lists import RowLists
from visray.accel.origin import Candidate, RayOrigin
from visray.accel.ray_segment import RaySegment, occludes
from visray.accel.screening import any_hit, nearest
from visray.accel.tint import tint_factors
from visray.accel.traversal import Query, traverse
from visray.batches import Batch
from visray.geometry import gamma, l1_norm
from visray.pytree import detached, leaves, rows
from visray.quantities import Arrays
from visray.ray import NO_ROW, Hit, Ray


def closest(origin: RayOrigin, ray: Ray, brute_force: bool = False, active: Any = True, within: Any = dr.inf) -> Hit:
    """The closest hit of each ray at a distance below `within`.

    If two rows are hit at the same distance, the row with the lower number is chosen. Without a hit, `row` is NO_ROW
    and `t` is `within` (inf by default).

    active: mask of the lanes whose result is needed.
    """
    a, ray = origin.a, detached(ray)
    n = max(dr.width(ray.d), dr.width(origin.o))
    d32 = a.V32(ray.d)
    # Most rays from a shared origin need an exact test, so all directions are converted to double here.
    exact = ray.exact() if origin.shared else None
    has_parts = origin.geometry.has_parts
    # Each array of the state has one entry per lane from the start, because a loop must not change the widths.
    start = (dr.full(a.D, 0, n) + dr.detach(a.D(within)), dr.full(a.U, NO_ROW, n), *[dr.zeros(a.U, n)] * has_parts)

    def may_hit(c: Candidate, *_: Any) -> Any:
        if origin.shared and origin.batches[c.batch].radius is None:
            # Many camera rays hit an unbounded plane such as a floor, so a guard would cost more than it saves.
            return a.B(active)
        return origin.guard_passes(c, d32) & ~origin.never_rehit(c, ray) & c.present & active

    def intersect(c: Candidate, t: Any, row: Any, *part: Any, begun: tuple = (exact,)) -> tuple:
        # Without a shared origin, directions are converted to double here, so that packets of rays without a candidate
        # skip the conversion.
        exact_ray, kind = begun[0] or ray.exact(), origin.batches[c.batch].kind
        known = origin.start(c, exact_ray)
        x = kind.crossing(origin.seen_row(c), exact_ray, exact_ray.begin(known), None, known)
        nearer = x.t < t
        if c.present is not True:  # the walk through a tree visits rows in no fixed order
            nearer |= (x.t == t) & (c.index < row) & (x.t < dr.inf)
        part = tuple(dr.select(nearer, a.U(0) if x.part is None else x.part, old) for old in part)
        return dr.select(nearer, x.t, t), dr.select(nearer, c.index, row), *part

    def screen(lists: RowLists, d: Any, first: Any, end: Any, guarded: Callable, state: tuple) -> tuple:
        return *nearest(a, lists, d, first, end, state[0], guarded), state

    finished = lambda *_: ~(active | a.B(False))  # noqa: E731 - no state ends the search
    screens = ray.row is None and ray.clearance is None and origin.place is None

    def certain(exact_ray: Ray) -> Certain:
        return Certain(a.D(0) if exact_ray.clearance is None else exact_ray.clearance, a.D(dr.inf), a.D(0))

    query = Query(
        may_hit, intersect, lambda state: state[0], finished, screen=screen if screens else None, certain=certain
    )
    return Hit(*traverse(origin, query, ray, start, brute_force))


@dataclass(frozen=True)
class Target:
    """The end of a shadow ray.

    distance: distance from the ray origin to the end; inf for an endless ray. If the ray has a vector `to_target`, the
        exact distance is the length of that vector, and this field is the same length in single.
    error: bound on the distance between the computed end and the true point.
    row, part: the row, and the part of its surface, on which the end lies; None if it lies on no row.
    inward: mask of the rays that reach that surface from inside the row, or None.
    may_touch: whether the end is a point of a light. Such a point may lie on any row, so each row is tested for it.
    slack, cosine: the segment that is tested ends slack / cosine before `distance`; None if it ends at `distance`.
    """

    distance: Any
    error: Any
    row: Any = None
    inward: Any = None
    part: Any = None
    may_touch: bool = False
    slack: Any = None
    cosine: Any = None

    def exact(self, a: Arrays, ray: Ray) -> tuple[Ray, Any]:
        """(the ray in double, the distance of its end in double)."""
        exact_ray = ray.exact()
        distance = a.D(self.distance) if ray.to_target is None else dr.dot(ray.to_target, exact_ray.d)
        return exact_ray, distance if self.slack is None else distance - a.D(a.F(self.slack) / self.cosine)


def occluded(origin: RayOrigin, ray: Ray, target: Target, active: Any, brute_force: bool = False) -> Any:
    """Mask of the rays that meet a row between their origin and their target. Inactive lanes: False."""

    a = origin.a

    def stop(c: Candidate, segment: RaySegment, hidden: Any) -> tuple:
        return (hidden | occludes(segment),)

    def screen(lists: RowLists, d: Any, first: Any, end: Any, guarded: Callable, state: tuple) -> tuple:
        hit, unsure = any_hit(a, lists, d, first, end, origin.farthest(reach), guarded, surely)
        return unsure, end, (state[0] | hit,)

    def surely(c: Candidate, guard: Any, bounds: CrossingBounds) -> tuple[Any, Any]:
        """(mask of the rays whose crossing with a row is sure to be before their end, mask of those whose crossing is
        sure to be behind it)."""
        if origin.place is not None:
            return (bounds.high < last) & (known_row != c.index), a.B(False)
        misses = bounds.low > reach * (1 + gamma(32, "single"))
        if isinstance(guard, TriangleGuard):
            # The end must be behind the triangle's plane by more than its error (Flat.crossing).
            return (last - bounds.high) * guard.cosine(d32) > error, misses
        return (bounds.high < last) & (known_row != c.index), misses & (known_row != c.index)

    d32, reach, known_row = dr.detach(a.V32(ray.d)), dr.detach(a.F32(target.distance)), None
    if origin.place is not None:
        # Rays to a directional light: the surface where they start is the end of the light's way.
        screens, known_row = origin.parallel.against and target.row is None and not target.may_touch, ray.row
        if screens:
            clearance = a.F32(detached(ray.exact()).clearance)
            last = origin.place.depth - clearance * (1 + gamma(8, "single"))
    else:
        screens = ray.row is None and ray.clearance is None and target.row is not None and not target.may_touch
        if screens:
            known_row, error = target.row, dr.detach(a.F32(target.error)) * (1 + gamma(8, "single"))
            # A lower bound of the end's distance; the distance in single has a few rounding errors.
            last = reach * (1 - gamma(32, "single"))
            if target.slack is not None:
                last -= dr.detach(a.F32(target.slack / target.cosine)) * (1 + gamma(8, "single"))
    start = (dr.full(a.B, False, _width(origin, ray)),)
    (hidden,) = _between(
        origin, ray, target, active, brute_force, start, stop, lambda hidden: hidden, screen if screens else None,
        lambda _: (a.B(True),),
    )  # fmt: skip
    return hidden & active


def transmittance(
    origin: RayOrigin, ray: Ray, target: Target, active: Any, tints: tuple, brute_force: bool = False
) -> Any:
    """The transmittance of each ray from its origin to its target, a colour, without derivatives. It is 1 without a row
    between them.

    A row that the ray both enters and leaves multiplies the transmittance by kt (1 - min(d / dmax, 1)), where d is the
    length of the ray inside the row. A row that the ray only enters, or only leaves, multiplies it by kt. Opaque rows
    have kt = 0. A transparent row also multiplies it by exp(-absorption d), even if both ends of the ray are inside.

    tints: a Tint for each batch
    """
    a, tints = origin.a, detached(tints)

    def change(c: Candidate, segment: RaySegment, *state: Any) -> tuple:
        hit, tint = tint_factors(origin, c, segment, None, tints)
        return tuple(dr.select(hit, old * k, old) for old, k in zip(state, tint))

    def dark(r: Any, g: Any, b: Any) -> Any:
        return (r == 0) & (g == 0) & (b == 0)

    start = tuple(dr.full(a.F, 1, _width(origin, ray)) for _ in range(3))
    return a.V(*_between(origin, ray, target, active, brute_force, start, change, dark))


@dataclass(frozen=True)
class TintProduct:
    """The transmittance of rays as a product without its factors 0, for each of three channels.

    product: product of all factors that are not 0
    zeros: number of factors that are 0
    """

    product: Any
    zeros: Any

    def whole(self) -> Any:
        """The transmittance."""
        return dr.select(self.zeros == 0, self.product, 0)

    def without(self, tint: Any) -> Any:
        """The product of all factors but one. tint: this factor."""
        dark = tint == 0
        rest = self.product / dr.select(dark, 1, tint)
        return dr.select(self.zeros == dr.select(dark, type(self.zeros)(1), 0), rest, 0)


def tint_product(
    origin: RayOrigin, ray: Ray, target: Target, active: Any, tints: tuple, brute_force: bool = False
) -> TintProduct:
    """The transmittance with its factors 0 counted, without derivatives. Arguments are those of `transmittance`."""
    a, tints = origin.a, detached(tints)

    def change(c: Candidate, segment: RaySegment, *state: Any) -> tuple:
        hit, tint = tint_factors(origin, c, segment, None, tints)
        product = (dr.select(hit & (k != 0), old * k, old) for old, k in zip(state[:3], tint))
        zeros = (dr.select(hit & (k == 0), old + 1, old) for old, k in zip(state[3:], tint))
        return *product, *zeros

    n = _width(origin, ray)
    start = *(dr.full(a.F, 1, n) for _ in range(3)), *(dr.zeros(a.F, n) for _ in range(3))
    never = lambda *_: a.B(False)  # noqa: E731 - no state decides
    state = _between(origin, ray, target, active, brute_force, start, change, never)
    return TintProduct(a.V(*state[:3]), a.V(*state[3:]))


def tint_of_row(
    origin: RayOrigin, ray: Ray, target: Target, active: Any, tints: tuple, batch: int, row: Any
) -> tuple[Any, Any]:
    """(mask of the rays that one row tints, its factor of the transmittance, a colour with derivatives).

    batch, row: number of the batch, and of the row in it, one for each ray. Other arguments: as in `transmittance`
    """
    segments = _Segments(origin, ray, target)
    c = Candidate(batch, row, row + origin.batches[batch].first_row, True)
    segment = segments.of(c, *segments.begin())
    hit, tint = tint_factors(origin, c, segment, segments.attached(c, segment), tints)
    return hit & active & ~origin.never_rehit(c, segments.ray), origin.a.V(*tint)


def _width(origin: RayOrigin, ray: Ray) -> int:
    """The number of lanes."""
    return max(dr.width(ray.d), dr.width(origin.o))


class _Segments:
    """The segments of rays up to their targets, for tests against rows."""

    def __init__(self, origin: RayOrigin, ray: Ray, target: Target):
        self.origin, self.ray, self.target = origin, detached(ray), detached(target)
        self.attached_ray, self.attached_target = ray, target

    def begin(self) -> tuple[Ray, Any]:
        """(the rays in double, the distances of their ends in double)."""
        return self.target.exact(self.origin.a, self.ray)

    def ends_on(self, c: Candidate) -> Any:
        """Mask of the segments that end on a row."""
        return self.origin.a.B(False) if self.target.row is None else self.target.row == c.index

    def of(self, c: Candidate, exact_ray: Ray, distance: Any) -> RaySegment:
        """The segments for a test against a row. exact_ray, distance: results of `begin`."""
        a, origin, target = self.origin.a, self.origin, self.target
        batch = origin.batches[c.batch]
        kind, placed, seen = batch.kind, rows(batch.placed, c.row), origin.seen_row(c)
        on_end, inward = self.ends_on(c), a.B(False) if target.inward is None else target.inward
        error = a.D(target.error)
        end_part = target.part if kind.uses_part else None
        if target.may_touch:
            touched = self._touched(batch.rows_at(c.row), placed, seen, exact_ray, distance)
            on_end, inward, end_part = on_end | touched[0], inward | touched[1], None
        elif target.row is None:
            on_end = inward = None
        known = replace(origin.start(c, exact_ray), on_end=on_end, inward=inward, end_part=end_part, end_error=error)
        return RaySegment(kind, placed, seen, exact_ray, exact_ray.begin(known), distance, known)

    def _touched(self, row: Batch, placed: Any, seen: Any, exact_ray: Ray, distance: Any) -> tuple[Any, Any]:
        """(mask of the segments whose end lies on a row to within rounding, mask of those that reach it from inside).

        row: the row as a batch. placed, seen: its data. exact_ray, distance: as in `of`.
        """
        a, kind, error = self.origin.a, row.kind, self.target.error
        end = exact_ray.o + distance * exact_ray.d
        end_error = point_rounding(row, end) + a.D(error)

        def look(*_: Any) -> tuple[Any, Any]:
            f, g = kind.surface_at(placed, end)
            slope = -dr.dot(g, exact_ray.d)
            into = kind.runs_inside(seen, exact_ray, slope, 0, distance, end_error)
            return none | touches(row, f, g, end, a.D(error)), none | into

        none = dr.full(a.B, False, dr.width(end))
        if not kind.composite or row.radius is None:
            return look()
        # All operands must be asked, so only points in the bounding ball are looked at.
        near = dr.norm(end - row.centre) <= row.radius + end_error
        return dr.if_stmt((none, none), near, look, lambda *old: old, label="touched")

    def attached(self, c: Candidate, segment: RaySegment) -> RaySegment | None:
        """The segment with derivatives; None if neither the row nor the ray carries any."""
        if segment.kind.finds_roots or segment.kind.walks:
            # gradients.py refuses transparent rows of such kinds. So this row is opaque, and it makes the transmittance
            # 0 whatever the length inside.
            return None
        placed = self.origin.geometry.batches[c.batch].placed
        if not dr.grad_enabled(leaves((placed, self.attached_ray), shared=True)):
            return None
        placed = rows(placed, c.row)
        exact_ray, end = self.attached_target.exact(self.origin.a, self.attached_ray)
        seen = segment.kind.seen(placed, self.attached_ray.o)
        return replace(segment, placed=placed, seen=seen, ray=exact_ray, end=end)


def _between(
    origin: RayOrigin, ray: Ray, target: Target, active: Any, brute_force: bool, start: tuple, change: Callable,
    finished: Callable, screen: Callable | None = None, decided: Callable | None = None,
) -> tuple:  # fmt: skip
    """The state (a tuple of arrays) after each ray is tested against all rows between its origin and its target.

    start: the state before the first row.
    change(c, segment, *state): function that returns the state after one row.
    finished(*state): function that returns a mask of the rays whose state no other row can change.
    screen: as in Query
    decided(*state): function that returns the state of rays that surely cross a row; None if that does not decide it.
    """
    a, segments = origin.a, _Segments(origin, ray, target)
    ray, target, active = segments.ray, segments.target, dr.detach(active)
    d32, reach = a.V32(ray.d), a.F32(target.distance)

    def may_hit(c: Candidate, *state: Any) -> Any:
        maybe = active & ~finished(*state) & c.present & ~origin.never_rehit(c, ray)
        maybe &= origin.guard_passes(c, d32, reach)
        if target.row is None:
            return maybe
        # `never_rehit` also holds for the ray in the other direction, which starts at the end: such a ray cannot hit
        # the row on which it starts.
        return maybe & ~(segments.ends_on(c) & origin.batches[c.batch].kind.never_rehit(target.inward))

    def intersect(c: Candidate, *state: Any, begun: tuple | None = None) -> tuple:
        return change(c, segments.of(c, *(begun or segments.begin())), *state)

    def certain(exact_ray: Ray, distance: Any) -> Certain:
        # The rounding error of the end bounds that of its distance from a row (culling.point_rounding).
        rounding = gamma(64) * (l1_norm(origin.o) + 2 * dr.select(distance < dr.inf, distance, 0))
        clearance = a.D(0) if exact_ray.clearance is None else exact_ray.clearance
        return Certain(clearance, distance, a.D(target.error) + rounding, decided)

    # The distance in single has a few rounding errors.
    farthest = a.D(target.distance) * (1 + gamma(16, "single"))
    query = Query(
        may_hit, intersect, lambda _: farthest, lambda *state: finished(*state) | ~active, segments.begin, screen,
        decided and certain,
    )  # fmt: skip
    return traverse(origin, query, ray, start, brute_force)
