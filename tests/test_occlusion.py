"""Ambient occlusion: closed forms for what hides the sky and what is near, both hemispheres, and no acne."""

from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest
from samples import CONVEX, direction, unit
from test_sampling import SIGMA
from test_shading import BLACK, PRECISIONS, along, seen
from test_shadows import SOLIDS, alone, looks, triple

from visray.camera import Camera
from visray.geometry import gamma
from visray.lights import DirectionalLight, PointLight
from visray.materials import Material
from visray.modes import MODES
from visray.primitives import Box, Cone, Cylinder, Disk, Plane, Rectangle, Sphere
from visray.scene.scene import Occlusion, Scene, Settings
from visray.setup import prepare

SAMPLERS = ("stratified", "sobol", "independent")
WHITE = Material(ka=(1.0, 1.0, 1.0), kd=BLACK)
# The sky is red and the lights' ambient light is green: each shows what is left of it.
RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
LANES = 4000


def scene_of(
    things: dict,
    material: Material = WHITE,
    sampler: str = "stratified",
    precision: str = "single",
    shading: str = "blinn-phong",
    **occlusion: Any,
) -> Scene:
    """Two lights share the green."""
    dim = {"Ia": GREEN, "Id": BLACK, "Is": BLACK}
    lights = {
        "one": PointLight(position=(0, 50, 0), intensity=0.75, **dim),
        "two": DirectionalLight(direction=(0, -1, 0), intensity=0.25, **dim),
    }
    rays = Occlusion(**occlusion)
    return Scene(
        objects={name: replace(thing, material="m") for name, thing in things.items()},
        lights=lights,
        materials={"m": material},
        ambient=RED,
        background=BLACK,
        settings=Settings(sampler=sampler, precision=precision, depth=0, shading=shading, occlusion=rays),
        camera=Camera(),
    )


def at(scene: Scene, p: Any = (0, 0, 0), n: int = LANES) -> np.ndarray:
    """How much of sky and near light gets to a floor's point, as n pixels see it. Shape: (n, 2)."""
    step = np.array([0.03, 0.1, 0.02])
    found = seen(scene, np.array(p) + step, np.tile(-step, (n, 1))).astype(float)
    assert (found[:, 2] == 0).all()
    return found[:, :2]


def close(found: np.ndarray, exact: float, bound: float = 0.0) -> bool:
    return abs(found.mean() - exact) <= SIGMA * found.std(ddof=1) / sqrt(len(found)) + bound


FLOOR = {"floor": Plane()}


# Nothing and everything


@PRECISIONS
@pytest.mark.parametrize("everything", [False, True])
def test_without_rays_all_of_the_light_gets_everywhere(precision: str, everything: bool) -> None:
    """0 rays are no division by 0, forced or not; and it is the same for each of both terms alone."""
    box = FLOOR | {"box": Box(min=(-1, -1, -1), max=(1, 1, 1))}
    for sky, near in ((0, 0), (4, 0), (0, 4)):
        made = prepare(scene_of(box, precision=precision, sky=sky, near=near, distance=10.0), everything=everything)
        step = np.array([0.03, 0.1, 0.02])
        found = along(made, step, np.tile(-step, (50, 1)))
        assert (found[:, 0] == (0 if sky else 1)).all()
        assert (found[:, 1] < 1).all() if near else (found[:, 1] == 1).all()


@PRECISIONS
@pytest.mark.parametrize("hemisphere", ["cosine", "box"])
def test_a_bare_floor_sees_all_of_the_sky(precision: str, hemisphere: str) -> None:
    """No ray meets the floor that it leaves: 64 rays each at 4000 points, exactly 1; from below too."""
    p = np.random.default_rng(1).normal(size=(LANES, 3)) * (1e3, 0, 1e3)
    tilted = {"floor": Plane(normal=(0.1, 1.0, -0.2)), "far": Sphere(center=(1e6, -2e6, 0))}
    for up in (1, -1):
        scene = scene_of(tilted, precision=precision, sky=64, near=64, hemisphere=hemisphere)
        found = seen(scene, p + (0.0, 9e3 * up, 0.0), np.tile([0.0, -up, 0], (LANES, 1)))
        if up == 1:
            assert (found[:, :2] == 1).all()
        else:
            assert (found[:, :2] > 1 - 1 / 32).all()  # At most a ray or two meets the ball far below.


