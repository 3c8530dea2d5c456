"""Derivatives of every effect against central differences in double, and of terms that are zero but have a slope.

Views without edges, in the manner and to the tolerance of tests/test_gradients.py: what several objects could hide is
warned of without being looked for, and no warning counts here; that the differences agree shows that there is none.
"""

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest
from PIL import Image as Pillow
from test_gradients import ROUNDING, parts
from test_paths import SIGMAS, plain

import visray as vr
from visray.geometry import gamma
from visray.passes import expose
from visray.setup import prepare

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
SKY = vr.SkyGradient(top=(0.1, 0.5, 1.0), bottom=(1.0, 0.75, 0.2))
PAINT = vr.Material(ka=(0.2, 0.1, 0.1), kd=(0.5, 0.2, 0.3), ks=(0.4, 0.5, 0.6), shininess=7.3)
GLASS = vr.Material(ka=(0.1, 0.2, 0.1), kd=(0.3, 0.2, 0.4), kt=(0.5, 0.7, 0.6), ior=1.4, dmax=5.0)
LAMP = vr.PointLight(position=(2.0, 3.0, 5.0), Ia=(0.1, 0.2, 0.3), a=0.5, b=0.1, c=0.02)


@pytest.fixture(autouse=True)
def unwarned():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vr.EdgeWarning)
        yield


def scene_of(**fields: Any) -> vr.Scene:
    """A small picture in double; settings are named with the fields of the scene."""
    settings = {k: fields.pop(k) for k in list(fields) if k in vr.Settings.__dataclass_fields__}
    whole = {
        "film": vr.Film(width=12, height=8),
        "background": SKY,
        "lights": {"key": LAMP},
        "camera": vr.Camera(),
    } | fields
    return vr.Scene(settings=vr.Settings(**{"spp": 4, "precision": "double", "seed": 3} | settings), **whole)


@dataclass(frozen=True)
class Case:
    """A scene, and the addresses whose derivatives are compared: so many of them in forward mode as well, each of
    which is a kernel of its own."""

    scene: vr.Scene
    addresses: tuple[str, ...]
    forward: int = 1


def look(at: tuple, origin: tuple = (0.0, 0.3, 4.0), fov: float = 8.0, **lens: float) -> vr.Camera:
    return vr.Camera(origin=origin, target=at, fov=fov, **lens)


