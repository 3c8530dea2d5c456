"""Reads the JSON objects of original VisRayTrace files.

The original passed over what it did not know or could not read. Here that is a warning where the picture still makes
sense, and an error where it does not.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from visray.scene.messages import hint, line, printable


@dataclass
class Log:
    """What is wrong with a file, and what was passed over; each line begins with the file's name."""

    name: str
    errors: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def error(self, text: str) -> None:
        self.errors.append(f"{self.name}: {printable(text)}")

    def warn(self, text: str) -> None:
        self.warnings.append(f"{self.name}: {printable(text)}")


QUOTE = "'"
# What the original took for a colour that a file leaves out.
BLACK = (0.0, 0.0, 0.0)


class Entry:
    """One JSON object of a file, its keys known under one spelling, its values read by type.

    A value of another type is passed over with a warning, as the original did in silence.
    """

    def __init__(self, raw: Mapping[str, Any], address: str, keys: Mapping[str, tuple[str, ...]], log: Log):
        self.address, self.log = address, log
        self.spelling: dict[str, str] = {}
        self.values: dict[str, Any] = {}
        meanings = {spelling: key for key, others in keys.items() for spelling in (key, *others)}
        loose = {_loosely(spelling): key for spelling, key in meanings.items()}
        for written in sorted(raw, key=lambda w: w not in meanings):  # the right spelling goes first
            key = meanings.get(written) or loose.get(_loosely(written))
            if key is None:
                log.warn(f"{self.at(written)}: unknown key, passed over; {hint(written, keys, QUOTE)}")
            elif key in self.values:
                log.warn(f"{self.at(written)}: passed over; {self.spelling[key]!r} says the same")
            else:
                if written not in meanings:
                    log.warn(f"{address or 'key'}: {written!r} is read as {key!r}; the original passed it over")
                self.spelling[key], self.values[key] = written, raw[written]

    def at(self, key: str) -> str:
        """The address of a key."""
        written = self.spelling.get(key, key)
        return f"{self.address}.{written}" if self.address else written

    def error(self, key: str, text: str) -> None:
        self.log.error(line(self.at(key), self.values[key], text))

    def has(self, key: str) -> bool:
        return key in self.values

    def _odd(self, key: str, wanted: str) -> None:
        self.log.warn(line(self.at(key), self.values.pop(key), f"passed over; must be {wanted}"))

    def number(self, key: str, default: float | None = None) -> float | None:
        """A finite number; without a default, a missing one is an error and gives None."""
        if self.has(key) and not _is_number(self.values[key]):
            self._odd(key, "a number")
        if self.has(key):
            if not isfinite(self.values[key]):
                self.error(key, "must be finite")
                return default
            return float(self.values[key])
        if default is None:
            self.log.error(f"{self.at(key)}: the key is missing; it is a number")
        return default

    def whole(self, key: str, default: int) -> int:
        """A whole number; what it has after the point is cut off."""
        return int(self.number(key, float(default)))

    def vector(self, key: str, default: tuple | None = None, size: int = 3) -> tuple[float, ...] | None:
        """Numbers; as in the original, further ones are passed over and missing ones are 0, each with a warning."""
        found = self.values.get(key)
        if self.has(key) and not (isinstance(found, list) and all(map(_is_number, found))):
            self._odd(key, f"{size} numbers")
        if self.has(key):
            if not all(map(isfinite, found)):
                self.error(key, "must be finite")
                return default
            if len(found) != size:
                rest = "further ones are passed over" if len(found) > size else "missing ones are 0"
                self.log.warn(line(self.at(key), found, f"must be {size} numbers; {rest}"))
            return tuple(map(float, (found + [0] * size)[:size]))
        if default is None:
            self.log.error(f"{self.at(key)}: the key is missing; it is {size} numbers")
        return default

    def flag(self, key: str, default: bool | None = None) -> bool | None:
        if self.has(key) and not isinstance(self.values[key], bool):
            self._odd(key, "true or false")
        return self.values.get(key, default)

    def text(self, key: str) -> str | None:
        if self.has(key) and not isinstance(self.values[key], str):
            self._odd(key, "a string")
        return self.values.get(key)

    def chosen(self, key: str, choices: Iterable[str]) -> str | None:
        """The choice that a text means, whatever its case; None where it is none of them, or not there."""
        text = self.text(key)
        if text is None:
            return None
        meant = next((c for c in choices if c.casefold() == text.strip().casefold()), None)
        if meant is None:
            self.error(key, f"unknown {key}; {hint(text, choices)}")
        return meant

    def inner(self, key: str, keys: Mapping[str, tuple[str, ...]]) -> "Entry | None":
        """The JSON object under a key."""
        if self.has(key) and not isinstance(self.values[key], dict):
            self._odd(key, "an object {...}")
        return Entry(self.values[key], self.at(key), keys, self.log) if self.has(key) else None

    def entries(self, key: str) -> list[Any]:
        if self.has(key) and not isinstance(self.values[key], list):
            self.error(key, "must be a list [...]")
            return []
        return self.values.get(key, [])


def _loosely(key: str) -> str:
    """A key as hands that slip write it: with a colon or spaces inside the quotes, in any case."""
    return key.strip(" \t:").casefold()


def _is_number(found: Any) -> bool:
    return isinstance(found, (int, float)) and not isinstance(found, bool)
