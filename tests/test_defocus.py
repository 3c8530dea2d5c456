"""The thin lens: sharp at its distance, a circle of confusion elsewhere, and the pinhole where it has no width."""

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from samples import array
from test_paths import BLACK, PRECISIONS, SIGMAS, WHITE, plain, scene_of, unit
from test_render import SHOW

from visray import integrator
from visray.camera import Camera
from visray.features import features
from visray.geometry import gamma
from visray.passes import expose
from visray.primitives import Plane, Sphere
from visray.scene.scene import Film, Scene, Settings
from visray.setup import prepare

CAMERA = Camera(origin=(0.5, 2.0, 6.0), target=(0.0, 0.5, -1.0), up=(0.1, 1.0, 0.0), fov=40.0, aperture=0.8, focus=5.0)


def film_of(scene: Scene, **more: Any) -> np.ndarray:
    """The picture by rows. Shape: (H, W, 3)."""
    made = prepare(scene, **more)
    mean = np.array(expose(made)[0].mean).T
    picture = np.empty_like(mean)
    picture[made.order] = mean
    return picture.reshape(scene.film.height, scene.film.width, 3)


def lens_rays(
    camera: Camera, x: Any, y: Any, u: Any, v: Any, precision: str = "double"
) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions of the rays for points of the picture and points of the unit square. Shapes: (N, 3)."""
    made = prepare(
        Scene(camera=camera, film=Film(width=30, height=20), settings=Settings(precision=precision), lights={})
    )
    n = np.broadcast(x, y, u, v).size
    x, y, u, v = (made.a.put(made.a.F, np.array(np.broadcast_to(w, n), float)) for w in (x, y, u, v))
    ray = integrator.lens_ray(made.kernel, x, y, u, v)
    dr.eval(ray)
    return array(ray.o), array(ray.d)


def axes(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forward, right and up."""
    forward = unit(np.subtract(camera.target, camera.origin))
    right = unit(np.cross(forward, camera.up))
    return forward, right, np.cross(right, forward)


@PRECISIONS
def test_a_lens_without_width_is_the_pinhole_bit_for_bit(precision: str) -> None:
    """Called into the kernel of a scene of five kinds and two lights by a derivative, whatever the focus."""
    for focus in (0.0, 0.01, 1e6):
        scene = replace(SHOW, camera=replace(SHOW.camera, focus=focus), settings=Settings(spp=3, precision=precision))
        assert features(scene, ("camera.aperture",))["defocus"] and not features(scene)["defocus"]
        assert film_of(scene).tobytes() == film_of(scene, wrt=("camera.aperture",)).tobytes()
    # And the rays themselves.
    made = prepare(replace(SHOW, settings=Settings(precision=precision)))
    rng = np.random.default_rng(1)
    x, y, u, v = (made.a.F(rng.uniform(0, 16, 1000)) for _ in range(4))
    thin, point = integrator.lens_ray(made.kernel, x, y, u / 16, v / 16), integrator.camera_ray(made.kernel, x, y)
    assert np.array_equal(array(thin.d), array(point.d))
    assert np.array_equal(array(thin.o), np.broadcast_to(array(point.o), array(thin.o).shape))


@PRECISIONS
@pytest.mark.parametrize("focus", [0.0, 0.5, 5.0, 300.0])
def test_rays_through_one_point_of_the_picture_meet_in_the_plane_of_focus(precision: str, focus: float) -> None:
    """At the distance `focus` along the view; 0 stands for the target's. They meet where the pinhole's ray does."""
    camera, n = replace(CAMERA, focus=focus), 400
    rng = np.random.default_rng(2)
    x, y = rng.uniform(0, 30, 20), rng.uniform(0, 20, 20)
    u, v = rng.uniform(size=(2, n, 20))
    o, d = lens_rays(camera, np.tile(x, (n, 1)).ravel(), np.tile(y, (n, 1)).ravel(), u.ravel(), v.ravel(), precision)
    _, middle = lens_rays(replace(camera, aperture=0.0), x, y, 0.5, 0.5, precision)
    forward, *_ = axes(camera)
    far = focus or float(np.linalg.norm(np.subtract(camera.target, camera.origin)))
    p = o + (far / (d @ forward))[:, None] * d
    goal = np.array(camera.origin) + (far / (middle @ forward))[:, None] * middle
    # Directions have 20 roundings of the shading precision; the lens is up to 0.4 wide, and 0.8 where it is near.
    slack = gamma(20, precision) * (far + camera.aperture) * 2
    assert np.abs(p.reshape(n, 20, 3) - goal).max() <= slack
    # Elsewhere they do not meet.
    apart = (o + (2 * far / (d @ forward))[:, None] * d).reshape(n, 20, 3)
    assert np.ptp(apart, axis=0).max(1).min() > 0.9 * camera.aperture / 2


@PRECISIONS
def test_points_of_the_lens_are_uniform_over_a_disk_across_the_view(precision: str) -> None:
    """A raster of k x k places in the square: how many of its points lie within each radius and each sector.

    The edge of a disk of radius r is that of a square of side r k, which cuts 4 r k + 4 cells of the raster; that of a
    sector, two radii, cuts 2 k more.
    """
    k = 200
    u, v = (g.ravel() for g in np.meshgrid((np.arange(k) + 0.5) / k, (np.arange(k) + 0.5) / k))
    o, _ = lens_rays(CAMERA, 7.0, 3.0, u, v, precision)
    forward, right, up = axes(CAMERA)
    aside = (o - np.array(CAMERA.origin)) / (0.5 * CAMERA.aperture)
    # The lens's points are in double, from u and v in the shading precision.
    assert np.abs(aside @ forward).max() <= gamma(40) * 20
    x, y = aside @ right, aside @ up
    r, turn = np.hypot(x, y), np.arctan2(y, x)
    assert r.max() <= 1 + gamma(40) * 20
    for radius in (0.1, 0.25, 0.5, 0.75, 0.9):
        assert abs((r < radius).sum() - radius**2 * k * k) <= 4 * radius * k + 4
    for start in np.linspace(-3, 2, 9):
        share = ((turn > start) & (turn < start + 1)).mean()
        assert abs(share - 1 / (2 * np.pi)) <= (2 * k + 4 * k + 4) / k**2


