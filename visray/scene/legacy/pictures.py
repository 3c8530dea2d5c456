"""The picture files of original VisRayTrace scenes, found where they lie now, as our textures.

In the original they were resources built into the program: `://resources/earth/map.png` is earth/map.png below the
folder of resources, which held the scene files too, some of them in sub-folders. So that folder is the scene's own or
the one above it.
"""

import os
import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from visray.scene.legacy.entry import Entry
from visray.scene.legacy.names import distinct, valid
from visray.scene.messages import line

PREFIX = re.compile(r"^:/*(resources/)?")


class Pictures:
    """The textures of a scene, one for each picture file, with the name of the file.

    As in the original the colour is that of the nearest pixel, and there are no pixels beyond the edge. With `compat`
    the numbers 0..255 of the file are 0..1 of kd as they stand, as they were there, whatever curve they were meant for.
    """

    def __init__(self, scene_file: str | Path, compat: bool):
        self.folder = Path(scene_file).parent
        self.encoding = "linear" if compat else "auto"
        self.textures: dict[str, dict] = {}

    def texture(self, e: Entry, key: str) -> str | None:
        """The name of the texture of the file that a key asks for; None with an error if there is no such file."""
        asked = e.values[key]
        inner = PREFIX.sub("", asked.replace("\\", "/"))
        near = (self.folder / inner, self._above() / inner)
        found = next(filter(os.path.isfile, chain(near, self._elsewhere(os.path.basename(inner)))), None)
        if found is None:
            e.error(key, f"there is no such picture in {self.folder}, in the folder above, or in a sub-folder of these")
            return None
        file = os.path.normpath(found)
        if found not in near:
            e.log.warn(line(e.at(key), asked, f"is not there; {file} is used"))
        return self._named(file)

    def _named(self, file: str) -> str:
        known = next((name for name, texture in self.textures.items() if texture["file"] == file), None)
        if known is None:
            known = distinct(valid(Path(file).stem) or "picture", self.textures)
            self.textures[known] = {
                "type": "image",
                "file": file,
                "filter": "nearest",
                "wrap": "clamp",
                "encoding": self.encoding,
            }
        return known

    def _above(self) -> Path:
        """The folder above, also of a relative path such as "."."""
        return Path(os.path.normpath(self.folder / ".."))

    def _elsewhere(self, name: str) -> Iterator[Path]:
        """Where a file of that name may be, other than where it should be: beside the scene, or one folder off."""
        yield self.folder / name
        for root in (self.folder, self._above()):
            yield from (folder / name for folder in _folders(root))


def _folders(root: Path) -> list[Path]:
    try:
        return sorted(Path(entry.path) for entry in os.scandir(root) if entry.is_dir())
    except OSError:
        return []
