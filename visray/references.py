"""References: fields of records that hold the names of entries of a scene, such as `Sphere.material`.

In Python, such a field may hold the entry itself. A scene gives it a name (scene/naming.py).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, get_args

from visray.operands import ROLES, named_operands
from visray.quantities import Name


@dataclass(frozen=True)
class Reference:
    """Marks the type of a field that holds the name of an entry of a scene.

    section: the section of the scene that has the entry. Classes of its entries have an attribute `section`.
    """

    section: str


MaterialName = Annotated[Name, Reference("materials")]
TextureName = Annotated[Name, Reference("textures")]
GeometryName = Annotated[Name, Reference("geometries")]


def reference_of(annotation: Any) -> str | None:
    """The section to which a field of this type refers; None if it does not refer to entries."""
    marks = [m for m in getattr(annotation, "__metadata__", ()) if isinstance(m, Reference)]
    if marks:
        return marks[0].section
    return next((s for a in get_args(annotation) if (s := reference_of(a)) is not None), None)


@cache
def references(kind: type) -> dict[str, str]:
    """The fields of a kind that refer to entries, each with the section of these; {} for what is no record."""
    own = fields(kind) if hasattr(kind, "__dataclass_fields__") else ()
    return {f.name: section for f in own if (section := reference_of(f.type)) is not None}


@cache
def roles_of(kind: type) -> tuple[str, ...]:
    """The fields of a kind that hold operands."""
    return tuple(role for role in ROLES if role in getattr(kind, "__dataclass_fields__", {}))


def operands_of(record: Any) -> Iterator[tuple[str, str, Any]]:
    """Yields the field, the name and the operand for each operand of a record."""
    for role in roles_of(type(record)):
        if isinstance(operands := getattr(record, role), (list, tuple, dict)):
            yield from ((role, name, x) for name, x in named_operands(operands).items())


@cache
def _fields_to_ask(kind: type) -> tuple[str, ...]:
    """The fields of a kind that may have entries: references and operands."""
    return (*references(kind), *roles_of(kind))


def first_with_entries(records: Iterable[Any]) -> Any | None:
    """The first of some records that has an entry in place of a name; None if there is none. It is fast for records
    whose fields hold names alone."""
    for record in records:
        for name in _fields_to_ask(type(record)):
            value = getattr(record, name)
            if value is not None and type(value) is not str and has_entries(record):
                return record
    return None


def has_entries(record: Any) -> bool:
    """Whether a record, or one of its operands at any depth, has an entry in place of a name."""
    left, seen = [record], set()
    while left:
        one = left.pop()
        if any(not isinstance(getattr(one, name), (str, type(None))) for name in references(type(one))):
            return True
        if roles_of(type(one)) and id(one) not in seen:
            seen.add(id(one))  # a list may contain itself
            left += [x for _, _, x in operands_of(one)]
    return False


def is_entry(value: Any, section: str | None) -> bool:
    """Whether a value is an entry of a section. section: None for a field that refers to none."""
    return section is not None and getattr(type(value), "section", None) == section


def contains_entries(value: Any) -> bool:
    """Whether a value has an entry in place of a name: a record, or a list or dict of records."""
    if isinstance(value, dict):
        return any(map(contains_entries, value.values()))
    return any(map(contains_entries, value)) if isinstance(value, (list, tuple)) else has_entries(value)
