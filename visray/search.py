"""Which object a ray meets. Detached from derivatives: `surface_at` in shading.py feels what is found here.

Most objects are far from most rays. A test in single precision against a sphere around each object rejects them; its
margin is a bound of its own rounding, so that it never rejects what the exact test in double would accept. The exact
test then runs in a branch, for packets of rays that need it: double costs what single does. `plain=True` is the slow
twin without the test, equal bit for bit (tests/test_search.py).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray import tables
from visray.bvh import Walk, packets
from visray.geometry import UNIT_ROUNDOFF, extent, gamma
from visray.quantities import Arrays
from visray.ray import NO_OBJECT, Hit, Ray
from visray.tables import Group, Kinship
from visray.trees import detached, rows
from visray.trees import leaves as leaves_of


@dataclass(frozen=True)
class Guard:
    """What rejects most rays before an object is looked at. Shapes: one entry an object, or one a lane.

    toward: the centre of the object's sphere minus the origin. margin: |toward|^2 - radius^2, less its error. Single.
    """

    toward: Any
    margin: Any


def guard(a: Arrays, centre: Any, radius: Any, o: Any) -> Guard:
    """The guard of the sphere around an object, for rays from `o`."""
    toward = centre - o
    squared = dr.squared_norm(toward)
    # With u the roundoff of single: the dot product of toward and d is off by at most 6 u |toward| (two conversions,
    # five operations), its square by 13 u |toward|^2, and the margin's own conversion by u |toward|^2. 2^-124 covers
    # underflow.
    margin = squared - dr.square(radius) - 16 * UNIT_ROUNDOFF["single"] * squared - 2.0**-124
    return Guard(a.V32(toward), a.F32(margin))


def _touch(kind: type, group: Group, o: Any) -> tuple[Any, Any] | None:
    """Which objects the origin lies on to within rounding, with their gradients there; None if it lies on none.

    From such an object the crossing at the origin is not seen again, whatever sign rounding gives its distance. That
    there is one is structure: a camera or light that comes to lie on a surface compiles anew.
    """
    f, g = kind.level(group.placed, o)
    on = _flush(group, dr.arange(dr.uint32_array_t(dr.detached_t(f)), dr.width(f)), f, g, o)
    return (on, g) if np.any(np.array(on)) else None


def _flush(group: Group, index: Any, f: Any, g: Any, p: Any) -> Any:
    """Whether the points p lie on objects to within rounding, by their level f and its gradient g there."""
    size = extent(p)
    size += extent(rows(group.placed.o, index)) if group.radius is None else rows(group.radius, index)
    return dr.abs(f) <= gamma(32) * size * dr.norm(g)


def candidate(g: Guard, d: Any) -> Any:
    """Whether a ray in direction `d` (single) may meet the sphere around an object."""
    along = dr.dot(g.toward, d)
    return (along * along >= g.margin) & ((along > 0) | (g.margin < 0))


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
            self.guards = tuple(None if g.radius is None else guard(a, g.centre, g.radius, self.o) for g in self.groups)
            # A loop reads a guard as a packet of four neighbours, which is faster than four reads.
            self.packets = tuple(g and dr.ravel(a.Q32(*g.toward, g.margin)) for g in self.guards)
            self.boxes = tuple(g.tree and packets(a, g.tree, self.o) for g in self.groups)
            dr.eval(self.sights, self.guards, self.packets, self.boxes)
            self.touches = tuple(_touch(k.kind, g, self.o) for k, g in zip(kin, self.groups))
        else:
            # Here and not where they are used: many rays from one point, in a loop, then share them.
            self.near = [self._guards(g, len(k.names)) for k, g in zip(kin, self.groups)]

    def _guards(self, group: Group, count: int) -> list[Guard]:
        """The guards of the objects of a group that are written out, for origins that differ from lane to lane."""
        if group.radius is None or count > tables.WRITTEN_OUT:
            return []
        index = map(self.a.U, range(count))
        return [guard(self.a, *rows((group.centre, group.radius), i), self.o) for i in index]

    def seen(self, v: Visit) -> Any:
        """An object as its kind sees it from the origin."""
        if self.shared:
            return rows(self.sights[v.group], v.row)
        return self.kin[v.group].kind.seen(rows(self.groups[v.group].placed, v.row), self.o)

    def guard(self, v: Visit) -> Guard | None:
        """The guard of an object, or None where it is unbounded."""
        group = self.groups[v.group]
        if group.radius is None:
            return None
        if not self.shared:
            if v.written is not None:
                return self.near[v.group][v.written]
            return guard(self.a, *rows((group.centre, group.radius), v.row), self.o)
        if dr.width(v.row) == 1:
            return rows(self.guards[v.group], v.row)
        x, y, z, margin = dr.gather(self.a.Q32, self.packets[v.group], v.row)
        return Guard(self.a.V32(x, y, z), margin)

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

        g = None if plain else watch.guard(v)
        if g is None:
            return meet(*state)
        maybe = candidate(g, d32) & v.present & active
        return dr.if_stmt(state, maybe, meet, lambda t, found: (t, found), label="meet")

    return Hit(*watch.sweep(d32, start, visit, lambda s: a.F32(s[0]), lambda _: ~(active | a.B(False)), plain))


@dataclass(frozen=True)
class End:
    """Where rays that ask what is between end: at `length`, on object `index` (reached from within if `inward`).

    lamp: the points of lights there, which may lie on a surface themselves, or None.
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
    where it lies on none that is known. `lamp`: that point, where it is a light's that may lie on a surface itself.
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
            seen, whole = watch.seen(v), ray.exact()
            leaves, into = watch.leaving(v, whole)
            comes, inward = arrives, a.B(False) if end.inward is None else end.inward
            if end.lamp is not None:
                f, g = kind.level(rows(group.placed, v.row), end.lamp)
                comes = comes | _flush(group, v.row, f, g, end.lamp)
                inward = inward | (dr.dot(g, whole.d) > 0)

            def met(passage: bool = False) -> Any:
                if not passage:
                    return kind.blocks(seen, whole, end.length, comes, inward, leaves, into)
                if not dr.grad_enabled(leaves_of((watch.felt[v.group].placed, felt))):
                    return kind.passage(seen, whole, end.length, comes, leaves)
                near = kind.seen(rows(watch.felt[v.group].placed, v.row), felt.o)
                return kind.passage(near, felt.exact(), felt_length, comes, leaves)

            return change(*state, met, v)

        if plain:
            return look(*state)
        maybe = active & ~done(state) & v.present
        if end.index is not None:
            maybe &= ~(arrives & ~end.inward)
        g = watch.guard(v)
        if g is not None:
            maybe &= candidate(g, d32)
        return dr.if_stmt(state, maybe, look, lambda *state: state, label="between")

    return watch.sweep(d32, start, visit, lambda _: reach, lambda s: done(s) | ~active, plain)
