"""A scene in one line, and as a small table for notebooks. Nothing is rendered, read or checked."""

from collections import Counter
from collections.abc import Mapping
from html import escape
from typing import Any

# Kinds that the line names, and entries of a section that the table shows.
NAMED, ROWS = 4, 8
# Sections of a scene, each with the word for one of its entries.
SECTIONS = {
    "objects": "object",
    "geometries": "geometry",
    "lights": "light",
    "materials": "material",
    "textures": "texture",
}


def summary(scene: Any) -> str:
    """A scene in one line: `Scene: 3 objects (2 spheres, 1 plane), 2 materials, 1 light, 640 x 480`."""
    parts = [_section(getattr(scene, name), word, name == "objects") for name, word in SECTIONS.items()]
    if scene.lights is None:
        parts.append("fitted lights")
    if scene.data is not None:
        parts.append(counted(len(getattr(scene.data, "layers", ())), "layer") + " of data")
    if scene.animation is not None:
        parts.append(f"{getattr(scene.animation, 'duration', '?')} s of animation")
    parts.append(_size(scene.film))
    return f"Scene: {', '.join(part for part in parts if part)}"


def table(scene: Any) -> str:
    """A scene as an HTML table: a row for each entry, as many as can be read at a glance."""
    rows = []
    for name in SECTIONS:
        entries = getattr(scene, name)
        if not isinstance(entries, Mapping):
            continue
        for key, entry in list(entries.items())[:ROWS]:
            rows.append((f"{name}.{key}", repr(entry)))
        if len(entries) > ROWS:
            rows.append((name, f"and {len(entries) - ROWS} more"))
    rows += [
        (name, repr(x)) for name in ("camera", "background", "settings") if (x := getattr(scene, name)) is not None
    ]
    cells = "".join(f"<tr><td>{_cell(a)}</td><td><code>{_cell(b)}</code></td></tr>" for a, b in rows)
    return f"<p>{_cell(summary(scene))}</p><table>{cells}</table>"


def _cell(text: str) -> str:
    return escape(text if len(text) <= 160 else text[:157] + "...")


def _section(entries: Any, word: str, with_kinds: bool) -> str:
    """The number of entries in words; "" without entries."""
    if not entries and word != "object":
        return ""
    if not isinstance(entries, Mapping):
        return "" if entries is None else f"{word}s that are no dict"
    text = counted(len(entries), word)
    if not (with_kinds and entries):
        return text
    kinds = Counter(_kind(entry) for entry in entries.values()).most_common()
    named = [counted(count, kind) for kind, count in kinds[:NAMED]] + (["..."] if kinds[NAMED:] else [])
    return f"{text} ({', '.join(named)})"


def _kind(entry: Any) -> str:
    """The type of an object."""
    kind = entry.get("type") if isinstance(entry, Mapping) else getattr(entry, "type", None)
    return kind if isinstance(kind, str) else type(entry).__name__


def _size(film: Any) -> str:
    """Width and height of the picture."""
    return f"{getattr(film, 'width', '?')} x {getattr(film, 'height', '?')}"


def counted(count: int, word: str) -> str:
    """A number and a word: 1 sphere, 2 spheres, 2 boxes, 3 tori."""
    if count == 1:
        return f"1 {word}"
    if word == "csg":
        return f"{count:,} csg"
    if word == "torus":
        return f"{count:,} tori"
    if word.endswith("y"):
        return f"{count:,} {word[:-1]}ies"
    return f"{count:,} {word}{'es' if word.endswith(('s', 'x', 'sh')) else 's'}"
