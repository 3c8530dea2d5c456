"""`vr.data_scene`: the scene of `visray data`, from files and from tables of Python."""

import inspect
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.cli.data import data_command
from visray.data_picture import Wishes, data_picture
from visray.data_picture.in_python import in_python
from visray.scene.write import with_files

DATA = Path(__file__).resolve().parents[1] / "scenes" / "data"
TABLE = {
    "name": ["Oslo", "Paris", "Bern"], "lat": [59.9, 48.85, 46.95], "lon": [10.75, 2.35, 7.45],
    "rain": [760.0, 640.0, 1020.0], "people": [700000.0, 2100000.0, 134000.0],
}  # fmt: skip
# Options of the command that concern the picture, and not the scene.
OF_PICTURES = {
    "file", "output", "save", "describe", "error", "time", "threads", "quiet", "json", "overwrite", "show", "preview",
    "filter", "region", "scale",
}  # fmt: skip
# Parameters that the command has no option for: it takes a file, and names the map after the scene.
OF_PYTHON = {"table", "map_file"}


def without_paths(scene: vr.Scene) -> vr.Scene:
    return with_files(scene, lambda _: "file")


def test_every_option_of_the_command_that_changes_the_scene_is_a_parameter():
    options, own = (set(inspect.signature(f).parameters) for f in (data_command, vr.data_scene))
    assert own - OF_PYTHON == options - OF_PICTURES


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("cities.csv", {"height": "population", "color": "rain", "base": "globe"}),
        ("ports.csv", {"color": "january", "places": "all", "title": "Ports", "palette": "RdBu", "norm": "symmetric"}),
        ("earthquakes.csv", {"radius": "magnitude", "color": "depth", "gizmo": "sphere", "source_line": "USGS"}),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_the_scene_is_that_of_the_command(tmp_path, monkeypatch, name, words):
    monkeypatch.chdir(tmp_path)
    options = [x for key, value in words.items() for x in (f"--{key.replace('_', '-')}", value)]
    size = ["--size", "96x64", "--spp", "1", "--quiet"]
    assert main(["data", str(DATA / name), *options, "--save", "scene.json", "-o", "a.png", *size]) == 0
    saved = vr.load("scene.json", allow_outside=True)
    made = vr.data_scene(DATA / name, **words, size=(96, 64), spp=1)
    assert without_paths(made) == without_paths(saved)
    assert Path(made.textures["map"].file).read_bytes() == Path("scene-map.png").read_bytes()


@pytest.mark.parametrize("kind", ["file", "dict", "records", "array"])
def test_all_tables_have_the_same_scene(tmp_path, kind):
    rows = list(zip(*TABLE.values()))
    path = tmp_path / "places.csv"
    path.write_text("\n".join([",".join(TABLE), *(",".join(map(str, row)) for row in rows)]) + "\n")
    array = np.array(rows, [(k, "U9" if k == "name" else "f8") for k in TABLE])
    records = [dict(zip(TABLE, row)) for row in rows]
    made = vr.data_scene({"file": path, "dict": TABLE, "records": records, "array": array}[kind])
    expected = data_picture(str(path), Wishes(), "map.png").scene
    (layer,), (of_file,) = made.data.layers.items(), expected.data.layers.items()
    assert layer[0] == ("places" if kind == "file" else "table")
    assert replace(layer[1], source=None) == replace(of_file[1], source=None)
    for part in ("camera", "lights", "film", "materials", "background", "settings"):
        assert getattr(made, part) == getattr(expected, part)
    assert (made.data.base, made.data.legend) == (expected.data.base, expected.data.legend)
    assert vr.value(made, f"data.{layer[0]}.1.height") == TABLE["rain"][1]
    assert vr.value(vr.replaced(made, f"data.{layer[0]}.1.height", 5.0), f"data.{layer[0]}.1.height") == 5


