"""Constructive solid geometry (CSG): objects that are made of other objects."""

from dataclasses import dataclass
from typing import Literal

from visray.operands import Operands
from visray.primitives.primitive import Primitive


@dataclass(frozen=True, kw_only=True)
class Csg(Primitive):
    """A solid that is made of other solids, its operands `of`: a list, or solids by name. Operands can be of any closed
    kind, a plane (the half-space that its normal points away from), or CSG again.

    `op`: `union` and `merge` are all points of any operand, `intersection` the points of all operands, `difference` the
    points of the first operand that are in no other one. Where operands are transparent, `union` keeps the surfaces
    inside, and `merge` does not.
    `ends`: if "capped", the result is a solid. If "open", only the surface of the first operand is kept, with a hole
    wherever the others cut it; so is a first operand that is no solid, such as a disk.
    """

    type: Literal["csg"] = "csg"
    op: Literal["union", "intersection", "difference", "merge"]
    of: Operands
    ends: Literal["capped", "open"] = "capped"
