"""Reads OBJ files.

trimesh's own reader is not used: it counts relative indices from the end of the file, guesses the meaning of all
corners from the first one, and cuts all lines to the shortest; each of these changes the mesh without a word.
"""

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


def read_obj(raw: bytes, name: str) -> FileMesh:
    """The mesh of an OBJ file.

    name: name of the part of all faces that stand before the first `o` or `g`.
    """
    text = Text.of(raw)
    line_of_keyword = _lines(text)
    vertices = _rows(text, line_of_keyword.get("v", _NONE), 3)
    normals = _rows(text, line_of_keyword.get("vn", _NONE), 3)
    uvs = _rows(text, line_of_keyword.get("vt", _NONE), 1, 2)
    lines = line_of_keyword.get("f", _NONE)
    if not len(lines):
        raise MeshError("file", "has no triangles (no line begins with f)")
    words = _words_after(text, lines)
    indices = _corner_indices(text, words)
    sizes = np.diff(text.first)[lines] - 1
    if sizes.min() < 3:
        line = text.line(text.first[lines[sizes.argmin()]])
        raise MeshError("file", f"line {line} has a face of {sizes.min()} corners; a face has at least 3")
    of_corner = np.repeat(lines, sizes)
    kinds = (("v", "vertex", len(vertices)), ("vt", "texture coordinate", len(uvs)), ("vn", "normal", len(normals)))
    v, vt, vn = (
        _absolute(text, index, of_corner, line_of_keyword.get(key, _NONE), noun, count)
        for index, (key, noun, count) in zip(indices, kinds)
    )
    parts, part_of = _parts(text, line_of_keyword, lines, name)
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


def _lines(text: Text) -> dict[str, np.ndarray]:
    """For each keyword of the file, the lines that begin with it. A line is an index into `text.first`."""
    heads = text.first[:-1]
    begin, length = text.word[heads], np.minimum(text.word_end[heads] - text.word[heads], 8)
    # The first seven characters and the length in one number tell all known keywords apart.
    code = length << 56
    for i in range(7):
        character = text.data[np.minimum(begin + i, len(text.data) - 1)].astype(np.int64)
        code |= np.where(i < length, character, 0) << 8 * i
    codes, firsts = np.unique(code, return_index=True)
    words = {}
    for line, value in sorted(zip(firsts, codes)):
        word = text[heads[line]]
        if word not in KNOWN:
            raise MeshError("file", f"is no OBJ file: its line {text.line(heads[line])} begins with {word[:20]!r}")
        words[word] = np.flatnonzero(code == value)
    return words


def _words_after(text: Text, lines: np.ndarray) -> np.ndarray:
    """The words of some lines without their keywords."""
    sizes = np.diff(text.first)[lines] - 1
    offset = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return np.repeat(text.first[lines] + 1, sizes) + offset


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
    values = text.numbers(_words_after(text, lines))
    place = (np.cumsum(sizes) - sizes)[:, None] + np.arange(wanted)
    missing = np.arange(wanted) >= sizes[:, None]
    return np.where(missing, 0.0, np.append(values, 0.0)[np.where(missing, len(values), place)])


def _corner_indices(text: Text, words: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The three indices of corners such as `3`, `3/1`, `3//2` and `3/1/2`; 0 where one is missing.

    Shapes: words (C); result (C) each.
    """
    characters = text.characters(words)
    slash = np.flatnonzero(characters == SLASH)
    begin = text.word[words] - text.word[words[0]]
    end = text.word_end[words] - text.word[words[0]]
    first = np.searchsorted(slash, begin)
    slashes = np.searchsorted(slash, end) - first
    if slashes.max() > 2:
        number = words[slashes.argmax()]
        raise MeshError("file", f"line {text.line(number)} has {text[number]!r} where a corner such as 3/1/2 must be")
    places = np.append(slash, [0, 0])
    # A number follows a slash unless the word ends there or another slash stands there.
    stop_1 = np.where(slashes == 2, places[first + 1], end)
    has_2 = (slashes >= 1) & (stop_1 > places[first] + 1)
    has_3 = (slashes == 2) & (end > places[first + 1] + 1)
    if len(slash):
        characters = characters.copy()
        characters[slash] = ord(" ")
    count = 1 + has_2.astype(np.int64) + has_3
    values = text.parsed_words(characters, words, int(count.sum()), np.int64)
    place = np.cumsum(count) - count
    values = np.append(values, 0)
    nothing = len(values) - 1
    return (
        values[place],
        values[np.where(has_2, place + 1, nothing)],
        values[np.where(has_3, place + 1 + has_2, nothing)],
    )


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
