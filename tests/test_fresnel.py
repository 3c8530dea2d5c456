"""Fresnel reflection: formulas by closed forms and against NumPy, and what cameras see of glass, coats and metals."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import test_paths
from hypothesis import given
from hypothesis import strategies as st
from test_paths import BLACK, PRECISIONS, SIGMAS, SKY, WHITE, agrees, plain, rays_at, seen, unit

import visray as vr
from visray import fresnel
from visray.features import features
from visray.geometry import gamma
from visray.quantities import Arrays

A = Arrays.of(precision="double")
IORS = st.floats(0.01, 100)
COSINES = st.floats(0, 1)


def scene_of(objects: dict, materials: dict, precision: str = "single", **more: Any) -> vr.Scene:
    """As test_paths.scene_of, with a camera, and without lights that are not given."""
    return test_paths.scene_of(objects, materials, precision, **{"camera": vr.Camera(), "lights": {}} | more)


def numbers(*values: Any) -> list:
    return [A.put(A.D, np.array(v, float)) for v in np.broadcast_arrays(*map(np.atleast_1d, values))]


def reflectance(cosine: Any, ratio: Any) -> np.ndarray:
    """By the kernel's formula."""
    return np.array(fresnel.dielectric(*numbers(cosine, ratio)), float)


def twin(cosine: Any, ratio: Any) -> np.ndarray:
    """By Snell's law and the equations of Fresnel as they stand in the books, in 80 bits."""
    c, r = (np.asarray(x, np.longdouble) for x in (cosine, ratio))
    squared = 1 - r**2 * (1 - c**2)
    behind = np.sqrt(np.maximum(squared, 0))
    with np.errstate(invalid="ignore"):
        s = (r * c - behind) / (r * c + behind)
        p = (r * behind - c) / (r * behind + c)
    return np.where(squared > 0, (s**2 + p**2) / 2, 1)


@pytest.mark.parametrize("n", [1.33, 1.5, 2.417, 0.75, 0.01, 100.0])
def test_at_a_right_angle_from_both_sides(n: float) -> None:
    """((n - 1) / (n + 1))^2: 0.04 for glass."""
    for ratio in (n, 1 / n):
        assert abs(reflectance(1.0, ratio)[0] - ((n - 1) / (n + 1)) ** 2) <= gamma(24)


@pytest.mark.parametrize("n", [1.33, 1.5, 2.417])
def test_at_the_angle_of_brewster_only_one_polarisation_is_reflected(n: float) -> None:
    """tan = n: the reflectance is half of ((n^2 - 1) / (n^2 + 1))^2."""
    inside = reflectance(np.cos(np.arctan(1 / n)), n)[0]
    outside = reflectance(np.cos(np.arctan(n)), 1 / n)[0]
    for found in (outside, inside):
        assert abs(found - 0.5 * ((n**2 - 1) / (n**2 + 1)) ** 2) <= gamma(32)


@pytest.mark.parametrize("ratio", [0.01, 1 / 1.5, np.nextafter(1, 0), np.nextafter(1, 2), 1.5, 100.0])
def test_at_grazing_angles_all_light_is_reflected(ratio: float) -> None:
    assert reflectance(0.0, ratio)[0] == 1
    # 1 - F falls linearly, by 2 (n^2 + 1) / sqrt(n^2 - 1) per unit of the cosine.
    n = 1 / ratio
    if n > 1.1:
        assert abs(1 - reflectance(1e-6, ratio)[0] - 2e-6 * (n**2 + 1) / np.sqrt(n**2 - 1)) <= 1e-10 * n**2


@given(COSINES)
def test_between_equal_indices_nothing_is_reflected(cosine: float) -> None:
    assert reflectance(cosine, 1.0)[0] == 0


@given(COSINES, IORS)
def test_formula_is_that_of_the_books(cosine: float, ratio: float) -> None:
    """Near the critical angle the cosine behind is a root of a small difference: its error is the root of that of the
    difference, which is some roundings."""
    found, truth = reflectance(cosine, ratio)[0], float(twin(cosine, ratio))
    squared = float(np.longdouble(1) - np.longdouble(ratio) ** 2 * (1 - np.longdouble(cosine) ** 2))
    slack = gamma(4) * max(1, ratio**2)
    behind = slack / np.sqrt(squared) if squared > slack else np.sqrt(2 * slack)
    slope = 4 * max(ratio, 1 / ratio) / max(cosine, 1e-300)
    assert 0 <= found <= 1
    assert abs(found - truth) <= gamma(24) + min(1, slope * behind)


