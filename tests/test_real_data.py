"""The tables in scenes/data, and the maps that belong to them."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

DATA = Path(__file__).resolve().parents[1] / "scenes" / "data"
TABLES = sorted(DATA.glob("*.csv"))
# Columns that hold texts.
TEXTS = {"name", "country", "code", "continent", "place", "time"}
# Columns in degrees Celsius.
WARMTHS = {
    "january", "february", "march", "april", "may", "june",
    "july", "august", "september", "october", "november", "december",
}  # fmt: skip
# The smallest and largest numbers that each column can have.
LIMITS = {
    "lon": (-180, 180), "lat": (-90, 90), "population": (0, 2e9), "rain": (0, 15_000), "depth": (-5, 700),
    "magnitude": (4, 10), "gdp": (0, 3e7), "gdp_per_head": (0, 3e5),
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
        assert len({(row["name"], row.get("country")) for row in rows}) == len(rows)


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


def test_outlines_are_rings_of_the_countries_in_the_table():
    shapes = json.loads((DATA / "countries.geojson").read_text(encoding="utf-8"))["features"]
    rows = {row["name"]: row for row in table(DATA / "countries.csv")}
    assert {s["properties"]["name"] for s in shapes} == set(rows)
    for shape in shapes:
        about, parts = shape["properties"], shape["geometry"]["coordinates"]
        assert str(about["population"]) == rows[about["name"]]["population"]
        for part in parts:
            for ring in part:
                assert ring[0] == ring[-1] and len(ring) >= 4
    spain = next(s for s in shapes if s["properties"]["name"] == "Spain")["geometry"]["coordinates"]
    # Spain without its islands has 493,500 km2; a square degree at its middle, 40 degrees north, has 9,470 km2.
    assert max(abs(area(part[0])) for part in spain) == pytest.approx(493_500 / 9_470, rel=0.05)
