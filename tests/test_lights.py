"""Each kind of light against a closed form or a quadrature of its own; lights on, in and at things; many of them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import atan2, pi, sqrt
from typing import Any

import numpy as np
import pytest
from light_samples import light_sample
from samples import SAMPLES, inverse, outer, real, unit
from test_sampling import SIGMA
from test_shading import BLACK, DARK, PRECISIONS, seen

from visray import prepared_lights
from visray.camera import Camera
from visray.errors import UserError
from visray.geometry import gamma
from visray.lights import KINDS, DirectionalLight, DiskLight, PointLight, RectangleLight, SphereLight, SpotLight
from visray.materials import Material
from visray.primitives import Box, Cone, Cylinder, Disk, Plane, Rectangle, Sphere
from visray.scene.check import checked
from visray.scene.scene import Scene, Settings
from visray.setup import prepare
from visray.transforms import Rotate, Translate

WHITE = Material(ka=BLACK, kd=(1.0, 1.0, 1.0))


def triple(v: Any) -> tuple:
    return tuple(np.array(v, float).tolist())


SAMPLERS = ("stratified", "sobol", "independent")
SHADOWLESS = {"shadows": False}


def scene_of(lights: dict, objects: dict | None = None, material: Material = WHITE, **settings: Any) -> Scene:
    """Objects, a floor by default, of one material: cosines are seen as they are."""
    things = {"floor": Plane()} if objects is None else objects
    things = {name: replace(thing, material="m") for name, thing in things.items()}
    return Scene(
        camera=Camera(), objects=things, lights=lights, materials={"m": material}, settings=Settings(**settings), **DARK
    )


def at(scene: Scene, p: Any, n: int = 1) -> np.ndarray:
    """How bright the floor is at p, as n pixels see it from nearby, each with random numbers of its own."""
    step = np.array([0.3, 1.0, 0.2])
    return seen(scene, np.array(p) + step, np.tile(-step, (n, 1)))[:, 0].astype(float)


def close(found: np.ndarray, exact: float, rounding: float) -> bool:
    """Whether the mean of independent numbers is the exact one, within its standard errors."""
    return abs(found.mean() - exact) <= SIGMA * found.std(ddof=1) / sqrt(len(found)) + rounding * abs(exact)


# Far away


@PRECISIONS
def test_directional_light_is_the_same_everywhere(precision: str) -> None:
    """kd n.l, however far the floor's points are from each other; `a` weakens it, and length of direction does not."""
    rng = np.random.default_rng(1)
    for _ in range(5):
        d = rng.normal(size=3) * 10 ** rng.uniform(-6, 6)
        d[1] = -abs(d[1])
        hand = -d[1] / np.linalg.norm(d)
        for a, weight in ((0.0, 1.0), (2.0, 0.5), (0.25, 4.0)):
            sun = DirectionalLight(direction=triple(d), a=a)
            p = np.c_[rng.normal(size=(50, 1)) * 1e6, np.zeros((50, 1)), rng.normal(size=(50, 1)) * 1e3]
            found = seen(scene_of({"sun": sun}, precision=precision), p + [0, 1, 0], np.tile([0, -1.0, 0], (50, 1)))
            assert (found == found[0]).all()
            assert abs(found[0, 0] - weight * hand) <= gamma(8, precision) * weight * hand


def test_directional_light_has_no_distance() -> None:
    """b and c would make it dark everywhere: they are errors, and a is none."""
    checked(scene_of({"sun": DirectionalLight(direction=(0, -1, 0), a=2.0)}))
    for name in ("b", "c"):
        with pytest.raises(UserError, match=rf"lights\.sun\.{name} = 0\.5: must be 0: a directional light"):
            checked(scene_of({"sun": DirectionalLight(direction=(0, -1, 0), **{name: 0.5})}))


def test_sides_of_a_rectangle_light_must_not_be_parallel() -> None:
    checked(scene_of({"l": RectangleLight(position=(0, 1, 0), width=(1, 0, 0), height=(1, 1e-12, 0))}))
    with pytest.raises(UserError, match=r"lights\.l\.height = .*: must not be parallel to width"):
        checked(scene_of({"l": RectangleLight(position=(0, 1, 0), width=(1, 2, 3), height=(-2, -4, -6))}))


# Spot lights

ANGLES = [0.01, 0.5, 10.0, 30.0, 89.0, 90.0, 120.0, 179.0, 180.0]


def around(light: Any, d: np.ndarray, precision: str, everything: bool = False) -> np.ndarray:
    """What a light at the centre of a ball sends in the directions d, as seen from there: n.l is 1."""
    scene = scene_of({"l": light}, {"ball": Sphere(radius=10.0)}, precision=precision)
    return seen(scene, (0, 0, 0), d, everything)[:, 0].astype(float)


