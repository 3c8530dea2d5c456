"""The plain map that is drawn where the user gives none: land is where it is on earth, lines where they belong."""

import shutil
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from visray.data.base import GlobeBase, MapBase, PlaneBase
from visray.data.basemap import COARSE, LINES, Colours, drawn, graticule_step, has_land
from visray.data.land import UNIT, Ring, decode, encode, land
from visray.data_picture.drawn_map import passing_map

WIDTH = 900
PLACES = {
    "land": [
        (-3.7, 40.4), (2.35, 48.85), (37.6, 55.75), (116.4, 39.9), (-99.1, 19.4), (-47.9, -15.8), (149.1, -35.3),
        (31.2, 29.5), (-178.0, 66.9), (178.0, 67.5), (20.0, 4.0), (-100.0, 45.0), (-42.0, 72.0),
    ],
    "sea": [
        (-41.0, 40.5), (-28.0, -20.0), (75.0, -20.0), (-145.0, 20.0), (-178.0, -11.0), (178.0, 11.0), (5.0, 39.5),
        (51.0, 41.0), (35.0, 43.5), (-92.0, 25.0), (-85.0, 59.0), (3.0, 56.0), (4.0, 85.5),
    ],
}  # fmt: skip
BASES = [
    GlobeBase(),
    MapBase(),
    MapBase(extent=(-180.0, 180.0, -70.0, 84.0), projection="mercator"),
    MapBase(extent=(-20.0, 60.0, 20.0, 75.0), projection="mercator"),
    PlaneBase(extent=(100.0, 265.0, -50.0, 72.0)),
]


@cache
def picture_of(base) -> np.ndarray:
    return drawn(base, WIDTH)


def colour_at(base, lon: float, lat: float) -> tuple:
    """Colour of the map at a place: that of the pixel at the texture coordinates of the place."""
    picture = picture_of(base)
    height, width, _ = picture.shape
    if isinstance(base, GlobeBase):
        u, v = 0.5 + lon / 360, 0.5 + lat / 180
    else:
        x, _, z = base.place(np.array([lon]), np.array([lat])).point[0]
        u, v = x / base.width + 0.5, 0.5 - z / base.true_depth
    return tuple(picture[int((1 - v) * height), int(u * width)].tolist())


@pytest.mark.parametrize("base", BASES, ids=repr)
@pytest.mark.parametrize("what", PLACES)
def test_land_and_sea_are_where_they_are_on_earth(base, what) -> None:
    places = [p for p in PLACES[what] if base.inside(np.array([p[0]]), np.array([p[1]])).all()]
    assert len(places) > 2
    for lon, lat in places:
        assert colour_at(base, lon, lat) == getattr(Colours(), what), (lon, lat)


def test_antarctica_reaches_the_pole_on_both_sides_of_the_date_line() -> None:
    for lon in (-179.5, -120.0, 0.0, 90.0, 179.5):
        assert colour_at(GlobeBase(), lon, -88.0) == Colours().land


def test_every_ring_is_closed_and_has_no_jump() -> None:
    for points, _ in land():
        assert (points[0] == points[-1]).all() and len(points) >= 4
        assert (np.abs(points[:, 1]) <= 90).all() and (np.abs(points[:, 0]) <= 540).all()
        steps = np.abs(np.diff(points[:, 0]))
        assert (steps[points[1:, 1] > -90] < 180).all()
    assert any(ring.water for ring in land())


numbers = arrays(np.int64, st.tuples(st.integers(1, 9), st.just(2)), elements=st.integers(-20000, 20000))


@settings(derandomize=True, deadline=None)
@given(st.lists(st.tuples(numbers, st.booleans()), max_size=5))
def test_rings_are_read_as_they_were_written(rings) -> None:
    read = decode(encode([Ring(whole * UNIT, water) for whole, water in rings])) if rings else []
    assert len(read) == len(rings)
    for (points, water), (whole, expected) in zip(read, rings):
        assert water == expected
        np.testing.assert_array_equal(points, whole * UNIT)


@settings(derandomize=True, deadline=None)
@given(wide=st.floats(0.02, 360), west=st.floats(-180, 0), south=st.floats(-60, 0), tall=st.floats(0.02, 60))
def test_the_graticule_has_some_lines_but_not_many(wide, west, south, tall) -> None:
    base = MapBase(extent=(west, west + wide, south, south + tall))
    assert LINES <= max(wide, tall) / graticule_step(base) <= 3 * LINES


def test_lines_are_at_whole_steps() -> None:
    base = MapBase(extent=(1.9, 2.4, 41.2, 41.6))
    assert not has_land(base) and graticule_step(base) == 0.1
    picture = drawn(base, 1000).astype(int)
    line, paper = Colours().lines, Colours().land
    dark = (picture != paper).any(axis=2)
    columns = np.flatnonzero(dark.mean(axis=0) > 0.9)
    expected = [(lon - 1.9) / 0.5 * 1000 for lon in (1.9, 2.0, 2.1, 2.2, 2.3, 2.4)]
    assert all(min(abs(c + 0.5 - e) for e in expected) < 2 for c in columns)
    # Half of a line at an edge of the map lies outside.
    assert all(min(abs(c + 0.5 - e) for c in columns) < 2 for e in expected[1:-1])
    assert (np.abs(picture[dark] - line).min() == 0) and picture.shape[:2] == (round(1000 * base.true_depth / 10), 1000)


def test_a_small_map_has_no_coasts() -> None:
    assert has_land(MapBase(extent=(0.0, COARSE + 1, 50.0, 51.0))) and not has_land(
        MapBase(extent=(0.0, 3.0, 50.0, 53.0))
    )
    colours = {tuple(c) for c in drawn(MapBase(extent=(-5.0, -3.0, 49.0, 51.0)), 300).reshape(-1, 3).tolist()}
    assert Colours().sea not in colours and Colours().coast not in colours


def test_a_removed_folder_of_maps_is_made_again():
    pixels = np.zeros((2, 3, 3), np.uint8)
    first = Path(passing_map(pixels))
    shutil.rmtree(first.parent)
    assert Path(passing_map(pixels)).exists()
