"""Cameras and lights fitted to data: everything lies in the window, and nothing more could be had."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visray.camera import Camera
from visray.data.base import GlobeBase, MapBase, PlaneBase
from visray.data.fit import LATITUDES, POPULATED, axes_over, balls, middle_of
from visray.fitting import Balls, Window, fitted_lights, fitted_view
from visray.transforms import Rotate, Scale, Translate

MOVED = (Rotate(rotate=40.0, axis=(1.0, 0.5, 0.0)), Scale(scale=30.0), Translate(translate=(100.0, -20.0, 3.0)))
BASES = [
    GlobeBase(radius=2.0),
    GlobeBase(center=(1.0, 2.0, 3.0), transform=MOVED),
    MapBase(),
    MapBase(extent=(-10.0, 40.0, 35.0, 70.0), projection="mercator", transform=MOVED),
    PlaneBase(extent=(100.0, 260.0, -50.0, 50.0), center=(0.0, 3.0, -5.0)),
]
# Rounding of the camera moves a picture by this much at most: its file has five digits.
ROUNDED = 1e-4


def slopes(camera: Camera, aspect: float, points: np.ndarray) -> np.ndarray:
    """Where points lie in the picture, from -1 to 1, by the definition of the camera. Shape: (N, 2)."""
    origin, target, up = (np.array(v) for v in (camera.origin, camera.target, camera.up))
    forward = (target - origin) / np.linalg.norm(target - origin)
    right = np.cross(forward, up) / np.linalg.norm(np.cross(forward, up))
    x, y, z = (np.stack([right, np.cross(right, forward), forward]) @ (points - origin).T).reshape(3, -1)
    assert (z > 0).all()
    half = np.tan(np.radians(camera.fov / 2))
    return np.stack([x / (half * aspect * z), y / (half * z)], axis=1)


def surfaces(shown: Balls) -> np.ndarray:
    """Points of the surfaces of balls. Shape: (N, 3)."""
    rng = np.random.default_rng(1)
    v = rng.normal(size=(2000, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    return np.concatenate([c + r * (v if r else v[:1]) for c, r in zip(shown.centre, shown.radius)])


windows = st.builds(
    Window, left=st.floats(-1, -0.3), right=st.floats(0.3, 1), bottom=st.floats(-1, -0.3), top=st.floats(0.3, 1)
)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    base=st.sampled_from(BASES), aspect=st.floats(0.3, 3), seed=st.integers(0, 99), window=windows,
    tall=st.floats(-0.5, 0.5), thick=st.floats(0, 0.1),
)  # fmt: skip
def test_everything_lies_in_the_window_and_fills_it_one_way(base, aspect, seed, window, tall, thick) -> None:
    rng = np.random.default_rng(seed)
    west, east, south, north = getattr(base, "extent", (-180.0, 180.0, -90.0, 90.0))
    lon, lat = rng.uniform(west, east, 12), rng.uniform(south, north, 12)
    shown = balls(base, lon, lat, tall * base.size * rng.random(12), thick * base.size)
    camera = fitted_view(shown, axes_over(base, middle_of(lon, lat)), aspect, window)
    seen = slopes(camera, aspect, surfaces(shown))
    low, high = np.array([window.left, window.bottom]), np.array([window.right, window.top])
    assert (seen >= low - ROUNDED).all() and (seen <= high + ROUNDED).all()
    # A nearer camera would cut something off: one pair of edges is reached, up to the points that balls are sampled at.
    gaps = np.minimum(seen.min(axis=0) - low, high - seen.max(axis=0))
    both = np.maximum(seen.min(axis=0) - low, high - seen.max(axis=0))
    assert gaps.min() < 0.02 and both.min() < 0.05


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_north_is_up_and_east_is_right(base) -> None:
    at = (20.0, 30.0) if isinstance(base, GlobeBase) else (np.mean(base.extent[:2]), np.mean(base.extent[2:]))
    lon, lat = at[0] + np.array([0.0, 5.0, 0.0]), at[1] + np.array([0.0, 0.0, 5.0])
    shown = balls(base, lon, lat)
    camera = fitted_view(shown, axes_over(base, at), 1.6)
    here, east, north = slopes(camera, 1.6, base.place(lon, lat).point)
    assert east[0] > here[0] and abs(east[1] - here[1]) < 0.3 * (east[0] - here[0])
    assert north[1] > here[1] and abs(north[0] - here[0]) < 1e-3


@pytest.mark.parametrize("lat", [-90.0, -60.0, 0.0, 45.0, 90.0])
def test_bars_in_the_middle_of_the_data_stand_upright_in_a_picture_of_a_globe(lat) -> None:
    base, at = GlobeBase(), (15.0, lat)
    place = np.array([at[0]]), np.array([lat])
    shown = balls(base, *place, 0.2)
    camera = fitted_view(shown, axes_over(base, at), 1.0)
    foot, top = slopes(camera, 1.0, shown.centre[1:])
    assert abs(top[0] - foot[0]) < 1e-3
    if lat > LATITUDES[0]:
        assert top[1] > foot[1] + 0.02
    # It is in front of the globe, not behind it.
    assert np.dot(np.array(camera.origin) - shown.centre[1], base.place(*place).up[0]) > 0


def test_the_middle_of_places_counts_across_the_date_line_and_with_weights() -> None:
    lon, lat = middle_of(np.array([170.0, -170.0]), np.array([10.0, 10.0]))
    assert abs(lon) == pytest.approx(180, abs=1e-9) and 10 < lat < 11
    np.testing.assert_allclose(middle_of(np.array([10.0, 80.0]), np.zeros(2), np.array([1.0, 0.0])), [10, 0], atol=1e-9)
    assert middle_of(np.array([0.0, 180.0]), np.zeros(2)) == POPULATED
    assert middle_of(np.array([5.0]), np.array([5.0]), 0.0) == POPULATED


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_lights_shine_on_the_side_that_the_camera_sees(base) -> None:
    shown, axes = balls(base, np.zeros(1), np.zeros(1)), axes_over(base)
    lights = fitted_lights(shown, axes)
    toward = {name: np.array(light.position) - shown.middle() for name, light in lights.items()}
    for name, light in lights.items():
        assert np.linalg.norm(toward[name]) - light.radius > shown.reach()
        assert -axes[2] @ toward[name] > 0.5 * np.linalg.norm(toward[name])
    assert axes[0] @ toward["key"] < 0 < axes[1] @ toward["key"] and axes[0] @ toward["fill"] > 0
