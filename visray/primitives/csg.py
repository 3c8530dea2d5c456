"""Constructive solid geometry (CSG): objects that are made of other objects."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

from visray.geometry import Frame
from visray.operands import Operands, named_operands
from visray.primitives.csg_body import CsgBody
from visray.primitives.csg_bounds import Hull, hull_of
from visray.primitives.csg_clusters import clustered
from visray.primitives.csg_form import Form, form_of
from visray.primitives.primitive import Bounds, Primitive
from visray.records import record_kind


@record_kind
@dataclass(frozen=True, kw_only=True)
class Csg(Primitive):
    """A solid that is made of other solids, its operands `of`: a list, or solids by name. Operands can be of any closed
    kind, a plane (the half-space that its normal points away from), or CSG again.

    `op`: `union` and `merge` are all points of any operand, `intersection` the points of all operands, `difference` the
    points of the first operand that are in no other one.
    A `union` is one solid, as a `merge` is, unless an operand is transparent or there are more than 64 operands. Then
    each operand is drawn as a body of its own, with its surfaces inside the others; all bodies have the union's name.
    Where faces of one solid coincide, that of the first operand is seen. Where faces of bodies coincide, either may be.
    `ends`: if "capped", the result is a solid. If "open", only the surface of the first operand is kept, with a hole
    wherever the others cut it; so is a first operand that is no solid, such as a disk.
    """

    type: Literal["csg"] = "csg"
    op: Literal["union", "intersection", "difference", "merge"] = field(kw_only=False)
    of: Operands = field(kw_only=False)
    ends: Literal["capped", "open"] = "capped"

    composite = True

    @cached_property
    def form(self) -> Form:
        """The structure of the object. Domain: objects without instances and cuts (csg_resolved.py)."""
        return clustered(form_of(self))

    @cached_property
    def hull(self) -> Hull:
        """A box and a ball that contain the object, after its transform. Domain: as for `form`."""
        return hull_of(self.form)

    @property
    def kind(self) -> Any:
        return CsgBody.kind_of(self.form)

    @property
    def closed(self) -> bool:
        """Whether the object is a solid."""
        return self.ends == "capped" and next(iter(named_operands(self.of).values())).operand_kind.closed

    @property
    def bounded(self) -> bool:
        """Whether the object has a bounding box."""
        return self.kind.bounded

    def advice_for_solid(self) -> str:
        return 'leave "ends" out, and let its first operand be a solid'

    def bounds(self, outer: Frame | None) -> Bounds:
        # This is only for bounding_box, outside of kernels; kernels use CsgTable.bounds.
        return Bounds(self.hull.low, self.hull.high, self.hull.centre, self.hull.radius)

    def mitsuba(self) -> str:
        return "Mitsuba has no CSG"
