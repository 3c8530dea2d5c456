"""The arrays of mesh bodies: triangles and trees of several meshes in shared buffers, and a row for each body."""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.accel.blocks import TreeRows
from visray.accel.bvh import TreePlan, joined, planned
from visray.geometry import Frame
from visray.primitives.mesh_search import MeshBuffers, MeshRows
from visray.primitives.mesh_triangle import Corners, attached_normals
from visray.primitives.primitive import Bounds, half_extents
from visray.pytree import Shared
from visray.pytree import rows as gathered
from visray.quantities import Arrays
from visray.transforms import Transform, composed, product


@dataclass(frozen=True)
class Body:
    """A mesh at a place.

    mesh: the mesh, a primitives.Mesh.
    steps: transform that follows that of the mesh.
    """

    mesh: Any
    steps: tuple[Transform, ...] = ()


@dataclass(frozen=True)
class MeshLook:
    """Normals and texture coordinates of triangles in shared buffers.

    normal_corners, normals: numbers of the corners' unit normals, and these, in coordinates of their mesh; None for
        meshes of flat faces.
    uv_corners, u, v: numbers of the corners' texture coordinates, and these; None if no mesh has any.
    """

    normal_corners: Corners | None
    normals: Any
    uv_corners: Corners | None
    u: Any
    v: Any


@dataclass(frozen=True)
class BodyTable:
    """Several bodies, as arrays with one entry per body.

    frame: map from coordinates of the mesh to the world.
    mesh: where the mesh lies in the buffers.
    half, radius: half sides of the mesh's bounding box, and radius of a ball, both about the centre of its tree.
    volume: the volume that the mesh encloses, in its coordinates, by the divergence theorem.
    vertex_starts: for each body, the number of the first vertex of its mesh, in NumPy.
    buffers, look: the data of all meshes.
    """

    frame: Frame
    mesh: MeshRows
    half: Any
    radius: Any
    volume: Any
    vertex_starts: np.ndarray
    buffers: Shared
    look: Shared

    @property
    def vertices(self) -> Shared:
        """The buffer of vertices."""
        return Shared(self.buffers.value.vertices)

    def first_vertex(self, body: int) -> int:
        """Number of the first vertex of a body's mesh. body: its number."""
        return int(self.vertex_starts[body])

    def moved(self, index: Any, frame: Frame) -> "BodyTable":
        """The bodies with the numbers `index`, one for each of them, in other frames."""
        return replace(gathered(self, index), frame=frame, vertex_starts=self.vertex_starts[np.array(index)])

    def placed(self, outer: Frame | None) -> "PlacedBody":
        """The bodies in the world. Their frames contain their transforms, so `outer` is None."""
        axes, look, corners = (self.frame.x, self.frame.y, self.frame.z), self.look.value, self.buffers.value.corners
        if look.normals is not None:
            normals = attached_normals(corners, self.vertices, look.normal_corners, look.normals)
            look = replace(look, normals=normals)
        return PlacedBody(self.frame.inverse(), axes, self.mesh, self.buffers, Shared(look))

    def bounds(self, outer: Frame | None) -> Bounds:
        """As Primitive.bounds: the transformed box of the mesh, and the smaller of two balls."""
        frame, half = self.frame, self.half
        box = Frame(frame.x * half.x, frame.y * half.y, frame.z * half.z, frame.point(self.mesh.centre))
        extent = half_extents(box, "xyz")
        radius = dr.minimum(frame.max_stretch() * self.radius, dr.norm(extent))
        return Bounds(box.o - extent, box.o + extent, box.o, radius)


@dataclass(frozen=True)
class PlacedBody:
    """Bodies in the world.

    inverse: map from the world to coordinates of the mesh.
    axes: the map from coordinates of the mesh to the world: the vectors of its axes.
    mesh, buffers, look: as in BodyTable.
    """

    inverse: Any
    axes: tuple[Any, Any, Any]
    mesh: MeshRows
    buffers: Shared
    look: Shared


def frames(a: Arrays, bodies: list[Body]) -> Frame:
    """The maps of bodies from coordinates of their meshes to the world."""
    fits = {key: _fit(shape) for key, shape in _shapes(bodies).items()}
    outer = composed([x.mesh.transform + x.steps for x in bodies])
    fit = np.stack([fits[id(x.mesh)] for x in bodies])
    return Frame.table(a, product(outer, fit))


