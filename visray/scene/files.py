"""Files that a scene file names. A scene reads only below its own folder: a scene of a stranger can neither read other
files nor find out which there are."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from visray.operands import ROLES, like_operands, named_operands
from visray.scene.messages import line
from visray.terminal import printable

# Sections whose entries may name a file. For each, an entry without a file. It takes the place of an entry whose file
# must not be read, while the rest of the scene is checked.
WITH_FILES: dict[str, dict] = {
    "textures": {"type": "checker"},
    "geometries": {"type": "sphere"},
    "objects": {"type": "sphere"},
}
OUTSIDE = (
    "is outside of the scene's folder; put the file below it, or allow that: --allow-outside, or "
    "load(..., allow_outside=True)"
)


class OutsideWarning(UserWarning):
    """A scene file that is written names files outside of its folder."""


def is_below(file: str | Path, folder: str | Path) -> bool:
    """Whether a file is below a folder if all links are followed. Whether it exists makes no difference."""
    try:
        return Path(os.path.realpath(file)).is_relative_to(os.path.realpath(folder))
    except (OSError, ValueError):
        return False


def placed(raw: Any, folder: Path, allow_outside: bool) -> tuple[Any, list[str]]:
    """Content of a scene file in which paths of files are relative to the current folder, and a list of errors: one for
    each file outside of the scene's folder. Such an entry is replaced by one without a file.

    Meshes are read when a scene is checked, so their paths must be right before.

    folder: folder of the scene file; in the file, paths are relative to it.
    allow_outside: whether files outside of the folder may be read.
    """
    if not isinstance(raw, dict):
        return raw, []
    flaws: list[str] = []

    def moved(address: str, entry: Any, key: str, stand_in: Callable[[dict], dict]) -> Any:
        """An entry whose path under a key is relative to the current folder; `stand_in` of it, if that is outside."""
        file = entry.get(key) if isinstance(entry, dict) else None
        if not (file and isinstance(file, str)):
            return entry
        path = str(folder / file)
        if not (allow_outside or is_below(path, folder)):
            flaws.append(printable(line(f"{address}.{key}", file, OUTSIDE)))
            return stand_in(entry)
        return entry | {key: path}

    def moved_entry(address: str, entry: Any, stand_in: dict) -> Any:
        """An entry, and its operands at all depths, with the right paths. stand_in: as in WITH_FILES."""
        entry = moved(address, entry, "file", lambda _: stand_in)
        if not isinstance(entry, dict):
            return entry
        inner = {}
        for role in ROLES:
            if isinstance(operands := entry.get(role), dict | list):
                named = named_operands(operands).items()
                inner[role] = like_operands(
                    {name: moved_entry(f"{address}.{role}.{name}", x, stand_in) for name, x in named}, operands
                )
        return entry | inner

    sections = {section: raw[section] for section in WITH_FILES if isinstance(raw.get(section), dict)}
    new = {
        section: {name: moved_entry(f"{section}.{name}", x, WITH_FILES[section]) for name, x in entries.items()}
        for section, entries in sections.items()
    }
    if isinstance(raw.get("background"), dict):
        new["background"] = moved("background", raw["background"], "file", lambda _: [0.0, 0.0, 0.0])
    data = raw.get("data")
    if isinstance(data, dict) and isinstance(data.get("layers"), dict):
        layers = data["layers"].items()
        new["data"] = data | {
            "layers": {name: moved(f"data.layers.{name}", x, "source", _without_source) for name, x in layers}
        }
    return raw | new, flaws


def _without_source(layer: dict) -> dict:
    """A layer without its file: without the fields that name columns, which are not known, and without lines, of which
    there are none."""
    rest = {key: layer[key] for key in ("gizmo", "geometry", "material") if layer.get(key, "line") != "line"}
    return rest | {"source": {"lon": [0.0], "lat": [0.0]}}
