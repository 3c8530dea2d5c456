"""What tracks write: how the values at an address of a scene are interpolated."""

from dataclasses import fields, is_dataclass
from typing import Any

from visray.animation.curves import Sort
from visray.quantities import Direction, Quantity
from visray.scene.address import value
from visray.scene.scene import Scene
from visray.transforms import STEPS

_DIRECTION = next(m for m in Direction.__metadata__ if isinstance(m, Quantity))


def sort_of(scene: Scene, address: str) -> Sort:
    """How the values at an address are interpolated. Domain: an address of the scene."""
    found = value(scene, address)
    if type(found) in STEPS.values():
        return "step"
    owner, _, name = address.rpartition(".")
    if name == "transform":
        return "steps"
    holder = value(scene, owner) if owner else scene
    marks = _marks(holder, name) if is_dataclass(holder) else ()
    return "direction" if _DIRECTION in marks else "number"


def _marks(holder: Any, name: str) -> tuple:
    """What the type of a field says beside the type itself."""
    return next((getattr(f.type, "__metadata__", ()) for f in fields(holder) if f.name == name), ())
