"""The map that is fitted to places on earth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visray.data.base import GlobeBase
from visray.data.fitted_base import MARGIN, MOST_ASKED, SLIMMEST, fitted_base, longitudes_of, spacing

lons, lats = st.floats(-180, 360), st.floats(-90, 90)
anywhere = st.lists(st.tuples(lons, lats), min_size=1, max_size=20)
together = st.builds(
    lambda at, size, offsets: [
        ((at[0] + size * x + 180) % 360 - 180, float(np.clip(at[1] + size * y, -90, 90))) for x, y in offsets
    ],
    st.tuples(st.floats(-180, 180), st.floats(-80, 80)),
    st.sampled_from((0.01, 0.3, 5.0, 30.0, 80.0)),
    st.lists(st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)), min_size=1, max_size=9),
)


@settings(derandomize=True, deadline=None, max_examples=400)
@given(st.one_of(anywhere, together))
def test_every_place_is_inside_a_map_without_flaws(places) -> None:
    lon, lat = np.array(places).T
    base = fitted_base(lon, lat)
    assert base.flaws() == [] and base.inside(lon, lat).all()
    assert SLIMMEST / 2.2 < base.true_depth / base.width < 2.2 / SLIMMEST


@settings(derandomize=True, deadline=None, max_examples=200)
@given(together)
def test_a_map_has_space_around_the_data_but_not_much(places) -> None:
    lon, lat = np.array(places).T
    west, east, south, north = fitted_base(lon, lat).extent
    if east - west == 360 or abs(lat).max() > 80 or min(np.ptp(lat), len(set(places))) < 1e-3:
        return
    gap = min(lat.min() - south, north - lat.max())
    assert gap >= MARGIN * np.ptp(lat) * (1 - 1e-9)
    first, last = longitudes_of(lon)
    shrink = np.cos(np.radians(0.5 * (lat.min() + lat.max())))
    longer = max(np.ptp(lat), (last - first) * shrink)
    assert north - south <= (1 + 2 * MARGIN) * longer + 2.1


def test_data_across_the_date_line_are_not_torn_apart() -> None:
    lon, lat = np.array([170.0, 178.0, -175.0, -150.0]), np.array([-40.0, -20.0, -15.0, -20.0])
    assert longitudes_of(lon) == (170.0, 210.0)
    west, east, _, _ = fitted_base(lon, lat).extent
    assert west < 170 and 210 < east < 240
    assert longitudes_of(np.array([350.0, 10.0])) == (-10.0, 10.0)
    assert longitudes_of(np.array([5.0])) == (5.0, 5.0)


def test_data_all_around_get_the_whole_earth() -> None:
    lon, lat = np.array([-120.0, 0.0, 30.0, 110.0, 150.0]), np.array([40.0, -33.0, 60.0, 30.0, -38.0])
    assert fitted_base(lon, lat).extent == (-180.0, 180.0, -58.0, 80.0)
    assert fitted_base(lon, np.append(lat[:4], -77.0)).extent == (-180.0, 180.0, -82.0, 80.0)
    assert isinstance(fitted_base(lon, lat, "globe"), GlobeBase)


@pytest.mark.parametrize(
    ("span", "projection"), [(0.2, "equirectangular"), (5.0, "equirectangular"), (30.0, "mercator")]
)
def test_the_projection_suits_the_region(span, projection) -> None:
    base = fitted_base(np.array([0.0, span]), np.array([40.0, 40.0 + span]))
    assert base.projection == projection


@pytest.mark.parametrize("apart", [0.0, 1e-18, 1e-9])
def test_a_single_place_gets_a_map_around_it(apart) -> None:
    west, east, south, north = fitted_base(np.array([2.17, 2.17]), np.array([0.0, apart])).extent
    assert west < 2.17 < east and south < 0 < north and north - south > 10


def test_spacing_is_the_median_distance_of_nearest_places() -> None:
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0), [0.0]), -1).reshape(-1, 3)
    assert spacing(grid * 0.25) == 0.25
    assert spacing(np.concatenate([grid, grid])) == 1.0
    assert spacing(np.array([[0, 0, 0], [1, 0, 0], [5.0, 0, 0]])) == 1.0
    assert spacing(np.zeros((3, 3))) == spacing(np.zeros((1, 3))) == 0.0
    line = np.stack([np.arange(3.0 * MOST_ASKED), np.zeros(3 * MOST_ASKED), np.zeros(3 * MOST_ASKED)], axis=1)
    assert spacing(line) == 1.0
