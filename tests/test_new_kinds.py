"""Ellipsoid, capsule and torus against their twins in 80 bits, exact algebra, differences and Mitsuba."""

import json
from dataclasses import replace
from fractions import Fraction
from functools import cache

import flint
import numpy as np
import pytest
from samples import (
    SAMPLES,
    Lineup,
    aimed,
    array,
    direction,
    distortion,
    dot,
    gap,
    instances,
    inverse,
    norm,
    outer,
    place,
    real,
    rounding,
    truth,
    unit,
)

import visray as vr
from visray.explaining import explain
from visray.geometry import UNIT_ROUNDOFF, gamma
from visray.pack import pack
from visray.primitives import Capsule, Ellipsoid, Torus
from visray.primitives.primitive import bounding_box, scalars, transform_frame
from visray.pytree import leaves
from visray.quantities import Arrays, quantities
from visray.repack import repacked
from visray.study.mitsuba import crosscheck
from visray.study.mitsuba.tessellation import tessellate

KINDS = ("Ellipsoid", "Capsule", "Torus")
U = UNIT_ROUNDOFF["double"]
EACH = pytest.mark.parametrize("name", KINDS)
BOTH = pytest.mark.parametrize("moved", [False, True], ids=["as it is", "transformed"])


class Run:
    """Objects of one kind with rays aimed at them, and what the kernel says."""

    def __init__(self, things: list, seed: int, per: int = 64, rays=aimed):
        self.things, self.per = things, per
        rng = np.random.default_rng(seed)
        pairs = [rays(rng, x, per) for x in things]
        self.o, self.d = (np.stack([p[i] for p in pairs]) for i in (0, 1))
        self.line = Lineup(things, per)
        ray = self.line.ray(self.o, self.d)
        c = self.line.crossing(ray)
        s, u, v = self.line.surface(ray, c.t, c.part)
        count = len(things)
        self.t, self.u, self.v, self.error = (np.array(x).reshape(count, per) for x in (c.t, u, v, s.error))
        self.hit = np.isfinite(self.t)
        self.enters = np.broadcast_to(np.array(c.enters).reshape(count, -1), self.t.shape)
        self.part = None if c.part is None else np.array(c.part).reshape(count, per)
        p, n = (array(x).reshape(count, per, 3) for x in (s.p, s.n))
        self.p, self.n = np.where(self.hit[..., None], p, self.o), np.where(self.hit[..., None], n, (0, 0, 1))

    def bound(self, i: int, which: np.ndarray) -> np.ndarray:
        """What rounding may move rays by, in the object's own units."""
        o, d = local(self.things[i], self.o[i][which], self.d[i][which])
        return rounding(self.things[i], o, d, self.t[i][which])


