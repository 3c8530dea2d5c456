"""The maps in scenes/textures on which data stand: world-light, world-dark, europe and barcelona.

    python scenes/make_maps.py FOLDER
    python scenes/make_maps.py FOLDER europe -o somewhere/else

FOLDER has the downloads of scenes/make_data.py, of which the outlines of Natural Earth are used (public domain). What
Barcelona has is written down here by hand. All maps are equirectangular, with north up: equal steps of longitude are
equally many pixels apart, and so are equal steps of latitude. PNG, 8 bits, sRGB, few colours.
"""

import argparse
import csv
import itertools
from collections.abc import Iterator
from pathlib import Path

import matplotlib
import numpy as np
from make_data import Sources, lines
from PIL import Image, ImageColor, ImageDraw, ImageFont

# A map is drawn so many times larger, and then shrunk: that smooths its edges.
FINER = 4
# Extent of each map: west, east, south, north, in degrees; its width and height in pixels. At the middle of europe and
# of barcelona, a pixel is about as high as it is wide on the earth.
SHEETS = {
    "world-light": ((-180, 180, -90, 90), (2048, 1024)),
    "world-dark": ((-180, 180, -90, 90), (2048, 1024)),
    "europe": ((-25, 45, 32, 72), (1400, 1300)),
    "barcelona": ((2.03, 2.27, 41.29, 41.47), (1024, 1024)),
}
LIGHT = {"sea": "#c3d6e3", "land": "#f5f1e6", "coast": "#7f9bae", "border": "#c9bfaa", "grid": "#b4cad9",
         "city": "#6b5b4b"}  # fmt: skip
DARK = {"sea": "#0e1722", "land": "#29354a", "coast": "#56708f", "border": "#44536b", "grid": "#16222f",
        "city": "#ffd27a"}  # fmt: skip
# Barcelona, by hand: longitude and latitude in degrees, from place to place, to about 200 m.
COAST = """2.02 41.2665 2.061 41.2745 2.085 41.282 2.105 41.2875 2.125 41.292 2.1385 41.2945 2.1425 41.2955 2.1465
    41.301 2.152 41.31 2.156 41.319 2.152 41.326 2.147 41.331 2.152 41.3355 2.157 41.333 2.163 41.3385 2.165 41.3445
    2.171 41.351 2.1745 41.3565 2.173 41.362 2.176 41.369 2.1785 41.3755 2.1825 41.379 2.1855 41.3775 2.188 41.371
    2.1905 41.368 2.1915 41.373 2.1945 41.3795 2.199 41.385 2.203 41.388 2.208 41.393 2.213 41.398 2.218 41.404
    2.224 41.4085 2.2295 41.41 2.232 41.4145 2.235 41.4185 2.24 41.424 2.2435 41.43 2.247 41.437 2.2505 41.4445
    2.258 41.451 2.266 41.4575 2.276 41.4635 2.29 41.47"""
BESOS = "2.191 41.478 2.189 41.468 2.195 41.458 2.2015 41.449 2.2075 41.441 2.216 41.434 2.225 41.4265 2.235 41.4185"
LLOBREGAT = """1.995 41.43 2.01 41.412 2.022 41.398 2.035 41.383 2.044 41.3675 2.054 41.355 2.068 41.346 2.083 41.3395
    2.1 41.334 2.115 41.3235 2.127 41.312 2.1345 41.3025 2.1425 41.2955"""
HILLS = {
    "Collserola": """2.0325 41.415 2.055 41.405 2.075 41.3985 2.09 41.3975 2.103 41.4035 2.112 41.4095 2.121 41.4165
        2.1325 41.4255 2.143 41.4335 2.154 41.4425 2.163 41.4495 2.172 41.4585 2.181 41.4695 2.185 41.48 2.02 41.48
        2.02 41.42""",
    "Montjuïc": """2.149 41.361 2.153 41.356 2.161 41.355 2.1685 41.3585 2.1715 41.3635 2.1705 41.369 2.165 41.3705
        2.156 41.3685 2.1505 41.3655""",
}
STREETS = {
    "Diagonal": "2.082 41.379 2.117 41.3875 2.1445 41.393 2.187 41.4035 2.2215 41.411",
    "Gran Via": "2.103 41.356 2.127 41.3625 2.149 41.375 2.187 41.4035 2.205 41.4165 2.214 41.423",
    "Meridiana": "2.1835 41.393 2.187 41.4035 2.187 41.42 2.1885 41.436 2.19 41.45",
    "Passeig de Gràcia": "2.17 41.387 2.158 41.398",
    "Aragó": "2.1445 41.3765 2.187 41.408",
}
# A place by which a reader finds the way.
SQUARE = ("Pl. Catalunya", 2.17, 41.387)


def points(text: str) -> np.ndarray:
    """Longitudes and latitudes of a text. Shape: (N, 2)."""
    return np.array(text.split(), float).reshape(-1, 2)


