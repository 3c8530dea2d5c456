"""Blinn-Phong by hand and against NumPy, shadows where geometry puts them, and the integer power."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import drjit as dr
import numpy as np
import pytest
from samples import array, norm, real

from visray import integrator
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.geometry import UNIT_ROUNDOFF, gamma
from visray.lights import PointLight
from visray.materials import Material
from visray.primitives import Box, Disk, Plane, Rectangle, Sphere
from visray.quantities import Arrays
from visray.ray import Ray
from visray.scene.scene import Film, Scene, Settings, SkyGradient
from visray.setup import Prepared, prepare
from visray.shading import power
from visray.transforms import Rotate, Translate

PRECISIONS = pytest.mark.parametrize("precision", ["single", "double"])
BLACK, DARK = (0.0, 0.0, 0.0), {"ambient": (0.0, 0.0, 0.0), "background": (0.0, 0.0, 0.0)}


def seen(scene: Scene, o: Any, d: Any, everything: bool = False) -> np.ndarray:
    """The colours along rays (N, 3) from one origin or many."""
    made = prepare(scene, everything=everything)
    return along(made, o, d)


def along(made: Prepared, o: Any, d: Any) -> np.ndarray:
    d = np.atleast_2d(np.array(d, float))
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    o, d = (made.a.put(made.a.W, np.atleast_2d(np.array(v, float)).T) for v in (o, d))
    origin = RayOrigin(made.kernel.geometry, o)
    return array(integrator.radiance(replace(made.kernel, origin=origin), Ray(o, d))[0])


def pixels(scene: Scene, everything: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colours through the centres of all pixels, with their rays: colours, origin, directions."""
    made = prepare(scene, everything=everything)
    ray = integrator.camera_ray(made.kernel, made.a.F(made.x) + 0.5, made.a.F(made.y) + 0.5)
    colour, _ = integrator.radiance(made.kernel, ray)
    dr.eval(colour, ray.d)
    n = len(made.order)
    return np.broadcast_to(array(colour), (n, 3)), array(ray.o), array(ray.d)


def scene_of(objects: dict, lights: dict, materials: dict, precision: str = "single", **more: Any) -> Scene:
    settings = Settings(precision=precision, shadows=more.pop("shadows", True))
    return Scene(
        objects=objects, lights=lights, materials=materials, settings=settings, **({"camera": Camera()} | more)
    )


# By hand

MATT = Material(ka=(0.1, 0.2, 0.3), kd=(0.5, 0.4, 0.3), ks=(0.25, 0.5, 0.75), shininess=10.0)
LAMP = {"intensity": 2.0, "Ia": (0.1, 0.1, 0.2), "Id": (1.0, 0.5, 0.25), "Is": (0.5, 1.0, 2.0)}


@PRECISIONS
def test_head_on_sphere_by_hand(precision: str) -> None:
    """Camera and light at (0, 0, 5), a unit ball at the origin: n = l = v = h, distance 4.

    I = Ig ka + 2 (Ia ka) + 2 (Id kd + Is ks) / (1 + 4/2 + 16/4) = Ig ka + 2 Ia ka + 2 (Id kd + Is ks) / 7
    """
    lamp = PointLight(position=(0, 0, 5), a=1.0, b=0.5, c=0.25, **LAMP)
    scene = scene_of({"ball": Sphere(material="m")}, {"key": lamp}, {"m": MATT}, precision, ambient=(1, 1, 0.5))
    found = seen(scene, (0, 0, 5), (0, 0, -1))[0]
    ka, kd, ks = (np.array(v) for v in (MATT.ka, MATT.kd, MATT.ks))
    hand = np.array([1, 1, 0.5]) * ka + 2 * np.array([0.1, 0.1, 0.2]) * ka
    hand += 2 * (np.array([1, 0.5, 0.25]) * kd + np.array([0.5, 1, 2]) * ks) / 7
    # Some 40 roundings of terms that are all positive, and the power's ten.
    assert (np.abs(found - hand) <= gamma(50, precision) * hand).all()


