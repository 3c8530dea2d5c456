"""Reads the JSON objects of VisRayTrace files.

VisRayTrace silently ignored keys that it did not know and values that it could not read. visray warns about them if the
picture still makes sense without them, and reports an error if it does not.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from visray.hints import hint
from visray.scene.messages import line
from visray.terminal import printable


@dataclass
class Log:
    """Errors and warnings about one file. Each line begins with the name of the file.

    said: topics of the warnings that are given only once.
    """

    name: str
    errors: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    said: set[str] = field(default_factory=set)

    def error(self, text: str) -> None:
        """Adds an error."""
        self.errors.append(f"{self.name}: {printable(text)}")

    def warn(self, text: str) -> None:
        """Adds a warning."""
        self.warnings.append(f"{self.name}: {printable(text)}")

    def warn_once(self, topic: str, text: str) -> None:
        """Adds a warning, unless there is one about this topic already."""
        if topic not in self.said:
            self.said.add(topic)
            self.warn(text)


QUOTE = "'"
# VisRayTrace used this colour if the file did not give one.
BLACK = (0.0, 0.0, 0.0)


class Entry:
    """One JSON object of a file. A key with several spellings has one name here, and each value is read as a type.

    A value of a wrong type is ignored with a warning; VisRayTrace ignored it silently.

    address: address of the object in the file.
    log: log that receives its errors and warnings.
    spelling: for each key, how the file writes it.
    values: value of each key.
    """

    def __init__(self, raw: Mapping[str, Any], address: str, keys: Mapping[str, tuple[str, ...]], log: Log):
        """raw: the JSON object as a dict. keys: the known keys, each with its other spellings."""
        self.address, self.log = address, log
        self.spelling: dict[str, str] = {}
        self.values: dict[str, Any] = {}
        key_of = {spelling: key for key, synonyms in keys.items() for spelling in (key, *synonyms)}
        key_of_normalized = {_normalized(spelling): key for spelling, key in key_of.items()}
        for written in sorted(raw, key=lambda w: w not in key_of):  # exact spellings take precedence
            key = key_of.get(written) or key_of_normalized.get(_normalized(written))
            if key is None:
                log.warn(f"{self.at(written)}: unknown key, ignored; {hint(written, keys, QUOTE)}")
            elif key in self.values:
                log.warn(f"{self.at(written)}: ignored; {self.spelling[key]!r} says the same")
            else:
                if written not in key_of:
                    log.warn(f"{address or 'key'}: {written!r} is read as {key!r}; VisRayTrace ignored it")
                self.spelling[key], self.values[key] = written, raw[written]

    def at(self, key: str) -> str:
        """Address of a key in the file."""
        written = self.spelling.get(key, key)
        return f"{self.address}.{written}" if self.address else written

    def error(self, key: str, text: str) -> None:
        """Logs an error about the value of a key."""
        self.log.error(line(self.at(key), self.values[key], text))

    def has(self, key: str) -> bool:
        """Whether the object has the key."""
        return key in self.values

    def _ignore(self, key: str, expected: str) -> None:
        """Removes a value of a wrong type, with a warning."""
        self.log.warn(line(self.at(key), self.values.pop(key), f"ignored; must be {expected}"))

    def number(self, key: str, default: float | None = None) -> float | None:
        """The finite number under a key, or the default if there is none. If there is no default either, None with an
        error in the log."""
        if self.has(key) and not is_number(self.values[key]):
            self._ignore(key, "a number")
        if self.has(key):
            if not isfinite(self.values[key]):
                self.error(key, "must be finite")
                return default
            return float(self.values[key])
        if default is None:
            self.log.error(f"{self.at(key)}: the key is missing; it is a number")
        return default

    def integer(self, key: str, default: int) -> int:
        """The whole number under a key, or the default. Digits after the decimal point are cut off."""
        return int(self.number(key, float(default)))

    def vector(self, key: str, default: tuple | None = None, size: int = 3) -> tuple[float, ...] | None:
        """The vector of `size` numbers under a key, or the default. If there is no default either, None with an error.

        As in VisRayTrace, missing numbers are 0 and surplus numbers are ignored; visray warns of both.
        """
        numbers = self.values.get(key)
        if self.has(key) and not (isinstance(numbers, list) and all(map(is_number, numbers))):
            self._ignore(key, f"{size} numbers")
        if self.has(key):
            if not all(map(isfinite, numbers)):
                self.error(key, "must be finite")
                return default
            if len(numbers) != size:
                rest = "further ones are ignored" if len(numbers) > size else "missing ones are 0"
                self.log.warn(line(self.at(key), numbers, f"must be {size} numbers; {rest}"))
            return tuple(map(float, (numbers + [0] * size)[:size]))
        if default is None:
            self.log.error(f"{self.at(key)}: the key is missing; it is {size} numbers")
        return default

    def flag(self, key: str, default: bool | None = None) -> bool | None:
        """True or false as given under a key, or the default."""
        if self.has(key) and not isinstance(self.values[key], bool):
            self._ignore(key, "true or false")
        return self.values.get(key, default)

    def text(self, key: str) -> str | None:
        """The string under a key, or None if there is none."""
        if self.has(key) and not isinstance(self.values[key], str):
            self._ignore(key, "a string")
        return self.values.get(key)

    def choice(self, key: str, choices: Iterable[str]) -> str | None:
        """The choice that the string under a key names, in upper or lower case. None if the key is missing. If the
        string is none of the choices, None with an error in the log."""
        text = self.text(key)
        if text is None:
            return None
        chosen = next((c for c in choices if c.casefold() == text.strip().casefold()), None)
        if chosen is None:
            self.error(key, f"unknown {key}; {hint(text, choices)}")
        return chosen

    def nested(self, key: str, keys: Mapping[str, tuple[str, ...]]) -> "Entry | None":
        """The JSON object under a key, or None if there is none.

        keys: the known keys of this object, each with its other spellings.
        """
        if self.has(key) and not isinstance(self.values[key], dict):
            self._ignore(key, "an object {...}")
        return Entry(self.values[key], self.at(key), keys, self.log) if self.has(key) else None

    def items(self, key: str) -> list[Any]:
        """The list under a key; empty if there is none."""
        if self.has(key) and not isinstance(self.values[key], list):
            self.error(key, "must be a list [...]")
            return []
        return self.values.get(key, [])


def _normalized(key: str) -> str:
    """A key in lower case, without colons and spaces at its ends. Recognises misspellings such as `"lookAt:"`."""
    return key.strip(" \t:").casefold()


def is_number(value: Any) -> bool:
    """Whether a JSON value is a number. True and false are not numbers."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)
