"""Facts about the meshes of a scene: what `visray explain` lists, and what is said once for each mesh."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from visray.primitives.mesh import Mesh, MeshShape, gaps
from visray.scene.scene import Scene
from visray.transforms import compose
from visray.warn import warn

# Rounding errors of double and of single precision, relative to a number.
DOUBLE, SINGLE = 2.0**-53, 2.0**-24


class MeshWarning(UserWarning):
    """Warning about a part of a mesh that was left out, changed or is not used, or about points with few digits."""


@dataclass(frozen=True)
class MeshFacts:
    """Facts about one mesh.

    address: address of the object or geometry in the scene.
    triangles, vertices: their numbers.
    parts: names of its parts in the file.
    closed: whether it is closed.
    edges: why it is not closed, in a few words; "" if it is closed.
    bytes: number of bytes of its vertices, triangles, normals and texture coordinates.
    notes: sentences about what was left out, turned, or is not used, and about few digits.
    """

    address: str
    triangles: int
    vertices: int
    parts: tuple[str, ...]
    closed: bool
    edges: str
    bytes: int
    notes: tuple[str, ...]


def mesh_facts(scene: Scene) -> tuple[MeshFacts, ...]:
    """Facts about each mesh of a scene."""
    return tuple(_facts(address, mesh, mesh.shape_of_file()) for address, mesh in _meshes(scene))


def warn_of_meshes(scene: Scene) -> None:
    """Warns of what was left out of meshes, changed, or is not used. Each is shown once."""
    for text in mesh_notes(scene):
        warn(text, MeshWarning)


def mesh_notes(scene: Scene) -> list[str]:
    """List of sentences about the meshes of a scene. Each begins with the file or the address that it is about; several
    objects of one file have each sentence once."""
    texts = []
    for address, mesh in _meshes(scene):
        shape = mesh.shape_of_file()
        texts += [f"{mesh.file or address}: {note}" for note in shape.notes]
        texts += [f"{address}: {note}" for note in _far_away(mesh, shape)]
    return list(dict.fromkeys(texts))


def _meshes(scene: Scene) -> Iterator[tuple[str, Mesh]]:
    """Yields the address and the mesh of each geometry, object and operand that is a mesh."""
    yield from ((address, shape) for address, shape in scene.shapes() if isinstance(shape, Mesh))


def _facts(address: str, mesh: Mesh, shape: MeshShape) -> MeshFacts:
    """Facts about a mesh. shape: the mesh as it is rendered."""
    return MeshFacts(
        address,
        len(shape.mesh.faces),
        len(shape.mesh.vertices),
        shape.mesh.parts,
        shape.topology.closed,
        gaps(shape),
        shape.bytes,
        (*shape.notes, *_far_away(mesh, shape)),
    )


def _far_away(mesh: Mesh, shape: MeshShape) -> list[str]:
    """List with a sentence about a mesh that lies so far from the origin of the world that double precision gives its
    points fewer digits than single precision has, in which colours are computed; empty for other meshes."""
    matrix = compose(mesh.transform)
    corners = np.stack(np.meshgrid(*(shape.box * shape.scale + shape.shift).T), -1).reshape(-1, 3)
    p = corners if matrix is None else corners @ matrix[:, :3].T + matrix[:, 3]
    distance, size = np.abs(p).max(), np.ptp(p, axis=0).max()
    if distance * DOUBLE <= SINGLE * size:
        return []
    return [
        f"lies {distance:.3g} from the origin of the world, and is {size:.3g} wide; its points are exact to "
        f"{distance * DOUBLE:.2g}, {distance * DOUBLE / size:.2g} of its size; move the scene nearer to the origin"
    ]
