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
    size = extent(o)
    size += extent(group.placed.o) if group.radius is None else group.radius
    on = dr.abs(f) <= gamma(32) * size * dr.norm(g)
    return (on, g) if np.any(np.array(on)) else None


def candidate(g: Guard, d: Any) -> Any:
    """Whether a ray in direction `d` (single) may meet the sphere around an object."""
    along = dr.dot(g.toward, d)
    return (along * along >= g.margin) & ((along > 0) | (g.margin < 0))


class Watch:
    """All groups as seen from an origin; where all rays share it, this is computed once for all objects."""

    def __init__(self, a: Arrays, kin: tuple[Kinship, ...], groups: tuple[Group, ...], o: Any):
        self.a, self.kin, self.o = a, kin, dr.detach(o)
        self.groups = detached(groups)
        self.shared = dr.width(o) == 1
        if self.shared:
            self.sights = tuple(k.kind.seen(g.placed, self.o) for k, g in zip(kin, self.groups))
            self.guards = tuple(None if g.radius is None else guard(a, g.centre, g.radius, self.o) for g in self.groups)
            # A loop reads a guard as a packet of four neighbours, which is faster than four reads.
            self.packets = tuple(g and dr.ravel(a.Q32(*g.toward, g.margin)) for g in self.guards)
            self.boxes = tuple(g.tree and packets(a, g.tree, self.o) for g in self.groups)
            dr.eval(self.sights, self.guards, self.packets, self.boxes)
            self.touches = tuple(_touch(k.kind, g, self.o) for k, g in zip(kin, self.groups))

    def seen(self, number: int, index: Any) -> Any:
        """Object `index` of group `number`, as its kind sees it from the origin."""
        if self.shared:
            return rows(self.sights[number], index)
        return self.kin[number].kind.seen(rows(self.groups[number].placed, index), self.o)

    def guard(self, number: int, index: Any) -> Guard | None:
        """The guard of object `index` of group `number`, or None where the object is unbounded."""
        group = self.groups[number]
        if group.radius is None:
            return None
        if not self.shared:
            return guard(self.a, *rows((group.centre, group.radius), index), self.o)
        if dr.width(index) == 1:
            return rows(self.guards[number], index)
        x, y, z, margin = dr.gather(self.a.Q32, self.packets[number], index)
        return Guard(self.a.V32(x, y, z), margin)

    def leaving(self, number: int, index: Any, ray: Ray, whole: Any) -> tuple[Any, Any]:
        """Whether rays start on an object (number `whole` in all), and whether they run into it: None if none does.

        A ray says so itself, or the shared origin lies on the object.
        """
        leaves, inside = (None, None) if ray.source is None else (ray.source == whole, ray.inside)
        if self.shared and self.touches[number] is not None:
            on, g = rows(self.touches[number], index)
            into = dr.dot(g, ray.d) < 0
            inside = into if inside is None else dr.select(on, into, inside)
            leaves = on if leaves is None else leaves | on
        return leaves, inside

    def sweep(self, d: Any, state: tuple, visit: Any, reach: Any, done: Any, plain: bool) -> tuple:
        """`state` after visit(state, group, object, index, present) for every object that a ray may meet.

        `object` and `index` number it in its group and in all; lanes where `present` is false are not concerned.
        reach(state): no object farther than that is of interest; done(state): none at all. `plain`: visit them all.
        """
        base = 0
        for number, k in enumerate(self.kin):
            n, tree = len(k.names), self.groups[number].tree
            if n <= tables.WRITTEN_OUT:
                for i in range(n):
                    state = visit(state, number, self.a.U(i), self.a.U(base + i), True)
            elif tree is None or plain:
                state = self._loop(number, n, base, state, visit)
            else:
                walk = Walk.along(self.a, tree, self.boxes[number] if self.shared else None, self.o, d)

                def call(state: tuple, i: Any, present: Any, number: int = number, base: int = base) -> tuple:
                    return visit(state, number, i, i + base, present)

                state = walk.through(state, call, reach, done)
            base += n
        return state

    def _loop(self, number: int, n: int, base: int, state: tuple, visit: Any) -> tuple:
        last = dr.opaque(self.a.U, n)

        def body(i: Any, *state: Any) -> tuple:
            return (i + 1, *visit(state, number, i, i + base, True))

        i = dr.zeros(self.a.U, dr.width(state))
        return dr.while_loop((i, *state), lambda i, *_: i < last, body, label="objects")[1:]


def closest(watch: Watch, ray: Ray, plain: bool = False) -> Hit:
    """The first object along each ray. Ties go to the object that comes first in the scene's families."""
    a, ray = watch.a, detached(ray)
    n = dr.width(ray.d)
    d32 = a.V32(ray.d)
    # State is of full width from the start: a loop over objects must not mix widths.
    start = dr.full(a.D, dr.inf, n), dr.full(a.U, NO_OBJECT, n)

    def visit(state: tuple, number: int, i: Any, index: Any, present: Any) -> tuple:
        def meet(t: Any, found: Any) -> tuple:
            # Read in here, so that a packet of rays that is not a candidate does not wait for it.
            seen = watch.seen(number, i)
            met = watch.kin[number].kind.first(seen, ray, *watch.leaving(number, i, ray, index))
            nearer = met < t
            if present is not True:  # a tree gives the objects in no fixed order
                nearer |= (met == t) & (index < found) & (met < dr.inf)
            return dr.select(nearer, met, t), dr.select(nearer, index, found)

        g = None if plain else watch.guard(number, i)
        if g is None:
            return meet(*state)
        return dr.if_stmt(state, candidate(g, d32) & present, meet, lambda t, found: (t, found), label="meet")

    return Hit(*watch.sweep(d32, start, visit, lambda s: a.F32(s[0]), lambda _: a.B(False), plain))


def blocked(watch: Watch, ray: Ray, length: Any, end: Any, inward: Any, active: Any, plain: bool = False) -> Any:
    """Whether an object lies between the origin and the point at `length` along each ray.

    `end` is the index of the object that point lies on, `inward` whether the ray reaches it from within.
    """
    a, ray = watch.a, detached(ray)
    length, end, inward, active = detached((length, end, inward, active))
    d32, reach = a.V32(ray.d), a.F32(length)

    def visit(state: tuple, number: int, i: Any, index: Any, present: Any) -> tuple:
        arrives = end == index

        def stop(hidden: Any) -> tuple:
            kind, seen = watch.kin[number].kind, watch.seen(number, i)
            leaves, into = watch.leaving(number, i, ray, index)
            return (hidden | kind.blocks(seen, ray, length, arrives, inward, leaves, into),)

        if plain:
            return stop(*state)
        maybe = active & ~state[0] & ~(arrives & ~inward) & present
        g = watch.guard(number, i)
        if g is not None:
            maybe &= candidate(g, d32)
        return dr.if_stmt(state, maybe, stop, lambda hidden: (hidden,), label="block")

    start = (dr.full(a.B, False, dr.width(ray.d)),)
    return watch.sweep(d32, start, visit, lambda _: reach, lambda s: s[0] | ~active, plain)[0] & active
