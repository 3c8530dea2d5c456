"""The tables in scenes/data, and the maps that belong to them."""

import csv
import json
import re
import runpy
import struct
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import visray as vr

DATA = Path(__file__).resolve().parents[1] / "scenes" / "data"
TABLES = sorted(DATA.glob("*.csv"))
# Columns that hold texts.
TEXTS = {"name", "country", "code", "continent", "place", "time", "month"}
# Columns in degrees Celsius.
WARMTHS = {
    "january", "february", "march", "april", "may", "june",
    "july", "august", "september", "october", "november", "december",
}  # fmt: skip
# The smallest and largest numbers that each column can have.
LIMITS = {
    "lon": (-180, 180), "lat": (-90, 90), "population": (0, 2e9), "rain": (0, 15_000), "depth": (-5, 700),
    "magnitude": (4, 10), "gdp": (0, 3e7), "gdp_per_head": (0, 3e5),
    "temperature": (-30, 40),
} | dict.fromkeys(WARMTHS, (-30, 40))  # fmt: skip


def table(path: Path) -> list[dict]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def listed() -> dict[str, int]:
    """The rows of each file, as scenes/data/README.md has them."""
    text = (DATA / "README.md").read_text(encoding="utf-8")
    return {name: int(rows) for name, rows in re.findall(r"^\| `(.+?)` \| (\d+) \|", text, re.MULTILINE)}


@pytest.mark.parametrize("path", TABLES, ids=lambda p: p.stem)
def test_tables_hold_what_the_page_says(path):
    rows = table(path)
    assert len(rows) == listed()[path.name]
    assert path.stat().st_size < 100_000
    assert all(None not in row and None not in row.values() for row in rows)
    for column in set(rows[0]) - TEXTS:
        low, high = LIMITS[column]
        assert all(low <= float(row[column]) <= high for row in rows), column
    for column in set(rows[0]) & {"name", "place"}:
        assert all(row[column] == row[column].strip() != "" for row in rows)
    if "name" in rows[0]:
        assert len({(row["name"], row.get("country"), row.get("month")) for row in rows}) == len(rows)


def test_all_data_are_listed_and_small():
    files = {p.name for p in DATA.iterdir()} - {"README.md"}
    assert files == set(listed())
    assert sum(p.stat().st_size for p in DATA.iterdir()) < 500_000


def test_numbers_that_are_known():
    """Places and numbers that an atlas gives, to within what it rounds."""
    ports = {row["name"]: row for row in table(DATA / "ports.csv")}
    for name, lon, lat in (("Barcelona", 2.18, 41.38), ("Reykjavík", -21.94, 64.15), ("Valletta", 14.51, 35.90)):
        assert float(ports[name]["lon"]) == pytest.approx(lon, abs=0.06)
        assert float(ports[name]["lat"]) == pytest.approx(lat, abs=0.06)
    assert all(float(row["january"]) < float(row["july"]) for row in ports.values())
    assert set(table(DATA / "coastal-cities.csv")[0]) > WARMTHS
    south = [row for row in table(DATA / "coastal-cities.csv") if float(row["lat"]) < -24]
    assert south and all(float(row["january"]) > float(row["july"]) for row in south)
    cities = {row["name"]: float(row["rain"]) for row in table(DATA / "cities.csv")}
    assert cities["Cairo"] < 100 < 1000 < cities["Singapore"]
    people = [int(row["population"]) for row in table(DATA / "barcelona-districts.csv")]
    assert sum(people) == pytest.approx(1.66e6, rel=0.1)
    magnitudes = [float(row["magnitude"]) for row in table(DATA / "earthquakes.csv")]
    assert max(magnitudes) == 6.4


def area(ring: list) -> float:
    """The signed area of a ring on a map, in square degrees, positive if it runs counter-clockwise."""
    x, y = np.array(ring).T
    return float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum() / 2)


