"""CSG geometries: their instances, a geometry as an operand, updates of all of them, and what is remembered."""

import gc
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

import visray as vr
from visray.primitives import csg_resolved
from visray.primitives.csg_clusters import CLUSTER, UNSPLIT
from visray.primitives.csg_form import MAX_WRITTEN_OUT
from visray.primitives.primitive import bounding_box
from visray.scene.check import checked

BLOCK = vr.Box(min=(-0.5, -0.5, -0.5), max=(0.5, 0.5, 0.5))
DRILLED = vr.Csg(
    op="difference", of={"block": BLOCK, "bore": vr.Cylinder(radius=0.3, height=1.2)}, cut_material="inner"
)


def at(x: float, **fields) -> vr.Instance:
    return vr.Instance(geometry="drilled", transform=(vr.Translate(translate=(x, 0, 0)),), **fields)


SCENE = vr.Scene(
    camera=vr.Camera(origin=(0.5, 2.0, 5.0), fov=45),
    film=vr.Film(width=48, height=24),
    materials={"inner": vr.Material(kd=(0.1, 0.2, 0.9)), "red": vr.Material(kd=(0.9, 0.1, 0.1))},
    lights={"key": vr.PointLight(position=(3, 4, 5))},
    geometries={"drilled": DRILLED},
    objects={"still": vr.Instance(geometry="drilled"), "left": at(-1.5, material="red"), "right": at(1.5)},
    settings=vr.Settings(spp=1),
)


def picture(scene: vr.Scene | vr.Prepared) -> np.ndarray:
    return vr.render(scene, progress=False)


def same(a: vr.Image, b: vr.Image) -> bool:
    return all(np.array_equal(a[name], b[name], equal_nan=True) for name in a.layers)


@contextmanager
def compiled() -> Iterator[list]:
    """Collects the kernels that are compiled inside."""
    found: list = []
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        yield found
        found += [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT and not k["cache_hit"]]


def holes(count: int, seed: int = 1) -> vr.Csg:
    """A block with many round holes."""
    centres = np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 3)).tolist()
    return vr.Csg(op="difference", of=(BLOCK, *(vr.Sphere(center=tuple(c), radius=0.2) for c in centres)))


def test_instances_are_the_objects_at_their_places() -> None:
    """Those with a transform, and that without one."""
    objects = {name: SCENE.placed_shape(x) for name, x in SCENE.objects.items()}
    image = picture(SCENE)
    assert same(image, picture(replace(SCENE, objects=objects, geometries={})))
    assert np.unique(image["id"]).size == 4
    for name, x in (("still", 0.0), ("left", -1.5), ("right", 1.5)):
        low, high = bounding_box(SCENE.placed_shape(SCENE.objects[name]))
        assert np.array_equal((low, high), np.array([[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]]) + (x, 0, 0))


def test_instances_share_a_batch_and_a_kernel() -> None:
    prepared = vr.prepare(replace(SCENE, objects={f"i{k}": at(0.7 * k - 1) for k in range(4)}))
    (batch,) = prepared.packed.batches
    assert list(batch.names.listed) == ["i0", "i1", "i2", "i3"]
    picture(prepared)
    moves = {"objects.i1.transform.0.translate": (0.1, 0.8, 0.2), "objects.i3.transform.0.translate": (1.2, -0.4, 0)}
    picture(prepared.updated(moves))
    moves["objects.i1.transform.0.translate"] = (-0.1, 0.9, 0.1)
    with compiled() as kernels:
        updated = prepared.updated(moves | {"objects.i2.transform": (vr.Rotate(rotate=20),)})
        image = picture(updated)
    assert not kernels
    assert same(image, picture(updated.scene)) and not same(image, picture(prepared))


