"""The continuous values of a scene: their addresses, and what their fields may contain."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, NamedTuple, get_args

from visray.data.rows import Rows
from visray.quantities import NOT_ZERO, Quantity
from visray.scene.annotations import bare, child, is_union, members_of, tag_of
from visray.scene.edits import entry_of
from visray.scene.scene import Scene


@dataclass(frozen=True)
class Limits:
    """What a field may contain.

    least, most: smallest and largest number; infinite where there is no limit
    open_least, open_most: whether these two are refused themselves
    quantity: size, precision and unit; None for numbers that enter no kernel as they are
    not_zero: whether three numbers must not all be 0
    """

    least: float = -math.inf
    most: float = math.inf
    open_least: bool = False
    open_most: bool = False
    quantity: Quantity | None = None
    not_zero: bool = False

    @property
    def unit(self) -> str:
        """Unit and limits in words; "" if nothing is known."""
        return self.quantity.unit if self.quantity else ""


class Field(NamedTuple):
    """A field of a scene. value: what it contains. annotation: its type, as it is declared. owner: the record that has
    the field, and for a number of a list the record that has the list."""

    value: Any
    annotation: Any
    owner: Any


def numbers_of(value: Any) -> tuple[float, ...]:
    """The numbers of a continuous value, which is one number or consists of two or three; none for any other value."""
    if type(value) is float:
        return (value,)
    is_numbers = type(value) is tuple and len(value) in (2, 3) and all(type(x) is float for x in value)
    return value if is_numbers else ()


def addresses(scene: Scene) -> Iterator[str]:
    """Yields the address of each continuous value of a scene, in the order of a file. Values that are null are left
    out. Rows of data are left out, too: `row_addresses` has these."""
    for f in fields(scene):
        if f.name not in ("film", "animation"):
            yield from _below(getattr(scene, f.name), f.name)


def _below(node: Any, address: str) -> Iterator[str]:
    """Yields the addresses of the continuous values at and below an address. node: what is there."""
    if numbers_of(node):
        yield address
    elif is_dataclass(node):
        for f in fields(node):
            yield from _below(getattr(node, f.name), f"{address}.{f.name}")
    elif isinstance(node, dict):
        for key, part in node.items():
            yield from _below(part, f"{address}.{key}")
    elif type(node) is tuple:
        for i, part in enumerate(node):
            yield from _below(part, f"{address}.{i}")


def row_addresses(layer: str, rows: Rows) -> Iterator[tuple[str, str]]:
    """Yields the address of each number of the rows of a layer of data, with the name of the row, or "". Rows that the
    date hides are left out."""
    for i, number in zip(rows.first.tolist(), rows.number[rows.first].tolist()):
        if not rows.hidden[i]:
            name = "" if rows.texts is None else str(rows.texts[i])
            yield from ((f"data.{layer}.{number}.{key}", name) for key in rows.values)


def field_at(scene: Scene, address: str) -> Field | None:
    """The field at an address; None if the scene has none there."""
    found = Field(scene, Scene, scene)
    for key in address.split("."):
        value, annotation, owner = found
        try:
            part = entry_of(value, key)
        except (AttributeError, KeyError, IndexError, ValueError, TypeError):
            return None
        if is_dataclass(value):
            owner = value
            declared = next(f.type for f in fields(value) if f.name == key)
        else:
            declared = _part(annotation, value, int(key) if type(value) is tuple else key)
        found = Field(part, declared, owner)
    return found


def _part(annotation: Any, value: Any, key: str | int) -> Any:
    """The type of a part of a value; None if it is not known. annotation: type of the value."""
    kind = bare(annotation)
    for member in members_of(kind) if is_union(kind) else (kind,):
        if annotation is not None and _fits(bare(member), value) and (found := child(bare(member), key)) is not None:
            return found
    return None


def _fits(kind: Any, value: Any) -> bool:
    """Whether a value may be one of a bare type."""
    if is_dataclass(kind):
        return type(value) is kind or (is_dataclass(value) and tag_of(kind) == getattr(value, "type", None))
    args = get_args(kind)
    if type(value) is tuple:
        return bool(args) and (args[-1] is Ellipsis or len(args) == len(value))
    return (bool(args) and isinstance(value, dict)) or kind is type(value)


def limits(annotation: Any, value: Any) -> Limits:
    """What a field may contain. annotation: type of the field. value: what it contains, which says which part of a
    union counts."""
    found, kind = _marked(Limits(), annotation), bare(annotation)
    if is_union(kind):
        fitting = [m for m in members_of(kind) if _fits(bare(m), value)]
        return _merged(found, limits(fitting[0], value)) if fitting else found
    inner = get_args(kind)
    return _merged(found, limits(inner[0], value[0])) if type(value) is tuple and inner else found


def _marked(found: Limits, annotation: Any) -> Limits:
    """Limits with what the marks of an annotation say."""
    for mark in getattr(annotation, "__metadata__", ()):
        if isinstance(mark, Quantity):
            found = replace(found, quantity=mark)
        found = replace(found, not_zero=found.not_zero or mark is NOT_ZERO)
        for rule in getattr(mark, "metadata", ()):
            for name, is_open in (("ge", False), ("gt", True)):
                if (bound := getattr(rule, name, None)) is not None and bound >= found.least:
                    found = replace(found, least=float(bound), open_least=is_open)
            for name, is_open in (("le", False), ("lt", True)):
                if (bound := getattr(rule, name, None)) is not None and bound <= found.most:
                    found = replace(found, most=float(bound), open_most=is_open)
    return found


def _merged(outer: Limits, inner: Limits) -> Limits:
    """The narrower limits of a list and of its numbers."""
    result = replace(inner, quantity=outer.quantity or inner.quantity, not_zero=outer.not_zero or inner.not_zero)
    if outer.least > inner.least:
        result = replace(result, least=outer.least, open_least=outer.open_least)
    return replace(result, most=outer.most, open_most=outer.open_most) if outer.most < inner.most else result
