"""Polynomial surfaces: the kernels against closed forms, exact arithmetic and what must not change an answer."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import flint
import numpy as np
import pytest
from polynomial_rays import (
    Rig,
    U,
    alike,
    along,
    assert_spheres,
    departures,
    gradient,
    rational,
    rays_at,
    real_roots,
    shifted_by_noise,
    surface,
    unit,
    unsettled,
    valued,
    within,
)
from samples import Lineup, array, polynomial_sphere
from test_render import compiled

import visray as vr
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.pack import pack
from visray.polynomials.catalogue import SURFACES
from visray.primitives.clips import Ball, Block
from visray.primitives.polynomial import Polynomial
from visray.primitives.primitive import bounding_box
from visray.quantities import Arrays
from visray.ray import NO_ROW
from visray.scene.scene import Scene, Settings

# Where both of two searches miss, distances are inf - inf.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
HYPERBOLOID = "x^2 + y^2 - z^2 - 1"
TORUS = "(x^2 + y^2 + z^2 + 21/25)^2 - 4*(x^2 + y^2)"
HEART = SURFACES["heart"].expression
BARTH = SURFACES["barth-sextic"].expression


# Degrees 1 and 2


def test_an_ellipsoid_is_the_scaled_sphere() -> None:
    """200 of each, sizes over 6 decades, from 0.1 to 100 sizes away; what only one sees is within rounding of the
    edge."""
    rng, things, twins, per = np.random.default_rng(1), [], [], 50
    for _ in range(200):
        size = 10 ** rng.uniform(-3, 3)
        axes = size * 2 ** rng.uniform(-1, 1, 3)
        clip = Ball(radius=float(1.5 * axes.max()))
        names = dict(zip("abc", axes.tolist()))
        things.append(Polynomial(expression="x^2*b^2*c^2 + y^2*a^2*c^2 + z^2*a^2*b^2 - a^2*b^2*c^2", parameters=names,
                                 clip=clip, ends="capped"))  # fmt: skip
        twins.append(vr.Sphere(transform=(vr.Scale(scale=tuple(axes.tolist())),)))
    rays = [rays_at(rng, per, x.clip.radius, 100) for x in things]
    o, d = (np.stack([r[i] for r in rays]) for i in (0, 1))
    found = []
    for line in (Lineup(things, per), Lineup(twins, per)):
        ray = line.ray(o, d)
        t = line.first(ray)
        found.append((np.array(t), array(line.surface(ray, t)[0].n)))
    (t, n), (other, m) = found
    slope = (m * d.reshape(-1, 3)).sum(1)
    size = np.linalg.norm(o, axis=2).ravel() + np.repeat([x.clip.radius for x in things], per)
    assert (np.isfinite(t) == np.isfinite(other)).all()
    assert np.isfinite(t).sum() > 1000
    hit = np.isfinite(t)
    assert alike(t, other, slope, size)[hit].all()
    sure = hit & (np.abs(slope) > 1e-3)
    assert np.abs(n - m)[sure].max() < 1e-12


def test_a_plane_is_the_plane() -> None:
    rng, per, things, twins = np.random.default_rng(2), 50, [], []
    for _ in range(200):
        size, normal = 10 ** rng.uniform(-3, 3), unit(rng.normal(size=3))
        away = size * rng.uniform(-0.5, 0.5)
        names = dict(zip("abck", [*normal.tolist(), away]))
        clip = Ball(radius=size)
        things.append(Polynomial(expression="a*x + b*y + c*z - k", parameters=names, clip=clip))
        twins.append(vr.Plane(point=tuple((away * normal).tolist()), normal=tuple(normal.tolist())))
    rays = [rays_at(rng, per, x.clip.radius, 100) for x in things]
    o, d = (np.stack([r[i] for r in rays]) for i in (0, 1))
    one, two = Lineup(things, per), Lineup(twins, per)
    t, other = np.array(one.first(one.ray(o, d))), np.array(two.first(two.ray(o, d)))
    radius = np.repeat([x.clip.radius for x in things], per)
    p = o.reshape(-1, 3) + np.where(np.isfinite(other), other, 0)[:, None] * d.reshape(-1, 3)
    inside = np.isfinite(other) & (np.linalg.norm(p, axis=1) < radius * (1 - 1e-9))
    assert np.array_equal(np.isfinite(t), inside)
    slope = (np.repeat([x.normal for x in twins], per, 0) * d.reshape(-1, 3)).sum(1)
    assert alike(t, other, slope, np.linalg.norm(o, axis=2).ravel() + radius)[inside].all()
    assert inside.sum() > 1000


# Exact roots


@pytest.mark.parametrize(
    ("expression", "radius"),
    [(TORUS, 1.5), (HEART, SURFACES["heart"].radius), (BARTH, SURFACES["barth-sextic"].radius), (HYPERBOLOID, 3.0)],
    ids=["torus", "heart", "barth-sextic", "hyperboloid"],
)
@pytest.mark.slow
def test_all_crossings_are_the_exact_roots_there_and_back(expression: str, radius: float) -> None:
    """800 rays: each crossing from the one before, and the same from the far end."""
    rng, rig = np.random.default_rng(3), Rig(surface(expression, radius))
    o, d = rays_at(rng, 800, radius)
    degree, seen = 6, 0
    times = rig.walked(o, d, degree + 2)[0]
    assert np.isinf(times[-1]).all()
    # From as far beyond the clip, back to where the rays began.
    beyond = 2 * radius + np.linalg.norm(o, axis=1)
    back = beyond - rig.walked(o + beyond[:, None] * d, -d, degree + 2)[0]
    for i in range(len(d)):
        exact = np.array(within(radius, real_roots(along(expression, o[i], d[i])), o[i], d[i]))
        if np.abs(np.diff(exact, prepend=0.0)).min(initial=1.0) < 1e-6 * radius:
            continue  # two roots that rounding may join
        size = radius + np.linalg.norm(o[i])
        found, again = (np.sort(v[np.isfinite(v) & (v > 0)]) for v in (times[:, i], back[:, i]))
        assert len(found) == len(exact) == len(again)
        slopes = np.abs([float((along(expression, o[i] + t * d[i], d[i]))[1]) for t in exact])
        loose = 1e-12 * size * np.maximum(1, 1 / np.maximum(slopes, 1e-6))
        assert (np.abs(found - exact) <= loose).all() and (np.abs(again - exact) <= loose).all()
        seen += len(exact)
    assert seen > 500


def test_the_heart_is_met_on_its_equator() -> None:
    """Where every ray has a triple root: from outside, within 45 degrees of the normal, and from within."""
    rng, n = np.random.default_rng(4), 5000
    angle = rng.uniform(0, 2 * np.pi, n)
    p = np.stack([np.cos(angle), 2 / 3 * np.sin(angle), 0 * angle], 1)
    outwards = unit(np.stack([np.cos(angle), 1.5 * np.sin(angle), 0 * angle], 1))
    o = p + 10 ** rng.uniform(-0.5, 1, (n, 1)) * unit(outwards + 0.7 * unit(rng.normal(size=(n, 3))))
    length = np.linalg.norm(p - o, axis=1)
    rig = Rig(Polynomial(surface="heart"))
    t, _, normal, _, _ = rig.surfaces(o, unit(p - o))
    assert (np.abs(t - length) <= 1e-12 * length).all()
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-6
    o = 0.3 * rng.uniform(-1, 1, (n, 3))
    length = np.linalg.norm(p - o, axis=1)
    assert (np.abs(rig.first(o, unit(p - o))[0] - length) <= 1e-12 * length).all()


@pytest.mark.parametrize("thick", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("written", ["(x^2 + y^2 + z^2 - 1)^2 - e^2", "(x^2 + y^2 + z^2 - 1)^2 - e^2 + k*x^8"])
def test_a_thin_shell_is_met_on_both_sides(written: str, thick: float) -> None:
    """Against the two spheres that it is: from outside, from the middle, and from in between. With a term of eighth
    order that is zero, it cannot be taken apart."""
    rng, n = np.random.default_rng(5), 4000
    names = {"e": thick} | ({"k": 0.0} if "k" in written else {})
    rig = Rig(surface(written, parameters=names))
    o, d = rays_at(rng, n, 1.0)
    radii = tuple(np.sqrt([1 - thick, 1 + thick]))
    on = unit(o)
    for start in (o[np.abs(np.linalg.norm(o, axis=1) - 1) > 1e-3], 0.5 * on, on):
        assert_spheres(rig, start, d[: len(start)], radii)


def test_a_ray_that_leaves_the_heart_meets_its_equator_where_it_is() -> None:
    """What is noise near the ray's start is none far away from it: there f is small, but its sign is certain."""
    rng, n = np.random.default_rng(6), 5000
    rig = Rig(Polynomial(surface="heart"))
    o = 0.3 * rng.uniform(-1, 1, (n, 3))
    d = unit(rng.normal(size=(n, 3)))
    _, start, _, _, _ = rig.surfaces(o, d)
    angle = rng.uniform(0, 2 * np.pi, n)
    p = np.stack([np.cos(angle), 2 / 3 * np.sin(angle), 0 * angle], 1)
    length = np.linalg.norm(p - start, axis=1)
    exact = rig.first(o, unit(p - o))[0]
    assert np.abs(exact / np.linalg.norm(p - o, axis=1) - 1).max() < 1e-12
    # From points of the lower half, whence all of the equator is in sight.
    below = (start[:, 2] < -0.3) & (length > 0.5)
    t = rig.first(start, unit(p - start), 0, True)[0]
    assert below.sum() > 500
    assert (np.abs(t - length)[below] <= 1e-12 * length[below]).all()


