"""GeoJSON as a table: points as rows, lines and polygons as outlines, and what is refused in one line."""

import copy
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visray import memory
from visray.data.describe import describe
from visray.data.geojson import GEOMETRIES, from_geojson
from visray.data.geojson_text import to_geojson
from visray.data.positions import position_columns
from visray.data.reading import read_table
from visray.data.table import Table
from visray.errors import UserError

NAN = float("nan")
SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]
# Coordinates of a geometry of each type.
COORDINATES = {
    "Point": [2, 41],
    "MultiPoint": [[2, 41], [3, 42, 9]],
    "LineString": [[0, 0], [1, 1], [2, 0]],
    "MultiLineString": [[[0, 0], [1, 1]], [[5, 5], [6, 6], [7, 7]]],
    "Polygon": [SQUARE, [[0.2, 0.2], [0.4, 0.2], [0.4, 0.4], [0.2, 0.2]]],
    "MultiPolygon": [[SQUARE], [[[5, 5], [6, 5], [6, 6], [5, 5]]]],
}


def geometry(kind: str) -> dict:
    return {"type": kind, "coordinates": COORDINATES[kind]}


def feature(shape: dict | None, **properties) -> dict:
    return {"type": "Feature", "geometry": shape, "properties": properties}


def collection(*features: dict, **more) -> dict:
    return {"type": "FeatureCollection", "features": list(features), **more}


def refusal(function, *arguments) -> str:
    """The message of the UserError that a call raises: it must be one line."""
    with pytest.raises(UserError) as caught:
        function(*arguments)
    (line,) = caught.value.lines
    assert line.isprintable() and len(line) < 600
    return line


@pytest.fixture
def table(tmp_path: Path):
    """Function that reads a table from JSON, or from a text."""

    def read(content: object, name: str = "a.geojson") -> Table:
        path = tmp_path / name
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return read_table(path)

    return read


def test_points_with_properties(table):
    read = table(
        collection(feature(geometry("Point"), name="Vic", rain=5), feature(geometry("Point"), rain=2.5, wet=True))
    )
    assert read.names == ["lon", "lat", "name", "rain", "wet"] and position_columns(read) == ("lon", "lat")
    assert read.columns["lon"].tolist() == [2, 2] and read.columns["lat"].tolist() == [41, 41]
    assert read.texts("name").tolist() == ["Vic", ""] and read.columns["rain"].tolist() == [5, 2.5]
    np.testing.assert_array_equal(read.columns["wet"], [NAN, 1])
    assert read.notes == ['column "wet": true is read as 1, and false as 0'] and not read.lines


def positions(coordinates: list) -> list:
    """The positions in nested coordinates."""
    return [coordinates] if isinstance(coordinates[0], (int, float)) else [p for c in coordinates for p in positions(c)]


@pytest.mark.parametrize("kind", GEOMETRIES)
@pytest.mark.parametrize("wrap", ["bare", "feature", "collection", "nested"])
def test_every_geometry_in_every_place(table, kind, wrap):
    shape = geometry(kind)
    if wrap == "nested":
        shape = {"type": "GeometryCollection", "geometries": [{"type": "GeometryCollection", "geometries": [shape]}]}
    read = table({"bare": shape, "nested": shape, "feature": feature(shape)}.get(wrap, collection(feature(shape))))
    wanted = [p[:2] for p in positions(COORDINATES[kind])]
    if "Point" in kind:
        assert np.column_stack([read.columns["lon"], read.columns["lat"]]).tolist() == wanted and not read.lines
    else:
        assert len(read) == 1 and {row for row, _ in read.lines} == {0} and "lon" not in read.names
        assert np.concatenate([line for _, line in read.lines]).tolist() == wanted
    if kind == "MultiPoint":
        np.testing.assert_array_equal(read.columns["altitude"], [NAN, 9])


def test_rows_of_features_with_several_geometries(table):
    several = {"type": "GeometryCollection", "geometries": [geometry(kind) for kind in GEOMETRIES]}
    read = table(collection(feature(geometry("Point"), n=1), feature(several, n=2), feature(None, n=3)))
    # The first point; three points, and a row for all outlines; and a row without a geometry.
    assert read.columns["n"].tolist() == [1, 2, 2, 2, 2, 3]
    np.testing.assert_array_equal(read.columns["lon"], [2, 2, 2, 3, NAN, NAN])
    assert {row for row, _ in read.lines} == {4} and len(read.lines) == 7
    assert read.notes == ["1 feature has no geometry"]
    assert len(table(collection(feature({"type": "Point", "coordinates": []}, n=1)))) == 1


def test_rings_are_closed(table):
    read = table({"type": "Polygon", "coordinates": [SQUARE[:-1]]})
    assert read.lines[0][1].tolist() == SQUARE and read.notes == ["1 ring is open; visray closes them"]
    line = table({"type": "LineString", "coordinates": SQUARE[:-1]}).lines[0][1]
    assert line.tolist() == SQUARE[:-1]


