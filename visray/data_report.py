"""What visray says about the data of a scene: rows that are not shown, and what is odd about rules and palettes."""

import warnings

from visray.scene.scene import Scene


class DataWarning(UserWarning):
    """Warning about the data of a scene, such as rows that are not shown."""


def warn_of_data(scene: Scene) -> None:
    """Warns of what is odd about the data. Python shows each warning once."""
    for text in data_notes(scene):
        warnings.warn(text, DataWarning, stacklevel=2)


def data_notes(scene: Scene) -> list[str]:
    """List of sentences about the data, each of which begins with an address; empty without data."""
    return [] if scene.data is None else scene.data.notes()
