"""The sphere."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
from drjit.scalar import Array3f64

from visray.geometry import Frame, Similarity
from visray.primitives.convex import ConvexSolid, Interval
from visray.primitives.primitive import MitsubaShapes, half_extents, scalars, to_world_matrix
from visray.quantities import Length, Point
from visray.transforms import compose


def sphere_uv(local: Any) -> tuple[Any, Any]:
    """Longitude and latitude as (u, v), as seen from the origin: u is 0.5 at +x and grows eastwards, v upwards."""
    u = 0.5 - dr.atan2(local.z, local.x) * (0.5 / dr.pi)
    return u, dr.atan2(local.y, dr.norm(type(local)(local.x, 0, local.z))) * (1 / dr.pi) + 0.5


class UnitSphere(ConvexSolid):
    """The unit sphere in a frame: what sphere and ellipsoid share. Its poles are on the frame's y axis, like a globe's.

    uv: u is 0.5 at +x and grows eastwards, v is 0 at the south pole and 1 at the north pole.
    """

    smooth = True

    @staticmethod
    def extents(whole: Frame | Similarity, shape: tuple) -> tuple[Any, Any]:
        return whole.longest(), half_extents(whole, "", "xyz")

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """Recentred at the line's point nearest to the centre, where no digits cancel (Hearn and Baker; Haines)."""
        scale = dr.rcp(squared)
        middle = -dr.dot(o, d) * scale
        nearest = dr.fma(middle, d, o)
        half = dr.sqrt((1 - dr.squared_norm(nearest)) * scale)
        return Interval(middle - half, middle + half)

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        return 0.5 * (dr.squared_norm(q) - 1), q

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        return sphere_uv(q)

    def mitsuba(self) -> MitsubaShapes | str:
        f = scalars(self).frame().then(IDENTITY)
        # Mitsuba's poles are on its z axis, its u begins at its x axis, and its v at the north pole.
        whole = to_world_matrix(Frame(-f.x, f.z, f.y, f.o), compose(self.transform))
        return MitsubaShapes([{"type": "sphere", "to_world": whole}], uv=lambda uv: (uv[0], 1 - uv[1]))


# The world's own frame, as scalar values.
IDENTITY = Frame(*(Array3f64(*(float(i == j) for j in range(3))) for i in range(4)))


@dataclass(frozen=True, kw_only=True)
class Sphere(UnitSphere):
    """All points at `radius` from `center`; its poles are on the y axis, like a globe's.

    uv: u is 0.5 at +x and grows eastwards, v is 0 at the south pole and 1 at the north pole.
    """

    type: Literal["sphere"] = "sphere"
    center: Point = (0.0, 0.0, 0.0)
    radius: Length = 1.0

    def frame(self) -> Similarity:
        return Similarity(self.radius, self.center)
