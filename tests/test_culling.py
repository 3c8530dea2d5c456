"""Guards in single precision never reject what meets an object: brute force over decades, in double."""

import drjit as dr
import numpy as np
import pytest
from samples import geometry_of

from visray.accel.culling import DirectionCone, ball_guard, plane_guard
from visray.camera import Camera
from visray.primitives import Plane
from visray.quantities import Arrays
from visray.scene.scene import Scene

A = Arrays.of("llvm", "single")
N = 200_000


def triples(v: np.ndarray) -> object:
    return A.put(A.W, v.T)


def units(rng: np.random.Generator, n: int) -> np.ndarray:
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def in_ball(rng: np.random.Generator, n: int) -> np.ndarray:
    return units(rng, n) * rng.uniform(0, 1, (n, 1)) ** (1 / 3)


@pytest.fixture(params=range(4))
def cones(request: pytest.FixtureRequest) -> tuple:
    """Origins, lights as spheres (middle from the origin, radius) and a direction to a point of each: from narrow cones
    to ones that hold all directions."""
    rng = np.random.default_rng(request.param)
    o = rng.normal(size=(N, 3)) * 10 ** rng.uniform(-3, 4, (N, 1))
    far = 10 ** rng.uniform(-3, 3, (N, 1))
    way = units(rng, N) * far
    radius = far * 10 ** rng.uniform(-4, 0.3, (N, 1))
    d = way + radius * in_ball(rng, N)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return rng, o, way, radius[:, 0], d


def test_a_sphere_that_a_ray_meets_is_near_its_cone_and_a_candidate(cones: tuple) -> None:
    """Spheres that touch the ray from outside by as little as 1e-9 of their radius, before the origin and around it."""
    rng, o, way, radius, d = cones
    t = 10 ** rng.uniform(-4, 4, N)
    r = t * 10 ** rng.uniform(-4, 0.5, N)
    aside = np.cross(d, units(rng, N))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    off = np.where(rng.random(N) < 0.5, 1 - 10 ** rng.uniform(-9, -1, N), rng.random(N))
    # Some share of 2^-50 of the numbers' size is lost when the centre is written down: the sphere is grown by it.
    centre = o + t[:, None] * d + (off * r)[:, None] * aside
    r = r + 8 * np.finfo(float).eps * (np.abs(centre).sum(1) + np.abs(o).sum(1))
    g = ball_guard(A, triples(centre), A.D(r), triples(o))
    assert np.array(g.may_hit(A.V32(triples(d)))).all()
    near = np.array(g.may_hit_cone(DirectionCone.around(A, triples(way), A.D(radius))))
    assert near.all()


def test_cones_reject_most_spheres_that_they_miss(cones: tuple) -> None:
    """A guard that rejects nothing would pass the test above."""
    rng, o, way, radius, _ = cones
    far = np.linalg.norm(way, axis=1)
    centre = o + units(rng, N) * (4 * far)[:, None]
    g = ball_guard(A, triples(centre), A.D(0.01 * far), triples(o))
    narrow = radius < 0.1 * far
    near = np.array(g.may_hit_cone(DirectionCone.around(A, triples(way), A.D(radius))))
    assert near[narrow].mean() < 0.05


def test_a_plane_that_a_ray_meets_is_near_its_cone_and_a_candidate(cones: tuple) -> None:
    rng, o, way, radius, d = cones
    o, way, radius, d = o[:200], way[:200], radius[:200], d[:200]
    t = 10 ** rng.uniform(-3, 3, 200)
    for i in range(200):
        # From steep to all but along the ray.
        n = np.cross(d[i], rng.normal(size=3))
        n = n / np.linalg.norm(n) + 10 ** rng.uniform(-6, 1) * d[i]
        scene = Scene(
            objects={"p": Plane(point=tuple((o[i] + t[i] * d[i]).tolist()), normal=tuple(n.tolist()))},
            camera=Camera(),
            lights={},
        )
        g = plane_guard(A, geometry_of(scene).batches[0], triples(o[i : i + 1]))
        cone = DirectionCone.around(A, triples(way[i : i + 1]), A.D(float(radius[i])))
        dr.eval(g, cone)
        assert np.array(g.may_hit(A.V32(triples(d[i : i + 1])))).all()
        assert np.array(g.may_hit_cone(cone)).all()
