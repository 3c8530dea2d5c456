"""The fit of a camera and of lights to many things: bounds of all shapes at once are those of each shape, views that
are not looked at would not have been taken, and no fit is made twice."""

import warnings

import numpy as np
import pytest
from samples import NAMES, instances

import visray as vr
from visray import fitted_scene
from visray.errors import FittedNote, UserError
from visray.fitted_scene import ENOUGH, WINDOW, completed
from visray.fitting import Balls, fitted_origin, fitted_view
from visray.primitives.primitive import scalars, transform_frame
from visray.scene.check import checked, checked_as_written
from visray.shape_bounds import bounds_of
from visray.surroundings import Stage
from visray.things import ROUND, corners_of, things_of


def some_scenes() -> list[vr.Scene]:
    """Scenes of all kinds of objects, with and without transforms, of few and of many objects."""
    rng, scenes = np.random.default_rng(2), []
    for seed in range(12):
        names = rng.choice(NAMES, rng.integers(1, 30))
        objects = {
            f"{name}{i}": instances(name, 50 * seed + i, 1, bool(i % 2), decades=1)[0] for i, name in enumerate(names)
        }
        scenes.append(vr.Scene(objects=objects, film=vr.Film(width=int(rng.integers(50, 400)), height=200)))
    return scenes


def one_by_one(shape) -> np.ndarray | None:
    """The low corner, the high corner, the centre and the radius of a shape, by its own methods; None if unbounded."""
    if not shape.bounded:
        return None
    bounds = scalars(shape).bounds(transform_frame(shape))
    return np.concatenate([np.ravel(x) for x in (bounds.low, bounds.high, bounds.centre, bounds.radius)])


def test_bounds_of_many_shapes_are_those_of_each():
    """Bit for bit, in any order and number."""
    shapes = [x for name in NAMES for moved in (False, True) for x in instances(name, 7, 5, moved, decades=2)]
    scene = vr.Scene(objects={f"o{i}": x for i, x in enumerate(shapes)})
    shapes = [scene.placed_shape(x) for x in np.random.default_rng(0).permutation(np.array(shapes, object))]
    found = bounds_of(shapes)
    rows = np.concatenate([found.low, found.high, found.centre, found.radius[:, None]], axis=1)
    expected = [one_by_one(x) for x in shapes]
    assert np.array_equal(np.isnan(rows).all(axis=1), [x is None for x in expected])
    for row, other in zip(rows, expected):
        assert other is None or np.array_equal(row, other)
    assert len(bounds_of([]).radius) == 0


def test_things_have_the_box_or_the_ball_of_their_shape():
    for thing in (x for scene in some_scenes() for x in things_of(scene)):
        if thing.balls is None:
            continue
        *box, radius = one_by_one(thing.shape)
        low, high, centre = np.reshape(box, (3, 3))
        half = 0.5 * np.linalg.norm(high - low)
        assert np.array_equal(thing.low, low) and np.array_equal(thing.high, high)
        if radius < ROUND * half:
            assert np.array_equal(thing.balls.centre, [centre]) and thing.balls.radius == thing.reach == radius
        else:
            assert np.array_equal(thing.balls.centre, corners_of(low, high)) and not thing.balls.radius.any()
            assert thing.reach == half


def test_corners_of_a_box_are_all_choices_of_its_sides():
    low, high = np.array([1.0, 2.0, 3.0]), np.array([4.0, 6.0, 8.0])
    assert corners_of(low, high).tolist() == [[x, y, z] for x in (1, 4) for y in (2, 6) for z in (3, 8)]
    assert np.array_equal(corners_of(np.array([low, high]), np.array([high, low]))[1], corners_of(high, low))


def test_the_origin_alone_is_that_of_the_view():
    rng = np.random.default_rng(3)
    for _ in range(20):
        shown = Balls(rng.normal(size=(9, 3)), rng.uniform(0, 1, 9))
        axes, fov = fitted_scene._axes(*rng.uniform(-80, 80, 2)), rng.uniform(20, 80)
        camera = fitted_view(shown, axes, 1.5, WINDOW, fov=fov)
        assert camera.origin == fitted_origin(shown, axes, 1.5, WINDOW, fov)


def test_views_that_are_not_looked_at_would_not_have_been_taken(monkeypatch):
    """The first candidate is taken at once if it is good enough. So the fit is that of a search of all candidates."""

    def search_all(candidates, worth_of):
        worth = worth_of(candidates)
        first = int(np.argmax(worth >= ENOUGH * worth.max()))
        return candidates[first], worth[first]

    scenes = [checked_as_written(x) for x in some_scenes()]
    room = {"room": vr.Box(min=(-4, 0, -4), max=(4, 5, 4)), "wall": vr.Box(min=(0.6, 0, -2), max=(0.7, 2, 2))}
    scenes += [vr.Scene(objects={"ball": vr.Sphere(radius=0.5), "floor": vr.Plane(), **x}) for x in ({}, room)]
    found = [completed(x)[0] for x in scenes]
    monkeypatch.setattr(fitted_scene, "_first_enough", search_all)
    monkeypatch.setattr(fitted_scene, "_fits", fitted_scene.IdentityCache())
    expected = [completed(x)[0] for x in scenes]
    assert [(x.camera, x.lights) for x in found] == [(x.camera, x.lights) for x in expected]


FIRST = {"ball": vr.Sphere(center=(0, 1, 0)), "floor": vr.Plane()}
MANY = {f"ball{i}": vr.Sphere(center=(i % 7, (i * i) % 5, i % 11), radius=0.1 + 0.02 * (i % 4)) for i in range(100)}


