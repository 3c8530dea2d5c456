"""Frames, affine maps, rounding bounds: the arithmetic under every primitive.

All functions but those of plain numbers take Dr.Jit arrays of any backend and width, and are written once for tables
(one entry an object), for single rows and for one row a lane.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

UNIT_ROUNDOFF = {"single": 2.0**-24, "double": 2.0**-53}


def gamma(n: int, precision: str = "double") -> float:
    """Bound of the relative error of n successive roundings, n u / (1 - n u). Source: Higham, lemma 3.1."""
    nu = n * UNIT_ROUNDOFF[precision]
    return nu / (1 - nu)


def clearly_not_parallel(v: tuple[float, float, float], w: tuple[float, float, float]) -> bool:
    """Whether two vectors are more than a millionth of a radian from parallel, found without arrays. Rounding changes
    the product's square by less than 1e-14 of the squares of both."""
    (a, b, c), (d, e, f) = v, w
    product = (b * f - c * e) ** 2 + (c * d - a * f) ** 2 + (a * e - b * d) ** 2
    both = (a * a + b * b + c * c) * (d * d + e * e + f * f)
    return 1e-200 < both < 1e200 and product > 1e-12 * both


def l1_norm(v: Any) -> Any:
    """A bound of |v| that costs no root: the sum of its components' sizes, at most sqrt(3) |v|."""
    return dr.abs(v.x) + dr.abs(v.y) + dr.abs(v.z)


def face_forward(n: Any, d: Any) -> tuple[Any, Any]:
    """The normal turned against the direction of a ray, and whether it had to be: then its side is seen from within."""
    within = dr.dot(n, d) > 0
    return dr.select(within, -n, n), within


def triple(v: Any, x: Any, y: Any, z: Any) -> Any:
    """A triple of the type of `v`."""
    return type(v)(x, y, z)


def tangents(n: Any) -> tuple[Any, Any]:
    """Two unit vectors (s, t) with s x t = n, so that a picture on the plane stands upright.

    t is the direction in the plane nearest to world +y; where n is exactly +-y, s is +x. So u runs east and v north on
    a floor seen from above with -z upwards, and u runs right and v up on a wall.

    Shapes: n (3, N), unit. Domain: every unit n.
    """
    # Scaled first: the squares of a slope as small as 1e-200 would be zero.
    slope = dr.detach(dr.maximum(dr.abs(n.x), dr.abs(n.z)))
    level = slope == 0
    scale = dr.select(level, 1, slope)
    s = dr.normalize(triple(n, dr.select(level, 1, n.z / scale), 0, dr.select(level, 0, -n.x / scale)))
    return s, dr.cross(n, s)


@dataclass(frozen=True)
class Frame:
    """An affine map from local to world: p -> o + x p.x + y p.y + z p.z."""

    x: Any
    y: Any
    z: Any
    o: Any

    def then(self, outer: "Frame | Similarity | None") -> "Frame":
        """This map first, then `outer`."""
        if outer is None:
            return self
        return Frame(outer.vector(self.x), outer.vector(self.y), outer.vector(self.z), outer.point(self.o))

    def vector(self, v: Any) -> Any:
        return self.x * v.x + self.y * v.y + self.z * v.z

    def point(self, p: Any) -> Any:
        return self.o + self.vector(p)

    def inverse(self) -> "Inverse":
        rx, ry, rz = dr.cross(self.y, self.z), dr.cross(self.z, self.x), dr.cross(self.x, self.y)
        scale = dr.rcp(dr.dot(self.x, rx))
        return Inverse(rx * scale, ry * scale, rz * scale, self.o)

    def max_stretch(self) -> Any:
        """A bound of |M v| / |v| for the linear part M: exact where its columns are orthogonal.

        Source: the spectral radius of M^T M is at most its largest row sum.
        """
        xy, xz, yz = (dr.abs(dr.dot(a, b)) for a, b in ((self.x, self.y), (self.x, self.z), (self.y, self.z)))
        rows = dr.squared_norm(self.x) + xy + xz, dr.squared_norm(self.y) + xy + yz, dr.squared_norm(self.z) + xz + yz
        return dr.sqrt(dr.maximum(dr.maximum(rows[0], rows[1]), rows[2]))


@dataclass(frozen=True)
class Similarity:
    """The affine map p -> o + scale p, kept apart because a sphere needs no more and saves three quarters of the
    work."""

    scale: Any
    o: Any

    def then(self, outer: "Frame | None") -> "Frame | Similarity":
        if outer is None:
            return self
        axes = [self.scale * type(self.o)(*(1 if i == j else 0 for j in range(3))) for i in range(3)]
        return Frame(*axes, self.o).then(outer)

    def inverse(self) -> "SimilarityInverse":
        return SimilarityInverse(dr.rcp(self.scale), self.o)

    def max_stretch(self) -> Any:
        return self.scale


@dataclass(frozen=True)
class Inverse:
    """The inverse of a Frame: rows of the inverse linear part, and the origin to subtract first."""

    x: Any
    y: Any
    z: Any
    o: Any

    def vector(self, v: Any) -> Any:
        return triple(v, dr.dot(self.x, v), dr.dot(self.y, v), dr.dot(self.z, v))

    def point(self, p: Any) -> Any:
        return self.vector(p - self.o)

    def normal(self, n: Any) -> Any:
        """A local gradient as a world gradient: the transpose of the inverse."""
        return self.x * n.x + self.y * n.y + self.z * n.z

    def squared_length(self, v: Any) -> Any:
        """|M^-1 v|^2 for a vector already mapped."""
        return dr.squared_norm(v)


@dataclass(frozen=True)
class SimilarityInverse:
    """The inverse of a Similarity."""

    scale: Any
    o: Any

    def vector(self, v: Any) -> Any:
        return self.scale * v

    def point(self, p: Any) -> Any:
        return self.scale * (p - self.o)

    def normal(self, n: Any) -> Any:
        return self.scale * n

    def squared_length(self, v: Any) -> Any:
        """As of Inverse, for v the image of a unit vector: then it depends on no ray."""
        return dr.square(self.scale)