BALL = vr.Sphere(center=(0.1, 0.0, -0.2), radius=1.1, material="paint")
MIRROR = vr.Plane(point=(0.0, 0.0, -3.0), normal=(0.1, 0.05, 1.0), material="mirror")
CASES = {
    "lights that are far or aimed": Case(
        scene_of(
            camera=look((0.0, 0.1, 0.0)), objects={"ball": BALL}, materials={"paint": PAINT},
            lights={"sun": vr.DirectionalLight(direction=(-0.4, -0.7, -1.0), a=2.0),
                    "spot": vr.SpotLight(position=(1.0, 1.5, 4.0), direction=(-0.3, -0.4, -1.2), angle=40.0,
                                         exponent=2.5, a=1.0, c=0.1)},
        ),
        ("lights.sun.direction", "lights.sun.a", "lights.spot.position", "lights.spot.direction", "lights.spot.angle",
         "lights.spot.exponent", "lights.spot.c", "lights.spot.Is", "objects.ball.center"),
    ),
    "lights with an extent": Case(
        scene_of(
            camera=look((0.0, 0.1, 0.0)), objects={"ball": BALL}, materials={"paint": PAINT},
            lights={"pane": vr.RectangleLight(position=(1.0, 2.0, 4.0), width=(1.0, 0.2, 0.0), height=(0.0, 0.3, 0.8),
                                              samples=2, c=0.05),
                    "disk": vr.DiskLight(position=(-1.0, 2.0, 4.0), normal=(0.3, -1.0, -0.5), radius=0.7, samples=2),
                    "globe": vr.SphereLight(position=(0.5, -1.0, 5.0), radius=0.6, samples=2, a=1.5)},
        ),
        ("lights.pane.position", "lights.pane.width", "lights.pane.height", "lights.disk.position",
         "lights.disk.normal", "lights.disk.radius", "lights.globe.position", "lights.globe.radius",
         "lights.globe.Id"),
    ),
    "lights with an extent from their centre": Case(
        scene_of(
            camera=look((0.0, 0.1, 0.0)), objects={"ball": BALL}, materials={"paint": PAINT}, area="centre",
            lights={"pane": vr.RectangleLight(position=(1.0, 2.0, 4.0), samples=3, c=0.05)},
        ),
        ("lights.pane.position", "lights.pane.c", "objects.ball.radius"),
    ),
    "a ball in a mirror": Case(
        scene_of(
            camera=look((0.3, 0.2, -3.0), fov=5.0), depth=1, misses="ambient",
            objects={"ball": vr.Sphere(center=(1.5, 1.0, 6.0), radius=1.8, material="paint"), "mirror": MIRROR},
            materials={"paint": PAINT, "mirror": replace(PAINT, kr=(0.8, 0.6, 0.7))},
            lights={"key": replace(LAMP, position=(3.0, 3.0, -2.0))},
        ),
        ("materials.mirror.kr", "materials.mirror.kd", "materials.paint.kd", "objects.ball.center",
         "objects.ball.radius", "objects.mirror.point", "objects.mirror.normal", "lights.key.position",
         "camera.origin", "camera.fov"),
    ),
    "the sky in a mirrored ball": Case(
        scene_of(camera=look((0.0, 0.1, 0.0)), objects={"ball": replace(BALL, material="mirror")}, depth=2,
                 materials={"mirror": plain(kr=(0.8, 0.6, 0.7))}, lights={}),
        ("background.top", "background.bottom", "materials.mirror.kr", "objects.ball.center", "objects.ball.radius",
         "camera.target"),
    ),
    "the sky through a ball of glass": Case(
        scene_of(camera=look((0.2, 0.15, 0.0)), objects={"ball": replace(BALL, material="glass")}, depth=2,
                 materials={"glass": GLASS}),
        ("materials.glass.kt", "materials.glass.ior", "materials.glass.kd", "materials.glass.dmax",
         "objects.ball.center", "objects.ball.radius", "background.top", "camera.origin", "lights.key.position"),
    ),
    "a wall through a slab": Case(
        scene_of(
            camera=look((0.4, 0.3, 0.0), origin=(1.5, 1.3, 4.0)), depth=2,
            objects={"slab": vr.Box(min=(-4.0, -4.0, 0.0), max=(4.0, 4.0, 0.7), material="glass"),
                     "wall": vr.Plane(point=(0.0, 0.0, -3.0), normal=(0.1, 0.2, 1.0), material="paint")},
            materials={"paint": PAINT, "glass": replace(GLASS, kd=BLACK)},
            lights={"key": replace(LAMP, position=(0.5, 1.0, -1.0))},
        ),
        ("materials.glass.kt", "materials.glass.ior", "objects.slab.min", "objects.slab.max", "objects.wall.point",
         "objects.wall.normal", "camera.origin", "lights.key.position"),
    ),
    "balls of glass in each other": Case(
        scene_of(
            camera=look((0.2, 0.1, 0.0), fov=6.0), depth=4, lights={},
            objects={"outer": replace(BALL, material="glass"),
                     "inner": vr.Sphere(center=(0.2, 0.1, -0.3), radius=0.5, material="water")},
            materials={"glass": plain(kt=(0.5, 0.7, 0.6), ior=1.5), "water": plain(kt=(0.9, 0.8, 0.7), ior=1.2)},
        ),
        ("materials.glass.ior", "materials.water.ior", "materials.water.kt", "objects.inner.center",
         "objects.inner.radius", "objects.outer.radius", "background.bottom"),
    ),
    "what is reflected and what is refracted, by geometry": Case(
        scene_of(camera=look((0.2, 0.15, 0.0)), objects={"ball": replace(BALL, material="glass")}, depth=2, lights={},
                 materials={"glass": replace(GLASS, kr=(0.3, 0.2, 0.1))}),
        ("materials.glass.ior", "objects.ball.radius", "objects.ball.center", "background.top", "camera.origin"),
    ),
    "a room of one ball, by scattered light": Case(
        scene_of(
            camera=look((0.0, 0.1, -2.0), origin=(0.3, 0.2, 0.5), fov=20.0),
            objects={"room": vr.Sphere(center=(0.1, 0.0, -0.2), radius=2.5, material="paint")},
            materials={"paint": PAINT}, lights={"key": replace(LAMP, position=(0.7, 0.5, -0.4))},
            scatter=vr.Scatter(rays=2, depth=2), depth=0,
        ),
        ("materials.paint.kd", "materials.paint.ks", "lights.key.position", "objects.room.radius",
         "objects.room.center", "ambient", "camera.origin"),
    ),
    "a floor under a ball, by scattered light": Case(
        scene_of(
            camera=look((0.0, -1.0, 1.0), origin=(0.0, 1.0, 4.0)), scatter=vr.Scatter(rays=2, depth=1), depth=0,
            objects={"floor": vr.Plane(point=(0.0, -1.0, 0.0), material="floor"), "ball": BALL},
            materials={"paint": PAINT, "floor": replace(PAINT, kd=(0.6, 0.7, 0.8))},
        ),
        ("materials.floor.kd", "materials.paint.kd", "materials.paint.ka", "background.top", "lights.key.intensity"),
    ),
    "near occlusion in a room of one ball": Case(
        scene_of(
            camera=look((0.0, 0.1, -2.0), origin=(0.3, 0.2, 0.5), fov=20.0),
            objects={"room": vr.Sphere(center=(0.1, 0.0, -0.2), radius=1.5, material="paint")},
            materials={"paint": PAINT}, lights={"key": replace(LAMP, position=(0.7, 0.5, -0.4))},
            occlusion=vr.Occlusion(near=3, distance=3.5),
        ),
        ("settings.occlusion.distance", "objects.room.radius", "objects.room.center", "lights.key.Ia",
         "lights.key.intensity", "materials.paint.ka", "camera.origin"),
    ),
    "occlusion on a floor under a ball": Case(
        scene_of(
            camera=look((0.0, -1.0, 1.0), origin=(0.0, 1.0, 4.0)),
            objects={"floor": vr.Plane(point=(0.0, -1.2, 0.0), material="paint"), "ball": BALL},
            materials={"paint": PAINT}, occlusion=vr.Occlusion(sky=3, near=3, distance=0.8),
        ),
        ("settings.occlusion.distance", "lights.key.Ia", "ambient", "materials.paint.ka"),
    ),
    "a thin lens": Case(
        scene_of(camera=look((0.0, 0.1, 0.0), aperture=0.1, focus=2.0), objects={"ball": BALL},
                 materials={"paint": PAINT}),
        ("camera.aperture", "camera.focus", "camera.origin", "camera.target", "camera.up", "camera.fov",
         "objects.ball.radius", "lights.key.position"), 6,
    ),
    "a thin lens focused on its target": Case(
        scene_of(camera=look((0.0, 0.1, 0.0), aperture=0.1), objects={"ball": BALL}, materials={"paint": PAINT}),
        ("camera.aperture", "camera.origin", "camera.target"), 3,
    ),
    "the shadow of glass": Case(
        scene_of(
            camera=look((0.2, -1.0, 0.0), origin=(3.0, 1.0, 5.0), fov=3.0), depth=1,
            objects={"floor": vr.Plane(point=(0.0, -1.0, 0.0), material="paint"),
                     "ball": vr.Sphere(center=(0.2, 1.5, 0.0), radius=0.8, material="glass")},
            materials={"paint": PAINT, "glass": GLASS},
            lights={"key": replace(LAMP, position=(0.3, 4.0, 0.1)),
                    "sun": vr.DirectionalLight(direction=(0.05, -1.0, -0.04), intensity=0.4),
                    "pane": vr.RectangleLight(position=(0.1, 4.5, 0.0), width=(0.2, 0.0, 0.0), height=(0.0, 0.1, 0.2),
                                              samples=2)},
        ),
        ("materials.glass.kt", "materials.glass.dmax", "objects.ball.radius", "objects.ball.center",
         "objects.floor.point", "lights.key.position", "lights.sun.direction", "lights.pane.position",
         "lights.pane.width", "camera.origin"),
    ),
    "a ball with a coat": Case(
        scene_of(camera=look((0.2, 0.15, 0.0)), objects={"ball": replace(BALL, material="coat")}, depth=2,
                 materials={"coat": replace(PAINT, kr=(0.8, 0.9, 0.7), ior=1.6, fresnel="dielectric")}),
        ("materials.coat.ior", "materials.coat.kr", "materials.coat.kd", "objects.ball.center", "objects.ball.radius",
         "background.top", "camera.origin"),
    ),
    "a ball of metal": Case(
        scene_of(camera=look((0.6, 0.4, 0.0)), objects={"ball": replace(BALL, material="gold")}, depth=2,
                 materials={"gold": replace(PAINT, kr=(0.8, 0.6, 0.3), fresnel="metal")}),
        ("materials.gold.kr", "materials.gold.kd", "objects.ball.center", "objects.ball.radius", "camera.origin"),
    ),
    "what passes through a ball by the angle": Case(
        scene_of(camera=look((0.2, 0.15, 0.0)), objects={"ball": replace(BALL, material="glass")}, depth=2, lights={},
                 materials={"glass": replace(GLASS, fresnel="dielectric", absorption=(0.1, 0.3, 0.2))}),
        ("materials.glass.ior", "materials.glass.absorption", "materials.glass.kt", "materials.glass.ka",
         "objects.ball.center", "objects.ball.radius", "camera.origin"), 2,
    ),
    "balls that absorb in each other": Case(
        scene_of(
            camera=look((0.2, 0.1, 0.0), fov=6.0), depth=4, lights={},
            objects={"outer": replace(BALL, material="glass"),
                     "inner": vr.Sphere(center=(0.2, 0.1, -0.3), radius=0.5, material="water")},
            materials={"glass": plain(kt=(0.5, 0.7, 0.6), ior=1.5, absorption=(0.0, 0.3, 0.2)),
                       "water": plain(kt=(0.9, 0.8, 0.7), ior=1.2, fresnel="dielectric", absorption=(0.5, 0.1, 0.3))},
        ),
        ("materials.glass.absorption", "materials.water.absorption", "materials.water.ior", "materials.glass.ior",
         "objects.inner.center", "objects.inner.radius", "objects.outer.radius"),
    ),
    "the shadow of a ball that absorbs": Case(
        scene_of(
            camera=look((0.2, -1.0, 0.0), origin=(3.0, 1.0, 5.0), fov=3.0), depth=1,
            objects={"floor": vr.Plane(point=(0.0, -1.0, 0.0), material="paint"),
                     "ball": vr.Sphere(center=(0.2, 1.5, 0.0), radius=0.8, material="glass")},
            materials={"paint": PAINT, "glass": replace(GLASS, absorption=(0.1, 0.3, 0.2))},
            lights={"key": replace(LAMP, position=(0.3, 4.0, 0.1)),
                    "within": replace(LAMP, position=(0.2, 1.4, 0.1)),
                    "sun": vr.DirectionalLight(direction=(0.05, -1.0, -0.04), intensity=0.4)},
        ),
        ("materials.glass.absorption", "materials.glass.kt", "objects.ball.radius", "objects.ball.center",
         "objects.floor.point", "lights.key.position", "lights.within.position", "lights.sun.direction"),
    ),
}  # fmt: skip