def test_a_geometry_is_an_instance_and_an_operand() -> None:
    """An update of a number in it changes both, and compiles nothing."""
    corner = vr.Csg(op="intersection", of={"part": at(0), "ball": vr.Sphere(radius=0.6)}, transform=at(1.5).transform)
    scene = replace(SCENE, objects={"left": at(-1.5), "corner": corner})
    written = replace(corner, of={"part": replace(DRILLED, transform=at(0).transform), "ball": vr.Sphere(radius=0.6)})
    apart = replace(scene, objects={"left": replace(DRILLED, transform=at(-1.5).transform), "corner": written})
    prepared = vr.prepare(scene)
    assert same(picture(prepared), picture(replace(apart, geometries={})))
    picture(prepared.updated({"geometries.drilled.of.bore.radius": 0.25}))
    with compiled() as kernels:
        image = picture(prepared.updated({"geometries.drilled.of.bore.radius": 0.2}))
    assert not kernels
    assert same(image, picture(vr.replaced(scene, "geometries.drilled.of.bore.radius", 0.2)))
    both = {"objects.left.of.bore.radius": 0.2, "objects.corner.of.part.of.bore.radius": 0.2}
    for address, radius in both.items():
        apart = vr.replaced(replace(apart, geometries={}), address, radius)
    assert same(image, picture(apart))


MOVES: Mapping[str, object] = {
    "of.bore.radius": 0.2,
    "of.bore.center": (0.1, 0.1, 0.05),
    "of.block.max.1": 0.3,
    "of.bore.transform": (vr.Rotate(rotate=40.0, axis=(1, 0, 0)),),
}


def test_numbers_of_operands_change_without_a_new_kernel() -> None:
    turned = DRILLED.of["bore"].__class__(radius=0.3, height=1.2, transform=(vr.Rotate(rotate=10.0, axis=(1, 0, 0)),))
    scene = replace(SCENE, objects={"c": replace(DRILLED, of=DRILLED.of | {"bore": turned})}, geometries={})
    prepared = vr.prepare(scene)
    picture(prepared.updated({"objects.c.of.bore.radius": 0.21}))
    for path, value in MOVES.items():
        address = f"objects.c.{path}"
        with compiled() as kernels:
            image = picture(prepared.updated({address: value}))
        assert not kernels, path
        assert same(image, picture(vr.replaced(scene, address, value))) and not same(image, picture(prepared)), path


@pytest.mark.parametrize("counts", [(MAX_WRITTEN_OUT + 1, UNSPLIT - 1), (UNSPLIT + 1, UNSPLIT * CLUSTER // 2)])
def test_more_operands_of_a_group_that_is_looped_over_need_no_new_kernel(counts: tuple[int, int]) -> None:
    """A group is looped over if it is larger than what is written out, and in clusters if it is larger still."""
    few, many = (replace(SCENE, objects={"c": holes(n)}, geometries={}) for n in counts)
    prepared = vr.prepare(few)
    picture(prepared.updated({"objects.c": holes(counts[0], seed=2)}))
    with compiled() as kernels:
        image = picture(prepared.updated({"objects.c": many.objects["c"]}))
    assert not kernels
    assert same(image, picture(many)) and not same(image, picture(few))


@pytest.mark.parametrize("op", ["union", "merge", "intersection"])
def test_another_operation_is_a_new_scene(op: str) -> None:
    scene = replace(SCENE, objects={"c": replace(DRILLED, cut_material=None)}, geometries={})
    updated = vr.prepare(scene).updated({"objects.c.op": op})
    assert same(picture(updated), picture(vr.replaced(scene, "objects.c.op", op)))


def test_another_first_operand_changes_the_medium_and_the_materials() -> None:
    scene = replace(SCENE, objects={"c": replace(DRILLED, cut_material=None)}, geometries={})
    prepared = vr.prepare(scene)
    for address, value in (("objects.c.of.block.material", "red"), ("objects.c.cut_material", "inner")):
        assert same(picture(prepared.updated({address: value})), picture(vr.replaced(scene, address, value)))


def test_instances_of_one_geometry_share_its_operands_and_nothing_stays_when_they_are_gone() -> None:
    gc.collect()  # what earlier tests left must not go during this one
    before = len(csg_resolved._entries)
    scene = checked(replace(SCENE, objects={"left": at(-1.5), "right": at(1.5)}))
    left, right = (scene.placed_shape(x) for x in scene.objects.values())
    assert left.of is right.of and scene.placed_shape(scene.objects["left"]) is left
    other = replace(scene, geometries={"drilled": replace(DRILLED, op="intersection", cut_material=None)})
    assert other.placed_shape(scene.objects["left"]).op == "intersection"
    assert scene.placed_shape(scene.objects["left"]).op == "difference"
    assert len(csg_resolved._entries) > before
    del scene, other, left, right
    gc.collect()
    assert len(csg_resolved._entries) == before
