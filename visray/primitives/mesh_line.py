"""Lines that cross the triangles of a mesh, in coordinates of the mesh.

Which triangles a line crosses is decided without rounding errors, by the signs of cross products in the plane to which
the line projects the mesh. If the line runs exactly through an edge or a corner, it is decided as if the line were
moved by an infinitely small vector (e, e^2) of that plane. So a line crosses the triangles around it as a line of
ordinary position does: at a common edge or corner, no triangle is left out and none counts twice. In a closed mesh,
entries and exits of every line are equal in number (tests/test_mesh_body.py).
Source: Edelsbrunner and Mücke 1990 (moved lines); Woop, Benthin, Wald 2013 (projection).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.geometry import gamma, l1_norm
from visray.primitives.triangle import SeenTriangle, crossing_distance, normal_of, projected, signed_area


@dataclass(frozen=True)
class TriangleCrossing:
    """The crossing of a line with a triangle.

    hit: whether there is one.
    t: distance along the line.
    slack: bound on the error of t.
    leaves: whether the line runs out of the solid here: to the side to which the normal of the triangle points.
    n: the normal, of any length.
    """

    hit: Any
    t: Any
    slack: Any
    leaves: Any
    n: Any


@dataclass(frozen=True)
class MeshLine:
    """A line through a mesh, in coordinates of the mesh.

    o: origin.
    d: direction, of any length.
    along: vector whose product with a vector from the origin to a point of the line is the distance t of the point. So
        t is the distance in the world, although d is not normalised.
    rounding: bound on the error of t for a triangle that the line meets at a right angle.
    """

    o: Any
    d: Any
    along: Any
    rounding: Any

    @staticmethod
    def of(o: Any, d: Any, along: Any, size: Any) -> "MeshLine":
        """The line. size: bound on the coordinates of the mesh."""
        return MeshLine(o, d, along, gamma(128) * l1_norm(along) * (l1_norm(o) + size))

    def crossing(self, corners: tuple[Any, Any, Any]) -> TriangleCrossing:
        """The crossing with a triangle.

        Error of t: let R be the size of the corners relative to the origin, and E their greatest distance from each
        other. A projected corner has an error of at most gamma(3) |d| R, and lies within |d| E of the origin. So a
        product of two of them, which is the weight of the third corner, has an error of at most gamma(17) |d|^2 E R.
        The three weights move t by at most gamma(51) |d|^2 E^2 R |along| / area, where E^2 is at most twice the sum of
        two squared sides. The step to the plane makes this error smaller. The other roundings of t are below
        gamma(8) R |along|. And t lies between the distances of the corners, so its error is no larger than their
        differences.
        """
        d, (a, b, c) = self.d, (v - self.o for v in corners)
        p, q, r = (projected(d, v) for v in (a, b, c))
        (positive_a, exact_a), (positive_b, exact_b), (positive_c, exact_c) = _side(q, r), _side(r, p), _side(p, q)
        one_place = (p[0] == q[0]) & (p[1] == q[1]) & (q[0] == r[0]) & (q[1] == r[1])
        hit = ~(positive_a ^ positive_b) & ~(positive_b ^ positive_c) & ~one_place
        wa, wb, wc = signed_area(q, r), signed_area(r, p), signed_area(p, q)
        # Rounding may hide all three products of a tiny triangle.
        hidden = wa + wb + wc == 0
        wa, wb, wc = (dr.select(hidden, x, w) for x, w in ((exact_a, wa), (exact_b, wb), (exact_c, wc)))
        total = wa + wb + wc
        along, x, y, n = self.along, b - a, c - a, normal_of(a, b, c)
        # As for other triangles, so that t is the same to the last bit.
        t = crossing_distance(SeenTriangle(a, b, c, None), d, (wa, wb, wc), n, dr.dot(n, d), along)
        squares = dr.squared_norm(x) + dr.squared_norm(y)
        moved = self.rounding * dr.squared_norm(d) * squares / dr.abs(total)
        extent = dr.abs(dr.dot(x, along)) + dr.abs(dr.dot(y, along))
        slack = self.rounding + dr.select(moved < extent, moved, extent)
        return TriangleCrossing(hit & (total != 0), t, slack, positive_a ^ self.turned, n)

    @property
    def turned(self) -> Any:
        """Whether a triangle with positive products is seen from the side to which its normal points."""
        x, y, z = dr.abs(self.d.x), dr.abs(self.d.y), dr.abs(self.d.z)
        on_x = (x >= y) & (x >= z)
        on_z = ~on_x & (z >= y)
        return dr.select(on_x, self.d.x < 0, dr.select(on_z, self.d.z < 0, self.d.y > 0))


def _side(p: tuple[Any, Any], q: tuple[Any, Any]) -> tuple[Any, Any]:
    """(whether the cross product p x q of two plane vectors is positive, the product).

    If the product is zero, the first result is that of the vectors after the origin is moved by (e, e^2), for every
    small enough e > 0: the cross product then grows by e (p_1 - q_1) - e^2 (p_0 - q_0).
    Error: relative, at most two roundings. So the sign is exact, except where a product underflows.
    Source: Kahan; Jeannerod, Louvet, Muller 2013.
    """
    second = p[1] * q[0]
    product = dr.fma(p[0], q[1], -second) + dr.fma(-p[1], q[0], second)
    after = (p[1] > q[1]) | ((p[1] == q[1]) & (p[0] < q[0]))
    return (product > 0) | ((product == 0) & after), product
