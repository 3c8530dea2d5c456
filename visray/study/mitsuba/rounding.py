"""Bounds of the difference between Mitsuba's single precision and visray's double precision, ray by ray.

The model is backward error: Mitsuba's result for a ray is the exact result for a nearby ray, and the number of
roundings bounds the distance to the nearby ray. So visray traces rays that are moved by this distance in several
directions. The changes of visray's results bound the error of Mitsuba's result. They also show where Mitsuba's result
is undecided: at silhouettes, creases and seams, and for objects that are too small.
"""

from dataclasses import dataclass

import numpy as np

from visray.geometry import gamma
from visray.study.mitsuba.visray_scene import FirstHits, Rays, VisrayScene

# Number of roundings in Mitsuba, from the scene file to the decision on which side of a facet's edge a ray passes: 1
# when a matrix is stored, 3 in a corner, 1 in the corner minus the origin, 2 in sums and differences of those, 2 in a
# cross product, 3 in a dot product. The numbers of a sphere or a disk are rounded less often. The rounded numbers are
# no larger than the sum of distances in RayError. As roundings partly cancel, the observed errors of flat shapes and
# spheres are at most a fifth of the bound.
ROUNDINGS = 12
BOUND = gamma(ROUNDINGS, "single")
# Six vectors of length sqrt(3), along the axes. Their convex hull contains the unit ball, so errors in every direction
# are covered (test_moved_rays_surround_every_error).
AXES = np.sqrt(3) * np.concatenate([np.eye(3), -np.eye(3)])
# A hit is undecided in single precision if moving the ray by its rounding error turns the normal by more than
# UNRESOLVED radians, or changes t by more than UNRESOLVED * t; its (u, v) are undecided if u or v changes by more than
# UNRESOLVED. Then the hit is at a silhouette, crease, seam or pole, or on an object that is less than 16 times as large
# as the rounding error.
UNRESOLVED = 1 / 16


@dataclass(frozen=True)
class ObjectRounding:
    """Numbers that bound the rounding of each object's Mitsuba shapes. Shapes: one entry an object.

    far, growth: the numbers that are rounded when a ray passes the point p, such as the corners of a facet, are at most
        far + growth |p| (world units)
    gap: largest distance between the surfaces of Mitsuba's shapes and of the object (world units)
    angle: largest angle between the normals of Mitsuba's shapes and of the object (radians)
    smear: largest change of u or v per length across a facet; 0 if the shapes are not tessellated (1 / world units)
    slip: largest difference between the (u, v) of Mitsuba's shapes and of the object
    bounded: whether the object has a bounding box
    sided: whether Mitsuba's normals are sure to point outwards, so that their sign can be compared
    """

    far: np.ndarray
    growth: np.ndarray
    gap: np.ndarray
    angle: np.ndarray
    smear: np.ndarray
    slip: np.ndarray
    bounded: np.ndarray
    sided: np.ndarray

    def ray_error(self, *indices: np.ndarray) -> "RayError":
        """The RayError of rays that hit given objects.

        indices: arrays of object indices, (N) each; a ray gets the largest error over the arrays. Index -1 stands for
            any bounded object.
        """

        def largest(values: np.ndarray) -> np.ndarray:
            return np.max([np.append(values, values[self.bounded].max(initial=0.0))[i] for i in indices], axis=0)

        return RayError(largest(self.far), largest(self.growth), largest(self.gap))

    def largest_ray_error(self, n: int) -> "RayError":
        """The RayError of n rays that may hit any object of the scene."""
        return RayError(*(np.full(n, v.max(initial=0.0)) for v in (self.far, self.growth, self.gap)))


@dataclass(frozen=True)
class RayError:
    """A bound of Mitsuba's error across a ray: start(o) + slope() * s at distance s from the ray's origin o.

    far, growth, gap: as in ObjectRounding, one entry a ray, (N)
    """

    far: np.ndarray
    growth: np.ndarray
    gap: np.ndarray

    def start(self, o: np.ndarray) -> np.ndarray:
        """The bound at the origins o. Shapes: (N, 3) -> (N). Units: world units."""
        return BOUND * ((1 + self.growth) * np.linalg.norm(o, axis=1) + self.far) + self.gap

    def slope(self) -> np.ndarray:
        """Growth of the bound per length along the ray. Shapes: (N)."""
        return BOUND * (1 + self.growth)

    def where(self, mask: np.ndarray, other: "RayError") -> "RayError":
        """The error `other` in lanes where the mask is true, this error in all other lanes."""
        pairs = ((self.far, other.far), (self.growth, other.growth), (self.gap, other.gap))
        return RayError(*(np.where(mask, b, a) for a, b in pairs))


