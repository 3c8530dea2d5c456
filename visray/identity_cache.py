"""A cache of what is known of objects, by their identity."""

from typing import Any
from weakref import ref


class _Entry(ref):
    """A weak reference to an object.

    key: identity (id) of the object.
    value: what is known of it.
    """

    __slots__ = ("key", "value")


class IdentityCache:
    """Values by the identity of objects. Objects that are equal but not the same have entries of their own. An entry
    ends when its object no longer exists, so the value must not refer to the object."""

    def __init__(self) -> None:
        self._entries: dict[int, _Entry] = {}
        # The method is bound here, because at exit Python may delete the module's globals first.
        pop = self._entries.pop
        self._forget = lambda entry: pop(entry.key, None)

    def __len__(self) -> int:
        return len(self._entries)

    def get(self, instance: Any) -> Any | None:
        """The value of an object; None if it has none."""
        entry = self._entries.get(id(instance))
        return entry.value if entry is not None and entry() is instance else None

    def put(self, instance: Any, value: Any) -> None:
        """Sets the value of an object."""
        entry = _Entry(instance, self._forget)
        entry.key, entry.value = id(instance), value
        self._entries[entry.key] = entry
