"""Looks at the file of a scene, and at the files that it names, and reads the scene again when one of them changes."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from visray.environment_map import EnvironmentMap
from visray.errors import UserError
from visray.images.environment import read_map
from visray.images.reading import read_image
from visray.named_files import stamp_of
from visray.scene.scene import Scene
from visray.scene.source import read
from visray.scene.write import files_of

# Number of bytes of a scene file from which on it is told before it is read: nothing else goes on meanwhile.
LARGE = 2 * 10**7
# Keys of a scene file under which paths of files are.
FILE_KEYS = ("file", "source")


class FileWatch:
    """The file of a scene, as it was seen last.

    file: the scene's file
    load: reads the scene
    scene: the scene that the file had when it was last right
    lines: what is wrong with the file now; () if nothing is
    tell: says a sentence in passing

    A file that changes is read when it has not changed for one look, because programs may write it in several steps.
    """

    def __init__(
        self,
        file: Path,
        load: Callable[[], Scene],
        scene: Scene,
        others: Iterable[Path] = (),
        tell: Callable[[str], None] = lambda text: None,
    ):
        self.file, self.load, self.scene, self.others, self.tell = file, load, scene, tuple(map(str, others)), tell
        self.lines: tuple[str, ...] = ()
        self._names = files_of(scene)
        self._hash = scene.hash()
        self._seen = self._stamps()
        self._is_settling = False

    def look(self) -> Scene | None:
        """Looks at the files once. Returns the scene if it has become another one, else None."""
        now = self._stamps()
        if now != self._seen:
            self._seen, self._is_settling = now, True
            return None
        if not self._is_settling:
            return None
        self._is_settling = False
        return self._read()

    def _read(self) -> Scene | None:
        """Reads the scene. Returns it if it is another one."""
        if not self.file.exists():
            self.lines = (f"{self.file}: has been deleted or renamed; its last content is shown",)
            return None
        # A pipe must not be opened: that would wait for a writer.
        if odd := [x for x in (self.file, *map(Path, self.others)) if x.exists() and not (x.is_file() or x.is_dir())]:
            self.lines = (f"{odd[0]}: is not a regular file; the last scene is shown until it is one",)
            return None
        if (size := self.file.stat().st_size) > LARGE:
            self.tell(f"{self.file.name} has {size / 1e6:.0f} MB; the picture waits while it is read")
        try:
            scene = self.load()
            _check_images(scene)
            found = scene.hash()
        except UserError as error:
            self.lines = error.lines
            self._watch({*self._names, *_named_in(self.file)})
            return None
        self.lines = ()
        self._watch(files_of(scene))
        if found == self._hash:
            return None
        self.scene, self._hash = scene, found
        return scene

    def _watch(self, names: Iterable[str]) -> None:
        """Watches other files than before. Those that are new here count as they are now."""
        self._names = tuple(names)
        self._seen = {path: self._seen.get(path, x) for path, x in self._stamps().items()}

    def _stamps(self) -> dict[str, Any]:
        """What tells whether a file has changed, by path."""
        return {path: stamp_of(path) for path in (str(self.file), *self.others, *self._names)}


def _check_images(scene: Scene) -> None:
    """Raises UserError if the image of a texture or the environment map cannot be read. All other files are read with
    the scene."""
    images = ((name, texture) for name, texture in scene.textures.items() if getattr(texture, "file", None))
    flaws = []
    for name, texture in images:
        try:
            read_image(texture.file, texture.encoding, f"textures.{name}.file")
        except UserError as error:
            flaws += error.lines
    if isinstance(scene.background, EnvironmentMap):
        try:
            read_map(scene.background)
        except UserError as error:
            flaws += error.lines
    if flaws:
        raise UserError(*flaws)


def _named_in(file: Path) -> set[str]:
    """Paths of the files that a scene file names, even if the scene has errors."""
    try:
        raw = read(file).raw
    except UserError:
        return set()
    return {str(file.parent / name) for name in _texts(raw)}


def _texts(node: Any) -> Iterable[str]:
    """All texts under FILE_KEYS, at all depths."""
    if isinstance(node, dict):
        for key, value in node.items():
            if key in FILE_KEYS and isinstance(value, str):
                yield value
            yield from _texts(value)
    elif isinstance(node, list):
        for value in node:
            yield from _texts(value)
