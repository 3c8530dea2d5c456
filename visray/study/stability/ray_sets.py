"""The sets of rays that a polynomial surface is tested with. The clip is the sphere that bounds the surface.

camera: from three eyes to all points of the clip; the distance of an eye from the clip's centre is 3 radii of the clip
inside: from points inside the clip, in all directions
grazing: past points of the surface, at a distance of 10^-12 to 10^-2 radii of the clip
singular: past singular points of the surface, at a distance of 10^-9 to 10^-2 radii of the clip
secondary: from points where camera and inside rays hit the surface, into the side from which these rays came. Half of
    them are spread over the hemisphere. The other half, the skimming rays, leave at less than 3 degrees to the surface.
    Reports call this half "secondary, grazing".

Origins are single-precision numbers, except those of secondary rays. The length of a direction is 1 to within 2^-52.
Both are stored as doubles, so that the exact solver and the kernel get the same rays.
"""

import json
from dataclasses import dataclass
from math import cos
from pathlib import Path

import numpy as np

from visray.errors import UserError
from visray.polynomials.catalogue import SURFACES
from visray.study.stability.exact.expressions import number
from visray.study.stability.exact.surface import RayBundle, Surface
from visray.study.stability.exact.truth import Truth

SETS = ("camera", "inside", "grazing", "singular", "secondary")
SECONDARY_SETS = ("secondary, hemisphere", "secondary, grazing")
# Exponents of ten: grazing and singular rays pass at distances between 10^LEAST_GRAZING (or 10^LEAST_SINGULAR) and
# 10^LARGEST radii of the clip. Nearer to a singular point than 10^-9, double precision defines few of the hits.
LEAST_GRAZING, LEAST_SINGULAR, LARGEST = -12, -9, -2
SKIMMING_COSINE = 0.05  # a secondary ray is skimming if the cosine of its angle with the normal is at most this
ROUNDING = 2.0**-50  # relative error of the coordinates of a hit point that a kernel in double precision computes


@dataclass(frozen=True)
class NamedSurface:
    """A surface with its name and its known singular points.

    singular: for each singular point, three coordinates, which are numbers or expressions
    """

    name: str
    surface: Surface
    singular: tuple = ()

    def singular_points(self) -> np.ndarray:
        """The singular points inside the clip. Shapes: (M, 3)."""
        s = self.surface
        p = np.array([[_coordinate(c, s.parameters) for c in point] for point in self.singular]).reshape(-1, 3)
        return p[np.linalg.norm(p - np.array(s.centre), axis=1) < s.radius]


def _coordinate(text: float | str, parameters: dict[str, float]) -> float:
    """The value of a number, of an expression without x, y and z, or of "cos(expression)"."""
    if str(text).startswith("cos("):
        return cos(number(str(text)[4:-1], parameters))
    return float(number(text, parameters))


# By the name of a surface in a file, the name of the same surface in the catalogue, which has its singular points.
ALIASES = {"heart-taubin": "heart", "roman-steiner": "roman"}


FORMAT = '{"surfaces": [{"name": "ball", "expression": "x^2 + y^2 + z^2 - 1", "bounding_radius": 1.5}, ...]}'


def named_surfaces(path: Path | None) -> dict[str, NamedSurface]:
    """The surfaces of the catalogue (path is None), or of a JSON file in FORMAT, by name.

    In a file, each surface may also have the keys "centre", "parameters" and "singular_points".
    """
    if path is None:
        return {
            name: NamedSurface(name, Surface(c.expression, c.radius, c.centre, c.parameters), c.singular)
            for name, c in SURFACES.items()
        }
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))["surfaces"]
        return {e["name"]: _named_surface(e) for e in entries}
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise UserError(f"{path}: is not a file of surfaces; right would be {FORMAT}") from None


def _named_surface(entry: dict) -> NamedSurface:
    """The surface of one entry of a file."""
    surface = Surface(
        entry["expression"],
        float(entry["bounding_radius"]),
        tuple(map(float, entry.get("centre", (0, 0, 0)))),
        entry.get("parameters", {}),
    )
    points = tuple(map(tuple, entry.get("singular_points") or ()))
    name = entry["name"].replace("_", "-")
    in_catalogue = SURFACES.get(ALIASES.get(name, name))
    return NamedSurface(entry["name"], surface, points or (in_catalogue.singular if in_catalogue else ()))


def single(v: np.ndarray) -> np.ndarray:
    """Numbers rounded to single precision, but stored as doubles."""
    return v.astype(np.float32).astype(float)


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def sphere(rng: np.random.Generator, n: int) -> np.ndarray:
    """Random unit vectors, uniform over the sphere. Shapes: (n, 3)."""
    return unit(rng.normal(size=(n, 3)))


def ball(rng: np.random.Generator, n: int) -> np.ndarray:
    """Random points, uniform in the unit ball. Shapes: (n, 3)."""
    return sphere(rng, n) * rng.random((n, 1)) ** (1 / 3)


def camera(named: NamedSurface, n: int, rng: np.random.Generator) -> RayBundle:
    """n rays from three eyes to random points of a disk that faces the eye and has the clip's centre and radius."""
    s = named.surface
    eyes = single(np.array(s.centre) + 3 * s.radius * sphere(rng, 3))
    o = eyes[np.arange(n) % len(eyes)]
    forward = unit(np.array(s.centre) - o)
    side = unit(np.cross(forward, sphere(rng, 1)))
    angle, radius = 2 * np.pi * rng.random((n, 1)), s.radius * np.sqrt(rng.random((n, 1)))
    target = np.array(s.centre) + radius * (np.cos(angle) * side + np.sin(angle) * np.cross(forward, side))
    return RayBundle(o, unit(target - o))