def local(thing, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays of the world in the object's own coordinates."""
    m, offset = outer(thing)
    back = inverse(m)
    return (real(o) - real(offset)) @ back.T, real(d) @ back.T


@cache
def run(name: str, moved: bool) -> Run:
    return Run(instances(name, 7, 250, moved), 8)


def extremes(name: str, rng: np.random.Generator) -> list:
    """Objects whose lengths differ by up to a million."""
    thing, found = SAMPLES[name], []
    for _ in range(100):
        base = thing.random(rng, 10 ** rng.uniform(-2, 2))
        if name == "Ellipsoid":
            radii = max(base.radii) * np.array([1, 1e-3, 1e-6])[rng.permutation(3)] ** rng.uniform(0, 1)
            found.append(replace(base, radii=tuple(radii.tolist())))
        elif name == "Capsule":
            long = float(np.linalg.norm(np.array(base.b) - base.a))
            found.append(replace(base, radius=long * float(10 ** rng.uniform(-3, 3))))
        else:
            share = rng.choice([10 ** rng.uniform(-3, 0), 1 - 10 ** rng.uniform(-5, 0)])
            found.append(replace(base, minor=base.major * float(share)))
    return found


def support(thing, n: np.ndarray, spread: np.ndarray | None = None) -> np.ndarray:
    """The points of an object that have these unit normals: of a torus the outer ones, of a capsule's wall any. The
    object's own coordinates."""
    if isinstance(thing, Ellipsoid):
        a = real(thing.radii)
        return real(thing.center) + a * a * n / norm(a * n)[:, None]
    if isinstance(thing, Capsule):
        upper = dot(n, real(thing.b) - real(thing.a)) > 0
        return np.where(upper[:, None], real(thing.b), real(thing.a)) + thing.radius * n
    axis = unit(thing.axis)
    across = n - dot(n, axis)[:, None] * axis
    return real(thing.center) + thing.major * unit(across) + thing.minor * n


@EACH
def test_twin_in_80_bits_agrees_on_extreme_shapes(name: str) -> None:
    """Ellipsoids as thin as a millionth, capsules as balls and as needles, tori as hairs and with holes of 1e-5.

    A narrower hole is next to a singular point: there a polynomial in double tells less than the error bound."""
    check(Run(extremes(name, np.random.default_rng(5)), 6), few=0.002)


def check(r: Run, few: float = 0.1) -> None:
    unsure = hits = 0
    for i, thing in enumerate(r.things):
        name, hit = type(thing).__name__, r.hit[i]
        exact = truth(thing, r.o[i], r.d[i])
        unsure += (~exact.sure).sum()
        assert np.array_equal(hit[exact.sure], exact.what[exact.sure] > 0)
        met = exact.sure & hit
        assert np.array_equal(r.enters[i][met], exact.what[met] == 1)
        slack = gamma(2) * exact.high[met]
        assert (r.t[i][met] >= exact.low[met] - slack).all() and (r.t[i][met] <= exact.high[met] + slack).all()
        hits += met.sum()
        if not hit.any():
            continue
        k, _ = distortion(thing)
        distance, n, bend, _ = gap(thing, r.p[i][hit])
        bound = r.bound(i, hit)
        assert (np.abs(distance) <= r.error[i][hit] * k).all()
        # A normal on its way to the world is multiplied by the inverse (8), summed (3) and normalised (4).
        assert (norm(np.cross(n, r.n[i][hit])) <= k * (bound / bend + gamma(15))).all()
        assert (np.sum(n * r.n[i][hit], axis=1) > 0).all()
        assert (np.abs(norm(r.n[i][hit]) - 1) <= gamma(5)).all()
        p = local(thing, r.p[i][hit], r.d[i][hit])[0]
        least, turn = sizes(thing, p)
        u, v = SAMPLES[name].twin.uv(thing, p)
        assert (facets_around(r.u[i][hit] - u) <= bound / turn + gamma(8)).all()
        assert (facets_around(r.v[i][hit] - v) <= bound / least + gamma(8)).all()
    assert unsure <= 0.001 * r.hit.size and hits > few * r.hit.size


def sizes(thing, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least radius of curvature along v, and the distance from the axis that u turns about."""
    if isinstance(thing, Ellipsoid):
        q = (p - real(thing.center)) / real(thing.radii)
        turn = np.hypot(q[:, 0], q[:, 2])
        return min(thing.radii), np.where(turn == 0, 1, turn) * min(thing.radii)
    if isinstance(thing, Capsule):
        way = unit(real(thing.b) - real(thing.a))
        return thing.radius, norm(np.cross(p - real(thing.a), way))
    return thing.minor, norm(np.cross(p - real(thing.center), unit(thing.axis)))


def facets_around(x: np.ndarray) -> np.ndarray:
    """The distance of numbers on a circle of length 1."""
    return np.abs((x + 0.5) % 1 - 0.5)


def test_parts_of_a_capsule_are_where_its_axis_ends() -> None:
    for moved in (False, True):
        r = run("Capsule", moved)
        seen = 0
        for i, thing in enumerate(r.things):
            hit = r.hit[i]
            p = local(thing, r.p[i][hit], r.d[i][hit])[0]
            way = real(thing.b) - real(thing.a)
            along = dot(p - real(thing.a), way / norm(way))
            part = np.where(along < 0, 1, np.where(along > norm(way), 2, 0))
            # Two more roundings of p itself, and those of the twin's own corner.
            near = np.minimum(np.abs(along), np.abs(along - norm(way))) < 4 * r.bound(i, hit)
            # A grazing ray may meet the wall and the ball at once.
            assert (r.part[i][hit] == part)[~near].all()
            seen += (~near).sum()
            assert (near.sum() == 0) or near.mean() < 0.5
        assert seen > 0.99 * r.hit.sum()


@BOTH
@EACH
def test_box_is_tight_and_ball_holds_the_object(name: str, moved: bool) -> None:
    """Against the points where the object touches the planes of its box, from its normals in 80 bits."""
    for thing in instances(name, 17, 100, moved):
        m, offset = outer(thing)
        bounds = scalars(thing).bounds(transform_frame(thing))
        low, high = bounding_box(thing)
        middle, reach = SAMPLES[name].hull(thing)
        rounded = gamma(24) * (np.linalg.norm(m, 2) * (np.linalg.norm(middle) + reach) + np.linalg.norm(offset))
        for sign, side in ((1, high), (-1, low)):
            n = real(sign * np.eye(3)) @ real(m)
            touch = support(thing, unit(n)) @ real(m).T + real(offset)
            assert (np.abs(np.diagonal(touch) - side) <= rounded).all()
            away = norm(touch - np.array(bounds.centre, float))
            assert (away <= float(np.array(bounds.radius).item()) + rounded).all()
        if not moved:
            assert float(np.array(bounds.radius).item()) <= reach * (1 + gamma(12))


# Exact algebra


def quartic(s: Torus, o: np.ndarray, d: np.ndarray) -> flint.fmpq_poly:
    """(|p|^2 + R^2 - r^2)^2 - 4 R^2 (p.x^2 + p.z^2) of a torus about y, exactly, along a ray."""

    def q(x: float) -> flint.fmpq:
        x = Fraction(float(x))
        return flint.fmpq(x.numerator, x.denominator)

    x, y, z = (flint.fmpq_poly([q(a) - q(c), q(b)]) for a, b, c in zip(o, d, s.center))
    big, small = q(s.major) ** 2, q(s.minor) ** 2
    return (x * x + y * y + z * z + (big - small)) ** 2 - 4 * big * (x * x + z * z)


def exact_roots(s: Torus, o: np.ndarray, d: np.ndarray) -> list[float]:
    roots = quartic(s, o, d).numer().complex_roots()
    return sorted(float(z.real) for z, _ in roots if z.imag == 0)


def tori(rng: np.random.Generator, count: int) -> list[Torus]:
    found = []
    for _ in range(count):
        scale = 10 ** rng.uniform(-3, 3)
        major = float(scale * 10 ** rng.uniform(-1, 1))
        found.append(Torus(center=place(rng, scale), major=major, minor=major * float(rng.uniform(0.05, 0.99))))
    return found


@pytest.mark.slow
def test_torus_agrees_with_exact_algebra() -> None:
    """4,000 rays of 40 tori about y: the first positive root of the exact quartic, certified, and t to within so many
    roundings of what it comes from over the slope."""
    rng = np.random.default_rng(31)
    r = Run(tori(rng, 40), 32, 100)
    worst = 0.0
    for i, thing in enumerate(r.things):
        for o, d, t, n in zip(r.o[i], r.d[i], r.t[i], r.n[i]):
            ahead = [x for x in exact_roots(thing, o, d) if x > 0]
            assert np.isfinite(t) == bool(ahead)
            if ahead:
                size = np.linalg.norm(o - thing.center) + t + thing.major + thing.minor + np.abs(thing.center).sum()
                worst = max(worst, abs(t - ahead[0]) * abs(n @ d) / (U * size))
    assert worst < 4


def test_length_inside_is_the_sum_of_the_chords() -> None:
    """Of a torus by exact roots, of the others by their twins' intervals."""
    rng = np.random.default_rng(33)
    r = Run(tori(rng, 20), 34, 50)
    ray = r.line.ray(r.o, r.d)
    end = 4e3 * np.array([x.major + x.minor for x in r.things])
    through, length = r.line.length_inside(ray, r.line.a.D(np.repeat(end, 50)))
    through, length = np.array(through).reshape(r.t.shape), np.array(length).reshape(r.t.shape)
    twice = 0
    for i, thing in enumerate(r.things):
        for k in range(50):
            o, d = r.o[i, k], r.d[i, k]
            ahead = [x for x in exact_roots(thing, o, d) if x > 0]
            inside, at, exact = len(ahead) % 2 == 1, 0.0, 0.0
            for x in ahead:
                exact, at, inside = exact + (x - at if inside else 0), x, not inside
            size = np.linalg.norm(o - thing.center) + thing.major + np.abs(thing.center).sum()
            # A chord's ends move by rounding over their slope, which is small only where the chord is short.
            assert abs(length[i, k] - exact) <= np.sqrt(U * size * 64 * thing.major) if exact < 1e-4 * size else True
            assert abs(length[i, k] - exact) <= 1e-9 * size
            # Of rays that miss, nothing is said.
            assert not ahead or through[i, k] == (len(ahead) % 2 == 0)
            twice += len(ahead) == 4
    assert twice > 20
    for name in ("Ellipsoid", "Capsule"):
        r = run(name, False)
        ray = r.line.ray(r.o, r.d)
        _, length = r.line.length_inside(ray, r.line.a.D(1e30))
        length = np.array(length).reshape(r.t.shape)
        for i, thing in enumerate(r.things):
            o, d = real(r.o[i]), real(r.d[i])
            g = rounding(thing, o, d, 0.0)
            low, high = ([np.maximum(0, x) for x in SAMPLES[name].twin.interval(thing, o, d, s * g)] for s in (-1, 1))
            shortest = np.where(low[0] < low[1], low[1] - low[0], 0)
            longest = np.where(high[0] < high[1], high[1] - high[0], 0)
            slack = gamma(4) * np.abs(high[1])
            assert (length[i] >= shortest - slack).all() and (length[i] <= longest + slack).all()


# In scenes

WHITE = vr.Material(ka=(0.1, 0.2, 0.3), kd=(0.7, 0.6, 0.5), ks=(0.3, 0.3, 0.3), shininess=10)
FILLING = {
    "ellipsoid": (Ellipsoid(center=(0.1, -0.2, 0.3), radii=(5.0, 4.0, 1.5), material="m"), ("center", "radii")),
    "capsule": (Capsule(a=(-4, -0.3, 0.2), b=(5, 0.8, -0.3), radius=2.0, material="m"), ("a", "b", "radius")),
    "end of a capsule": (Capsule(a=(-0.4, 0.3, -3), b=(0.3, 0.2, 0.5), radius=2.0, material="m"), ("a", "b", "radius")),
    "torus": (Torus(center=(0.2, -7, -0.4), axis=(0.1, 0.2, 1), major=7, minor=1.8, material="m"),
              ("center", "axis", "major", "minor")),
}  # fmt: skip


def filled(thing) -> vr.Scene:
    """One object that fills the view, all of it lit."""
    return vr.Scene(
        film=vr.Film(width=12, height=8),
        camera=vr.Camera(origin=(0, 0, 6), target=(0, 0, 0), fov=14),
        lights={"key": vr.PointLight(position=(1, 2, 8), Is=(1, 1, 1))},
        materials={"m": WHITE},
        objects={"thing": thing},
        settings=vr.Settings(spp=1, shadows=False, precision="double"),
    )


@pytest.mark.filterwarnings("ignore::visray.EdgeWarning")
@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("which", FILLING)
def test_derivative_by_every_field_is_the_difference(which: str, moved: bool) -> None:
    """Central differences in double leave 1e-16 / 1e-6 of rounding and 1e-12 of third derivatives, each a few times."""
    thing, named = FILLING[which]
    if moved:
        thing = replace(thing, transform=(vr.Scale(scale=(1.1, 0.9, 1.05)), vr.Rotate(rotate=5, axis=(1, 2, 3))))
    scene = filled(thing)
    assert np.all(vr.render(scene)["id"] == vr.render(scene)["id"][0, 0])
    for name in named:
        value = getattr(thing, name)
        for address in (
            [f"objects.thing.{name}.{k}" for k in range(3)] if isinstance(value, tuple) else [f"objects.thing.{name}"]
        ):
            slope, slow = vr.derivative(scene, address), vr.difference(scene, address)
            assert np.allclose(slope, slow, rtol=0, atol=2e-8), address
            mean = vr.gradient(scene, [address])[address]
            assert np.isclose(mean, slope.mean(), rtol=1e-9, atol=1e-12)
    assert np.abs(slope).max() > 1e-3


def test_a_torus_may_hide_itself_and_a_derivative_says_so() -> None:
    with pytest.warns(vr.EdgeWarning, match="silhouettes"):
        vr.derivative(filled(FILLING["torus"][0]), "objects.thing.major")


def test_a_torus_moves_without_its_scene_being_packed_anew_and_shows_its_certificate() -> None:
    scene = filled(FILLING["torus"][0])
    image = vr.render(scene, layers=["RGB", "unresolved", "residual"])
    assert np.all(image["unresolved"] == 0) and image["residual"].max() <= 8
    other = vr.replaced(scene, "objects.thing.minor", 1.5)
    assert not np.array_equal(vr.render(other)["RGB"], image["RGB"])
    assert vr.value(other, "objects.thing.minor") == 1.5
    assert "shadows" in str(explain(scene))


@EACH
def test_numbers_that_change_are_put_where_they_are(name: str) -> None:
    """What is packed after an update is what is packed anew, bit for bit."""
    things = {f"o{i}": x for i, x in enumerate(instances(name, 51, 5, False))}
    old, a = vr.Scene(objects=things, camera=vr.Camera(), lights={}), Arrays.of("llvm", "double")
    other = instances(name, 52, 1, False)[0]
    addressed = {f"objects.o3.{k}": getattr(other, k) for k in quantities(type(other))}
    new = replace(old, objects=things | {"o3": other})
    found = repacked(pack(old, a), old, new, addressed, a)
    fresh = pack(new, a)
    for x, y in zip(leaves(found.batches), leaves(fresh.batches)):
        assert np.array_equal(np.array(x), np.array(y))


@pytest.mark.parametrize(
    ("thing", "wrong"),
    [
        ({"type": "torus", "major": 1, "minor": 1}, "objects.x.minor = 1.0: must be less than major"),
        ({"type": "capsule", "a": [1, 2, 3], "b": [1, 2, 3]},
         "objects.x.b = [1.0, 2.0, 3.0]: must be another point than a; where they are one, write a sphere"),
        ({"type": "ellipsoid", "radii": [1, 0, 1]}, "objects.x.radii.1 = 0: must be greater than 0"),
        ({"type": "ellipsoid", "radii": [1, 2]}, "objects.x.radii"),
    ],
)  # fmt: skip
def test_bad_values_are_one_clear_line(tmp_path, thing: dict, wrong: str) -> None:
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"objects": {"x": thing}, "camera": {}, "lights": {}}))
    with pytest.raises(vr.UserError) as told:
        vr.load(path)
    assert wrong in str(told.value) and len(str(told.value).strip().splitlines()) == 1