def rounded(line: np.ndarray, passes: int = 3) -> np.ndarray:
    """A line whose corners are cut, with the same ends (Chaikin, 1974). Shape: (N, 2)."""
    for _ in range(passes):
        cut = np.stack([0.75 * line[:-1] + 0.25 * line[1:], 0.25 * line[:-1] + 0.75 * line[1:]], axis=1)
        line = np.vstack([line[:1], cut.reshape(-1, 2), line[-1:]])
    return line


class Sheet:
    """A map that is drawn, in colours of its own."""

    def __init__(self, name: str, colours: dict[str, str]) -> None:
        (self.west, self.east, self.south, self.north), self.size = SHEETS[name]
        self.colours = colours
        self.image = Image.new("RGB", tuple(FINER * n for n in self.size), colours["sea"])
        self.pen = ImageDraw.Draw(self.image)

    def pixels(self, places: np.ndarray) -> list[tuple[float, float]]:
        """Where places lie, in pixels of the enlarged picture. places: (N, 2)."""
        # Pillow cuts off what follows the point, so a place is drawn at the pixel in which it lies.
        x = (places[:, 0] - self.west) / (self.east - self.west) * self.image.width
        y = (self.north - places[:, 1]) / (self.north - self.south) * self.image.height
        return list(zip(x.tolist(), y.tolist()))

    def fill(self, places: np.ndarray, colour: str) -> None:
        self.pen.polygon(self.pixels(places), self.colours[colour])

    def line(self, places: np.ndarray, colour: str, width: float) -> None:
        self.pen.line(self.pixels(places), self.colours[colour], round(FINER * width), joint="curve")

    def dot(self, lon: float, lat: float, radius: float, colour: str = "city") -> None:
        [(x, y)] = self.pixels(np.array([[lon, lat]]))
        r = FINER * radius
        self.pen.ellipse([x - r, y - r, x + r, y + r], self.colours[colour])

    def word(self, lon: float, lat: float, text: str, size: float, colour: str, anchor: str = "mm") -> None:
        [at] = self.pixels(np.array([[lon, lat]]))
        # The font of Pillow has no accents.
        path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
        self.pen.text(at, text, self.colours[colour], ImageFont.truetype(path, FINER * size), anchor)

    def grid(self, step: float) -> None:
        """Meridians and parallels, a multiple of `step` degrees apart."""
        for lon in np.arange(np.ceil(self.west / step), self.east / step) * step:
            self.line(np.array([[lon, self.south], [lon, self.north]]), "grid", 1)
        for lat in np.arange(np.ceil(self.south / step), self.north / step) * step:
            self.line(np.array([[self.west, lat], [self.east, lat]]), "grid", 1)

    def finished(self) -> Image.Image:
        """The map in its colours, and those halfway and a quarter of the way between two of them."""
        pure = [np.array(ImageColor.getrgb(colour), float) for colour in dict.fromkeys(self.colours.values())]
        pairs = [(a, b, t) for a, b in itertools.combinations(pure, 2) for t in (0.25, 0.5, 0.75)]
        colours = np.array([*pure, *(a + t * (b - a) for a, b, t in pairs)]).round()
        small = np.asarray(self.image.resize(self.size, Image.Resampling.BOX))
        seen, which = np.unique(small.reshape(-1, 3), axis=0, return_inverse=True)
        nearest = np.abs(seen[:, None] - colours).sum(axis=2).argmin(axis=1)
        result = Image.fromarray(nearest[which].reshape(small.shape[:2]).astype(np.uint8), "P")
        result.putpalette(colours.astype(int).ravel().tolist())
        return result


def unwound(ring: np.ndarray) -> np.ndarray:
    """A ring whose longitudes go on beyond 180 degrees, and that goes by the pole if it runs about it."""
    ring = np.stack([np.unwrap(ring[:, 0], period=360), ring[:, 1]], axis=1)
    if abs(ring[-1, 0] - ring[0, 0]) > 180:
        pole = 90 * np.sign(ring[:, 1].mean())
        ring = np.vstack([ring, [[ring[-1, 0], pole], [ring[0, 0], pole]]])
    return ring


def rings(sources: Sources) -> Iterator[tuple[np.ndarray, str]]:
    """The rings of land, and those of lakes in land, with the colour that fills them."""
    topology = sources.json("land-50m.json")
    arcs = list(lines(topology))
    [land] = topology["objects"]["land"]["geometries"]
    for polygon in land["arcs"]:
        for i, numbers in enumerate(polygon):
            parts = [arcs[k] if k >= 0 else arcs[~k][::-1] for k in numbers]
            yield unwound(np.vstack([part[:-1] for part in parts] + [parts[-1][-1:]])), "sea" if i else "land"


