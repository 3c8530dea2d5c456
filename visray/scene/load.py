"""Scenes from files and into files; every error names the file, the address in it and what would be right."""

import warnings
from pathlib import Path

from visray import lights
from visray.errors import UserError
from visray.scene.check import checked, examined, flaws
from visray.scene.messages import line, printable, tag_of
from visray.scene.scene import Scene
from visray.scene.seed_format import SeedWarning, convert, is_seed, is_setup
from visray.scene.source import read
from visray.scene.write import dump, schema

__all__ = ["checked", "dump", "flaws", "load", "schema"]


def load(path: str | Path, setup: str | Path | None = None) -> Scene:
    """The scene in a file: one of visray's, or one of the original VisRayTrace, with or without its `setup` file.

    What an original file says and this version cannot do is told by a SeedWarning each, or a UserError.
    """
    source = read(path)
    if is_seed(source.raw) or is_setup(source.raw):
        scene, told = convert(path, setup)
        for text in told:
            warnings.warn(text, SeedWarning, stacklevel=2)
        return scene
    if setup is not None:
        raise UserError(f"{path}: is not a VisRayTrace scene, and only those take a setup file; leave {setup} out")
    found = [f"{address}: the key is written twice; keep one" for address in source.repeated]
    raw, found = _native(source.raw, found) if isinstance(source.raw, dict) else (source.raw, found)
    scene, wrong = examined(raw)
    if found or wrong:
        raise UserError(*(f"{path}: {text}" for text in dict.fromkeys([*map(printable, found), *wrong])))
    return scene


def _native(raw: dict, found: list[str]) -> tuple[dict, list[str]]:
    """The scene without its `$schema`, and what is wrong that the kinds themselves cannot say."""
    raw = dict(raw)
    schema_name = raw.pop("$schema", "")
    if not isinstance(schema_name, str):
        found.append(line("$schema", schema_name, "must be a string, the name of a JSON Schema"))
    # A file names the type of a light even while there is only one, so that it reads the same when there are more.
    named = raw.get("lights") if isinstance(raw.get("lights"), dict) else {}
    untyped = [name for name, light in named.items() if isinstance(light, dict) and "type" not in light]
    kinds = ", ".join(tag_of(kind) for kind in lights.KINDS)
    return raw, found + [f"lights.{name}: the key 'type' is missing; one of {kinds}" for name in untyped]
