"""Rays, hits, crossings and surface points.

Single letters used everywhere: o origin, d unit direction, t distance, p point, n normal, l to the light, v to the eye,
h half vector; F, V, D, W array types (see quantities.Arrays).

Rows are the objects of a scene as kernels number them: the batches one after the other. A `part` is a face of a row: a
box's side, a cylinder's cap, a factor of a polynomial; of rows that have one part only it is not carried (None).

No ray is ever moved off the surface it leaves. A ray says which row and part it leaves, and on which side of it it runs
(`inside`), and that row answers with the crossings that are left. So there is no epsilon to choose.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

NO_ROW = 0xFFFFFFFF


@dataclass(frozen=True)
class Ray:
    """A ray in world space, in double.

    o: origin, one for all lanes or one a lane.
    d: unit to 2^-52, or in single, and then `exact` makes it so.
    row, part: what the ray leaves, or None.
    inside: whether it runs into that row, where it is closed.
    start: what is nearer than this, over `cosine` where it is given, lies flush with the surface that is left, and is
    not met; None: nothing is left.
    way: a vector in double that d, in single, is the direction of: what need not be known of it before a ray comes near
    something.
    rough: the direction that d was made exact from, which is enough for shading; None where d came in double.
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
        """The same ray in double: d and start may come in single, where few rays need more."""
        d = self.d if type(self.d) is type(self.o) else unit(self.d, type(self.o))
        if self.to_target is not None:
            d = self.to_target * inverse_length(self.to_target, type(self.d.x))
        d_single = self.d_single if d is self.d else self.d
        clearance, cosine = (None if x is None else type(d.x)(x) for x in (self.clearance, self.cosine))
        if cosine is not None:
            clearance /= dr.select(cosine > 0, cosine, 1)
        return replace(self, d=d, clearance=clearance, cosine=None, to_target=None, d_single=d_single)

    def begin(self, known: "KnownEnds") -> Any:
        """The distance beyond which an exact ray meets a row. The row that it leaves may be as near as it likes."""
        if self.clearance is None:
            return 0
        return self.clearance if known.on_start is None else dr.select(known.on_start, 0, self.clearance)


@dataclass(frozen=True)
class Hit:
    """What a search finds: the distance t (inf where nothing is hit), the row (or NO_ROW) and the part of it."""

    t: Any
    row: Any
    part: Any = None

    @property
    def valid(self) -> Any:
        return self.row != NO_ROW


@dataclass(frozen=True)
class KnownEnds:
    """What is known of the ends of a piece of a ray that one row is asked about. Masks are None where no ray has it.

    on_start: it begins on the row's surface; inside: and runs into the row from there; start_part: on which part.
    on_end: it ends on the row's surface; inward: and comes to it from within; end_part: on which part.
    end_error: bound on the distance of the end from the true point, or None where there is no end.
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
    """Where a piece of a ray first crosses a row's surface.

    met: whether it does.
    t: the distance, inf where it does not.
    part: of the surface, or None where the kind has one only.
    enters: whether the ray is outside up to there, or up to the end where it does not cross.
    unresolved: on how many parts of the ray it is not known whether there is a crossing; 0 is expected.
    """

    met: Any
    t: Any
    part: Any
    enters: Any
    unresolved: Any = 0


@dataclass(frozen=True)
class Surface:
    """A point on an object: p in double with its error bound (world units), n the outward unit normal; `exact` the same
    normal in double, where rays go on from there."""

    p: Any
    n: Any
    error: Any
    exact: Any = None


def unit(d: Any, w: Any) -> Any:
    """`d`, of unit length to its own precision, as a `w` of unit length to 2^-52, exactly parallel to d.

    Error: one third-order step; with |d|^2 = 1 + e it leaves 5/16 e^3, and e <= 2^-21 in single.
    """
    d = w(d)
    e = dr.squared_norm(d) - 1
    return d * dr.fma(e, dr.fma(e, 0.375, -0.5), 1)


def inverse_length(v: Any, fast: Any) -> Any:
    """1/|v| to 2^-52 for |v| from 1e-18 to 1e18, and 0 for v = 0.

    `fast` is the single type whose reciprocal root starts one third-order step, or None for division and root in
    double: both agree to 4 ulp (tests/test_ray.py). The step is used because a double root and division cost eight
    times as much.
    """
    squared = dr.squared_norm(v)
    if fast is None:
        return dr.select(squared > 0, dr.rcp(dr.sqrt(squared)), 0)
    r = type(squared)(dr.detach(dr.rsqrt(fast(squared))))
    r = dr.select(squared > 0, r, 0)
    e = squared * r * r - 1
    return r * dr.fma(e, dr.fma(e, 0.375, -0.5), 1)
