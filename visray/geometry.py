"""Frames, affine maps and rounding bounds: the arithmetic that all primitives are built on.

Functions take Dr.Jit arrays of any backend and width: tables with one entry for each object, single entries, or arrays
with one entry for each lane (one ray or pixel). Functions that take plain numbers instead say so.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.quantities import Arrays

UNIT_ROUNDOFF = {"single": 2.0**-24, "double": 2.0**-53}


# A unit vector n is upright if |n.x| and |n.z| are below this bound. Derivatives of `tangents` grow as 1 / |n.x|, and
# rounding moves them by u / |n.x|, for the unit roundoff u. For smaller |n.x| that is more than |n.x| itself.
UPRIGHT = {precision: u**0.5 for precision, u in UNIT_ROUNDOFF.items()}


def gamma(n: int, precision: str = "double") -> float:
    """Bound on the relative error of n successive roundings: n u / (1 - n u), where u is the unit roundoff of
    `precision`. Takes plain numbers. Source: Higham, lemma 3.1."""
    nu = n * UNIT_ROUNDOFF[precision]
    return nu / (1 - nu)


def clearly_not_parallel(v: tuple[float, float, float], w: tuple[float, float, float]) -> bool:
    """Whether the angle between two vectors differs from 0 and 180 degrees by more than a millionth of a radian. Takes
    plain numbers, no arrays.

    Error: rounding changes the squared cross product by less than 1e-14 of the product of both squared lengths.
    """
    (a, b, c), (d, e, f) = v, w
    cross_squared = (b * f - c * e) ** 2 + (c * d - a * f) ** 2 + (a * e - b * d) ** 2
    lengths_squared = (a * a + b * b + c * c) * (d * d + e * e + f * f)
    return 1e-200 < lengths_squared < 1e200 and cross_squared > 1e-12 * lengths_squared


def l1_norm(v: Any) -> Any:
    """Sum of the absolute components: a bound on |v| without a square root, at most sqrt(3) |v|."""
    return dr.abs(v.x) + dr.abs(v.y) + dr.abs(v.z)


def face_forward(n: Any, d: Any) -> tuple[Any, Any]:
    """The normal on the side that a ray comes from, and a mask of the lanes in which n was turned for this. In these
    lanes the ray sees the surface from inside.

    n: outward normal
    d: direction of the ray
    """
    from_inside = dr.dot(n, d) > 0
    return dr.select(from_inside, -n, n), from_inside


def triple(v: Any, x: Any, y: Any, z: Any) -> Any:
    """A vector (x, y, z) of the same type as `v`."""
    return type(v)(x, y, z)


def tangents(n: Any) -> tuple[Any, Any]:
    """Two unit vectors s and t in the plane perpendicular to n, with s x t = n. They are the directions of u and v in a
    plane; a texture then stands upright.

    t is the direction in the plane nearest to world +y; if n is exactly +y or -y, s is +x. So on a floor, u runs along
    +x and v along -z; on a wall, seen from the side that n points to, u runs right and v runs up.

    Shapes: n (3, N).
    Domain: every unit n.
    Derivatives: near +y and -y (UPRIGHT), s and t turn about n ever faster, and at +y and -y they jump. There, they are
        given the derivative without this turn. It is right for whatever does not depend on the directions of u and v.
    Error: of the derivatives of other n, 1 / UPRIGHT times that of one rounding.
    """
    # n.x and n.z are divided by the slope first: the square of a slope as small as 1e-200 would underflow to zero.
    slope = dr.detach(dr.maximum(dr.abs(n.x), dr.abs(n.z)))
    horizontal = slope == 0
    scale = dr.select(horizontal, 1, slope)
    s = dr.normalize(triple(n, dr.select(horizontal, 1, n.z / scale), 0, dr.select(horizontal, 0, -n.x / scale)))
    if dr.grad_enabled(n):
        upright = slope < UPRIGHT["double" if dr.type_v(n) == dr.VarType.Float64 else "single"]
        s = dr.select(upright, _transported(dr.detach(s), n), s)
    return s, dr.cross(n, s)


def _transported(s: Any, n: Any) -> Any:
    """The vector s, with the derivative that keeps it perpendicular to n and turns it about n as little as possible."""
    along = dr.dot(s, n)
    return s - dr.detach(n) * (along - dr.detach(along))


@dataclass(frozen=True)
class Frame:
    """Affine map from local to world coordinates: p -> o + x p.x + y p.y + z p.z.

    x, y, z: world vectors of the local axes
    o: world point of the local origin
    """

    x: Any
    y: Any
    z: Any
    o: Any

    @staticmethod
    def table(a: Arrays, matrices: np.ndarray) -> "Frame":
        """The frames of 3 x 4 matrices in NumPy, as one table. Shape: (N, 3, 4)."""
        return Frame(*(a.put(a.W, matrices[:, :, column].T) for column in range(4)))

    def matrices(self) -> np.ndarray:
        """The 3 x 4 matrices of a table of frames, without derivatives. Shape: (N, 3, 4)."""
        return np.stack([np.array(v, float).T for v in (self.x, self.y, self.z, self.o)], axis=2)

    def then(self, outer: "Frame | Similarity | None") -> "Frame":
        """This map followed by `outer`; only this map if `outer` is None."""
        if outer is None:
            return self
        return Frame(outer.vector(self.x), outer.vector(self.y), outer.vector(self.z), outer.point(self.o))

    def vector(self, v: Any) -> Any:
        """World vector of a local vector; the translation does not apply."""
        return self.x * v.x + self.y * v.y + self.z * v.z

    def point(self, p: Any) -> Any:
        """World point of a local point."""
        return self.o + self.vector(p)

    def inverse(self) -> "Inverse":
        """Map from world to local coordinates."""
        rx, ry, rz = dr.cross(self.y, self.z), dr.cross(self.z, self.x), dr.cross(self.x, self.y)
        scale = dr.rcp(dr.dot(self.x, rx))
        return Inverse(rx * scale, ry * scale, rz * scale, self.o)

    def volume_factor(self) -> Any:
        """Factor by which the map changes volumes: the absolute value of its determinant."""
        return dr.abs(dr.dot(self.x, dr.cross(self.y, self.z)))

    def max_stretch(self) -> Any:
        """Bound on |M v| / |v| for the linear part M; exact if the columns of M are orthogonal.

        Source: the spectral radius of M^T M is at most its largest row sum.
        """
        xy, xz, yz = dr.abs(dr.dot(self.x, self.y)), dr.abs(dr.dot(self.x, self.z)), dr.abs(dr.dot(self.y, self.z))
        xx, yy, zz = dr.squared_norm(self.x), dr.squared_norm(self.y), dr.squared_norm(self.z)
        return dr.sqrt(dr.maximum(dr.maximum(xx + xy + xz, yy + xy + yz), zz + xz + yz))


@dataclass(frozen=True)
class Similarity:
    """Affine map p -> o + scale p. It is a type of its own because spheres need no other map, and it saves three
    quarters of the work of a Frame."""

    scale: Any
    o: Any

    def then(self, outer: "Frame | None") -> "Frame | Similarity":
        """This map followed by `outer`; only this map if `outer` is None."""
        if outer is None:
            return self
        axes = [self.scale * type(self.o)(*(1 if i == j else 0 for j in range(3))) for i in range(3)]
        return Frame(*axes, self.o).then(outer)

    def inverse(self) -> "SimilarityInverse":
        """Map from world to local coordinates."""
        return SimilarityInverse(dr.rcp(self.scale), self.o)

    def volume_factor(self) -> Any:
        """As Frame.volume_factor."""
        return dr.abs(self.scale * self.scale * self.scale)

    def max_stretch(self) -> Any:
        """Factor by which the map changes lengths."""
        return self.scale


@dataclass(frozen=True)
class Inverse:
    """Inverse of a Frame: p -> M^-1 (p - o).

    x, y, z: rows of M^-1
    o: origin of the frame
    """

    x: Any
    y: Any
    z: Any
    o: Any

    def vector(self, v: Any) -> Any:
        """Local vector of a world vector; the translation does not apply."""
        return triple(v, dr.dot(self.x, v), dr.dot(self.y, v), dr.dot(self.z, v))

    def point(self, p: Any) -> Any:
        """Local point of a world point."""
        return self.vector(p - self.o)

    def normal(self, n: Any) -> Any:
        """World gradient of a function whose local gradient is n: the transposed inverse matrix times n."""
        return self.x * n.x + self.y * n.y + self.z * n.z

    def squared_length(self, v: Any) -> Any:
        """Squared length of `v`, a vector in local coordinates."""
        return dr.squared_norm(v)


@dataclass(frozen=True)
class SimilarityInverse:
    """Inverse of a Similarity: p -> scale (p - o), where scale is the reciprocal of the Similarity's scale."""

    scale: Any
    o: Any

    def vector(self, v: Any) -> Any:
        """Local vector of a world vector; the translation does not apply."""
        return self.scale * v

    def point(self, p: Any) -> Any:
        """Local point of a world point."""
        return self.scale * (p - self.o)

    def normal(self, n: Any) -> Any:
        """World gradient of a function whose local gradient is n."""
        return self.scale * n

    def squared_length(self, v: Any) -> Any:
        """Squared length of `v`, a local vector whose world vector has length 1. All such vectors have the same."""
        return dr.square(self.scale)