@PRECISIONS
def test_light_from_the_side_by_hand(precision: str) -> None:
    """At (0, 0, 1) with l = (1, 0, 1)/sqrt 2: n.l = cos 45, n.h = cos 22.5, whatever the distance of the light.

    So h is made of unit vectors: of the vectors to eye and light themselves it would turn with the distance.
    """
    hand = np.cos(np.pi / 4) * np.array(MATT.kd) + np.cos(np.pi / 8) ** 10 * np.array(MATT.ks)
    for far in (0.01, 1.0, 3.0, 1e4):
        lamp = PointLight(position=(far, 0, 1 + far))
        scene = scene_of({"ball": Sphere(material="m")}, {"key": lamp}, {"m": MATT}, precision, **DARK)
        found = seen(scene, (0, 0, 5), (0, 0, -1))[0]
        assert (np.abs(found - hand) <= gamma(80, precision) * hand).all()


@PRECISIONS
def test_ambient_light_is_the_sum_of_the_scene_and_all_lights_even_in_shadow(precision: str) -> None:
    lights = {
        "a": PointLight(position=(0, 0, -9), intensity=3.0, Ia=(0.1, 0.2, 0.3)),  # behind the ball
        "b": PointLight(position=(0, 0, -5), intensity=0.5, Ia=(1, 0, 1), a=100.0),  # attenuation is not for ambient
    }
    scene = scene_of({"ball": Sphere(material="m")}, lights, {"m": MATT}, precision, ambient=(0.25, 0.5, 0))
    glow = np.array([0.25, 0.5, 0]) + 3 * np.array([0.1, 0.2, 0.3]) + 0.5 * np.array([1, 0, 1])
    found = seen(scene, (0, 0, 5), (0, 0, -1))[0]
    assert (np.abs(found - glow * MATT.ka) <= gamma(8, precision) * glow * MATT.ka).all()


@PRECISIONS
def test_background_is_linear_in_the_height_of_the_ray(precision: str) -> None:
    sky = SkyGradient(top=(0.0, 0.5, 1.0), bottom=(1.0, 0.5, 0.25))
    d = np.array([[0, 1, 0], [0, -1, 0], [1, 0, 0], [0, 0, -1], [0, 1, 1], [3, -4, 0]], float)
    up = 0.5 + 0.5 * d[:, 1] / np.linalg.norm(d, axis=1)
    hand = np.outer(up, sky.top) + np.outer(1 - up, sky.bottom)
    found = seen(scene_of({}, {}, {}, precision, background=sky), (0, 0, 0), d)
    assert (np.abs(found - hand) <= gamma(6, precision)).all()
    flat = seen(scene_of({}, {}, {}, precision, background=(0.2, 0.3, 0.4)), (0, 0, 0), d)
    assert np.array_equal(flat, np.broadcast_to(np.array([0.2, 0.3, 0.4]).astype(flat.dtype), flat.shape))


# Against NumPy


