"""Points of a surface: some from near and far, all over a ball, and special ones."""

from dataclasses import dataclass

import numpy as np

from visray.clip_report import directions
from visray.surface_picture.field import Field
from visray.surface_picture.jet import Jet

# Starts of the search for points: their distances from the origin, how many at each, and steps of each search.
DISTANCES, STARTS, STEPS = 10.0 ** np.arange(-2, 4.1, 0.5), 48, 80
# A search has found a point if its next step is this share of the point's distance or shorter.
CLOSE = 1e-7
# Lines along each axis and steps along them, and lines from the centre, that find points of a surface in a ball.
GRID, ALONG, RAYS = 40, 72, 2000
# How far beside a point signs are compared, as shares of its distance from the origin.
BESIDE = (1e-3, 1e-5, 1e-7)
# Lines from the origin and places on them, that find points near and far.
WIDE, FAR = 400, np.append(0.0, np.geomspace(1e-3, 1e4, 160))
# Points are the same if they are nearer to each other than this share of their distance.
SAME = 1e-4
# A singular point is isolated if the smallest eigenvalue of the Hessian is this share of the largest or more.
ISOLATED = 1e-3
# Nodes farther from the middle of a clip than this share of its radius hardly show. Nearer to each other than this
# share, they are one.
NODES_WITHIN, ONE_NODE = 0.97, 1e-3
# How far beside a node it is searched for again, as a share of the same radius.
ASIDE = 0.05
# Steps of the search for special points.
SPECIAL_STEPS = 25


@dataclass(frozen=True)
class Special:
    """Points that say where the shape of a surface is. Beyond all of them it goes on without a new feature.

    singular: isolated singular points of the surface. Shape: (N, 3).
    turning: smooth points of the surface whose distance from the centre is critical. Shape: (M, 3).
    still: points beside the surface at which the gradient of f is 0. Shape: (K, 3).
    """

    singular: np.ndarray
    turning: np.ndarray
    still: np.ndarray


def found_points(field: Field) -> tuple[np.ndarray, np.ndarray]:
    """Points of the surface near and far from the origin at which the sign changes: those where lines cross it, and
    those that Newton's method finds. Shapes: (N, 3), (M, 3)."""
    lines = directions(WIDE)
    crossed = field.all_crossings(np.zeros((WIDE, 3)), lines, np.tile(FAR, (WIDE, 1)), sure=True)
    p = (DISTANCES[:, None, None] * directions(STARTS)).reshape(-1, 3)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            p = p - _newton_step(field, p)
        left = np.linalg.norm(_newton_step(field, p), axis=1)
        near = left <= CLOSE * (np.linalg.norm(p, axis=1) + CLOSE)
        p = p[near & np.isfinite(p).all(1)]
        return crossed, p[_changes(field, p)]


def _changes(field: Field, p: np.ndarray) -> np.ndarray:
    """Whether the sign changes along the gradient at each point of the surface. Shape: (N)."""
    _, gradient = field.slope(p)
    normal = np.nan_to_num((gradient / np.linalg.norm(gradient, axis=0)).T)
    steps = [size * np.linalg.norm(p, axis=1, keepdims=True) * normal for size in BESIDE]
    return np.any([field.signs(p + step) * field.signs(p - step) < 0 for step in steps], axis=0)


def _newton_step(field: Field, p: np.ndarray) -> np.ndarray:
    """How far each point moves along the gradient in one step; nan where it cannot move. Shapes: (N, 3)."""
    value, gradient = field.slope(p)
    square = (gradient**2).sum(0)
    step = np.where(square > 0, value * gradient / np.where(square > 0, square, 1), np.nan)
    return np.where(value == 0, 0, step).T


