"""The witness of media in `visray check`: its solids and volumes, and that it tells a wrong rule from the right one."""

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import pytest
from samples import NAMES, SAMPLES, instances
from solids import SOLIDS
from test_media import MEDIA
from test_nesting import rod, volumes, with_priorities

import visray as vr
from visray import kernel_scene
from visray.accel.culling import touches
from visray.primitives import KINDS
from visray.primitives.clips import Ball
from visray.primitives.primitive import bounding_box
from visray.pytree import rows
from visray.setup import prepare
from visray.study.mitsuba import media
from visray.study.mitsuba.crosscheck import check
from visray.study.mitsuba.membership import TESTS, inside, measured_volume
from visray.transforms import Rotate, Scale, Translate

CLOSED = [name for name in NAMES if SAMPLES[name].posed.closed]
LAMP = {"lamp": vr.PointLight(position=(0, 3, 4))}
SIGMAS = 5


def scene_of(objects: dict, **materials: Any) -> vr.Scene:
    """Objects of clear materials, seen from the front."""
    return vr.Scene(
        camera=vr.Camera(origin=(0, 0, 6), fov=24.0), film=vr.Film(width=24, height=24), lights=LAMP,
        objects=objects, materials=MEDIA | materials, settings=vr.Settings(spp=1),
    )  # fmt: skip


def differences(scene: vr.Scene, declared: vr.Scene | None = None) -> Any:
    return media.compare(scene, declared or scene, 0)[0]


def test_every_solid_has_a_test() -> None:
    solids = {kind for kind in KINDS if SAMPLES[kind.__name__].posed.closed} | {vr.Mesh}
    assert set(TESTS) == solids


