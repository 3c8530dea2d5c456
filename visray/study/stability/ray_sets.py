"""The sets of rays that a polynomial surface is tested with.

camera: from three eyes, at three radii of the clip from its centre, to all of the clip
inside: from points in the clip, in any direction
grazing: past points of the surface, at 10^-12 to 10^-2 of the clip's radius
singular: past the surface's singular points, at 10^-9 to 10^-2 of the clip's radius
secondary: from points of the surface, on the side from which they were seen: half of them over the hemisphere, half at
    less than 3 degrees to the surface

Origins are single-precision numbers, but those of secondary rays. Directions are of unit length to 2^-52. Both are
stored as doubles, so that the exact solver and the kernel see the same rays.
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
# Powers of ten of the clip's radius: least distances from the surface and from singular points, and the largest one.
# Nearer to a singular point than 10^-9, few rays have a defined hit.
LEAST_GRAZING, LEAST_SINGULAR, LARGEST = -12, -9, -2
GRAZING_COSINE = 0.05  # of the angle with the normal; below it a secondary ray is grazing
ROUNDING = 2.0**-50  # of a point's coordinates: how well a kernel in double precision knows where it is


@dataclass(frozen=True)
class NamedSurface:
    """A surface with its name and its known singular points.

    singular: coordinates of each point, as numbers or expressions
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
    """The value of a number, of an expression without x, y and z, or of the cosine of one."""
    if str(text).startswith("cos("):
        return cos(number(str(text)[4:-1], parameters))
    return float(number(text, parameters))


# Surfaces of files under other names than those in the catalogue, which knows their singular points.
ALIASES = {"heart-taubin": "heart", "roman-steiner": "roman"}


FORMAT = '{"surfaces": [{"name": "ball", "expression": "x^2 + y^2 + z^2 - 1", "bounding_radius": 1.5}, ...]}'


def named_surfaces(path: Path | None) -> dict[str, NamedSurface]:
    """The surfaces of the catalogue, or those of a JSON file in FORMAT.

    In a file, each surface may also have "centre", "parameters" and "singular_points".
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
        raise UserError(f"{path}: is no file of surfaces; it must hold {FORMAT}") from None


def _named_surface(entry: dict) -> NamedSurface:
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
    """Numbers rounded to single precision, as doubles."""
    return v.astype(np.float32).astype(float)


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def sphere(rng: np.random.Generator, n: int) -> np.ndarray:
    """Uniform random directions. Shapes: (n, 3)."""
    return unit(rng.normal(size=(n, 3)))


def ball(rng: np.random.Generator, n: int) -> np.ndarray:
    """Uniform random points of the unit ball. Shapes: (n, 3)."""
    return sphere(rng, n) * rng.random((n, 1)) ** (1 / 3)


def camera(named: NamedSurface, n: int, rng: np.random.Generator) -> RayBundle:
    """Rays from three eyes to points on the disk through the clip's centre that faces the eye."""
    s = named.surface
    eyes = single(np.array(s.centre) + 3 * s.radius * sphere(rng, 3))
    o = eyes[np.arange(n) % len(eyes)]
    forward = unit(np.array(s.centre) - o)
    side = unit(np.cross(forward, sphere(rng, 1)))
    angle, radius = 2 * np.pi * rng.random((n, 1)), s.radius * np.sqrt(rng.random((n, 1)))
    target = np.array(s.centre) + radius * (np.cos(angle) * side + np.sin(angle) * np.cross(forward, side))
    return RayBundle(o, unit(target - o))


def inside(named: NamedSurface, n: int, rng: np.random.Generator) -> RayBundle:
    """Rays from random points in the clip, in random directions."""
    s = named.surface
    return RayBundle(single(np.array(s.centre) + s.radius * ball(rng, n)), sphere(rng, n))


