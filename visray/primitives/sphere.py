"""The sphere."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame, Similarity
from visray.primitives.convex import ConvexSolid, Interval
from visray.primitives.primitive import MitsubaShapes, half_extents, identity, scalars, to_world_matrix
from visray.quantities import Length, Point
from visray.records import record_kind
from visray.transforms import compose


def sphere_uv(local: Any) -> tuple[Any, Any]:
    """(u, v): longitude and latitude of a point about the origin.

    u is 0.5 at +x and grows eastwards; v is 0 at the south pole (-y) and 1 at the north pole (+y).
    """
    u = 0.5 - dr.atan2(local.z, local.x) * (0.5 / dr.pi)
    return u, dr.atan2(local.y, dr.norm(type(local)(local.x, 0, local.z))) * (1 / dr.pi) + 0.5


class UnitSphere(ConvexSolid):
    """The unit sphere in a frame: the base class of Sphere and Ellipsoid.

    uv: as sphere_uv, in coordinates of the frame.
    """

    smooth = True
    v_ends = True

    @staticmethod
    def extents(to_world: Frame | Similarity, shape: tuple) -> tuple[Any, Any]:
        return to_world.max_stretch(), half_extents(to_world, "", "xyz")

    @staticmethod
    def canonical_volume(shape: tuple) -> Any:
        return 4 / 3 * dr.pi

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The interval inside the unit sphere.

        The origin is moved to the point of the line nearest to the centre, where no digits cancel.

        Source: Hearn and Baker; Haines.
        """
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
        f = scalars(self).frame().then(identity())
        # In Mitsuba the poles are on the z axis, u begins at the x axis, and v is 0 at the north pole.
        matrix = to_world_matrix(Frame(-f.x, f.z, f.y, f.o), compose(self.transform))
        return MitsubaShapes([{"type": "sphere", "to_world": matrix}], uv=lambda uv: (uv[0], 1 - uv[1]))


@record_kind
@dataclass(frozen=True, kw_only=True)
class Sphere(UnitSphere):
    """A sphere of `radius` about `center`.

    uv: u is 0.5 at +x and grows eastwards; v is 0 at the south pole (-y) and 1 at the north pole (+y).
    """

    fills_ball = True

    type: Literal["sphere"] = "sphere"
    center: Point = field(default=(0.0, 0.0, 0.0), kw_only=False)
    radius: Length = field(default=1.0, kw_only=False)

    def frame(self) -> Similarity:
        return Similarity(self.radius, self.center)
