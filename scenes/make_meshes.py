"""The meshes in scenes/meshes, each computed from nothing but the numbers in this file, so free to use like it.

    python scenes/make_meshes.py
    python scenes/make_meshes.py teapot -o somewhere/else

The same every time. y is up. Closed parts have no open edges, and their faces run counter-clockwise seen from outside.
"""

import argparse
import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np


@dataclass
class Part:
    """A part of a mesh: its name, its vertices (V, 3), its polygons, each a list of numbers of vertices from 0, and the
    texture coordinates of its vertices (V, 2) or None."""

    name: str
    vertices: np.ndarray
    polygons: list[list[int]]
    uvs: np.ndarray | None = None


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors of length 1. Shape: (N, 3)."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def curve(points: list[tuple], steps: int) -> np.ndarray:
    """A Catmull-Rom curve through points, with `steps` points from one to the next. Shape: (N, dimensions)."""
    p = np.array(points, float)
    p = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])
    t = np.arange(steps)[:, None] / steps
    pieces = [
        b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))
        for a, b, c, d in zip(p, p[1:], p[2:], p[3:])
    ]
    return np.concatenate([*pieces, p[-2:-1]])


def bezier(points: list[tuple], count: int) -> np.ndarray:
    """`count` points of a cubic Bezier curve. Shape: (count, dimensions)."""
    a, b, c, d = np.array(points, float)
    t = np.linspace(0, 1, count)[:, None]
    return (1 - t) ** 3 * a + 3 * t * (1 - t) ** 2 * b + 3 * t**2 * (1 - t) * c + t**3 * d


def tube(rings: np.ndarray) -> list[list[int]]:
    """The quads between rings of vertices, one ring after the other. Shape: rings (R, S, 3)."""
    count, around = rings.shape[:2]
    number = np.arange(count * around).reshape(count, around)
    following = np.roll(number, -1, axis=1)
    quads = np.stack([number[:-1], following[:-1], following[1:], number[1:]], axis=-1)
    return quads.reshape(-1, 4).tolist()


def capped(name: str, rings: np.ndarray) -> Part:
    """A closed tube: the quads between its rings, and a polygon at each end."""
    around, last = rings.shape[1], rings.shape[0] * rings.shape[1]
    ends = [list(range(around))[::-1], list(range(last - around, last))]
    return outwards(Part(name, rings.reshape(-1, 3), tube(rings) + ends))


def revolved(name: str, profile: np.ndarray, around: int) -> Part:
    """A closed surface of revolution about the y axis.

    profile: radius and height, from a point of the axis to another one; both ends have the radius 0. Shape: (N, 2)
    """
    turn = 2 * np.pi * np.arange(around) / around
    r, y = profile[1:-1, :1], profile[1:-1, 1:]
    rings = np.stack([r * np.cos(turn), y + 0 * turn, -r * np.sin(turn)], axis=-1)
    low, high = rings.size // 3, rings.size // 3 + 1
    poles = [(0, profile[0, 1], 0), (0, profile[-1, 1], 0)]
    following = [(k + 1) % around for k in range(around)]
    fans = [[low, n, k] for k, n in enumerate(following)]
    fans += [[high, low - around + k, low - around + n] for k, n in enumerate(following)]
    return outwards(Part(name, np.concatenate([rings.reshape(-1, 3), poles]), tube(rings) + fans))


def swept(path: np.ndarray, across: np.ndarray, along: np.ndarray, around: int) -> np.ndarray:
    """Rings of ellipses along a path in the plane z = 0.

    across, along: half axes of each ellipse, in the z direction and in the plane of the path.

    Shapes: path (N, 2), across and along (N); result (N, around, 3).
    """
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    turn = 2 * np.pi * np.arange(around) / around
    in_plane = path[:, None] + (along[:, None] * np.cos(turn))[..., None] * normal[:, None]
    return np.concatenate([in_plane, (across[:, None] * np.sin(turn))[..., None]], axis=2)


def outwards(part: Part) -> Part:
    """The part with its polygons turned so that its volume is positive."""
    volume = 0.0
    for polygon in part.polygons:
        a, *rest = part.vertices[polygon]
        volume += sum(np.dot(a, np.cross(b, c)) for b, c in itertools.pairwise(rest))
    return part if volume > 0 else replace(part, polygons=[p[::-1] for p in part.polygons])


