"""From the unit square to disks, spheres, hemispheres: each against a twin; equal areas, unit lengths, safe edges."""

import drjit as dr
import numpy as np
import pytest
from samples import array
from test_sampling import SIGMA, chi_square, chi_square_limit

from visray import warp
from visray.geometry import UNIT_ROUNDOFF, gamma, tangents
from visray.quantities import Arrays

PRECISIONS = pytest.mark.parametrize("precision", ["single", "double"])
POINTS = 1_000_000
BINS = 32


def square(n: int, seed: int, count: int = 2) -> np.ndarray:
    """Random numbers as the sampler's: multiples of 2^-24, which both precisions hold exactly. Shape: (count, n)."""
    return np.random.default_rng(seed).integers(0, 2**24, (count, n)) * 2.0**-24


def corners(count: int = 2) -> np.ndarray:
    """Corners, sides, diagonals and the middle of the unit square (or cube), 1 being the number before it."""
    steps = np.array([0.0, 2.0**-24, 2.0**-17, 0.25, 0.5 - 2.0**-24, 0.5, 0.5 + 2.0**-24, 0.75, 1 - 2.0**-24])
    return np.stack(np.meshgrid(*count * [steps], indexing="ij"), -1).reshape(-1, count).T


def normals(n: int) -> np.ndarray:
    """Unit vectors all over the sphere, a third of them by an axis to 10^U(-12, 0), and the six axes. Shape: (n, 3)."""
    rng = np.random.default_rng(n)
    v = rng.normal(size=(n, 3))
    near = rng.random(n) < 1 / 3
    v[near] *= np.where(np.arange(3) == rng.integers(0, 3, near.sum())[:, None], 1, 10 ** rng.uniform(-12, 0))
    v[:6] = np.vstack([np.eye(3), -np.eye(3)])
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def put(a: Arrays, values: np.ndarray) -> tuple:
    return tuple(a.put(a.F, v) for v in values)


