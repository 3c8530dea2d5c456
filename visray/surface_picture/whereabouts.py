"""Where a surface is: whether it ends, and the ball that holds it, or what is interesting of it."""

from dataclasses import dataclass

import numpy as np

from visray.clip_report import directions
from visray.surface_picture.field import Field
from visray.surface_picture.points import (
    Special,
    distinct,
    found_points,
    special_points,
    surface_points,
    turning_points,
)

# Spheres on which signs are compared: their number, how much larger each is than the one before, and places on each.
SPHERES, PLACES = 48, 2000
# The smallest and the largest of them, in units of the distances of points; a surface ends if the sign is the same on
# this many of the largest.
SMALLEST, LARGEST, QUIET = 1.05, 300.0, 12
# The search for thin arms: its starts, its steps, and the largest step in radians.
ARMS, ARM_STEPS, WIDEST = 64, 25, 0.2
# A ball about the origin is taken if its middle is nearer to it than this share of its radius.
CENTRAL = 0.2
# The share of the special points that must be in the clip of a surface that goes on.
SHARE = 0.85
# The clip is larger than the ball of the special points by 1 + ROOM / degree: surfaces of a high degree have more of
# them, so that they show all of the shape.
ROOM = 2.6
# How far normals must turn in the clip of a surface without special points: 1 less the length of their mean.
TURNED = 0.25
# The clip is this much larger. If that is so in one of the first balls, all balls are alike.
AROUND, ALIKE = 1.4, 5
# Special points count at distances from the centre between these, in units of the distance of a middle point: nearer
# ones are one degenerate point, and farther ones are places to which the surface only tends.
NEAREST, FARTHEST_SPECIAL = 1e-5, 100.0
# Points from which special points are looked for.
STARTS = 500
# How often the ball of a surface that ends is looked at for parts of it, and how much larger than the parts before.
ROUNDS, WIDER = 5, 1.4
# Points, the farthest ones, from which farther points are looked for.
FARTHEST = 64


@dataclass(frozen=True)
class Whereabouts:
    """A ball that shows a surface.

    centre, radius: the ball.
    compact: whether the ball holds the whole surface; else the surface goes on.
    points: some points of the surface, not all of them in the ball. Shape: (N, 3).
    """

    centre: np.ndarray
    radius: float
    compact: bool
    points: np.ndarray


def whereabouts(field: Field) -> Whereabouts | None:
    """Where the surface is; None if no place is found at which f changes its sign."""
    crossed, touched = found_points(field)
    points = np.concatenate([crossed, touched])
    if not len(points):
        return None
    distance = np.linalg.norm(points, axis=1)
    scale = float(np.median(distance if not len(crossed) else np.linalg.norm(crossed, axis=1)))
    radius = end_of(field, max(float(distance.min()), 1e-3 * scale, 1e-9), max(scale, 1e-9))
    if radius:
        return _all_of_it(field, points, radius)
    return _heart_of_it(field, points, max(float(distance.min()), 1e-9))


def end_of(field: Field, nearest: float, scale: float) -> float | None:
    """Radius of a ball about the origin beyond which the polynomial keeps its sign; None if there is none.

    nearest, scale: distances of the nearest point of the surface and of a middle one.
    """
    radii = np.geomspace(SMALLEST * nearest, LARGEST * scale, SPHERES)
    lattice = np.array([p for p in np.ndindex(3, 3, 3) if p != (1, 1, 1)]) - 1.0
    places = np.concatenate([directions(PLACES), lattice / np.linalg.norm(lattice, axis=1, keepdims=True)])
    signs = np.array([field.signs(r * places) for r in radii])
    last = np.sign(signs[-1].sum())
    same = (signs * last >= 0).all(1)
    if not last or not same[-QUIET:].all():
        return None
    # A surface may go on as thin arms between the places.
    if any(_has_arm(field, r, last, places) for r in (radii[-1], radii[-QUIET])):
        return None
    return float(radii[0 if same.all() else len(same) - int(np.argmin(same[::-1]))])


def _has_arm(field: Field, radius: float, sign: float, places: np.ndarray) -> bool:
    """Whether the sign is another one somewhere on a sphere. It is looked for where the values are nearest to 0.

    sign: the sign at all places. places: unit vectors to them. Shape: places (N, 3).
    """
    p = places[np.argsort(sign * field.values(radius * places))[:ARMS]]
    for _ in range(ARM_STEPS):
        # Newton's method on the sphere, down in all directions: with the sizes of the eigenvalues.
        jet = field.jet(radius * p)
        across = np.eye(3) - p[:, :, None] * p[:, None, :]
        gradient, hessian = sign * radius * jet.gradient.T, sign * radius**2 * np.moveaxis(jet.hessian, 2, 0)
        curved = across @ hessian @ across - (gradient * p).sum(1)[:, None, None] * across
        sizes, axes = np.linalg.eigh(np.where(np.isfinite(curved), curved, 0))
        sizes = np.maximum(np.abs(sizes), 1e-12 * np.abs(sizes).max(1, keepdims=True) + 1e-300)
        along = (axes * (across @ gradient[..., None])).sum(1) / sizes
        step = (axes @ along[..., None])[..., 0]
        p = p - step * np.minimum(1, WIDEST / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300))
        p = p / np.linalg.norm(p, axis=1, keepdims=True)
    return bool((sign * field.signs(radius * p) < 0).any())


