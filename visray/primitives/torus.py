"""The torus: a polynomial of degree 4 with fields of its own."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame, tangents
from visray.primitives.algebraic import PlacedPolynomial
from visray.primitives.clips import Block
from visray.primitives.polynomial import Polynomial
from visray.primitives.polynomial_solid import PolynomialSolid
from visray.primitives.primitive import MitsubaShapes, half_extents, scalars, to_world_matrix
from visray.primitives.revolved import angle_u
from visray.quantities import Direction, Length, Point
from visray.transforms import compose

# (x^2 + y^2 + z^2 + R^2 - r^2)^2 - 4 R^2 (x^2 + y^2) written so that no greater numbers are subtracted than R^2: as
# above, R^4 would be, and on a thin ring the surface would be R/r times less exact.
EQUATION = "(x^2 + y^2 + z^2 - R^2 - r^2)^2 - 4*R^2*(r^2 - z^2)"
# Half the sides of the clip, over those of the box around the torus: rounding cuts none of it, however far the eye is.
ROOM = 1 + 2.0**-7


@dataclass(frozen=True, kw_only=True)
class Torus(PolynomialSolid):
    """A ring about `axis`: all points within `minor` of a circle of radius `major` about `center`.

    uv: u around the axis, eastwards, as on the cylinder; v around the tube: 0.5 at the outermost circle, growing
    upwards along the axis. Both have a seam where 1 meets 0: u across the tube, opposite to 0.5; v along the innermost
    circle.
    """

    smooth = True
    parameters = ("major", "minor")

    type: Literal["torus"] = "torus"
    center: Point = (0.0, 0.0, 0.0)
    axis: Direction = (0.0, 1.0, 0.0)
    major: Length = 1.0
    minor: Length = 0.4

    def flaws(self) -> list[tuple[str, str]]:
        return [] if self.minor < self.major else [("minor", "must be less than major")]

    def definition(self) -> Polynomial:
        half = ROOM * (self.major + self.minor), ROOM * (self.major + self.minor), ROOM * self.minor
        return Polynomial(
            expression=EQUATION,
            parameters={"R": self.major, "r": self.minor},
            clip=Block(min=tuple(-x for x in half), max=half),
            ends="capped",
        )

    def frame(self) -> Frame:
        n = dr.normalize(self.axis)
        return Frame(*tangents(n), n, self.center)

    def shape(self) -> tuple:
        return self.major, self.minor

    @staticmethod
    def extents(whole: Frame, shape: tuple) -> tuple[Any, Any]:
        """Those of a circle and a ball, whose points are added up."""
        major, minor = shape
        across = Frame(whole.x, whole.y, 0 * whole.z, whole.o)
        reach = major * across.longest() + minor * whole.longest()
        return reach, major * half_extents(whole, "", "xy") + minor * half_extents(whole, "", "xyz")

    @staticmethod
    def uv(placed: PlacedPolynomial, p: Any, part: Any = None) -> tuple[Any, Any]:
        q = placed.inverse.point(p)
        return angle_u(q), 0.5 + dr.atan2(q.z, dr.sqrt(q.x * q.x + q.y * q.y) - placed.shape[0]) * (0.5 / dr.pi)

    def mitsuba(self) -> MitsubaShapes | str:
        f, size = scalars(self).frame(), self.major
        whole = to_world_matrix(Frame(size * f.x, size * f.y, size * f.z, f.o), compose(self.transform))
        return MitsubaShapes([{"type": "torus", "shape": self.minor / self.major, "to_world": whole}])
