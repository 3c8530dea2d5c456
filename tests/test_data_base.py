"""Where places on earth lie on the base of a data scene, against closed forms, differences and the kinds' own uv."""

from dataclasses import replace

import drjit as dr
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from visray.data.base import KINDS, MERCATOR_LIMIT, Base, GlobeBase, MapBase, PlaneBase
from visray.primitives.primitive import scalars, transform_frame
from visray.transforms import Matrix, Rotate, Scale, Translate

FLAT = (MapBase, PlaneBase)
PROJECTIONS = ("equirectangular", "mercator")
EXTENTS = {
    "world": (-180.0, 180.0, -85.0, 85.0),
    "europe": (-10.0, 40.0, 35.0, 70.0),
    "pacific": (100.0, 260.0, -50.0, 50.0),
    "south": (-75.0, -60.0, -56.0, -33.0),
}
TURNED = (Rotate(rotate=33.0, axis=(1.0, 2.0, -1.0)), Scale(scale=1.7), Translate(translate=(0.4, -2.0, 5.0)))
MIRRORED = (Scale(scale=(-1.0, 1.0, 1.0)), *TURNED)
SHEARED = (Matrix(matrix=((1.0, 0.4, 0.1, 3.0), (0.0, 1.2, -0.3, 1.0), (0.2, 0.0, 0.9, -2.0))), *TURNED)
STEPS = {"still": (), "turned": TURNED, "mirrored": MIRRORED, "sheared": SHEARED}
BASES = [
    kind(center=(0.5, -1.0, 2.0), width=6.0, extent=extent, projection=projection, transform=steps)
    for kind in FLAT
    for extent in EXTENTS.values()
    for projection in PROJECTIONS
    for steps in STEPS.values()
] + [GlobeBase(center=(0.5, -1.0, 2.0), radius=2.5, transform=STEPS[k]) for k in ("still", "turned", "mirrored")]
PARTS = ("point", "up", "east")


def places(base, count: int = 40, seed: int = 3):
    """Places within the extent of a base."""
    west, east, south, north = getattr(base, "extent", (-180.0, 180.0, -90.0, 90.0))
    rng = np.random.default_rng(seed)
    return rng.uniform(west, east, count), rng.uniform(south, north, count)


def texture_coordinates(base, points: np.ndarray) -> np.ndarray:
    """(u, v) of points in world space, as the kernels find them. Shape: (N, 2)."""
    shape = base.object()
    placed = scalars(shape).placed(transform_frame(shape))
    return np.array([shape.kind.uv(placed, dr.scalar.Array3f64(*map(float, p))) for p in points])


def mercator(lat):
    """Mercator's ordinate, by Gudermann's formula with the logarithm."""
    return np.log(np.tan(np.pi / 4 + np.radians(lat) / 2))


def expected_uv(base, lon, lat) -> np.ndarray:
    if isinstance(base, GlobeBase):
        return np.stack([0.5 + lon / 360, 0.5 + lat / 180], axis=1)
    west, east, south, north = base.extent
    y = mercator if base.projection == "mercator" else np.asarray
    return np.stack([(lon - west) / (east - west), (y(lat) - y(south)) / (y(north) - y(south))], axis=1)


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_a_place_lies_where_the_texture_shows_it(base) -> None:
    lon, lat = places(base)
    ground = base.place(lon, lat)
    np.testing.assert_allclose(texture_coordinates(base, ground.point), expected_uv(base, lon, lat), atol=2e-12)


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_up_is_the_normal_of_the_object_and_east_lies_in_it(base) -> None:
    ground, shape = base.place(*places(base)), base.object()
    placed = scalars(shape).placed(transform_frame(shape))
    for p, up, east in zip(ground.point, ground.up, ground.east):
        f, gradient = shape.kind.surface_at(placed, dr.scalar.Array3f64(*map(float, p)))
        assert abs(f) < 1e-12
        normal = np.array(gradient) / np.linalg.norm(gradient)
        np.testing.assert_allclose(up, normal, atol=1e-12)
        np.testing.assert_allclose([up @ up, east @ east, up @ east], [1, 1, 0], atol=1e-12)


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_east_is_the_direction_of_growing_longitude(base) -> None:
    ground = base.place(*places(base))
    steps = ground.point_lon / np.linalg.norm(ground.point_lon, axis=1, keepdims=True)
    np.testing.assert_allclose(ground.east, steps, atol=1e-12)