def _all_of_it(field: Field, points: np.ndarray, radius: float) -> Whereabouts:
    """The ball of a surface that ends. points: some points of it. radius: of a ball about the origin that holds it."""
    points = points[np.linalg.norm(points, axis=1) <= radius]
    points = np.concatenate([points, surface_points(field, np.zeros(3), radius)])
    ball = _around(points)
    for _ in range(ROUNDS):
        # Lines through a smaller ball are closer, and find more.
        points = np.concatenate([points, surface_points(field, ball.centre, WIDER * ball.radius)])
        before, ball = ball, _around(points)
        if ball.radius < 1.01 * before.radius:
            break
    distance = np.linalg.norm(points - ball.centre, axis=1)
    with np.errstate(all="ignore"):
        far = turning_points(field, ball.centre, points[np.argsort(distance)[-FARTHEST:]])
    far = far[np.linalg.norm(far - ball.centre, axis=1) <= WIDER * ball.radius]
    return _around(np.concatenate([points, far]))


def _around(points: np.ndarray) -> Whereabouts:
    """A ball that holds points, about the origin if that is near its middle."""
    middle = 0.5 * (points.min(0) + points.max(0))
    reach = float(np.linalg.norm(points - middle, axis=1).max())
    if np.linalg.norm(middle) < CENTRAL * reach:
        middle, reach = np.zeros(3), float(np.linalg.norm(points, axis=1).max())
    return Whereabouts(middle, max(reach, 1e-9), True, points)


def _heart_of_it(field: Field, points: np.ndarray, nearest: float) -> Whereabouts:
    """The ball of a surface that goes on: it holds singular points and the places where the shape changes.

    points: some points of it. nearest: distance of the nearest of them.
    """
    centre, middle_one = np.zeros(3), float(np.median(np.linalg.norm(points, axis=1)))
    near = _near(special_points(field, centre, _some(points)), centre, middle_one)
    more = surface_points(field, centre, 1.5 * _reach(near, centre) if len(near) else middle_one)
    special = special_points(field, centre, np.concatenate([near, _some(more), _some(points)]))
    kept = np.concatenate([special.singular, special.still])
    if len(kept):
        middle = 0.5 * (kept.min(0) + kept.max(0))
        if np.linalg.norm(middle) > 3 * np.linalg.norm(kept - middle, axis=1).max() + nearest / 3:
            centre, special = middle, special_points(field, middle, _some(points) + middle)
    near = _near(special, centre, middle_one)
    degree = sum(f.degree for f in field.compiled.program.factors)
    radius = (1 + ROOM / degree) * _reach(near, centre) if len(near) else _bent(field, centre)
    return Whereabouts(centre, radius, False, points)


def _near(special: Special, centre: np.ndarray, middle: float) -> np.ndarray:
    """The special points of the surface that are neither at its centre nor very far away. middle: distance of a middle
    point of the surface."""
    found = distinct(np.concatenate([special.singular, special.turning]))
    distance = np.linalg.norm(found - centre, axis=1)
    return found[(distance > NEAREST * middle) & (distance < FARTHEST_SPECIAL * middle)]


def _some(points: np.ndarray) -> np.ndarray:
    """At most twice as many of the points as STARTS, evenly chosen."""
    return points[:: max(1, len(points) // STARTS)]


def _reach(points: np.ndarray, centre: np.ndarray) -> float:
    """Radius of a ball about a centre that holds most of the points."""
    return float(np.quantile(np.linalg.norm(points - centre, axis=1), SHARE, method="higher"))


def _bent(field: Field, centre: np.ndarray) -> float:
    """Radius of a ball in which the normals of the surface clearly point in different directions; 1 if no ball is
    special, as with planes and cones."""
    radii = 10.0 ** np.arange(-3, 3.01, 0.1)
    for radius in radii:
        points = surface_points(field, centre, radius, 16)
        if len(points):
            _, gradient = field.slope(points)
            length = np.linalg.norm(gradient, axis=0)
            normals = gradient[:, length > 0] / length[length > 0]
            if normals.shape[1] and 1 - np.linalg.norm(normals.mean(1)) > TURNED:
                return AROUND * float(radius) if radius > radii[ALIKE] else 1.0
    return 1.0
