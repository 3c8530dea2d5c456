"""Error messages about scenes, one line each: `ADDRESS = VALUE: what is wrong; what would be right`.

An address is the dotted name of a value in a scene, such as `objects.ball.radius`. Inside this module it is a tuple of
keys.
"""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, is_dataclass
from itertools import islice
from types import NoneType
from typing import Any, get_args, get_origin

from pydantic import ValidationError

from visray.data.layer import ROW_NUMBER
from visray.hints import hint
from visray.number_table import NumberTable
from visray.primitives.csg import Csg
from visray.primitives.instance import Instance
from visray.records import Words
from visray.scene.annotations import bare, child, describe, inputs, is_union, member, members_of, tag_of
from visray.scene.scene import Scene
from visray.scene.source import wrong_texts
from visray.scene.validated import plain
from visray.terminal import printable
from visray.transforms import STEPS

UNDER_MATERIALS = "write {} under materials, and its name here"
NAME_RULE = "a name is not empty, has no dot, and has no space at either end"
ROW_RULE = 'rows are counted from 0, as in {"12": {"lon": 2.2}}'
OPERATIONS = get_args(Csg.__dataclass_fields__["op"].type)
# Other words for operations, and the names that these have here.
OTHER_WORDS = {
    **dict.fromkeys(("add", "plus", "or", "join"), "union"),
    **dict.fromkeys(("and", "intersect", "common"), "intersection"),
    **dict.fromkeys(("subtract", "subtraction", "minus", "cut", "not"), "difference"),
}
LONGEST_VALUE = 60
# Largest number of errors of one scene that are reported.
MOST = 50


def line(address: str, value: Any, text: str) -> str:
    """The message `ADDRESS = VALUE: text`. The value is written as JSON, and cut if it is long, unless it is a path."""
    table = isinstance(value, NumberTable)
    shown = str(value) if table else json.dumps(value, ensure_ascii=False, default=str)
    is_path = isinstance(value, str) and address.endswith((".file", ".source"))
    shown = shown if len(shown) <= LONGEST_VALUE or is_path else shown[: LONGEST_VALUE - 3] + "..."
    return f"{address} = {shown}: {text}" if address else f"{shown}: {text}"


def limited(texts: Iterable[str]) -> list[str]:
    """List of the first messages, as many as a user can read, with a last one if there are more."""
    first = list(islice(texts, MOST + 1))
    return first if len(first) <= MOST else [*first[:MOST], f"there are more than {MOST} errors; correct these first"]


def lines(error: ValidationError, raw: Any, root: type = Scene) -> list[str]:
    """List of messages, one for each error that pydantic reports.

    raw: the scene, as dicts and lists.
    root: the class of `raw`, if it is another record than a scene.

    If a value fits no member of a union, pydantic reports an error for each member. Here this becomes one message about
    the union. If a member fits by its type, only the errors inside this member are reported.
    """
    located = [(_locate(e["loc"], root), e) for e in error.errors(include_url=False)]
    misfits = {b for place, e in located for b in place.branches[-1:] if _is_type_error(e) and place.at(b)}
    fitting = {b.address for place, _ in located for b in place.branches if b not in misfits}
    texts = []
    for place, e in located:
        misfit = next((b for b in place.branches if b in misfits), None)
        if misfit and misfit.address in fitting:
            continue
        texts.append(_type_message(misfit.address, misfit.union, raw) if misfit else _message(place, e, raw))
    return list(dict.fromkeys(texts))


def record_lines(kind: type, error: ValidationError, given: dict[str, Any]) -> list[str]:
    """List of messages about a record that Python makes: `Sphere: radius = -1: must be greater than 0`.

    given: the values by name.
    """
    given = plain(given)
    texts = wrong_texts(given) or limited(lines(error, given, kind))
    return [printable(f"{kind.__name__}: {_in_python(text)}") for text in texts]


