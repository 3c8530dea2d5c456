"""Reads STL files: binary ones with trimesh, texts with the checks that trimesh leaves out."""

import struct
from io import BytesIO
from pathlib import Path

import numpy as np

from visray.meshes.assembly import FileMesh
from visray.meshes.text import Text
from visray.meshes.triangle_mesh import MeshError

# Bytes of a binary file before its triangles, and of each triangle.
HEAD, TRIANGLE = 84, 50
FACET = ("facet", "outer", "vertex", "vertex", "vertex", "endloop", "endfacet")


def read_stl(raw: bytes, path: Path) -> FileMesh:
    """The mesh of an STL file. The solids of a text are its parts. Normals are not used: the corners give them."""
    count = struct.unpack_from("<I", raw, HEAD - 4)[0] if len(raw) >= HEAD else 0
    if len(raw) >= HEAD and len(raw) == HEAD + TRIANGLE * count:
        # Imported here, because only this needs it, and it takes a tenth of a second.
        from trimesh.exchange.stl import load_stl_binary

        points = load_stl_binary(BytesIO(raw)).get("vertices", np.empty((0, 3)))
        return FileMesh(points, np.arange(len(points)), np.full(len(points) // 3, 3))
    if raw[:512].lstrip()[:5].lower() == b"solid" and b"\0" not in raw:
        return _text(raw, path.stem)
    if len(raw) >= HEAD:
        room = (len(raw) - HEAD) / TRIANGLE
        claim = f"it claims {count:,} triangles, and has bytes for {room:,.1f}"
        raise MeshError("file", f"is damaged or no STL file: {claim}")
    raise MeshError("file", "is no STL file: it has neither a binary header nor the word solid")


def _text(raw: bytes, name: str) -> FileMesh:
    """The mesh of a text.

    name: the part of solids without a name
    """
    text = Text.of(raw if raw.lstrip().startswith(b"solid") else raw.lower())
    lines = text.lines_by_keyword({*FACET, "solid", "endsolid"}, "STL")
    _check_facets(text, lines)
    vertices = lines.get("vertex", np.empty(0, int))
    words = np.diff(text.first)[vertices] - 1
    if (words != 3).any():
        line = text.line(text.first[vertices[(words != 3).argmax()]])
        raise MeshError("file", f"line {line} has {words[(words != 3).argmax()]} numbers after vertex, not 3")
    points = text.numbers(text.after_keyword(vertices)).reshape(-1, 3)
    number_of: dict[str, int] = {}
    numbers = []
    for line in lines["solid"]:
        word = text.first[line] + 1
        solid = text.rest(word) if word < text.first[line + 1] else name
        numbers.append(number_of.setdefault(solid, len(number_of)))
    part_of = np.array(numbers)[np.searchsorted(lines["solid"], vertices[::3]) - 1]
    used, part_of = np.unique(part_of, return_inverse=True)
    parts = [list(number_of)[i] for i in used]
    return FileMesh(points, np.arange(len(points)), np.full(len(points) // 3, 3), parts=parts, part_of=part_of)


def _check_facets(text: Text, lines: dict[str, np.ndarray]) -> None:
    """Raises a MeshError if a line does not stand where it must in a text of complete facets, or the end is missing."""
    order = np.full(len(text.first) - 1, -1)
    for i, word in enumerate(dict.fromkeys(FACET)):
        order[lines.get(word, np.empty(0, int))] = i
    inside = np.flatnonzero(order >= 0)
    expected = np.array([list(dict.fromkeys(FACET)).index(word) for word in FACET])
    wrong = order[inside] != expected[np.arange(len(inside)) % len(FACET)]
    if wrong.any():
        line, word = inside[wrong.argmax()], FACET[wrong.argmax() % len(FACET)]
        found = text[text.first[line]]
        raise MeshError("file", f"line {text.line(text.first[line])} begins with {found!r} where {word!r} must be")
    if len(inside) % len(FACET) or len(lines["solid"]) != len(lines.get("endsolid", ())):
        raise MeshError("file", "ends within a facet or a solid; it is cut off")
