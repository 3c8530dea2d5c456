"""The triangle mesh, and what a valid one is."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from visray.geometry import gamma
from visray.quantities import FARTHEST

Field = Literal["file", "faces", "vertices", "part", "solid", "normals"]


class MeshError(ValueError):
    """What is wrong with a mesh, in one line without address or file name.

    field: the field of the scene object that it concerns.
    """

    def __init__(self, field: Field, text: str):
        super().__init__(text)
        self.field = field


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles with shared vertices. The arrays are C-contiguous and read-only.

    vertices: positions
    faces: for each triangle, the indices of its three vertices, counter-clockwise seen from outside
    normals, normal_of: unit normals of the file, and for each corner of each triangle the index of its normal; or None
    uvs, uv_of: texture coordinates, and for each corner the index of its own; or None. v grows upwards: the first row
        of an image lies at v = 1
    parts, part_of: names of the file's parts, and for each triangle the index of its part
    notes: sentences for the user about what was dropped or is not used

    Shapes: vertices (V, 3), faces (F, 3), normals (N, 3), normal_of (F, 3), uvs (T, 2), uv_of (F, 3), part_of (F).
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    normal_of: np.ndarray | None = None
    uvs: np.ndarray | None = None
    uv_of: np.ndarray | None = None
    parts: tuple[str, ...] = ()
    part_of: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        if self.part_of is None:
            object.__setattr__(self, "parts", self.parts or ("mesh",))
            object.__setattr__(self, "part_of", np.zeros(len(self.faces)))
        for name in ("vertices", "normals", "uvs"):
            object.__setattr__(self, name, _frozen(getattr(self, name), np.float64))
        for name in ("faces", "normal_of", "uv_of", "part_of"):
            object.__setattr__(self, name, _frozen(getattr(self, name), np.uint32))

    def kept(self, keep: np.ndarray) -> "TriangleMesh":
        """The mesh of some of its triangles, with all vertices.

        keep: mask or indices of the triangles.
        """
        of = {name: getattr(self, name) for name in ("faces", "normal_of", "uv_of", "part_of")}
        return replace(self, **{name: None if rows is None else rows[keep] for name, rows in of.items()})


def _frozen(values: Any, kind: type) -> np.ndarray | None:
    """The values as a read-only C-contiguous array; None stays None."""
    if values is None:
        return None
    array = np.ascontiguousarray(values, kind)
    # Freezing a view of an array that the caller can still write would be no protection.
    if array.flags.writeable and array is values:
        array = array.view()
    array.flags.writeable = False
    return array


def edge_vectors(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges b - a and c - a of triangles. Shapes: (F, 3) each."""
    a = vertices[faces[:, 0]]
    return vertices[faces[:, 1]] - a, vertices[faces[:, 2]] - a


def without_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Mask of the triangles whose corners lie on one line as far as rounding lets one say: two corners are equal, or no
    component of the cross product of two edges has a certain sign. Shape: (F).

    Error: a component is the difference of two products; each of them carries four roundings (two edges, product,
    difference), so it is off by at most gamma(4) times the sum of their sizes (tests/test_meshes.py).
    """
    doubtful = np.ones(len(faces), bool)
    x, y = edge_vectors(vertices, faces)
    for i, j in ((1, 2), (2, 0), (0, 1)):
        first, second = x[:, i] * y[:, j], x[:, j] * y[:, i]
        doubtful &= np.abs(first - second) <= gamma(4) * (np.abs(first) + np.abs(second))
    equal = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return equal | doubtful


def check_vertices(vertices: np.ndarray, first: int = 0) -> None:
    """Raises a MeshError if a coordinate is not finite or too large.

    first: the number that the file gives its first vertex, 0 or 1.
    """
    if np.abs(vertices).max(initial=0) <= FARTHEST:
        return
    finite = np.isfinite(vertices).all(axis=1)
    number = np.flatnonzero(~finite)
    if len(number):
        raise MeshError("vertices", f"vertex {number[0] + first} is not finite; every coordinate must be a number")
    number = np.flatnonzero((np.abs(vertices) > FARTHEST).any(axis=1))[0]
    raise MeshError(
        "vertices",
        f"vertex {number + first} has the coordinate {np.abs(vertices[number]).max():g}; "
        f"coordinates lie between {-FARTHEST:g} and {FARTHEST:g}",
    )


def from_arrays(vertices: Any, faces: Any) -> TriangleMesh:
    """The mesh of given vertices and faces; triangles without area are dropped, and noted.

    Shapes: vertices (V, 3) numbers; faces (F, 3) whole numbers from 0 to V - 1.

    Raises a MeshError about the field `vertices` or `faces`.
    """
    vertices = _table(vertices, "vertices", "x, y, z")
    faces = _table(faces, "faces", "three indices")
    # A sum with 0 turns -0 into 0: equal positions then have equal bits.
    vertices = vertices.astype(np.float64) + 0.0
    check_vertices(vertices)
    whole = faces == np.trunc(faces)
    if not whole.all():
        face = np.flatnonzero(~whole.all(axis=1))[0]
        raise MeshError("faces", f"face {face} is not made of whole numbers; a face is three indices of vertices")
    outside = (faces < 0) | (faces >= len(vertices))
    if outside.any():
        face, corner = np.argwhere(outside)[0]
        raise MeshError(
            "faces", f"face {face} names vertex {int(faces[face, corner])}; the vertices are 0 to {len(vertices) - 1}"
        )
    return with_area(TriangleMesh(vertices, faces), "faces")


def _table(values: Any, field: Field, entry: str) -> np.ndarray:
    """A copy of the values as a table of numbers with three columns and at least one row."""
    try:
        table = np.array(values)
    except ValueError:  # rows of different lengths
        table = np.empty(0, object)
    if table.dtype.kind not in "iuf" or table.ndim != 2 or table.shape[1] != 3:
        raise MeshError(field, f"must be a list of rows of three numbers ({entry})")
    if not len(table):
        raise MeshError(field, f"is empty; give at least {'one triangle' if field == 'faces' else 'three vertices'}")
    return table


def with_area(mesh: TriangleMesh, field: Field) -> TriangleMesh:
    """The mesh without its triangles that have no area. Raises a MeshError about `field` if none is left."""
    flat = without_area(mesh.vertices, mesh.faces)
    count = int(flat.sum())
    if not count:
        return mesh
    if count == len(flat):
        raise MeshError(field, "no triangle has an area; give at least one whose corners do not lie on one line")
    note = "1 triangle without area was dropped" if count == 1 else f"{count:,} triangles without area were dropped"
    return replace(mesh.kept(~flat), notes=(*mesh.notes, note))
