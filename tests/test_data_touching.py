"""Gizmos that lie in the map or in each other have a note, and lines that leave a map or go around the earth."""

import numpy as np
import pytest

import visray as vr
from visray.data.outlines import STEP
from visray.errors import UserError
from visray.scene.check import checked

PLACES = {"lon": [0.0, 20.0, 40.0], "lat": [0.0, 10.0, -10.0], "rain": [1.0, 2.0, -3.0]}


def notes(base: object, source: dict = PLACES, **fields) -> list[str]:
    layer = vr.DataLayer(**{"source": source, "height": "rain", "radius": 0.1, "color": "rain"} | fields)
    made = checked(vr.Scene(data=vr.Data(base=base, layers={"a": layer}), camera=vr.Camera(), lights={}))
    return [text for text in made.data.notes() if "noise" in text or "stand in" in text]


def test_ends_in_the_map_have_a_note() -> None:
    (text,) = notes(vr.MapBase(), lift=0.0)
    assert text.startswith("data.layers.a: 1 row is below the map") and "a lift, such as 0.01" in text
    assert (
        notes(vr.MapBase())
        == notes(vr.MapBase(), lift=0.01)
        == notes(vr.MapBase(), sunk=0.5)
        == notes(vr.GlobeBase())
        == []
    )
    (text,) = notes(vr.MapBase(), sunk=1.0)
    assert "2 rows are below" in text
    assert notes(vr.MapBase(), gizmo="sphere", height=None) == notes(vr.MapBase(), gizmo="disk", height=None) == []
    (text,) = notes(vr.MapBase(), gizmo="disk", height=None, lift=0.0)
    assert "the disks lie in the map" in text


@pytest.mark.parametrize("base", [vr.MapBase(), vr.GlobeBase()])
def test_rows_of_one_place_and_radius_have_a_note(base: object) -> None:
    source = {"lon": [180.0, 5.0, 0.0, -180.0, 5.0, 180.0], "lat": [3.0, 5, 5, 3, 5, 3], "rain": [1.0, 2, 3, 4, 5, 6]}
    (text,) = notes(base, source)
    # A map of the whole earth has one edge for 180 degrees west, and another for 180 degrees east.
    assert ("3 rows stand in" if isinstance(base, vr.GlobeBase) else "2 rows stand in") in text
    assert notes(base, source, radius="rain") == notes(base, source, color=None) == []


def test_the_note_on_rows_of_one_place_names_the_dates() -> None:
    source = {"lon": [5.0, 5.0], "lat": [5.0, 5.0], "rain": [1.0, 2.0]}
    for column, values, named in (
        ("the day", ["2020-01-01", "2020-01-02"], True),
        ("Year", [2001, 2002], True),
        ("the day", ["2020-01-01", "2020-01-01"], False),
        ("number", [2001, 2002], False),
        ("the day", ["2020-01-01", "soon"], False),
    ):
        (text,) = notes(vr.GlobeBase(), source | {column: values})
        assert (f'write "time": "{column}" into the layer' in text) == named
        assert (f'--time-column "{column}"' in text) == named
        assert ("give them different radii" in text) != named
    assert notes(vr.GlobeBase(), source | {"day": ["2020-01-01", "2020-01-02"]}, time="day") == []


def lines(coordinates: list, base: object) -> tuple[np.ndarray, np.ndarray, dict]:
    source = {"type": "MultiLineString", "coordinates": coordinates}
    layer = vr.DataLayer(source=source, gizmo="line", radius=0.01)
    rows = checked(vr.Scene(data=vr.Data(base=base, layers={"a": layer}), camera=vr.Camera(), lights={})).data.rows["a"]
    return rows.fields["a"].T, rows.fields["b"].T, rows.counts


MAP = vr.MapBase(width=360.0)
ACROSS = "segments across the edge of the map"


@pytest.mark.parametrize(
    ("line", "base", "length", "counts"),
    [
        ([[-180, -30], [180, -30]], MAP, 360, {}),  # the edge of a map of the earth, and not nothing
        ([[-100, 0], [80, 0]], MAP, 180, {}),
        ([[170, 20], [-170, 20]], MAP, 0, {ACROSS: 1}),
        ([[170, 20], [190, 20]], MAP, 0, {ACROSS: 1}),
        ([[350, 50], [10, 50]], MAP, 20, {}),
        ([[170, 20], [-170, 20]], vr.MapBase(width=360.0, extent=(0, 360, -90, 90)), 20, {}),
        (
            [[0, 0], [0, 89]],
            vr.MapBase(width=360.0, extent=(-180, 180, -80, 80)),
            0,
            {"segments outside of the map": 1},
        ),
    ],
)
def test_lines_on_a_map_are_straight_and_cross_no_edge(line: list, base: object, length: float, counts: dict) -> None:
    a, b, found = lines([line], base)
    assert np.linalg.norm(b - a, axis=1).sum() == pytest.approx(length) and found == counts


@pytest.mark.parametrize("ends", [(170, -170), (-170, 170), (350, 10), (-350, -10), (-10, 10), (359, 19)])
def test_lines_on_a_globe_go_the_short_way(ends: tuple[float, float]) -> None:
    globe = vr.GlobeBase()
    a, b, counts = lines([[[ends[0], 0], [ends[1], 0]]], globe)
    assert np.linalg.norm(b - a, axis=1).sum() == pytest.approx(np.radians(20), rel=1e-3) and counts == {}
    # The pieces are joined, and begin and end at the ends.
    assert np.abs(a[1:] - b[:-1]).max() < 1e-12 and len(a) == 20 / STEP
    for x, lon in ((a[0], ends[0]), (b[-1], ends[1])):
        assert x == pytest.approx(globe.place([lon], [0]).point[0], abs=1e-12)


@pytest.mark.parametrize("base", [MAP, vr.GlobeBase()])
@pytest.mark.parametrize(
    ("line", "message"),
    [
        ([[400000, 4500000], [400100, 4500100]], "out of range: row 0 (400000, 4.5e+06), row 0"),
        ([[41, 120], [42, 121]], "longitudes and latitudes look swapped"),
    ],
)
def test_lines_that_are_not_on_earth_are_refused(base: object, line: list, message: str) -> None:
    with pytest.raises(UserError) as caught:
        lines([line], base)
    (text,) = caught.value.lines
    assert text.startswith("data.layers.a.source: ") and message in text