@pytest.mark.parametrize("power", [2, 3])
@pytest.mark.parametrize("ends", ["open", "capped"])
def test_a_power_of_a_sphere_is_the_sphere(power: int, ends: str) -> None:
    rng = np.random.default_rng(7)
    rig = Rig(surface(f"(x^2 + y^2 + z^2 - 1)^{power}", ends=ends))
    assert_spheres(rig, *rays_at(rng, 5000, 1.2), (1.0,))


def test_a_product_is_the_union_of_its_factors() -> None:
    """Five nested spheres: from outside the outermost is met, from between two of them the next one; all ten crossings
    of a ray through all of them."""
    rng, radii = np.random.default_rng(8), (0.2, 0.5, 0.55, 0.9, 1.0)
    text = "*".join(f"(x^2 + y^2 + z^2 - {r}^2)" for r in radii)
    rig = Rig(surface(text))
    assert_spheres(rig, *rays_at(rng, 10_000, 1.2), radii)
    o, d = rays_at(rng, 2000, 0.19)
    o = o + 3 * unit(o)
    times, normals = rig.walked(o, d, 11)
    deep = np.linalg.norm(np.cross(o, d), axis=1) < 0.19
    assert np.isfinite(times[:10, deep]).all() and np.isinf(times[10]).all()
    b, nearest = (o * d).sum(1), (np.cross(o, d) ** 2).sum(1)
    exact = np.sort(np.concatenate([[-b - np.sqrt(r**2 - nearest), -b + np.sqrt(r**2 - nearest)] for r in radii]), 0)
    assert np.abs(times[:10] - exact)[:, deep].max() < 1e-12
    sides = np.sign((normals[:10] * d).sum(2))[:, deep]
    assert (sides[1:] == -sides[:-1]).all() and (sides[0] == -1).all()


