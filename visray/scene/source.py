"""Reads JSON files strictly, with errors that say where."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.scene.garbage import uncollected

# Every whole number of this many digits has a double near it; longer ones may overflow.
LONGEST_INTEGER = 300


@dataclass(frozen=True)
class Source:
    """What a JSON file holds, and the addresses of its keys that are written more than once (the last one counts)."""

    raw: Any
    repeated: tuple[str, ...] = ()


class _Repeated(Exception):
    """A key is written twice in an object."""


def _once(pairs: list[tuple[str, Any]]) -> dict:
    """A JSON object whose keys are all different."""
    made = dict(pairs)
    if len(made) < len(pairs):
        raise _Repeated
    return made


class _Object(dict):
    """A JSON object that remembers which of its keys came twice."""

    def __init__(self, pairs: list[tuple[str, Any]]):
        super().__init__(pairs)
        seen: set[str] = set()
        self.repeated = list(dict.fromkeys(k for k, _ in pairs if k in seen or seen.add(k)))


def read(path: str | Path) -> Source:
    """The content of a JSON file; raises UserError where it cannot be read, is not UTF-8 or not JSON."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise UserError(f"{path}: no such file{neighbour(Path(path))}") from None
    except IsADirectoryError:
        raise UserError(f"{path}: is a folder; give a file in it") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise UserError(f"{path}: line {line}: is not UTF-8; save the file as UTF-8 text") from None
    if not text.strip():
        raise UserError(f"{path}: the file is empty; it must hold at least {{}}")
    return parse(text, str(path))


@uncollected()
def parse(text: str, name: str) -> Source:
    """The content of a JSON text; `name` stands before what is wrong with it."""
    try:
        return Source(_loaded(text, name, _once))
    except _Repeated:
        repeated: list[str] = []
        return Source(_plain(_loaded(text, name, _Object), "", repeated), tuple(repeated))


def _loaded(text: str, name: str, made: Callable[[list], dict]) -> Any:
    """The content of a JSON text, with `made` from the pairs of each object."""
    try:
        return json.loads(text, object_pairs_hook=made, parse_int=_integer)
    except json.JSONDecodeError as error:
        what = error.msg[0].lower() + error.msg[1:]
        raise UserError(f"{name}: line {error.lineno}, column {error.colno}: is not JSON: {what}") from None
    except RecursionError:
        raise UserError(f"{name}: is nested too deeply") from None


def _integer(digits: str) -> int | float:
    return int(digits) if len(digits) <= LONGEST_INTEGER else float(digits)


def _plain(tree: Any, address: str, repeated: list[str]) -> Any:
    """The tree in plain dicts; the addresses of repeated keys are added to `repeated`."""
    if isinstance(tree, list):
        return [_plain(v, f"{address}{i}.", repeated) for i, v in enumerate(tree)]
    if isinstance(tree, _Object):
        repeated += [address + key for key in tree.repeated]
        return {k: _plain(v, f"{address}{k}.", repeated) for k, v in tree.items()}
    return tree


def neighbour(path: Path) -> str:
    """A hint at a file of a similar name in the same folder, or nothing."""
    if not path.parent.is_dir():
        return ""
    # By the names without their ends, in which all files of a kind are alike.
    files = {p.stem: p.name for p in path.parent.iterdir() if p.is_file()}
    near = get_close_matches(path.stem, files, 1)
    return f"; did you mean {str(path.parent / files[near[0]])!r}?" if near else ""