def teapot() -> list[Part]:
    """A teapot of four closed parts: body, lid, spout and handle. It stands on y = 0, with its spout to +x."""
    around = 56
    outside = curve([(0.7, 0.05), (0.9, 0.24), (1.03, 0.52), (1.0, 0.82), (0.83, 1.08), (0.6, 1.23)], 4)
    lip = np.array([(0.56, 1.265), (0.545, 1.285), (0.525, 1.285), (0.51, 1.265), (0.52, 1.23)])
    inside = curve([(0.72, 1.11), (0.92, 0.84), (0.96, 0.53), (0.84, 0.28), (0.5, 0.13), (0.0, 0.1)], 2)
    foot = np.array([(0, 0.04), (0.52, 0.04), (0.56, 0.0), (0.65, 0.0), (0.68, 0.02)])
    body = revolved("body", np.concatenate([foot, outside, lip, inside]), around)
    dome = curve([(0.62, 1.305), (0.6, 1.34), (0.46, 1.41), (0.25, 1.465), (0.1, 1.5)], 3)
    knob = curve([(0.07, 1.54), (0.1, 1.59), (0.145, 1.645), (0.13, 1.71), (0.07, 1.745), (0.0, 1.755)], 3)
    lid = revolved("lid", np.concatenate([[(0, 1.295), (0.3, 1.295), (0.57, 1.295)], dome, knob]), around)
    path = bezier([(0.82, 0.4), (1.62, 0.36), (1.2, 1.08), (1.79, 1.24)], 26)
    t = np.linspace(0, 1, len(path))
    across, along = 0.2 - 0.125 * t**0.8, 0.27 - 0.185 * t**0.7
    # Its hole: the tube turns back into itself at the mouth.
    hole = slice(None, 14, -1)
    rings = swept(path, across, along, 28)
    mouth = swept(path, 0.75 * across, 0.75 * along, 28)[hole]
    spout = capped("spout", np.concatenate([rings, mouth]))
    grip = bezier([(-0.86, 1.0), (-1.75, 1.3), (-1.75, 0.2), (-0.93, 0.34)], 30)
    swell = 0.8 + 0.4 * np.abs(np.linspace(-1, 1, len(grip))) ** 3
    handle = capped("handle", swept(grip, 0.095 * swell, 0.062 * swell, 20))
    return [body, lid, spout, handle]


def knot() -> list[Part]:
    """The tube of a torus knot that winds twice around the axis and three times through the hole, with texture
    coordinates: u along the knot, v around the tube."""
    count, around, radius = 240, 26, 0.33
    s = 2 * np.pi * np.arange(count) / count
    core = np.stack([np.cos(2 * s), 0 * s, np.sin(2 * s)], axis=-1)

    def point(s: np.ndarray) -> np.ndarray:
        r = 1.3 + 0.6 * np.cos(3 * s)
        return np.stack([r * np.cos(2 * s), 0.6 * np.sin(3 * s), r * np.sin(2 * s)], axis=-1)

    tangent = unit(point(s + 1e-4) - point(s - 1e-4))
    out = point(s) - 1.3 * core
    out = unit(out - (out * tangent).sum(axis=1, keepdims=True) * tangent)
    side = np.cross(tangent, out)
    turn = 2 * np.pi * np.arange(around)[:, None] / around
    rings = point(s)[:, None] + radius * (np.cos(turn) * out[:, None] + np.sin(turn) * side[:, None])
    # The first ring and the first vertex of each ring come again at the end, with other texture coordinates.
    i, j = np.meshgrid(np.arange(count + 1), np.arange(around + 1), indexing="ij")
    number = i * (around + 1) + j
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    uvs = np.stack([i / count, j / around], axis=-1).reshape(-1, 2)
    return [outwards(Part("knot", rings[i % count, j % around].reshape(-1, 3), quads.reshape(-1, 4).tolist(), uvs))]


def tulip() -> list[Part]:
    """A tulip of two parts: the stem with its leaves, and the blossom. It stands on y = 0."""
    stalk = np.stack([0.03 * np.sin(np.linspace(0, 2.5, 12)), np.linspace(0, 1, 12)], axis=1)
    size = np.full(len(stalk), 0.022)
    parts = [capped("stem", swept(stalk, size, size, 8)), *(leaf(turn) for turn in (0.4, 2.7, 4.6))]
    return [joined("green", parts), blossom(stalk[-1])]


