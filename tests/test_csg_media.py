"""Transparent CSG: refraction, nested media and coloured shadows as of other objects with the same shape, and by closed
forms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from samples import NAMES, SAMPLES
from test_media import CROWN, FLINT, WATER, check, media, ratios
from test_paths import BLACK, FURNACE, PRECISIONS, SKY, WHITE, plain, rays_at, scene_of, seen, sky, unit, walk

from visray import Box, Capsule, Csg, Cylinder, DirectionalLight, Plane, PointLight, Sphere
from visray.geometry import gamma
from visray.materials import Material
from visray.primitives.primitive import bounding_box
from visray.transforms import Rotate, Translate

TURN = (Rotate(rotate=33.0, axis=(1.0, 2.0, 3.0)),)
CLOSED = [name for name in NAMES if SAMPLES[name].posed.closed]


# Against the same shape of another kind

BLOCKS = (Box(min=(-3, -0.8, -0.7), max=(0.7, 0.6, 3)), Box(min=(-0.6, -2, -2), max=(2, 3, 0.8)))
ROD = (Cylinder(radius=0.5), *(Sphere(center=(0, y, 0), radius=0.5) for y in (-0.5, 0.5)))
EQUAL = {
    "two boxes are a box": (
        Csg(op="intersection", of=BLOCKS, transform=TURN),
        Box(min=(-0.6, -0.8, -0.7), max=(0.7, 0.6, 0.8), transform=TURN),
    ),
    "a cylinder and two balls are a capsule": (
        Csg(op="merge", of=ROD, transform=TURN),
        Capsule(a=(0, -0.5, 0), b=(0, 0.5, 0), radius=0.5, transform=TURN),
    ),
    "a ball that is cut by nothing": (Csg(op="difference", of=(Sphere(), Sphere(center=(9, 0, 0)))), Sphere()),
}


@pytest.mark.parametrize("shape", EQUAL)
def test_csg_refracts_in_and_around_other_media_as_the_same_shape_of_another_kind(shape: str) -> None:
    """Water in a ball of crown, with flint in it: the CSG is an outer and an inner solid. The volume says which."""
    o, d = rays_at(np.random.default_rng(1), 1500, 1.5)
    one, other = (
        seen(media({"in": Sphere(radius=0.3, material="flint"), "w": replace(x, material="water"),
                    "out": Sphere(center=(0.1, 0, 0), radius=1.6, material="crown")}), o, d)
        for x in EQUAL[shape]
    )  # fmt: skip
    # A point is off by some roundings; a hundred times of that where light leaves. At an edge another face may be met.
    assert (np.abs(one - other) <= gamma(60) * 100).all(1).mean() >= 1 - 3 / len(d)
    assert np.ptp(one, axis=0).min() > 0.1


def in_a_row() -> dict[str, Any]:
    """An object of each closed kind, 3 apart from each other along the x axis."""
    found = {}
    for i, name in enumerate(CLOSED):
        low, high = bounding_box(SAMPLES[name].posed)
        move = np.array((3.0 * i, 0, 0)) - (low + high) / 2
        found[name] = replace(SAMPLES[name].posed, transform=(Translate(translate=tuple(move.tolist())),))
    return found


def rays_in_a_row(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays at the objects in a row, from points whose x is that of the object that they are aimed at."""
    o, d = rays_at(rng, count, 0.6)
    return o + np.c_[3.0 * rng.integers(0, len(CLOSED), count), np.zeros((count, 2))], d


@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.slow)])
def test_solids_that_do_not_meet_are_the_same_merged_in_a_union_or_alone(precision: str) -> None:
    """All closed kinds of glass in a row, in front of a floor with their shadows: each ray sees the same bits."""
    o, d = rays_in_a_row(np.random.default_rng(2), 150 * len(CLOSED))
    glass = {"glass": Material(ka=BLACK, kd=(0.1, 0.1, 0.1), kt=(0.9, 0.8, 0.7), ior=1.5, dmax=4.0)}
    row = in_a_row()
    pictures = []
    for objects in (
        {"all": Csg(op="merge", of=row, material="glass")},
        {"all": Csg(op="union", of=row, material="glass")},
        {name: replace(x, material="glass") for name, x in row.items()},
    ):
        scene = scene_of(
            {"floor": Plane(point=(0, -2, 0)), **objects}, glass, precision, depth=8, background=WHITE,
            lights={"sun": DirectionalLight(direction=(0.0, -1.0, 0.3))},
        )  # fmt: skip
        pictures.append(seen(scene, o, d))
    assert np.array_equal(pictures[0], pictures[2]) and np.array_equal(pictures[1], pictures[2])
    # Most rays meet glass, which is less bright than the sky.
    assert (pictures[0].max(1) < 1).mean() > 0.5


