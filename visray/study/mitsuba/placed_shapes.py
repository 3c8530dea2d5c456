"""Objects as Mitsuba shapes, in coordinates relative to the camera, and bounds of their rounding in Mitsuba."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from visray.primitives.primitive import MitsubaShapes, Primitive
from visray.scene.scene import Scene
from visray.study.mitsuba.rounding import BOUND, ObjectRounding
from visray.study.mitsuba.tessellation import Tessellation, facets_around, tessellate
from visray.transforms import compose

# A plane is made of nested squares, each twice as large as the next smaller square. So the corners of a facet are about
# as near to the camera as the points between them, and their rounding is about as small. SMALLEST_SQUARE is half the
# side of the innermost square, unless the camera is farther than this from the plane. LARGEST_SQUARE bounds half the
# side of the outermost square: products of three lengths in Embree must stay below 2^128, the largest single-precision
# number.
SMALLEST_SQUARE, LARGEST_SQUARE = 2.0**-16, 2.0**40


def mitsuba_shapes(scene: Scene) -> tuple[dict[str, MitsubaShapes], dict[str, str]]:
    """Two dicts by object name: the Mitsuba shapes of objects; and for objects without such shapes, the reason."""
    results = {name: primitive.mitsuba() for name, primitive in scene.objects.items()}
    return (
        {name: x for name, x in results.items() if isinstance(x, MitsubaShapes)},
        {name: x for name, x in results.items() if isinstance(x, str)},
    )


@dataclass(frozen=True)
class PlacedShape:
    """One Mitsuba shape of an object, relative to the centre, and bounds of its rounding.

    shape: dict for Mitsuba, or dict of the arrays of a mesh
    uv: function from Mitsuba's (u, v) to visray's
    far, growth, smear, gap, slip: see ObjectRounding
    blunt: largest quotient of a facet's distance from the centre and the facet's width. If rounding changes the corners
        by a relative error, the facet turns by at most `blunt` times this error.
    tilt: largest angle between the normals of the mesh and of the object (radians)
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


def placed_shapes(objects: list[MitsubaShapes], centre: np.ndarray) -> list[list[PlacedShape]]:
    """The shapes of each object, moved so that `centre` is the origin."""
    counts = Counter(shape["type"] for shapes in objects for shape in shapes.shapes)

    @cache
    def tessellated(kind: str, parameter: float | None) -> Tessellation:
        return tessellate(kind, facets_around(kind, counts[kind]), parameter)

    return [
        [_placed(dict(shape), shapes.uv or (lambda uv: uv), centre, tessellated) for shape in shapes.shapes]
        for shapes in objects
    ]


def _placed(
    shape: dict, uv: Callable, centre: np.ndarray, tessellated: Callable[[str, float | None], Tessellation]
) -> PlacedShape:
    """One shape, moved so that `centre` is the origin.

    shape: dict that Primitive.mitsuba returns; it is changed
    tessellated: function from a kind of shape and its parameter to the triangles of the canonical shape
    """
    if shape["type"] == "mesh":
        shape["vertices"] = shape["vertices"] - centre
        far, blunt = _far_and_blunt(shape["vertices"], shape["faces"])
        return PlacedShape(shape, uv, far.max(), blunt=blunt.max())
    to_world = shape["to_world"] = shape["to_world"].copy()
    to_world[:3, 3] -= centre
    if shape["type"] == "plane":
        return _plane(to_world, uv)
    if shape["type"] == "rectangle":
        x, y, _, o = to_world[:3].T
        corners = np.array([o - x - y, o + x - y, o + x + y, o - x + y])
        far, blunt = _far_and_blunt(corners, np.array([[0, 1, 2], [0, 2, 3]]))
        return PlacedShape(shape, uv, far.max(), blunt=blunt.max())
    if shape["type"] == "disk":
        # The length of a disk's z axis has no effect. It gets the length of the x axis, so that a disk without shear
        # passes the test for a similarity.
        to_world[:3, 2] *= np.linalg.norm(to_world[:3, 0]) / np.linalg.norm(to_world[:3, 2])
    if shape["type"] in ("sphere", "disk") and is_similarity(to_world[:3, :3]):
        native_uv = (lambda polar: uv(_square_from_polar(polar))) if shape["type"] == "disk" else uv
        return PlacedShape(shape, native_uv, np.linalg.norm(to_world[:3], axis=0).sum())
    return _mesh(tessellated(shape["type"], shape.get("shape")), uv, to_world)


def _square_from_polar(polar: tuple) -> tuple:
    """Coordinates x, y on the square around a disk, from Mitsuba's polar coordinates (radius, angle).

    Units: all of them run from 0 to 1; the centre of the disk is at (0.5, 0.5).
    """
    return tuple(0.5 + 0.5 * polar[0] * f(2 * np.pi * polar[1]) for f in (np.cos, np.sin))


