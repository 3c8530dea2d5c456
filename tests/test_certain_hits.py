"""Hits that single precision is certain of, in searches for occlusion and for the closest hit: the exact test of each
row gives the same result bit for bit, also where rays begin and end on rows."""

from typing import Any

import drjit as dr
import numpy as np
import pytest
from samples import geometry_of

from visray.accel import policy
from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.camera import Camera
from visray.primitives import Box, Rectangle, Sphere, Triangle
from visray.quantities import Arrays
from visray.ray import NO_ROW, Ray
from visray.scene.scene import Scene
from visray.transforms import Scale

A = Arrays.of("llvm", "single")
RAYS = 8000


def scene(rng: np.random.Generator, kinds: str) -> Scene:
    """Spheres, triangles, and ellipsoids and boxes, which have no test in single; those that `kinds` names."""
    objects: dict[str, Any] = {}
    point = lambda: tuple(rng.uniform(-1, 1, 3).tolist())  # noqa: E731
    for i in range(60):
        if "s" in kinds:
            objects[f"s{i}"] = Sphere(center=point(), radius=float(10 ** rng.uniform(-2, -0.3)))
        if "t" in kinds:
            a = np.array(point())
            b, c = (tuple((a + rng.normal(size=3) * 10 ** rng.uniform(-2, 0)).tolist()) for _ in range(2))
            objects[f"t{i}"] = Triangle(a=tuple(a.tolist()), b=b, c=c)
        if "o" in kinds:
            objects[f"e{i}"] = Sphere(center=point(), radius=0.1, transform=(Scale(scale=(1.0, 2.0, 0.5)),))
            objects[f"b{i}"] = Box(min=(low := point()), max=tuple(x + 0.2 for x in low))
    # Sheets in one plane: hits at equal distances.
    for i in range(3):
        objects[f"r{i}"] = Rectangle(center=(0.1 * i, 0.0, 0.0), width=(0.7, 0.0, 0.0), height=(0.0, 0.7, 0.0))
    return Scene(objects=objects, camera=Camera(), lights={})


def put(kind: Any, values: np.ndarray) -> Any:
    return A.put(kind, np.ascontiguousarray(values))


@pytest.mark.parametrize(
    "kinds", ["t", pytest.param("s", marks=pytest.mark.slow), pytest.param("sto", marks=pytest.mark.slow)]
)
def test_rays_between_surface_points(kinds: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rationale: a certain hit must count by the rules of the exact test. Setup: shadow rays that leave surface points
    of the scene, with and without saying so, and end on others, a few roundings in front of them or behind them, again
    with and without saying so; and rays for closest hits from the same points, with the clearance of surface points.
    Expected: the result of the tests of all rows."""
    monkeypatch.setattr(policy, "MAX_UNROLLED", 0)
    rng = np.random.default_rng(1)
    g = geometry_of(scene(rng, kinds))
    p, row, inside = surface_points(rng, g)
    order = rng.permutation(RAYS)
    q, other = p[:, order], row[order]
    d = q - p
    length = np.linalg.norm(d, axis=0)
    d = np.where(length > 0, d / np.where(length > 0, length, 1), np.array([[1.0], [0], [0]]))
    length = length * (1 + rng.choice([0, 1e-16, -1e-16, 1e-12, -1e-12, 1e-7, -1e-7, 1e-3, 0.5], RAYS))
    known, named = rng.random((2, RAYS)) < 0.7
    inward = rng.random(RAYS) < 0.3
    o, d, none = put(A.W, p), put(A.W, d), np.uint32(NO_ROW)
    ray = Ray(o, d, row=put(A.U, np.where(known, row, none)), inside=put(A.B, inside),
              clearance=put(A.D, np.where(known, 1e-15, 0) * 10 ** rng.uniform(0, 8, RAYS)))  # fmt: skip
    error, active = put(A.D, 1e-15 * 10 ** rng.uniform(0, 8, RAYS)), A.B(True)
    origin = RayOrigin(g, o)
    assert origin.plan.tree
    targets = {
        "named": Target(put(A.D, length), error, put(A.U, np.where(named, other, none)), put(A.B, inward)),
        "touching": Target(put(A.D, length), error, may_touch=True),
        "endless": Target(dr.full(A.D, dr.inf, RAYS), dr.zeros(A.D, RAYS)),
    }
    for target in targets.values():
        hidden, plain = (np.array(occluded(origin, ray, target, active, way)) for way in (False, True))
        assert np.array_equal(hidden, plain) and 0.05 < plain.mean() < 0.999
    fast, plain = (closest(origin, ray, way) for way in (False, True))
    assert np.array_equal(np.array(fast.t), np.array(plain.t)) and np.array_equal(
        np.array(fast.row), np.array(plain.row)
    )
    assert np.isfinite(np.array(plain.t)).mean() > 0.3


def surface_points(rng: np.random.Generator, g: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(points on surfaces of the scene, their rows, whether rays run inwards from there). Shape: (3, RAYS)."""
    points, rows, n = np.empty((3, 0)), np.empty(0, np.uint32), 4 * RAYS
    while len(rows) < RAYS:
        o, d = 3 * rng.normal(size=(3, n)), rng.normal(size=(3, n))
        d = rng.uniform(-1, 1, (3, n)) - o
        d /= np.linalg.norm(d, axis=0)
        hit = closest(RayOrigin(g, put(A.W, o)), Ray(put(A.W, o), put(A.W, d)), True)
        t = np.array(hit.t)
        met = np.isfinite(t)
        points = np.concatenate([points, (o + t * d)[:, met]], axis=1)
        rows = np.concatenate([rows, np.array(hit.row)[met]])
    return points[:, :RAYS], rows[:RAYS], rng.random(RAYS) < 0.3