def test_outlines_are_those_of_the_countries_in_the_table():
    shapes = json.loads((DATA / "countries.geojson").read_text(encoding="utf-8"))["features"]
    rows = {row["name"]: row for row in table(DATA / "countries.csv")}
    assert {s["properties"]["name"] for s in shapes} == set(rows)
    for shape in shapes:
        about, lines = shape["properties"], shape["geometry"]["coordinates"]
        assert str(about["population"]) == rows[about["name"]]["population"]
        # Lines end only where another one goes on, or at the 180th meridian; and no step goes around the earth.
        ends = Counter(tuple(end) for line in lines for end in (line[0], line[-1]) if abs(end[0]) < 180)
        assert all(count % 2 == 0 for count in ends.values()), about["name"]
        assert all(np.abs(np.diff(np.array(line)[:, 0])).max() < 60 for line in lines)
    spain = next(s for s in shapes if s["properties"]["name"] == "Spain")["geometry"]["coordinates"]
    # Spain without its islands has 493,500 km2; a square degree at its middle, 40 degrees north, has 9,470 km2.
    assert max(abs(area(line)) for line in spain) == pytest.approx(493_500 / 9_470, rel=0.05)


MAPS = DATA.parent / "textures"
WORLD, EUROPE, BARCELONA = (-180, 180, -90, 90), (-25, 45, 32, 72), (2.03, 2.27, 41.29, 41.47)
# The colour of a city's dot, that of land and that of the sea.
LIGHT, DARK = ("#6b5b4b", "#f5f1e6", "#c3d6e3"), ("#ffd27a", "#29354a", "#0e1722")
SHEETS = {
    "world-light": (WORLD, LIGHT, "cities"),
    "world-dark": (WORLD, DARK, "cities"),
    "europe": (EUROPE, LIGHT, "ports"),
}


def rgb(colour: str) -> np.ndarray:
    return np.array(list(bytes.fromhex(colour[1:])), float)


def sheet(name: str) -> np.ndarray:
    """The pixels of a map, the first row in the north. Shape: (height, width, 3)."""
    with Image.open(MAPS / f"{name}.png") as image:
        assert image.mode == "P"
        return np.asarray(image.convert("RGB"), float)


def pixel(extent: tuple, shape: tuple, lon, lat) -> tuple:
    """The column and row of a place, counted from the map's corner; the middle of the first pixel is at 0.5, 0.5."""
    west, east, south, north = extent
    return (lon - west) / (east - west) * shape[1], (north - lat) / (north - south) * shape[0]


@pytest.mark.parametrize("name", SHEETS)
def test_dots_on_maps_lie_where_the_coordinates_of_their_cities_say(name):
    """The colour of each city's pixel, and the middle of each dot without neighbours to a quarter of a pixel."""
    extent, (city, *_), rows = SHEETS[name]
    image = sheet(name)
    lon, lat = np.array([[float(row["lon"]), float(row["lat"])] for row in table(DATA / f"{rows}.csv")]).T
    x, y = pixel(extent, image.shape, lon, lat)
    at = image[np.floor(y).astype(int), np.floor(x).astype(int)]
    assert (at == rgb(city)).all()
    # A dot is told from land, sea and lines by one channel: it is darker in blue, or lighter in red, than a limit.
    channel, limit = (0, 90) if name == "world-dark" else (2, 165)
    radius, seen = 6, 0
    for i in range(len(x)):
        near = np.hypot(x - x[i], y - y[i]) < 2.5 * radius
        column, row = int(x[i]), int(y[i])
        window = image[row - radius : row + radius + 1, column - radius : column + radius + 1, channel]
        weight = np.clip((window - limit) / (rgb(city)[channel] - limit), 0, 1)
        if near.sum() == 1 and weight[0].sum() + weight[-1].sum() == 0:
            place = np.arange(2 * radius + 1) + 0.5 - radius
            assert weight.sum(0) @ place / weight.sum() + column == pytest.approx(x[i], abs=0.25)
            assert weight.sum(1) @ place / weight.sum() + row == pytest.approx(y[i], abs=0.25)
            seen += 1
    assert seen > 20


