"""The ways to shade but Blinn and Phong's: each by hand on a plane or a ball, and what their kernels leave out."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_features import operations
from test_shading import BLACK, DARK, PRECISIONS, pixels, seen

from visray.camera import Camera
from visray.feature_rules import RULES
from visray.features import ON_EVERYWHERE, features
from visray.geometry import gamma
from visray.lights import DirectionalLight, DiskLight, PointLight, RectangleLight, SphereLight
from visray.materials import Material
from visray.modes import MODES, STEPS
from visray.primitives import Plane, Rectangle, Sphere
from visray.scene.scene import Film, Occlusion, Scatter, Scene, Settings
from visray.textures import CheckerTexture

MATT = Material(ka=BLACK, kd=(0.5, 0.4, 0.3))
LIT = tuple(mode.name for mode in MODES if mode.lit)
UNLIT = tuple(mode.name for mode in MODES if not mode.lit)
EYE = np.array([0.0, 3.0, 4.0])


def scene_of(shading: str, precision: str, material: Material, objects: dict, lights: dict, **more: Any) -> Scene:
    settings = Settings(shading=shading, precision=precision, **more)
    things = {name: replace(thing, material="m") for name, thing in objects.items()}
    return Scene(camera=Camera(), objects=things, lights=lights, materials={"m": material}, settings=settings, **DARK)


def floor_of(shading: str, precision: str, material: Material, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """What EYE sees of the origin on a floor, with the sun `turn` radians from the zenith towards the eye, and l."""
    l = np.array([0.0, np.cos(turn), np.sin(turn)])
    sun = {"sun": DirectionalLight(direction=tuple((-l).tolist()))}
    return seen(scene_of(shading, precision, material, {"floor": Plane()}, sun), EYE, -EYE)[0].astype(float), l


@PRECISIONS
@pytest.mark.parametrize("shininess", [1.0, 5.0, 12.5])
def test_phong_is_the_cosine_between_the_eye_and_the_mirrored_light(precision: str, shininess: float) -> None:
    """kd n.l + ks max(r.v, 0)^shininess with r = 2 (n.l) n - l; no highlight where r points away from the eye."""
    m = replace(MATT, ks=(0.25, 0.5, 0.75), shininess=shininess)
    v = EYE / np.linalg.norm(EYE)
    dark = 0
    for turn in (-1.5, -1.2, -0.9, np.arctan2(4, 3) * -1, -0.5, 0.0, 0.4, 0.7, 1.0, 1.3):
        found, l = floor_of("phong", precision, m, turn)
        n = np.array([0.0, 1, 0])
        shine = max((2 * l[1] * n - l) @ v, 0)
        dark += shine == 0
        hand = l[1] * np.array(m.kd) + shine**shininess * np.array(m.ks)
        # A cosine is off by ten roundings, which a power multiplies by its exponent.
        slope = max(shininess, 1) * shine ** max(shininess - 1, 0)
        assert (np.abs(found - hand) <= gamma(12, precision) * (np.array(m.kd) + slope * np.array(m.ks))).all()
    assert dark > 0


@PRECISIONS
def test_phong_has_no_highlight_from_behind(precision: str) -> None:
    """The sun just under the floor: its mirrored direction would still be near the eye's."""
    m = replace(MATT, ks=(1.0, 1.0, 1.0), shininess=1.0)
    for turn in (-1.6, -1.7, 1.6, 3.0):
        assert (floor_of("phong", precision, m, turn)[0] == 0).all()


@PRECISIONS
def test_phong_and_blinn_differ_where_they_should(precision: str) -> None:
    """The eye at 53 degrees, the sun at 30: v.r is cos 23.1, n.h is cos 11.6; both are 1 in the mirror's direction."""
    m = replace(MATT, kd=BLACK, ks=(1.0, 1.0, 1.0), shininess=8.0)
    eye = np.arctan2(4, 3)
    for turn, apart in ((-eye, 0.0), (-np.pi / 6, eye - np.pi / 6)):
        phong, blinn = (floor_of(s, precision, m, turn)[0][0] for s in ("phong", "blinn-phong"))
        assert abs(phong - np.cos(apart) ** 8) <= gamma(8 * 12 + 8, precision)
        assert abs(blinn - np.cos(apart / 2) ** 8) <= gamma(8 * 12 + 8, precision)


