"""Rays that go on from glass and mirrors: level by level against Mitsuba, and against exact arithmetic.

Paths are driven here as the kernel drives them, but each of their levels is evaluated, so that what it hits is seen.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from flint import arb, ctx

from visray import indirect, integrator, media
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.direct import DIMENSION, area_light
from visray.geometry import UNIT_ROUNDOFF, gamma
from visray.interaction import interact
from visray.lights import DiskLight
from visray.materials import Material
from visray.primitives import Box, Disk, Plane, Sphere
from visray.pytree import rows as lanes_of
from visray.ray import Ray
from visray.scene.scene import Film, Scene, Settings
from visray.study.mitsuba import visray_lighting
from visray.study.mitsuba.mitsuba_scene import MitsubaScene
from visray.study.mitsuba.placed_shapes import mitsuba_shapes
from visray.study.mitsuba.ray_comparison import RayComparison
from visray.study.mitsuba.rounding import UNRESOLVED, absolute_difference, angle
from visray.study.mitsuba.shadow_rays import ShadowRays
from visray.study.mitsuba.shadows import moved_shadow_rays
from visray.study.mitsuba.visray_scene import Rays, VisrayScene, to_numpy
from visray.transforms import Rotate, Translate

COUNT = 20_000
EYE = (0.8, 1.1, 4.0)
SMALL, U = gamma(1, "single"), UNIT_ROUNDOFF["double"]
# What Mitsuba is told of a direction or says of it: one rounding, and five of a dot product for each turn into a frame.
STORED = gamma(6, "single")


@dataclass(frozen=True)
class Level:
    """The rays of one level of many paths, in double, from the centre, and how they go on.

    o, d: the rays; off: |cosine| of d with the surface they leave, 1 where they leave none; index and t: what they hit;
    n: its normal, outwards; onward: their next direction; inside: whether that runs into the object; alive: whether
    there is a next one. Shapes: (N, 3), or (N).
    """

    o: np.ndarray
    d: np.ndarray
    off: np.ndarray
    index: np.ndarray
    t: np.ndarray
    n: np.ndarray
    onward: np.ndarray
    inside: np.ndarray
    alive: np.ndarray

    @property
    def p(self) -> np.ndarray:
        return self.o + self.t[:, None] * self.d


def levels(ours: VisrayScene, o: np.ndarray, d: np.ndarray, count: int) -> Iterator[Level]:
    """The levels of paths, from the centre + o. Of each level, only those that are alive are in the next."""
    a, s = ours.a, ours.kernel
    ray = Ray(ours.triples(ours.centre + o), ours.triples(d / np.linalg.norm(d, axis=1, keepdims=True)))
    off = np.ones(len(d))
    for _ in range(count):
        n = dr.width(ray.d)
        hit = closest(RayOrigin(s.geometry, ray.o, shared=False), ray)
        here = interact(s, ray, hit, integrator.single_sample_state(ours.kernel, n))
        b = indirect.bounce(s, here, ray, media.interface_at(s, here), dr.full(a.U, count, n), dr.zeros(a.U, n))
        dr.eval(hit, here.surface, b.ray, b.alive)
        index = np.where(np.array(hit.valid), np.array(hit.row).astype(np.int64), -1)
        alive = np.broadcast_to(np.array(b.alive), n)
        normal, onward = to_numpy(here.surface.exact), to_numpy(b.ray.d)
        found = (to_numpy(ray.o) - ours.centre, to_numpy(ray.d), off, index, np.array(hit.t), normal, onward)
        yield Level(*found, np.broadcast_to(np.array(b.ray.inside), n), alive)
        if not alive.any():
            return
        ray = lanes_of(b.ray, a.U(np.flatnonzero(alive).astype(np.uint32)))
        off = np.abs((normal * onward).sum(1))[alive]


def aimed(seed: int, count: int = COUNT, width: float = 1.2) -> tuple[np.ndarray, np.ndarray]:
    """Rays as of a camera: from EYE to places around the middle."""
    target = np.random.default_rng(seed).uniform(-width, width, (count, 3))
    return np.broadcast_to(EYE, target.shape).astype(float), target - EYE


def pair(objects: dict, materials: dict) -> tuple[VisrayScene, MitsubaScene]:
    """A scene in visray and in Mitsuba, about the origin. Objects have the material of their own name."""
    things = {name: replace(x, material=name if name in materials else "default") for name, x in objects.items()}
    return pair_of(
        Scene(objects=things, materials=materials, camera=Camera(origin=(0, 0, 0), target=(0, 0, 1)), lights={})
    )


def pair_of(scene: Scene) -> tuple[VisrayScene, MitsubaScene]:
    ours = VisrayScene(scene)
    return ours, MitsubaScene(scene, ours.names, mitsuba_shapes(scene)[0], ours.centre)


def met(ours: VisrayScene, theirs: MitsubaScene, level: Level) -> tuple[RayComparison, np.ndarray]:
    """The level's rays through Mitsuba, and which are sure: of which rounding does not decide what they meet.

    Rays that leave a surface begin off it, by four times the bound of Mitsuba's rounding of both.
    """
    n = len(level.t)
    bound = theirs.rounding.largest_ray_error(n).start(level.o)
    first = level.o == level.o[:1]
    by = np.where(first.all(1), 0, 4 * np.divide(bound, level.off, out=np.full(n, np.inf), where=level.off > 0))
    apart = by < UNRESOLVED * level.t
    by = np.where(apart & np.isfinite(by), by, 0)
    rays = Rays((level.o + by[:, None] * level.d).astype(np.float32), level.d.astype(np.float32))
    seen = RayComparison(ours, theirs, rays)
    sure = apart & ~seen.allowed.edge & ~seen.beyond & ~seen.tied
    # visray itself, by the ray as it was rounded for Mitsuba, and by the path.
    assert (seen.our_hits.index == level.index)[sure].all()
    assert (absolute_difference(seen.our_hits.t + by, level.t) <= seen.allowed.t + bound)[sure].all()
    return seen, sure


def agrees(seen: RayComparison, sure: np.ndarray) -> None:
    """Both hit the same objects at the same points with the same normals, within rounding."""
    found = seen.differences()
    assert (seen.our_hits.index == seen.their_hits.index)[sure].all()
    assert found.hit_mismatches == found.object_mismatches == 0
    assert found.dt_bound <= 1 and found.angle_bound <= 1


def mirrored_bound(c: np.ndarray, d: float, n: np.ndarray) -> np.ndarray:
    """How far d + 2 c n is off, with c = -d.n, where d and n are off by these."""
    return d + 2 * c * n + 2 * (d + n)


def bent_bound(ratio: np.ndarray, c: np.ndarray, d: np.ndarray | float, n: np.ndarray | float, u: float) -> np.ndarray:
    """How far the direction ratio d + (ratio c - s) n of a ray that is refracted is off, inf where it is not resolved.

    d and n are off by these, and each of 8 roundings by u. s^2 = 1 - ratio^2 (1 - c^2), so that ds = ratio^2 c dc / s,
    to first order, which holds where s^2 changes by less than a quarter of itself.
    """
    squared = 1 - ratio**2 * (1 - c**2)
    s = np.sqrt(np.where(squared > 0, squared, 1))
    dc = d + n + 2 * u
    change = 2 * ratio**2 * c * dc + 8 * u * (1 + ratio**2)
    first = ratio * d + np.abs(ratio * c - s) * n + ratio * dc + change / s + 8 * u * (1 + ratio)
    return np.where(squared > 4 * change, first, np.inf)


# Refraction and reflection against Mitsuba's dielectric and conductor


@dataclass(frozen=True)
class Glasses:
    """Objects, and the indices of refraction inside and outside of those that are glass."""

    objects: dict
    indices: dict[str, tuple[float, float]]


FLOOR = Plane(point=(0, -2, 0))
LEANING = (Rotate(rotate=25.0, axis=(1, 2, 3)), Translate(translate=(0.1, 0.2, 0)))
GLASSES = {
    "spheres": Glasses(
        {"a": Sphere(), "b": Sphere(center=(-0.5, -0.6, -2.2), radius=0.9), "floor": FLOOR},
        {"a": (1.5, 1.0), "b": (1.9, 1.0)},
    ),
    "a slab": Glasses({"a": Box(min=(-1.2, -0.9, -0.4), max=(1.2, 0.9, 0.5)), "floor": FLOOR}, {"a": (1.4, 1.0)}),
    "a turned box": Glasses(
        {"a": Box(min=(-0.8, -0.8, -0.8), max=(0.8, 0.8, 0.8), transform=LEANING), "floor": FLOOR}, {"a": (1.33, 1.0)}
    ),
    "a thin slab": Glasses({"a": Box(min=(-1, -1, 0), max=(1, 1, 0.01)), "floor": FLOOR}, {"a": (1.6, 1.0)}),
    "a sphere in a sphere": Glasses(
        {"outer": Sphere(), "inner": Sphere(center=(0.1, 0.15, 0.2), radius=0.5), "floor": FLOOR},
        {"outer": (1.5, 1.0), "inner": (1.2, 1.5)},
    ),
    "a denser sphere in a box": Glasses(
        {"outer": Box(min=(-1, -1, -1), max=(1, 1, 1)), "inner": Sphere(radius=0.6)},
        {"outer": (1.3, 1.0), "inner": (2.0, 1.3)},
    ),
}


@pytest.mark.parametrize("case", GLASSES)
def test_refracted_paths_agree_with_mitsuba(case: str) -> None:
    glasses = GLASSES[case]
    materials = {name: Material(kt=(1.0, 1.0, 1.0), ior=inside) for name, (inside, _) in glasses.indices.items()}
    ours, theirs = pair(glasses.objects, materials)
    rays = checked = beyond = deepest = 0
    for depth, level in enumerate(levels(ours, *aimed(1), 7)):
        seen, sure = met(ours, theirs, level)
        agrees(seen, sure)
        rays += int(level.alive.sum())
        for name, (inside, outside) in glasses.indices.items():
            lanes = np.flatnonzero(sure & (level.index == ours.names.index(name)))
            assert level.alive[lanes].all()
            resolved, inner = _refraction(seen, level, lanes, inside, outside)
            checked, beyond = checked + int(resolved.sum()), beyond + int((inner & resolved).sum())
            deepest = max(deepest, depth if len(lanes) else 0)
    assert checked > 15_000 and checked > 0.97 * rays and deepest >= 3
    # Light that came into a ball leaves it; and from a slab so thin, hardly any light meets the rim.
    assert beyond > 1000 or case in ("spheres", "a thin slab")


def _refraction(
    seen: RayComparison, level: Level, lanes: np.ndarray, inside: float, outside: float
) -> tuple[np.ndarray, np.ndarray]:
    """Compares how paths go on with Mitsuba's dielectric at Mitsuba's hits: where rounding does not decide it, and
    where all of the light is reflected. Shapes: (lanes)."""
    bsdf = mi.load_dict({"type": "dielectric", "int_ior": inside, "ext_ior": outside})
    through, _ = _sampled(bsdf, seen, mi.BSDFFlags.DeltaTransmission)
    back, weight = _sampled(bsdf, seen, mi.BSDFFlags.DeltaReflection)
    d, n, onward = level.d[lanes], level.n[lanes], level.onward[lanes]
    along = (d * n).sum(1)
    ratio, c = np.where(along > 0, inside / outside, outside / inside), np.abs(along)
    left = 1 - ratio**2 * (1 - c**2)
    turned = angle(seen.their_hits.n, level.n)[lanes] + STORED
    off = bent_bound(ratio, c, STORED, turned, SMALL)
    resolved = np.isfinite(off) | (left < -2 * ratio**2 * c * (STORED + turned) - 8 * SMALL * (1 + ratio**2))
    inner = left <= 0
    # Which side it goes on is the same, and Mitsuba reflects all of it there and only there.
    assert (level.inside[lanes] == ((along < 0) ^ inner))[resolved].all()
    assert ((weight[lanes] == 1) == inner)[resolved].all()
    wrong = angle(onward, np.where(inner[:, None], back[lanes], through[lanes]))
    allowed = np.where(inner, mirrored_bound(c, STORED, turned) + 8 * SMALL, off)
    assert (wrong <= allowed)[resolved].all()
    return resolved, inner


def _sampled(bsdf: object, seen: RayComparison, lobe: object) -> tuple[np.ndarray, np.ndarray]:
    """The directions of one lobe at Mitsuba's hits, in the world, of unit length, and the weight of the lobe."""
    context = mi.BSDFContext()
    context.type_mask = int(lobe)
    sample, weight = bsdf.sample(context, seen.si, mi.Float(0.5), mi.Point2f(0.5, 0.5), seen.si.is_valid())
    wo = np.array(seen.si.to_world(sample.wo), float).T
    size = np.linalg.norm(wo, axis=1, keepdims=True)
    return np.divide(wo, size, out=np.zeros_like(wo), where=size > 0), np.array(weight, float)[0]


