"""Places of a scene's addresses in its packed arrays: for derivatives and updates."""

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
    """The place of one address in the packed arrays.

    arrays: arrays that hold the number; a plain background has two, top and bottom
    row: entry in the arrays
    component: 0, 1 or 2, or None for the whole entry
    """

    arrays: tuple[Any, ...]
    row: int
    component: int | None

    def read(self, values: tuple | list) -> Any:
        """The entry in `values`, which are shaped like `arrays`, summed over all of them."""
        entry = sum(np.array(v, float)[..., self.row] for v in values)
        return float(entry) if entry.ndim == 0 else entry if self.component is None else float(entry[self.component])

    def one_hot(self) -> list[np.ndarray]:
        """Arrays that are 1 at the entry and 0 elsewhere."""
        hot = [np.zeros(np.array(v).shape) for v in self.arrays]
        for h in hot:
            h[(Ellipsis, self.row) if self.component is None else (self.component, self.row)] = 1
        return hot


class AddressIndex:
    """Finds the arrays and rows that hold an address of a scene: for derivatives and updates."""

    def __init__(self, scene: Scene, packed: Packed):
        self.scene, self.packed = scene, packed

    def row_of(self, section: tuple[Columns, ...] | tuple[LightColumns, ...], name: str) -> tuple[int, int]:
        """The batch of an object or a light, and its row there."""
        for number, batch in enumerate(section):
            if (row := batch.names.row(name)) is not None:
                return number, row
        raise KeyError(name)

    def slot(self, address: str) -> Slot:
        """The place of the number at `address`. Raises UserError where a picture does not depend smoothly on it."""
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
        """The place of one of an object's numbers. path: the address after the object's name, split at dots."""
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
