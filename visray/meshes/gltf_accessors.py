"""The data of glTF files: buffers, and the tables of numbers in them. Every size that a file claims is checked against
the bytes that are there, before memory is taken."""

import base64
import binascii
import os
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from visray.meshes.assembly import MOST_BYTES
from visray.meshes.triangle_mesh import MeshError

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def entry(tree: dict, key: str, index: Any) -> dict:
    """The entry of a list of the file. Raises a MeshError if there is none, or it is no dict."""
    entries = tree.get(key, [])
    if type(index) is not int or not isinstance(entries, list) or not 0 <= index < len(entries):
        raise MeshError("file", f"is damaged: it names {key}[{str(index)[:20]}], which is not there")
    if not isinstance(entries[index], dict):
        raise MeshError("file", f"is damaged: its {key}[{index}] is not an object")
    return entries[index]


def whole(record: dict, key: str, default: int | None = None) -> int:
    """A whole number of a record that is not negative. Raises a MeshError if it is anything else."""
    value = record.get(key, default)
    if type(value) is not int or value < 0:
        raise MeshError("file", f"is damaged: it has {str(value)[:20]!r} as {key}, which must be a whole number")
    return value


@dataclass(eq=False)
class GltfData:
    """The numbers of a glTF file.

    tree: its JSON
    chunk: the binary part of a GLB file, or None
    folder: its folder, in which files of buffers lie
    files: files of buffers that were read
    """

    tree: dict
    chunk: bytes | None
    folder: Path
    files: list[str] = field(default_factory=list)
    _buffers: dict[int, bytes] = field(default_factory=dict)

    def count(self, index: Any) -> int:
        """Number of rows of an accessor."""
        return whole(entry(self.tree, "accessors", index), "count")

    def values(self, index: Any, kind: str, whole_numbers: bool = False) -> np.ndarray:
        """The table of an accessor; integers that stand for 0 to 1 or -1 to 1 are divided.

        kind: the type that it must have, such as VEC3

        Shapes: (N) for SCALAR, else (N, 2), (N, 3) or (N, 4).
        """
        accessor = entry(self.tree, "accessors", index)
        name = f"accessors[{index}]"
        component = COMPONENTS.get(accessor.get("componentType"))
        if accessor.get("type") != kind or component is None or (whole_numbers and component[1] != "u"):
            wanted = f"{kind} of whole numbers" if whole_numbers else kind
            raise MeshError("file", f"is damaged: its {name} is not a table of type {wanted}")
        if "sparse" in accessor:
            raise MeshError("file", f"stores its {name} sparsely, which visray does not read; save it without")
        if "bufferView" not in accessor:
            raise MeshError("file", f"has no data for its {name}")
        view = entry(self.tree, "bufferViews", accessor["bufferView"])
        number, width = np.dtype(component), WIDTHS[kind]
        rows, stride = whole(accessor, "count"), whole(view, "byteStride", number.itemsize * width)
        offset, length = whole(accessor, "byteOffset", 0), whole(view, "byteLength")
        row = number.itemsize * width
        if stride < row or (rows and offset + (rows - 1) * stride + row > length):
            raise MeshError("file", f"claims {rows:,} rows in its {name}, for which it has not the bytes")
        buffer = self._buffer(view.get("buffer"))
        begin = whole(view, "byteOffset", 0)
        if begin + length > len(buffer):
            raise MeshError("file", f"claims {begin + length:,} bytes in a buffer of {len(buffer):,}; it is cut off")
        data = np.frombuffer(buffer, np.uint8, length, begin)
        shape, strides = (rows, width), (stride, number.itemsize)
        table = np.ndarray(shape, number, data, offset, strides) if rows else np.empty(shape, number)
        table = table[:, 0] if kind == "SCALAR" else table
        if accessor.get("normalized") is True and number.kind in "iu":
            return np.maximum(table / np.iinfo(number).max, -1.0)
        return table

    def _buffer(self, index: Any) -> bytes:
        """The bytes of a buffer."""
        record = entry(self.tree, "buffers", index)
        if index not in self._buffers:
            uri = record.get("uri")
            if uri is None and index == 0 and self.chunk is not None:
                self._buffers[index] = self.chunk
            elif isinstance(uri, str):
                self._buffers[index] = _embedded(uri) if uri.startswith("data:") else self._external(uri)
            else:
                raise MeshError("file", f"has no data for its buffers[{index}]")
        return self._buffers[index]

    def _external(self, uri: str) -> bytes:
        """The bytes of a file beside the glTF file."""
        shown, folder = repr(uri[:80]), self.folder.resolve()
        try:
            path = (folder / unquote(uri)).resolve()
            status = os.stat(path)
        except (OSError, ValueError):
            raise MeshError("file", f"names the data {shown}, which is not there; put it beside the file") from None
        if ":" in uri or not path.is_relative_to(folder):
            raise MeshError("file", f"names the data {shown}, which lies outside its folder; put it into it")
        if not stat.S_ISREG(status.st_mode) or status.st_size > MOST_BYTES:
            raise MeshError("file", f"names the data {shown}, which is no regular file of up to {MOST_BYTES:,} bytes")
        self.files.append(str(path))
        return path.read_bytes()


def _embedded(uri: str) -> bytes:
    """The bytes within a `data:` address."""
    head, _, text = uri.partition(",")
    try:
        if head.endswith(";base64"):
            return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        pass
    raise MeshError("file", "is damaged: the data within it is not in base64")