def test_the_drawn_map_is_kept_where_it_is_asked_for_and_replaces_no_other_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first = vr.data_scene(TABLE, map_file="map.png", size=(96, 64))
    assert first.textures["map"].file == "map.png" and list(Path().iterdir()) == [Path("map.png")]
    drawn = np.asarray(Pillow.open("map.png"))
    # A map that was drawn before is replaced by another.
    vr.data_scene(TABLE, base="globe", map_file="map.png", size=(96, 64))
    assert np.asarray(Pillow.open("map.png")).shape != drawn.shape
    Path("text.png").write_text("no picture")
    Pillow.new("RGB", (2, 1)).save("own.png")
    vr.Image({"RGB": np.ones((2, 3, 3), np.float32)}).write("rendered.png")
    for name in ("text", "own", "rendered"):
        before = Path(f"{name}.png").read_bytes()
        with pytest.raises(vr.UserError, match=f"map_file = '{name}.png': there is a file that is no map drawn by"):
            vr.data_scene(TABLE, map_file=f"{name}.png", size=(96, 64))
        assert Path(f"{name}.png").read_bytes() == before
    with pytest.raises(vr.UserError, match="a map is a PNG file; end the name in"):
        vr.data_scene(TABLE, map_file="map.jpg")
    with pytest.raises(vr.UserError, match="map_file: goes with a map that is drawn"):
        vr.data_scene(TABLE, map="own.png", extent=(0, 20, 40, 60), map_file="new.png")
    made = vr.data_scene(TABLE, map="own.png", extent=(0, 20, 40, 60))
    assert made.textures["map"].file == "own.png" and made.data.base.extent == (0, 20, 40, 60)


PASSING = """
from pathlib import Path
import visray as vr
table = {"lon": [2.0, 30.0], "lat": [41.0, 60.0], "v": [1.0, 2.0]}
one, two = vr.data_scene(table), vr.data_scene(table, color="v", title="x", gizmo="box")
assert Path(one.textures["map"].file).read_bytes()[1:4] == b"PNG"
print(one.textures["map"].file)
"""


@pytest.mark.slow
def test_other_maps_are_removed_when_python_ends(tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error::ResourceWarning", "-c", PASSING], capture_output=True, text=True, cwd=tmp_path
    )
    path = Path(done.stdout.strip())
    assert (
        done.returncode == 0
        and "ResourceWarning" not in done.stderr
        and path.suffix == ".png"
        and not path.parent.exists()
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"table": None}, "the table: NoneType is no table; give a path, a dict of columns, a list of records"),
        ({"table": "no.csv"}, "no.csv: there is no such file"),
        ({"table": {"a": [1], "b": [2]}}, "the table: no column is named like a longitude; write lon and lat"),
        ({"height": "rian"}, 'height = "rian": there is no such column in the table; did you mean "rain"?'),
        ({"lon": "x", "gizmo": "z"}, 'lon = "x": there is no such column'),
        ({"palette": "virdis"}, 'palette = "virdis": unknown palette'),
        ({"norm": "lin"}, 'norm = "lin": there is no such norm'),
        (
            {"domain": (3, 1)},
            "domain: the first number must be less than the second; to turn the palette around, write _r",
        ),
        ({"domain": (3,)}, "domain = (3,): must be two numbers"),
        ({"domain": "ab"}, "domain = 'ab': must be two numbers"),
        ({"bands": 2.5}, "bands = 2.5: must be a whole number"),
        ({"bands": 0}, "bands: "),
        ({"units": {"rian": "mm"}}, 'units = "rian": there is no such column in the table; did you mean "rain"?'),
        ({"units": {"rain": 3}}, "units = {'rain': 3}: must be a dict of texts"),
        ({"labels": ["rain"]}, "labels = ['rain']: must be a dict"),
        ({"base": "glob"}, "base = 'glob': there is no such base; one of auto, map, globe"),
        ({"extent": (1, 2, 3)}, "extent = (1, 2, 3): must be west, east, south and north in degrees"),
        ({"extent": (1, 2, 3, "x")}, "extent = (1, 2, 3, 'x'): must be west, east"),
        ({"extent": (30, -10, 30, 60)}, "extent = 30,-10,30,60: must be west, east, south, north"),
        ({"base": "globe", "extent": (0, 1, 2, 3)}, 'leave it out, or write base="map"'),
        ({"map": "no.png"}, 'map = "no.png": there is no such file'),
        ({"places": [1]}, 'places = [1]: must be "auto", "none", "all", or a list of names'),
        ({"title": "\ud800"}, "is half a character"),
        ({"gizmo": "sphere", "height": "rain"}, "height: a sphere has no height; write radius, or take another gizmo"),
        ({"spp": 0}, "settings.spp = 0: must be greater than 0"),
        ({"size": (0, 5)}, "film.width = 0"),
    ],
)
def test_messages_name_arguments(arguments, line):
    with pytest.raises(vr.UserError) as caught:
        vr.data_scene(**{"table": TABLE} | arguments)
    assert any(line in text for text in caught.value.lines)
    assert not any("--" in text for text in caught.value.lines)