@PRECISIONS
@pytest.mark.parametrize("hemisphere", ["cosine", "box"])
def test_in_a_closed_box_there_is_no_sky(precision: str, hemisphere: str) -> None:
    """From all of its walls, up to the corners; and what is near there is nearer than the box is long."""
    scene = scene_of({"box": Box(min=(-1, -2, -3), max=(3, 2, 1))}, precision=precision, sky=16, near=16,
                     hemisphere=hemisphere, distance=7.0)  # fmt: skip
    found = seen(scene, (0.3, 0.2, -0.4), np.random.default_rng(2).normal(size=(LANES, 3)))
    assert (found[:, 0] == 0).all()
    # Its diagonal is sqrt(48).
    assert (found[:, 1] > 0).all() and (found[:, 1] < sqrt(48) / 7).all()


# Closed forms


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize(
    ("middle", "radius"), [((0.0, 2.0, 0.0), 1.0), ((1.0, 1.5, -0.5), 1.2), ((3.0, 2.0, 1.0), 1.9)]
)
def test_a_ball_above_a_floor_hides_its_form_factor(sampler: str, middle: tuple, radius: float) -> None:
    """Of the light by the cosine, a ball wholly above the horizon hides (r / d)^2 cos: unbiased with 1 to 64 rays."""
    d = np.linalg.norm(middle)
    exact = 1 - (radius / d) ** 2 * middle[1] / d
    for precision, counts in (("single", (1, 2, 3, 16, 17, 64)), ("double", (16,))):
        for rays in counts:
            found = at(scene_of(FLOOR | {"ball": Sphere(center=middle, radius=radius)}, sampler=sampler,
                                precision=precision, sky=rays))[:, 0]  # fmt: skip
            assert close(found, exact)
            # Each ray counts as much as any other.
            assert np.abs(found * rays - np.round(found * rays)).max() <= rays * gamma(4, precision)


def test_a_disk_parallel_to_a_floor_hides_its_form_factor() -> None:
    """R^2 / (R^2 + h^2) seen from below its middle, at half the height where it is a box's face or a cylinder's cap."""
    for radius, height in ((1.0, 1.0), (3.0, 0.5), (0.2, 2.0)):
        exact = 1 - radius**2 / (radius**2 + height**2)
        things = [
            Disk(center=(0, height, 0), radius=radius),
            Cylinder(center=(0, height + 0.1, 0), radius=radius, height=0.2),
            Cone(base=(0, height, 0), radius=radius, height=0.3),
        ]
        for thing in things:
            assert close(at(scene_of(FLOOR | {"thing": thing}, sky=16))[:, 0], exact)


def mean_to_ceiling(height: float, reach: float) -> float:
    """The mean of min(h / cos / D, 1) with the density 2 cos: h/D is met by rays steeper than cos = h/D alone."""
    c = min(height / reach, 1)
    return c * c + 2 * c * (1 - c)


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("reach", [0.5, 1.0, 1.5, 4.0, 100.0])
def test_what_is_near_is_a_ramp_up_to_the_distance(sampler: str, reach: float) -> None:
    """Under a ceiling without end at the height 1: the mean of min(t / D, 1). Nearer than that there is nothing."""
    for precision, rays in (("single", 1), ("single", 16), ("double", 5)):
        found = at(scene_of(FLOOR | {"roof": Plane(point=(0, 1, 0))}, sampler=sampler, precision=precision, near=rays,
                            distance=reach))[:, 1]  # fmt: skip
        exact = mean_to_ceiling(1.0, reach)
        assert close(found, exact, gamma(8, precision))
        if reach <= 1:
            # A distance of just 1 is not met: the nearest point of the ceiling is that far.
            assert (np.abs(found - 1) <= gamma(4, precision)).all()
        else:
            assert found.std() > 0


def test_the_variance_falls_with_the_rays() -> None:
    """Independent ones: as 1 / n of that of a coin, exactly; stratified ones faster."""
    ball, exact = FLOOR | {"ball": Sphere(center=(0, 2, 0))}, 0.75
    for rays in (1, 4, 16, 64):
        found = at(scene_of(ball, sampler="independent", sky=rays))[:, 0]
        # The variance of a variance of n numbers, (kurtosis - 1) / n; of a coin, 1 / (p (1 - p)) - 3 at most.
        assert abs(found.var() * rays / (exact * (1 - exact)) - 1) < SIGMA * sqrt(4 / LANES)
    for sampler in ("stratified", "sobol"):
        # A disk's edge cuts few strata: some 4 sqrt(64) of 64, each with a variance of a quarter at most.
        assert at(scene_of(ball, sampler=sampler, sky=64))[:, 0].var() < 4 * 8 * 0.25 / 64**2