def borders(sources: Sources) -> Iterator[np.ndarray]:
    """The lines that two countries share."""
    topology = sources.json("countries-50m.json")
    uses: dict[int, int] = {}
    for shape in topology["objects"]["countries"]["geometries"]:
        parts = [shape["arcs"]] if shape["type"] == "Polygon" else shape["arcs"]
        for k in (k for part in parts for ring in part for k in ring):
            uses[max(k, ~k)] = uses.get(max(k, ~k), 0) + 1
    for k, line in enumerate(lines(topology)):
        if uses.get(k, 0) > 1:
            yield np.stack([np.unwrap(line[:, 0], period=360), line[:, 1]], axis=1)


def earth(sheet: Sheet, sources: Sources, widths: tuple[float, float]) -> None:
    """Land, borders and coasts. widths: of borders and of coasts, in pixels."""
    outlines = list(rings(sources))
    turns = [np.array([turn, 0]) for turn in (-360, 0, 360)]
    for ring, colour in outlines:
        for turn in turns:
            sheet.fill(ring + turn, colour)
    for line, colour, width in (
        *((line, "border", widths[0]) for line in borders(sources)),
        *((ring, "coast", widths[1]) for ring, _ in outlines),
    ):
        for turn in turns:
            sheet.line(line + turn, colour, width)


def table(name: str) -> list[dict]:
    path = Path(__file__).parent / "data" / f"{name}.csv"
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def world(name: str, colours: dict[str, str], sources: Sources) -> Image.Image:
    """The world, with a dot for each of the large cities of cities.csv."""
    sheet = Sheet(name, colours)
    sheet.grid(30)
    earth(sheet, sources, (1, 1))
    for city in table("cities"):
        sheet.dot(float(city["lon"]), float(city["lat"]), 1.2 + 0.25 * (float(city["population"]) / 1e6) ** 0.5)
    return sheet.finished()


def europe(sources: Sources) -> Image.Image:
    """Europe, with a dot for each of the ports of ports.csv."""
    sheet = Sheet("europe", LIGHT)
    sheet.grid(10)
    earth(sheet, sources, (2, 2))
    for port in table("ports"):
        sheet.dot(float(port["lon"]), float(port["lat"]), 3)
    return sheet.finished()


def barcelona() -> Image.Image:
    """A sketch of Barcelona and its surroundings: the coast, two rivers, two hills and some streets."""
    colours = {"sea": "#bcd3e2", "land": "#f3efe6", "coast": "#7f9bae", "hill": "#d3dfc2", "street": "#ded6c6",
               "city": "#4a4038", "word": "#8a8577", "water": "#5d86a3"}  # fmt: skip
    sheet = Sheet("barcelona", colours)
    coast = rounded(points(COAST), 1)
    sheet.fill(np.vstack([coast, [[2.29, 41.5], [2.0, 41.5], [2.0, 41.26]]]), "land")
    for text in HILLS.values():
        hill = points(text)
        sheet.fill(rounded(np.vstack([hill, hill[:1]])), "hill")
    for text in STREETS.values():
        sheet.line(rounded(points(text)), "street", 5)
    for text in (BESOS, LLOBREGAT):
        sheet.line(rounded(points(text)), "coast", 9)
        sheet.line(rounded(points(text)), "sea", 6)
    sheet.line(coast, "coast", 2)
    sheet.word(2.199, 41.339, "Mediterranean Sea", 18, "water")
    sheet.word(2.082, 41.432, "Collserola", 26, "word")
    sheet.word(2.1605, 41.3628, "Montjuïc", 15, "word")
    sheet.word(2.2185, 41.4385, "Besòs", 20, "water", "lm")
    sheet.word(2.093, 41.3285, "Llobregat", 20, "water", "rm")
    name, lon, lat = SQUARE
    sheet.dot(lon, lat, 5)
    sheet.word(lon + 0.0025, lat + 0.0005, name, 16, "city", "lm")
    sheet.word(2.265, 41.2935, "sketch, not for finding the way", 14, "water", "rm")
    return sheet.finished()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", type=Path, metavar="FOLDER", help="the folder of the unpacked downloads")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(SHEETS)}; all if none is named")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent / "textures", help="the folder")
    chosen = parser.parse_args()
    for name in set(chosen.names) - set(SHEETS):
        parser.error(f"there is no {name}; there are {', '.join(SHEETS)}")
    sources = Sources(chosen.sources)
    made = {
        "world-light": lambda: world("world-light", LIGHT, sources),
        "world-dark": lambda: world("world-dark", DARK, sources),
        "europe": lambda: europe(sources),
        "barcelona": barcelona,
    }
    chosen.output.mkdir(parents=True, exist_ok=True)
    for name in chosen.names or SHEETS:
        path = chosen.output / f"{name}.png"
        made[name]().save(path, optimize=True)
        print(f"{path}: {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
