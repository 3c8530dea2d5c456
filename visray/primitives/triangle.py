"""The triangle."""

from dataclasses import dataclass, field
from typing import Any, Literal

import drjit as dr
import numpy as np

from visray.geometry import Frame, clearly_not_parallel
from visray.primitives.flat import Flat
from visray.primitives.primitive import Bounds, MitsubaShapes, scalars, transform_frame
from visray.pytree import leaves
from visray.quantities import Point
from visray.records import record_kind


@dataclass(frozen=True)
class PlacedTriangle:
    """A triangle in the world: corners a, b, c and unit normal n."""

    a: Any
    b: Any
    c: Any
    n: Any


@dataclass(frozen=True)
class SeenTriangle:
    """A triangle for rays from one origin: corners a, b, c relative to the ray origin, and a normal n of any length;
    None if it is to be computed from the corners."""

    a: Any
    b: Any
    c: Any
    n: Any


def projected(d: Any, v: Any) -> tuple[Any, Any]:
    """The projection of v along d to a plane: two components of d x v.

    The third component is left out. It belongs to the axis along which d has the largest component.
    """
    x, y, z = dr.abs(d.x), dr.abs(d.y), dr.abs(d.z)
    on_x = (x >= y) & (x >= z)
    on_z = ~on_x & (z >= y)
    product = dr.cross(d, v)
    return dr.select(on_x, product.y, product.x), dr.select(on_z, product.y, product.z)


def signed_area(p: tuple[Any, Any], q: tuple[Any, Any]) -> Any:
    """The cross product p x q of two plane vectors. Its sign is correct, or the result is zero.

    The reason is that both products are rounded before they are subtracted, and rounding keeps their order. A fused
    multiply-add rounds only one of them.
    """
    return p[0] * q[1] - p[1] * q[0]


def _area(p: tuple[Any, Any], q: tuple[Any, Any]) -> Any:
    """The cross product p x q of two plane vectors.

    Error: at most two roundings of the result.
    Source: Kahan; Jeannerod, Louvet, Muller 2013.
    """
    product = p[1] * q[0]
    return dr.fma(p[0], q[1], -product) - dr.fma(p[1], q[0], -product)


def normal_of(a: Any, b: Any, c: Any) -> Any:
    """The vector (b - a) x (c - a), with a small error for slivers too.

    Error: relative to its length, below gamma(8), except that corners are rounded. The shortest side is one factor, so
    that its rounding error, which tilts the triangle about a long side, is relative to the shortest side. The
    components are computed by Kahan's formula, with two roundings (tests/test_mesh.py).
    """
    x, y, z = b - a, c - a, c - b
    shortest = (dr.squared_norm(z) < dr.squared_norm(x)) & (dr.squared_norm(z) < dr.squared_norm(y))
    y = dr.select(shortest, z, y)
    # z is y - x, and x x (y - x) = x x y.
    return type(x)(_area((x.y, x.z), (y.y, y.z)), _area((x.z, x.x), (y.z, y.x)), _area((x.x, x.y), (y.x, y.y)))


def crossing_distance(
    seen: SeenTriangle, d: Any, weights: tuple[Any, Any, Any], n: Any, slope: Any, unit: Any = None
) -> Any:
    """Distance at which a ray crosses a triangle.

    d: direction
    unit: vector whose product with a point of the ray is its distance, if d is not a unit vector; None: d
    weights: weights of the corners at the crossing, of any sum
    n: normal
    slope: d . n

    The weights give a first value of t. Their errors are divided by the area of the triangle that the ray sees, so for
    slivers they are large. One step to the plane of the triangle, from a place that is close, removes them. The result
    lies between the distances of the corners, even if the ray is almost parallel to the plane.
    """
    along = [dr.dot(v, d if unit is None else unit) for v in (seen.a, seen.b, seen.c)]
    t = sum(w * x for w, x in zip(weights, along)) / sum(weights)
    t -= dr.dot(dr.fma(t, d, -seen.a), n) / slope
    low, high = (f(f(along[0], along[1]), along[2]) for f in (dr.minimum, dr.maximum))
    # A ray in the plane has slope 0. Then t is inf or NaN here, and becomes the distance of a corner.
    return dr.select(t < high, dr.select(t > low, t, low), high)


@record_kind
@dataclass(frozen=True, kw_only=True)
class Triangle(Flat):
    """The triangle with corners a, b, c. Its normal is (b - a) x (c - a).

    uv: a is (0, 0), b is (1, 0), c is (0, 1).

    Meshes of triangles are watertight. A corner is projected to the same place for all triangles that share it. From
    these places, the side on which a ray passes an edge is computed without error. So no ray passes between two
    triangles at a common edge or corner. A ray exactly through an edge or a corner meets all triangles that share it
    (tests/test_primitives.py).
    Error: the distance t of a hit is off by at most gamma(4) t + gamma(6) R / cosine. R is the distance of the farthest
    corner from the ray origin, and cosine that of the angle between ray and normal. It is the same for slivers.
    Measured: 1.2 u R / cosine, where u is the unit roundoff; half of the rays are off by at most 0.4 ulp
    (tests/test_mesh.py).
    Source: Woop, Benthin, Wald 2013.
    """

    triangular = True

    type: Literal["triangle"] = "triangle"
    a: Point = field(kw_only=False)
    b: Point = field(kw_only=False)
    c: Point = field(kw_only=False)

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
        return PlacedTriangle(a, b, c, dr.normalize(normal_of(a, b, c)))

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
        a, b, c = (projected(d, v) for v in (seen.a, seen.b, seen.c))
        wa, wb, wc = signed_area(b, c), signed_area(c, a), signed_area(a, b)
        inside = ((wa >= 0) & (wb >= 0) & (wc >= 0)) | ((wa <= 0) & (wb <= 0) & (wc <= 0))
        inside &= wa + wb + wc != 0

        def cross_plane() -> tuple[Any, Any, Any]:
            n = normal_of(seen.a, seen.b, seen.c) if seen.n is None else seen.n
            slope = dr.dot(n, d)
            return crossing_distance(seen, d, (wa, wb, wc), n, slope), slope, dr.squared_norm(n)

        if dr.grad_enabled(leaves((seen, d))):
            t, slope, squared = cross_plane()
        else:
            # Most rays miss, so packets of rays without a hit skip the rest.
            missed = lambda: (type(wa)(dr.inf), type(wa)(0), type(wa)(0))  # noqa: E731
            t, slope, squared = dr.if_stmt((), inside, cross_plane, missed, label="plane of triangle")
        return t, inside, slope, squared

    @staticmethod
    def surface_at(placed: PlacedTriangle, p: Any, part: Any = None) -> tuple[Any, Any]:
        return dr.dot(p - placed.a, placed.n), placed.n

    @staticmethod
    def uv(placed: PlacedTriangle, p: Any, part: Any = None) -> tuple[Any, Any]:
        x, y = placed.b - placed.a, placed.c - placed.a
        local = Frame(x, y, dr.cross(x, y), placed.a).inverse().point(p)
        return local.x, local.y

    def advice_for_solid(self) -> str:
        return "use a solid, such as a closed mesh"

    def mitsuba(self) -> MitsubaShapes | str:
        corners = scalars(self).placed(transform_frame(self))
        corners = np.array([corners.a, corners.b, corners.c], float)
        return MitsubaShapes([{"type": "mesh", "vertices": corners, "faces": np.array([[0, 1, 2]])}])
