"""Transparent solids in each other: the index of the smallest one holds, whatever the order of the file."""

from itertools import pairwise, permutations
from typing import Any

import numpy as np
import pytest
from test_paths import (
    BLACK,
    FURNACE,
    HALF,
    PRECISIONS,
    SIGMAS,
    SKY,
    WHITE,
    agrees,
    plain,
    rays_at,
    scene_of,
    seen,
    sky,
    unit,
    walk,
)

from visray.accel import policy
from visray.features import features
from visray.geometry import gamma
from visray.materials import Material
from visray.primitives import Box, Cone, Cylinder, Disk, Plane, Rectangle, Sphere
from visray.scene.scene import Scene
from visray.transforms import Rotate, Translate

CROWN, WATER, FLINT, AIR = 1.5, 1.33, 1.8, 1.0
MEDIA = {name: plain(kt=WHITE, ior=n) for name, n in
         {"crown": CROWN, "water": WATER, "flint": FLINT, "air": AIR}.items()}  # fmt: skip


def media(objects: dict, precision: str = "double", **more: Any) -> Scene:
    """Things of clear materials under the sky."""
    return scene_of(objects, MEDIA | more.pop("materials", {}), precision, **{"background": SKY, "depth": 60} | more)


def ratios(scene: Scene, o: Any, d: Any, levels: int) -> list[tuple[str, float, bool]]:
    """What one ray meets, the ratio of the indices there, and whether the surface is buried in another solid."""
    steps = walk(scene, o, d, levels)
    return [(str(s.what[0]), float(s.ratio[0]), bool(s.hidden[0])) for s in steps]


def check(found: list, *expected: tuple) -> None:
    """A ratio is a quotient of two numbers as they stand in the scene: one rounding."""
    assert [(w, b) for w, _, b in found] == [(e[0], len(e) > 2) for e in expected]
    for (what, ratio, buried), e in zip(found, expected):
        assert buried or abs(ratio - e[1]) <= gamma(1) * e[1], what


# By hand


@pytest.mark.parametrize("order", list(permutations(("small", "middle", "large"))))
def test_three_balls_in_each_other_in_any_order_of_the_file(order: tuple) -> None:
    """Along the axis: air, flint, water, crown, water, flint, air."""
    balls = {
        "large": Sphere(center=(0, 0, 0.1), radius=3.0, material="flint"),
        "middle": Sphere(center=(0, 0.2, 0), radius=2.0, material="water"),
        "small": Sphere(center=(0.1, 0, 0), material="crown"),
    }
    check(
        ratios(media({name: balls[name] for name in order}), (0.1, 0.1, 9), (0, 0, -1), 6),
        ("large", 1 / FLINT), ("middle", FLINT / WATER), ("small", WATER / CROWN),
        ("small", CROWN / WATER), ("middle", WATER / FLINT), ("large", FLINT),
    )  # fmt: skip


@pytest.mark.parametrize("order", list(permutations(("left", "right", "far"))))
def test_in_an_overlap_the_smaller_ball_holds(order: tuple) -> None:
    """Along the axis: -1.5 left in, -0.2 right in, 0.5 left out, within right and so buried, 1.4 right out.

    The other way: right in at 1.4, at 0.5 the left one's surface is buried, at -0.2 right out into left, then out.
    """
    balls = {
        "left": Sphere(center=(-0.5, 0, 0), material="crown"),
        "right": Sphere(center=(0.6, 0, 0), radius=0.8, material="flint"),
        "far": Sphere(center=(0, 9, 0), radius=0.1, material="water"),
    }
    scene = media({name: balls[name] for name in order})
    check(
        ratios(scene, (-5, 0, 0), (1, 0, 0), 4),
        ("left", 1 / CROWN), ("right", CROWN / FLINT), ("left", None, "buried"), ("right", FLINT),
    )  # fmt: skip
    check(
        ratios(scene, (5, 0, 0), (-1, 0, 0), 4),
        ("right", 1 / FLINT), ("left", None, "buried"), ("right", FLINT / CROWN), ("left", CROWN),
    )  # fmt: skip
    steps = walk(scene, [(-5, 0.05, 0), (-5, 0, 0.1)], [(1, 0, 0)] * 2, 4)
    assert (steps[2].what == "left").all()
    # Light goes straight through what is buried, and all of it.
    assert np.array_equal(steps[2].d, steps[1].d) and (steps[2].weight == 1).all() and steps[2].alive.all()


