"""The kernel of CSG: what only makes it faster changes no bit of a picture."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import visray as vr
from visray.primitives import csg_clusters, csg_form, csg_table
from visray.primitives.csg_body import CsgBody
from visray.primitives.mesh_buffers import Body
from visray.setup import arrays

MATERIALS = {"skin": vr.Material(kd=(0.8, 0.2, 0.1)), "inner": vr.Material(kd=(0.1, 0.3, 0.9))}


def balls(count: int) -> tuple[vr.Sphere, ...]:
    """Balls of many sizes in and around the unit cube; some contain others, some lie apart."""
    rng = np.random.default_rng(3)
    return tuple(
        vr.Sphere(center=tuple(rng.uniform(-1, 1, 3).tolist()), radius=float(rng.uniform(0.05, 0.4)))
        for _ in range(count)
    )


def wedges(count: int) -> tuple[vr.Csg, ...]:
    """Parts of two operands each, around the y axis."""
    ball = vr.Sphere(center=(0.8, 0, 0), radius=0.5)
    box = vr.Box(min=(0.2, -0.3, -0.05), max=(1.2, 0.3, 0.05))
    turns = [(vr.Rotate(rotate=360.0 * i / count, axis=(0, 1, 0)),) for i in range(count)]
    return tuple(vr.Csg(op="intersection", of=(box, ball), transform=turn) for turn in turns)


BOX = vr.Box(min=(-0.9, -0.9, -0.9), max=(0.9, 0.9, 0.9))
SOLIDS = {
    "holes": vr.Csg(op="difference", of=(BOX, *balls(50)), cut_material="inner"),
    "union": vr.Csg(op="merge", of=balls(50)),
    "wedges": vr.Csg(op="merge", of=wedges(20)),
    "slots": vr.Csg(op="difference", of=(BOX, *wedges(20)), cut_material="inner"),
    "nested": vr.Csg(op="intersection", of=(BOX, vr.Csg(op="difference", of=(vr.Sphere(radius=1.2), *balls(30))))),
}


def picture(solid: vr.Csg) -> np.ndarray:
    scene = vr.Scene(
        camera=vr.Camera(origin=(2.0, 1.7, 3.0), target=(0, 0, 0), fov=40.0),
        film=vr.Film(width=96, height=72),
        materials=MATERIALS,
        lights={"key": vr.PointLight(position=(3.0, 4.0, 2.0))},
        objects={"floor": vr.Plane(point=(0, -1, 0)), "solid": vr.Csg(**vars(solid) | {"material": "skin"})},
    )
    return np.array(vr.render(scene, spp=4))


@pytest.mark.parametrize("name", SOLIDS)
def test_clusters_and_loops_and_balls_change_no_bit(name: str, monkeypatch: Any) -> None:
    """Clusters against kernels in which every operand is written out, or is in one loop without balls."""
    with monkeypatch.context() as split:
        split.setattr(csg_clusters, "UNSPLIT", csg_clusters.CLUSTER)
        fast = picture(SOLIDS[name])
    assert fast.std() > 0.05
    with monkeypatch.context() as slow:
        slow.setattr(csg_clusters, "UNSPLIT", 10**6)
        assert np.array_equal(picture(SOLIDS[name]), fast)
        slow.setattr(csg_table, "packed_balls", lambda *_: None)
        assert np.array_equal(picture(SOLIDS[name]), fast)
    with monkeypatch.context() as slow:
        slow.setattr(csg_clusters, "UNSPLIT", 10**6)
        slow.setattr(csg_form, "MAX_WRITTEN_OUT", 10**6)
        assert np.array_equal(picture(SOLIDS[name]), fast)


TETRAHEDRON = vr.Mesh(
    vertices=[[1, 0, 0], [-0.5, 0, 0.8], [-0.5, 0, -0.8], [0, 1, 0]], faces=[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
)


@pytest.mark.parametrize("op", ["intersection", "difference"])
def test_a_point_on_a_surface_without_a_known_part_lies_on_the_right_operand(op: str) -> None:
    """A camera or a light on the surface knows no part of it, and no triangle of a mesh."""
    a, rng = arrays("llvm", "single"), np.random.default_rng(5)
    large, small = (replace(TETRAHEDRON, transform=(vr.Scale(scale=s),)) for s in (2.0, 0.3))
    mesh = small if op == "difference" else large
    box = vr.Box(min=(-0.3, -0.5, -0.3), max=(0.3, 0.4, 0.3))
    made = vr.Csg(op=op, of=(box, mesh))
    placed = CsgBody.table(a, [made]).placed(None)
    alone = mesh.body_kind.table(a, [Body(mesh)]).placed(None)
    for side in range(20):
        on_box = np.array([rng.uniform(-0.3, 0.3), 0.4, rng.uniform(-0.3, 0.3)])
        p = a.put(a.W, on_box[:, None])
        assert made.kind.leaf_number(made.kind.part_at(placed, p)) == 0
        f, g = made.kind.surface_at(placed, p)
        assert abs(f[0]) < 1e-15 and np.array_equal(np.array(g)[:, 0] > 0, (False, True, False))
        triangle = np.array(mesh.vertices.values)[np.array(mesh.faces.values)[side % 4]] * mesh.transform[0].scale
        on_mesh = rng.dirichlet((1, 1, 1)) @ triangle
        p = a.put(a.W, on_mesh[:, None])
        assert op == "intersection" or made.kind.leaf_number(made.kind.part_at(placed, p)) == 1
        for x, y in zip(made.kind.surface_at(placed, p), mesh.body_kind.surface_at(alone, p)):
            assert op == "intersection" or np.array_equal(x, -y)


TEXTURES = {
    "unused": vr.CheckerTexture(),
    "tiles": vr.CheckerTexture(a=(0.9, 0.2, 0.1), b=(0.1, 0.2, 0.9)),
    "squares": vr.CheckerTexture(a=(0.2, 0.8, 0.1), b=(0.9, 0.8, 0.9)),
}


@pytest.mark.parametrize("textured", ["ka and kd", "kd"])
def test_textures_are_those_of_the_operands(textured: str) -> None:
    """Operands that do not meet look as separate objects do, whether their v ends at poles or not."""
    apart = (
        vr.Box(min=(-1.4, -0.5, -0.5), max=(-0.4, 0.5, 0.5), material="tiled"),
        vr.Sphere(center=(0.3, 0, 0), radius=0.5, material="squared"),
        vr.Cylinder(center=(1.4, 0, 0), radius=0.4, height=1.0, material="squared"),
        vr.Cone(base=(0.3, 0.6, 0), radius=0.4, height=0.8, material="tiled"),
    )

    def shown(objects: dict) -> np.ndarray:
        scene = vr.Scene(
            camera=vr.Camera(origin=(1.0, 1.5, 4.0), target=(0.1, 0.1, 0), fov=45.0),
            film=vr.Film(width=96, height=64),
            textures=TEXTURES,
            materials={
                "tiled": vr.Material(texture="tiles"),
                "squared": vr.Material(texture="squares", textured=textured),
            },
            lights={"key": vr.PointLight(position=(3.0, 4.0, 4.0))},
            objects=objects,
        )
        return np.array(vr.render(scene, spp=4))

    separate = shown({f"x{i}": x for i, x in enumerate(apart)})
    assert np.array_equal(shown({"all": vr.Csg(op="merge", of=apart)}), separate)
    assert len(np.unique(separate.reshape(-1, separate.shape[-1]).round(1), axis=0)) > 20
