"""What is wrong with a scene, in one line each: `ADDRESS = VALUE: what is wrong; what would be right`."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, fields, is_dataclass
from difflib import get_close_matches
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import ValidationError

from visray.quantities import Quantity
from visray.scene.scene import Scene
from visray.transforms import STEPS

NAME_RULE = "a name is not empty, has no dot, and has no space at either end"
LONGEST_VALUE = 60


def line(address: str, value: Any, text: str) -> str:
    """`ADDRESS = VALUE: text`, with the value as JSON, cut where it is long."""
    shown = json.dumps(value, ensure_ascii=False, default=str)
    shown = shown if len(shown) <= LONGEST_VALUE else shown[: LONGEST_VALUE - 3] + "..."
    return f"{address} = {shown}: {text}" if address else f"{shown}: {text}"


def printable(text: str) -> str:
    """The text on one line: names and keys from a file may hold line breaks."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def hint(word: Any, choices: Iterable[str], quote: str = '"') -> str:
    """`did you mean "sphere"? (one of ...)`, or only the choices where none is near."""
    choices = list(choices)
    listed = f"one of {', '.join(choices)}" if choices else "there is none"
    near = _near(word, choices) if isinstance(word, str) else []
    return f"did you mean {quote}{near[0]}{quote}? ({listed})" if near else listed


def _near(word: str, choices: list[str]) -> list[str]:
    """The choices that a word may stand for, the likeliest first: `Kd` for `kd`, `radus` for `radius`."""
    return [c for c in choices if c.casefold() == word.casefold()] or get_close_matches(word, choices, 1)


def lines(error: ValidationError, raw: Any) -> list[str]:
    """The errors that pydantic found in `raw`, one line each."""
    found = [(_locate(e["loc"]), e) for e in error.errors(include_url=False)]
    wrong = {b for place, e in found for b in place.branches[-1:] if e["type"].endswith("_type") and place.at(b)}
    fitting = {b.address for place, _ in found for b in place.branches if b not in wrong}
    result = []
    for place, e in found:
        misfit = next((b for b in place.branches if b in wrong), None)
        if misfit and misfit.address in fitting:
            continue
        result.append(_expected(misfit.address, misfit.union, raw) if misfit else _described(place, e, raw))
    return list(dict.fromkeys(result))


@dataclass(frozen=True)
class _Branch:
    """A member of a union that pydantic tried: the union's address, the union, and pydantic's name of the member."""

    address: tuple
    union: Any
    tag: str


@dataclass(frozen=True)
class _Place:
    """Where an error lies: its address, the type declared there and that of its owner, the union members on the way."""

    address: tuple
    annotation: Any
    parent: Any
    branches: tuple[_Branch, ...]

    def at(self, branch: _Branch) -> bool:
        return self.address == branch.address


def _locate(loc: tuple) -> _Place:
    """The place of an error from pydantic's location, which names the members of unions among the keys."""
    address, branches, annotation, parent = (), (), Scene, None
    for part in loc:
        if part == "[key]":
            break  # the name itself is wrong
        optional = [m for m in members_of(bare(annotation)) if bare(m) is not NoneType]
        if is_union(bare(annotation)) and len(optional) == 1:
            annotation = optional[0]  # which pydantic does not name
        if is_union(bare(annotation)):
            branches += (_Branch(address, annotation, part),)
            annotation = _member(bare(annotation), part)
        else:
            address, parent, annotation = (*address, part), annotation, _child(bare(annotation), part)
    return _Place(address, annotation, parent, branches)


def bare(annotation: Any) -> Any:
    """The type without what Annotated adds."""
    return bare(get_args(annotation)[0]) if get_origin(annotation) is Annotated else annotation


def is_union(annotation: Any) -> bool:
    """Whether a bare type is a union."""
    return get_origin(annotation) in (Union, UnionType)


def members_of(union: Any) -> list[Any]:
    """The members of a bare union, and of unions in it."""
    inner = [(m, bare(m)) for m in get_args(union)]
    return [x for m, plain in inner for x in (members_of(plain) if is_union(plain) else [m])]


def tag_of(kind: type) -> str:
    """The name of a kind in a union: its `type` in files, or else its class."""
    return next((f.default for f in fields(kind) if f.name == "type"), kind.__name__)


def _member(union: Any, tag: str) -> Any:
    """The member of a union that pydantic calls `tag`."""
    members = members_of(union)
    kinds = [m for m in members if is_dataclass(bare(m)) and tag in (tag_of(bare(m)), bare(m).__name__)]
    others = [m for m in members if not is_dataclass(bare(m))]
    alike = [m for m in others if (get_origin(bare(m)) is tuple) == tag.startswith("tuple")]
    return (kinds + alike + others)[0]


