"""`visray data`: what it chooses for a table, the scene that it writes, and the one line that bad input gets."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.data.base import GlobeBase
from visray.data.fit import AMBIENT
from visray.data.land import FILE
from visray.data.reading import read_table
from visray.data_picture import DataPicture, Wishes, data_picture
from visray.data_picture.viewing import MARGIN
from visray.data_picture.wishes import completed
from visray.errors import UserError
from visray.legend.content import legend_content
from visray.legend.drawing import drawn
from visray.projection import projected

DATA = Path(__file__).resolve().parents[1] / "scenes" / "data"
SMALL = ("--size", "96x64", "--spp", "1")
TABLE = (
    "name,lat,lon,rain,people\nOslo,59.9,10.75,760,700000\nParis,48.85,2.35,640,2100000\nBern,46.95,7.45,1020,134000\n"
)

SKEWED = "\n".join(["lat,lon,v", *(f"{i},{2 * i},{i + 1}" for i in range(19)), "19,38,1000"]) + "\n"


@pytest.fixture
def table(tmp_path, monkeypatch):
    """A function that writes a table to a file in the current folder, and returns its name."""
    monkeypatch.chdir(tmp_path)

    def written(text: str = TABLE, name: str = "places.csv") -> str:
        Path(name).write_text(text, encoding="utf-8")
        return name

    return written


def said(capsys, *words: str):
    """Exit code, standard output and standard error of the command."""
    code = main(["data", *words])
    return code, *capsys.readouterr()


def picture(path, **wishes) -> DataPicture:
    return data_picture(str(path), Wishes(**wishes), "map.png")


@pytest.mark.slow
def test_a_saved_scene_renders_the_same_picture(table, capsys):
    csv = table()
    code, out, _ = said(capsys, csv, "-o", "a.exr", "-o", "a.png", "--save", "scene.json", "--title", "Rain", *SMALL)
    assert code == 0 and "scene.json: written" in out and "height rain" in out
    # Without --allow-outside: all that the scene needs is below its folder.
    assert main(["render", "scene.json", "-o", "b.exr", "-o", "b.png"]) == 0
    capsys.readouterr()
    first, second = (vr.Image.read(f"{name}.exr") for name in "ab")
    assert first.metadata["scene_hash"] == second.metadata["scene_hash"]
    for name in ("RGB", "id", "Z"):
        np.testing.assert_array_equal(first[name], second[name])
    assert Pillow.open("a.png").tobytes() == Pillow.open("b.png").tobytes()
    # Without --save the picture is the same, and nothing else is written.
    before = set(Path().iterdir())
    assert said(capsys, csv, "-o", "c.exr", "--title", "Rain", *SMALL, "--quiet") == (0, "", "")
    np.testing.assert_array_equal(vr.Image.read("c.exr")["RGB"], first["RGB"])
    assert set(Path().iterdir()) - before == {Path("c.exr")}


@pytest.mark.slow
def test_the_report_says_what_was_chosen(table, capsys):
    code, out, _ = said(capsys, table(), *SMALL, "--json")
    report = json.loads(out)
    assert code == 0 and report["outputs"] == ["places.png"] and Path("places.png").exists()
    chosen = {"rows": "3 of 3", "lon": "lon", "lat": "lat", "height": "rain", "color": "rain", "gizmo": "cylinder"}
    assert chosen.items() <= report["choices"].items() and report["choices"]["base"] == "map"


@pytest.mark.slow
def test_options_set_the_colours_and_the_texts_of_the_legend(table, capsys):
    words = ["--domain", "-100,2000", "--bands", "4", "--labels", "rain=Rain, 2016,people=People", "--units", "rain=mm"]
    assert said(capsys, table(), *words, "--save", "a.json", *SMALL)[0] == 0
    data = vr.load("a.json").data
    rule = data.layers["places"].color
    assert (rule.column, rule.domain, rule.bands) == ("rain", (-100.0, 2000.0), 4)
    assert data.legend.labels == {"rain": "Rain, 2016", "people": "People"} and data.legend.units == {"rain": "mm"}


@pytest.mark.parametrize("kind", ["map", "globe"])
def test_gizmos_stand_where_the_map_shows_their_places(tmp_path, kind):
    """The pixel where a place is seen has the colour that its texture has there."""
    made = picture(DATA / "cities.csv", base=kind)
    rows, base = made.scene.data.rows["cities"], made.scene.data.base
    height, width, _ = made.drawn.shape
    sea = made.drawn[height // 2, 0]
    u, v = (0.5 + rows.values["lon"] / 360, 0.5 + rows.values["lat"] / 180)
    if not isinstance(base, GlobeBase):
        u = rows.ground.point[:, 0] / base.width + 0.5
        v = 0.5 - rows.ground.point[:, 2] / base.true_depth
    found = made.drawn[((1 - v) * height).astype(int), (u * width).astype(int)]
    # Cities lie on land, but for those on coasts that are simplified.
    assert (found != sea).any(axis=1).mean() > 0.93


shapes = st.sampled_from(("cylinder", "cone", "box", "sphere", "disk"))


@pytest.mark.slow
@settings(derandomize=True, deadline=None, max_examples=30)
@given(
    places=st.lists(st.tuples(st.floats(-179, 179), st.floats(-84, 84), st.floats(0.1, 1e6)), min_size=1, max_size=12),
    shrink=st.sampled_from((1.0, 0.1, 0.001)),
    gizmo=shapes,
    base=st.sampled_from(("map", "globe")),
    size=st.sampled_from(((960, 540), (640, 640), (400, 700))),
)
def test_everything_is_in_the_picture_and_not_under_the_legend(tmp_path_factory, places, shrink, gizmo, base, size):
    path = tmp_path_factory.mktemp("data") / "places.csv"
    lon, lat, value = np.array(places).T
    lines = [f"{x * shrink:.9f},{y * shrink:.9f},{v!r}" for x, y, v in zip(lon, lat, value.tolist())]
    path.write_text("\n".join(["lon,lat,v", *lines]) + "\n")
    made = picture(path, gizmo=gizmo, base=base, size=size, title="A title", source_line="A source")
    scene = made.scene
    width, height = size
    rows = scene.data.rows["places"]
    tops = (rows.stand.foot + rows.stand.up * rows.stand.height * (gizmo not in ("sphere", "disk"))).T
    seen = projected(scene, np.concatenate([rows.ground.point, tops]))
    assert (seen.depth > 0).all()
    boxes = drawn(legend_content(scene), width, height).layout.boxes
    for x, y in zip(seen.x, seen.y):
        assert 0 <= x <= width and 0 <= y <= height
        assert not any(left <= x <= right and top <= y <= bottom for _, (left, top, right, bottom) in boxes)


@pytest.mark.parametrize(
    ("text", "wishes", "expected"),
    [
        (TABLE, {}, {"height": "rain", "color": "rain"}),
        (TABLE, {"height": "people"}, {"height": "people", "color": "people"}),
        (TABLE, {"color": "people"}, {"height": None, "color": "people"}),
        (TABLE, {"radius": "people", "color": "rain"}, {"height": None, "radius": "people", "color": "rain"}),
        (TABLE, {"gizmo": "sphere"}, {"height": None, "color": "rain"}),
        (TABLE, {"norm": "log", "palette": "magma"}, {"height": "rain", "color": "rain"}),
        ("lat,lon,t\n1,2,-5\n2,3,5\n", {}, {"height": None, "color": "t"}),
        ("lat,lon,t\n1,2,-5\n2,3,5\n", {"gizmo": "cone"}, {"height": "t", "color": "t"}),
        ("id,year,lat,lon,v\n1,1990,1,2,3\n2,1991,2,3,4\n", {}, {"height": "v"}),
        ("lat,lon,equal,v\n1,2,5,3\n2,3,5,4\n", {}, {"height": "v"}),
        ("lat,lon,equal\n1,2,5\n2,3,5\n", {}, {"height": "equal"}),
        ("lat,lon,town\n1,2,A\n2,3,B\n", {}, {"height": None, "color": None}),
        ("Länge;Breite;v\n1,5;2;3\n", {}, {"lon": "Länge", "lat": "Breite"}),
        (TABLE, {"places": "all"}, {"name": "name"}),
        ("lat,lon,Stadt\n1,2,A\n2,3,B\n", {"places": "all"}, {"name": "Stadt"}),
    ],
)
def test_columns_are_chosen(table, text, wishes, expected):
    done = completed(read_table(table(text)), Wishes(**wishes))
    assert {name: getattr(done, name) for name in expected} == expected


def test_gizmos_are_as_thick_as_their_distance_allows(table):
    sizes = []
    for step in (1e-6, 2.0, 40.0):
        rows = [f"{i * step},{j * step},{i + j + 1}" for i in range(2) for j in range(3)]
        base = picture(table("\n".join(["lat,lon,v", "60,-60,1", *rows])), base="globe").scene.data
        sizes.append(base.layers["places"].radius / base.base.size)
    assert sizes[0] < sizes[1] <= sizes[2]


@pytest.mark.parametrize("base", ["map", "globe"])
def test_a_single_bar_is_as_thick_as_one_of_few(table, base):
    found = [picture(table(text), base=base).scene.data.layers["places"].radius
             for text in (TABLE, "lat,lon,v\n52,13,570\n", "lat,lon,v\n52,13,570\n52,13,500\n")]  # fmt: skip
    assert found[0] <= found[1] == found[2]


def test_a_size_and_a_colour_of_the_same_column_have_one_key(table):
    csv = table()
    assert not picture(csv).scene.data.legend.sizes
    assert picture(csv, height="rain", color="people").scene.data.legend.sizes


def test_a_horizontal_surface_has_the_colour_of_the_legend(table):
    """Ambient light and the light of both lights on a surface that faces upwards add up to one."""
    scene = picture(table()).scene
    total = np.array([AMBIENT])
    for light in scene.lights.values():
        toward = np.array(light.position) / np.linalg.norm(light.position)
        total = total + light.Id[0] * toward[1]
    assert total[0] == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize(
    ("text", "wishes", "says"),
    [
        (TABLE.replace("760", "n/k"), {}, '"people" is shown, as the column "rain": 1 cell holds text'),
        (TABLE + "X,0,0,1,1\n", {}, "1 row is at longitude 0 and latitude 0"),
        ("lat,lon,v\n41.4,2.1,3\n41.5,2.2,4\n", {}, "the map has no coasts, as it shows less than 4 degrees"),
        ("lat,lon,v\n41.4,2.1,3\n-41.5,-178,4\n", {"base": "globe"}, "1 of 2 rows are on the far side of the globe"),
        ("lat,lon,town\n1,2,A\n20,30,B\n", {}, "no column of numbers is shown"),
        (SKEWED, {}, "half of the values are from 1 to 10.5, and the largest is 1000"),
        (
            SKEWED.replace(",v", ",w").replace(",1000", ",-1000"),
            {},
            "half of the values are from 9.5 to 19, and the smallest",
        ),
    ],
)
def test_what_the_picture_does_not_show_is_said(table, text, wishes, says):
    assert any(says in note for note in picture(table(text), **wishes).notes)
    assert not any(says in note for note in picture(table(TABLE, "fine.csv")).notes)


BAD = {
    "no file": (["missing.csv"], "missing.csv: there is no such file"),
    "column": (["places.csv", "--height", "rian"], '--height = "rian": there is no such column in places.csv; did you'),
    "two columns": (["places.csv", "--lon", "x", "--color", "y"], '--lon = "x": there is no such column'),
    "gizmo": (["places.csv", "--gizmo", "cylindr"], 'did you mean "cylinder"?'),
    "geometry": (["places.csv", "--gizmo", "geometry"], "there is no such gizmo"),
    "palette": (["places.csv", "--palette", "virdis"], '--palette = "virdis": unknown palette; did you mean "viridis"'),
    "bars": (["places.csv", "--gizmo", "Bars"], '--gizmo = "Bars": there is no such gizmo; did you mean "cylinder"?'),
    "spheres": (["places.csv", "--gizmo", "spheres"], 'did you mean "sphere"?'),
    "extent turned": (
        ["places.csv", "--extent", "30,62,-5,30"], "no row can be shown; 3 outside of the map; 3 rows lie outside of"
    ),
    "edges swapped": (["places.csv", "--extent", "30,62,-5,30"], "or in extent, which is west, east, south, north"),
    "norm": (["places.csv", "--norm", "lin"], '--norm = "lin": there is no such norm; did you mean "linear"?'),
    "log": (["negative.csv", "--color", "v", "--norm", "log"], '--norm: values of "v" must be above 0 for log'),
    "no height": (["places.csv", "--gizmo", "sphere", "--height", "rain"], "a sphere has no height; write --radius"),
    "no lines": (["places.csv", "--gizmo", "line"], "--gizmo: a line needs a source with lines"),
    "text": (["places.csv", "--height", "name"], '--height: column "name": 3 cells hold text'),
    "extent": (["places.csv", "--extent", "1,2,3"], "--extent = '1,2,3': must be WEST,EAST,SOUTH,NORTH"),
    "domain": (["places.csv", "--domain", "1"], "--domain = '1': must be LOW,HIGH, two numbers, such as 0,100"),
    "domain turned": (["places.csv", "--domain", "5,1"], "--domain: the first number must be less than"),
    "domain of log": (["places.csv", "--domain", "-1,9", "--norm", "log"], "--domain: both numbers must be above 0"),
    "bands": (["places.csv", "--bands", "0"], "--bands: "),
    "unit": (["places.csv", "--units", "mm"], "--units = 'mm': must be COLUMN=TEXT, such as rain=mm"),
    "unit of none": (["places.csv", "--units", "rian=mm"], '--units = "rian": there is no such column in places.csv; '),
    "words": (["places.csv", "--extent", "a,b,c,d"], "must be WEST,EAST,SOUTH,NORTH"),
    "turned": (["places.csv", "--extent", "30,-10,30,60"], "--extent = 30,-10,30,60: must be west, east, south, north"),
    "elsewhere": (["places.csv", "--extent", "-100,-90,30,60"], "no row can be shown; 3 outside of the map"),
    "globe": (["places.csv", "--base", "globe", "--extent", "-10,30,30,60"], "--extent: a globe shows the whole earth"),
    "edges": (["places.csv", "--map", "map.png"], "--map: the edges of the picture are not known; write --extent"),
    "map": (["places.csv", "--map", "no.png", "--extent", "-10,30,30,60"], '--map = "no.png": there is no such file'),
    "scene": (["places.csv", "--save", "scene.txt"], "scene.txt: a scene is a .json file"),
    "itself": (["points.json", "--save", "points.json"], "points.json: is the table; give the scene another name"),
    "the map": (
        ["places.csv", "--map", "map.png", "--base", "globe", "-o", "map.png"], "map.png: is the picture of the map"
    ),
    "samples": (["places.csv", "--spp", "0", "--save", "a.json"], "settings.spp = 0: must be greater than 0"),
    "its map": (["places.csv", "--save", "a.json", "-o", "a-map.png"], "a-map.png: is the map of the scene a.json"),
    "format": (["places.csv", "-o", "a.jpg"], "a.jpg: the name says no format visray writes"),
    "goal": (["places.csv", "--error", "1%", "--spp", "4"], "spp = 4: goes with neither error nor time"),
    "size": (["places.csv", "--size", "big"], "--size = 'big': must be WIDTHxHEIGHT"),
    "a colour": (["places.csv", "--color", "red"], 'write "color": "red" into the layer of the scene'),
    "swapped": (["swapped.csv"], 'and no longitude is beyond 90; write --lon "lat" --lat "lon"'),
    "projected": (["metres.csv"], "--lon: longitude and latitude are out of range: line 2 (431000, "),
    "no places": (["unnamed.csv"], "unnamed.csv: no column is named like a longitude; write --lon and --lat"),
    "no latitude": (["unnamed.csv", "--lon", "a"], "no column is named like a latitude; write --lat (one of a, b)"),
    "empty": (["empty.csv"], "empty.csv: the file is empty"),
    "no positions": (["nowhere.csv"], "nowhere.csv: no row has a longitude and a latitude"),
    "formulas": (["formulas.csv", "--height", "v"], '"=SUM(A1)" (a formula, not its result)'),
}  # fmt: skip


@pytest.mark.parametrize(("words", "line"), BAD.values(), ids=BAD)
def test_bad_input_gets_lines_and_writes_nothing(table, capsys, words, line):
    table()
    Pillow.new("RGB", (2, 1)).save("map.png")
    table("lat,lon,v\n120,20,5\n150,25,3\n", "swapped.csv")
    table("x,y,v\n431000,4581000,5\n", "metres.csv")
    table("a,b\n1,2\n", "unnamed.csv")
    table('{"type": "Point", "coordinates": [2.0, 41.0]}', "points.json")
    table("", "empty.csv")
    table("lat,lon,v\n,,1\n", "nowhere.csv")
    table("lat,lon,v\n1,2,-1\n2,3,4\n", "negative.csv")
    table("lat,lon,v\n1,2,=SUM(A1)\n2,3,4\n", "formulas.csv")
    before = set(Path().iterdir())
    code, out, err = said(capsys, *words, "--quiet")  # on a busy machine there would be bars of progress
    assert code == 2 and out == "" and line in err
    assert all(text.startswith("visray: ") for text in err.splitlines()) and "Traceback" not in err
    assert set(Path().iterdir()) == before


def test_all_wrong_columns_are_named_at_once(table, capsys):
    _, _, err = said(capsys, table(), "--lon", "x", "--color", "y", "--gizmo", "z")
    assert [line.split(" = ")[0] for line in err.splitlines()] == [
        "visray: --lon",
        "visray: --color",
        "visray: --gizmo",
    ]


@pytest.mark.parametrize(
    ("size", "extent", "projection"),
    [
        ((200, 100), (-180.0, 180.0, -90.0, 90.0), "equirectangular"),
        ((700, 400), (-25.0, 45.0, 32.0, 72.0), "equirectangular"),
        ((1400, 1300), (-25.0, 45.0, 32.0, 72.0), "equirectangular"),
        ((1000, 1023), (-25.0, 45.0, 32.0, 72.0), "mercator"),
        ((500, 500), (-180.0, 180.0, -85.0, 85.0), "mercator"),
    ],
)
def test_the_shape_of_a_picture_tells_its_projection(table, size, extent, projection):
    csv = table()
    Pillow.new("RGB", size).save("map.png")
    made = picture(csv, image="map.png", extent=extent)
    assert made.scene.data.base.projection == projection
    assert made.drawn is None and made.scene.textures["map"].file == "map.png"


def test_a_picture_on_a_globe_needs_no_extent(table):
    csv = table()
    Pillow.new("RGB", (2, 1)).save("map.png")
    assert isinstance(picture(csv, image="map.png", base="globe").scene.data.base, GlobeBase)


def test_describe_tells_what_columns_hold(table, capsys):
    csv = table(TABLE + "Rome,41.9,12.5,,2800000\n")
    code, out, err = said(capsys, csv, "--describe")
    assert (code, err) == (0, "")
    rain = next(line for line in out.splitlines() if "rain" in line)
    assert "3 numbers" in rain and "640 to 1,020" in rain and f"mean {(760 + 640 + 1020) / 3:.6g}" in rain
    assert "4 texts" in out and "places.csv: 4 rows" in out
    code, out, _ = said(capsys, csv, "--describe", "--json")
    report = json.loads(out)
    assert code == 0 and report["rows"] == 4
    columns = {record["column"]: record for record in report["columns"]}
    assert list(columns) == ["name", "lat", "lon", "rain", "people"]
    assert columns["rain"]["missing"] == 1 and columns["rain"]["max"] == 1020
    assert not list(Path().glob("*.png"))


def test_describe_tells_from_when_to_when_dates_are(table, capsys):
    csv = table("lon,lat,day,soon\n1,2,2020-03-01,2020-03\n1,2,2020-01-15,later\n1,2,,2020-01\n")
    code, out, err = said(capsys, csv, "--describe")
    assert (code, err) == (0, "")
    day, soon = (next(line for line in out.splitlines() if name in line) for name in ("day", "soon"))
    assert "2 dates" in day and "2020-01-15 to 2020-03-01 (2 different)" in day and "3 texts" in soon
    columns = {x["column"]: x for x in json.loads(said(capsys, csv, "--describe", "--json")[1])["columns"]}
    assert [columns[name]["first"] for name in columns] == [None, None, "2020-01-15", None]
    assert [columns[name]["kind"] for name in columns] == ["numbers", "numbers", "dates", "texts"]


def test_describe_of_a_bad_table_is_one_line(table, capsys):
    assert said(capsys, "missing.csv", "--describe")[0] == 2
    code, _, err = said(capsys, table("", "empty.csv"), "--describe")
    assert code == 2 and err.startswith("visray: empty.csv")


def test_a_layer_is_named_after_its_file_and_names_of_the_scene_are_left_alone(table):
    for name, layer in (("rain.2020.csv", "rain 2020"), ("base.csv", "base data")):
        assert list(picture(table(TABLE, name)).scene.data.layers) == [layer]


def test_the_coasts_are_part_of_the_package():
    pyproject = (Path(__file__).resolve().parents[1] / "pyproject.toml").read_text()
    assert FILE.exists() and 'visray = ["data/*.bin"]' in pyproject and MARGIN > 0


def test_no_rows_are_an_error(table):
    with pytest.raises(UserError, match="no row"):
        picture(table("lat,lon,v\n1,2,\n"), height="v")


IMPORTED = """
import sys
from visray.cli import main
code = main(sys.argv[1:])
print(code, "drjit._drjit_ext" in sys.modules, "matplotlib" in sys.modules, file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("words", "code"), [(["nowhere.csv"], 2), (["places.csv", "--describe"], 0), (["nowhere.csv", "--describe"], 2)]
)
def test_what_renders_nothing_loads_no_compiler(table, words, code):
    table()
    done = subprocess.run([sys.executable, "-c", IMPORTED, "data", *words], capture_output=True, text=True)
    assert done.stderr.splitlines()[-1] == f"{code} False False"
