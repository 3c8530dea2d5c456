"""Tracks of the type spin without a center: what is at their address turns about the centre of its bounding box."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from samples import SAMPLES
from track_samples import DURATION, SCENE, keys, moving

import visray as vr
from visray.primitives.primitive import bounding_box
from visray.scene import moved_scene
from visray.scene.check import checked
from visray.transforms import Transform, compose

TIMES = np.linspace(0, DURATION, 9)
STEPS = (vr.Scale(scale=(1.0, 2.0, 1.0)), vr.Rotate(rotate=30, axis=(1, 2, 3)), vr.Translate(translate=(1, 2, -1)))
EPS = np.finfo(float).eps
AXIS = (1.0, 2.0, 0.5)


def spin(of: str, **more: Any) -> vr.SpinTrack:
    return vr.SpinTrack(of=of, axis=AXIS, **more)


def scene_of(shapes: Mapping[str, Any], *tracks: Any, **more: Any) -> vr.Scene:
    """A scene with some objects and tracks, checked."""
    named = {f"track{i}": track for i, track in enumerate(tracks)}
    moves = vr.Animation(duration=DURATION, tracks=named)
    return checked(vr.Scene(objects=shapes, animation=moves, **({"camera": vr.Camera(), "lights": {}} | more)))


def mapped(steps: tuple[Transform, ...], point: Any) -> np.ndarray:
    """A point after the steps of a transform."""
    matrix = compose(steps)
    return np.array(point, float) if matrix is None else matrix[:, :3] @ point + matrix[:, 3]


def turn_of(steps: tuple[Transform, ...]) -> np.ndarray:
    """The linear part of a transform."""
    return np.eye(3) if not steps else compose(steps)[:, :3]


def checks_in_place(scene: vr.Scene, of: str, middle: Any, before: tuple[Transform, ...] = ()) -> None:
    """Checks that a shape turns about the image of a point, which rests. before: the transform at rest."""
    size = 1 + np.abs(middle).max() + np.abs(mapped(before, middle)).max()
    seen = [vr.value(vr.at(scene, t), f"{of}.transform") for t in TIMES]
    assert len({len(steps) for steps in seen}) == 1
    for t, steps in zip(TIMES, seen):
        # Some tens of roundings of the coordinates.
        assert mapped(steps, middle) == pytest.approx(mapped(before, middle), abs=256 * EPS * size)
        angle = turn_of(steps) @ np.linalg.inv(turn_of(before))
        assert np.trace(angle) == pytest.approx(1 + 2 * np.cos(2 * np.pi * t / DURATION), abs=256 * EPS * size)


@pytest.mark.parametrize("steps", [(), STEPS], ids=["at rest", "transformed"])
@pytest.mark.parametrize("name", SAMPLES)
def test_a_shape_turns_about_the_centre_of_its_box(name: str, steps: tuple[Transform, ...]) -> None:
    shape = SAMPLES[name].posed.with_fields(material="default", transform=())
    box = bounding_box(shape)
    middle = (0, 0, 0) if box is None else 0.5 * (np.ravel(box[0]) + np.ravel(box[1]))
    middle = getattr(shape, "point", middle) if box is None else middle
    scene = scene_of({"shape": shape.with_fields(transform=steps)}, spin("objects.shape"))
    checks_in_place(scene, "objects.shape", np.array(middle, float), steps)


def test_the_box_of_a_mesh_is_that_of_its_vertices() -> None:
    vertices = np.array([[1, 1, 0], [4, 1, 0], [1, 2, 8], [0, 0, 0]], float)
    mesh = vr.Mesh(vertices=vertices, faces=[[0, 1, 2], [0, 2, 3]])
    checks_in_place(scene_of({"mesh": mesh}, spin("objects.mesh")), "objects.mesh", (2, 1, 4))
    fitted = mesh.with_fields(fit=2.0)
    checks_in_place(scene_of({"mesh": fitted}, spin("objects.mesh")), "objects.mesh", (0, 0, 0))


def test_endless_and_empty_solids_turn_about_the_origin() -> None:
    ground, ball = vr.Plane(point=(0, 3, 0)), vr.Sphere(center=(5, 0, 0))
    for shapes in ((ground, ball), (vr.Sphere(), ball)):
        cut = vr.Csg(op="union" if shapes[0] is ground else "intersection", of=shapes)
        checks_in_place(scene_of({"cut": cut}, spin("objects.cut")), "objects.cut", (0, 0, 0))


def test_instances_geometries_and_operands_turn_in_place() -> None:
    drop = vr.Cone(base=(1, 2, 0), transform=STEPS)
    middle = 0.5 * np.sum(np.reshape(bounding_box(drop.with_fields(transform=())), (2, 3)), axis=0)
    copy, away = vr.Instance(geometry="drop", transform=STEPS[1:]), vr.Translate(translate=(3, 0, 0))
    bite = vr.Csg(op="difference", of=(vr.Box(), vr.Sphere(center=(1, 2, 3), transform=(away,))))
    shapes, geometries = {"copy": copy, "bite": bite}, {"drop": drop}
    scene = scene_of(shapes, spin("objects.copy"), geometries=geometries)
    checks_in_place(scene, "objects.copy", mapped(STEPS, middle), STEPS[1:])
    checks_in_place(scene_of(shapes, spin("geometries.drop"), geometries=geometries), "geometries.drop", middle, STEPS)
    checks_in_place(scene_of(shapes, spin("objects.bite.of.1"), geometries=geometries), "objects.bite.of.1", (1, 2, 3),
                    (away,))  # fmt: skip
    both = scene_of(shapes, spin("objects.copy"), spin("geometries.drop"), geometries=geometries)
    checks_in_place(both, "objects.copy", mapped(STEPS, middle), STEPS[1:])


@pytest.mark.parametrize("base", [vr.GlobeBase, vr.MapBase, vr.PlaneBase])
def test_the_base_of_data_turns_about_its_centre(base: type) -> None:
    layer = vr.DataLayer(source={"lon": [0.0, 1.0], "lat": [0.0, 1.0], "x": [1.0, 2.0]}, color=vr.ColorRule(column="x"))
    data = vr.Data(base=base(center=(1, 2, 3)), layers={"rain": layer})
    checks_in_place(scene_of({}, spin("data.base"), data=data), "data.base", (1, 2, 3))


def test_a_ball_turns_about_the_centre_that_moves() -> None:
    ball = vr.Sphere(center=(1, 0, 0), transform=STEPS)
    flight = keys("objects.ball.center", (1, 0, 0), (2, 5, 0), (4, 0, 1))
    for tracks in ((flight, spin("objects.ball")), (spin("objects.ball"), flight)):
        scene = scene_of({"ball": ball}, *tracks)
        for t in TIMES:
            now = vr.at(scene, t).objects["ball"]
            assert mapped(now.transform, now.center) == pytest.approx(mapped(STEPS, now.center), abs=256 * EPS)


def test_the_turn_follows_the_steps_that_move() -> None:
    die = vr.Box(min=(0, 0, 0), max=(2, 2, 2), transform=STEPS)
    flight = keys("objects.die.transform.2.translate", (0, 0, 0), (6, 0, 0))
    steps = [{"rotate": 0.0}, {"translate": (0, 0, 0)}], [{"rotate": 90.0}, {"translate": (6, 0, 0)}]
    for track in (flight, keys("objects.die.transform", *steps)):
        alone, both = (scene_of({"die": die}, *x) for x in ((track,), (track, spin("objects.die"))))
        for t in TIMES:
            moved, turned = (vr.at(x, t).objects["die"].transform for x in (alone, both))
            assert len(turned) == len(moved) + 3
            assert mapped(turned, (1, 1, 1)) == pytest.approx(mapped(moved, (1, 1, 1)), abs=256 * EPS)
            # The turn comes last.
            expected = vr.Rotate(rotate=360 * t / DURATION, axis=AXIS)
            assert turn_of(turned) == pytest.approx(turn_of((expected,)) @ turn_of(moved), abs=256 * EPS)


def test_an_instance_turns_about_the_centre_of_its_geometry_that_grows() -> None:
    scene = moving(keys("geometries.drop.center", (0, 0, 0), (1, 0, 0)), spin("objects.copy"))
    for t in TIMES:
        now = vr.at(scene, t)
        center, rest = now.geometries["drop"].center, SCENE.objects["copy"].transform
        assert mapped(now.objects["copy"].transform, center) == pytest.approx(mapped(rest, center), abs=256 * EPS)


def test_a_written_centre_stays_where_it_is() -> None:
    flight = keys("objects.ball.center", (0, 0, 0), (2, 5, 0))
    for center in ((0, 0, 0), (1, 2, 3)):
        for tracks in ((spin("objects.ball", center=center),), (flight, spin("objects.ball", center=center))):
            checks_in_place(moving(*tracks), "objects.ball", center)


@pytest.mark.parametrize("track", [None, keys("objects.mesh.transform.0.translate", (0, 0, 0), (1, 2, 3))])
def test_the_box_is_found_once(track: vr.KeysTrack | None, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    monkeypatch.setattr(moved_scene, "bounding_box", lambda shape: found.append(shape) or bounding_box(shape))
    mesh = SCENE.objects["mesh"].with_fields(transform=(vr.Translate(translate=(0, 0, 0)),))
    scene = scene_of({"mesh": mesh}, spin("objects.mesh"), *([track] if track else []))
    for t in TIMES:
        vr.at(scene, t)
    assert len(found) == 1
