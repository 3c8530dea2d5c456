"""The twins of a scene's objects as shapes that Mitsuba has, from the camera, and what bounds their rounding."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from visray.primitives.primitive import MitsubaShapes, Primitive
from visray.scene.scene import Scene
from visray.study.mitsuba.facets import Facets, around, facets
from visray.study.mitsuba.rounding import BOUND, Extents
from visray.transforms import compose

# A plane is made of squares, each twice as large as the one in it, so that corners are as near as the points between
# them, and rounded as finely. These are the first one, unless the camera is farther away, and a bound of the last one:
# the products of three lengths in Embree stay below the largest single, 2^128.
SMALLEST_SQUARE, LARGEST_SQUARE = 2.0**-16, 2.0**40


def twins(scene: Scene) -> tuple[dict[str, MitsubaShapes], dict[str, str]]:
    """The twins of the objects, and of those that have none, why."""
    answers = {name: thing.mitsuba() for name, thing in scene.objects.items()}
    return (
        {name: a for name, a in answers.items() if isinstance(a, MitsubaShapes)},
        {name: a for name, a in answers.items() if isinstance(a, str)},
    )


@dataclass(frozen=True)
class Part:
    """One shape of a twin, its numbers from the centre, and what bounds its rounding: see Extents.

    blunt: how many times farther the corners of a facet are than it is wide, so that as many times their rounding turns
    it; smear: the change of (u, v) on a facet over its width, where it is one of many.
    """

    shape: dict
    uv: Callable
    far: float
    growth: float = 0.0
    blunt: float = 1.0
    smear: float = 0.0
    gap: float = 0.0
    slip: float = 0.0
    tilt: float = 0.0


def parts(made: list[MitsubaShapes], centre: np.ndarray) -> list[list[Part]]:
    """The shapes of twins, moved so that `centre` is the origin."""
    counts = Counter(shape["type"] for twin in made for shape in twin.shapes)

    @cache
    def of(kind: str, own: float | None) -> Facets:
        return facets(kind, around(kind, counts[kind]), own)

    return [[_part(dict(shape), twin.uv or (lambda uv: uv), centre, of) for shape in twin.shapes] for twin in made]


def _part(shape: dict, uv: Callable, centre: np.ndarray, facets_of: Callable[[str, float | None], Facets]) -> Part:
    if shape["type"] == "mesh":
        shape["vertices"] = shape["vertices"] - centre
        far, blunt = _of_facets(shape["vertices"], shape["faces"])
        return Part(shape, uv, far.max(), blunt=blunt.max())
    whole = shape["to_world"] = shape["to_world"].copy()
    whole[:3, 3] -= centre
    if shape["type"] == "plane":
        return _plane(whole, uv)
    if shape["type"] == "rectangle":
        x, y, _, o = whole[:3].T
        corners = np.array([o - x - y, o + x - y, o + x + y, o - x + y])
        far, blunt = _of_facets(corners, np.array([[0, 1, 2], [0, 2, 3]]))
        return Part(shape, uv, far.max(), blunt=blunt.max())
    if shape["type"] == "disk":
        # Only its z axis could be of another length, which means nothing on a disk.
        whole[:3, 2] *= np.linalg.norm(whole[:3, 0]) / np.linalg.norm(whole[:3, 2])
    if shape["type"] in ("sphere", "disk") and uniform(whole[:3, :3]):
        own = (lambda found: uv(_square(found))) if shape["type"] == "disk" else uv
        return Part(shape, own, np.linalg.norm(whole[:3], axis=0).sum())
    return _faceted(facets_of(shape["type"], shape.get("shape")), uv, whole)


def _square(polar: tuple) -> tuple:
    """The square around a disk, from 0 to 1, from Mitsuba's distance and angle on it, both from 0 to 1."""
    return tuple(0.5 + 0.5 * polar[0] * part(2 * np.pi * polar[1]) for part in (np.cos, np.sin))


