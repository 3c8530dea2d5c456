"""Rays, hits, crossings and surface points.

Single letters with one meaning everywhere: o origin, d unit direction, t distance, p point, n normal, l direction to
the light, v direction to the eye, h half vector; F, V, D, W array types (quantities.Arrays).

Rows are the objects of a scene, numbered batch after batch. A `part` is one smooth piece of a row's surface: a side of
a box, a cap of a cylinder, a factor of a polynomial. Rows with a single part carry None instead of a number.

There is no epsilon: a ray never starts off the surface that it leaves. Instead, a ray names the row and the part that
it leaves, and the side on which it runs (`inside`). With this, the row reports only its other crossings.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

NO_ROW = 0xFFFFFFFF


@dataclass(frozen=True)
class Ray:
    """A ray in world space, in double precision.

    o: origin, one for all lanes, or one for each lane
    d: direction, unit to 2^-52; or in single precision, until `exact` refines it
    row, part: surface that the ray leaves, or None
    inside: whether the ray runs into that row, for closed kinds
    clearance: crossings nearer than clearance / cosine are ignored, because they lie flush with the surface that the
        ray leaves; None where the ray leaves no surface
    cosine: between d and the normal of the surface that the ray leaves; None where `clearance` is already divided
    to_target: vector in double of which the single-precision d is the direction, or None; `exact` normalises it
    d_single: direction in single precision from which `exact` computed d, good enough for shading; None where d came in
        double
    """

    o: Any
    d: Any
    row: Any = None
    inside: Any = None
    clearance: Any = None
    cosine: Any = None
    part: Any = None
    to_target: Any = None
    d_single: Any = None

    def exact(self) -> "Ray":
        """The same ray with direction and clearance in double. Rays may start in single, as few of them need more."""
        d = self.d if type(self.d) is type(self.o) else unit(self.d, type(self.o))
        if self.to_target is not None:
            d = self.to_target * inverse_length(self.to_target, type(self.d.x))
        d_single = self.d_single if d is self.d else self.d
        clearance, cosine = (None if x is None else type(d.x)(x) for x in (self.clearance, self.cosine))
        if cosine is not None:
            clearance /= dr.select(cosine > 0, cosine, 1)
        return replace(self, d=d, clearance=clearance, cosine=None, to_target=None, d_single=d_single)

    def begin(self, known: "KnownEnds") -> Any:
        """Distance beyond which an exact ray meets a row; 0 for the row that the ray leaves, which excludes its own
        crossing."""
        if self.clearance is None:
            return 0
        return self.clearance if known.on_start is None else dr.select(known.on_start, 0, self.clearance)


@dataclass(frozen=True)
class Hit:
    """The result of a search along a ray.

    t: distance, inf where nothing is hit
    row: number of the row, NO_ROW where nothing is hit
    part: part of the row's surface, or None
    """

    t: Any
    row: Any
    part: Any = None

    @property
    def valid(self) -> Any:
        """Whether anything is hit."""
        return self.row != NO_ROW


@dataclass(frozen=True)
class KnownEnds:
    """Facts about both ends of a ray segment, for the one row that the segment is tested against. A mask is None where
    it holds for no ray.

    on_start: the segment begins on the row's surface
    inside: from there it runs into the row
    start_part: part of the surface on which it begins
    on_end: the segment ends on the row's surface
    inward: it reaches its end from inside the row
    end_part: part of the surface on which it ends
    end_error: bound on the distance between the computed end and the true point; None where there is no end
    """

    on_start: Any = None
    inside: Any = None
    start_part: Any = None
    on_end: Any = None
    inward: Any = None
    end_part: Any = None
    end_error: Any = None


NOTHING_KNOWN = KnownEnds()


@dataclass(frozen=True)
class Crossing:
    """First crossing of a ray segment with a row's surface.

    met: whether there is a crossing
    t: distance, inf where there is none
    part: part of the surface, or None for kinds with a single part
    enters: whether the ray is outside before the crossing, or along the whole segment where there is none
    unresolved: number of pieces of the ray on which the search cannot decide whether there is a crossing; normally 0
    """

    met: Any
    t: Any
    part: Any
    enters: Any
    unresolved: Any = 0


@dataclass(frozen=True)
class Surface:
    """A point on an object's surface.

    p: position, in double
    n: outward unit normal, in the precision of shading
    error: bound on the distance between p and the true point, in world units
    exact: the same normal in double, where rays continue from the point; else None
    """

    p: Any
    n: Any
    error: Any
    exact: Any = None


def unit(d: Any, w: Any) -> Any:
    """The direction `d` as a vector of type `w`, unit to 2^-52 and exactly parallel to d. Domain: d is unit to its own
    precision.

    Error: one third-order step; with |d|^2 = 1 + e it leaves 5/16 e^3, and e <= 2^-21 in single.
    """
    d = w(d)
    e = dr.squared_norm(d) - 1
    return d * dr.fma(e, dr.fma(e, 0.375, -0.5), 1)


def inverse_length(v: Any, fast: Any) -> Any:
    """1/|v|, accurate to 2^-52 for |v| from 1e-18 to 1e18; 0 for v = 0.

    fast: single-precision type whose reciprocal root is refined by one third-order step; None computes root and
        division in double, which costs eight times as much.
    Error: both ways agree to 4 ulp (tests/test_ray.py).
    """
    squared = dr.squared_norm(v)
    if fast is None:
        return dr.select(squared > 0, dr.rcp(dr.sqrt(squared)), 0)
    r = type(squared)(dr.detach(dr.rsqrt(fast(squared))))
    r = dr.select(squared > 0, r, 0)
    e = squared * r * r - 1
    return r * dr.fma(e, dr.fma(e, 0.375, -0.5), 1)