def attached(scene: vr.Scene, addresses: tuple[str, ...]) -> tuple[dict[str, Any], np.ndarray]:
    """The derivatives of the mean, and the picture that they were taken of. Shape: (3, H W)."""
    kept = []

    def loss(rgb: Any) -> Any:
        kept.append(np.array(dr.detach(rgb)))
        return dr.mean(rgb.x + rgb.y + rgb.z) / 3

    return vr.gradient(scene, addresses, loss), kept[0]


def picture(scene: vr.Scene) -> np.ndarray:
    """The ordinary picture, as the loss sees the other one. Shape: (3, H W)."""
    made = prepare(scene)
    mean = np.array(expose(made)[0].mean)
    rows = np.empty_like(mean)
    rows[:, made.order] = mean
    return rows


def compare(case: Case) -> None:
    scene = case.scene
    found, seen = attached(scene, case.addresses)
    ordinary = picture(scene)
    # Written out instead of looped over, and found by branches instead of selections: the same but for rounding, of a
    # few hundred operations on ways that glass makes diverge ten times at most.
    assert np.abs(seen - ordinary).max() <= 10 * gamma(300) * np.abs(ordinary).max()
    for address in case.addresses:
        truths = [vr.difference(scene, part) for part in parts(scene, address)]
        assert max(np.abs(t).max() for t in truths) > 1e-5, f"{address} changes nothing"
        for value, truth in zip(np.ravel(found[address]), truths):
            assert abs(value - truth.mean()) <= ROUNDING * max(1.0, abs(truth.mean())), address
        if address in case.addresses[: case.forward]:
            number = int(np.argmax([np.abs(t).max() for t in truths]))
            slope = vr.derivative(scene, parts(scene, address)[number])
            # Pixel by pixel: the sum of a pixel's terms, not of the picture's.
            assert np.abs(slope - truths[number]).max() <= 10 * ROUNDING * max(1.0, np.abs(truths[number]).max()), (
                address
            )


