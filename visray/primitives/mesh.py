"""The mesh: a surface of triangles, from a file or from arrays."""

import os
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal

import drjit as dr
import numpy as np
from pydantic import ConfigDict, Field

from visray.geometry import Frame, Similarity
from visray.meshes.fit import fit_transform
from visray.meshes.normals import normalised, smooth_normals
from visray.meshes.reading import files_of_mesh, part, read
from visray.meshes.topology import Topology, oriented, topology
from visray.meshes.triangle_mesh import MeshError, TriangleMesh, from_arrays
from visray.named_files import FileRule
from visray.number_table import NumberTable, TableRule
from visray.primitives.mesh_body import MeshBody
from visray.primitives.mesh_buffers import Body
from visray.primitives.mesh_triangle import MeshTriangle, SmoothMeshTriangle
from visray.primitives.primitive import Bounds, MitsubaShapes, Primitive
from visray.quantities import FARTHEST, Point, Real
from visray.records import record_kind
from visray.transforms import Transform, compose

TABLES = {
    "vertices": TableRule(3, False, "world units"),
    "faces": TableRule(3, True, "numbers of vertices, from 0"),
}
Vertices = Annotated[NumberTable, TABLES["vertices"]]
Faces = Annotated[NumberTable, TABLES["faces"]]
Size = Annotated[Real, Field(gt=0, le=FARTHEST)]
# Coordinates are coarse if their steps are larger than this share of a mesh: a pixel of a picture 1024 pixels wide.
COARSE = 2.0**-10
# Largest number of bytes that the meshes in the cache take.
CACHE_BYTES = 2**30


@record_kind
@dataclass(frozen=True, kw_only=True)
class FitBox:
    """A box, given by two opposite corners, into which a mesh is scaled and moved."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    low: Point = field(kw_only=False)
    high: Point = field(kw_only=False)


@dataclass(frozen=True)
class MeshShape:
    """A mesh as it is rendered, before its transform.

    mesh: vertices and faces; faces of a closed mesh turn outwards
    normals: unit normals of a smooth mesh; None for a mesh of flat faces. Shape: (N, 3)
    normal_of: for each corner of each face, its row of `normals`; None without normals. Shape: (F, 3)
    topology: edges that are open or inconsistent, and whether the mesh is closed
    turned: number of faces that were turned
    scale, shift: the map p -> scale p + shift that `fit` asks for
    """

    mesh: TriangleMesh
    normals: np.ndarray | None
    normal_of: np.ndarray | None
    topology: Topology
    turned: int
    scale: float
    shift: tuple[float, float, float]

    @property
    def bytes(self) -> int:
        """Number of bytes of its arrays."""
        mesh = self.mesh
        arrays = (mesh.vertices, mesh.faces, mesh.uvs, mesh.uv_of, mesh.part_of, self.normals, self.normal_of)
        return sum(array.nbytes for array in arrays if array is not None)

    @cached_property
    def box(self) -> np.ndarray:
        """The low and the high corner of the bounding box of the vertices. Shape: (2, 3)."""
        return np.stack([self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)])

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user about what was left out, turned, or is not used, and about coarse coordinates."""
        notes = list(self.mesh.notes)
        if self.turned:
            plural, own = ("triangle was", "its") if self.turned == 1 else ("triangles were", "their")
            what = "to face outwards" if self.topology.closed else f"to agree with {own} neighbours"
            notes.append(f"{self.turned:,} {plural} turned {what}")
        largest, size = np.abs(self.box).max(), np.ptp(self.box, axis=0).max()
        step = float(np.spacing(np.float32(largest)))
        if step > COARSE * size and (self.mesh.vertices == self.mesh.vertices.astype(np.float32)).all():
            text = f"its coordinates have single precision: at {largest:.6g} they lie {step:.2g} apart"
            notes.append(f"{text}, and it is {size:.3g} wide; save it nearer to the origin")
        return tuple(notes)


# Cache of meshes. Key: the arguments of _shape. It is ordered by last use.
_cache: dict[tuple, MeshShape] = {}


