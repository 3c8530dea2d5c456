"""Batches as kernels read them: objects that share their code, placed in the world.

Words of all code that runs in kernels:

row: one object, as an entry of the kernel's tables. Rows are numbered through the whole scene, batch after batch.
batch: rows of one kind that share their code, either all with a transform or all without one
lane: one entry of a Dr.Jit array, for one ray or one pixel. A kernel computes all lanes in parallel; a packet is the
    group of lanes that the processor computes with one instruction (SIMD).
part: one smooth piece of a row's surface, such as a face of a box (ray.py)
attached, detached: with derivatives, without derivatives (pytree.py)
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from visray.columns import BackSide, Columns, Looks, Names
from visray.data.row_table import NO_ROW
from visray.geometry import SimilarityInverse, gamma, l1_norm
from visray.materials import Material
from visray.primitives.primitive import Primitive
from visray.pytree import Packets, detached, evaluated, rows


@dataclass(frozen=True)
class Batch:
    """Rows of one kind that share their code.

    kind: class of the objects
    names: names of the rows
    first_row: number of the batch's first row among all rows of the scene
    placed: data of all rows that depends on no ray, as Primitive.placed returns it
    low, high: corners of each row's bounding box; None for unbounded kinds
    centre, radius: bounding ball of each row; None for unbounded kinds
    coordinate_bound: size of each row's world coordinates, from which rounding bounds are computed: |centre| + radius
        for bounded kinds, |origin of the frame| for unbounded kinds, where |v| is geometry.l1_norm. One number for all
        rows of meshes
    object_of: number of each row's object among the objects of the batch; None if each row is an object
    material: material of each object
    texture: number of each object's texture, or NO_TEXTURE
    rank: place of each row in the order of solids (nesting.py): where transparent solids overlap, that with the lowest
        rank counts. None for open kinds, and in scenes without nested media
    packets: the materials once more, in packets, and then those of the backs; None if there are few, or if derivatives
        are asked for
    object: number of each object in the scene
    back: what each object shows on its back; None if this is what it shows on its front
    looks: materials and textures of the operands of CSG; None for other kinds
    """

    kind: type[Primitive]
    names: Names
    first_row: int
    placed: Any
    low: Any
    high: Any
    centre: Any
    radius: Any
    coordinate_bound: Any
    object_of: Any
    material: Material
    texture: Any
    object: Any
    rank: Any = None
    packets: Packets | None = None
    back: BackSide | None = None
    looks: Looks | None = None

    def __len__(self) -> int:
        return len(self.names)

    def has(self, row: Any) -> Any:
        """Mask of the lanes whose row belongs to this batch. row: number among all rows of the scene."""
        return (row >= self.first_row) & (row < self.first_row + len(self))

    def rows_at(self, i: Any) -> "Batch":
        """The rows with numbers `i` in this batch, one for each lane, as a Batch. Only `placed`, `centre`, `radius` and
        `rank` are filled; all other arrays are None."""
        return Batch(
            self.kind, self.names, self.first_row, *rows((self.placed, None, None, self.centre, self.radius), i),
            coordinate_bound=None, object_of=None, material=None, texture=None, object=None, rank=rows(self.rank, i),
        )  # fmt: skip

    def object_at(self, i: Any) -> Any:
        """Number of the object of row `i`, among the objects of the batch; the entry of `material`, `texture` and
        `object` that belongs to the row."""
        if self.object_of is None:
            return i
        u = type(self.object_of)
        return u(0) if dr.width(self.object) == 1 else dr.gather(u, self.object_of, i)

    @property
    def is_ball(self) -> bool:
        """Whether each row is its own bounding ball: a sphere that no transform has stretched."""
        return self.kind.fills_ball and isinstance(self.placed.inverse, SimilarityInverse)

    def part(self, part: Any) -> Any:
        """The part of a hit as an argument for methods of the kind: `part`, or None if the kind has a single part."""
        return None if self.kind.parts == 1 else part


def place(columns: Columns, first_row: int, materials: Material) -> Batch:
    """The batch that `columns` describe, placed in the world and evaluated. Derivatives flow through it.

    first_row: number of the batch's first row among all rows of the scene
    materials: table of all materials of the scene
    """
    numbers, outer = columns.numbers, columns.outer
    placed = numbers.placed(outer)
    low = high = centre = radius = None
    if columns.kind.bounded:
        bounds = numbers.bounds(outer)
        low, high, centre, radius = detached((bounds.low, bounds.high, bounds.centre, bounds.radius))
        coordinate_bound = l1_norm(centre) + radius
        if columns.kind.many_rows:
            coordinate_bound = dr.max(coordinate_bound)
    elif not columns.kind.composite:
        coordinate_bound = dr.detach(l1_norm(placed.inverse.o))
    if columns.kind.composite:
        coordinate_bound = placed.size
    return evaluated(
        Batch(columns.kind, columns.names, first_row, placed, low, high, centre, radius, coordinate_bound,
              columns.object_of, object=columns.object, **_painted(columns, materials))
    )  # fmt: skip


def repainted(batch: Batch, columns: Columns, materials: Material) -> Batch:
    """A placed batch with other materials, evaluated. columns: what it was made from. materials: as in place"""
    return evaluated(replace(batch, **_painted(columns, materials)))


def _painted(columns: Columns, materials: Material) -> dict[str, Any]:
    """The fields of a batch that depend on materials. materials: as in place"""
    material = rows(materials, columns.material)
    if columns.color is not None:
        material = columns.color.applied(material)
    looks = columns.looks and _placed_looks(columns, materials)
    return {"material": material, "texture": columns.texture, "back": _back(columns, materials), "looks": looks}


def _placed_looks(columns: Columns, materials: Material) -> Looks:
    """The looks of operands, placed, with the colours of rows. materials: as in place"""
    looks, color = columns.looks, columns.color
    front, back = rows(materials, looks.material), _back(looks, materials)
    if color is not None:
        front = color.applied(front, looks.row)
        if back is not None:
            # A back that is as the front has the same colour.
            same = looks.back.material == looks.material
            back = replace(back, material=color.applied(back.material, dr.select(same, looks.row, NO_ROW)))
    return replace(looks, material=front, back=back, row=None)


def _back(columns: Columns | Looks, materials: Material) -> BackSide | None:
    """The backs of objects or looks, placed; None if they are all as the fronts. materials: as in place"""
    back = columns.back
    if back is None or np.array_equal(back.material, columns.material):
        return None
    return BackSide(rows(materials, back.material), back.texture)


def boxes(batch: Batch) -> tuple[np.ndarray, np.ndarray]:
    """Corners (low, high) of the rows' boxes, moved outwards by their rounding error. Shapes: (rows, 3) each."""
    low, high = np.array(batch.low, float).T, np.array(batch.high, float).T
    # Corners are sums of at most eight products of numbers no greater than the coordinate bound.
    error = gamma(16) * np.broadcast_to(np.array(batch.coordinate_bound, float), len(low))[:, None]
    return low - error, high + error
