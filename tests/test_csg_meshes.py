"""CSG of meshes: surfaces of several meshes, and the same solids made by manifold3d and traced as one mesh."""

import manifold3d
import numpy as np
import pytest
import solids
from csg_traced import Traced
from samples import Lineup, array

import visray as vr
from visray.primitives import csg_form
from visray.transforms import Rotate, Scale, Translate, compose

QUARTER = Rotate(rotate=90.0, axis=(1.0, 0.0, 0.0))
TILTED = (
    Rotate(rotate=31.0, axis=(1.0, 2.0, -0.5)),
    Scale(scale=(1.2, 0.8, 1.1)),
    Translate(translate=(0.2, 0.3, 0.1)),
)
MIRRORED = (Scale(scale=(-0.7, 0.7, 0.7)), Rotate(rotate=77.0, axis=(0.3, 1.0, 0.2)))
# The name and the transform of two solids. Those below the line have faces that coincide.
PAIRS = {
    "cube and ball": (("cube", ()), ("ball", (Scale(scale=0.6), Translate(translate=(0.3, 0.2, 0.25))))),
    "balls": (("ball", ()), ("ball", TILTED)),
    "ring and ball": (("ring", TILTED), ("ball", MIRRORED)),
    "rings": (("ring", ()), ("ring", (QUARTER, Translate(translate=(0.9, 0.1, 0.2))))),
    "tetrahedron and ring": (("tetrahedron", (Scale(scale=2.0), Translate(translate=(0.2, -0.6, 0.1)))), ("ring", ())),
    # -----
    "flush cubes": (("cube", ()), ("cube", (Scale(scale=0.5), Translate(translate=(0.1, 0.25, 0.0))))),
    "abutting cubes": (("cube", ()), ("cube", (Translate(translate=(1.0, 0.0, 0.25)),))),
    "equal balls": (("ball", ()), ("ball", ())),
}  # fmt: skip
OPS = {"union": "__add__", "intersection": "__xor__", "difference": "__sub__"}


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


def moved(name: str, steps: tuple) -> manifold3d.Manifold:
    """A solid for manifold3d, in double."""
    vertices, faces = solids.SOLIDS[name]
    if steps:
        matrix = compose(steps)
        vertices = vertices @ matrix[:, :3].T + matrix[:, 3]
        faces = faces if np.linalg.det(matrix[:, :3]) > 0 else faces[:, ::-1]
    return manifold3d.Manifold(manifold3d.Mesh64(vertices.copy(), faces.astype(np.uint64)))


def distance_from_edges(o: np.ndarray, d: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The distance of each line from the nearest edge of a mesh."""
    sides = np.unique(np.sort(np.stack([faces, np.roll(faces, -1, 1)], 2).reshape(-1, 2), 1), axis=0)
    a, b = (vertices[sides[:, k]] for k in (0, 1))
    best = np.full(len(o), np.inf)
    for i in range(len(o)):
        # In the plane across the line, edges are segments, and the line is a point.
        p, q = ((x - o[i]) - ((x - o[i]) @ d[i])[:, None] * d[i] for x in (a, b))
        way = q - p
        squared = (way**2).sum(1)
        share = np.clip(-(p * way).sum(1) / np.where(squared == 0, 1, squared), 0, 1)
        best[i] = np.linalg.norm(p + share[:, None] * way, axis=1).min()
    return best


@pytest.mark.parametrize("op", OPS)
@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("count", [3_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_meshes_are_joined_as_by_manifold3d(pair: str, op: str, count: int) -> None:
    """The first hits are those of the mesh that manifold3d makes, unless a ray passes an edge within its tolerance,
    which is 1e-12 of the size (Manifold.get_tolerance)."""
    rng = np.random.default_rng(2)
    made = getattr(moved(*PAIRS[pair][0]), OPS[op])(moved(*PAIRS[pair][1]))
    given = [vr.Mesh(vertices=solids.SOLIDS[n][0], faces=solids.SOLIDS[n][1], normals="face", transform=steps)
             for n, steps in PAIRS[pair]]  # fmt: skip
    low, high = np.reshape(made.bounding_box() if not made.is_empty() else (-1,) * 3 + (1,) * 3, (2, 3))
    target = low + rng.uniform(-0.1, 1.1, (count, 3)) * (high - low)
    o = target + rng.uniform(0.1, 20, (count, 1)) * solids.directions(rng, count)
    d = (target - o) / np.linalg.norm(target - o, axis=1, keepdims=True)
    ours = Traced(vr.Csg(op=op, of=tuple(given))).first(o, d)
    if made.is_empty():
        assert not ours.hit.any()
        return
    result = made.to_mesh64()
    vertices, faces = np.array(result.vert_properties)[:, :3], np.array(result.tri_verts).astype(int)
    theirs = Traced(vr.Mesh(vertices=vertices, faces=faces, normals="face", material="m0")).first(o, d)
    both = ours.hit & theirs.hit
    cosine = np.abs((theirs.n * d).sum(1))
    tolerance = 1e-11
    apart = both.copy()
    apart[both] = np.abs(ours.t[both] - theirs.t[both]) > tolerance / cosine[both] + 1e-13 * theirs.t[both]
    odd = (ours.hit != theirs.hit) | apart
    assert (distance_from_edges(o[odd], d[odd], vertices, faces) < tolerance).all() and odd.sum() <= 1e-4 * count
    assert both.mean() > 0.1
    assert (np.abs((ours.n * theirs.n).sum(1) - 1)[both & ~odd] < 1e-6).mean() > 0.999


def bitten(count: int) -> vr.Scene:
    """A ball as a mesh, less balls: with them `count` operands."""
    bites = [
        vr.Sphere(center=tuple(x), radius=0.3) for x in 0.6 * solids.directions(np.random.default_rng(3), count - 1)
    ]
    return vr.Scene(
        camera=vr.Camera(origin=(0, 1, 4), fov=30),
        film=vr.Film(width=32, height=24),
        lights={"lamp": vr.PointLight(position=(1, 3, 3))},
        objects={"a": vr.Csg(op="difference", of=[mesh_of("ball", (0, 0, 0)), *bites])},
    )


def test_no_operand_is_without_a_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """A code has 32 bits for the operand and for its triangle, and the last one stands for none. As many operands as
    have codes are drawn as ever, and more are refused."""
    most = 15
    plain = vr.render(bitten(most), progress=False)
    monkeypatch.setattr(csg_form, "PART_BITS", 28)
    wide = vr.render(bitten(most), progress=False)
    assert np.array_equal(plain["RGB"], wide["RGB"])
    with pytest.raises(vr.UserError, match=f"have {most + 1} operands together; at most {most} fit"):
        vr.render(bitten(most + 1), progress=False)


def test_a_code_stands_for_no_triangle() -> None:
    """Each mesh has a part that is none of its triangles, even one with as many triangles as some bits can tell."""
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    four = np.concatenate([faces + 4 * k for k in range(4)])
    mesh = vr.Mesh(vertices=np.concatenate([corner + [2 * k, 0, 0] for k in range(4)]), faces=four)
    csg = vr.Csg(op="difference", of=(mesh, vr.Sphere(radius=0.5)))
    assert mesh.row_count() == 16 < 1 << csg.kind.bits
