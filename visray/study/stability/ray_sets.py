"""The rays that a polynomial surface is put to the test with.

camera: from three eyes at three radii of the clip, to all of it. inside: from points in the clip, any way. grazing:
past points of the surface at 10^-12 to 10^-2 of the radius. singular: past its singular points, at 10^-9 or more.
secondary: from points of the surface, on the side from which they were seen: half of them over the hemisphere, half
at less than 3 degrees to the surface.

Origins are numbers in single precision, but those of secondary rays. Directions are of unit length to 2^-52. Both are
doubles, so that truth and kernel see the same rays.
"""

import json
from dataclasses import dataclass
from math import cos
from pathlib import Path

import numpy as np

from visray.errors import UserError
from visray.polynomials.catalogue import SURFACES
from visray.study.stability.exact.formulas import number
from visray.study.stability.exact.known_surface import Bundle, Surface
from visray.study.stability.exact.truth import Truth

SETS = ("camera", "inside", "grazing", "singular", "secondary")
# Powers of ten of the clip's radius. Nearer to a singular point than 10^-9, hardly an answer is defined.
GRAZING, SINGULAR, FAR = -12, -9, -2
LOW = 0.05  # cosine below which a ray skims the surface
ROUNDING = 2.0**-50  # of a point's coordinates: how well a kernel in double knows where it is
PARTS = ("secondary, hemisphere", "secondary, grazing")


@dataclass(frozen=True)
class Named:
    """A surface and what is known of it: points at which it is singular."""

    name: str
    surface: Surface
    singular: tuple = ()

    def points(self) -> np.ndarray:
        """The singular points within the clip. Shapes: (M, 3)."""
        s = self.surface
        p = np.array([[_coordinate(c, s.parameters) for c in point] for point in self.singular]).reshape(-1, 3)
        return p[np.linalg.norm(p - np.array(s.centre), axis=1) < s.radius]


def _coordinate(text: float | str, parameters: dict[str, float]) -> float:
    """An expression without x, y and z, or the cosine of one."""
    if str(text).startswith("cos("):
        return cos(number(str(text)[4:-1], parameters))
    return float(number(text, parameters))


# The same surfaces under other names, whose singular points are known.
ALIASES = {"heart-taubin": "heart", "roman-steiner": "roman"}


FORMAT = '{"surfaces": [{"name": "ball", "expression": "x^2 + y^2 + z^2 - 1", "bounding_radius": 1.5}, ...]}'


def surfaces_of(path: Path | None) -> dict[str, Named]:
    """The known surfaces, or those of a JSON file in FORMAT; each may have "centre", "parameters" and
    "singular_points" as well."""
    if path is None:
        named = SURFACES.items()
        return {n: Named(n, Surface(c.expression, c.radius, c.centre, c.parameters), c.singular) for n, c in named}
    try:
        listed = json.loads(path.read_text(encoding="utf-8"))["surfaces"]
        return {e["name"]: _read(e) for e in listed}
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise UserError(f"{path}: is no file of surfaces; it must hold {FORMAT}") from None


def _read(entry: dict) -> Named:
    surface = Surface(
        entry["expression"],
        float(entry["bounding_radius"]),
        tuple(map(float, entry.get("centre", (0, 0, 0)))),
        entry.get("parameters", {}),
    )
    points = tuple(map(tuple, entry.get("singular_points") or ()))
    name = entry["name"].replace("_", "-")
    known = SURFACES.get(ALIASES.get(name, name))
    return Named(entry["name"], surface, points or (known.singular if known else ()))


def single(v: np.ndarray) -> np.ndarray:
    """Rounded to single precision."""
    return v.astype(np.float32).astype(float)


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def sphere(rng: np.random.Generator, n: int) -> np.ndarray:
    """Directions, uniform. Shapes: (n, 3)."""
    return unit(rng.normal(size=(n, 3)))


def ball(rng: np.random.Generator, n: int) -> np.ndarray:
    """Points of the unit ball, uniform. Shapes: (n, 3)."""
    return sphere(rng, n) * rng.random((n, 1)) ** (1 / 3)


def camera(named: Named, n: int, rng: np.random.Generator) -> Bundle:
    """Rays from eyes to points in the disc of the clip that faces them."""
    s = named.surface
    eyes = single(np.array(s.centre) + 3 * s.radius * sphere(rng, 3))
    o = eyes[np.arange(n) % len(eyes)]
    forward = unit(np.array(s.centre) - o)
    side = unit(np.cross(forward, sphere(rng, 1)))
    angle, radius = 2 * np.pi * rng.random((n, 1)), s.radius * np.sqrt(rng.random((n, 1)))
    target = np.array(s.centre) + radius * (np.cos(angle) * side + np.sin(angle) * np.cross(forward, side))
    return Bundle(o, unit(target - o))


