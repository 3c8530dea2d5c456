"""A named city lies where the map shows it: the pixels of a city's datum, and those of its dot in the map's texture."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import visray as vr

SCENES = Path(__file__).resolve().parents[1] / "scenes"
# For each view: the base, its texture, the table of the cities, the camera, and cities that must be seen.
GLOBE = {"type": "globe", "radius": 1, "material": "base"}
WORLD = {"type": "map", "width": 20, "material": "base"}
VIEWS = {
    "europe": (
        {"type": "map", "extent": [-25, 45, 32, 72], "width": 10, "material": "base"}, "europe", "ports",
        {"origin": [0.4, 15, 5], "target": [0, 0, 0.1], "fov": 37}, {"Barcelona", "Reykjavík", "Trabzon"},
    ),
    "map": (
        WORLD, "world-dark", "cities", {"origin": [0.3, 11, 4], "target": [0, 0, 0], "fov": 30},
        {"Kinshasa", "Cape Town", "Madrid"},
    ),
    "a turned map": (
        WORLD | {"transform": [{"rotate": 70, "axis": [1, 0.2, 0]}, {"translate": [1, 2, 3]}]}, "world-dark", "cities",
        {"origin": [-3, 6, 13], "target": [-3, 2, 3], "fov": 30}, {"Santiago", "Mexico City", "Manaus"},
    ),
    "the globe from Africa": (
        GLOBE, "world-dark", "cities", {"origin": [3.6, 0.9, -1.2], "fov": 34}, {"Nairobi", "Cape Town", "Madrid"},
    ),
    "the globe from America": (
        GLOBE, "world-dark", "cities", {"origin": [0.9, 0.6, 3.7], "fov": 34}, {"Lima", "New York City", "Mexico City"},
    ),
    "the globe from Australia": (
        GLOBE, "world-dark", "cities", {"origin": [-2.6, -1, -2.6], "fov": 34}, {"Perth", "Melbourne", "Tokyo"},
    ),
    "a turned globe": (
        GLOBE | {"transform": [{"rotate": -100}, {"rotate": 23, "axis": [0, 0, 1]}]}, "world-dark", "cities",
        {"origin": [0, 0.4, 3.8], "fov": 34}, {"Johannesburg", "Baghdad", "Moscow"},
    ),
}  # fmt: skip


def table(name: str) -> list[dict]:
    with (SCENES / "data" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def rendered(folder: Path, view: str, rows: list[dict], **options) -> vr.Image:
    """The picture of a view, unlit, with a small ball half sunk at each row."""
    base, texture, _, camera, _ = VIEWS[view]
    columns = {name: [float(row[name]) for row in rows] for name in ("lon", "lat")}
    columns["name"] = [row["name"] for row in rows]
    scene = {
        "camera": camera,
        "film": {"width": 1000, "height": 800},
        "textures": {"base": {"type": "image", "file": str(SCENES / "textures" / f"{texture}.png")}},
        "materials": {"base": {"texture": "base", "shading": "unlit"}},
        "data": {"base": base},
    }
    if rows:
        size = base.get("width", 2 * base.get("radius", 0))
        layer = {"source": columns, "gizmo": "sphere", "radius": 0.003 * size, "sunk": 0.5}
        scene["data"]["layers"] = {"cities": layer}
    path = folder / "scene.json"
    path.write_text(json.dumps(scene))
    return vr.render(vr.load(path, allow_outside=True), **options)


def dots(image: np.ndarray, dark: bool) -> np.ndarray:
    """How much of each pixel a dot covers: dots are the brightest in red on the dark map, the darkest on the others."""
    return np.clip((image[..., 0] - 0.3) / 0.5, 0, 1) if dark else np.clip((0.2 - image[..., 0]) / 0.05, 0, 1)


@pytest.mark.parametrize(
    "view", [pytest.param(v, marks=[] if v == "the globe from Africa" else pytest.mark.slow) for v in VIEWS]
)
def test_cities_lie_where_the_map_shows_them(view, tmp_path):
    _, texture, name, _, wanted = VIEWS[view]
    rows = table(name)
    numbers = rendered(tmp_path, view, rows, spp=1, layers=("id",))
    empty = rendered(tmp_path, view, [], spp=16, layers=("RGB",))
    weight = dots(empty["RGB"], texture == "world-dark")
    ids, seen, reach = numbers["id"], set(), 4
    middles = {}
    for i in range(len(rows)):
        # The base is object 1, and the rows after it are numbered in order.
        y, x = np.nonzero(ids == 2 + i)
        if len(x) >= 12 and min(*x, *y) >= reach and max(x) < 1000 - reach and max(y) < 800 - reach:
            middles[i] = np.array([x.mean(), y.mean()])
    for i, (x, y) in middles.items():
        # A near city has its own dot.
        apart = min(np.hypot(*(middles[i] - other)) for j, other in middles.items() if j != i)
        row, column = round(y), round(x)
        if apart > 4 * reach:
            window = weight[row - reach : row + reach + 1, column - reach : column + reach + 1]
            assert window.sum() > 1, rows[i]["name"]
            place = np.arange(-reach, reach + 1)
            off = np.array([window.sum(0) @ place, window.sum(1) @ place]) / window.sum() + (column - x, row - y)
            # Half of a ball stands up from the middle of its dot, by less than a pixel in the picture.
            assert np.abs(off).max() < 1, (rows[i]["name"], off)
            seen.add(rows[i]["name"])
    assert wanted <= seen