@given(COSINES, IORS)
def test_reversed_light_is_reflected_as_much(cosine: float, ratio: float) -> None:
    """Stokes: F is the same for the refracted ray that runs back."""
    squared = 1 - ratio**2 * (1 - cosine**2)
    if squared < 1e-6 or cosine < 1e-3:
        return
    behind = np.sqrt(squared)
    there, back = reflectance(cosine, ratio)[0], reflectance(behind, 1 / ratio)[0]
    assert abs(there - back) <= gamma(64) * (1 + ratio**2 + 1 / ratio**2) / (squared * cosine**2)


@given(COSINES, IORS)
def test_what_is_not_reflected_is_refracted(cosine: float, ratio: float) -> None:
    """R + T = 1, where T is that of the amplitudes: n2 cos2 / (n1 cos1) times the squares of t_s and t_p."""
    c, r = np.longdouble(cosine), np.longdouble(ratio)
    squared = 1 - r**2 * (1 - c**2)
    if squared < 1e-6 or cosine < 1e-6:
        return
    behind = np.sqrt(squared)
    t_s, t_p = 2 * r * c / (r * c + behind), 2 * r * c / (c + r * behind)
    transmitted = behind / (r * c) * (t_s**2 + t_p**2) / 2
    assert abs(reflectance(cosine, ratio)[0] + float(transmitted) - 1) <= 1e-9


def test_beyond_the_critical_angle_all_light_is_reflected_exactly() -> None:
    cosine = np.linspace(0, np.sqrt(1 - 1 / 1.5**2) - 1e-12, 1000)
    assert (reflectance(cosine, 1.5) == 1).all()


def test_schlick_is_between_0_and_1() -> None:
    found = np.array(fresnel.schlick(numbers([0, 0.5, 1, 1 + 1e-15])[0]), float)
    assert np.array_equal(found, [1, 0.5**5, 0, 0])


def test_a_thin_sheet_is_the_sum_of_all_its_echoes() -> None:
    r = 0.04
    echoes = r + sum((1 - r) ** 2 * r ** (2 * k + 1) for k in range(20))
    assert abs(np.array(fresnel.thin_sheet(numbers(r)[0]))[0] - echoes) <= gamma(8)


# Pictures. A slab of glass between two backgrounds: white behind it, black in front of it, or the other way round.

GLASS = plain(kr=WHITE, kt=WHITE, ior=1.5, fresnel="dielectric")


def slab(material: vr.Material = GLASS, precision: str = "double", **more: Any) -> vr.Scene:
    """A slab from z = 0 to z = 1 and a bright wall far behind it."""
    wall = vr.Rectangle(center=(0, 0, -50), width=(1e4, 0, 0), height=(0, 1e4, 0), material="wall")
    things = {"slab": vr.Box(min=(-1e3, -1e3, 0), max=(1e3, 1e3, 1), material="glass"), "wall": wall}
    materials = {"glass": material, "wall": plain(kd=WHITE, shading="unlit")}
    return scene_of(things, materials, precision, **{"depth": 40} | more)


@PRECISIONS
def test_a_slab_lets_through_what_its_echoes_leave(precision: str) -> None:
    """Seen against a white wall, T = (1 - F) / (1 + F) is left, by the mean of many paths."""
    for degrees in (0, 30, 60, 80):
        angle = np.radians(degrees)
        d = np.tile((np.sin(angle), 0, -np.cos(angle)), (20_000, 1))
        o = np.array((0.1, 0.2, 3)) * np.ones_like(d) - (3 - 0.5) * np.tan(angle) * np.array((1, 0, 0))
        f = float(twin(np.cos(angle), 1 / 1.5))
        assert agrees(seen(slab(precision=precision), o, d), (1 - f) / (1 + f)).all(), degrees


def test_a_slab_in_uniform_light_is_not_seen() -> None:
    """Nothing is lost: from any side, each path of R and T ends in the same white."""
    o, d = rays_at(np.random.default_rng(1), 4000, 1.2)
    for ior in (1.5, 0.7, 1.0):
        ball = scene_of({"ball": vr.Sphere(material="glass")}, {"glass": replace(GLASS, ior=ior)}, "double",
                        background=WHITE, depth=1000)  # fmt: skip
        assert np.abs(seen(ball, o, d) - 1).max() <= gamma(500)