BY_HAND = (
    (Ellipsoid(radii=(2, 3, 4)), (2, 0, 0), (0.5, 0.5)),
    (Ellipsoid(radii=(2, 3, 4)), (0, 0, -4), (0.75, 0.5)),
    (Ellipsoid(radii=(2, 3, 4)), (0, 3, 0), (0.5, 1)),
    # About y, half a unit of wall beside two quarters of a circle.
    (Capsule(radius=1, a=(0, -1, 0), b=(0, 1, 0)), (1, 0, 0), (0.5, 0.5)),
    (Capsule(radius=1, a=(0, -1, 0), b=(0, 1, 0)), (0, 1, -1), (0.75, 0.5 + 1 / (np.pi + 2))),
    (Capsule(radius=1, a=(0, -1, 0), b=(0, 1, 0)), (0, 2, 0), (0.5, 1)),
    (Capsule(radius=1, a=(0, -1, 0), b=(0, 1, 0)), (0, -2, 0), (0.5, 0)),
    (Capsule(radius=1, a=(0, -1, 0), b=(0, 1, 0)), (0.6, 1.8, 0), (0.5, 0.5 + (1 + np.arcsin(0.8)) / (np.pi + 2))),
    (Torus(major=2, minor=1), (3, 0, 0), (0.5, 0.5)),
    (Torus(major=2, minor=1), (0, 1, -2), (0.75, 0.75)),
    (Torus(major=2, minor=1), (0, -1, 2), (0.25, 0.25)),
)  # fmt: skip


