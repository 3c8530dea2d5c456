"""The surface of each kind as polynomials over the rational numbers: no digit of them is rounded.

A point is three numbers of any ring that holds the rational numbers: numbers, or polynomials in the distance along a
ray. Where a formula has the length |a| of an axis, its square stands instead, so that no root is taken.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import flint
import numpy as np

from visray.primitives import Box, Capsule, Cone, Cylinder, Disk, Ellipsoid, Plane, Rectangle, Sphere, Torus, Triangle

Point = Sequence[Any]


@dataclass(frozen=True)
class Piece:
    """A part of a surface: all points where `equation` is zero and no `condition` is greater than zero."""

    equation: Callable[[Point], Any]
    conditions: tuple[Callable[[Point], Any], ...] = ()


def rational(x: float) -> flint.fmpq:
    exact = Fraction(float(x))
    return flint.fmpq(exact.numerator, exact.denominator)


def vector(v: Sequence[float]) -> list:
    return [rational(x) for x in v]


def minus(a: Point, b: Point) -> list:
    return [x - y for x, y in zip(a, b)]


def inner(a: Point, b: Point) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Point, b: Point) -> list:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def squared(a: Point) -> Any:
    return inner(a, a)


def ball(center: Sequence[float], radius: float, *conditions: Callable) -> Piece:
    c, r2 = vector(center), rational(radius) ** 2
    return Piece(lambda p: squared(minus(p, c)) - r2, conditions)


def sphere(s: Sphere) -> list[Piece]:
    return [ball(s.center, s.radius)]


def ellipsoid(s: Ellipsoid) -> list[Piece]:
    c, r = vector(s.center), vector(s.radii)
    return [Piece(lambda p: squared([x / k if isinstance(x, flint.fmpq) else x * (1 / k)
                                     for x, k in zip(minus(p, c), r)]) - 1)]  # fmt: skip


def plane(s: Plane) -> list[Piece]:
    c, n = vector(s.point), vector(s.normal)
    return [Piece(lambda p: inner(minus(p, c), n))]


def disk(s: Disk) -> list[Piece]:
    c, n, r2 = vector(s.center), vector(s.normal), rational(s.radius) ** 2
    return [Piece(lambda p: inner(minus(p, c), n), (lambda p: squared(minus(p, c)) - r2,))]


def rectangle(s: Rectangle) -> list[Piece]:
    """Inside, the coordinate along each side is at most a half: a triple product over |n|^2."""
    c, w, h = vector(s.center), vector(s.width), vector(s.height)
    n = cross(w, h)
    within = (
        lambda p: 4 * inner(cross(minus(p, c), h), n) ** 2 - squared(n) ** 2,
        lambda p: 4 * inner(cross(w, minus(p, c)), n) ** 2 - squared(n) ** 2,
    )
    return [Piece(lambda p: inner(minus(p, c), n), within)]


def triangle(s: Triangle) -> list[Piece]:
    corners = [vector(v) for v in (s.a, s.b, s.c)]
    n = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]))
    edges = zip(corners, corners[1:] + corners[:1])
    within = tuple(lambda p, a=a, b=b: -inner(cross(minus(b, a), minus(p, a)), n) for a, b in edges)
    return [Piece(lambda p: inner(minus(p, corners[0]), n), within)]


def box(s: Box) -> list[Piece]:
    low, high = vector(s.min), vector(s.max)
    within = [lambda p, i=i: (p[i] - low[i]) * (p[i] - high[i]) for i in range(3)]
    return [
        Piece(lambda p, i=i, side=side: p[i] - side[i], tuple(within[j] for j in range(3) if j != i))
        for i in range(3)
        for side in (low, high)
    ]


def cylinder(s: Cylinder) -> list[Piece]:
    c, a, r2, h2 = vector(s.center), vector(s.axis), rational(s.radius) ** 2, rational(s.height) ** 2
    aside = lambda p: squared(cross(minus(p, c), a)) - r2 * squared(a)  # noqa: E731
    beyond = lambda p: 4 * inner(minus(p, c), a) ** 2 - h2 * squared(a)  # noqa: E731
    return [Piece(aside, (beyond,)), Piece(beyond, (aside,))]


def cone(s: Cone) -> list[Piece]:
    """The wall: |w x a| / |a| = r (1 - z / (h |a|)), z = w . a, squared twice. That adds the cone that is mirrored in
    the base, and what lies beyond both apices: all of it is wider than the base or higher than the apex."""
    c, a, r2, h2 = vector(s.base), vector(s.axis), rational(s.radius) ** 2, rational(s.height) ** 2
    aa = squared(a)
    height = lambda p: inner(minus(p, c), a)  # noqa: E731
    wide = lambda p: squared(cross(minus(p, c), a))  # noqa: E731

    def wall(p: Point) -> Any:
        return (h2 * wide(p) - r2 * (h2 * aa + height(p) ** 2)) ** 2 - 4 * r2**2 * h2 * aa * height(p) ** 2

    within = (lambda p: -height(p), lambda p: height(p) ** 2 - h2 * aa, lambda p: wide(p) - r2 * aa)
    return [Piece(wall, within), Piece(height, (within[2],))]


def capsule(s: Capsule) -> list[Piece]:
    a, b, r2 = vector(s.a), vector(s.b), rational(s.radius) ** 2
    v = minus(b, a)
    before, after = lambda p: -inner(minus(p, a), v), lambda p: inner(minus(p, b), v)
    wall = Piece(lambda p: squared(cross(minus(p, a), v)) - r2 * squared(v), (before, after))
    return [wall, ball(s.a, s.radius, lambda p: -before(p)), ball(s.b, s.radius, lambda p: -after(p))]


def torus(s: Torus) -> list[Piece]:
    c, a, R2, r2 = vector(s.center), vector(s.axis), rational(s.major) ** 2, rational(s.minor) ** 2

    def f(p: Point) -> Any:
        w = minus(p, c)
        return squared(a) * (squared(w) + R2 - r2) ** 2 - 4 * R2 * squared(cross(w, a))

    return [Piece(f)]


@dataclass(frozen=True)
class ExactHit:
    """The first crossing of a ray: its distance to 300 bits, None if there is none.

    sure: no crossing is so close to an edge of its piece that 300 bits do not tell the side.
    """

    t: Any
    sure: bool


def exact_first(pieces: list[Piece], o: np.ndarray, d: np.ndarray) -> ExactHit:
    """Of a ray whose direction need not be a unit vector. All real roots are isolated, and told from complex ones."""
    flint.ctx.prec = 300
    p = [flint.fmpq_poly([x, y]) for x, y in zip(vector(o), vector(d))]
    crossings, sure = [], True
    for piece in pieces:
        f = as_polynomial(piece.equation(p))
        if f.degree() < 1:
            sure &= f != 0
            continue
        conditions = [as_polynomial(g(p)) for g in piece.conditions]
        for root, _ in f.numer().complex_roots():
            if root.imag != 0 or not root.real > 0:
                continue
            outside = [value(g, root.real) for g in conditions]
            sure &= all(x > 0 or x < 0 for x in outside) or any(x > 0 for x in outside)
            if not any(x > 0 for x in outside):
                crossings.append(root.real)
    return ExactHit(min(crossings, key=float) if crossings else None, bool(sure))


def as_polynomial(x: Any) -> flint.fmpq_poly:
    return x if isinstance(x, flint.fmpq_poly) else flint.fmpq_poly([x])


def value(f: flint.fmpq_poly, t: flint.arb) -> flint.arb:
    """By Horner's rule in balls of 300 bits."""
    total = flint.arb(0)
    for c in reversed(f.coeffs()):
        total = total * t + flint.arb(c)
    return total
