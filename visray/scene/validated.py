"""Cache of validated textures, materials, lights and objects, so that each instance is validated once.

Their classes are frozen dataclasses. So an instance that can be hashed contains no list and no dict, and never changes.
Instances are compared by identity: a copy, by dataclasses.replace or pickle for example, is a new instance.
Polynomials contain a dict of parameters. They cannot be hashed, and are validated every time.
"""

from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

from visray.arguments import python_number
from visray.identity_cache import IdentityCache

# Atoms: types of values that contain no other values.
ATOMS = frozenset((float, str, int, bool, type(None)))


# The value of an instance that is valid itself, in place of its validated copy.
ITSELF = object()
# The validated copies of instances.
_entries = IdentityCache()


def validated(instance: Any) -> Any | None:
    """The validated copy of an instance, which is often the instance itself; None if it has not been validated yet."""
    equal = _entries.get(instance)
    return instance if equal is ITSELF else equal


def remember(instance: Any, equal: Any) -> None:
    """Stores the validated copy of an instance in the cache, unless the instance or the copy can change.

    equal: the validated copy; it may be the instance itself.
    """
    try:
        hash(equal)
        if instance is not equal:
            hash(instance)
    except TypeError:
        return
    if instance is not equal:
        _entries.put(instance, equal)
    _entries.put(equal, ITSELF)


def plain(value: Any) -> Any:
    """The value with dicts in place of dataclass instances at every depth, like dataclasses.asdict, and with Python's
    numbers in place of NumPy's. The result must not be changed: its dicts may be the instances' own."""
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
    return tuple(map(plain, value)) if isinstance(value, tuple) else python_number(value)


@cache
def _names(kind: type) -> tuple[str, ...]:
    """Names of a dataclass's fields."""
    return tuple(f.name for f in fields(kind))


def _flat(own: dict[str, Any]) -> bool:
    """Whether the values of a dict are only atoms (ATOMS) and tuples of atoms."""
    for value in own.values():
        if type(value) not in ATOMS and not (type(value) is tuple and ATOMS.issuperset(map(type, value))):
            return False
    return True