@PRECISIONS
def test_toon_has_steps_of_light_and_a_highlight_or_none(precision: str) -> None:
    """Diffuse light of a cosine in (i/4, (i + 1)/4] is (i + 1)/4; the highlight is ks where Blinn's is at least 1/2."""
    m = replace(MATT, ks=(0.25, 0.5, 0.75), shininess=6.0)
    v, seen_steps, seen_gloss = EYE / np.linalg.norm(EYE), set(), set()
    for cosine in (0.01, 0.249, 0.251, 0.4, 0.499, 0.501, 0.749, 0.751, 0.9, 0.999):
        for side in (1, -1):
            found, l = floor_of("toon", precision, m, side * np.arccos(cosine))
            h = (l + v) / np.linalg.norm(l + v)
            gloss = float(h[1] ** 6 >= 0.5)
            assert abs(h[1] ** 6 - 0.5) > 1e-3
            step = int(np.ceil(cosine * STEPS))
            hand = step / STEPS * np.array(m.kd) + gloss * np.array(m.ks)
            assert (np.abs(found - hand) <= gamma(4, precision) * hand).all()
            seen_steps.add(step)
            seen_gloss.add(gloss)
    assert seen_steps == {1, 2, 3, 4} and seen_gloss == {0.0, 1.0}
    # No light from behind.
    assert (floor_of("toon", precision, m, 1.6)[0] == 0).all()


@PRECISIONS
def test_toon_has_no_step_beyond_the_brightest(precision: str) -> None:
    """Light straight onto a surface: n.l is 1 but for rounding, and it must not count as more than 1."""
    rng = np.random.default_rng(5)
    for _ in range(40):
        n = rng.normal(size=3)
        sun = {"sun": DirectionalLight(direction=tuple((-n).tolist()))}
        scene = scene_of("toon", precision, MATT, {"wall": Plane(normal=tuple(n.tolist()))}, sun)
        eye = n + 0.3 * rng.normal(size=3)
        found = seen(scene, eye, -eye)[0]
        assert (np.abs(found - MATT.kd) <= gamma(2, precision)).all()


@PRECISIONS
def test_normals_as_colours(precision: str) -> None:
    """(n + 1) / 2, n turned to the viewer: a floor from above and below, a ball from all around and from within."""
    floor = scene_of("normal", precision, MATT, {"floor": Plane()}, {})
    for side in (1, -1):
        assert seen(floor, side * EYE, -side * EYE)[0].tolist() == [0.5, 0.5 + 0.5 * side, 0.5]
    rng = np.random.default_rng(1)
    ball = scene_of("normal", precision, MATT, {"ball": Sphere(center=(1.0, 2.0, 3.0), radius=0.5)}, {})
    for outside, far in ((1, 4.0), (-1, 0.3)):
        n = rng.normal(size=(500, 3))
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        c = np.array([1.0, 2.0, 3.0])
        # Along its radius: towards the point from outside, away from the centre from within.
        found = seen(ball, c + 0.5 * far * n, -outside * n)
        assert (np.abs(found - (0.5 + 0.5 * outside * n)) <= gamma(4, precision) + gamma(26) * 20).all()


