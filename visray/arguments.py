"""Checks of the arguments of public functions: what is no value of the declared type is refused in one line."""

import os
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from inspect import Signature, signature
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from visray.errors import UserError
from visray.hints import hint
from visray.terminal import printable

LONGEST_VALUE = 60
# What vr.prepare returns, and what to give in its place.
ONE_MOMENT = "a prepared scene is one moment, without an animation: give the scene itself"


class SceneFiles:
    """How a function that takes a scene reads a file, or the dict of its content. Scenes stand above this module:
    scene/load.py sets `read`.

    read: function of a path or a dict, which returns the scene
    """

    read: Callable[[Any], Any]


def checked_arguments(function: Callable) -> Callable:
    """A function that checks its arguments by the annotations of its parameters. NumPy's numbers become Python's. Where
    a scene is asked for, a path or a dict stands for the scene of a file.

    Numbers are not refused here, because their own checks say more. Neither are types that this module does not know.
    """

    @wraps(function)
    def checking(*args: Any, **kwargs: Any) -> Any:
        declared, hints = _declared(function)
        try:
            bound = declared.bind(*args, **kwargs)
        except TypeError as error:
            raise TypeError(f"{function.__name__}(): {error}{_known_arguments(declared, kwargs)}") from None
        for name, value in bound.arguments.items():
            if name in hints:
                bound.arguments[name] = checked_argument(name, value, hints[name])
        return function(*bound.args, **bound.kwargs)

    return checking


@cache
def _declared(function: Callable) -> tuple[Signature, dict[str, Any]]:
    """Signature of a function, and the types of its parameters by name."""
    declared = signature(function)
    own = {name: hint for name, hint in get_type_hints(function).items() if name in declared.parameters}
    return declared, own


def _known_arguments(declared: Signature, kwargs: Mapping[str, Any]) -> str:
    """What to write in place of an argument that a function does not have; "" if it has all of them."""
    unknown = [name for name in kwargs if name not in declared.parameters]
    if not unknown:
        return ""
    value = kwargs[unknown[0]]
    if "parameters" in declared.parameters and isinstance(value, (int, float)):
        return f'; a parameter of a formula is written parameters={{"{unknown[0]}": {value!r}}}'
    known = [name for name in declared.parameters if name != "self"]
    return f"; {hint(unknown[0].strip('_'), known)}"


def checked_argument(name: str, value: Any, annotation: Any) -> Any:
    """The value of an argument, with Python's numbers in place of NumPy's. Raises a UserError if it is of another
    type."""
    value = python_number(value)
    members = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
    if any(_fits(value, member) for member in members):
        return value
    kinds = list(dict.fromkeys(_described(member) for member in members))
    right = " or ".join(kinds)
    if any(getattr(member, "__name__", "") == "Scene" for member in members):
        if isinstance(value, (str, Path, dict)):
            return SceneFiles.read(value)
        kind = type(value).__name__
        more = f"; {ONE_MOMENT}" if kind == "Prepared" else ""
        raise UserError(f"a scene is a visray Scene, not a {kind}{more}")
    raise UserError(f"{name} = {shown(value)}: must be {right}")


def python_number(value: Any) -> Any:
    """Python's number for one of NumPy's; any other value as it is."""
    is_scalar = any(kind.__name__ == "generic" and kind.__module__ == "numpy" for kind in type(value).__mro__)
    return value.item() if is_scalar else value


def shown(value: Any) -> str:
    """The value as text for a message, cut if it is long."""
    text = printable(" ".join(repr(value).split()))
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."


def _fits(value: Any, kind: Any) -> bool:
    """Whether a value is of a type, as far as this module judges it."""
    origin = get_origin(kind)
    if kind in (Path, os.PathLike) or origin is os.PathLike:
        return isinstance(value, os.PathLike)
    if origin is Sequence:
        return hasattr(value, "__iter__") and getattr(value, "shape", None) != ()
    if origin is Callable:
        return callable(value)
    if origin is Mapping:
        return isinstance(value, Mapping)
    if kind is bool:
        return isinstance(value, int)
    is_judged = isinstance(kind, type) and origin is None and kind not in (int, float, object, Any)
    return isinstance(value, kind) if is_judged else True


def _described(kind: Any) -> str:
    """Words for a type."""
    names = {str: "a text", Path: "a path", os.PathLike: "a path", bool: "True or False", NoneType: "None"}
    names |= {Sequence: "a list of texts", Mapping: "a dict", Callable: "a function"}
    return names.get(kind) or names.get(get_origin(kind)) or f"a {getattr(kind, '__name__', kind)}"
