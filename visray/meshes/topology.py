"""How the triangles of a mesh hang together: shared edges, open edges, orientation and volume."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from visray.meshes.triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class Topology:
    """What the edges of a mesh say about it.

    closed: every edge has exactly two faces, which run it in opposite directions
    open_edges: edges of exactly one face, as vertex numbers, in the direction in which the face runs them
    open_loops: number of connected groups of open edges: the holes of an ordinary mesh
    inconsistent: number of edges of two faces that run them in the same direction
    nonmanifold: number of edges of three or more faces
    volume: signed volume, positive if the faces of a closed mesh run counter-clockwise seen from outside

    Shapes: open_edges (E, 2).
    """

    closed: bool
    open_edges: np.ndarray
    open_loops: int
    inconsistent: int
    nonmanifold: int
    volume: float


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """The half-edges of a mesh, in the order of their edges. Half-edge h belongs to face h // 3 and runs from its
    corner h % 3 to the next one.

    half_edges: the half-edges; those of the same edge stand beside each other
    first: for each edge, the place of its first half-edge in `half_edges`
    count: for each edge, the number of its half-edges
    forward: for each entry of `half_edges`, whether it runs from the lower to the higher vertex number

    Shapes: half_edges and forward (3 F), first and count (E).
    """

    half_edges: np.ndarray
    first: np.ndarray
    count: np.ndarray
    forward: np.ndarray


def edge_table(faces: np.ndarray) -> EdgeTable:
    """The edges of triangles. Shapes: faces (F, 3)."""
    start = faces.reshape(-1).astype(np.uint64)
    end = np.roll(faces, -1, axis=1).reshape(-1).astype(np.uint64)
    forward = start < end
    # One key an edge, equal for both directions; vertex numbers have 32 bits.
    key = np.where(forward, start << np.uint64(32) | end, end << np.uint64(32) | start)
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.concatenate(([True], key[1:] != key[:-1])))
    return EdgeTable(order, first, np.diff(first, append=len(key)), forward[order])


def topology(mesh: TriangleMesh) -> Topology:
    """Open, inconsistent and shared edges of a mesh, and its volume."""
    table = edge_table(mesh.faces)
    pair = table.first[table.count == 2]
    inconsistent = int((table.forward[pair] == table.forward[pair + 1]).sum())
    open_edges = _ends(mesh.faces, table.half_edges[table.first[table.count == 1]])
    nonmanifold = int((table.count > 2).sum())
    return Topology(
        closed=not len(open_edges) and not inconsistent and not nonmanifold,
        open_edges=open_edges,
        open_loops=_groups(open_edges),
        inconsistent=inconsistent,
        nonmanifold=nonmanifold,
        volume=volume(mesh.vertices, mesh.faces),
    )


def _ends(faces: np.ndarray, half_edges: np.ndarray) -> np.ndarray:
    """The vertex numbers of half-edges. Shapes: half_edges (E); result (E, 2)."""
    face, corner = np.divmod(half_edges, 3)
    return np.stack([faces[face, corner], faces[face, (corner + 1) % 3]], axis=1)


def _groups(edges: np.ndarray) -> int:
    """Number of connected groups of edges. Shapes: edges (E, 2)."""
    vertices, ends = np.unique(edges, return_inverse=True)
    return len(numbered(group_labels(ends.reshape(-1, 2), len(vertices)))[0])


def numbered(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The different labels, and for each node the index of its own. A label is its own label.

    Shapes: labels (N); result (G) and (N).
    """
    own = labels == np.arange(len(labels))
    return np.flatnonzero(own), (np.cumsum(own) - 1)[labels]


def group_labels(pairs: np.ndarray, count: int) -> np.ndarray:
    """For each of `count` nodes, the smallest node that it is connected with by pairs of nodes.

    Each round hooks the larger of two labels onto the smaller one, then follows labels to their roots, so the number of
    rounds grows with the logarithm of `count`.

    Shapes: pairs (P, 2); result (count).
    """
    label = np.arange(count)
    while len(pairs):
        ends = label[pairs]
        pairs = pairs[ends[:, 0] != ends[:, 1]]
        ends = label[pairs]
        np.minimum.at(label, ends.max(axis=1), ends.min(axis=1))
        while (label[label] != label).any():
            label = label[label]
    return label


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Signed volume that triangles enclose. Shapes: vertices (V, 3), faces (F, 3)."""
    return float(_volumes(vertices, faces).sum())


def _volumes(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Signed volumes of the tetrahedra between the faces and the middle of all vertices. About the middle, a mesh far
    from the origin loses no digits. Shapes: vertices (V, 3), faces (F, 3); result (F)."""
    around = (vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2).T
    a, b, c = (around[:, faces[:, i]] for i in range(3))
    products = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2])
    return (products + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6


def oriented(mesh: TriangleMesh) -> tuple[TriangleMesh, int]:
    """The mesh with faces turned so that neighbours run their common edge in opposite directions, and the number of
    turned faces. A mesh that is consistent, with a volume that is not negative or with open edges, stays as it is.

    Of each connected piece, as few faces are turned as possible; if the piece is closed, those that make its volume
    positive. Then, if the volume of a closed mesh is negative, all faces are turned. So inner shells of a consistent
    solid stay inner shells. Pieces that have only one side (a Moebius strip) stay as they are.
    """
    turned = _misfits(mesh)
    candidate = _with_turned(mesh, turned)
    if topology(candidate).volume < 0 and topology(candidate).closed:
        turned = ~turned
    return (_with_turned(mesh, turned), int(turned.sum())) if turned.any() else (mesh, 0)


def _with_turned(mesh: TriangleMesh, turned: np.ndarray) -> TriangleMesh:
    """The mesh with some of its faces turned. Shapes: turned (F)."""
    of = {name: getattr(mesh, name) for name in ("faces", "normal_of", "uv_of")}
    return replace(
        mesh, **{name: None if v is None else np.where(turned[:, None], v[:, ::-1], v) for name, v in of.items()}
    )


def _misfits(mesh: TriangleMesh) -> np.ndarray:
    """Mask of the faces to turn in pieces that are inconsistent. Shape: (F)."""
    count, table = len(mesh.faces), edge_table(mesh.faces)
    pair = table.first[table.count == 2]
    one, other = table.half_edges[pair] // 3, table.half_edges[pair + 1] // 3
    agree = table.forward[pair] != table.forward[pair + 1]
    if agree.all():
        return np.zeros(count, bool)
    # Each face stands twice in a graph: as it is (even) and turned (odd). An edge joins those that fit together.
    left, right = 2 * one, 2 * other + ~agree
    pairs = np.concatenate([np.stack([left, right], axis=1), np.stack([left + 1, right ^ 1], axis=1)])
    label = group_labels(pairs, 2 * count).reshape(-1, 2)
    one_sided = label[:, 0] == label[:, 1]
    turned = label[:, 0] > label[:, 1]
    piece = label.min(axis=1) // 2
    total = partial(np.bincount, piece, minlength=count)
    closed = np.ones(count, bool)
    closed[piece[table.half_edges[np.repeat(table.count != 2, table.count)] // 3]] = False
    inside_out = total(np.where(turned, -1, 1) * _volumes(mesh.vertices, mesh.faces)) < 0
    flip = np.where(closed, inside_out, total(turned) > total(~turned))
    inconsistent = np.zeros(count, bool)
    inconsistent[piece[one[~agree]]] = True
    inconsistent[piece[one_sided]] = False
    return (turned ^ flip[piece]) & inconsistent[piece]