@pytest.mark.parametrize(
    ("expression", "points", "ways"),
    [
        # Of the hyperboloid: both rulings through (cos a, sin a, 0). Of the cone: the generators.
        (HYPERBOLOID, lambda c, s: (c, s, 0 * c), lambda c, s: (-s, c, 1 + 0 * c)),
        (HYPERBOLOID, lambda c, s: (c, s, 0 * c), lambda c, s: (s, -c, 1 + 0 * c)),
        ("x^2 + y^2 - z^2", lambda c, s: (c, s, 1 + 0 * c), lambda c, s: (c, s, 1 + 0 * c)),
        ("x*y*z", lambda c, s: (c, s, 0 * c), lambda c, s: (s, c, 0 * c)),
        ("x*y", lambda c, s: (0 * c, s, c), lambda c, s: (0 * c, s, c)),
        (HEART, lambda c, s: (0 * c, 0 * s, 1 + 0 * c), lambda c, s: (c, s, 0 * c)),
        # Whitney's umbrella: the lines at each height. A flat bottom far below the noise of the rest.
        ("x^2 - y^2*z", lambda c, s: (0 * c, 0 * s, c * c), lambda c, s: (c, 1 + 0 * c, 0 * c)),
        ("x^12 + y^12 + z^12 - 1/10000000000000", lambda c, s: (c / 9, s / 9, 0 * c), lambda c, s: (s, c, 0 * c)),
    ],
    ids=["one ruling", "the other", "cone", "planes", "axis", "a singular point", "umbrella", "flat"],
)
def test_rays_in_the_surface_have_an_answer(expression: str, points: Callable, ways: Callable) -> None:
    """Hit or miss is a matter of taste, but no answer is NaN or lies elsewhere."""
    angle = np.concatenate([np.arange(8) * np.pi / 4, np.random.default_rng(9).uniform(0, 7, 2000)])
    c, s = np.cos(angle), np.sin(angle)
    p, d = np.stack(points(c, s), 1), unit(np.stack(ways(c, s), 1))
    rig = Rig(surface(expression, 3.0), surface(expression, 3.0, ends="capped", centre=(0.5, 0.0, 0.0)))
    for o, leaves in ((p, (None, None)), (p - 5 * d, (None, None)), (p, (0, True)), (p, (0, False)), (p, (1, True))):
        t, q, n, _, _ = rig.surfaces(o, d, *leaves)
        assert not np.isnan(t).any() and (t > 0).all()
        met = np.isfinite(t)
        assert np.isfinite(np.concatenate([q[met], n[met]])).all()
        assert (np.abs(np.linalg.norm(n[met], axis=1) - 1) < 1e-6).all()
        assert (np.linalg.norm(q[met] - (0.25, 0, 0), axis=1) < 3.3).all()
        assert np.isin(rig.occluded(o, d, np.full(len(d), 2.0)), [True, False]).all()


# What must not change an answer


def test_units_do_not_matter() -> None:
    """Powers of two: the same answer in other units, to the last digits, and for directions that are not unit."""
    rng, per = np.random.default_rng(10), 4000
    o, d = rays_at(rng, per, 1.5)
    one = surface(TORUS, 1.5)
    line = Lineup([one], per)
    t = np.array(line.first(line.ray(o, d)))
    assert np.isfinite(t).sum() > 500
    for power in (-60, -7, 40):
        assert np.array_equal(np.array(line.first(line.ray(o, d * 2.0**power))), t * 2.0**-power)
    for power in (-20, 25):
        s = 2.0**power
        names = {"s": s}
        text = "(x^2 + y^2 + z^2 + 21/25*s^2)^2 - 4*s^2*(x^2 + y^2)"
        written = Lineup([surface(text, 1.5 * s, parameters=names)], per)
        moved = Lineup([replace(one, transform=(vr.Scale(scale=s),))], per)
        for other in (written, moved):
            found = np.array(other.first(other.ray(o * s, d))) / s
            assert np.array_equal(np.isfinite(found), np.isfinite(t))
            hit = np.isfinite(t)
            assert (np.abs(found - t)[hit] <= 1e-11 * t[hit]).mean() > 0.999


@pytest.mark.parametrize("away", [1e3, 1e6])
def test_a_far_centre_costs_only_what_the_rays_lose(away: float) -> None:
    rng, n = np.random.default_rng(11), 3000
    centre = tuple(np.round(away * unit([1.0, -0.7, 0.4])).tolist())
    text = "((x - a)^2 + (y - b)^2 + (z - c)^2 + 21/25)^2 - 4*((x - a)^2 + (y - b)^2)"
    far = Rig(surface(text, 1.5, centre, parameters=dict(zip("abc", centre))))
    o, d = rays_at(rng, n, 1.5)
    # Rounded so that the far origin is exactly the near one, moved.
    o = np.round(o * 2.0**24) / 2.0**24
    (t, _, m, _, _), near = far.surfaces(o + centre, d), Rig(surface(TORUS, 1.5))
    s, _, k, _, _ = near.surfaces(o, d)
    assert np.array_equal(np.isfinite(s), np.isfinite(t))
    hit = np.isfinite(s)
    assert hit.sum() > 300
    assert (np.abs(t - s)[hit] * np.abs((k * d).sum(1))[hit] <= 16 * U * (away + np.linalg.norm(o, axis=1)[hit])).all()
    assert np.abs(m - k)[hit & (np.abs((k * d).sum(1)) > 0.1)].max() < 100 * U * away
    literal = text
    for name, value in zip("abc", centre):
        literal = literal.replace(f"- {name})", f"- ({value:.0f}))")
    other = Rig(surface(literal, 1.5, centre)).first(o + centre, d)[0]
    assert np.array_equal(np.isfinite(other), np.isfinite(t))
    assert (np.abs(other - t)[hit] * np.abs((k * d).sum(1))[hit] <= 4 * U * away).all()


def test_a_transform_is_the_substitution_by_hand() -> None:
    """Turned by 90 degrees about z, stretched by (2, 1/2, 3) and moved: f of (y', -x', z') over the stretch."""
    rng, n = np.random.default_rng(12), 5000
    away = (1.5, -2.0, 0.25)
    steps = (
        vr.Rotate(rotate=90.0, axis=(0.0, 0.0, 1.0)),
        vr.Scale(scale=(2.0, 0.5, 3.0)),
        vr.Translate(translate=away),
    )
    moved = surface(TORUS, 1.5, transform=steps)
    x, y, z = "((y + 2)/0.5)", "(-(x - 1.5)/2)", "((z - 0.25)/3)"
    text = f"({x}^2 + {y}^2 + {z}^2 + 21/25)^2 - 4*({x}^2 + {y}^2)"
    text = text.replace("/0.5)", "*2)")
    by_hand = surface(text, 5.0, away)
    o, d = rays_at(rng, n, 4.0)
    (t, _, m, _, _), (s, _, k, _, _) = (Rig(thing).surfaces(o + away, d) for thing in (moved, by_hand))
    assert np.array_equal(np.isfinite(s), np.isfinite(t))
    hit = np.isfinite(s)
    slope = np.abs((k * d).sum(1))
    assert hit.sum() > 500 and (np.abs(t - s)[hit] * slope[hit] <= 1e-13 * (1 + s[hit])).all()
    assert np.abs(m - k)[hit & (slope > 1e-2)].max() < 1e-11