@pytest.mark.parametrize(("thing", "p", "uv"), BY_HAND)
def test_uv_by_hand(thing, p: tuple, uv: tuple) -> None:
    line = Lineup([thing], 1)
    found = line.kind.uv(line.batch.placed, line.a.W(*map(float, p)))
    assert np.allclose([x[0] for x in found], uv, rtol=0, atol=4 * gamma(20))


@pytest.mark.slow
def test_objects_under_unequal_scales_agree_with_mitsuba() -> None:
    rng = np.random.default_rng(41)
    turned = lambda *scale: (vr.Scale(scale=scale), vr.Rotate(rotate=40, axis=direction(rng)))  # noqa: E731
    things = {
        "egg": Ellipsoid(radii=(0.6, 0.9, 0.4), transform=(*turned(1, 1.5, 0.7), vr.Translate(translate=(-2, 0, 0)))),
        "pill": Capsule(a=(0, -0.4, 0), b=(0.5, 0.4, 0.1), radius=0.3, transform=turned(1.2, 1, 0.8)),
        "ring": Torus(axis=(1, 1, 0), major=0.7, minor=0.25,
                      transform=(*turned(1, 0.8, 1.3), vr.Translate(translate=(2, 0, 0)))),
    }  # fmt: skip
    scene = vr.Scene(objects=things, camera=vr.Camera(origin=(0, 1, 8), target=(0, 0, 0), fov=40),
                     film=vr.Film(width=120, height=80), lights={"l": vr.PointLight(position=(3, 5, 6))})  # fmt: skip
    report = crosscheck.check(scene, rays=20_000)
    assert report.passed, report.as_json()


