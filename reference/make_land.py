"""Writes visray/data/land.bin, the coasts that maps are drawn with, from Natural Earth's land at 1:50 million.

    npm pack world-atlas@2 && tar xzf world-atlas-2.*.tgz
    python reference/make_land.py package/land-50m.json

The source is in the public domain (naturalearthdata.com); world-atlas has it as TopoJSON.
"""

import json
import sys
from pathlib import Path

import numpy as np

from visray.data import land

# Largest distance of a point that is left out from the line that replaces it, in degrees.
TOLERANCE = 0.04
# Smallest area of a ring that is kept, in square degrees.
SMALLEST = 0.02


def rings(path: Path) -> list[land.Ring]:
    """All rings of a TopoJSON file of land. In each polygon, rings after the first enclose water."""
    topology = json.loads(path.read_text())
    scale, shift = (np.array(topology["transform"][key]) for key in ("scale", "translate"))
    arcs = [np.cumsum(np.array(arc), axis=0) * scale + shift for arc in topology["arcs"]]

    def line(numbers: list[int]) -> np.ndarray:
        # A negative number is an arc the other way round; the arcs of a ring share their ends.
        parts = [arcs[i] if i >= 0 else arcs[~i][::-1] for i in numbers]
        return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])

    found = []
    for shape in topology["objects"]["land"]["geometries"]:
        for polygon in shape["arcs"] if shape["type"] == "MultiPolygon" else [shape["arcs"]]:
            found += [land.Ring(unwrapped(line(ring)), i > 0) for i, ring in enumerate(polygon)]
    return found


def unwrapped(points: np.ndarray) -> np.ndarray:
    """The ring without jumps at the date line: its longitudes go on beyond 180. A ring around the south pole is closed
    along latitude -90."""
    lon = np.unwrap(points[:, 0], period=360)
    lon -= 360 * np.round(lon.mean() / 360)
    points = np.stack([lon, points[:, 1]], axis=1)
    if abs(lon[-1] - lon[0]) < 180:
        return points
    return np.concatenate([points, [[lon[-1], -90.0], [lon[0], -90.0], points[0]]])


def area(points: np.ndarray) -> float:
    """Area of a ring in square degrees."""
    x, y = points.T
    return 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))


def simplified(points: np.ndarray) -> np.ndarray:
    """The ring with fewer points. Source: Douglas and Peucker, 1973."""
    keep = np.zeros(len(points), bool)
    far = int(np.argmax(np.linalg.norm(points - points[0], axis=1)))
    keep[[0, far, -1]] = True
    stack = [(0, far), (far, len(points) - 1)]
    while stack:
        a, b = stack.pop()
        if b - a < 2:
            continue
        chord, offsets = points[b] - points[a], points[a + 1 : b] - points[a]
        share = np.clip(offsets @ chord / max(chord @ chord, np.finfo(float).tiny), 0, 1)
        distance = np.linalg.norm(offsets - share[:, None] * chord, axis=1)
        worst = int(np.argmax(distance))
        if distance[worst] > TOLERANCE:
            keep[a + 1 + worst] = True
            stack += [(a, a + 1 + worst), (a + 1 + worst, b)]
    return points[keep]


if __name__ == "__main__":
    # The source has a seam along the south pole, as a lake a thousandth of a degree wide.
    no_seam = [ring for ring in rings(Path(sys.argv[1])) if ring.points[:, 1].max() > -89]
    kept = [ring for ring in no_seam if area(ring.points) >= SMALLEST]
    content = land.encode([ring._replace(points=simplified(ring.points)) for ring in kept])
    land.FILE.write_bytes(content)
    print(f"{land.FILE}: {len(kept)} rings, {len(content):,} bytes")
