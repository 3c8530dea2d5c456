"""Tests of triangles, balls and rods in single precision, for rays that walk through a tree (bvh_walk.py).

Each test answers in three ways: a ray surely misses the row, surely hits it, or the test cannot tell. So the exact test
in double decides only rays that pass an edge or an outline to within rounding.

Error: u = 2^-24. Coordinates are relative to the tree's centre. The walk of a ray starts at p and has the direction d,
both rounded to single. Let e = u (|p|_1 + R) + error, where R is the radius of the ball around all rows, and `error`
bounds the error of p in double and that of the exact test, as a shift of the row or of the ray (`Walk`). So each
coordinate of p, and each number of a block that is a coordinate or a radius, has an error of at most e. A row that the
exact test hits at the distance t is met by the ray at a point that is at most `error` away from o + t d.
Proof by comparison with exact arithmetic: tests/test_row_tests.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel.blocks import SLOPE
from visray.geometry import UNIT_ROUNDOFF
from visray.quantities import Arrays


@dataclass(frozen=True)
class SingleRay:
    """Rays in single precision, in coordinates relative to the tree's centre.

    p, d: start of the walk, and direction.
    error: the bound e of this module.
    """

    p: Any
    d: Any
    error: Any


@dataclass(frozen=True)
class Verdict:
    """What a test in single precision says of a row, for each ray. Distances count from the start of the walk.

    may_hit: whether the exact test may find a crossing between 0 and a limit. It is true for all such crossings.
    surely_hits: whether the line crosses the row for certain, first between `low` and `high`.
    low, high: bounds of the distance of the first crossing.
    last: bound of the distance of the last crossing, from above.
    slope: bound of |n . d| at the last crossing, from below, for the unit normal n. A point of the ray behind the last
        crossing by x is at least x * slope away from the row.
    """

    may_hit: Any
    surely_hits: Any
    low: Any
    high: Any
    last: Any
    slope: Any


def test_triangle(a: Arrays, ray: SingleRay, block: Sequence[Any], limit: Any) -> Verdict:
    """The test of a triangle. block: the words of its block, as floats. limit: distance at which the search ends.

    Error: let h = n . p + c be the height of p above the plane, s = n . d, and t = -h / s the distance of the plane.
    |n| = 1, and |n . p| and |c| are at most |p|_1 + R. So h has an error of at most 6 e: one e for the rounding of n,
    one for p and c, and three roundings. s has an error of at most 5 u. If |s| >= 10 u, its true value is at least
    |s| / 2. The true distance t' fulfils |s'| |t - t'| <= 5 u |t| + 6 e + 2 u |t|. With E = e + u |t| this gives
    |t - t'| <= 14 E / |s|, and the point p + t d has an error of at most 16 E / |s| in each coordinate. A weight is
    n . p + c with |n|_1 <= SLOPE and |c| <= SLOPE R. Its own roundings add 5 SLOPE E. The third weight, 1 - b - c, has
    those of both others and two more: at most 32 SLOPE E / |s| in all. The code takes 40 E / |s| instead of 14 and of
    32, which covers the rounding of this bound.
    """
    u = UNIT_ROUNDOFF["single"]
    p, d, n = ray.p, ray.d, block[0:3]
    s = dr.fma(n[0], d.x, dr.fma(n[1], d.y, n[2] * d.z))
    # Also true for triangles that are nearly a line, whose normals are 0.
    edge_on = dr.abs(s) < 10 * u
    inverse = dr.rcp(dr.select(edge_on, 10 * u, s))
    t = -_height(n, block[3], p.x, p.y, p.z) * inverse
    x, y, z = (dr.fma(t, d[k], p[k]) for k in range(3))
    b, c = _height(block[4:7], block[7], x, y, z), _height(block[8:11], block[11], x, y, z)
    smaller = dr.select(b < c, b, c)
    least = dr.select(smaller < 1 - b - c, smaller, 1 - b - c)
    margin = 40 * dr.fma(dr.abs(t), u, ray.error) * dr.abs(inverse)
    low, high, edge = t - margin, t + margin, margin * block[SLOPE]
    may_hit = edge_on | ((least >= -edge) & (low <= limit) & (high >= 0))
    return Verdict(may_hit, ~edge_on & (least >= edge), low, high, high, dr.abs(s) - 5 * u)


def test_ball(a: Arrays, ray: SingleRay, block: Sequence[Any], limit: Any) -> Verdict:
    """The test of a ball. block, limit: as in `test_triangle`.

    Error: let l be the vector from p to the centre, m = l . d, and q = l - m d the vector from the ray's nearest point
    to the centre. l has an error of at most 2 e (one for p and the centre, and a rounding), m of 6 e (l, the rounding
    of d, and three roundings), and q of 11 e (l, m, and three roundings). With the rounding of |q| and of the radius r,
    and the error of the exact test, |q| - r has an error of at most 16 e. Let w = 32 e. So a ray that meets the ball
    has |q| <= r + w, and one with |q| <= r - w meets it. The square of half the chord, r^2 - q^2, has an error of at
    most 32 e r + (16 e)^2 for q <= r + w. So its true value lies between (r - w)^2 - q^2 and (r + w)^2 - q^2, the lower
    bound for r >= w.
    """
    p, d, radius, w = ray.p, ray.d, block[3], 32 * ray.error
    l = a.V32(*block[0:3]) - p
    m = dr.dot(l, d)
    squared = dr.squared_norm(l - m * d)
    longest2, shortest2 = dr.square(radius + w) - squared, dr.square(radius - w) - squared
    surely_hits = (shortest2 >= 0) & (radius > w)
    longest, shortest = dr.sqrt(dr.maximum(longest2, 0)), dr.sqrt(dr.select(surely_hits, shortest2, 0))
    low, last = m - longest - w, m + longest + w
    may_hit = (longest2 >= 0) & (low <= limit) & (last >= 0)
    return Verdict(may_hit, surely_hits, low, m - shortest + w, last, shortest / (radius + w))


def test_rod(a: Arrays, ray: SingleRay, block: Sequence[Any], limit: Any) -> Verdict:
    """The test of a rod: a row inside an infinite cylinder of radius r about a line, the axis. It is never sure of a
    hit. block, limit: as in `test_triangle`.

    Let l be the vector from p to the point of the axis, a the unit vector along it, and n = d x a. The distance of the
    ray's line from the axis is |l . n| / |n|. The ray is nearest to the axis at the distance m / |n|^2, for
    m = l . d - (l . a) (d . a). If the row is crossed at t, then |l . n| <= r |n|, and
    m - r |n| <= t |n|^2 <= m + r |n|.

    Error: l has an error of at most 6 e as a vector, and |l| u <= e. n has one of at most 7 u as a vector, and |n| is
    at most 1. So l . n has an error of at most 6 e + 7 e + 3 e. r and the exact test have one of at most 2 e each, and
    u r <= e, so r |n| has one of at most 4 e + 7 e + 4 e. Each of l . d and l . a has an error of at most 10 e, d . a
    of 5 u, and m of 28 e. |n|^2 has an error of at most 18 u. A crossing is at t <= e / u, because it is in the ball
    around all rows. With a limit of at most e / u, its product with |n|^2 has an error of at most 18 e. The code takes
    128 e for each of the sums, which are at most 63 e.
    """
    p, d, radius, axis = ray.p, ray.d, block[3], a.V32(*block[4:7])
    w = 128 * ray.error
    l, n = a.V32(*block[0:3]) - p, dr.cross(d, axis)
    squared = dr.squared_norm(n)
    reach = radius * dr.sqrt(squared) + w
    m = dr.dot(l, d) - dr.dot(l, axis) * dr.dot(d, axis)
    latest = dr.minimum(limit, ray.error * (1 / UNIT_ROUNDOFF["single"])) * squared
    may_hit = (dr.abs(dr.dot(l, n)) <= reach) & (m - reach <= latest) & (m + reach >= 0)
    zero = a.F32(0)
    return Verdict(may_hit, a.B(False), zero, zero, zero, zero)


def _height(n: Sequence[Any], c: Any, x: Any, y: Any, z: Any) -> Any:
    """n . (x, y, z) + c."""
    return dr.fma(n[0], x, dr.fma(n[1], y, dr.fma(n[2], z, c)))
