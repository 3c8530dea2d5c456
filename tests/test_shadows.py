"""Shadows: what transparent things leave of light against exact chords, who is in the way of whom, and no acne."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from samples import (
    CONVEX,
    NAMES,
    SAMPLES,
    direction,
    inverse,
    outer,
    polynomial_sphere,
    real,
    rounding,
    shifted,
    stretched,
    unit,
)
from test_search import crowd
from test_shading import BLACK, DARK, PRECISIONS, along, seen

from visray.accel import policy
from visray.camera import Camera
from visray.geometry import gamma
from visray.lights import DirectionalLight, DiskLight, PointLight, RectangleLight, SphereLight, SpotLight
from visray.materials import Material
from visray.primitives import Box, Cone, Cylinder, Plane, Polynomial, Rectangle, Sphere, Triangle
from visray.primitives.convex import ConvexSolid
from visray.primitives.flat import Flat
from visray.renderer import render
from visray.scene.scene import Film, Scene, Settings
from visray.setup import prepare
from visray.transforms import Matrix, Rotate, Translate

WHITE = Material(ka=BLACK, kd=(1.0, 1.0, 1.0))
# The polynomial of the sample is a convex solid, though not all are.
SOLIDS = [n for n in NAMES if issubclass(SAMPLES[n].kind, ConvexSolid | Polynomial)]
FLATS = [n for n in NAMES if issubclass(SAMPLES[n].posed.kind, Flat) and n != "Plane"]
EACH_SOLID = pytest.mark.parametrize("name", SOLIDS)
MOVED = pytest.mark.parametrize("moved", [False, True], ids=["as it is", "transformed"])
KT = (1.0, 0.5, 0.125)


def glass(dmax: float, kt: tuple = KT) -> Material:
    return Material(ka=BLACK, kd=(1.0, 1.0, 1.0), kt=kt, dmax=dmax)


def scene_of(things: dict, lights: dict, materials: dict | None = None, **settings: Any) -> Scene:
    """Shadows alone: no path goes on from a surface."""
    settings = {"depth": 0} | settings
    return Scene(camera=Camera(), objects=things, lights=lights, materials={"floor": WHITE} | (materials or {}),
                 settings=Settings(**settings), **DARK)  # fmt: skip


def triple(v: Any) -> tuple:
    return tuple(np.array(v, float).tolist())


@dataclass(frozen=True)
class Room:
    """A floor of any tilt, a place above it for a thing of some size and one for a light, and points in its shadow: of
    the light, or of one far away in its direction.

    All of it is scaled and moved, up to a hundred of its sizes away from the origin of the world.
    """

    n: np.ndarray
    middle: np.ndarray
    size: float
    light: np.ndarray
    how: str
    p: np.ndarray

    @staticmethod
    def of(rng: np.random.Generator, points: int, how: str = "from the light") -> "Room":
        size = 10 ** rng.uniform(-3, 3)
        n = unit(rng.normal(size=3)).astype(float)
        middle = size * 10 ** rng.uniform(-1, 2) * rng.normal(size=3)
        light = middle + size * (rng.uniform(2, 6) * n + rng.uniform(-1, 1, 3))
        within = unit(rng.normal(size=(points, 3))).astype(float) * rng.uniform(size=(points, 1)) ** (1 / 3)
        q = middle + 1.1 * size * within
        d = np.broadcast_to(middle - light, q.shape) if how == "from afar" else q - light
        p = q + d * (((middle - 3 * size * n - q) @ n) / (d @ n))[:, None]
        return Room(n, middle, size, light, how, p)

    @property
    def floor(self) -> Plane:
        return Plane(point=triple(self.middle - 3 * self.size * self.n), normal=triple(self.n), material="floor")

    def seen(self, scene: Scene, brute_force: bool = False) -> np.ndarray:
        """The floor's colours at its points, from below all things."""
        step = self.size * (0.5 * self.n + 0.1 * np.cross(self.n, (0.3, 0.5, 0.7)))
        return along(
            prepare(scene, brute_force=brute_force), self.p + step, np.broadcast_to(-step, self.p.shape)
        ).astype(float)

    @property
    def lamp(self) -> Any:
        return LIGHTS[self.how](self.light, self.middle - self.light)

    @property
    def ways(self) -> tuple[np.ndarray, np.ndarray]:
        """Where light comes from and its way to the points, from afar from beyond all things."""
        if self.how == "from afar":
            d = np.broadcast_to(8 * (self.middle - self.light), self.p.shape)
            return self.p - d, d
        return np.broadcast_to(self.light, self.p.shape), self.p - self.light

    @property
    def cosine(self) -> np.ndarray:
        return -(unit(self.ways[1]).astype(float) @ self.n)

    def slip(self, precision: str) -> float:
        """By how much the floor's points are off; and a small light's place, and in single the way to it."""
        off = gamma(16) * float(np.abs(self.p).sum(1).max() + 10 * self.size)
        if self.how == "from the points":
            off += 2e-9 + (gamma(16, "single") * 10 * self.size if precision == "single" else 0)
        return off

    def chords(self, things: list, precision: str) -> list["Chord"]:
        return [chord(t, *self.ways, self.slip(precision)) for t in things]

    def check(self, found: np.ndarray, chords: list["Chord"], dmax: float, kts: list, precision: str) -> float:
        """Whether the colours found are the cosine times the shares of all chords. Returns how many points are sure."""
        far = np.linalg.norm(self.ways[1], axis=1)
        bounds = [left(c, far, dmax, kt) for c, kt in zip(chords, kts)]
        low, high = (np.prod([b[i] for b in bounds], 0) * self.cosine[:, None] for i in (0, 1))
        sure = np.all([c.met | c.missed for c in chords], axis=0)
        # Cosine and each share: some roundings of positive factors. And the cosine is off by what the point is off over
        # the distance of the light, which is 5 sizes at least.
        slack = gamma(20 + 4 * len(chords), precision) + self.slip(precision) / self.size
        assert (found[sure] >= (low * (1 - slack))[sure]).all()
        assert (found[sure] <= (high * (1 + slack))[sure]).all()
        return float(sure.mean())