@pytest.mark.parametrize("wrong", [1.4999, 1.5001])
def test_a_wrong_index_is_told_from_rounding(wrong: float) -> None:
    ours, theirs = pair({"a": Sphere()}, {"a": Material(kt=(1.0, 1.0, 1.0), ior=1.5)})
    level = next(levels(ours, *aimed(4, 1000), 1))
    seen, sure = met(ours, theirs, level)
    lanes = np.flatnonzero(sure & (level.index == 0))
    assert _refraction(seen, level, lanes, 1.5, 1.0)[0].all()
    with pytest.raises(AssertionError):
        _refraction(seen, level, lanes, wrong, 1.0)


HALL = {
    "a": Sphere(center=(-0.9, 0, 0), radius=0.8),
    "b": Sphere(center=(0.9, 0.1, 0.2), radius=0.85),
    "c": Sphere(center=(0, 1.2, -0.6), radius=0.6),
    "d": Box(min=(-1.5, -1.6, -1.5), max=(1.5, -0.95, 1.5), transform=(Rotate(rotate=10.0, axis=(1, 2, 0.5)),)),
    "back": Box(min=(-3, -3, -2.2), max=(3, 3, -2)),
}


def test_mirrored_paths_agree_with_mitsuba() -> None:
    ours, theirs = pair(HALL, dict.fromkeys(HALL, Material(kr=(1.0, 1.0, 1.0))))
    conductor = mi.load_dict({"type": "conductor", "material": "none"})
    counts, rays = [], 0
    for level in levels(ours, *aimed(2), 8):
        seen, sure = met(ours, theirs, level)
        agrees(seen, sure)
        lanes = np.flatnonzero(sure & level.alive)
        wo, weight = _sampled(conductor, seen, mi.BSDFFlags.DeltaReflection)
        assert (weight[lanes] == 1).all() and not level.inside[lanes].any()
        c = np.abs((level.d * level.n).sum(1))
        allowed = mirrored_bound(c, STORED, angle(seen.their_hits.n, level.n) + STORED) + 8 * SMALL
        assert (angle(level.onward, wo) <= allowed)[lanes].all()
        counts, rays = [*counts, len(lanes)], rays + int(level.alive.sum())
    assert counts[0] > 15_000 and counts[4] > 300 and sum(counts) > 0.97 * rays


