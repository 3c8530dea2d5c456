"""What a layer may be given in place of columns: arrays, names, colours; and how legends call them."""

import warnings

import numpy as np
import pytest

import visray as vr
from visray.data.name_column import NAME_COLUMNS, name_column
from visray.data.table import Table, as_texts
from visray.errors import UserError
from visray.legend.content import legend_content
from visray.scene.check import checked

TABLE = {"lon": [0.0, 20.0, 40.0, 60.0], "lat": [0.0, 10.0, 20.0, 0.0], "rain": [1.0, 2.0, 3.0, 5.0]}
NUMBERS = [4.0, 7.0, 9.0, 8.0]
TOWNS = ["Berlin", "Wien", "Bern", "Rom"]


def scene(legend: vr.Legend | None = None, **fields) -> vr.Scene:
    layer = vr.DataLayer(**{"source": TABLE} | fields)
    camera = vr.Camera(origin=(4.0, 2.0, -1.0))
    return checked(vr.Scene(camera=camera, data=vr.Data(layers={"caps": layer}, legend=legend), lights={}))


def refused(**fields) -> tuple[str, ...]:
    with pytest.raises(UserError) as caught:
        scene(**fields)
    return caught.value.lines


def written_again(made: vr.Scene, folder) -> vr.Scene:
    (folder / "scene.json").write_text(vr.dump(made))
    return vr.load(folder / "scene.json")


# Arrays


@pytest.mark.parametrize("kind", [list, np.array, tuple])
@pytest.mark.parametrize("key", ["height", "radius", "color"])
def test_numbers_are_those_of_a_column(tmp_path, key: str, kind: type) -> None:
    given, of_column = scene(**{key: kind(NUMBERS)}), scene(source=TABLE | {"v": NUMBERS}, **{key: "v"})
    rows, wanted = (x.data.rows["caps"] for x in (given, of_column))
    assert rows.values[key].tolist() == NUMBERS
    for a, b in ((rows.stand.height, wanted.stand.height), (rows.stand.radius, wanted.stand.radius)):
        assert np.array_equal(a, b)
    assert key != "color" or np.array_equal(rows.color, wanted.color)
    again = written_again(given, tmp_path)
    assert again == given and again.hash() == given.hash()
    assert vr.value(vr.replaced(given, f"data.caps.2.{key}", 6.0), f"data.caps.2.{key}") == 6.0


def test_three_numbers_are_a_colour_or_those_of_three_rows() -> None:
    three = {name: values[:3] for name, values in TABLE.items()}
    assert "color" not in scene(source=three, color=[0.1, 0.2, 0.3]).data.rows["caps"].values
    assert scene(source=three, color=[4, 5, 600]).data.rows["caps"].values["color"].tolist() == [4, 5, 600]
    (line,) = refused(color=[0, 0, 255])
    assert "lon has 4, lat has 4, color has 3; one colour is three numbers from 0 to 1" in line


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"height": [1, 2]}, "all columns need the same number of rows: lon has 4, lat has 4, height has 2"),
        ({"name": ["a"]}, "lon has 4, lat has 4, name has 1"),
        ({"height": [1, "a", 2, 3]}, 'height = [1, "a", 2, 3]: must be the name of a column, or a list of numbers'),
        ({"height": {"colum": "rain"}}, "height: the key 'column' is missing"),
        ({"height": True}, "height = true: must be an object"),
        ({"radius": -1}, "radius = -1: must be at least 0"),
        ({"color": {"column": "rain", "palete": "x"}}, "palete: unknown key; did you mean 'palette'?"),
        ({"name": 5}, "name = 5: must be a string or a list"),
    ],
)
def test_what_is_no_list_of_numbers_is_refused(fields: dict, says: str) -> None:
    assert says in refused(**fields)[0]


# Names of rows


@pytest.mark.parametrize("kind", [list, np.array])
def test_names_are_given_as_a_list(tmp_path, kind: type) -> None:
    made = scene(name=kind(TOWNS), height="rain", legend=vr.Legend(places="all"))
    assert made.data.rows["caps"].texts == tuple(TOWNS)
    assert {p.name for p in legend_content(made).places} <= set(TOWNS) and legend_content(made).places
    assert written_again(made, tmp_path) == made
    bare = scene(source=None, lon=TABLE["lon"], lat=TABLE["lat"], name=kind(TOWNS))
    assert bare.data.rows["caps"].texts == tuple(TOWNS)