def fitted(rng: np.random.Generator, name: str, middle: np.ndarray, size: float, moved: bool) -> Any:
    """A random object of a kind that just fits into the ball of that middle and size."""
    thing = SAMPLES[name].random(rng, size)
    thing = stretched(rng, thing) if moved else thing
    centre, reach = SAMPLES[name].hull(thing)
    m = outer(thing)[0]
    factor = size / (reach * np.linalg.norm(m, 2))
    if moved:
        matrix = np.c_[factor * m, middle - factor * m @ centre]
        return replace(thing, transform=(Matrix(matrix=tuple(map(tuple, matrix.tolist()))),))
    if isinstance(thing, Polynomial):
        return polynomial_sphere(triple(middle), size)
    sizes = {k: factor * getattr(thing, k) for k in ("radius", "height") if isinstance(getattr(thing, k, None), float)}
    triples = "width", "height", "a", "b", "c", "min", "max", "radii"
    sizes |= {k: triple(factor * np.array(getattr(thing, k))) for k in triples
              if isinstance(getattr(thing, k, None), tuple)}  # fmt: skip
    thing = replace(thing, **sizes)
    return shifted(thing, middle - SAMPLES[name].hull(thing)[0])


@dataclass(frozen=True)
class Chord:
    """How long rays are inside an object: bounds within rounding, and where it is certain that they meet it or not.

    For a flat object the length is 0.
    """

    low: np.ndarray
    high: np.ndarray
    met: np.ndarray
    missed: np.ndarray


def chord(thing: Any, o: Any, d: Any, slip: float) -> Chord:
    """Of the part of a ray before the distance 1 in units of d, in 80 bits. `slip`: by how much its ends may be off."""
    m, offset = outer(thing)
    back = inverse(m)
    o, d = np.broadcast_arrays((real(o) - real(offset)) @ back.T, real(d) @ back.T)
    g = rounding(thing, o, d, 1.0) + slip * np.linalg.norm(back.astype(float), 2)
    twin = SAMPLES[type(thing).__name__].twin
    with np.errstate(all="ignore"):
        if not hasattr(twin, "interval"):
            t, outside = twin.crossing(thing, o, d, 0)
            lean = g / np.abs(unit(d) @ twin.plane(thing)[0])
            inside = (t > 0) & (t < 1)
            return Chord(0 * t, 0 * t, inside & (outside < -lean - g), ~inside | (outside > lean + g))
        (grown, shrunk) = (twin.interval(thing, o, d, s * g) for s in (1, -1))
    low, high = (np.clip(t[1], 0, 1) - np.clip(t[0], 0, 1) for t in (shrunk, grown))
    met = (shrunk[0] <= shrunk[1]) & (shrunk[1] > 0) & (shrunk[0] < 1)
    missed = ~(grown[0] <= grown[1]) | (grown[1] < 0) | (grown[0] > 1)
    return Chord(np.maximum(low, 0), np.maximum(high, 0), met, missed)


def left(c: Chord, far: np.ndarray, dmax: float, kt: tuple = KT) -> tuple[np.ndarray, np.ndarray]:
    """The least and the greatest colour that may be left of light beyond an object, 1 where it is missed."""
    shares = [1 - np.minimum(np.asarray(l * far, float) / dmax, 1) for l in (c.high, c.low)]
    low, high = (np.where(c.met[:, None], s[:, None] * np.array(kt), 1) for s in shares)
    return low, high


LIGHTS = {
    "from the light": lambda at, d: PointLight(position=triple(at)),
    "from the points": lambda at, d: SphereLight(position=triple(at), radius=1e-9, samples=2),
    "from afar": lambda at, d: DirectionalLight(direction=triple(d)),
}


