"""The search: fast paths equal slow twins bit for bit, the first object is found, no ray meets what it leaves."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from samples import (
    CONVEX,
    NAMES,
    SAMPLES,
    Lineup,
    aimed,
    array,
    gap,
    geometry_of,
    instances,
    inverse,
    norm,
    outer,
    real,
    rounding,
    shifted,
    stretched,
    truth,
)

import visray as vr
from visray.accel import policy
from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.geometry import gamma
from visray.lights import PointLight
from visray.materials import Material
from visray.primitives import Box, Cylinder, Plane, Polynomial, Rectangle, Sphere
from visray.primitives.convex import ConvexSolid
from visray.quantities import Arrays
from visray.ray import NO_ROW, Ray
from visray.scene.scene import Film, Scene
from visray.transforms import Translate

A = Arrays.of("llvm", "single")
RAYS = 10_000
# The polynomial of the sample is a convex solid, though not all are.
SOLIDS = [n for n in NAMES if issubclass(SAMPLES[n].kind, ConvexSolid | Polynomial)]


# Worlds of one structure, so that one kernel serves them all: an object of each kind as it is, and one transformed.


def crowd(rng: np.random.Generator, kinds: list[str], scale: Callable[[], float], place: float, moved: bool) -> list:
    """Objects of these kinds around the origin, each of its own scale and up to some `place` of its scales away."""
    found = []
    for name in kinds:
        s = scale()
        thing = SAMPLES[name].random(rng, s)
        thing = shifted(thing, place * s * rng.normal(size=3) - np.array(SAMPLES[name].hull(thing)[0]))
        found.append(stretched(rng, thing) if moved else thing)
    return found


def world(rng: np.random.Generator, scale: Callable[[], float], place: float) -> Scene:
    things = crowd(rng, NAMES, scale, place, False) + crowd(rng, NAMES, scale, place, True)
    return Scene(objects={f"o{i}": x for i, x in enumerate(things)}, camera=Camera(), lights={})


def decades(rng: np.random.Generator) -> tuple[Scene, np.ndarray]:
    """Sizes from 1e-4 to 1e4, looked at from 0.1 to 1000 of one of them away."""
    scene = world(rng, lambda: 10 ** rng.uniform(-4, 4), 3)
    return scene, 10 ** rng.uniform(-4, 4) * rng.normal(size=3)


def nested(rng: np.random.Generator) -> tuple[Scene, np.ndarray]:
    """All around one point, one inside the other, seen from within."""
    return world(rng, lambda: 10 ** rng.uniform(-2, 2), 0.01), 0.1 * rng.normal(size=3)


def far(rng: np.random.Generator) -> tuple[Scene, np.ndarray]:
    """Objects of size 1 seen from a million away."""
    return world(rng, lambda: 1.0, 5), 1e6 * rng.normal(size=3)


def many(rng: np.random.Generator) -> tuple[Scene, np.ndarray]:
    """Enough of each family for a tree of several levels, and behind them planes, which no tree can hold."""
    size = lambda: 10 ** rng.uniform(-1.5, 0)  # noqa: E731
    things = crowd(rng, ["Sphere"] * 50 + ["Triangle"] * 70, size, 20, False)
    things += crowd(rng, ["Box"] * 40 + ["Cone"] * 35, size, 20, True)
    n = rng.normal(size=(40, 3))
    points = 100 * n / np.linalg.norm(n, axis=1, keepdims=True)
    things += [Plane(point=tuple(p.tolist()), normal=tuple((-p).tolist())) for p in points]
    return Scene(objects={f"o{i}": x for i, x in enumerate(things)}, camera=Camera(), lights={}), rng.normal(size=3)


def objects_in_order(scene: Scene) -> list:
    """The objects in the order of the kernel's families."""
    return [scene.objects[name] for batch in geometry_of(scene).batches for name in batch.names]