def test_air_in_glass_is_a_solid_of_index_1() -> None:
    balls = {"glass": Sphere(radius=2.0, material="crown"), "bubble": Sphere(center=(0.5, 0, 0), material="air")}
    check(
        ratios(media(balls), (-9, 0, 0), (1, 0, 0), 4),
        ("glass", 1 / CROWN), ("bubble", CROWN), ("bubble", 1 / CROWN), ("glass", CROWN),
    )  # fmt: skip
    # A bubble that reaches out of the glass: an open dent, whose surface outside is between air and air.
    dent = balls | {"bubble": Sphere(center=(1.8, 0, 0), material="air")}
    check(
        ratios(media(dent), (-9, 0, 0), (1, 0, 0), 4),
        ("glass", 1 / CROWN), ("bubble", CROWN), ("glass", None, "buried"), ("bubble", 1),
    )  # fmt: skip


def test_from_within() -> None:
    """The eye in the smaller of two balls, in the larger one, and where both hold."""
    scene = media({"large": Sphere(radius=2.0, material="crown"), "small": Sphere(material="flint")})
    check(ratios(scene, (0.1, 0, 0), (1, 0, 0), 2), ("small", FLINT / CROWN), ("large", CROWN))
    check(ratios(scene, (1.5, 0, 0), (1, 0, 0), 1), ("large", CROWN))
    check(
        ratios(scene, (1.5, 0, 0), (-1, 0, 0), 3), ("small", CROWN / FLINT), ("small", FLINT / CROWN), ("large", CROWN)
    )
    lens = media(
        {
            "a": Sphere(center=(-0.5, 0, 0), material="crown"),
            "b": Sphere(center=(0.6, 0, 0), radius=0.8, material="flint"),
        }
    )
    check(ratios(lens, (0.2, 0, 0), (1, 0, 0), 2), ("a", None, "buried"), ("b", FLINT))
    check(ratios(lens, (0.2, 0, 0), (-1, 0, 0), 2), ("b", FLINT / CROWN), ("a", CROWN))


def test_kinds_of_solids_in_each_other() -> None:
    """A can of water in a crystal box, a flint cone in the water, and sheets, which have no inside."""
    things = {
        "cone": Cone(base=(0, -0.5, 0), radius=0.4, height=0.8, material="flint"),
        "sheet": Disk(center=(0, 0, 0.7), normal=(0, 0, 1), radius=0.5, material="water"),
        "can": Cylinder(radius=0.9, height=1.4, material="water"),
        "box": Box(min=(-1, -1, -1), max=(1, 1, 1), material="crown", transform=(Rotate(rotate=90.0),)),
        "wall": Rectangle(center=(0, 0, -2), width=(9, 0, 0), height=(0, 9, 0), material="crown"),
    }
    check(
        ratios(media(things), (0, -0.1, 9), (0, 0, -1), 8),
        ("box", 1 / CROWN), ("can", CROWN / WATER), ("sheet", 1), ("cone", WATER / FLINT), ("cone", FLINT / WATER),
        ("can", WATER / CROWN), ("box", CROWN), ("wall", 1),
    )  # fmt: skip


def test_what_is_opaque_is_no_medium() -> None:
    """A small opaque ball about the eye, which sees the glass ball that overlaps it: outside of the glass is air."""
    opaque = Sphere(center=(0, 0, 3), material="paint")
    scene = media({"glass": Sphere(radius=2.5, material="crown"), "paint": opaque}, materials={"paint": plain(kd=HALF)})
    check(ratios(scene, (0, 0, 3), (0, 0, -1), 1), ("glass", 1 / CROWN))
    scene = media({"glass": Sphere(radius=2.5, material="crown"), "paint": opaque}, materials={"paint": plain(kt=HALF)})
    check(ratios(scene, (0, 0, 3), (0, 0, -1), 1), ("glass", None, "buried"))


