"""Reads glTF files (.gltf and .glb): the triangles of all meshes of the scene, placed by their nodes.

trimesh's own reader is not used: it takes sparse tables for zeros and whole numbers that stand for fractions as they
are, passes over triangle fans, reads texture coordinates only together with the textures, and takes the memory that a
file claims before it looks for its bytes.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from visray.meshes.assembly import MOST_TRIANGLES, FileMesh
from visray.meshes.gltf_accessors import GltfData, whole
from visray.meshes.gltf_nodes import PlacedPrimitive, placed_primitives
from visray.meshes.triangle_mesh import MeshError

# Largest JSON part: a list of small numbers takes several times its size in memory.
MOST_JSON = 2**27
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
# Extensions that a file may require although visray ignores them: they concern materials, textures and lights.
HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_")
KNOWN = ("KHR_mesh_quantization",)
TRIANGLES, STRIP, FAN = 4, 5, 6
MODES = {0: "points", 1: "lines", 2: "lines", 3: "lines", TRIANGLES: "", STRIP: "", FAN: ""}


def read_gltf(raw: bytes, path: Path) -> FileMesh:
    """The mesh of a glTF file. The parts are its nodes, or the meshes of nodes without a name."""
    tree, chunk = _tree(raw)
    _check_extensions(tree)
    placed, notes = [], []
    for item in placed_primitives(tree):
        mode = whole(item.primitive, "mode", TRIANGLES)
        if mode not in MODES:
            raise MeshError("file", f"is damaged: a mesh has the mode {mode}")
        if MODES[mode]:
            notes.append(f"its {MODES[mode]} are not used")
        else:
            placed.append(item)
    data = GltfData(tree, chunk, path.parent)
    if sum(_corner_count(data, item.primitive) for item in placed) > 3 * MOST_TRIANGLES:
        raise MeshError("file", f"has too many triangles; visray reads up to {MOST_TRIANGLES:,}")
    if not placed:
        raise MeshError("file", "has no triangles")
    mesh = _joined([_piece(data, item) for item in placed], [item.name for item in placed])
    if any(tree.get(key) for key in ("materials", "textures", "images")):
        notes.append("its materials and textures are not used")
    if any(tree.get(key) for key in ("skins", "animations")):
        notes.append("its skins and animations are not used: it stands as it is stored")
    mesh.notes, mesh.files = list(dict.fromkeys(notes)), data.files
    return mesh


def _tree(raw: bytes) -> tuple[dict, bytes | None]:
    """The JSON of a file, and the binary part that follows it in a GLB file."""
    text, binary = raw, None
    if raw.startswith(b"glTF"):
        chunks = _chunks(raw)
        text = chunks.get(JSON_CHUNK)
        binary = chunks.get(BINARY_CHUNK)
        if text is None:
            raise MeshError("file", "is damaged: its JSON part is missing")
    elif not raw[:64].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        raise MeshError("file", "is no glTF file: it begins neither with glTF nor with a brace")
    if len(text) > MOST_JSON:
        raise MeshError("file", f"has {len(text):,} bytes of JSON; visray reads up to {MOST_JSON:,}; save it as GLB")
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError):
        raise MeshError("file", "is damaged: its JSON cannot be read") from None
    asset = tree.get("asset") if isinstance(tree, dict) else None
    if not isinstance(asset, dict) or not str(asset.get("version", "")).startswith("2."):
        raise MeshError("file", "is no glTF file of version 2")
    return tree, binary


def _chunks(raw: bytes) -> dict[int, bytes]:
    """The parts of a GLB file: a dict from type to bytes."""
    if len(raw) < 12 or struct.unpack_from("<I", raw, 4)[0] != 2:
        raise MeshError("file", "is no GLB file of version 2")
    claimed = struct.unpack_from("<I", raw, 8)[0]
    if claimed > len(raw):
        raise MeshError("file", f"claims {claimed:,} bytes and has {len(raw):,}; it is cut off")
    chunks, place = {}, 12
    while place + 8 <= claimed:
        length, kind = struct.unpack_from("<II", raw, place)
        if place + 8 + length > claimed:
            raise MeshError("file", f"claims a part of {length:,} bytes, but {claimed - place - 8:,} follow")
        chunks.setdefault(kind, raw[place + 8 : place + 8 + length])
        place += 8 + length
    return chunks


def _check_extensions(tree: dict) -> None:
    """Raises a MeshError if the file needs an extension that visray does not read."""
    required = tree.get("extensionsRequired", [])
    for name in required if isinstance(required, list) else []:
        if not str(name).startswith(HARMLESS) and name not in KNOWN:
            raise MeshError(
                "file", f"needs the extension {str(name)[:60]}, which visray does not read; save it without"
            )


def _unread(extension: Any) -> MeshError:
    """The error for an extension that visray does not read."""
    return MeshError("file", f"uses the extension {str(extension)[:60]}, which visray does not read; save it without")


def _corner_count(data: GltfData, primitive: dict) -> int:
    """Number of corners that a primitive claims."""
    corners = data.count(primitive["indices"] if "indices" in primitive else primitive["attributes"].get("POSITION"))
    return corners if whole(primitive, "mode", TRIANGLES) == TRIANGLES else 3 * corners


def _piece(data: GltfData, item: PlacedPrimitive) -> FileMesh:
    """The triangles of a primitive in the place of its node."""
    primitive, attributes = item.primitive, item.primitive["attributes"]
    compressed = [name for name in primitive.get("extensions", {}) if "compression" in name]
    if compressed:
        raise _unread(compressed[0])
    points = data.values(attributes.get("POSITION"), "VEC3").astype(np.float64)
    if "indices" in primitive:
        corners = data.values(primitive["indices"], "SCALAR", whole_numbers=True).astype(np.int64)
        if len(corners) and corners.max() >= len(points):
            raise MeshError("file", f"names vertex {corners.max()} of a mesh that has {len(points)}, counted from 0")
    else:
        corners = np.arange(len(points))
    faces = _triangles(corners, whole(primitive, "mode", TRIANGLES))
    linear = item.matrix[:3, :3]
    # A mirrored node turns its triangles; the cofactors turn normals with them.
    mirrored = np.linalg.det(linear) < 0
    corners = (faces[:, ::-1] if mirrored else faces).reshape(-1)
    with np.errstate(over="ignore", invalid="ignore"):  # numbers that are not finite are refused later
        points = points @ linear.T + item.matrix[:3, 3]
        piece = FileMesh(points, corners, np.full(len(faces), 3))
        if (normals := _attribute(data, attributes, "NORMAL", "VEC3", len(points))) is not None:
            rows = np.stack([np.cross(linear[i - 2], linear[i - 1]) for i in range(3)])
            piece.normals, piece.normal_of = normals @ (-rows if mirrored else rows).T, corners
    if (uvs := _attribute(data, attributes, "TEXCOORD_0", "VEC2", len(points))) is not None:
        # In glTF v grows downwards.
        piece.uvs, piece.uv_of = uvs * [1.0, -1.0] + [0.0, 1.0], corners
    return piece


def _attribute(data: GltfData, attributes: dict, name: str, kind: str, count: int) -> np.ndarray | None:
    """A table with a row for each vertex, or None if the file has none."""
    if name not in attributes:
        return None
    values = data.values(attributes[name], kind)
    if len(values) != count:
        raise MeshError("file", f"is damaged: it has {len(values):,} rows of {name} for {count:,} vertices")
    return values.astype(np.float64)


def _triangles(corners: np.ndarray, mode: int) -> np.ndarray:
    """Triangles of a list, a strip or a fan of corners. Shapes: corners (C); result (F, 3)."""
    if mode == TRIANGLES:
        if len(corners) % 3:
            raise MeshError("file", f"is damaged: a mesh has {len(corners):,} corners, not three a triangle")
        return corners.reshape(-1, 3)
    place = np.arange(max(len(corners) - 2, 0))
    if mode == FAN:
        return corners[np.stack([place + 1, place + 2, 0 * place], axis=1)]
    odd = place % 2
    return corners[np.stack([place, place + 1 + odd, place + 2 - odd], axis=1)]


def _joined(pieces: list[FileMesh], names: list[str]) -> FileMesh:
    """One mesh of several; pieces of the same name are one part."""
    number_of: dict[str, int] = {}
    numbers = [number_of.setdefault(name, len(number_of)) for name in names]
    columns: dict[str, Any] = {}
    for values, index in (("vertices", "corners"), ("normals", "normal_of"), ("uvs", "uv_of")):
        if all(getattr(p, values) is None for p in pieces):
            continue
        tables = [t if (t := getattr(p, values)) is not None else np.zeros((0, 0)) for p in pieces]
        offsets = np.cumsum([0, *map(len, tables)])
        width = max(t.shape[1] for t in tables)
        columns[values] = np.concatenate([t.reshape(-1, width) for t in tables])
        columns[index] = np.concatenate(
            [
                np.full(len(p.corners), -1) if getattr(p, index) is None else getattr(p, index) + offset
                for p, offset in zip(pieces, offsets)
            ]
        )
    sizes = np.concatenate([p.sizes for p in pieces])
    return FileMesh(
        sizes=sizes, parts=list(number_of), part_of=np.repeat(numbers, [len(p.sizes) for p in pieces]), **columns
    )