def _in_python(text: str) -> str:
    """A message whose advice writes fields as Python does: kd=[1, 0, 0] in place of "kd": [1, 0, 0]."""
    said, write, advice = text.partition("write ")
    return said + write + re.sub(r'"(\w+)": (?=["\[])', r"\1=", advice)


Words.lines = record_lines


def _is_type_error(e: dict) -> bool:
    """Whether an error of pydantic says that a value has a wrong type: a list in place of a word, for example."""
    return e["type"].endswith("_type") or (e["type"] == "literal_error" and not isinstance(e["input"], str))


@dataclass(frozen=True)
class _Branch:
    """A member of a union that pydantic tried for a value.

    address: address of the value.
    union: the union, which is the declared type of the value.
    tag: pydantic's name of the member.
    """

    address: tuple
    union: Any
    tag: str


@dataclass(frozen=True)
class _Place:
    """The place of an error.

    address: address of the wrong value.
    annotation: the type declared for the value, or None if its key is unknown.
    parent: the type of the record, dict or list that contains the value.
    branches: the members of unions that lie on the path from the scene to the value.
    """

    address: tuple
    annotation: Any
    parent: Any
    branches: tuple[_Branch, ...]

    def at(self, branch: _Branch) -> bool:
        """Whether the wrong value is the branch's value itself, and not a part of it."""
        return self.address == branch.address


def _locate(loc: tuple, root: type = Scene) -> _Place:
    """Place of an error.

    loc: pydantic's location of the error: a tuple of keys, with the names of union members among them.
    root: the class of what was checked.
    """
    address, branches, annotation, parent = (), (), root, None
    for part in loc:
        if part == "[key]":
            break  # the error is in the key itself, which is a name
        optional = [m for m in members_of(bare(annotation)) if bare(m) is not NoneType]
        if is_union(bare(annotation)) and len(optional) == 1:
            annotation = optional[0]  # pydantic does not name the member of an optional type
        if is_union(bare(annotation)) and isinstance(part, str):
            branches += (_Branch(address, annotation, part),)
            annotation = member(bare(annotation), part)
        else:
            address, parent, annotation = (*address, part), annotation, child(bare(annotation), part)
    return _Place(address, annotation, parent, branches)


def _value(raw: Any, address: tuple) -> Any:
    """Value at an address. A number that stands for several, such as the scale of a texture, is the value of each."""
    for part in address:
        raw = raw[part] if isinstance(raw, (dict, list, tuple)) else raw
    return raw


def _dotted(address: tuple) -> str:
    """An address as text, such as `objects.ball.radius`."""
    return ".".join(map(str, address))


def _type_message(address: tuple, annotation: Any, raw: Any) -> str:
    """Message about a value of a wrong type. `annotation`: the right type."""
    value = _value(raw, address)
    named = isinstance(value, list) and value and get_origin(bare(annotation)) is dict
    example = ', such as {"NAME": {...}}' if named else ""
    if address[-1:] in (("material",), ("cut_material",)):
        way = f"; {UNDER_MATERIALS.format('it')}" if isinstance(value, dict) and "type" not in value else ""
        return line(_dotted(address), value, f"must be the name of a material{way}")
    if isinstance(value, dict) and value and address[-1:] == ("transform",):
        example = "; write [{...}]"
    return line(_dotted(address), value, f"must be {describe(annotation)}{example}")


# Messages for pydantic's types of errors. The names in braces stand for values that the error contains.
_BOUNDS = {
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le}",
    "finite_number": "must be finite",
    "string_pattern_mismatch": NAME_RULE,
    "string_too_short": "must not be empty",
    "value_error": "{error}",
}