def twin(scene: Scene, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The picture of a lone sphere in 80 bits: colours, the sizes of their terms, and where the answer is certain.

    With one convex object shadows are the side that n.l tells, seen from inside and from outside.
    """
    (ball,) = scene.objects.values()
    m = scene.materials[ball.material]
    o, d, c = real(o), real(d), real(ball.center)
    w = c - o
    b = (d * w).sum(1)
    disc = ball.radius**2 - norm(np.cross(np.broadcast_to(w, d.shape), d)) ** 2
    half = np.sqrt(np.maximum(disc, 0))
    t = np.where(b - half > 0, b - half, b + half)
    hit = (disc > 0) & (t > 0)
    p = o + t[:, None] * d
    n = (p - c) / ball.radius
    within = (n * d).sum(1) > 0
    n = np.where(within[:, None], -n, n)
    colour = np.zeros_like(d) + real(scene.ambient) * m.ka
    sizes, certain = colour.copy(), np.abs(disc) > 1e-3 * ball.radius**2
    for light in scene.lights.values():
        add, size, sure = lit(light, m, p, n, d)
        inside = norm(real(light.position) - c) < ball.radius
        reached = ~within | inside if scene.settings.shadows else np.full(len(d), True)
        colour = colour + np.where(reached[:, None], add, 0) + light.intensity * real(light.Ia) * m.ka
        sizes, certain = sizes + size + light.intensity * real(light.Ia) * m.ka, certain & sure
    return np.where(hit[:, None], colour, 0), np.where(hit[:, None], sizes, 0), certain


def lit(light: PointLight, m: Material, p: np.ndarray, n: np.ndarray, d: np.ndarray) -> tuple:
    """What a light adds, the size of the error that one rounding of every number makes in it, and n.l away from 0."""
    to = real(light.position) - p
    far = norm(to)
    l = to / far[:, None]
    nl = (n * l).sum(1)
    h = l - d
    nh = np.maximum((n * h).sum(1) / norm(h), 0)
    gloss = nh**m.shininess
    weight = light.a + far * (light.b + far * light.c)
    scale = light.intensity / np.where(weight > 0, weight, 1)
    matte, shiny = real(light.Id) * m.kd, real(light.Is) * m.ks
    colour = scale[:, None] * (np.maximum(nl, 0)[:, None] * matte + gloss[:, None] * shiny)
    # Cosines are known to an absolute error, which a power multiplies by its exponent.
    slope = np.where(nh > 0, m.shininess * nh ** max(m.shininess - 1, 0), 0) + gloss
    size = scale[:, None] * (matte + slope[:, None] * shiny)
    return np.where(nl[:, None] > 0, colour, 0), size, np.abs(nl) > 1e-4


def random_ball(rng: np.random.Generator, precision: str, inside: bool) -> Scene:
    """A sphere of 10^U(-3, 3), two lights around or in it, a camera that sees it, and a material of any exponent."""
    radius = 10 ** rng.uniform(-3, 3)
    centre = radius * 10 ** rng.uniform(-1, 1) * rng.normal(size=3)

    def away(low: float, high: float) -> tuple:
        v = rng.normal(size=3)
        return tuple((centre + radius * rng.uniform(low, high) * v / np.linalg.norm(v)).tolist())

    def colour() -> tuple:
        return tuple(rng.uniform(0, 1, 3).tolist())

    lamps = {
        f"l{i}": PointLight(
            position=away(*((0.1, 0.8) if inside and not i else (1.2, 9))), intensity=float(rng.uniform(0.5, 2)),
            Ia=colour(), Id=colour(), Is=colour(), a=float(rng.uniform(0.1, 1)), b=0.3 / radius, c=0.1 / radius**2,
        )
        for i in range(2)
    }  # fmt: skip
    shine = float(rng.choice([0.0, 1.0, 7.5, 32.0, 50.25, 200.0]))
    m = Material(ka=colour(), kd=colour(), ks=colour(), shininess=shine)
    camera = Camera(origin=away(0.1, 0.6) if inside else away(1.5, 20), target=tuple(centre.tolist()), fov=60.0)
    film = Film(width=24, height=16)
    objects = {"ball": Sphere(center=tuple(centre.tolist()), radius=float(radius), material="m")}
    return scene_of(objects, lamps, {"m": m}, precision, camera=camera, film=film, ambient=colour(), background=BLACK)


@PRECISIONS
@pytest.mark.parametrize("inside", [False, True], ids=["from outside", "from inside"])
def test_blinn_phong_agrees_with_numpy_in_every_pixel(precision: str, inside: bool) -> None:
    """30 scenes of 24 x 16 pixels: two lights, attenuation, any exponent; pixels by an edge are left out."""
    rng, compared, shown = np.random.default_rng(5), 0, 0
    for _ in range(30):
        scene = random_ball(rng, precision, inside)
        found, o, d = pixels(scene)
        exact, size, certain = twin(scene, o, d)
        # Where both are in double, so is the normal: off by 26 u of |o| + t, in sizes of the ball up to 60.
        u = gamma(40, precision) + (gamma(26) * 60 if precision == "double" else 0)
        assert (np.abs(found - exact) <= u * size)[certain].all()
        assert ((exact == 0) == (found == 0))[certain].all()
        compared, shown = compared + certain.sum(), shown + (exact[certain] > 0).sum()
    assert compared > 0.6 * 30 * 384 and shown > 0.1 * 30 * 384


@PRECISIONS
def test_two_lights_add(precision: str) -> None:
    rng = np.random.default_rng(6)
    for _ in range(5):
        scene = replace(random_ball(rng, precision, False), ambient=BLACK)
        first, second = ({k: v} for k, v in scene.lights.items())
        both, one, two = (pixels(replace(scene, lights=l))[0] for l in (scene.lights, first, second))
        # The ambient sum is rounded before its product with ka, the parts after it.
        assert (np.abs(both - (one + two)) <= gamma(4, precision) * both).all()


# Sides


@PRECISIONS
@pytest.mark.parametrize("everything", [False, True])
def test_no_light_and_no_highlight_from_behind_or_along_the_surface(precision: str, everything: bool) -> None:
    """The lamp under the floor, and exactly in its plane. Seen flat, n.h is up to 0.7: a highlight but for n.l."""
    shiny = {"m": Material(kd=(1, 1, 1), ks=(1, 1, 1), shininess=2.0)}
    for height in (-1.0, 0.0):
        lamp = PointLight(position=(0, height, -5))
        for shadows in (False, True):
            floor = {"floor": Plane(material="m")}
            scene = scene_of(floor, {"key": lamp}, shiny, precision, shadows=shadows, **DARK)
            assert (seen(scene, (0, 3, 5), [(0.1, -1, -1.5), (0, -3, -5)], everything) == 0).all()


@PRECISIONS
def test_flat_things_are_lit_on_the_side_that_is_seen(precision: str) -> None:
    for thing in (Plane(), Disk(radius=3), Rectangle(width=(4, 0, 0), height=(0, 0, -4))):
        for side in (1, -1):
            lamp = PointLight(position=(0, 4 * side, 0))
            scene = scene_of({"flat": thing}, {"key": lamp}, {}, precision, **DARK)
            for eye in (1, -1):
                colour = seen(scene, (0, 2.0 * eye, 1), (0, -2.0 * eye, -1))[0]
                hand = 0.7 if side == eye else 0  # n.l is 1 at the origin, and kd 0.7
                assert (np.abs(colour - hand) <= gamma(10, precision) * hand).all()


@PRECISIONS
def test_a_ball_around_the_camera_is_lit_from_within_only(precision: str) -> None:
    """n is turned to the viewer. With the lamp inside, the wall that is seen is lit; with the lamp outside it is dark,
    although n.l is positive on the side away from the lamp."""
    rays = np.random.default_rng(7).normal(size=(2000, 3))
    for lamp, dark in (((0.3, 0.2, 0.1), False), ((3.0, 0.0, 0.0), True), ((1.0001, 0, 0), True)):
        scene = scene_of({"ball": Sphere()}, {"key": PointLight(position=lamp)}, {}, precision, **DARK)
        colour = seen(scene, (0.1, -0.3, 0.2), rays)
        assert (colour == 0).all() if dark else (colour > 0.2).all()


@PRECISIONS
@pytest.mark.parametrize("everything", [False, True])
def test_attenuation_of_nothing_is_none(precision: str, everything: bool) -> None:
    """a = b = c = 0 means no attenuation, beside a lamp that has one; c alone is the inverse square."""
    wall = {"wall": Plane(normal=(0, 0, 1))}
    lamps = {"plain": PointLight(position=(0, 0, 3)), "far": PointLight(position=(0, 0, 3), Id=BLACK, Is=BLACK, c=1.0)}
    scene = scene_of(wall, lamps, {}, precision, **DARK)
    assert (np.abs(seen(scene, (0, 0, 3), (0, 0, -1), everything) - 0.7) <= gamma(10, precision)).all()
    scene = scene_of(wall, {"key": PointLight(position=(0, 0, 2), c=0.5)}, {}, precision, **DARK)
    assert (np.abs(seen(scene, (0, 0, 3), (0, 0, -1)) - 0.35) <= gamma(12, precision)).all()


@PRECISIONS
@pytest.mark.parametrize("everything", [False, True])
def test_a_light_on_a_surface_gives_no_nan(precision: str, everything: bool) -> None:
    """At the very point a ray hits, on the camera, in the centre of a ball, on an edge."""
    shiny = {"m": Material(kd=(1, 1, 1), ks=(1, 1, 1), shininess=3.5)}
    objects = {"floor": Plane(material="m"), "ball": Sphere(center=(0, 1, 0), material="m")}
    objects["box"] = Box(min=(2, 0, -1), max=(4, 2, 1))
    rng = np.random.default_rng(8)
    for at in ((0, 0, 3), (0, 2, 0), (0, 1, 1), (0, 1, 0), (2, 0, 1), (2, 2, 1), (0, 5, 9), (0, 0, 0)):
        scene = scene_of(objects, {"key": PointLight(position=at, c=1.0)}, shiny, precision)
        near, around = np.array(at) + 1e-9 * rng.normal(size=(50, 3)), rng.normal(size=(200, 3))
        goal = np.vstack([np.repeat([at], 8, 0), near, around])
        o = np.array((0, 5, 9.0))
        d = goal - o
        d = d[np.linalg.norm(d, axis=1) > 0]
        assert np.isfinite(seen(scene, o, d, everything)).all()


# Shadows


@PRECISIONS
def test_shadow_of_a_ball_ends_where_geometry_puts_it(precision: str) -> None:
    """A ball over a floor, the lamp right above: the shadow is a disk of radius 6 / sqrt 15.

    The lamp at height 6, the ball of radius 1 at height 2: the tangent cone has the sine 1/4, so the tangent
    1 / sqrt 15. Rays at points off that edge by 10^-1 to 10^-12 of it, on both sides and all around.
    """
    objects = {"floor": Plane(), "ball": Sphere(center=(0, 2, 0))}
    scene = scene_of(objects, {"key": PointLight(position=(0, 6, 0))}, {}, precision, **DARK)
    rng = np.random.default_rng(9)
    turn, off = rng.uniform(0, 2 * np.pi, 4000), 10 ** rng.uniform(-12, -1, 4000) * rng.choice([-1, 1], 4000)
    edge = 6 / np.sqrt(15)
    goal = edge * (1 + off)[:, None] * np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
    o = np.array([0, 0.5, 40])
    # From the side, and below the ball's centre: the line to no point of the edge runs through the ball.
    d = goal - o
    passes = norm(np.cross(real(d), real(np.array([0, 2.0, 0]) - o))) / norm(real(d)) > 1.01
    lit_ = seen(scene, o, d)[:, 0] > 0
    # p is off by 8 roundings of |o| + t = 80, here along a ray that comes in at a slope of 0.5 / 40: 80 times more.
    sure = passes & (np.abs(off) * edge > gamma(8) * 80 * 80)
    assert sure.mean() > 0.8
    assert np.array_equal(lit_[sure], off[sure] > 0)


@PRECISIONS
def test_shadows_of_balls_on_a_floor_by_their_distance_from_the_light(precision: str) -> None:
    """Any lamp and ball: a point is dark where the line to the lamp passes the centre nearer than the radius."""
    rng = np.random.default_rng(10)
    for _ in range(20):
        lamp, ball = rng.normal(size=3) * 3 + (0, 12, 0), rng.normal(size=3) + (0, 5, 0)
        radius = rng.uniform(0.2, 2)
        objects = {"floor": Plane(), "ball": Sphere(center=tuple(ball.tolist()), radius=float(radius))}
        scene = scene_of(objects, {"key": PointLight(position=tuple(lamp.tolist()))}, {}, precision, **DARK)
        o = np.array([rng.normal() * 30, 30.0, 30.0])
        goal = np.c_[rng.normal(size=(2000, 1)) * 4, np.zeros((2000, 1)), rng.normal(size=(2000, 1)) * 4]
        d = goal - o
        aside = norm(np.cross(real(d), real(ball - o))) / norm(real(d))
        shaft = real(goal - lamp)
        miss = norm(np.cross(shaft, real(ball - lamp))) / norm(shaft)
        sure = (aside > 1.001 * radius) & (np.abs(miss - radius) > gamma(60) * 100)
        assert sure.mean() > 0.5
        assert np.array_equal(seen(scene, o, d)[sure, 0] > 0, (miss > radius)[sure])


@PRECISIONS
@pytest.mark.parametrize("turned", [False, True])
def test_flush_surfaces_do_not_shade_each_other(precision: str, turned: bool) -> None:
    """Two boxes with a common top look like one; a label lies on a box; a ball stands in its own place twice.

    Each is hit at the same distance as the other, up to rounding: which of the two is seen is chance, and it must not
    be dark because the other is a rounding nearer to the light.
    """
    turn = (Rotate(rotate=12.0, axis=(1, 0.3, 0.2)), Translate(translate=(0.1, 0.2, 0.3))) if turned else ()
    left = Box(min=(-1, 0, -1), max=(0.7, 1, 1), transform=turn)
    right = Box(min=(0.1, 0, -1), max=(2, 1, 1), transform=turn)
    label = Rectangle(center=(-0.2, 1, 0), width=(1, 0, 0), height=(0, 0, -1), transform=turn)
    ball = Sphere(center=(0.5, 0.5, 0), transform=turn)
    camera, film = Camera(origin=(0.3, 5, 4), target=(0.5, 1, 0.5), fov=25.0), Film(width=90, height=60)
    lamps = {"key": PointLight(position=(3, 7, 2)), "far": PointLight(position=(3e3, 7e3, 5e3), Is=BLACK)}
    for two, one in (
        ({"a": left, "b": right}, {"a": Box(min=(-1, 0, -1), max=(2, 1, 1), transform=turn)}),
        ({"a": left, "b": label}, {"a": left}),
        ({"a": ball, "b": ball}, {"a": ball}),
    ):
        scenes = [scene_of(x, lamps, {}, precision, camera=camera, film=film, **DARK) for x in (two, one)]
        first, second = (pixels(s)[0] for s in scenes)
        assert (first > 0).mean() > 0.2
        # The one that is seen may be a rounding nearer or its normal a rounding other; at an edge, another face.
        close = np.abs(first - second) <= gamma(60, precision) * 2
        assert close.mean() >= 1 - 3 / first.size


# The power


def bound_of(x: np.ndarray, exponent: float, u: float, fraction: bool) -> np.ndarray:
    """Relative. Repeated squaring makes as many factors (1 + u) as the exponent; exp2 is off by 4 u and by the error of
    its argument: log2 is off by 4 u, and the product by one more."""
    whole = np.floor(exponent)
    rest = (exponent - whole) * np.abs(np.log2(x)) * np.log(2) * 5 + 6 if fraction else 0
    return (whole + rest + 1) * u / (1 - (whole + rest + 1) * u)


WHOLE = [0.0, 1.0, 2.0, 3.0, 7.0, 10.0, 64.0, 255.0, 4095.0]
BROKEN = [0.5, 0.001, 1.75, 17.3, 254.999]


@PRECISIONS
@pytest.mark.parametrize(("exponent", "fraction"), [(e, False) for e in WHOLE] + [(e, True) for e in WHOLE + BROKEN])
def test_power_is_the_power(precision: str, exponent: float, fraction: bool) -> None:
    """Against exact rationals for whole exponents, and 80 bits for others; the part for fractions changes no whole."""
    a = Arrays.of("llvm", precision)
    x = np.concatenate([[0.0, 1.0], np.random.default_rng(1).uniform(size=3000), 1 - 2.0 ** -np.arange(1, 20)])
    x = np.array(a.F(x)).astype(float)
    bits = max(8, 4 * -(-int(exponent).bit_length() // 4))
    found = np.array(power(a.F(x), dr.opaque(a.F, exponent), bits, fraction, a.F)).astype(float)
    given = float(np.array(a.F(exponent))[0])
    exact = real(x) ** real(given)
    u = UNIT_ROUNDOFF[precision]
    tiny = np.finfo(np.float32 if precision == "single" else float).tiny
    normal = (x > 0) & (exact > 4 * tiny)
    error = np.abs(found[normal] - exact[normal]) / exact[normal]
    assert (error <= bound_of(x[normal], given, u, fraction) + 2.0**-63 * max(given, 1)).all()
    assert (found[(x > 0) & ~normal] <= 8 * tiny).all()
    assert found[0] == (1 if exponent == 0 else 0) and found[1] == 1
    for i in range(2, 40):
        if exponent % 1 == 0 and exponent < 300 and normal[i]:
            truth = Fraction(x[i]) ** int(exponent)
            assert abs(Fraction(found[i]) - truth) <= Fraction(gamma(max(int(exponent), 1) + 6, precision)) * truth


def test_power_has_the_slopes_of_a_power() -> None:
    """d/dx x^e = e x^(e-1) and d/de x^e = x^e ln x, in double; e = 2 as well, where the fraction is nothing."""
    a = Arrays.of("llvm", "double")
    x0 = np.linspace(0.05, 0.99, 50)
    for e0 in (2.0, 5.25, 40.0):
        x, e = a.F(x0), dr.opaque(a.F, e0)
        dr.enable_grad(x, e)
        dr.set_grad(x, 1.0)
        dr.set_grad(e, 0.0)
        y = power(x, e, 8, True, a.F)
        by_x = np.array(dr.forward_to(y))
        exact = e0 * x0 ** (e0 - 1)
        assert (np.abs(by_x - exact) <= gamma(200) * exact).all()
        x, e = a.F(x0), dr.opaque(a.F, e0, len(x0))
        dr.enable_grad(e)
        dr.set_grad(e, 1.0)
        by_e = np.array(dr.forward_to(power(x, e, 8, True, a.F)))
        exact = x0**e0 * np.log(x0)
        # log2 near 1 keeps an absolute error.
        assert (np.abs(by_e - exact) <= gamma(200) * (np.abs(exact) + x0**e0)).all()