@PRECISIONS
def test_depth_is_white_at_the_eye_and_half_at_the_target(precision: str) -> None:
    """D / (D + t), D the distance of the camera's target, whatever it looks at."""
    wall = {"wall": Rectangle(width=(1e6, 0, 0), height=(0, 1e6, 0))}
    camera = Camera(origin=(0.0, 0.0, 9.0), target=(0.0, 2.0, 7.0))
    scene = replace(scene_of("depth", precision, MATT, wall, {}), camera=camera)
    rng = np.random.default_rng(2)
    o = np.c_[rng.normal(size=(400, 2)), 10 ** rng.uniform(-4, 4, 400)]
    d = np.c_[rng.normal(size=(400, 2)), -(10 ** rng.uniform(-1, 1, 400))]
    t = o[:, 2] * np.linalg.norm(d, axis=1) / -d[:, 2]
    middle = np.sqrt(8.0)
    hand = middle / (middle + t)
    found = seen(scene, o, d)
    assert (np.abs(found - hand[:, None]) <= gamma(6, precision) * hand[:, None]).all()
    assert abs(seen(scene, (0, 0, middle), (0, 0, -1))[0, 0] - 0.5) <= gamma(6, precision)


@PRECISIONS
def test_uv_is_the_part_after_the_point(precision: str) -> None:
    """A floor's u and v are world units from its point, to the east and to the north; negative ones wrap around."""
    scene = scene_of("uv", precision, MATT, {"floor": Plane(point=(0.25, 0.0, -0.5))}, {})
    rng = np.random.default_rng(3)
    p = np.c_[rng.uniform(-8, 8, 500), np.zeros(500), rng.uniform(-8, 8, 500)]
    found = seen(scene, p + np.array([1.0, 2.0, 1.0]), np.tile([-1.0, -2.0, -1.0], (500, 1)))
    u, v = (p[:, 0] - 0.25) % 1, (-p[:, 2] - 0.5) % 1
    # u in single is off by a rounding of up to 8; where that carries it over a whole number, by one more.
    for one, exact in zip(found.T, (u, v)):
        apart = np.abs(one - exact)
        assert (np.minimum(apart, 1 - apart) <= 8.5 * gamma(2, precision)).all()
        assert (one >= 0).all() and (one <= 1).all()
    assert (found[:, 2] == 0).all()


@PRECISIONS
def test_albedo_is_kd_whatever_the_light(precision: str) -> None:
    """With and without a texture: the colour itself, bit for bit."""
    lights = {"key": PointLight(position=(0, 9, 0), intensity=7.0), "far": DirectionalLight(direction=(1, -1, 0))}
    plain = scene_of("albedo", precision, replace(MATT, ks=(1, 1, 1), kr=(1, 1, 1)), {"floor": Plane()}, lights)
    kind = np.float32 if precision == "single" else float
    assert (seen(plain, EYE, -EYE)[0] == np.array(MATT.kd, kind)).all()
    checker = CheckerTexture(a=(0.9, 0.1, 0.2), b=(0.05, 0.6, 0.7))
    painted = replace(plain, textures={"c": checker}, materials={"m": replace(MATT, texture="c")})
    for x, z in ((0.25, -0.25), (0.75, -0.25), (0.75, -0.75), (0.25, -0.75), (-0.25, -0.25), (-5.75, 3.75)):
        kd = checker.a if (x % 1 < 0.5) == (-z % 1 < 0.5) else checker.b
        p = np.array([x, 0, z])
        assert (seen(painted, p + EYE, -EYE)[0] == np.array(kd, kind)).all()


# What is left out

LIGHTS = {
    "key": PointLight(position=(3, 5, 4), Ia=(0.1, 0.1, 0.1), c=0.1),
    "sun": DirectionalLight(direction=(-1.0, -2.0, -0.5)),
    "panel": RectangleLight(position=(0.0, 4.0, 0.0), samples=4),
    "bulb": SphereLight(position=(2.0, 3.0, 0.0), samples=4),
}
GLOSSY = Material(kd=(0.5, 0.4, 0.3), ks=(0.3, 0.3, 0.3), shininess=7.5, kr=(0.2, 0.2, 0.2), kt=(0.3, 0.2, 0.1))
RICH = Scene(
    camera=Camera(origin=(0.5, 2, 6), target=(0, 0.5, 0)),
    film=Film(width=12, height=8),
    materials={
        "m": replace(GLOSSY, fresnel="dielectric", absorption=(0.1, 0.2, 0.3)),
        "f": Material(texture="c", emission=(0.1, 0.1, 0.1)),
        "u": Material(shading="unlit", back="f"),
    },
    textures={"c": CheckerTexture()},
    objects={
        "floor": Plane(material="f"),
        "a": Sphere(material="m"),
        "b": Sphere(center=(1, 0, 1), material="m"),
        "sign": Sphere(center=(-2, 0, 1), radius=0.3, material="u"),
    },
    lights=LIGHTS | {"lamp": DiskLight(position=(0, 4, 0), visible=True)},
    settings=Settings(spp=1, occlusion=Occlusion(sky=2, near=2), scatter=Scatter(rays=1)),
)


