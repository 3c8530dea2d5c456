"""Reads OBJ files.

trimesh's own reader is not used: it counts relative indices from the end of the file, guesses the meaning of all
corners from the first one, and cuts all lines to the shortest; each of these changes the mesh without a word.
"""

from pathlib import Path

import numpy as np

from visray.meshes.assembly import FileMesh
from visray.meshes.text import Text
from visray.meshes.triangle_mesh import MeshError

SLASH = ord("/")
# Keywords that say nothing about where a triangle lies.
IGNORED = {"s", "mg", "usemtl", "mtllib", "usemap", "maplib", "bevel", "c_interp", "d_interp", "lod"}
IGNORED |= {"shadow_obj", "trace_obj"}
# Keywords of points, lines, curves and free-form surfaces.
OTHER_SHAPES = {"p", "l", "vp", "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole"}
OTHER_SHAPES |= {"scrv", "sp", "end", "con", "ctech", "stech"}
KNOWN = {"v", "vt", "vn", "f", "o", "g"} | IGNORED | OTHER_SHAPES
_NONE = np.empty(0, int)


def read_obj(raw: bytes, path: Path) -> FileMesh:
    """The mesh of an OBJ file. Faces before the first `o` or `g` belong to a part with the name of the file."""
    text = Text.of(raw)
    del raw  # a large file is not kept twice
    line_of_keyword = text.lines_by_keyword(KNOWN, "OBJ")
    vertices = _rows(text, line_of_keyword.get("v", _NONE), 3)
    normals = _rows(text, line_of_keyword.get("vn", _NONE), 3)
    uvs = _rows(text, line_of_keyword.get("vt", _NONE), 1, 2)
    lines = line_of_keyword.get("f", _NONE)
    if not len(lines):
        raise MeshError("file", "has no triangles (no line begins with f)")
    sizes = np.diff(text.first)[lines] - 1
    if sizes.min() < 3:
        line = text.line(text.first[lines[sizes.argmin()]])
        raise MeshError("file", f"line {line} has a face of {sizes.min()} corners; a face has at least 3")
    indices = _corner_indices(text, text.after_keyword(lines))
    of_corner = np.repeat(lines, sizes)
    kinds = (("v", "vertex", len(vertices)), ("vt", "texture coordinate", len(uvs)), ("vn", "normal", len(normals)))
    v, vt, vn = (
        _absolute(text, index, of_corner, line_of_keyword.get(key, _NONE), noun, count)
        for index, (key, noun, count) in zip(indices, kinds)
    )
    parts, part_of = _parts(text, line_of_keyword, lines, path.stem)
    mesh = FileMesh(vertices, v, sizes, parts=parts, part_of=part_of, first=1)
    if (vn >= 0).any():
        mesh.normals, mesh.normal_of = normals, vn
    if (vt >= 0).any():
        mesh.uvs, mesh.uv_of = uvs, vt
    if {"usemtl", "mtllib"} & set(line_of_keyword):
        mesh.notes.append("its materials and textures are not used")
    if others := OTHER_SHAPES & set(line_of_keyword):
        mesh.notes.append(f"its points, lines and curves ({', '.join(sorted(others))}) are not used")
    return mesh


def _rows(text: Text, lines: np.ndarray, least: int, wanted: int | None = None) -> np.ndarray:
    """The numbers of some lines.

    least: how many numbers a line must have
    wanted: how many of them are read (`least` if None); missing ones are 0

    Shapes: lines (L); result (L, wanted).
    """
    wanted = wanted or least
    sizes = np.diff(text.first)[lines] - 1
    if len(sizes) and sizes.min() < least:
        number = text.first[lines[sizes.argmin()]]
        raise MeshError("file", f"line {text.line(number)} has {sizes.min()} numbers after {text[number]}, not {least}")
    values = text.numbers(text.after_keyword(lines))
    place = (np.cumsum(sizes) - sizes)[:, None] + np.arange(wanted)
    missing = np.arange(wanted) >= sizes[:, None]
    return np.where(missing, 0.0, np.append(values, 0.0)[np.where(missing, len(values), place)])


def _corner_indices(text: Text, words: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The three indices of corners such as `3`, `3/1`, `3//2` and `3/1/2`; 0 where one is missing.

    Shapes: words (C); result (C) each.
    """
    characters = text.characters(words)
    has_2, has_3 = _has_indices(text, words, np.flatnonzero(characters == SLASH))
    characters[characters == SLASH] = ord(" ")
    count = 1 + has_2.astype(np.int64) + has_3
    place = np.cumsum(count) - count
    values = text.parsed(characters, words, int(count.sum()), np.int64)
    second = np.where(has_2, values[np.minimum(place + 1, len(values) - 1)], 0)
    third = np.where(has_3, values[place + count - 1], 0)
    return values[place], second, third


def _has_indices(text: Text, words: np.ndarray, slash: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether corners have a second and a third index. A number follows a slash unless the word ends there or another
    slash stands there.

    slash: places of the slashes, counted from the first of the words
    """
    begin = text.word[words] - text.word[words[0]]
    end = text.word_end[words] - text.word[words[0]]
    first = np.searchsorted(slash, begin)
    slashes = np.searchsorted(slash, end) - first
    if slashes.max() > 2:
        number = words[slashes.argmax()]
        raise MeshError("file", f"line {text.line(number)} has {text[number]!r} where a corner such as 3/1/2 must be")
    places = np.append(slash, [0, 0])
    stop = np.where(slashes == 2, places[first + 1], end)
    return (slashes >= 1) & (stop > places[first] + 1), (slashes == 2) & (end > places[first + 1] + 1)


def _absolute(text: Text, index: np.ndarray, of_corner: np.ndarray, lines: np.ndarray, noun: str, count: int):
    """Indices from 0 of the indices of a file, which count from 1, or backwards from the line where they stand. -1 for
    none, which a vertex must not be.

    lines: the lines of the entries that are counted
    """
    result = np.where(index < 0, index, index - 1)
    backwards = np.flatnonzero(index < 0)
    result[backwards] += np.searchsorted(lines, of_corner[backwards])
    wrong = (result < 0) | (result >= count)
    if noun != "vertex":
        wrong &= index != 0
    if wrong.any():
        corner = np.flatnonzero(wrong)[0]
        line = text.line(text.first[of_corner[corner]])
        raise MeshError("file", f"line {line} names {noun} {index[corner]}; the file has {count}, counted from 1")
    return result


def _parts(text: Text, line_of_keyword: dict, lines: np.ndarray, name: str) -> tuple[list[str], np.ndarray]:
    """Names of the parts, and for each face the index of its part. A part is a group (`g`), an object (`o`), or, where
    both are named, `object/group`."""
    marks = [(line, key) for key in "og" for line in line_of_keyword.get(key, _NONE)]
    numbers: dict[str, int] = {}
    begins, names = [0], [numbers.setdefault(name, 0)]
    current = {"o": "", "g": ""}
    for line, key in sorted(marks):
        word = text.first[line] + 1
        current[key] = text.rest(word) if word < text.first[line + 1] else ""
        both = [part for part in dict.fromkeys(current.values()) if part]
        begins.append(int(line))
        names.append(numbers.setdefault("/".join(both) or name, len(numbers)))
    part_of = np.array(names)[np.searchsorted(begins, lines, side="right") - 1]
    used, part_of = np.unique(part_of, return_inverse=True)
    return [list(numbers)[i] for i in used], part_of
