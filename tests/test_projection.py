"""Projected points are where the picture shows them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import visray as vr
from visray.camera import KINDS
from visray.data.base import GlobeBase, MapBase
from visray.data.data_scene import Data
from visray.errors import UserError
from visray.projection import projected
from visray.renderer import render
from visray.scene.scene import Film, Scene, Settings

FILM = Film(width=48, height=32)
CAMERAS = {
    "perspective": vr.Camera(origin=(1.0, 2.0, 6.0), target=(0.2, -0.1, 0.3), up=(0.2, 1.0, 0.1), fov=35.0),
    "lens": vr.Camera(origin=(1.0, 2.0, 6.0), target=(0.2, -0.1, 0.3), fov=35.0, aperture=0.3),
    "orthographic": vr.OrthographicCamera(origin=(1.0, 2.0, 6.0), target=(0.2, -0.1, 0.3), height=3.0),
}
GLOBE = GlobeBase(center=(0.1, -0.2, 0.3), radius=1.2)


def scene_of(camera, base=GLOBE, film: Film = FILM) -> Scene:
    data = None if base is None else Data(base=base)
    return Scene(camera=camera, film=film, data=data, settings=Settings(spp=1, precision="double"), lights={})


def test_each_kind_of_camera_is_looked_at() -> None:
    assert {type(camera) for camera in CAMERAS.values()} == set(KINDS)


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("base", [GLOBE, MapBase(width=4.0)], ids=lambda base: base.type)
def test_a_pixel_sees_the_points_that_are_projected_into_its_middle(name: str, base) -> None:
    """Layer P: the point that the ray through the middle of a pixel hits."""
    scene = scene_of(CAMERAS[name], base)
    image = render(scene, progress=False, layers=("P", "id", "Z"))
    hit = image["id"] > 0
    assert 100 < hit.sum() < hit.size
    found = projected(scene, image["P"][hit].astype(float))
    rows, columns = np.nonzero(hit)
    # Layer P is in single precision.
    assert np.abs(found.x - (columns + 0.5)).max() <= 1e-4
    assert np.abs(found.y - (rows + 0.5)).max() <= 1e-4
    assert np.abs(found.depth - image["Z"][hit]).max() <= 1e-5
    assert found.visible.mean() > 0.97  # a point on the outline may be rounded to its other side


@pytest.mark.parametrize("name", ["perspective", "orthographic"])
def test_a_place_is_visible_if_the_picture_shows_it(name: str) -> None:
    """Places all over a globe: those that are visible are at the point of layer P in their pixel, and the hidden ones
    are farther away than that by more than a pixel shows."""
    scene = scene_of(CAMERAS[name], film=Film(width=480, height=320))
    rng = np.random.default_rng(3)
    lon, lat = rng.uniform(-180, 180, 500), np.degrees(np.arcsin(rng.uniform(-1, 1, 500)))
    points = GLOBE.place(lon, lat).point
    image = render(scene, progress=False, layers=("P", "id"))
    found = projected(scene, points)
    inside = (found.x >= 0) & (found.x < 480) & (found.y >= 0) & (found.y < 320)
    at = np.where(inside, found.y, 0).astype(int), np.where(inside, found.x, 0).astype(int)
    gap = np.linalg.norm(image["P"][at] - points, axis=1)
    shown = inside & (image["id"][at] > 0) & (gap < 0.1)
    # Near the outline a pixel covers much of the globe: there the picture cannot tell.
    sight = np.array(scene.camera.origin) - points if name == "perspective" else -np.array(forward_of(scene))
    up = GLOBE.place(lon, lat).up
    slant = (up * (sight / np.linalg.norm(sight, axis=-1, keepdims=True))).sum(axis=1)
    clear = np.abs(slant) > 0.15
    assert clear.sum() > 300 and 50 < found.visible.sum() < 350
    assert (found.visible == shown)[clear].all()


def forward_of(scene: Scene) -> tuple[float, float, float]:
    c = scene.camera
    return tuple(t - o for t, o in zip(c.target, c.origin))


def test_on_a_map_nothing_is_hidden_and_behind_the_camera_is_no_pixel() -> None:
    scene = scene_of(vr.Camera(origin=(0.0, 0.0, 5.0)), MapBase())
    found = projected(scene, [[0, 0, 0], [0, 0, 6], [0, 0, 5], [100, 0, 0], [0, -3, -1]])
    assert found.visible.tolist() == [True, False, False, False, False]
    assert (found.x[0], found.y[0], found.depth[0]) == (24, 16, 5)
    assert np.isnan(found.x[1:3]).all() and np.isfinite(found.x[3:]).all()


def test_without_data_only_the_frame_counts() -> None:
    found = projected(scene_of(vr.Camera(), None), (0.0, 0.0, 0.0))
    assert found.x.shape == (1,) and found.visible.all()


@given(point=st.tuples(*[st.floats(-2.0, 2.0)] * 3), name=st.sampled_from(["perspective", "orthographic"]))
@settings(deadline=None, derandomize=True, max_examples=200)
def test_a_point_is_back_where_its_ray_starts(point, name: str) -> None:
    """The inverse by other formulas: from pixel and depth along the axes of the camera to the point."""
    scene = scene_of(CAMERAS[name], None)
    c = scene.camera
    found = projected(scene, point)
    forward = np.array(forward_of(scene)) / np.linalg.norm(forward_of(scene))
    right = np.cross(forward, c.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    depth = float(found.depth[0])
    size = 3.0 if name == "orthographic" else 2 * depth * np.tan(np.radians(17.5))
    x, y = (found.x[0] - 24) * size / 32, (16 - found.y[0]) * size / 32
    back = np.array(c.origin) + depth * forward + x * right + y * up
    assert np.abs(back - point).max() < 1e-12


@pytest.mark.parametrize("points", [[[1, 2]], "abc", [[np.nan, 0, 0]], [[[1, 2, 3]]], [["a", "b", "c"]], None])
def test_what_is_no_point_is_refused(points) -> None:
    with pytest.raises(UserError, match=r"^points: must be an array of N x 3 finite numbers"):
        vr.projected(scene_of(vr.Camera()), points)
