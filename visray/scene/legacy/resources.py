"""Resources of a VisRayTrace scene: finds its image and mesh files.

VisRayTrace contained these files as resources: `://resources/earth/map.png` is earth/map.png in the resources folder.
The scene files are in the same folder or in its sub-folders. So the resources folder is the folder of the scene file or
its parent.
"""

import os
import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from visray.scene.files import is_below
from visray.scene.legacy.entry import Entry
from visray.scene.messages import line

RESOURCES_PREFIX = re.compile(r"^:/*(resources/)?")


class Resources:
    """Files that a scene names.

    folder: folder of the scene file.
    allow_outside: whether files outside of the resources folder may be read.
    """

    def __init__(self, scene_file: str | Path, allow_outside: bool = False):
        self.folder, self.allow_outside = Path(scene_file).parent, allow_outside

    def path(self, e: Entry, key: str, sort: str) -> str | None:
        """Path of the file that is given under a key. If there is no such file, None with an error in the log.

        e: the JSON object that names the file.
        sort: what the file is, such as "picture".
        """
        written = e.values[key]
        relative = RESOURCES_PREFIX.sub("", written.replace("\\", "/"))
        expected = (self.folder / relative, self._parent() / relative)
        candidates = chain(expected, self._elsewhere(os.path.basename(relative)))
        # What is outside counts as if it did not exist, so that nobody learns whether it does.
        visible = (p for p in candidates if self.allow_outside or is_below(p, self._parent()))
        path = next(filter(os.path.isfile, visible), None)
        if path is None:
            tried = " and ".join(map(os.path.normpath, expected))
            e.error(key, f"there is no such {sort}; tried {tried}, and the sub-folders of both folders")
            return None
        file = os.path.normpath(path)
        if path not in expected:
            e.log.warn(line(e.at(key), written, f"is not there; {file} is used"))
        return file

    def _parent(self) -> Path:
        """Parent of the scene file's folder. It is right also if the folder is a relative path such as "."."""
        return Path(os.path.normpath(self.folder / ".."))

    def _elsewhere(self, name: str) -> Iterator[Path]:
        """Yields other paths where a file may be: beside the scene file, and in sub-folders of its folder and of
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
