"""The triangle."""

from dataclasses import dataclass
from typing import Any, Literal

import drjit as dr
import numpy as np

from visray.geometry import Frame
from visray.primitives.flat import Flat
from visray.primitives.primitive import Twin
from visray.quantities import Point
from visray.transforms import compose


@dataclass(frozen=True)
class Corners:
    """A triangle in the world."""

    a: Any
    b: Any
    c: Any


@dataclass(frozen=True)
class SeenCorners:
    """A triangle as seen from an origin: the planes through the origin and each edge, the normal and the volume."""

    ab: Any
    bc: Any
    ca: Any
    n: Any
    volume: Any
    steep: Any


def _cross(a: Any, b: Any) -> Any:
    """a x b whose rounding is odd: _cross(b, a) is exactly -_cross(a, b), which fused multiply-add would spoil."""
    return type(a)(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


def _dot(a: Any, b: Any) -> Any:
    return a.x * b.x + a.y * b.y + a.z * b.z


@dataclass(frozen=True, kw_only=True)
class Triangle(Flat):
    """The triangle a, b, c; its normal is (b - a) x (c - a).

    A ray passes an edge on a side that depends on the edge's two ends alone, exactly opposite for the two triangles
    that share it: no ray passes between them (tests/test_primitives.py). uv: a is (0, 0), b is (1, 0), c is (0, 1).
    """

    type: Literal["triangle"] = "triangle"
    a: Point
    b: Point
    c: Point

    def flaws(self) -> list[tuple[str, str]]:
        a, b, c = (np.array(v, float) for v in (self.a, self.b, self.c))
        ab, ac = np.linalg.norm(b - a), np.linalg.norm(c - a)
        flat = np.linalg.norm(np.cross(b - a, c - a)) <= 8 * np.finfo(float).eps * ab * ac
        return [("c", "the corners must not lie on one line")] if flat else []

    def frame(self) -> Frame:
        x, y = self.b - self.a, self.c - self.a
        return Frame(x, y, dr.normalize(dr.cross(x, y)), self.a)

    def placed(self, outer: Frame | None) -> Corners:
        corners = (self.a, self.b, self.c)
        return Corners(*(corners if outer is None else map(outer.point, corners)))

    def sphere(self, outer: Frame | None) -> tuple[Any, Any]:
        p = self.placed(outer)
        centre = (p.a + p.b + p.c) / 3
        far = [dr.squared_norm(v - centre) for v in (p.a, p.b, p.c)]
        return centre, dr.sqrt(dr.maximum(dr.maximum(far[0], far[1]), far[2]))

    @staticmethod
    def seen(placed: Corners, o: Any) -> SeenCorners:
        a, b, c = placed.a - o, placed.b - o, placed.c - o
        n = dr.cross(placed.b - placed.a, placed.c - placed.a)
        return SeenCorners(_cross(a, b), _cross(b, c), _cross(c, a), n, dr.dot(n, a), dr.norm(n))

    @classmethod
    def crossing(cls, seen: SeenCorners, d: Any) -> tuple[Any, Any, Any]:
        ab, bc, ca = _dot(seen.ab, d), _dot(seen.bc, d), _dot(seen.ca, d)
        inside = ((ab >= 0) & (bc >= 0) & (ca >= 0)) | ((ab <= 0) & (bc <= 0) & (ca <= 0))
        slope = dr.dot(seen.n, d)
        return seen.volume / slope, inside & (slope != 0), seen.steep / dr.abs(slope)

    @staticmethod
    def level(placed: Corners, p: Any) -> tuple[Any, Any]:
        n = dr.cross(placed.b - placed.a, placed.c - placed.a)
        return dr.dot(p - placed.a, n), n

    @staticmethod
    def uv(placed: Corners, p: Any) -> tuple[Any, Any]:
        x, y = placed.b - placed.a, placed.c - placed.a
        local = Frame(x, y, dr.cross(x, y), placed.a).inverse().point(p)
        return local.x, local.y

    def mitsuba(self) -> Twin | str:
        corners, outer = np.array([self.a, self.b, self.c], float), compose(self.transform)
        if outer is not None:
            corners = corners @ outer[:, :3].T + outer[:, 3]
        return Twin([{"type": "mesh", "vertices": corners, "faces": np.array([[0, 1, 2]])}], uv=lambda uv: uv)
