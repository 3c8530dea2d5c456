"""Smooth normals of a mesh: means over the faces around a vertex, up to creases."""

import numpy as np

from visray.meshes.topology import edge_table, group_labels
from visray.meshes.triangle_mesh import TriangleMesh, edge_vectors


def face_normals(mesh: TriangleMesh) -> np.ndarray:
    """Unit normals of the triangles. Shape: (F, 3)."""
    normals = np.cross(*edge_vectors(mesh.vertices, mesh.faces))
    # The largest component is divided out first: squares of very small or large numbers would underflow or overflow.
    normals /= np.abs(normals).max(axis=1, keepdims=True)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def smooth_normals(mesh: TriangleMesh, crease: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals at the corners of a mesh, and for each corner of each triangle the index of its normal.

    A normal is the mean of the normals of the faces around a vertex, each weighted with its angle there. Only faces are
    averaged that follow one another around the vertex across edges whose two faces differ by at most `crease` degrees
    (and agree in direction). Where a mean vanishes, each corner has the normal of its face.

    Shapes: normals (N, 3), index (F, 3).
    Source: Thürmer and Wüthrich 1998 (weights).
    """
    flat = face_normals(mesh)
    corners = 3 * len(mesh.faces)
    fan, fan_of = np.unique(group_labels(_soft_pairs(mesh, flat, crease), corners), return_inverse=True)
    weighted = flat[np.arange(corners) // 3] * _angles(mesh).reshape(-1, 1)
    sums = np.stack([np.bincount(fan_of, weighted[:, i], len(fan)) for i in range(3)], axis=1)
    largest = np.abs(sums).max(axis=1, keepdims=True)
    # A sum of unit vectors times angles that cancels leaves only rounding errors.
    total = np.bincount(fan_of, np.abs(weighted).max(axis=1), len(fan))
    sizes = np.bincount(fan_of, minlength=len(fan))
    vanishes = largest[:, 0] <= 4 * np.finfo(float).eps * sizes * total
    sums = np.where(vanishes[:, None], flat[fan // 3], sums)
    sums /= np.abs(sums).max(axis=1, keepdims=True)
    normals = sums / np.linalg.norm(sums, axis=1, keepdims=True)
    lost = np.flatnonzero(vanishes[fan_of])
    fan_of[lost] = len(normals) + np.arange(len(lost))
    return np.concatenate([normals, flat[lost // 3]]), fan_of.reshape(-1, 3).astype(np.uint32)


def _soft_pairs(mesh: TriangleMesh, flat: np.ndarray, crease: float) -> np.ndarray:
    """Pairs of corners at the same vertex whose faces share an edge that is no crease. Shape: (P, 2)."""
    table = edge_table(mesh.faces)
    place = table.first[table.count == 2]
    place = place[table.forward[place] != table.forward[place + 1]]
    one, other = table.half_edges[place], table.half_edges[place + 1]
    a, b = flat[one // 3], flat[other // 3]
    # An angle from its tangent has all digits; near 0 and 180 degrees the cosine has only half of them.
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
    soft = angle <= np.radians(crease)
    one, other = one[soft], other[soft]
    # The two half-edges run in opposite directions: one starts where the other ends.
    return np.concatenate([np.stack([one, _next(other)], axis=1), np.stack([_next(one), other], axis=1)])


def _next(corner: np.ndarray) -> np.ndarray:
    """The next corner of the same triangle."""
    return np.where(corner % 3 == 2, corner - 2, corner + 1)


def _angles(mesh: TriangleMesh) -> np.ndarray:
    """Angles of the triangles at their corners, in radians. Shape: (F, 3)."""
    angles = np.empty(mesh.faces.shape)
    for i in range(3):
        x, y = edge_vectors(mesh.vertices, np.roll(mesh.faces, -i, axis=1))
        angles[:, i] = np.arctan2(np.linalg.norm(np.cross(x, y), axis=1), (x * y).sum(axis=1))
    return angles
