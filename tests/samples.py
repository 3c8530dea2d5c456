"""One sample for each kind of primitive: random instances, and the same shape in NumPy by another formula.

The twins work in the object's own coordinates, before its transform, in 80-bit floats: their rounding is 2^11 times
finer than the kernels'. No twin shares a formula with its kernel: a kernel maps the ray to a canonical shape, a twin
keeps the object where it is and cuts the ray with half-spaces and with quadrics in vector form.

Each twin can be grown by a distance g, outwards everywhere. A kernel in double answers exactly for some object within a
rounding bound of the true one; so its t lies between those of the object grown and shrunk by that bound, grazing rays
included, and where growing turns a hit into a miss the exact answer is within rounding of an edge.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import exact_surfaces as exact
import numpy as np
from exact_surfaces import Piece

from visray.accel.origin import Geometry
from visray.accel.ray_segment import RaySegment, length_inside, occludes
from visray.camera import Camera
from visray.errors import UserError
from visray.geometry import gamma
from visray.interaction import surface_of
from visray.primitives import (
    KINDS,
    Box,
    Capsule,
    Cone,
    Csg,
    Cylinder,
    Disk,
    Ellipsoid,
    Mesh,
    Plane,
    Polynomial,
    Rectangle,
    Sphere,
    Torus,
    Triangle,
)
from visray.primitives.clips import Ball
from visray.primitives.polynomial_solid import PolynomialSolid
from visray.primitives.primitive import scalars
from visray.pytree import rows
from visray.ray import NOTHING_KNOWN, Crossing, Hit, KnownEnds, Ray
from visray.scene.scene import Film, Scene, Settings
from visray.setup import prepare
from visray.transforms import Rotate, Scale, Translate, compose

Real = np.longdouble
PI = 4 * np.arctan(Real(1))


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(-1)


def norm(a: np.ndarray) -> np.ndarray:
    return np.sqrt(dot(a, a))


def real(v: Any) -> np.ndarray:
    return np.asarray(v, Real)


def unit(v: Any) -> np.ndarray:
    v = real(v)
    return v / norm(v)[..., None]


@dataclass(frozen=True)
class Face:
    """A part of a surface as seen from points: signed distance (outside > 0), outward normal, radius of curvature."""

    distance: np.ndarray
    normal: np.ndarray
    bend: Any = np.inf


def half_space(o: np.ndarray, d: np.ndarray, n: np.ndarray, k: Any) -> tuple[np.ndarray, np.ndarray]:
    """The interval of t with n . (o + t d) <= k."""
    slope, gap = dot(d, n), k - dot(o, n)
    t = gap / np.where(slope == 0, 1, slope)
    low = np.where(slope < 0, t, np.where((slope == 0) & (gap < 0), np.inf, -np.inf))
    return low, np.where(slope > 0, t, np.where((slope == 0) & (gap < 0), -np.inf, np.inf))


def endless_tube(w: np.ndarray, d: np.ndarray, a: np.ndarray, radius: Any) -> tuple[np.ndarray, np.ndarray]:
    """The interval of w + t d within `radius` of a line through 0 along the unit vector a, by the distance of lines."""
    across, aside = np.cross(d, a), np.cross(w, a)
    squared = dot(across, across)
    disc = radius**2 * squared - dot(np.cross(w, d), a) ** 2
    along = squared == 0
    safe = np.where(along, 1, squared)
    half = np.where(disc < 0, -np.inf, np.sqrt(np.maximum(disc, 0)) / safe)
    half = np.where(along, np.where(dot(aside, aside) <= radius**2, np.inf, -np.inf), half)
    middle = np.where(along, 0, -dot(aside, across) / safe)
    return middle - half, middle + half


def common(*parts: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return np.max([p[0] for p in parts], 0), np.min([p[1] for p in parts], 0)


class RoundSphere:
    """By the distance of the centre from the line, from a cross product."""

    @staticmethod
    def interval(s: Sphere, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        w, dd = real(s.center) - o, dot(d, d)
        aside = np.cross(w, d)
        squared = np.maximum(s.radius + g, 0) ** 2 - dot(aside, aside) / dd
        half = np.sqrt(np.maximum(squared, 0) / dd)
        half = np.where(squared < 0, -np.inf, half)
        middle = dot(w, d) / dd
        return middle - half, middle + half

    @staticmethod
    def faces(s: Sphere, p: np.ndarray) -> list[Face]:
        w = p - real(s.center)
        return [Face(norm(w) - s.radius, unit(w), s.radius)]

    @staticmethod
    def uv(s: Sphere, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By the height on the axis, and by the half angle of longitude."""
        x, y, z = unit(p - real(s.center)).T
        east = 2 * np.arctan2(-z, np.hypot(x, z) + x)
        return 0.5 + east / (2 * PI), np.arcsin(np.clip(y, -1, 1)) / PI + 0.5


