"""Tests of rows in single precision against exact geometry: what they exclude is no hit, what is certain is one."""

from typing import Any

import numpy as np
import pytest

import visray as vr
from visray.accel.blocks import BALL, KIND, ROD, ROW, SLOPE, TRIANGLE, TreeRows, packed, triangle_planes
from visray.accel.bvh import build
from visray.accel.bvh_rows import WIDEST, tree_rows
from visray.accel.row_tests import Verdict, test_ball, test_rod, test_triangle
from visray.accel.tree_rays import TreeRays
from visray.primitives import KINDS
from visray.pytree import rows
from visray.quantities import Arrays
from visray.setup import prepare

A = Arrays.of("llvm", "single")
N = 200_000
REAL = np.longdouble
test_ball.__test__ = test_rod.__test__ = test_triangle.__test__ = False  # pytest takes their names for those of tests


def directions(rng: np.random.Generator, n: int) -> np.ndarray:
    d = rng.normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def verdict(
    rows: TreeRows, o: np.ndarray, target: np.ndarray, test: Any, limit: np.ndarray | None = None
) -> tuple[Verdict, np.ndarray, np.ndarray]:
    """(what the test says of row i and ray i, the unit directions, the distances from o to the start of the walk).

    The rays run from o to `target`. limit: distances from o at which the search ends; None: inf.
    """
    d = target - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    tree = build(A, {0: rows})
    centre = np.array(tree.centre)[:, 0]
    rays = TreeRays.along(A, tree, A.put(A.W, o.T), A.put(A.W, d.T))
    limit = A.D(np.inf) if limit is None else A.put(A.D, limit)
    blocks = np.zeros((len(o), 16), np.float32)
    if rows.corners is not None:
        blocks[:, :12], blocks[:, SLOPE] = triangle_planes(rows.corners, centre)
    elif rows.rods is not None:
        blocks[:, :3], blocks[:, 3:7] = rows.rods[:, :3] - centre, rows.rods[:, 3:]
    else:
        blocks[:, :3], blocks[:, 3] = rows.balls[:, :3] - centre, rows.balls[:, 3]
    found = test(A, rays.single, [A.put(A.F32, x) for x in blocks.T], rays.at_most(limit))
    values = [np.broadcast_to(np.array(x), len(o)) for x in vars(found).values()]
    return Verdict(*values), d, np.broadcast_to(np.array(rays.skipped), len(o)).astype(REAL)


def triangles(rng: np.random.Generator, n: int) -> np.ndarray:
    """Triangles of all sizes and shapes, slivers too, in a space of a few units. Shape: (n, 3, 3)."""
    size = 10 ** rng.uniform(-5, 0.5, (n, 1))
    a = rng.uniform(-2, 2, (n, 3))
    ab, aside = directions(rng, n) * size, directions(rng, n) * size * 10 ** rng.uniform(-7, 0, (n, 1))
    return np.stack([a, a + ab, a + ab * rng.uniform(-1, 2, (n, 1)) + aside], axis=1)


def edge_targets(rng: np.random.Generator, corners: np.ndarray) -> np.ndarray:
    """Points in the triangles, on their edges and next to these, at corners, and beside the triangles."""
    n = len(corners)
    weights = rng.dirichlet((1, 1, 1), n)
    edge = rng.random(n) < 0.5
    weights[edge, 0] = rng.choice([0, 1e-9, -1e-9, 1e-7, -1e-7, 1e-5, -1e-5, -0.5], edge.sum())
    corner = rng.random(n) < 0.1
    weights[corner] = np.eye(3)[rng.integers(0, 3, corner.sum())]
    weights /= weights.sum(axis=1, keepdims=True)
    return np.einsum("nk,nki->ni", weights, corners)