def rays_at(rng: np.random.Generator, scene: Scene, o: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays at random objects' neighbourhoods from o, and the distances of these targets."""
    things = objects_in_order(scene)
    found = np.empty((n, 3))
    for i, part in enumerate(np.array_split(np.arange(n), len(things))):
        p, d = aimed(rng, things[i], len(part), beyond=1.5)
        # The point of each ray that is nearest to its object.
        middle, _ = SAMPLES[type(things[i]).__name__].hull(things[i])
        m, t = outer(things[i])
        centre = m @ middle + t
        found[part] = p + ((centre - p) * d).sum(1, keepdims=True) * d
    d = rng.permutation(found) - o
    length = np.linalg.norm(d, axis=1)
    return d / length[:, None], length


@dataclass
class World:
    """A scene ready for rays, with rays and what a search may be told about them."""

    scene: Scene
    o: np.ndarray
    d: np.ndarray
    length: np.ndarray
    first: tuple | None = None

    @staticmethod
    def of(make: Callable, seed: int, n: int = RAYS) -> "World":
        rng = np.random.default_rng(seed)
        scene, o = make(rng)
        return World(scene, o, *rays_at(rng, scene, o, n))

    def searched(self, shared: bool, brute_force: bool) -> tuple[np.ndarray, ...]:
        """t and row of the first object, for rays half of which leave one; and whether the target is hidden."""
        n, count = len(self.d), len(self.scene.objects)
        o = triples(self.o if shared else np.broadcast_to(self.o, self.d.shape))
        d, rng = triples(self.d), np.random.default_rng(1)
        source = np.where(rng.random(n) < 0.5, NO_ROW, rng.integers(0, count, n))
        origin = RayOrigin(geometry_of(self.scene), o)
        for batch in origin.batches:
            # A search for roots relies on it that the ray starts on the row, so its answer would have no meaning here.
            if batch.kind.finds_roots:
                source = np.where((source >= batch.first_row) & (source < batch.first_row + len(batch)), NO_ROW, source)
        source = A.put(A.U, source.astype(np.uint32))
        hit = closest(origin, Ray(o, d, row=source, inside=A.put(A.B, rng.random(n) < 0.5)), brute_force)
        length, end, inward = self.ends(rng)
        target = Target(
            A.put(A.D, length), A.put(A.D, 1e-15 * length), A.put(A.U, end.astype(np.uint32)), A.put(A.B, inward)
        )
        hidden = occluded(origin, Ray(o, d), target, A.put(A.B, rng.random(n) < 0.9), brute_force)
        dr.eval(hit, hidden)
        return np.array(hit.t), np.array(hit.row), np.array(hidden)

    def ends(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where shadow rays end: at the first object, or behind its entry and seen from within, or at no object."""
        if self.first is None:
            self.first = self.seen(brute_force=True)
        t, index = self.first
        what = np.where(np.isfinite(t), rng.integers(0, 3, len(t)), 2)
        return np.choose(what, [t, 2 * t, self.length]), np.where(what < 2, index, NO_ROW), what == 1

    def seen(self, brute_force: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """t and row of the first object, for rays from the camera."""
        o = triples(self.o)
        hit = closest(RayOrigin(geometry_of(self.scene), o), Ray(o, triples(self.d)), brute_force)
        dr.eval(hit)
        return np.array(hit.t), np.array(hit.row)


def triples(v: np.ndarray) -> Any:
    return A.put(A.W, np.atleast_2d(v).T)


def same(one: tuple, two: tuple) -> bool:
    return all(np.array_equal(a.view(np.uint8), b.view(np.uint8)) for a, b in zip(one, two))


WORLDS = pytest.mark.parametrize("make", [decades, nested, far])
SEEDS = range(3)


@WORLDS
@pytest.mark.parametrize("shared", [True, False], ids=["one origin", "an origin a ray"])
@pytest.mark.slow
def test_filtered_search_is_the_plain_one_bit_for_bit(make: Callable, shared: bool) -> None:
    hits = hidden = 0
    for seed in SEEDS:
        w = World.of(make, seed)
        fast = w.searched(shared, False)
        assert same(fast, w.searched(shared, True))
        hits, hidden = hits + np.isfinite(fast[0]).sum(), hidden + fast[2].sum()
        if shared:
            assert same(w.seen(), w.seen(brute_force=True))
    assert hits > RAYS and hidden > RAYS / 10


@WORLDS
def test_shared_origin_is_one_origin_a_ray_bit_for_bit(make: Callable) -> None:
    for seed in SEEDS:
        w = World.of(make, seed)
        assert same(w.searched(True, False), w.searched(False, False))


@WORLDS
@pytest.mark.parametrize("shared", [True, False], ids=["one origin", "an origin a ray"])
@pytest.mark.slow
def test_looped_search_is_the_written_out_one_bit_for_bit(
    make: Callable, shared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing written out: every bounded family hangs in a tree, planes and the plain search are looped over."""
    worlds = [World.of(make, seed) for seed in SEEDS]
    written = [w.searched(shared, False) for w in worlds]
    monkeypatch.setattr(policy, "MAX_UNROLLED", 0)
    monkeypatch.setattr(policy, "MAX_UNROLLED_SHARED", 0)
    for w, before in zip(worlds, written):
        assert same(before, w.searched(shared, False))
        assert same(before, w.searched(shared, True))


@WORLDS
@pytest.mark.slow
def test_gathered_objects_are_the_written_out_ones_bit_for_bit(make: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three and more of each family, those that pass the guards gathered as bits: from one origin and from many."""
    w = World.of(make, 0)
    objects = {f"{seed} {name}": x for seed in SEEDS for name, x in World.of(make, seed).scene.objects.items()}
    w = replace(w, scene=replace(w.scene, objects=objects), first=None)
    written = w.searched(True, False)
    assert same(written, w.searched(True, True)) and same(written, w.searched(False, False))
    monkeypatch.setattr(policy, "MAX_INLINED", 0)
    assert same(written, w.searched(True, False))


@pytest.mark.parametrize("shared", [True, False], ids=["one origin", "an origin a ray"])
def test_trees_find_what_the_plain_loop_finds_bit_for_bit(shared: bool) -> None:
    """235 objects in trees of up to 5 levels and a loop."""
    for seed in SEEDS:
        w = World.of(many, seed)
        fast = w.searched(shared, False)
        assert same(fast, w.searched(shared, True))
        assert len(np.unique(fast[1])) > 150


def test_rays_along_the_axes_find_the_same_in_trees_and_loops() -> None:
    """Zero components: the slabs of a tree's boxes have no reciprocal there."""
    side = np.arange(6.0)
    places = np.stack(np.meshgrid(side, side, side, indexing="ij"), -1).reshape(-1, 3)
    things = {f"o{i}": Sphere(center=tuple(p.tolist()), radius=0.25) for i, p in enumerate(places)}
    d = np.array([v for v in np.stack(np.meshgrid(*3 * [[-1, -0.0, 0.0, 1]]), -1).reshape(-1, 3) if np.abs(v).sum()])
    d = np.repeat(d / np.linalg.norm(d, axis=1, keepdims=True), 200, 0)
    for o in (np.array([2.5, 2.5, 2.5]), np.array([2.0, 2.0, 2.5]), np.array([2.0, 2.5, 0.25]), np.zeros(3)):
        w = World(Scene(objects=things, camera=Camera(), lights={}), o, d, np.full(len(d), 3.0))
        for shared in (True, False):
            fast = w.searched(shared, False)
            assert same(fast, w.searched(shared, True))
        assert np.isfinite(fast[0]).any()


@WORLDS
@pytest.mark.slow
def test_the_object_found_is_the_first_by_the_twins(make: Callable) -> None:
    """Each object's own twin in 80 bits; lanes where rounding leaves open which comes first are few."""
    w = World.of(make, 9, 4000)
    t, index = w.seen()
    o = np.broadcast_to(w.o, w.d.shape)
    things = objects_in_order(w.scene)
    exact = [truth(x, o, w.d) for x in things]
    low, high = (np.stack([np.where(e.what > 0, getattr(e, k), np.inf) for e in exact]) for k in ("low", "high"))
    sure = np.all([e.sure for e in exact], axis=0)
    first = np.argmin(low, axis=0)
    second = np.partition(low, 1, axis=0)[1]
    clear = sure & ((high[first, np.arange(len(t))] < second) | np.isinf(second))
    assert clear.mean() > 0.9
    none = np.isinf(low.min(0))
    assert np.array_equal(index[clear & none], np.full((clear & none).sum(), NO_ROW))
    found = clear & ~none
    assert np.array_equal(index[found], first[found])
    slack = gamma(2) * t[found]
    assert (t[found] >= low.min(0)[found] - slack).all()
    assert (t[found] <= high[first, np.arange(len(t))][found] + slack).all()


def test_ties_go_to_the_object_that_comes_first() -> None:
    """Equal spheres, and sheets in one plane, the first of them last in space: the index is that of the first, written
    out and in a tree."""
    for count in (2, policy.MAX_UNROLLED + 8):
        balls = [Sphere(center=(0, 0, -3)) for _ in range(count)]
        sheets = [Rectangle(center=(-0.01 * i, 0, -2), width=(4, 0, 0), height=(0, 4, 0)) for i in range(count)]
        for things in (balls, sheets):
            scene = Scene(objects={f"o{i}": x for i, x in enumerate(things)}, camera=Camera(), lights={})
            w = World(scene, np.zeros(3), np.tile([0.0, 0, -1], (64, 1)), np.full(64, 2.0))
            for plain in (False, True):
                t, index = w.seen(plain)
                assert (index == 0).all() and (t == 2).all()


def test_search_of_nothing() -> None:
    w = World(Scene(camera=Camera(), lights={}), np.zeros(3), np.tile([0.0, 0, -1], (64, 1)), np.full(64, 2.0))
    o = triples(w.o)
    hit = closest(RayOrigin(geometry_of(w.scene), o), Ray(o, triples(w.d)))
    assert not np.array(hit.valid).any()


# Rays that leave what they have hit


@dataclass
class Departure:
    """Objects of a kind, a point on each, and rays that leave it, `per` an object."""

    line: Lineup
    things: list
    p: np.ndarray
    n: np.ndarray
    d: np.ndarray

    @staticmethod
    def of(name: str, count: int, per: int, inside: bool) -> "Departure":
        """The directions fill the hemisphere about the normal, a tenth of them grazing down to a cosine of 1e-12."""
        rng = np.random.default_rng(count)
        things = instances(name, 21, count, moved=False)
        things = [x if i % 2 else stretched(rng, x) for i, x in enumerate(things)]
        # One family a table: a transform that does nothing makes them all transformed.
        things = [x if x.transform else replace(x, transform=(Translate(translate=(0.0, 0.0, 0.0)),)) for x in things]
        p, n, hit = first_points(rng, things)
        things, p, n = [x for x, h in zip(things, hit) if h], p[hit], n[hit]
        d = rng.normal(size=(len(things), per, 3))
        along = (d * n[:, None]).sum(2, keepdims=True)
        graze = rng.random((len(things), per, 1)) < 0.1
        rise = np.abs(along) * np.where(graze, 10 ** rng.uniform(-12, 0, along.shape), 1)
        d = d - along * n[:, None] + (-rise if inside else rise) * n[:, None]
        d /= np.linalg.norm(d, axis=2, keepdims=True)
        return Departure(Lineup(things, per), things, p, n, d)

    def first(self, inside: bool, leaving: bool = True) -> np.ndarray:
        a = self.line.a
        o = np.repeat(self.p, self.line.per, 0)
        ray = self.line.ray(o, self.d, inside=dr.full(a.B, inside, len(o)))
        t = self.line.first(ray, dr.full(a.B, True, len(o)) if leaving else None)
        return np.array(t).reshape(self.d.shape[:2])

    def clear_of_the_surface(self, p: np.ndarray, outside: bool = False) -> np.ndarray:
        """Whether points are inside (or outside) by more than rounding may move the surface. Shapes: p (N, per, 3)."""
        found = []
        for thing, q in zip(self.things, p):
            m, offset = outer(thing)
            local = (real(q) - real(offset)) @ inverse(m).T
            bound = 2 * np.linalg.norm(m, 2) * rounding(thing, local, local * 0, 0.0)
            distance = gap(thing, q)[0]
            found.append((distance > bound) if outside else (distance < -bound))
        return np.array(found)


def first_points(rng: np.random.Generator, things: list) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A point and the outward normal on each object, and whether one was found."""
    per = 32
    rays = [aimed(rng, x, per, beyond=0.5) for x in things]
    line = Lineup(things, per)
    ray = line.ray(*(np.stack([r[i] for r in rays]) for i in (0, 1)))
    t = line.first(ray)
    s = line.surface(ray, t)[0]
    hit = np.isfinite(np.array(t)).reshape(-1, per)
    at = np.arange(len(things)), hit.argmax(1)
    return *(array(x).reshape(-1, per, 3)[at] for x in (s.p, s.n)), hit.any(1)


@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.slow
def test_no_ray_that_leaves_a_convex_object_meets_it_again(name: str) -> None:
    """pbrt's test: 1000 random shapes of random size and transform, 1000 rays from a hit point of each."""
    leave = Departure.of(name, 1000, 1000, inside=False)
    assert len(leave.things) > 900
    assert not np.isfinite(leave.first(inside=False)).any()


def test_departing_rays_would_meet_a_sphere_that_they_do_not_know_to_leave() -> None:
    """The test above can fail: without a source about half of the points are under the surface."""
    leave = Departure.of("Sphere", 100, 100, inside=False)
    again = np.isfinite(leave.first(inside=False, leaving=False))
    assert 0.2 < again.any(1).mean() < 0.8


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.slow
def test_rays_that_run_inside_leave_once_at_the_far_side(name: str) -> None:
    """t is finite and positive and at the exit, by the twin; but for rays that graze: those that leave the object
    shrunk by the rounding bound behind their origin."""
    enter = Departure.of(name, 500, 200, inside=True)
    t = enter.first(inside=True)
    open_ = 0
    for i, thing in enumerate(enter.things):
        m, offset = outer(thing)
        back = inverse(m)
        o = np.broadcast_to((real(enter.p[i]) - real(offset)) @ back.T, enter.d[i].shape)
        d = real(enter.d[i]) @ back.T
        g = rounding(thing, o, d, 0.0)
        with np.errstate(all="ignore"):
            low0, low = SAMPLES[name].twin.interval(thing, o, d, -g)
            _, high = SAMPLES[name].twin.interval(thing, o, d, g)
        sure = (low0 <= low) & (low > 0)
        assert np.isfinite(t[i][sure]).all() and (t[i][sure] > 0).all()
        slack = gamma(2) * high[sure]
        assert (t[i][sure] >= low[sure] - slack).all() and (t[i][sure] <= high[sure] + slack).all()
        open_ += (~sure).sum()
    # A tenth of the rays graze, with cosines that are even over 12 decades; the bound is 1e-11 of the size at worst,
    # and an object flat to a hundredth of its size is left again at its other side.
    assert open_ < 0.1 * t.size


@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.slow
def test_no_object_shades_its_own_lit_side(name: str) -> None:
    """Rays from a light to a point of an object: not blocked by it where its normal is turned to the light, at any
    distance of the light. Grazing ones included."""
    leave = Departure.of(name, 300, 300, inside=False)
    rng, a, line = np.random.default_rng(3), leave.line.a, leave.line
    reach = np.array([SAMPLES[name].hull(x)[1] for x in leave.things])[:, None, None]
    p = np.broadcast_to(leave.p[:, None], leave.d.shape)
    light = p + leave.d * reach * 10 ** rng.uniform(-3, 4, leave.d.shape[:2])[..., None]
    d = p - light
    length = np.linalg.norm(d, axis=2)
    yes, no = (dr.full(a.B, x, length.size) for x in (True, False))
    ray = line.ray(light, d / length[..., None])
    assert not np.array(line.occludes(ray, a.D(length.ravel()), on_end=yes, inward=no)).any()


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.slow
def test_a_wall_seen_from_within_is_lit_from_within_only(name: str) -> None:
    """A light on a ray that runs inside: between entry and exit it is not blocked, beyond the exit it is."""
    enter = Departure.of(name, 200, 100, inside=True)
    a, line, t = enter.line.a, enter.line, enter.first(inside=True)
    sizes = np.array([SAMPLES[name].hull(x)[1] * np.linalg.norm(outer(x)[0], 2) for x in enter.things])[:, None]
    for share, hidden in ((0.5, False), (0.95, False), (1.05, True), (100.0, True)):
        light = enter.p[:, None] + enter.d * (share * np.where(np.isfinite(t), t, sizes))[..., None]
        sure = np.isfinite(t) & enter.clear_of_the_surface(light, hidden)
        # The ray must run inside long enough to be found there: its middle lies deeper than rounding reaches.
        middle = enter.p[:, None] + enter.d * (0.5 * np.where(np.isfinite(t), t, 0))[..., None]
        sure &= enter.clear_of_the_surface(middle)
        assert sure.mean() > 0.8
        d = enter.p[:, None] - light
        length = np.linalg.norm(d, axis=2)
        ray = line.ray(light, d / np.where(length > 0, length, 1)[..., None])
        yes = dr.full(a.B, True, length.size)
        found = np.array(line.occludes(ray, a.D(length.ravel()), on_end=yes, inward=yes))
        found = found.reshape(length.shape)
        assert (found[sure] == hidden).all()


def test_occluded_by_what_lies_between_and_by_nothing_else() -> None:
    """By hand: a ball between, beside, behind the point, behind the light; the point's own object; lights inside."""
    ball, floor = Sphere(center=(0, 5, 0), radius=1), Plane()
    scene = Scene(
        objects={"ball": ball, "floor": floor, "box": Box(min=(10, 4, -1), max=(12, 6, 1))}, camera=Camera(), lights={}
    )
    cases = [
        ((0, 10, 0), (0, 0, 0), 1, False, True),  # straight under the ball
        # The line to (x, 0, 0) passes the ball's centre at 5 x / sqrt(100 + x^2): at 1 for x = 10 / sqrt(24) = 2.041.
        ((0, 10, 0), (2.04, 0, 0), 1, False, True),
        ((0, 10, 0), (2.042, 0, 0), 1, False, False),
        ((0, 3, 0), (0, 0, 0), 1, False, False),  # the ball is behind the light
        ((0, 10, 0), (0, 6, 0), 0, False, False),  # the ball's own top, lit
        ((0, 5, 0), (0, 6, 0), 0, True, False),  # the ball's top from within, light at the centre
        ((0, -5, 0), (0, 6, 0), 0, True, True),  # from within, light outside
        ((11, 5, 0), (11, 0, 0), 1, False, True),  # the light is in the box
        ((0, 10, 0), (20, 10, 0), 1, False, False),
    ]
    light, p = (np.array([c[i] for c in cases], float) for i in (0, 1))
    d = p - light
    length = np.linalg.norm(d, axis=1)
    o = triples(light)
    ray = Ray(o, triples(d / length[:, None]))
    end, inward = A.U(np.array([c[2] for c in cases], np.uint32)), A.B(np.array([c[3] for c in cases]))
    active = dr.full(A.B, True, len(p))
    target = Target(A.D(length), A.D(np.full(len(p), 1e-14)), end, inward)
    for brute_force in (False, True):
        origin = RayOrigin(geometry_of(scene), o)
        found = np.array(occluded(origin, ray, target, active, brute_force))
        assert found.tolist() == [c[4] for c in cases]
        none = occluded(origin, ray, target, dr.full(A.B, False, len(p)), brute_force)
        assert not np.array(none).any()


def test_norm_of_directions_stays_one() -> None:
    """The rays above are unit to 2^-52, as the search expects."""
    w = World.of(decades, 0, 100)
    assert np.abs(norm(real(w.d)) - 1).max() <= gamma(4)


# An object, a point on it, and its normal there; a flat object hides nothing from a light on it.
LAMP_ON = {
    "sphere": (Sphere(material="m"), (0.48, 0.64, 0.6), (0.48, 0.64, 0.6)),
    "cylinder": (Cylinder(radius=1.0, height=3.0, material="m"), (0.6, 0.3, 0.8), (0.6, 0.0, 0.8)),
    "box": (Box(min=(-0.3, -0.4, -0.5), max=(0.3, 0.4, 0.5), material="m"), (0.1, 0.4, 0.2), (0.0, 1.0, 0.0)),
    "rectangle": (
        Rectangle(width=(1.0, 0.1, 0.0), height=(0.0, 0.1, 1.0), material="m"),
        (0.1, 0.01, 0.0),
        (0.0, 1.0, 0.0),
    ),
}


@pytest.mark.parametrize("name", LAMP_ON)
def test_a_light_on_a_surface_lights_the_half_space_before_it(name: str) -> None:
    """Rationale: rounding alone puts such a light inside or outside. Setup: a roof over it, seen from below. Expected:
    the roof is lit before the tangent plane and dark behind it, but for pixels that the border crosses."""
    thing, lamp, n = LAMP_ON[name]
    roof = Plane(point=(0.0, 3.0, 0.0), normal=(0.0, -1.0, 0.0), material="m")
    scene = Scene(
        camera=Camera(origin=(0.0, 1.5, 9.0), target=(0.0, 2.0, 0.0)),
        film=Film(width=96, height=64),
        background=(0.0, 0.0, 0.0),
        materials={"m": Material(ka=(0.0, 0.0, 0.0))},
        objects={"thing": thing, "roof": roof},
        lights={"lamp": PointLight(position=lamp)},
    )
    image = vr.render(scene, spp=1, layers=("RGB", "id", "P"), progress=False)
    before = (image["P"] - np.array(lamp)) @ np.array(n) > 0
    alike = np.ones_like(before)
    for shift in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        alike &= (np.roll(before, shift, (0, 1)) == before) & (np.roll(image["id"], shift, (0, 1)) == 2)
    sure = alike & (image["id"] == 2)
    assert sure.sum() > 500
    np.testing.assert_array_equal(image["RGB"][..., 0][sure] > 0, before[sure])


@pytest.mark.parametrize("normal", [(0.0, 1.0, 0.0), (1.0, 2.0, 3.0)])
def test_a_camera_on_a_plane_does_not_see_it(normal: tuple) -> None:
    camera = Camera(origin=(0.0, 0.0, 0.0), target=normal, up=(1.0, 0.0, 0.3))
    scene = Scene(camera=camera, objects={"floor": Plane(normal=normal)}, film=Film(width=32, height=32), lights={})
    assert not vr.render(scene, spp=1, layers=("RGB", "id"), progress=False)["id"].any()


def test_a_camera_on_a_sphere_sees_its_inside_or_nothing() -> None:
    on = (0.48, 0.64, 0.6)
    for target, seen in (((0.96, 1.28, 1.2), False), ((0.0, 0.0, 0.0), True)):
        scene = Scene(
            camera=Camera(origin=on, target=target),
            objects={"ball": Sphere()},
            film=Film(width=32, height=32),
            lights={},
        )
        image = vr.render(scene, spp=1, layers=("RGB", "id", "distance"), progress=False)
        assert (image["id"] == 1).all() if seen else not image["id"].any()
        # The far side of the unit sphere: 2 cos of the angle to the axis, at most 20 degrees and a corner's 1/cos.
        assert not seen or image["distance"].min() > 2 * np.cos(np.radians(20) * np.sqrt(2))