@pytest.mark.parametrize("depth", [1, 2, 3, 4, 7])
def test_a_buried_surface_shows_nothing_of_itself(depth: int) -> None:
    """Both balls glow by 1 and let a half through; where the left one's surface is buried it adds nothing.

    1/2 of left, 1/4 of right, no bounce at the buried surface, 1/8 of right's far side, 1/8 of the background.
    """
    balls = {
        "left": Sphere(center=(-0.5, 0, 0), material="a"),
        "right": Sphere(center=(0.6, 0, 0), radius=0.8, material="b"),
    }
    glass = {
        "a": Material(ka=WHITE, kd=BLACK, kt=HALF, ior=CROWN),
        "b": Material(ka=WHITE, kd=BLACK, kt=HALF, ior=FLINT),
    }
    scene = scene_of(balls, glass, ambient=WHITE, background=(4.0, 4.0, 4.0), depth=depth)
    # The far side is reached by three bounces of which one is none, so by what the depth leaves for it.
    parts = [1 / 2, 1 / 4, 0, 1 / 8, 4 / 8]
    found = seen(scene, (-5, 0, 0), (1, 0, 0))
    assert (found == sum(parts[: depth + 1])).all()


def test_a_buried_mirror_does_not_reflect() -> None:
    """Each sample of an overlap whose buried surface would reflect a half: all lanes go on as they came."""
    balls = {
        "left": Sphere(center=(-0.5, 0, 0), material="a"),
        "right": Sphere(center=(0.6, 0, 0), radius=0.8, material="b"),
    }
    glass = {"a": plain(kr=HALF, kt=HALF, ior=CROWN), "b": plain(kt=WHITE, ior=FLINT)}
    scene = scene_of(balls, glass, "double", background=SKY, depth=20)
    # From within the right ball, through the buried surface.
    steps = walk(scene, (0.2, 0, 0), np.tile((1.0, 0.1, 0), (500, 1)), 1)
    assert (steps[0].what == "left").all() and steps[0].hidden.all()
    assert np.ptp(steps[0].d, axis=0).max() == 0 and (steps[0].weight == 1).all()
    # From within the left one at its own surface in the open, half of them are reflected.
    steps = walk(scene, (-1, 0, 0), np.tile((-1.0, 0.1, 0), (500, 1)), 1)
    reflected = steps[0].d[:, 0] > 0
    assert abs(reflected.mean() - 0.5) <= SIGMAS * np.sqrt(0.25 / 500)


def test_one_transparent_solid_needs_no_media() -> None:
    one = media({"ball": Sphere(material="crown"), "floor": Plane(point=(0, -3, 0))})
    assert not features(one)["nested media"] and features(one)["refraction"]
    two = media({"ball": Sphere(material="crown"), "far": Sphere(center=(9, 0, 0), material="crown")})
    assert features(two)["nested media"]
    # With the effect forced into the kernel the same light comes out of it.
    o, d = rays_at(np.random.default_rng(20), 500)
    assert np.array_equal(seen(one, o, d), seen(one, o, d, everything=True))


# Against NumPy: where the smallest ball that holds a point changes along a ray, light is refracted


def traced(balls: list[tuple], o: np.ndarray, d: np.ndarray, events: int) -> tuple[np.ndarray, np.ndarray]:
    """The directions in which rays leave for good, and whether they do after so many events. balls: (c, r, ior).

    A ray is cut at all spheres; which ball holds a piece is told by the middle of the piece. Where that changes, the
    surface is that of the smaller of the two balls.
    """
    o, d = o.astype(np.longdouble).copy(), unit(d).astype(np.longdouble)
    c, r, ior = (np.array(v, float) for v in zip(*balls))
    gone = np.zeros(len(d), bool)
    for _ in range(events):
        for i in np.flatnonzero(~gone):
            hit = _change(c, r, o[i], d[i])
            if hit is None:
                gone[i] = True
                continue
            p, before, beyond = hit
            own = min((b for b in (before, beyond) if b is not None), key=lambda b: r[b])
            n = (p - c[own]) / np.sqrt(((p - c[own]) ** 2).sum())
            n = n if n @ d[i] < 0 else -n
            eta = (1 if before is None else ior[before]) / (1 if beyond is None else ior[beyond])
            cosine = -n @ d[i]
            left = 1 - eta**2 * (1 - cosine**2)
            new = eta * d[i] + (eta * cosine - np.sqrt(left)) * n if left > 0 else d[i] + 2 * cosine * n
            o[i], d[i] = p, new / np.sqrt(new @ new)
    return d.astype(float), gone