# Total internal reflection

INDICES = np.linspace(1.1, 2.4, 14)


def _inside(kind: type) -> VisrayScene:
    """A solid of each index, side by side: spheres of radius 1, or slabs from -1 to 1 in y."""
    place = [(float(10 * i), 0.0, 0.0) for i in range(len(INDICES))]
    things = {f"{i}": Sphere(center=p) for i, p in enumerate(place)}
    if kind is Box:
        things = {f"{i}": Box(min=(p[0] - 4, -1, -4), max=(p[0] + 4, 1, 4)) for i, p in enumerate(place)}
    return pair(things, {f"{i}": Material(kt=(1.0, 1.0, 1.0), ior=float(n)) for i, n in enumerate(INDICES)})[0]


def _towards_the_top(ours: VisrayScene, theta: np.ndarray) -> Level:
    """Rays from inside of each solid to its top, at an angle (radians) with the normal there. Shapes: (solids)."""
    d = np.stack([np.sin(theta), np.cos(theta), 0 * theta], 1)
    top = np.stack([10.0 * np.arange(len(INDICES)), 1 + 0 * theta, 0 * theta], 1)
    # From the middle of the chord.
    level = next(levels(ours, top - np.cos(theta)[:, None] * d, d, 1))
    assert (level.index == np.arange(len(INDICES))).all()
    return level


