"""Maps from random numbers in the unit square to points of disks and spheres, and to directions in hemispheres. Strata
of the square become compact regions."""

from typing import Any

import drjit as dr

from visray.geometry import tangents


def disk(u: Any, v: Any) -> tuple[Any, Any]:
    """Uniform point of the unit disk, as x and y. Source: Shirley and Chiu 1997; the map takes concentric squares to
    concentric circles."""
    x, y = 2 * u - 1, 2 * v - 1
    x_dominates = dr.abs(x) > dr.abs(y)
    r = dr.select(x_dominates, x, y)
    minor = dr.select(x_dominates, y, x)
    angle = (0.25 * dr.pi) * minor / dr.select(r == 0, 1, r)
    s, c = dr.sincos(angle)
    return r * dr.select(x_dominates, c, s), r * dr.select(x_dominates, s, c)


def sphere(w: Any, u: Any, v: Any) -> Any:
    """Uniform point of the unit sphere, as a triple of type `w`. By Archimedes' theorem its z is uniform."""
    z = 1 - 2 * u
    r = 2 * dr.sqrt(dr.maximum(u * (1 - u), 0))
    s, c = dr.sincos((2 * dr.pi) * v)
    return w(r * c, r * s, z)


def cosine(n: Any, u: Any, v: Any) -> Any:
    """Direction in the hemisphere about the unit vector n, with density proportional to the cosine of the angle to n.
    Source: Malley's method, which projects a uniform point of the disk up to the hemisphere."""
    x, y = disk(type(n.x)(u), type(n.x)(v))
    s, t = tangents(n)
    return x * s + y * t + dr.sqrt(dr.maximum(1 - x * x - y * y, 0)) * n


def box(n: Any, u: Any, v: Any, w: Any) -> Any:
    """Direction in the hemisphere about the unit vector n, with the density of the original VisRayTrace. It points to a
    uniform point of the half cube |x| <= 1, |y| <= 1, 0 <= z <= 1, with z along n. Directions towards the cube's edges
    are therefore more frequent."""
    s, t = tangents(n)
    return dr.normalize((2 * u - 1) * s + (2 * v - 1) * t + w * n)