def concentric(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shirley and Chiu's map in polar form: squares of half side r to circles of radius r, their sides to quarters."""
    x, y = 2 * u - 1, 2 * v - 1
    r = np.maximum(np.abs(x), np.abs(y))
    right, left = (x >= np.abs(y)) & (x > 0), (-x >= np.abs(y)) & (x < 0)
    above = ~right & ~left & (y > 0)
    safe = np.where(r == 0, 1, r)
    # An eighth of the way round for each half side: from the middle of the right, upper, left, lower side.
    quarter = np.select([right, above, left], [0, 1, 2], 3)
    along = np.select([right, above, left], [y, -x, -y], x) / safe
    turn = (quarter + 0.5 * along) * (np.pi / 2)
    return r * np.cos(turn), r * np.sin(turn)


def direct(n: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The vector (x, y, z) about each n: t nearest to +y in the plane across n, s to its right. Shape: (N, 3)."""
    up = np.array([0.0, 1.0, 0.0]) - n[:, 1:2] * n
    flat = np.linalg.norm(up, axis=1) < 1e-13
    s = np.where(flat[:, None], (1.0, 0.0, 0.0), np.cross(np.broadcast_to((0.0, 1.0, 0.0), n.shape), n))
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    return x[:, None] * s + y[:, None] * np.cross(n, s) + z[:, None] * n


# Values


@PRECISIONS
def test_disk_is_shirley_and_chius(precision: str) -> None:
    a = Arrays.of("llvm", precision)
    for points in (square(100_000, 1), corners()):
        x, y = (np.array(w, float) for w in warp.disk(*put(a, points)))
        # Square to disk: the step to -1..1 is exact, then a quotient, three products and a sine.
        for found, exact in zip((x, y), concentric(*points)):
            assert (np.abs(found - exact) <= gamma(8, precision)).all()
        assert (x * x + y * y <= 1 + gamma(10, precision)).all()


@PRECISIONS
def test_sphere_is_a_cylinder_by_archimedes(precision: str) -> None:
    """Height is linear in u, longitude in v; and its length is 1, at the poles and everywhere."""
    a = Arrays.of("llvm", precision)
    for points in (square(100_000, 2), corners()):
        p = array(warp.sphere(a.V, *put(a, points))).astype(float)
        u, v = points
        z = 1 - 2 * u
        exact = np.stack([np.sqrt(1 - z * z) * np.cos(2 * np.pi * v), np.sqrt(1 - z * z) * np.sin(2 * np.pi * v), z], 1)
        # An angle of up to 2 pi is rounded twice (the constant and the product): 4 pi roundings, and 8 of the rest.
        assert (np.abs(p - exact) <= gamma(21, precision)).all()
        assert (np.abs(np.linalg.norm(p, axis=1) - 1) <= gamma(8, precision)).all()


@PRECISIONS
def test_cosine_is_a_disk_lifted_up(precision: str) -> None:
    a = Arrays.of("llvm", precision)
    n = normals(30_000)
    points = np.hstack([square(len(n) - 81, 3), corners()])
    w = a.put(a.V, n.T)
    d, given = array(warp.cosine(w, *put(a, points))).astype(float), array(w).astype(float)
    x, y = concentric(*points)
    rest = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    exact = direct(given / np.linalg.norm(given, axis=1, keepdims=True), x, y, rest)
    # Near the rim a root of what is off by e is off by e over the root, or by the root of e.
    e = gamma(16, precision)
    lift = np.minimum(e / np.where(rest > 0, rest, e), np.sqrt(e))
    assert (np.abs(d - exact) <= (lift + gamma(24, precision))[:, None]).all()
    assert (np.abs(np.linalg.norm(d, axis=1) - 1) <= gamma(24, precision)).all()
    # Never below the surface, but for the rounding of two tangents and a normal.
    assert ((d * given).sum(1) >= -gamma(12, precision)).all()


@PRECISIONS
def test_box_is_the_originals_half_cube(precision: str) -> None:
    """norm(a v1 + b v2 + c N) with a and b from -1 to 1 and c from 0 to 1."""
    a = Arrays.of("llvm", precision)
    n = normals(30_000)
    points = np.hstack([square(len(n) - 729, 4, 3), corners(3)])
    # The middle of its floor has no direction; it has a chance of 2^-72.
    there = (points != np.array([[0.5], [0.5], [0.0]])).any(0)
    points, w = points[:, there], a.put(a.V, n[there].T)
    d, given = array(warp.box(w, *put(a, points))).astype(float), array(w).astype(float)
    u, v, up = points
    exact = direct(given / np.linalg.norm(given, axis=1, keepdims=True), 2 * u - 1, 2 * v - 1, up)
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    assert (np.abs(d - exact) <= gamma(24, precision)).all()
    assert (np.abs(np.linalg.norm(d, axis=1) - 1) <= gamma(6, precision)).all()
    assert ((d * given).sum(1) >= -gamma(12, precision)).all()


# Areas


def test_equal_areas_of_the_square_are_equal_areas_of_the_disk() -> None:
    """Share of the disk within a radius, and turn: a million random points in 32 x 32 bins."""
    a = Arrays.of("llvm", "single")
    x, y = (np.array(w, float) for w in warp.disk(*put(a, square(POINTS, 5))))
    found = np.stack([x * x + y * y, np.arctan2(y, x) / (2 * np.pi) % 1], 1)
    assert chi_square(np.minimum(found, 1), BINS) < chi_square_limit(BINS**2 - 1)


def test_equal_areas_of_the_square_are_equal_areas_of_the_sphere() -> None:
    a = Arrays.of("llvm", "single")
    p = array(warp.sphere(a.V, *put(a, square(POINTS, 6)))).astype(float)
    # About another axis than its own: all zones of equal height are equal.
    found = np.stack([0.5 + 0.5 * p[:, 0], np.arctan2(p[:, 2], p[:, 1]) / (2 * np.pi) % 1], 1)
    assert chi_square(np.clip(found, 0, 1), BINS) < chi_square_limit(BINS**2 - 1)


@pytest.mark.parametrize("n", [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.36, 0.48, -0.8)])
def test_cosine_has_the_density_of_the_cosine(n: tuple) -> None:
    """sin^2 and the turn about n are uniform, and the mean cosine is 2/3 where evenly spread it would be 1/2."""
    a = Arrays.of("llvm", "single")
    d = array(warp.cosine(a.V(*n), *put(a, square(POINTS, 7)))).astype(float)
    s, t = (array(x).astype(float)[0] for x in tangents(Arrays.of("llvm", "double").V(*n)))
    rise = d @ np.array(n)
    found = np.stack([1 - rise * rise, np.arctan2(d @ t, d @ s) / (2 * np.pi) % 1], 1)
    assert chi_square(np.clip(found, 0, 1), BINS) < chi_square_limit(BINS**2 - 1)
    # The variance of a cosine of this density: 1/2 - 4/9.
    assert abs(rise.mean() - 2 / 3) < SIGMA * np.sqrt((1 / 2 - 4 / 9) / POINTS)


def test_neighbouring_strata_stay_neighbours_on_the_disk() -> None:
    """Of k x k strata of the square of half side 1, each has a diagonal of 2 sqrt 2 / k, and nothing is stretched by
    more than pi/2: with r (cos, sin)(pi/4 s/r) and |s| <= r, the squares of both slopes add up to at most
    1 + 2 (pi/4)^2 < (pi/2)^2.
    """
    a, k = Arrays.of("llvm", "double"), 16
    steps = np.linspace(0, 1, 9)
    cells = np.stack(np.meshgrid(np.arange(k), np.arange(k), steps, steps, indexing="ij"), -1).reshape(-1, 4)
    u, v = ((cells[:, :2] + cells[:, 2:]) / k).T
    x, y = (np.array(w).reshape(k * k, -1) for w in warp.disk(a.F(u), a.F(v)))
    apart = np.hypot(x[:, :, None] - x[:, None], y[:, :, None] - y[:, None])
    assert apart.max() <= 2 * np.sqrt(2) / k * np.pi / 2


@PRECISIONS
def test_edges_of_the_square_are_safe(precision: str) -> None:
    """0 and the number before 1, and the middle, where the disk's map divides by 0: finite, in both precisions."""
    a = Arrays.of("llvm", precision)
    one = np.array([0.0, UNIT_ROUNDOFF[precision], 0.5, 1 - 2 * UNIT_ROUNDOFF[precision], 1 - UNIT_ROUNDOFF[precision]])
    u, v = (w.ravel() for w in np.meshgrid(one, one))
    points = put(a, np.stack([u, v]))
    found = [*warp.disk(*points), *warp.sphere(a.V, *points)]
    for n in ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.6, 0.0, -0.8)):
        found += [*warp.cosine(a.V(*n), *points), *warp.box(a.V(*n), *points, dr.full(a.F, 2.0**-24, len(u)))]
    for x in found:
        assert np.isfinite(np.array(x)).all() and (np.abs(np.array(x)) <= 1 + gamma(12, precision)).all()
