"""Each kind of primitive against its twin, against exact arithmetic, and where rays are degenerate."""

from dataclasses import replace
from functools import cache

import drjit as dr
import flint
import numpy as np
import pytest
from samples import (
    NAMES,
    ROUNDINGS,
    SAMPLES,
    Lineup,
    aimed,
    array,
    ball_of,
    direction,
    distortion,
    gap,
    geometry_of,
    instances,
    inverse,
    norm,
    outer,
    real,
    round_of,
    rounding,
    shifted,
    triangle_of,
    truth,
    unit,
)

from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.geometry import gamma
from visray.primitives import (
    KINDS,
    Box,
    Capsule,
    Cone,
    Csg,
    Cylinder,
    Ellipsoid,
    Mesh,
    Polynomial,
    Rectangle,
    Sphere,
    Torus,
    Triangle,
)
from visray.primitives.algebraic import Algebraic
from visray.primitives.convex import ConvexSolid
from visray.primitives.flat import Flat
from visray.primitives.primitive import bounding_box, scalars, transform_frame
from visray.ray import Ray
from visray.scene.scene import Scene
from visray.transforms import Scale

OBJECTS, RAYS = 250, 64
FLATS = [name for name in NAMES if issubclass(SAMPLES[name].posed.kind, Flat)]
SOLIDS = [name for name in NAMES if issubclass(SAMPLES[name].posed.kind, ConvexSolid)]
ALGEBRAIC = [name for name in NAMES if issubclass(SAMPLES[name].posed.kind, Algebraic)]
COMPOSITE = [name for name in NAMES if SAMPLES[name].posed.composite]
TRIANGULAR = [name for name in NAMES if SAMPLES[name].posed.kind.triangular]
U = 2.0**-53


def test_every_kind_has_a_sample_and_a_family() -> None:
    assert set(NAMES) == set(SAMPLES)
    assert all(SAMPLES[k.__name__].kind is k for k in KINDS)
    # Of an algebraic surface there is no telling how often a ray meets it.
    assert sorted([*FLATS, *SOLIDS, *ALGEBRAIC, *COMPOSITE]) == sorted(NAMES)


class Run:
    """Objects of one kind with rays aimed at them, and what the kernel says."""

    def __init__(self, name: str, moved: bool, seed: int, count: int = OBJECTS, per: int = RAYS, rays=None):
        self.things = instances(name, seed, count, moved)
        self.count, self.per = count, per
        rng = np.random.default_rng(seed + 1)
        pairs = [(rays or aimed)(rng, x, per) for x in self.things]
        self.o, self.d = (np.stack([p[i] for p in pairs]) for i in (0, 1))
        self.line = Lineup(self.things, per)
        ray = self.line.ray(self.o, self.d)
        crossing = self.line.crossing(ray)
        t = crossing.t
        s, u, v = self.line.surface(ray, t, crossing.part)
        self.enters = np.broadcast_to(np.array(crossing.enters).reshape(count, -1), (count, per))
        self.t, self.u, self.v, self.error = (np.array(x).reshape(count, per) for x in (t, u, v, s.error))
        self.hit = np.isfinite(self.t)
        # Where a ray misses, its own origin and any direction, so that what follows stays finite.
        p, n = (array(x).reshape(count, per, 3) for x in (s.p, s.n))
        self.p, self.n = np.where(self.hit[..., None], p, self.o), np.where(self.hit[..., None], n, (0, 0, 1))

    def truths(self):
        """(index, object, truth) of every object."""
        for i, thing in enumerate(self.things):
            yield i, thing, truth(thing, self.o[i], self.d[i])


@cache
def run(name: str, moved: bool) -> Run:
    return Run(name, moved, seed=7)


BOTH = pytest.mark.parametrize("moved", [False, True], ids=["as it is", "transformed"])
# The quick suite leaves transformed objects to the test of the crossings.
MOVED_IS_SLOW = pytest.mark.parametrize(
    "moved", [pytest.param(False, id="as it is"), pytest.param(True, id="transformed", marks=pytest.mark.slow)]
)
EACH = pytest.mark.parametrize("name", NAMES)


