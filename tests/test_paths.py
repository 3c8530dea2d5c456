"""Light by way of other surfaces: reflected, refracted and scattered, by hand, by closed forms and against NumPy."""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from samples import SAMPLES, array

from visray import indirect, integrator, media
from visray.accel.intersect import closest
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.geometry import gamma
from visray.interaction import interact
from visray.lights import DirectionalLight, PointLight
from visray.materials import Material
from visray.primitives import Box, Cone, Cylinder, Disk, Plane, Rectangle, Sphere, Triangle
from visray.ray import Ray
from visray.renderer import render
from visray.scene.scene import Film, Scatter, Scene, Settings, SkyGradient
from visray.setup import Prepared, prepare
from visray.textures import CheckerTexture
from visray.transforms import Rotate

PRECISIONS = pytest.mark.parametrize("precision", ["single", "double"])
BLACK, WHITE, HALF = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.5, 0.5, 0.5)
SKY = SkyGradient(top=(0.1, 0.5, 1.0), bottom=(1.0, 0.75, 0.2))
# A mean of independent samples is off by more than five of its standard errors once in two million times.
SIGMAS = 5


def plain(**fields: Any) -> Material:
    """A material without light of its own but for what is given."""
    return Material(**{"ka": BLACK, "kd": BLACK} | fields)


def scene_of(objects: dict, materials: dict, precision: str = "single", **more: Any) -> Scene:
    """A scene without lights, ambient light and background but for what is given; settings are named with the rest."""
    settings = {k: more.pop(k) for k in list(more) if k in Settings.__dataclass_fields__}
    fields = {"ambient": BLACK, "background": BLACK, "camera": Camera(), "lights": {}} | more
    return Scene(objects=objects, materials=materials, settings=Settings(precision=precision, **settings), **fields)


def triples(a: Any, o: Any, d: Any) -> tuple[Any, Any]:
    """Origins and unit directions as triples, a lane for each direction. Shapes: (3) or (N, 3)."""
    d = np.atleast_2d(np.array(d, float))
    o = np.broadcast_to(np.array(o, float), d.shape)
    return tuple(a.put(a.W, v.T) for v in (o, d / np.linalg.norm(d, axis=1, keepdims=True)))


def along(made: Prepared, o: Any, d: Any) -> np.ndarray:
    """The colours along rays, one sample of each, in double. Each ray has random numbers of its own. Shape: (N, 3)."""
    o, d = triples(made.a, o, d)
    origin = RayOrigin(made.kernel.geometry, o, shared=False)
    colour = array(integrator.radiance(replace(made.kernel, origin=origin), Ray(o, d))[0])
    return np.broadcast_to(colour, (np.shape(d)[1], 3)).astype(float)


def seen(scene: Scene, o: Any, d: Any, everything: bool = False) -> np.ndarray:
    """The colours along rays; `everything`: with all effects in the kernel."""
    return along(prepare(scene, everything=everything), o, d)


@dataclass(frozen=True)
class Step:
    """What rays do at a level. what: the object that they hit, or ""; p: where; d: how they leave; weight: of what
    comes from there; ratio: of the indices before and beyond; hidden: whether the surface counts as none; alive:
    whether they go on."""

    what: np.ndarray
    p: np.ndarray
    d: np.ndarray
    weight: np.ndarray
    ratio: np.ndarray
    hidden: np.ndarray
    alive: np.ndarray


def walk(scene: Scene, o: Any, d: Any, levels: int) -> list[Step]:
    """The ways of rays, level by level, as indirect.indirect goes them."""
    made = prepare(scene)
    a, s = made.a, made.kernel
    names = np.array([name for batch in s.batches for name in batch.names] + [""])
    ray, steps = Ray(*triples(a, o, d)), []
    n = np.shape(ray.d)[1]
    for level in range(levels):
        hit = closest(RayOrigin(s.geometry, ray.o, shared=False), ray)
        here = interact(s, ray, hit, integrator.single_sample_state(made.kernel, n).derived(a.U(level)))
        interface = media.interface_at(s, here)
        b = indirect.bounce(s, here, ray, interface, a.U(1), a.U(0))
        ratio, hidden = (a.D(1), None) if interface is None else (interface.ratio, interface.hidden)
        each = [array(v) for v in (here.surface.p, b.ray.d, b.weight)]
        lanes = [np.broadcast_to(np.array(v), n) for v in (ratio, a.B(False) if hidden is None else hidden, b.alive)]
        steps.append(Step(names[np.minimum(np.array(hit.row), len(names) - 1)], *each, *lanes))
        ray = b.ray
        dr.eval(ray)
    return steps