def _faceted(f: Facets, uv: Callable, whole: np.ndarray) -> Part:
    """A round shape as a mesh. Its normals are given, so they do not turn with the facets.

    But where on a narrow facet a ray is, and so what its (u, v) are, is less certain than where it is in the world.
    """
    linear = whole[:3, :3]
    vertices, normals = f.vertices @ linear.T + whole[:3, 3], f.normals @ np.linalg.inv(linear)
    normals /= np.linalg.norm(normals, axis=1).max()
    far, blunt = _of_facets(vertices, f.faces)
    smear = (blunt / far * np.ptp(f.uv[f.faces], 1).max(1)).max()
    mesh = {"type": "mesh", "vertices": vertices, "normals": normals, "uv": f.uv, "faces": f.faces}
    gap, tilt = f.gap * np.linalg.norm(linear, 2), f.tilt * np.linalg.cond(linear)
    return Part(mesh, uv, far.max(), smear=smear, gap=gap, slip=f.slip, tilt=tilt)


def uniform(linear: np.ndarray) -> bool:
    """Whether a linear map keeps shapes: a turn, a mirror, a scale."""
    square = linear.T @ linear
    scale = np.trace(square) / 3
    # Twelve roundings in the product and the trace; a tenfold share for those of the composed steps.
    return bool(np.allclose(square, scale * np.eye(3), rtol=0, atol=120 * np.finfo(float).eps * scale))


def mirrors(matrix: np.ndarray | None) -> bool:
    """Whether a transform turns a right hand into a left one."""
    return matrix is not None and bool(np.linalg.det(matrix[:, :3]) < 0)


def _of_facets(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far the corners of each triangle are, and how many times that is its width."""
    corners = vertices[faces]
    sides = np.roll(corners, -1, 1) - corners
    width = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / np.linalg.norm(sides, axis=2).max(1)
    far = np.linalg.norm(corners, axis=2).max(1)
    return far, far / width


def _plane(whole: np.ndarray, uv: Callable) -> Part:
    """A plane as squares within squares about the point nearest to the centre."""
    x, y, _, o = whole[:3].T
    n = np.cross(x, y) / np.linalg.norm(np.cross(x, y))
    foot = n * (n @ o)
    s = x / np.linalg.norm(x)
    first = 2.0 ** np.ceil(np.log2(max(np.linalg.norm(foot), SMALLEST_SQUARE)))
    sides = first * 2.0 ** np.arange(max(1, 1 + np.log2(LARGEST_SQUARE / first)))
    corners = np.array([-s - np.cross(n, s), s - np.cross(n, s), s + np.cross(n, s), -s + np.cross(n, s)])
    away = (sides[:, None, None] * corners).reshape(-1, 3)
    inner = 4 * np.arange(len(sides) - 1)[:, None] + np.arange(4)
    after = 4 * np.arange(len(sides) - 1)[:, None] + (np.arange(4) + 1) % 4
    rings = np.stack([inner, inner + 4, after + 4, inner, after + 4, after], -1).reshape(-1, 3)
    faces = np.concatenate([[[0, 1, 2], [0, 2, 3]], rings])
    # (u, v) from the foot: single precision is finest near the camera, and the foot's own are added in double.
    inverse = np.linalg.inv(whole[:3, :3])[:2]
    base = inverse @ (foot - o)
    mesh = {"type": "mesh", "vertices": foot + away, "faces": faces, "uv": away @ inverse.T}
    spread = 2 * np.sqrt(2)
    far = np.linalg.norm(foot) + spread * first
    blunt = _of_facets(mesh["vertices"], faces)[1].max()
    return Part(mesh, lambda found: uv((found[0] + base[0], found[1] + base[1])), far, spread, blunt)


def extents(things: list[Primitive], made: list[list[Part]]) -> Extents:
    """What bounds the rounding of each object's twin."""

    def most(name: str) -> np.ndarray:
        return np.array([max(getattr(p, name) for p in found) for found in made])

    return Extents(
        far=most("far"),
        growth=most("growth"),
        gap=most("gap"),
        angle=BOUND * most("blunt") + most("tilt"),
        smear=most("smear"),
        slip=most("slip"),
        bounded=np.array([t.bounded for t in things]),
        sided=np.array([t.closed and not mirrors(compose(t.transform)) for t in things]),
    )