@pytest.mark.parametrize("name", CASES)
@pytest.mark.slow
def test_forward_and_reverse_equal_central_differences(name: str) -> None:
    compare(CASES[name])


def test_a_blended_texture_has_the_slopes_of_its_blends(tmp_path: Path) -> None:
    """A picture of random pixels on a wall and, by what it scatters, in front of it; the camera and the wall move."""
    pixels = np.random.default_rng(1).integers(0, 256, (9, 7, 3), np.uint8)
    Pillow.fromarray(pixels).save(tmp_path / "t.png")
    wall = vr.Plane(point=(0.0, 0.0, -3.0), normal=(0.1, 0.2, 1.0), material="paint")
    scene = scene_of(
        camera=look((0.4, 0.3, 0.0), fov=30.0), objects={"wall": wall},
        materials={"paint": replace(PAINT, texture="t")},
        textures={"t": vr.ImageTexture(file=str(tmp_path / "t.png"), scale=(0.7, 0.6))},
        scatter=vr.Scatter(rays=1), depth=0,
    )  # fmt: skip
    compare(Case(scene, ("camera.origin", "objects.wall.normal", "objects.wall.point", "camera.fov", "camera.target")))


# Chance: where a surface reflects and lets through, one is drawn, and derivatives are right in the mean