@pytest.mark.parametrize("base", BASES, ids=repr)
@pytest.mark.parametrize("axis", ["lon", "lat"])
def test_derivatives_are_those_of_differences(base, axis) -> None:
    lon, lat = places(base)
    h = 1e-3
    a, b = (base.place(lon + s * h * (axis == "lon"), lat + s * h * (axis == "lat")) for s in (1, -1))
    ground = base.place(lon, lat)
    for part in PARTS:
        difference = (getattr(a, part) - getattr(b, part)) / (2 * h)
        # The error of a central difference is h^2 / 6 times the third derivative; rounding adds 1e-16 / h.
        np.testing.assert_allclose(getattr(ground, f"{part}_{axis}"), difference, rtol=1e-6, atol=1e-9)


def test_a_globe_has_greenwich_at_x_and_grows_eastwards() -> None:
    globe = GlobeBase(radius=2.0)
    lon, lat = np.array([0.0, 90.0, 180.0, -90.0, 12.0, 12.0]), np.array([0.0, 0.0, 0.0, 0.0, 90.0, -90.0])
    points = [[2, 0, 0], [0, 0, -2], [-2, 0, 0], [0, 0, 2], [0, 2, 0], [0, -2, 0]]
    np.testing.assert_allclose(globe.place(lon, lat).point, points, atol=1e-15)
    assert globe.size == 4.0


@pytest.mark.parametrize("kind", FLAT)
def test_a_map_has_east_at_x_and_north_away_from_the_viewer(kind) -> None:
    base = kind(center=(1.0, 2.0, 3.0), extent=(-20.0, 20.0, 10.0, 50.0), width=8.0, depth=4.0)
    ground = base.place(np.array([-20.0, 20.0, 0.0]), np.array([10.0, 50.0, 30.0]))
    np.testing.assert_allclose(ground.point, [[-3, 2, 5], [5, 2, 1], [1, 2, 3]], atol=1e-14)
    assert np.all(ground.up == [0, 1, 0]) and np.all(ground.east == [1, 0, 0])
    assert not ground.up_lon.any() and not ground.east_lat.any()


@pytest.mark.parametrize("extent", EXTENTS.values(), ids=EXTENTS)
@pytest.mark.parametrize("projection", PROJECTIONS)
def test_by_default_shapes_in_the_middle_keep_their_proportions(extent, projection) -> None:
    base = MapBase(extent=extent, projection=projection)
    west, east, south, north = extent
    lat = np.array([0.5 * (south + north)])
    ground = base.place(np.array([0.5 * (west + east)]), lat)
    east_step, north_step = (np.linalg.norm(x) for x in (ground.point_lon, ground.point_lat))
    assert east_step == pytest.approx(north_step * np.cos(np.radians(lat[0])), rel=1e-12)


def test_mercator_keeps_angles_everywhere_and_the_whole_earth_is_a_square() -> None:
    limit = np.degrees(2 * np.arctan(np.exp(np.pi)) - np.pi / 2)
    base = MapBase(extent=(-180.0, 180.0, -float(limit), float(limit)), projection="mercator")
    assert base.true_depth == pytest.approx(base.width, rel=1e-12) and limit < MERCATOR_LIMIT
    lon, lat = places(base)
    ground = base.place(lon, lat)
    lengths = [np.linalg.norm(x, axis=1) for x in (ground.point_lon, ground.point_lat)]
    np.testing.assert_allclose(lengths[0], lengths[1] * np.cos(np.radians(lat)), rtol=1e-12)


@settings(derandomize=True, deadline=None)
@given(
    west=st.floats(-360, 0), wide=st.floats(1, 360), share=st.floats(0.01, 0.99), turns=st.integers(-1, 1),
    kind=st.sampled_from(FLAT),
)  # fmt: skip
def test_longitudes_wrap_into_the_extent(west, wide, share, turns, kind) -> None:
    base = kind(extent=(west, west + wide, -10.0, 10.0))
    lon = west + share * wide
    other = lon + 360 * turns
    if abs(other) > 360 or abs(lon) > 360:
        return
    assert base.inside(np.array([lon]), np.array([0.0])).all() and base.inside(np.array([other]), np.array([0.0])).all()
    a, b = (base.place(np.array([x]), np.array([0.0])).point for x in (lon, other))
    np.testing.assert_allclose(a, b, atol=1e-9 * base.width)