def inside(named: NamedSurface, n: int, rng: np.random.Generator) -> RayBundle:
    """n rays from random points in the clip, in random directions."""
    s = named.surface
    return RayBundle(single(np.array(s.centre) + s.radius * ball(rng, n)), sphere(rng, n))


def rays_past(
    named: NamedSurface, p: np.ndarray, sideways: np.ndarray, d: np.ndarray, least: float, rng: np.random.Generator
) -> RayBundle:
    """Rays roughly along d that pass the points p at a distance of 10^least to 10^LARGEST radii of the clip.

    p: points, (n, 3)
    sideways: unit vectors from the point to the ray, or to the opposite side, (n, 3)
    d: unit vectors, (n, 3)
    least: exponent of ten
    """
    s, n = named.surface, len(p)
    distance = s.radius * 10 ** rng.uniform(least, LARGEST, (n, 1)) * rng.choice([-1.0, 1.0], (n, 1))
    o = single(p - s.radius * rng.uniform(0.5, 2.5, (n, 1)) * d)
    return RayBundle(o, unit(p + distance * sideways - o))


def grazing(named: NamedSurface, n: int, rng: np.random.Generator, rays: RayBundle, truth: Truth) -> RayBundle | None:
    """n rays that just touch or just miss the surface, near points that other rays hit.

    None if no other ray hits at a point with a normal.

    rays, truth: the other rays and their exact hits
    """
    hit = np.flatnonzero(truth.judged & np.isfinite(truth.t))
    if not len(hit):
        return None
    p = rays.select(hit).points(truth.t[hit], truth.low[hit])
    g = named.surface.gradient(p)
    length = np.linalg.norm(g, axis=1)
    regular = np.flatnonzero(length > 0)
    if not len(regular):
        return None
    pick = regular[rng.integers(len(regular), size=n)]
    normal = g[pick] / length[pick, None]
    d = unit(np.cross(normal, sphere(rng, n)))
    return rays_past(named, np.stack([c.hi[0] for c in p], 1)[pick], normal, d, LEAST_GRAZING, rng)


def singular(named: NamedSurface, n: int, rng: np.random.Generator) -> RayBundle | None:
    """n rays past the singular points. None if no singular point is known."""
    points = named.singular_points()
    if not len(points):
        return None
    d = sphere(rng, n)
    passed = points[rng.integers(len(points), size=n)]
    return rays_past(named, passed, unit(np.cross(d, sphere(rng, n))), d, LEAST_SINGULAR, rng)


@dataclass(frozen=True)
class SecondaryRays:
    """Rays that start at the points where other rays hit the surface.

    rays: the secondary rays; their origins are the exact hit points to within 2^-100
    incoming: for each secondary ray, the ray that hit the surface at its origin
    t, low: the hit is at distance t + low along the incoming ray, (N)
    n: unit normal at the hit, along the gradient, (N, 3)
    skimming: whether the secondary ray leaves at less than 3 degrees to the surface, (N)
    """

    rays: RayBundle
    incoming: RayBundle
    t: np.ndarray
    low: np.ndarray
    n: np.ndarray
    skimming: np.ndarray

    @property
    def p(self) -> np.ndarray:
        """The hit points in double precision. Shapes: (N, 3)."""
        return self.rays.o

    def select(self, lanes: np.ndarray) -> "SecondaryRays":
        """Chosen rays. lanes: indices or mask of the rays."""
        fields = (v[lanes] for v in (self.t, self.low, self.n, self.skimming))
        return SecondaryRays(self.rays.select(lanes), self.incoming.select(lanes), *fields)


def secondary(
    named: NamedSurface, n: int, rng: np.random.Generator, rays: RayBundle, truth: Truth
) -> SecondaryRays | None:
    """n secondary rays from hits whose point, side and normal are certain. None if there are no such hits.

    rays, truth: the rays that hit, and their exact hits
    """
    surface, hit = named.surface, truth.judged & np.isfinite(truth.t) & (truth.side != 0)
    if not hit.any():
        return None
    incoming, t, low, side = rays.select(hit), truth.t[hit], truth.low[hit], truth.side[hit]
    p = incoming.points(t, low)
    g = surface.gradient(p)
    length = np.linalg.norm(g, axis=1)
    point, point_low = (np.stack(v, 1) for v in ([c.hi[0] for c in p], [c.lo[0] for c in p]))
    # A gradient that consists of rounding errors only may point to the wrong side; such hits are left out.
    certain = np.flatnonzero((length > 0) & ((g * incoming.d).sum(1) * side < 0))
    if not len(certain):
        return None
    pick = certain[rng.integers(len(certain), size=n)]
    is_skimming = np.arange(n) % 2 == 1
    normal = g[pick] / length[pick, None]
    across = unit(np.cross(normal, sphere(rng, n)))
    cosine = np.where(is_skimming, SKIMMING_COSINE * (1 - rng.random(n)), 1 - rng.random(n))[:, None]
    d = unit(normal * (side[pick, None] * cosine) + across * np.sqrt(1 - cosine**2))
    noise = ROUNDING * length[pick] * (np.abs(point[pick]).max(1) + surface.radius)
    outgoing = RayBundle(point[pick], d, point_low[pick], side[pick], noise)
    return SecondaryRays(outgoing, incoming.select(pick), t[pick], low[pick], normal, is_skimming)
