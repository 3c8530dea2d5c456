"""The axis-aligned box."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame
from visray.primitives.convex import ConvexSolid, Interval, slab
from visray.primitives.primitive import MitsubaShapes, corner_distance, half_extents, scalars, to_world_matrix
from visray.quantities import Point
from visray.records import record_kind
from visray.transforms import compose


@record_kind
@dataclass(frozen=True, kw_only=True)
class Box(ConvexSolid):
    """An axis-aligned box between the corners `min` and `max`. A transform can rotate it.

    uv: from 0 to 1 on each face. Seen from outside, a texture is upright and not mirrored. Its up direction is -z on
    the top face (+y), +z on the bottom face, and +y on all other faces.
    """

    # The parts are the faces, in this order: +x, -x, +y, -y, +z, -z.
    parts = 6

    type: Literal["box"] = "box"
    min: Point = field(default=(-0.5, -0.5, -0.5), kw_only=False)
    max: Point = field(default=(0.5, 0.5, 0.5), kw_only=False)

    def flaws(self) -> list[tuple[str, str]]:
        empty = [axis for axis, low, high in zip("xyz", self.min, self.max) if not high > low]
        return [("max", f"must be greater than min in {', '.join(empty)}")] if empty else []

    def frame(self) -> Frame:
        h, w = 0.5 * (self.max - self.min), type(self.min)
        return Frame(w(h.x, 0, 0), w(0, h.y, 0), w(0, 0, h.z), 0.5 * (self.min + self.max))

    @staticmethod
    def extents(to_world: Frame, shape: tuple) -> tuple[Any, Any]:
        return corner_distance(to_world), half_extents(to_world, "xyz")

    @staticmethod
    def canonical_volume(shape: tuple) -> Any:
        return 8

    @staticmethod
    def interval(o: Any, d: Any, squared: Any, shape: tuple) -> Interval:
        """The interval inside the canonical cube: the intersection of three slabs, one per axis."""
        x, y, z = (slab(p, v, 2 * i + 1, 2 * i) for i, (p, v) in enumerate(zip(o, d)))
        return x.intersection(y.intersection(z))

    @staticmethod
    def part_at(q: Any, shape: tuple) -> Any:
        a, u = dr.abs(q), dr.uint32_array_t(q.x)
        on_x = (a.x >= a.y) & (a.x >= a.z)
        on_y = ~on_x & (a.y >= a.z)
        lower = dr.select(on_x, q.x, dr.select(on_y, q.y, q.z)) < 0
        return dr.select(on_x, u(0), dr.select(on_y, u(2), u(4))) + dr.select(lower, u(1), 0)

    @staticmethod
    def depth(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        side = dr.select((part & 1) == 0, type(q.x)(1), -1)
        axis = type(q)(*(dr.select((part >> 1) == i, side, 0) for i in range(3)))
        return dr.dot(axis, q) - 1, axis

    @staticmethod
    def uv_of(q: Any, part: Any, shape: tuple) -> tuple[Any, Any]:
        upper, on_x, on_y = (part & 1) == 0, part < 2, (part >> 1) == 1
        u = dr.select(on_x, dr.select(upper, -q.z, q.z), dr.select(on_y | upper, q.x, -q.x))
        v = dr.select(on_y, dr.select(upper, -q.z, q.z), q.y)
        return 0.5 + 0.5 * u, 0.5 + 0.5 * v

    def mitsuba(self) -> MitsubaShapes | str:
        f = scalars(self).frame()
        shapes = []
        for n, u, v in _FACES:
            face = Frame(*(f.x * e[0] + f.y * e[1] + f.z * e[2] for e in (u, v, n)), f.o)
            face = Frame(face.x, face.y, face.z, f.o + face.z)
            shapes.append({"type": "rectangle", "to_world": to_world_matrix(face, compose(self.transform))})
        return MitsubaShapes(shapes)


# For each face, in the order of the parts: its normal, the direction of u, the direction of v.
_FACES = (
    ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
)