def test_the_pacific_map_crosses_the_date_line() -> None:
    base = MapBase(extent=EXTENTS["pacific"], width=16.0)
    lon = np.array([100.0, 179.0, -179.0, 181.0, -100.0, 99.0, -99.0, 0.0])
    lat = np.zeros(len(lon))
    assert base.inside(lon, lat).tolist() == [True] * 5 + [False] * 3
    x = base.place(lon, lat).point[:, 0]
    np.testing.assert_allclose(x[:7], [-8, -0.1, 0.1, 0.1, 8, -8.1, 8.1], atol=1e-12)


@pytest.mark.parametrize("kind", FLAT)
def test_places_beyond_the_map_can_be_shown(kind) -> None:
    base = kind(extent=EXTENTS["europe"], width=6.0, depth=4.0, outside="shown")
    lon, lat = np.array([20.0, -60.0, 90.0, 20.0, np.nan]), np.array([50.0, 90.0, -90.0, 91.0, 50.0])
    assert base.inside(lon, lat).tolist() == [True, True, True, False, False]
    west, east, south, north = base.extent
    expected = np.stack([6 * (lon - 15) / (east - west), 0 * lon, -4 * (lat - 52.5) / (north - south)], axis=1)
    np.testing.assert_allclose(base.place(lon[:3], lat[:3]).point, expected[:3], atol=1e-12)


@pytest.mark.parametrize("base", [GlobeBase(), MapBase(), MapBase(extent=EXTENTS["pacific"]), PlaneBase()], ids=repr)
def test_what_is_no_place_is_not_inside(base) -> None:
    lon = np.array([np.nan, 0.0, np.inf, 0.0, 0.0, 1e4, 180.0])
    lat = np.array([0.0, np.nan, 0.0, 90.5, -91.0, 0.0, 0.0])
    assert base.inside(lon, lat).tolist() == [False] * 6 + [True]
    assert base.inside(np.zeros(0), np.zeros(0)).shape == (0,)


@pytest.mark.parametrize("kind", FLAT)
@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"extent": (10.0, 10.0, 0.0, 1.0)}, "west < east"),
        ({"extent": (170.0, -170.0, 0.0, 1.0)}, "add 360"),
        ({"extent": (-180.0, 181.0, 0.0, 1.0)}, "360 degrees"),
        ({"extent": (0.0, 1.0, 2.0, 2.0)}, "south < north"),
        ({"extent": (0.0, 1.0, 0.0, 86.0), "projection": "mercator"}, "no poles"),
        ({"extent": (0.0, 1.0, -86.0, 0.0), "projection": "mercator"}, "no poles"),
    ],
)
def test_wrong_extents_are_refused_with_words(kind, fields, says) -> None:
    [(field, text)] = kind(**fields).flaws()
    assert field == "extent" and says in text
    assert kind(**fields | {"extent": (0.0, 1.0, -85.06, 85.06)}).flaws() == []


def test_a_globe_stays_a_sphere() -> None:
    for steps in (SHEARED, (Scale(scale=(1.0, 1.0, 1.1)),), (Scale(scale=(1.0, 1.0, 1.0001)),)):
        [(field, text)] = GlobeBase(transform=steps).flaws()
        assert field == "transform" and "stretches" in text
    six_digits = Matrix(matrix=((0.866025, 0.0, 0.5, 0.0), (0.0, 1.0, 0.0, 0.0), (-0.5, 0.0, 0.866025, 0.0)))
    for steps in ((), TURNED, MIRRORED, (Scale(scale=-2.0),), (six_digits,)):
        assert GlobeBase(transform=steps).flaws() == []


@pytest.mark.parametrize("kind", KINDS)
def test_size_follows_the_transform(kind) -> None:
    base = kind()
    assert replace(base, transform=TURNED).size == pytest.approx(1.7 * base.size, rel=1e-12)
    assert replace(base, transform=MIRRORED).size == pytest.approx(1.7 * base.size, rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_base_is_read_from_a_file(kind) -> None:
    adapter = TypeAdapter(Base)
    read = adapter.validate_python({"type": kind.type, "material": "land", "transform": [{"scale": 2.0}]})
    assert read == kind(material="land", transform=(Scale(scale=2.0),))
    assert adapter.validate_json(adapter.dump_json(read)) == read
    assert read.object().material == "land"
    for wrong in (
        {"type": kind.type, "radios": 1.0},
        {"type": "cube"},
        {"type": kind.type, "center": [0.0, np.nan, 0]},
    ):
        with pytest.raises(ValidationError):
            adapter.validate_python(wrong)
