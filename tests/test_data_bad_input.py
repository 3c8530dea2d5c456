"""Data scenes with wrong or odd values: one line that names the address, and scenes that stay equal when written."""

import copy
import gc
import json
import os
import pickle
import warnings
import weakref
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray.data import resolve, shown_rows
from visray.data.gizmos import GIZMOS
from visray.data.number_column import NumberColumn
from visray.errors import UserError
from visray.legend.content import legend_content
from visray.scene.check import checked

TABLE = {"lon": [0.0, 90.0, -90.0], "lat": [0.0, 10.0, -20.0], "rain": [1.0, 2.0, 3.0], "heat": [5.0, None, -3.0]}
OUTLINE = {"type": "LineString", "coordinates": [[0, 0], [10, 10], [30, 5]]}


def scene(**fields) -> vr.Scene:
    fields = {"source": TABLE} | fields
    sizes = {"radius": 0.1} if fields.get("gizmo") == "line" else {"value": "rain"}
    return vr.Scene(data=vr.Data(layers={"rain": vr.DataLayer(**sizes | fields)}), camera=vr.Camera(), lights={})


def loaded(folder: Path, layer: dict) -> vr.Scene:
    (folder / "rain.csv").write_text("name,lon,lat,rain\nA,0,0,1\nB,90,10,2\n")
    (folder / "scene.json").write_text(json.dumps({"data": {"layers": {"rain": layer}}, "camera": {}, "lights": {}}))
    return vr.load(folder / "scene.json")


@pytest.mark.parametrize(
    ("layer", "message"),
    [
        ({"source": "rain.csv", "name": "nam"}, 'data.layers.rain.name = "nam": there is no such column; did you mean'),
        ({"lon": [1], "lat": [2], "name": "town"}, 'data.layers.rain.name = "town": there is no such column, as the'),
        (
            {"source": "rain.csv", "rows": {"one": {"lon": 2}}},
            'data.layers.rain.rows: "one" is not the number of a row',
        ),
        ({"source": {"lon": "lon", "lat": [1]}}, 'column "lon" has the shape (): it is a single value; give a list'),
        ({"source": "wind.csv"}, 'source = "wind.csv": there is no such file'),
    ],
)
def test_wrong_layers_have_one_line_with_an_address(tmp_path, layer: dict, message: str) -> None:
    with pytest.raises(UserError) as caught:
        loaded(tmp_path, layer)
    (line,) = caught.value.lines
    assert line.startswith(f"{tmp_path}/scene.json: data.layers.rain.") and message in line.replace(f"{tmp_path}/", "")
    assert line.count("wind.csv") <= 1


@pytest.mark.parametrize("source", ["rain.csv\0", "pipe.csv", "/dev/zero", "x" * 300 + ".csv", "loop.csv"])
@pytest.mark.parametrize("allow_outside", [False, True])
def test_sources_that_are_no_files_are_refused(tmp_path, source: str, allow_outside: bool) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    (tmp_path / "scene.json").write_text(
        json.dumps({"data": {"layers": {"rain": {"source": source}}}, "camera": {}, "lights": {}})
    )
    with pytest.raises(UserError) as caught:
        vr.load(tmp_path / "scene.json", allow_outside=allow_outside)
    (line,) = caught.value.lines
    assert line.startswith(f"{tmp_path}/scene.json: data.layers.rain.source = ")


@pytest.mark.parametrize(
    ("palette", "message"),
    [
        ([[float("inf"), "#000000"], [1, [1, 1, 1]]], "data.layers.rain.color.palette.0.0 = Infinity: must be finite"),
        ([[0, "#000000"], [1, [1, "a", 1]]], "data.layers.rain.color.palette"),
        ([[0, float("nan"), 0], "red"], "data.layers.rain.color.palette"),
    ],
)
def test_wrong_palettes_have_messages_with_addresses(tmp_path, palette: list, message: str) -> None:
    with pytest.raises(UserError) as caught:
        loaded(tmp_path, {"source": "rain.csv", "radius": 0.1, "color": {"column": "rain", "palette": palette}})
    assert caught.value.lines[0].startswith(f"{tmp_path}/scene.json: {message}")
    assert all(line.startswith(f"{tmp_path}/scene.json: data.layers.rain.color.palette") for line in caught.value.lines)


@pytest.mark.parametrize("number", ["9" * 30, "9" * 5000, "01", "\uff11", "\u00b2", "1e0", "-1", ""])
def test_what_is_no_number_of_a_row_is_no_address(number: str) -> None:
    made = checked(scene())
    with pytest.raises(UserError, match=r"data\.rain"):
        vr.value(made, f"data.rain.{number}.lon")
    with pytest.raises(UserError, match=r"data\.rain"):
        vr.replaced(made, f"data.rain.{number}.lon", 1.0)
    assert f"data.rain.{number}" not in made.all_objects


@pytest.mark.parametrize("given", [[1, None, 3], [-0.0, 1, 2], np.array([1, -np.nan, 3])])
def test_columns_with_missing_numbers_are_equal_when_they_are_read_again(tmp_path, given: list) -> None:
    sources = [
        {"lon": [1, 2, 3], "lat": [3, 4, 5], "value": given},
        {"source": TABLE | {"rain": given}, "value": "rain"},
    ]
    for source in sources:
        made = checked(vr.Scene(data=vr.Data(layers={"a": vr.DataLayer(**source)}), camera=vr.Camera(), lights={}))
        (tmp_path / "scene.json").write_text(vr.dump(made))
        again = vr.load(tmp_path / "scene.json")
        assert again == made and again.hash() == made.hash() and hash(again.data.layers["a"].source) is not None
    a, b = (checked(scene(source=TABLE | {"rain": [x, 1, 2]})) for x in (0.0, -0.0))
    assert a.data.layers["rain"].source.digest == b.data.layers["rain"].source.digest


