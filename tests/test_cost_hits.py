"""First hits and the rays that leave them, of a choice against the reference."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import trimesh

import visray as vr
from visray.primitives.clips import Ball
from visray.setup import Prepared, prepare
from visray.study.cost.hits import geometry
from visray.study.cost.records import Geometry

NOTHING = {"lost": 0, "added": 0, "other": 0, "ulps": 0.0, "angle": 0.0, "self_shadows": 0}
HEART = vr.Polynomial(surface="heart")
VIEW = vr.Scene(
    camera=vr.Camera(origin=(3.0, 2.0, 5.0), target=(0.0, 0.0, 0.0), fov=40.0),
    film=vr.Film(width=96, height=80),
    objects={
        "ball": vr.Sphere(center=(1.3, 0.6, 1.0), radius=0.4),
        "heart": HEART,
        "floor": vr.Plane(point=(0, -1.2, 0)),
    },
    lights={},
)


def made(precision: str = "double", brute_force: bool = False, **objects: Any) -> Prepared:
    settings = replace(VIEW.settings, precision=precision)
    return prepare(replace(VIEW, objects=VIEW.objects | objects, settings=settings), brute_force=brute_force)


def test_the_same_scene_has_the_same_geometry() -> None:
    """Also by the slow twin of the search; and whatever the precision of both is."""
    truth = made()
    found = geometry(made(), truth)
    assert found == Geometry(rays=96 * 80, leaving=found.leaving, **NOTHING)
    assert found.leaving > 5000
    assert geometry(made(brute_force=True), truth) == found
    single = made("single")
    assert {k: v for k, v in vars(geometry(single, single)).items() if k in NOTHING} == NOTHING


def test_single_precision_is_that_of_shading() -> None:
    """Hits are found in double all the same; normals are rounded."""
    found = geometry(made("single"), made("double"))
    assert (found.lost, found.added, found.other, found.ulps, found.self_shadows) == (0, 0, 0, 0, 0)
    assert 1e-8 < found.angle < 1e-6


def test_triangles_of_a_mesh_are_one_object() -> None:
    """Other settings leave the first hits of a mesh and of what stands before it as they are."""
    mesh = trimesh.creation.icosphere(subdivisions=2)
    mesh = vr.Mesh(vertices=mesh.vertices, faces=mesh.faces)
    truth = made(heart=mesh)
    found = geometry(made("single", heart=mesh), truth)
    assert (found.lost, found.added, found.other, found.ulps, found.self_shadows) == (0, 0, 0, 0, 0)
    bare = prepare(replace(truth.scene, objects={k: v for k, v in truth.scene.objects.items() if k != "heart"}))
    assert geometry(bare, truth).other > 100


def of_heart(tolerance: float = 0.0) -> Prepared:
    """The heart alone, which fills much of the picture."""
    camera = vr.Camera(origin=(3.7, 2.0, 2.7), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=30.0)
    film = vr.Film(width=160, height=160)
    return prepare(
        vr.Scene(camera=camera, film=film, objects={"heart": replace(HEART, tolerance=tolerance)}, lights={})
    )


def test_the_looser_crossings_are_the_more_is_wrong() -> None:
    """No ray is lost even so; and points that are off hide themselves rarely, as rays leave on the right side."""
    truth = of_heart()
    found = [geometry(of_heart(x), truth) for x in (1e-1, 1e-2, 1e-3, 1e-6, 1e-9, 1e-12)]
    for loose, tight in pairwise(found):
        assert loose.ulps > 4 * tight.ulps and loose.angle >= tight.angle
        assert loose.self_shadows >= tight.self_shadows
    assert found[0].self_shadows > found[1].self_shadows > 0
    assert [x.self_shadows for x in found[3:]] == [0, 0, 0]
    assert found[1].self_shadows < 0.01 * found[1].leaving
    assert all((x.lost, x.added, x.other) == (0, 0, 0) for x in found)
    # Half the chord in the clip's ball is at most its radius; nothing is nearer than 2.
    assert found[-1].ulps < 1e-12 * HEART.clip_volume().radius / np.spacing(2.0)


def test_objects_are_told_by_name() -> None:
    """One of another tolerance is of another kind, and so the objects come in another order."""
    blunt = {
        name: vr.Polynomial(expression="(x - a)^4 + y^4 + z^4 - 0.1", parameters={"a": a}, clip=Ball(radius=4.0))
        for name, a in (("left", -2.0), ("right", 2.0))
    }
    loose, truth = (
        made(
            left=replace(blunt["left"], tolerance=x), box=vr.Box(min=(-1, -1, -3), max=(1, 0, -2)), right=blunt["right"]
        )
        for x in (1e-9, 0.0)
    )
    order = [[name for batch in x.kernel.batches for name in batch.names] for x in (loose, truth)]
    assert order[0] != order[1]
    found = geometry(loose, truth)
    assert (found.lost, found.added, found.other) == (0, 0, 0)
    assert 0 < found.ulps < 1e-9 * 4 / np.spacing(2.0)


def test_what_is_not_there_is_counted() -> None:
    """A floor as far as the camera sees, for one that is smaller; and another name for what is the same."""
    truth = made()
    small = made(floor=vr.Disk(center=(0.0, -1.2, 0.0), normal=(0.0, 1.0, 0.0), radius=4.0))
    less, more = geometry(small, truth), geometry(truth, small)
    assert less.lost == more.added > 100 and (less.added, more.lost) == (0, 0)
    assert less.ulps <= 64 and less.angle < 1e-15
    named = prepare(replace(truth.scene, objects={"marble" if k == "ball" else k: v for k, v in VIEW.objects.items()}))
    with pytest.raises(KeyError, match="marble"):
        geometry(named, truth)


def test_the_seed_chooses_the_rays() -> None:
    truth, loose = of_heart(), of_heart(1e-1)
    found = [geometry(loose, truth, seed) for seed in (0, 0, 1)]
    assert found[0] == found[1] and found[0].self_shadows != found[2].self_shadows
