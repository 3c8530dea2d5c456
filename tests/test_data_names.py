"""The column with the names of rows: the command and scenes find the same one."""

import numpy as np
import pytest

import visray as vr
from visray.data.name_column import NAME_COLUMNS, name_column
from visray.data.reading import read_table
from visray.data_picture import Wishes, data_picture
from visray.legend.content import legend_content
from visray.scene.check import checked

CASES = [
    *(f"lon,lat,code,{name}" for name in NAME_COLUMNS),
    *(f"lon,lat,code,{name.upper()}" for name in NAME_COLUMNS),
    "lon,lat,kind,Hauptstadt",  # the kind is a text too, but always the same
    "lon,lat,number,Hauptstadt",
]
ROWS = ((13.4, 52.5, "Berlin"), (2.35, 48.85, "Paris"), (-3.7, 40.4, "Madrid"))


@pytest.mark.parametrize("header", CASES)
def test_the_command_and_scenes_name_the_same_rows(tmp_path, header):
    third = header.split(",")[2]
    values = {"code": ("DE", "FR", "ES"), "kind": ("big",) * 3, "number": ("1", "2", "3")}[third]
    path = tmp_path / "capitals.csv"
    path.write_text("\n".join([header, *(f"{x},{y},{v},{name}" for (x, y, name), v in zip(ROWS, values))]) + "\n")
    assert name_column(read_table(path)) == header.split(",")[3]
    made = data_picture(str(path), Wishes(), "map.png").scene
    assert {place.name for place in legend_content(made).places} == {name for *_, name in ROWS}
    layer = vr.DataLayer(source=str(path), height=0.1)
    scene = checked(
        vr.Scene(
            data=vr.Data(layers={"capitals": layer}, legend=vr.Legend(places="all")), camera=vr.Camera(), lights={}
        )
    )
    assert scene.data.rows["capitals"].texts == tuple(name for *_, name in ROWS)


@pytest.mark.parametrize("places", ["all", ("Berlin",)])
def test_without_names_the_legend_says_so(places):
    lon, lat, _ = (list(column) for column in zip(*ROWS))
    layer = vr.DataLayer(source={"lon": lon, "lat": lat, "v": np.arange(3.0)}, value="v")
    scene = checked(
        vr.Scene(
            data=vr.Data(layers={"capitals": layer}, legend=vr.Legend(places=places)), camera=vr.Camera(), lights={}
        )
    )
    notes = legend_content(scene).notes
    assert [note for note in notes if "no layer has a column of names" in note] and not legend_content(scene).places
    assert not any("has the name" in note for note in notes)