def test_many_tori_in_a_tree_are_found_as_one_by_one() -> None:
    rng = np.random.default_rng(43)
    things = {
        f"t{i}": Torus(center=tuple(rng.normal(size=3).tolist()), axis=direction(rng), major=0.2, minor=0.06)
        for i in range(100)
    }
    scene = vr.Scene(objects=things, camera=vr.Camera(origin=(0, 0, 6), target=(0, 0, 0), fov=40),
                     film=vr.Film(width=48, height=32), lights={"l": vr.PointLight(position=(3, 5, 6))})  # fmt: skip
    ways = [vr.render(replace(scene, settings=vr.Settings(spp=1, accelerator=way)))["RGB"] for way in ("none", "tree")]
    assert np.array_equal(*ways)


@pytest.mark.parametrize("kind", ["capsule", "torus"])
def test_triangles_for_mitsuba_are_near_the_shape_and_look_outwards(kind: str) -> None:
    n, shape = 64, {"capsule": 0.7, "torus": 0.3}[kind]
    f = tessellate(kind, n, shape)
    corners = f.vertices[f.faces]
    flat = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).astype(float)
    middle = unit(f.normals[f.faces].mean(1)).astype(float)
    assert (np.arccos(np.clip((flat * middle).sum(1), -1, 1)) <= 2 * np.pi / n).all()
    x, y, z = f.vertices.T
    if kind == "capsule":
        away = np.sqrt(x * x + y * y + np.maximum(np.abs(z) - shape, 0) ** 2) - 1
        volume = np.pi * (4 / 3 + 2 * shape)
    else:
        away = np.hypot(np.hypot(x, y) - 1, z) - shape
        volume = 2 * np.pi**2 * shape**2
    assert np.abs(away).max() <= 8 * U
    # The divergence theorem; triangles are off by the gap at most, over the whole of the surface.
    area = 4 * np.pi * (1 + shape) if kind == "capsule" else 4 * np.pi**2 * shape
    inside = (corners.mean(1) * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).sum() / 6
    assert abs(inside - volume) <= f.gap * area
    # v runs as the surface is long.
    assert f.uv.min() == 0 and f.uv.max() == 1