@pytest.mark.parametrize("ior", [1.5, 0.7])
def test_a_coat_reflects_by_the_angle_and_hides_its_colour_as_much(ior: float) -> None:
    """An opaque ball: (1 - F) of its own colour and F of the sky, along each ray; only one ray goes on, so no noise."""
    o, d = rays_at(np.random.default_rng(2), 3000, 0.9)
    red = vr.Material(kd=(0.8, 0.1, 0.0), kr=WHITE, ior=ior, fresnel="dielectric", shading="unlit")
    scene = scene_of({"ball": vr.Sphere(material="red")}, {"red": red}, "double", background=WHITE)
    d = unit(d)
    b = (o * d).sum(1)
    root = b**2 - (o**2).sum(1) + 1
    met = root > 1e-3
    cosine = np.sqrt(root[met])
    f = twin(cosine, 1 / ior).astype(float)[:, None]
    assert np.abs(seen(scene, o, d)[met] - (f + (1 - f) * np.array(red.kd))).max() <= 1e-12
    assert met.mean() > 0.5


def test_metals_are_as_schlick_says() -> None:
    o, d = rays_at(np.random.default_rng(3), 3000, 0.9)
    gold = plain(kr=(1.0, 0.7, 0.3), kd=(0.0, 0.2, 0.5), fresnel="metal", shading="unlit")
    scene = scene_of({"ball": vr.Sphere(material="gold")}, {"gold": gold}, "double", background=WHITE)
    d = unit(d)
    root = (o * d).sum(1) ** 2 - (o**2).sum(1) + 1
    met = root > 1e-3
    w = ((1 - np.sqrt(root[met])) ** 5)[:, None]
    kr = np.array(gold.kr)
    assert np.abs(seen(scene, o, d)[met] - (kr + (1 - kr) * w + (1 - w) * np.array(gold.kd))).max() <= 1e-12


def test_a_coat_in_water_reflects_less() -> None:
    """Its index is compared with that of the water in front: at a right angle, ((1.5 - 1.33) / (1.5 + 1.33))^2."""
    water = plain(kt=WHITE, ior=1.33)
    coat = plain(kr=WHITE, ior=1.5, fresnel="dielectric")
    for around, near in ({"w": vr.Sphere(radius=3.0, material="water")}, 1.33), ({}, 1.0):
        scene = scene_of({**around, "ball": vr.Sphere(material="coat")}, {"water": water, "coat": coat}, "double",
                         background=WHITE)  # fmt: skip
        assert features(scene)["nested media"] == bool(around)
        found = seen(scene, (0, 0, 9), (0, 0, -1))[0, 0]
        assert abs(found - ((1.5 - near) / (1.5 + near)) ** 2) <= gamma(64)


def test_a_pane_without_thickness_is_a_thin_sheet() -> None:
    """2 F / (1 + F) is reflected, the rest goes straight on; from both sides."""
    pane = {"pane": vr.Rectangle(width=(9, 0, 0), height=(0, 9, 0), material="glass")}
    sky = vr.SkyGradient(top=WHITE, bottom=WHITE)
    for z in (3.0, -3.0):
        d = np.tile((0.0, 0.6, -0.8 * np.sign(z)), (20_000, 1))
        for kr, kt in ((WHITE, BLACK), (BLACK, WHITE)):
            clear = (1e-30,) * 3 if kt == BLACK else kt
            scene = scene_of(pane, {"glass": replace(GLASS, kr=kr, kt=clear)}, "double", background=sky, depth=2)
            f = float(twin(0.8, 1 / 1.5))
            share = 2 * f / (1 + f)
            assert agrees(seen(scene, (0, 0, z), d), share if kr == WHITE else 1 - share).all()


def test_total_reflection_is_weighted_with_kr() -> None:
    """From within, beyond the critical angle: all light goes back, times kr."""
    scene = slab(replace(GLASS, kr=(0.5, 0.25, 0.125), kt=(1.0, 1.0, 1.0)), depth=1)
    mirror = replace(
        scene, objects=scene.objects | {"mark": vr.Sphere(center=(6, 0, 0.5), radius=0.3, material="wall")}
    )
    o, d = np.array([(0, 0, 0.5)]), np.array([(6, 0, -1.0)])
    assert np.abs(seen(mirror, o, d) - np.array((0.5, 0.25, 0.125))).max() <= gamma(16)


def test_grazing_rays_are_numbers() -> None:
    """Rays along and across the surface of a ball, from outside and inside, and at the critical angle: no NaN."""
    rng = np.random.default_rng(4)
    d = unit(rng.normal(size=(3000, 3)))
    n = unit(np.cross(d, rng.normal(size=(3000, 3))))
    for off in (0, 1e-16, 1e-9, -1e-9):
        for ior in (1.5, 1.0, 0.7, 100.0, 0.01):
            scene = scene_of({"ball": vr.Sphere(material="glass")}, {"glass": replace(GLASS, ior=ior)},
                             background=WHITE, depth=5)  # fmt: skip
            found = seen(scene, n * (1 + off) - 0.5 * d, d)
            assert np.isfinite(found).all() and found.max() <= 1 + 1e-5