def blur(camera: Camera, ball: Sphere, side: int = 65, spp: int = 2048) -> tuple[np.ndarray, float]:
    """The second moments of a glowing ball's picture about its middle, in pixels, across and up; and its brightness."""
    scene = scene_of({"ball": ball}, {"m": plain(ka=WHITE)}, "double", ambient=WHITE, camera=camera,
                     film=Film(width=side, height=side), spp=spp)  # fmt: skip
    light = film_of(scene)[..., 0]
    x = np.arange(side) - 0.5 * (side - 1)
    total = light.sum()
    across, up = light.sum(0) / total, light.sum(1) / total
    return np.array([(x * x * w).sum() - (x * w).sum() ** 2 for w in (across, up)]), float(total)


@pytest.mark.parametrize("distance", [3.0, 4.5, 5.0, 8.0, 20.0])
def test_the_circle_of_confusion_is_as_wide_as_the_thin_lens_says(distance: float) -> None:
    """A ball of radius r at distance z, the lens of width A focused at f: a disk A |z - f| / (z f) wide, in slopes.

    In pixels times their number per slope, P. Second moments add: D^2 / 16 for the disk, (r P / z)^2 / 4 for the ball,
    and 1 / 12 for the pixel.
    """
    focus, aperture, side, spp, fov = 5.0, 0.4, 65, 2048, 6.0
    pixels = side / (2 * np.tan(np.radians(fov) / 2))
    radius = 2.5 * distance / pixels
    camera = Camera(origin=(0, 0, distance), target=(0, 0, 0), fov=fov, aperture=aperture, focus=focus)
    found, total = blur(camera, Sphere(radius=radius, material="m"), side, spp)
    wide = aperture * abs(distance - focus) / (distance * focus) * pixels
    truth = wide**2 / 16 + 2.5**2 / 4 + 1 / 12
    # Off the middle of the lens the ball is farther, and its silhouette lies before its middle: both by shares of
    # (A / z)^2 and (r / z)^2.
    bent = 4 * ((aperture / distance) ** 2 + (radius / distance) ** 2)
    # So many samples meet the ball; a second moment of them is off by root(kurtosis - 1) of itself, below 1 for disks.
    # The light is spread, not lost: the sum of the pixels is the ball's size in the picture.
    samples = spp * np.pi * 2.5**2
    noise = SIGMAS / np.sqrt(samples)
    assert abs(total / (np.pi * 2.5**2) - 1) <= noise + bent
    assert (np.abs(found / truth - 1) <= noise + bent).all()
    if distance == focus:
        sharp, _ = blur(replace(camera, aperture=0.0), Sphere(radius=radius, material="m"), side, spp)
        assert (np.abs(found - sharp) <= (2 * noise + bent) * truth).all()


def test_focus_is_the_distance_of_the_target_unless_it_says_otherwise() -> None:
    camera = replace(CAMERA, focus=0.0)
    far = float(np.linalg.norm(np.subtract(camera.target, camera.origin)))
    scene = replace(SHOW, camera=camera, film=Film(width=24, height=16))
    same, other = (replace(scene, camera=replace(camera, focus=f)) for f in (far, 0.9 * far))
    # Its length comes from one root and is given here in decimal places that are read back as they are: a last bit.
    assert np.abs(film_of(scene) - film_of(same)).max() <= gamma(60, "single") * 2
    assert np.abs(film_of(scene) - film_of(other)).max() > 0.01


def test_the_lens_sees_past_what_hides_the_pinhole() -> None:
    """A black ball of radius 0.2 half a unit before a lens of radius 0.5, focused on a wall 100 away.

    From each point of the wall the ball hides that part of the lens that its shadow covers: (0.2 / 0.5)^2.
    """
    objects = {
        "ball": Sphere(radius=0.2, material="black"),
        "wall": Plane(point=(0, 0, -100), normal=(0, 0, 1), material="m"),
    }
    materials = {"m": plain(ka=WHITE), "black": plain()}
    camera = Camera(origin=(0, 0, 0.5), target=(0, 0, -1), fov=1.0, aperture=1.0, focus=100.5)
    scene = scene_of(objects, materials, "double", ambient=WHITE, camera=camera, film=Film(width=4, height=4), spp=4096)
    light = film_of(scene)[..., 0]
    hidden = (0.2 / 0.5) ** 2
    # The shadow is wider than the ball by 1 / 200, and by the slant of rays, 0.5 / 100, squared; that is two hundredths
    # of its area. It lies within the lens, moved by up to 0.5 tan 0.5 degrees.
    noise = np.sqrt(hidden * (1 - hidden) / 4096)
    assert np.abs(light - (1 - hidden)).max() <= SIGMAS * noise + 0.02 * hidden
    assert (film_of(replace(scene, camera=replace(camera, aperture=0.0))) == np.array(BLACK)).all()
