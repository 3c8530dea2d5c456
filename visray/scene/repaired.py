"""Scenes of files with values of the option --set, which may also replace values that are wrong in the file."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.scene.address import changed
from visray.scene.load import load
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
) -> Scene:
    """The scene of a file, with other values at some addresses. Only what is wrong then is an error.

    assignments: values by address. source: content of the file. The others are those of `load`.
    """
    more = {"setup": setup, "compat": compat, "allow_outside": allow_outside}
    try:
        scene = load(path, source=source, **more)
    except UserError:
        raw = source.raw
        for address, new in assignments.items():
            raw = _with(raw, address.split("."), new)
        if raw == source.raw:
            raise
        try:
            scene = load(path, source=replace(source, raw=raw), **more)
        except UserError as error:
            # What the command line says is no fault of the file.
            begins = tuple(f"{path}: {address}{end}" for address in assignments for end in (" ", ".", ":"))
            lines = (line.removeprefix(f"{path}: ") if line.startswith(begins) else line for line in error.lines)
            raise UserError(*lines) from None
    return changed(scene, assignments) if assignments else scene


def _with(node: Any, keys: list[str], new: Any) -> Any:
    """A part of a file with another value at the end of a path of keys; as it is, if it has no such path."""
    key, *rest = keys
    if isinstance(node, dict) and (key in node or not rest):
        return node | {key: _with(node[key], rest, new) if rest else new}
    if isinstance(node, list) and key.isdecimal() and int(key) < len(node):
        i = int(key)
        return [*node[:i], _with(node[i], rest, new) if rest else new, *node[i + 1 :]]
    return node
