"""A scene with the values that tracks have written at one time: what tracks that follow others see."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from visray.data.base import AnyBase
from visray.identity_cache import IdentityCache
from visray.meshes.triangle_mesh import MeshError
from visray.primitives.csg_resolved import resolved
from visray.primitives.plane import Plane
from visray.primitives.primitive import Primitive, bounding_box
from visray.scene.edits import edited, value_at, value_in, within
from visray.scene.scene import Object, Scene
from visray.transforms import Transform, compose

_SHAPE = TypeAdapter(Object)
_TRANSFORM = TypeAdapter(tuple[Transform, ...])
# The centres of the boxes of shapes, before their transforms.
_centers = IdentityCache()


@dataclass(frozen=True)
class MovedScene:
    """A scene at one time.

    rest: the scene without its animation.
    written: the values that tracks have written so far, by address.
    """

    rest: Scene
    written: dict[str, Any]

    def value(self, address: str) -> Any:
        """The value at an address, with what was written there or at a part of it. Domain: an address of the scene."""
        below = self._below(address)
        return value_in(edited(self.rest, below), address) if below else value_at(self.rest, address)

    def center(self, address: str) -> tuple[float, float, float]:
        """The centre of what is at an address, after its transform: that of the bounding box that the shape has before
        the transform. That of a plane is its point, and that of other endless shapes the origin.

        If what was written makes no valid shape, the shape at rest counts; the check of the scene says what is wrong.
        """
        try:
            return self._center(address)
        except (ValidationError, MeshError):
            return MovedScene(self.rest, {})._center(address)

    def _center(self, address: str) -> tuple[float, float, float]:
        """As center. Raises ValidationError or MeshError if the shape is not valid."""
        steps, shape = _TRANSFORM.validate_python(self.value(f"{address}.transform")), value_at(self.rest, address)
        if isinstance(shape, AnyBase):
            point = np.array(self.value(f"{address}.center"), float)
        else:
            # While only the transform moves, the shape is that of the scene, whose centre is known.
            if set(self._below(address)) - set(self._below(f"{address}.transform")):
                shape = _SHAPE.validate_python(self.value(address))
            form = resolved(shape, self._geometries())
            point = _own_center(form)
            # An instance has the transform of its geometry too.
            steps = form.transform[: len(form.transform) - len(shape.transform)] + steps
        matrix = compose(steps)
        return tuple((point if matrix is None else matrix[:, :3] @ point + matrix[:, 3]).tolist())

    def _geometries(self) -> Mapping[str, Primitive]:
        """The geometries of the scene."""
        names = dict.fromkeys(address.split(".")[1] for address in self._below("geometries"))
        moved = {name: _SHAPE.validate_python(self.value(f"geometries.{name}")) for name in names}
        return self.rest.geometries | moved if moved else self.rest.geometries

    def _below(self, address: str) -> dict[str, Any]:
        """What was written at an address, or at a part of it."""
        return {a: x for a, x in self.written.items() if within(a, address)}


def _own_center(form: Primitive) -> np.ndarray:
    """The centre of the bounding box of a shape, before its transform. It is found once. Domain: no instances."""
    known = _centers.get(form)
    if known is None:
        known = _box_center(form.with_fields(transform=()))
        _centers.put(form, known)
    return known


def _box_center(shape: Primitive) -> np.ndarray:
    """The centre of a bounding box; the origin of a shape without one."""
    if isinstance(shape, Plane):
        return np.array(shape.point, float)
    box = bounding_box(shape)
    if box is None:
        return np.zeros(3)
    low, high = map(np.ravel, box)
    # The box of an empty shape is inside out.
    return 0.5 * (low + high) if np.isfinite([low, high]).all() and (low <= high).all() else np.zeros(3)