class RoundEllipsoid:
    """By Lagrange's identity: of the half axes' inverses, cross products in place of a difference of squares."""

    @staticmethod
    def interval(s: Ellipsoid, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        # Half axes that are longer by g make the ellipsoid thicker by as little as 2 sqrt(k) / (1 + k) g, where k is
        # the ratio of the longest to the shortest (Kantorovich).
        k = max(s.radii) / min(s.radii)
        g = np.atleast_1d(g) * (1 + k) / (2 * np.sqrt(real(k)))
        a = np.maximum(real(s.radii) + g[:, None], np.finfo(float).tiny)
        w = real(s.center) - o
        dd, wd = dot(d / a, d / a), dot(w / a, d / a)
        aside = np.cross(w, d) * a / np.prod(a, 1)[:, None]
        squared = dd - dot(aside, aside)
        half = np.where(squared < 0, -np.inf, np.sqrt(np.maximum(squared, 0)))
        return (wd - half) / dd, (wd + half) / dd

    @staticmethod
    def faces(s: Ellipsoid, p: np.ndarray) -> list[Face]:
        """The distance to first order: the points are within rounding of the surface."""
        a = real(s.radii)
        q = (p - real(s.center)) / a
        slope, size = norm(q / a), norm(q)
        # Curvature is the second derivative over the slope, which is at most 1 over the square of the least half axis.
        return [Face((size - 1) * size / slope, unit(q / a), slope * min(s.radii) ** 2)]

    @staticmethod
    def uv(s: Ellipsoid, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a = real(s.radii)
        return RoundSphere.uv(Sphere(), (p - real(s.center)) / a)


class RoundCapsule:
    """By its three parts, each as a whole: a cylinder and two balls."""

    @staticmethod
    def interval(s: Capsule, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        way = real(s.b) - real(s.a)
        middle, n = (real(s.a) + real(s.b)) / 2, unit(way)
        # Not by way of Cylinder, whose fields are rounded to doubles.
        w, radius = o - middle, np.maximum(s.radius + g, 0)
        top = dot(middle, n)
        caps = [half_space(o, d, e * n, e * top + norm(way) / 2) for e in (1, -1)]
        parts = [common(endless_tube(w, d, n, radius), *caps)]
        parts += [RoundSphere.interval(Sphere(center=c, radius=s.radius), o, d, g) for c in (s.a, s.b)]
        near = np.min([np.where(low <= high, low, np.inf) for low, high in parts], 0)
        return near, np.max([np.where(low <= high, high, -np.inf) for low, high in parts], 0)

    @staticmethod
    def faces(s: Capsule, p: np.ndarray) -> list[Face]:
        away, _ = from_axis(s, p)
        return [Face(norm(away) - s.radius, unit(away), s.radius)]

    @staticmethod
    def uv(s: Capsule, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By the half angle around, and by the arc from the pole beyond a, from its sine."""
        way = real(s.b) - real(s.a)
        n, (away, share) = unit(way), from_axis(s, p)
        lift = dot(away, n)
        arc = np.arcsin(np.clip(lift / norm(away), -1, 1)) * s.radius
        whole = PI * s.radius + norm(way)
        return turn_about(n, away), (PI / 2 * s.radius + share * norm(way) + arc) / whole


def from_axis(s: Capsule, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The way to points from the nearest point between a and b, and where that is, from 0 to 1."""
    way, w = real(s.b) - real(s.a), p - real(s.a)
    share = np.clip(dot(w, way) / dot(way, way), 0, 1)
    return w - share[:, None] * way, share


def turn_about(n: np.ndarray, w: np.ndarray) -> np.ndarray:
    """The angle of points about an axis, from 0 to 1, by half of it; 0.5 is where the horizontal across the axis is."""
    east = np.array([n[2], 0, -n[0]])
    east = np.array([1, 0, 0], Real) if not east.any() else unit(east)
    x, y = dot(w, east), dot(w, np.cross(n, east))
    return 0.5 + np.arctan2(y, np.hypot(x, y) + x) / PI


class RoundTorus:
    """By the quartic of a ray that is recentred, which has no cubic term: between the zeros of its slope, a cubic in
    closed form, it has one zero or none, and bisection finds it."""

    @classmethod
    def first(cls, s: Torus, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        """(kind of the first crossing as in Truth, t)."""
        n, w, size = unit(s.axis), o - real(s.center), norm(d)
        d = d / size[:, None]
        shift = -dot(w, d)
        w = w + shift[:, None] * d
        major, minor = real(s.major), np.maximum(s.minor + g, 0)
        z, dz = dot(w, n), dot(d, n)
        c = dot(w, w) - major**2 - minor**2

        minor = np.broadcast_to(minor, shift.shape)

        def f(t: np.ndarray, i: Any = ...) -> np.ndarray:
            lift = t * dz[i]
            return (t * t + c[i]) ** 2 - 4 * major**2 * (minor[i] - z[i] - lift) * (minor[i] + z[i] + lift)

        # f' / 4 = t^3 + p t + q.
        p, q = c + 2 * major**2 * dz**2, 2 * major**2 * z * dz
        turns = cubic_roots(p, q)
        # Beyond this distance from where the ray is nearest to the centre it is outside.
        far = np.broadcast_to(1.5 * (major + minor), shift.shape)
        ends = np.sort(np.clip(np.stack([-far, *turns, far]), -far, far), 0)
        start = np.clip(-shift, -far, far)
        t, what = np.full(shift.shape, np.inf, Real), np.zeros(shift.shape, int)
        inside = (f(start) < 0) & (np.abs(shift) < far)
        lows, highs = np.maximum(ends[:-1], start), ends[1:]
        below = f(lows) < 0
        crossed = (lows < highs) & (below != (f(highs) < 0))
        # The first piece between turns in which a ray crosses, of the rays that do.
        i = np.flatnonzero(crossed.any(0))
        k = crossed.argmax(0)[i]
        low, high, below = lows[k, i], highs[k, i], below[k, i]
        for _ in range(70):  # 64 bits of a span that is no longer than the ray's way through the torus
            middle = (low + high) / 2
            same = (f(middle, i) < 0) == below
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        t[i] = (low + high) / 2 + shift[i]
        what[i] = np.where(inside[i], 2, 1)
        return what, t / size

    @staticmethod
    def faces(s: Torus, p: np.ndarray) -> list[Face]:
        n, w = unit(s.axis), p - real(s.center)
        z = dot(w, n)
        out = w - z[:, None] * n
        wide = norm(out)
        tube = np.hypot(wide - s.major, z)
        e = out / np.where(wide == 0, 1, wide)[:, None]
        normal = ((wide - s.major)[:, None] * e + z[:, None] * n) / tube[:, None]
        # Across the tube, and around the axis: the way to it along the normal.
        slope = np.abs(wide - s.major) / tube
        bend = np.minimum(s.minor, wide / np.where(slope == 0, 1e-9, slope))
        return [Face(tube - s.minor, normal, bend)]

    @staticmethod
    def uv(s: Torus, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n, w = unit(s.axis), p - real(s.center)
        z = dot(w, n)
        out = norm(w - z[:, None] * n) - s.major
        return turn_about(n, w), 0.5 + np.arctan2(z, np.hypot(out, z) + out) / PI


def cubic_roots(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The real roots of t^3 + p t + q, in closed form and by four steps of Newton's; where there is one only, it stands
    three times. Shapes: (3, N)."""
    half, third = q / 2, p / 3
    disc = half**2 + third**3
    root = np.sqrt(np.maximum(disc, 0))
    big = np.cbrt(-half - np.copysign(root, half))
    one = big - np.where(big == 0, 0, third / np.where(big == 0, 1, big))
    size = np.sqrt(np.maximum(-third, 0))
    cube = np.where(size == 0, 1, size) ** 3
    angle = np.arccos(np.clip(-half / cube, -1, 1)) / 3
    found = [np.where(disc < 0, 2 * size * np.cos(angle - 2 * PI * k / 3), one) for k in range(3)]
    for _ in range(4):
        for k, t in enumerate(found):
            slope = 3 * t * t + p
            step = (t**3 + p * t + q) / np.where(slope == 0, np.inf, slope)
            found[k] = t - np.where(np.abs(step) < 1e-3 * np.abs(t), step, 0)
    return np.stack(found)


class RoundPolynomial(RoundSphere):
    """That of the sphere that the polynomial of the sample is."""

    @staticmethod
    def interval(s: Polynomial, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        return RoundSphere.interval(round_of(s), o, d, g)

    @staticmethod
    def faces(s: Polynomial, p: np.ndarray) -> list[Face]:
        return RoundSphere.faces(round_of(s), p)

    @staticmethod
    def uv(s: Polynomial, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return RoundSphere.uv(round_of(s), p)


def round_of(s: Polynomial) -> Sphere:
    """The sphere that the polynomial of the sample is."""
    a, b, c, r = s.parameters.values()
    return Sphere(center=(a, b, c), radius=r, transform=s.transform)


def polynomial_sphere(centre: tuple, radius: float, **more: Any) -> Polynomial:
    """A sphere as a polynomial, a solid, well within its clip."""
    return Polynomial(
        expression="(x - a)^2 + (y - b)^2 + (z - c)^2 - r^2",
        parameters=dict(zip("abcr", (*centre, radius))),
        clip=Ball(center=centre, radius=CLIP * radius),
        ends="capped",
        **more,
    )


# Radius of the clip of a polynomial sphere over its own.
CLIP = 1.3


class RoundBox:
    """By six half-spaces."""

    @staticmethod
    def interval(s: Box, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        sides = [(n, (s.max[i] if n[i] > 0 else -s.min[i])) for i in range(3) for n in (np.eye(3)[i], -np.eye(3)[i])]
        return common(*(half_space(o, d, real(n), real(k) + g) for n, k in sides))

    @staticmethod
    def faces(s: Box, p: np.ndarray) -> list[Face]:
        high = [Face(p[:, i] - s.max[i], np.broadcast_to(real(np.eye(3)[i]), p.shape)) for i in range(3)]
        low = [Face(s.min[i] - p[:, i], np.broadcast_to(-real(np.eye(3)[i]), p.shape)) for i in range(3)]
        return high + low


class RoundCylinder:
    """By the distance between the line and the axis, as of two skew lines."""

    @staticmethod
    def interval(s: Cylinder, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        a, w = unit(s.axis), o - real(s.center)
        radius = np.maximum(s.radius + g, 0)
        top = dot(real(s.center), a)
        caps = [half_space(o, d, n * a, n * top + 0.5 * real(s.height) + g) for n in (1, -1)]
        return common(endless_tube(w, d, a, radius), *caps)

    @staticmethod
    def faces(s: Cylinder, p: np.ndarray) -> list[Face]:
        a, w = unit(s.axis), p - real(s.center)
        z = dot(w, a)
        out = w - z[:, None] * a
        wide = norm(out)
        outward = out / np.where(wide == 0, 1, wide)[:, None]
        caps = [Face(n * z - 0.5 * real(s.height), np.broadcast_to(n * a, p.shape)) for n in (1, -1)]
        return [Face(wide - s.radius, outward, s.radius), *caps]


class RoundCone:
    """By the angle at the apex, the ray recentred where it is nearest to the apex."""

    @staticmethod
    def interval(s: Cone, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        a, slant = unit(s.axis), np.hypot(real(s.radius), real(s.height))
        cos2, sine = (s.height / slant) ** 2, s.radius / slant
        apex = real(s.base) + np.atleast_1d(s.height + g / sine)[:, None] * a
        dd = dot(d, d)
        shift = dot(apex - o, d) / dd
        w = o + shift[:, None] * d - apex
        # down . (p - apex) >= cos |p - apex| inside.
        dn, wn = -dot(d, a), -dot(w, a)
        A, B, C = dn * dn - cos2 * dd, dn * wn - cos2 * dot(w, d), wn * wn - cos2 * dot(w, w)
        A = np.where(A == 0, Real(1e-300), A)  # parallel to the wall: one root is as good as infinite
        disc = B * B - A * C
        root = np.sqrt(np.maximum(disc, 0))
        q = -(B + np.where(B < 0, -root, root))
        r1, r2 = C / np.where(q == 0, 1, q), q / A
        r1 = np.where(q == 0, 0, r1)
        low, high = np.minimum(r1, r2), np.maximum(r1, r2)
        steep, down = A > 0, dn > 0
        lower = wn + 0.5 * (low + high) * dn >= 0
        bad = ~steep & ((disc < 0) | ~lower)
        near = np.where(bad, np.inf, np.where(steep, np.where(down, high, -np.inf), low)) + shift
        far = np.where(bad, -np.inf, np.where(steep, np.where(down, np.inf, low), high)) + shift
        return common((near, far), half_space(o, d, -a, -dot(real(s.base), a) + g))

    @staticmethod
    def faces(s: Cone, p: np.ndarray) -> list[Face]:
        a, w = unit(s.axis), p - real(s.base)
        slant = np.hypot(real(s.radius), real(s.height))
        z = dot(w, a)
        out = w - z[:, None] * a
        wide = norm(out)
        outward = out / np.where(wide == 0, 1, wide)[:, None]
        wall = (wide - s.radius) * (s.height / slant) + z * (s.radius / slant)
        normal = outward * (s.height / slant) + a * (s.radius / slant)
        return [Face(wall, normal, wide), Face(-z, np.broadcast_to(-a, p.shape))]


def flat_distance(o: np.ndarray, d: np.ndarray, n: np.ndarray, point: np.ndarray) -> np.ndarray:
    """t of the plane through `point`; NaN for rays along it."""
    slope = dot(d, n)
    return np.where(slope == 0, np.nan, dot(point - o, n) / np.where(slope == 0, 1, slope))


class RoundFlat:
    """A convex outline in a plane: `outline` tells how far a point of the plane is outside of it."""

    @classmethod
    def crossing(cls, s: Any, o: np.ndarray, d: np.ndarray, lift: Any) -> tuple[np.ndarray, np.ndarray]:
        """t of the plane lifted by `lift`, and the distance of the crossing from the outline, outside > 0."""
        n, point = cls.plane(s)
        t = flat_distance(o, d, n, point) + lift / dot(d, n)
        return t, cls.outline(s, o + np.nan_to_num(t)[:, None] * d)

    @classmethod
    def faces(cls, s: Any, p: np.ndarray) -> list[Face]:
        n, point = cls.plane(s)
        height = dot(p - point, n)
        return [Face(height, np.broadcast_to(n, p.shape))]


class RoundPlane(RoundFlat):
    @staticmethod
    def plane(s: Plane) -> tuple[np.ndarray, np.ndarray]:
        return unit(s.normal), real(s.point)

    @staticmethod
    def outline(s: Plane, p: np.ndarray) -> np.ndarray:
        return np.full(len(p), -np.inf, Real)


class RoundDisk(RoundFlat):
    @staticmethod
    def plane(s: Disk) -> tuple[np.ndarray, np.ndarray]:
        return unit(s.normal), real(s.center)

    @staticmethod
    def outline(s: Disk, p: np.ndarray) -> np.ndarray:
        return norm(np.cross(p - real(s.center), unit(s.normal))) - s.radius


def outside_polygon(corners: np.ndarray, n: np.ndarray, p: np.ndarray) -> np.ndarray:
    """The greatest distance beyond an edge of a polygon that runs counter-clockwise about n."""
    found = []
    for a, b in zip(corners, np.roll(corners, -1, 0)):
        found.append(dot(p - a, unit(np.cross(b - a, n))))
    return np.max(found, 0)


class RoundRectangle(RoundFlat):
    @staticmethod
    def plane(s: Rectangle) -> tuple[np.ndarray, np.ndarray]:
        return unit(np.cross(real(s.width), real(s.height))), real(s.center)

    @classmethod
    def outline(cls, s: Rectangle, p: np.ndarray) -> np.ndarray:
        w, h, c = real(s.width) / 2, real(s.height) / 2, real(s.center)
        return outside_polygon(np.array([c - w - h, c + w - h, c + w + h, c - w + h]), cls.plane(s)[0], p)

    @staticmethod
    def uv(s: Rectangle, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By the components of p along the two sides, from their scalar products."""
        w, h, q = real(s.width), real(s.height), p - real(s.center)
        ww, wh, hh, pw, ph = dot(w, w), dot(w, h), dot(h, h), dot(q, w), dot(q, h)
        whole = ww * hh - wh * wh
        return 0.5 + (pw * hh - ph * wh) / whole, 0.5 + (ph * ww - pw * wh) / whole


class RoundTriangle(RoundFlat):
    @staticmethod
    def plane(s: Triangle) -> tuple[np.ndarray, np.ndarray]:
        a, b, c = real(s.a), real(s.b), real(s.c)
        return unit(np.cross(b - a, c - a)), a

    @classmethod
    def outline(cls, s: Triangle, p: np.ndarray) -> np.ndarray:
        return outside_polygon(real([s.a, s.b, s.c]), cls.plane(s)[0], p)

    @classmethod
    def uv(cls, s: Triangle, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By the areas opposite to b and c."""
        a, b, c = real(s.a), real(s.b), real(s.c)
        n = np.cross(b - a, c - a)
        return dot(np.cross(a - c, p - c), n) / dot(n, n), dot(np.cross(b - a, p - a), n) / dot(n, n)


@dataclass(frozen=True)
class Sample:
    """A kind of primitive, for all tests that run over primitives.KINDS.

    random: an instance of about the given size.
    twin: the same shape in NumPy.
    hull: the middle and the reach of an instance, for aiming at it.
    exact: its surface as polynomials over the rational numbers (exact_surfaces.py).
    plain: instances whose numbers are round, about the origin and at most 2 wide, for degenerate rays.
    posed: an instance near the origin, of size 1, in no special position.
    uv: instances, points of theirs and the texture coordinates there, by hand.
    loose: the radius of the sphere that is known to hold an instance, over its reach.
    """

    kind: type
    random: Callable[[np.random.Generator, float], Any]
    twin: Any
    hull: Callable[[Any], tuple[np.ndarray, float]]
    exact: Callable[[Any], list[Piece]]
    plain: tuple
    posed: Any
    uv: tuple[tuple[Any, tuple, tuple], ...]
    loose: float = 1.0


def direction(rng: np.random.Generator) -> tuple[float, float, float]:
    return tuple(rng.normal(size=3).tolist())


def place(rng: np.random.Generator, scale: float) -> tuple[float, float, float]:
    """A point up to a thousand sizes away from the origin of the world."""
    return tuple((scale * 10 ** rng.uniform(-1, 3) * np.array(direction(rng))).tolist())


def length(rng: np.random.Generator, scale: float) -> float:
    """Sizes of one object differ by up to a hundred times."""
    return float(scale * 10 ** rng.uniform(-1, 1))


def _sphere(rng: np.random.Generator, scale: float) -> Sphere:
    return Sphere(center=place(rng, scale), radius=length(rng, scale))


def _plane(rng: np.random.Generator, scale: float) -> Plane:
    return Plane(point=place(rng, scale), normal=direction(rng))


def _disk(rng: np.random.Generator, scale: float) -> Disk:
    return Disk(center=place(rng, scale), normal=direction(rng), radius=length(rng, scale))


def _rectangle(rng: np.random.Generator, scale: float) -> Rectangle:
    """A parallelogram; its angle is at least 6 degrees, as random vectors nearly never are parallel."""
    while True:
        w, h = (unit(direction(rng)) * length(rng, scale) for _ in range(2))
        if norm(np.cross(unit(w), unit(h))) > 0.1:
            return Rectangle(center=place(rng, scale), width=tuple(map(float, w)), height=tuple(map(float, h)))


def _triangle(rng: np.random.Generator, scale: float) -> Triangle:
    middle = np.array(place(rng, scale))
    while True:
        corners = middle + scale * rng.normal(size=(3, 3))
        x, y = unit(corners[1] - corners[0]), unit(corners[2] - corners[0])
        if norm(np.cross(x, y)) > 0.1:
            return Triangle(**{k: tuple(v.tolist()) for k, v in zip("abc", corners)})


def mesh_of(t: Triangle) -> Mesh:
    """A mesh of one triangle; meshes of many have tests of their own (test_mesh.py)."""
    return Mesh(vertices=np.array([t.a, t.b, t.c]), faces=np.array([[0, 1, 2]]), normals="face", transform=t.transform)


def triangle_of(mesh: Mesh) -> Triangle:
    """The triangle of a mesh of one triangle."""
    a, b, c = (tuple(map(float, v)) for v in mesh.vertices.values)
    return Triangle(a=a, b=b, c=c, transform=mesh.transform)


def csg_of(s: Sphere) -> Csg:
    """A ball as the intersection of two balls about one centre."""
    outer = Sphere(center=s.center, radius=4 * s.radius)
    return Csg(op="intersection", of=(replace(s, transform=()), outer), transform=s.transform)


def ball_of(csg: Csg) -> Sphere:
    """The smaller ball of `csg_of`."""
    return replace(csg.of[0], transform=csg.transform)


class RoundCsg:
    """That of the ball."""

    @staticmethod
    def interval(s: Csg, o: np.ndarray, d: np.ndarray, g: Any) -> tuple[np.ndarray, np.ndarray]:
        return RoundSphere.interval(ball_of(s), o, d, g)

    @staticmethod
    def faces(s: Csg, p: np.ndarray) -> list[Face]:
        return RoundSphere.faces(ball_of(s), p)

    @staticmethod
    def uv(s: Csg, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return RoundSphere.uv(ball_of(s), p)


class RoundMesh(RoundFlat):
    """That of the triangle."""

    @staticmethod
    def plane(s: Mesh) -> tuple[np.ndarray, np.ndarray]:
        return RoundTriangle.plane(triangle_of(s))

    @staticmethod
    def outline(s: Mesh, p: np.ndarray) -> np.ndarray:
        return RoundTriangle.outline(triangle_of(s), p)

    @staticmethod
    def uv(s: Mesh, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return RoundTriangle.uv(triangle_of(s), p)


def _box(rng: np.random.Generator, scale: float) -> Box:
    low = np.array(place(rng, scale))
    return Box(min=tuple(low.tolist()), max=tuple((low + [length(rng, scale) for _ in range(3)]).tolist()))


def _cylinder(rng: np.random.Generator, scale: float) -> Cylinder:
    sizes = {"radius": length(rng, scale), "height": length(rng, scale)}
    return Cylinder(center=place(rng, scale), axis=direction(rng), **sizes)


def _cone(rng: np.random.Generator, scale: float) -> Cone:
    return Cone(base=place(rng, scale), axis=direction(rng), radius=length(rng, scale), height=length(rng, scale))


def _ellipsoid(rng: np.random.Generator, scale: float) -> Ellipsoid:
    return Ellipsoid(center=place(rng, scale), radii=tuple(length(rng, scale) for _ in range(3)))


def _capsule(rng: np.random.Generator, scale: float) -> Capsule:
    a = np.array(place(rng, scale))
    b = a + length(rng, scale) * unit(direction(rng)).astype(float)
    return Capsule(a=tuple(a.tolist()), b=tuple(b.tolist()), radius=length(rng, scale))


def _torus(rng: np.random.Generator, scale: float) -> Torus:
    """From rings as thin as a twentieth to those without a hole but for a hundredth."""
    major = length(rng, scale)
    minor = float(major * rng.uniform(0.05, 0.99))
    return Torus(center=place(rng, scale), axis=direction(rng), major=major, minor=minor)


def _polynomial(rng: np.random.Generator, scale: float) -> Polynomial:
    return polynomial_sphere(place(rng, scale), length(rng, scale))


def _box_hull(s: Box) -> tuple[np.ndarray, float]:
    low, high = np.array(s.min), np.array(s.max)
    return (low + high) / 2, float(np.linalg.norm(high - low) / 2)


def _corners_hull(s: Triangle) -> tuple[np.ndarray, float]:
    corners = np.array([s.a, s.b, s.c])
    middle = corners.mean(0)
    return middle, float(np.linalg.norm(corners - middle, axis=1).max())


def _box_middle_hull(corners: np.ndarray) -> tuple[np.ndarray, float]:
    middle = (corners.min(0) + corners.max(0)) / 2
    return middle, float(np.linalg.norm(corners - middle, axis=1).max())


def _cylinder_hull(s: Cylinder) -> tuple[np.ndarray, float]:
    return np.array(s.center), float(np.hypot(s.radius, s.height / 2))


def _cone_hull(s: Cone) -> tuple[np.ndarray, float]:
    half = 0.5 * s.height
    return np.array(s.base) + half * unit(s.axis).astype(float), float(np.hypot(s.radius, half))


def _capsule_hull(s: Capsule) -> tuple[np.ndarray, float]:
    a, b = np.array(s.a), np.array(s.b)
    return (a + b) / 2, float(np.linalg.norm(b - a) / 2 + s.radius)


def _rectangle_hull(s: Rectangle) -> tuple[np.ndarray, float]:
    w, h = np.array(s.width), np.array(s.height)
    return np.array(s.center), float(max(np.linalg.norm(w + h), np.linalg.norm(w - h)) / 2)


SAMPLES = {
    s.kind.__name__: s
    for s in (
        Sample(
            Sphere,
            _sphere,
            RoundSphere,
            lambda s: (np.array(s.center), s.radius),
            exact.sphere,
            (Sphere(radius=0.5),),
            Sphere(center=(0.1, 0.2, 0), radius=0.8),
            # Globe: +x is the middle of the map, east is to the left of it seen from +x with y up, i.e. towards -z.
            (
                (Sphere(radius=2), (2, 0, 0), (0.5, 0.5)),
                (Sphere(radius=2), (0, 0, -2), (0.75, 0.5)),
                (Sphere(radius=2), (0, 0, 2), (0.25, 0.5)),
                (Sphere(radius=2), (0, 2, 0), (0.5, 1)),
                (Sphere(radius=2), (0, -2, 0), (0.5, 0)),
            ),
        ),
        Sample(
            Plane,
            _plane,
            RoundPlane,
            # A plane has no size: rays are aimed at the part around its point.
            lambda s: (np.array(s.point), float(np.linalg.norm(s.point))),
            exact.plane,
            (Plane(),),
            Plane(point=(0, -0.5, 0), normal=(0.1, 1, 0.2)),
            # A floor: u east, v north (-z). A wall that looks at +z: u right, v up.
            (
                (Plane(point=(1, 0, 1)), (3, 0, 1), (2, 0)),
                (Plane(point=(1, 0, 1)), (1, 0, -2), (0, 3)),
                (Plane(normal=(0, 0, 5)), (2, 3, 0), (2, 3)),
            ),
        ),
        Sample(
            Disk,
            _disk,
            RoundDisk,
            lambda s: (np.array(s.center), s.radius),
            exact.disk,
            (Disk(radius=0.5),),
            Disk(normal=(0.3, 0.4, 1), radius=0.9),
            (
                (Disk(radius=2, normal=(0, 0, 1)), (2, 0, 0), (1, 0.5)),
                (Disk(radius=2, normal=(0, 0, 1)), (0, 2, 0), (0.5, 1)),
            ),
        ),
        Sample(
            Rectangle,
            _rectangle,
            RoundRectangle,
            _rectangle_hull,
            exact.rectangle,
            (Rectangle(),),
            Rectangle(width=(1.5, 0.1, 0), height=(0.2, 1, 0.4)),
            (
                (Rectangle(width=(4, 0, 0), height=(0, 2, 0)), (-2, -1, 0), (0, 0)),
                (Rectangle(width=(4, 0, 0), height=(0, 2, 0)), (2, 1, 0), (1, 1)),
                (Rectangle(width=(4, 0, 0), height=(0, 2, 0)), (-2, 1, 0), (0, 1)),
            ),
        ),
        Sample(
            Triangle,
            _triangle,
            RoundTriangle,
            _corners_hull,
            exact.triangle,
            (Triangle(a=(-0.5, -0.5, 0), b=(0.5, -0.5, 0), c=(-0.5, 0.5, 0)),),
            Triangle(a=(-0.8, -0.5, 0), b=(0.9, -0.4, 0.2), c=(0.1, 0.9, -0.3)),
            (
                (Triangle(a=(1, 0, 0), b=(3, 0, 0), c=(1, 2, 0)), (1, 0, 0), (0, 0)),
                (Triangle(a=(1, 0, 0), b=(3, 0, 0), c=(1, 2, 0)), (3, 0, 0), (1, 0)),
                (Triangle(a=(1, 0, 0), b=(3, 0, 0), c=(1, 2, 0)), (1, 2, 0), (0, 1)),
            ),
        ),
        Sample(
            Mesh,
            lambda rng, scale: mesh_of(_triangle(rng, scale)),
            RoundMesh,
            lambda s: _box_middle_hull(s.vertices.values),
            lambda s: exact.triangle(triangle_of(s)),
            (mesh_of(Triangle(a=(-0.5, -0.5, 0), b=(0.5, -0.5, 0), c=(-0.5, 0.5, 0))),),
            mesh_of(Triangle(a=(-0.8, -0.5, 0), b=(0.9, -0.4, 0.2), c=(0.1, 0.9, -0.3))),
            (
                (mesh_of(Triangle(a=(1, 0, 0), b=(3, 0, 0), c=(1, 2, 0))), (1, 0, 0), (0, 0)),
                (mesh_of(Triangle(a=(1, 0, 0), b=(3, 0, 0), c=(1, 2, 0))), (3, 0, 0), (1, 0)),
                (mesh_of(Triangle(a=(1, 0, 0), b=(3, 0, 0), c=(1, 2, 0))), (1, 2, 0), (0, 1)),
            ),
        ),
        Sample(
            Box,
            _box,
            RoundBox,
            _box_hull,
            exact.box,
            (Box(),),
            Box(min=(-0.7, -0.5, -0.4), max=(0.5, 0.6, 0.7)),
            # Face by face: the point a quarter in from the lower left corner, seen from outside.
            (
                (Box(), (-0.25, -0.25, 0.5), (0.25, 0.25)),
                (Box(), (0.25, -0.25, -0.5), (0.25, 0.25)),
                (Box(), (0.5, -0.25, 0.25), (0.25, 0.25)),
                (Box(), (-0.5, -0.25, -0.25), (0.25, 0.25)),
                (Box(), (-0.25, 0.5, 0.25), (0.25, 0.25)),
                (Box(), (-0.25, -0.5, -0.25), (0.25, 0.25)),
            ),
        ),
        Sample(
            Cylinder,
            _cylinder,
            RoundCylinder,
            _cylinder_hull,
            exact.cylinder,
            (Cylinder(),),
            Cylinder(axis=(0.3, 1, 0.2), radius=0.5, height=1.2),
            # About y: the frame's first axis is +x, and east is towards -z, as on the globe. Caps like floors and
            # ceilings.
            (
                (Cylinder(radius=1, height=2), (1, -1 + 0.5, 0), (0.5, 0.25)),
                (Cylinder(radius=1, height=2), (0, 0, -1), (0.75, 0.5)),
                (Cylinder(radius=1, height=2), (0.5, 1, 0), (0.75, 0.5)),
                (Cylinder(radius=1, height=2), (0, 1, -0.5), (0.5, 0.75)),
                (Cylinder(radius=1, height=2), (0, -1, 0.5), (0.5, 0.75)),
            ),
        ),
        Sample(
            Cone,
            _cone,
            RoundCone,
            _cone_hull,
            exact.cone,
            # Along the wall of the second one run diagonal rays, or parallel to it.
            (Cone(base=(0, -0.5, 0)), Cone(base=(0, -0.25, 0), height=0.5)),
            Cone(base=(0, -0.5, 0), axis=(0.2, 1, 0.3), radius=0.7, height=1.3),
            (
                (Cone(radius=1, height=2), (0.5, 1, 0), (0.5, 0.5)),
                (Cone(radius=1, height=2), (0, 1, -0.5), (0.75, 0.5)),
                (Cone(radius=1, height=2), (0, 0, 0.5), (0.5, 0.75)),
            ),
        ),
        Sample(
            Ellipsoid,
            _ellipsoid,
            RoundEllipsoid,
            lambda s: (np.array(s.center), max(s.radii)),
            exact.ellipsoid,
            (Ellipsoid(radii=(0.5, 0.25, 0.5)), Ellipsoid(radii=(0.5, 0.25, 1))),
            Ellipsoid(center=(0.1, 0.1, 0), radii=(0.9, 0.5, 0.7)),
            # As on the ball that it is stretched from.
            (
                (Ellipsoid(radii=(2, 1, 3)), (2, 0, 0), (0.5, 0.5)),
                (Ellipsoid(radii=(2, 1, 3)), (0, 0, -3), (0.75, 0.5)),
                (Ellipsoid(radii=(2, 1, 3)), (0, -1, 0), (0.5, 0)),
            ),
        ),
        Sample(
            Capsule,
            _capsule,
            RoundCapsule,
            _capsule_hull,
            exact.capsule,
            (Capsule(a=(0, -0.25, 0), b=(0, 0.25, 0), radius=0.25), Capsule()),
            Capsule(a=(-0.4, -0.3, 0.1), b=(0.3, 0.4, -0.2), radius=0.4),
            # v is the arc from pole to pole: here pi/2, pi and pi/2 of 2 pi long.
            (
                (Capsule(a=(0, 0, 0), b=(0, float(PI), 0), radius=1), (1, 0, 0), (0.5, 0.25)),
                (Capsule(a=(0, 0, 0), b=(0, float(PI), 0), radius=1), (0, float(PI), -1), (0.75, 0.75)),
                (Capsule(a=(0, 0, 0), b=(0, float(PI), 0), radius=1), (0, -1, 0), (0.5, 0)),
            ),
        ),
        Sample(
            Csg,
            lambda rng, scale: csg_of(_sphere(rng, scale)),
            RoundCsg,
            lambda s: (np.array(s.of[0].center), s.of[0].radius),
            lambda s: exact.sphere(ball_of(s)),
            (csg_of(Sphere(radius=0.5)),),
            csg_of(Sphere(center=(0.1, 0.2, 0), radius=0.8)),
            (
                (csg_of(Sphere(radius=2)), (2, 0, 0), (0.5, 0.5)),
                (csg_of(Sphere(radius=2)), (0, 0, -2), (0.75, 0.5)),
            ),
        ),
        Sample(
            Torus,
            _torus,
            RoundTorus,
            lambda s: (np.array(s.center), s.major + s.minor),
            exact.torus,
            (Torus(major=0.5, minor=0.25),),
            Torus(axis=(0.2, 1, 0.3), major=0.6, minor=0.25),
            # u around the axis, as on the globe; v around the tube, from the inside over the lower side.
            (
                (Torus(major=2, minor=1), (3, 0, 0), (0.5, 0.5)),
                (Torus(major=2, minor=1), (0, 0, -3), (0.75, 0.5)),
                (Torus(major=2, minor=1), (2, 1, 0), (0.5, 0.75)),
                (Torus(major=2, minor=1), (2, -1, 0), (0.5, 0.25)),
            ),
        ),
        Sample(
            Polynomial,
            _polynomial,
            RoundPolynomial,
            lambda s: (np.array(s.clip.center), s.parameters["r"]),
            lambda s: exact.sphere(round_of(s)),
            (polynomial_sphere((0.0, 0.0, 0.0), 0.5),),
            polynomial_sphere((0.1, 0.2, 0.0), 0.8),
            (
                (polynomial_sphere((1.0, 0.0, 0.0), 2.0), (1, 0, -2), (0.75, 0.5)),
                (polynomial_sphere((1.0, 0.0, 0.0), 2.0), (1, -2, 0), (0.5, 0)),
            ),
            loose=CLIP,
        ),
    )
}
NAMES = [k.__name__ for k in KINDS]
assert set(NAMES) <= set(SAMPLES), f"no entry in SAMPLES of tests/samples.py: {set(NAMES) - set(SAMPLES)}"
# No ray that leaves one of these outwards meets it again. The polynomial of the sample is a ball.
CONVEX = [k.__name__ for k in KINDS if not issubclass(k, PolynomialSolid)]


def stretched(rng: np.random.Generator, thing: Any) -> Any:
    """The object turned, scaled by 10^U(-1, 1) and by up to 2 more on each axis, turned and moved."""
    middle, reach = SAMPLES[type(thing).__name__].hull(thing)
    factor = 10 ** rng.uniform(-1, 1)
    scale = tuple((factor * 2 ** rng.uniform(-1, 1, 3)).tolist())
    turns = [Rotate(rotate=float(rng.uniform(0, 360)), axis=direction(rng)) for _ in range(2)]
    away = factor * (np.linalg.norm(middle) + reach) * np.array(direction(rng))
    return replace(thing, transform=(turns[0], Scale(scale=scale), turns[1], Translate(translate=tuple(away.tolist()))))


def instances(name: str, seed: int, count: int, moved: bool, decades: float = 4) -> list:
    """`count` instances of a kind whose sizes span 10^-decades to 10^decades, of those that a scene may have."""
    rng, things = np.random.default_rng(seed), []
    while len(things) < count:
        with suppress(UserError):  # farther away than scenes reach
            things.append(SAMPLES[name].random(rng, 10 ** rng.uniform(-decades, decades)))
    return [stretched(rng, x) for x in things] if moved else things


def shifted(thing: Any, by: np.ndarray) -> Any:
    """The object with all points that it is made of moved."""
    if isinstance(thing, Polynomial):
        ball = round_of(thing)
        centre = tuple((np.array(ball.center) + by).tolist())
        return polynomial_sphere(centre, ball.radius, material=thing.material, transform=thing.transform)
    if isinstance(thing, Mesh):
        return replace(thing, vertices=thing.vertices.values + by)
    if isinstance(thing, Csg):
        return replace(thing, of=tuple(shifted(x, by) for x in thing.of))
    points = [k for k in ("center", "point", "a", "b", "c", "min", "max", "base") if hasattr(thing, k)]
    return replace(thing, **{k: tuple((np.array(getattr(thing, k)) + by).tolist()) for k in points})


def outer(thing: Any) -> tuple[np.ndarray, np.ndarray]:
    """Linear part and offset of an object's transform."""
    whole = compose(thing.transform)
    return (np.eye(3), np.zeros(3)) if whole is None else (whole[:, :3], whole[:, 3])


def inverse(m: np.ndarray) -> np.ndarray:
    """The inverse of a 3 x 3 matrix in 80 bits: NumPy's, and two steps of Newton's iteration."""
    x, m = real(np.linalg.inv(np.asarray(m, float))), real(m)
    for _ in range(2):
        x = x + x @ (np.eye(3) - m @ x)
    return x


def geometry_of(scene: Scene, precision: str = "single") -> Geometry:
    """What rays can meet in a scene."""
    settings = replace(scene.settings, precision=precision)
    return prepare(replace(scene, film=Film(width=1, height=1), settings=settings)).kernel.geometry


class Lineup:
    """Many objects of one kind in one batch, each with its own rays: lane i belongs to object i // per."""

    def __init__(self, things: list, per: int, precision: str = "double"):
        self.things, self.per = things, per
        scene = Scene(
            film=Film(width=1, height=1),
            objects={f"o{i}": x for i, x in enumerate(things)},
            settings=Settings(precision=precision),
            camera=Camera(),
            lights={},
        )
        self.prepared = prepare(scene)
        self.a, self.kernel = self.prepared.a, self.prepared.kernel
        (self.batch,) = self.kernel.batches
        self.kind = self.batch.kind
        self.index = self.a.put(self.a.U, np.repeat(np.arange(len(things), dtype=np.uint32), per))

    def ray(self, o: np.ndarray, d: np.ndarray, **more: Any) -> Ray:
        """Rays of shape (N, per, 3) or (N per, 3)."""
        o, d = (self.a.put(self.a.W, v.reshape(-1, 3).T) for v in (o, d))
        return Ray(o, d, **more)

    def placed(self) -> Any:
        """Each lane's object."""
        return rows(self.batch.placed, self.index)

    def seen(self, o: Any) -> Any:
        return self.kind.seen(self.placed(), o)

    def crossing(self, ray: Ray, leaving: Any = None) -> Crossing:
        """The first crossing; `leaving`: the ray begins on the object's surface, on the side that it says."""
        known = NOTHING_KNOWN if leaving is None else KnownEnds(leaving, ray.inside, ray.part)
        return self.kind.crossing(self.seen(ray.o), ray, 0, None, known)

    def first(self, ray: Ray, leaving: Any = None) -> Any:
        """The distance of the first crossing."""
        return self.crossing(ray, leaving).t

    def piece(self, ray: Ray, length: Any, **known: Any) -> RaySegment:
        """Each ray up to a distance, with what is known of its ends (KnownEnds)."""
        known = {"end_error": self.a.D(0)} | known
        return RaySegment(self.kind, self.placed(), self.seen(ray.o), ray, 0, length, KnownEnds(**known))

    def occludes(self, ray: Ray, length: Any, **known: Any) -> Any:
        """Whether the object is in the way up to a distance."""
        return occludes(self.piece(ray, length, **known))

    def length_inside(self, ray: Ray, length: Any, **known: Any) -> tuple[Any, Any]:
        """Whether each ray goes through the object up to a distance, and how long it is inside."""
        return length_inside(self.piece(ray, length, **known))

    def surface(self, ray: Ray, t: Any, part: Any = None) -> tuple:
        """Surface, u and v where the rays have run t; lanes that miss are to be ignored."""
        part = self.crossing(ray).part if part is None else part
        s, _, u, v = surface_of(self.kernel, ray, Hit(t, self.index, part))
        return s, u, v


def array(v: Any) -> np.ndarray:
    """A Dr.Jit triple as (N, 3), a number as (N)."""
    v = np.array(v)
    return v.T if v.ndim == 2 else v


def aimed(rng: np.random.Generator, thing: Any, count: int, beyond: float = 1.2) -> tuple[np.ndarray, np.ndarray]:
    """Rays in the world at points of the object's ball, from 0.1 to 1000 reaches away, a few of them from inside."""
    middle, reach = SAMPLES[type(thing).__name__].hull(thing)
    m, t = outer(thing)
    within = rng.normal(size=(count, 3))
    within *= beyond * rng.uniform(size=(count, 1)) ** (1 / 3) / np.linalg.norm(within, axis=1, keepdims=True)
    target = (middle + reach * within) @ m.T + t
    away = rng.normal(size=(count, 3))
    away *= 10 ** rng.uniform(-1, 3, (count, 1)) / np.linalg.norm(away, axis=1, keepdims=True)
    o = (middle + reach * away) @ m.T + t
    d = target - o
    return o, d / np.linalg.norm(d, axis=1, keepdims=True)


@dataclass(frozen=True)
class Truth:
    """What a twin says of rays in the world: kind of first crossing (0 none, 1 entry, 2 exit), t, and its bounds.

    Where `sure` is False, the kind of crossing changes as the object grows or shrinks by the rounding bound.
    """

    what: np.ndarray
    t: np.ndarray
    low: np.ndarray
    high: np.ndarray
    sure: np.ndarray


def distortion(thing: Any) -> tuple[float, float]:
    """By how much the rounding of the kernel's inverse frame grows, and the least stretch of the transform.

    The rows of the inverse are cross products over a determinant: their relative error is gamma(8) times Hadamard's
    ratio |x||y||z| / |det| of the frame's columns, once for the products and once for the determinant.
    """
    # Of a polynomial only the clip has one, and of a mesh its triangle.
    framed = thing.clip if isinstance(thing, Polynomial) else triangle_of(thing) if isinstance(thing, Mesh) else thing
    framed = ball_of(framed) if isinstance(framed, Csg) else framed
    frame = scalars(framed).frame()
    columns = np.eye(3) if not hasattr(frame, "x") else np.array([frame.x, frame.y, frame.z], float).reshape(3, 3).T
    m, _ = outer(thing)
    whole = m @ columns
    hadamard = np.prod(np.linalg.norm(whole, axis=0)) / abs(np.linalg.det(whole))
    stretch = np.linalg.svd(m, compute_uv=False)
    return hadamard * (1 + hadamard) / 2 * stretch[0] / stretch[-1], stretch[-1]


# Roundings between a ray and its place on a canonical shape: inverse frame 8, origin 4, direction 3, recentring 6,
# root 5.
ROUNDINGS = 26


def rounding(thing: Any, o: np.ndarray, d: np.ndarray, t: Any) -> np.ndarray:
    """The bound, in the object's own units, within which a kernel's ray passes the object. `o`, `d` in these units."""
    middle, reach = SAMPLES[type(thing).__name__].hull(thing)
    k, least = distortion(thing)
    m, offset = outer(thing)
    # The frame's own origin: 6 roundings of what is added up to it.
    origin = 6 * (np.linalg.norm(m, 2) * np.linalg.norm(middle) + np.linalg.norm(offset)) / least
    far = norm(o - real(middle)) + reach
    return gamma(ROUNDINGS) * k * (far + np.maximum(far, np.nan_to_num(t, posinf=0) * norm(d))) + gamma(1) * origin


def truth(thing: Any, o: np.ndarray, d: np.ndarray) -> Truth:
    """The first crossing of world rays (M, 3) with an object, with what rounding may change."""
    m, offset = outer(thing)
    back = inverse(m)
    o, d = (real(o) - real(offset)) @ back.T, real(d) @ back.T
    twin = SAMPLES[type(thing).__name__].twin
    with np.errstate(all="ignore"):
        if hasattr(twin, "first"):
            g = rounding(thing, o, d, 0.0)
            return _combined(*(twin.first(thing, o, d, s * g) for s in (0, 1, -1)))
        if hasattr(twin, "interval"):
            g = rounding(thing, o, d, 0.0)
            return _combined(*(_first(*twin.interval(thing, o, d, s * g)) for s in (0, 1, -1)))
        t, outside = twin.crossing(thing, o, d, 0)
        g = rounding(thing, o, d, np.abs(t))
        lifted = [twin.crossing(thing, o, d, s * g) for s in (1, -1)]
        # In its plane a crossing is off by what it is off along the ray: more where the ray is flat.
        slip = g + sum(np.abs(l[0] - t) for l in lifted) * norm(d)
        met = [np.where((t > 0) & (outside <= s * slip) & (l[0] > 0), 1, 0) for s, l in zip((1, -1), lifted)]
        what = np.where((t > 0) & (outside <= 0), 1, 0)
        low, high = np.minimum(lifted[0][0], lifted[1][0]), np.maximum(lifted[0][0], lifted[1][0])
        sure = (met[0] == what) & (met[1] == what) & (np.sign(low) == np.sign(high))
        # A ray along the plane misses, but for one in it.
        n, point = twin.plane(thing)
        sure = np.where(np.isfinite(t), sure, np.abs(dot(o - point, n)) > rounding(thing, o, d, 0.0))
        return Truth(what, t, low, high, sure)


def crossed(thing: Any, o: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The kind of the first crossing as in Truth, by the twin alone. Domain: objects without a transform."""
    o, d, twin, exactly = real(o), real(d), SAMPLES[type(thing).__name__].twin, np.zeros(len(o), Real)
    with np.errstate(all="ignore"):
        if hasattr(twin, "first"):
            return twin.first(thing, o, d, exactly)[0]
        if hasattr(twin, "interval"):
            return _first(*twin.interval(thing, o, d, exactly))[0]
        t, outside = twin.crossing(thing, o, d, exactly)
        return np.where((t > 0) & (outside <= 0), 1, 0)


def _first(t0: np.ndarray, t1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    what = np.where(~(t0 <= t1) | (t1 <= 0), 0, np.where(t0 > 0, 1, 2))
    return what, np.where(what == 1, t0, t1)


def _combined(exact: tuple, grown: tuple, shrunk: tuple) -> Truth:
    sure = (exact[0] == grown[0]) & (exact[0] == shrunk[0])
    both = np.stack([grown[1], shrunk[1]])
    return Truth(exact[0], exact[1], both.min(0), both.max(0), sure)


def gap(thing: Any, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """At world points near the surface: distance from it, outward normal, curvature radius, distance to the next face.

    The first two in world units; the last two in the object's own.
    """
    m, offset = outer(thing)
    back = inverse(m)
    local = (real(p) - real(offset)) @ back.T
    faces = SAMPLES[type(thing).__name__].twin.faces(thing, local)
    distance = np.stack([f.distance for f in faces])
    order = np.argsort(-distance, 0)
    best, lane = order[0], np.arange(len(local))
    normal = np.stack([f.normal for f in faces])[best, lane] @ back
    stretch = norm(normal)
    bend = np.stack([np.broadcast_to(f.bend, len(local)) for f in faces])[best, lane]
    crease = distance[best, lane] - distance[order[1], lane] if len(faces) > 1 else np.full(len(local), np.inf)
    return distance[best, lane] / stretch, normal / stretch[:, None], bend, crease
