"""Reads PLY files, text and binary, with triangles and polygons mixed.

trimesh's own reader is not used: it reads no binary file of triangles and quads mixed, and takes a text that ends too
early, or lines that lack a number, without a word.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from visray.meshes.assembly import FileMesh
from visray.meshes.text import Text
from visray.meshes.triangle_mesh import MeshError

TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
TYPES |= {"double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
TYPES |= {"float32": "f4", "float64": "f8"}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
# Longest header that is searched for its end.
LONGEST_HEADER = 2**16


class Property(NamedTuple):
    """A column of an element. length: type of the number of entries if it is a list, else None."""

    name: str
    type: str
    length: str | None


class Lists(NamedTuple):
    """A column of lists: all entries one after the other, and the number of entries of each list."""

    values: np.ndarray
    sizes: np.ndarray


@dataclass(eq=False)
class Element:
    """A table of the file: its name, number of rows, and columns."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


def read_ply(raw: bytes, path: Path) -> FileMesh:
    """The mesh of a PLY file."""
    order, elements, start, notes = _header(raw)
    if order:
        tables = _binary_tables(raw, start, order, elements)
    else:
        tables = _text_tables(Text.of(b"\n" * raw[:start].count(b"\n") + raw[start:]), elements)
    vertex, face = tables.get("vertex", {}), tables.get("face", {})
    if "tristrips" in tables and not face:
        raise MeshError("file", "holds its triangles as strips; save it with faces")
    lists = next((face[key] for key in ("vertex_indices", "vertex_index") if isinstance(face.get(key), Lists)), None)
    if lists is None or not len(lists.sizes):
        raise MeshError("file", "has no triangles (it has no faces)")
    if not {"x", "y", "z"} <= set(vertex):
        raise MeshError("file", "has no vertices with x, y and z")
    corners = lists.values.astype(np.int64)
    mesh = FileMesh(np.stack([vertex[axis] for axis in "xyz"], axis=1), corners, lists.sizes, notes=notes)
    if {"nx", "ny", "nz"} <= set(vertex):
        mesh.normals, mesh.normal_of = np.stack([vertex[axis] for axis in ("nx", "ny", "nz")], axis=1), corners
    texcoord = face.get("texcoord")
    if isinstance(texcoord, Lists) and (texcoord.sizes == 2 * lists.sizes).all():
        mesh.uvs, mesh.uv_of = texcoord.values.reshape(-1, 2), np.arange(len(corners))
    elif names := next((names for names in UV_NAMES if set(names) <= set(vertex)), None):
        mesh.uvs, mesh.uv_of = np.stack([vertex[axis] for axis in names], axis=1), corners
    return mesh


def _header(raw: bytes) -> tuple[str, list[Element], int, list[str]]:
    """Byte order (empty for text), elements, place of the first byte after the header, and notes."""
    end = raw.find(b"end_header", 0, LONGEST_HEADER)
    stop = raw.find(b"\n", end) + 1
    if not raw.startswith(b"ply") or end < 0 or not stop:
        raise MeshError("file", "is no PLY file: its header is missing or has no end")
    order, elements, notes = None, [], []
    for number, line in enumerate(raw[:end].decode("latin-1").splitlines()[1:], 2):
        match line.split():
            case ["format", kind, _] if kind in ORDERS:
                order = ORDERS[kind]
            case ["element", name, count] if count.isdecimal():
                elements.append(Element(name, int(count)))
            case ["property", "list", length, kind, name] if elements and {length, kind} <= set(TYPES):
                elements[-1].properties.append(Property(name, TYPES[kind], TYPES[length]))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append(Property(name, TYPES[kind], None))
            case ["comment", "TextureFile", *_]:
                notes.append("its materials and textures are not used")
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MeshError("file", f"line {number} of its header cannot be read: {line.strip()[:40]!r}")
    if order is None:
        raise MeshError("file", "is no PLY file: its header states no format")
    return order, [e for e in elements if e.properties], stop, notes


def _needed(elements: list[Element]) -> list[Element]:
    """The elements up to the last one that is needed."""
    last = max((i for i, e in enumerate(elements) if e.name in ("vertex", "face", "tristrips")), default=-1)
    return elements[: last + 1]


