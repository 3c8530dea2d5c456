"""Records as texts of one line, as Python shows them."""

from dataclasses import MISSING, fields
from typing import Any

import drjit as dr


def record_text(record: Any) -> str:
    """A record as Python writes it, in one line, with the fields that differ from their defaults. Those that
    are given by place come first."""
    parts = []
    for f in sorted(fields(record), key=lambda f: f.kw_only):
        value = getattr(record, f.name)
        default = f.default if f.default_factory is MISSING else f.default_factory()
        if dr.is_array_v(value) or (value is not default and not _equal(value, default)):
            parts.append(f"{f.name}={_text(value)}")
    return f"{type(record).__name__}({', '.join(parts)})"


def _equal(value: Any, default: Any) -> bool:
    """Whether a value equals a default. Values that cannot be compared differ."""
    try:
        return type(value) is type(default) and bool(value == default)
    except Exception:
        return False


def _text(value: Any) -> str:
    """A value in one line."""
    if dr.is_array_v(value):
        return f"<{type(value).__name__}>"
    return repr(value) if isinstance(value, str) else " ".join(repr(value).split())