@pytest.mark.parametrize("moved", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", [*CLOSED, "Mesh"])
def test_points_are_inside_for_the_witness_as_for_the_kernel(name: str, moved: bool) -> None:
    """But for points at the surface; and volumes by random points are those of the kernel's order."""
    rng = np.random.default_rng(11)
    steps = (Scale(scale=(1.0, 2.0, -0.5)), Rotate(rotate=50.0, axis=(1, 2, 3)), Translate(translate=(1, 0, 2)))
    if name == "Mesh":
        things = [vr.Mesh(vertices=v, faces=f, transform=steps if moved else ()) for v, f in SOLIDS.values()]
    else:
        things = instances(name, 12, 3, moved, 1)
    made, of_kernel = volumes({f"o{i}": x for i, x in enumerate(things)})
    for batch in made.kernel.batches:
        for i in range(len(batch)):
            thing = replace(things[int(batch.names[i][1:])], material="glass")
            low, high = bounding_box(thing)
            p = rng.uniform(low - 0.2 * (high - low), high + 0.2 * (high - low), (3000, 3))
            q, row = made.a.put(made.a.W, p.T), dr.full(made.a.U, i, len(p))
            found = np.array(batch.kind.inside(rows(batch.placed, row), q))
            at_surface = np.array(touches(batch.rows_at(row), *batch.kind.surface_at(rows(batch.placed, row), q), q))
            differs = (found != inside(thing, p)) & ~at_surface
            assert not differs.any() and 0 < found.sum() < len(p)
            measured, (volume, error) = measured_volume(thing, rng), of_kernel[batch.names[i]]
            assert abs(measured.volume - volume) <= error + SIGMAS * measured.error + 1e-9 * volume


def by_bounding_ball(scene: vr.Scene, batches: Any, a: Any) -> list[Any]:
    """The order of solids by the size of their bounding balls, as it once was."""
    radii = [np.broadcast_to(np.array(b.numbers.bounds(b.outer).radius), len(b)) for b in batches]
    rank = np.argsort(np.argsort(np.concatenate(radii), kind="stable")).astype(np.uint32)
    return [a.put(a.U, part) for part in np.split(rank, np.cumsum([len(b) for b in batches])[:-1])]


@pytest.mark.slow
def test_the_check_fails_if_bounding_balls_decide(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thin rod through a ball of water that is a little shorter."""
    scene = scene_of(rod(2.1))
    report = check(scene, rays=1000)
    assert report.passed and report.media.compared > 300, report.examples
    monkeypatch.setattr(kernel_scene.nesting, "ranks", by_bounding_ball)
    report = check(scene, rays=1000)
    assert not report.passed and report.media.mismatches > 20
    failed = {t.name for t in report.tolerances if not t.ok}
    assert failed == {"media: mismatches"}
    assert any("visray hidden, by the scene from water to rod, ratio 0.88" in text for text in report.examples)
    # The ball is larger than the shorter rod by both measures.
    assert differences(scene_of(rod(1.9))).mismatches == 0


def test_another_priority_or_index_in_the_file_is_told() -> None:
    scene = scene_of(rod(2.1), **with_priorities(crown=-2.0))
    assert differences(scene).mismatches == 0
    assert differences(scene, scene_of(rod(2.1))).mismatches > 20
    other = replace(scene, materials=scene.materials | {"water": replace(MEDIA["water"], ior=1.34)})
    assert differences(scene, other).mismatches > 100


RING = vr.Mesh(vertices=SOLIDS["ring"][0], faces=SOLIDS["ring"][1])
TANGLES = {
    "convex": (vr.Sphere(radius=0.8), vr.Box(transform=(Scale(scale=1.4),)), vr.Cylinder(radius=0.3, height=2.5),
               vr.Cone(base=(0, -0.8, 0), radius=0.7, height=1.7)),
    "round": (vr.Ellipsoid(radii=(1.2, 0.3, 0.5)), vr.Capsule(radius=0.2), vr.Torus(major=0.9, minor=0.25)),
    "meshes": (RING, vr.Mesh(vertices=SOLIDS["ball"][0], faces=SOLIDS["ball"][1]),
               vr.Instance(geometry="ring", transform=(Scale(scale=(0.8, -0.7, 0.9)),))),
    "polynomials": (vr.Polynomial(expression="x^4+y^4+z^4-0.4", ends="capped"),
                    vr.Polynomial(expression="x^2+y^2-z^2-0.1", ends="capped", clip=Ball(radius=1.1)), vr.Box()),
}  # fmt: skip


@pytest.mark.parametrize("name", TANGLES)
@pytest.mark.slow
def test_solids_in_each_other_have_the_media_of_the_witness(name: str) -> None:
    """With and without priorities, beside a clear sheet and an opaque ball."""
    rng, objects = np.random.default_rng(3), {}
    for i, shape in enumerate(TANGLES[name]):
        at, turn = tuple((0.3 * rng.normal(size=3)).tolist()), float(rng.uniform(0, 360))
        steps = (*shape.transform, Rotate(rotate=turn, axis=(1, 2, 3)), Translate(translate=at))
        objects[f"o{i}"] = replace(shape, transform=steps, material=list(MEDIA)[i % 4])
    objects |= {"sheet": vr.Disk(radius=2.0, material="crown"), "core": vr.Sphere(radius=0.2)}
    scene = replace(scene_of(objects), geometries={"ring": RING})
    for materials in ({}, with_priorities(crown=1.0, flint=-1.0)):
        found = differences(replace(scene, materials=scene.materials | materials))
        assert found.mismatches == 0 and found.compared > 0.5 * found.crossings > 300


@pytest.mark.slow
def test_what_touches_and_what_coincides() -> None:
    """Boxes with a common face, and two balls in one place, whose order the witness does not know."""
    box = vr.Box(min=(-0.8, -0.7, -0.6), max=(0.9, 0.1, 0.5), material="crown")
    touching = {"a": box, "b": replace(box, min=(-0.8, 0.1, -0.6), max=(0.9, 0.8, 0.5), material="water")}
    found = differences(scene_of(touching))
    assert found.mismatches == 0 and found.compared > 300
    twins = {"a": vr.Sphere(material="crown"), "b": vr.Sphere(center=(0.1, 0, 0), material="water")}
    found = differences(scene_of(twins))
    assert found.mismatches == 0 and found.unordered > 100


def test_the_media_of_a_union_are_those_of_its_operands() -> None:
    """Each operand has its own medium, and the small ball counts inside the large one. Other indices are told."""
    balls = {
        "large": vr.Sphere(radius=1.0, material="water"),
        "small": vr.Sphere(center=(0.8, 0, 0), radius=0.6, material="crown"),
    }

    def union(*materials: str) -> vr.Scene:
        of = {name: replace(ball, material=m) for (name, ball), m in zip(balls.items(), materials)}
        return scene_of({"both": vr.Csg(op="union", of=of)})

    united, swapped = union("water", "crown"), union("crown", "water")
    found = differences(united)
    assert found.compared > 300 and found.mismatches == 0
    assert differences(united, swapped).mismatches > 0.5 * found.compared


def test_scenes_without_media_are_left_out() -> None:
    opaque, flat = {"a": vr.Sphere(), "b": vr.Box()}, {"pane": vr.Disk(material="crown")}
    for objects in (opaque, flat):
        assert differences(scene_of(objects)).rays == 0
    deep = scene_of(rod(2.1))
    assert differences(replace(deep, settings=replace(deep.settings, depth=0))).rays == 0
    many = {f"b{i}": vr.Sphere(center=(float(i), 0, 0), material="crown") for i in range(media.MOST_TRANSPARENT + 1)}
    assert media.compare(scene_of(many), scene_of(many), 0)[2] == ["not compared: media (65 transparent solids)"]
    assert prepare(deep).features["nested media"]
