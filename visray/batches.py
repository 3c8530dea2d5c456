"""Batches: rows that share their code, placed in the world, as kernels read them."""

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
    """Rows of a kind that share their code.

    base: the number of its first row among all rows of the scene.
    placed: the kind's own record, an entry a row.
    low, high, centre, radius: as primitives.primitive.Bounds; None of unbounded kinds.
    span: no coordinate that a row is made of is greater, up to a factor that rounding bounds allow for.
    material, texture: an entry a row. object: the number of its object in the scene.
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
        """Whether a row of the scene is one of the batch."""
        return (row >= self.first_row) & (row < self.first_row + len(self))

    def rows_at(self, i: Any) -> "Batch":
        """Some rows of the batch, by their numbers in it: where they are."""
        return Batch(
            self.kind, self.names, self.first_row, *rows((self.placed, None, None, self.centre, self.radius), i),
            coordinate_bound=None, material=None, texture=None, object=None,
        )  # fmt: skip

    def part(self, part: Any) -> Any:
        """A hit's part, as the kind takes it: None where it has one part only."""
        return None if self.kind.parts == 1 else part


def place(columns: Columns, base: int, materials: Material) -> Batch:
    """A batch in the world, evaluated. Derivatives flow through it."""
    numbers, outer = columns.numbers, columns.outer
    where = numbers.placed(outer)
    low = high = centre = radius = None
    if columns.kind.bounded:
        bounds = numbers.bounds(outer)
        low, high, centre, radius = detached((bounds.low, bounds.high, bounds.centre, bounds.radius))
        span = l1_norm(centre) + radius
    else:
        span = dr.detach(l1_norm(where.inverse.o))
    material = rows(materials, columns.material)
    return evaluated(
        Batch(columns.kind, columns.names, base, where, low, high, centre, radius, span, material, columns.texture,
              columns.object)
    )  # fmt: skip


def boxes(batch: Batch) -> tuple[np.ndarray, np.ndarray]:
    """The corners of the boxes around a batch's rows, beyond their own rounding. Shapes: (rows, 3) each."""
    low, high = np.array(batch.low, float).T, np.array(batch.high, float).T
    # Corners are sums of at most eight products of numbers no greater than the span.
    off = gamma(16) * np.broadcast_to(np.array(batch.coordinate_bound, float), len(low))[:, None]
    return low - off, high + off
