"""What a name may mean that is no scene file: files with similar names, and files in its folder."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

from visray.scene.source import as_surface, neighbour

# Suffixes of scene files.
SUFFIXES = (".json",)
# Number of files of a folder that are looked at, and of those that are named.
LOOKED_AT, NAMED = 1000, 3


def meant(path: Path) -> str:
    """What is wrong with a path that is no file, and what would be right."""
    if path.is_dir():
        found = [str(file) for file in islice(files_in(path), NAMED)]
        return f"is a folder; give a scene in it{', such as ' + ' or '.join(found) if found else ''}"
    if hint := neighbour(path, SUFFIXES) or as_surface(str(path)):
        return f"no such file{hint}"
    below = next((str(file) for file in _below(path.parent) if file.name == path.name), None)
    if below:
        return f"no such file; did you mean {below!r}?"
    if path.suffix.lower() != ".json" and path.with_name(path.name + ".json").exists():
        return f"no such file; did you mean {str(path.with_name(path.name + '.json'))!r}?"
    name = path if path.suffix.lower() == ".json" else f"{path}.json"
    return f"no such file; visray new {name} writes a scene to begin with"


def missing(command: str) -> str:
    """What would be right where a command gets no scene."""
    found = next(files_in(Path()), None) or next((file for file in _below(Path()) if is_scene(file)), None)
    return f"write {command} {found}" if found else "visray new ball.json writes one to begin with"


def files_in(folder: Path) -> Iterator[Path]:
    """The scene files in a folder, in the order of their names."""
    return filter(is_scene, _entries(folder))


def is_scene(path: Path) -> bool:
    """Whether a file may be a scene, by its name."""
    return path.suffix.lower() == ".json" and path.name != "schema.json" and path.is_file()


def _below(folder: Path) -> Iterator[Path]:
    """The files in the folders in a folder."""
    for inner in _entries(folder):
        if inner.is_dir() and not inner.name.startswith("."):
            yield from _entries(inner)


def _entries(folder: Path) -> list[Path]:
    """What is in a folder, in the order of its names; nothing if it may not be listed."""
    with suppress(OSError):
        return sorted(islice(folder.iterdir(), LOOKED_AT))
    return []