@PRECISIONS
@MOVED
@EACH_SOLID
@pytest.mark.slow
def test_light_through_a_solid_is_tinted_by_its_thickness(name: str, moved: bool, precision: str) -> None:
    """kt (1 - min(d / dmax, 1)), d exactly as long as the ray is inside: over 6 decades of size, rays from a point
    light, and rays to a small light and to one far away, grazing ones included."""
    rng, met = np.random.default_rng(1), 0
    for how in list(LIGHTS) * 3:
        room = Room.of(rng, 600, how)
        thing = fitted(rng, name, room.middle, room.size, moved)
        dmax = room.size * 10 ** rng.uniform(-1, 1)
        things = {"floor": room.floor, "thing": replace(thing, material="glass")}
        found = room.seen(scene_of(things, {"l": room.lamp}, {"glass": glass(dmax)}, precision=precision))
        chords = room.chords([thing], precision)
        assert room.check(found, chords, dmax, [KT], precision) > 0.9
        met += chords[0].met.mean()
    assert met > 9 * 0.1


@PRECISIONS
@MOVED
@EACH_SOLID
def test_light_in_a_thing_is_tinted_once(name: str, moved: bool, precision: str) -> None:
    """What is entered and not left, or left and not entered, counts by its kt alone."""
    rng = np.random.default_rng(2)
    for how in ("from the light", "from the points"):
        room = Room.of(rng, 200)
        thing = fitted(rng, name, room.middle, room.size, moved)
        things = {"floor": room.floor, "thing": replace(thing, material="glass")}
        materials = {"glass": glass(1e-3 * room.size)}
        found = room.seen(scene_of(things, {"l": LIGHTS[how](room.middle, None)}, materials, precision=precision))
        hand = replace(room, light=room.middle).cosine[:, None] * np.array(KT)
        slip = (gamma(16) * np.abs(room.p).sum(1).max() + 2e-9) / room.size
        assert (np.abs(found - hand) <= (gamma(24, precision) + slip) * hand).all()


@PRECISIONS
@EACH_SOLID
def test_the_far_side_of_a_thing_is_lit_through_it(name: str, precision: str) -> None:
    """Seen from within, a wall gets the light from outside that entered on the other side, kt (1 - min(d / dmax, 1));
    seen from outside, its lit side is not tinted by itself.

    Against the same wall seen as good as clear: a dmax of 1e9.
    """
    rng, lit = np.random.default_rng(3), 0
    for how in list(LIGHTS) * 2:
        size = 10 ** rng.uniform(-2, 2)
        thing = fitted(rng, name, size * rng.normal(size=3), size, True)
        m, offset = outer(thing)
        middle = m @ SAMPLES[name].hull(thing)[0] + offset
        away = unit(rng.normal(size=3)).astype(float)
        lamp = LIGHTS[how](middle + 5 * size * away, -away)
        dmax = size * 10 ** rng.uniform(-0.5, 1)
        d = rng.normal(size=(400, 3))
        things = {"t": replace(thing, material="glass")}
        tinted, clear = (
            seen(scene_of(things, {"l": lamp}, {"glass": glass(x)}, precision=precision), middle, d).astype(float)
            for x in (dmax, 1e9)
        )
        # The wall's points, from the exit of the rays from within.
        back = inverse(m)
        _, exit_ = SAMPLES[name].twin.interval(thing, (real(middle) - offset) @ back.T, real(d) @ back.T, 0.0)
        p = middle + exit_.astype(float)[:, None] * d
        start = p - 20 * size * -away if how == "from afar" else np.broadcast_to(middle + 5 * size * away, p.shape)
        way = p - start
        slip = gamma(32) * size * 30 + 1e-9 + (gamma(16, "single") * 10 * size if precision == "single" else 0)
        c = chord(thing, start, way, slip)
        there = (clear[:, 1] > 0) & c.met
        low, high = left(c, np.linalg.norm(way, axis=1), dmax, (1.0, 1.0, 1.0))
        ratio = tinted[there, 1] / clear[there, 1]
        slack = gamma(16, precision) + 3 * size / 1e9
        assert (ratio >= low[there, 1] * (1 - slack)).all() and (ratio <= high[there, 1] * (1 + slack)).all()
        assert np.array_equal(tinted[clear[:, 1] == 0], np.zeros((int((clear[:, 1] == 0).sum()), 3)))
        # The wall is white: its colour is that of the light, which came through it.
        assert np.allclose(clear[there] / clear[there][:, :1], np.array(KT), rtol=gamma(8, precision), atol=0)
        lit += there.mean()
    assert lit > 6 * 0.2


