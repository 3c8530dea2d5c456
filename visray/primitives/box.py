"""The box."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr

from visray.geometry import Frame
from visray.primitives.primitive import Twin, boxed_reach, homogeneous
from visray.primitives.solid import Solid, common, slab
from visray.quantities import Point
from visray.transforms import compose


@dataclass(frozen=True, kw_only=True)
class Box(Solid):
    """All points between two corners, `min` and `max`; turn it with a transform.

    uv: each face from 0 to 1, upright and unmirrored when looked at from outside (top and bottom with -z and +z up).
    """

    type: Literal["box"] = "box"
    min: Point = (-0.5, -0.5, -0.5)
    max: Point = (0.5, 0.5, 0.5)

    def flaws(self) -> list[tuple[str, str]]:
        flat = [axis for axis, low, high in zip("xyz", self.min, self.max) if not high > low]
        return [("max", f"must be greater than min in {', '.join(flat)}")] if flat else []

    def frame(self) -> Frame:
        h, w = 0.5 * (self.max - self.min), type(self.min)
        return Frame(w(h.x, 0, 0), w(0, h.y, 0), w(0, 0, h.z), 0.5 * (self.min + self.max))

    @staticmethod
    def reach(whole: Frame) -> Any:
        return boxed_reach(whole)

    @staticmethod
    def interval(o: Any, d: Any, squared: Any) -> tuple[Any, Any]:
        """The common part of three slabs."""
        return common(slab(o.x, d.x), common(slab(o.y, d.y), slab(o.z, d.z)))

    @staticmethod
    def faces(p: Any) -> tuple[Any, Any]:
        """Masks of the x and y faces; where neither holds it is a z face."""
        a = dr.abs(p)
        on_x = (a.x >= a.y) & (a.x >= a.z)
        return on_x, ~on_x & (a.y >= a.z)

    @classmethod
    def depth(cls, p: Any) -> tuple[Any, Any]:
        on_x, on_y = cls.faces(p)
        on_z = ~(on_x | on_y)
        axis = type(p)(
            *(dr.select(m, dr.copysign(type(p.x)(1), x), 0) for m, x in zip((on_x, on_y, on_z), (p.x, p.y, p.z)))
        )
        return dr.dot(axis, p) - 1, axis

    @classmethod
    def uv(cls, placed: Any, p: Any) -> tuple[Any, Any]:
        q = placed.point(p)
        on_x, on_y = cls.faces(q)
        u = dr.select(on_x, -dr.copysign(q.z, q.z * q.x), dr.select(on_y, q.x, dr.copysign(q.x, q.x * q.z)))
        v = dr.select(on_y, -dr.copysign(q.z, q.z * q.y), q.y)
        return 0.5 + 0.5 * u, 0.5 + 0.5 * v

    def mitsuba(self) -> Twin | str:
        f = self.numbers().frame()
        shapes = []
        for n, u, v in _FACES:
            face = Frame(*(f.x * e[0] + f.y * e[1] + f.z * e[2] for e in (u, v, n)), f.o)
            face = Frame(face.x, face.y, face.z, f.o + face.z)
            shapes.append({"type": "rectangle", "to_world": homogeneous(face, compose(self.transform))})
        return Twin(shapes)


# Each face of the box: its normal, and the directions of u and v on it.
_FACES = (
    ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
)
