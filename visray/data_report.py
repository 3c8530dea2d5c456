"""What visray says about the data of a scene: rows that are not shown, and what is odd about rules and palettes."""

import warnings

from visray.materials import Material
from visray.scene.scene import Scene


class DataWarning(UserWarning):
    """Warning about the data of a scene, such as rows that are not shown."""


def warn_of_data(scene: Scene) -> None:
    """Warns of what is odd about the data. Python shows each warning once."""
    for text in data_notes(scene):
        warnings.warn(text, DataWarning, stacklevel=2)


def data_notes(scene: Scene) -> list[str]:
    """List of sentences about the data, each of which begins with an address; empty without data."""
    if scene.data is None:
        return []
    notes = scene.data.notes()
    for name, rows in scene.data.rows.items():
        if rows.color is not None and (flaw := scene.materials.get(rows.material, Material()).color_flaw()):
            notes.append(f"data.layers.{name}.color: is not seen, as materials.{rows.material} {flaw}")
    return notes
