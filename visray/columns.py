"""Columns: objects that share their code, as arrays with one entry for each row. Batches are made of them."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from visray.geometry import Frame
from visray.materials import Material
from visray.primitives.csg_operands import Operand
from visray.primitives.primitive import Primitive
from visray.quantities import Arrays
from visray.scene.scene import Scene
from visray.textures import row_number

NO_TEXTURE = 0xFFFFFFFF


class Names:
    """Names of a batch's rows: either listed, or made of a prefix and numbers in increasing order, such as t0, t2, t2,
    t3. Rows with the same number are parts of one object.

    If `counts` is given, each listed name belongs to so many rows in a row, such as the triangles of a mesh.
    """

    def __init__(
        self,
        listed: tuple[str, ...] = (),
        prefix: str = "",
        numbers: np.ndarray | None = None,
        counts: tuple[int, ...] | None = None,
    ):
        self.listed, self.prefix, self.numbers = listed, prefix, numbers
        self.ends = None if counts is None else np.cumsum(counts)
        rows = len(listed if numbers is None else numbers)
        self.count = rows if counts is None else int(self.ends[-1])

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, row: int) -> str:
        if not 0 <= row < self.count:
            raise IndexError(row)
        if self.ends is not None:
            return self.listed[np.searchsorted(self.ends, row, side="right")]
        return self.listed[row] if self.numbers is None else f"{self.prefix}{self.numbers[row]}"

    @cached_property
    def _rows(self) -> dict[str, int]:
        first = range(len(self.listed)) if self.ends is None else [0, *self.ends[:-1].tolist()]
        return dict(zip(self.listed, first))

    def row(self, name: str) -> int | None:
        """The row with this name, the first one if there are several; None if there is none."""
        if self.numbers is None:
            return self._rows.get(name)
        number = name.removeprefix(self.prefix)
        if not (name.startswith(self.prefix) and number.isdecimal() and str(int(number)) == number):
            return None
        row = int(np.searchsorted(self.numbers, int(number)))
        return row if row < self.count and self.numbers[row] == int(number) else None

    def repeats(self, row: int) -> int:
        """Number of rows from this one on that have its number; 1 if the names are listed."""
        if self.numbers is None:
            return 1
        return int(np.searchsorted(self.numbers, self.numbers[row], side="right")) - row


@dataclass(frozen=True)
class BackSide:
    """What objects show on the side that their normals point away from (Material.back). An object whose material has no
    back has the same there as on the front.

    material, texture: as in Columns; in a Batch, `material` is a table of materials
    """

    material: Any
    texture: Any


@dataclass(frozen=True)
class Looks:
    """What the surfaces of operands look like.

    of: for each operand of all objects of a batch, the number of its look.
    material, texture, back: as in Columns and Batch, with an entry for each look.
    row: for each look the row that has its colour (Columns.color), or NO_ROW (data/row_table.py); None if
        rows have no colours.
    """

    of: Any
    material: Any
    texture: Any
    back: BackSide | None
    row: Any = None


@dataclass(frozen=True)
class Columns:
    """Objects that share their code, as arrays with one entry for each row. They come from a scene, or from any other
    source of columns.

    kind: class of the objects; objects with a transform and objects without one form two batches
    names: names of the rows
    numbers: the kind's fields, as arrays
    outer: transforms of the rows; None for a batch without transforms
    object_of: number of each row's object among the objects of the batch, if rows are parts of objects, such as the
        triangles of meshes; None if each row is an object
    material, texture: number of each object's material, and of its texture's row in the atlas (textures.row_number)
    back: what each object shows on its back; None if no material of the scene has a back
    object: number of each object, in the order of Scene.all_objects; the segments of a line of data have the same one
    color: colour of each row, in linear light; None if rows have the colours of their materials
    looks: looks of the operands, for CSG; else None
    bodies: for data layers whose gizmos are geometries, the bodies of each gizmo that are in this batch; else empty
    """

    kind: type[Primitive]
    names: Names
    numbers: Any
    outer: Frame | None
    object_of: Any
    material: Any
    texture: Any
    back: BackSide | None
    object: Any
    color: Any = None
    looks: Looks | None = None
    bodies: tuple[Operand, ...] = ()

    def __len__(self) -> int:
        return len(self.names)


def materials_of(scene: Scene) -> dict[str, Material]:
    """The materials by name; the default material is the first."""
    return {"default": Material()} | scene.materials


def sides(scene: Scene, a: Arrays, named: Iterable[tuple[str, bool]], repeats: int = 1) -> dict[str, Any]:
    """The fields `material`, `texture` and `back` of Columns or Looks, as a dict.

    named: for each object or look the name of its material, and whether v ends at poles (Primitive.v_ends)
    repeats: how many objects in a row have each of these
    """
    named, materials = list(named), materials_of(scene)
    index = {name: i for i, name in enumerate(materials)}
    texture_of = {v_ends: texture_rows(scene, v_ends) for v_ends in {v_ends for _, v_ends in named}}

    def numbers(names: Iterable[str]) -> tuple[Any, Any]:
        pairs = [(index[name], texture_of[v_ends][name]) for name, (_, v_ends) in zip(names, named)]
        return tuple(a.put(a.U, x) for x in np.repeat(np.array(pairs, np.uint32), repeats, axis=0).T)

    material, texture = numbers(name for name, _ in named)
    two_sided = any(m.back for m in materials.values())
    back = BackSide(*numbers(materials[name].back or name for name, _ in named)) if two_sided else None
    return {"material": material, "texture": texture, "back": back}


def texture_rows(scene: Scene, v_ends: bool) -> dict[str, int]:
    """Number of the atlas row of each material's texture, or NO_TEXTURE, as a dict by the name of the material.

    v_ends: whether it is for kinds whose v ends at poles (Primitive.v_ends)
    """
    number = {name: i for i, name in enumerate(scene.textures)}
    return {
        name: row_number(number[m.texture], len(number), v_ends, m.keeps_ka) if m.texture else NO_TEXTURE
        for name, m in materials_of(scene).items()
    }
