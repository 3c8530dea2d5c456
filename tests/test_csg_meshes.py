"""CSG of meshes: surfaces of several meshes, and the same solids made by manifold3d and traced as one mesh."""

import numpy as np
import solids
from csg_traced import Traced
from samples import Lineup, array

import visray as vr


def mesh_of(name: str, shift: tuple[float, float, float]) -> vr.Mesh:
    vertices, faces = solids.SOLIDS[name]
    return vr.Mesh(vertices=vertices + np.array(shift), faces=faces, normals="face")


def test_each_mesh_has_its_own_triangles() -> None:
    """Of a point on one mesh, no triangle of the other one is read, however many more the first one has."""
    apart = vr.Csg(op="union", of=[mesh_of("cube", (-2, 0, 0)), mesh_of("ball", (2, 0, 0))])
    traced = Traced(apart)
    rng = np.random.default_rng(1)
    target = rng.uniform(-0.4, 0.4, (2000, 3)) + np.where(rng.random(2000) < 0.5, -2, 2)[:, None] * np.eye(3)[0]
    o = target + 9 * solids.directions(rng, 2000) * [0.2, 1, 1]
    d = (target - o) / np.linalg.norm(target - o, axis=1, keepdims=True)
    found = traced.first(o, d)
    line = Lineup([traced.obj_alone()], 2000)
    f, g = (array(x) for x in line.kind.surface_at(line.placed(), line.a.put(line.a.W, found.p.T)))
    cube = found.p[:, 0] < 0
    assert found.hit.all() and np.array_equal(found.leaf, np.where(cube, 0, 1)) and 0.3 < cube.mean() < 0.7
    assert np.abs(f).max() < 1e-13
    outward = np.where(
        cube[:, None], found.n, (found.p - [2, 0, 0]) / np.linalg.norm(found.p - [2, 0, 0], axis=1)[:, None]
    )
    # Facets of the ball are inclined by up to half the angle of their sides.
    assert (np.abs(found.n).max(1)[cube] == 1).all() and ((found.n * outward).sum(1) > 0.95).all()
    assert ((g * found.n).sum(1) > 1 - 1e-12).mean() > 0.99
    far = array(line.kind.surface_at(line.placed(), line.a.put(line.a.W, o.T))[0])
    assert np.isinf(far).all()