@PRECISIONS
@pytest.mark.parametrize("name", FLATS)
def test_light_through_a_sheet_is_tinted_by_kt(name: str, precision: str) -> None:
    rng, met = np.random.default_rng(4), 0
    for how in list(LIGHTS) * 2:
        room = Room.of(rng, 600, how)
        thing = fitted(rng, name, room.middle, room.size, True)
        things = {"floor": room.floor, "thing": replace(thing, material="glass")}
        found = room.seen(scene_of(things, {"l": room.lamp}, {"glass": glass(1e-9)}, precision=precision))
        chords = room.chords([thing], precision)
        assert room.check(found, chords, 1.0, [KT], precision) > 0.9
        met += chords[0].met.mean()
    assert met > 6 * 0.05


# Several things


def several(rng: np.random.Generator, room: Room) -> dict:
    """Solids and sheets of all kinds that overlap, one of each as it is and one transformed."""
    found = {}
    for i, name in enumerate((SOLIDS + FLATS) * 2):
        middle = room.middle + 0.4 * room.size * rng.uniform(-1, 1, 3)
        found[f"t{i}"] = fitted(rng, name, middle, room.size * rng.uniform(0.5, 1), i >= len(SOLIDS + FLATS))
    return found


@pytest.mark.parametrize("how", LIGHTS)
@pytest.mark.parametrize(
    ("written", "precision"),
    [(True, "single"), (True, "double"), (False, "single")],
    ids=["written out, single", "written out, double", "in trees"],
)
@pytest.mark.slow
def test_things_that_overlap_multiply(how: str, written: bool, precision: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """16 things of one material, so that none can be told from another by it: each counts for itself, the product of
    all; and in any order, written out or in trees."""
    if not written:
        monkeypatch.setattr(policy, "MAX_UNROLLED", 0)
        monkeypatch.setattr(policy, "MAX_UNROLLED_SHARED", 0)
    rng = np.random.default_rng(5)
    room = Room.of(rng, 1500, how)
    things, dmax, kt = several(rng, room), 3 * room.size, (0.9, 0.8, 0.7)
    chords, pictures = room.chords(list(things.values()), precision), []
    for order in (list(things), list(reversed(things))):
        objects = {"floor": room.floor} | {name: replace(things[name], material="glass") for name in order}
        scene = scene_of(objects, {"l": room.lamp}, {"glass": glass(dmax, kt)}, precision=precision)
        pictures.append(room.seen(scene))
        assert room.check(pictures[-1], chords, dmax, [kt] * len(things), precision) > 0.8
    pictures.append(room.seen(scene, brute_force=True))
    for other in pictures[1:]:
        assert (np.abs(pictures[0] - other) <= gamma(2 * len(things), precision) * other).all()
    assert (np.sum([c.met for c in chords], axis=0) >= 4).mean() > 0.2


@pytest.mark.parametrize("how", LIGHTS)
def test_many_things_in_trees_multiply(how: str) -> None:
    """60 balls and 45 boxes, every tenth of a colour that leaves no red: their trees, the plain loop, and the product
    of exact shares."""
    rng = np.random.default_rng(6)
    room = Room.of(rng, 2000, how)
    things = []
    for name in ["Sphere"] * 60 + ["Box"] * 45:
        middle = room.middle + room.size * rng.uniform(-0.7, 0.7, 3)
        things.append(fitted(rng, name, middle, room.size * rng.uniform(0.1, 0.4), False))
    kt, dmax = (0.95, 0.9, 0.8), 5 * room.size
    names = ["glass" if i % 10 else "blue" for i in range(105)]
    materials = {"glass": glass(dmax, kt), "blue": glass(dmax, (0.0, 0.5, 1.0))}
    objects = {"floor": room.floor} | {f"t{i}": replace(x, material=n) for i, (x, n) in enumerate(zip(things, names))}
    scene = scene_of(objects, {"l": room.lamp}, materials)
    found, plain = room.seen(scene), room.seen(scene, brute_force=True)
    assert (np.abs(found - plain) <= gamma(2 * 105, "single") * plain).all()
    chords = room.chords(things, "single")
    # The way to a small light is known in single: at one of 105 edges, more often than elsewhere.
    assert room.check(found, chords, dmax, [materials[n].kt for n in names], "single") > 0.9
    assert np.sum([c.met for c in chords], axis=0).max() >= 10


@PRECISIONS
@pytest.mark.parametrize("how", ["from the light", "from the points"])
def test_what_is_behind_a_light_does_not_count(how: str, precision: str) -> None:
    """The original went on to the full distance after the first transparent thing, and so beyond the light."""
    rng = np.random.default_rng(7)
    room = Room.of(rng, 500, how)
    ball = Sphere(center=triple(room.middle), radius=0.5 * room.size, material="glass")
    up = unit(room.light - room.middle).astype(float)
    shade = fitted(rng, "Box", room.light + 1.5 * room.size * up, room.size, False)
    beside = shifted(shade, 50 * room.size * np.cross(up, unit(np.cross(up, (0.2, 0.5, 0.7))).astype(float)))
    lamp, materials = {"l": room.lamp}, {"glass": glass(3 * room.size), "dark": WHITE}
    for material in ("dark", "glass"):
        boxes = (replace(x, material=material) for x in (shade, beside))
        behind, aside = (
            room.seen(scene_of({"floor": room.floor, "ball": ball, "box": x}, lamp, materials, precision=precision))
            for x in boxes
        )
        assert np.array_equal(behind, aside)
        assert (behind.min(1) < 0.9 * room.cosine).any() and (behind > 0).all()


ALL_LIGHTS = {
    "point": PointLight(position=(1.0, 6.0, 2.0), c=0.01),
    "sun": DirectionalLight(direction=(-0.3, -1.0, 0.2)),
    "spot": SpotLight(position=(-3.0, 5.0, 1.0), direction=(0.5, -1.0, 0.0), angle=50.0, exponent=1.5),
    "panel": RectangleLight(position=(0.0, 5.0, -1.0), width=(2.0, 0.3, 0.0), samples=8),
    "disk": DiskLight(position=(2.0, 4.0, 2.0), normal=(1.0, 2.0, 0.0), radius=0.8, samples=8),
    "bulb": SphereLight(position=(-2.0, 5.0, -2.0), radius=0.5, samples=8),
}


@PRECISIONS
@pytest.mark.slow
def test_opaque_things_are_as_dark_as_without_colour(precision: str) -> None:
    """With something transparent in the scene, shadows are colours; where it is not in the way they are the same, bit
    for bit, whatever the light."""
    rng = np.random.default_rng(8)
    dark = [replace(x, material="dark") for x in crowd(rng, SOLIDS + FLATS, lambda: 0.5, 3, True)]
    things = {"floor": Plane(point=(0, -2, 0), material="floor")} | {f"t{i}": x for i, x in enumerate(dark)}
    materials = {"dark": WHITE, "glass": glass(1.0)}
    far = {"far": Sphere(center=(0.0, -500.0, 0.0), material="glass")}
    d = rng.normal(size=(4000, 3)) - (0, 1.0, 0)
    grey, colour = (
        seen(scene_of(objects, ALL_LIGHTS, materials, precision=precision), (0.5, 4.0, 0.3), d)
        for objects in (things, things | far)
    )
    assert np.array_equal(grey, colour)
    # All shades there are: of six lights, none and some and all.
    assert (grey == 0).any() and len(np.unique(grey[:, 0])) > 1000


@pytest.mark.slow
def test_what_is_clear_throws_no_shadow() -> None:
    """kt = 1 and a dmax of 1e9: nothing is lost but 1e-9 of the thickness."""
    rng = np.random.default_rng(9)
    things = crowd(rng, SOLIDS + FLATS, lambda: 0.5, 3, True)
    clear = {f"t{i}": replace(x, material="glass") for i, x in enumerate(things)}
    floor = {"floor": Plane(point=(0, -4, 0), material="floor")}
    p = np.c_[rng.uniform(-4, 4, (2000, 1)), np.full((2000, 1), -4.0), rng.uniform(-4, 4, (2000, 1))]
    step, materials = np.array([0.001, 0.002, 0.0]), {"glass": glass(1e9, (1.0, 1.0, 1.0))}
    with_them, without = (
        seen(scene_of(floor | more, ALL_LIGHTS, materials), p + step, np.broadcast_to(-step, p.shape))
        for more in (clear, {})
    )
    assert (without > 0).all()
    assert (np.abs(with_them - without) <= (gamma(14, "single") + 14 * 10 / 1e9) * without).all()


# The original's own


def marched(objects: list, p: np.ndarray, light: np.ndarray) -> np.ndarray:
    """The shadow as the original's report has it: from crossing to crossing of one ray, in the order of distance.

    objects: (centre, radius, kt, dmax) of balls. At a ball's first crossing its point is kept, at the second
    S *= (1 - min(d / dmax, 1)) kt; of what is entered and not left, S *= kt.
    """
    d = light - p
    far = np.linalg.norm(d)
    crossings = []
    for number, (centre, radius, _, _) in enumerate(objects):
        b, c = (p - centre) @ d / far, (p - centre) @ (p - centre) - radius * radius
        root = b * b - c
        crossings += [(t, number) for s in (-1, 1) if root > 0 and 0 < (t := -b + s * np.sqrt(root)) < far]
    share, entered = np.ones(3), {}
    for t, number in sorted(crossings):
        _, _, kt, dmax = objects[number]
        if number not in entered:
            entered[number] = t
            continue
        share = share * (1 - min((t - entered.pop(number)) / dmax, 1)) * kt
    for number in entered:
        share = share * objects[number][2]
    return share


@PRECISIONS
def test_two_transparent_balls_of_the_original(precision: str) -> None:
    """Its scene "transparencies": two that overlap over a ground that is a ball of radius 100."""
    balls = {
        "one": (np.array([0.0, 1.0, 0.0]), 1.5, np.array([0.8, 0.5, 0.5]), 50.0),
        "two": (np.array([1.25, 1.0, 0.0]), 1.5, np.array([0.7, 0.7, 1.0]), 2.5),
    }
    light, centre = np.array([2.0, 5.0, 2.0]), np.array([0.0, -100.5, -1.0])
    materials = {name: Material(ka=BLACK, kd=BLACK, kt=triple(b[2]), dmax=b[3]) for name, b in balls.items()}
    things = {name: Sphere(center=triple(b[0]), radius=b[1], material=name) for name, b in balls.items()}
    things["ground"] = Sphere(center=triple(centre), radius=100.0, material="floor")
    lamp = PointLight(position=triple(light), Id=(0.7, 0.7, 0.7), a=0.5, c=0.01)
    rng = np.random.default_rng(10)
    p = np.c_[rng.uniform(-5, 4, (3000, 1)), np.zeros((3000, 1)), rng.uniform(-5, 4, (3000, 1))]
    n = unit(p - centre).astype(float)
    p = centre + 100 * n
    step = 1e-3 * n
    found = seen(scene_of(things, {"l": lamp}, materials, precision=precision), p + step, -step).astype(float)
    # Ground within a ball is seen from within it: as far as it is a point to be lit, it is entered and not left.
    way = light - p
    far = np.linalg.norm(way, axis=1)
    cosine = (way * n).sum(1) / far
    share = np.array([marched(list(balls.values()), q, light) for q in p])
    hand = 0.7 * (np.maximum(cosine, 0) / (0.5 + 0.01 * far**2))[:, None] * share
    # Rounding moves the point by 8 roundings of some 300, which a chord near an edge multiplies by the root of that.
    slip = gamma(16) * 300
    edge = np.sqrt(2 * 1.5 * slip) / 2.5
    assert (np.abs(found - hand) <= (gamma(30, precision) + slip) * hand + 2 * edge).all()
    kinds = len(np.unique(np.round(share, 6), axis=0))
    assert kinds > 500 and (share == 1).all(1).any()


# Who is in the way: brute force

PRIMARIES = np.eye(3)


def visible(lamps: list, things: dict, o: np.ndarray, d: np.ndarray, precision: str) -> np.ndarray:
    """Whether the light of each of three lamps gets to the points that rays see, told by its colour. Shape (N, 3)."""
    lights = {f"l{i}": replace(l, Id=triple(c)) for i, (l, c) in enumerate(zip(lamps, PRIMARIES))}
    return seen(scene_of(things, lights, {"m": WHITE}, precision=precision), o, d) > 0


def cast(rng: np.random.Generator, kinds: list, scale: float, apart: float = 1) -> tuple[dict, np.ndarray, np.ndarray]:
    """Things of these kinds around the origin, every other one transformed, and rays at them; `apart`: how much smaller
    they are than the space they fill."""
    sizes = lambda: scale * 10 ** rng.uniform(-0.5, 0.5) / apart  # noqa: E731
    things = crowd(rng, kinds[::2], sizes, 2 * apart, False) + crowd(rng, kinds[1::2], sizes, 2 * apart, True)
    o = scale * 10 * unit(rng.normal(size=3)).astype(float)
    d = scale * 2 * rng.normal(size=(4000, 3)) - o
    return {f"t{i}": replace(x, material="m") for i, x in enumerate(things)}, o, d


TETRAHEDRON = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)


