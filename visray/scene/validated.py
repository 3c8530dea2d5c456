"""Memory of the textures, materials, lights and objects that have passed validation, so that each is validated once.

The kinds are frozen: an instance that can be hashed holds no list and no dict, and says the same as long as it lives.
Instances are known by identity: copies, also those by dataclasses.replace or pickle, are new ones. Polynomials have a
dict of parameters, and are validated every time.
"""

from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any
from weakref import ref

# Types of values that hold no others.
ATOMS = frozenset((float, str, int, bool, type(None)))


class _Entry(ref):
    """A weak reference to an instance, with the key of its entry and its validated equal (None: the instance
    itself)."""

    __slots__ = ("equal", "key")


_entries: dict[int, _Entry] = {}


def _forget(entry: _Entry, pop: Any = _entries.pop) -> None:
    pop(entry.key, None)


def validated(thing: Any) -> Any | None:
    """The validated equal of an instance that has passed before, often itself; None of any other."""
    entry = _entries.get(id(thing))
    if entry is None or entry() is not thing:
        return None
    return thing if entry.equal is None else entry.equal


def remember(thing: Any, equal: Any) -> None:
    """Remembers what an instance was validated to, if neither can change any more. `thing` may be `equal` itself."""
    try:
        hash(equal)
        if thing is not equal:
            hash(thing)
    except TypeError:
        return
    if thing is not equal:
        _enter(thing, equal)
    _enter(equal, None)


def _enter(thing: Any, equal: Any | None) -> None:
    entry = _Entry(thing, _forget)
    entry.key, entry.equal = id(thing), equal
    _entries[entry.key] = entry


def plain(value: Any) -> Any:
    """Dicts in place of instances of dataclasses, however deep, as by dataclasses.asdict. They may be shared with the
    instances: only to be read."""
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
    return tuple(f.name for f in fields(kind))


def _flat(own: dict[str, Any]) -> bool:
    """Whether the fields are atoms and tuples of atoms only."""
    for value in own.values():
        if type(value) not in ATOMS and not (type(value) is tuple and ATOMS.issuperset(map(type, value))):
            return False
    return True
