"""Cache of validated textures, materials, lights and objects, so that each instance is validated once.

The kinds are frozen dataclasses, so an instance that can be hashed holds no list and no dict and never changes.
Instances are compared by identity: copies, also by dataclasses.replace or pickle, are new instances. Polynomials hold a
dict of parameters, cannot be hashed, and are validated every time.
"""

from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any
from weakref import ref

# Types of values that contain no other values.
ATOMS = frozenset((float, str, int, bool, type(None)))


class _Entry(ref):
    """Weak reference to an instance.

    key: the key of the entry. equal: the validated copy of the instance; None means the instance itself.
    """

    __slots__ = ("equal", "key")


_entries: dict[int, _Entry] = {}


def _forget(entry: _Entry, pop: Any = _entries.pop) -> None:
    """Removes the entry of an instance that is gone."""
    pop(entry.key, None)


def validated(instance: Any) -> Any | None:
    """The validated copy of an instance, often the instance itself; None if it has not been validated yet."""
    entry = _entries.get(id(instance))
    if entry is None or entry() is not instance:
        return None
    return instance if entry.equal is None else entry.equal


def remember(instance: Any, equal: Any) -> None:
    """Stores the validated copy of an instance, unless one of the two can change. They may be the same object."""
    try:
        hash(equal)
        if instance is not equal:
            hash(instance)
    except TypeError:
        return
    if instance is not equal:
        _add(instance, equal)
    _add(equal, None)


def _add(instance: Any, equal: Any | None) -> None:
    """Adds an entry."""
    entry = _Entry(instance, _forget)
    entry.key, entry.equal = id(instance), equal
    _entries[entry.key] = entry


def plain(value: Any) -> Any:
    """The value with dicts in place of dataclass instances at every depth, as by dataclasses.asdict. Read only: the
    dicts may be those of the instances."""
    kind = type(value)
    if kind in ATOMS:
        return value
    if is_dataclass(kind):
        own, names = vars(value), _names(kind)
        return own if len(own) == len(names) and _flat(own) else {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, list):
        return [plain(part) for part in value]
    return tuple(map(plain, value)) if isinstance(value, tuple) else value


@cache
def _names(kind: type) -> tuple[str, ...]:
    """Names of the fields of a dataclass."""
    return tuple(f.name for f in fields(kind))


def _flat(own: dict[str, Any]) -> bool:
    """Whether the fields hold only atoms and tuples of atoms."""
    for value in own.values():
        if type(value) not in ATOMS and not (type(value) is tuple and ATOMS.issuperset(map(type, value))):
            return False
    return True
