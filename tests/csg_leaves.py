"""The solids that CSG is made of, on rays and at points, in 80-bit floats: what is inside, outside, or within rounding.

No formula is that of a kernel. Convex kinds are those of samples.py. Polynomials are multiplied out along the ray, and
their roots are found between those of their derivatives by bisection. Of meshes, all triangles are tested.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from csg_sets import IN, OUT, UNKNOWN, Sets
from samples import ROUNDINGS, SAMPLES, Real, dot, half_space, inverse, norm, real, rounding, unit

from visray.geometry import gamma
from visray.transforms import Matrix, Transform

# Two faces count as one if they are nearer to each other than this number of roundings of their coordinates.
TIE = 64


def affine(linear: np.ndarray, offset: np.ndarray) -> Matrix:
    """An affine map as a step of a transform."""
    return Matrix(matrix=tuple(map(tuple, np.c_[linear, offset].astype(float).tolist())))


@dataclass(frozen=True)
class Leaf:
    """An operand without operands of its own, placed in the world.

    thing: the object, without `transform` and `cut`.
    steps: all transforms from its coordinates to the world.
    material: name of its own material.
    """

    thing: Any
    steps: tuple[Transform, ...]
    material: str

    @cached_property
    def to_world(self) -> tuple[np.ndarray, np.ndarray]:
        """Linear part and offset of its transform: the product of the steps' matrices in 80 bits."""
        linear, offset = np.eye(3, dtype=Real), np.zeros(3, Real)
        for step in self.steps:
            matrix = real(step.affines([step])[0])
            linear, offset = matrix[:, :3] @ linear, matrix[:, :3] @ offset + matrix[:, 3]
        return linear, offset

    @cached_property
    def from_world(self) -> np.ndarray:
        return inverse(self.to_world[0])

    def local(self, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World rays in its own coordinates."""
        return (real(o) - self.to_world[1]) @ self.from_world.T, real(d) @ self.from_world.T

    def local_point(self, p: np.ndarray) -> np.ndarray:
        return (real(p) - self.to_world[1]) @ self.from_world.T

    def world_normal(self, n: np.ndarray) -> np.ndarray:
        return unit(n @ self.from_world)

    def hull(self) -> tuple[np.ndarray, float]:
        """Middle and reach in its own coordinates."""
        return SAMPLES[type(self.thing).__name__].hull(self.thing)

    @cached_property
    def placed(self) -> Any:
        """The object with all its transforms as one, in double."""
        return replace(self.thing, transform=(affine(*self.to_world),) if self.steps else ())

    def slack(self, o: np.ndarray, d: np.ndarray, t: Any) -> np.ndarray:
        """The bound, in its own units, within which a kernel's ray passes it, t from its origin, and within which faces
        count as one. `o`, `d`: local."""
        middle, reach = self.hull()
        linear, offset = self.to_world
        stretch = np.linalg.svd(linear.astype(float), compute_uv=False)
        size = np.abs(linear @ real(middle) + offset).sum() + stretch[0] * reach
        start = o @ linear.T + offset
        far = norm(start - linear @ real(middle) - offset) + stretch[0] * reach
        tie = gamma(TIE) * (np.abs(start).sum(1) + np.maximum(far, t) + size) / stretch[-1]
        return np.maximum((2 + len(self.steps)) * self.rounding(o, d, t), tie)

    def rounding(self, o: np.ndarray, d: np.ndarray, t: Any) -> np.ndarray:
        """The bound, in its own units, within which a kernel's ray passes it if the transforms were one. `o`, `d`:
        local."""
        return rounding(self.placed, o, d, t)

    def sets(self, o: np.ndarray, d: np.ndarray) -> Sets:
        """What of world rays is inside."""
        raise NotImplementedError

    def surface(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(signed distance to first order, outside > 0; outward unit normal) at points, in its own coordinates."""
        faces = SAMPLES[type(self.thing).__name__].twin.faces(self.thing, p)
        distance = np.stack([f.distance for f in faces])
        normal = np.stack([np.broadcast_to(f.normal, p.shape) for f in faces])
        best = distance.argmax(0)
        return distance.max(0), normal[best, np.arange(len(p))]

    def crease(self, p: np.ndarray) -> np.ndarray:
        """The distance of points of the surface from the next of its faces, in its own coordinates."""
        faces = SAMPLES[type(self.thing).__name__].twin.faces(self.thing, p)
        if len(faces) == 1:
            return np.full(len(p), np.inf)
        distance = np.sort(np.stack([f.distance for f in faces]), 0)
        return distance[-1] - distance[-2]

    def state(self, p: np.ndarray) -> np.ndarray:
        """Whether world points are inside, outside, or within rounding of the surface."""
        local = self.local_point(p)
        distance, _ = self.surface(local)
        slack = self.slack(local, np.zeros_like(local), 0.0)
        return np.where(distance < -slack, IN, np.where(distance > slack, OUT, UNKNOWN))


class Unframed(Leaf):
    """A kind whose surface is read in its own coordinates, without a frame that maps a canonical shape to it."""

    def rounding(self, o: np.ndarray, d: np.ndarray, t: Any) -> np.ndarray:
        middle, reach = self.hull()
        m, offset = (x.astype(float) for x in self.to_world)
        stretch = np.linalg.svd(m, compute_uv=False)
        hadamard = np.prod(np.linalg.norm(m, axis=0)) / abs(np.linalg.det(m))
        k = hadamard * (1 + hadamard) / 2 * stretch[0] / stretch[-1]
        origin = 6 * (stretch[0] * np.linalg.norm(middle) + np.linalg.norm(offset)) / stretch[-1]
        far = norm(o - real(middle)) + reach + np.linalg.norm(middle)
        return gamma(2 * ROUNDINGS) * k * far + gamma(1) * origin


class Convex(Leaf):
    """A kind whose twin in samples.py has an interval. Domain: rays that are no subset of the surface."""

    def sets(self, o: np.ndarray, d: np.ndarray) -> Sets:
        o, d = self.local(o, d)
        twin = SAMPLES[type(self.thing).__name__].twin
        with np.errstate(all="ignore"):
            g = self.slack(o, d, 0.0)
            grown, shrunk = (twin.interval(self.thing, o, d, s * g) for s in (1, -1))
        return between(grown, shrunk)


def between(grown: tuple[np.ndarray, np.ndarray], shrunk: tuple[np.ndarray, np.ndarray]) -> Sets:
    """The set that lies between two intervals of each ray. An interval whose ends are not in order is empty."""
    cut = np.stack([*grown, *shrunk]).astype(Real)

    def state(t: np.ndarray) -> np.ndarray:
        within = [(low < t) & (t < high) for low, high in (grown, shrunk)]
        return np.where(within[1], IN, np.where(within[0], UNKNOWN, OUT))

    return Sets.of(cut, state)


class HalfSpace(Leaf):
    """A plane: the side that its normal points away from."""

    def sets(self, o: np.ndarray, d: np.ndarray) -> Sets:
        o, d = self.local(o, d)
        n, point = unit(self.thing.normal), real(self.thing.point)
        with np.errstate(all="ignore"):
            low, high = half_space(o, d, n, dot(point, n))
            t = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0))
            g = self.slack(o, d, np.abs(t))
            grown, shrunk = (half_space(o, d, n, dot(point, n) + s * g) for s in (1, -1))
        return between(grown, shrunk)