def test_properties_of_any_kind(table):
    read = table(
        collection(
            {**feature(geometry("Point"), lat=7, a=1, big=2**60, list=[1], none=None), "id": "x"},
            {**feature(geometry("Point"), lat=8, a="q", big=3, code="007"), "id": 4},
            {"type": "Feature", "geometry": geometry("Point"), "properties": None},
        )
    )
    assert read.columns["lat"].tolist() == [41] * 3
    np.testing.assert_array_equal(read.columns["lat (property)"], [7, 8, NAN])
    assert read.texts("a").tolist() == ["1", "q", ""] and read.texts("big").tolist() == [str(2**60), "3", ""]
    assert read.texts("list").tolist() == ["[1]", "", ""] and read.texts("id").tolist() == ["x", "4", ""]
    assert np.isnan(read.columns["none"]).all() and read.numbers("code")[0].tolist()[1] == 7
    assert any("numbers and other values" in note for note in read.notes) and any(
        '"lat"' in note for note in read.notes
    )


@pytest.mark.parametrize(
    "name", ["urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326", "WGS 84", "http://opengis.net/def/crs/OGC/1.3/CRS84"]
)
def test_wgs84_is_read(table, name):
    assert len(table(collection(feature(geometry("Point")), crs={"type": "name", "properties": {"name": name}}))) == 1


def of_point(coordinates: object) -> dict:
    return collection(feature({"type": "Point", "coordinates": coordinates}))


# Contents that are refused, and a part of the message.
REFUSED = [
    (of_point([1, "2"]), 'features.0.geometry.coordinates = [1, "2"]: must be a list of two finite numbers'),
    *(
        (of_point(bad), "features.0.geometry.coordinates = ")
        for bad in ([1], [True, 2], [1, None], 3, "1,2", [[1, 2]], {})
    ),
    ('{"type": "Point", "coordinates": [NaN, 1]}', "coordinates = [NaN, 1]"),
    ('{"type": "Point", "coordinates": [1e999, 1]}', "coordinates = [Infinity, 1]"),
    (collection(), "the file has no features"),
    ({"type": "FeatureCollection"}, "features = null: must be a list of features"),
    (collection({"type": "Point"}), 'features.0 = {"type": "Point"}: must be an object with "type": "Feature"'),
    (collection({"type": "Feature", "properties": {}}), 'must have a "geometry"'),
    (collection({"type": "Feature", "geometry": None, "properties": [1]}), "features.0.properties = [1]: must be"),
    (collection(feature({"type": "Pt"})), 'features.0.geometry.type = "Pt": must be one of Point'),
    (collection(feature([1])), "features.0.geometry = [1]: must be one of Point"),
    ({"type": "LineString", "coordinates": [[0, 0]]}, "coordinates = [[0, 0]]: a line must have at least 2"),
    ({"type": "LineString", "coordinates": [0, 0]}, "coordinates.0 = 0: must be a list of two"),
    ({"type": "Polygon", "coordinates": [[[0, 0], [1, 1], [0, 0]]]}, "a ring of a polygon must have at least 4"),
    ({"type": "MultiPolygon", "coordinates": [[3]]}, "coordinates.0.0 = 3: must be a list of positions"),
    ({"type": "GeometryCollection"}, "geometries = null: must be a list of geometries"),
    (collection(feature(None), crs={"properties": {"name": "EPSG:3857"}}), 'crs = "EPSG:3857": visray reads'),
    (collection(feature(None), crs={"properties": {"name": "EPSG:14326"}}), 'crs = "EPSG:14326": visray reads'),
    (collection(feature(None), crs={"type": "link"}), "ogr2ogr"),
    ({"type": "Topology", "arcs": []}, "is TopoJSON, not GeoJSON"),
    ({"a": 1}, "type is missing: must be FeatureCollection"),
    ({"type": ["x"]}, "must be FeatureCollection"),
    ([1], "type is missing"),
    ('{"type": "Point",\n "coordinates": [1 2]}', "line 2, column 20: is not JSON"),
    ('{"type": "Point", "type": "Point"}', "keys are written twice: type"),
    ("", "the file is empty"),
    ('{"type": "\\ud800", "x": "\\ud801"}', "half a character; write the whole one; errors like this: 2"),
    ("[" * 5000, "nested"),
]


@pytest.mark.parametrize(("content", "said"), REFUSED)
def test_refused(table, content, said):
    assert said in refusal(table, content)


def test_a_file_that_does_not_fit_into_memory(table, monkeypatch):
    monkeypatch.setattr(memory, "free", lambda: memory.Free(1000, "are free"))
    assert "takes about 0.0 GiB while it is read, and 0.0 GiB are free" in refusal(
        table, collection(*[feature(None)] * 9)
    )


