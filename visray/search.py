"""Which object a ray meets. Detached from derivatives: `feel` in scenery.py feels what is found here.

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
from visray.accel.tree import Walk
from visray.guards import Cone, Ground, Guard, flush, ground, guard, rounding
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
    on = flush(group, f, g, o) & kind.sided(group.placed, o)
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
            dr.eval(self.sights, self.guards, self.packets)
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
        return (ray.source == v.index) & self.kin[v.group].kind.gone(ray.inside)

    def leaving(self, v: Visit, ray: Ray) -> tuple[Any, Any]:
        """Whether rays start on an object, and whether they run into it: None if none does.

        A ray says so itself, or the shared origin lies on the object.
        """
        leaves, inside = (None, None) if ray.source is None else (ray.source == v.index, ray.inside)
        if self.shared and self.touches[v.group] is not None:
            on, g = rows(self.touches[v.group], v.row)
            kind, one = self.kin[v.group].kind, self.one(self.groups[v.group], v.row)
            into = kind.runs_within(self.seen(v), ray, dr.dot(g, ray.d), 0, dr.inf, rounding(one, self.o))
            inside = into if inside is None else dr.select(on, into, inside)
            leaves = on if leaves is None else leaves | on
        return leaves, inside

    def sweep(self, q: "Question", d: Any, state: tuple, plain: bool) -> tuple:
        """`state` after the question is put to every object that a ray in direction `d` (single) may meet; `plain`: to
        all objects."""
        base = 0
        for number, k in enumerate(self.kin):
            n, tree = len(k.names), self.groups[number].tree
            written = range(n if n <= (tables.GATHERED if self.shared else tables.WRITTEN_OUT) else 0)
            each = [Visit(number, self.a.U(i), self.a.U(base + i), True, i) for i in written]
            if plain and each:
                for v in each:
                    state = q.meet(v, *state)
            elif tree and not plain:
                pass  # below, with all others in the tree
            elif plain or not each:
                state = self._loop(q, number, n, base, state, plain)
            elif each and self.shared and n <= tables.FEW:
                for v in each:
                    state = _where(q.likely(v, *state), state, lambda *state, v=v: q.meet(v, *state), "meet")
            elif each:
                state = self._gathered(q, number, base, each, state)
            base += n
        return state if plain else self._walked(q, d, state)

    def _walked(self, q: "Question", d: Any, state: tuple) -> tuple:
        """The same for the objects in the tree."""
        tree = next((g.tree for g in self.groups if g.tree), None)
        if tree is None:
            return state
        bases = np.cumsum([0] + [len(k.names) for k in self.kin])

        def visit(number: int, state: tuple, index: Any, present: Any) -> tuple:
            v = Visit(number, index - int(bases[number]), index, present)
            return _where(q.likely(v, *state), state, lambda *state: q.meet(v, *state), "meet")

        walk = Walk.along(self.a, tree, self.o, d)
        return walk.through(state, visit, q.reach, lambda state: q.done(*state))

    def _gathered(self, q: "Question", number: int, base: int, each: list[Visit], state: tuple) -> tuple:
        """As sweep, for objects whose guards are written out: those that pass are gathered as the bits of a number, and
        then looked at in one loop. So what looks at them is compiled once, and each lane goes on to its own next one.
        """
        for first in range(0, len(each), 32):
            state = self._passed(q, number, base, each[first : first + 32], first, state)
        return state

    def _passed(self, q: "Question", number: int, base: int, each: list[Visit], first: int, state: tuple) -> tuple:
        """The same for the objects from number `first` on, at most 32."""
        u, n = self.a.U, dr.width(state)
        bits = dr.zeros(u, n)
        for v in each:

            def add(bits: Any, v: Visit = v) -> tuple:
                return (bits | dr.select(q.likely(v, *state), u(1 << (v.written - first)), 0),)

            hope = self.hope(v)
            bits = add(bits)[0] if hope is None else _where(hope, (bits,), add, "hope")[0]

        def step(bits: Any, *state: Any) -> tuple:
            i = dr.tzcnt(bits) + first
            state = q.meet(Visit(number, i, i + base, True), *state)
            return (dr.select(q.done(*state), 0, bits & (bits - 1)), *state)

        return dr.while_loop((bits, *state), lambda bits, *_: bits != 0, step, label="passed")[1:]

    def _loop(self, q: "Question", number: int, n: int, base: int, state: tuple, plain: bool) -> tuple:
        last = dr.opaque(self.a.U, n)

        def body(i: Any, *state: Any) -> tuple:
            v = Visit(number, i, i + base, True)
            if plain:
                return (i + 1, *q.meet(v, *state))
            return (i + 1, *_where(q.likely(v, *state), state, lambda *state: q.meet(v, *state), "meet"))

        i = dr.zeros(self.a.U, dr.width(state))
        return dr.while_loop((i, *state), lambda i, *_: i < last, body, label="objects")[1:]


def _where(mask: Any, state: tuple, change: Callable, label: str) -> tuple:
    """change(*state) in lanes where the mask holds, by packets that have one."""
    return dr.if_stmt(state, mask, change, lambda *state: state, label=label)


@dataclass(frozen=True)
class Question:
    """What a search asks of objects, with a state that the answers change.

    likely(v, *state): which rays a test in single cannot rule out; meet(v, *state): the state after the exact answer;
    reach(state): no object farther than that is of interest; done(*state): none at all.
    """

    likely: Callable
    meet: Callable
    reach: Callable
    done: Callable


def closest(watch: Watch, ray: Ray, plain: bool = False, active: Any = True, within: Any = dr.inf) -> Hit:
    """The first object along each ray, nearer than `within`. Ties go to the object that comes first in the scene's
    families."""
    a, ray = watch.a, detached(ray)
    n = max(dr.width(ray.d), dr.width(watch.o))
    d32 = a.V32(ray.d)
    # State is of full width from the start: a loop over objects must not mix widths.
    start = dr.full(a.D, 0, n) + dr.detach(a.D(within)), dr.full(a.U, NO_OBJECT, n)

    def likely(v: Visit, *_: Any) -> Any:
        if watch.shared and watch.groups[v.group].radius is None:
            return a.B(active)  # a floor is met by most rays from the eye: to ask first costs more
        return watch.guard(v).candidate(d32) & ~watch.gone(v, ray) & v.present & active

    def meet(v: Visit, t: Any, found: Any) -> tuple:
        # Read in here, so that a packet of rays that is not a candidate does not wait for it.
        whole = ray.exact()
        met = watch.kin[v.group].kind.first(watch.seen(v), whole, *watch.leaving(v, whole))
        nearer = met < t
        if v.written is None:  # a tree gives the objects in no fixed order
            nearer |= (met == t) & (v.index < found) & (met < dr.inf)
        return dr.select(nearer, met, t), dr.select(nearer, v.index, found)

    question = Question(likely, meet, lambda s: s[0], lambda *_: ~(active | a.B(False)))
    return Hit(*watch.sweep(question, ray.exact().d, start, plain))


@dataclass(frozen=True)
class End:
    """Where rays that ask what is between end: at `length`, on object `index` (reached from within if `inward`).

    lamp: how well the point there is known, where it is a light's that may lie on a surface itself, or None.
    """

    length: Any
    index: Any = None
    inward: Any = None
    lamp: Any = None


def blocked(watch: Watch, ray: Ray, end: End, active: Any, plain: bool = False) -> Any:
    """Whether an object lies between the origin and the end of each ray."""

    def stop(v: Visit, met: Callable, hidden: Any) -> tuple:
        return (hidden | met(),)

    start = (dr.full(watch.a.B, False, _width(watch, ray)),)
    return _between(watch, ray, end, active, plain, start, stop, lambda hidden: hidden)[0] & active


def transmitted(watch: Watch, ray: Ray, end: End, active: Any, tints: tuple, feel: bool, plain: bool = False) -> Any:
    """The share of light, a colour, that gets along each ray: 1 where nothing is between, 0 behind what is opaque.

    Each object in between multiplies it by kt (1 - min(d / dmax, 1)), d the path inside, or by kt where the ray enters
    it and does not leave it, or the other way round. tints: (kt, dmax) of each group's objects. `feel`: with
    derivatives by these and by the path, for which it does without branches.
    """
    a = watch.a

    def tint(v: Visit, met: Callable, *state: Any) -> tuple:
        kt, dmax = rows(tints[v.group] if feel else detached(tints[v.group]), v.row)
        whole, inside = met(passage=True)
        share = a.F(dr.select(whole, 1 - dr.minimum(inside / dmax, 1), 1))
        hit = met()
        return tuple(dr.select(hit, old * k * share, old) for old, k in zip(state, kt))

    def dark(r: Any, g: Any, b: Any) -> Any:
        return (r == 0) & (g == 0) & (b == 0)

    start = tuple(dr.full(a.F, 1, _width(watch, ray)) for _ in range(3))
    return a.V(*_between(watch, ray, end, active, plain or feel, start, tint, dark))


def _width(watch: Watch, ray: Ray) -> int:
    return max(dr.width(ray.d), dr.width(watch.o))


def _between(
    watch: Watch, ray: Ray, end: End, active: Any, plain: bool, start: tuple, change: Callable, done: Callable
) -> tuple:
    """The state after change(v, met, *state) for every object that may lie between a ray's origin and its end.

    met() says whether it does, and met(passage=True) how the ray passes it. done(*state): nothing changes it any more.
    """
    a, felt, felt_length = watch.a, ray, end.length
    ray, end, active = detached(ray), detached(end), dr.detach(active)
    d32, reach = a.V32(ray.d), a.D(end.length)

    def arrives(v: Visit) -> Any:
        return a.B(False) if end.index is None else end.index == v.index

    def likely(v: Visit, *state: Any) -> Any:
        maybe = active & ~done(*state) & v.present & ~watch.gone(v, ray) & watch.guard(v).candidate(d32)
        if end.index is None:
            return maybe
        # The way back from the end would leave it so.
        return maybe & ~(arrives(v) & watch.kin[v.group].kind.gone(end.inward))

    def meet(v: Visit, *state: Any) -> tuple:
        kind, group = watch.kin[v.group].kind, watch.groups[v.group]
        seen, whole, length = watch.seen(v), ray.exact(), a.D(end.length)
        leaves, into = watch.leaving(v, whole)
        comes, inward = arrives(v), a.B(False) if end.inward is None else end.inward
        if end.lamp is not None:
            lamp, one = whole.o + length * whole.d, watch.one(group, v.row)
            f, g = kind.level(one.placed, lamp)
            error = a.D(end.lamp)
            comes = comes | flush(one, f, g, lamp, error)
            near = rounding(one, lamp) + error
            inward = inward | kind.runs_within(seen, whole, -dr.dot(g, whole.d), 0, length, near)

        def met(passage: bool = False) -> Any:
            if not passage:
                return kind.blocks(seen, whole, length, comes, inward, leaves, into)
            if not dr.grad_enabled(leaves_of((watch.felt[v.group].placed, felt))):
                return kind.passage(seen, whole, length, comes, leaves)
            near = kind.seen(rows(watch.felt[v.group].placed, v.row), felt.o)
            return kind.passage(near, felt.exact(), a.D(felt_length), comes, leaves)

        return change(v, met, *state)

    question = Question(likely, meet, lambda _: reach, lambda *state: done(*state) | ~active)
    return watch.sweep(question, ray.exact().d, start, plain)