def rays_past(
    named: NamedSurface, p: np.ndarray, sideways: np.ndarray, d: np.ndarray, least: float, rng: np.random.Generator
) -> RayBundle:
    """Rays roughly along d that pass the points p, at 10^least to 10^LARGEST of the clip's radius.

    sideways: unit vector; the ray passes on this side of the point or on the opposite one. Shapes: (n, 3) each.
    """
    s, n = named.surface, len(p)
    distance = s.radius * 10 ** rng.uniform(least, LARGEST, (n, 1)) * rng.choice([-1.0, 1.0], (n, 1))
    o = single(p - s.radius * rng.uniform(0.5, 2.5, (n, 1)) * d)
    return RayBundle(o, unit(p + distance * sideways - o))


def grazing(named: NamedSurface, n: int, rng: np.random.Generator, rays: RayBundle, truth: Truth) -> RayBundle | None:
    """Rays that just touch or just miss the surface, near points that other rays hit. None if no ray hits."""
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
    """Rays past the singular points. None if none is known."""
    points = named.singular_points()
    if not len(points):
        return None
    d = sphere(rng, n)
    passed = points[rng.integers(len(points), size=n)]
    return rays_past(named, passed, unit(np.cross(d, sphere(rng, n))), d, LEAST_SINGULAR, rng)


@dataclass(frozen=True)
class SecondaryRays:
    """Rays that leave the points where other rays hit the surface.

    rays: the secondary rays; their origins are the exact hit points to 2^-100
    incoming: the rays that hit, a ray each
    t, low: distance t + low of the hit along the incoming ray, (N)
    n: unit normal there, along the gradient, (N, 3)
    grazing: whether the secondary ray is at less than 3 degrees to the surface, (N)
    """

    rays: RayBundle
    incoming: RayBundle
    t: np.ndarray
    low: np.ndarray
    n: np.ndarray
    grazing: np.ndarray

    @property
    def p(self) -> np.ndarray:
        """The hit points in double precision. Shapes: (N, 3)."""
        return self.rays.o

    def select(self, lanes: np.ndarray) -> "SecondaryRays":
        """Chosen rays, by index or by mask."""
        fields = (v[lanes] for v in (self.t, self.low, self.n, self.grazing))
        return SecondaryRays(self.rays.select(lanes), self.incoming.select(lanes), *fields)


def secondary(
    named: NamedSurface, n: int, rng: np.random.Generator, rays: RayBundle, truth: Truth
) -> SecondaryRays | None:
    """Secondary rays from hits whose point, side and normal are certain. None if there are no such hits."""
    surface, hit = named.surface, truth.judged & np.isfinite(truth.t) & (truth.side != 0)
    if not hit.any():
        return None
    incoming, t, low, side = rays.select(hit), truth.t[hit], truth.low[hit], truth.side[hit]
    p = incoming.points(t, low)
    g = surface.gradient(p)
    length = np.linalg.norm(g, axis=1)
    point, point_low = (np.stack(v, 1) for v in ([c.hi[0] for c in p], [c.lo[0] for c in p]))
    # Where the gradient is nothing but rounding noise, it may point to the wrong side; such hits are left out.
    certain = np.flatnonzero((length > 0) & ((g * incoming.d).sum(1) * side < 0))
    if not len(certain):
        return None
    pick = certain[rng.integers(len(certain), size=n)]
    is_grazing = np.arange(n) % 2 == 1
    normal = g[pick] / length[pick, None]
    across = unit(np.cross(normal, sphere(rng, n)))
    cosine = np.where(is_grazing, GRAZING_COSINE * (1 - rng.random(n)), 1 - rng.random(n))[:, None]
    d = unit(normal * (side[pick, None] * cosine) + across * np.sqrt(1 - cosine**2))
    noise = ROUNDING * length[pick] * (np.abs(point[pick]).max(1) + surface.radius)
    outgoing = RayBundle(point[pick], d, point_low[pick], side[pick], noise)
    return SecondaryRays(outgoing, incoming.select(pick), t[pick], low[pick], normal, is_grazing)