@pytest.mark.parametrize("kind", [Sphere, Box])
def test_total_reflection_begins_at_the_critical_angle(kind: type) -> None:
    """By bisection over the angle: for each index, where visray turns from letting through to reflecting."""
    ours, critical = _inside(kind), np.arcsin(1 / INDICES)
    low, high = critical - 0.1, np.minimum(critical + 0.1, np.pi / 2 - 0.01)
    assert not _towards_the_top(ours, low).inside.any() and _towards_the_top(ours, high).inside.all()
    for _ in range(48):
        middle = 0.5 * (low + high)
        reflected = _towards_the_top(ours, middle).inside
        low, high = np.where(reflected, low, middle), np.where(reflected, middle, high)
    assert (np.abs(high - critical) < 1e-6).all()
    # 1 - n^2 sin^2: off by 8 roundings of 1 + n^2, and by those of the ray and of the point, which turns the normal.
    place = gamma(16) * (10 * len(INDICES) + 2)
    slope = 2 * INDICES**2 * np.sin(critical) * np.cos(critical)
    assert (np.abs(high - critical) <= gamma(8) * (1 + INDICES**2) / slope + place).all()


@pytest.mark.parametrize("kind", [Sphere, Box])
def test_beyond_the_critical_angle_rays_are_mirrored(kind: type) -> None:
    ours, critical = _inside(kind), np.arcsin(1 / INDICES)
    for share in (1e-6, 0.01, 0.3, 0.9):
        theta = critical + share * (np.pi / 2 - critical)
        level = _towards_the_top(ours, theta)
        assert level.inside.all() and level.alive.all()
        mirrored = np.stack([np.sin(theta), -np.cos(theta), 0 * theta], 1)
        # The normal is off by what the point is off.
        place = gamma(16) * (10 * len(INDICES) + 2)
        assert (angle(level.onward, mirrored) <= 4 * place + gamma(16)).all()
        before = _towards_the_top(ours, critical * (1 - share))
        assert not before.inside.any()
        sine = np.minimum(INDICES * np.sin(critical * (1 - share)), 1)
        # sin r is off by a few roundings, and r by that over cos r.
        turn = (4 * place + gamma(16)) * INDICES / np.sqrt(1 - sine**2)
        assert (np.abs(np.arcsin(sine) - np.arctan2(before.onward[:, 0], before.onward[:, 1])) <= turn).all()