def _mesh(canonical: Tessellation, uv: Callable, to_world: np.ndarray) -> PlacedShape:
    """A tessellated shape as a mesh.

    The mesh has its own normals, so they do not turn if rounding turns a facet. But (u, v) are less certain than the
    hit point, because they change quickly across a narrow facet. `smear` bounds this change.

    canonical: the triangles of the shape before its transform
    to_world: the transform, (4, 4)
    """
    linear = to_world[:3, :3]
    vertices, normals = canonical.vertices @ linear.T + to_world[:3, 3], canonical.normals @ np.linalg.inv(linear)
    normals /= np.linalg.norm(normals, axis=1).max()
    far, blunt = _far_and_blunt(vertices, canonical.faces)
    smear = (blunt / far * np.ptp(canonical.uv[canonical.faces], 1).max(1)).max()
    mesh = {"type": "mesh", "vertices": vertices, "normals": normals, "uv": canonical.uv, "faces": canonical.faces}
    gap, tilt = canonical.gap * np.linalg.norm(linear, 2), canonical.tilt * np.linalg.cond(linear)
    return PlacedShape(mesh, uv, far.max(), smear=smear, gap=gap, slip=canonical.slip, tilt=tilt)


def is_similarity(linear: np.ndarray) -> bool:
    """Whether a linear map consists of rotation, reflection and uniform scale only. Shapes: (3, 3)."""
    square = linear.T @ linear
    scale = np.trace(square) / 3
    # The product and the trace take 12 roundings. The tolerance is ten times as large, because the transforms from
    # which the map was composed are rounded too.
    return bool(np.allclose(square, scale * np.eye(3), rtol=0, atol=120 * np.finfo(float).eps * scale))


def is_mirroring(matrix: np.ndarray | None) -> bool:
    """Whether a transform mirrors space (has a negative determinant). Shapes: (3, 4). None: no transform."""
    return matrix is not None and bool(np.linalg.det(matrix[:, :3]) < 0)


def _far_and_blunt(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each triangle: the distance of its farthest corner from the origin; and that distance over the triangle's
    width, which is its least height. Shapes: vertices (N, 3), faces (M, 3) -> (M), (M).
    """
    corners = vertices[faces]
    sides = np.roll(corners, -1, 1) - corners
    width = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / np.linalg.norm(sides, axis=2).max(1)
    far = np.linalg.norm(corners, axis=2).max(1)
    return far, far / width


def _plane(to_world: np.ndarray, uv: Callable) -> PlacedShape:
    """A plane as a mesh of nested squares about its foot, which is the point of the plane nearest to the camera."""
    x, y, _, o = to_world[:3].T
    n = np.cross(x, y) / np.linalg.norm(np.cross(x, y))
    foot = n * (n @ o)
    s = x / np.linalg.norm(x)
    first = 2.0 ** np.ceil(np.log2(max(np.linalg.norm(foot), SMALLEST_SQUARE)))
    sides = first * 2.0 ** np.arange(max(1, 1 + np.log2(LARGEST_SQUARE / first)))
    corners = np.array([-s - np.cross(n, s), s - np.cross(n, s), s + np.cross(n, s), -s + np.cross(n, s)])
    from_foot = (sides[:, None, None] * corners).reshape(-1, 3)
    inner = 4 * np.arange(len(sides) - 1)[:, None] + np.arange(4)
    after = 4 * np.arange(len(sides) - 1)[:, None] + (np.arange(4) + 1) % 4
    rings = np.stack([inner, inner + 4, after + 4, inner, after + 4, after], -1).reshape(-1, 3)
    faces = np.concatenate([[[0, 1, 2], [0, 2, 3]], rings])
    # The mesh stores (u, v) minus those of the foot, so that their rounding is smallest near the camera. The (u, v) of
    # the foot are added in double precision.
    inverse = np.linalg.inv(to_world[:3, :3])[:2]
    foot_uv = inverse @ (foot - o)
    mesh = {"type": "mesh", "vertices": foot + from_foot, "faces": faces, "uv": from_foot @ inverse.T}
    growth = 2 * np.sqrt(2)
    far = np.linalg.norm(foot) + growth * first
    blunt = _far_and_blunt(mesh["vertices"], faces)[1].max()
    return PlacedShape(mesh, lambda mesh_uv: uv((mesh_uv[0] + foot_uv[0], mesh_uv[1] + foot_uv[1])), far, growth, blunt)


def object_rounding(primitives: list[Primitive], shapes: list[list[PlacedShape]]) -> ObjectRounding:
    """Bounds of the rounding of each object's shapes in Mitsuba."""

    def largest(name: str) -> np.ndarray:
        return np.array([max(getattr(s, name) for s in shapes_of_object) for shapes_of_object in shapes])

    return ObjectRounding(
        far=largest("far"),
        growth=largest("growth"),
        gap=largest("gap"),
        angle=BOUND * largest("blunt") + largest("tilt"),
        smear=largest("smear"),
        slip=largest("slip"),
        bounded=np.array([p.bounded for p in primitives]),
        sided=np.array([p.closed and not is_mirroring(compose(p.transform)) for p in primitives]),
    )
