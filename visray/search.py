"""Which object a ray meets. Detached from derivatives: `surface_at` in shading.py feels what is found here.

Most objects are far from most rays. A test in single precision against a sphere around each object rejects them; its
margin is a bound of its own rounding, so that it never rejects what the exact test in double would accept. The exact
test then runs in a branch, for packets of rays that need it: double costs what single does. `plain=True` is the slow
twin without the test, equal bit for bit (tests/test_search.py).
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray import tables
from visray.bvh import Walk, packets
from visray.guards import Cone, Ground, Guard, flush, ground, guard
from visray.quantities import Arrays
from visray.ray import NO_OBJECT, Hit, Ray
from visray.tables import Group, Kinship
from visray.trees import detached, rows
from visray.trees import leaves as leaves_of


def _touch(kind: type, group: Group, o: Any) -> tuple[Any, Any] | None:
    """Which objects the origin lies on to within rounding, with their gradients there; None if it lies on none.

    From such an object the crossing at the origin is not seen again, whatever sign rounding gives its distance. That
    there is one is structure: a camera or light that comes to lie on a surface compiles anew.
    """
    f, g = kind.level(group.placed, o)
    on = flush(group, f, g, o)
    return (on, g) if np.any(np.array(on)) else None


@dataclass(frozen=True)
class Visit:
    """An object that rays may meet: its group, its number there and in all; lanes where `present` is false are not
    concerned. written: its number in the group as Python knows it, where objects are written out one by one."""

    group: int
    row: Any
    index: Any
    present: Any
    written: int | None = None


class Watch:
    """All groups as seen from an origin; where all rays share it, this is computed once for all objects.

    shared: whether they do; None: as the origin has one entry or one a lane.
    """

    def __init__(
        self, a: Arrays, kin: tuple[Kinship, ...], groups: tuple[Group, ...], o: Any, shared: bool | None = None
    ):
        self.a, self.kin, self.o = a, kin, dr.detach(o)
        self.groups, self.felt = detached(groups), groups
        self.shared = dr.width(o) == 1 if shared is None else shared
        if self.shared:
            self.sights = tuple(k.kind.seen(g.placed, self.o) for k, g in zip(kin, self.groups))
            self.guards = tuple(self._guard(k.kind, g) for k, g in zip(kin, self.groups))
            # A loop reads a guard as a packet of four neighbours, which is faster than four reads.
            self.packets = tuple(dr.ravel(a.Q32(*leaves_of(g)[0], leaves_of(g)[1])) for g in self.guards)
            self.boxes = tuple(g.tree and packets(a, g.tree, self.o) for g in self.groups)
            dr.eval(self.sights, self.guards, self.packets, self.boxes)
            self.touches = tuple(_touch(k.kind, g, self.o) for k, g in zip(kin, self.groups))
        self.hopes: list[list[Any]] | None = None
        if not self.shared:
            # Here and not where they are used: many rays from one point, in a loop, then share them.
            self.near = [self._near(n) for n in range(len(kin))]

    def _guard(self, kind: type, group: Group) -> Guard | Ground:
        """The guard of an object, or of all objects of a group."""
        if group.radius is None:
            return ground(self.a, kind, group, self.o)
        return guard(self.a, group.centre, group.radius, self.o)

    def _near(self, number: int) -> list[Guard | Ground]:
        """The guards of the objects of a group that are written out, for origins that differ from lane to lane."""
        kind, group, count = self.kin[number].kind, self.groups[number], len(self.kin[number].names)
        written = range(count if count <= tables.WRITTEN_OUT else 0)
        return [self._guard(kind, self.one(group, self.a.U(i))) for i in written]

    def toward(self, cone: Cone) -> "Watch":
        """The same watch for rays in a cone: of the objects that are written out, those that none can meet are marked
        before the rays are drawn."""
        watch = copy(self)
        watch.hopes = [[g.near(cone) for g in near] for near in self.near]
        return watch

    def hope(self, v: Visit) -> Any:
        """Whether an object may be met by any of the rays, or None where that is not known."""
        return None if self.hopes is None or v.written is None else self.hopes[v.group][v.written]

    def one(self, group: Group, i: Any) -> Group:
        """One object of a group: where it is."""
        return rows(replace(group, material=None, texture=None, tree=None), i)

    def seen(self, v: Visit) -> Any:
        """An object as its kind sees it from the origin."""
        if self.shared:
            return rows(self.sights[v.group], v.row)
        return self.kin[v.group].kind.seen(rows(self.groups[v.group].placed, v.row), self.o)

    def guard(self, v: Visit) -> Guard | Ground:
        """The guard of an object."""
        if not self.shared:
            if v.written is not None:
                return self.near[v.group][v.written]
            return self._guard(self.kin[v.group].kind, self.one(self.groups[v.group], v.row))
        if dr.width(v.row) == 1:
            return rows(self.guards[v.group], v.row)
        x, y, z, margin = dr.gather(self.a.Q32, self.packets[v.group], v.row)
        return type(self.guards[v.group])(self.a.V32(x, y, z), margin)

    def gone(self, v: Visit, ray: Ray) -> Any:
        """Whether rays leave an object so that they never meet it again."""
        if ray.source is None:
            return self.a.B(False)
        gone = ray.source == v.index
        return gone & ~ray.inside if self.kin[v.group].kind.closed else gone

    def leaving(self, v: Visit, ray: Ray) -> tuple[Any, Any]:
        """Whether rays start on an object, and whether they run into it: None if none does.

        A ray says so itself, or the shared origin lies on the object.
        """
        leaves, inside = (None, None) if ray.source is None else (ray.source == v.index, ray.inside)
        if self.shared and self.touches[v.group] is not None:
            on, g = rows(self.touches[v.group], v.row)
            into = dr.dot(g, ray.d) < 0
            inside = into if inside is None else dr.select(on, into, inside)
            leaves = on if leaves is None else leaves | on
        return leaves, inside

    def sweep(self, d: Any, state: tuple, visit: Any, reach: Any, done: Any, plain: bool) -> tuple:
        """`state` after visit(state, Visit) for every object that a ray may meet.

        reach(state): no object farther than that is of interest; done(state): none at all. `plain`: visit them all.
        """
        base = 0
        for number, k in enumerate(self.kin):
            n, tree = len(k.names), self.groups[number].tree
            if n <= tables.WRITTEN_OUT:
                for i in range(n):
                    state = visit(state, Visit(number, self.a.U(i), self.a.U(base + i), True, i))
            elif tree is None or plain:
                state = self._loop(number, n, base, state, visit)
            else:
                walk = Walk.along(self.a, tree, self.boxes[number] if self.shared else None, self.o, d)

                def call(state: tuple, i: Any, present: Any, number: int = number, base: int = base) -> tuple:
                    return visit(state, Visit(number, i, i + base, present))

                state = walk.through(state, call, reach, done)
            base += n
        return state

    def _loop(self, number: int, n: int, base: int, state: tuple, visit: Any) -> tuple:
        last = dr.opaque(self.a.U, n)

        def body(i: Any, *state: Any) -> tuple:
            return (i + 1, *visit(state, Visit(number, i, i + base, True)))

        i = dr.zeros(self.a.U, dr.width(state))
        return dr.while_loop((i, *state), lambda i, *_: i < last, body, label="objects")[1:]


def closest(watch: Watch, ray: Ray, plain: bool = False, active: Any = True, within: Any = dr.inf) -> Hit:
    """The first object along each ray, nearer than `within`. Ties go to the object that comes first in the scene's
    families."""
    a, ray = watch.a, detached(ray)
    n = max(dr.width(ray.d), dr.width(watch.o))
    d32 = a.V32(ray.d)
    # State is of full width from the start: a loop over objects must not mix widths.
    start = dr.full(a.D, 0, n) + dr.detach(a.D(within)), dr.full(a.U, NO_OBJECT, n)

    def visit(state: tuple, v: Visit) -> tuple:
        def meet(t: Any, found: Any) -> tuple:
            # Read in here, so that a packet of rays that is not a candidate does not wait for it.
            whole = ray.exact()
            met = watch.kin[v.group].kind.first(watch.seen(v), whole, *watch.leaving(v, whole))
            nearer = met < t
            if v.present is not True:  # a tree gives the objects in no fixed order
                nearer |= (met == t) & (v.index < found) & (met < dr.inf)
            return dr.select(nearer, met, t), dr.select(nearer, v.index, found)

        if plain:
            return meet(*state)

        def likely(*state: Any) -> tuple:
            maybe = watch.guard(v).candidate(d32) & ~watch.gone(v, ray) & v.present & active
            return dr.if_stmt(state, maybe, meet, lambda *state: state, label="meet")

        return _hopefully(watch, v, state, likely)

    return Hit(*watch.sweep(d32, start, visit, lambda s: a.F32(s[0]), lambda _: ~(active | a.B(False)), plain))


def _hopefully(watch: Watch, v: Visit, state: tuple, likely: Callable) -> tuple:
    """likely(*state), but by packets of rays that may meet the object at all."""
    hope = watch.hope(v)
    if hope is None:
        return likely(*state)
    return dr.if_stmt(state, hope, likely, lambda *state: state, label="hope")


@dataclass(frozen=True)
class End:
    """Where rays that ask what is between end: at `length`, on object `index` (reached from within if `inward`).

    lamp: how well the point there is known, where it is a light's that may lie on a surface itself, or None.
    """

    length: Any
    index: Any = None
    inward: Any = None
    lamp: Any = None


def blocked(
    watch: Watch, ray: Ray, length: Any, end: Any, inward: Any, active: Any, plain: bool = False, lamp: Any = None
) -> Any:
    """Whether an object lies between the origin and the point at `length` along each ray.

    `end` is the index of the object that point lies on, `inward` whether the ray reaches it from within; both None
    where it lies on none that is known. `lamp`: how well that point is known, where it is a light's.
    """

    def stop(hidden: Any, met: Any, _: Visit) -> tuple:
        return (hidden | met(),)

    start = (dr.full(watch.a.B, False, _width(watch, ray)),)
    stops = End(length, end, inward, lamp)
    return _between(watch, ray, stops, active, plain, start, stop, lambda s: s[0])[0] & active


def transmitted(watch: Watch, ray: Ray, end: End, active: Any, tints: tuple, feel: bool, plain: bool = False) -> Any:
    """The share of light, a colour, that gets along each ray: 1 where nothing is between, 0 behind what is opaque.

    Each object in between multiplies it by kt (1 - min(d / dmax, 1)), d the path inside, or by kt where the ray enters
    it and does not leave it, or the other way round. tints: (kt, dmax) of each group's objects. `feel`: with
    derivatives by these and by the path, for which it does without branches.
    """
    a = watch.a

    def tint(*args: Any) -> tuple:
        *state, met, v = args
        kt, dmax = rows(tints[v.group] if feel else detached(tints[v.group]), v.row)
        whole, inside = met(passage=True)
        share = a.F(dr.select(whole, 1 - dr.minimum(inside / dmax, 1), 1))
        hit = met()
        return tuple(dr.select(hit, old * k * share, old) for old, k in zip(state, kt))

    def dark(state: tuple) -> Any:
        return (state[0] == 0) & (state[1] == 0) & (state[2] == 0)

    start = tuple(dr.full(a.F, 1, _width(watch, ray)) for _ in range(3))
    return a.V(*_between(watch, ray, end, active, plain or feel, start, tint, dark))


def _width(watch: Watch, ray: Ray) -> int:
    return max(dr.width(ray.d), dr.width(watch.o))


def _between(watch: Watch, ray: Ray, end: End, active: Any, plain: bool, start: tuple, change: Any, done: Any) -> tuple:
    """The state after change(*state, met, visit) for every object that may lie between a ray's origin and its end.

    met() says whether it does, and met(passage=True) how the ray passes it. done(state): nothing changes it any more.
    """
    a, felt, felt_length = watch.a, ray, end.length
    ray, end, active = detached(ray), detached(end), dr.detach(active)
    d32, reach = a.V32(ray.d), a.F32(end.length)

    def visit(state: tuple, v: Visit) -> tuple:
        kind, group = watch.kin[v.group].kind, watch.groups[v.group]
        arrives = a.B(False) if end.index is None else end.index == v.index

        def look(*state: Any) -> tuple:
            seen, whole, length = watch.seen(v), ray.exact(), a.D(end.length)
            leaves, into = watch.leaving(v, whole)
            comes, inward = arrives, a.B(False) if end.inward is None else end.inward
            if end.lamp is not None:
                lamp, one = whole.o + length * whole.d, watch.one(group, v.row)
                f, g = kind.level(one.placed, lamp)
                comes = comes | flush(one, f, g, lamp, a.D(end.lamp))
                inward = inward | (dr.dot(g, whole.d) > 0)

            def met(passage: bool = False) -> Any:
                if not passage:
                    return kind.blocks(seen, whole, length, comes, inward, leaves, into)
                if not dr.grad_enabled(leaves_of((watch.felt[v.group].placed, felt))):
                    return kind.passage(seen, whole, length, comes, leaves)
                near = kind.seen(rows(watch.felt[v.group].placed, v.row), felt.o)
                return kind.passage(near, felt.exact(), a.D(felt_length), comes, leaves)

            return change(*state, met, v)

        if plain:
            return look(*state)

        def likely(*state: Any) -> tuple:
            maybe = active & ~done(state) & v.present & ~watch.gone(v, ray) & watch.guard(v).candidate(d32)
            if end.index is not None:
                maybe &= ~(arrives & ~end.inward)
            return dr.if_stmt(state, maybe, look, lambda *state: state, label="between")

        return _hopefully(watch, v, state, likely)

    return watch.sweep(d32, start, visit, lambda _: reach, lambda s: done(s) | ~active, plain)