@dataclass(frozen=True)
class AllowedDifference:
    """The difference between visray's and Mitsuba's hits that rounding may cause. Shapes: (N).

    edge: whether the hit is undecided: rounding may change the object or the face, or move the point far away
    seam: whether (u, v) are undecided
    t: bound of the difference of distances (world units)
    angle: bound of the angle between normals (radians)
    uv: bound of the difference of u, and of the difference of v
    """

    edge: np.ndarray
    seam: np.ndarray
    t: np.ndarray
    angle: np.ndarray
    uv: np.ndarray


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The angle between unit vectors in radians; small angles are accurate too. Shapes: (N, 3), (N, 3) -> (N)."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(1))


def absolute_difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """|a - b|, and 0 in lanes where a and b are both infinite."""
    both = np.isinf(a) & np.isinf(b)
    return np.abs(np.where(both, 0, a) - np.where(both, 0, b))


def moved_rays(rays: Rays, error: RayError) -> list[tuple[np.ndarray, np.ndarray]]:
    """The rays, moved by their error along each of AXES: a list of six pairs (origins, directions). Shapes: (N, 3)."""
    d = rays.direction()
    o = np.broadcast_to(rays.o.astype(float), d.shape)
    start, slope = error.start(o)[:, None], error.slope()[:, None]
    return [(o + start * e, _unit(d + slope * e)) for e in AXES]


def _unit(d: np.ndarray) -> np.ndarray:
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def allowed_difference(
    ours: VisrayScene, rays: Rays, hits: FirstHits, error: RayError, rounding: ObjectRounding
) -> AllowedDifference:
    """The largest difference between visray's and Mitsuba's hits that rounding may cause.

    It is computed from the hits of rays that are moved by Mitsuba's rounding error and traced by visray.

    hits: visray's hits of the rays that are not moved
    error: Mitsuba's rounding error of the rays
    rounding: bounds of the rounding of each object
    """
    n = len(hits.t)
    edge, dt, turn, duv = np.zeros(n, bool), np.zeros(n), np.zeros(n), np.zeros(n)
    for o, d in moved_rays(rays, error):
        moved_hits = ours.trace_from(o, d).first_hits
        edge |= moved_hits.index != hits.index
        dt = np.maximum(dt, absolute_difference(moved_hits.t, hits.t))
        turn = np.maximum(turn, angle(moved_hits.n, hits.n))
        duv = np.maximum(duv, np.abs(moved_hits.uv - hits.uv).max(1))
    edge |= hits.hit & ((dt > UNRESOLVED * hits.t) | (turn > UNRESOLVED))
    seam = hits.hit & ~edge & (duv > UNRESOLVED)
    tilt, smear, slip = (np.append(v, 0.0)[hits.index] for v in (rounding.angle, rounding.smear, rounding.slip))
    # Both programs store t, n and (u, v) in single precision.
    t, dt = np.where(hits.hit, hits.t, 0), np.where(np.isfinite(dt), dt, 0)
    size = np.linalg.norm(rays.o, axis=1) + t
    # The uncertainty of a hit point on a facet is that of the ray across its direction plus that of t along it.
    duv += slip + smear * (error.start(rays.o) + error.slope() * t + dt) + BOUND * (1 + np.abs(hits.uv).max(1))
    return AllowedDifference(edge, seam, dt + BOUND * size, turn + tilt, duv)


def coincident(
    ours: VisrayScene, rays: Rays, our_hits: FirstHits, their_hits: FirstHits, tolerance: np.ndarray
) -> np.ndarray:
    """Whether the object that Mitsuba hits also lies at visray's hit, to within `tolerance` along the ray. Shapes: (N).

    Then two surfaces are in the same place. tolerance: in world units, (N).
    """
    d = rays.direction()
    o = np.broadcast_to(rays.o.astype(float), d.shape)
    behind = ours.trace_from(o + (our_hits.t - tolerance)[:, None] * d, d, our_hits.row).first_hits
    return (behind.index == their_hits.index) & (behind.t <= 2 * tolerance)
