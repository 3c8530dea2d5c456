"""A scene without a camera or lights gets fitted ones: all that is bounded is in the picture, the lights are above the
floor and in the room, and what is written is never changed."""

import json
import warnings
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from samples import NAMES, aimed, instances, truth

import visray as vr
import visray.warn
from visray.blocking import TESTS, Blocker
from visray.cli import main
from visray.errors import FittedNote
from visray.fitted_scene import completed
from visray.lights import KINDS as LIGHTS
from visray.scene.check import checked
from visray.surroundings import Stage
from visray.things import things_of

UNIT = np.concatenate([np.eye(3), -np.eye(3)])
BALL = {"type": "sphere", "center": [0, 1, 0]}
FLOOR = {"type": "plane"}


def fitted(**parts) -> vr.Scene:
    """A checked scene of these parts, without notes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FittedNote)
        return checked(vr.Scene(**parts))


@contextmanager
def noted():
    """Expects a FittedNote, also if it was said before."""
    visray.warn._SAID.clear()
    with pytest.warns(FittedNote):
        yield


def in_the_picture(scene: vr.Scene, points: np.ndarray) -> np.ndarray:
    """Mask of the points that the picture of a scene shows, hidden or not."""
    found = vr.projected(scene, points)
    return np.asarray(found.x >= 0) & (found.x < scene.film.width) & (found.y >= 0) & (found.y < scene.film.height)


def surface_points(thing, seed: int) -> np.ndarray:
    """Some points of an object, by its slow twin."""
    o, d = aimed(np.random.default_rng(seed), thing, 400)
    found = truth(thing, o, d)
    on = found.what == 1
    return np.asarray(o + np.where(on, found.t, 0)[:, None] * d, float)[on]


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_all_points_of_bounded_objects_are_in_the_picture(name, moved):
    """Objects of all kinds and sizes, in pictures of several shapes."""
    things = instances(name, 3, 4, moved, decades=1)
    for film in (vr.Film(), vr.Film(width=100, height=300), vr.Film(width=500, height=100)):
        for count in (1, 4):
            scene = fitted(objects={f"o{i}": x for i, x in enumerate(things[:count])}, film=film)
            if not things[0].bounded:
                assert scene.camera == vr.Camera()
                continue
            around = {x.address for x in Stage.of(things_of(scene)).around}
            for i, thing in enumerate(things[:count]):
                if f"objects.o{i}" not in around:
                    assert in_the_picture(scene, surface_points(thing, i)).all()


@pytest.mark.parametrize("kind", [k for k in LIGHTS if "visible" in {f.name for f in fields(k)}])
def test_visible_lights_are_in_the_picture(kind):
    """Others are not looked at."""
    place, objects = (5.0, 4.0, 1.0), {"ball": vr.Sphere()}
    lamp = kind(position=place, visible=True)
    scene = fitted(objects=objects, lights={"lamp": lamp})
    assert in_the_picture(scene, np.array([place])).all()
    hidden = fitted(objects=objects, lights={"lamp": replace(lamp, visible=False)})
    assert hidden.camera == fitted(objects=objects).camera and hidden.camera != scene.camera


def test_the_picture_is_filled():
    """A ball touches the margin of the picture in its shorter direction."""
    scene = fitted(objects={"ball": vr.Sphere(center=(3, 4, 5), radius=2)}, film=vr.Film(width=300, height=200))
    image = vr.render(scene, spp=1, layers=("id",), progress=False)
    rows = np.flatnonzero((image["id"] > 0).any(axis=1))
    assert np.abs([rows[0] - 0.09 * 200, 199 - rows[-1] - 0.09 * 200]).max() < 3


def test_y_is_up_and_the_view_is_from_the_side_and_from_above():
    camera = fitted(objects={"ball": vr.Sphere(center=(0, 1, 0)), "floor": vr.Plane()}).camera
    towards = np.subtract(camera.origin, camera.target) / np.linalg.norm(np.subtract(camera.origin, camera.target))
    assert camera.up == (0, 1, 0)
    assert np.degrees(np.arcsin(towards[1])) == pytest.approx(24, abs=0.1)
    assert np.degrees(np.arctan2(towards[0], towards[2])) == pytest.approx(35, abs=0.1)


ROOM = {
    "floor": vr.Plane(),
    "ceiling": vr.Plane(point=(0, 4, 0), normal=(0, -1, 0)),
    "left": vr.Plane(point=(-3, 0, 0), normal=(1, 0, 0)),
    "right": vr.Plane(point=(3, 0, 0), normal=(-1, 0, 0)),
    "back": vr.Plane(point=(0, 0, -3), normal=(0, 0, 1)),
    "front": vr.Plane(point=(0, 0, 3), normal=(0, 0, -1)),
}
LIGHTED = {
    "floor": {"floor": vr.Plane()},
    "ceiling": {"ceiling": vr.Plane(point=(0, 2.5, 0))},
    "wall in front": {"wall": vr.Rectangle(center=(3, 1, 3), width=(4, 0, -4), height=(0, 4, 0))},
    "ground ball": {"ground": vr.Sphere(center=(0, -1000, 0), radius=1000)},
    "sky": {"sky": vr.Sphere(radius=500), "floor": vr.Plane()},
    "box room": {"room": vr.Box(min=(-4, 0, -4), max=(4, 5, 4))},
    "plane room": ROOM,
}


@pytest.mark.parametrize("name", LIGHTED)
def test_camera_and_lights_are_where_the_ball_is_seen(name):
    """Nothing opaque lies between the ball and the camera, or between it and the lights, and nothing cuts a light."""
    around = LIGHTED[name]
    scene = fitted(objects={"ball": vr.Sphere(center=(0, 1, 0)), **around})
    places = np.array([scene.camera.origin, *(x.position for x in scene.lights.values())])
    for other in around.values():
        blocker = Blocker.of(other)
        assert not blocker.blocks(np.tile([0.0, 1.0, 0.0], (3, 1)), places).any()
        for light in scene.lights.values():
            p = np.tile(light.position, (6, 1))
            assert not blocker.blocks(p, p + light.radius * UNIT).any()
    assert in_the_picture(scene, surface_points(vr.Sphere(center=(0, 1, 0)), 0)).all()


@pytest.mark.parametrize("height", [0.0, -0.3, -5.0])
def test_lights_are_above_the_floor(height):
    """With their whole balls, also if a camera is given that looks along the floor or from below it."""
    floor = vr.Plane(point=(0, height, 0))
    for camera in (None, vr.Camera(origin=(0, height + 0.1, 9), target=(0, 1, 0))):
        scene = fitted(camera=camera, objects={"ball": vr.Sphere(center=(0, 1.1 + height, 0)), "floor": floor})
        for light in scene.lights.values():
            assert light.position[1] - light.radius > height


def test_lights_stand_to_a_given_camera():
    """Of a camera along any axis: the key light is at its upper left, and the fill light at its right."""
    for origin in ((0, 2, 9), (9, 2, 0), (-6, 3, -6)):
        camera = vr.Camera(origin=origin, target=(0, 1, 0))
        scene = fitted(camera=camera, objects={"ball": vr.Sphere(center=(0, 1, 0))})
        assert scene.camera == camera
        forward = np.subtract(camera.target, origin)
        right = np.cross(forward, camera.up)
        key, fill = (np.subtract(scene.lights[name].position, camera.target) for name in ("key", "fill"))
        assert key @ right < 0 < fill @ right
        assert key[1] > 0


def test_large_surroundings_need_not_be_in_the_picture():
    """A floor of a ball, of a box or of a disk, and a sky; but a row of things of all sizes is seen as a whole."""
    small = {"a": vr.Sphere(center=(-1, 0.5, 0), radius=0.5), "b": vr.Sphere(center=(1, 0.5, 0), radius=0.5)}
    for large in (
        vr.Sphere(center=(0, -100, 0), radius=100),
        vr.Box(min=(-50, -0.1, -50), max=(50, 0, 50)),
        vr.Disk(radius=60),
        vr.Sphere(radius=900),
    ):
        assert [x.address for x in Stage.of(things_of(vr.Scene(objects=small | {"it": large}))).around] == [
            "objects.it"
        ]
    apart = small | {"moon": vr.Sphere(center=(900, 0, 0), radius=70), "speck": vr.Sphere(radius=1e-3)}
    assert Stage.of(things_of(vr.Scene(objects=apart))).around == ()


@pytest.mark.parametrize("kind", TESTS, ids=lambda x: x.__name__)
@pytest.mark.parametrize("moved", [False, True])
def test_blocked_agrees_with_the_slow_twin(kind, moved):
    rng = np.random.default_rng(5)
    for seed in range(4):
        [thing] = instances(kind.__name__, seed, 1, moved, decades=1)
        o, d = aimed(rng, thing, 200)
        found = truth(thing, o, d)
        hit = np.asarray(found.sure) & (found.what == 1)
        t = np.asarray(found.t, float)
        for share in (0.4, 0.9, 1.1):
            end = o + (share * np.where(hit, t, 1.0))[:, None] * d
            assert (Blocker.of(thing).blocks(o, end)[hit] == (share > 1)).all()
        missed = np.asarray(found.sure) & (found.what == 0)
        assert not Blocker.of(thing).blocks(o, o + 1e3 * d)[missed].any()


def test_a_scene_of_nothing_has_the_default_camera_and_no_lights():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = checked(vr.Scene())
    assert (scene.camera, scene.lights) == (vr.Camera(), {})


def test_what_is_written_stays():
    """Also what is explicitly empty. Nothing is said."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = checked(vr.Scene(camera=vr.Camera(), lights={}, objects={"ball": vr.Sphere(center=(50, 0, 0))}))
    assert (scene.camera, scene.lights) == (vr.Camera(), {})