# Snell's law in exact arithmetic

BITS = 200


def vector(v: np.ndarray) -> list:
    return [arb(float(x)) for x in v]


def dot(x: list, y: list) -> arb:
    return sum((a * b for a, b in zip(x, y)), arb(0))


def plus(x: list, k: arb, y: list) -> list:
    """x + k y."""
    return [a + k * b for a, b in zip(x, y)]


def snell(d: list, n: list, ratio: arb) -> list:
    """The refracted direction; n is unit, against d."""
    c = -dot(d, n)
    return plus([ratio * x for x in d], ratio * c - (1 - ratio**2 * (1 - c**2)).sqrt(), n)


def through_a_ball(o: np.ndarray, d: np.ndarray, centre: np.ndarray, radius: float, ior: float) -> np.ndarray:
    """Where rays leave a ball of glass, and in which direction; exact far beyond double. Shapes: (N, 3) -> (N, 6)."""
    found = []
    for origin, way in zip(o, d):
        way, from_middle = vector(way), plus(vector(origin), arb(-1), vector(centre))
        way = [x / dot(way, way).sqrt() for x in way]
        b = dot(from_middle, way)
        p = plus(from_middle, -b - (b**2 - dot(from_middle, from_middle) + arb(radius) ** 2).sqrt(), way)
        bent = snell(way, [x / radius for x in p], 1 / arb(ior))
        q = plus(p, -2 * dot(p, bent), bent)
        out = snell(bent, [-x / radius for x in q], arb(ior))
        found.append([float((x + y).mid()) for x, y in zip(q, vector(centre))] + [float(x.mid()) for x in out])
    return np.array(found)