def agree(first: list, second: list, things: dict, o: np.ndarray, d: np.ndarray, precision: str) -> np.ndarray:
    """Points lit, not lit, and open. first: a lamp, one that must agree with it, and one that it is moved to; second:
    three more that it is moved to. Where a move changes the answer, an edge is within rounding: it is open."""
    answers = np.hstack([visible(lamps, things, o, d, precision) for lamps in (first, second)])
    same = (answers[:, [2, 3, 4, 5]] == answers[:, :1]).all(1)
    assert np.array_equal(answers[same, 1], answers[same, 0])
    return np.array([(same & answers[:, 0]).sum(), (same & ~answers[:, 0]).sum(), (~same).sum()])


@PRECISIONS
@pytest.mark.slow
def test_rays_from_a_light_and_rays_to_it_agree(precision: str) -> None:
    """A point light, whose rays start at the light, and a tiny area light, whose rays start at the points: over scenes
    of things of all kinds and 6 decades of size, the same points are lit, but for those that a move of the light within
    rounding would light or darken."""
    rng, total = np.random.default_rng(11), np.zeros(3)
    for i in range(8):
        scale = 10 ** rng.uniform(-3, 3)
        things, o, d = cast(rng, NAMES[::-1] if i % 2 else NAMES, scale)
        at = scale * 6 * rng.normal(size=3)
        off = scale * 30 * gamma(16, precision) + 1e-9
        place = triple(at)
        small = RectangleLight(position=place, width=(1e-9, 0, 0), height=(0, 0, 1e-9), samples=1)
        moved = [PointLight(position=triple(at + off * v)) for v in TETRAHEDRON]
        total += agree([PointLight(position=place), small, moved[0]], moved[1:], things, o, d, precision)
    lit, dark, open_ = total / total.sum()
    assert lit > 0.05 and dark > 0.05 and open_ < 0.01