def _change(c: np.ndarray, r: np.ndarray, o: np.ndarray, d: np.ndarray) -> tuple | None:
    """Where along a ray the smallest ball that holds it changes, and the two balls, None for air."""
    w = c - o
    b, squared = w @ d, r**2 - (w**2).sum(1) + (w @ d) ** 2
    half = np.sqrt(squared[squared > 0])
    cuts = np.sort(np.concatenate([b[squared > 0] - half, b[squared > 0] + half]))
    # The ray starts on a sphere, to within rounding.
    cuts = [0, *cuts[cuts > 1e-9], np.inf]
    held = []
    for t0, t1 in pairwise(cuts):
        middle = o + (0.5 * (t0 + t1) if np.isfinite(t1) else t0 + 1) * d
        inside = np.flatnonzero(((c - middle) ** 2).sum(1) < r**2)
        held.append(min(inside, key=lambda j: r[j]) if inside.size else None)
    for k in range(1, len(held)):
        if held[k] != held[k - 1]:
            return o + cuts[k] * d, held[k - 1], held[k]
    return None


@pytest.mark.parametrize("seed", range(6))
def test_random_balls_refract_as_in_numpy(seed: int) -> None:
    """Four balls that overlap in all ways, of indices from 0.7 to 2.4: 150 rays, and the sky where they leave.

    How much an error grows on the way is measured: NumPy traces each ray again from 1e-9 beside. Rays that make it
    grow a million times, or pass an edge of a ball in between, are left out.
    """
    rng = np.random.default_rng(seed)
    balls = [(0.7 * rng.normal(size=3), float(rng.uniform(0.4, 1.2)), float(rng.uniform(0.7, 2.4))) for _ in range(4)]
    o, d = rays_at(rng, 150, 1.5)
    objects = {
        f"b{i}": Sphere(center=tuple(c.tolist()), radius=r, material=f"m{i}") for i, (c, r, _) in enumerate(balls)
    }
    glass = {f"m{i}": plain(kt=WHITE, ior=n) for i, (_, _, n) in enumerate(balls)}
    out, gone = traced(balls, o, d, 14)
    step = 1e-9
    beside = [traced(balls, o + step * v, d, 14) for v in np.eye(3)]
    grown = np.max([np.linalg.norm(b - out, axis=1) for b, _ in beside], 0) / step
    sure = gone & np.all([g for _, g in beside], 0) & (grown < 1e6)
    assert sure.mean() > 0.75
    assert (np.abs(out - unit(d)).max(1) > 0.01)[sure].mean() > 0.3
    # Up to 14 times, 60 roundings of numbers up to 6, each grown by no more than all of the way grows it; in three
    # directions.
    slack = gamma(10) + 14 * gamma(60) * 6 * 3 * (1 + grown)
    found = seen(scene_of(objects, glass, "double", background=SKY, depth=60), o, d)
    assert (np.abs(found - sky(out[:, 1])) <= slack[:, None])[sure].all()


# Invariants


def pictures(objects: dict, orders: list, o: np.ndarray, d: np.ndarray, **more: Any) -> list[np.ndarray]:
    return [seen(media({name: objects[name] for name in order}, **more), o, d) for order in orders]


def test_the_order_of_the_file_changes_nothing() -> None:
    """Six solids of three kinds that overlap: the same families in another order, and other orders within them."""
    things = {
        "a": Sphere(center=(0.3, 0, 0), radius=1.1, material="crown"),
        "b": Sphere(center=(-0.5, 0.3, 0), radius=0.8, material="flint"),
        "c": Sphere(center=(0, 0.5, 0.5), radius=0.6, material="air"),
        "d": Box(min=(-0.6, -0.9, -0.4), max=(0.8, 0.4, 0.5), material="water"),
        "e": Cylinder(center=(0.5, 0, 0), radius=0.45, height=1.9, material="flint"),
        "f": Box(min=(-1.2, -0.3, -0.2), max=(1.3, 0.1, 0.3), material="crown"),
    }
    rng = np.random.default_rng(21)
    o, d = rays_at(rng, 1000, 1.5)
    orders = [list(things), list(things)[::-1], list(rng.permutation(list(things)))]
    first, *rest = pictures(things, orders, o, d)
    assert (np.abs(first - sky(unit(d)[:, 1])).max(1) > 0.01).mean() > 0.4
    for other in rest:
        assert np.array_equal(first, other)