GLASS = vr.Material(kt=(0.8, 0.7, 0.9), dmax=3.0)
BESIDE_GLASS = vr.Scene(
    film=vr.Film(width=40, height=30),
    camera=vr.Camera(origin=(0.0, 1.5, 6.0)),
    materials={"glass": GLASS, "matte": vr.Material()},
    lights={"key": vr.PointLight(position=(2.0, 6.0, 3.0))},
    objects={
        "floor": vr.Plane(point=(0.0, -1.0, 0.0)),
        "ring": vr.Torus(axis=(0.2, 1.0, 0.3), major=1.2, minor=0.35, material="matte"),
        "egg": vr.Ellipsoid(center=(0.0, 1.2, 0.0), radii=(0.5, 0.4, 0.5), material="glass"),
    },
    settings=vr.Settings(spp=1, depth=1),
)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::visray.EdgeWarning")
@pytest.mark.parametrize("address", ["objects.ring.major", "objects.egg.center.1"])
def test_an_opaque_torus_beside_glass_has_derivatives(address: str) -> None:
    """Its own coloured shadow is none, so that what it lacks is not missed; one of glass is refused by its name."""
    slope, exact = vr.derivative(BESIDE_GLASS, address), vr.difference(BESIDE_GLASS, address)
    # Differences see what moving edges add, in a few pixels.
    off = np.abs(slope - exact).max(-1) > 1e-5 * np.abs(exact).max()
    assert np.abs(slope).max() > 0.01 and off.mean() < 0.1
    glassy = vr.replaced(BESIDE_GLASS, "objects.ring.material", "glass")
    with pytest.raises(vr.UserError, match=r"^objects.ring: .*; give this torus a material without kt$"):
        vr.derivative(glassy, address)
