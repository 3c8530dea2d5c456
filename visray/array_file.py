"""Files of named arrays: those of NumPy (.npz), without compression, and with facts about what they hold."""

import json
import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.output.files import replacing

# The name of the facts among the arrays.
FACTS = "origin"


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, np.ndarray], facts: dict[str, Any]) -> None:
    """Writes arrays and facts to a file. An old file is replaced only when the new one is complete."""
    origin = np.frombuffer(json.dumps(facts).encode(), np.uint8)
    with replacing(path) as aside, open(aside, "wb") as file:
        np.savez(file, **{FACTS: origin}, **arrays)


@contextmanager
def opened_arrays(
    path: str | os.PathLike[str], refusal: str
) -> Iterator[tuple[Mapping[str, np.ndarray], dict[str, Any]]]:
    """Yields the arrays and the facts of a file, to be read in a `with` block. Raises UserError if the file cannot be
    read, or if the block finds that it holds something else.

    refusal: what the error says of such a file
    """
    name = os.fspath(path)
    try:
        with np.load(path, allow_pickle=False) as arrays:
            facts = json.loads(bytes(arrays[FACTS]))
            if not isinstance(facts, dict):
                raise ValueError("the facts are no dict")
            yield arrays, facts
    except OSError as error:
        raise UserError(f"{name}: cannot be read, {error.strerror or error}") from error
    # RuntimeError: raised for zip files that are encrypted, or compressed by a method unknown to Python.
    except (zipfile.BadZipFile, zlib.error, KeyError, TypeError, ValueError, EOFError, RuntimeError) as error:
        raise UserError(f"{name}: {refusal}") from error