# By hand


def test_merged_glass_has_no_surface_inside() -> None:
    """Along the x axis: two balls that overlap, and water in both, which is the smaller one without a priority."""
    balls = {"left": Sphere(center=(-0.5, 0, 0)), "right": Sphere(center=(0.5, 0, 0))}
    water = Csg(op="intersection", of=(Sphere(center=(-0.3, 0, 0), radius=0.5), Sphere(center=(0.3, 0, 0), radius=0.5)))
    scene = media({"glass": Csg(op="merge", of=balls, material="crown"), "water": replace(water, material="water")})
    steps = walk(scene, (-5, 0, 0), (1, 0, 0), 4)
    assert np.abs([s.p[0, 0] for s in steps] - np.array([-1.5, -0.2, 0.2, 1.5])).max() <= gamma(16) * 5
    check(
        ratios(scene, (-5, 0, 0), (1, 0, 0), 4),
        ("glass", 1 / CROWN), ("water", CROWN / WATER), ("water", WATER / CROWN), ("glass", CROWN),
    )  # fmt: skip
    # A difference has air in it: no medium at all.
    shell = Csg(op="difference", of=(Sphere(radius=2.0), Sphere()), material="crown")
    scene = media({"shell": shell, "drop": Sphere(radius=0.5, material="water")})
    check(
        ratios(scene, (-5, 0, 0), (1, 0, 0), 6),
        ("shell", 1 / CROWN), ("shell", CROWN), ("drop", 1 / WATER), ("drop", WATER), ("shell", 1 / CROWN),
        ("shell", CROWN),
    )  # fmt: skip


def test_a_prism_of_half_spaces_bends_light_by_its_angle() -> None:
    """Two planes at 30 degrees each from the vertical. Light along x meets the first face at 30 degrees, and leaves by
    the angle e with sin e = n sin(60 degrees - asin(sin 30 / n))."""
    sides = [(-np.cos(np.pi / 6), 0.5, 0.0), (np.cos(np.pi / 6), 0.5, 0.0)]
    prism = Csg(op="intersection", of=tuple(Plane(point=(0, 1, 0), normal=n) for n in sides), material="crown")
    z = np.random.default_rng(3).uniform(-1, 1, 50)
    steps = walk(media({"prism": prism}), np.c_[0 * z - 5, z, z], np.tile((1.0, 0.0, 0.0), (50, 1)), 2)
    inner = np.pi / 3 - np.arcsin(np.sin(np.pi / 6) / CROWN)
    leaves = np.pi / 6 - np.arcsin(CROWN * np.sin(inner))
    hand = np.array([np.cos(leaves), np.sin(leaves), 0])
    assert np.abs(steps[1].d - hand).max() <= gamma(32) and leaves < 0


