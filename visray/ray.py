"""Rays, hits, crossings and surface points.

Single letters with one meaning everywhere: o origin, d unit direction, t distance, p point, n normal, l direction to
the light, v direction to the eye, h half vector; F, V, D, W array types (quantities.Arrays).

A row is one object, as an entry of the kernel's tables (batches.py). A part is one smooth piece of a row's surface: a
side of a box, a cap of a cylinder, a factor of a polynomial. Parts are numbered from 0. If no kind in the
scene has several parts, the number is None.
A crossing is a point at which a ray passes through the surface of one row. A hit is the crossing that a search over all
rows returns.

There is no epsilon: the origin of a ray is not moved away from the surface that the ray leaves. Instead, the ray names
the row and the part that it leaves, and the side on which it runs (`inside`). The test of that row then reports only
other crossings, and not the one at the start.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

NO_ROW = 0xFFFFFFFF


@dataclass(frozen=True)
class Ray:
    """A ray in world space. Its direction may be in single precision until `exact` refines it.

    o: origin, in double; one for all lanes, or one for each lane
    d: unit direction; in double its length is 1 to within 4 roundings (`unit`)
    row, part: the surface that the ray leaves; None if it leaves no surface
    inside: whether the ray runs into the object that it leaves; for closed kinds
    clearance: crossings with other rows at a distance below clearance / cosine are ignored, because to within rounding
        they lie on the surface that the ray leaves; None if it leaves no surface
    cosine: cosine of the angle between d and the normal of the surface that the ray leaves; None if `clearance` is
        already divided by it
    to_target: vector in double from o to the ray's target. It is given if d is its direction in single; `exact` then
        computes d from it. None otherwise
    d_single: direction in single from which `exact` has computed d, precise enough for shading; None if d came in
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

    @property
    def lanes(self) -> int:
        """Number of lanes. All rays may share their origin, or their direction."""
        return max(dr.width(self.d), dr.width(self.o))

    def exact(self) -> "Ray":
        """The same ray with direction and clearance in double. Rays may start with a direction in single precision,
        because few of them need more."""
        d = self.d if type(self.d) is type(self.o) else unit(self.d, type(self.o))
        if self.to_target is not None:
            d = self.to_target * inverse_length(self.to_target, type(self.d.x))
        d_single = self.d_single if d is self.d else self.d
        clearance, cosine = (None if x is None else type(d.x)(x) for x in (self.clearance, self.cosine))
        if cosine is not None:
            clearance /= dr.select(cosine > 0, cosine, 1)
        return replace(self, d=d, clearance=clearance, cosine=None, to_target=None, d_single=d_single)

    def begin(self, known: "KnownEnds") -> Any:
        """Distance from which crossings of an exact ray with a row count: its clearance, or 0 if the ray starts on this
        row, because the kind itself then excludes the crossing at the start.

        known: facts about the ends of the ray, for this row
        """
        if self.clearance is None:
            return 0
        return self.clearance if known.on_start is None else dr.select(known.on_start, 0, self.clearance)


@dataclass(frozen=True)
class Hit:
    """The result of a search along a ray.

    t: distance of the hit. If nothing is hit, it is the distance at which the search ended, usually inf
    row: number of the row that is hit, among all rows of the scene; NO_ROW if nothing is hit
    part: part of the row's surface; None in scenes in which every kind has a single part
    """

    t: Any
    row: Any
    part: Any = None

    @property
    def valid(self) -> Any:
        """Mask of the lanes in which something is hit."""
        return self.row != NO_ROW


@dataclass(frozen=True)
class KnownEnds:
    """Facts about both ends of a ray segment, for the one row that the segment is tested against. A mask is None if it
    would be false in all lanes.

    on_start: mask: the segment begins on the row's surface
    inside: mask: the segment runs into the row from there
    start_part: part of the surface on which the segment begins
    on_end: mask: the segment ends on the row's surface
    inward: mask: the segment reaches its end from inside the row
    end_part: part of the surface on which the segment ends
    end_error: bound on the distance between the computed end and the true point; None if the ray is endless
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

    met: mask of the lanes that have a crossing
    t: distance; inf without a crossing
    part: part of the surface; None for kinds with a single part
    enters: whether the ray is outside before the crossing; without a crossing, whether the whole segment is outside
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
    exact: the same normal in double if paths continue from the point; else None
    shading: outward unit normal for shading, in double; None if it is n for all surfaces of the scene
    """

    p: Any
    n: Any
    error: Any
    exact: Any = None
    shading: Any = None


def unit(d: Any, w: Any) -> Any:
    """The direction `d` as a vector of type `w`, normalised by one step in the precision of `w`.

    Domain: d has length 1 to within its own precision.
    Error: the length is 1 to within 4 roundings, and the result is parallel to d to within one rounding of each
        component (tests/test_ray.py). With |d|^2 = 1 + e the step itself leaves 5/16 e^3, and |e| <= 2^-21 in single.
    """
    d = w(d)
    e = dr.squared_norm(d) - 1
    return d * dr.fma(e, dr.fma(e, 0.375, -0.5), 1)


def inverse_length(v: Any, fast: Any) -> Any:
    """1 / |v|; 0 for v = 0.

    fast: type in single precision. The reciprocal square root is computed in this type and then refined by one
        third-order step. None: root and division are computed in double, which takes eight times as long
    Domain: v = 0, or |v| from 1e-18 to 1e18.
    Error: relative, at most gamma(5); the two ways agree to 4 ulp (tests/test_ray.py).
    """
    squared = dr.squared_norm(v)
    if fast is None:
        return dr.select(squared > 0, dr.rcp(dr.sqrt(squared)), 0)
    r = type(squared)(dr.detach(dr.rsqrt(fast(squared))))
    r = dr.select(squared > 0, r, 0)
    e = squared * r * r - 1
    return r * dr.fma(e, dr.fma(e, 0.375, -0.5), 1)