def test_the_guarded_search_is_the_plain_one_bit_for_bit() -> None:
    rng, n = np.random.default_rng(13), 20_000
    spin = (vr.Rotate(rotate=33.0, axis=(1.0, 2.0, 3.0)), vr.Scale(scale=(1.0, 0.4, 2.0)))
    rig = Rig(
        Polynomial(surface="heart"),
        Polynomial(surface="heart", clip=Ball(center=(0.0, 0.1, 0.0), radius=1.2), transform=spin),
        replace(surface(HYPERBOLOID, 2.0, ends="capped"), transform=(vr.Translate(translate=(3.0, 0.0, 0.0)),)),
        surface(TORUS, 1.5),
        vr.Sphere(center=(0.0, 0.0, -2.0)),
    )
    o, d = rays_at(rng, n, 3.0)
    source = np.where(rng.random(n) < 0.5, NO_ROW, rng.integers(0, 5, n))
    inside = rng.random(n) < 0.5
    fast, slow = (rig.first(o, d, source, inside, plain) for plain in (False, True))
    assert fast[0].tobytes() == slow[0].tobytes() and np.array_equal(fast[1], slow[1])
    assert len(np.unique(fast[1])) == 6
    assert 0.1 < rig.occluded(o, d, rng.uniform(0, 5, n)).mean() < 0.9


# Clips

CLIPS = {"ball": Ball(center=(0.2, -0.1, 0.3), radius=2.0), "block": Block(min=(-1.5, -2.0, -1.2), max=(2.0, 1.7, 1.4))}


def in_clip(clip: Any, p: np.ndarray, slack: float) -> np.ndarray:
    """Whether points are in a clip, grown by `slack`."""
    if isinstance(clip, Ball):
        return np.linalg.norm(p - clip.center, axis=1) <= clip.radius + slack
    return ((p >= np.array(clip.min) - slack) & (p <= np.array(clip.max) + slack)).all(1)


@pytest.mark.parametrize("clip", CLIPS)
def test_an_open_surface_ends_at_its_clip(clip: str) -> None:
    """The hyperboloid: the first root in the clip, by the formula."""
    rng = np.random.default_rng(14)
    rig, (o, d) = Rig(Polynomial(expression=HYPERBOLOID, clip=CLIPS[clip])), rays_at(rng, 10_000, 2.5)
    t = rig.first(o, d)[0]
    met = np.isfinite(t)
    p = o + np.where(met, t, 0)[:, None] * d
    assert met.sum() > 2000 and in_clip(CLIPS[clip], p[met], 1e-12).all()
    metric = np.array([1.0, 1.0, -1.0])
    a, b, c = ((v * w * metric).sum(1) for v, w in ((d, d), (o, d), (o, o)))
    root = np.sqrt(np.where(b * b - a * (c - 1) > 0, b * b - a * (c - 1), np.nan))
    both = np.stack([(-b - root) / a, (-b + root) / a])
    there = np.stack([(q > 0) & in_clip(CLIPS[clip], o + q[:, None] * d, 0.0) for q in np.nan_to_num(both, nan=-1.0)])
    exact = np.where(there, both, np.inf).min(0)
    sure = np.all([np.isnan(q) | (in_clip(CLIPS[clip], o + q[:, None] * d, 1e-9)
                   == in_clip(CLIPS[clip], o + q[:, None] * d, -1e-9)) for q in both], axis=0)  # fmt: skip
    sure &= ~(np.abs(b * b - a * (c - 1)) < 1e-9)
    assert sure.mean() > 0.99 and np.array_equal(met[sure], np.isfinite(exact)[sure])
    hit = sure & met
    slope = np.abs((2 * p * metric * d).sum(1))
    assert (np.abs(t - exact)[hit] * np.minimum(slope, 1)[hit] <= 1e-11 * (1 + t[hit])).all()


@pytest.mark.parametrize("clip", CLIPS)
@pytest.mark.parametrize("expression", [HYPERBOLOID, f"-1*({HYPERBOLOID})", BARTH], ids=["solid", "around", "barth"])
def test_a_capped_surface_is_a_solid(clip: str, expression: str) -> None:
    """Rays enter and leave it in turn, an even number of times; caps have the clip's normal, and lie where f < 0."""
    rng, clip = np.random.default_rng(15), CLIPS[clip]
    rig = Rig(Polynomial(expression=expression, clip=clip, ends="capped"))
    o, d = rays_at(rng, 6000, 2.5)
    outside = ~in_clip(clip, o, 1e-6)
    o, d = o[outside], d[outside]
    times, normals = rig.walked(o, d, 15)
    met = np.isfinite(times)
    turns = (normals * d).sum(2)
    sides = np.where(met, np.sign(turns), 0)
    p = o + np.where(met, times, 0)[..., None] * d
    f = valued(expression, *np.moveaxis(p, -1, 0), float)
    size = np.abs(f[met]).max()
    # A root that is within rounding of a rim, or a double one, may be met or not.
    odd = (met.sum(0) % 2 == 1) | ((sides[1:] == sides[:-1]) & met[1:]).any(0) | (sides[0] > 0)
    assert odd.sum() == 0
    assert not met[-1].any() and met[0].sum() > 1500
    cap = met & (f < -1e-9 * size)
    assert cap.sum() > 500
    q, n = p[cap], normals[cap]
    if isinstance(clip, Ball):
        assert np.abs(n - (q - clip.center) / clip.radius).max() < 1e-12
    else:
        assert (np.sort(np.abs(n), 1) == [0, 0, 1]).all()
        face = np.where((n > 0).any(1), (q - clip.max)[np.arange(len(n)), np.abs(n).argmax(1)],
                        (q - clip.min)[np.arange(len(n)), np.abs(n).argmax(1)])  # fmt: skip
        assert np.abs(face).max() < 1e-12
    assert (f[met] < 1e-9 * size).all()


