"""Strict reading of JSON files. Errors give the line and the column."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.scene.garbage import uncollected

# A whole number of at most this many digits fits a double. A longer one is read as a float, which may be infinite.
LONGEST_INTEGER = 300


@dataclass(frozen=True)
class Source:
    """Content of a JSON file.

    raw: the content as dicts, lists and values.
    repeated: addresses of keys that are written twice in their object. `raw` contains the last value of each.
    """

    raw: Any
    repeated: tuple[str, ...] = ()


class _RepeatedKey(Exception):
    """Raised if a JSON object has the same key twice."""


def _with_unique_keys(pairs: list[tuple[str, Any]]) -> dict:
    """Dict of a JSON object. Raises _RepeatedKey if it has the same key twice."""
    values = dict(pairs)
    if len(values) < len(pairs):
        raise _RepeatedKey
    return values


class _Object(dict):
    """Dict of a JSON object. Its attribute `repeated` lists the keys that are written twice."""

    def __init__(self, pairs: list[tuple[str, Any]]):
        super().__init__(pairs)
        seen: set[str] = set()
        self.repeated = list(dict.fromkeys(k for k, _ in pairs if k in seen or seen.add(k)))


def read(path: str | Path) -> Source:
    """Content of a JSON file. Raises UserError if the file cannot be read, or is not JSON in UTF-8."""
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
    """Content of a JSON text.

    name: what errors call the text, such as the file's path.
    """
    try:
        return Source(_loaded(text, name, _with_unique_keys))
    except _RepeatedKey:
        # The addresses of repeated keys are needed only now. Finding them takes longer than reading alone.
        repeated: list[str] = []
        return Source(_plain(_loaded(text, name, _Object), "", repeated), tuple(repeated))


def _loaded(text: str, name: str, to_object: Callable[[list], dict]) -> Any:
    """Content of a JSON text.

    name: what errors call the text.
    to_object: function that makes the dict of a JSON object from its (key, value) pairs.
    """
    try:
        return json.loads(text, object_pairs_hook=to_object, parse_int=_integer)
    except json.JSONDecodeError as error:
        reason = error.msg[0].lower() + error.msg[1:]
        raise UserError(f"{name}: line {error.lineno}, column {error.colno}: is not JSON: {reason}") from None
    except RecursionError:
        raise UserError(f"{name}: is nested too deeply") from None


def _integer(digits: str) -> int | float:
    """Value of a whole number; a float if it has more than LONGEST_INTEGER digits."""
    return int(digits) if len(digits) <= LONGEST_INTEGER else float(digits)


def _plain(tree: Any, address: str, repeated: list[str]) -> Any:
    """The content of a JSON text with plain dicts in place of each _Object.

    address: address of this part, and a dot.
    repeated: list to which the addresses of repeated keys are added.
    """
    if isinstance(tree, list):
        return [_plain(v, f"{address}{i}.", repeated) for i, v in enumerate(tree)]
    if isinstance(tree, _Object):
        repeated += [address + key for key in tree.repeated]
        return {k: _plain(v, f"{address}{k}.", repeated) for k, v in tree.items()}
    return tree


def neighbour(path: Path) -> str:
    """Hint at a file with a similar name in the same folder; "" if there is none."""
    if not path.parent.is_dir():
        return ""
    # Names are compared without their suffix, because files of one type all have the same one.
    files = {p.stem: p.name for p in path.parent.iterdir() if p.is_file()}
    similar = get_close_matches(path.stem, files, 1)
    return f"; did you mean {str(path.parent / files[similar[0]])!r}?" if similar else ""