def surface_points(field: Field, centre: np.ndarray, radius: float, grid: int = GRID) -> np.ndarray:
    """Points of the surface in a ball, spread over all of it. grid: lines along the side of a square. Shape: (N, 3)."""
    t = np.linspace(-radius, radius, ALONG * grid // GRID)
    u, v = (x.ravel() for x in np.meshgrid(*2 * [np.linspace(-radius, radius, grid)]))
    found = []
    for axis in range(3):
        o = centre + np.insert(np.stack([u, v], 1), axis, 0, axis=1)
        o = o[u * u + v * v < radius * radius]
        found.append(field.all_crossings(o, np.tile(np.eye(3)[axis], (len(o), 1)), np.tile(t, (len(o), 1))))
    rays, t = RAYS * grid * grid // GRID**2, np.linspace(0, radius, ALONG * grid // (2 * GRID))
    found.append(field.all_crossings(np.tile(centre, (rays, 1)), directions(rays), np.tile(t, (rays, 1))))
    points = np.concatenate(found)
    return points[np.linalg.norm(points - centre, axis=1) <= radius]


def special_points(field: Field, centre: np.ndarray, starts: np.ndarray) -> Special:
    """The special points to which Newton's method leads. starts: points of the surface. Shapes: (3), (N, 3)."""
    with np.errstate(all="ignore"):
        turning = turning_points(field, centre, starts)
        p, size = _still(field, starts)
        value = np.abs(field.jet(p).value)
        on = value <= 1e-9 * size * (1e-3 + np.linalg.norm(p, axis=1)) ** 2
    return Special(distinct(p[on]), distinct(turning), distinct(p[~on]))


def nodes(field: Field, centre: np.ndarray, radius: float, starts: np.ndarray) -> np.ndarray:
    """Singular points of the surface in a ball, without those on singular curves. starts: points of the surface.
    Shapes: (3), (N, 3), (M, 3)."""
    with np.errstate(all="ignore"):
        p, size = _still(field, starts, isolated=0.0)
        value = np.abs(field.jet(p).value)
        p = p[(value <= 1e-9 * size * radius**2) & (np.linalg.norm(p - centre, axis=1) < NODES_WITHIN * radius)]
        _, first = np.unique(np.round((p - centre) / (ONE_NODE * radius)), axis=0, return_index=True)
        p = p[first]
        # From beside a node, the search leads back to it; from beside a point of a curve, to another one.
        sizes, axes = np.linalg.eigh(_derivatives(field.jet(p))[1])
        flattest = axes[np.arange(len(p)), :, np.abs(sizes).argmin(1)]
        back = _descended(field, p + ASIDE * radius * flattest)
    return p[np.linalg.norm(back - p, axis=1) < 0.1 * ASIDE * radius]


def _still(field: Field, p: np.ndarray, isolated: float = ISOLATED) -> tuple[np.ndarray, np.ndarray]:
    """Isolated points at which the gradient is 0, and the size of the Hessian there. Shapes: (M, 3), (M).

    isolated: the least share of the smallest eigenvalue of the Hessian of the largest.
    """
    p = _descended(field, p)
    gradient, hessian = _derivatives(field.jet(p))
    sizes = np.sort(np.abs(np.linalg.eigvalsh(hessian)), axis=1)
    found = np.linalg.norm(gradient, axis=1) <= 0.1 * CLOSE * sizes[:, 2] * (np.linalg.norm(p, axis=1) + 1e-3)
    found &= (sizes[:, 0] >= isolated * sizes[:, 2]) & (sizes[:, 2] > 0) & np.isfinite(p).all(1)
    return p[found], sizes[found, 2]


def _descended(field: Field, p: np.ndarray) -> np.ndarray:
    """Where Newton's method for a gradient of 0 leads. Shapes: (N, 3)."""
    for _ in range(SPECIAL_STEPS):
        gradient, hessian = _derivatives(field.jet(p))
        p = p - _solved(hessian, gradient)
    return p


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions of linear equations, of singular ones roughly. Shapes: matrix (N, K, K), right (N, K)."""
    size = np.abs(matrix).max((1, 2), keepdims=True)
    tiny = np.where(size > 0, 1e-13 * size, 1) * np.eye(matrix.shape[-1])
    try:
        return np.linalg.solve(matrix + tiny, right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        return (np.linalg.pinv(matrix) @ right[..., None])[..., 0]


def _derivatives(jet: Jet) -> tuple[np.ndarray, np.ndarray]:
    """Gradients and Hessians; those of points that have gone too far are 0 and 1. Shapes: (N, 3), (N, 3, 3)."""
    gradient, hessian = jet.gradient.T.copy(), np.moveaxis(jet.hessian, 2, 0).copy()
    far = ~(np.isfinite(hessian).all((1, 2)) & np.isfinite(gradient).all(1))
    gradient[far], hessian[far] = 0, np.eye(3)
    return gradient, hessian


def turning_points(field: Field, centre: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Smooth points of the surface at which the normal runs through the centre: p - centre = m g, for the gradient g
    and a number m. Shape: (M, 3)."""
    gradient, _ = _derivatives(field.jet(p))
    m = ((p - centre) * gradient).sum(1) / (gradient**2).sum(1)
    step = np.zeros((len(p), 4))
    for _ in range(SPECIAL_STEPS):
        jet = field.jet(p)
        gradient, hessian = _derivatives(jet)
        # Newton's equations for p and for m times the length of g, so that all unknowns have one unit.
        length = np.linalg.norm(gradient, axis=1)
        length = np.where(length > 0, length, 1)
        unit, matrix = gradient / length[:, None], np.zeros((len(p), 4, 4))
        matrix[:, :3, :3] = np.eye(3) - m[:, None, None] * hessian
        matrix[:, :3, 3], matrix[:, 3, :3] = -unit, unit
        right = np.concatenate([p - centre - m[:, None] * gradient, (jet.value / length)[:, None]], axis=1)
        far = ~(np.isfinite(matrix).all((1, 2)) & np.isfinite(right).all(1))
        matrix[far], right[far] = np.eye(4), 0
        step = _solved(matrix, right)
        p, m = p - step[:, :3], m - step[:, 3] / length
    gradient, hessian = _derivatives(field.jet(p))
    reach = np.linalg.norm(p - centre, axis=1) + 1e-3
    found = np.isfinite(p).all(1) & (np.linalg.norm(step[:, :3], axis=1) < 0.1 * CLOSE * reach)
    smooth = np.linalg.norm(gradient, axis=1) > 1e-6 * np.linalg.norm(hessian, axis=(1, 2)) * reach
    return p[found & smooth]


def distinct(p: np.ndarray) -> np.ndarray:
    """The points without repetitions. Shapes: (N, 3)."""
    if not len(p):
        return p
    size = SAME * max(float(np.median(np.linalg.norm(p, axis=1))), 1e-12)
    _, first = np.unique(np.round(p / size), axis=0, return_index=True)
    return p[np.sort(first)]