def test_all_advice_on_options_is_reworded():
    """The texts of the modules that name options of the command."""
    own = Path(inspect.getfile(in_python))
    sources = [path.read_text() for path in own.parent.glob("*.py") if path != own]
    # The names of options that a program puts in are those of arguments.
    texts = [text for source in sources for text in re.findall(r'"[^"\n]*--[^"\n{]*"', source)]
    assert texts and not any("--" in text for text in in_python(texts))
    assert in_python(["--gizmo sphere shows points"]) == ['gizmo="sphere" shows points']
    assert in_python(['write --lon "lat" --lat "lon"']) == ['write lon="lat" and lat="lon"']


@pytest.mark.filterwarnings("ignore:color")
def test_what_the_picture_does_not_show_is_a_warning_at_the_call():
    with pytest.warns(UserWarning, match='rows are on the far side of the globe; base="map" shows all') as caught:
        vr.data_scene(DATA / "cities.csv", base="globe")
    assert {Path(w.filename) for w in caught} == {Path(__file__)}


@pytest.mark.filterwarnings("ignore")
def test_a_row_is_found_by_its_name_and_its_pixels_by_the_number_of_the_object():
    table = {**TABLE, "rain": [760.0, None, 1020.0]}
    scene = vr.data_scene(table, height="rain", size=(160, 100), spp=1)
    row = scene.data.row("table", "Bern")
    assert row == 2 and vr.value(scene, f"data.table.{row}.height") == 1020
    image = vr.render(scene)
    number = image.objects[f"data.table.{row}"]
    seen = image["id"] == number
    y, x = np.argwhere(seen).mean(axis=0) + 0.5
    foot = vr.projected(scene, scene.data.base.place([7.45], [46.95]).point)
    # The bar rises from its place.
    assert seen.sum() > 5 and abs(x - foot.x[0]) < 5 and y < foot.y[0] + 1
    assert image.objects["data.base"] == 1 and len(set(image.objects.values())) == len(image.objects)


@pytest.mark.filterwarnings("ignore")
def test_rows_that_have_no_name_or_the_name_of_others_are_lines():
    names = ["Oslo", "Paris", "Paris"]
    data = vr.data_scene({**TABLE, "name": names}, height="rain").data
    assert data.row("table", "Oslo") == 0
    for arguments, text in (
        (("tables", "Oslo"), "data.tables: there is no such layer; did you mean"),
        (("table", "Osla"), 'data.table: no row that is shown has the name "Osla"; did you mean "Oslo"?'),
        (("table", "X"), 'no row that is shown has the name "X"; data.rows["table"].texts has all names'),
        (("table", "Paris"), 'data.table: rows 1, 2 have the name "Paris"; take one of these'),
    ):
        with pytest.raises(vr.UserError) as caught:
            data.row(*arguments)
        assert text in str(caught.value)
    line = {"type": "LineString", "coordinates": [[0, 0], [10, 20], [20, 5]]}
    lines = [{"type": "Feature", "properties": {"name": name}, "geometry": line} for name in ("a", "b")]
    # A line of two segments is one row.
    assert vr.data_scene({"type": "FeatureCollection", "features": lines}).data.row("table", "b") == 1
    nameless = vr.data_scene({"lon": [1.0, 2.0], "lat": [2.0, 3.0], "v": [1.0, 2.0]}).data
    with pytest.raises(vr.UserError, match="the layer has no column of names"):
        nameless.row("table", "x")
    with pytest.raises(vr.UserError, match="metadata have no numbers of objects"):
        _ = vr.Image({"RGB": np.ones((2, 3, 3), np.float32)}).objects
