"""Scenes of files with values of the option --set, which may also replace values that are wrong in the file."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.scene.address import changed
from visray.scene.adjusted import adjusted, adjusted_as_written
from visray.scene.load import load_as_written
from visray.scene.scene import Scene
from visray.scene.source import Source


def loaded_with(
    assignments: Mapping[str, Any],
    path: Path,
    setup: Path | None,
    compat: bool,
    source: Source,
    *,
    allow_outside: bool,
    **settings: Any,
) -> Scene:
    """The scene of a file, with other values at some addresses. Only what is wrong then is an error. A camera that the
    file does not have is fitted to the size of the film, and to what the assignments change.

    assignments: values by address. source: content of the file. settings: as for adjusted.adjusted. The others are
        those of `load`.
    """
    more = {"setup": setup, "compat": compat, "allow_outside": allow_outside}
    try:
        scene = load_as_written(path, source=source, **more)
    except UserError:
        raw = source.raw
        for address, new in assignments.items():
            raw = _with(raw, address.split("."), new)
        if raw == source.raw:
            raise
        try:
            scene = load_as_written(path, source=replace(source, raw=raw), **more)
        except UserError as error:
            # What the command line says is no fault of the file.
            begins = tuple(f"{path}: {address}{end}" for address in assignments for end in (" ", ".", ":"))
            lines = (line.removeprefix(f"{path}: ") if line.startswith(begins) else line for line in error.lines)
            raise UserError(*lines) from None
    if assignments:
        scene = changed(adjusted_as_written(scene, **settings), assignments)
    return adjusted(scene, **settings)


def _with(node: Any, keys: list[str], new: Any) -> Any:
    """A part of a file with another value at the end of a path of keys; as it is, if it has no such path."""
    key, *rest = keys
    if isinstance(node, dict) and (key in node or not rest):
        return node | {key: _with(node[key], rest, new) if rest else new}
    if isinstance(node, list) and key.isdecimal() and int(key) < len(node):
        i = int(key)
        return [*node[:i], _with(node[i], rest, new) if rest else new, *node[i + 1 :]]
    return node
