"""The package of a scene: its text and the contents of all files that it names, as bytes that travel to workers."""

import hashlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from visray.errors import UserError
from visray.meshes.reading import READERS, files_of
from visray.scene.load import load
from visray.scene.scene import Scene
from visray.scene.write import text_with_files

SCENE = "scene.json"
# Number of digits of a content's hash in the name of its folder.
DIGITS = 16


@dataclass(frozen=True)
class ScenePackage:
    """A scene and its files.

    text: the scene as JSON; it names the files by their paths in the package
    files: pairs of a path in the package and the content
    digest: hash of all of it
    """

    text: str
    files: tuple[tuple[str, bytes], ...]
    digest: str

    @staticmethod
    def of(scene: Scene) -> "ScenePackage":
        """The package of a scene. Raises UserError if a file cannot be read."""
        files: dict[str, bytes] = {}

        def packed(path: str) -> str:
            """The path in the package of a file, which is added to it with the files that it names itself."""
            own = Path(path).resolve()
            paths = [own, *(Path(other) for other in _others(path) if Path(other).is_relative_to(own.parent))]
            contents = [_content(p) for p in paths]
            folder = PurePosixPath(hashlib.sha256(b"".join(contents)).hexdigest()[:DIGITS])
            names = [str(folder / p.relative_to(own.parent).as_posix()) for p in paths]
            files.update(zip(names, contents))
            return names[0]

        text = text_with_files(scene, packed)
        digest = hashlib.sha256(text.encode())
        for name, content in sorted(files.items()):
            digest.update(f"\0{name}\0{len(content)}\0".encode() + hashlib.sha256(content).digest())
        return ScenePackage(text, tuple(files.items()), digest.hexdigest())

    @property
    def bytes(self) -> int:
        """Number of bytes that travel to each worker."""
        return len(self.text.encode()) + sum(len(content) for _, content in self.files)

    def unpacked(self, folder: Path) -> Scene:
        """The scene, whose files are written into a folder. Raises OSError if that fails."""
        for name, content in self.files:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        (folder / SCENE).write_text(self.text, encoding="utf-8")
        return load(folder / SCENE)


def _others(path: str) -> tuple[str, ...]:
    """The files that a file names itself: those of a mesh."""
    return files_of(path)[1:] if Path(path).suffix.lower() in READERS else ()


def _content(path: Path) -> bytes:
    """Content of a file. Raises UserError if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read, {error.strerror or error}") from error