@record_kind
@dataclass(frozen=True, kw_only=True)
class Mesh(Primitive):
    """A surface of triangles, from a `file` (OBJ, PLY, STL, glTF, GLB or OFF) or from the lists `vertices` and `faces`.

    `part`: the part of the file with this name; by default, all parts.
    `normals`: if "face", each triangle is flat. If "smooth", normals are averaged across edges at which the surface
    bends by at most `crease` degrees. If "file", they are those of the file.
    `fit`: the mesh is scaled and moved, before its transform. If it is a number, this is the longest side of the
    bounding box, and the box is centred at the origin. If it is a box, the mesh is as large as fits into it.
    `solid`: a closed mesh is a solid, and a mesh with open edges is a sheet ("auto"). If true, a mesh with open edges
    is refused. If false, a closed mesh is a sheet too.
    uv: texture coordinates of the file. Without them, the corners of each triangle are (0, 0), (1, 0) and (0, 1).
    """

    type: Literal["mesh"] = "mesh"
    file: Annotated[str, FileRule(files_of_mesh)] | None = field(default=None, kw_only=False)
    part: Annotated[str, Field(strict=True, min_length=1)] | None = None
    vertices: Vertices | None = None
    faces: Faces | None = None
    normals: Literal["face", "smooth", "file"] = "smooth"
    crease: Annotated[Real, Field(ge=0, le=180)] = 40.0
    fit: Size | FitBox | None = None
    solid: Literal["auto", True, False] = "auto"

    many_rows = True

    def __post_init__(self) -> None:
        # Arrays become tables at once, because a mesh can be used before it is checked. The check reports wrong values.
        for name, rule in TABLES.items():
            with suppress(ValueError):
                if (given := getattr(self, name)) is not None:
                    object.__setattr__(self, name, rule.table(given))

    @property
    def kind(self) -> Any:
        return MeshTriangle if self.normals == "face" else SmoothMeshTriangle

    @property
    def body_kind(self) -> Any:
        """The class whose methods serve the mesh if it is one row (mesh_body.py)."""
        return MeshBody.kind_of(self.closed, self.normals != "face")

    @property
    def operand_kind(self) -> Any:
        return self.body_kind

    @property
    def closed(self) -> bool:
        """Whether the object is a solid."""
        return self.solid is not False and self.shape_of_file().topology.closed

    def advice_for_solid(self) -> str:
        edges = gaps(self.shape_of_file())
        return f"close it: it has {edges}" if edges else 'leave "solid" out'

    @property
    def textured(self) -> bool:
        """Whether the mesh has texture coordinates."""
        return self.shape_of_file().mesh.uvs is not None

    def shape_of_file(self) -> MeshShape:
        """The mesh as it is rendered, before its transform. Raises MeshError if the file or the lists are wrong."""
        stamp = None
        if self.file is not None and os.path.exists(self.file):
            status = os.stat(self.file)
            stamp = os.path.abspath(self.file), status.st_mtime_ns, status.st_size
        fit = (self.fit.low, self.fit.high) if isinstance(self.fit, FitBox) else self.fit
        crease = self.crease if self.normals == "smooth" else None
        key = self.file, stamp, self.part, self.vertices, self.faces, self.normals, crease, fit
        if (known := _cache.pop(key, None)) is not None:
            _cache[key] = known
            return known
        _cache[key] = shape = _shape(*key)
        while len(_cache) > 1 and sum(other.bytes for other in _cache.values()) > CACHE_BYTES:
            del _cache[next(iter(_cache))]
        return shape

    def flaws_of_values(self) -> list[tuple[str, str]]:
        """What is wrong with the lists `vertices` and `faces`, where Python makes the mesh: a field and a text."""
        tables = self.vertices, self.faces
        if self.file is not None or not all(isinstance(table, NumberTable) for table in tables):
            return []
        try:
            from_arrays(*(table.values for table in tables))
        except MeshError as error:
            return [(error.field, str(error))]
        return []

    def flaws(self) -> list[tuple[str, str]]:
        lists = {"vertices": self.vertices, "faces": self.faces}
        missing = [name for name, table in lists.items() if table is None]
        if self.file is not None and len(missing) < 2:
            return [("file", "is given beside vertices or faces; keep one")]
        if self.file is None and missing:
            both = "is missing; give a file, or vertices and faces"
            return [("file", both) if len(missing) == 2 else (missing[0], "is missing; give vertices and faces")]
        if self.part is not None and self.file is None:
            return [("part", "only a file has parts; leave it out")]
        if isinstance(self.fit, FitBox) and not all(l < h for l, h in zip(self.fit.low, self.fit.high)):
            return [("fit", "each coordinate of low must be less than that of high")]
        try:
            shape = self.shape_of_file()
        except MeshError as error:
            return [(error.field, str(error))]
        if self.solid is True and not shape.topology.closed:
            return [("solid", f"the mesh is not closed: {gaps(shape)}; mend it, or leave solid out")]
        return []

    def carrier(self) -> Similarity:
        # Vertices keep their places in the file while `fit` changes.
        shape = self.shape_of_file()
        return Similarity(shape.scale, dr.scalar.Array3f64(*shape.shift))

    def bounds(self, outer: Frame | None) -> Bounds:
        # This is only for bounding_box, outside of kernels; kernels use MeshRows.bounds.
        p = self._world_vertices()
        low, high = p.min(axis=0), p.max(axis=0)
        centre = 0.5 * (low + high)
        return Bounds(low, high, centre, float(np.linalg.norm(p - centre, axis=1).max()))

    def body(self, steps: tuple[Transform, ...]) -> Body:
        """The mesh at a place, as one row. steps: transform that follows that of the mesh."""
        return Body(self, steps)

    def row_count(self) -> int:
        return len(self.shape_of_file().mesh.faces)

    def mitsuba(self) -> MitsubaShapes | str:
        shape, matrix, p = self.shape_of_file(), compose(self.transform), self._world_vertices()
        of_corners = [shape.mesh.faces, shape.normal_of, shape.mesh.uv_of]
        of_corners = [np.zeros_like(shape.mesh.faces) if x is None else x for x in of_corners]
        # In Mitsuba a vertex has one normal and one pair of texture coordinates.
        of_vertices, faces = np.unique(np.stack(of_corners, -1).reshape(-1, 3), axis=0, return_inverse=True)
        of_vertex, of_normal, of_uv = of_vertices.T
        mesh = {"type": "mesh", "vertices": p[of_vertex], "faces": faces.reshape(-1, 3)}
        if shape.normals is not None:
            n = shape.normals if matrix is None else normalised(shape.normals @ np.linalg.inv(matrix[:, :3]))
            mesh["normals"] = n[of_normal]
        if shape.mesh.uvs is not None:
            mesh["uv"] = shape.mesh.uvs[of_uv]
        return MitsubaShapes([mesh])

    def _world_vertices(self) -> np.ndarray:
        """The vertices in the world. Shape: (N, 3)."""
        shape = self.shape_of_file()
        p = shape.mesh.vertices * shape.scale + shape.shift
        matrix = compose(self.transform)
        return p if matrix is None else p @ matrix[:, :3].T + matrix[:, 3]