@PRECISIONS
@pytest.mark.slow
def test_a_light_far_away_agrees_with_one_infinitely_far(precision: str) -> None:
    """A directional light and a point light 1e6 sizes away: seen from each other's points, they differ by 1e-5 of an
    angle, within which edges are left out."""
    rng, total = np.random.default_rng(12), np.zeros(3)
    for _ in range(6):
        scale = 10 ** rng.uniform(-2, 2)
        # A plane would hide half of all directions.
        things, o, d = cast(rng, SOLIDS + FLATS, scale)
        l = unit(rng.normal(size=3)).astype(float)
        moved = [DirectionalLight(direction=triple(-l - 3e-5 * v)) for v in TETRAHEDRON]
        far = PointLight(position=triple(1e6 * scale * l))
        total += agree([DirectionalLight(direction=triple(-l)), far, moved[0]], moved[1:], things, o, d, precision)
    lit, dark, open_ = total / total.sum()
    assert lit > 0.05 and dark > 0.05 and open_ < 0.02


@pytest.mark.parametrize("kt", [0.0, 0.5], ids=["opaque", "transparent"])
@pytest.mark.slow
def test_guards_leave_no_shadow_out(kt: float) -> None:
    """Lights as wide as the scene and in the midst of it, so that some points are nearer to their middle than their
    edge: the picture is that of the plain search, bit for bit where shadows are grey."""
    rng, lit = np.random.default_rng(13), 0
    for _ in range(4):
        scale = 10 ** rng.uniform(-2, 2)
        things, o, d = cast(rng, NAMES, scale, 5)
        a, b, c = (triple(scale * rng.normal(size=3)) for _ in range(3))
        w, h = (triple(s * scale * rng.normal(size=3)) for s in (9, 3))
        lamps = {
            "panel": RectangleLight(position=a, width=w, height=h, samples=8),
            "disk": DiskLight(position=b, normal=direction(rng), radius=4 * scale, samples=8),
            "bulb": SphereLight(position=c, radius=3 * scale, samples=8),
        }
        scene = scene_of(things, lamps, {"m": replace(WHITE, kt=(kt, kt, kt), dmax=10 * scale)})
        fast, plain = (along(prepare(scene, brute_force=p), o, d) for p in (False, True))
        assert (np.abs(fast - plain) <= (gamma(2 * len(things), "single") if kt else 0) * plain).all()
        lit += (plain > 0).mean()
    assert lit > 4 * 0.2


