"""Strict reading of JSON files, which may have comments. Errors give the line and the column."""

import json
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from visray.errors import UserError
from visray.scene.comments import without_comments
from visray.scene.garbage import uncollected
from visray.scene.other_files import other_file

# A whole number of at most this many digits fits a double. A longer one is read as a float, which may be infinite.
LONGEST_INTEGER = 300
# Largest number of objects and lists around a value: two for each of a hundred levels of operands, and a few more.
# Python's own limit depends on who calls.
DEEPEST = 210
# Bytes of a JSON text other than brackets, and a table that makes all brackets square.
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_SQUARE = bytes.maketrans(b"{}", b"[]")
_HALF = re.compile("[\ud800-\udfff]")
# A text that may be a name or a formula, and no path.
_NAME, _FORMULA = (
    re.compile("[A-Za-z][A-Za-z0-9 -]*"),
    re.compile(r"(?=.*[xyz])(?=.*[\^=*+²³]).*(?<!\.json)", re.DOTALL),
)


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
    """Content of a JSON file, without comments and commas after a last entry (scene/comments.py). Raises UserError if
    the file cannot be read, or is not JSON in UTF-8."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise UserError(f"{path}: no such file{neighbour(Path(path)) or as_surface(str(path))}") from None
    except IsADirectoryError:
        raise UserError(f"{path}: is a folder; give a file in it") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if other := other_file(Path(path), data):
        raise UserError(f"{path}: {other}")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise UserError(f"{path}: line {line}: is not UTF-8; save the file as UTF-8 text") from None
    if not text.strip():
        raise UserError(f"{path}: the file is empty; it must hold at least {{}}")
    return parse(text, str(path), comments=True)


@uncollected()
def parse(text: str, name: str, *, comments: bool = False) -> Source:
    """Content of a JSON text.

    name: what errors call the text, such as the file's path.
    comments: whether comments and commas after a last entry are allowed.
    """
    try:
        return _content(text, name)
    except UserError:
        # Most files have no comments. Looking for them takes longer than reading alone.
        plain = without_comments(text, name) if comments else text
        if plain == text:
            raise
    if not plain.strip():
        raise UserError(f"{name}: the file holds only comments; it must hold at least {{}}")
    return _content(plain, name)


def _content(text: str, name: str) -> Source:
    """Content of a JSON text without comments. name: what errors call the text."""
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
        raw = json.loads(text, object_pairs_hook=to_object, parse_int=_integer)
    except json.JSONDecodeError as error:
        position, reason = _reason(text, error)
        line, column = text.count("\n", 0, position) + 1, position - text.rfind("\n", 0, position)
        raise UserError(f"{name}: line {line}, column {column}: is not JSON: {reason}") from None
    except RecursionError:
        raise UserError(_too_deep(name)) from None
    if _is_too_deep(text):
        raise UserError(_too_deep(name))
    if "\\u" in text and (halves := wrong_texts(raw)):
        raise UserError(*(f"{name}: {half}" for half in halves))
    return raw


# Beginnings of values that other languages have, and what JSON has instead.
VALUES = {
    "True": "write true", "False": "write false", "None": "write null", "'": 'a text has double quotes: "..."',
    "\u201c": 'a text has straight quotes: "..."', "\u201d": 'a text has straight quotes: "..."',
    ".": "a number begins with a digit, as in 0.5", "+": "a number has no plus sign; leave it out",
}  # fmt: skip


def _reason(text: str, error: json.JSONDecodeError) -> tuple[int, str]:
    """Position of the fault in a text that is no JSON, and what is wrong there.

    Python's own message names the next token, which may be on another line.
    """
    rest, before = text[error.pos :].lstrip(), text[: error.pos].rstrip()
    if before.endswith(",") and rest[:1] in ("]", "}"):
        return len(before) - 1, f"no comma belongs before '{rest[0]}'; leave it out"
    if rest[:1] == "," and before.endswith(","):
        return len(before), "there are two commas; leave one out"
    if rest[:1] == "#":
        return error.pos, "a comment begins with //, not with #"
    if rest[:2] in ("//", "/*"):
        return error.pos, "a value has no comments; leave it out"
    if not rest:
        return len(before), "the file ends too early"
    if error.msg == "Expecting value" and (said := next((t for key, t in VALUES.items() if rest.startswith(key)), "")):
        return error.pos, said
    if error.msg.startswith("Expecting ','") and "\n" in text[len(before) : error.pos]:
        return len(before), "a comma is missing here, or a bracket"
    return error.pos, error.msg[0].lower() + error.msg[1:]


def _is_too_deep(text: str) -> bool:
    """Whether a JSON text is nested deeper than DEEPEST. Domain: it has no errors.

    Texts in it may be long, so nothing here goes through their characters one by one.
    """
    # Without escapes, what is outside of quotes is every second part.
    outside = "".join(text.replace(r"\\", "").replace(r"\"", "").split('"')[::2])
    brackets = outside.encode("utf-8", "replace").translate(None, _NO_BRACKETS).translate(_SQUARE)
    for _ in range(DEEPEST):
        if not brackets:
            return False
        brackets = brackets.replace(b"[]", b"")
    return bool(brackets)


def _too_deep(name: str) -> str:
    """Message about a JSON text that is nested too deeply."""
    return f"{name}: is nested deeper than {DEEPEST} objects and lists; no scene needs that"


def wrong_texts(raw: Any, address: str = "") -> list[str]:
    """List with a message for each text in dicts, lists and values that contains half a character, and for each key
    that is no text. Half a character, which Python calls a surrogate, is none, and cannot be written to a file.

    address: address of `raw`, and a dot.
    """
    if isinstance(raw, str):
        half = _HALF.search(raw)
        where = f"{address}{json.dumps(raw)}" if half else ""
        return [f"{where}: \\u{ord(half[0]):x} is half a character; write the whole one"] if half else []
    if isinstance(raw, dict):
        others = [f"{address}{key!r}: is no text; a key is a text" for key in raw if not isinstance(key, str)]
        keys = others + [text for key in raw if isinstance(key, str) for text in wrong_texts(key, address)]
        return keys + [text for key, value in raw.items() for text in wrong_texts(value, f"{address}{key}.")]
    if isinstance(raw, (list, tuple)):
        return [text for i, value in enumerate(raw) for text in wrong_texts(value, f"{address}{i}.")]
    return []


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


def as_surface(text: str) -> str:
    """A hint for a text that is no file, but a formula or the name of a known surface; "" for any other text."""
    if not (_NAME.fullmatch(text) or _FORMULA.fullmatch(text)):
        return ""
    return f'; if it is a formula or a known surface: visray surface "{text}", in Python vr.surface_scene("{text}")'


def neighbour(path: Path, suffixes: Collection[str] | None = None) -> str:
    """Hint at a file with a similar name in the same folder; "" if there is none.

    suffixes: suffixes of the files that may be named, in lower case; None means all files.
    """
    # Names are compared without their suffix, because files of one type all have the same one.
    try:
        readable = (p for p in path.parent.iterdir() if suffixes is None or p.suffix.lower() in suffixes)
        files = {p.stem: p.name for p in readable if p.is_file()}
    except (OSError, ValueError):
        # There is no such folder, or it may not be listed.
        return ""
    similar = get_close_matches(path.stem, files, 1)
    return f"; did you mean {str(path.parent / files[similar[0]])!r}?" if similar else ""
