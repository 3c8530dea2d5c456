"""The triangle."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
import numpy as np

from visray.geometry import Frame, clearly_not_parallel
from visray.primitives.flat import Flat
from visray.primitives.primitive import Bounds, MitsubaShapes, scalars, transform_frame
from visray.quantities import Point


@dataclass(frozen=True)
class PlacedTriangle:
    """A triangle in the world: corners a, b, c and unit normal n."""

    a: Any
    b: Any
    c: Any
    n: Any


@dataclass(frozen=True)
class SeenTriangle:
    """A triangle for rays from one origin: corners a, b, c relative to the ray origin, and unit normal n."""

    a: Any
    b: Any
    c: Any
    n: Any


def _projected(d: Any, v: Any) -> tuple[Any, Any]:
    """The projection of v along d to a plane: two components of d x v.

    The third component is left out. It belongs to the axis along which d has the largest component.
    """
    x, y, z = dr.abs(d.x), dr.abs(d.y), dr.abs(d.z)
    on_x = (x >= y) & (x >= z)
    on_z = ~on_x & (z >= y)
    product = dr.cross(d, v)
    return dr.select(on_x, product.y, product.x), dr.select(on_z, product.y, product.z)


def _area(p: tuple[Any, Any], q: tuple[Any, Any]) -> Any:
    """The cross product p x q of two plane vectors. Its sign is correct, or the result is zero.

    The reason is that both products are rounded before they are subtracted, and rounding keeps their order. A fused
    multiply-add rounds only one of them.
    """
    return p[0] * q[1] - p[1] * q[0]


@dataclass(frozen=True, kw_only=True)
class Triangle(Flat):
    """The triangle with corners a, b, c. Its normal is (b - a) x (c - a).

    uv: a is (0, 0), b is (1, 0), c is (0, 1).

    Meshes of triangles are watertight. A corner is projected to the same place for all triangles that share it. From
    these places, the side on which a ray passes an edge is computed without error. So no ray passes between two
    triangles at a common edge or corner. A ray exactly through an edge or a corner meets all triangles that share it
    (tests/test_primitives.py).
    Source: Woop, Benthin, Wald 2013.
    """

    triangular = True

    type: Literal["triangle"] = "triangle"
    a: Point
    b: Point
    c: Point

    def flaws(self) -> list[tuple[str, str]]:
        if clearly_not_parallel(*(tuple(q - p for p, q in zip(self.a, v)) for v in (self.b, self.c))):
            return []
        a, b, c = (np.array(v, float) for v in (self.a, self.b, self.c))
        ab, ac = np.linalg.norm(b - a), np.linalg.norm(c - a)
        flat = np.linalg.norm(np.cross(b - a, c - a)) <= 8 * np.finfo(float).eps * ab * ac
        return [("c", "the corners must not lie on one line")] if flat else []

    def frame(self) -> Frame:
        x, y = self.b - self.a, self.c - self.a
        return Frame(x, y, dr.normalize(dr.cross(x, y)), self.a)

    def placed(self, outer: Frame | None) -> PlacedTriangle:
        a, b, c = (v if outer is None else outer.point(v) for v in (self.a, self.b, self.c))
        return PlacedTriangle(a, b, c, dr.normalize(dr.cross(b - a, c - a)))

    def bounds(self, outer: Frame | None) -> Bounds:
        p = self.placed(outer)
        centre = (p.a + p.b + p.c) / 3
        squared = [dr.squared_norm(v - centre) for v in (p.a, p.b, p.c)]
        radius = dr.sqrt(dr.maximum(dr.maximum(squared[0], squared[1]), squared[2]))
        low, high = (f(f(p.a, p.b), p.c) for f in (dr.minimum, dr.maximum))
        return Bounds(low, high, centre, radius)

    @staticmethod
    def corners(placed: PlacedTriangle) -> tuple[Any, Any, Any]:
        return placed.a, placed.b, placed.c

    @staticmethod
    def seen(placed: PlacedTriangle, o: Any) -> SeenTriangle:
        return SeenTriangle(placed.a - o, placed.b - o, placed.c - o, placed.n)

    @classmethod
    def intersect_plane(cls, seen: SeenTriangle, d: Any) -> tuple[Any, Any, Any, Any]:
        a, b, c = (_projected(d, v) for v in (seen.a, seen.b, seen.c))
        wa, wb, wc = _area(b, c), _area(c, a), _area(a, b)
        area = wa + wb + wc
        inside = ((wa >= 0) & (wb >= 0) & (wc >= 0)) | ((wa <= 0) & (wb <= 0) & (wc <= 0))
        # t is a weighted mean of the corners' distances along the ray. So it lies between them even if the ray is
        # almost parallel to the plane.
        t = (wa * dr.dot(seen.a, d) + wb * dr.dot(seen.b, d) + wc * dr.dot(seen.c, d)) / area
        return t, inside & (area != 0), dr.dot(seen.n, d), dr.squared_norm(seen.n)

    @staticmethod
    def surface_at(placed: PlacedTriangle, p: Any, part: Any = None) -> tuple[Any, Any]:
        return dr.dot(p - placed.a, placed.n), placed.n

    @staticmethod
    def uv(placed: PlacedTriangle, p: Any, part: Any = None) -> tuple[Any, Any]:
        x, y = placed.b - placed.a, placed.c - placed.a
        local = Frame(x, y, dr.cross(x, y), placed.a).inverse().point(p)
        return local.x, local.y

    def mitsuba(self) -> MitsubaShapes | str:
        corners = scalars(self).placed(transform_frame(self))
        corners = np.array([corners.a, corners.b, corners.c], float)
        return MitsubaShapes([{"type": "mesh", "vertices": corners, "faces": np.array([[0, 1, 2]])}])
