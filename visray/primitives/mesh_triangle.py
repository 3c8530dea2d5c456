"""Triangles of meshes, as kernels see them. Each row is one triangle; its corners are vertices that rows share."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.geometry import Frame
from visray.primitives.flat import Flat
from visray.primitives.primitive import Bounds
from visray.primitives.triangle import SeenTriangle, Triangle, normal_of
from visray.pytree import Shared
from visray.quantities import Arrays
from visray.transforms import compose


@dataclass(frozen=True)
class Corners:
    """Entries of a buffer at the corners of triangles: their numbers at the corners a, b and c."""

    a: Any
    b: Any
    c: Any

    @staticmethod
    def of(a: Arrays, numbers: np.ndarray) -> "Corners":
        """The entries with these numbers. Shape: (rows, 3)."""
        return Corners(*(a.put(a.U, numbers[:, k].astype(np.uint32)) for k in range(3)))

    def read(self, buffer: Shared) -> tuple[Any, Any, Any]:
        """The entries of a buffer at the three corners."""
        kind = type(buffer.value)
        return tuple(dr.gather(kind, buffer.value, k) for k in (self.a, self.b, self.c))

    def at(self, triangle: Any) -> "Corners":
        """The numbers at the corners of one triangle for each lane. triangle: its number."""
        return Corners(*(dr.gather(type(k), k, triangle) for k in (self.a, self.b, self.c)))


@dataclass(frozen=True)
class MeshRows:
    """The triangles of several meshes of a scene, as arrays with one entry per triangle.

    corners: numbers of the corners in `vertices`
    vertices: vertices in coordinates of their mesh. Shape: (3, vertices)
    mesh_of: number of each vertex's mesh
    frames: for each mesh, the map from its coordinates to the world
    normal_corners, normals: numbers of the corners' normals, and the unit normals in coordinates of their mesh; None
        for meshes of flat faces
    mesh_of_normal: number of each normal's mesh
    uv_corners, u, v: numbers of the corners' texture coordinates, and these; None if no mesh has any
    """

    corners: Corners
    vertices: Shared
    mesh_of: Shared
    frames: Shared
    normal_corners: Corners | None
    normals: Shared | None
    mesh_of_normal: Shared | None
    uv_corners: Corners | None
    u: Shared | None
    v: Shared | None

    def world_vertices(self) -> Any:
        """The vertices in the world."""
        return _gathered(self.frames.value, self.mesh_of.value).point(self.vertices.value)

    def first_vertex(self, mesh: int) -> int:
        """Number of the first vertex of a mesh. mesh: its number."""
        return int(np.searchsorted(np.array(self.mesh_of.value), mesh))

    def placed(self, outer: Frame | None) -> "PlacedMesh":
        """The triangles in the world. Each mesh has its own transform, so `outer` is None."""
        normals = None
        if self.normals is not None:
            inverse = _gathered(self.frames.value, self.mesh_of_normal.value).inverse()
            attached = attached_normals(self.corners, self.vertices, self.normal_corners, self.normals.value)
            normals = Shared(dr.normalize(inverse.normal(attached)))
        vertices = Shared(self.world_vertices())
        a, b, c = self.corners.read(vertices)
        n = dr.detach(dr.normalize(normal_of(a, b, c)))
        unit = dr.float32_array_t(type(n))(n)
        return PlacedMesh(self.corners, vertices, unit, self.normal_corners, normals, self.uv_corners, self.u, self.v)

    def bounds(self, outer: Frame | None) -> Bounds:
        """As Primitive.bounds."""
        a, b, c = self.corners.read(Shared(self.world_vertices()))
        centre = (a + b + c) / 3
        squared = [dr.squared_norm(v - centre) for v in (a, b, c)]
        radius = dr.sqrt(dr.maximum(dr.maximum(squared[0], squared[1]), squared[2]))
        low, high = (f(f(a, b), c) for f in (dr.minimum, dr.maximum))
        return Bounds(low, high, centre, radius)


def attached_normals(corners: Corners, vertices: Shared, normal_corners: Corners, normals: Any) -> Any:
    """The buffer `normals` of smooth meshes, with derivatives by the vertices if these carry any.

    corners, normal_corners: numbers of the corners in `vertices` and in `normals`.

    A normal is the sum of the normals of the triangles around it, each times the angle of its corner
    (meshes/normals.py). Which triangles these are is fixed.
    """
    if not dr.grad_enabled(vertices.value):
        return normals
    sums = dr.zeros(type(normals), dr.width(normals))
    p = corners.read(vertices)
    n = dr.normalize(dr.cross(p[1] - p[0], p[2] - p[0]))
    for k, corner in enumerate((normal_corners.a, normal_corners.b, normal_corners.c)):
        x, y = p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]
        dr.scatter_add(sums, dr.atan2(dr.norm(dr.cross(x, y)), dr.dot(x, y)) * n, corner)
    # A mesh that is mirrored has its corners in the other order here.
    side = dr.dot(dr.detach(sums), normals)
    new = sums * dr.select(side < 0, -1, 1) / dr.select(side == 0, 1, dr.norm(sums))
    return normals + (new - dr.detach(new))


def _gathered(frames: Frame, index: Any) -> Frame:
    """The frame of each vertex. index: number of each vertex's mesh."""
    return Frame(*(dr.gather(type(x), x, index) for x in (frames.x, frames.y, frames.z, frames.o)))