# Acne


def lamps_around(rng: np.random.Generator, middle: np.ndarray, reach: float) -> dict:
    """A light of each kind, 2 to 100 reaches away; area lights up to half a reach wide."""

    def away() -> tuple:
        return triple(middle + reach * 10 ** rng.uniform(0.3, 2) * unit(rng.normal(size=3)).astype(float))

    size = max(0.3 * reach, 1e-8)
    return {
        "point": PointLight(position=away()),
        "sun": DirectionalLight(direction=direction(rng)),
        "spot": SpotLight(position=away(), direction=direction(rng), angle=120.0),
        "panel": RectangleLight(position=away(), width=(size, 0, 0), height=(0, size, size), samples=8),
        "disk": DiskLight(position=away(), radius=size, samples=8),
        "bulb": SphereLight(position=away(), radius=size, samples=8),
    }


def looks(rng: np.random.Generator, thing: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays at an object, from 2 to 1000 of its reaches away."""
    middle, reach = SAMPLES[type(thing).__name__].hull(thing)
    m, t = outer(thing)
    within = unit(rng.normal(size=(count, 3))).astype(float) * rng.uniform(size=(count, 1)) ** (1 / 3)
    away = unit(rng.normal(size=(count, 3))).astype(float) * 10 ** rng.uniform(0.3, 3, (count, 1))
    # In the world's measure: a transform may flatten it.
    o = m @ middle + t + np.linalg.norm(m, 2) * reach * away
    return o, (middle + reach * within) @ m.T + t - o


def alone(rng: np.random.Generator, name: str) -> tuple[Any, np.ndarray, float]:
    """A random object of a kind over 6 decades of size, its middle and its reach in the world."""
    while True:
        thing = stretched(rng, SAMPLES[name].random(rng, 10 ** rng.uniform(-3, 3)))
        (middle, reach), (m, t) = SAMPLES[name].hull(thing), outer(thing)
        # A light or a transform farther than 1e9 is no scene.
        if reach * np.linalg.norm(m, 2) < 1e6 and np.abs(t).max() < 1e8:
            return thing, m @ middle + t, reach * float(np.linalg.norm(m, 2))


@PRECISIONS
@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.slow
def test_no_convex_thing_shades_itself(name: str, precision: str) -> None:
    """pbrt's test, end to end: random shapes, points on them that eyes see, lights of all kinds all around. The picture
    is the same bit for bit as without shadows."""
    rng, lit = np.random.default_rng(14), 0
    for _ in range(6):
        thing, middle, reach = alone(rng, name)
        objects, lamps = {"t": replace(thing, material="m")}, lamps_around(rng, middle, reach)
        # A second thing, far from all: shadows are not left out where nothing can throw one.
        far = middle + 1e4 * reach * unit(rng.normal(size=3)).astype(float)
        objects["far"] = Sphere(center=triple(far), radius=reach, material="m")
        o, d = looks(rng, thing, 600)
        with_them, without = (seen(scene_of(objects, lamps, {"m": WHITE}, precision=precision, shadows=s), o, d)
                              for s in (True, False))  # fmt: skip
        assert np.array_equal(with_them, without)
        lit += (without > 0).mean()
    assert lit > 6 * 0.05


TURN = (Rotate(rotate=12.0, axis=(1.0, 0.3, 0.2)), Translate(translate=(0.1, 0.2, 0.3)))


@PRECISIONS
@pytest.mark.parametrize("turn", [(), TURN], ids=["upright", "turned"])
def test_what_lies_flush_has_no_acne_under_any_light(turn: tuple, precision: str) -> None:
    """On a box a label and a leaf; and things that have their top in its top: boxes, one of them the same again, a can
    and a hat. Under lights whose rays start at the points it is as bright as the box alone."""
    box = Box(min=(-1, 0, -1), max=(2, 1, 1))
    flush = {
        "label": Rectangle(center=(0.3, 1, 0), width=(1.1, 0, 0), height=(0, 0, -1.3)),
        "leaf": Triangle(a=(-0.7, 1, -0.3), b=(0.9, 1, 0.8), c=(1.1, 1, -0.7)),
        "part": Box(min=(0.1, 0, -1), max=(2, 1, 1)),
        "again": box,
        "can": Cylinder(center=(0.5, 0.5, 0.0), radius=0.9, height=1.0),
        "hat": Cone(base=(0.5, 1.0, 0.0), axis=(0.0, -1.0, 0.0), radius=0.9, height=0.9),
    }
    lamps = {
        "sun": DirectionalLight(direction=(-0.3, -1.0, -0.5)),
        "panel": RectangleLight(position=(1.0, 5.0, 2.0), width=(2.0, 0, 0), samples=8),
        "bulb": SphereLight(position=(-2.0, 4.0, 1.0), radius=0.7, samples=8),
    }
    rng = np.random.default_rng(15)
    goal = np.c_[rng.uniform(-0.95, 1.95, (4000, 1)), np.ones((4000, 1)), rng.uniform(-0.95, 0.95, (4000, 1))]
    m, t = outer(replace(box, transform=turn))
    o, goal = m @ np.array([0.3, 5, 4]) + t, goal @ m.T + t

    def picture(things: dict) -> np.ndarray:
        placed = {k: replace(x, transform=turn, material="m") for k, x in things.items()}
        return seen(scene_of(placed, lamps, {"m": WHITE}, precision=precision), o, goal - o)

    single, both = picture({"box": box}), picture({"box": box, **flush})
    assert (single > 0.5).all()
    assert (np.abs(both - single) <= gamma(60, precision) * single).all()


@pytest.mark.parametrize(("size", "height"), [(2.0, 0.1), (2.0, 0.01), (200.0, 0.1)])
def test_a_light_flush_with_a_tilted_plane_is_not_in_its_shadow(size: float, height: float) -> None:
    """Seen near the light and away from its middle: the way there is a difference of longer ways, in single."""
    n = np.array([0.3, 0.5, 0.7]) / np.linalg.norm([0.3, 0.5, 0.7])
    x = np.cross(n, [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    y = np.cross(n, x)
    place = lambda v: tuple(map(float, v))  # noqa: E731
    aside = 0.3 * size * x + 0.2 * size * y
    panel = RectangleLight(position=(0, 0, 0), width=place(size * x), height=place(size * y), samples=16)
    scene = Scene(
        camera=Camera(origin=place(aside - 0.5 * height * n), target=place(aside - height * n + 1e-3 * x), fov=60.0),
        film=Film(width=48, height=48),
        lights={"panel": panel},
        objects={"ceiling": Plane(normal=place(n)), "floor": Plane(point=place(-height * n), normal=place(n))},
        settings=Settings(spp=2),
    )
    lit, free = (
        render(replace(scene, settings=replace(scene.settings, shadows=on)), layers=("RGB",), progress=False)["RGB"]
        for on in (True, False)
    )
    assert np.array_equal(lit, free) and free.min() > 1e-4