# Rays that leave the surface


@pytest.mark.parametrize(
    ("expression", "radius"),
    [(HEART, SURFACES["heart"].radius), (TORUS, 1.6), (BARTH, SURFACES["barth-sextic"].radius), (HYPERBOLOID, 3.0)],
    ids=["heart", "torus", "barth-sextic", "hyperboloid"],
)
@pytest.mark.slow
def test_rays_that_leave_the_surface_never_meet_their_own_point(expression: str, radius: float) -> None:
    """20 000 rays a surface. Truth: the exact roots on the surface through the point as it is, that of f = f(p), less
    the one at 0; where those of f = f(p) +- rounding say otherwise, the answer is open."""
    rng, rig = np.random.default_rng(16), Rig(surface(expression, radius))
    p, d, inside = departures(rig, rng, radius, 20_000)
    t = rig.first(p, d, 0, inside)[0]
    hidden = rig.occluded(p, d, np.full(len(d), 10 * radius), source=0, inside=inside)
    assert np.array_equal(hidden, np.isfinite(t))
    false, leaks, open_ = 0, 0, 0

    def right(i: int, exact: list[float]) -> bool:
        exact = within(radius, exact, p[i], d[i])[:1]
        return len(exact) == np.isfinite(t[i]) and (not exact or abs(exact[0] - t[i]) < 1e-3)

    for i in unsettled(expression, radius, p, d, t):
        line = along(expression, p[i], d[i])
        if right(i, real_roots((line - line[0]) // flint.fmpq_poly([0, 1]))):
            continue
        if any(right(i, [r for r in real_roots(level) if r > 1e-6]) for level in shifted_by_noise(line)):
            open_ += 1
        else:
            false, leaks = false + np.isfinite(t[i]), leaks + np.isinf(t[i])
    assert (false, leaks) == (0, 0)
    assert open_ < 20
    assert np.isfinite(t).sum() > 2000


@pytest.mark.parametrize("name", ["heart", "torus", "hyperboloid", "capped"])
def test_occluded_is_that_the_first_hit_is_nearer(name: str) -> None:
    """For ends anywhere; and for ends on the surface, which rays reach from either side: an end is hidden where what
    is met first is not the end itself."""
    rng, n = np.random.default_rng(17), 20_000
    thing = {
        "heart": Polynomial(surface="heart"),
        "torus": surface(TORUS, 1.6, transform=(vr.Scale(scale=(1.0, 2.0, 0.5)),)),
        "hyperboloid": surface(HYPERBOLOID, 2.5),
        "capped": surface(HYPERBOLOID, 2.5, ends="capped"),
    }[name]
    rig = Rig(thing)
    o, d = rays_at(rng, n, 1.5)
    t = rig.first(o, d)[0]
    length = np.where(np.isfinite(t), t, 2.0) * rng.uniform(0.5, 1.5, n)
    assert np.array_equal(rig.occluded(o, d, length), t < length)
    # Points of the surface, as other rays know them.
    t, p, m, _, _ = rig.surfaces(*rays_at(rng, n, 1.5))
    there = np.isfinite(t)
    o, p, m = o[there], p[there], m[there]
    length, d = np.linalg.norm(p - o, axis=1), unit(p - o)
    inward = (m * d).sum(1) > 0
    hidden = rig.occluded(o, d, length, 0, inward)
    times, _ = rig.walked(o, d, 10)
    before = (times < length * (1 - 1e-7)).sum(0)
    # Where the end is approached from its proper side, and nothing else is near it.
    clear = np.abs((m * d).sum(1)) > 1e-3
    assert clear.sum() > 1000
    assert np.array_equal(hidden[clear], before[clear] > 0)
    assert 0.1 < hidden[clear].mean() < 0.9


@pytest.mark.parametrize("thing", [polynomial_sphere((0.0, 0.0, 0.0), 1.0), surface(TORUS, 1.6)], ids=["ball", "torus"])
def test_a_point_without_a_slope_is_not_on_the_surface(thing: Polynomial) -> None:
    """The centre, where the gradient is zero and f is not: as an origin that all rays share it is no other than as one
    that each ray has, and an object around a light hides it."""
    rng, rig = np.random.default_rng(20), Rig(thing)
    line = Lineup([thing], 1)
    assert abs(line.kind.surface_at(line.placed(), line.a.W(0.0, 0.0, 0.0))[0][0]) > 0.1
    d = unit(rng.normal(size=(5000, 3)))
    ray = rig.ray(np.zeros((1, 3)), d)
    ray = replace(ray, o=rig.a.W(0.0, 0.0, 0.0))
    shared = closest(RayOrigin(rig.kernel.geometry, ray.o), ray)
    t = rig.first(np.zeros(3), d)[0]
    assert np.isfinite(t).mean() > 0.3 and np.array_equal(np.array(shared.t), t)


@pytest.mark.parametrize("expression", [TORUS, HYPERBOLOID, "(x^2 + y^2 + z^2 - 1)*(x^2 + y^2 + z^2 - 1/4)"])
def test_the_way_inside_a_solid_is_that_of_the_exact_roots(expression: str) -> None:
    """How long rays are where f < 0, up to an end anywhere; whether that is from an entry to an exit; and whether they
    meet the solid at all."""
    rng, radius, n = np.random.default_rng(21), 2.0, 1500
    line = Lineup([surface(expression, radius, ends="capped")], n)
    o, d = rays_at(rng, n, radius, 5.0)
    length = np.where(rng.random(n) < 0.5, 1e3, rng.uniform(0, 2 * radius, n))
    ray, far = line.ray(o, d), line.a.D(length)
    through, inside = (np.array(x) for x in line.length_inside(ray, far))
    occludes = np.array(line.occludes(ray, far))
    for i in range(n):
        b = o[i] @ d[i]
        half = np.sqrt(max(b * b - o[i] @ o[i] + radius**2, 0))
        begin, end = max(-b - half, 0), min(-b + half, length[i])
        if begin >= end:
            assert not occludes[i]
            continue
        f = along(expression, o[i], d[i])
        cuts = np.array([begin, *(t for t in real_roots(f) if begin < t < end), end])
        below = np.array([float(f(rational(m))) < 0 for m in (cuts[1:] + cuts[:-1]) / 2])
        assert abs((np.diff(cuts) * below).sum() - inside[i]) < 1e-9
        assert occludes[i] == (len(cuts) > 2 or (below[0] and begin > 0) or (below[-1] and end < length[i]))
        if occludes[i]:
            starts, ends = below[0] and begin == 0, below[-1] and end == length[i]
            assert through[i] == (not starts and not ends)


# What is compiled


def test_polynomials_of_one_form_share_their_code() -> None:
    mine = surface("x^2 + 2*y^2 - k*z^3 - 1", parameters={"k": 0.5}, centre=(1.0, 2.0, 3.0))
    same = {
        "a literal": replace(mine, expression="x^2 + 7*y^2 - k*z^3 - 3"),
        "a parameter": replace(mine, parameters={"k": -3.0}),
        "a radius": replace(mine, clip=Ball(center=(1.0, 2.0, 3.0), radius=0.5)),
        "a centre": replace(mine, clip=Ball(center=(-4.0, 5.0, 6.0), radius=2.0)),
    }
    others = {
        "another degree": replace(mine, expression="x^2 + 2*y^2 - k*z^4 - 1"),
        "capped": replace(mine, ends="capped"),
        "another clip": replace(mine, clip=Block(min=(0.5, 1.5, 2.5), max=(2.0, 3.0, 4.0))),
        "moved": replace(mine, transform=(vr.Scale(scale=2.0),)),
        "another factor": replace(mine, expression="(x^2 + 2*y^2 - k*z^3 - 1)*(x - 5)"),
    }

    def count(thing: Polynomial) -> int:
        return len(pack(Scene(objects={"a": mine, "b": thing}, camera=Camera(), lights={}), Arrays.of()).batches)

    assert {k: count(v) for k, v in same.items()} == dict.fromkeys(same, 1)
    assert {k: count(v) for k, v in others.items()} == dict.fromkeys(others, 2)
    assert mine.kind is not Polynomial and issubclass(mine.kind, Polynomial) and not mine.kind.never_rehit(True)


VIEW = Scene(
    camera=vr.Camera(origin=(0.5, 0.4, 4.0), target=(0.0, 0.0, 0.0), fov=40.0),
    film=vr.Film(width=48, height=32),
    materials={"m": vr.Material(kd=(0.5, 0.3, 0.2), ks=(0.3, 0.3, 0.3), shininess=9.0)},
    lights={"key": vr.PointLight(position=(3.0, 4.0, 5.0)), "side": vr.PointLight(position=(-4.0, 0.0, 2.0))},
    settings=Settings(spp=4, precision="double"),
)
TANGLE = "(x^4 + y^4 + z^4) - 5*(x^2 + y^2 + z^2)*mu + 11.8*mu"


def looked_at(thing: Any, **more: Any) -> Scene:
    return replace(VIEW, objects={"k": replace(thing, material="m")}, **more)


def picture(scene: Scene) -> np.ndarray:
    return vr.render(scene, progress=False, layers=("RGB",))["RGB"]


def test_numbers_of_a_polynomial_are_data_not_code() -> None:
    thing = surface("(x - a)^4 + y^4 + z^4 - 0.9*b", 1.4, (0.1, 0.2, 0.3), parameters={"a": 0.1, "b": 1.0})
    scene = looked_at(thing)
    before = picture(scene)
    changes = {
        "expression": "(x - a)^4 + y^4 + z^4 - 0.4*b",
        "parameters": {"a": 0.2, "b": 0.7},
        "clip": Ball(center=(0.1, 0.2, 0.3), radius=1.1),
        "moved": Ball(center=(-0.2, 0.1, 0.2), radius=1.5),
    }
    for key, value in changes.items():
        changed = looked_at(replace(thing, **{"clip" if key == "moved" else key: value}))
        assert compiled(lambda scene=changed: picture(scene)) == 0, key
        # All of the surface is in either clip.
        assert np.array_equal(picture(changed), before) == (key == "moved"), key
    assert compiled(lambda: picture(looked_at(replace(thing, expression="(x - a)^4 + y^4 + z^2 - 0.4*b")))) > 0


# How far off crossings may be

LOOSE = {
    "heart": Polynomial(surface="heart"),
    "barth-decic": Polynomial(surface="barth-decic"),
    "torus": surface(TORUS, 1.6, transform=(vr.Scale(scale=(1.0, 2.0, 0.5)), vr.Translate(translate=(3.0, 1.0, 2.0)))),
    "capped": surface("(x^2 + y^2 + z^2 - 1)*(x^4 + y^4 - z^4)", 1.4, (0.1, 0.2, 0.3), ends="capped"),
    "block": replace(surface(BARTH), clip=Block(min=(-1.0, -0.5, -1.0), max=(0.5, 1.0, 1.5))),
}


@pytest.mark.parametrize("name", LOOSE)
def test_crossings_are_no_farther_off_than_the_tolerance(name: str) -> None:
    """20 000 rays: those that hit are the same, and the distances within the tolerance times half the chord, which is
    at most that of the clip's sphere; the looser the farther off."""
    thing, rng = LOOSE[name], np.random.default_rng(32)
    low, high = bounding_box(thing)
    reach = 0.5 * float((high - low).max())
    o, d = rays_at(rng, 20_000, reach)
    o = o + 0.5 * (low + high)
    exact, index = Rig(thing).first(o, d)
    met = np.isfinite(exact)
    assert met.sum() > 2000
    farthest = []
    for tolerance in (1e-3, 1e-6, 1e-9, 1e-12):
        t, other = Rig(replace(thing, tolerance=tolerance)).first(o, d)
        assert np.array_equal(index, other)
        off = np.abs(t - exact)[met]
        rounding = 64 * U * (np.linalg.norm(o, axis=1) + reach)[met]
        assert (off <= tolerance * reach + rounding).all()
        farthest.append(off.max())
    assert farthest[0] > 1e3 * farthest[2] > 0 and farthest == sorted(farthest, reverse=True)


@pytest.mark.filterwarnings("ignore:what is seen is up to")
def test_without_a_tolerance_there_is_no_code_for_it() -> None:
    """0 is as if nothing were said: the same kernel, the same picture and residual. Any other is one more kernel, and
    which it is does not matter. Degrees 1 and 2 have none."""
    heart, round_ = Polynomial(surface="heart"), polynomial_sphere((0.0, 0.0, 0.0), 1.0)
    assert replace(heart, tolerance=0.0).kind is heart.kind
    assert replace(heart, tolerance=1e-3).kind is replace(heart, tolerance=1e-9).kind is not heart.kind
    assert replace(round_, tolerance=1e-3).kind is round_.kind

    def layers(tolerance: float) -> tuple[np.ndarray, np.ndarray]:
        scene = looked_at(replace(heart, tolerance=tolerance))
        image = vr.render(scene, progress=False, layers=("RGB", "residual"))
        return image["RGB"], image["residual"]

    before = layers(0.0)
    assert compiled(lambda: layers(0.0)) == 0
    assert all(np.array_equal(x, y, equal_nan=True) for x, y in zip(before, layers(0.0)))
    assert compiled(lambda: layers(1e-4)) > 0
    found = [layers(1e-4)]
    assert compiled(lambda: found.append(layers(1e-10))) == 0
    residuals = [np.nanmax(residual) for _, residual in (*found, before)]
    assert residuals[0] > 100 * residuals[1] > 100 * residuals[2] > 0
    errors = [np.abs(light - before[0]).mean() for light, _ in found]
    assert errors[0] > errors[1] and errors[0] < 0.05
    assert all(np.isfinite(light).all() for light, _ in found)


@pytest.mark.parametrize("ends", ["open", "capped"])
@pytest.mark.slow
def test_loose_crossings_of_glass_end(ends: str) -> None:
    """As loose as can be, through reflections, refractions, shadows in colour: all numbers are finite."""
    glass = vr.Material(kd=(0.1, 0.1, 0.1), kr=(0.3, 0.3, 0.3), kt=(0.7, 0.8, 0.9), ior=1.3, dmax=3.0)
    for tolerance in (1.0, 1e-3):
        thing = replace(LOOSE["capped"], ends=ends, tolerance=tolerance)
        scene = looked_at(thing, materials={"m": glass}, settings=replace(VIEW.settings, depth=6))
        scene = replace(scene, objects=scene.objects | {"floor": vr.Plane(point=(0.0, -1.5, 0.0))})
        assert np.isfinite(picture(scene)).all()


@pytest.mark.filterwarnings(r"ignore:the picture has moving edges \(creases\)")
def test_derivatives_where_crossings_are_loose() -> None:
    """They are those at the point that is found: as far off as that point is."""
    near = vr.Camera(origin=(0.1, 0.2, 4.0), target=(0.0, 0.0, 1.0), fov=6.0)
    dome = surface("x^2 + y^4 + z^2*(1 + x) - k", 4.0, (0.1, 0.2, 0.3), parameters={"k": 3.0})
    slopes = [
        vr.derivative(looked_at(replace(dome, tolerance=x), camera=near), "objects.k.parameters.k")
        for x in (0.0, 1e-3, 1e-9)
    ]
    assert np.abs(slopes[0]).max() > 0.01
    assert 1e-6 < np.abs(slopes[1] - slopes[0]).max() < 1e-2
    assert np.abs(slopes[2] - slopes[0]).max() < 1e-8


# What is felt


@pytest.mark.parametrize("ends", ["open", "capped"])
@pytest.mark.filterwarnings(r"ignore:the picture has moving edges \(creases\)")
def test_derivatives_by_parameters_are_central_differences(ends: str) -> None:
    """Of a dome that fills the picture: no edge is in view. The clip and the numbers in the text have no address."""
    near = vr.Camera(origin=(0.1, 0.2, 4.0), target=(0.0, 0.0, 1.0), fov=6.0)
    names = {"mu": 1.1, "k": 3.0}
    dome = surface("x^2*mu^2 + y^4/mu + z^2*(1 + x*mu) - k*mu", 4.0, (0.1, 0.2, 0.3), parameters=names, ends=ends)
    scene = looked_at(dome, camera=near)
    for name in names:
        slope, truth = (f(scene, f"objects.k.parameters.{name}") for f in (vr.derivative, vr.difference))
        assert np.abs(truth).max() > 0.01
        assert np.abs(slope - truth).max() <= 1e-7 * max(1.0, np.abs(truth).max())
        mean = vr.gradient(scene, [f"objects.k.parameters.{name}"])[f"objects.k.parameters.{name}"]
        assert abs(mean - truth.mean()) <= 1e-7
    with pytest.raises(vr.UserError, match=r"those of a polynomial are parameters.mu, parameters.k"):
        vr.derivative(scene, "objects.k.clip.center.0")


@pytest.mark.parametrize("name", ["heart", "barth-sextic", "labs-septic", "tangle"])
@pytest.mark.slow
def test_normals_and_uv_are_those_of_the_exact_gradient(name: str) -> None:
    """800 points: within 1e-9 rad where the gradient is not near zero; turned to where f > 0."""
    rng, mu = np.random.default_rng(18), {"mu": 1.0}
    if name == "tangle":
        thing, text, names = surface(TANGLE, 3.0, parameters=mu), TANGLE, mu
    else:
        thing, text, names = Polynomial(surface=name), SURFACES[name].expression, SURFACES[name].parameters
    rig = Rig(thing)
    t, p, n, u, v = rig.surfaces(*rays_at(rng, 6000, thing.clip_volume().radius))
    met = np.flatnonzero(np.isfinite(t))[:800]
    p, n, u, v = p[met], n[met], u[met], v[met]
    exact = gradient(text, p, **names)
    lengths = np.array([float(along(text, q, unit(g), **names)[1]) for q, g in zip(p, exact)])
    clear = lengths > 1e-3 * np.median(lengths)
    sine = np.linalg.norm(np.cross(n, unit(exact)), axis=1)
    assert len(met) > 400 and clear.mean() > 0.9
    assert sine[clear].max() < 1e-9
    assert ((n * exact).sum(1) > 0)[clear].all()
    assert (u >= 0).all() and (u <= 1).all() and (v >= 0).all() and (v <= 1).all()
    middle = p - np.array(thing.clip_volume().center)
    assert np.abs(v - (np.arcsin(unit(middle)[:, 1]) / np.pi + 0.5)).max() < 1e-6
    assert np.abs(np.cos(2 * np.pi * (u - 0.5)) - middle[:, 0] / np.hypot(middle[:, 0], middle[:, 2])).max() < 1e-6


# Pictures

MATERIALS = {
    "matte": vr.Material(kd=(0.6, 0.4, 0.2), ks=(0.3, 0.3, 0.3), shininess=20.0),
    "mirror": vr.Material(kd=(0.1, 0.1, 0.1), kr=(0.8, 0.7, 0.6)),
    "glass": vr.Material(kd=(0.02, 0.02, 0.02), kt=(0.9, 0.95, 0.8), kr=(0.1, 0.1, 0.1), ior=1.5, dmax=4.0),
}


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("away", [(0.0, 0.0, 0.0), (1e3, -2e3, 500.0)], ids=["here", "far away"])
def test_a_ball_looks_the_same_written_as_a_polynomial(material: str, away: tuple) -> None:
    """On a chequered floor beside another ball, under a small light and a wide one: reflections, refraction, coloured
    shadows. Pixels that an edge crosses within rounding are few."""
    place = lambda *p: tuple((np.array(p) + away).tolist())  # noqa: E731 - a name for a sum

    def scene(ball: Callable) -> Scene:
        return Scene(
            camera=vr.Camera(origin=place(0.5, 2.0, 6.0), target=place(0.0, 0.5, 0.0), fov=35.0),
            film=vr.Film(width=64, height=48),
            textures={"tiles": vr.CheckerTexture(scale=(2.0, 2.0))},
            materials=MATERIALS | {"floor": vr.Material(texture="tiles")},
            objects={
                "floor": vr.Plane(point=place(0.0, -0.51, 0.0), material="floor"),
                "ball": ball(place(-0.3, 0.5, 0.2), 1.0, material=material),
                "small": ball(place(1.1, 0.0, 1.0), 0.4, material="glass"),
            },
            lights={
                "key": vr.PointLight(position=place(3.0, 5.0, 2.0)),
                "pane": vr.RectangleLight(position=place(-3.0, 4.0, 1.0), samples=2, intensity=0.5),
            },
            settings=Settings(spp=4, precision="double", depth=6),
        )

    ours = picture(scene(polynomial_sphere))
    theirs = picture(scene(lambda centre, radius, **more: vr.Sphere(center=centre, radius=radius, **more)))
    off = np.abs(ours - theirs).max(2)
    assert theirs.std() > 0.05
    assert (off > 1e-6).sum() <= (1 if away[0] == 0 else 3)


# Points on the solid's cap, and on singular points


CAPS = {
    "ball": ("x - 9", {"clip": Ball(radius=1.0)}, vr.Sphere(radius=1.0)),
    "box": (
        "x - 9",
        {"clip": Block(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0))},
        vr.Box(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0)),
    ),
}
OUTSIDE, WITHIN, ON = (3.0, 1.7, 0.4), (0.1, 0.2, -0.3), (0.0, 1.0, 0.0)