def test_an_explicitly_empty_file_stays_empty(tmp_path):
    path = write(tmp_path, {"camera": {}, "lights": {}, "objects": {"ball": BALL}})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = vr.load(path)
    assert (scene.camera, scene.lights) == (vr.Camera(), {})
    assert json.loads(vr.dump(scene)) == {
        "camera": {},
        "lights": {},
        "objects": {"ball": {"type": "sphere", "center": [0.0, 1.0, 0.0]}},
    }


def write(folder: Path, content: dict) -> Path:
    path = folder / "a.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize("parts", [{}, {"camera": {"origin": [0, 2, 7]}}, {"lights": {}}])
def test_import_writes_out_what_was_fitted(tmp_path, parts, capsys):
    """A note says so, once; the file that is written has a camera and lights, and gives no note."""
    path = write(tmp_path, parts | {"objects": {"ball": BALL, "floor": FLOOR}})
    out = tmp_path / "b.json"
    assert main(["import", str(path), "-o", str(out)]) == 0
    said = [x for x in capsys.readouterr().err.splitlines() if "fitted" in x]
    assert len(said) == 1
    assert ("no camera" in said[0], "no lights" in said[0]) == ("camera" not in parts, "lights" not in parts)
    assert {"camera", "lights"} <= set(json.loads(out.read_text()))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FittedNote)
        expected = vr.load(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert vr.load(out) == expected


def test_the_note_is_said_once_by_a_command(tmp_path, capsys):
    path = write(tmp_path, {"objects": {"ball": BALL}, "film": {"width": 8, "height": 6}, "settings": {"spp": 1}})
    assert main(["render", str(path), "-o", str(tmp_path / "a.png"), "--set", "camera.fov=30"]) == 0
    assert capsys.readouterr().err.count("fitted") == 1
    assert main(["explain", str(path)]) == 0


def test_the_note_is_said_once_in_a_process():
    """Of another scene it is said again, and Python's filters make no difference."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for radius in (1.0, 2.0):
            checked(vr.Scene(objects={"ball": vr.Sphere(radius=radius)}))
        assert [w.category for w in caught] == [FittedNote]
        checked(vr.Scene(objects={"box": vr.Box()}))
    assert [w.category for w in caught] == [FittedNote] * 2


def test_addresses_of_what_is_fitted(tmp_path):
    """They can be read and changed. Other changes leave a scene without camera and lights as it is, and come first."""
    bare = vr.Scene(objects={"ball": vr.Sphere()})
    with noted():
        assert vr.value(bare, "camera.origin") == fitted(objects=bare.objects).camera.origin
    with noted():
        changed = vr.replaced(bare, "camera.fov", 50.0)
    assert changed == replace(fitted(objects=bare.objects), camera=changed.camera)
    assert changed.camera == replace(fitted(objects=bare.objects).camera, fov=50.0)
    larger = vr.replaced(bare, "objects.ball.radius", 3.0)
    assert (larger.camera, larger.lights) == (None, None)
    with noted():
        from visray.scene.address import changed as both

        made = both(bare, {"camera.fov": 50.0, "objects.ball.radius": 3.0})
    assert made.camera.origin == fitted(objects=larger.objects).camera.origin


def test_a_camera_is_fitted_to_the_size_that_is_asked_for(tmp_path):
    path = write(tmp_path, {"objects": {"a": BALL, "b": BALL | {"center": [9, 1, 0]}}})
    with noted():
        image = vr.render(path, size=(40, 120), spp=1, layers=("id",), progress=False)
    shown = image["id"]
    assert set(np.unique(shown)) == {0, 1, 2}
    assert (shown[:, [0, -1]] == 0).all()


def test_an_animated_scene_fits_its_beginning():
    """Not the place that the object has in the scene itself, where no frame shows it."""
    track = vr.KeysTrack(address="objects.ball.center", times=(0, 1), values=((20, 0, 0), (25, 0, 0)))
    moving = {"objects": {"ball": vr.Sphere()}, "animation": vr.Animation(duration=1, tracks={"go": track})}
    scene = fitted(**moving)
    beginning = fitted(objects={"ball": vr.Sphere(center=(20, 0, 0))})
    assert (scene.camera, scene.lights) == (beginning.camera, beginning.lights)
    with noted():
        assert vr.at(vr.Scene(**moving), 1).camera == scene.camera


def test_tracks_move_what_is_fitted():
    orbit = vr.Animation(duration=1, tracks={"around": vr.OrbitTrack()})
    scene = fitted(objects={"ball": vr.Sphere()}, animation=orbit)
    half = vr.at(scene, 0.5).camera.origin
    assert np.allclose(np.multiply(half, (-1, 1, -1)), scene.camera.origin)


def test_public_functions_take_scenes_without_camera_and_lights():
    """They say what they fit, and do as with the completed scene."""
    parts = {
        "objects": {"ball": vr.Sphere(), "floor": vr.Plane(point=(0, -1, 0))},
        "film": vr.Film(width=8, height=6), "settings": vr.Settings(spp=1),
    }  # fmt: skip
    bare, whole = vr.Scene(**parts), fitted(**parts)
    with noted():
        picture = vr.render(bare, progress=False, layers=("RGB",))["RGB"]
    assert (picture == vr.render(whole, progress=False, layers=("RGB",))["RGB"]).all()
    with noted():
        assert str(vr.explain(bare)) == str(vr.explain(whole))
    with noted():
        assert str(vr.why(bare, 3, 3)) == str(vr.why(whole, 3, 3))
    with noted():
        assert vr.dump(bare) == vr.dump(whole)
    with noted():
        assert vr.prepare(bare).scene == whole


def test_completed_scenes_are_left_alone():
    scene = fitted(objects={"ball": vr.Sphere()})
    assert completed(scene) == (scene, [])
