"""Finds the numbers of a scene in its packed arrays, by address: for derivatives and updates.

An address is the dotted name of a value in a scene, such as `objects.ball.radius` (scene/address.py).
"""

from dataclasses import dataclass, is_dataclass
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.pack import Columns, LightColumns, Packed, materials_of
from visray.quantities import quantities
from visray.scene import address as addresses
from visray.scene.scene import Scene, SkyGradient


@dataclass(frozen=True)
class Slot:
    """The place where the packed arrays contain the value of one address: a number or a triple of numbers.

    arrays: the arrays that contain the value. A background of one colour is stored twice, as top and bottom of a sky,
        and has two arrays; every other value has one.
    row: index of the array entry
    component: 0, 1 or 2 for one number of a triple; None for the whole entry
    """

    arrays: tuple[Any, ...]
    row: int
    component: int | None

    def read(self, values: tuple | list) -> Any:
        """Reads the entry at this place from `values`. Returns a number, or a NumPy array of three numbers.

        values: one array for each of `self.arrays`, of the same shape, such as its gradient. If there are two, their
            entries are added.
        """
        entry = sum(np.array(v, float)[..., self.row] for v in values)
        return float(entry) if entry.ndim == 0 else entry if self.component is None else float(entry[self.component])

    def one_hot(self) -> list[np.ndarray]:
        """NumPy arrays with the shapes of `self.arrays` that are 1 at this place and 0 elsewhere, as a list."""
        hot = [np.zeros(np.array(v).shape) for v in self.arrays]
        for h in hot:
            h[(Ellipsis, self.row) if self.component is None else (self.component, self.row)] = 1
        return hot


class AddressIndex:
    """Maps the addresses of a scene to places in its packed arrays."""

    def __init__(self, scene: Scene, packed: Packed):
        self.scene, self.packed = scene, packed

    def row_of(self, section: tuple[Columns, ...] | tuple[LightColumns, ...], name: str) -> tuple[int, int]:
        """Number of the batch that contains an object or a light, and the row in this batch. Raises KeyError if there
        is none.

        section: batches of all objects, or batches of all lights
        name: name of the object or light
        """
        for number, batch in enumerate(section):
            if (row := batch.names.row(name)) is not None:
                return number, row
        raise KeyError(name)

    def slot(self, address: str) -> Slot:
        """The place of the value at `address`. Raises UserError if the picture does not depend smoothly on this value,
        or if the address names more than one number or triple."""
        parts, packed = address.split("."), self.packed
        head, name, field = (parts + ["", ""])[:3]
        if isinstance(value := addresses.value(self.scene, address), dict) or is_dataclass(value):
            raise UserError(f"{address}: is not one number or three; name one of its parts")
        if head == "ambient":
            return Slot((packed.ambient,), 0, int(name) if name else None)
        if head == "background":
            plain, sky = not isinstance(self.scene.background, SkyGradient), packed.background
            colours = (sky.top, sky.bottom) if plain else (getattr(sky, name or "top"),)
            rest = name if plain else field
            return Slot(colours, 0, int(rest) if rest else None)
        if head == "camera":
            table, row, field, rest = packed.camera, 0, name, parts[2:]
        elif head == "materials":
            table, row, rest = packed.materials, list(materials_of(self.scene)).index(name), parts[3:]
        elif head == "objects":
            return self._of_object(name, parts[2:])
        elif head == "lights":
            number, row = self.row_of(packed.lights, name)
            table, rest = packed.lights[number].numbers, parts[3:]
        elif address == "settings.occlusion.distance":
            table, row, rest = packed.occlusion, 0, parts[3:]
        else:
            raise UserError(f"{address}: is not a number that a picture depends on smoothly")
        if field not in quantities(type(table)):
            raise UserError(f"{address}: has no derivative; those of {head} are {', '.join(quantities(type(table)))}")
        return Slot((getattr(table, field),), row, int(rest[0]) if rest else None)

    def _of_object(self, name: str, path: list[str]) -> Slot:
        """The place of one value of an object. Raises UserError if the value has no derivative.

        name: name of the object
        path: rest of the address after this name, split at the dots
        """
        obj = self.scene.objects[name]
        number, row = self.row_of(self.packed.batches, name)
        batch = self.packed.batches[number]
        columns = batch.kind.columns(obj, batch.numbers)
        for field, column in columns.items():
            size = len(field.split("."))
            if ".".join(path[:size]) == field:
                return Slot((column,), row, int(path[size]) if path[size:] else None)
        known = ", ".join(columns) or "none of its own"
        raise UserError(f"objects.{name}.{'.'.join(path)}: has no derivative; those of a {obj.type} are {known}")