@pytest.mark.parametrize("name", SHEETS)
def test_land_and_sea_lie_where_they_are(name):
    """Of each pair the first is land and the second is sea, on either side of a coast."""
    extent, (_, land, sea), _ = SHEETS[name]
    image = sheet(name)
    pairs = [
        ((-5.5, 36.5), (-7, 36.3)), ((2.5, 42), (4, 41)), ((-4.5, 50.6), (-5, 49)), ((14.2, 37.5), (15.8, 36)),
        ((13.5, 57), (11.3, 57)), ((-8.4, 39.5), (-11, 39.5)), ((30, 59.5), (21, 59)), ((9.1, 40.1), (11.5, 40.2)),
    ]  # fmt: skip
    if extent == WORLD:
        pairs += [
            ((146.5, -42), (146, -40)),
            ((-69, -54.2), (-62, -54)),
            ((-82, 28), (-85, 28)),
            ((140, 36.5), (143, 36.5)),
        ]
    for (lon, lat), colour in ((place, colour) for pair in pairs for place, colour in zip(pair, (land, sea))):
        x, y = pixel(extent, image.shape, lon, lat)
        assert (image[int(y), int(x)] == rgb(colour)).all(), (lon, lat)


def test_barcelona_has_its_quarters_on_land_and_the_sea_beside_them():
    image = sheet("barcelona")
    sea = rgb("#bcd3e2")
    for row in table(DATA / "barcelona-quarters.csv") + table(DATA / "barcelona-districts.csv"):
        x, y = pixel(BARCELONA, image.shape, float(row["lon"]), float(row["lat"]))
        window = image[int(y) - 2 : int(y) + 3, int(x) - 2 : int(x) + 3]
        assert (window != sea).any(axis=2).all(), row["name"]
    for lon, lat in ((2.196, 41.374), (2.21, 41.39), (2.23, 41.405), (2.24, 41.415), (2.18, 41.35), (2.16, 41.3)):
        x, y = pixel(BARCELONA, image.shape, lon, lat)
        assert (image[int(y), int(x)] == sea).all()
    x, y = pixel(BARCELONA, image.shape, 2.17, 41.387)
    dark = (image == rgb("#4a4038")).all(axis=2)
    rows, columns = np.nonzero(dark[int(y) - 6 : int(y) + 7, int(x) - 6 : int(x) + 7])
    assert columns.mean() + int(x) - 5.5 == pytest.approx(x, abs=0.5)
    assert rows.mean() + int(y) - 5.5 == pytest.approx(y, abs=0.5)


@pytest.mark.slow
def test_the_sketch_of_barcelona_is_what_its_script_draws(monkeypatch):
    """But for a few pixels: other versions of Pillow may round edges and texts in other ways."""
    monkeypatch.syspath_prepend(str(DATA.parent))
    drawn = runpy.run_path(str(DATA.parent / "make_maps.py"))["barcelona"]()
    differs = (np.asarray(drawn.convert("RGB"), float) != sheet("barcelona")).any(axis=2)
    assert differs.mean() < 0.01


def test_maps_are_small():
    assert all((MAPS / f"{name}.png").stat().st_size < 300_000 for name in (*SHEETS, "barcelona"))


@pytest.fixture(scope="module")
def made() -> dict:
    """The names that the script of the tables defines."""
    return runpy.run_path(str(DATA.parent / "make_data.py"))


def test_great_circles(made):
    """A quarter of the equator, and from Barcelona to its antipodes: half of the circumference."""
    quarter = np.pi / 2 * 6371
    others = np.array([[92.159, 0], [2.159, 41.389], [2.159 - 180, -41.389]])
    assert made["distance"](2.159, 0, others[:1]) == pytest.approx([quarter])
    assert made["distance"](2.159, 41.389, others[1:]) == pytest.approx([0, 2 * quarter], abs=1e-3)


