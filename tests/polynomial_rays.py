"""Rays against polynomial surfaces: what kernels say of them, and their polynomials in exact arithmetic."""

import re
from collections.abc import Callable
from fractions import Fraction
from math import comb, isqrt
from typing import Any

import drjit as dr
import flint
import numpy as np
from samples import array

from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.interaction import surface_of
from visray.primitives.clips import Ball
from visray.primitives.polynomial import Polynomial
from visray.ray import NO_ROW, Ray
from visray.scene.scene import Scene, Settings
from visray.setup import prepare

U = 2.0**-53
PHI = Fraction(10**80 + isqrt(5 * 10**160), 2 * 10**80)


def surface(expression: str, radius: float = 2.0, centre: tuple = (0.0, 0.0, 0.0), **more: Any) -> Polynomial:
    return Polynomial(expression=expression, clip=Ball(center=centre, radius=radius), **more)


def unit(v: Any) -> np.ndarray:
    v = np.asarray(v, float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def rays_at(rng: np.random.Generator, n: int, reach: float, far: float = 30.0) -> tuple[np.ndarray, np.ndarray]:
    """Rays at points of a ball, from 0.1 to `far` of its radii away."""
    target = reach * unit(rng.normal(size=(n, 3))) * rng.random((n, 1)) ** (1 / 3)
    o = reach * 10 ** rng.uniform(-1, np.log10(far), (n, 1)) * unit(rng.normal(size=(n, 3)))
    return o, unit(target - o)


class Rig:
    """Objects ready for rays, all in double."""

    def __init__(self, *things: Any):
        named = {f"o{i}": x for i, x in enumerate(things)}
        self.prepared = prepare(Scene(objects=named, settings=Settings(precision="double"), camera=Camera(), lights={}))
        self.a, self.kernel = self.prepared.a, self.prepared.kernel

    def ray(self, o: np.ndarray, d: np.ndarray, source: Any = None, inside: Any = None) -> Ray:
        a, n = self.a, len(d)
        o, d = (a.put(a.W, np.broadcast_to(v, (n, 3)).T) for v in (o, d))
        if source is not None:
            source = a.put(a.U, np.broadcast_to(np.asarray(source, np.uint32), n))
            inside = a.put(a.B, np.broadcast_to(np.asarray(inside, bool), n))
        return Ray(o, d, source, inside)

    def origin(self, ray: Ray) -> RayOrigin:
        return RayOrigin(self.kernel.geometry, ray.o, shared=False)

    def first(self, o: Any, d: Any, source: Any = None, inside: Any = None, brute_force: bool = False) -> tuple:
        """t and index of what is hit first."""
        ray = self.ray(o, d, source, inside)
        hit = closest(self.origin(ray), ray, brute_force)
        dr.eval(hit)
        return np.array(hit.t), np.array(hit.row)

    def surfaces(self, o: Any, d: Any, source: Any = None, inside: Any = None) -> tuple:
        """t, point, normal, u and v of what is hit first."""
        ray = self.ray(o, d, source, inside)
        hit = closest(self.origin(ray), ray)
        s, _, u, v = surface_of(self.kernel, ray, hit)
        dr.eval(hit, s, u, v)
        return np.array(hit.t), array(s.p), array(s.n), np.array(u), np.array(v)

    def occluded(self, o: Any, d: Any, length: Any, end: Any = None, inward: Any = None, **leaves: Any) -> np.ndarray:
        a, ray = self.a, self.ray(o, d, **leaves)
        if end is not None:
            end, inward = a.put(a.U, np.full(len(d), end, np.uint32)), a.put(a.B, inward)
        active, target = dr.full(a.B, True, len(d)), Target(a.D(length), a.D(0), end, inward)
        hidden = [np.array(occluded(self.origin(ray), ray, target, active, slow)) for slow in (False, True)]
        assert np.array_equal(*hidden)
        return hidden[0]

    def walked(self, o: np.ndarray, d: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
        """All crossings, inf where there are no more, and the normals there: each looked for from the one before, on
        the side to which the ray went through it. Shapes: (most, N), (most, N, 3)."""
        start, total, source, inside = o, np.zeros(len(d)), np.full(len(d), NO_ROW), np.zeros(len(d), bool)
        times, normals = [], []
        for _ in range(most):
            t, p, n, _, _ = self.surfaces(start, d, source, inside)
            met = np.isfinite(t)
            total = np.where(met & np.isfinite(total), total + np.where(met, t, 0), np.inf)
            times.append(total)
            normals.append(n)
            start = np.where(np.isfinite(total)[:, None], p, 1e3 + 0 * p)
            source, inside = np.where(met, 0, NO_ROW), (n * d).sum(1) < 0
        return np.array(times), np.array(normals)


def alike(t: np.ndarray, other: np.ndarray, slope: np.ndarray, size: np.ndarray, ulps: float = 64) -> np.ndarray:
    """Whether distances agree to so many roundings of all that they come from, `slope` the cosine with the normal."""
    t, other = (np.where(np.isfinite(v), v, 0) for v in (t, other))
    return np.abs(t - other) * np.abs(slope) <= ulps * U * size


def spheres_met(o: np.ndarray, d: np.ndarray, radii: tuple) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """t of the first of some spheres about the origin, its radius, and which rays touch one to within rounding."""
    b = (o * d).sum(1)
    nearest = ((o - b[:, None] * d) ** 2).sum(1)
    halves = [np.sqrt(np.where(r**2 > nearest, r**2 - nearest, np.nan)) for r in radii]
    found = np.stack([sign * h - b for h in halves for sign in (-1, 1)])
    found = np.where(found > 0, found, np.inf)
    edge = np.min([np.abs(nearest - r**2) for r in radii], 0) < 1e-13 * (1 + (o**2).sum(1))
    return found.min(0), np.repeat(radii, 2)[found.argmin(0)], edge


def assert_spheres(rig: Rig, o: np.ndarray, d: np.ndarray, radii: tuple, precise: float = 2e-15) -> None:
    """The first hits are those of spheres, to so much of the size over the cosine with the normal."""
    t = rig.first(o, d)[0]
    exact, radius, edge = spheres_met(o, d, radii)
    assert np.array_equal(np.isfinite(t)[~edge], np.isfinite(exact)[~edge])
    hit = ~edge & np.isfinite(exact)
    assert hit.sum() > len(d) / 10
    slope = np.abs(((o + exact[:, None] * d)[hit] * d[hit]).sum(1)) / radius[hit]
    size = radius + np.linalg.norm(o, axis=1)
    assert (np.abs(t - exact)[hit] * slope <= precise * size[hit]).all()


def departures(rig: Rig, rng: np.random.Generator, radius: float, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points as kernels know them, and directions over both sides, half of them at less than 3 degrees to the surface;
    and whether they run to where f < 0."""
    o, d = rays_at(rng, 40 * n, radius, 3.0)
    t, p, m, _, _ = rig.surfaces(o, d)
    met = np.isfinite(t) & (np.linalg.norm(p, axis=1) < 0.98 * radius)
    p, m = p[met][:n], m[met][:n]
    assert len(p) == n
    side = rng.choice([-1.0, 1.0], (n, 1))
    cosine = rng.random((n, 1)) * np.where(rng.random((n, 1)) < 0.5, 0.05, 1.0)
    d = unit(side * cosine * m + np.sqrt(1 - cosine**2) * unit(np.cross(m, unit(rng.normal(size=(n, 3))))))
    return p, d, side[:, 0] < 0


# Exact arithmetic


def valued(expression: str, x: Any, y: Any, z: Any, number: Callable[[Fraction], Any], **names: Any) -> Any:
    """An expression in any ring; `number` makes a Fraction an element."""
    text = re.sub(
        r"(\^\d+)|(\d+\.?\d*)", lambda m: f"**{m[0][1:]}" if m[1] else f"q('{m[0]}')", expression.replace(" ", "")
    )
    # A quotient of two numbers is one number.
    text = re.sub(r"q\('([\d.]+)'\)/q\('([\d.]+)'\)", r"q('\1/\2')", text)

    def q(written: str) -> Any:
        top, _, bottom = written.partition("/")
        return number(Fraction(top) / Fraction(bottom or "1"))

    known = {k: number(Fraction(v)) for k, v in names.items()}
    return eval(text, {"q": q, "x": x, "y": y, "z": z, "phi": number(PHI), **known})


def rational(x: Any) -> flint.fmpq:
    x = Fraction(float(x)) if not isinstance(x, Fraction) else x
    return flint.fmpq(x.numerator, x.denominator)


def along(expression: str, o: np.ndarray, d: np.ndarray, **names: Any) -> flint.fmpq_poly:
    """The polynomial of a ray in t."""
    line = [flint.fmpq_poly([rational(a), rational(b)]) for a, b in zip(o, d)]
    return valued(expression, *line, lambda f: flint.fmpq_poly([rational(f)]), **names)


def real_roots(p: flint.fmpq_poly) -> list[float]:
    """Certified, in order."""
    return sorted(float(z.real) for z, _ in p.numer().complex_roots() if z.imag == 0)


def gradient(expression: str, p: np.ndarray, **names: Any) -> np.ndarray:
    """Exactly, rounded at the end. Shapes: (N, 3)."""
    found = []
    for point in p:
        lines = (along(expression, point, e, **names) for e in np.eye(3))
        slopes = [Fraction(int(c.p), int(c.q)) for c in (line[1] for line in lines)]
        most = max(map(abs, slopes)) or 1
        found.append([float(s / most) for s in slopes])
    return np.array(found)


def shifted_by_noise(p: flint.fmpq_poly) -> list[flint.fmpq_poly]:
    """The polynomials of the same ray for f = f(o) and what is above and below that by rounding."""
    slack = rational(8 * U * sum(abs(float(c)) for c in p.coeffs()))
    return [p - p[0] + slack, p - p[0] - slack]


def within(radius: float, roots: list[float], o: np.ndarray, d: np.ndarray) -> list[float]:
    """Those in front, and in a ball about the origin."""
    return [t for t in roots if t > 0 and np.linalg.norm(o + t * d) < radius]


def unsettled(expression: str, radius: float, p: np.ndarray, d: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Which rays need exact arithmetic: not those whose answer Bernstein's coefficients of (f - f(p)) / t in 80 bits
    prove, of one sign up to the clip, or up to shortly before the hit and the sign another shortly behind it."""
    big = np.longdouble
    degree = along(expression, *np.random.default_rng(0).normal(size=(2, 3))).degree()
    b = (p * d).sum(1)
    end = -b + np.sqrt(b * b + radius**2 - (p * p).sum(1))
    last = np.where(np.isfinite(t), t * (1 - 1e-5), end)
    points = np.cos(np.pi * (np.arange(degree + 1) + big(0.5)) / (degree + 1)) / 2 + big(0.5)
    q = p.astype(big)[:, None] + (points[:, None] * last.astype(big)[:, None, None]) * d.astype(big)[:, None]
    number = lambda x: big(x.numerator) / big(x.denominator)  # noqa: E731 - as floats are made
    f = valued(expression, *np.moveaxis(q, -1, 0), number)
    start = valued(expression, *p.astype(big).T, number)
    power = points[:, None] ** np.arange(degree)
    values = (f - start[:, None]) / points
    coefficients = values[:, :degree] @ np.linalg.inv(power[:degree].astype(float)).T.astype(big)
    to = np.array([[comb(i, k) / comb(degree - 1, k) if k <= i else 0 for k in range(degree)] for i in range(degree)])
    bernstein = coefficients @ to.T
    margin = 1e-11 * np.abs(coefficients).sum(1)
    sign = np.sign(bernstein[:, 0])
    clear = (bernstein * sign[:, None] > margin[:, None]).all(1)
    beyond = p + np.where(np.isfinite(t), t * (1 + 1e-5), 0)[:, None] * d
    turned = (valued(expression, *beyond.T, float) - start) * sign < -margin
    return np.flatnonzero(~(clear & (turned | np.isinf(t))))