@dataclass(frozen=True)
class PlacedMesh:
    """Triangles of meshes in the world.

    corners, vertices: numbers of the corners, and the vertices
    unit: unit normals of the triangles, in single and without derivatives
    normal_corners, normals: numbers of the corners' unit normals, and these; None for flat faces
    uv_corners, u, v: numbers of the corners' texture coordinates, and these; None if there are none
    """

    corners: Corners
    vertices: Shared
    unit: Any
    normal_corners: Corners | None
    normals: Shared | None
    uv_corners: Corners | None
    u: Shared | None
    v: Shared | None

    def barycentric(self, p: Any) -> tuple[Any, Any, Any]:
        """Weights of the corners a, b, c at points p of the triangles. Their sum is 1."""
        a, b, c = self.corners.read(self.vertices)
        x, y = b - a, c - a
        n = dr.cross(x, y)
        scale = dr.rcp(dr.squared_norm(n))
        wb, wc = dr.dot(dr.cross(p - a, y), n) * scale, dr.dot(dr.cross(x, p - a), n) * scale
        return 1 - wb - wc, wb, wc


class MeshTriangle(Flat):
    """A triangle of a mesh with flat faces.

    Its test is that of Triangle. A corner is one entry of the vertex buffer for all triangles that share it, so no ray
    passes between two triangles at a common edge or corner (tests/test_mesh.py).
    """

    triangular = True
    many_rows = True
    stores_normals = True
    own_frames = True

    @staticmethod
    def table(a: Arrays, objects: list) -> MeshRows:
        return _table(a, objects)

    @staticmethod
    def corners(placed: PlacedMesh) -> tuple[Any, Any, Any]:
        return placed.corners.read(placed.vertices)

    @staticmethod
    def seen(placed: PlacedMesh, o: Any) -> SeenTriangle:
        return SeenTriangle(*(v - o for v in placed.corners.read(placed.vertices)), None)

    intersect_plane = Triangle.intersect_plane

    @staticmethod
    def surface_at(placed: PlacedMesh, p: Any, part: Any = None) -> tuple[Any, Any]:
        a, b, c = placed.corners.read(placed.vertices)
        n = dr.normalize(normal_of(a, b, c))
        return dr.dot(p - a, n), n

    @staticmethod
    def unit_normal(placed: PlacedMesh) -> Any:
        return placed.unit

    @staticmethod
    def uv(placed: PlacedMesh, p: Any, part: Any = None) -> tuple[Any, Any]:
        weights = placed.barycentric(p)
        if placed.uv_corners is None:
            return weights[1], weights[2]
        return tuple(
            sum(w * x for w, x in zip(weights, placed.uv_corners.read(buffer))) for buffer in (placed.u, placed.v)
        )


