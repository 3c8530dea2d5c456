"""Names for entries of a scene that Python gives in place of names: `vr.Sphere(material=vr.Material(...))`.

An entry is a texture, a material, a geometry, an object or a light. Scenes hold each entry once, under a name, and
other entries refer to it by this name (records.Reference). An entry that is given in place of a name gets the name of
what shows it, and equal entries share one name.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import wraps
from typing import Any

from visray.hints import hint
from visray.operands import like_operands
from visray.references import first_with_entries, has_entries, is_entry, operands_of, references, roles_of

# Sections whose entries other entries refer to, and those whose entries refer to others.
REFERRED = ("textures", "materials", "geometries")
REFERRING = ("materials", "geometries", "objects")
# Sections that may be a list in Python: nothing refers to their entries by name.
LISTED = ("objects", "lights")
# What the name of an entry in one of these fields ends with, after the name of what shows it.
ENDINGS = {"cut_material": " cut", "back": " back"}
# An object that names no material has the one with this name, so no other entry gets it.
RESERVED = "default"


def with_named_entries(kind: type) -> type:
    """Decorator of the class of scenes: in what `__init__` is given, lists become dicts by name, and entries in place
    of names get names."""
    plain_init = kind.__init__

    @wraps(plain_init)
    def __init__(self: Any, **given: Any) -> None:
        names = kind.__dataclass_fields__
        if unknown := [name for name in given if name not in names]:
            name, part = unknown[0], kind.OWNERS.get(unknown[0])
            right = f"write {part}=vr.{part.title()}({name}=...)" if part else hint(name, names, "'")
            raise TypeError(f"{kind.__name__}() has no {name!r}; {right}")
        plain_init(self, **named(given))

    kind.__init__ = __init__
    return kind


def named(given: dict[str, Any]) -> dict[str, Any]:
    """The parts of a scene by name, with names in place of entries. Parts that are no dicts stay as they are, since the
    check of the scene says what is wrong with them."""
    lists = {name: _by_type(given[name]) for name in LISTED if isinstance(given.get(name), (list, tuple))}
    given = given | lists if lists else given
    if not all(isinstance(given.get(name, {}), dict) for name in REFERRED):
        return given
    entries = (x for section in REFERRING for _, x in _entries(given, section))
    data = given.get("data")
    if first_with_entries(entries) is None and first_with_entries(_parts_of(data).values()) is None:
        return given
    namer = _Namer({name: given.get(name, {}) for name in REFERRED})
    for section in REFERRING:
        for name, entry in _entries(given, section):
            if has_entries(entry):
                new = namer.without_entries(entry, str(name))
                own = namer.sections if section in REFERRED else (given := dict(given))
                own[section] = {**own[section], name: new}
    for part, record in _parts_of(data).items():
        if has_entries(record):
            new = namer.without_entries(record, part)
            layers = data.layers | {part: new} if part in data.layers else data.layers
            data = replace(data, layers=layers, base=data.base if part in data.layers else new)
    return given | namer.sections | ({"data": data} if data is not None else {})


def _entries(given: dict[str, Any], section: str) -> list[tuple[str, Any]]:
    """Names and entries of a section; none if it is no dict."""
    own = given.get(section)
    return list(own.items()) if isinstance(own, dict) else []


def _by_type(entries: list | tuple) -> dict[str, Any]:
    """Entries of a list by names: their type, such as `sphere`, and from the second of a type on its number, as in
    `sphere2`."""
    counts: Counter[str] = Counter()
    found = {}
    for entry in entries:
        kind = entry.get("type") if isinstance(entry, dict) else getattr(entry, "type", None)
        kind = kind if isinstance(kind, str) else type(entry).__name__.lower()
        counts[kind] += 1
        found[kind if counts[kind] == 1 else f"{kind}{counts[kind]}"] = entry
    return found


def _parts_of(data: Any) -> dict[str, Any]:
    """The parts of a scene's data that refer to entries, by name: its layers, and its base."""
    layers = getattr(data, "layers", None)
    base = {"base": data.base} if hasattr(data, "base") else {}
    return base | (dict(layers) if isinstance(layers, Mapping) else {})


class _Namer:
    """Gives names to entries.

    sections: the sections of a scene that are referred to, with the entries that got names
    """

    def __init__(self, sections: dict[str, Any]):
        self.sections = sections

    def without_entries(self, record: Any, name: str) -> Any:
        """A record with names in place of entries. name: what the names of its entries begin with."""
        changes: dict[str, Any] = {}
        for field, section in references(type(record)).items():
            entry = getattr(record, field)
            if is_entry(entry, section):
                changes[field] = self._name_of(section, entry, name + ENDINGS.get(field, ""))
        for role in roles_of(type(record)):
            own = {key: x for r, key, x in operands_of(record) if r == role}
            if any(map(has_entries, own.values())):
                new = {key: self.without_entries(x, f"{name} {key}") for key, x in own.items()}
                changes[role] = like_operands(new, getattr(record, role))
        return _with_fields(record, changes) if changes else record

    def _name_of(self, section: str, entry: Any, wish: str) -> str:
        """The name of an entry, which the section has or gets. wish: the name, if it is free."""
        entry = self.without_entries(entry, wish)
        own = self.sections[section]
        for name, other in own.items():
            if other is entry or (type(other) is type(entry) and other == entry):
                return name
        name = next(n for n in _numbered(wish) if n not in own and n != RESERVED)
        self.sections[section] = {**own, name: entry}
        return name


def _numbered(name: str) -> Iterator[str]:
    """Yields a name, and then the name with the numbers from 2 on."""
    yield name
    number = 2
    while True:
        yield f"{name} {number}"
        number += 1


def _with_fields(record: Any, changes: dict[str, Any]) -> Any:
    """A copy of a record with other values in some fields."""
    own: Callable | None = getattr(record, "with_fields", None)
    return own(**changes) if own else replace(record, **changes)