def test_other_json(table):
    assert table({"lon": [1, 2], "lat": [3, None]}, "a.json").names == ["lon", "lat"]
    assert table([{"lon": 1, "lat": 2}, {"lon": 3}], "a.json").columns["lon"].tolist() == [1, 3]
    assert len(table(collection(feature(geometry("Point"))), "a.json")) == 1
    assert "is a scene" in refusal(table, {"typeScene": "REALDATA"}, "a.json")
    for scene in ({"camera": {}, "objects": {}, "lights": {}}, {"objects": {"ball": {"type": "sphere"}}}):
        line = refusal(table, scene, "a.json")
        assert re.search(r"a\.json: is a scene, not a table; visray render .*a\.json makes its picture$", line)
    for content in (3, None, "x", {}, [], [1], {"lon": [1, 2], "lat": 3}, {"lon": [1], "lat": [1, 2]}):
        assert refusal(table, content, "a.json")


TYPES = st.sampled_from([*GEOMETRIES, "Feature", "FeatureCollection", "GeometryCollection", "Topology", "x"])
KEYS = st.sampled_from(["type", "coordinates", "geometry", "geometries", "features", "properties", "crs", "lat", "a"])
LEAVES = st.one_of(st.none(), st.booleans(), st.floats(), st.integers(-(2**70), 2**70), TYPES, st.text(max_size=3))
TREES = st.recursive(LEAVES, lambda t: st.one_of(st.lists(t, max_size=3), st.dictionaries(KEYS, t, max_size=4)))


@settings(max_examples=200, derandomize=True, deadline=None)
@given(st.data())
def test_any_json_is_a_table_or_an_error_of_one_line(tmp_path_factory, data):
    """Valid files in which some value is replaced by another one."""
    shapes = [geometry(kind) for kind in GEOMETRIES]
    raw = copy.deepcopy(
        collection(
            *(feature(s, a=1, lat="x") for s in shapes), feature({"type": "GeometryCollection", "geometries": shapes})
        )
    )
    place, steps = raw, data.draw(st.integers(0, 6))
    for _ in range(steps):
        inner = [
            k
            for k in (place if isinstance(place, dict) else range(len(place)))
            if isinstance(place[k], (dict, list)) and place[k]
        ]
        if not inner:
            break
        place = place[data.draw(st.sampled_from(inner))]
    key = (
        data.draw(st.sampled_from(sorted(place)))
        if isinstance(place, dict)
        else data.draw(st.integers(0, len(place) - 1))
    )
    place[key] = data.draw(TREES)
    path = tmp_path_factory.mktemp("any") / "a.geojson"
    path.write_text(json.dumps(raw), encoding="utf-8")
    try:
        read = read_table(path)
    except UserError as error:
        assert len(error.lines) == 1 and error.lines[0].isprintable() and error.lines[0].startswith(str(path))
        return
    assert all(len(read.texts(name)) == len(read.numbers(name)[0]) == len(read) for name in read.names)
    assert all(0 <= row < len(read) and line.shape[1:] == (2,) and np.isfinite(line).all() for row, line in read.lines)
    assert json.dumps(describe(read)) and all(note.isprintable() for note in read.notes)


def test_a_table_becomes_geojson_and_is_read_again(table):
    several = {"type": "GeometryCollection", "geometries": [geometry(kind) for kind in GEOMETRIES]}
    labelled = feature(geometry("Polygon"), lon=2.0, lat=41.0), feature(geometry("LineString"), lon="", lat=None)
    contents = (
        collection(feature(several, n=2, name="a"), feature(None, n=None)),
        geometry("Polygon"),
        # Properties with the names of coordinates, such as where the label of an outline is.
        collection(*labelled),
        collection(labelled[0], feature(None, lon=1.0)),
        collection(labelled[0], feature(geometry("Point"), altitude="high")),
        collection(feature(geometry("Polygon"), altitude=3.0, lon=1.0, lat=1.0), feature(None, lat=2.0)),
    )
    for content in contents:
        read = table(content)
        again = from_geojson(json.loads(json.dumps(to_geojson(read), allow_nan=False)), "the table")
        assert again.names == read.names and len(again) == len(read)
        for name in read.names:
            np.testing.assert_array_equal(again.columns[name], read.columns[name])
        assert [(row, line.tolist()) for row, line in again.lines] == [(row, line.tolist()) for row, line in read.lines]


def test_the_same_from_python():
    raw = collection(feature(geometry("Point"), a=1), feature(geometry("Polygon"), a=2))
    read = from_geojson(raw, "the table")
    assert (
        read.columns["a"].tolist() == [1, 2]
        and len(read.lines) == 2
        and read.where is None
        and read.place(1) == "row 1"
    )