def unit(v: Any) -> np.ndarray:
    v = np.array(v, float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def sky(y: Any) -> np.ndarray:
    """The background in unit directions of height y. Shape: (N, 3)."""
    up = 0.5 + 0.5 * np.atleast_1d(y)[:, None]
    return up * np.array(SKY.top) + (1 - up) * np.array(SKY.bottom)


def agrees(samples: np.ndarray, truth: Any, other: Any = 0.0) -> np.ndarray:
    """Whether the mean of independent samples (N, 3) is the truth, which has a standard error of its own, `other`.

    Beside the noise there is rounding: a sample is a sum of fewer than 100 terms in single precision.
    """
    error = np.sqrt(samples.var(0, ddof=1) / len(samples) + np.square(other))
    return np.abs(samples.mean(0) - truth) <= SIGMAS * error + gamma(100, "single") * np.abs(truth)


# Mirrors

ROOM = {
    "ball": Sphere(center=(0.5, 0.8, 3), material="red"),
    "box": Box(min=(-2, -1, 1), max=(-1, 0.5, 2), material="blue"),
    "floor": Plane(point=(0, -1, 0), material="blue"),
}
PAINTS = {
    "red": Material(ka=(0.1, 0.05, 0.1), kd=(0.8, 0.2, 0.1), ks=(0.3, 0.3, 0.3), shininess=20.0),
    "blue": Material(kd=(0.1, 0.3, 0.9)),
}
# No light is behind the mirror z = 0, so that it throws no shadow.
LAMPS = {"key": PointLight(position=(2, 5, 6), a=0.5, c=0.02), "sun": DirectionalLight(direction=(0.4, -1, -0.8))}


@PRECISIONS
@pytest.mark.parametrize("kr", [WHITE, (0.9, 0.5, 0.25)])
def test_a_plane_mirror_shows_what_the_mirrored_eye_sees(precision: str, kr: tuple) -> None:
    """A room in front of the mirror z = 0: rays that meet it go on as those from the image of the eye behind it.

    The two reach each point by other roundings, of its place in double and of its shading: 100 of terms that add up to
    less than 2, and by the exponent more in a highlight.
    """
    rng = np.random.default_rng(1)
    o, d = np.array([0.3, 1.5, 4.5]), np.c_[rng.uniform(-0.5, 0.5, (4000, 2)), np.full(4000, -1.0)]
    room = scene_of(ROOM, PAINTS, precision, lights=LAMPS, ambient=HALF, background=SKY)
    mirrored = replace(
        room,
        objects=ROOM | {"mirror": Plane(normal=(0, 0, 1), material="mirror")},
        materials=PAINTS | {"mirror": plain(kr=kr)},
    )
    hidden = np.any([crossed(ROOM[name], o, d) for name in ("ball", "box")], 0)
    down = np.where(d[:, 1] < 0, -(o[1] + 1) / d[:, 1], np.inf)
    first = ~hidden & (down > 4.5)
    assert 0.3 < first.mean() < 0.8
    flip = np.array([1, 1, -1])
    truth = np.array(kr) * seen(room, o * flip, d * flip)
    assert len(np.unique(truth[first].round(3), axis=0)) > 200
    found, bound = seen(mirrored, o, d), gamma(100 + 20, precision) * 2
    assert (np.abs(found - truth) <= bound)[first].all()
    # What stands before the mirror looks as it did.
    assert (np.abs(found - seen(room, o, d)) <= bound)[~first].all()


@PRECISIONS
@pytest.mark.parametrize("depth", [0, 1, 2, 3, 1000])
def test_two_parallel_mirrors_make_a_geometric_series_as_long_as_the_depth(precision: str, depth: int) -> None:
    """Each wall adds its ambient light, tinted by kr once for each bounce before it: the sum of kr^k c to k = depth."""
    kr, c = np.array([0.9, 0.5, 1.0]), np.array([0.25, 1.0, 0.125])
    walls = {f"w{x}": Plane(point=(x, 0, 0), normal=(1, 0, 0), material="m") for x in (-1, 1)}
    materials = {"m": Material(ka=WHITE, kd=BLACK, kr=tuple(kr.tolist()))}
    scene = scene_of(walls, materials, precision, ambient=tuple(c.tolist()), depth=depth, background=(9.0, 9.0, 9.0))
    found = seen(scene, (0.1, 0, 0), [(1, 0.3, 0.2), (-1, 0, 0)])
    series = (kr[None, :] ** np.arange(depth + 1)[:, None]).sum(0) * c
    # Of positive terms: as many roundings as there are products and sums, twice each.
    assert (np.abs(found - series) <= gamma(4 * (depth + 1), precision) * series).all()


@pytest.mark.parametrize("depth", [0, 1, 2, 5, 1000])
def test_as_many_sheets_are_seen_through_as_the_depth_says(depth: int) -> None:
    sheets = {f"s{i}": Rectangle(center=(0, 0, -i), width=(9, 0, 0), height=(0, 9, 0), material="m") for i in range(5)}
    materials = {"m": Material(ka=WHITE, kd=BLACK, kt=HALF)}
    scene = scene_of(sheets, materials, background=WHITE, ambient=WHITE, depth=depth)
    passed = min(depth, 5)
    # Each sheet adds the half that it does not let through, of what those before it do.
    truth = sum(0.5 * 0.5**k for k in range(min(depth, 4) + 1)) + (0.5**5 if passed == 5 else 0)
    # Without refraction a surface is opaque, and its own colour is not weakened.
    assert (seen(scene, (0, 0, 3), (0, 0, -1)) == (1 if depth == 0 else truth)).all()


@PRECISIONS
def test_misses_of_mirrors_show_the_background_or_ambient_light(precision: str) -> None:
    """Rays at a mirrored ball and past it; what the ball reflects comes from the direction mirrored by hand."""
    rng = np.random.default_rng(2)
    d = np.c_[rng.uniform(-0.3, 0.3, (1000, 2)), np.full(1000, -1.0)]
    objects, materials = {"ball": Sphere(material="m")}, {"m": plain(kr=(1.0, 0.5, 0.25))}
    o = np.array([0, 0, 5.0])
    u = unit(d)
    along_ = -(u @ o)
    inside = 1 - (o @ o - along_**2)
    hit = inside > 0
    n = o + (along_ - np.sqrt(np.maximum(inside, 0)))[:, None] * u
    mirrored = u - 2 * (u * n).sum(1)[:, None] * n
    assert 0.2 < hit.mean() < 0.8
    for misses, far in (("background", sky(mirrored[:, 1])), ("ambient", np.array([[0.3, 0.2, 0.7]]))):
        scene = scene_of(objects, materials, precision, background=SKY, ambient=(0.3, 0.2, 0.7), misses=misses)
        truth = np.where(hit[:, None], far * np.array([1.0, 0.5, 0.25]), sky(u[:, 1]))
        # Roundings of the sky; and of the direction, which where rays graze is off by more than the point they meet.
        slack = gamma(8, precision) + 4 * gamma(30) * 6 / np.sqrt(np.maximum(np.abs(inside), gamma(30)))
        assert (np.abs(seen(scene, o, d) - truth) <= slack[:, None]).all()


def test_a_transparent_film_is_empty_where_the_eye_misses_but_mirrors_show_the_background() -> None:
    camera = Camera(origin=(0, 0, 5), fov=20.0)
    objects = {"ball": Sphere(material="m")}
    scene = scene_of(objects, {"m": plain(kr=HALF)}, background=WHITE, camera=camera, spp=4)
    image = render(replace(scene, film=Film(width=32, height=32, transparent=True)), progress=False)
    opaque = render(replace(scene, film=Film(width=32, height=32)), progress=False)
    covered = image["A"]
    assert (covered == 0).any() and (covered == 1).any()
    # Each sample is 0.5 on the ball and, in the opaque film, 1 beside it.
    assert np.array_equal(image["RGB"], np.repeat(0.5 * covered[..., None], 3, 2))
    assert np.array_equal(opaque["RGB"], np.repeat(1 - 0.5 * covered[..., None], 3, 2))


# Glass


def ball_sky(height: np.ndarray, ior: float) -> np.ndarray:
    """Where rays along -z leave a unit ball that they meet at these heights: the y of their direction.

    By Snell's law they turn by 2 (i - r), sin i = height and sin r = height / ior; beyond the critical angle the ball
    mirrors them to 2 i.
    """
    i, s = np.arcsin(height), height / ior
    r = np.arcsin(np.clip(s, -1, 1))
    return np.where(np.abs(s) < 1, -np.sin(2 * (i - r)), np.sin(2 * i))


@PRECISIONS
@pytest.mark.parametrize("ior", [0.5, 0.7, 1.0, 1.1, 1.5, 2.0, 2.42, 10.0])
def test_a_glass_ball_turns_rays_as_snell_says_and_the_picture_upside_down(precision: str, ior: float) -> None:
    height = np.linspace(-0.995, 0.995, 399)
    height = height[np.abs(np.abs(height / ior) - 1) > 1e-3]
    o = np.c_[np.zeros_like(height), height, np.full_like(height, 5.0)]
    scene = scene_of(
        {"ball": Sphere(material="m")}, {"m": plain(kt=(1.0, 0.5, 0.25), ior=ior)}, precision, background=SKY
    )
    truth = ball_sky(height, ior)
    through = np.abs(height / ior) < 1
    tint = np.where(through[:, None], np.array([1.0, 0.5, 0.25]) ** 2, np.array([1.0, 0.5, 0.25]))
    # The height is known to 30 roundings of 6, and turns into the angle by its slope: 1 / cos i and 1 / (ior cos r).
    steep = 2 / np.sqrt(1 - height**2) + np.where(through, 2 / ior / np.sqrt(np.abs(1 - (height / ior) ** 2)), 0)
    slack = gamma(10, precision) + gamma(60) * 6 * (1 + steep)
    found = seen(scene, o, [(0, 0, -1)] * len(height))
    assert (np.abs(found - sky(truth) * tint) <= slack[:, None]).all()
    if ior > 1:
        # Below the middle of the ball the sky is seen, above it the ground.
        near = (np.abs(height) < 0.5) & (height != 0)
        assert np.array_equal(np.sign(truth[near]), -np.sign(height[near]))
        blue = found[near, 2] / 0.25**2
        assert np.array_equal(blue > 0.6, height[near] < 0)


def crossed(thing: Any, o: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Whether rays meet a thing, by its twin in NumPy."""
    twin, d = SAMPLES[type(thing).__name__].twin, np.asarray(unit(d), np.longdouble)
    o = np.broadcast_to(np.asarray(o, np.longdouble), d.shape)
    if thing.closed:
        near, far = twin.interval(thing, o, d, 0)
        return (near <= far) & (near > 0)
    t, outside = twin.crossing(thing, o, d, 0)
    return (t > 0) & (outside <= 0)


def lit_wall(precision: str, **more: Any) -> Scene:
    """The wall z = -4, with a lamp before it that makes each of its places of another colour."""
    lamp = {"key": PointLight(position=(0.5, 1, -3.5), a=1.0, c=0.3, Id=(1, 0.5, 0.25))}
    wall = {"wall": Plane(point=(0, 0, -4), normal=(0, 0, 1), material="wall")}
    return scene_of(wall, {"wall": plain(kd=WHITE)}, precision, lights=lamp, **more)


@PRECISIONS
@pytest.mark.parametrize("ior", [0.8, 1.2, 1.5, 2.4])
def test_a_slab_shifts_what_is_seen_and_turns_nothing(precision: str, ior: float) -> None:
    """A wall seen through a slab of thickness t looks as it does along the ray shifted by t (tan i - tan r).

    The lamp is behind the slab as well.
    """
    thick, rng = 0.6, np.random.default_rng(3)
    bare = lit_wall(precision)
    slab = Box(min=(-20, -20, -0.3), max=(20, 20, 0.3), material="glass")
    glazed = replace(
        bare, objects=bare.objects | {"slab": slab}, materials=bare.materials | {"glass": plain(kt=HALF, ior=ior)}
    )
    d = unit(np.c_[rng.uniform(-0.5, 0.5, (1000, 2)), np.full(1000, -1.0)])
    sine = np.sqrt(1 - d[:, 2] ** 2)
    passing = sine < 0.99 * ior
    d, sine = d[passing], sine[passing]
    inner = sine / ior
    shift = thick * (sine / np.sqrt(1 - sine**2) - inner / np.sqrt(1 - inner**2))
    aside = np.c_[d[:, :2] / sine[:, None], np.zeros(len(d))]
    o = np.array([0, 0, 5.0])
    found, truth = seen(glazed, o, d), seen(bare, o - shift[:, None] * aside, d) * 0.25
    # Shading rounds 60 times. The place on the wall: 60 roundings of numbers up to 20, grazing by up to 1 / cos r; the
    # colour, below 1, changes by up to 2 over a unit, the lamp being half a unit away.
    slack = gamma(60, precision) + 2 * gamma(60) * 20 / np.sqrt(1 - inner**2).min()
    assert (np.abs(found - truth) <= slack).all()
    assert np.abs(found - seen(bare, o, d) * 0.25).max() > 100 * slack
    # It leaves as it came.
    out = walk(glazed, o, d, 2)[1]
    assert (out.what == "slab").all() and (np.abs(out.d - d) <= gamma(60) / (1 - inner**2)[:, None]).all()


@pytest.mark.parametrize(("precision", "everything"), [("single", False), ("single", True), ("double", False)])
def test_glass_of_index_1_tints_and_does_nothing_else(precision: str, everything: bool) -> None:
    """A solid of each kind before a wall: what is behind is seen times kt^2 for each of them."""
    solids = {
        "ball": Sphere(center=(-0.5, 0.8, 3), radius=0.6, material="glass"),
        "box": Box(min=(0.1, 0.1, 2), max=(0.9, 0.7, 3), material="glass"),
        "can": Cylinder(center=(0.5, 1.4, 3), radius=0.4, height=0.9, material="glass"),
        "cone": Cone(base=(-0.5, -1.1, 3), radius=0.5, material="glass"),
    }
    rng, kt = np.random.default_rng(4), np.array([1.0, 0.5, 0.25])
    o, d = np.array([0.1, 0.2, 5.5]), np.c_[rng.uniform(-0.7, 0.7, (2000, 2)), np.full(2000, -1.0)]
    bare = lit_wall(precision)
    materials = bare.materials | {"glass": plain(kt=tuple(kt.tolist()), ior=1.0)}
    glass = replace(bare, objects=bare.objects | solids, materials=materials)
    each = [crossed(solid, o, d) for solid in solids.values()]
    assert min(x.mean() for x in each) > 0.04
    truth = (kt**2) ** np.sum(each, 0)[:, None] * seen(bare, o, d)
    # Where a ray goes on it starts anew: a few roundings of 10, up to eight times.
    slack = gamma(60, precision) + 2 * 8 * gamma(30) * 10
    assert (np.abs(seen(glass, o, d, everything) - truth) <= slack).all()


@PRECISIONS
def test_light_goes_straight_through_sheets(precision: str) -> None:
    """They have no inside, whatever their index. Four kinds of them, one behind the other; the wall is lit beyond."""
    rng, kt = np.random.default_rng(5), np.array([0.5, 1.0, 0.25])
    o, d = np.array([0, 0, 5.0]), np.c_[rng.uniform(-0.9, 0.9, (2000, 2)), np.full(2000, -1.0)]
    bare = lit_wall(precision)
    sheets = {
        "plane": Plane(point=(0, 0, 2), normal=(0.2, 0.1, 1), material="thin"),
        "disk": Disk(center=(0, 0, -1), normal=(0.5, 0, 1), radius=1.5, material="dense"),
        "rectangle": Rectangle(center=(0, 0, -2), width=(3, 0, 0.3), height=(0, 3, 0), material="thin"),
        "triangle": Triangle(a=(-3, -3, -3), b=(3, -3, -3), c=(0, 4, -2.7), material="dense"),
    }
    materials = {name: plain(kt=tuple(kt.tolist()), ior=ior) for name, ior in (("thin", 0.5), ("dense", 3.0))}
    glazed = replace(bare, objects=bare.objects | sheets, materials=bare.materials | materials)
    count = np.sum([crossed(sheet, o, d) for sheet in sheets.values()], 0)
    assert np.unique(count).tolist() == [1, 2, 3, 4]
    weight = kt ** count[:, None]
    # The rest of the way starts anew at each sheet: the place on the wall is a few roundings of 10 off, four times.
    slack = gamma(60, precision) + 2 * 4 * gamma(30) * 10
    assert (np.abs(seen(glazed, o, d) - weight * seen(bare, o, d)) <= slack).all()


@PRECISIONS
def test_all_light_is_reflected_beyond_the_critical_angle_and_weighs_kt(precision: str) -> None:
    """In a glass cube, ways at 45 degrees meet all faces beyond the critical angle, 41.8: they never get out.

    Each of them adds (1 - kt) of the wall's own light: a geometric series, 1 less kt^(depth + 1) in all.
    """
    kt = np.array([0.9, 0.5, 0.0])
    cube = {"cube": Box(min=(-1, -1, -1), max=(1, 1, 1), material="m")}
    for depth in (1, 2, 40):
        scene = scene_of(cube, {"m": Material(ka=WHITE, kd=BLACK, kt=tuple(kt.tolist()), ior=1.5)}, precision,
                         ambient=WHITE, background=(9.0, 9.0, 9.0), depth=depth)  # fmt: skip
        found = seen(scene, (0.1, 0.3, 0), [(1, 1, 0), (-1, 1, 0)])
        # Beside the roundings of the sum, one of 1 - kt in each term.
        assert (np.abs(found - (1 - kt ** (depth + 1))) <= gamma(5 * (depth + 1), precision)).all()


@PRECISIONS
def test_the_critical_angle_is_where_its_sine_is_1_over_ior(precision: str) -> None:
    """From within a ball, off its middle: the angle with the wall is given by the place of the eye."""
    sine = 1 / 1.5 + np.array([-1e-3, -1e-9, -1e-12, 1e-12, 1e-9, 1e-3])
    # On the chord through (sine, 0, 0) along z the wall is met at that sine.
    o = np.c_[sine, 0 * sine, 0 * sine]
    scene = scene_of({"ball": Sphere(material="m")}, {"m": plain(kt=WHITE, ior=1.5)}, precision, background=SKY)
    step = walk(scene, o, [(0, 0, 1)] * len(sine), 1)[0]
    leaves = (step.d * step.p).sum(1) > 0
    # 1e-12 is more than the 30 roundings of the wall's normal.
    assert gamma(30) < 1e-12 and np.array_equal(leaves, sine < 1 / 1.5)
    assert (step.weight == 1).all() and step.alive.all()
    # Just before it, light leaves along the wall.
    assert np.abs((step.d * step.p).sum(1))[2] <= np.sqrt(4 * 1e-12 * 1.5)


@PRECISIONS
def test_an_eye_in_glass_sees_out_by_one_surface(precision: str) -> None:
    """From the middle of a ball all rays leave straight; from elsewhere they turn as Snell says."""
    kt = (0.5, 0.25, 1.0)
    scene = scene_of({"ball": Sphere(material="m")}, {"m": plain(kt=kt, ior=1.5)}, precision, background=SKY)
    d = unit(np.random.default_rng(6).normal(size=(500, 3)))
    found = seen(scene, (0, 0, 0), d)
    assert (np.abs(found - sky(d[:, 1]) * np.array(kt)) <= gamma(20, precision)).all()
    # Off by h, in direction z: the wall's normal is at the sine h, and beyond it 1.5 h; so the ray turns towards h.
    h = np.linspace(-0.66, 0.66, 101)
    o = np.c_[0 * h, h, 0 * h]
    turned = np.arcsin(1.5 * h) - np.arcsin(h)
    slack = gamma(10, precision) + gamma(60) * 2 / np.sqrt(1 - (1.5 * h) ** 2)
    found = seen(scene, o, [(0, 0, 1)] * len(h))
    assert (np.abs(found - sky(-np.sin(turned)) * np.array(kt)) <= slack[:, None]).all()


@pytest.mark.parametrize(("local", "share"), [("weighted", np.array([0.75, 0.5, 0.0])), ("full", np.ones(3))])
@PRECISIONS
def test_the_own_colour_of_glass_is_weighted_or_full(precision: str, local: str, share: np.ndarray) -> None:
    """A sheet with ka before the black, and a lit one: its own colour as without kt, times 1 - kt or whole."""
    lamp = {"key": PointLight(position=(1, 2, 3), Ia=(0.1, 0.1, 0.1))}
    solid = Material(ka=(0.5, 0.25, 1.0), kd=(0.3, 0.2, 0.1), ks=HALF, shininess=3.0)
    scene = scene_of({"sheet": Plane(normal=(0, 0, 1), material="m")}, {"m": solid}, precision, lights=lamp,
                     ambient=(0.5, 1, 0.25), local=local)  # fmt: skip
    clear = replace(scene, materials={"m": replace(solid, kt=(0.25, 0.5, 1.0))})
    o, d = (0, 0, 5), [(0.1 * x, 0.07 * x, -1) for x in range(-5, 5)]
    truth = seen(scene, o, d) * share
    assert (np.abs(seen(clear, o, d) - truth) <= gamma(60, precision) * 2).all()
    assert (truth[:, share > 0] > 0.05).all()


def test_a_surface_that_reflects_and_lets_through_sends_both_in_the_mean() -> None:
    """kr R + kt T for a sheet between ground and sky, with colours whose greatest parts are of other channels."""
    kr, kt = np.array([0.3, 0.1, 0.05]), np.array([0.2, 0.6, 0.9])
    m = Material(ka=WHITE, kd=BLACK, kr=tuple(kr.tolist()), kt=tuple(kt.tolist()))
    scene = scene_of({"sheet": Plane(material="m")}, {"m": m}, background=SKY, ambient=(0.3, 0.3, 0.3))
    d = unit([0.3, -0.8, -0.2])
    samples = seen(scene, (0, 2, 0), np.tile(d, (40_000, 1)))
    assert samples.std(0).min() > 0.01
    truth = 0.3 * (1 - kt) + kr * sky(-d[1])[0] + kt * sky(d[1])[0]
    assert agrees(samples, truth).all()
    # Every sample is one of the two.
    assert len(np.unique(samples.round(6), axis=0)) == 2


def test_each_surface_on_a_way_draws_anew() -> None:
    """Two half-mirrors, one below the other: by the series of what goes to and fro between them, a third gets through.

    kt^2 (1 + kr^2 + kr^4 + ...) = kt^2 / (1 - kr^2). Were the same drawn at each of them, it would be a half.
    """
    sheets = {f"s{y}": Plane(point=(0, y, 0), material="m") for y in (0, -1)}
    sky_below = SkyGradient(top=(0.0, 0.0, 0.0), bottom=(2.0, 4.0, 1.0))
    scene = scene_of(sheets, {"m": plain(kr=HALF, kt=HALF)}, background=sky_below, depth=60)
    found = seen(scene, (0, 3, 0), np.tile((0, -1.0, 0), (40_000, 1)))
    # Straight up the sky is black. No way is longer than 60: 2^-60.
    assert agrees(found, np.array(sky_below.bottom) / 3).all()


# Energy: under a sky of 1 all round, what takes nothing away shows 1

SHAPES = {
    "ball": Sphere(),
    "box": Box(min=(-0.7, -0.5, -0.9), max=(0.7, 0.5, 0.9), transform=(Rotate(rotate=25.0, axis=(1, 2, 3)),)),
    "can": Cylinder(radius=0.6, height=1.5, axis=(1, 1, 0.3)),
    "cone": Cone(base=(0, -0.8, 0), radius=0.9, height=1.6),
}
FURNACE = {"background": WHITE, "depth": 1000}


def rays_at(rng: np.random.Generator, count: int, reach: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Rays from around, at points of a ball of this radius about the origin."""
    o, at = 4 * reach * unit(rng.normal(size=(count, 3))), rng.normal(size=(count, 3))
    at = reach * at / np.linalg.norm(at, axis=1, keepdims=True) * rng.uniform(size=(count, 1)) ** (1 / 3)
    return o, at - o


@PRECISIONS
@pytest.mark.parametrize("shape", SHAPES)
def test_mirrors_and_glass_keep_all_light(precision: str, shape: str) -> None:
    """kr = 1, kt = 1 of any index, and both at 0.5: every sample is 1, to the last bit.

    Where both are, a way goes on inside with a chance of one half: 1000 times in a row it does not.
    """
    o, d = rays_at(np.random.default_rng(7), 500)
    objects = {"thing": replace(SHAPES[shape], material="m")}
    for m in (plain(kr=WHITE), *(plain(kt=WHITE, ior=x) for x in (0.3, 1.0, 1.5, 3.0)), plain(kr=HALF, kt=HALF)):
        found = seen(scene_of(objects, {"m": m}, precision, **FURNACE), o, d)
        assert (found == 1).all(), m


@PRECISIONS
def test_a_tangle_of_mirrors_and_glass_keeps_all_light(precision: str) -> None:
    """Ten solids that overlap, of mirrors, glass and both; no way is trapped among them for 1000 bounces."""
    rng = np.random.default_rng(8)
    materials = {
        "mirror": plain(kr=WHITE), "glass": plain(kt=WHITE, ior=1.5), "water": plain(kt=WHITE, ior=1.33),
        "air": plain(kt=WHITE, ior=1.0), "both": plain(kr=(0.25, 0.25, 0.25), kt=(0.75, 0.75, 0.75)),
    }  # fmt: skip
    objects = {}
    for i, material in enumerate(list(materials) * 2):
        at, size = tuple((1.2 * rng.normal(size=3)).tolist()), float(rng.uniform(0.3, 1))
        objects[f"o{i}"] = Sphere(center=at, radius=size, material=material)
    found = seen(scene_of(objects, materials, precision, **FURNACE), *rays_at(rng, 3000, 2.5))
    # Weights of 0.25 / 0.25 and 0.75 / 0.75 are 1 but for their two roundings each.
    assert (np.abs(found - 1) <= gamma(2 * 50, precision)).all()


# Scattering


@PRECISIONS
@pytest.mark.parametrize("rays", [1, 5])
@pytest.mark.parametrize("shape", SHAPES)
def test_white_paint_keeps_all_light(precision: str, shape: str, rays: int) -> None:
    """kd = 1 without lights under a sky of 1: what leaves a convex thing meets the sky, so every sample is 1."""
    o, d = rays_at(np.random.default_rng(9), 500)
    objects, scatter = {"thing": replace(SHAPES[shape], material="m")}, Scatter(rays=rays)
    found = seen(scene_of(objects, {"m": plain(kd=WHITE)}, precision, scatter=scatter, **FURNACE), o, d)
    # The mean of `rays` numbers, each a share of 1.
    assert (np.abs(found - 1) <= gamma(2 * rays, precision)).all()


@PRECISIONS
def test_white_paint_keeps_all_light_from_thing_to_thing(precision: str) -> None:
    """A ball, a box and a mirrored can on a floor: ways go to and fro between them until the sky."""
    objects = {
        "floor": Plane(point=(0, -1, 0), material="m"),
        "ball": Sphere(material="m"),
        "box": Box(min=(1, -1, -1), max=(2, 1, 1), material="m"),
        "can": Cylinder(center=(-1.8, 0, 0), radius=0.7, material="mirror"),
    }
    scene = scene_of(objects, {"m": plain(kd=WHITE), "mirror": plain(kr=WHITE)}, precision,
                     scatter=Scatter(rays=3, depth=1000), **FURNACE)  # fmt: skip
    o, d = rays_at(np.random.default_rng(10), 3000, 2.0)
    assert (np.abs(seen(scene, o, d) - 1) <= gamma(2 * 3, precision)).all()
    # One scattering is not enough for that.
    once = replace(scene, settings=replace(scene.settings, scatter=Scatter(rays=3, depth=1)))
    assert (seen(once, o, d) < 0.9).any(1).mean() > 0.05


@PRECISIONS
@pytest.mark.parametrize("rays", [1, 4])
@pytest.mark.parametrize("depth", [0, 1, 2, 7])
def test_in_a_closed_box_each_scattering_adds_a_power_of_kd(precision: str, rays: int, depth: int) -> None:
    """Walls that glow by c: c + kd c + kd^2 c + ..., as many as the depth; in every sample, for all walls are alike."""
    kd, c = np.array([0.5, 0.9, 0.25]), np.array([0.3, 0.6, 1.0])
    walls = {"box": Box(min=(-1, -2, -3), max=(3, 2, 1), material="m")}
    scene = scene_of(walls, {"m": Material(ka=WHITE, kd=tuple(kd.tolist()))}, precision, ambient=tuple(c.tolist()),
                     scatter=Scatter(rays=rays, depth=depth), background=(9.0, 9.0, 9.0))  # fmt: skip
    found = seen(scene, (0, 0, 0), np.random.default_rng(11).normal(size=(300, 3)))
    series = c * (kd[None, :] ** np.arange(depth + 1)[:, None]).sum(0)
    assert (np.abs(found - series) <= gamma(4 * (depth + 1) * rays, precision) * series).all()


@pytest.mark.parametrize("mirrors", [0, 1, 2, 5])
@pytest.mark.parametrize("scatterings", [1, 2, 4])
def test_reflections_and_scatterings_are_counted_apart(mirrors: int, scatterings: int) -> None:
    """A floor that glows under a mirror as wide: ways go up by scattering and down by reflection, always.

    Every round adds the floor's light once more, times kd kr; it ends where either count does.
    """
    objects = {"floor": Plane(material="m"), "mirror": Plane(point=(0, 2, 0), material="mirror")}
    materials = {"m": Material(ka=WHITE, kd=HALF), "mirror": plain(kr=HALF)}
    scene = scene_of(objects, materials, ambient=WHITE, depth=mirrors, scatter=Scatter(rays=2, depth=scatterings))
    rounds = min(mirrors, scatterings)
    found = seen(scene, (0, 1, 0), np.c_[np.random.default_rng(12).normal(size=(50, 2)), np.full(50, -1)][:, [0, 2, 1]])
    assert (found == sum(0.25**k for k in range(rounds + 1))).all()


def test_what_a_mirror_shows_scatters_as_well() -> None:
    """kr (local + kd sky) for a floor seen in a mirror, and the same seen through a sheet."""
    objects = {"floor": Plane(material="m"), "mirror": Plane(point=(0, 0, -3), normal=(0, 0, 1), material="way")}
    for way in (plain(kr=HALF), plain(kt=HALF)):
        scene = scene_of(objects, {"m": Material(ka=WHITE, kd=HALF), "way": way}, ambient=(0.25, 0.5, 0.125),
                         background=WHITE, depth=1, scatter=Scatter(rays=4))  # fmt: skip
        # Of the floor's ways on, those that meet the sheet again end there: no reflection is left to them.
        found = seen(scene, (0, 1, 0), np.tile((0, -0.2, -1), (20_000, 1)))
        glow = np.array([0.25, 0.5, 0.125])
        assert np.isin(found[:, 0].round(6), (0.5 * glow[0], 0.5 * (glow[0] + 0.5))).all()
        # From (0, 0, -5) or its mirror image (0, 0, -1), 2 from the sheet: half of all ways, by symmetry, run at it.
        assert agrees(found, 0.5 * (glow + 0.5 * 0.5)).all()


def test_a_mirror_does_not_scatter_even_where_no_reflection_is_followed() -> None:
    """Without depth a mirror is black but for its own colour; its kd does not make it matte."""
    objects = {"ball": Sphere(material="m"), "floor": Plane(point=(0, -1, 0), material="matte")}
    for way in ({"kr": HALF}, {"kt": HALF}):
        m = plain(kd=HALF, **way)
        scene = scene_of(objects, {"m": m, "matte": plain(kd=HALF)}, background=WHITE, depth=0, scatter=Scatter(rays=2))
        assert (seen(scene, (0, 0, 5), (0, 0, -1)) == 0).all()


def gradient_mean(n: np.ndarray) -> np.ndarray:
    """The mean of the sky over a hemisphere, by the cosine: the mean direction is 2/3 of the normal."""
    return sky(2 / 3 * n[1])[0]


@pytest.mark.parametrize("rays", [1, 4, 16])
def test_matte_things_show_the_mean_of_the_sky_above_them(rays: int) -> None:
    """kd times the mean over the hemisphere, in closed form for a sky that is linear; on either side of a plane."""
    kd = np.array([0.5, 0.75, 1.0])
    n = unit([0.3, 1.0, -0.2])
    scene = scene_of({"floor": Plane(normal=tuple(n.tolist()), material="m")}, {"m": plain(kd=tuple(kd.tolist()))},
                     background=SKY, scatter=Scatter(rays=rays))  # fmt: skip
    for side in (1, -1):
        found = seen(scene, 3 * side * n, np.tile(-side * n, (20_000, 1)))
        assert found.std(0).min() > 0.003
        assert agrees(found, kd * gradient_mean(side * n)).all()


@pytest.mark.parametrize("sampler", ["stratified", "sobol", "independent"])
def test_more_rays_have_the_same_mean_and_less_noise(sampler: str) -> None:
    """The variance of the mean of k rays is that of one over k, or less where they are spread evenly."""
    count = 20_000
    objects = {"floor": Plane(material="m"), "ball": Sphere(center=(0.5, 1.2, 0), material="glow")}
    materials = {"m": plain(kd=(0.5, 0.75, 1.0)), "glow": plain(ka=WHITE)}
    spread, means = [], []
    for rays in (1, 4, 16):
        scene = scene_of(objects, materials, background=SKY, ambient=WHITE, sampler=sampler, scatter=Scatter(rays=rays))
        found = seen(scene, (-2, 3, 0), np.tile((2, -3, 0.2), (count, 1)))
        spread.append(found.var(0, ddof=1))
        means.append(found)
    for rays, variance, found in zip((1, 4, 16), spread, means):
        # A variance is off by root((kurtosis - 1) / N) of itself.
        kurtosis = [((x - x.mean(0)) ** 4).mean(0) / x.var(0) ** 2 for x in (found, means[0])]
        wrong = SIGMAS * np.sqrt((kurtosis[0] + kurtosis[1] - 2) / count)
        assert (variance * rays <= spread[0] * (1 + wrong)).all()
        if sampler == "independent":
            assert (variance * rays >= spread[0] * (1 - wrong)).all()
        assert agrees(found, means[0].mean(0), np.sqrt(spread[0] / count)).all() or rays == 1


def test_scattering_is_that_of_the_original_with_points_on_the_sphere() -> None:
    """Against NumPy: rays along the normal plus a random unit vector, from a floor beneath a glowing ball and the sky.

    The original drew points in the ball instead, which is neither this nor uniform.
    """
    rng, count = np.random.default_rng(13), 200_000
    centre, radius, glow, kd = np.array([0.4, 1.2, -0.3]), 0.8, np.array([2.0, 1.0, 0.5]), np.array([0.5, 0.75, 1.0])
    objects = {
        "floor": Plane(material="m"),
        "ball": Sphere(center=tuple(centre.tolist()), radius=radius, material="glow"),
    }
    materials = {"m": plain(kd=tuple(kd.tolist())), "glow": plain(ka=tuple((glow / 2).tolist()))}
    scene = scene_of(objects, materials, background=SKY, ambient=(2.0, 2.0, 2.0), scatter=Scatter(rays=4))
    for p in (np.array([0, 0, 0.0]), np.array([1.5, 0, 0.5]), np.array([0.4, 0, -0.3])):
        d = unit(np.array([0, 1.0, 0]) + unit(rng.normal(size=(count, 3))))
        w = centre - p
        meets = ((d @ w) > 0) & ((d @ w) ** 2 - w @ w + radius**2 > 0)
        drawn = kd * np.where(meets[:, None], glow, sky(d[:, 1]))
        o = p + np.array([-4, 0.5, 3.0])
        found = seen(scene, o, np.tile(p - o, (20_000, 1)))
        assert agrees(found, drawn.mean(0), drawn.std(0) / np.sqrt(count)).all()
        assert 0.05 < meets.mean() < 0.95


def test_the_second_scattering_draws_anew() -> None:
    """Against NumPy in two levels: a floor and a ball, both matte and glowing, under the sky."""
    rng, count = np.random.default_rng(15), 400_000
    centre, radius = np.array([0.4, 1.2, -0.3]), 0.8
    glow, paint, kd = np.array([0.3, 0.2, 0.1]), np.array([0.2, 0.9, 0.4]), np.array([0.5, 0.75, 1.0])
    materials = {
        "floor": plain(ka=tuple(glow.tolist()), kd=tuple(kd.tolist())),
        "ball": plain(ka=tuple(glow[::-1].tolist()), kd=tuple(paint.tolist())),
    }
    objects = {
        "floor": Plane(material="floor"),
        "ball": Sphere(center=tuple(centre.tolist()), radius=radius, material="ball"),
    }
    scene = scene_of(objects, materials, background=SKY, ambient=WHITE, scatter=Scatter(rays=1, depth=2))

    def scattered(n: np.ndarray) -> np.ndarray:
        return unit(n + unit(rng.normal(size=(count, 3))))

    p = np.array([0.6, 0.0, 0.7])
    d = scattered(np.array([0, 1.0, 0]))
    along_, gap = d @ (centre - p), (centre - p) @ (centre - p) - radius**2
    meets = (along_ > 0) & (along_**2 > gap)
    t = along_ - np.sqrt(np.where(meets, along_**2 - gap, 0))
    again = scattered((p + t[:, None] * d - centre) / radius)
    # From the ball, what runs down meets the floor.
    second = np.where(again[:, 1:2] < 0, glow, sky(again[:, 1]))
    light = glow + kd * np.where(meets[:, None], glow[::-1] + paint * second, sky(d[:, 1]))
    o = p + np.array([2.0, 1.0, 1.0])
    found = seen(scene, o, np.tile(p - o, (100_000, 1)))
    assert agrees(found, light.mean(0), light.std(0) / np.sqrt(count)).all()
    assert 0.1 < meets.mean() < 0.5


@PRECISIONS
def test_textures_tint_what_is_scattered(precision: str) -> None:
    """A chequered floor under a sky of 1 shows its colours, though its kd is black."""
    checker = CheckerTexture(a=(0.8, 0.4, 0.2), b=(0.1, 0.2, 0.3))
    scene = scene_of({"floor": Plane(material="m")}, {"m": plain(texture="t")}, precision, textures={"t": checker},
                     background=WHITE, scatter=Scatter(rays=2))  # fmt: skip
    rng = np.random.default_rng(14)
    p = rng.uniform(-3, 3, (1000, 2))
    o = np.array([0, 2.0, 0])
    found = seen(scene, o, np.c_[p[:, 0], np.zeros(1000), p[:, 1]] - o)
    # A floor's u runs along x and its v along -z.
    u, v = p[:, 0] % 1, -p[:, 1] % 1
    sure = (np.abs(u % 0.5 - 0.25) < 0.2499) & (np.abs(v % 0.5 - 0.25) < 0.2499)
    truth = np.where(((u < 0.5) ^ (v < 0.5))[:, None], checker.b, checker.a)
    assert sure.mean() > 0.9
    assert (np.abs(found - truth) <= gamma(8, precision))[sure].all()
