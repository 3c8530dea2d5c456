"""The structures of several CSG objects of one kind, in Python. Their numbers are in csg_table.py."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.primitives.csg_bounds import Trees
from visray.primitives.csg_form import PART_BITS, Form
from visray.transforms import composed


class Structure:
    """Something in Python that belongs to a table, and that functions of tables (pytree.py) leave alone."""

    def __init__(self, value: Any):
        self.value = value


@dataclass(frozen=True)
class Objects:
    """The structures of CSG objects of one kind, in Python.

    surface, within: trees of the surfaces, and of the points at which these are kept; None if all of them is.
    counts: number of leaves of each object.
    bodies: the objects without their transforms, as Form.body.
    factors: factor by which the transform of each object changes volumes.
    bits: number of bits of a code for a leaf's own part (csg_body.py).

    Raises UserError if there are more leaves than codes.
    """

    surface: Trees
    within: Trees | None
    counts: np.ndarray
    bodies: Sequence[Any]
    factors: np.ndarray
    bits: int

    def __post_init__(self) -> None:
        # The last code stands for no leaf (csg_state.NO_LEAF).
        count, most = int(self.counts.sum()), (1 << 32 - self.bits) - 1
        if count > most:
            text = f"CSG objects with meshes of more than {1 << self.bits - PART_BITS} triangles have {count} operands"
            raise UserError(f"objects: {text} together; at most {most} fit; use fewer objects, or fewer triangles")

    @staticmethod
    def of(forms: Sequence[Form], surface: Sequence[Any], within: Sequence[Any] | None) -> "Objects":
        """The structures of several objects. surface, within: their trees, with leaves numbered through all objects."""
        trees = (None if x is None else Trees.of(x) for x in (surface, within))
        counts = np.array([len(form.leaves) for form in forms])
        factors = volume_factors(composed([form.steps for form in forms]))
        return Objects(*trees, counts, [form.body for form in forms], factors, forms[0].part_bits)

    def repeated(self, frames: np.ndarray) -> "Objects":
        """Copies of all objects, moved by the first one of the frames, then copies moved by the second one, and so on.
        Shape: (copies, 3, 4)."""
        count, objects, leaves = len(frames), len(self.counts), int(self.counts.sum())
        trees = (None if x is None else x.repeated(count, objects, leaves) for x in (self.surface, self.within))
        factors = np.outer(volume_factors(frames), self.factors).ravel()
        return Objects(*trees, np.tile(self.counts, count), self.bodies * count, factors, self.bits)

    def originals(self) -> np.ndarray:
        """For each object the number of the first one that differs from it by its transform alone."""
        first: dict[Any, int] = {}
        return np.array([first.setdefault(_key(body), i) for i, body in enumerate(self.bodies)])

    def firsts(self) -> np.ndarray:
        """Number of the first leaf of each object."""
        return np.cumsum(self.counts) - self.counts


def _key(body: Any) -> Any:
    """A key that is the same only for equal bodies."""
    try:
        hash(body)
    except TypeError:
        # Operands with tables or dicts in them. All instances of a geometry have the same operands.
        return body.op, body.ends, tuple(map(id, body.of))
    return body


def volume_factors(matrices: np.ndarray) -> np.ndarray:
    """The factors by which affine maps change volumes. Shapes: (N, 3, 4) and (N)."""
    return np.abs(np.linalg.det(matrices[:, :, :3]))