def leaf(turn: float) -> Part:
    """A leaf that grows from the ground and bends outwards: a thin sheet. turn: its direction, in radians."""
    spine = bezier([(0.02, 0), (0.08, 0.3), (0.12, 0.62), (0.34, 0.7)], 10)
    width = 0.085 * np.sin(np.pi * np.linspace(0.12, 0.98, 10)) ** 0.7
    across = np.linspace(-1, 1, 5)
    # A leaf is folded along its spine.
    x = spine[:, :1] - 0.5 * width[:, None] * across**2
    rows = np.stack([x, spine[:, 1:] + 0 * x, width[:, None] * across], axis=-1)
    cos, sin = np.cos(turn), np.sin(turn)
    rows = rows @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    number = np.arange(50).reshape(10, 5)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    return Part("leaf", rows.reshape(-1, 3), quads.reshape(-1, 4).tolist())


def blossom(top: np.ndarray) -> Part:
    """A cup of six petals. top: end of the stem, x and y."""
    around = 30
    turn = 2 * np.pi * np.arange(around) / around
    profile = curve([(0.015, -0.01), (0.09, 0.03), (0.135, 0.14), (0.12, 0.26), (0.09, 0.34)], 2)
    petal = np.abs(np.cos(3 * turn))
    share = np.linspace(0, 1, len(profile))[:, None]
    r = profile[:, :1] * (1 - 0.1 * share * (1 - petal))
    y = profile[:, 1:] * (1 - 0.3 * share * (1 - petal) ** 2)
    rings = np.stack([top[0] + r * np.cos(turn), top[1] + y, -r * np.sin(turn)], axis=-1)
    base = [list(range(around))[::-1]]
    return Part("blossom", rings.reshape(-1, 3), tube(rings) + base)


def ribbon() -> list[Part]:
    """A ribbon that is wound around the x axis, ever wider, with gaps between its turns. Its front is outside."""
    share = np.linspace(0, 1, 121)
    turn, radius = 7 * np.pi * share, 0.22 + 0.22 * share
    middle = np.stack([2.1 * share, radius * np.sin(turn), radius * np.cos(turn)], axis=-1)
    rows = middle[:, None] + np.array([-0.15, 0.15])[:, None] * np.array([1, 0, 0])
    number = np.arange(rows.size // 3).reshape(-1, 2)
    quads = np.stack([number[:-1, 0], number[:-1, 1], number[1:, 1], number[1:, 0]], axis=-1)
    return [Part("ribbon", rows.reshape(-1, 3), quads.tolist())]


def joined(name: str, parts: list[Part]) -> Part:
    """Several parts as one."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    polygons = [[k + int(start) for k in p] for part, start in zip(parts, starts) for p in part.polygons]
    return Part(name, np.concatenate([part.vertices for part in parts]), polygons)


def write_obj(path: Path, parts: list[Part]) -> None:
    """Writes an OBJ file, which names its parts."""
    lines, first = [f"# Written by scenes/make_meshes.py: {path.stem}"], 1
    for part in parts:
        lines.append(f"o {part.name}")
        lines += ["v " + " ".join(f"{x:.4f}".rstrip("0").rstrip(".") for x in v + 0.0) for v in part.vertices]
        lines += ["f " + " ".join(str(k + first) for k in polygon) for polygon in part.polygons]
        first += len(part.vertices)
    path.write_text("\n".join(lines) + "\n")


def write_ply(path: Path, parts: list[Part]) -> None:
    """Writes a binary PLY file of one part of quads, with texture coordinates."""
    (part,) = parts
    columns = "".join(f"property float {name}\n" for name in "xyzst")
    head = f"ply\nformat binary_little_endian 1.0\ncomment Written by scenes/make_meshes.py: {path.stem}\n"
    head += f"element vertex {len(part.vertices)}\n{columns}element face {len(part.polygons)}\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    faces = np.empty(len(part.polygons), [("count", "u1"), ("corners", "<i4", 4)])
    faces["count"], faces["corners"] = 4, part.polygons
    numbers = np.concatenate([part.vertices, part.uvs], axis=1).astype("<f4")
    path.write_bytes(head.encode() + numbers.tobytes() + faces.tobytes())


MESHES: dict[str, Callable[[], list[Part]]] = {
    "teapot.obj": teapot,
    "knot.ply": knot,
    "tulip.obj": tulip,
    "ribbon.obj": ribbon,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = {Path(file).stem: file for file in MESHES}
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(names)}; all if none is named")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent / "meshes", help="the folder")
    chosen = parser.parse_args()
    for name in set(chosen.names) - set(names):
        parser.error(f"there is no {name}; there are {', '.join(names)}")
    chosen.output.mkdir(parents=True, exist_ok=True)
    for name in chosen.names or names:
        path = chosen.output / names[name]
        write = write_ply if path.suffix == ".ply" else write_obj
        write(path, MESHES[path.name]())
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