def _message(place: _Place, e: dict, raw: Any) -> str:
    """visray's message for an error of pydantic."""
    kind, address = e["type"], place.address
    if e["loc"][-1:] == ("[key]",):
        of_row = e.get("ctx", {}).get("pattern") == ROW_NUMBER
        rule = f"the number of a row; {ROW_RULE}" if of_row else f"a valid name; {NAME_RULE}"
        return f"{_dotted(address[:-1])}: {json.dumps(address[-1], default=str)} is not {rule}"
    if kind == "unexpected_keyword_argument":
        instead = getattr(bare(place.parent), "MISPLACED", {}).get(address[-1])
        if instead:
            return line(_dotted(address), e["input"], instead)
        return f"{_dotted(address)}: unknown key; {_key_hint(place, e['input'], raw)}"
    if kind == "missing" and isinstance(address[-1], str):
        return _missing_message(place)
    if kind == "missing":
        return _type_message(address[:-1], place.parent, raw)
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        return _tag_message(place, raw)
    if kind == "literal_error":
        word = "type" if address[-1] == "type" else "value"
        choices = [c if isinstance(c, str) else json.dumps(c) for c in get_args(place.annotation)]
        words = [part.strip() for part in e["input"].split(",")] if isinstance(e["input"], str) else []
        if len(words) > 1 and set(words) <= set(choices):
            return line(_dotted(address), e["input"], f"several values are a list; write {json.dumps(words)}")
        word_given = isinstance(e["input"], str) and address[-1] == "op"
        meant = OTHER_WORDS.get(e["input"].casefold(), e["input"]) if word_given else e["input"]
        return line(_dotted(address), e["input"], f"unknown {word}; {hint(meant, choices)}")
    if kind not in _BOUNDS:
        return _type_message(address, place.annotation, raw)
    context = {k: f"{v:g}" if isinstance(v, float) else v for k, v in e.get("ctx", {}).items()}
    return line(_dotted(address), _value(raw, address), _BOUNDS[kind].format_map(context))


def _key_hint(place: _Place, value: Any, raw: Any) -> str:
    """Hint at the keys that may replace an unknown key.

    place: place of the unknown key. value: its value. raw: the scene, as dicts and lists.
    """
    key, owner = place.address[-1], bare(place.parent)
    if owner in STEPS.values() and key in STEPS:
        return f"a step has only one of {', '.join(STEPS)}; write two steps"
    names = sorted(inputs(owner), key=lambda name: name != "type")
    if key in STEPS and "transform" in names:
        step = json.dumps({key: value}, default=str)
        return f'write "transform": [{step if len(step) <= LONGEST_VALUE else f"{{{json.dumps(key)}: ...}}"}]'
    if owner is Csg and isinstance(value, list | tuple | dict) and "of" not in _value(raw, place.address[:-1]):
        key = "of"  # the operands are missing, and this must be meant to be these
    return hint(key, names, "'")


def _missing_message(place: _Place) -> str:
    """Message about a missing key."""
    owner, key = _dotted(place.address[:-1]), place.address[-1]
    return f"{owner}: the key '{key}' is missing; it is {describe(place.annotation)}"


def _tag_message(place: _Place, raw: Any) -> str:
    """Message about a value of a union in which one key, such as `type`, tells the member. The key is missing or wrong,
    or the value is not a JSON object."""
    value, address = _value(raw, place.address), _dotted(place.address)
    members = [m for m in map(bare, members_of(bare(place.annotation))) if is_dataclass(m)]
    if not isinstance(value, dict):
        return _type_message(place.address, place.annotation, raw)
    if not members:
        return line(address, value, f"must be {describe(place.annotation)}; write [{{...}}]")
    if members[0] in STEPS.values():
        return line(address, value, f"unknown step; it has one of the keys {', '.join(STEPS)}")
    names = [tag_of(m) for m in members]
    if value.get("type") == Instance.type and place.address[0] == "geometries":
        return line(f"{address}.type", value["type"], "a geometry cannot be an instance; write the shape itself")
    if "type" not in value:
        return f"{address}: the key 'type' is missing; one of {', '.join(names)}"
    word = value["type"]
    op = OTHER_WORDS.get(word, word) if isinstance(word, str) else word
    if Csg in members and op in OPERATIONS:
        return line(f"{address}.type", word, f'unknown type; write "type": "csg", "op": "{op}"')
    return line(f"{address}.type", word, f"unknown type; {hint(word, names)}")