def test_a_derivative_by_the_index_is_right_in_the_mean() -> None:
    """A pane between sky and ground: reflected with the chance R = 2 F / (1 + F), so the picture is R sky + (1 - R)
    ground, and its derivative by the index is R' (sky - ground), by paths that are drawn."""
    camera = vr.Camera(origin=(0.0, 1e6, 1e6), target=(0.0, 0.0, 0.0), fov=0.01)
    scene = scene_of({"pane": vr.Plane(material="glass")}, {"glass": GLASS}, "double", background=SKY, depth=1, spp=64,
                     film=vr.Film(width=64, height=64), camera=camera, lights={})  # fmt: skip
    up = 0.5 + 0.5 * np.sqrt(0.5)
    top, bottom = np.array(SKY.top), np.array(SKY.bottom)
    above, below = up * top + (1 - up) * bottom, (1 - up) * top + up * bottom

    def share(n: float) -> float:
        f = float(twin(np.sqrt(0.5), 1 / n))
        return 2 * f / (1 + f)

    slope, r = (share(1.5 + 1e-5) - share(1.5 - 1e-5)) / 2e-5, share(1.5)
    found = vr.gradient(scene, ["materials.glass.ior"])["materials.glass.ior"]
    # A path adds slope / r times the sky with the chance r, and -slope / (1 - r) times the ground otherwise.
    spread = abs(slope) * (above / r + below / (1 - r)).mean() * np.sqrt(r * (1 - r))
    truth = slope * (above - below).mean()
    assert abs(truth) > 1e-3
    assert abs(found - truth) <= SIGMAS * spread / 512 + 1e-4


def test_no_derivative_where_fresnel_begins() -> None:
    scene = scene_of({"b": vr.Sphere(material="m")}, {"m": vr.Material(fresnel="dielectric")})
    with pytest.raises(vr.UserError, match=r"materials\.m\.kr: has no derivative at 0"):
        vr.gradient(scene, "materials.m.kr")


def test_a_priority_decides_whose_surface_reflects() -> None:
    """A hidden surface reflects nothing, though it is of another index."""
    clear = {n: replace(GLASS, ior=i, priority=p) for n, i, p in (("a", 1.5, 1.0), ("b", 1.8, 0.0))}
    big, small = vr.Sphere(radius=2.0, material="a"), vr.Sphere(material="b")
    o, d = rays_at(np.random.default_rng(5), 2000, 0.9)
    black = replace(clear["a"], kr=BLACK), replace(clear["b"], kr=BLACK)
    two = scene_of({"a": big, "b": small}, {"a": black[0], "b": black[1]}, "double", background=WHITE, depth=20)
    one = scene_of({"a": big}, {"a": black[0]}, "double", background=WHITE, depth=20)
    assert np.abs(seen(two, o, d) - seen(one, o, d)).max() <= gamma(200)


@pytest.mark.slow
def test_mean_of_a_glass_ball_on_a_floor_is_that_of_a_path_tracer_in_numpy() -> None:
    """A ball of glass before a white half-space: rays are followed with both branches, to a weight of 1e-6."""
    o = np.array((0.3, 0.4, 4.0))
    d = unit(np.array((0.05, -0.12, -1.0)))
    sky = vr.SkyGradient(top=WHITE, bottom=BLACK)
    scene = scene_of({"ball": vr.Sphere(material="glass")}, {"glass": GLASS}, "double", background=sky, depth=60)
    samples = seen(scene, o, np.tile(d, (40_000, 1)))
    assert agrees(samples, branches(o, d, False, 1.0)).all()
    assert samples.std() > 0.01


def branches(o: np.ndarray, d: np.ndarray, inside: bool, weight: float) -> float:
    """What a ray brings from the sky 0.5 + 0.5 y around a unit ball of index 1.5."""
    b = o @ d
    root = b * b - o @ o + 1
    t = -b + (1 if inside else -1) * np.sqrt(max(root, 0))
    if root <= 0 or t <= 1e-9:
        return weight * (0.5 + 0.5 * d[1])
    if weight < 1e-7:
        return 0.0
    p = o + t * d
    n = -p if inside else p
    ratio = 1.5 if inside else 1 / 1.5
    c = -n @ d
    f = float(twin(c, ratio))
    total = branches(p, d + 2 * c * n, inside, weight * f) if inside else weight * f * (0.5 + 0.5 * (d + 2 * c * n)[1])
    if f < 1:
        behind = np.sqrt(1 - ratio**2 * (1 - c**2))
        through = ratio * d + (ratio * c - behind) * n
        rest = weight * (1 - f)
        total += rest * (0.5 + 0.5 * through[1]) if inside else branches(p, through, True, rest)
    return total