@PRECISIONS
def test_looped_solids_refract_as_written_out_ones(precision: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """More than policy.MAX_UNROLLED solids of a family are looped over and hang in a tree."""
    rng = np.random.default_rng(22)
    names = list(MEDIA)
    objects = {
        f"b{i}": Sphere(center=tuple((0.8 * rng.normal(size=3)).tolist()), radius=float(rng.uniform(0.2, 1)),
                        material=names[i % 4]) for i in range(9)
    }  # fmt: skip
    objects["box"] = Box(min=(-1, -0.2, -1), max=(1, 0.3, 1), material="flint")
    o, d = rays_at(rng, 2000, 1.5)
    written = seen(media(objects, precision), o, d)
    monkeypatch.setattr(policy, "MAX_UNROLLED", 3)
    monkeypatch.setattr(policy, "MAX_UNROLLED_SHARED", 3)
    monkeypatch.setattr(policy, "MAX_INLINED", 3)
    looped = seen(media(objects, precision), o, d)
    assert np.array_equal(written, looped)
    assert (np.abs(written - sky(unit(d)[:, 1])).max(1) > 0.01).mean() > 0.4


@PRECISIONS
def test_a_tangle_of_glass_keeps_all_light(precision: str) -> None:
    """Twelve solids of four kinds and media, in each other: under a sky of 1 each ray sees 1, or is caught for ever."""
    rng, objects = np.random.default_rng(23), {}
    for i in range(12):
        at, size = 0.9 * rng.normal(size=3), float(rng.uniform(0.4, 1))
        moved = (Rotate(rotate=float(rng.uniform(0, 360)), axis=(1, 2, 3)), Translate(translate=tuple(at.tolist())))
        which = {"transform": moved, "material": list(MEDIA)[i // 3]}
        kinds = (
            Sphere(radius=size, **which),
            Box(min=(-size,) * 3, max=(size,) * 3, **which),
            Cylinder(radius=size, height=size, **which),
            Cone(radius=size, height=2 * size, **which),
        )
        objects[f"o{i}"] = kinds[i % 4]
    o, d = rays_at(rng, 3000, 2.0)
    found = seen(media(objects, precision, **FURNACE), o, d)
    # Weights of 1 only. Few ways run round and round in a box beyond the critical angle.
    assert np.isin(found, (0, 1)).all() and found.mean() > 0.95


@pytest.mark.parametrize("kinds", [("crown", "flint"), ("flint", "crown")])
def test_of_two_balls_of_one_size_the_same_one_holds_everywhere(kinds: tuple) -> None:
    """Which one is free to choose; but from air to air all ratios along the axis make 1."""
    balls = {"a": Sphere(center=(-0.4, 0, 0), material=kinds[0]), "b": Sphere(center=(0.4, 0, 0), material=kinds[1])}
    for way in (1, -1):
        found = ratios(media(balls), (-5 * way, 0, 0), (way, 0, 0), 4)
        assert [w for w, _, _ in found] == (["a", "b", "a", "b"] if way > 0 else ["b", "a", "b", "a"])
        product = np.prod([r for _, r, buried in found if not buried])
        assert abs(product - 1) <= gamma(8)


# Flush surfaces: of two solids that touch or coincide, both end where they are


@PRECISIONS
def test_a_ball_of_glass_that_stands_in_its_own_place_twice_looks_like_one(precision: str) -> None:
    """But for its colour: each surface is met once."""
    o, d = rays_at(np.random.default_rng(24), 1000)
    one = {"a": Sphere(center=(0.1, 0.2, 0.3), radius=0.9, material="crown")}
    alone, twice = (seen(media(x, precision), o, d) for x in (one, one | {"b": one["a"]}))
    assert (np.abs(alone - sky(unit(d)[:, 1])).max(1) > 0.01).mean() > 0.4
    assert np.array_equal(alone, twice)


@PRECISIONS
def test_two_boxes_of_glass_that_touch_look_like_one(precision: str) -> None:
    """A block cut in two, at places that are no dyadic numbers, and turned."""
    rng = np.random.default_rng(25)
    o, d = rays_at(rng, 1500)
    for cut, turn in ((0.1, ()), (-0.37, ()), (0.3, (Rotate(rotate=33.0, axis=(1, 2, -1)),))):
        low, high = (-0.8, -0.7, -0.6), (0.9, 0.8, 0.5)
        whole = {"a": Box(min=low, max=high, material="crown", transform=turn)}
        halves = {
            "a": Box(min=low, max=(0.9, cut, 0.5), material="crown", transform=turn),
            "b": Box(min=(-0.8, cut, -0.6), max=high, material="crown", transform=turn),
        }
        one, two = (seen(media(x, precision), o, d) for x in (whole, halves))
        # At the cut a ray is bent by the rounding of ratios of 1; at an edge of the block it may meet another face.
        close = (np.abs(one - two) <= gamma(60, precision) + gamma(60) * 100).all(1)
        assert close.mean() >= 1 - 3 / len(d)


def test_water_that_touches_its_glass_refracts_from_glass_to_water() -> None:
    """A box of water flush on a larger box of crown: as with a gap of nothing, and not as with air in between."""
    things = {
        "glass": Box(min=(-2, -1, -2), max=(2, 0.1, 2), material="crown"),
        "water": Box(min=(-1, 0.1, -1), max=(1, 1.3, 1), material="water"),
    }
    sunk = things | {"water": Box(min=(-1, 0.1 - 1e-9, -1), max=(1, 1.3, 1), material="water")}
    p = np.random.default_rng(26).uniform(-0.5, 0.5, (500, 3)) * [1, 0, 1] + [0, 0.1, 0]
    o = np.array([0.2, 4.0, 0.3])
    found = walk(media(things), o, p - o, 3)
    assert (found[0].what == "water").all()
    inner = found[1].ratio
    sure = np.isin(found[1].what, ("water", "glass")) & (np.abs(found[1].p[:, 1] - 0.1) < gamma(30) * 4)
    assert sure.mean() > 0.8
    assert (np.abs(inner - WATER / CROWN) <= gamma(1))[sure].all()
    out, truth = seen(media(things), o, p - o), seen(media(sunk), o, p - o)
    # The one is 1e-9 lower, so that where light leaves is as much off, grown ten times at most.
    assert (np.abs(out - truth) <= 1e-8)[sure].all()


@pytest.mark.parametrize("others", [0, 1])
def test_a_clear_sheet_that_lies_on_glass_changes_nothing(others: int) -> None:
    """Whichever of the two is met, light is refracted once; with another solid in the scene, and without one."""
    block = {"block": Box(min=(-1, -0.7, -0.4), max=(0.8, 0.1, 0.6), material="crown")}
    block |= {"far": Sphere(center=(9, 0, 0), radius=0.1, material="crown")} if others else {}
    sheet = Rectangle(center=(-0.1, 0.1, 0.1), width=(1.5, 0, 0), height=(0, 0, -0.8), material="air")
    rng = np.random.default_rng(28)
    p = np.c_[rng.uniform(-0.8, 0.6, 500), np.full(500, 0.1), rng.uniform(-0.25, 0.45, 500)]
    o = np.array([0.3, 3.0, 1.5])
    bare = seen(media(block), o, p - o)
    for objects in (block | {"sheet": sheet}, {"sheet": sheet} | block):
        assert (np.abs(seen(media(objects), o, p - o) - bare) <= gamma(60) * 10).all()


def test_mirrored_and_clear_shares_of_nested_balls_add_up() -> None:
    """A furnace of balls in each other that reflect a quarter and let the rest through: 1 in every sample."""
    shares = {"kr": (0.25, 0.25, 0.25), "kt": (0.75, 0.75, 0.75)}
    glass = {f"m{round(100 * n)}": plain(**shares, ior=n) for n in (CROWN, FLINT, WATER)}
    balls = {f"b{i}": Sphere(center=(0.1 * i, 0, 0), radius=1.0 - 0.3 * i, material=m) for i, m in enumerate(glass)}
    o, d = rays_at(np.random.default_rng(27), 2000)
    found = seen(scene_of(balls, glass, **FURNACE), o, d)
    assert (np.abs(found - 1) <= gamma(2 * 200, "single")).all() and agrees(found, 1).all()
