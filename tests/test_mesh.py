"""Meshes as kernels see them: no ray slips between triangles, distances against exact arithmetic, and every way to find
triangles gives the same bits."""

from dataclasses import dataclass, replace
from fractions import Fraction

import drjit as dr
import numpy as np
import pytest
import trimesh
from samples import NAMES, SAMPLES, Lineup, geometry_of

import visray as vr
from visray.accel.intersect import Target, closest, occluded
from visray.accel.origin import RayOrigin
from visray.geometry import gamma
from visray.quantities import Arrays
from visray.ray import NO_ROW, Ray

A = Arrays.of("llvm", "single")
FAR = 1e6 * np.array([1.0, 0.3, -0.7])


def triples(v: np.ndarray) -> object:
    return A.put(A.W, np.atleast_2d(v).T)


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


# Closed meshes


def cube() -> trimesh.Trimesh:
    return trimesh.creation.box((1.0, 1.2, 0.9))


def ball() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=3)


RINGS, AROUND, TUBE = 240, 7, 0.3


def middle_of_tube(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of the trefoil knot on a torus, and two directions across it. Shapes: (n, 3) each."""
    p, q = 2 * s, 3 * s
    out = np.stack([np.cos(p), np.sin(p), 0 * s], 1)
    up = np.array([0.0, 0, 1])
    normal = np.cos(q)[:, None] * out + np.sin(q)[:, None] * up
    middle = (2 + np.cos(q))[:, None] * out + np.sin(q)[:, None] * up
    along = np.stack([-np.sin(p), np.cos(p), 0 * s], 1) * (2 * (2 + np.cos(q)))[:, None]
    along += (-np.sin(q)[:, None] * out + np.cos(q)[:, None] * up) * 3
    return middle, normal, unit(np.cross(along, normal))


def knot() -> trimesh.Trimesh:
    """A trefoil knot, a tube whose rings are 0.08 or 1e-6 apart: half of its triangles are slivers."""
    steps = np.where(np.arange(RINGS) % 2, 1e-6, 1.0)
    s = 2 * np.pi * np.cumsum(steps) / steps.sum()
    middle, x, y = middle_of_tube(s)
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    p = middle[:, None] + TUBE * (np.cos(turn)[:, None] * x[:, None] + np.sin(turn)[:, None] * y[:, None])
    i, k = np.divmod(np.arange(RINGS * AROUND), AROUND)
    place = lambda i, k: (i % RINGS) * AROUND + k % AROUND  # noqa: E731
    a, b, c, d = place(i, k), place(i + 1, k), place(i + 1, k + 1), place(i, k + 1)
    return trimesh.Trimesh(p.reshape(-1, 3), np.concatenate([np.c_[a, c, b], np.c_[a, d, c]]), process=False)


def inside_of(name: str, rng: np.random.Generator, n: int) -> np.ndarray:
    """Points inside of a closed mesh."""
    if name == "knot":
        return middle_of_tube(rng.uniform(0, 2 * np.pi, n))[0]
    return 0.3 * rng.uniform(-1, 1, (n, 3))


CLOSED = {"cube": cube, "ball": ball, "knot": knot}


@dataclass(frozen=True)
class Closed:
    """A closed mesh, and what is known of the surface around its edges and vertices.

    vertices, faces: of the mesh. Shapes: (V, 3), (F, 3)
    edges: pairs of vertices. Shape: (E, 2)
    around: unit normals of the faces at each edge, and at each vertex; the last one again where there are fewer.
        Shapes: (E, 2, 3), (V, k, 3)
    """

    vertices: np.ndarray
    faces: np.ndarray
    edges: np.ndarray
    around: dict[str, np.ndarray]

    @staticmethod
    def of(name: str, offset: np.ndarray) -> "Closed":
        mesh = CLOSED[name]()
        v, f = mesh.vertices + offset, np.array(mesh.faces)
        n = unit(np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]]))
        sides = np.sort(f[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, edge_of, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
        assert (count == 2).all()
        at_edges = np.argsort(edge_of.ravel(), kind="stable").reshape(-1, 2) // 3
        order, count = np.argsort(f.ravel(), kind="stable") // 3, np.bincount(f.ravel())
        place = np.minimum(np.arange(count.max()), count[:, None] - 1)
        at_vertices = order[np.cumsum(count)[:, None] - count[:, None] + place]
        return Closed(v, f, edges, {"edges": n[at_edges], "vertices": n[at_vertices]})

    def targets(self, what: str, rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Points on edges or at vertices, and the normals of the faces around them. Shapes: (n, 3), (n, k, 3)."""
        i = rng.integers(len(self.around[what]), size=n)
        if what == "vertices":
            return self.vertices[i], self.around[what][i]
        w = rng.choice([0.5, *rng.uniform(size=9)], size=(n, 1))
        a, b = self.edges[i].T
        return self.vertices[a] * (1 - w) + self.vertices[b] * w, self.around[what][i]

    def scene(self) -> vr.Scene:
        return vr.Scene(
            objects={"m": vr.Mesh(vertices=self.vertices, faces=self.faces, normals="face")},
            camera=vr.Camera(),
            lights={},
        )


def first_hits(geometry: object, o: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Distances of the first hits."""
    o = triples(o)
    return np.array(closest(RayOrigin(geometry, o), Ray(o, triples(d))).t)


def slipped(name: str, offset: np.ndarray, rays: int, seed: int) -> int:
    """Asserts that no ray at an edge or a vertex slips through a mesh; returns the number of rays that would have.

    From inside, every ray must hit. From outside, a ray at a point around which all faces are turned towards it, or all
    away from it, must hit there or before. To that point it is known to within 16 roundings of the coordinates, divided
    by the least cosine between the ray and a normal.
    """
    rng, mesh, tried = np.random.default_rng(seed), Closed.of(name, offset), 0
    geometry, size = geometry_of(mesh.scene()), np.ptp(mesh.vertices, axis=0).max()
    for what in ("edges", "vertices"):
        for starts in (1, rays):
            goal, normals = mesh.targets(what, rng, rays)
            o = offset + inside_of(name, rng, starts)
            assert np.isfinite(first_hits(geometry, o, unit(goal - o))).all(), (name, what, "inside")
            way = unit(rng.normal(size=(starts, 3)))
            o = (goal if starts > 1 else offset) + size * 10 ** rng.uniform(0, 2, (starts, 1)) * way
            length = np.linalg.norm(goal - o, axis=1)
            d = (goal - o) / length[:, None]
            cosines = np.einsum("ij,ikj->ik", d, normals)
            sheet = (cosines > 0.05).all(1) | (cosines < -0.05).all(1)
            slack = gamma(16) * (np.abs(goal).sum(1) + np.abs(o).sum(1)) / 0.05
            t = first_hits(geometry, o, d)
            assert (t <= length + slack)[sheet].all(), (name, what, "outside")
            tried += len(goal) + int(sheet.sum())
    return tried


@pytest.mark.parametrize("offset", [np.zeros(3), FAR], ids=["near", "far"])
@pytest.mark.parametrize("name", CLOSED)
def test_no_ray_slips_between_triangles(name: str, offset: np.ndarray) -> None:
    """Together 200,000 rays at edges and vertices: one origin and many, lists and trees, outside and inside."""
    assert slipped(name, offset, 5_000, 1) > 25_000


@pytest.mark.nightly
@pytest.mark.parametrize("offset", [np.zeros(3), FAR], ids=["near", "far"])
@pytest.mark.parametrize("name", CLOSED)
def test_none_of_ten_million_rays_slips_between_triangles(name: str, offset: np.ndarray) -> None:
    assert sum(slipped(name, offset, 250_000, seed) for seed in (2, 3)) > 10_000_000 / 6


# Distances


def exact_distance(o: np.ndarray, d: np.ndarray, corners: np.ndarray) -> Fraction:
    """Distance to the plane of a triangle, in rational arithmetic."""
    o, d, *abc = ([Fraction(float(x)) for x in v] for v in (o, d, *corners))
    a, x, y = abc[0], *([q - p for p, q in zip(abc[0], v)] for v in abc[1:])
    n = [x[i] * y[j] - x[j] * y[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return sum((p - q) * r for p, q, r in zip(a, o, n)) / sum(p * q for p, q in zip(d, n))


def random_corners(rng: np.random.Generator, n: int, thin: float) -> np.ndarray:
    """Triangles of sizes 1e-2 to 1e2. thin: least ratio of width to length; it is even over the decades from there to
    1. Shape: (n, 3, 3)."""
    a, b = rng.normal(size=(2, n, 3))
    aside = unit(np.cross(b - a, rng.normal(size=(n, 3)))) * np.linalg.norm(b - a, axis=1, keepdims=True)
    c = a + (b - a) * rng.uniform(-0.2, 1.2, (n, 1)) + aside * thin ** rng.uniform(0, 1, (n, 1))
    size = 10 ** rng.uniform(-2, 2, (n, 1, 1))
    return size * rng.permuted(np.stack([a, b, c], 1), axis=0)[rng.permutation(n)]


@pytest.mark.parametrize("thin", [0.1, 1e-6], ids=["triangles", "slivers"])
@pytest.mark.parametrize("away", [0.0, 1e6], ids=["near", "far"])
def test_distances_are_those_of_exact_arithmetic(thin: float, away: float) -> None:
    """3,000 triangles, each with a ray from up to 1,000 sizes away.

    t is off by the roundings of the corners relative to the origin, over the cosine at which the ray meets the plane,
    and by a few roundings of t itself. But it never leaves the range of the corners' distances.
    """
    rng, n = np.random.default_rng(5), 3_000
    corners = random_corners(rng, n, thin) + away * rng.normal(size=3)
    w = rng.dirichlet((1, 1, 1), n)
    target = np.einsum("ij,ijk->ik", w, corners)
    size = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1, keepdims=True)
    o = target + size * 10 ** rng.uniform(-1, 3, (n, 1)) * unit(rng.normal(size=(n, 3)))
    d = unit(target - o)
    faces = np.arange(3 * n).reshape(n, 3)
    mesh = vr.Mesh(vertices=corners.reshape(-1, 3), faces=faces, normals="face")
    kept = np.array(mesh.shape_of_file().mesh.faces)[:, 0] // 3
    line = Lineup([mesh], 1)
    a = line.a
    ray, row = Ray(triples(o[kept]), triples(d[kept])), dr.arange(a.U, len(kept))
    seen = line.kind.seen(line.batch.rows_at(row).placed, ray.o)
    t, inside, _, _ = (np.array(x) for x in line.kind.intersect_plane(seen, ray.d))
    assert inside.mean() > 0.9 and len(kept) > 0.9 * n
    for i, k in zip(np.flatnonzero(inside), kept[inside]):
        exact = exact_distance(o[k], d[k], corners[k])
        x, y = corners[k, 1] - corners[k, 0], corners[k, 2] - corners[k, 0]
        cosine = abs(np.dot(np.cross(x, y), d[k])) / np.linalg.norm(np.cross(x, y))
        reach = np.linalg.norm(corners[k] - o[k], axis=1).max()
        error = gamma(4) * t[i] + gamma(6) * reach / cosine
        assert abs(float(exact - Fraction(t[i]))) <= min(error, np.ptp((corners[k] - o[k]) @ d[k]) + gamma(8) * reach)


# Every way to find triangles


@dataclass(frozen=True)
class View:
    """Rays from one origin into a scene.

    d: unit directions. Shape: (n, 3)
    """

    scene: vr.Scene
    o: np.ndarray
    d: np.ndarray

    def answers(self, accelerator: str, brute_force: bool = False, shared: bool = True) -> tuple[np.ndarray, ...]:
        """(t, row) of the first hits, and whether something hides a target.

        Of every three targets, the first is the hit, the second is behind it, and the third half-way to it.
        """
        geometry = geometry_of(replace(self.scene, settings=vr.Settings(accelerator=accelerator)))
        o, d = triples(self.o if shared else np.broadcast_to(self.o, self.d.shape)), triples(self.d)
        origin, n = RayOrigin(geometry, o), len(self.d)
        hit = closest(origin, Ray(o, d), brute_force)
        t, row = np.array(hit.t), np.array(hit.row)
        third, size = np.arange(n) % 3, np.abs(self.o).sum()
        reach = np.where(np.isfinite(t), t, size + 10) * np.choose(third, [1, 2, 0.5])
        end = A.put(A.U, np.where(third == 0, row, NO_ROW).astype(np.uint32))
        error = A.put(A.D, gamma(8) * (2 * size + 2 * reach))
        no, yes = (dr.full(A.B, x, n) for x in (False, True))
        hidden = occluded(origin, Ray(o, d), Target(A.put(A.D, reach), error, end, no), yes, brute_force)
        return t, row, np.array(hidden)

    def disagreements(self, ways: tuple[str, ...]) -> int:
        """Number of rays for which some way to find triangles gives other bits than the test of every row.

        An origin on a surface is known to lie there only if all rays share it, so these have a truth of their own.
        """
        wrong = np.zeros(len(self.d), bool)
        for shared in (True, False):
            truth = self.answers("none", brute_force=True, shared=shared)
            assert np.isfinite(truth[0]).mean() > 0.2 and truth[2].mean() > 0.05
            for way in ways:
                t, row, hidden = self.answers(way, shared=shared)
                wrong |= (t.view(np.uint64) != truth[0].view(np.uint64)) | (row != truth[1]) | (hidden != truth[2])
        return int(wrong.sum())


def objects_around(rng: np.random.Generator, offset: np.ndarray, meshes: tuple) -> vr.Scene:
    """Meshes, balls and a floor."""
    objects: dict = {"floor": vr.Plane(point=tuple((offset - [0, 3, 0]).tolist()))}
    for i in range(40):
        centre = offset + rng.uniform(1.2, 3) * unit(rng.normal(size=3))
        objects[f"ball{i}"] = vr.Sphere(center=tuple(centre.tolist()), radius=float(rng.uniform(0.02, 0.4)))
    for i, mesh in enumerate(meshes):
        objects[f"mesh{i}"] = vr.Mesh(vertices=mesh.vertices + offset, faces=mesh.faces, normals="face")
    return vr.Scene(objects=objects, camera=vr.Camera(), lights={})


BODY = trimesh.creation.icosphere(subdivisions=2)
CORNERS = np.array(BODY.vertices)
EDGES = np.array(BODY.faces)[:, :2]
# Where rays start. A mesh lies in the middle of the scene.
ORIGINS = {
    "inside a mesh": (0.1, 0.2, -0.15),
    "between things": (1.4, 0.3, 0.2),
    "outside of all": (30.0, 20.0, 25.0),
    "at a vertex": CORNERS[7],
    "on an edge": CORNERS[EDGES[3]].mean(0),
    "along the axes": (0.0, 0.0, 0.0),
    "a million away": (1.4, 0.3, 0.2),
    "two meshes in one place": (1.4, 0.3, 0.2),
}


def view(what: str, seed: int, n: int, scene: vr.Scene | None = None) -> View:
    """A view from one of ORIGINS. Of its rays, half run through vertices of the mesh in the middle, or through points
    of its edges, and half anywhere."""
    rng = np.random.default_rng(seed)
    offset, o = FAR * (what == "a million away"), np.array(ORIGINS[what])
    other = BODY if what == "two meshes in one place" else trimesh.creation.icosphere(subdivisions=2, radius=3.5)
    edge, w = EDGES[rng.integers(len(EDGES), size=n)], rng.choice([0, 0.25, 0.5], (n, 1))
    on_mesh = CORNERS[edge[:, 0]] * (1 - w) + CORNERS[edge[:, 1]] * w
    d = np.where(rng.random((n, 1)) < 0.5, on_mesh, 4 * rng.uniform(-1, 1, (n, 3))) - o
    if what == "along the axes":
        d = rng.choice([-1, -0.0, 0.0, 1], (n, 3))
    d[~d.any(1)] = (0, 0, 1)
    return View(scene or objects_around(rng, offset, (BODY, other)), o + offset, unit(d))


QUICK = ("between things", "a million away", "two meshes in one place")


@pytest.mark.parametrize("what", [w if w in QUICK else pytest.param(w, marks=pytest.mark.slow) for w in ORIGINS])
def test_every_way_to_find_triangles_is_that_of_every_row_bit_for_bit(what: str) -> None:
    assert view(what, 6, 2_000).disagreements(("lists", "tree")) == 0


@pytest.mark.slow
@pytest.mark.parametrize("what", ["between things", "inside a mesh"])
def test_so_it_is_among_all_kinds(what: str) -> None:
    """Two objects of each kind, many balls and two meshes: some are unrolled, some in lists or in the tree."""
    rng = np.random.default_rng(8)
    kinds = [SAMPLES[name].posed for name in NAMES] + [SAMPLES[name].plain[0] for name in NAMES]
    moved = [vr.Translate(translate=tuple((2 * unit(rng.normal(size=3))).tolist())) for _ in kinds]
    more = {f"kind{i}": replace(x, transform=(m,)) for i, (x, m) in enumerate(zip(kinds, moved))}
    scene = objects_around(rng, np.zeros(3), (BODY, trimesh.creation.icosphere(subdivisions=3, radius=3.5)))
    scene = replace(scene, objects=scene.objects | more)
    assert view(what, 9, 20_000, scene).disagreements(("none", "lists", "tree", "auto")) == 0


@pytest.mark.nightly
def test_ten_million_rays_find_the_same_in_every_way() -> None:
    """Half of them with lists, half with the tree."""
    seeds, rays = 16, 20_000
    for what in ORIGINS:
        assert sum(view(what, seed, rays).disagreements(("lists", "tree")) for seed in range(seeds)) == 0, what
    assert len(ORIGINS) * seeds * rays * 4 > 10_000_000


# Pictures


LIGHTS = {
    "inside": vr.PointLight(position=(0.1, 0.2, -0.15)),
    "between": vr.PointLight(position=(1.4, 0.3, 0.2), intensity=0.5),
    "at a vertex": vr.PointLight(position=tuple(CORNERS[7].tolist()), intensity=0.5),
    "far": vr.PointLight(position=(4e5, 9e5, 3e5), intensity=0.5),
    "sun": vr.DirectionalLight(direction=(-1.0, -2.0, -0.7), intensity=0.5),
    "along an axis": vr.DirectionalLight(direction=(0.0, -1.0, 0.0), intensity=0.5),
    "spot": vr.SpotLight(position=(2.0, 3.0, 3.0), direction=(-2.0, -3.0, -3.0), angle=40.0),
}


@pytest.mark.parametrize("name", [n if n == "sun" else pytest.param(n, marks=pytest.mark.slow) for n in LIGHTS])
def test_pictures_are_the_same_bits_in_every_way(name: str) -> None:
    """Camera rays and shadow rays of each light, on half a ball of triangles, smooth and open, with balls around it."""
    scene = objects_around(np.random.default_rng(3), np.zeros(3), ())
    half = np.array(BODY.faces)[CORNERS[np.array(BODY.faces)].mean(1)[:, 2] < 0.3]
    scene = replace(
        scene,
        camera=vr.Camera(origin=(2.0, 1.5, 5.0), target=(0.0, 0.0, 0.0)),
        film=vr.Film(width=40, height=30),
        lights={"light": LIGHTS[name]},
        objects=scene.objects | {"half": vr.Mesh(vertices=CORNERS, faces=half)},
        settings=vr.Settings(spp=2),
    )
    layers = ("RGB", "id", "distance", "N")
    truth = vr.render(vr.replaced(scene, "settings.accelerator", "none"), layers=layers, progress=False)
    assert len(np.unique(truth["id"])) > 20
    for way in ("lists", "tree", "auto") if name != "sun" else ("lists",):
        image = vr.render(vr.replaced(scene, "settings.accelerator", way), layers=layers, progress=False)
        assert all(np.array_equal(image[layer], truth[layer]) for layer in layers), way
