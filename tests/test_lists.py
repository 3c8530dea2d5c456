"""Lists as kernels read them: the cell of a ray is that of the twin in NumPy, and no row that a ray meets is missing
from the span that the kernel reads. The truth are the tests of test_cells.py, in extended precision."""

from dataclasses import replace

import numpy as np
import pytest
from samples import geometry_of
from test_cells import Balls, Triangles, ahead, cell_of, random_balls, random_triangles, rays, views_of

import visray as vr
from visray import integrator
from visray.accel import lists as list_module
from visray.accel.lists import RowLists, Sheet
from visray.accel.origin import RayOrigin
from visray.meshes.triangle_mesh import without_area
from visray.quantities import Arrays
from visray.setup import prepare

A = Arrays.of("llvm", "single")
KINDS = {"balls": random_balls, "triangles": random_triangles}


def triples(v: np.ndarray) -> object:
    return A.put(A.W, np.atleast_2d(v).T)


def rows_of(kind: str, random: np.random.Generator, n: int, one_side: bool, place: np.ndarray) -> Balls | Triangles:
    """Rows around a place that a scene may have: balls with a radius, triangles with an area."""
    rows = KINDS[kind](random, n)
    rows = ahead(rows, 2000) if one_side else rows
    rows = type(rows)(*(v + place if v.ndim == 2 else v for v in vars(rows).values()))
    if kind == "balls":
        return Balls(rows.centre, np.maximum(rows.radius, 1e-6))
    kept = ~without_area(np.concatenate([rows.a, rows.b, rows.c]), np.arange(3 * n).reshape(3, n).T)
    return Triangles(rows.a[kept], rows.b[kept], rows.c[kept])


def scene_of(rows: Balls | Triangles) -> vr.Scene:
    """A scene of one batch with these rows, in this order."""
    if isinstance(rows, Balls):
        pairs = zip(rows.centre.tolist(), rows.radius.tolist())
        objects = {f"o{i}": vr.Sphere(center=tuple(c), radius=r) for i, (c, r) in enumerate(pairs)}
    else:
        points = np.stack([rows.a, rows.b, rows.c], 1).reshape(-1, 3)
        faces = np.arange(len(points)).reshape(-1, 3)
        objects = {"m": vr.Mesh(vertices=points, faces=faces, normals="face")}
    return vr.Scene(objects=objects, settings=vr.Settings(accelerator="lists"), camera=vr.Camera(), lights={})


def lost(lists: RowLists, rows: Balls | Triangles, o: np.ndarray, d: np.ndarray, d32: object) -> tuple[int, int]:
    """(number of hits whose row is missing from the span of their ray or seems to begin too far away, number of hits).

    d32: the directions as the kernel has them
    """
    first, end = (np.array(x) for x in lists.span(A, d32, A.B(True)))
    first, end = (np.broadcast_to(x, len(d)) for x in (first, end))
    entries, near = np.array(lists.entries), np.array(lists.near)
    ray, row, t = rows.hits(o[None], d, False)
    wrong = 0
    for i, k, distance in zip(ray, row, t):
        at = np.flatnonzero(entries[first[i] : end[i]] == k)
        wrong += len(at) != 1 or near[first[i] + at[0]] > distance
    return wrong, len(ray)


@pytest.mark.parametrize("view", ["point", "camera", "narrow"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_cell_of_a_ray_is_that_of_the_twin_or_its_neighbour(kind: str, view: str) -> None:
    """In a kernel, the place of a ray has an error of at most a quarter of a cell, so it may be beyond a border."""
    random = np.random.default_rng(11)
    for one_side in (False, True):
        o = random.normal(size=3)
        rows = rows_of(kind, random, 90, one_side, o)
        found = rows.lists(views_of(view, o, rows, random))
        _, d = rays(found, o, rows, random, 500)
        d32 = A.V32(triples(d))
        cell, inside = (np.array(x) for x in Sheet.of(A, found).cell(A, d32))
        twin = cell_of(found, np.array(d32).T)
        both = np.broadcast_to(inside, len(d)) & (twin >= 0)
        assert both.mean() > 0.2
        columns, others = (x[both] for x in (cell, twin))
        across = np.abs(columns % found.columns - others % found.columns)
        along = np.abs(columns // found.columns - others // found.columns)
        assert (np.maximum(across, along) <= 1).all() and (across + along == 0).mean() > 0.6


PLACES = [(0, 0.0), (1, 0.0), (2, 1e6)]


@pytest.mark.parametrize("kind", KINDS)
def test_no_row_is_missing_from_the_span_that_a_kernel_reads(kind: str) -> None:
    """Rays at borders of cells, tangents, edges and corners. The origin is among the rows, outside, and far away."""
    total = 0
    for seed, place in PLACES:
        random = np.random.default_rng(seed)
        o = place * np.array([1, -0.3, 0.2]) + random.normal(size=3)
        rows = rows_of(kind, random, 96, seed == 1, o)
        (lists,) = RayOrigin(geometry_of(scene_of(rows)), triples(o)).lists
        _, d = rays(rows.lists(views_of("point", o, rows, random)), o, rows, random, 400)
        wrong, hits = lost(lists, rows, o, d, A.V32(triples(d)))
        assert wrong == 0, (kind, seed)
        total += hits
    assert total > 2_000


@pytest.mark.parametrize("kind", KINDS)
def test_no_row_is_missing_for_a_camera_up_to_the_corners_of_its_picture(kind: str) -> None:
    """Rays at the corners and borders of the picture and of pixels, through a narrow, a wide and a far camera."""
    total = 0
    for seed, place in PLACES:
        random = np.random.default_rng(seed + 10)
        o = place * np.array([1, -0.3, 0.2]) + random.normal(size=3)
        rows = rows_of(kind, random, 96, False, o)
        camera = vr.Camera(origin=tuple(o), target=tuple(o + random.normal(size=3)), fov=(60.0, 140.0, 8.0)[seed])
        scene = replace(scene_of(rows), camera=camera, film=vr.Film(width=48, height=32))
        kernel = prepare(scene).kernel
        x, y = (
            random.choice([0, k, *random.integers(k + 1, size=4), *random.uniform(0, k, 4)], 3_000) for k in (48, 32)
        )
        d32 = integrator.camera_direction(kernel, A.F(x), A.F(y))
        d = np.array(integrator.camera_ray(kernel, A.F(x), A.F(y)).d).T
        (lists,) = kernel.origin.lists
        wrong, hits = lost(lists, rows, o, d, d32)
        assert wrong == 0, (kind, seed)
        total += hits
    assert total > 1_000


@pytest.mark.slow
def test_a_smaller_budget_gives_coarser_cells_and_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(5)
    scene = replace(
        scene_of(rows_of("balls", random, 200, False, np.zeros(3))),
        film=vr.Film(width=32, height=24),
        lights={"key": vr.PointLight(position=(1.0, 2.0, 3.0))},
    )
    fine = vr.render(scene, progress=False, layers=("RGB", "id", "distance"))
    monkeypatch.setattr(list_module, "BUDGET", 8_000)
    coarse = vr.render(scene, progress=False, layers=("RGB", "id", "distance"))
    none = vr.render(
        vr.replaced(scene, "settings.accelerator", "none"), progress=False, layers=("RGB", "id", "distance")
    )
    assert fine["id"].any()
    for name in ("RGB", "id", "distance"):
        assert np.array_equal(fine[name], coarse[name]) and np.array_equal(fine[name], none[name])
