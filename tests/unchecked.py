"""Records with wrong values. Constructors refuse them, so they are made by force, for tests of later checks."""

from dataclasses import MISSING, fields
from typing import Any


def unchecked(kind: type, *args: Any, **given: Any) -> Any:
    """A record of a kind whose values are not checked."""
    by_place = [f.name for f in fields(kind) if not f.kw_only]
    made = object.__new__(kind)
    for f in fields(kind):
        object.__setattr__(made, f.name, f.default if f.default_factory is MISSING else f.default_factory())
    for name, value in (dict(zip(by_place, args)) | given).items():
        object.__setattr__(made, name, value)
    return made