def sheet(kr: tuple, kt: tuple) -> vr.Scene:
    """A sheet between sky and ground, that fills the picture and looks the same all over."""
    camera = vr.Camera(origin=(0.0, 1e6, 1e6), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=0.01)
    glass = vr.Material(ka=(0.5, 0.25, 1.0), kd=BLACK, kr=kr, kt=kt)
    return scene_of(camera=camera, objects={"sheet": vr.Plane(material="m")}, materials={"m": glass}, lights={},
                    depth=1, ambient=(0.5, 0.5, 0.5), film=vr.Film(width=64, height=64), spp=64)  # fmt: skip


@pytest.mark.parametrize(
    ("kr", "kt", "chance"),
    [
        ((0.3, 0.1, 0.05), (0.2, 0.6, 0.4), 0.6 / 0.9),
        # A way of strength 0 whose slope is asked for is drawn as if it were of strength 1.
        (BLACK, (0.2, 0.5, 0.4), 0.5 / 1.5),
        ((0.3, 0.1, 0.25), BLACK, 1 / 1.3),
    ],
)
def test_shares_that_are_drawn_have_their_slopes_in_the_mean(kr: tuple, kt: tuple, chance: float) -> None:
    """d/dkr is the sky above, and d/dkt the ground below less the sheet's own colour.

    A slope is drawn with its way: a mean of numbers x / p with chance p, else 0, which is off by x root((1 - p) / p N).
    """
    scene = sheet(kr, kt)
    up = 0.5 + 0.5 * np.sqrt(0.5)
    top, bottom = np.array(SKY.top), np.array(SKY.bottom)
    above, below = up * top + (1 - up) * bottom, (1 - up) * top + up * bottom
    own = 0.5 * np.array([0.5, 0.25, 1.0])
    found = vr.gradient(scene, ["materials.m.kr", "materials.m.kt", "background.top", "materials.m.ka"])
    noise = SIGMAS / np.sqrt(64 * 64 * 64)
    r, t = 1 - chance, chance
    # The mean over pixels and channels: a third of each. Across the view the sky changes by 1e-4.
    assert (np.abs(3 * found["materials.m.kr"] - above) <= above * noise * np.sqrt((1 - r) / r) + 1e-4).all()
    assert (np.abs(3 * found["materials.m.kt"] - (below - own)) <= below * noise * np.sqrt((1 - t) / t) + 1e-4).all()
    sky = np.array(kr) * up + np.array(kt) * (1 - up)
    spread = np.array(kr) * up / r - np.array(kt) * (1 - up) / t
    assert (np.abs(3 * found["background.top"] - sky) <= np.abs(spread) * noise * np.sqrt(r * t) + 1e-4).all()
    # A sum over all samples.
    assert (np.abs(3 * found["materials.m.ka"] - 0.5 * (1 - np.array(kt))) <= gamma(64 * 64 * 64)).all()


