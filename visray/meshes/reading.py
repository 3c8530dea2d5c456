"""Reads mesh files."""

import difflib
import os
import stat
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from visray.meshes.assembly import MOST_BYTES, assembled
from visray.meshes.gltf import read_gltf
from visray.meshes.obj import read_obj
from visray.meshes.off import read_off
from visray.meshes.ply import read_ply
from visray.meshes.stl import read_stl
from visray.meshes.triangle_mesh import MeshError, TriangleMesh

READERS = {".obj": read_obj, ".ply": read_ply, ".stl": read_stl, ".off": read_off}
READERS |= {".gltf": read_gltf, ".glb": read_gltf}
# Largest number of bytes that the meshes in the cache take.
CACHE_BYTES = 2**30

# For each file that a mesh was read from, its path, modification time and size.
Stamps = tuple[tuple[str, int, int], ...]
# Cache of meshes. Key: path. Value: the files that the mesh was read from, and the mesh.
_cache: dict[str, tuple[Stamps, TriangleMesh]] = {}


def read(path: str) -> TriangleMesh:
    """The triangle mesh of a file. A file that has not changed is not read again.

    Raises a MeshError about the field `file`.
    """
    stamp = _stamp(path)
    entry = _cache.pop(stamp[0], None)
    if entry is None or entry[0][0] != stamp or any(_changed(other) for other in entry[0][1:]):
        mesh, others = _read(path, stamp[2])
        entry = (stamp, *(_stamp(other) for other in others)), mesh
    # The cache is ordered by last use; the least recently used meshes are removed first.
    _cache[stamp[0]] = entry
    while len(_cache) > 1 and sum(_size(mesh) for _, mesh in _cache.values()) > CACHE_BYTES:
        del _cache[next(iter(_cache))]
    return entry[1]


def files_of(path: str) -> tuple[str, ...]:
    """The files that a mesh is read from: its own, then those that it names, such as the data of a glTF file."""
    read(path)
    return tuple(stamp[0] for stamp in _cache[os.path.abspath(path)][0])


def files_of_mesh(path: str) -> tuple[str, ...]:
    """As files_of, and quick if the kind of file names no others. The path alone if the mesh cannot be read, as in a
    scene that was not checked yet."""
    if READERS.get(Path(path).suffix.lower()) is not read_gltf:
        return (path,)
    try:
        return files_of(path)
    except MeshError:
        return (path,)


def _changed(stamp: tuple[str, int, int]) -> bool:
    """Whether a file has changed or vanished."""
    try:
        return _stamp(stamp[0]) != stamp
    except MeshError:
        return True


def _size(mesh: TriangleMesh) -> int:
    """Number of bytes of a mesh."""
    return sum(getattr(getattr(mesh, f.name), "nbytes", 0) for f in fields(mesh))


def _stamp(path: str) -> tuple[str, int, int]:
    """Path, modification time and size of a file. Raises a MeshError if it is not a regular file."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise MeshError("file", "there is no such file; check the path") from None
    except (OSError, ValueError) as error:
        raise MeshError("file", f"cannot be read ({_reason(error)}); check the path") from None
    if stat.S_ISDIR(status.st_mode):
        raise MeshError("file", "is a folder; give a file in it")
    # A pipe must not be opened: that would wait for a writer.
    if not stat.S_ISREG(status.st_mode):
        raise MeshError("file", "is not a regular file; give a mesh file")
    return os.path.abspath(path), status.st_mtime_ns, status.st_size


def _reason(error: Exception) -> str:
    """Text of an exception on one line, or the name of its class if it has no text."""
    return " ".join((getattr(error, "strerror", None) or str(error) or type(error).__name__).split())


def _read(path: str, size: int) -> tuple[TriangleMesh, list[str]]:
    """The triangle mesh of a regular file of `size` bytes, and the other files that it was read from."""
    reader = READERS.get(Path(path).suffix.lower())
    if reader is None:
        known = ", ".join(suffix.removeprefix(".").upper() for suffix in READERS)
        raise MeshError("file", f"is not known to be a mesh by its name; visray reads {known}")
    if size > MOST_BYTES:
        raise MeshError("file", f"has {size:,} bytes; visray reads mesh files of up to {MOST_BYTES:,}")
    if not size:
        raise MeshError("file", "is empty; save the mesh anew")
    try:
        mesh = reader(Path(path).read_bytes(), Path(path))
        return assembled(mesh, Path(path).stem), mesh.files
    except MeshError as error:
        # To the user, all errors of a file are about the file.
        raise MeshError("file", str(error)) from None
    except OSError as error:
        raise MeshError("file", f"cannot be read ({_reason(error)}); check its permissions") from None
    except MemoryError:
        raise MeshError("file", "does not fit into memory; make the mesh smaller") from None
    # The readers check what a damaged file can say; should one forget a case, the user still gets one line.
    except Exception as error:
        raise MeshError("file", f"is damaged ({type(error).__name__}: {_reason(error)}); save it anew") from None


def part(mesh: TriangleMesh, name: str) -> TriangleMesh:
    """The triangles of a part of a mesh: those of the part of this name, or of all parts `name/...`. Vertices that no
    other triangle uses are removed.

    Raises a MeshError about the field `part`.
    """
    wanted = [p == name or p.startswith(name + "/") for p in mesh.parts]
    keep = np.array(wanted)[mesh.part_of]
    if not keep.any():
        near = difflib.get_close_matches(name, mesh.parts, 1, 0) or mesh.parts
        raise MeshError("part", f"the file has no part {name!r}; the nearest is {near[0]!r}, of {len(mesh.parts)}")
    mesh = mesh.kept(keep)
    columns = {}
    for values, index in (("vertices", "faces"), ("normals", "normal_of"), ("uvs", "uv_of")):
        if (old := getattr(mesh, index)) is not None:
            used, new = np.unique(old, return_inverse=True)
            columns |= {values: getattr(mesh, values)[used], index: new.reshape(-1, 3)}
    used, part_of = np.unique(mesh.part_of, return_inverse=True)
    return replace(mesh, **columns, parts=tuple(mesh.parts[i] for i in used), part_of=part_of)