def local_rounding(thing, o: np.ndarray, d: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The bound of samples.rounding for rays of the world, in the object's own units."""
    m, offset = outer(thing)
    back = inverse(m)
    return rounding(thing, (real(o) - real(offset)) @ back.T, real(d) @ back.T, t)


@BOTH
@EACH
def test_kernel_finds_the_same_crossing_as_its_twin(name: str, moved: bool) -> None:
    """16 000 rays over 8 decades of size: the same decision, and t within what the rounding bound may change."""
    r, unsure, hits = run(name, moved), 0, 0
    for i, _, exact in r.truths():
        unsure += (~exact.sure).sum()
        met = exact.sure & r.hit[i]
        assert np.array_equal(r.hit[i][exact.sure], exact.what[exact.sure] > 0)
        assert np.array_equal(r.enters[i][met], exact.what[met] == 1) or not r.line.kind.closed
        # The last step of the kernel adds what it found to where it recentred: two roundings.
        slack = gamma(2) * exact.high[met]
        assert (r.t[i][met] >= exact.low[met] - slack).all()
        assert (r.t[i][met] <= exact.high[met] + slack).all()
        hits += met.sum()
    # A ray is within the bound (1e-8 of the object at worst) of an edge with a chance of 1e-8: 1e-4 of them expected.
    assert unsure <= 1
    assert hits > OBJECTS * RAYS / 10


@MOVED_IS_SLOW
@EACH
def test_normal_is_that_of_the_twin(name: str, moved: bool) -> None:
    """Where no edge is near: the angle is at most the rounding bound over the radius of curvature."""
    r, seen = run(name, moved), 0
    for i, thing in enumerate(r.things):
        hit = r.hit[i]
        if not hit.any():
            continue
        k, _ = distortion(thing)
        _, n, bend, crease = gap(thing, r.p[i][hit])
        # The corners of a triangle are rounded one by one, which tilts it.
        bend = np.minimum(bend, _least(thing)) if name in TRIANGULAR else bend
        bound = local_rounding(thing, r.o[i][hit], r.d[i][hit], r.t[i][hit])
        away = crease > 2 * bound
        sine = norm(np.cross(n, r.n[i][hit]))
        # A normal on its way to the world is multiplied by the inverse (8), summed (3) and normalised (4).
        assert (sine <= k * (bound / bend + gamma(15)))[away].all()
        assert (np.sum(n * r.n[i][hit], axis=1) > 0)[away].all()
        assert (np.abs(norm(r.n[i][hit]) - 1) <= gamma(5)).all()
        seen += away.sum()
    assert seen > 0.99 * r.hit.sum()


@MOVED_IS_SLOW
@EACH
def test_error_of_a_surface_point_bounds_its_distance_from_the_surface(name: str, moved: bool) -> None:
    """Measured in 80 bits. A transform that shears or stretches multiplies the bound by its distortion."""
    r = run(name, moved)
    for i, thing in enumerate(r.things):
        hit = r.hit[i]
        distance = np.abs(gap(thing, r.p[i][hit])[0])
        assert (distance <= r.error[i][hit] * (distortion(thing)[0] if moved else 1)).all()
        along = norm(real(r.p[i][hit]) - (real(r.o[i][hit]) + r.t[i][hit, None] * real(r.d[i][hit])))
        assert (along <= np.sqrt(3) * gamma(2) * (np.abs(r.o[i][hit]).max(1) + r.t[i][hit])).all()


@EACH
def test_error_bound_holds_on_objects_much_greater_than_the_view(name: str) -> None:
    """A ball as the ground: rays of 1e-6 to 1 of its size about the origin of the world, its centre far below."""
    far, rng, things = run(name, False), np.random.default_rng(3), []
    for thing, p, hit in zip(far.things, far.p, far.hit):
        things += [shifted(thing, -p[hit][0])] if hit.any() else []
    reach = np.array([SAMPLES[name].hull(x)[1] for x in things])[:, None, None]
    o = reach * 10 ** rng.uniform(-6, 0, (len(things), 32, 1)) * rng.normal(size=(len(things), 32, 3))
    d = rng.normal(size=o.shape)
    d /= np.linalg.norm(d, axis=2, keepdims=True)
    line = Lineup(things, 32)
    ray = line.ray(o, d)
    t = line.first(ray)
    s = line.surface(ray, t)[0]
    distance = np.array(t).reshape(len(things), 32)
    hit = np.isfinite(distance)
    p, error = array(s.p).reshape(o.shape), np.array(s.error).reshape(hit.shape)
    assert hit.sum() > hit.size / 4
    sizes = [np.abs(middle).sum() + size for middle, size in map(SAMPLES[name].hull, things)]
    # Triangles of meshes have one bound for all.
    sizes = np.full(len(sizes), max(sizes)) if line.kind.many_rows else sizes
    for i, thing in enumerate(things):
        assert (np.abs(gap(thing, p[i][hit[i]])[0]) <= error[i][hit[i]]).all()
        exact = truth(thing, o[i], d[i])
        assert np.array_equal(hit[i][exact.sure], exact.what[exact.sure] > 0)
        away = exact.sure & hit[i]
        t = distance[i][away]
        assert (t >= exact.low[away] * (1 - gamma(2))).all() and (t <= exact.high[away] * (1 + gamma(2))).all()
        # And it is no careless bound: 24 roundings of the greatest coordinate that matters.
        most = sizes[i] + np.abs(o[i]).sum(1) + distance[i]
        assert (error[i][hit[i]] <= gamma(24) * most[hit[i]]).all()


@MOVED_IS_SLOW
@EACH
def test_bounds_and_sphere_hold_the_object_and_little_more(name: str, moved: bool) -> None:
    r = run(name, moved)
    for i, thing in enumerate(r.things):
        if name == "Plane":
            assert bounding_box(thing) is None
            continue
        low, high = bounding_box(thing)
        ball = scalars(thing).bounds(transform_frame(thing))
        centre, radius = np.array(ball.centre, float), np.array(ball.radius, float)
        p, e = r.p[i][r.hit[i]], r.error[i][r.hit[i]][:, None]
        # The corners come out of at most 12 roundings of numbers no greater than these.
        m, offset = outer(thing)
        middle, reach = SAMPLES[name].hull(thing)
        stretch = np.linalg.norm(m, 2)
        slack = e + gamma(12) * (stretch * (np.linalg.norm(middle) + reach) + np.linalg.norm(offset))
        assert (p >= low - slack).all() and (p <= high + slack).all()
        assert (np.linalg.norm(p - centre, axis=1)[:, None] <= radius + slack).all()
        # Longest row sums and leaning axes cost at most sqrt(3) and sqrt(2); what is not moved is held tightly.
        loose = SAMPLES[name].loose * reach
        assert radius <= (np.sqrt(6) * stretch if moved else 1 + gamma(12)) * loose


@MOVED_IS_SLOW
@pytest.mark.parametrize("name", SOLIDS)
def test_solid_is_entered_before_it_is_left_and_the_middle_is_inside(name: str, moved: bool) -> None:
    r = run(name, moved)
    ray = r.line.ray(r.o, r.d)
    line = r.line.kind.intervals(r.line.seen(ray.o), ray.d)
    t0, t1 = (np.array(t).reshape(r.count, r.per) for t in (line.near, line.far))
    assert np.array_equal((t0 <= t1) & (t1 > 0), r.hit)
    for i, thing in enumerate(r.things):
        hit = r.hit[i]
        assert (t0[i][hit] < t1[i][hit]).all()
        middle = real(r.o[i][hit]) + 0.5 * (t0[i][hit] + t1[i][hit])[:, None] * real(r.d[i][hit])
        assert (gap(thing, middle)[0] < 0).all()
        # Both ends are on the surface, whichever of them is in front of the origin.
        for t in (t0[i][hit], t1[i][hit]):
            end = real(r.o[i][hit]) + t[:, None] * real(r.d[i][hit])
            middle, reach = SAMPLES[name].hull(thing)
            m, offset = outer(thing)
            span = np.linalg.norm(m, 2) * (np.abs(middle).sum() + reach) + np.abs(offset).sum()
            bound = gamma(8) * (np.abs(r.o[i][hit]).sum(1) + np.abs(t) + span) * distortion(thing)[0]
            assert (np.abs(gap(thing, end)[0]) <= bound).all()


# Exact truth: balls of 300 bits around real numbers, whose comparisons are true only where they are certain.

flint.ctx.prec = 300


def arbs(v) -> list:
    return [flint.arb(float(x)) for x in v]


def add(a: list, b: list, s=1) -> list:
    return [x + s * y for x, y in zip(a, b)]


def inner(a: list, b: list):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def outer_product(a: list, b: list) -> list:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def roots(a, b, c) -> tuple | None:
    """The roots of a t^2 + 2 b t + c in order, or None."""
    disc = b * b - a * c
    if not disc >= 0:
        return None
    root = disc.sqrt()
    first, second = (-b - root) / a, (-b + root) / a
    return (first, second) if first <= second else (second, first)


def slab(z, dz, low, high) -> tuple:
    """Where low <= z + t dz <= high; no test ray is parallel to a cap."""
    first, second = (low - z) / dz, (high - z) / dz
    return (first, second) if first <= second else (second, first)


def both(p: tuple | None, q: tuple | None) -> tuple | None:
    if p is None or q is None:
        return None
    low, high = p[0] if p[0] >= q[0] else q[0], p[1] if p[1] <= q[1] else q[1]
    return (low, high) if low <= high else None


def exact_sphere(s: Sphere, o: list, d: list, g: float) -> tuple | None:
    w = add(o, arbs(s.center), -1)
    radius = flint.arb(s.radius) + g
    return roots(inner(d, d), inner(w, d), inner(w, w) - radius * radius)


def exact_cylinder(s: Cylinder, o: list, d: list, g: float) -> tuple | None:
    a = arbs(s.axis)
    a = [x / inner(a, a).sqrt() for x in a]
    w = add(o, arbs(s.center), -1)
    dx, wx, radius = outer_product(d, a), outer_product(w, a), flint.arb(s.radius) + g
    half = flint.arb(s.height) / 2 + g
    wall = roots(inner(dx, dx), inner(dx, wx), inner(wx, wx) - radius * radius)
    return both(wall, slab(inner(w, a), inner(d, a), -half, half))


def exact_cone(s: Cone, o: list, d: list, g: float) -> tuple | None:
    """Crossings of the wall on the side of the base, and of the base's disk: the first and the last of them."""
    a = arbs(s.axis)
    a = [x / inner(a, a).sqrt() for x in a]
    radius, height = flint.arb(s.radius), flint.arb(s.height)
    slant = (radius * radius + height * height).sqrt()
    apex = add(arbs(s.base), a, height + g * slant / radius)
    w, cosine = add(o, apex, -1), height / slant
    dn, wn, c2 = inner(d, a), inner(w, a), cosine * cosine
    wall = roots(dn * dn - c2 * inner(d, d), dn * wn - c2 * inner(w, d), wn * wn - c2 * inner(w, w))
    depth = -height - g * slant / radius - g  # of the base under the apex
    found = [t for t in wall or () if wn + t * dn <= 0 and wn + t * dn >= depth]
    at_base = (depth - wn) / dn
    q = add(w, d, at_base)
    if inner(q, q) * c2 <= depth * depth:
        found.append(at_base)
    return (min(found), max(found)) if len(found) > 1 else None


def exact_polynomial(s: Polynomial, o: list, d: list, g: float) -> tuple | None:
    return exact_sphere(round_of(s), o, d, g)


EXACT = {"Sphere": exact_sphere, "Cylinder": exact_cylinder, "Cone": exact_cone, "Polynomial": exact_polynomial}


def exact_first(thing, o: np.ndarray, d: np.ndarray, g: float):
    """(kind of first crossing as in Truth, t) of one ray."""
    if isinstance(thing, Triangle):
        return exact_triangle(thing, arbs(o), arbs(d), g)
    found = EXACT[type(thing).__name__](thing, arbs(o), arbs(d), flint.arb(g))
    if found is None or not found[1] > 0:
        return 0, flint.arb("inf")
    return (1, found[0]) if found[0] > 0 else (2, found[1])


def exact_triangle(s: Triangle, o: list, d: list, g: float):
    """By half-planes; g > 0 moves every edge outwards, and its size lifts the plane."""
    corners = [arbs(v) for v in (s.a, s.b, s.c)]
    n = outer_product(add(corners[1], corners[0], -1), add(corners[2], corners[0], -1))
    n = [x / inner(n, n).sqrt() for x in n]
    slope = inner(d, n)
    t = (inner(add(corners[0], o, -1), n) + g) / slope
    p = add(o, d, t)
    for a, b in zip(corners, corners[1:] + corners[:1]):
        m = outer_product(add(b, a, -1), n)
        # A crossing that slips along a flat ray passes the edge by as much more.
        slip = g * (1 + 1 / abs(slope)) if g else 0
        if not inner(add(p, a, -1), m) <= slip * inner(m, m).sqrt():
            return 0, flint.arb("inf")
    return (1, t) if t > 0 else (0, flint.arb("inf"))


def touching(rng: np.random.Generator, thing, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays past points of the silhouette, or through edges and the apex, off them by 10^U(-16, -1) of the size."""
    reach = SAMPLES[type(thing).__name__].hull(thing)[1]
    off = reach * 10 ** rng.uniform(-16, -1, (count, 1)) * rng.choice([-1, 1], (count, 1))
    far = reach * 10 ** rng.uniform(-0.5, 2, (count, 1))
    q, n = _rim(rng, thing, count)
    along = np.cross(n, rng.normal(size=(count, 3)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    if isinstance(thing, Triangle):
        along += n * rng.normal(size=(count, 1))  # rays across the edge, not past it
    o = q + off * n - far * along
    d = q + off * n - o
    return o, d / np.linalg.norm(d, axis=1, keepdims=True)


def _rim(rng: np.random.Generator, thing, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of an object, and the direction away from it there."""
    if isinstance(thing, Polynomial):
        return _rim(rng, round_of(thing), count)
    if isinstance(thing, Sphere):
        n = unit(rng.normal(size=(count, 3)))
        return (real(thing.center) + thing.radius * n).astype(float), n.astype(float)
    if isinstance(thing, Triangle):
        corners = np.array([thing.a, thing.b, thing.c])
        i, w = rng.integers(3, size=count), rng.uniform(size=(count, 1))
        a, b = corners[i], corners[(i + 1) % 3]
        n = np.cross(b - a, np.cross(corners[1] - corners[0], corners[2] - corners[0]))
        return a + w * (b - a), n / np.linalg.norm(n, axis=1, keepdims=True)
    axis = unit(thing.axis).astype(float)
    e = np.cross(axis, rng.normal(size=(count, 3)))
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    h = rng.uniform(size=(count, 1))
    if isinstance(thing, Cylinder):
        return np.array(thing.center) + thing.radius * e + (h - 0.5) * thing.height * axis, e
    # The cone: a third of the rays at the apex, the others at the wall.
    h[: count // 3] = 1
    n = e * thing.height + axis * thing.radius
    return np.array(thing.base) + (1 - h) * thing.radius * e + h * thing.height * axis, n / np.linalg.norm(
        n, axis=1, keepdims=True
    )


@pytest.mark.parametrize("aim", [aimed, touching])
@pytest.mark.parametrize("name", ["Sphere", "Cylinder", "Cone", "Triangle", "Polynomial"])
def test_kernel_agrees_with_exact_arithmetic(name: str, aim) -> None:
    """1 600 rays a kind, half of them off an edge by 1e-16 to 0.1 of the size: every decision that rounding leaves open
    belongs to a ray that is aimed within the bound of the edge."""
    r = Run(name, False, seed=11, count=40, per=20, rays=aim)
    unsure = 0
    for i, thing in enumerate(r.things):
        far = norm(r.o[i] - SAMPLES[name].hull(thing)[0])
        bound = 2 * rounding(thing, real(r.o[i]), real(r.d[i]), far).astype(float)
        for o, d, t, g in zip(r.o[i], r.d[i], r.t[i], bound):
            what, _ = exact_first(thing, o, d, 0)
            grown, shrunk = (exact_first(thing, o, d, s * g) for s in (1.0, -1.0))
            if not what == grown[0] == shrunk[0]:
                unsure += 1
                continue
            assert np.isfinite(t) == (what > 0)
            if what:
                low, high = sorted([grown[1], shrunk[1]])
                assert low * (1 - gamma(2)) <= t <= high * (1 + gamma(2))
    # Of the 15 decades of distances from the edge, at most those below 1e-12 are open: far / size is at most 1e3, the
    # bound 26 u times that; and triangles are crossed at an angle.
    assert unsure <= (0.4 * r.count * r.per if aim is touching else 0)


@pytest.mark.parametrize("aim", [aimed, touching])
@pytest.mark.parametrize("name", ["Sphere", "Cylinder", "Cone", "Triangle", "Polynomial"])
def test_error_bound_holds_where_rays_graze(name: str, aim) -> None:
    """The distance of p from the surface, in 80 bits; for the sphere exactly, from p's own digits."""
    r = Run(name, False, seed=12, count=100, per=100, rays=aim)
    for i, thing in enumerate(r.things):
        hit = r.hit[i]
        assert (np.abs(gap(thing, r.p[i][hit])[0]) <= r.error[i][hit]).all()
    if name == "Sphere":
        for thing, p, e, hit in zip(r.things, r.p[:, 0], r.error[:, 0], r.hit[:, 0]):
            if hit:
                w = add(arbs(p), arbs(thing.center), -1)
                assert abs(inner(w, w).sqrt() - thing.radius) <= float(e)


# Coordinates on the surface


@MOVED_IS_SLOW
@EACH
def test_uv_is_right_handed_and_in_range(name: str, moved: bool) -> None:
    """(dp/du, dp/dv, outward n) by differences on the tangent plane: unmirrored on every kind, from outside."""
    r = run(name, moved)
    sizes = np.array([SAMPLES[name].hull(x)[1] * np.linalg.svd(outer(x)[0], compute_uv=False)[-1] for x in r.things])
    s = np.cross(r.n, np.roll(r.n, 1, axis=2) * [1, -1, 1])
    s /= np.linalg.norm(s, axis=2, keepdims=True)
    step = 1e-5 * sizes[:, None, None]
    slopes = [(uv_at(r, r.p + step * w) - uv_at(r, r.p - step * w)) for w in (s, np.cross(r.n, s))]
    (us, vs), (ut, vt) = ((d + 0.5) % 1 - 0.5 if name != "Plane" else d for d in slopes)
    determinant = us * vt - ut * vs
    away = r.hit & np.stack([clear_of_creases(x, p, 3e-5) for x, p in zip(r.things, r.p)])
    assert away.sum() > 0.95 * r.hit.sum()
    assert (determinant[away] > 0).all()
    if name != "Plane":
        # Where the local point is off by a rounding bound, so are its coordinates, in sizes of the object.
        for i, thing in enumerate(r.things):
            hit = r.hit[i]
            slack = local_rounding(thing, r.o[i][hit], r.d[i][hit], r.t[i][hit]) / _least(thing)
            for w in (r.u[i][hit], r.v[i][hit]):
                assert (w >= -slack).all() and (w <= 1 + slack).all()


@pytest.mark.parametrize("name", [n for n in NAMES if hasattr(SAMPLES[n].twin, "uv")])
def test_uv_is_that_of_the_twin(name: str) -> None:
    r = run(name, False)
    for i, thing in enumerate(r.things):
        hit, p = r.hit[i], real(r.p[i][r.hit[i]])
        bound = local_rounding(thing, r.o[i][hit], r.d[i][hit], r.t[i][hit]) / _least(thing)
        if name in ("Sphere", "Polynomial", "Ellipsoid"):
            # Longitude turns faster near the poles, latitude by a root there.
            ball = round_of(thing) if name == "Polynomial" else thing
            size = real(thing.radii) if name == "Ellipsoid" else ball.radius
            level = np.hypot(*((p - real(ball.center)) / size)[:, [0, 2]].T)
            bound = bound / level + gamma(8)
        u, v = SAMPLES[name].twin.uv(thing, p)
        across = np.abs(r.u[i][hit] - u)
        assert (np.minimum(across, 1 - across) <= bound).all()
        assert (np.abs(r.v[i][hit] - v) <= bound).all()


def _least(thing) -> float:
    """The least width of an object."""
    if isinstance(thing, Polynomial):
        return round_of(thing).radius
    if isinstance(thing, Box):
        return min(h - l for l, h in zip(thing.min, thing.max))
    thing = triangle_of(thing) if isinstance(thing, Mesh) else ball_of(thing) if isinstance(thing, Csg) else thing
    if isinstance(thing, Triangle):
        corners = real([thing.a, thing.b, thing.c])
        sides = norm(np.roll(corners, -1, 0) - corners)
        return float(norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) / sides.max())
    if isinstance(thing, Ellipsoid):
        return min(thing.radii)
    if isinstance(thing, Torus):
        return thing.minor
    if isinstance(thing, Rectangle):
        w, h = real(thing.width), real(thing.height)
        return float(norm(np.cross(w, h)) / max(norm(w), norm(h)))
    return min(thing.radius, getattr(thing, "height", np.inf))


def uv_at(r: Run, p: np.ndarray) -> np.ndarray:
    uv = r.line.kind.uv(r.line.placed(), r.line.a.put(r.line.a.W, p.reshape(-1, 3).T))
    return np.stack([np.array(x).reshape(r.count, r.per) for x in uv])


def clear_of_creases(thing, p: np.ndarray, part: float) -> np.ndarray:
    """Points farther than that part of the size from the next face, and from the poles, where u turns at once."""
    _, _, bend, crease = gap(thing, p)
    reach = SAMPLES[type(thing).__name__].hull(thing)[1]
    clear = (crease > part * reach) & (bend > 10 * part * reach)
    if isinstance(thing, Sphere | Polynomial | Ellipsoid | Capsule):
        m, offset = outer(thing)
        local = (real(p) - real(offset)) @ inverse(m).T - real(SAMPLES[type(thing).__name__].hull(thing)[0])
        clear &= np.hypot(local[:, 0], local[:, 2]) > 10 * part * reach
    return clear


@EACH
def test_uv_by_hand(name: str) -> None:
    assert SAMPLES[name].uv
    for thing, p, uv in SAMPLES[name].uv:
        assert_uv(thing, p, uv)


def assert_uv(thing, p: tuple, uv: tuple) -> None:
    line = Lineup([thing], 1)
    found = line.kind.uv(line.placed(), line.a.W(*map(float, p)))
    # Frame, local point and angle: 20 roundings of numbers of order one.
    assert np.allclose([x[0] for x in found], uv, rtol=0, atol=4 * gamma(20))


# Degenerate rays

LATTICE = np.array([-2, -1, -0.5, -0.25, -0.0, 0.0, 0.25, 0.5, 1, 2])
STEPS = np.array([-1, -0.0, 0.0, 1, 2.0**-40])
PLAIN_EACH = pytest.mark.parametrize(("name", "i"), [(n, i) for n in NAMES for i in range(len(SAMPLES[n].plain))])


@cache
def lattice_rays() -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions full of zeros of both signs: along edges and axes, in planes, through corners."""
    o = np.stack(np.meshgrid(LATTICE, LATTICE, LATTICE, indexing="ij"), -1).reshape(-1, 3)
    d = np.stack(np.meshgrid(STEPS, STEPS, STEPS, indexing="ij"), -1).reshape(-1, 3)
    d = d[np.abs(d).sum(1) > 0]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return np.repeat(o, len(d), 0), np.tile(d, (len(o), 1))


@cache
def lattice_truth(name: str, i: int):
    return truth(SAMPLES[name].plain[i], *lattice_rays())


@PLAIN_EACH
def test_degenerate_rays_give_no_nan_and_agree_where_the_answer_is_sure(name: str, i: int) -> None:
    """124 000 rays. In the plane of a flat shape, on a face, along an edge or the axis the answer may be either, but it
    is an answer: t > 0 or inf, a point on the surface, a finite normal."""
    thing, (o, d), exact = SAMPLES[name].plain[i], lattice_rays(), lattice_truth(name, i)
    line = Lineup([thing], len(o))
    ray = line.ray(o, d)
    t = line.first(ray)
    assert not np.isnan(np.array(t)).any() and (np.array(t) > 0).all()
    s, u, v = line.surface(ray, t)
    hit = np.isfinite(np.array(t))
    for x in (s.p.x, s.p.y, s.p.z, s.n.x, s.n.y, s.n.z, s.error, u, v):
        assert np.isfinite(np.broadcast_to(np.array(x), hit.shape)[hit]).all()
    assert (np.abs(gap(thing, array(s.p)[hit])[0]) <= np.array(s.error)[hit]).all()
    assert np.array_equal(hit[exact.sure], exact.what[exact.sure] > 0)
    met = exact.sure & hit
    assert met.sum() > len(o) / 200
    slack = gamma(2) * np.array(t)[met]
    assert (np.array(t)[met] >= exact.low[met] - slack).all() and (np.array(t)[met] <= exact.high[met] + slack).all()


@PLAIN_EACH
def test_degenerate_shadow_rays_have_an_answer_that_agrees(name: str, i: int) -> None:
    """`occludes` from lattice points over a length of 1: blocked exactly where the twin crosses before 1."""
    thing, (o, d), exact = SAMPLES[name].plain[i], lattice_rays(), lattice_truth(name, i)
    line, n = Lineup([thing], len(o)), len(o)
    found = np.array(line.occludes(line.ray(o, d), dr.full(line.a.D, 1, n), end_error=line.a.D(U)))
    far = np.abs(exact.t - 1) > 4 * gamma(ROUNDINGS)
    # Of a solid that is not convex rounding may leave open which of its crossings is the first one.
    sure = exact.sure & ((far & ((exact.low < 1) == (exact.high < 1))) | (exact.what == 0))
    # Leaving a solid counts as blocked as well: the light is inside.
    assert np.array_equal(found[sure], ((exact.what > 0) & (exact.t < 1))[sure])


@pytest.mark.parametrize("name", FLATS)
def test_flat_shape_never_meets_the_ray_that_leaves_it(name: str) -> None:
    r = run(name, False)
    n = r.count * r.per
    ray = r.line.ray(r.o, r.d)
    t = r.line.first(Ray(ray.o, ray.d), dr.full(r.line.a.B, True, n))
    assert np.isinf(np.array(t)).all()


# Watertight


def sphere_of_triangles(levels: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners and faces of an icosahedron whose faces are cut in four, `levels` times. Shapes: (P, 3), (T, 3)."""
    g = (1 + 5**0.5) / 2
    corners = [np.roll((0.0, a, b * g), i) for i in range(3) for a in (1, -1) for b in (1, -1)]
    corners = [c / np.linalg.norm(c) for c in corners]
    apart = np.linalg.norm(np.array(corners)[:, None] - np.array(corners)[None], axis=2)
    near = (apart > 0) & (apart < 1.1)
    triples = [(i, j, k) for i in range(12) for j in range(i) for k in range(j)]
    faces = [(i, j, k) for i, j, k in triples if near[i, j] and near[j, k] and near[i, k]]
    assert len(faces) == 20
    for _ in range(levels):
        middles: dict[tuple, int] = {}

        def middle(i: int, j: int, middles: dict = middles) -> int:
            key = (min(i, j), max(i, j))
            if key not in middles:
                m = corners[i] + corners[j]
                corners.append(m / np.linalg.norm(m))
                middles[key] = len(corners) - 1
            return middles[key]

        cut = []
        for i, j, k in faces:
            x, y, z = middle(i, j), middle(j, k), middle(k, i)
            cut += [(i, x, z), (x, j, y), (z, y, k), (x, y, z)]
        faces = cut
    return np.array(corners), np.array(faces)


def mesh(corners: np.ndarray, faces: np.ndarray) -> Scene:
    points = [tuple(c.tolist()) for c in corners]
    return Scene(
        objects={f"t{n}": Triangle(a=points[i], b=points[j], c=points[k]) for n, (i, j, k) in enumerate(faces)},
        camera=Camera(),
        lights={},
    )


def missed(scene: Scene, o: np.ndarray, d: np.ndarray, brute_force: bool = False) -> int:
    """How many rays hit nothing. o: one origin, or one a ray."""
    geometry = geometry_of(scene)
    a = geometry.a
    o, d = (a.put(a.W, np.atleast_2d(v).T) for v in (o, d))
    return int((~np.isfinite(np.array(closest(RayOrigin(geometry, o), Ray(o, d), brute_force).t))).sum())


def inside_ball(rng: np.random.Generator, n: int, radius: float) -> np.ndarray:
    p = rng.normal(size=(n, 3))
    return p * radius * rng.uniform(size=(n, 1)) ** (1 / 3) / np.linalg.norm(p, axis=1, keepdims=True)


def targets(rng: np.random.Generator, corners: np.ndarray, faces: np.ndarray, what: str, n: int) -> np.ndarray:
    """Points of a mesh: its corners, points on its edges, or anywhere around it."""
    if what == "anywhere":
        return rng.normal(size=(n, 3)) * np.ptp(corners) + corners.mean(0)
    if what == "corners":
        return corners[rng.integers(len(corners), size=n)]
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    e, w = edges[rng.integers(len(edges), size=n)], rng.uniform(size=(n, 1))
    return corners[e[:, 0]] * (1 - w) + corners[e[:, 1]] * w


@pytest.mark.parametrize("what", ["anywhere", "edges", "corners"])
@pytest.mark.parametrize(("centre", "size", "levels"), [((0, 0, 0), 1.0, 2), ((148376.0, 1234.0, -223423.0), 2.0, 1)])
def test_no_ray_gets_out_of_a_closed_mesh(what: str, centre: tuple, size: float, levels: int) -> None:
    """A million rays from inside, each from its own origin and all from one, at corners and edges too: all hit.

    The second mesh is the one of Embree's own test, 3e5 of its radii away from the origin of the world.
    """
    rng, n = np.random.default_rng(3), 1_000_000
    corners, faces = sphere_of_triangles(levels)
    corners = centre + size * corners
    goal = targets(rng, corners, faces, what, n)
    for o in (centre + size * inside_ball(rng, n, 0.7), centre + size * np.array([0.1, 0.2, -0.15])):
        d = goal - o
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        assert missed(mesh(corners, faces), o, d) == 0


def test_no_ray_passes_between_two_triangles() -> None:
    """A fold of two triangles over 12 decades of shape and place, 10^6 rays exactly at points of the shared edge."""
    rng = np.random.default_rng(4)
    for _ in range(50):
        size, place = 10 ** rng.uniform(-4, 4), 10 ** rng.uniform(-4, 8)
        a, b, c, e = place * rng.normal(size=3) + size * rng.normal(size=(4, 3))
        scene = mesh(np.array([a, b, c, e]), np.array([[0, 1, 2], [1, 0, 3]]))
        w = rng.uniform(0.01, 0.99, size=(20_000, 1))
        o = (a + b) / 2 + max(size, place * 1e-6) * 10 ** rng.uniform(-1, 4) * rng.normal(size=(20_000, 3))
        d = a * (1 - w) + b * w - o
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        # Seen as one sheet: the triangles on different sides of the edge. A fold seen from its side may be passed.
        n = np.cross(d, b - a)
        sheet = np.sign((n * (c - a)).sum(1)) != np.sign((n * (e - a)).sum(1))
        assert sheet.sum() > 100
        assert missed(scene, o[sheet], d[sheet]) == 0


def test_rays_through_the_corners_of_a_grid_hit_it() -> None:
    """Where every product is exact, so that edge functions are exactly zero: zero counts as inside on both sides."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij")
    corners = np.stack([x.ravel(), y.ravel(), np.zeros(25)], 1)
    cells = [(5 * i + j, 5 * i + j + 5, 5 * i + j + 6, 5 * i + j + 1) for i in range(4) for j in range(4)]
    faces = np.array([f for p, q, r, s in cells for f in ((p, q, r), (p, r, s))])
    half = np.stack(np.meshgrid(np.arange(0, 4.5, 0.5), np.arange(0, 4.5, 0.5), indexing="ij"), -1).reshape(-1, 2)
    goal = np.c_[half, np.zeros(len(half))]
    for slant in ((0, 0, 1), (1, 0, 1), (3, -2, 4), (0, 5, 1)):
        o = goal + 2.0 * np.array(slant)
        d = (goal - o) / np.linalg.norm(goal - o, axis=1, keepdims=True)
        assert missed(mesh(corners, faces), o, d) == 0


def test_small_triangle_seen_from_far_keeps_its_shape() -> None:
    """A triangle of size 1 seen from 1e6 away is hit and missed as by exact arithmetic, but for rays within 1e6 u."""
    rng = np.random.default_rng(6)
    thing = Triangle(a=(0, 0, 0), b=(1, 0.1, 0.2), c=(0.3, 0.9, -0.1))
    o = 1e6 * unit(np.array(direction(rng))).astype(float)
    d = inside_ball(rng, 20_000, 1.5) + 0.4 - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    o = np.broadcast_to(o, d.shape).copy()
    line = Lineup([thing], len(o))
    hit = np.isfinite(np.array(line.first(line.ray(o, d))))
    exact = truth(thing, o, d)
    assert np.array_equal(hit[exact.sure], exact.what[exact.sure] > 0)
    # The bound is 26 * 2 * 1e6 u = 6e-9 of the size, over a perimeter of 3 and an area of 7 where rays are aimed.
    assert (~exact.sure).sum() <= 1 and hit.sum() > 500


def test_a_mirrored_solid_has_its_normal_outside() -> None:
    """A negative scale turns the coordinates over, but the outward normal stays outward."""
    for name in [n for n in NAMES if SAMPLES[n].posed.closed]:
        thing = replace(SAMPLES[name].plain[0], transform=(Scale(scale=(-2, 1, 3)),))
        rng = np.random.default_rng(8)
        o, d = aimed(rng, thing, 500)
        line = Lineup([thing], len(o))
        ray = line.ray(o, d)
        t = line.first(ray)
        p, n = array(line.surface(ray, t)[0].p), array(line.surface(ray, t)[0].n)
        hit = np.isfinite(np.array(t))
        _, outward, _, crease = gap(thing, p[hit])
        sure = crease > 1e-9
        assert hit.sum() > 50 and (np.sum(outward * n[hit], 1)[sure] > 0).all()