def gaps(shape: MeshShape) -> str:
    """Why a mesh is not closed, in a few words: "" if it is closed. Positions are those of the file."""
    edges = shape.topology
    counts = {
        "open edges": len(edges.open_edges),
        "edges that two triangles run in the same direction": edges.inconsistent,
        "edges of three or more triangles": edges.nonmanifold,
    }
    text = ", ".join(f"{count:,} {words}" for words, count in counts.items() if count)
    if not len(edges.open_edges):
        return text
    first, second = (f"({x:.6g}, {y:.6g}, {z:.6g})" for x, y, z in shape.mesh.vertices[edges.open_edges[0]])
    holes = "1 hole" if edges.open_loops == 1 else f"{edges.open_loops:,} holes"
    return f"{text} around {holes}, the first from {first} to {second}"


def _shape(
    file: str | None, stamp: tuple | None, name: str | None, vertices: NumberTable | None, faces: NumberTable | None,
    normals: str, crease: float | None, fit: Any,
) -> MeshShape:  # fmt: skip
    """As Mesh.shape_of_file. stamp: path, modification time and size of the file; if it changes, it is read anew."""
    mesh = from_arrays(vertices.values, faces.values) if file is None else read(file)
    scale, shift = (1.0, (0.0, 0.0, 0.0)) if fit is None else fit_transform(mesh, fit)
    if name is not None:
        mesh = part(mesh, name)
    edges, turned = topology(mesh), 0
    if edges.inconsistent or (edges.closed and edges.volume < 0):
        mesh, turned = oriented(mesh)
        edges = topology(mesh) if turned else edges
    if normals == "file":
        if mesh.normals is None:
            raise MeshError("normals", "the file has no normals; use smooth or face")
        unit_normals, normal_of = mesh.normals, mesh.normal_of
    elif normals == "smooth":
        unit_normals, normal_of = smooth_normals(mesh, crease)
    else:
        unit_normals, normal_of = None, None
    return MeshShape(mesh, unit_normals, normal_of, edges, turned, scale, tuple(map(float, shift)))