@pytest.mark.parametrize("glass", [False, True], ids=["matte", "glass"])
@pytest.mark.parametrize("lamp", [OUTSIDE, WITHIN, ON], ids=["lamp outside", "lamp within", "lamp on it"])
@pytest.mark.parametrize("eye", [OUTSIDE, WITHIN], ids=["eye outside", "eye within"])
@pytest.mark.parametrize("name", CAPS)
def test_a_solid_of_cap_alone_looks_as_the_solid(name: str, eye: tuple, lamp: tuple, glass: bool) -> None:
    """A capped surface that is nowhere in its clip, and below zero there, is the clip."""
    expression, clip, solid = CAPS[name]
    material = vr.Material(kd=(0.2, 0.3, 0.4), kt=(0.8, 0.7, 0.6), ior=1.3, dmax=3.0) if glass else vr.Material()
    pictures = []
    for thing in (solid, vr.Polynomial(expression=expression, ends="capped", **clip)):
        scene = vr.Scene(
            camera=vr.Camera(origin=eye, target=(0.0, 0.1, 0.05), fov=60.0),
            film=vr.Film(width=48, height=40),
            materials={"m": material},
            objects={"thing": replace(thing, material="m"), "floor": vr.Plane(point=(0.0, -1.5, 0.0))},
            lights={"lamp": vr.PointLight(position=lamp)},
            settings=vr.Settings(precision="double", spp=1, depth=3),
        )
        pictures.append(vr.render(scene, layers=("RGB",), progress=False)["RGB"])
    differ = (np.abs(pictures[0] - pictures[1]) > 1e-6).any(-1)
    # Where a path runs along an edge of the box, rounding decides.
    assert differ.sum() <= 2


@pytest.mark.parametrize("expression", ["x^2 + y^2 - z^2", "x*y*z", "x^4 + y^4 - z^4", "x^2 + y^2 - 3*z^2 - x^6"])
def test_from_a_singular_point_no_ray_meets_the_point_itself(expression: str) -> None:
    """From the apex of a cone: nothing of it is met; of a surface that is a cone near it only what is farther."""
    rng = np.random.default_rng(31)
    d = unit(rng.normal(size=(4000, 3)))
    t = Rig(surface(expression, 1.5)).first(np.zeros((4000, 3)), d)[0]
    met = np.isfinite(t)
    assert (t[met] > 0.1).all()
    assert met.any() == ("x^6" in expression)