# Terms that are zero, and whose slopes are not


def slope_at_0(scene: vr.Scene, address: str) -> tuple[np.ndarray, float]:
    """The slope of every pixel as the numbers at an address grow from 0, and the bound of its error.

    One-sided, from steps h and h / 2: exact for what is a polynomial of degree 2, and off by h^2 of a third derivative
    where light is tinted three times. Pixels and their terms are below 4.
    """
    h = 1e-3
    size = np.size(vr.value(scene, address))

    def at(x: float) -> np.ndarray:
        return picture(vr.replaced(scene, address, x if size == 1 else (x,) * size))

    zero, half, whole = at(0.0), at(h / 2), at(h)
    return 2 * (half - zero) / (h / 2) - (whole - zero) / h, 4 * h * h + 4 * gamma(1000) / h


TOWER = {"ball": replace(BALL, material="paint"), "floor": vr.Plane(point=(0.0, -1.1, 0.0), material="floor")}
DULL = {"paint": PAINT, "floor": vr.Material(ka=(0.3, 0.3, 0.3), kd=(0.4, 0.5, 0.6))}
TRAPS = {
    "kr of a ball": (
        scene_of(camera=look((0.0, 0.1, 0.0), fov=20.0), objects=TOWER, materials=DULL, depth=1),
        "materials.paint.kr",
    ),
    "kr of a ball, on a transparent film": (
        scene_of(camera=look((0.0, 0.1, 0.0), fov=20.0), objects={"ball": BALL}, materials=DULL, depth=1,
                 film=vr.Film(width=12, height=8, transparent=True)),
        "materials.paint.kr",
    ),
    "kr of what a mirror shows": (
        scene_of(camera=look((0.0, 0.1, 0.0), fov=20.0), objects=TOWER, depth=2,
                 materials=DULL | {"paint": replace(PAINT, kr=(0.5, 0.6, 0.7))}),
        "materials.floor.kr",
    ),
    "kt of a ball": (
        scene_of(camera=look((0.0, 0.1, 0.0), fov=20.0), objects={"ball": BALL}, materials=DULL, depth=2),
        "materials.paint.kt",
    ),
    "kt of what throws a shadow": (
        scene_of(camera=look((0.1, -2.0, -0.2), origin=(3.0, 1.0, 5.0), fov=3.0), depth=0, materials=DULL,
                 objects=TOWER | {"floor": vr.Plane(point=(0.0, -2.0, 0.0), material="floor")},
                 lights={"key": replace(LAMP, position=(0.3, 4.0, 0.1))}),
        "materials.paint.kt",
    ),
    "the sky in a mirror": (
        scene_of(camera=look((0.0, 0.1, 0.0)), objects={"ball": BALL}, background=BLACK, depth=1,
                 materials={"paint": replace(PAINT, kr=(0.5, 0.6, 0.7))}),
        "background",
    ),
    "ambient light that a ray finds which misses": (
        scene_of(camera=look((0.0, 0.1, 0.0)), objects={"ball": BALL}, ambient=BLACK, depth=1, misses="ambient",
                 materials={"paint": replace(PAINT, kr=(0.5, 0.6, 0.7), ka=BLACK)}),
        "ambient",
    ),
    "Ia with near occlusion": (
        scene_of(camera=look((0.0, -1.0, 1.0), origin=(0.0, 1.0, 4.0)), objects=TOWER, materials=DULL,
                 lights={"key": replace(LAMP, Ia=BLACK)}, occlusion=vr.Occlusion(near=3)),
        "lights.key.Ia",
    ),
    "ambient light with sky occlusion": (
        scene_of(camera=look((0.0, -1.0, 1.0), origin=(0.0, 1.0, 4.0)), objects=TOWER, materials=DULL, ambient=BLACK,
                 occlusion=vr.Occlusion(sky=3)),
        "ambient",
    ),
    "kd of what scatters": (
        scene_of(camera=look((0.0, -1.0, 1.0), origin=(0.0, 1.0, 4.0)), objects=TOWER, depth=0,
                 scatter=vr.Scatter(rays=2), materials={name: replace(m, kd=BLACK) for name, m in DULL.items()}),
        "materials.floor.kd",
    ),
    "kd of what scatters, on a transparent film": (
        scene_of(camera=look((0.0, 0.1, 0.0)), objects={"ball": BALL}, depth=0, scatter=vr.Scatter(rays=1),
                 film=vr.Film(width=12, height=8, transparent=True), materials={"paint": replace(PAINT, kd=BLACK)}),
        "materials.paint.kd",
    ),
    "kr of what is black beside what scatters": (
        scene_of(camera=look((0.0, 0.1, 0.0), fov=20.0), objects=TOWER, depth=1, scatter=vr.Scatter(rays=1),
                 materials=DULL | {"paint": replace(PAINT, kd=BLACK)}),
        "materials.paint.kr",
    ),
    "the intensity of a light whose shadow is coloured": (
        scene_of(camera=look((0.1, -2.0, -0.2), origin=(3.0, 1.0, 5.0), fov=3.0), depth=0,
                 materials=DULL | {"paint": replace(PAINT, kt=(0.5, 0.6, 0.7))},
                 objects=TOWER | {"floor": vr.Plane(point=(0.0, -2.0, 0.0), material="floor")},
                 lights={"key": replace(LAMP, position=(0.3, 4.0, 0.1), intensity=0.0)}),
        "lights.key.intensity",
    ),
    "the width of the lens": (
        scene_of(camera=look((0.0, 0.1, 0.0), focus=2.0), objects={"ball": BALL}, materials=DULL),
        "camera.aperture",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TRAPS)
def test_a_term_that_is_zero_keeps_its_slope(name: str) -> None:
    scene, address = TRAPS[name]
    truth, slack = slope_at_0(scene, address)
    assert np.abs(truth).max() > 0.01
    found, seen = attached(scene, (address,))
    assert np.abs(seen - picture(scene)).max() <= gamma(1000) * 4
    numbers = np.ravel(found[address])
    # Each number of the address is a channel of its own, whose mean over channels is a third.
    expected = truth.mean(1) / 3 if numbers.size == 3 else [truth.mean()]
    assert (np.abs(numbers - expected) <= slack).all()


def test_what_is_matte_scatters_whatever_is_asked_for() -> None:
    """The slope by kd of a floor that scatters does not depend on whether that of a mirror's kr is asked for as well.

    Its own kr is 0 and so has no slope: with any of it the floor would not scatter.
    """
    scene = scene_of(
        camera=look((0.0, -1.0, 1.0), origin=(0.0, 1.0, 4.0), fov=30.0), objects=TOWER, depth=1,
        scatter=vr.Scatter(rays=1), materials=DULL | {"paint": replace(PAINT, kr=(0.5, 0.6, 0.7))},
    )  # fmt: skip
    alone, first = attached(scene, ("materials.floor.kd",))
    beside, second = attached(scene, ("materials.floor.kd", "materials.paint.kr"))
    assert np.abs(first - second).max() <= gamma(1000) * 4
    assert np.abs(alone["materials.floor.kd"] - beside["materials.floor.kd"]).max() <= gamma(1000) * 4
    assert min(alone["materials.floor.kd"]) > 0.1
    # By paint's kr: as without scattering on the ball, where it is linear.
    truth = vr.difference(scene, "materials.paint.kr").mean()
    assert abs(np.sum(beside["materials.paint.kr"]) - truth) <= ROUNDING


# Warnings of what is left out

FLOOR = vr.Plane(point=(0.0, -1.0, 0.0), material="floor")
DOWN = vr.Camera(origin=(0.0, 1.0, 3.0), target=(0.0, -1.0, -0.5), fov=30.0)
HIDDEN = vr.Sphere(center=(0.8, 0.6, 1.7), radius=0.2, material="paint")


def warned(scene: vr.Scene, address: str) -> str:
    """What a derivative warns of, or nothing."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        vr.derivative(scene, address)
    return " ".join(str(w.message) for w in found)


WARNINGS = {
    "a coloured shadow": (
        scene_of(camera=DOWN, objects={"floor": FLOOR, "ball": HIDDEN}, depth=0,
                 materials=DULL | {"paint": replace(PAINT, kt=(0.5, 0.5, 0.5))},
                 lights={"key": replace(LAMP, position=(2.0, 3.0, 5.0))}),
        "objects.ball.center.0", "shadow edges",
    ),
    "a shadow of the sun": (
        scene_of(camera=DOWN, objects={"floor": FLOOR, "ball": HIDDEN}, materials=DULL,
                 lights={"sun": vr.DirectionalLight(direction=(-1.2, -2.4, -3.3))}),
        "lights.sun.direction.0", "shadow edges",
    ),
    "a spot's cone": (
        scene_of(camera=DOWN, objects={"floor": FLOOR}, materials=DULL,
                 lights={"spot": vr.SpotLight(position=(0.0, 3.0, -0.5), direction=(0.0, -1.0, 0.0), angle=8.0)}),
        "lights.spot.angle", "shadow edges",
    ),
    "a penumbra": (
        scene_of(camera=DOWN, objects={"floor": FLOOR, "ball": HIDDEN}, materials=DULL,
                 lights={"pane": vr.RectangleLight(position=(2.0, 3.0, 5.0), samples=2)}),
        "lights.pane.width", "penumbras",
    ),
    "what is behind glass": (
        scene_of(camera=look((0.0, 0.1, 0.0)), objects={"ball": BALL, "far": vr.Sphere(center=(0.0, 0.0, -5.0))},
                 materials={"paint": plain(kt=WHITE)}, depth=2),
        "materials.paint.ior", "refractions",
    ),
    "the edge of a square": (
        scene_of(camera=DOWN, objects={"floor": FLOOR}, materials={"floor": vr.Material(texture="t")},
                 textures={"t": vr.CheckerTexture()}),
        "camera.origin.0", "texture",
    ),
    "the step of a cartoon": (
        scene_of(camera=look((0.0, 0.1, 0.0)), objects={"ball": BALL}, materials={"paint": PAINT}, shading="toon"),
        "lights.key.position.0", "cartoon",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WARNINGS)
def test_edges_that_move_are_warned_of(name: str) -> None:
    """Each is one: a difference over a step that it crosses a sample in is far from the derivative."""
    scene, address, what = WARNINGS[name]
    scene = replace(scene, film=vr.Film(width=36, height=24), settings=replace(scene.settings, spp=16))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        slope = vr.derivative(scene, address)
    assert np.abs(vr.difference(scene, address, 1e-2) - slope).max() > 0.1
    assert what in warned(scene, address)


@pytest.mark.parametrize(
    "address", ["materials.paint.kt", "materials.paint.dmax", "lights.key.intensity", "background.top", "ambient"]
)
def test_what_moves_nothing_warns_of_nothing(address: str) -> None:
    scene, *_ = WARNINGS["a coloured shadow"]
    assert not warned(scene, address)
