"""The meshes of the stability study: round ones and slivers, near the origin of the world and far from it."""

from dataclasses import dataclass

import numpy as np

# How far the far meshes are from the origin of the world, in world units. All meshes have a size of about 1 to 3.
FAR = 1e6 * np.array([1.0, 0.3, -0.7])
# The tube: number of rings and of corners in each ring, and the distance between two rings that slivers join.
RINGS, CORNERS, THIN = 64, 7, 1e-6


@dataclass(frozen=True)
class NamedMesh:
    """A closed mesh with its name.

    vertices, faces: as in Mesh. Shapes: (V, 3), (F, 3)
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        """The middle of the bounding box."""
        return (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2

    @property
    def radius(self) -> float:
        """Radius of a ball about the centre that contains the mesh."""
        return float(np.linalg.norm(self.vertices - self.centre, axis=1).max())


def named_meshes() -> dict[str, NamedMesh]:
    """The meshes by name."""
    shapes = {"ball": _ball(3), "slivers": _tube()}
    near = [NamedMesh(name, v, f) for name, (v, f) in shapes.items()]
    far = [NamedMesh(f"{m.name} far away", m.vertices + FAR, m.faces) for m in near]
    return {m.name: m for m in (*near, *far)}


def _ball(levels: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of an octahedron whose faces are cut in four, `levels` times, with vertices on the unit
    sphere."""
    vertices = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float)
    faces = np.array([(i, k, j) if (i + j + k) % 2 else (i, j, k) for i in (0, 1) for j in (2, 3) for k in (4, 5)])
    for _ in range(levels):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, edge_of = np.unique(edges, axis=0, return_inverse=True)
        middle = vertices[edges].sum(axis=1)
        x, y, z = len(vertices) + edge_of.reshape(-1, 3).T
        a, b, c = faces.T
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        faces = np.concatenate([np.c_[a, x, z], np.c_[x, b, y], np.c_[z, y, c], np.c_[x, y, z]])
    return vertices, faces


def _tube() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a closed tube along a curve. Every second pair of rings is so close that the triangles
    between them are slivers."""
    steps = np.where(np.arange(RINGS) % 2, THIN, 1.0)
    s = 2 * np.pi * np.cumsum(steps) / steps.sum()
    turn = 2 * np.pi * np.arange(CORNERS) / CORNERS
    out = np.stack([np.cos(s), np.sin(s), 0 * s], axis=1)[:, None]
    up = np.array([0.0, 0, 1])
    wave = 0.3 * np.sin(3 * s)[:, None, None] * up
    p = out + wave + 0.35 * (np.cos(turn)[:, None] * out + np.sin(turn)[:, None] * up)
    ring, corner = np.divmod(np.arange(RINGS * CORNERS), CORNERS)
    place = lambda i, k: (ring + i) % RINGS * CORNERS + (corner + k) % CORNERS  # noqa: E731 - one line for each use
    a, b, c, d = place(0, 0), place(1, 0), place(1, 1), place(0, 1)
    return p.reshape(-1, 3), np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
