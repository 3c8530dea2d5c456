"""Reads scenes from files. Every error message gives the file, the address in the file, and what would be right."""

import warnings
from pathlib import Path
from typing import Any

from visray.arguments import SceneFiles, checked_arguments
from visray.errors import UserError
from visray.scene.check import checked, examined, fitted
from visray.scene.files import placed
from visray.scene.legacy.convert import LegacyWarning, convert, is_legacy_scene, is_legacy_setup
from visray.scene.messages import line
from visray.scene.naming import named
from visray.scene.scene import Scene
from visray.scene.source import Source, read
from visray.scene.write import dump, schema
from visray.terminal import printable

__all__ = ["checked", "dump", "load", "schema"]


@checked_arguments
def load(
    path: str | Path | dict,
    setup: str | Path | None = None,
    compat: bool = False,
    source: Source | None = None,
    *,
    allow_outside: bool = False,
) -> Scene:
    """The scene of a file in visray's format, or in the format of the original VisRayTrace.

    path: the file; or a dict as json.load returns it, whose files are relative to the current folder.

    setup: the setup file of a VisRayTrace scene, or None.
    compat: whether a VisRayTrace scene follows VisRayTrace's rules where visray's rules differ (legacy/convert.py).
    source: content of the file, if it was read before.
    allow_outside: whether the scene may name files outside of its folder: by `..`, absolute paths, or links. Without
        it, that is an error.

    In the file, paths of texture and mesh files are relative to the folder of the file. In the scene, they are relative
    to the current folder. If a VisRayTrace file asks for something that visray cannot do, there is a LegacyWarning or a
    UserError. A scene without a camera or lights gets fitted ones, which a FittedNote says.
    """
    return fitted(load_as_written(path, setup, compat, source, allow_outside=allow_outside))


def load_as_written(
    path: str | Path | dict,
    setup: str | Path | None = None,
    compat: bool = False,
    source: Source | None = None,
    *,
    allow_outside: bool = False,
) -> Scene:
    """As `load`, but a camera and lights that the file does not have are None."""
    if isinstance(path, dict):
        return _of_dict(path, setup, compat)
    source = source or read(path)
    if is_legacy_scene(source.raw) or is_legacy_setup(source.raw):
        scene, warning_texts = convert(path, setup, compat, allow_outside)
        for text in warning_texts:
            warnings.warn(text, LegacyWarning, stacklevel=4)
        return scene
    if setup is not None:
        raise UserError(f"{path}: is not a VisRayTrace scene, and only those take a setup file; leave {setup} out")
    if compat:
        raise UserError(f"{path}: is not a VisRayTrace scene, and only those have its rules; leave --compat out")
    repeated = [printable(f"{address}: the key is written twice; keep one") for address in source.repeated]
    raw, schema_flaws = _without_schema(source.raw)
    raw, outside = placed(raw, Path(path).parent, allow_outside)
    scene, scene_flaws = examined(raw)
    if flaws := [*repeated, *schema_flaws, *outside, *scene_flaws]:
        raise UserError(*(f"{path}: {text}" for text in flaws))
    return scene


def _of_dict(raw: dict, setup: str | Path | None, compat: bool) -> Scene:
    """The scene that a dict describes, as written. Its entries may also be records, such as vr.Sphere()."""
    if setup is not None or compat:
        raise UserError("a dict is no VisRayTrace scene, and only those have a setup file and their own rules")
    rest, flaws = _without_schema(raw)
    scene, scene_flaws = examined(named(rest))
    if flaws := [*flaws, *scene_flaws]:
        raise UserError(*flaws)
    return scene


SceneFiles.read = load_as_written


def _without_schema(raw: Any) -> tuple[Any, list[str]]:
    """Content of a scene file without its key `$schema`, and a list of errors of that key."""
    if not isinstance(raw, dict) or "$schema" not in raw:
        return raw, []
    rest = {k: v for k, v in raw.items() if k != "$schema"}
    name = raw["$schema"]
    wrong = [] if isinstance(name, str) else [line("$schema", name, "must be a string, the name of a JSON Schema")]
    return rest, wrong
