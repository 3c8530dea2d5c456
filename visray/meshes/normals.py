"""Smooth normals of a mesh: means over the faces around a vertex, up to creases."""

import numpy as np

from visray.geometry import gamma
from visray.meshes.topology import edge_table, group_labels, numbered
from visray.meshes.triangle_mesh import TriangleMesh, edge_vectors


def face_normals(mesh: TriangleMesh) -> np.ndarray:
    """Unit normals of the triangles. Shape: (F, 3)."""
    return normalised(np.cross(*edge_vectors(mesh.vertices, mesh.faces)))


def normalised(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors of vectors that are not zero. Shapes: (N, 3)."""
    # The largest component is divided out first: squares of very small or large numbers would underflow or overflow.
    vectors = vectors / np.abs(vectors).max(axis=1, keepdims=True)
    return vectors / np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]


def smooth_normals(mesh: TriangleMesh, crease: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals at the corners of a mesh, and for each corner of each triangle the index of its normal.

    A normal is the mean of the normals of the faces around a vertex, each weighted with its angle there. Only faces are
    averaged that follow one another around the vertex across edges whose two faces differ by at most `crease` degrees
    (and run the edge in opposite directions). Where a mean vanishes, each corner has the normal of its face.

    Shapes: normals (N, 3), index (F, 3).
    Source: Thürmer and Wüthrich 1998 (weights).
    """
    flat = face_normals(mesh)
    corners = 3 * len(mesh.faces)
    fan, fan_of = numbered(group_labels(_soft_pairs(mesh, flat, crease), corners))
    weights = _angles(mesh).reshape(-1)
    face_of = np.arange(corners) // 3
    sums = np.stack([np.bincount(fan_of, flat[face_of, i] * weights, len(fan)) for i in range(3)], axis=1)
    # A sum that cancels leaves its rounding errors: of each term those of n additions and of its own three factors.
    sizes, total = np.bincount(fan_of, minlength=len(fan)), np.bincount(fan_of, weights, len(fan))
    vanishes = np.abs(sums).max(axis=1) <= gamma(1) * (sizes + 8) * total
    normals = normalised(np.where(vanishes[:, None], flat[fan // 3], sums))
    lost = np.flatnonzero(vanishes[fan_of])
    fan_of[lost] = len(normals) + np.arange(len(lost))
    return np.concatenate([normals, flat[lost // 3]]), fan_of.reshape(-1, 3).astype(np.uint32)


def _soft_pairs(mesh: TriangleMesh, flat: np.ndarray, crease: float) -> np.ndarray:
    """Pairs of corners at the same vertex whose faces share an edge that is no crease. Shape: (P, 2)."""
    table = edge_table(mesh.faces)
    place = table.first[table.count == 2]
    place = place[table.forward[place] != table.forward[place + 1]]
    one, other = table.half_edges[place], table.half_edges[place + 1]
    # The chord between two unit normals whose angle is the crease; a crease of exactly this angle is still smooth.
    chord = 2 * np.sin(np.radians(min(crease, 180.0)) / 2) * (1 + gamma(8))
    difference = flat[one // 3] - flat[other // 3]
    soft = np.einsum("ij,ij->i", difference, difference) <= chord**2
    one, other = one[soft], other[soft]
    # The two half-edges run in opposite directions: one starts where the other ends.
    return np.concatenate([np.stack([one, _next(other)], axis=1), np.stack([_next(one), other], axis=1)])


def _next(corner: np.ndarray) -> np.ndarray:
    """The next corner of the same triangle."""
    return np.where(corner % 3 == 2, corner - 2, corner + 1)


def _angles(mesh: TriangleMesh) -> np.ndarray:
    """Angles of the triangles at their corners, in radians. Shape: (F, 3)."""
    x, y = edge_vectors(mesh.vertices, mesh.faces)
    z = y - x
    # The sine of each angle, times the lengths of its sides, is twice the area.
    area = np.cross(x, y)
    area = np.sqrt(np.einsum("ij,ij->i", area, area))
    cosines = (np.einsum("ij,ij->i", a, b) for a, b in ((x, y), (-x, z), (z, y)))
    return np.stack([np.arctan2(area, cosine) for cosine in cosines], axis=1)