@pytest.mark.parametrize("most", [0.01, 0.1, 0.5])
def test_thinned_lines_stay_near(made, most):
    t = np.linspace(0, 2 * np.pi, 200)
    line = np.stack([t, np.sin(3 * t)], axis=1)
    short = made["thinned"](line, most)
    assert len(short) < len(line) and (short[[0, -1]] == line[[0, -1]]).all()
    a, b = short[:-1, None], short[1:, None]
    share = np.clip(((line - a) * (b - a)).sum(2) / ((b - a) ** 2).sum(2), 0, 1)[..., None]
    assert np.linalg.norm(a + share * (b - a) - line, axis=2).min(axis=0).max() <= most * (1 + 1e-12)


def test_middle_of_a_ring(made):
    area, middle = made["area_and_middle"](np.array([[0, 0], [0, 3], [6, 0], [0, 0]], float))
    assert area == 9 and middle == pytest.approx([2, 1])


def test_months_are_what_their_script_makes(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["make_months.py", "-o", str(tmp_path / "made.csv")])
    runpy.run_path(str(DATA.parent / "make_months.py"), run_name="__main__")
    assert (tmp_path / "made.csv").read_bytes() == (DATA / "coastal-months.csv").read_bytes()


def netcdf(records: int) -> bytes:
    """A netCDF file with the variables x (3) and, for each of the records, y (3) and z: the classic format, by hand."""

    def text(word: str) -> bytes:
        return struct.pack(">i", len(word)) + word.encode() + bytes(-len(word) % 4)

    def variable(name: str, dimensions: list[int], kind: int, size: int, begin: int) -> bytes:
        head = text(name) + struct.pack(f">{1 + len(dimensions)}i", len(dimensions), *dimensions)
        attribute = struct.pack(">2i", 12, 1) + text("unit") + struct.pack(">2i", 2, 1) + b"K\0\0\0"
        return head + attribute + struct.pack(">3i", kind, size, begin)

    head = b"CDF\1" + struct.pack(">3i", records, 10, 2) + text("time") + struct.pack(">i", 0)
    head += text("lon") + struct.pack(">i", 3) + struct.pack(">2i", 0, 0)

    def whole(begin: int) -> bytes:
        return (
            head
            + struct.pack(">2i", 11, 3)
            + variable("x", [1], 4, 12, begin)
            + (variable("y", [0, 1], 5, 12, begin + 12) + variable("z", [0], 6, 8, begin + 24))
        )

    parts = [struct.pack(">3i", 7, 8, 9)]
    parts += [struct.pack(">3fd", r, r + 0.25, r + 0.5, 100.0 + r) for r in range(records)]
    return whole(len(whole(0))) + b"".join(parts)


def test_netcdf_files_are_read(made):
    found = made["variables"](netcdf(4))
    assert found["x"].tolist() == [7, 8, 9]
    assert found["y"].tolist() == [[r, r + 0.25, r + 0.5] for r in range(4)]
    assert found["z"].tolist() == [100, 101, 102, 103]


@pytest.mark.parametrize("path", sorted(DATA.parent.glob("data-*.json")), ids=lambda p: p.stem)
def test_scenes_of_data_name_their_sources_and_give_no_warnings(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = vr.load(path)
    assert scene.data.notes() == []
    files = {Path(layer["source"]).name for layer in json.loads(path.read_text())["data"]["layers"].values()}
    assert files <= set(listed())
    said = {"GeoNames": "CC BY 4.0"} if files - {"earthquakes.csv", "countries.geojson"} else {}
    said |= {"U.S. Geological Survey": ""} if "earthquakes.csv" in files else {}
    said |= {"COADS": ""} if files & {"ports.csv", "coastal-cities.csv"} else {}
    for holder, licence in said.items():
        assert holder in scene.data.legend.source and licence in scene.data.legend.source