def test_a_lens_of_two_spheres_refracts_as_in_numpy() -> None:
    """Rays enter at the farther of both spheres' near crossings, and leave at the nearer one of their far crossings."""
    centre, radius = np.array([[0, 0, 1.2], [0, 0, -1.5]]), np.array([1.6, 1.9])
    balls = tuple(Sphere(center=tuple(c), radius=r) for c, r in zip(centre.tolist(), radius.tolist()))
    o, d = rays_at(np.random.default_rng(4), 2000, 0.4)
    steps = walk(media({"lens": Csg(op="intersection", of=balls, material="flint")}), o, d, 2)
    d, bound = unit(d).astype(np.longdouble), np.full(len(d), 1.0)
    for step, eta, far in ((steps[0], 1 / FLINT, False), (steps[1], FLINT, True)):
        w = o[:, None] - centre
        b = (w * d[:, None]).sum(2)
        root = b**2 - (w**2).sum(2) + radius**2
        t = -b + (1 if far else -1) * np.sqrt(np.where(root > 0, root, np.nan))
        own = np.argmin(t, 1) if far else np.argmax(t, 1)
        p = o + np.take_along_axis(t, own[:, None], 1) * d
        n = (p - centre[own]) / radius[own][:, None] * (-1 if far else 1)
        cosine = -(n * d).sum(1)
        left = 1 - eta**2 * (1 - cosine**2)
        d = eta * d + (eta * cosine - np.sqrt(np.where(left > 0, left, np.nan)))[:, None] * n
        # An error grows by the slope of the face, and by that of the light beyond it.
        bound = bound * (1 + 5 / np.minimum(cosine, np.sqrt(np.abs(left))).astype(float) ** 2)
        met = step.what == "lens"
        sure = met & (left > 1e-3) & (cosine > 0.05) & np.isfinite(d).all(1)
        assert sure.mean() > 0.3
        assert (np.abs(step.d - d).max(1) <= gamma(64) * bound)[sure].all()
        o, d = p, d / np.sqrt((d**2).sum(1))[:, None]


# Against NumPy: where the medium changes along a ray, light is refracted


def leaves(shape: Any) -> list[Sphere]:
    return [y for x in shape.of for y in leaves(x)] if isinstance(shape, Csg) else [shape]


def holds(shape: Any, p: np.ndarray) -> np.ndarray:
    """Whether points (N, 3) are in a tree of balls."""
    if isinstance(shape, Sphere):
        return ((p - np.array(shape.center)) ** 2).sum(1) < shape.radius**2
    first, *others = (holds(x, p) for x in shape.of)
    if shape.op == "difference":
        return first & ~np.any(others, axis=0)
    return (np.all if shape.op == "intersection" else np.any)([first, *others], axis=0)


def traced(solids: list[tuple[Any, float]], o: np.ndarray, d: np.ndarray, events: int) -> tuple[np.ndarray, np.ndarray]:
    """The directions in which rays leave for good, and whether they do after so many events, in 80 bits.

    solids: trees of balls with their indices of refraction; where several hold a point, the first one counts.
    A ray is cut at all spheres, and the middle of each piece says in which medium it is.
    """
    o, d, gone = o.astype(np.longdouble), unit(d).astype(np.longdouble), np.zeros(len(d), bool)
    every = [ball for shape, _ in solids for ball in leaves(shape)]
    c, r = np.array([x.center for x in every]), np.array([x.radius for x in every])
    for _ in range(events):
        for i in np.flatnonzero(~gone):
            w = c - o[i]
            b = w @ d[i]
            root = np.sqrt(np.maximum(r**2 - (w**2).sum(1) + b**2, 0))
            t = np.concatenate([b - root, b + root])
            # The ray starts on a sphere, to within rounding.
            ahead = np.flatnonzero((np.tile(root, 2) > 0) & (t > 1e-9))
            ahead = ahead[np.argsort(t[ahead])]
            cuts = np.concatenate([[0], t[ahead], [t[ahead][-1] + 2 if len(ahead) else 2]])
            middles = o[i] + 0.5 * (cuts[1:] + cuts[:-1])[:, None] * d[i]
            inside = np.array([holds(shape, middles) for shape, _ in solids] + [np.full(len(middles), True)])
            medium = inside.argmax(0)
            changes = np.flatnonzero(medium[1:] != medium[:-1])
            if not len(changes):
                gone[i] = True
                continue
            k = changes[0]
            ior = [x for _, x in solids] + [1.0]
            p, ball = o[i] + t[ahead[k]] * d[i], ahead[k] % len(r)
            n = (p - c[ball]) / r[ball]
            n = n if n @ d[i] < 0 else -n
            eta, cosine = ior[medium[k]] / ior[medium[k + 1]], -n @ d[i]
            left = 1 - eta**2 * (1 - cosine**2)
            new = eta * d[i] + (eta * cosine - np.sqrt(left)) * n if left > 0 else d[i] + 2 * cosine * n
            o[i], d[i] = p, new / np.sqrt(new @ new)
    return d.astype(float), gone