class Algebraic(Unframed):
    """A solid f < 0 within a ball: along a ray f is a polynomial in s, from -1 to 1 within the ball."""

    def ball(self) -> tuple[np.ndarray, float]:
        """Middle and radius of a ball that holds the solid, or that the ends of a clip touch at most."""
        raise NotImplementedError

    def along(self, o: np.ndarray, d: np.ndarray, sign: int, slack: np.ndarray) -> np.ndarray:
        """The coefficients, lowest first, along rays o + s d of the solid grown (1) or shrunk (-1). Shape: (n, N)."""
        raise NotImplementedError

    def sets(self, o: np.ndarray, d: np.ndarray) -> Sets:
        o, d = self.local(o, d)
        middle, radius = self.ball()
        with np.errstate(all="ignore"):
            g = self.slack(o, d, 0.0)
            w, dd = o - real(middle), dot(d, d)
            shift = -dot(w, d) / dd
            nearest = w + shift[:, None] * d
            half = np.sqrt(np.maximum((radius * Real(1.001) + g) ** 2 - dot(nearest, nearest), 0) / dd)
        met = half > 0
        if not met.any():
            return Sets.of(np.full((1, len(o)), np.inf, Real), lambda t: np.full(t.shape, OUT))
        nearest, step = np.where(met[:, None], nearest, 0), np.where(met, half, 1)
        grown, shrunk = (self.along(nearest, d * step[:, None], s, g) for s in (1, -1))
        roots = np.concatenate([real_roots(f) for f in (grown, shrunk)])
        ends = np.array([[-1.0], [1.0]]) + np.zeros_like(roots[:1])
        cut = np.where(met, shift + step * np.concatenate([roots, ends]), np.inf)

        def state(t: np.ndarray) -> np.ndarray:
            s = np.where(met & np.isfinite(t), (t - shift) / step, 2)
            inside, outside = horner(shrunk, s) < 0, horner(grown, s) > 0
            return np.where(np.abs(s) > 1, OUT, np.where(inside, IN, np.where(outside, OUT, UNKNOWN)))

        return Sets.of(cut, state)


def horner(f: np.ndarray, s: np.ndarray) -> np.ndarray:
    total = np.zeros_like(s)
    for c in f[::-1]:
        total = total * s + c
    return total


def real_roots(f: np.ndarray, steps: int = 66) -> np.ndarray:
    """All changes of sign from -1 to 1 of polynomials (n, N), lowest coefficient first; 1 where there are fewer.

    Between two neighbours of -1, the roots of the derivative and 1, the polynomial is monotone, and bisection finds its
    root to the last of 64 bits. The roots of the derivative need half as many: an error of 2^-40 there changes the
    polynomial by its square.
    """
    if len(f) <= 1:
        return np.ones((0, f.shape[1]), Real)
    slope = f[1:] * np.arange(1, len(f), dtype=Real)[:, None]
    turns = np.sort(real_roots(slope, 40), 0)
    ends = np.concatenate([np.full_like(f[:1], -1), turns, np.full_like(f[:1], 1)])
    low, high = ends[:-1], ends[1:]
    below = horner(f, low) < 0
    crossed = below != (horner(f, high) < 0)
    found = np.ones_like(low)
    piece, ray = np.nonzero(crossed)
    low, high, below, f = low[piece, ray], high[piece, ray], below[piece, ray], f[:, ray]
    for _ in range(steps):
        middle = (low + high) / 2
        same = (horner(f, middle) < 0) == below
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    found[piece, ray] = (low + high) / 2
    return found