def cone(rng: np.random.Generator, axis: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Directions at these angles from the axis, all around it, in 80 bits rounded to double. Shape: (N, 3)."""
    axis = unit(axis)
    aside = np.cross(axis, rng.normal(size=(len(turn), 3)))
    aside /= np.linalg.norm(aside.astype(float), axis=1)[:, None]
    return (np.cos(real(turn))[:, None] * axis + np.sin(real(turn))[:, None] * aside).astype(float)


def versine(t: np.ndarray) -> np.ndarray:
    """1 - cos t, of all digits."""
    return 2 * np.sin(real(t) / 2) ** 2


@PRECISIONS
@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.5, 40.0])
@pytest.mark.parametrize("angle", ANGLES)
def test_spot_fades_from_axis_to_edge(precision: str, angle: float, exponent: float) -> None:
    """((cos t - cos A) / (1 - cos A))^e within the cone and nothing outside, off the edge by 10^U(-9, 0) of A too."""
    rng, edge = np.random.default_rng(int(angle)), np.radians(angle)
    axis = rng.normal(size=3)
    off = 10 ** rng.uniform(-9, 0, 600) * rng.choice([-1, 1], 600)
    turn = np.concatenate([edge * (1 + off), edge * rng.uniform(0, 1, 300), [0.0]])
    turn = turn[turn <= pi]
    d = cone(rng, axis, turn)
    found = around(SpotLight(position=(0, 0, 0), direction=triple(axis), angle=angle, exponent=exponent), d,
                   precision)  # fmt: skip
    share = 1 - versine(turn) / versine(np.array(edge))
    # Two unit vectors are off by some 8 roundings in double, and so is the angle; the share by as much times its slope.
    slip = gamma(8) * np.maximum(np.sin(turn), gamma(8)) / float(versine(np.array(edge))) + gamma(8)
    sure = np.abs(share) > slip
    assert sure.mean() > 0.9
    inside = np.where(share > 0, share, 1)
    hand = np.where(share > 0, inside**exponent, 0)
    # Beyond what the precision holds, a power may be 0 or not.
    lit, dark = sure & (hand > 1e-30), sure & (share < 0)
    assert (found[lit] > 0).all() and (found[dark] == 0).all()
    # n.l, logarithm and power: a share's error times the exponent, that of log2 times its own size, and 12 more.
    bound = exponent * slip / inside + gamma(1, precision) * (8 * exponent * np.abs(np.log2(inside)) + 12)
    assert (np.abs(found - hand) <= bound * hand)[lit].all()
    assert lit.sum() > 200 and (dark.sum() > 100 or angle > 90)


@PRECISIONS
def test_a_spot_of_180_degrees_and_a_hard_edge_is_a_point_light(precision: str) -> None:
    rng = np.random.default_rng(2)
    d = np.vstack([rng.normal(size=(500, 3)), cone(rng, np.array([0.0, -1, 0]), 10 ** rng.uniform(-7, -1, 500))])
    spot = around(SpotLight(position=(0, 0, 0), direction=(0, 1, 0), angle=180.0), d, precision)
    assert np.array_equal(spot, around(PointLight(position=(0, 0, 0)), d, precision))


@PRECISIONS
def test_length_of_a_spots_direction_does_not_count(precision: str) -> None:
    rng = np.random.default_rng(3)
    axis, d = np.array([0.3, -0.5, 0.2]), rng.normal(size=(400, 3))
    one, *others = (
        around(SpotLight(position=(0, 0, 0), direction=tuple((s * axis).tolist()), angle=100.0, exponent=3.0), d,
               precision)
        for s in (1.0, 1e-6, 7.0, 1e6)
    )  # fmt: skip
    assert (one > 0).sum() > 100
    for other in others:
        # The axis is off by some roundings in double, the share by as much over 1 - cos 100.
        assert (np.abs(one - other) <= gamma(8, precision) * one + 3 * gamma(20)).all()


@PRECISIONS
@pytest.mark.parametrize("everything", [False, True])
def test_no_attenuation_keeps_the_cone(precision: str, everything: bool) -> None:
    """a = b = c = 0, where the original forgot it: dark outside, the light itself inside."""
    rng = np.random.default_rng(4)
    d = cone(rng, np.array([0.0, 0, 1]), np.radians([10.0, 19.9, 20.1, 60.0, 150.0]))
    found = around(SpotLight(position=(0, 0, 0), direction=(0, 0, 1), angle=20.0), d, precision, everything)
    assert (np.abs(found - [1, 1, 0, 0, 0]) <= gamma(8, precision)).all()


# Attenuation

TINY = 1e-6  # An area light of this size is a point but for 1e-6 of its distance.
PLACED = [kind for kind in KINDS if kind.has_position]
SHINING_ALL_AROUND = [kind for kind in PLACED if light_sample(kind.__name__).all_around is not None]


def small(kind: type, p: tuple, **more: Any) -> Any:
    """A light of a kind at p that is TINY wide and shines down."""
    return replace(light_sample(kind.__name__).above(p, TINY), **({"samples": 3} if kind.has_area else {}) | more)


@PRECISIONS
@pytest.mark.parametrize("kind", PLACED, ids=lambda k: k.__name__)
def test_attenuation_of_each_kind(precision: str, kind: type) -> None:
    """n.l falloff / (a + b d + c d^2), d over decades; not weakened where all three are 0."""
    rng = np.random.default_rng(5)
    for a, b, c in ((0, 0, 0), (2, 0, 0), (0, 0.5, 0), (0, 0, 0.25), (1, 0.5, 0.25), (0, 1e-3, 1e3)):
        up = rng.normal(size=3) * (1, 0, 1) + (0, 1, 0)
        l = up * 10 ** rng.uniform(-1, 2)
        far = np.linalg.norm(l)
        weight = a + b * far + c * far * far
        lamp = small(kind, triple(l), a=float(a), b=float(b), c=float(c))
        share = float(lamp.falloff_reference(-l[None] / far)[0])
        hand = share * l[1] / far / (weight if weight else 1)
        found = at(scene_of({"l": lamp}, precision=precision), (0, 0, 0))[0]
        # A part of the lamp is nearer by TINY, which counts up to thrice.
        assert abs(found - hand) <= (gamma(20, precision) + (3 * 2 * TINY / far if kind.has_area else 0)) * hand


# Area lights: closed forms


def disk_on_axis(radius: float, height: float) -> float:
    """The mean of cos / d^2 over a disk above a point: of h / (r^2 + h^2)^(3/2) 2 r dr / R^2."""
    return 2 / radius**2 * (1 - height / sqrt(radius**2 + height**2))


def disk_on_axis_unweakened(radius: float, height: float) -> float:
    """The mean of cos: of h / sqrt(r^2 + h^2) 2 r dr / R^2."""
    return 2 * height / radius**2 * (sqrt(radius**2 + height**2) - height)


def rectangle_above(x0: float, x1: float, z0: float, z1: float, height: float) -> float:
    """The mean of cos / d^2 over a level rectangle: its solid angle, as h / d^3 is one over the area, by its area."""

    def corner(x: float, z: float) -> float:
        return atan2(x * z, height * sqrt(x * x + z * z + height * height))

    whole = corner(x1, z1) - corner(x0, z1) - corner(x1, z0) + corner(x0, z0)
    return whole / ((x1 - x0) * (z1 - z0))


def of_centre(p: np.ndarray) -> float:
    """cos / d^2 of a point at p: a sphere about it has the same mean (Newton's theorem of shells), if wholly above."""
    return p[1] / np.linalg.norm(p) ** 3


# Quadratures: Gauss and Legendre on smooth parameters of the shape itself, by another way than the light's.


def gauss(n: int, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    x, w = np.polynomial.legendre.leggauss(n)
    return 0.5 * (low + high) + 0.5 * (high - low) * x, 0.5 * (high - low) * w


def quadrature(points: np.ndarray, weights: np.ndarray, weigh: Callable) -> float:
    """The mean over a shape of what its points send to the origin of a floor."""
    d = np.linalg.norm(points, axis=-1)
    return float((np.maximum(points[..., 1], 0) / d / weigh(d) * weights).sum() / weights.sum())


def over_parallelogram(l: RectangleLight, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    (s, ws), (t, wt) = gauss(n, -0.5, 0.5), gauss(n, -0.5, 0.5)
    points = np.array(l.position) + s[:, None, None] * np.array(l.width) + t[None, :, None] * np.array(l.height)
    return points, ws[:, None] * wt


def over_disk(l: DiskLight, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    (r, wr), turn = gauss(n, 0, l.radius), np.arange(4 * n) * (pi / 2 / n)
    normal = np.array(l.normal) / np.linalg.norm(l.normal)
    x = np.cross(normal, (0.1, 0.2, 0.97))
    x /= np.linalg.norm(x)
    rim = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * np.cross(normal, x)
    return np.array(l.position) + r[:, None, None] * rim, np.broadcast_to((wr * r)[:, None], (n, 4 * n))


def over_sphere(l: SphereLight, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """By latitude and longitude about the axis x."""
    (t, wt), turn = gauss(n, 0, pi), np.arange(4 * n) * (pi / 2 / n)
    ring = np.stack([np.zeros(4 * n), np.cos(turn), np.sin(turn)], 1)
    points = np.cos(t)[:, None, None] * np.array([1.0, 0, 0]) + np.sin(t)[:, None, None] * ring
    return np.array(l.position) + l.radius * points, np.broadcast_to((wt * np.sin(t))[:, None], (n, 4 * n))


@dataclass(frozen=True)
class Case:
    """An area light over the origin of a floor, and the mean of cos / (a + b d + c d^2) over it."""

    light: Any
    exact: float


def square(d: np.ndarray) -> np.ndarray:
    return d * d


def whole(d: np.ndarray) -> np.ndarray:
    return 1 + 0 * d


def mixed(d: np.ndarray) -> np.ndarray:
    return 0.5 + 0.25 * d + 0.125 * d * d


def cases() -> dict[str, Case]:
    leaning = RectangleLight(position=(0.5, 2.0, -0.3), width=(1.2, 0.5, 0.3), height=(0.6, -0.4, 1.0))
    tilted = DiskLight(position=(-0.4, 1.5, 0.7), normal=(1.0, 2.0, -0.5), radius=0.8)
    ball, low = SphereLight(position=(0.7, 2.0, -0.4), radius=1.2), SphereLight(position=(0.9, 0.9, 0.2), radius=0.8)
    parts = {"a": 0.5, "b": 0.25, "c": 0.125}
    return {
        "disk on the axis": Case(DiskLight(position=(0, 1.5, 0), radius=1.25, c=1.0), disk_on_axis(1.25, 1.5)),
        "disk unweakened": Case(DiskLight(position=(0, 1.5, 0), radius=1.25), disk_on_axis_unweakened(1.25, 1.5)),
        "rectangle": Case(
            RectangleLight(position=(0.5, 1.5, 0.25), width=(2.0, 0, 0), height=(0, 0, 1.5), c=1.0),
            rectangle_above(-0.5, 1.5, -0.5, 1.0, 1.5),
        ),
        "sphere": Case(replace(ball, c=1.0), of_centre(np.array(ball.position))),
        "leaning parallelogram": Case(replace(leaning, c=1.0), quadrature(*over_parallelogram(leaning), square)),
        "leaning, mixed": Case(replace(leaning, **parts), quadrature(*over_parallelogram(leaning), mixed)),
        "tilted disk": Case(replace(tilted, c=1.0), quadrature(*over_disk(tilted), square)),
        "tilted disk, mixed": Case(replace(tilted, **parts), quadrature(*over_disk(tilted), mixed)),
        "sphere unweakened": Case(low, quadrature(*over_sphere(low), whole)),
        "sphere, mixed": Case(replace(low, **parts), quadrature(*over_sphere(low), mixed)),
    }


CASES = cases()
LANES = 4000


def test_the_quadratures_are_right() -> None:
    """They agree with the closed forms, and with themselves at fewer points."""
    ball, disk = SphereLight(position=(0.7, 2.0, -0.4), radius=1.2), DiskLight(position=(0, 1.5, 0), radius=1.25)
    flat = RectangleLight(position=(0.5, 1.5, 0.25), width=(2.0, 0, 0), height=(0, 0, 1.5))
    for points, exact in (
        (over_sphere(ball), of_centre(np.array(ball.position))),
        (over_disk(disk), disk_on_axis(1.25, 1.5)),
        (over_parallelogram(flat), rectangle_above(-0.5, 1.5, -0.5, 1.0, 1.5)),
    ):
        assert abs(quadrature(*points, square) / exact - 1) < 1e-12
    for case in CASES.values():
        light = case.light
        over = {RectangleLight: over_parallelogram, DiskLight: over_disk, SphereLight: over_sphere}[type(light)]
        weigh = lambda d, l=light: l.a + l.b * d + l.c * d * d if l.a + l.b + l.c else whole(d)  # noqa: E731
        assert abs(quadrature(*over(light, 45), weigh) / case.exact - 1) < 1e-12


def case_is_plain(name: str) -> bool:
    """One of each kind."""
    return name in ("disk on the axis", "leaning parallelogram", "sphere")


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("name", CASES)
def test_samples_of_an_area_light_have_the_mean_of_the_whole(name: str, sampler: str) -> None:
    """4000 pixels of 1 to 64 samples each, in single and double: unbiased, within their standard errors."""
    case, plain = CASES[name], case_is_plain(name)
    for precision, counts in (("single", (1, 2, 3, 16, 17, 64) if plain else (3, 17)), ("double", (16,))):
        for samples in counts:
            lamp = {"l": replace(case.light, samples=samples)}
            found = at(scene_of(lamp, sampler=sampler, precision=precision, **SHADOWLESS), (0, 0, 0), LANES)
            assert close(found, case.exact, gamma(30, precision))


@pytest.mark.parametrize("name", ["rectangle", "disk on the axis", "sphere"])
def test_the_variance_of_samples_falls_as_their_kind_promises(name: str) -> None:
    """Independent ones: as 1/n. Stratified ones: as 1/n^2 of what is smooth, and so do those of a net.

    A wave across the square varies in a stratum of side 1/k by (2 pi / k)^2 / 12 of its own variance; here there is no
    more than one along each side.
    """
    case = CASES[name]

    def variance(sampler: str, samples: int) -> float:
        lamp = {"l": replace(case.light, samples=samples)}
        return at(scene_of(lamp, sampler=sampler, **SHADOWLESS), (0, 0, 0), LANES).var(ddof=1)

    alone = variance("independent", 1)
    for samples in (4, 16, 64):
        # The variance of a variance is (kurtosis - 1) / n of its square; of what these lights send, 4 at most.
        assert abs(variance("independent", samples) * samples / alone - 1) < 2 * SIGMA * sqrt(4 / LANES)
    for sampler in ("stratified", "sobol"):
        assert variance(sampler, 64) < 2 * (2 * pi) ** 2 / 12 / 64 * alone / 64


@PRECISIONS
def test_area_lights_shine_to_both_sides(precision: str) -> None:
    """A floor below and a ceiling above, as far away: equally bright, of a flat light."""
    for light in (DiskLight(position=(0, 2, 0), radius=1.0), RectangleLight(position=(0, 2, 0))):
        light = replace(light, c=1.0, samples=16)
        scene = scene_of({"l": light}, {"floor": Plane(), "roof": Plane(point=(0, 4, 0))}, precision=precision)
        below = at(scene, (0, 0, 0), LANES)
        above = seen(scene, (0, 3, 0), np.tile([0.0, 1, 0], (LANES, 1)))[:, 0].astype(float)
        assert abs(above.mean() - below.mean()) <= SIGMA * sqrt((above.var() + below.var()) / LANES)


# As in the original: shading from the centre


@PRECISIONS
@pytest.mark.parametrize("name", ["rectangle", "tilted disk, mixed", "sphere"])
def test_centre_lights_like_a_point_light(precision: str, name: str) -> None:
    """With nothing in the way: cosine, distance and highlight of the centre alone."""
    light, shiny = CASES[name].light, replace(WHITE, ks=(0.5, 0.5, 0.5), shininess=9.0)
    point = PointLight(position=light.position, a=light.a, b=light.b, c=light.c)
    settings = {"precision": precision, "area": "centre"}
    for objects in (None, {"floor": Plane(), "ball": Sphere(center=(0.0, 9.0, 0.0))}):
        found, hand = (at(scene_of({"l": l}, objects, shiny, **settings), (0.1, 0, 0.2), 50) for l in (light, point))
        assert (np.abs(found - hand) <= gamma(120, precision) * hand).all()


@PRECISIONS
@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("kt", [0.0, 0.25])
def test_centre_averages_the_shadow_of_all_samples(precision: str, share: float, kt: float) -> None:
    """A sheet hides a part of the light from the origin: what is left is that share of the point light in its middle,
    whether the middle itself is hidden or not.

    The light is 2 wide at the height 2, the sheet lies at 1 with its edge at x: it hides what is right of 2 x.
    """
    light = RectangleLight(position=(0.0, 2.0, 0.0), width=(2.0, 0, 0), height=(0, 0, 1.0), samples=64)
    edge = (2 * share - 1) / 2
    sheet = Rectangle(center=(edge + 50, 1.0, 0.0), width=(100.0, 0, 0), height=(0, 0, 100.0))
    m = replace(WHITE, kt=(kt, kt, kt))
    scene = scene_of({"l": light}, {"floor": Plane(), "sheet": sheet}, m, precision=precision, area="centre", depth=0)
    step = np.array([-0.5, 0.5, 0.0])  # From under the sheet's free side.
    found = seen(scene, step, np.tile(-step, (LANES, 1)))[:, 0].astype(float)
    left = share + (1 - share) * kt
    assert close(found, left, gamma(20, precision))
    # 64 strata: 8 columns, of which one at most is cut.
    assert found.std() > 0 or abs(share * 8 % 1) < 1e-9


# Many lights


def some_lights(rng: np.random.Generator, kind: type, size: float) -> dict:
    """Four lights of a kind that differ in all that they have; area lights are up to `size` wide."""

    def colour() -> tuple:
        return tuple(rng.uniform(0.1, 1, 3).tolist())

    made = {}
    for i in range(4):
        own: dict[str, Any] = {"Ia": colour(), "Id": colour(), "Is": colour(), "intensity": float(rng.uniform(0.5, 2))}
        place = tuple((rng.normal(size=3) * (3, 0.5, 3) + (0, 5, 0)).tolist())
        own["a"] = float(rng.uniform(0.5, 1))
        if kind.has_position:
            own |= {"position": place, "b": 0.1, "c": float(rng.uniform(0, 0.2))}
        if kind.has_area:
            own["samples"] = (3, 1, 16, 5)[i]
        own |= light_sample(kind.__name__).random(rng, size)
        made[f"l{i}"] = kind(**own)
    return made


GLOSSY = Material(ka=(0.2, 0.3, 0.4), kd=(0.5, 0.4, 0.3), ks=(0.3, 0.4, 0.5), shininess=9.0)
BETWEEN = {
    "floor": Plane(),
    "ball": Sphere(center=(0.5, 1.5, 0.0), radius=0.7),
    "box": Box(min=(-2.0, 0.0, -1.0), max=(-1.0, 1.5, 0.5)),
    "sheet": Rectangle(center=(0.0, 2.0, 1.5), width=(2.0, 0.3, 0.0), height=(0.0, 0.2, 1.0)),
}


def both_ways(scene: Scene, o: Any, d: Any, monkeypatch: pytest.MonkeyPatch) -> tuple[np.ndarray, np.ndarray]:
    """Colours with the lights written out, and looped over."""
    found = []
    for limit in (10**9, 0):
        monkeypatch.setattr(prepared_lights, "MAX_UNROLLED_PAIRS", limit)
        found.append(seen(scene, o, d).astype(float))
    return found[0], found[1]


@pytest.mark.parametrize("kt", [0.0, 0.5], ids=["opaque", "transparent"])
@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.__name__)
def test_lights_looped_over_are_those_written_out(kind: type, kt: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """At 3000 points behind, beside and on things. Area lights draw other samples: these are nearly points here.

    Written out, rays run from point lights; looped over, from the points they light: rounding decides at the edges of
    shadows alone, which no random point is at.
    """
    rng = np.random.default_rng(7)
    scene = scene_of(some_lights(rng, kind, TINY), BETWEEN, replace(GLOSSY, kt=(kt, kt, kt / 2)), depth=0)
    d = rng.normal(size=(3000, 3)) * (1, 0.5, 1) - (0, 1, 0)
    one, two = both_ways(scene, (0.5, 6.0, 4.0), d, monkeypatch)
    assert len(np.unique(one[:, 0])) > 1000
    # Where a light is TINY wide: its highlight and its distance are off by TINY times what they have of a slope; and an
    # edge is within TINY of its size of a point with a chance of some TINY: 3000 points by 4 lights.
    close = np.abs(one - two) <= (gamma(60, "single") + (100 * TINY if kind.has_area else 0)) * one
    assert (~close.all(1)).sum() <= (2 if kind.has_area else 0)


@pytest.mark.parametrize("kind", [k for k in KINDS if k.has_area], ids=lambda k: k.__name__)
def test_wide_lights_looped_over_have_the_means_of_those_written_out(
    kind: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each with its own size, samples and colours, half in shadow: at a few points, within the standard errors."""
    scene = scene_of(some_lights(np.random.default_rng(8), kind, 1.0), BETWEEN, replace(GLOSSY, ks=BLACK))
    for p in ((-0.5, 0.0, 1.0), (0.5, 0.0, 0.5), (2.0, 0.0, -1.0)):
        step = np.array([0.2, 0.05, 0.3])
        one, two = both_ways(scene, np.array(p) + step, np.tile(-step, (LANES, 1)), monkeypatch)
        error = np.sqrt((one.var(0) + two.var(0)) / LANES)
        assert (error > 0).all()
        assert (np.abs(one.mean(0) - two.mean(0)) <= SIGMA * error + gamma(40, "single") * one.mean(0)).all()


@pytest.mark.parametrize("looped", [False, True], ids=["written out", "looped over"])
def test_each_light_draws_samples_of_its_own(looped: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of four lights that are alike, the variance of the sum is four times that of one, not sixteen times."""
    monkeypatch.setattr(prepared_lights, "MAX_UNROLLED_PAIRS", 0 if looped else 10**9)
    light = DiskLight(position=(-0.4, 1.5, 0.7), radius=0.8, samples=3)
    four, one = (
        at(scene_of({f"l{i}": light for i in range(n)}, shadows=False), (0, 0, 0), LANES).var() for n in (4, 1)
    )
    # The variance of either is off by root 4 / n of itself, with the kurtosis of such light.
    assert abs(four / one / 4 - 1) < 2 * SIGMA * sqrt(4 / LANES)


def test_lights_are_looped_over_from_where_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """More than so many lights times objects, the first of them counted once more; a kind with one light never."""
    lights = {f"l{i}": PointLight(position=(float(i), 5.0, 0.0)) for i in range(5)}
    lights["one"] = small(SpotLight, (0.0, 4.0, 0.0))
    for limit, looped in ((6 * 3, 0), (6 * 3 - 1, 1)):
        monkeypatch.setattr(prepared_lights, "MAX_UNROLLED_PAIRS", limit)
        kernel = prepare(scene_of(lights, {"floor": Plane(), "ball": Sphere()})).kernel
        assert (len(kernel.looped_lights), len(kernel.lights)) == (looped, 1 if looped else 6)


# Ambient light


@pytest.mark.parametrize("looped", [False, True])
@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.__name__)
def test_ambient_light_of_each_kind_gets_everywhere(kind: type, looped: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sum of intensity Ia, neither weakened nor shadowed, in a closed box that no light gets into otherwise."""
    monkeypatch.setattr(prepared_lights, "MAX_UNROLLED_PAIRS", 0 if looped else 10**9)
    lights = some_lights(np.random.default_rng(9), kind, 1.0)
    objects = {"floor": Plane(), "box": Box(min=(-0.5, -0.5, -0.5), max=(0.5, 0.5, 0.5))}
    d = np.random.default_rng(10).normal(size=(100, 3))
    found = seen(scene_of(lights, objects, GLOSSY), (0.0, 0.1, 0.0), d)
    hand = sum(l.intensity * np.array(l.Ia) for l in lights.values()) * np.array(GLOSSY.ka)
    assert (np.abs(found - hand) <= gamma(12, "single") * hand).all()


# Lights in things and on things


def all_around(kind: type, p: tuple, **more: Any) -> Any:
    """A small light of a kind, which shines in all directions if the kind can."""
    return small(kind, p, **(light_sample(kind.__name__).all_around or {}) | more)


HOLLOW = {
    "ball": Sphere(center=(-6, 2, 0)),
    "box": Box(min=(-3, 1, -1), max=(-1, 3, 1)),
    "can": Cylinder(center=(2, 2, 0), radius=1.0),
    "hat": Cone(base=(6, 1, 0), radius=2.0, height=3.0),
}
MIDDLES = np.array([(-6, 2, 0), (-2, 2, 0), (2, 2, 0), (6, 2, 0)], float)


@PRECISIONS
@pytest.mark.parametrize("kind", SHINING_ALL_AROUND, ids=lambda k: k.__name__)
def test_a_light_in_a_thing_lights_its_inside_alone(precision: str, kind: type) -> None:
    """A light in each of four things on a floor: all of it is dark, and all of their insides are lit."""
    wide = {"samples": 16} if kind.has_area else {}
    wide |= {"radius": 0.2} if hasattr(kind, "radius") else {}
    lamps = {f"l{i}": all_around(kind, tuple((m + (0.2, 0.1, 0.1)).tolist()), **wide) for i, m in enumerate(MIDDLES)}
    scene, rng = scene_of(lamps, {"floor": Plane(), **HOLLOW}, precision=precision), np.random.default_rng(11)
    goal = np.c_[rng.uniform(-9, 9, (1000, 1)), np.zeros((1000, 1)), rng.uniform(-4, 4, (1000, 1))]
    assert (seen(scene, goal + (0.0, 0.9, 0.0), np.tile([0.0, -1, 0], (1000, 1))) == 0).all()
    for m in MIDDLES:
        assert (seen(scene, m, rng.normal(size=(500, 3)))[:, 0] > 0).all()


TURN = (Rotate(rotate=12.0, axis=(1.0, 0.3, 0.2)), Translate(translate=(0.1, 0.7, 0.3)))
# All of them flush with the plane y = 2.1.
CEILINGS = {
    "rectangle": Rectangle(center=(0.3, 2.1, 0.1), width=(6.0, 0.0, 0.0), height=(0.0, 0.0, 6.0)),
    "disk": Disk(center=(0.3, 2.1, 0.1), radius=4.0),
    "plane": Plane(point=(0.3, 2.1, 0.1)),
    "box": Box(min=(-3.3, 2.1, -3.1), max=(3.7, 2.7, 3.3)),
    "cylinder": Cylinder(center=(0.3, 2.6, 0.1), radius=4.0, height=1.0),
    "cone": Cone(base=(0.3, 2.1, 0.1), radius=4.0, height=1.0),
}
PANELS = {
    "point": PointLight(position=(0.3, 2.1, 0.1)),
    "spot": SpotLight(position=(-0.7, 2.1, 0.4), direction=(0.1, -1.0, 0.0), angle=85.0),
    "rectangle": RectangleLight(position=(0.3, 2.1, 0.1), width=(0.8, 0, 0), height=(0.1, 0, 0.7), samples=16),
    "disk": DiskLight(position=(1.3, 2.1, -0.6), radius=0.6, samples=16),
    "point 2": PointLight(position=(-1.1, 2.1, -0.7), intensity=0.5),
    "disk 2": DiskLight(position=(-1.3, 2.1, 0.6), radius=0.3, samples=4),
}


@PRECISIONS
@pytest.mark.parametrize(
    ("kt", "looped"), [(0.0, False), (0.25, False), (0.0, True)], ids=["opaque", "transparent", "lights looped over"]
)
def test_lights_flush_with_ceilings_light_the_room_as_if_they_hung_free(
    kt: float, looped: bool, precision: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six ceilings of all kinds in one plane, and lights in it: the picture of the floor is that without a ceiling.
    At no pixel does rounding put one of them before a light."""
    monkeypatch.setattr(prepared_lights, "MAX_UNROLLED_PAIRS", 0 if looped else 10**9)
    rng = np.random.default_rng(12)
    goal = np.c_[rng.uniform(-3, 3, (4000, 1)), np.zeros((4000, 1)), rng.uniform(-3, 3, (4000, 1))]
    o, m = np.array([0.5, 1.0, 2.5]), replace(WHITE, kt=(kt, kt, kt))
    with_them, without = (
        seen(scene_of(PANELS, {"floor": Plane(), **things}, m, precision=precision, depth=0), o, goal - o)
        for things in (CEILINGS, {})
    )
    assert (without > 0).all()
    assert (np.abs(with_them - without) <= gamma(20, precision) * without).all()


@PRECISIONS
def test_lights_flush_with_leaning_ceilings(precision: str) -> None:
    """All of it turned, so that no coordinate is a round number: each light is off its ceiling by a rounding."""
    rng, (frame, shift) = np.random.default_rng(13), outer(replace(CEILINGS["box"], transform=TURN))
    goal = np.c_[rng.uniform(-3, 3, (4000, 1)), np.full((4000, 1), -1.0), rng.uniform(-3, 3, (4000, 1))]
    o, lamps = np.array([0.5, 0.2, 2.5]), {}
    for name, lamp in PANELS.items():
        kept = {"position": frame @ np.array(lamp.position) + shift}
        for side in ("width", "height", "direction", "normal"):
            if hasattr(lamp, side):
                kept[side] = frame @ np.array(getattr(lamp, side))
        lamps[name] = replace(lamp, **{k: triple(v) for k, v in kept.items()})
    things = {name: replace(thing, transform=TURN) for name, thing in CEILINGS.items()}
    with_them, without = (
        seen(scene_of(lamps, {"floor": Plane(point=(0, -1, 0)), **t}, precision=precision), o, goal - o)
        for t in (things, {})
    )
    # All of the floor lies below the ceilings' plane, which cuts it nowhere near.
    assert (without > 0).mean() > 0.9
    assert (np.abs(with_them - without) <= gamma(20, precision) * without).all()


EDGES = {
    "edge": (Box(min=(-0.3, -0.4, -0.5), max=(0.3, 0.4, 0.7)), (0.3, 0.1, 0.7)),
    "lower edge": (Box(min=(-0.3, -0.4, -0.5), max=(0.3, 0.4, 0.7)), (-0.3, -0.4, 0.2)),
    "corner": (Box(min=(-0.3, -0.4, -0.5), max=(0.3, 0.4, 0.7)), (0.3, -0.4, 0.7)),
    "rim of a cylinder": (Cylinder(radius=0.5, height=0.8), (0.3, 0.4, 0.4)),
    "rim of a cone": (Cone(radius=0.5, height=0.8), (0.4, 0.0, -0.3)),
}


@PRECISIONS
@pytest.mark.parametrize("looped", [False, True], ids=["written out", "looped over"])
@pytest.mark.parametrize("turn", [(), TURN], ids=["upright", "turned"])
def test_a_light_on_an_edge_lights_all_that_the_thing_does_not_hide(
    turn: tuple, looped: bool, precision: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Point lights on an edge, a corner or a rim, where a surface has two normals: a ball all around is dark where the
    way from the light runs through the thing, by its twin, and lit elsewhere."""
    monkeypatch.setattr(prepared_lights, "MAX_UNROLLED_PAIRS", 0 if looped else 10**9)
    rng = np.random.default_rng(16)
    for thing, place in EDGES.values():
        thing = replace(thing, transform=turn)
        m, t = outer(thing)
        lamp = triple(m @ np.array(place) + t)
        lamps = {f"l{i}": PointLight(position=lamp, intensity=i + 1.0) for i in range(3)}
        d = unit(rng.normal(size=(1500, 3))).astype(float)
        objects = {"sky": Sphere(center=lamp, radius=8.0), "thing": thing}
        found = seen(scene_of(lamps, objects, precision=precision), np.array(lamp) + 7.99 * d, d)[:, 0]
        # Where the direction is turned by up to 1e-4, the answer is the same.
        moved = [unit(d + 1e-4 * v).astype(float) for v in np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])]
        twin, back = SAMPLES[type(thing).__name__].twin, inverse(m)
        with np.errstate(all="ignore"):
            ways = [twin.interval(thing, real(place), real(v) @ back.T, 0.0) for v in moved]
        hidden = np.array([(t0 <= t1) & (t1 > 1e-6) for t0, t1 in ways])
        sure = (hidden == hidden[0]).all(0)
        assert sure.mean() > 0.99 and 0.02 < hidden[0].mean() < 0.6
        hand = np.where(hidden[0], 0, 6)
        assert (np.abs(found - hand) <= gamma(20, precision) * hand)[sure].all()


@pytest.mark.slow
@PRECISIONS
def test_a_bulb_of_the_size_of_its_light_shines_with_the_half_that_is_seen(precision: str) -> None:
    """A sphere light on the very surface of a sphere: what faces the point is a cap of height r - r^2 / d, the share
    (1 - r/d) / 2 of the sphere; and its light is there, none of it hidden by rounding.

    Mean of cos / d^2 over the cap, by quadrature about the axis to the point; the floor below is level.
    """
    centre, radius = np.array([0.0, 2.1, 0.0]), 0.5
    t, w = gauss(400, radius / centre[1], 1)
    # At the polar angle with cosine t towards the point: the distance and the height above the floor.
    height = centre[1] - radius * t
    far = np.sqrt(radius**2 * (1 - t * t) + height**2)
    exact = float((w * height / far**3).sum() / 2)
    lamp = SphereLight(position=triple(centre), radius=radius, samples=64, c=1.0)
    things = {"floor": Plane(), "bulb": Sphere(center=triple(centre), radius=radius)}
    assert close(at(scene_of({"l": lamp}, things, precision=precision), (0, 0, 0), LANES), exact, gamma(30, precision))


@PRECISIONS
def test_lights_where_they_are_shaded_give_numbers(precision: str) -> None:
    """All kinds at the very point that is seen, on a floor, a ball, an edge and a corner; and closer to it than can be
    told. Point lights alone: tests/test_shading.py."""
    shiny = replace(WHITE, ks=(1.0, 1.0, 1.0), shininess=3.5)
    objects = {"floor": Plane(), "ball": Sphere(center=(0, 1, 0)), "box": Box(min=(2, 0, -1), max=(4, 2, 1))}
    rng = np.random.default_rng(14)
    for p in ((0, 0, 3), (0, 2, 0), (2, 0, 1), (2, 2, 1)):
        lamps = {kind.__name__: all_around(kind, tuple(map(float, p)), c=1.0) for kind in PLACED}
        o = np.array([0, 5, 9.0])
        near = np.array(p) + 10 ** rng.uniform(-20, -3, (80, 1)) * rng.normal(size=(80, 3))
        goal = np.vstack([np.repeat([p], 20, 0), near])
        found = seen(scene_of(lamps, objects, shiny, precision=precision), o, goal - o)
        assert np.isfinite(found).all() and (found >= 0).all()


# Where a light is wider than it is far away


@PRECISIONS
@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
def test_a_light_all_around_a_point_is_shadowed_from_all_sides(precision: str, kind: str) -> None:
    """The point is in the middle of nothing: of the light, parts lie in opposite directions from it. Balls all around
    hide what NumPy says they hide."""
    rng, n = np.random.default_rng(15), 400_000
    u, v = rng.uniform(size=(2, n))
    light, points = {
        "rectangle": (
            RectangleLight(position=(3.0, 0.5, 0.0), width=(10.0, 0, 0), height=(0, 0, 0.5), samples=64),
            np.stack([3 + 10 * (u - 0.5), 0.5 + 0 * u, 0.5 * (v - 0.5)], 1),
        ),
        "disk": (
            DiskLight(position=(2.0, 0.4, 1.0), radius=4.0, samples=64),
            (2, 0.4, 1) + 4 * np.sqrt(u)[:, None] * np.stack([np.cos(2 * pi * v), 0 * u, np.sin(2 * pi * v)], 1),
        ),
        "sphere": (
            SphereLight(position=(0.5, 1.0, -0.5), radius=2.0, samples=64),
            np.array([0.5, 1.0, -0.5]) + 2 * unit(rng.normal(size=(n, 3))).astype(float),
        ),
    }[kind]
    centres = np.array([(-1.0, 0.25, 0.0), (0.6, 0.3, 0.3), (0.2, 0.2, -0.8), (-0.3, 0.3, 0.6), (1.5, 0.3, 0.0)])
    balls = {f"b{i}": Sphere(center=triple(c), radius=0.2) for i, c in enumerate(centres)}
    d = np.linalg.norm(points, axis=1)
    along = np.clip(points @ centres.T / d[:, None], 0, d[:, None])
    aside = np.linalg.norm(centres - along[..., None] * (points / d[:, None])[:, None], axis=2)
    hidden = (aside < 0.2).any(1)
    each = np.where(~hidden & (points[:, 1] > 0), points[:, 1] / d, 0)
    found = seen(scene_of({"l": light}, {"floor": Plane(), **balls}, precision=precision), (0, 0.05, 0.01),
                 np.tile([0, -0.05, -0.01], (LANES, 1)))[:, 0].astype(float)  # fmt: skip
    assert 0.02 < hidden.mean() < 0.8
    error = sqrt(each.var() / n + found.var() / LANES)
    assert abs(found.mean() - each.mean()) <= SIGMA * error