def origins(rng: np.random.Generator, corners: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Origins near and far; a third of them almost in the plane of their triangle."""
    n = len(target)
    away = directions(rng, n)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    flat = rng.random(n) < 0.33
    height = np.einsum("ni,ni->n", away, normal)
    away[flat] -= (height * (1 - 10 ** rng.uniform(-9, 0, n)))[flat, None] * normal[flat]
    return target + away * 10 ** rng.uniform(-4, 3, (n, 1))


def exact_triangle(corners: np.ndarray, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, ...]:
    """(distance of the plane, least weight of a corner, |n . d|) in 80 bits."""
    a, b, c, o, d = (x.astype(REAL) for x in (*corners.swapaxes(0, 1), o, d))
    dot = lambda x, y: (x * y).sum(axis=1)  # noqa: E731
    n = np.cross(b - a, c - a)
    t = dot(n, a - o) / dot(n, d)
    p, squared = o + t[:, None] * d, dot(n, n)
    weights = [dot(np.cross(y - x, p - x), n) / squared for x, y in ((b, c), (c, a), (a, b))]
    return t, np.min(weights, axis=0), np.abs(dot(n, d)) / np.sqrt(squared)


@pytest.mark.parametrize("shift", [0.0, 1e3, 1e6])
def test_triangles(shift: float) -> None:
    """Rays into triangles, at edges and corners and past them, some almost in the plane, also far from zero."""
    rng = np.random.default_rng(1)
    corners = triangles(rng, N) + shift
    target = edge_targets(rng, corners)
    o = origins(rng, corners, target)
    rows = TreeRows(0, corners.min(axis=1), corners.max(axis=1), corners=corners)
    found, d, skipped = verdict(rows, o, target, test_triangle)
    t, weight, cosine = exact_triangle(corners, o, d)
    t -= skipped
    hits = (weight >= 0) & (t >= 0) & np.isfinite(t)
    assert hits.mean() > 0.3 and found.may_hit[hits].all()
    sure = found.surely_hits
    assert (weight[sure] > 0).all() and (found.low[sure] <= t[sure]).all() and (t[sure] <= found.high[sure]).all()
    assert (found.slope[sure] <= cosine[sure]).all() and (found.last[sure] >= t[sure]).all()
    # Hits that are not nearly along a triangle are certain, if the triangle is not too small for its place.
    size = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    height = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / size
    clear = (weight > 0.1) & (cosine > 0.1) & (height > 0.01) & (t > 0.1)
    assert clear.sum() > 1000 and sure[clear].mean() > 0.99
    assert found.may_hit[(weight < -0.1) & (cosine > 0.1) & (height > 0.01)].mean() < 0.01


@pytest.mark.parametrize("shift", [0.0, 1e3, 1e6])
def test_balls(shift: float) -> None:
    """Rays into balls, past them, and along tangents to within 1e-9 of the radius."""
    rng = np.random.default_rng(2)
    radius = 10 ** rng.uniform(-5, 0.5, N)
    centre = rng.uniform(-2, 2, (N, 3)) + shift
    away, aside = directions(rng, N), directions(rng, N)
    aside -= np.einsum("ni,ni->n", aside, away)[:, None] * away
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    near = rng.random(N) < 0.5
    reach = np.where(near, 1 + rng.choice([-1, 1], N) * 10 ** rng.uniform(-9, -1, N), rng.uniform(0, 1.5, N))
    target = centre + aside * (reach * radius)[:, None]
    o = target + away * 10 ** rng.uniform(-4, 3, (N, 1))
    box = radius[:, None]
    rows = TreeRows(0, centre - box, centre + box, balls=np.concatenate([centre, box], axis=1))
    found, d, skipped = verdict(rows, o, target, test_ball)
    l, d = centre.astype(REAL) - o.astype(REAL), d.astype(REAL)
    d /= np.sqrt((d * d).sum(axis=1, keepdims=True))
    m = (l * d).sum(axis=1)
    q = l - m[:, None] * d
    square = radius.astype(REAL) ** 2 - (q * q).sum(axis=1)
    half = np.sqrt(np.maximum(square, 0))
    first, last = m - half - skipped, m + half - skipped
    hits = (square >= 0) & (last >= 0)
    assert hits.mean() > 0.3 and found.may_hit[hits].all()
    sure = found.surely_hits
    assert (
        (square[sure] > 0).all() and (found.low[sure] <= first[sure]).all() and (first[sure] <= found.high[sure]).all()
    )
    assert (last[sure] <= found.last[sure]).all() and (found.slope[sure] <= half[sure] / radius[sure]).all()
    clear = (radius > 1e-2) & (square > 0.1 * radius**2)
    assert clear.sum() > 1000 and sure[clear].mean() > 0.99
    assert found.may_hit[(radius > 1e-2) & (square < -0.1 * radius**2)].mean() < 0.001


@pytest.mark.parametrize("shift", [0.0, 1e3, 1e6])
def test_rods(shift: float) -> None:
    """Rays across rods and along them, at their outline to within 1e-9 of the radius, with ends near the crossings."""
    rng = np.random.default_rng(3)
    radius, half = 10 ** rng.uniform(-5, 0, N), 10 ** rng.uniform(-4, 0.3, N)
    middle, axis = rng.uniform(-2, 2, (N, 3)) + shift, directions(rng, N)
    aside = np.cross(axis, directions(rng, N))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    away = directions(rng, N)
    along = rng.random(N) < 0.33
    away[along] = axis[along] + away[along] * 10 ** rng.uniform(-9, 0, (along.sum(), 1))
    near = rng.random(N) < 0.5
    reach = np.where(near, 1 + rng.choice([-1, 1], N) * 10 ** rng.uniform(-9, -1, N), rng.uniform(0, 1.5, N))
    foot = middle + axis * (half * rng.uniform(-1, 1, N))[:, None]
    target = foot + aside * (reach * radius)[:, None]
    o = target + away * 10 ** rng.uniform(-4, 3, (N, 1))
    box = half[:, None] * np.abs(axis) + radius[:, None]
    rods = np.concatenate([middle, radius[:, None], axis], axis=1)
    first, last = exact_rod(middle, axis, half, radius, o, target)
    at = np.where(np.isfinite(first), np.maximum(first, 0), 1.0)
    later = at * (1 + rng.choice([0, 1, -1], N) * 10 ** rng.uniform(-12, 0, N))
    limit = np.where(rng.random(N) < 0.3, np.inf, later).astype(float)
    found, _, _ = verdict(TreeRows(0, middle - box, middle + box, rods=rods), o, target, test_rod, limit)
    hits = (first <= last) & (last >= 0) & (first <= limit)
    assert hits.mean() > 0.2 and found.may_hit[hits].all() and not found.surely_hits.any()
    # Rays that clearly pass a rod, and rods that are clearly behind the end, are excluded.
    d = target - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    n = np.cross(d, axis)
    sine = np.linalg.norm(n, axis=1)
    distance = np.abs(((middle - o) * n).sum(1)) / sine
    clear = (shift < 1e6) & (sine > 0.1) & (radius > 1e-2) & (distance > 1.1 * radius)
    assert shift == 1e6 or (clear.sum() > 1000 and found.may_hit[clear].mean() < 0.001)
    # The infinite cylinder begins farther away than the end.
    begins = ((middle - o) * np.cross(axis, n)).sum(1) / sine**2 - radius / sine
    behind = (shift < 1e6) & (sine > 0.1) & (begins > limit + 0.1) & np.isfinite(limit)
    assert shift == 1e6 or (behind.sum() > 1000 and found.may_hit[behind].mean() < 0.001)


def exact_rod(
    middle: np.ndarray, axis: np.ndarray, half: np.ndarray, radius: np.ndarray, o: np.ndarray, target: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distances at which rays enter and leave cylinders with flat ends, in 80 bits; inf and -inf if they miss."""
    l, d, axis = (x.astype(REAL) for x in (middle - o.astype(REAL), target - o, axis))
    d, axis = (x / np.sqrt((x * x).sum(axis=1, keepdims=True)) for x in (d, axis))
    dot = lambda x, y: (x * y).sum(axis=1)  # noqa: E731
    across, from_axis = d - axis * dot(d, axis)[:, None], -l + axis * dot(l, axis)[:, None]
    with np.errstate(all="ignore"):
        squared = dot(across, across)
        nearest = -dot(from_axis, across) / squared
        q = from_axis + nearest[:, None] * across
        chord = np.sqrt((radius.astype(REAL) ** 2 - dot(q, q)) / squared)
        ends = np.stack([(dot(l, axis) + sign * half) / dot(d, axis) for sign in (-1, 1)])
        first, last = np.maximum(nearest - chord, ends.min(0)), np.minimum(nearest + chord, ends.max(0))
    missed = ~(first <= last)
    return np.where(missed, np.inf, first), np.where(missed, -np.inf, last)


@pytest.mark.parametrize("kind", [k for k in KINDS if k.girth is not None])
def test_rods_contain_their_rows(kind: type) -> None:
    """Points of the surface are within the radius of the axis, also after a transform that shears, but for rounding."""
    shear = vr.Matrix(matrix=((1.0, 0.7, 0.0, 0.3), (0.0, 0.5, 0.2, -1.0), (0.1, 0.0, 2.0, 0.5)))
    flat = vr.Matrix(matrix=((1.0, 1.0, 0.0, 0.0), (1.0, 1.001, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)))
    for transform in ((), (shear,), (flat,)):
        scene = vr.Scene(objects={"it": kind(transform=transform)}, camera=vr.Camera(), lights={})
        batch = prepare(scene).kernel.batches[0]
        rod = tree_rows(batch).rods[0]
        a, rng = prepare(scene).a, np.random.default_rng(4)
        assert (rod[3] == WIDEST) == (transform == (flat,))
        low, high = (np.array(x, float)[:, 0] for x in (batch.low, batch.high))
        p = a.put(a.W, rng.uniform(low, high, (20_000, 3)).T)
        inside = np.array(batch.kind.inside(rows(batch.placed, a.U(0)), p))
        points = np.array(p).T[inside] - rod[:3]
        away = np.linalg.norm(np.cross(points, rod[4:]), axis=1)
        assert (away <= rod[3] * (1 + 1e-12)).all() and (inside.sum() > 50 or transform == (flat,))
        if not transform:
            assert away.max() > 0.9 * rod[3]


def test_triangles_that_are_lines_are_left_to_the_exact_test() -> None:
    corners = np.array(
        [[[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 1, 1]] * 3, [[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0]]], float
    )
    planes, slope = triangle_planes(corners, np.zeros(3))
    assert not planes.any() and not slope.any()
    rows = TreeRows(0, corners.min(axis=1), corners.max(axis=1), corners=corners)
    found, _, _ = verdict(rows, np.full((3, 3), 5.0), np.zeros((3, 3)), test_triangle)
    assert found.may_hit.all() and not found.surely_hits.any()


def test_blocks_of_rows() -> None:
    """A row that is a triangle or a ball, or lies in a rod, says so; others are tested in double only."""
    low, high = np.zeros((1, 3)), np.ones((1, 3))
    corners, balls, rods = np.eye(3)[None], np.array([[0.5, 0.5, 0.5, 0.5]]), np.ones((1, 7))
    for kind, data in ((ROW, {}), (TRIANGLE, {"corners": corners}), (BALL, {"balls": balls}), (ROD, {"rods": rods})):
        words = packed(None, [TreeRows(7, low, high, **data)], np.zeros(3)).view(np.uint32)
        assert words[0, KIND] == kind and words[0, 12] == 7


def test_thin_bars_in_a_tree_give_the_bits_of_brute_force() -> None:
    """Bars, cones and capsules at all angles, some of which cross, and soft shadows between them."""
    rng = np.random.default_rng(5)
    feet, axes = rng.uniform(-1, 1, (120, 3)), directions(rng, 120)
    objects: dict = {"floor": vr.Sphere(center=(0, -101, 0), radius=100)}
    for i, (p, n) in enumerate(zip(feet, axes)):
        width, p, n = float(10 ** rng.uniform(-3, -1)), tuple(p.tolist()), tuple(n.tolist())
        objects[f"{i}"] = (
            vr.Cylinder(center=p, axis=n, radius=width, height=1.0),
            vr.Cone(base=p, axis=n, radius=width, height=1.0),
            vr.Capsule(a=p, b=tuple(np.add(p, n).tolist()), radius=width),
        )[i % 3]
    lights = {"lamp": vr.RectangleLight(position=(2, 4, 3), samples=3)}
    camera, film = vr.Camera(origin=(0, 1, 4)), vr.Film(width=60, height=40)
    scene = vr.Scene(camera=camera, film=film, lights=lights, objects=objects)
    a, b = (
        vr.render(vr.replaced(scene, "settings.accelerator", name), spp=2, progress=False)["RGB"]
        for name in ("tree", "none")
    )
    assert np.array_equal(a, b) and len(np.unique(a)) > 1000