def test_the_first_column_of_texts_holds_names() -> None:
    named = scene(source=TABLE | {"Hauptstadt": TOWNS}, height="rain", legend=vr.Legend(places=("Berlin",)))
    assert named.data.rows["caps"].texts == tuple(TOWNS)
    assert [p.name for p in legend_content(named).places] == ["Berlin"]
    for usual in NAME_COLUMNS:
        table = {"Hauptstadt": as_texts(TOWNS), usual.title(): as_texts(TOWNS[::-1])}
        assert name_column(Table(list(table), table)) == usual.title()
    mixed = {"a": np.arange(4.0), "b": as_texts(["1", "2", "x", ""]), "c": as_texts(["1", "x", "y", ""])}
    assert name_column(Table(list(mixed), mixed)) == "c"
    assert name_column(Table(["a"], {"a": mixed["a"]})) is None


def test_rows_without_names_have_a_note() -> None:
    for places in ("all", ("Berlin",)):
        (note,) = legend_content(scene(height="rain", legend=vr.Legend(places=places))).notes
        assert "no layer has a column of names; give a layer the field name" in note


# One colour


def test_a_colour_has_a_name_if_no_column_has_it() -> None:
    named, hexed = (scene(color=c).data.rows["caps"].color for c in ("tomato", "#ff6347"))
    assert np.array_equal(named, hexed)
    rows = scene(source=TABLE | {"tomato": NUMBERS}, color="tomato").data.rows["caps"]
    assert rows.values["color"].tolist() == NUMBERS
    for near in ("Tomato", "tomatoes"):
        (line,) = refused(source=TABLE | {near: NUMBERS}, color="tomato")
        assert f'there is no column "tomato"; did you mean "{near}"?' in line
    assert 'there is no column "blurb"' in refused(color="blurb")[0]


# Legends


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"height": "rain"}, ["rain"]),
        ({"value": "rain"}, ["rain"]),
        ({"value": NUMBERS}, ["value", "caps"]),
        ({"height": NUMBERS}, ["height", "caps"]),
        ({"gizmo": "sphere", "radius": NUMBERS}, ["radius", "caps"]),
        ({"color": NUMBERS}, ["color", "caps"]),
        ({"value": NUMBERS, "color": vr.ColorRule(column="value")}, ["value", "caps"]),
    ],
)
def test_labels_and_units_are_for_what_is_shown(fields: dict, names: list[str]) -> None:
    def labels(legend: vr.Legend) -> set[str]:
        content = legend_content(scene(legend=legend, **fields))
        assert not [note for note in content.notes if "no column" in note]
        return {x.label for x in (*content.bars, *content.sizes)}

    assert labels(vr.Legend()) == {names[-1]}
    for name in names:
        assert labels(vr.Legend(labels={name: "Rain"}, units={name: "mm"})) == {"Rain (mm)"}


@pytest.mark.parametrize("field", ["labels", "units"])
def test_labels_of_no_column_have_a_note(field: str) -> None:
    made = scene(height="rain", legend=vr.Legend(**{field: {"rian": "mm"}}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (note,) = legend_content(made).notes
    assert note == f'legend.{field}: no column "rian" is shown; did you mean "rain"? (one of rain)'


# Addresses


@pytest.mark.parametrize(
    ("address", "right"),
    [("data.layers.caps.rows.3", "data.caps.3.height"), ("data.layers.caps.rows.3.lon", "data.caps.3.lon")],
)
def test_an_address_below_rows_leads_to_that_of_the_row(address: str, right: str) -> None:
    with pytest.raises(UserError) as caught:
        vr.replaced(scene(height="rain"), address, 5.0)
    assert caught.value.lines[0].endswith(f"write {right}")
    assert vr.value(vr.replaced(scene(height="rain"), right, 5.0), right) == 5.0
