"""Where a surface is: whether it ends, and the ball that holds it, or what is interesting of it."""

from dataclasses import dataclass

import numpy as np

from visray.clip_report import directions
from visray.surface_picture.field import Field

# Starts of the search for points: their distances from the origin, how many at each, and steps of each search.
DISTANCES, STARTS, STEPS = 10.0 ** np.arange(-2, 4.1, 0.5), 48, 80
# A search has found a point if Newton's next step is this share of the point's distance or shorter.
CLOSE = 1e-7
# Spheres on which signs are compared: their number, how much larger each is than the one before, and places on each.
SPHERES, GROWTH, PLACES = 36, 1.3, 3000
# A surface ends if the sign is the same on this many of the largest spheres.
QUIET = 12
# Lines along each axis and each step along them, and lines from the centre, that find points of a surface in a ball.
GRID, ALONG, RAYS = 40, 72, 2000


@dataclass(frozen=True)
class Whereabouts:
    """A ball that shows a surface.

    centre, radius: the ball.
    compact: whether the ball holds the whole surface; else the surface goes on.
    """

    centre: np.ndarray
    radius: float
    compact: bool


def found_points(field: Field) -> np.ndarray:
    """Points of the surface near and far from the origin, by Newton's method. Shape: (N, 3), N = 0 if none is found."""
    p = (DISTANCES[:, None, None] * directions(STARTS)).reshape(-1, 3)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            p = p - _newton_step(field, p)
        left = np.linalg.norm(_newton_step(field, p), axis=1)
        near = left <= CLOSE * (np.linalg.norm(p, axis=1) + CLOSE)
    return p[near & np.isfinite(p).all(1)]


def _newton_step(field: Field, p: np.ndarray) -> np.ndarray:
    """How far each point moves along the gradient in one step. Shapes: (N, 3)."""
    jet = field.jet(p)
    square = (jet.gradient**2).sum(0)
    return np.where(square > 0, jet.value * jet.gradient / np.where(square > 0, square, 1), 0).T


def whereabouts(field: Field) -> Whereabouts | None:
    """Where the surface is; None if no point of it is found."""
    points = found_points(field)
    if not len(points):
        return None
    distance = np.linalg.norm(points, axis=1)
    scale = max(distance.min(), 1e-3 * np.median(distance), 1e-9)
    radii = scale * GROWTH ** np.arange(1, SPHERES + 1)
    signs = np.array([field.signs(r * directions(PLACES)) for r in radii])
    same = (signs == signs[-1, 0]).all(1) & (signs[-1, 0] != 0)
    if not same[-QUIET:].all():
        return Whereabouts(np.zeros(3), 2.5 * scale if scale > 0.01 else 2.0, False)
    first = len(same) - int(np.argmin(same[::-1])) if not same.all() else 0
    inside = surface_points(field, np.zeros(3), radii[first])
    if not len(inside):
        inside = points
    middle = 0.5 * (inside.min(0) + inside.max(0))
    reach = np.linalg.norm(inside - middle, axis=1).max()
    if np.linalg.norm(middle) < 0.2 * reach:
        middle = np.zeros(3)
        reach = np.linalg.norm(inside, axis=1).max()
    return Whereabouts(middle, float(reach), True)


def surface_points(field: Field, centre: np.ndarray, radius: float) -> np.ndarray:
    """Points of the surface in a ball, spread over all of it. Shape: (N, 3)."""
    t = np.linspace(-radius, radius, ALONG)
    u, v = (x.ravel() for x in np.meshgrid(*2 * [np.linspace(-radius, radius, GRID)]))
    found = []
    for axis in range(3):
        o = centre + np.insert(np.stack([u, v], 1), axis, 0, axis=1)
        o = o[u * u + v * v < radius * radius]
        found.append(field.all_crossings(o, np.tile(np.eye(3)[axis], (len(o), 1)), np.tile(t, (len(o), 1))))
    t = np.linspace(0, radius, ALONG // 2)
    found.append(field.all_crossings(np.tile(centre, (RAYS, 1)), directions(RAYS), np.tile(t, (RAYS, 1))))
    points = np.concatenate(found)
    return points[np.linalg.norm(points - centre, axis=1) <= radius]
