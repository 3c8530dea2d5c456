"""Rays, hits and surface points.

Single letters used everywhere: o origin, d unit direction, t distance, p point, n normal, l to the light, v to the eye,
h half vector; F, V, D, W array types (see quantities.Arrays).

No ray is ever moved off the surface it leaves. A ray says which object it leaves (`source`) and on which side of it
it runs (`inside`), and that object answers with the crossings that are left. So there is no epsilon to choose.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

NO_OBJECT = 0xFFFFFFFF


@dataclass(frozen=True)
class Ray:
    """A ray in world space, in double.

    o: origin, one for all lanes or one a lane. d: unit to 2^-52, or in single, and then `exact` makes it so.
    source: index of the object the ray leaves, or None. inside: whether it runs into that object, where it is closed.
    start: what is nearer than this, over `cosine` where it is given, lies flush with the surface that is left, and is
    not met; None: nothing is left.
    error: bound on the distance of the ray's known end from the true point: the origin of a ray that looks for what is
    first, the far end of one that asks what is between.
    """

    o: Any
    d: Any
    source: Any = None
    inside: Any = None
    start: Any = None
    error: Any = None
    cosine: Any = None

    def exact(self) -> "Ray":
        """The same ray in double: d, start and error may come in single, where few rays need more."""
        d = self.d if type(self.d) is type(self.o) else unit(self.d, type(self.o))
        double = type(d.x)
        start, error, cosine = (None if x is None else double(x) for x in (self.start, self.error, self.cosine))
        if cosine is not None:
            start /= dr.select(cosine > 0, cosine, 1)
        return replace(self, d=d, start=start, error=error, cosine=None)


@dataclass(frozen=True)
class Hit:
    """What a search finds: the distance t (inf where nothing is hit) and the index of the object, or NO_OBJECT."""

    t: Any
    index: Any

    @property
    def valid(self) -> Any:
        return self.index != NO_OBJECT


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
    return d * (1 + e * (-0.5 + 0.375 * e))


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
    return r * (1 + e * (-0.5 + 0.375 * e))
