"""Textures of a VisRayTrace scene: finds its image files.

VisRayTrace contained its images as resources: `://resources/earth/map.png` is earth/map.png in the resources folder.
The scene files are in the same folder or in its sub-folders. So the resources folder is the folder of the scene file or
its parent.
"""

import os
import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from visray.scene.legacy.entry import Entry
from visray.scene.legacy.names import unique_name, valid_name
from visray.scene.messages import line

RESOURCES_PREFIX = re.compile(r"^:/*(resources/)?")


class Textures:
    """Textures of a scene: one for each image file, with the name of the file.

    As in VisRayTrace, the colour is that of the nearest pixel, and the edge pixels continue beyond the edges of the
    image. With `compat`, a file's numbers from 0 to 255 are kd from 0 to 1 without the sRGB curve, as in VisRayTrace.

    folder: folder of the scene file.
    encoding: encoding of all textures.
    by_name: dict of the textures by name, as plain dicts of visray's fields.
    """

    def __init__(self, scene_file: str | Path, compat: bool):
        self.folder = Path(scene_file).parent
        self.encoding = "linear" if compat else "auto"
        self.by_name: dict[str, dict] = {}

    def name(self, e: Entry, key: str) -> str | None:
        """Name of the texture whose file is given under a key. If there is no such file, None with an error in the log.

        e: the material as the file gives it.
        """
        written = e.values[key]
        relative = RESOURCES_PREFIX.sub("", written.replace("\\", "/"))
        expected = (self.folder / relative, self._parent() / relative)
        candidates = chain(expected, self._elsewhere(os.path.basename(relative)))
        path = next(filter(os.path.isfile, candidates), None)
        if path is None:
            e.error(key, f"there is no such picture in {self.folder}, in the folder above, or in a sub-folder of these")
            return None
        file = os.path.normpath(path)
        if path not in expected:
            e.log.warn(line(e.at(key), written, f"is not there; {file} is used"))
        return self._name_of(file)

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

    def _parent(self) -> Path:
        """Parent of the scene file's folder. It is right also if the folder is a relative path such as "."."""
        return Path(os.path.normpath(self.folder / ".."))

    def _elsewhere(self, name: str) -> Iterator[Path]:
        """Yields other paths where an image file may be: beside the scene file, and in sub-folders of its folder and of
        the parent folder.

        name: name of the file, without folders.
        """
        yield self.folder / name
        for root in (self.folder, self._parent()):
            yield from (folder / name for folder in _folders(root))


def _folders(root: Path) -> list[Path]:
    """List of the sub-folders of a folder, sorted; empty if the folder cannot be read."""
    try:
        return sorted(Path(entry.path) for entry in os.scandir(root) if entry.is_dir())
    except OSError:
        return []