def inside(named: Named, n: int, rng: np.random.Generator) -> Bundle:
    """Rays from anywhere in the clip."""
    s = named.surface
    return Bundle(single(np.array(s.centre) + s.radius * ball(rng, n)), sphere(rng, n))


def past(
    named: Named, p: np.ndarray, aside: np.ndarray, d: np.ndarray, least: float, rng: np.random.Generator
) -> Bundle:
    """Rays that run along d past the points p, on the side `aside` (of unit length) or its opposite, at 10^least of the
    clip's radius or more. Shapes: (n, 3)."""
    s, n = named.surface, len(p)
    distance = s.radius * 10 ** rng.uniform(least, FAR, (n, 1)) * rng.choice([-1.0, 1.0], (n, 1))
    o = single(p - s.radius * rng.uniform(0.5, 2.5, (n, 1)) * d)
    return Bundle(o, unit(p + distance * aside - o))


def grazing(named: Named, n: int, rng: np.random.Generator, rays: Bundle, truth: Truth) -> Bundle | None:
    """Rays that touch the surface, or miss it, by next to nothing, near points at which others hit it."""
    hit = np.flatnonzero(truth.good & np.isfinite(truth.t))
    if not len(hit):
        return None
    kept = rays.part(hit)
    p = kept.at(truth.t[hit], truth.low[hit])
    g = named.surface.gradient(p)
    length = np.linalg.norm(g, axis=1)
    ok = np.flatnonzero(length > 0)
    if not len(ok):
        return None
    pick = ok[rng.integers(len(ok), size=n)]
    normal = g[pick] / length[pick, None]
    d = unit(np.cross(normal, sphere(rng, n)))
    return past(named, np.stack([c.hi[0] for c in p], 1)[pick], normal, d, GRAZING, rng)


def singular(named: Named, n: int, rng: np.random.Generator) -> Bundle | None:
    """Rays past the singular points; None if none is known."""
    points = named.points()
    if not len(points):
        return None
    d = sphere(rng, n)
    return past(named, points[rng.integers(len(points), size=n)], unit(np.cross(d, sphere(rng, n))), d, SINGULAR, rng)


@dataclass(frozen=True)
class Leaving:
    """Rays that leave hits of others: `rays` by truth, from the exact points to 2^-100. first: the rays that hit, with
    their distances t + low; p: the points in double; n: the unit normals there, along the gradient; skimming: at less
    than 3 degrees to the surface. Shapes: (N, 3), (N)."""

    rays: Bundle
    first: Bundle
    t: np.ndarray
    low: np.ndarray
    n: np.ndarray
    skimming: np.ndarray

    @property
    def p(self) -> np.ndarray:
        return self.rays.o

    def part(self, keep: np.ndarray) -> "Leaving":
        fields = (v[keep] for v in (self.t, self.low, self.n, self.skimming))
        return Leaving(self.rays.part(keep), self.first.part(keep), *fields)


def secondary(named: Named, n: int, rng: np.random.Generator, rays: Bundle, truth: Truth) -> Leaving | None:
    """Rays from hits, where the hit, the side it is seen from and the normal are certain."""
    surface, hit = named.surface, truth.good & np.isfinite(truth.t) & (truth.side != 0)
    if not hit.any():
        return None
    first, t, low, side = rays.part(hit), truth.t[hit], truth.low[hit], truth.side[hit]
    p = first.at(t, low)
    g = surface.gradient(p)
    length = np.linalg.norm(g, axis=1)
    middle, rest = (np.stack(v, 1) for v in ([c.hi[0] for c in p], [c.lo[0] for c in p]))
    # The gradient must point away from the side that the viewer is on: it does not where it is but noise.
    ok = np.flatnonzero((length > 0) & ((g * first.d).sum(1) * side < 0))
    if not len(ok):
        return None
    pick = ok[rng.integers(len(ok), size=n)]
    skimming = np.arange(n) % 2 == 1
    normal = g[pick] / length[pick, None]
    across = unit(np.cross(normal, sphere(rng, n)))
    cosine = np.where(skimming, LOW * (1 - rng.random(n)), 1 - rng.random(n))[:, None]
    d = unit(normal * (side[pick, None] * cosine) + across * np.sqrt(1 - cosine**2))
    noise = ROUNDING * length[pick] * (np.abs(middle[pick]).max(1) + surface.radius)
    out = Bundle(middle[pick], d, rest[pick], side[pick], noise)
    chosen = first.part(pick)
    return Leaving(out, chosen, t[pick], low[pick], normal, skimming)