# Which light is dimmed


@PRECISIONS
@pytest.mark.parametrize("shading", [mode.name for mode in MODES if mode.lit])
def test_sky_dims_the_scenes_light_and_near_that_of_lights(precision: str, shading: str) -> None:
    """Ig ka sky + sum of Ia ka near: a roof of half a floor's width, and no more than its share of each colour."""
    roof, exact = FLOOR | {"roof": Disk(center=(0, 1, 0), radius=1.0)}, (0.5, 1 - 0.5 + mean_part(1.0, 1.0, 2.0))
    m = replace(WHITE, ka=(0.5, 0.25, 1.0))
    both = at(scene_of(roof, m, precision=precision, shading=shading, sky=16, near=16, distance=2.0))
    for column, ka in ((0, 0.5), (1, 0.25)):
        assert close(both[:, column] / ka, exact[column], gamma(8, precision))
    # Neither changes the other, nor are both the same rays.
    for more in ({"sky": 16}, {"near": 16, "distance": 2.0}):
        one = at(scene_of(roof, m, precision=precision, shading=shading, **more))
        column = 0 if "sky" in more else 1
        assert np.array_equal(one[:, column], both[:, column]) and (one[:, 1 - column] == (0.25, 0.5)[column]).all()
    assert abs(np.corrcoef(both.T)[0, 1]) < SIGMA / sqrt(LANES)


def mean_part(radius: float, height: float, reach: float) -> float:
    """The part of the mean of min(h / cos / D, 1) that a disk right above makes: 2 cos h / cos / D over its cosines."""
    edge = height / sqrt(radius**2 + height**2)
    assert height / edge <= reach
    return 2 * height / reach * (1 - edge)


@pytest.mark.parametrize("kt", [(0.5, 0.5, 0.5), (1.0, 1.0, 1.0)])
def test_transparent_things_hide_the_sky_as_well(kt: tuple) -> None:
    """Bit for bit as much as opaque ones: occlusion asks what is there."""
    ball = FLOOR | {"ball": Sphere(center=(0, 2, 0)), "sheet": Rectangle(center=(1, 1, 0))}
    clear, opaque = (at(scene_of(ball, replace(WHITE, kt=t), sky=16, near=16, distance=3.0)) for t in (kt, BLACK))
    assert np.array_equal(clear, opaque)
    assert (clear[:, 0] < 1).any() and (clear[:, 1] < 1).any()


# As in the original


def original(rng: np.random.Generator, count: int) -> np.ndarray:
    """Directions above a floor: norm(a v1 + b v2 + c N), a and b from -1 to 1, c from 0 to 1. Shape (count, 3)."""
    a, b, c = rng.uniform(-1, 1, count), rng.uniform(-1, 1, count), rng.uniform(0, 1, count)
    return unit(np.stack([a, c, b], 1)).astype(float)


@pytest.mark.parametrize("rays", [1, 4, 16, 64])
@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.slow
def test_the_box_hemisphere_is_the_originals(sampler: str, rays: int) -> None:
    """A ball off the axis and a roof, against the same in NumPy: the share of rays that meet nothing, and the mean of
    min(t / D, 1)."""
    d = original(np.random.default_rng(3), 1_000_000)
    middle, radius, height, reach = np.array([0.8, 1.2, 0.3]), 0.7, 2.5, 4.0
    b = d @ middle
    disc = b * b - middle @ middle + radius**2
    ball = np.where((disc > 0) & (b > 0), b - np.sqrt(np.maximum(disc, 0)), np.inf)
    with np.errstate(divide="ignore"):
        roof = height / d[:, 1]
    roof = np.where(np.hypot(d[:, 0], d[:, 2]) * roof <= 1.5, roof, np.inf)
    t = np.minimum(ball, roof)
    things = FLOOR | {"ball": Sphere(center=triple(middle), radius=radius)}
    things["roof"] = Disk(center=(0, height, 0), radius=1.5)
    found = at(scene_of(things, sampler=sampler, sky=rays, near=rays, distance=reach, hemisphere="box"))
    for column, each in ((0, np.isinf(t).astype(float)), (1, np.minimum(t / reach, 1))):
        error = sqrt(found[:, column].var() / LANES + each.var() / len(each))
        assert abs(found[:, column].mean() - each.mean()) <= SIGMA * error + gamma(8, "single")
    # Another density than the cosine's, by more than the error: the test can fail.
    cosine = at(scene_of(things, sampler=sampler, sky=64, near=1, distance=reach))[:, 0]
    assert abs(cosine.mean() - np.isinf(t).mean()) > 10 * SIGMA * cosine.std() / sqrt(LANES)


