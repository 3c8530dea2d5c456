"""Files that a scene names, as values of its fields. For the hash of the scene a file counts with its content."""

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import core_schema

# Key of the context of pydantic's serialisation. If it is true, files and tables are written as digests of their
# contents.
DIGESTS = "digests"
# Number of files whose digests are remembered.
REMEMBERED = 4096


def stamp_of(path: Any) -> Any:
    """A value that changes if the content of a file does. What is given itself if it is no path of a file."""
    if not isinstance(path, str):
        return path
    try:
        facts = os.stat(path)
    # ValueError: the path has a NUL character.
    except (OSError, ValueError):
        return path
    return path, facts.st_mtime_ns, facts.st_size, facts.st_ino


def file_digest(path: str) -> str:
    """SHA-256 of the content of a file; the path itself if it cannot be read. A file that has not changed is read
    once."""
    stamp = stamp_of(path)
    # A pipe must not be opened: that would wait for a writer.
    return _digest(stamp) if stamp != path and os.path.isfile(path) else path


@lru_cache(maxsize=REMEMBERED)
def _digest(stamp: tuple) -> str:
    """As file_digest. stamp: path of the file, with facts that change if its content does."""
    try:
        with open(stamp[0], "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return stamp[0]


@dataclass(frozen=True)
class FileRule:
    """The rule for the path of a file, as an annotation that pydantic reads.

    For the hash, a file is its name and the digest of its content: its folder changes no picture, but readers look at
    its ending, and a part of a mesh may have its name.

    files: function that returns the files that are read for a path, itself first.
    """

    files: Callable[[str], tuple[str, ...]] = lambda path: (path,)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def written(path: Any, info: Any) -> Any:
            if not isinstance(path, str) or not (info.context or {}).get(DIGESTS):
                return path
            return " ".join([Path(path).name, *map(file_digest, self.files(path))])

        serializer = core_schema.plain_serializer_function_ser_schema(written, info_arg=True)
        return core_schema.str_schema(strict=True, min_length=1, serialization=serializer)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict:
        return {"type": "string", "minLength": 1}
