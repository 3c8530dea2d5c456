"""The ellipsoid."""

from dataclasses import dataclass, field
from typing import Literal

from visray.geometry import Frame
from visray.primitives.sphere import UnitSphere
from visray.quantities import Lengths, Point
from visray.records import record_kind


@record_kind
@dataclass(frozen=True, kw_only=True)
class Ellipsoid(UnitSphere):
    """An ellipsoid about `center`, with the half axes `radii` along x, y and z. A transform can rotate it.

    uv: those of a sphere that is stretched to the ellipsoid. u is 0.5 at +x and grows eastwards; v is 0 at the south
    pole (-y) and 1 at the north pole (+y).
    """

    type: Literal["ellipsoid"] = "ellipsoid"
    center: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    radii: Lengths = field(default=(1.0, 0.5, 0.75), kw_only=False)

    def frame(self) -> Frame:
        r, w = self.radii, type(self.radii)
        return Frame(w(r.x, 0, 0), w(0, r.y, 0), w(0, 0, r.z), self.center)
