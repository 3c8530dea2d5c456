"""The nodes of a glTF file: where its meshes stand."""

from typing import NamedTuple

import numpy as np

from visray.meshes.gltf_accessors import entry
from visray.meshes.triangle_mesh import MeshError

# Largest number of primitives. A small file can name a mesh of many primitives in many nodes.
MOST_PRIMITIVES = 2**20


class PlacedPrimitive(NamedTuple):
    """A primitive of the file (a piece of a mesh), with the matrix and the name of its node."""

    primitive: dict
    matrix: np.ndarray
    name: str


def _listed(record: dict, key: str) -> list:
    """A list of the file; empty if it is missing."""
    value = record.get(key, [])
    if not isinstance(value, list):
        raise MeshError("file", f"is damaged: its {key} are not a list")
    return value


def placed_primitives(tree: dict) -> list[PlacedPrimitive]:
    """The primitives of all nodes of the scene, or of all nodes if there is no scene."""
    nodes = _listed(tree, "nodes")
    if _listed(tree, "scenes"):
        roots = _listed(entry(tree, "scenes", tree.get("scene", 0)), "nodes")
    else:
        inner = {i for node in nodes if isinstance(node, dict) for i in _listed(node, "children") if type(i) is int}
        roots = [i for i in range(len(nodes)) if i not in inner]
    result, seen = [], set()
    stack = [(root, np.eye(4)) for root in reversed(roots)]
    while stack:
        index, outer = stack.pop()
        node = entry(tree, "nodes", index)
        if index in seen:
            raise MeshError("file", f"is damaged: its nodes[{index}] stands in several places")
        seen.add(index)
        matrix = outer @ _matrix(node)
        if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
            raise MeshError("file", "uses the extension EXT_mesh_gpu_instancing, which visray does not read")
        if "mesh" in node:
            mesh = entry(tree, "meshes", node["mesh"])
            name = str(node.get("name") or mesh.get("name") or f"mesh {node['mesh']}")
            result += [PlacedPrimitive(primitive, matrix, name) for primitive in _primitives(mesh)]
            if len(result) > MOST_PRIMITIVES:
                raise MeshError("file", f"has too many pieces; visray reads up to {MOST_PRIMITIVES:,} primitives")
        stack += [(child, matrix) for child in reversed(_listed(node, "children"))]
    return result


def _primitives(mesh: dict) -> list[dict]:
    """The primitives of a mesh."""
    primitives = _listed(mesh, "primitives")
    if not all(isinstance(p, dict) and isinstance(p.get("attributes"), dict) for p in primitives):
        raise MeshError("file", "is damaged: a mesh has a primitive without attributes")
    return primitives


def _matrix(node: dict) -> np.ndarray:
    """The matrix of a node: given, or from translation, rotation (a quaternion) and scale. Shape: (4, 4)."""
    if "matrix" in node:
        return _numbers(node, "matrix", np.eye(4).reshape(-1)).reshape(4, 4).T
    x, y, z, w = _numbers(node, "rotation", np.array([0.0, 0, 0, 1]))
    length = np.sqrt(x * x + y * y + z * z + w * w)
    if not length:
        raise MeshError("file", "is damaged: the rotation of a node is (0, 0, 0, 0)")
    x, y, z, w = np.array([x, y, z, w]) / length
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix = np.eye(4)
    matrix[:3, :3] = np.array(rotation) * _numbers(node, "scale", np.ones(3))
    matrix[:3, 3] = _numbers(node, "translation", np.zeros(3))
    return matrix


def _numbers(node: dict, key: str, default: np.ndarray) -> np.ndarray:
    """A list of numbers of a node, as long as `default`."""
    value = node.get(key, default.tolist())
    good = isinstance(value, list) and len(value) == len(default) and all(type(x) in (int, float) for x in value)
    if not good or not np.abs(np.array(value, float)).max() < np.inf:
        raise MeshError("file", f"is damaged: the {key} of a node is not {len(default)} numbers")
    return np.array(value, float)
