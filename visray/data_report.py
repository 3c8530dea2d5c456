"""What visray says about the data of a scene: how files were read, which rows are not shown, and what is odd about
rules, palettes and materials."""

import os
import re

from visray.data.numerals import DECIMAL_COMMA
from visray.data.rows import ROW_MATERIAL, Rows
from visray.data.source import table_from
from visray.materials import Material
from visray.primitives.csg_operands import operands
from visray.scene.scene import Scene
from visray.warn import warn

# Share of the light that a material lets through, from which on a colour in its other fields is hardly seen.
CLEAR = 0.5
# Beginning of a note about one column of a table.
OF_COLUMN = re.compile(r'column ".*?": ')


class DataWarning(UserWarning):
    """Warning about the data of a scene, such as rows that are not shown."""


def warn_of_data(scene: Scene) -> None:
    """Warns of what is odd about the data. Each text is shown once. How a file was read is one short text."""
    if scene.data is None:
        return
    for text in [_shortened(path, notes) for path, notes in _reading_notes(scene).items()] + _notes(scene):
        warn(text, DataWarning)


def data_notes(scene: Scene) -> list[str]:
    """List of sentences about the data, each of which begins with a file or an address; empty without data."""
    if scene.data is None:
        return []
    return [f"{path}: {text}" for path, notes in _reading_notes(scene).items() for text in notes] + _notes(scene)


def _reading_notes(scene: Scene) -> dict[str, list[str]]:
    """What the readers say about the tables of the layers, by the path or the address of the table; without those of
    which they say nothing."""
    found = {}
    for name, layer in scene.data.layers.items():
        table = table_from(layer.source)
        if table is not None and table.notes:
            found[_near(layer.source) if isinstance(layer.source, str) else f"data.layers.{name}.source"] = table.notes
    return found


def _near(path: str) -> str:
    """A path as it is seen from the current folder, if it is below that."""
    short = os.path.relpath(path)
    return os.path.normpath(path) if short.startswith(os.pardir) else short


def _shortened(path: str, notes: list[str]) -> str:
    """What the readers say about a table, as one short sentence: the first note. That commas are decimal is right in
    most files that have such commas, so it gives way to others."""
    first = next((text for text in notes if not text.endswith(DECIMAL_COMMA)), OF_COLUMN.sub("", notes[0], count=1))
    more = f"; visray explain has all {len(notes)} notes" if len(notes) > 1 else ""
    return f"{path}: {first}{more}"


def _notes(scene: Scene) -> list[str]:
    """List of sentences about what the data become."""
    notes = scene.data.notes()
    for name, rows in scene.data.rows.items():
        material = scene.materials.get(rows.material, Material())
        if rows.color is not None and (flaw := material.color_flaw() or _clear(material)):
            seen = "is not seen" if material.color_flaw() else "is hardly seen"
            notes.append(f"data.layers.{name}.color: {seen}, as materials.{rows.material} {flaw}")
        elif rows.color is not None and not _takes_colors(scene, rows):
            text = f"all operands of geometries.{rows.geometry} have materials of their own"
            notes.append(f"data.layers.{name}.color: is not seen, as {text}")
    return notes


def _takes_colors(scene: Scene, rows: Rows) -> bool:
    """Whether the colours of rows are seen on some operand of their gizmos."""
    if rows.geometry is None or not len(rows):
        return True
    gizmo = rows.object(0).with_fields(material=ROW_MATERIAL)
    return any(x.is_leaf and x.material == ROW_MATERIAL for x in operands("", gizmo, scene.geometries))


def _clear(material: Material) -> str | None:
    """Why a colour is hardly seen in a transparent material, as the end of a sentence; None if it is seen."""
    if min(material.kt) < CLEAR or "kt" in material.colored:
        return None
    colored = ", ".join(f'"{name}"' for name in (*material.colored, "kt"))
    return f'lets {min(material.kt):.0%} of the light through, which has no colour; write "colored": [{colored}] there'
