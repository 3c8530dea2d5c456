"""Type annotations of scene fields: their parts, and their description in words for error messages.

A bare type is a type without Annotated around it, and without a name of its own. A kind is a dataclass of the scene,
such as Sphere.
"""

from dataclasses import InitVar, fields, is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import Tag
from typing_extensions import TypeAliasType

from visray.colors import TEXTS as COLOR_TEXTS
from visray.data.number_column import NumberColumn
from visray.data.time_column import TimeColumn
from visray.operands import OperandsRule
from visray.quantities import ColorMark, Quantity
from visray.transforms import STEPS


def bare(annotation: Any) -> Any:
    """The type inside Annotated, or for which a name stands; the annotation itself if it is neither."""
    if isinstance(annotation, TypeAliasType):
        return bare(annotation.__value__)
    if get_origin(annotation) is not Annotated:
        return annotation
    rule = _operands_rule(annotation)
    return bare(get_args(annotation)[0] if rule is None else rule.type())


def _is_color(annotation: Any) -> bool:
    """Whether a type is that of a colour, which may be spelled as text."""
    return any(isinstance(m, ColorMark) for m in getattr(annotation, "__metadata__", ()))


def _operands_rule(annotation: Any) -> OperandsRule | None:
    """The rule of a field that holds operands; None for any other type."""
    return next((m for m in getattr(annotation, "__metadata__", ()) if isinstance(m, OperandsRule)), None)


def is_union(annotation: Any) -> bool:
    """Whether a bare type is a union."""
    return get_origin(annotation) in (Union, UnionType)


def members_of(union: Any) -> list[Any]:
    """List of the members of a bare union. A member that is a union itself is replaced by its own members."""
    inner = [(m, bare(m)) for m in get_args(union)]
    return [x for m, bare_type in inner for x in (members_of(bare_type) if is_union(bare_type) else [m])]


def tag_of(kind: type) -> str:
    """Name of a kind in a union: its `type` in files, or the name of its class if it has no field `type`."""
    return next((f.default for f in fields(kind) if f.name == "type"), kind.__name__)


def member(union: Any, tag: str) -> Any:
    """The member of a bare union that fits a name best.

    tag: name that pydantic gives a member in its errors, such as "sphere" or "tuple[...]".
    """
    members = members_of(union)
    tagged = [m for m in members if Tag(tag) in getattr(m, "__metadata__", ())]
    kinds = [m for m in members if is_dataclass(bare(m)) and tag in (tag_of(bare(m)), bare(m).__name__)]
    not_kinds = [m for m in members if not is_dataclass(bare(m))]
    same_shape = [m for m in not_kinds if (get_origin(bare(m)) is tuple) == tag.startswith("tuple")]
    same_entries = [m for m in same_shape if tag.startswith(_beginning(bare(m)))]
    return (tagged + kinds + same_entries + same_shape + not_kinds)[0]


def _beginning(annotation: Any) -> str:
    """First words of pydantic's name of a bare type, down to the first that is no tuple and no union."""
    if is_union(annotation):
        return "union["
    return f"tuple[{_beginning(bare(get_args(annotation)[0]))}" if get_origin(annotation) is tuple else ""


def inputs(kind: type) -> list[str]:
    """Names of all that may be written for a kind: its fields, and what is given in place of them."""
    own = kind.__dataclass_fields__.values()
    return [f.name for f in own if isinstance(f.type, InitVar)] + [f.name for f in fields(kind)]


def child(annotation: Any, part: Any) -> Any:
    """The type declared for a part of a bare type, or None if the type has no such part.

    part: name of a field, key of a dict, or index in a tuple.
    """
    if is_dataclass(annotation):
        return next((f.type for f in fields(annotation) if f.name == part), None)
    args = get_args(annotation)
    if get_origin(annotation) is dict:
        return args[1]
    if get_origin(annotation) is tuple:
        return args[0] if args[-1] is Ellipsis else args[part] if isinstance(part, int) and part < len(args) else None
    return None


def describe(annotation: Any) -> str:
    """Words for what a file must contain for a value of a type, such as `3 numbers (world units)`."""
    marks = [m for m in getattr(annotation, "__metadata__", ()) if isinstance(m, Quantity)]
    if marks:
        numbers = f"{'a number' if marks[0].size == 1 else f'{marks[0].size} numbers'} ({marks[0].unit})"
        return f"a colour: {COLOR_TEXTS}, a number, or {numbers}" if _is_color(annotation) else numbers
    if _operands_rule(annotation) is not None:
        return "a list of objects, or objects by name"
    annotation = bare(annotation)
    if is_union(annotation):
        return _describe_union(members_of(annotation))
    if is_dataclass(annotation):
        return f"an object {{...}} with the keys {', '.join(inputs(annotation))}"
    args, origin = get_args(annotation), get_origin(annotation)
    if origin is Literal:
        return f"one of {', '.join(args)}"
    if origin is tuple and args[-1] is not Ellipsis:
        inner = bare(args[0])
        if get_origin(inner) is Literal:
            return f"a list of {len(args)} of {', '.join(get_args(inner))}"
        if inner is int:
            return f"{len(args)} whole numbers"
        return f"{len(args)} numbers" if inner is float else f"{len(args)} lists of {len(get_args(inner))} numbers"
    return _JSON_NAMES[origin or annotation]


# Descriptions of types by their name alone.
_JSON_NAMES = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a string",
    NumberColumn: "a list of numbers",
    TimeColumn: "a list of dates or numbers",
    NoneType: "null",
    tuple: "a list [...]",
    dict: "an object {...} that holds entries by name",
}


def _describe_union(members: list) -> str:
    """Words for what a file must contain for a value of a union.

    members: the types in the union.
    """
    kinds = [bare(m) for m in members if bare(m) is not NoneType]
    if len(kinds) > 1 and len(kinds) < len(members):
        return f"{_describe_union(kinds)}, or null"
    if len(kinds) == 1 and is_dataclass(kinds[0]):
        return f"{describe(kinds[0])}, or null"
    if all(k in STEPS.values() for k in kinds):
        return f"an object {{...}} with one of the keys {', '.join(STEPS)}"
    if all(is_dataclass(k) for k in kinds):
        return f"an object {{...}} with a type: one of {', '.join(map(tag_of, kinds))}"
    return " or ".join(map(describe, members))