def _text_tables(text: Text, elements: list[Element]) -> dict[str, dict]:
    """The columns of the elements of a text file; each row is a line."""
    tables, row = {}, 0
    widths = np.diff(text.first)
    for element in _needed(elements):
        if row + element.count > len(widths):
            raise _truncated(element, f"{max(len(widths) - row, 0):,} lines")
        rows = slice(row, row + element.count)
        begin = text.first[row]
        values = text.numbers(np.arange(begin, text.first[row + element.count]))
        place, width = text.first[rows] - begin, np.zeros(element.count, np.int64)
        table = tables[element.name] = {}
        # Beyond the last number stands one more, so that lines that are too short can be told afterwards.
        padded, last = np.append(values, 0.0), len(values)
        for column in element.properties:
            here = np.minimum(place + width, last)
            if column.length is None:
                table[column.name] = padded[here]
                width += 1
                continue
            sizes = padded[here].astype(np.int64)
            wrong = (sizes != padded[here]) | (sizes < 0) | (sizes > widths[rows])
            if wrong.any():
                raise _wrong_line(text, row + np.flatnonzero(wrong)[0])
            within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
            entries = padded[np.minimum(np.repeat(place + width + 1, sizes) + within, last)]
            table[column.name] = Lists(entries, sizes)
            width += 1 + sizes
        if (width != widths[rows]).any():
            raise _wrong_line(text, row + np.flatnonzero(width != widths[rows])[0])
        row += element.count
    return tables


def _wrong_line(text: Text, row: int) -> MeshError:
    """The error for a line that has too few or too many numbers."""
    line, count = text.line(text.first[row]), text.first[row + 1] - text.first[row]
    return MeshError("file", f"line {line} has {count} numbers, which is not what its header says")


def _truncated(element: Element, left: str) -> MeshError:
    """The error for a file that ends too early."""
    return MeshError("file", f"claims {element.count:,} rows of {element.name!r}, but only {left} follow; save it anew")


def _binary_tables(raw: bytes, start: int, order: str, elements: list[Element]) -> dict[str, dict]:
    """The columns of the elements of a binary file."""
    tables = {}
    for element in _needed(elements):
        least = sum(np.dtype(p.length or p.type).itemsize for p in element.properties)
        if element.count * least > len(raw) - start:
            raise _truncated(element, f"{len(raw) - start:,} bytes")
        read = _equal_rows(raw, start, order, element) or _ragged_rows(raw, start, order, element)
        tables[element.name], start = read
    return tables


def _equal_rows(raw: bytes, start: int, order: str, element: Element) -> tuple[dict, int] | None:
    """The columns of an element whose lists are all as long as in its first row, and the place after them; None if the
    rows differ."""
    layout, place = [], start
    for i, column in enumerate(element.properties):
        entry = np.dtype(order + column.type)
        if column.length is None:
            layout.append((f"{i}", entry))
            place += entry.itemsize
            continue
        length = np.dtype(order + column.length)
        if element.count == 0 or place + length.itemsize > len(raw):
            return ({p.name: _empty(p) for p in element.properties}, start) if element.count == 0 else None
        size = int(np.frombuffer(raw, length, 1, place)[0])
        place += length.itemsize + max(size, 0) * entry.itemsize
        if size < 0 or place > len(raw):
            return None
        layout += [(f"{i} length", length), (f"{i}", entry, (size,))]
    kind = np.dtype(layout)
    end = start + element.count * kind.itemsize
    if end > len(raw):
        return None
    rows = np.frombuffer(raw, kind, element.count, start)
    columns = {}
    for i, column in enumerate(element.properties):
        if column.length is not None:
            sizes = rows[f"{i} length"]
            if (sizes != sizes[0]).any():
                return None
            columns[column.name] = Lists(rows[f"{i}"].reshape(-1), sizes.astype(np.int64))
        else:
            columns[column.name] = rows[f"{i}"]
    return columns, end


def _empty(column: Property) -> np.ndarray | Lists:
    """A column without rows."""
    return np.empty(0) if column.length is None else Lists(np.empty(0, np.int64), np.empty(0, np.int64))


def _ragged_rows(raw: bytes, start: int, order: str, element: Element) -> tuple[dict, int]:
    """The columns of an element whose lists differ in length, and the place after them."""
    steps = [(p.length and np.dtype(p.length).itemsize, np.dtype(p.type).itemsize) for p in element.properties]
    byteorder = "little" if order == "<" else "big"
    places = [[] for _ in steps]
    sizes = [[] for _ in steps]
    place = start
    for _ in range(element.count):
        for i, (length, width) in enumerate(steps):
            size = 1
            if length:
                size = int.from_bytes(raw[place : place + length], byteorder)
                place += length
            places[i].append(place)
            sizes[i].append(size)
            place += size * width
        if place > len(raw):
            raise _truncated(element, f"{len(raw) - start:,} bytes")
    data = np.frombuffer(raw, np.uint8)
    columns = {}
    for column, (_, width), at, counts in zip(element.properties, steps, places, sizes):
        counts = np.array(counts)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        begin = np.repeat(np.array(at), counts) + within * width
        values = data[begin[:, None] + np.arange(width)].view(order + column.type)[:, 0]
        columns[column.name] = values if column.length is None else Lists(values, counts)
    return columns, place