def _child(annotation: Any, part: Any) -> Any:
    """The type declared for a key or an index, or None if there is no such key."""
    if is_dataclass(annotation):
        return next((f.type for f in fields(annotation) if f.name == part), None)
    args = get_args(annotation)
    if get_origin(annotation) is dict:
        return args[1]
    if get_origin(annotation) is tuple:
        return args[0] if args[-1] is Ellipsis else args[part] if isinstance(part, int) and part < len(args) else None
    return None


def _value(raw: Any, address: tuple) -> Any:
    for part in address:
        raw = raw[part]
    return raw


def _dotted(address: tuple) -> str:
    return ".".join(map(str, address))


def _expected(address: tuple, annotation: Any, raw: Any) -> str:
    return line(_dotted(address), _value(raw, address), f"must be {describe(annotation)}")


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


def _described(place: _Place, e: dict, raw: Any) -> str:
    """One error of pydantic in our words."""
    kind, address = e["type"], place.address
    if e["loc"][-1:] == ("[key]",):
        return f"{_dotted(address[:-1])}: {json.dumps(address[-1], default=str)} is not a valid name; {NAME_RULE}"
    if kind == "unexpected_keyword_argument":
        return f"{_dotted(address)}: unknown key; {_known(place)}"
    if kind == "missing" and isinstance(address[-1], str):
        return _absent(place)
    if kind == "missing":
        return _expected(address[:-1], place.parent, raw)
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        return _untagged(place, raw)
    if kind == "literal_error":
        word = "type" if address[-1] == "type" else "value"
        return line(_dotted(address), e["input"], f"unknown {word}; {hint(e['input'], get_args(place.annotation))}")
    if kind not in _BOUNDS:
        return _expected(address, place.annotation, raw)
    context = {k: f"{v:g}" if isinstance(v, float) else v for k, v in e.get("ctx", {}).items()}
    return line(_dotted(address), _value(raw, address), _BOUNDS[kind].format_map(context))


def _known(place: _Place) -> str:
    key, owner = place.address[-1], bare(place.parent)
    if owner in STEPS.values() and key in STEPS:
        return f"a step has only one of {', '.join(STEPS)}; write two steps"
    return hint(key, [f.name for f in sorted(fields(owner), key=lambda f: f.name != "type")], "'")


def _absent(place: _Place) -> str:
    owner, key = _dotted(place.address[:-1]), place.address[-1]
    return f"{owner}: the key '{key}' is missing; it is {describe(place.annotation)}"


def _untagged(place: _Place, raw: Any) -> str:
    """A value of a union whose member is named by a key: the key is missing or wrong, or the value has no keys."""
    value, address = _value(raw, place.address), _dotted(place.address)
    members = [m for m in map(bare, members_of(bare(place.annotation))) if is_dataclass(m)]
    if not isinstance(value, dict):
        return _expected(place.address, place.annotation, raw)
    if members[0] in STEPS.values():
        return line(address, value, f"unknown step; it has one of the keys {', '.join(STEPS)}")
    names = [tag_of(m) for m in members]
    if "type" not in value:
        return f"{address}: the key 'type' is missing; one of {', '.join(names)}"
    return line(f"{address}.type", value["type"], f"unknown type; {hint(value['type'], names)}")


def describe(annotation: Any) -> str:
    """What a value of a type looks like in a file."""
    marks = [m for m in getattr(annotation, "__metadata__", ()) if isinstance(m, Quantity)]
    if marks:
        return f"{'a number' if marks[0].size == 1 else f'{marks[0].size} numbers'} ({marks[0].unit})"
    annotation = bare(annotation)
    if is_union(annotation):
        return _described_union(members_of(annotation))
    if is_dataclass(annotation):
        return f"an object {{...}} with the keys {', '.join(f.name for f in fields(annotation))}"
    args, origin = get_args(annotation), get_origin(annotation)
    if origin is Literal:
        return f"one of {', '.join(args)}"
    if origin is tuple and args[-1] is not Ellipsis:
        inner = bare(args[0])
        return f"{len(args)} numbers" if inner is float else f"{len(args)} lists of {len(get_args(inner))} numbers"
    return _PLAIN[origin or annotation]


_PLAIN = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a string",
    NoneType: "null",
    tuple: "a list [...]",
    dict: "an object {...} that gives each thing its name",
}


def _described_union(members: list) -> str:
    kinds = [bare(m) for m in members if bare(m) is not NoneType]
    if len(kinds) > 1 and len(kinds) < len(members):
        return f"{_described_union(kinds)}, or null"
    if all(k in STEPS.values() for k in kinds):
        return f"an object {{...}} with one of the keys {', '.join(STEPS)}"
    if all(is_dataclass(k) for k in kinds):
        return f"an object {{...}} with a type: one of {', '.join(map(tag_of, kinds))}"
    return " or ".join(map(describe, members))