def two_levels(thing: object, ior: float, o: np.ndarray, d: np.ndarray) -> tuple[Level, Level]:
    """Into an object of glass and out of it."""
    ours, _ = pair({"a": thing}, {"a": Material(kt=(1.0, 1.0, 1.0), ior=ior)})
    first, second = levels(ours, o, d, 2)
    assert first.alive.all() and (second.index == 0).all() and not second.inside.any()
    return first, second


def point_bound(level: Level, size: float) -> np.ndarray:
    """How far a hit is off that is known to Surface.error across the ray. size: of what the object is made of."""
    c = np.abs((level.d * level.n).sum(1))
    return gamma(8) * (np.abs(level.o).sum(1) + level.t + size) / c


@pytest.mark.parametrize("ior", [1.1, 1.5, 2.4])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (3.0, -20.0, 100.0)])
def test_a_ball_of_glass_bends_as_exactly(ior: float, place: tuple) -> None:
    rng, centre, radius = np.random.default_rng(3), np.array(place), 0.75
    aside = rng.normal(size=(300, 3))
    aside *= 0.97 * radius * rng.uniform(size=(300, 1)) ** 0.5 / np.linalg.norm(aside, axis=1, keepdims=True)
    o = centre + 4 * rng.normal(size=(300, 3)) + (9, 0, 0)
    first, second = two_levels(Sphere(center=place, radius=radius), ior, o, centre + aside - o)
    ctx.prec = BITS
    exact = through_a_ball(first.o, first.d, centre, radius, ior)
    size = np.abs(centre).sum() + radius
    cosine = [np.abs((level.d * level.n).sum(1)) for level in (first, second)]
    at = point_bound(first, size)
    normal = at / radius + gamma(6)
    bent = bent_bound(1 / ior, cosine[0], gamma(4), normal, U)
    # A line that is off by so much meets the other side off by as much over the cosine there.
    out = (at + second.t * bent) / cosine[1] + point_bound(second, size)
    onward = bent_bound(ior, cosine[1], bent, out / radius + gamma(6), U)
    assert np.isfinite(onward).all()
    assert (np.linalg.norm(second.p - exact[:, :3], axis=1) <= out).all()
    assert (angle(second.onward, exact[:, 3:]) <= onward).all()


@pytest.mark.parametrize("ior", [1.1, 1.5, 2.4])
@pytest.mark.parametrize("thickness", [0.01, 1.0, 10.0])
def test_a_slab_of_glass_moves_rays_aside(ior: float, thickness: float) -> None:
    """By d sin i (1 - cos i / (n cos r)), and they go on as they came."""
    i, turn = np.linspace(0, np.radians(85), 300), np.linspace(0, 20, 300)
    d = np.stack([np.sin(i) * np.cos(turn), -np.cos(i), np.sin(i) * np.sin(turn)], 1)
    reach = 40 * max(thickness, 1)
    box = Box(min=(-reach, -thickness, -reach), max=(reach, 0, reach))
    first, second = two_levels(box, ior, -d, d)
    # In 80 bits: the direction as the kernel has it, of unit length.
    d = first.d.astype(np.longdouble)
    d /= np.sqrt((d**2).sum(1, keepdims=True))
    sine, cosine = np.hypot(d[:, 0], d[:, 2]), -d[:, 1]
    inner = np.sqrt(1 - (sine / ior) ** 2)
    closed = thickness * sine * (1 - cosine / (ior * inner))
    way = second.p - first.o
    aside = way - (way * d).sum(1, keepdims=True) * d
    # The faces are planes of the axes, so that their normals are right.
    bent = bent_bound(1 / ior, cosine.astype(float), gamma(4), gamma(2), U)
    size = 2 * reach + thickness
    out = (point_bound(first, size) + second.t * bent) / inner.astype(float) + point_bound(second, size)
    assert (np.abs(np.sqrt((aside**2).sum(1)) - closed) <= out).all()
    assert (angle(second.onward, d.astype(float)) <= bent_bound(ior, inner.astype(float), bent, gamma(2), U)).all()
    assert (first.onward[:, 1] < 0).all() and closed[1:].min() > 0


