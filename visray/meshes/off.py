"""Reads OFF files."""

import re
from pathlib import Path

import numpy as np

from visray.meshes.assembly import FileMesh
from visray.meshes.text import Text
from visray.meshes.triangle_mesh import MeshError


def read_off(raw: bytes, path: Path) -> FileMesh:
    """The mesh of an OFF file: polygons of vertices, with normals (NOFF) and texture coordinates (STOFF) where it has
    them. Colours are not used."""
    # Some files lack the space between the keyword and the first number.
    head = re.match(rb"\s*(ST)?(C)?(N)?OFF(?=[\s\d#])", raw)
    if head is None:
        wanted = "OFF, COFF, NOFF or STOFF"
        raise MeshError("file", f"is no OFF file that visray reads: its first word must be {wanted}")
    if re.match(rb"[^\S\n]+BINARY", raw[head.end() :]):
        raise MeshError("file", "is a binary OFF file; save it as text")
    text = Text.of(raw[: head.start()] + b" " * (head.end() - head.start()) + raw[head.end() :])
    if len(text.first) < 2 or text.first[1] < 2:
        raise MeshError("file", "has no line of counts after its first word")
    vertex_count, face_count = text.numbers(np.arange(2), np.int64)
    rows = len(text.first) - 2
    if min(vertex_count, face_count) < 0 or vertex_count + face_count > rows:
        claim = f"{vertex_count:,} vertices and {face_count:,} faces"
        raise MeshError("file", f"claims {claim}, but only {rows:,} lines follow; save it anew")
    textured, _, with_normals = head.groups()
    width = 3 + 3 * bool(with_normals) + 2 * bool(textured)
    first = text.first[1 : vertex_count + 2]
    _check_widths(text, first, width)
    values = text.numbers(np.arange(first[0], first[-1]))
    places = first[:-1] - first[0]
    mesh = FileMesh(_columns(values, places, 3), *_faces(text, text.first[vertex_count + 1 :][: face_count + 1]))
    if with_normals:
        mesh.normals, mesh.normal_of = _columns(values, places + 3, 3), mesh.corners
    if textured:
        mesh.uvs, mesh.uv_of = _columns(values, np.diff(first) + places - 2, 2), mesh.corners
    return mesh


def _faces(text: Text, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corners of all faces and the number of each: a line holds the number, the corners, and maybe a colour.

    first: the first word of each line, and the word after the last line
    """
    if len(first) < 2:
        raise MeshError("file", "has no triangles")
    sizes = text.numbers(first[:-1], np.int64)
    if sizes.min() < 0:
        raise MeshError("file", f"line {text.line(first[sizes.argmin()])} has a face of {sizes.min()} corners")
    _check_widths(text, first, sizes + 1)
    within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return text.numbers(np.repeat(first[:-1] + 1, sizes) + within, np.int64), sizes


def _check_widths(text: Text, first: np.ndarray, least: int | np.ndarray) -> None:
    """Raises a MeshError if a line has too few numbers."""
    short = np.flatnonzero(np.diff(first) < least)
    if len(short):
        count, wanted = np.diff(first)[short[0]], np.broadcast_to(least, len(first) - 1)[short[0]]
        line = text.line(first[short[0]])
        raise MeshError("file", f"line {line} has {count} numbers; it must have at least {wanted}")


def _columns(values: np.ndarray, places: np.ndarray, count: int) -> np.ndarray:
    """`count` neighbouring numbers from each place. Shapes: values (N), places (V); result (V, count)."""
    return values[places[:, None] + np.arange(count)]
