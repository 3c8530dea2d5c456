"""Which object a ray meets. Detached from derivatives: `surface_at` in shading.py feels what is found here.

Most objects are far from most rays. A test in single precision against a sphere around each object rejects them; its
margin is a bound of its own rounding, so that it never rejects what the exact test in double would accept. The exact
test then runs in a branch, for packets of rays that need it: double costs what single does. `plain=True` is the slow
twin without the test, equal bit for bit (tests/test_search.py).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.geometry import UNIT_ROUNDOFF
from visray.quantities import Arrays
from visray.ray import NO_OBJECT, Hit, Ray
from visray.tables import Group, Kinship
from visray.trees import detached, rows

# Up to this many objects of a kinship are written out one by one in the kernel; more are looped over. Written out they
# run 3 to 5 times faster and compile 100 times slower.
WRITTEN_OUT = 64


@dataclass(frozen=True)
class Sight:
    """A group as seen from an origin. Shapes: one entry an object, or one a lane.

    toward: the centre of the object's sphere minus the origin, in single. margin: |toward|^2 - radius^2, less its
    error.
    """

    seen: Any
    toward: Any = None
    margin: Any = None


def sight(a: Arrays, kind: type, group: Group, o: Any) -> Sight:
    """What of a group (or of rows of it) a ray from `o` needs."""
    seen = kind.seen(group.placed, o)
    if group.radius is None:
        return Sight(seen)
    toward = group.centre - o
    squared = dr.squared_norm(toward)
    # With u the roundoff of single: the dot product of toward and d is off by at most 6 u |toward| (two conversions,
    # five operations), its square by 13 u |toward|^2, and the margin's own conversion by u |toward|^2. 2^-124 covers
    # underflow.
    margin = squared - dr.square(group.radius) - 16 * UNIT_ROUNDOFF["single"] * squared - 2.0**-124
    return Sight(seen, a.V32(toward), a.F32(margin))


def candidate(view: Sight, d: Any) -> Any:
    """Whether a ray in direction `d` (single) may meet the sphere around an object."""
    along = dr.dot(view.toward, d)
    return (along * along >= view.margin) & ((along > 0) | (view.margin < 0))


class Watch:
    """All groups as seen from one origin; where the origin is shared by all rays this is computed once and
    evaluated."""

    def __init__(self, a: Arrays, kin: tuple[Kinship, ...], groups: tuple[Group, ...], o: Any):
        self.a, self.kin, self.o = a, kin, dr.detach(o)
        self.groups = detached(groups)
        self.shared = dr.width(o) == 1
        self.tables = None
        if self.shared:
            self.tables = tuple(sight(a, k.kind, g, self.o) for k, g in zip(kin, self.groups))
            dr.eval(self.tables)

    def row(self, number: int, index: Any) -> Sight:
        """Object `index` of group `number`."""
        if self.shared:
            return rows(self.tables[number], index)
        return sight(self.a, self.kin[number].kind, rows(self.groups[number], index), self.o)

    def sweep(self, state: tuple, visit: Any) -> tuple:
        """`state` after visit(state, kind, sight of an object, index of the object) for every object."""
        base = 0
        for number, k in enumerate(self.kin):
            n = len(k.names)
            if n <= WRITTEN_OUT:
                for i in range(n):
                    state = visit(state, k.kind, self.row(number, self.a.U(i)), self.a.U(base + i))
            else:
                state = self._loop(number, n, base, state, visit)
            base += n
        return state

    def _loop(self, number: int, n: int, base: int, state: tuple, visit: Any) -> tuple:
        kind, last = self.kin[number].kind, dr.opaque(self.a.U, n)

        def body(i: Any, *state: Any) -> tuple:
            return (i + 1, *visit(state, kind, self.row(number, i), i + base))

        i = dr.zeros(self.a.U, dr.width(state))
        return dr.while_loop((i, *state), lambda i, *_: i < last, body, label="objects")[1:]


def closest(watch: Watch, ray: Ray, plain: bool = False) -> Hit:
    """The first object along each ray. Ties go to the object that comes first in the scene's families."""
    a, ray = watch.a, detached(ray)
    n = dr.width(ray.d)
    d32 = a.V32(ray.d)
    # State is of full width from the start: a loop over objects must not mix widths.
    start = dr.full(a.D, dr.inf, n), dr.full(a.U, NO_OBJECT, n)

    def visit(state: tuple, kind: type, view: Sight, index: Any) -> tuple:
        def meet(t: Any, found: Any) -> tuple:
            met = kind.first(view.seen, ray, None if ray.source is None else ray.source == index)
            nearer = met < t
            return dr.select(nearer, met, t), dr.select(nearer, index, found)

        if plain or view.margin is None:
            return meet(*state)
        return dr.if_stmt(state, candidate(view, d32), meet, lambda t, found: (t, found), label="meet")

    return Hit(*watch.sweep(start, visit))


def blocked(watch: Watch, ray: Ray, length: Any, end: Any, inward: Any, active: Any, plain: bool = False) -> Any:
    """Whether an object lies between the origin and the point at `length` along each ray.

    `end` is the index of the object that point lies on, `inward` whether the ray reaches it from within.
    """
    a, ray = watch.a, detached(ray)
    length, end, inward, active = detached((length, end, inward, active))
    d32 = a.V32(ray.d)

    def visit(state: tuple, kind: type, view: Sight, index: Any) -> tuple:
        arrives = end == index

        def stop(hidden: Any) -> tuple:
            return (hidden | kind.blocks(view.seen, ray, length, arrives, inward),)

        if plain:
            return stop(*state)
        maybe = active & ~state[0] & ~(arrives & ~inward)
        if view.margin is not None:
            maybe &= candidate(view, d32)
        return dr.if_stmt(state, maybe, stop, lambda hidden: (hidden,), label="block")

    return watch.sweep((dr.full(a.B, False, dr.width(ray.d)),), visit)[0] & active