def body_table(a: Arrays, bodies: list[Body]) -> BodyTable:
    """The table of bodies. Each mesh is stored once.

    Meshes with vertices of their own in the scene are stored each, even if they are equal, because derivatives by their
    vertices differ.
    """
    shape_of = _shapes(bodies)
    stored = [id(shape_of[id(x.mesh)] if x.mesh.file else x.mesh) for x in bodies]
    shapes = list({key: shape_of[id(x.mesh)] for key, x in zip(stored, bodies)}.values())
    number = {key: i for i, key in enumerate(dict.fromkeys(stored))}
    mesh_of = np.array([number[key] for key in stored])
    vertices = [s.mesh.vertices - origin_of(s) for s in shapes]
    counts = np.array([len(s.mesh.faces) for s in shapes])
    firsts = np.cumsum(counts) - counts
    plans = [tree_of(shape) for shape in shapes]
    blocks, roots = joined(plans, firsts.tolist())
    buffers = MeshBuffers(a, _corners(a, [s.mesh.faces for s in shapes], vertices), a.put(a.W, _stacked(vertices)),
                          a.put(a.F32, blocks.ravel()))  # fmt: skip
    centres = np.array([plan.centre for plan in plans])
    rows = MeshRows(
        *(a.put(a.U, x[mesh_of].astype(np.uint32)) for x in (firsts, counts, roots)),
        a.put(a.W, centres[mesh_of].T),
        a.put(a.D, np.array([plan.ball for plan in plans])[mesh_of]),
        a.put(a.D, np.abs(centres).sum(axis=1)[mesh_of]),
    )
    sizes = np.array([len(v) for v in vertices])
    half = np.array([np.abs(v - c).max(axis=0) for v, c in zip(vertices, centres)])
    radius = np.array([np.linalg.norm(v - c, axis=1).max() for v, c in zip(vertices, centres)])
    volume = a.put(a.D, np.array([abs(s.topology.volume) for s in shapes])[mesh_of])
    return BodyTable(frames(a, bodies), rows, a.put(a.W, half[mesh_of].T), a.put(a.D, radius[mesh_of]), volume,
                     (np.cumsum(sizes) - sizes)[mesh_of], Shared(buffers), Shared(_look(a, shapes)))  # fmt: skip


def _shapes(bodies: list[Body]) -> dict[int, Any]:
    """The MeshShape of each mesh, by the id() of the mesh."""
    meshes = {id(x.mesh): x.mesh for x in bodies}
    return {key: mesh.shape_of_file() for key, mesh in meshes.items()}


def origin_of(shape: Any) -> np.ndarray:
    """The origin of the coordinates in which a mesh is stored, as a point of its file. Shape: (3).

    It is zero, so that coordinates stay as they are; only along axes on which the mesh is far from zero, it is a point
    near the mesh, so that rounding depends on the size of the mesh alone. All differences to this point are exact.
    """
    low, high = shape.mesh.vertices.min(axis=0), shape.mesh.vertices.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low).max()
    step = 2.0 ** np.ceil(np.log2(half))
    return np.where(np.abs(middle) > 4 * half, np.round(middle / step) * step, 0)


def _fit(shape: Any) -> np.ndarray:
    """The 3 x 4 matrix from the coordinates in which a mesh is stored to those of the object: the mesh's `fit`."""
    return np.c_[shape.scale * np.eye(3), shape.scale * origin_of(shape) + np.array(shape.shift)]


def tree_of(shape: Any) -> TreePlan:
    """The tree over the triangles of a mesh. It is built once for each MeshShape."""
    if "tree" not in shape.__dict__:
        corners = (shape.mesh.vertices - origin_of(shape))[shape.mesh.faces]
        low, high = corners.min(axis=1), corners.max(axis=1)
        shape.__dict__["tree"] = planned([TreeRows(0, low, high, corners)])
    return shape.__dict__["tree"]


def _stacked(buffers: list[np.ndarray]) -> np.ndarray:
    """Several buffers one after the other, as columns."""
    return np.concatenate(buffers).T


def _corners(a: Arrays, indices: list[np.ndarray], buffers: list[np.ndarray]) -> Corners:
    """The numbers of corners in several buffers one after the other. indices: those in each buffer."""
    starts = np.cumsum([0] + [len(b) for b in buffers])
    return Corners.of(a, np.concatenate([i.astype(np.int64) + s for i, s in zip(indices, starts)]))


def _look(a: Arrays, shapes: list) -> MeshLook:
    """Normals and texture coordinates of meshes. All of them have normals, or none."""
    normal_corners = normals = uv_corners = u = v = None
    if shapes[0].normals is not None:
        normal_corners = _corners(a, [s.normal_of for s in shapes], [s.normals for s in shapes])
        normals = a.put(a.W, _stacked([s.normals for s in shapes]))
    if any(s.mesh.uvs is not None for s in shapes):
        plain = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        uvs = [plain if s.mesh.uvs is None else s.mesh.uvs for s in shapes]
        indices = [
            np.tile(np.arange(3), (len(s.mesh.faces), 1)) if s.mesh.uvs is None else s.mesh.uv_of for s in shapes
        ]
        uv_corners = _corners(a, indices, uvs)
        u, v = (a.put(a.D, x) for x in _stacked(uvs))
    return MeshLook(normal_corners, normals, uv_corners, u, v)
