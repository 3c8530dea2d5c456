"""Values of keys: plain numbers, texts, tuples and dicts, like the content of a scene file."""

from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

from visray.arguments import python_number


def key_value(given: Any) -> Any:
    """A value with tuples in place of lists and arrays, and dicts in place of instances, such as steps of a
    transform."""
    if is_dataclass(given) and not isinstance(given, type):
        given = asdict(given)
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if isinstance(given, dict):
        return {key: key_value(part) for key, part in given.items()}
    return tuple(map(key_value, given)) if isinstance(given, list | tuple) else python_number(given)