def random_tree(rng: np.random.Generator, depth: int) -> Any:
    """Balls about the origin, joined by all operations."""
    if not depth:
        return Sphere(center=tuple(rng.uniform(-0.6, 0.6, 3).tolist()), radius=float(rng.uniform(0.4, 1.0)))
    op = ("merge", "intersection", "difference")[rng.integers(3)]
    return Csg(op=op, of=tuple(random_tree(rng, depth - 1) for _ in range(2 + (op == "merge"))))


@pytest.mark.parametrize("seed", [0, *(pytest.param(i, marks=pytest.mark.slow) for i in range(1, 12))])
def test_random_csg_refracts_as_in_numpy(seed: int) -> None:
    """Three solids that overlap in all ways, of indices from 0.7 to 2.4: 150 rays, and the sky where they leave.

    How much an error grows on the way is measured: NumPy traces each ray again from 1e-9 beside. Rays that make it
    grow a million times, or pass an edge in between, are left out.
    """
    rng = np.random.default_rng(seed)
    solids = [(random_tree(rng, 2), float(rng.uniform(0.7, 2.4))) for _ in range(3)]
    objects = {f"s{i}": replace(shape, material=f"m{i}") for i, (shape, _) in enumerate(solids)}
    glass = {f"m{i}": plain(kt=WHITE, ior=n, priority=float(-i)) for i, (_, n) in enumerate(solids)}
    o, d = rays_at(rng, 150, 1.2)
    out, gone = traced(solids, o, d, 14)
    step = 1e-9
    beside = [traced(solids, o + step * v, d, 14) for v in np.eye(3)]
    grown = np.max([np.linalg.norm(b - out, axis=1) for b, _ in beside], 0) / step
    sure = gone & np.all([g for _, g in beside], 0) & (grown < 1e6)
    assert sure.mean() > 0.6
    assert (np.abs(out - unit(d)).max(1) > 0.01)[sure].mean() > 0.2
    # Up to 14 times, 60 roundings of numbers up to 6, each grown by no more than all of the way grows it; in three
    # directions.
    slack = gamma(10) + 14 * gamma(60) * 6 * 3 * (1 + grown)
    found = seen(scene_of(objects, glass, "double", background=SKY, depth=60), o, d)
    assert (np.abs(found - sky(out[:, 1])) <= slack[:, None])[sure].all()


# Coloured shadows

KT, DMAX = np.array((1.0, 0.5, 0.125)), 7.0
CLEAR = {"glass": plain(kt=tuple(KT.tolist()), dmax=DMAX), "floor": plain(kd=WHITE)}


def shadows(objects: dict, lights: dict, p: np.ndarray, precision: str) -> np.ndarray:
    """The colours of points p of a white floor at y = 0, seen from just above it."""
    scene = scene_of({"floor": Plane(material="floor"), **objects}, CLEAR, precision, lights=lights, depth=0)
    return seen(scene, p + np.array([0.05, 0.1, 0.02]), np.tile((-0.05, -0.1, -0.02), (len(p), 1)))


@PRECISIONS
def test_slabs_tint_light_by_the_length_inside(precision: str) -> None:
    """Slabs from height 1 to 2 and from 1.5 to 3, far apart along x, under slanted light. A merge counts once, by the
    length inside; a union counts each slab by itself."""
    a, b, c = ((1.0, 2.0), (1.5, 3.0), (2.5, 4.0))
    cases = {
        "merge": ((a, b), (2.0,)),
        "union": ((a, b), (1.0, 1.5)),
        "intersection": ((a, b), (0.5,)),
        "difference": ((a, b), (0.5,)),
        "merge of two that do not meet": ((a, c), (2.5,)),
        "difference with a gap inside": (((0.5, 4.0), a), (2.5,)),
    }
    light = np.array([0.1, -1.0, 0.2])
    objects, p, hand = {}, [], []
    at = np.random.default_rng(5).uniform(-1, 1, (100, 3)) * [1, 0, 1]
    for i, (name, (slabs, lengths)) in enumerate(cases.items()):
        x = 20.0 * i
        boxes = tuple(Box(min=(x - 5, low, -5), max=(x + 5, high, 5)) for low, high in slabs)
        objects[name] = Csg(op=name.split()[0], of=boxes, material="glass")
        p.append(at + [x, 0, 0])
        share = np.prod([KT * (1 - length / -unit(light)[1] / DMAX) for length in lengths], axis=0)
        hand.append(np.tile(-unit(light)[1] * share, (len(at), 1)))
    found = shadows(objects, {"sun": DirectionalLight(direction=tuple(light.tolist()))}, np.concatenate(p), precision)
    hand = np.concatenate(hand)
    # The ends of a length are off by roundings of coordinates, of which the largest is x.
    slip = gamma(64) * 20 * len(cases) / DMAX
    assert (np.abs(found - hand) <= (gamma(40, precision) + slip) * hand.max()).all()


