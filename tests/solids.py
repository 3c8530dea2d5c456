"""Closed meshes for tests: a cube, a tetrahedron, a ball of triangles and a ring; and points of edges and corners."""

import numpy as np

CUBE = (
    np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]),
    np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
              [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]),
)  # fmt: skip
TETRAHEDRON = (
    np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


def ball(level: int) -> tuple[np.ndarray, np.ndarray]:
    """The unit ball as an icosahedron whose triangles are cut into four, `level` times."""
    g = (1 + 5**0.5) / 2
    p = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
         (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]  # fmt: skip
    faces = np.array([[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4],
                      [11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8],
                      [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]])  # fmt: skip
    vertices = np.array(p) / np.linalg.norm(p, axis=1, keepdims=True)
    for _ in range(level):
        sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
        edges, of = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        middle = vertices[edges].sum(axis=1)
        ab, bc, ca = (len(vertices) + of.reshape(-1, 3)).T
        a, b, c = faces.T
        corners = (a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        faces = np.concatenate([np.stack(corner, axis=1) for corner in corners])
    return vertices, faces


def ring(around: int = 24, across: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """A torus about the y axis, of radii 1 and 0.4. A line can cross it four times."""
    u, v = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in (around, across)), indexing="ij")
    radius = 1 + 0.4 * np.cos(v)
    vertices = np.stack([radius * np.cos(u), 0.4 * np.sin(v), radius * np.sin(u)], axis=2).reshape(-1, 3)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    a, b = i * across + j, (i + 1) % around * across + j
    c, d = (i + 1) % around * across + (j + 1) % across, i * across + (j + 1) % across
    return vertices, np.concatenate([np.stack([a, d, c], axis=1), np.stack([a, c, b], axis=1)])


SOLIDS = {"cube": CUBE, "tetrahedron": TETRAHEDRON, "ball": ball(2), "ring": ring()}


def directions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Random unit vectors. Shape: (n, 3)."""
    d = rng.normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def aims(rng: np.random.Generator, solid: tuple[np.ndarray, np.ndarray], n: int) -> np.ndarray:
    """Points of a solid: one third corners, one third middles of edges, one third other points of edges."""
    vertices, faces = solid
    face, corner = rng.integers(len(faces), size=n), rng.integers(3, size=n)
    a, b = vertices[faces[face, corner]], vertices[faces[face, (corner + 1) % 3]]
    share = np.choose(np.arange(n) % 3, [np.zeros(n), np.full(n, 0.5), rng.random(n)])[:, None]
    return a + share * (b - a)
