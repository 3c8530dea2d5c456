"""The torus: a polynomial surface of degree 4 with fields of its own."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr
import numpy as np

from visray.geometry import Frame, tangents
from visray.primitives.algebraic import PlacedPolynomial
from visray.primitives.clips import Block
from visray.primitives.polynomial import Polynomial
from visray.primitives.polynomial_solid import PolynomialSolid
from visray.primitives.primitive import MitsubaShapes, half_extents, scalars, to_world_matrix
from visray.primitives.revolved import angle_u
from visray.quantities import Direction, Length, Point
from visray.records import record_kind
from visray.transforms import compose

# The usual form (x^2 + y^2 + z^2 + R^2 - r^2)^2 - 4 R^2 (x^2 + y^2) is the same polynomial. But it subtracts numbers of
# size R^4, so the surface of a thin ring would be R/r times less accurate. This form subtracts no numbers above R^2.
EQUATION = "(x^2 + y^2 + z^2 - R^2 - r^2)^2 - 4*R^2*(r^2 - z^2)"
# The clip is larger than the bounding box by this factor. So it never cuts the surface, even if rounding moves it for a
# camera that is far away.
CLIP_MARGIN = 1 + 2.0**-7


@record_kind
@dataclass(frozen=True, kw_only=True)
class Torus(PolynomialSolid):
    """A solid torus about `axis`: all points with a distance up to `minor` from a circle of radius `major`.

    The circle is centred at `center` and perpendicular to `axis`.
    uv: u goes eastwards around the axis, as on the cylinder. v goes around the tube; it is 0.5 at the outermost circle
    and grows from there in the direction of `axis`. u and v jump from 1 to 0 at a seam. The seam of u is the circle
    around the tube opposite to u = 0.5. The seam of v is the innermost circle.
    """

    smooth = True
    parameters = ("major", "minor")
    axis_fields = ("axis",)

    type: Literal["torus"] = "torus"
    center: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    axis: Direction = field(default=(0.0, 1.0, 0.0), kw_only=False)
    major: Length = field(default=1.0, kw_only=False)
    minor: Length = field(default=0.4, kw_only=False)

    def flaws(self) -> list[tuple[str, str]]:
        return [] if self.minor < self.major else [("minor", "must be less than major")]

    def definition(self) -> Polynomial:
        half = (
            CLIP_MARGIN * (self.major + self.minor),
            CLIP_MARGIN * (self.major + self.minor),
            CLIP_MARGIN * self.minor,
        )
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
    def reshaped(q: np.ndarray, was: tuple, now: tuple) -> np.ndarray:
        """As Primitive.reshaped. A point keeps its angle about the axis and its place on the tube, which is scaled."""
        (major, minor), (new_major, new_minor) = was, now
        x, y, z = q.T
        radius, factor = np.hypot(x, y), new_minor / minor
        outwards = (new_major + (radius - major) * factor) / radius
        return np.stack([x * outwards, y * outwards, z * factor], axis=1)

    @staticmethod
    def canonical_volume(shape: tuple) -> Any:
        major, minor = shape
        return 2 * dr.pi * dr.pi * major * minor * minor

    @staticmethod
    def extents(to_world: Frame, shape: tuple) -> tuple[Any, Any]:
        """As Primitive.extents. The torus is the Minkowski sum of a circle and a ball, so both extents are added."""
        major, minor = shape
        flat = Frame(to_world.x, to_world.y, 0 * to_world.z, to_world.o)
        radius = major * flat.max_stretch() + minor * to_world.max_stretch()
        return radius, major * half_extents(to_world, "", "xy") + minor * half_extents(to_world, "", "xyz")

    @staticmethod
    def uv(placed: PlacedPolynomial, p: Any, part: Any = None) -> tuple[Any, Any]:
        q = placed.inverse.point(p)
        return angle_u(q), 0.5 + dr.atan2(q.z, dr.sqrt(q.x * q.x + q.y * q.y) - placed.shape[0]) * (0.5 / dr.pi)

    def mitsuba(self) -> MitsubaShapes | str:
        f, size = scalars(self).frame(), self.major
        matrix = to_world_matrix(Frame(size * f.x, size * f.y, size * f.z, f.o), compose(self.transform))
        return MitsubaShapes([{"type": "torus", "shape": self.minor / self.major, "to_world": matrix}])