@pytest.mark.parametrize(
    ("objects", "origin", "target", "key", "fill"),
    [
        (
            FIRST,
            (2.61594, 3.03058, 3.73596),
            (0.0, 1.0, 0.0),
            (-0.33146, 4.6282, 4.76721),
            (5.05774, 4.22662, -0.09013),
        ),
        (
            MANY,
            (13.0331, 9.56865, 20.72846),
            (2.50623, 1.39735, 5.69454),
            (0.90377, 24.94627, 35.1498),
            (39.74668, 9.37434, 10.93601),
        ),
    ],
)
def test_fitted_values_stay(objects, origin, target, key, fill):
    scene = completed(checked_as_written(vr.Scene(objects=objects)))[0]
    assert (scene.camera.origin, scene.camera.target) == (origin, target)
    assert (scene.lights["key"].position, scene.lights["fill"].position) == (key, fill)


@pytest.fixture
def fits(monkeypatch) -> list:
    """A list that gets an entry for each fit."""
    made, of = [], Stage.of
    monkeypatch.setattr(Stage, "of", staticmethod(lambda things: made.append(len(things)) or of(things)))
    warnings.simplefilter("ignore", FittedNote)
    return made


def keys(address: str, *values) -> vr.KeysTrack:
    return vr.KeysTrack(address=address, times=tuple(map(float, range(len(values)))), values=values)


TRACKS = {
    "none": {},
    "an object": {"go": keys("objects.ball.center", (5.0, 1.0, 0.0), (0.0, 1.0, 0.0))},
    "a spin": {"turn": vr.SpinTrack(of="objects.box")},
    "the camera": {"around": vr.OrbitTrack()},
    "a light": {"lift": keys("lights.key.position", (0.0, 50.0, 0.0), (1.0, 60.0, 0.0))},
    "a camera that begins at rest": {
        "around": vr.OrbitTrack(),
        "grow": keys("objects.ball.radius", 1.0, 3.0),
    },
}
OBJECTS = {"ball": vr.Sphere(center=(0, 1, 0)), "box": vr.Box(min=(2, 0, 0), max=(3, 1, 1)), "floor": vr.Plane()}


@pytest.mark.parametrize("camera", [None, vr.Camera(origin=(0, 3, 20))])
@pytest.mark.parametrize("name", TRACKS)
def test_an_animated_scene_is_fitted_once(name, camera, fits):
    """Also if its check needs the fitted camera. A camera that moves beside an object which begins elsewhere than at
    rest needs two different fits: that at rest for the check, and that to the beginning."""
    parts = {"objects": OBJECTS, "camera": camera}
    scene = checked(vr.Scene(**parts, animation=vr.Animation(duration=1, tracks=TRACKS[name])))
    assert len(fits) == 1
    assert scene.lights and scene.camera is not None
    both = {**TRACKS["the camera"], **TRACKS["an object"]}
    checked(vr.Scene(**parts, animation=vr.Animation(duration=1, tracks=both)))
    assert len(fits) == (3 if camera is None else 2)


def test_a_file_with_an_animation_is_fitted_once(tmp_path, fits):
    path = tmp_path / "a.json"
    path.write_text(
        '{"objects": {"ball": {"type": "sphere"}}, "animation": {"duration": 1, "tracks": {"o": {"type": "orbit"}}}}'
    )
    assert vr.load(path).camera is not None
    assert len(fits) == 1


def test_the_fit_of_an_animated_scene_is_that_of_its_beginning(fits):
    """Whatever the tracks move, and also where the check needs no fit."""
    begins = {"an object": {"ball": vr.Sphere(center=(5, 1, 0))}}
    for name, tracks in TRACKS.items():
        scene = checked(vr.Scene(objects=OBJECTS, animation=vr.Animation(duration=1, tracks=tracks)))
        other = checked(vr.Scene(objects=OBJECTS | begins.get(name, {})))
        assert (scene.camera, scene.lights) == (other.camera, other.lights)


def test_messages_about_tracks_know_scenes_without_camera_and_lights():
    """A track that names nothing is told what it may mean, also a part of what is fitted."""
    for address, meant in (("origin", "camera.origin"), ("ball.center", "objects.ball.center")):
        tracks = {"t": keys(address, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))}
        with pytest.raises(vr.UserError, match=f"is no address; write {meant}"):
            checked(vr.Scene(objects=OBJECTS, animation=vr.Animation(duration=1, tracks=tracks)))
    lamp = {"lights": {"lamp": vr.PointLight(position=(9, 9, 9))}}
    tracks = {"t": keys("lights.key.position", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))}
    with pytest.raises(vr.UserError, match="lights has no 'key'; one of lamp"):
        checked(vr.Scene(objects=OBJECTS, animation=vr.Animation(duration=1, tracks=tracks), **lamp))


@pytest.mark.parametrize("ball", [vr.Sphere(radius=1e-9), vr.Sphere(radius=1e9), vr.Sphere(center=(1e9, 0, 0))])
def test_what_no_camera_and_no_lights_fit_is_told_as_such(ball):
    """Their numbers would be out of the limits of a scene, and no user has written those."""
    with pytest.raises(UserError, match=r"^camera and lights: what the scene shows is too .* write camera and lights"):
        checked(vr.Scene(objects={"ball": ball}))


def test_what_no_lights_fit_is_told_as_such():
    with pytest.raises(UserError, match=r"^lights: what the scene shows is too small, .*; write lights, or scale"):
        checked(vr.Scene(objects={"ball": vr.Sphere(radius=1e9)}, camera=vr.Camera()))
