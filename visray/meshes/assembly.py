"""From what a mesh file says to a triangle mesh."""

from dataclasses import dataclass, field, replace

import numpy as np

from visray.meshes.normals import face_normals
from visray.meshes.polygons import triangulated
from visray.meshes.triangle_mesh import MeshError, TriangleMesh, check_vertices, with_area

# Largest number of triangles: a few GB of memory. A small file can name one mesh a million times.
MOST_TRIANGLES = 2**25
# Largest file that is read. A text of this size takes several times as much memory while it is read.
MOST_BYTES = 2**30


@dataclass(eq=False)
class FileMesh:
    """A mesh as its file states it.

    vertices: positions
    corners: vertices of all polygons, one polygon after the other
    sizes: number of corners of each polygon
    normals, normal_of: normals, and for each corner the index of its own (-1: none)
    uvs, uv_of: texture coordinates, and for each corner the index of its own (-1: none)
    parts, part_of: names of the parts, and for each polygon the index of its part
    notes: sentences for the user
    first: the number that the file gives its first vertex, 0 or 1
    files: other files that it is read from

    Shapes: vertices (V, 3), corners, normal_of and uv_of (C), sizes and part_of (P), normals (N, 3), uvs (T, 2).
    """

    vertices: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    normals: np.ndarray | None = None
    normal_of: np.ndarray | None = None
    uvs: np.ndarray | None = None
    uv_of: np.ndarray | None = None
    parts: list[str] = field(default_factory=list)
    part_of: np.ndarray | None = None
    notes: list[str] = field(default_factory=list)
    first: int = 0
    files: list[str] = field(default_factory=list)


def assembled(raw: FileMesh, name: str) -> TriangleMesh:
    """The triangle mesh of a file: polygons cut into triangles, vertices at equal positions merged, triangles without
    area dropped.

    name: name of its part if the file names none.
    """
    if not len(raw.sizes):
        raise MeshError("file", "has no triangles")
    if max(len(raw.corners), len(raw.vertices)) > 3 * MOST_TRIANGLES:
        raise MeshError("file", f"has too many triangles; visray reads up to {MOST_TRIANGLES:,}")
    _check_corners(raw)
    vertices = raw.vertices.astype(np.float64) + 0.0
    check_vertices(vertices, raw.first)
    triangles, polygon = triangulated(vertices, raw.corners, raw.sizes)
    vertices, merged = _merged(vertices, raw.corners)
    mesh = TriangleMesh(
        vertices,
        merged[triangles],
        parts=tuple(raw.parts) or (name,),
        part_of=np.zeros(len(triangles)) if raw.part_of is None else raw.part_of[polygon],
        notes=tuple(raw.notes),
    )
    if raw.uv_of is not None:
        mesh = replace(mesh, **_uvs(raw, triangles))
    if raw.normal_of is not None:
        mesh = replace(mesh, normals=np.zeros((0, 3)), normal_of=raw.normal_of[triangles] + 1)
    mesh = with_area(mesh, "file")
    return mesh if raw.normal_of is None else replace(mesh, **_normals(raw, mesh))


def _check_corners(raw: FileMesh) -> None:
    """Raises a MeshError if a polygon has fewer than three corners, or a corner is no vertex of the file."""
    if raw.sizes.min() < 3:
        face = int(raw.sizes.argmin())
        raise MeshError("file", f"face {face + raw.first} has {raw.sizes[face]} corners; a face has at least 3")
    if raw.corners.min() < 0 or raw.corners.max() >= len(raw.vertices):
        corner = np.flatnonzero((raw.corners < 0) | (raw.corners >= len(raw.vertices)))[0]
        face = np.searchsorted(np.cumsum(raw.sizes), corner, side="right")
        raise MeshError(
            "file",
            f"face {face + raw.first} names vertex {raw.corners[corner] + raw.first}; "
            f"the file has the vertices {raw.first} to {len(raw.vertices) - 1 + raw.first}",
        )


def _merged(vertices: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The positions that corners use, each once, in the order of the file; and for each corner the index of its own.

    Shapes: vertices (V, 3), corners (C); result (U, 3) and (C).
    """
    representative = _first_equal(vertices)[corners]
    used = np.zeros(len(vertices), bool)
    used[representative] = True
    return vertices[used], (np.cumsum(used) - 1)[representative]


def _first_equal(vertices: np.ndarray) -> np.ndarray:
    """For each position the index of the first one with the same bits. Shapes: vertices (V, 3); result (V)."""
    bits = vertices.view(np.uint64)
    # A sort by a mixture of the three numbers is several times faster than one by all of them. Equal positions then
    # stand together, unless different ones have the same mixture; these are sorted by all numbers.
    key = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15)
    key = (key ^ (key >> np.uint64(32)) ^ bits[:, 1]) * np.uint64(0xC2B2AE3D27D4EB4F)
    key = (key ^ (key >> np.uint64(32)) ^ bits[:, 2]) * np.uint64(0x165667B19E3779F9)
    order = np.argsort(key, kind="stable")
    new = (bits[order[1:]] != bits[order[:-1]]).any(axis=1)
    if (new & (key[order[1:]] == key[order[:-1]])).any():
        order = np.lexsort(bits.T)
        new = (bits[order[1:]] != bits[order[:-1]]).any(axis=1)
    group = np.concatenate(([0], np.cumsum(new)))
    first = order[np.concatenate(([0], np.flatnonzero(new) + 1))]
    result = np.empty(len(vertices), np.int64)
    result[order] = first[group]
    return result


def _uvs(raw: FileMesh, triangles: np.ndarray) -> dict:
    """Texture coordinates of the mesh; (0, 0) at corners that have none."""
    uvs, uv_of = raw.uvs.astype(np.float64), raw.uv_of[triangles]
    if not np.isfinite(uvs).all():
        return {"notes": (*raw.notes, "its texture coordinates are not used: some are not finite")}
    missing = uv_of < 0
    if missing.any():
        return {"uvs": np.concatenate([uvs, [[0.0, 0.0]]]), "uv_of": np.where(missing, len(uvs), uv_of)}
    return {"uvs": uvs, "uv_of": uv_of}


def _normals(raw: FileMesh, mesh: TriangleMesh) -> dict:
    """Unit normals of the mesh. A corner without one, or whose own has no direction, has the normal of its face.

    mesh: the mesh whose `normal_of` holds the indices of the file plus 1, and 0 for none.
    """
    normals, normal_of = raw.normals.astype(np.float64), mesh.normal_of.astype(np.int64) - 1
    largest = np.abs(normals).max(axis=1, initial=0)
    usable = (largest > 0) & np.isfinite(largest)
    # Divided by the largest component first: squares of very small or large numbers underflow or overflow.
    normals = np.where(usable[:, None], normals, 1.0) / np.where(usable, largest, 1.0)[:, None]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    missing = (normal_of < 0) | ~usable[normal_of]
    if not missing.any():
        return {"normals": normals, "normal_of": normal_of}
    faces = np.flatnonzero(missing.any(axis=1))
    own = np.zeros(len(missing), np.int64)
    own[faces] = len(normals) + np.arange(len(faces))
    normals = np.concatenate([normals, face_normals(mesh)[faces]])
    plural = "corner takes" if missing.sum() == 1 else "corners take"
    note = f"{missing.sum():,} {plural} the normal of the triangle, because the file gives none"
    return {"normals": normals, "normal_of": np.where(missing, own[:, None], normal_of), "notes": (*mesh.notes, note)}
