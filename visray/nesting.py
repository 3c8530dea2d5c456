"""The order of the transparent solids of a scene, which decides whose medium counts where several of them overlap.

The solid with the highest priority counts (Material.priority); of equal priorities, the one with the smallest volume;
of equal volumes, the first one in the scene. The place of a solid in this order is its rank; the lowest rank counts. So
kernels compare whole numbers, and a priority is a value: another one compiles nothing.

Source: Schmidt and Budge, Simple Nested Dielectrics in Ray Traced Images, 2002.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.columns import Columns, materials_of
from visray.pytree import detached
from visray.quantities import Arrays
from visray.scene.scene import Scene

# Volumes are compared by their first binary digits, so that rounding decides nothing between equal solids. A volume is
# a product of a few lengths, a determinant, and numbers such as pi: its rounding error is less than 2^-46 of it. The
# volume that a mesh encloses is a sum over its faces; it has about as many correct digits.
DIGITS = 40


@dataclass(frozen=True)
class Solids:
    """The solids of a batch, or of several, as NumPy arrays with one entry for each solid.

    priority: priority of its material
    volume: its volume; 0 for solids of opaque materials, whose rank is not used
    error: bound on the error of the volume, apart from rounding
    number: its number in the scene
    """

    priority: np.ndarray
    volume: np.ndarray
    error: np.ndarray
    number: np.ndarray

    def rounded_volume(self) -> np.ndarray:
        """The volumes, rounded to DIGITS binary digits."""
        mantissa, exponent = np.frexp(self.volume)
        return np.ldexp(np.round(np.ldexp(mantissa, DIGITS)), exponent - DIGITS)

    def order(self) -> np.ndarray:
        """Indices of the solids, by rank."""
        return np.lexsort((self.number, self.rounded_volume(), -self.priority))

    def at(self, index: np.ndarray) -> "Solids":
        """The solids with these indices."""
        return Solids(*(getattr(self, name)[index] for name in Solids.__dataclass_fields__))

    @staticmethod
    def joined(parts: Sequence["Solids"]) -> "Solids":
        """All solids of several batches."""
        return Solids(*(np.concatenate([getattr(part, f) for part in parts]) for f in Solids.__dataclass_fields__))


def solids_of(scene: Scene, columns: Columns) -> Solids:
    """The solids of one batch. Domain: batches of a closed kind."""
    materials = list(materials_of(scene).values())
    material, size = np.array(columns.material).astype(int), len(columns)
    volume = error = np.zeros(size)
    if any(any(materials[i].kt) for i in np.unique(material)):
        volume, error = (
            np.broadcast_to(np.array(x, float), size)
            for x in columns.kind.volumes(detached(columns.numbers), detached(columns.outer))
        )
    priority = np.array([m.priority for m in materials], float)[material]
    return Solids(np.broadcast_to(priority, size), volume, error, np.broadcast_to(np.array(columns.object), size))


def ranks(scene: Scene, batches: Sequence[Columns], a: Arrays) -> list[Any]:
    """For each batch, the ranks of its rows; None for batches of an open kind."""
    closed = [columns for columns in batches if columns.kind.closed]
    if not closed:
        return [None] * len(batches)
    order = Solids.joined([solids_of(scene, columns) for columns in closed]).order()
    rank = np.empty(len(order), np.uint32)
    rank[order] = np.arange(len(order), dtype=np.uint32)
    ends = iter(np.split(rank, np.cumsum([len(columns) for columns in closed])[:-1]))
    found = [a.put(a.U, next(ends)) if columns.kind.closed else None for columns in batches]
    dr.eval(*[x for x in found if x is not None])
    return found