# The penumbra of a disk of light


@pytest.mark.parametrize("sampler", ["stratified", "sobol", "independent"])
@pytest.mark.slow
def test_as_much_of_a_disk_light_is_seen_as_in_mitsuba(sampler: str) -> None:
    """Each pixel's own points of the light, as the kernel draws them, are sent to Mitsuba: the counts are equal."""
    samples = 64
    scene = Scene(
        objects={"floor": Plane(), "disk": Disk(center=(0.1, 1, 0), normal=(0.1, 1, 0.2), radius=0.6)},
        lights={"lamp": DiskLight(position=(0, 3, 0.2), normal=(0.2, -1, 0), radius=0.8, samples=samples)},
        camera=Camera(origin=(2.2, 0.8, 2), target=(0.1, 0, -0.2), fov=45.0),
        film=Film(width=96, height=64),
        settings=Settings(sampler=sampler),
    )
    ours, theirs = pair_of(scene)
    seen = RayComparison(ours, theirs, ours.pixel_rays())
    a, light = ours.a, ours.kernel.lights[0]
    here = interact(
        ours.kernel, seen.traced.ray, seen.traced.hit, integrator.single_sample_state(ours.kernel, len(seen.our_hits.t))
    )
    mean = area_light(ours.kernel, here, light, lambda s, at, row, b: a.V(dr.select(b.arrives, a.F(1), 0), 0, 0))
    mine = to_numpy(mean)[:, 0] * samples
    dimension, yours, near = here.sample.derived(0).dimension(DIMENSION + light.number), 0, False
    for j in range(samples):
        away = to_numpy(light.light.point_offset(a.W, *map(a.D, dimension.set_point(dr.opaque(a.U, j), light.points))))
        shadow_rays = ShadowRays.between(seen.points(), to_numpy(light.light.position) + away - ours.centre)
        cosine = np.where(seen.our_hits.hit, np.abs((shadow_rays.l * seen.our_hits.n).sum(1)), 1)
        reached, edge = _reached(seen, shadow_rays, seen.ray_error.start(shadow_rays.p) / cosine)
        yours, near = yours + reached.astype(int), near | edge
    compared = seen.our_hits.hit & ~near & ~seen.beyond
    assert (mine == np.round(mine))[seen.our_hits.hit].all()
    assert (mine == yours)[compared].all()
    assert ((mine > 0) & (mine < samples) & compared).sum() > 500 and (compared & (mine == 0)).sum() > 20
    assert compared.sum() > 0.98 * seen.our_hits.hit.sum()


def _reached(seen: RayComparison, shadow_rays: ShadowRays, margin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether shadow rays are unoccluded by Mitsuba, and whether rounding decides it. Shapes: (N), (N)."""
    straight = visray_lighting.unoccluded(seen.ours, seen.traced, shadow_rays, seen.our_hits.hit)
    edge = np.zeros(len(straight), bool)
    for beside in moved_shadow_rays(shadow_rays, seen.ray_error):
        edge |= visray_lighting.unoccluded(seen.ours, seen.traced, beside, seen.our_hits.hit) != straight
    return seen.theirs.unoccluded(shadow_rays, margin), edge
