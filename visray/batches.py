"""Batches as kernels read them: rows of one kind, placed in the world."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.geometry import gamma, l1_norm
from visray.materials import Material
from visray.pack import Columns, Names
from visray.primitives.primitive import Primitive
from visray.pytree import detached, evaluated, rows


@dataclass(frozen=True)
class Batch:
    """Rows of one kind that share their code.

    names: names of the rows
    first_row: number of the batch's first row among all rows of the scene
    placed: the kind's own record of placed rows
    low, high: corners of each row's bounding box; None for unbounded kinds
    centre, radius: bounding ball of each row; None for unbounded kinds
    coordinate_bound: no coordinate of a row is greater, up to a factor that the rounding bounds allow for
    material: material of each row
    texture: number of each row's texture, or NO_TEXTURE
    object: number of each row's object in the scene
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
    material: Material
    texture: Any
    object: Any

    def __len__(self) -> int:
        return len(self.names)

    def has(self, row: Any) -> Any:
        """Whether a row of the scene belongs to the batch."""
        return (row >= self.first_row) & (row < self.first_row + len(self))

    def rows_at(self, i: Any) -> "Batch":
        """Only the placed records and bounding balls of the rows with numbers `i` in the batch."""
        return Batch(
            self.kind, self.names, self.first_row, *rows((self.placed, None, None, self.centre, self.radius), i),
            coordinate_bound=None, material=None, texture=None, object=None,
        )  # fmt: skip

    def part(self, part: Any) -> Any:
        """The part of a hit as the kind expects it: None for kinds with a single part."""
        return None if self.kind.parts == 1 else part


def place(columns: Columns, first_row: int, materials: Material) -> Batch:
    """Places a batch in the world and evaluates it. Derivatives flow through it."""
    numbers, outer = columns.numbers, columns.outer
    placed = numbers.placed(outer)
    low = high = centre = radius = None
    if columns.kind.bounded:
        bounds = numbers.bounds(outer)
        low, high, centre, radius = detached((bounds.low, bounds.high, bounds.centre, bounds.radius))
        coordinate_bound = l1_norm(centre) + radius
    else:
        coordinate_bound = dr.detach(l1_norm(placed.inverse.o))
    material = rows(materials, columns.material)
    return evaluated(
        Batch(columns.kind, columns.names, first_row, placed, low, high, centre, radius, coordinate_bound, material,
              columns.texture, columns.object)
    )  # fmt: skip


def boxes(batch: Batch) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the rows' bounding boxes, enlarged by their own rounding. Shapes: (rows, 3) each."""
    low, high = np.array(batch.low, float).T, np.array(batch.high, float).T
    # Corners are sums of at most eight products of numbers no greater than the coordinate bound.
    error = gamma(16) * np.broadcast_to(np.array(batch.coordinate_bound, float), len(low))[:, None]
    return low - error, high + error
