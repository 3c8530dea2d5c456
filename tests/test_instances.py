"""Instances of geometries: the same picture as the objects written out, addresses, updates and what is refused."""

from dataclasses import replace
from pathlib import Path

import drjit as dr
import numpy as np
import pytest
from samples import NAMES, SAMPLES

import visray as vr
from visray.scene.address import changed, value
from visray.scene.check import checked, examined
from visray.scene.scene import Scene

MOVED = (vr.Rotate(rotate=20.0, axis=(1.0, 1.0, 0.0)), vr.Translate(translate=(0.3, 0.1, -0.2)))
VIEW = Scene(
    camera=vr.Camera(origin=(0.5, 1.5, 6.0)),
    film=vr.Film(width=32, height=24),
    materials={"red": vr.Material(kd=(0.8, 0.1, 0.1)), "blue": vr.Material(kd=(0.1, 0.2, 0.9))},
    lights={"key": vr.PointLight(position=(3.0, 6.0, 5.0))},
    settings=vr.Settings(spp=4),
)
BALLS = replace(
    VIEW,
    geometries={"ball": vr.Sphere(radius=0.5, transform=(vr.Scale(scale=(1.0, 2.0, 1.0)),)), "block": vr.Box()},
    objects={
        "left": vr.Instance(geometry="ball", material="red", transform=(vr.Translate(translate=(-1.2, 0.0, 0.0)),)),
        "middle": vr.Instance(geometry="block"),
        "right": vr.Instance(geometry="block", material="blue", transform=(vr.Translate(translate=(1.5, 0.0, 0.0)),)),
        "floor": vr.Plane(point=(0.0, -1.0, 0.0)),
    },
)


def written_out(scene: Scene) -> Scene:
    """The scene with the shape of its geometry in place of each instance."""
    objects = {name: scene.placed_shape(x) for name, x in scene.objects.items()}
    return checked(replace(scene, objects=objects, geometries={}))


def picture(scene: Scene | vr.Prepared, layers: tuple[str, ...] = ("RGB", "id")) -> dict[str, np.ndarray]:
    image = vr.render(scene, layers=layers, progress=False)
    return {name: image[name] for name in layers}


def same(x: dict[str, np.ndarray], y: dict[str, np.ndarray]) -> bool:
    return all(np.array_equal(x[name], y[name]) for name in x)


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow if i else []) for i, n in enumerate(NAMES)])
def test_an_instance_of_any_kind_is_the_object_at_its_place(name: str) -> None:
    shape = SAMPLES[name].posed
    scene = replace(
        VIEW,
        geometries={"shape": shape},
        objects={"one": vr.Instance(geometry="shape", material="red", transform=MOVED)},
    )
    here = picture(scene)
    assert here["id"].any() and same(here, picture(written_out(scene)))
    assert written_out(scene).objects["one"].transform == shape.transform + MOVED


def test_instances_with_and_without_transforms_are_the_objects_written_out() -> None:
    assert same(picture(BALLS), picture(written_out(BALLS)))


def test_an_address_of_an_instance_or_of_a_geometry_is_updated_without_compiling() -> None:
    prepared = vr.prepare(BALLS)
    # The first update compiles the kernel that replaces rows.
    picture(prepared.updated({"objects.left.transform.0.translate": (-1.1, 0.0, 0.0), "geometries.block.max.0": 0.6}))
    moves = {"objects.left.transform.0.translate": (-1.0, 0.2, 0.0), "geometries.ball.radius": 0.4}
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history()
        updated = prepared.updated(moves | {"geometries.block.max.0": 0.7})
        there = picture(updated)
        history = dr.kernel_history([dr.KernelType.JIT])
    assert [kernel for kernel in history if not kernel["cache_hit"]] == []
    assert same(there, picture(changed(BALLS, moves | {"geometries.block.max.0": 0.7})))
    assert value(updated.scene, "geometries.ball.radius") == 0.4


def test_another_geometry_and_another_material_are_updates_too() -> None:
    two = {"objects.right.geometry": "ball", "objects.right.material": "red"}
    updated = vr.prepare(BALLS).updated(two)
    assert same(picture(updated), picture(changed(BALLS, two)))


def test_a_derivative_by_a_geometry_is_the_sum_over_its_instances() -> None:
    scene = replace(BALLS, settings=vr.Settings(spp=1, shading="depth"))
    objects = written_out(scene)
    with pytest.warns(vr.EdgeWarning):
        whole = vr.gradient(scene, ["geometries.block.max"])["geometries.block.max"]
    with pytest.warns(vr.EdgeWarning):
        each = vr.gradient(objects, ["objects.middle.max", "objects.right.max"])
    assert np.abs(whole).max() > 1e-4
    assert whole == pytest.approx(sum(each.values()), rel=1e-9)
    with pytest.raises(
        vr.UserError, match=r"objects\.left\.transform.*: has no derivative; those of a instance are none"
    ):
        vr.gradient(scene, ["objects.left.transform.0.translate"])


def test_a_scene_with_instances_is_written_and_read(tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    file.write_text(vr.dump(BALLS))
    assert vr.load(file) == checked(BALLS) and vr.load(file).hash() == checked(BALLS).hash()


def test_the_file_of_a_geometry_is_relative_to_the_scene(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    file = tmp_path / "scene.json"
    file.write_text(
        '{"geometries": {"m": {"type": "mesh", "file": "meshes/one.obj"}}, '
        '"objects": {"a": {"type": "instance", "geometry": "m"}}}'
    )
    scene = vr.load(file)
    assert Path(scene.geometries["m"].file) == tmp_path / "meshes" / "one.obj"
    assert '"file": "meshes/one.obj"' in vr.dump(scene, folder=tmp_path)


@pytest.mark.parametrize(
    ("geometries", "objects", "line"),
    [
        (
            {"tree": {"type": "sphere"}},
            {"a": {"geometry": "tree"}, "b": {"geometry": "tre"}},
            'objects.b.geometry = "tre": unknown geometry; did you mean "tree"? (one of tree)',
        ),
        ({}, {"a": {"geometry": "tree"}}, 'objects.a.geometry = "tree": unknown geometry; there is none'),
        ({}, {"a": {}}, "objects.a: the key 'geometry' is missing; it is a string"),
        (
            {"tree": {"type": "sphere"}},
            {},
            "geometries.tree: no object is an instance of it; add one, or leave the geometry out",
        ),
        (
            {"tree": {"type": "instance", "geometry": "tree"}},
            {"a": {"geometry": "tree"}},
            'geometries.tree.type = "instance": a geometry cannot be an instance; write the shape itself',
        ),
        (
            {"tree": {"type": "sphere", "material": "red"}},
            {"a": {"geometry": "tree"}},
            'geometries.tree.material = "red": a geometry has no material; give one to each of its instances',
        ),
        (
            {"tree": {"type": "sphere", "radius": -1.0}},
            {"a": {"geometry": "tree"}},
            "geometries.tree.radius = -1.0: must be greater than 0",
        ),
        (
            {"tree": {"type": "sphere", "transform": [{"scale": 1e8}]}},
            {"a": {"geometry": "tree", "transform": [{"scale": 1e3}]}},
            'objects.a.transform = [{"scale": 1000.0}]: after the transform of geometries.tree, the steps together '
            "scale below 1e-09 or reach beyond 1e+09",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(geometries: dict, objects: dict, line: str) -> None:
    objects = {name: {"type": "instance"} | x for name, x in objects.items()}
    raw = {"materials": {"red": {}}, "geometries": geometries, "objects": objects, "camera": {}, "lights": {}}
    assert examined(raw)[1] == [line]