# Acne


@PRECISIONS
@pytest.mark.parametrize("name", CONVEX)
def test_no_convex_thing_hides_its_own_sky(name: str, precision: str) -> None:
    """Points that eyes see from outside, on random shapes over 6 decades of size: of 16 rays over the hemisphere none
    meets the shape, and nothing is near."""
    rng, hits = np.random.default_rng(4), 0
    for i in range(6):
        thing, _, reach = alone(rng, name)
        scene = scene_of({"t": thing}, precision=precision, sky=16, near=16, distance=reach,
                         hemisphere=("cosine", "box")[i % 2])  # fmt: skip
        found = seen(scene, *looks(rng, thing, 800))
        hit = found.any(1)
        assert (found[hit, :2] == 1).all()
        hits += hit.mean()
    assert hits > 6 * 0.05


@PRECISIONS
@pytest.mark.parametrize("name", SOLIDS)
def test_no_solid_lets_the_sky_in(name: str, precision: str) -> None:
    """Seen from within, of 16 rays none gets out; but for rays that graze the wall, as a wall has its rounding."""
    rng = np.random.default_rng(5)
    for _ in range(6):
        thing, middle, reach = alone(rng, name)
        scene = scene_of({"t": thing}, precision=precision, sky=16, near=16, distance=3 * reach)
        found = seen(scene, middle, rng.normal(size=(800, 3)))
        assert (found[:, 1] > 0).all()
        # A ray within 1e-6 of the surface has a chance of 1e-12 by the cosine.
        assert (found[:, 0] == 0).all()


@PRECISIONS
def test_what_lies_flush_hides_no_sky(precision: str) -> None:
    """A label on a box, a box with a common top, a ball in its own place twice: exactly 1 above them."""
    box = Box(min=(-1.1, 0, -1.3), max=(2.3, 1.1, 1.7))
    top = {
        "box": box,
        "label": Rectangle(center=(0.3, 1.1, 0), width=(1.1, 0, 0), height=(0, 0, -1.3)),
        "part": Box(min=(0.1, 0.2, -1), max=(2, 1.1, 1)),
        "again": box,
    }
    rng = np.random.default_rng(6)
    goal = np.c_[rng.uniform(-1, 2, (LANES, 1)), np.full((LANES, 1), 1.1), rng.uniform(-1.2, 1.6, (LANES, 1))]
    o = np.array([0.3, 5.0, 4.0])
    for hemisphere in ("cosine", "box"):
        scene = scene_of(top, precision=precision, sky=16, near=16, hemisphere=hemisphere, distance=5.0)
        assert (seen(scene, o, goal - o)[:, :2] == 1).all()
    # Of two balls in one place, the one that is not seen is a rounding farther out or in.
    twice = {"a": Sphere(center=(0.1, 0.2, 0.3), radius=0.7), "b": Sphere(center=(0.1, 0.2, 0.3), radius=0.7)}
    d = np.array([0.1, 0.2, 0.3]) + 0.65 * rng.uniform(-1, 1, (LANES, 3)) / sqrt(3) - o
    found = seen(scene_of(twice, precision=precision, sky=16, near=16, distance=5.0), o, d)
    assert (found[:, :2] == 1).all()


def test_occlusion_by_many_things_is_that_of_the_plain_search() -> None:
    """Trees and guards leave no object out: 40 balls and 40 boxes, the same rays."""
    rng = np.random.default_rng(7)
    things: dict = {"floor": Plane(normal=direction(rng))}
    for i in range(40):
        c = rng.normal(size=3)
        things[f"s{i}"] = Sphere(center=triple(2 * c), radius=float(rng.uniform(0.05, 0.3)))
        things[f"b{i}"] = Box(min=triple(3 * c[::-1]), max=triple(3 * c[::-1] + rng.uniform(0.1, 0.5, 3)))
    scene = scene_of(things, sky=8, near=8, distance=2.0)
    d = rng.normal(size=(LANES, 3))
    fast, plain = (along(prepare(scene, brute_force=p), (0.5, 3.0, 6.0), d - (0.5, 3.0, 6.0)) for p in (False, True))
    assert np.array_equal(fast, plain)
    assert len(np.unique(fast[:, 1])) > 1000
