"""Scenes from files and into files; every error names the file, the address in it and what would be right."""

import warnings
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.scene.check import checked, examined, flaws
from visray.scene.legacy.convert import SeedWarning, convert, is_seed, is_setup
from visray.scene.messages import line, printable
from visray.scene.scene import Scene
from visray.scene.source import read
from visray.scene.write import dump, schema, with_files

__all__ = ["checked", "dump", "flaws", "load", "schema"]


def load(path: str | Path, setup: str | Path | None = None, compat: bool = False) -> Scene:
    """The scene in a file: one of visray's, or one of the original VisRayTrace, with or without its `setup` file.

    The files of textures, in the file relative to its folder, are in the scene relative to the current one.
    What an original file says and this version cannot do is told by a SeedWarning each, or a UserError. `compat`: with
    the original's own rules where ours are others (see seed_format).
    """
    source = read(path)
    if is_seed(source.raw) or is_setup(source.raw):
        scene, told = convert(path, setup, compat)
        for text in told:
            warnings.warn(text, SeedWarning, stacklevel=2)
        return scene
    if setup is not None:
        raise UserError(f"{path}: is not a VisRayTrace scene, and only those take a setup file; leave {setup} out")
    if compat:
        raise UserError(f"{path}: is not a VisRayTrace scene, and only those have its rules; leave --compat out")
    found = [f"{address}: the key is written twice; keep one" for address in source.repeated]
    raw, of_schema = _native(source.raw)
    scene, wrong = examined(raw)
    if found or of_schema or wrong:
        raise UserError(*(f"{path}: {text}" for text in [*map(printable, found), *of_schema, *wrong]))
    folder = Path(path).parent
    return with_files(scene, lambda file: str(folder / file))


def _native(raw: Any) -> tuple[Any, list[str]]:
    """The content of a scene file without its `$schema`, and what is wrong with that."""
    if not isinstance(raw, dict) or "$schema" not in raw:
        return raw, []
    rest = {k: v for k, v in raw.items() if k != "$schema"}
    name = raw["$schema"]
    wrong = [] if isinstance(name, str) else [line("$schema", name, "must be a string, the name of a JSON Schema")]
    return rest, wrong
