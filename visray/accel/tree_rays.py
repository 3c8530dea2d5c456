"""Rays that walk through a bounding volume hierarchy (bvh.py), in single precision.

No ray misses a box that it meets: the docstring of `TreeRays` has the proof.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel.bvh import Tree
from visray.accel.row_tests import SingleRay
from visray.geometry import UNIT_ROUNDOFF, gamma, l1_norm
from visray.quantities import Arrays
from visray.ray import unit


@dataclass(frozen=True)
class TreeRays:
    """Rays that walk through a tree. All walks start at points near the tree, even if the ray origins are far away.

    The walk of a ray starts at the point p of the ray, at the distance `skipped` from the ray origin. No part of the
    ray before p is in a box, or it lies before the distance `begin` (`along`). Coordinates of p are relative to the
    tree's centre, so single precision suffices for them.
    Counted from p, the ray meets the plane x = b at the distance b / d.x - p.x / d.x.

    single: p, d and a bound of their errors, for the tests of rows.
    inverse: 1 / d, in single.
    near, far: -p / d, minus and plus an error margin.
    skipped: distance from the ray origin to p.
    error: bound on the error of p in double, and on the error of the exact test of a row.
    finite: mask of the rays without infinite or NaN components.

    Error: let u = 2^-24, and R the radius of the ball around all boxes. In double, p is within `error` of the true ray.
    The conversion of p to single adds at most u |p|. The product p.x / d.x and its sum with the margin add one rounding
    each. A plane of a box is b = c + k s, where c is a corner, s the length of a step, and k a number of steps
    (blocks.py). Its distance is computed as k (s / d.x) + (c / d.x - p.x / d.x). The roundings of s / d.x and of the
    term in brackets add at most 4 u R / |d.x| and one rounding of the distance itself. The margin
    (5 u |p| + 8 u R + error) / |d.x| is greater than all of these errors together, and what is left covers the rounding
    of the margin. The distance has four more relative errors: two from 1 / d.x (a conversion and a reciprocal), the one
    above, and one from the sum. `bvh_step.entered` allows for them at both ends of the interval.
    Source: Ize 2013.
    """

    a: Arrays
    tree: Tree
    single: SingleRay
    inverse: Any
    near: Any
    far: Any
    skipped: Any
    error: Any
    finite: Any

    @staticmethod
    def along(a: Arrays, tree: Tree, o: Any, d: Any, begin: Any = 0) -> "TreeRays":
        """The rays from the origin o in the direction d.

        d: unit vector, in double or in single. A single-precision d is taken as the ray's direction, and normalised in
            double.
        begin: distance from the ray origin. Boxes and rows that the ray meets only before it may be skipped.

        Shapes: o has one entry, or one entry per lane; d has one entry per lane.
        Domain: a ray with an infinite or NaN component meets no row.
        """
        d = d if type(d) is a.W else unit(d, a.W)
        q, ball, u = o - tree.centre, tree.ball, UNIT_ROUNDOFF["single"]
        # A ray meets no row before it enters the ball around the box of all rows.
        skipped = dr.maximum(-dr.dot(q, d) - ball, dr.maximum(begin, 0))
        p = q + skipped * d
        # The exact test of a row has an error of gamma(32) times the size of its numbers (culling.point_rounding). The
        # error of p is smaller.
        precision = "single" if a.D is a.F32 else "double"
        error = gamma(128, precision) * (l1_norm(o) + tree.size + skipped + ball)
        # A component of d below 2^-60 is replaced by 2^-60, so that no product is inf times 0. Inside the ball around
        # all rows, at distances up to |p| + ball, this moves the ray by less than 2 (2^-60) (|p| + ball). The bound
        # l1_norm(p) replaces |p|, because it needs no square root.
        least = 2.0**-60
        p32, d32, extent = a.V32(p), a.V32(d), l1_norm(p) + ball
        inverse = dr.rcp(dr.select(dr.abs(d32) < least, dr.copysign(a.V32(least), d32), d32))
        margin = 5 * u * dr.abs(p) + 8 * u * ball + error + 2 * least * extent
        middle, margin = -p32 * inverse, a.V32(margin) * dr.abs(inverse)
        single = SingleRay(p32, d32, a.F32(u * extent + error) * (1 + gamma(2, "single")))
        finite = dr.isfinite(dr.squared_norm(p) + dr.squared_norm(d))
        return TreeRays(a, tree, single, inverse, middle - margin, middle + margin, skipped, error, finite)

    @property
    def lanes(self) -> int:
        """The number of rays."""
        return max(dr.width(self.inverse), dr.width(self.near))

    def at_most(self, distance: Any) -> Any:
        """A distance from the ray origin, converted to a distance from the start of the walk.

        The result is in single, and rounded upwards.
        """
        a = self.a
        if type(distance) is a.F32:  # it may have been rounded from double to single
            distance = a.D(distance) * (1 + gamma(2, "single"))
        return a.F32(distance - self.skipped + self.error) * (1 + gamma(2, "single"))

    def at_least(self, distance: Any) -> Any:
        """As `at_most`, but rounded downwards. `distance` is in double; inf becomes a large number."""
        # Beyond this limit no product of a few numbers overflows single precision.
        after = dr.minimum(distance, 2.0**60) - self.skipped - self.error
        return self.a.F32(after - gamma(2, "single") * dr.abs(after))
