"""What tracks write: how the values at an address of a scene are interpolated, and which addresses can move."""

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from visray.animation.curves import Sort
from visray.number_table import NumberTable
from visray.quantities import NOT_ZERO, Direction, Quantity
from visray.scene.edits import canonical, keys_of, value_at
from visray.scene.scene import Scene
from visray.transforms import STEPS, Scale

_DIRECTION = next(m for m in Direction.__metadata__ if isinstance(m, Quantity))

# Fields with the name of a material.
MATERIALS = ("material", "cut_material", "back")
# The address of the date of data. It moves even if it is null or a text in the scene.
DATE = "data.date"


def still(scene: Scene) -> Scene:
    """The scene as it is written, without what moves it."""
    return replace(scene, animation=None)


def sort_of(scene: Scene, address: str) -> Sort:
    """How the values at an address are interpolated. Domain: an address of the scene whose value can move."""
    if type(value_at(scene, address)) in STEPS.values():
        return "step"
    if address == DATE:
        return "date"
    owner, _, name = address.rpartition(".")
    if name == "transform":
        return "steps"
    holder = value_at(scene, owner) if owner and not is_row(scene, address) else scene
    if isinstance(holder, Scale) or (name.isdigit() and owner.endswith(".scale") and sort_of(scene, owner) == "factor"):
        return "factor"
    marks = _marks(holder, name) if is_dataclass(holder) else ()
    return "direction" if _DIRECTION in marks else "vector" if NOT_ZERO in marks else "number"


def is_row(scene: Scene, address: str) -> bool:
    """Whether an address is that of a number of a row of data."""
    head, *rest = address.split(".")
    return head == "data" and scene.data is not None and bool(rest) and rest[0] in scene.data.layers


def _marks(holder: Any, name: str) -> tuple:
    """What the type of a field says beside the type itself."""
    return next((getattr(f.type, "__metadata__", ()) for f in fields(holder) if f.name == name), ())


def discrete(scene: Scene, address: str) -> str | None:
    """Reason why the value at an address cannot move; None if it can. Domain: an address of the scene."""
    found = value_at(scene, address)
    if canonical(address) != address:
        return f"is another name of {canonical(address)}; move that"
    if address == DATE:
        return None
    if type(found) in STEPS.values() or address.rpartition(".")[2] == "transform" or shape(found) is not None:
        return None
    if found is None:
        return "is null in the scene, and only numbers move; give it numbers first"
    if is_dataclass(found) or isinstance(found, dict):
        return f"is no value but has parts; name one: {', '.join(keys_of(found)) or 'there is none'}"
    if isinstance(found, str) and address.rpartition(".")[2] in MATERIALS:
        name = found if found in scene.materials else "NAME"
        return f"is the name of a material, and names do not move; move numbers of one, such as materials.{name}.kd"
    sorts = {bool: "true or false", str: "a word", int: "a whole number"}
    return f"is discrete ({sorts.get(type(found), 'no number')}), and only numbers move; leave the track out"


def shape(value: Any) -> tuple | None:
    """Numbers of entries of a value, as of a NumPy array: () for a number; None if it does not consist of numbers, or
    if its numbers are whole by their meaning."""
    if isinstance(value, NumberTable):
        return value.values.shape if value.values.dtype.kind == "f" else None
    return () if type(value) is float else _shape(value, float) if isinstance(value, tuple) and value else None


def given_shape(value: Any) -> tuple | None:
    """As `shape`, for the value of a key, in which whole numbers stand for any others."""
    return () if type(value) in (int, float) else _shape(value, (int, float)) if isinstance(value, tuple) else None


def _shape(value: tuple, kinds: Any) -> tuple | None:
    """Shape of nested tuples of numbers of some kinds; None if they are no full array of these."""
    try:
        array = np.array(value)
    except ValueError:
        return None
    flat: Any = value
    for _ in range(array.ndim - 1):
        flat = [x for part in flat for x in part]
    is_number = array.dtype.kind in "if" and all(isinstance(x, kinds) and not isinstance(x, bool) for x in flat)
    return array.shape if is_number else None