class SmoothMeshTriangle(MeshTriangle):
    """A triangle of a mesh whose normals are interpolated between its corners."""

    bends_normals = True

    @staticmethod
    def shading_normal(placed: PlacedMesh, p: Any, part: Any = None) -> Any:
        weights = placed.barycentric(p)
        return dr.normalize(sum(w * n for w, n in zip(weights, placed.normal_corners.read(placed.normals))))


def _table(a: Arrays, objects: list) -> MeshRows:
    """The triangles of several meshes, mesh after mesh."""
    shapes = [x.shape_of_file() for x in objects]
    matrices = [_matrix(x, shape) for x, shape in zip(objects, shapes)]
    # A transform that mirrors turns faces inside out, unless two corners change places.
    order = [[0, 1, 2] if np.linalg.det(m[:, :3]) > 0 else [0, 2, 1] for m in matrices]

    def joined(indices: list[np.ndarray], buffers: list[np.ndarray]) -> tuple[Corners, np.ndarray]:
        """The corners and the buffer of all meshes, from those of each mesh."""
        starts = np.cumsum([0] + [len(b) for b in buffers])
        moved = [i[:, o].astype(np.int64) + s for i, o, s in zip(indices, order, starts)]
        return Corners.of(a, np.concatenate(moved)), np.concatenate(buffers)

    def mesh_of(buffers: list[np.ndarray]) -> Shared:
        numbers = np.repeat(np.arange(len(buffers), dtype=np.uint32), [len(b) for b in buffers])
        return Shared(a.put(a.U, numbers))

    vertices = [s.mesh.vertices for s in shapes]
    corners, vertex_buffer = joined([s.mesh.faces for s in shapes], vertices)
    normal_corners = normal_buffer = mesh_of_normal = None
    if shapes[0].normals is not None:
        normals = [s.normals for s in shapes]
        normal_corners, buffer = joined([s.normal_of for s in shapes], normals)
        normal_buffer, mesh_of_normal = Shared(a.put(a.W, buffer.T)), mesh_of(normals)
    uv_corners = u = v = None
    # If two corners change places, the texture coordinates of triangles without any must do so too.
    if any(s.mesh.uvs is not None for s in shapes) or any(o != [0, 1, 2] for o in order):
        standard = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        uvs = [standard if s.mesh.uvs is None else s.mesh.uvs for s in shapes]
        plain = [np.tile(np.arange(3), (len(s.mesh.faces), 1)) for s in shapes]
        uv_corners, buffer = joined([p if s.mesh.uvs is None else s.mesh.uv_of for p, s in zip(plain, shapes)], uvs)
        u, v = (Shared(a.put(a.D, buffer[:, k])) for k in range(2))
    stacked = np.stack(matrices)
    frames = Frame.table(a, stacked)
    return MeshRows(corners, Shared(a.put(a.W, vertex_buffer.T)), mesh_of(vertices), Shared(frames), normal_corners,
                    normal_buffer, mesh_of_normal, uv_corners, u, v)  # fmt: skip


def _matrix(mesh: Any, shape: Any) -> np.ndarray:
    """The 3 x 4 matrix from coordinates of the mesh's vertices to the world."""
    fit = np.c_[shape.scale * np.eye(3), np.array(shape.shift)]
    outer = compose(mesh.transform)
    if outer is None:
        return fit
    return np.c_[outer[:, :3] @ fit[:, :3], outer[:, :3] @ fit[:, 3] + outer[:, 3]]
