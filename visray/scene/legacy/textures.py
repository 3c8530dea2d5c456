"""Textures of a VisRayTrace scene."""

from pathlib import Path

from visray.scene.legacy.entry import Entry
from visray.scene.legacy.names import unique_name, valid_name
from visray.scene.legacy.resources import Resources


class Textures:
    """Textures of a scene: one for each image file, with the name of the file.

    As in VisRayTrace, the colour is that of the nearest pixel, and the edge pixels continue beyond the edges of the
    image. With `compat`, a file's numbers from 0 to 255 are kd from 0 to 1 without the sRGB curve, and ka is kept.
    The same holds for the colours of data.

    resources: finds the image files.
    encoding: encoding of all textures.
    material_fields: fields of a material with a texture, beside the name of the texture.
    colored_fields: further fields of a material in the colours of data.
    by_name: dict of the textures by name, as plain dicts of visray's fields.
    """

    def __init__(self, resources: Resources, compat: bool):
        self.resources = resources
        self.encoding = "linear" if compat else "auto"
        self.material_fields = {"textured": "kd"} if compat else {}
        self.colored_fields = {"colored": ("kd",)} if compat else {}
        self.by_name: dict[str, dict] = {}

    def name(self, e: Entry, key: str) -> str | None:
        """Name of the texture whose file is given under a key. If there is no such file, None with an error in the log.

        e: the material as the file gives it.
        """
        file = self.resources.path(e, key, "picture")
        return None if file is None else self._name_of(file)

    def _name_of(self, file: str) -> str:
        """Name of the texture of a file. Adds the texture if it is new."""
        name = next((known for known, texture in self.by_name.items() if texture["file"] == file), None)
        if name is None:
            name = unique_name(valid_name(Path(file).stem) or "picture", self.by_name)
            self.by_name[name] = {
                "type": "image",
                "file": file,
                "filter": "nearest",
                "wrap": "clamp",
                "encoding": self.encoding,
            }
        return name