@PRECISIONS
@pytest.mark.parametrize("op", ["merge", "union", "intersection", "difference"])
def test_two_balls_tint_light_by_the_length_inside(op: str, precision: str) -> None:
    """Random rays from a point light, by the intervals of both balls."""
    light, centre, radius = np.array([0.3, 6.0, 0.2]), np.array([[-0.4, 2.5, 0], [0.5, 2.7, 0.2]]), np.array([1.0, 0.8])
    balls = tuple(Sphere(center=tuple(c), radius=r) for c, r in zip(centre.tolist(), radius.tolist()))
    p = np.random.default_rng(6).uniform(-2, 2, (2000, 3)) * [1, 0, 1]
    lamp = PointLight(position=tuple(light.tolist()))
    found = shadows({"glass": Csg(op=op, of=balls, material="glass")}, {"lamp": lamp}, p, precision)
    way = unit(p - light)
    w = light - centre
    b = way @ w.T
    half = np.sqrt(np.maximum(b**2 - (w**2).sum(1) + radius**2, 0))
    near, far = -b - half, -b + half
    each, both = far - near, np.maximum(far.min(1) - near.max(1), 0)
    lengths = {
        "merge": [each.sum(1) - both], "union": list(each.T), "intersection": [both], "difference": [each[:, 0] - both]
    }[op]  # fmt: skip
    share = np.prod([np.where(x[:, None] > 0, KT * (1 - x[:, None] / DMAX), 1) for x in lengths], axis=0)
    hand = -way[:, 1:2] * share
    # The length of a chord near the rim is off by the root of an error of the height; there kt counts or does not.
    slip = np.sqrt(2 * gamma(64) * 10)
    rim = np.any([(x > 0) & (x <= slip) for x in lengths], axis=0)
    assert (np.abs(found - hand) <= gamma(40, precision) + slip)[~rim].all()
    assert rim.mean() < 0.01 and (share[~rim] < 1).any(1).mean() > 0.05


# Nothing is lost

TREES = {
    "holes": lambda rng: Csg(op="difference", of=(Box(), *balls(rng, 7))),
    "balls": lambda rng: Csg(op="merge", of=balls(rng, 8)),
    "common": lambda rng: Csg(op="intersection", of=tuple(Csg(op="merge", of=balls(rng, 4)) for _ in range(2))),
}


def balls(rng: np.random.Generator, count: int) -> tuple:
    """Random balls about the origin."""
    at, radius = rng.uniform(-0.6, 0.6, (count, 3)).tolist(), rng.uniform(0.2, 0.6, count).tolist()
    return tuple(Sphere(center=tuple(c), radius=r) for c, r in zip(at, radius))


@PRECISIONS
@pytest.mark.parametrize("tree", TREES)
def test_csg_of_glass_keeps_all_light(tree: str, precision: str) -> None:
    """Under a sky of 1 each ray that gets out sees 1. A ray that leaves a surface on its wrong side would be lost."""
    rng = np.random.default_rng(7)
    objects = {f"o{i}": replace(TREES[tree](rng), material=m) for i, m in enumerate(("crown", "water"))}
    found = seen(media(objects, precision, **FURNACE), *rays_at(rng, 2000))
    # Weights of 1 only. Few ways run round and round beyond the critical angle.
    assert np.isin(found, (0, 1)).all() and found.mean() > 0.95
