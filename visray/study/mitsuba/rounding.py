"""How far Mitsuba's single precision may be from visray's double, lane by lane.

The model is that of backward error: what Mitsuba says of a ray is what is true of a ray beside it, no farther off than
the roundings in between allow. So visray's own answers for rays moved by that much, in all directions, say what
Mitsuba may answer, and where it may answer anything: at silhouettes, creases, seams, and for objects too small.
"""

from dataclasses import dataclass

import numpy as np

from visray.geometry import gamma
from visray.study.mitsuba.visray_scene import Answers, Rays, VisrayScene

# From a file to the side on which a ray passes an edge, a number of Mitsuba's passes through so many roundings: 1 in
# storing a matrix, 3 in a corner, 1 in the corner minus the origin, 2 in sums and differences of those, 2 in a cross
# product, 3 in a dot product. Of a sphere's or a disk's numbers it is fewer. Each is of numbers no larger than the sum
# of distances in Shift. As roundings partly cancel, what flat shapes and spheres use of the bound is a fifth at most.
ROUNDINGS = 12
BOUND = gamma(ROUNDINGS, "single")
# The ends of three axes at sqrt(3) hold the ball of radius 1 in their hull: no direction of error is missed.
AXES = np.sqrt(3) * np.concatenate([np.eye(3), -np.eye(3)])
# Where a move by rounding turns the normal by more than this (radians), or shifts t by more than this share of it, or
# (u, v) by more than this, the place is not resolved in single precision: it is a silhouette, crease, seam or pole, or
# on an object less than 16 times as large as the rounding.
UNRESOLVED = 1 / 16


@dataclass(frozen=True)
class Extents:
    """What of each object bounds the rounding of its twin. Shapes: one entry an object.

    far, growth: the twin's numbers under a point p are within far + growth |p|, such as the corners of the facet.
    gap: the distance between twin and object; angle: between their normals, in radians; slip: between their (u, v).
    smear: how much (u, v) change over a facet's width, in 1 / world units, where that is more than the object's own.
    bounded: whether it has bounds. sided: whether the twin knows outside from inside.
    """

    far: np.ndarray
    growth: np.ndarray
    gap: np.ndarray
    angle: np.ndarray
    smear: np.ndarray
    slip: np.ndarray
    bounded: np.ndarray
    sided: np.ndarray

    def shift(self, *indices: np.ndarray) -> "Shift":
        """How far rays may be off that meet the objects of `indices`; -1 stands for any bounded object."""

        def most(values: np.ndarray) -> np.ndarray:
            return np.max([np.append(values, values[self.bounded].max(initial=0.0))[i] for i in indices], axis=0)

        return Shift(most(self.far), most(self.growth), most(self.gap))

    def largest(self, n: int) -> "Shift":
        """As `shift`, for any object of the scene."""
        return Shift(*(np.full(n, v.max(initial=0.0)) for v in (self.far, self.growth, self.gap)))


@dataclass(frozen=True)
class Shift:
    """A bound of Mitsuba's error beside a ray: start + slope s at distance s from the ray's origin. Shapes: (N)."""

    far: np.ndarray
    growth: np.ndarray
    gap: np.ndarray

    def start(self, o: np.ndarray) -> np.ndarray:
        """The bound at the origin, or at any point o. Units: world units."""
        return BOUND * ((1 + self.growth) * np.linalg.norm(o, axis=1) + self.far) + self.gap

    def slope(self) -> np.ndarray:
        return BOUND * (1 + self.growth)

    def where(self, mask: np.ndarray, other: "Shift") -> "Shift":
        """`other` where the mask holds, this one elsewhere."""
        pairs = ((self.far, other.far), (self.growth, other.growth), (self.gap, other.gap))
        return Shift(*(np.where(mask, b, a) for a, b in pairs))


@dataclass(frozen=True)
class Slack:
    """What rounding may change of an answer. Shapes: (N).

    edge: another object, another face, or no certain place; seam: no certain (u, v). The others are bounds of the
    change of t (world units), of the normal (radians) and of u and v.
    """

    edge: np.ndarray
    seam: np.ndarray
    t: np.ndarray
    angle: np.ndarray
    uv: np.ndarray


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The angle between unit vectors in radians, exact for small ones too. Shapes: (N, 3), (N, 3) -> (N)."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(1))


def gaps(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """|a - b|, 0 where both are infinite."""
    both = np.isinf(a) & np.isinf(b)
    return np.abs(np.where(both, 0, a) - np.where(both, 0, b))


def moved(rays: Rays, shift: Shift) -> list[tuple[np.ndarray, np.ndarray]]:
    """The rays moved by the bound along each of AXES: pairs of origins and directions. Shapes: (N, 3)."""
    d = rays.direction()
    o = np.broadcast_to(rays.o.astype(float), d.shape)
    start, slope = shift.start(o)[:, None], shift.slope()[:, None]
    return [(o + start * e, _unit(d + slope * e)) for e in AXES]


def _unit(d: np.ndarray) -> np.ndarray:
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def slack(ours: VisrayScene, rays: Rays, base: Answers, shift: Shift, extents: Extents) -> Slack:
    """How much visray's answers change for rays moved by Mitsuba's rounding."""
    n = len(base.t)
    edge, dt, turn, duv = np.zeros(n, bool), np.zeros(n), np.zeros(n), np.zeros(n)
    for o, d in moved(rays, shift):
        other = ours.look(o, d).answers
        edge |= other.index != base.index
        dt = np.maximum(dt, gaps(other.t, base.t))
        turn = np.maximum(turn, angle(other.n, base.n))
        duv = np.maximum(duv, np.abs(other.uv - base.uv).max(1))
    hit = base.hit
    edge |= hit & ((dt > UNRESOLVED * base.t) | (turn > UNRESOLVED))
    seam = hit & ~edge & (duv > UNRESOLVED)
    tilt, smear, slip = (np.append(v, 0.0)[base.index] for v in (extents.angle, extents.smear, extents.slip))
    # t, n and (u, v) themselves are stored in single, by visray as by Mitsuba.
    t, dt = np.where(hit, base.t, 0), np.where(np.isfinite(dt), dt, 0)
    size = np.linalg.norm(rays.o, axis=1) + t
    # The place on a facet is as uncertain as the ray is across it, and as t along it.
    duv += slip + smear * (shift.start(rays.o) + shift.slope() * t + dt) + BOUND * (1 + np.abs(base.uv).max(1))
    return Slack(edge, seam, dt + BOUND * size, turn + tilt, duv)


def tied(ours: VisrayScene, rays: Rays, base: Answers, theirs: Answers, reach: np.ndarray) -> np.ndarray:
    """Whether the object that Mitsuba hits lies within `reach` of visray's hit: two surfaces in the same place."""
    d = rays.direction()
    o = np.broadcast_to(rays.o.astype(float), d.shape)
    behind = ours.look(o + (base.t - reach)[:, None] * d, d, base.index).answers
    return (behind.index == theirs.index) & (behind.t <= 2 * reach)