@pytest.mark.parametrize("gizmo", [name for name in GIZMOS if name != "geometry"])
def test_a_scene_has_its_hash_before_and_after_it_is_checked_copied_and_pickled(gizmo: str) -> None:
    given = scene(gizmo=gizmo, **({"source": OUTLINE} if gizmo == "line" else {}))
    made = checked(given)
    assert made.data.rows["rain"].number.size > 0
    for twin in (given, pickle.loads(pickle.dumps(made)), copy.deepcopy(made)):
        assert twin.hash() == made.hash()
        assert checked(twin) == made


def test_tables_with_other_cells_have_other_digests() -> None:
    tables = [["a\0b", "c", "d"], ["a", "b\0c", "d"], ["a", "b", "c\0d"]]
    hashes = {scene(source=TABLE | {"name": names}).hash() for names in tables}
    assert len(hashes) == len(tables)
    assert scene(source=TABLE | {"\ud800": [1, 2, 3]}).hash() not in hashes


@pytest.mark.parametrize(
    "value",
    [np.ones(3) * 1j, np.array(["2020-01-01"] * 3, "M8[D]"), np.array([b"1"] * 3), np.ones((3, 1)), {"a": 2}, 5],
)
def test_what_is_no_column_of_numbers_is_refused(value: object) -> None:
    with pytest.raises(UserError, match=r"^DataLayer: value = .*must be the name of a column"):
        checked(scene(value=value))


def test_a_flaw_of_two_properties_is_told_once_and_a_path_is_a_source(tmp_path) -> None:
    with pytest.raises(UserError) as caught:
        checked(scene(value="wind"))
    assert len(caught.value.lines) == 1
    loaded(tmp_path, {"source": "rain.csv"})
    made = checked(scene(source=tmp_path / "rain.csv"))
    assert made.hash() == checked(scene(source=str(tmp_path / "rain.csv"))).hash()
    assert len(made.data.rows["rain"]) == 2


def test_layers_that_were_changed_in_place_are_noticed() -> None:
    prepared = vr.prepare(scene())
    prepared.scene.data.layers["other"] = vr.DataLayer(source=TABLE)
    with pytest.raises(UserError, match="changed in place"):
        prepared.updated({"data.rain.0.height": 2.0})


def test_the_legend_of_a_layer_without_rows_says_nothing() -> None:
    rule = vr.SizeRule(column="none", scale="log", domain=(1, 2), range=(0.1, 0.2))
    made = checked(scene(source=TABLE | {"none": [None, None, None]}, height=rule, radius=0.1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        content = legend_content(replace(made, data=replace(made.data, legend=vr.Legend(title="T"))))
    assert content.sizes == content.bars == content.notes == ()


def test_large_layers_are_forgotten_and_small_ones_are_not_resolved_again(monkeypatch) -> None:
    made = checked(scene())
    again = checked(made)
    assert again.data is not made.data and again.data.rows["rain"] is made.data.rows["rain"]
    monkeypatch.setattr(resolve, "FEW_ROWS", 2)
    large = checked(scene(radius=0.125))
    kept = weakref.ref(large.data.rows["rain"])
    assert checked(large).data.rows["rain"] is kept()
    del large
    gc.collect()
    assert kept() is None


def test_an_update_after_a_file_has_changed_shows_the_new_rows(tmp_path) -> None:
    first = loaded(tmp_path, {"source": "rain.csv", "value": "rain", "radius": 0.3})
    first = replace(first, film=vr.Film(width=16, height=12), settings=vr.Settings(spp=1))
    prepared = vr.prepare(first)
    vr.render(prepared, progress=False)
    (tmp_path / "rain.csv").write_text("name,lon,lat,rain\nA,0,0,1\nB,-90,60,2\n")
    found = vr.render(prepared.updated({"ambient": (0.5, 0.5, 0.5)}), progress=False)
    expected = vr.render(vr.replaced(first, "ambient", (0.5, 0.5, 0.5)), progress=False)
    assert found.metadata["scene_hash"] == expected.metadata["scene_hash"]
    assert np.array_equal(found["RGB"], expected["RGB"])


def test_odd_sizes_warn_of_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rule = vr.SizeRule(column="rain", scale="sqrt", range=(0.2, 0.2))
        rows = checked(scene(source=TABLE | {"rain": [0.0, 1.0, 4.0]}, height=rule, radius=0.1)).data.rows["rain"]
        # At 0 the gizmo would turn down, from 0.2 to -0.2.
        assert rows.slopes["height"].tolist() == [np.inf, 0, 0] and rows.stand.height.tolist() == [0.2, 0.2, 0.2]
        vr.SizeRule(column="a", scale="log").sizes(np.array([0.0, 1, 2]), (0, 1))


def test_more_rows_than_fit_into_memory_are_refused_with_an_estimate(monkeypatch) -> None:
    rows = 10_000_000
    column = np.broadcast_to(1.0, rows)
    monkeypatch.setattr(shown_rows.memory, "free", lambda: shown_rows.memory.Free(2**30, "are free"))
    found = shown_rows.ShownRows(
        vr.DataLayer(lon=NumberColumn(column), lat=NumberColumn(column), radius=0.1, height=0.1), vr.GlobeBase()
    )
    (flaw,) = found.flaws
    assert flaw[0] == "source" and "has 10,000,000 rows, which need about 14.9 GiB, 1.0 GiB are free; take" in flaw[1]