def in_mode(scene: Scene, shading: str) -> Scene:
    return replace(scene, settings=replace(scene.settings, shading=shading))


@pytest.mark.parametrize("shading", UNLIT)
def test_modes_without_light_say_so(shading: str) -> None:
    """Everything that light goes through is off, even where it is forced or a derivative by it is asked for."""
    kept = {*ON_EVERYWHERE}
    lit = {f.name: f.on for f in features(RICH).listed}
    assert all(on for name, on in lit.items() if name not in kept)
    for more in ({}, {"everything": True}, {"wrt": ("lights.key.Id", "materials.m.kr", "ambient")}):
        found = {f.name: f for f in features(in_mode(RICH, shading), **more).listed}
        for rule in RULES:
            if rule.name not in kept:
                assert not found[rule.name].on and found[rule.name].reason == f"settings.shading is {shading}"
        assert found["textures"].on and found["background"].on


@pytest.mark.parametrize("shading", UNLIT)
def test_modes_without_light_trace_no_ray_but_the_eyes(shading: str) -> None:
    """The picture is that without lights, occlusion and paths bit for bit, and so is the kernel's size; with any of
    them, a lit mode needs many times as many operations."""
    scene = in_mode(RICH, shading)
    bare = replace(scene, lights={}, settings=Settings(spp=1, shading=shading, shadows=False, depth=0))
    assert operations(scene) == operations(bare)
    assert pixels(scene)[0].tobytes() == pixels(bare)[0].tobytes()
    assert 4 * operations(scene) < operations(in_mode(RICH, "toon"))
    shadowed = replace(bare, lights=LIGHTS, settings=replace(bare.settings, shading="blinn-phong", shadows=True))
    unshadowed = replace(shadowed, settings=replace(shadowed.settings, shadows=False))
    assert operations(scene) < operations(unshadowed) < operations(shadowed)


@pytest.mark.parametrize("shading", LIT)
def test_lit_modes_have_what_blinn_and_phong_have(shading: str) -> None:
    assert features(in_mode(RICH, shading)).names() == features(RICH).names()


def test_shadows_and_ambient_light_are_the_same_in_all_lit_modes() -> None:
    """A ball over a floor: what is in the shadow, and its ambient light, do not depend on the model."""
    m = Material(ka=(0.5, 0.25, 0.125), kd=(0.5, 0.5, 0.5), ks=(0.2, 0.2, 0.2))
    things = {"floor": Plane(material="m"), "ball": Sphere(center=(0, 2, 0), material="m")}
    scene = replace(RICH, materials={"m": m}, objects=things, lights={"key": PointLight(position=(0.5, 6, 0))},
                    textures={}, ambient=(1.0, 0.5, 0.25), settings=Settings(), background=BLACK)  # fmt: skip
    p = np.c_[np.random.default_rng(4).uniform(-3, 3, 2000), np.zeros(2000), np.zeros(2000)]
    shaft = p - np.array([0.5, 6, 0])
    aside = np.linalg.norm(np.cross(shaft, np.array([-0.5, -4, 0])), axis=1) / np.linalg.norm(shaft, axis=1)
    dark = aside < 1
    glow = np.array([0.5, 0.125, 0.03125])
    for shading in LIT:
        found = seen(in_mode(scene, shading), p + np.array([0, 0.01, 0.02]), np.tile([0, -0.01, -0.02], (2000, 1)))
        assert (found[dark] == glow).all() and (found[~dark] > glow).all()
    assert 100 < dark.sum() < 1900
