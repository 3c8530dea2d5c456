"""From the unit square to disks, spheres and hemispheres: equal areas to equal areas, strata to compact pieces."""

from typing import Any

import drjit as dr

from visray.geometry import tangents


def disk(u: Any, v: Any) -> tuple[Any, Any]:
    """A point of the unit disk, uniformly. Source: Shirley and Chiu 1997, concentric squares to concentric circles."""
    x, y = 2 * u - 1, 2 * v - 1
    wide = dr.abs(x) > dr.abs(y)
    r = dr.select(wide, x, y)
    other = dr.select(wide, y, x)
    turn = (0.25 * dr.pi) * other / dr.select(r == 0, 1, r)
    s, c = dr.sincos(turn)
    return r * dr.select(wide, c, s), r * dr.select(wide, s, c)


def sphere(w: Any, u: Any, v: Any) -> Any:
    """A point of the unit sphere, a triple of type `w`, uniformly: by Archimedes, all heights are alike."""
    z = 1 - 2 * u
    r = 2 * dr.sqrt(dr.maximum(u * (1 - u), 0))
    s, c = dr.sincos((2 * dr.pi) * v)
    return w(r * c, r * s, z)


def cosine(n: Any, u: Any, v: Any) -> Any:
    """A direction about the unit vector n, by the cosine with it. Source: Malley, a uniform disk lifted up."""
    x, y = disk(type(n.x)(u), type(n.x)(v))
    s, t = tangents(n)
    return x * s + y * t + dr.sqrt(dr.maximum(1 - x * x - y * y, 0)) * n


def box(n: Any, u: Any, v: Any, w: Any) -> Any:
    """A direction about n as the original VisRayTrace drew it: a point of a half cube, crowded along its edges."""
    s, t = tangents(n)
    return dr.normalize((2 * u - 1) * s + (2 * v - 1) * t + w * n)
