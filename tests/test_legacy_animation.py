"""Animated scenes of VisRayTrace and its forerunners: ellipses, rotations, and steps between two frames."""

import json
from collections.abc import Callable
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import visray as vr
from visray.primitives.primitive import Primitive
from visray.scene.legacy.convert import LegacyWarning, convert
from visray.transforms import compose

MATT = {"type": "LAMBERTIAN", "ka": [0, 0, 0], "kd": [0.5, 0.5, 0.5], "ks": [0, 0, 0], "shininess": 1}
BALL = {"name": "earth", "type": "SPHERE", "center": [1, 2, 3], "radius": 0.5, "material": MATT}
BOX = {"name": "box", "type": "BOX", "minPoint": [0, 0, 0], "maxPoint": [2, 2, 4], "material": MATT}
SETUP = {"renderType": "TEMPORAL", "camera": {"lookFrom": [0, 1, 9], "lookAt": [0, 0, 0], "vup": [0, 1, 0], "vfov": 60}}
Write = Callable[..., tuple[Path, Path]]


@pytest.fixture
def written(tmp_path: Path) -> Write:
    """Function that writes a scene with some objects, and a setup, and returns the paths."""

    def write(*objects: dict, **more: Any) -> tuple[Path, Path]:
        scene, setup = tmp_path / "scene.json", tmp_path / "setup.json"
        scene.write_text(json.dumps({"scene": "moves", "typeScene": "TEMPORALVW", "objects": objects} | more))
        setup.write_text(json.dumps(SETUP))
        return scene, setup

    return write


def matrix(scene: vr.Scene, name: str) -> np.ndarray:
    """The map of an object's own coordinates into the world."""
    steps = scene.objects[name].transform
    return compose(steps) if steps else np.eye(3, 4)


def place(scene: vr.Scene, name: str, point: tuple[float, float, float]) -> np.ndarray:
    """Where a point of an object's own coordinates is."""
    m = matrix(scene, name)
    return m[:, :3] @ np.array(point) + m[:, 3]


def on_ellipse(frame: float, rx: float, rz: float, period: float) -> np.ndarray:
    """The formula of the original: t = 3 pi / 2 + 2 pi frame / period; (rx cos t, 0, rz sin t)."""
    t = 3 * pi / 2 + 2 * pi * frame / period
    return np.array([rx * cos(t), 0, rz * sin(t)])


@pytest.mark.parametrize(
    "word", ["ELLIPSE,4,2.5,40", "ellipse, 4, 2.5, 40", ["ELLIPSE,4,2.5,40"], ["ELLIPSE", 4, 2.5, 40]]
)
def test_an_ellipse_is_that_of_the_original(written: Write, word: Any) -> None:
    scene, warnings = convert(*written(BALL | {"animation": word}, numFrames=30))
    assert warnings == []
    assert (scene.animation.duration, scene.animation.fps) == (1.2, 25)
    for frame in range(30):
        center = vr.at(scene, frame / 25).objects["earth"].center
        assert center == pytest.approx(np.array([1, 2, 3]) + on_ellipse(frame, 4, 2.5, 40), abs=1e-13)


def test_a_double_ellipse_is_the_sum_of_two(written: Write) -> None:
    scene, _ = convert(*written(BALL | {"animation": "DOUBLEELLIPSE,4,2.5,40,1,0.5,8"}))
    assert scene.animation.duration == 0.8
    for frame in range(20):
        center = vr.at(scene, frame / 25).objects["earth"].center
        expected = np.array([1, 2, 3]) + on_ellipse(frame, 4, 2.5, 40) + on_ellipse(frame, 1, 0.5, 8)
        assert center == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize(
    ("obj", "center"),
    [
        (BALL, (1, 2, 3)),
        (BOX, (1, 1, 2)),
        (
            {"name": "t", "type": "TRIANGLE", "p1": [0, 0, 0], "p2": [3, 0, 0], "p3": [0, 3, 3], "material": MATT},
            (1, 1, 1),
        ),
        ({"name": "c", "type": "CYLINDER", "center": [1, 0, 0], "radius": 1, "h": 2, "material": MATT}, (1, 0, 0)),
        ({"name": "p", "type": "POLYNOMIAL", "monomis": ["x2", "y2", "z2", "-1"], "material": MATT}, (0, 0, 0)),
    ],
)
@pytest.mark.parametrize("both", [False, True])
def test_an_object_rotates_about_its_centre_and_an_ellipse_takes_it_along(
    written: Write, obj: dict, center: tuple, both: bool
) -> None:
    words = "ROTATION,20" + (",ELLIPSE,4,2.5,40" if both else "")
    scene, _ = convert(*written(obj | {"animation": words}, numFrames=10))
    name = obj["name"]
    for frame in (0, 3, 5, 9):
        still = vr.at(scene, frame / 25)
        moved = np.array(center, float) + (on_ellipse(frame, 4, 2.5, 40) if both else 0)
        assert place(still, name, center) == pytest.approx(moved, abs=1e-12)
        angle = 2 * pi * frame / 20
        turned = moved + np.array([cos(angle), 0, -sin(angle)])
        assert place(still, name, tuple(np.add(center, (1, 0, 0)))) == pytest.approx(turned, abs=1e-12)


def test_an_object_without_a_centre_moves_by_a_step(written: Write) -> None:
    scene, _ = convert(*written(BOX | {"animation": "ELLIPSE,4,2.5,40"}))
    for frame in (0, 7):
        seen = place(vr.at(scene, frame / 25), "box", (0, 0, 0))
        assert seen == pytest.approx(on_ellipse(frame, 4, 2.5, 40), abs=1e-13)


def test_steps_between_two_frames_stay(written: Write) -> None:
    steps = [
        {"frames": [0, 10], "translate": [2, 0, 0]},
        {"frames": [10, 20], "rotate": {"angle": 90, "axis": [0, 0, 1]}, "scale": 2},
        {"frames": [5, 15], "rotate": 30},
    ]
    scene, warnings = convert(*written(BOX | {"animation": steps}))
    assert warnings == []
    assert place(vr.at(scene, 0), "box", (1, 0, 0)) == pytest.approx((1, 0, 0))
    # At frame 5, half of the first step is done, and nothing of the others.
    assert place(vr.at(scene, 0.2), "box", (1, 0, 0)) == pytest.approx((2, 0, 0))
    end = vr.at(scene, 0.8)
    c, s = cos(pi / 6), sin(pi / 6)
    assert place(end, "box", (0, 0, 0)) == pytest.approx((0, 4, 0))
    assert place(end, "box", (0, 1, 0)) == pytest.approx((-2 * c, 4, 2 * s))


def test_several_objects_move_and_the_rest_stands_still(written: Write) -> None:
    moon = BALL | {"name": "moon", "animation": ["DOUBLEELLIPSE,4,2,20,1,1,5", "ROTATION,5"]}
    scene, _ = convert(*written(BALL | {"animation": "ELLIPSE,4,2,20"}, moon, BOX))
    assert sorted(scene.animation.tracks) == ["earth ellipse", "moon ellipse", "moon rotation"]
    assert vr.at(scene, 0.3).objects["box"] == scene.objects["box"]
    assert isinstance(scene.objects["box"], Primitive)


def test_a_file_of_the_original_is_written_as_one_of_visray(written: Write, tmp_path: Path) -> None:
    scene = vr.load(*written(BALL | {"animation": "ELLIPSE,4,2,20,ROTATION,7"}))
    file = tmp_path / "own.json"
    file.write_text(vr.dump(scene))
    assert vr.load(file) == scene


def test_a_scene_in_which_nothing_moves_is_one_picture(written: Write) -> None:
    with pytest.warns(LegacyWarning) as said:
        scene = vr.load(*written(BALL))
    assert scene.animation is None
    assert [str(w.message).split(": ", 1)[1] for w in said] == [
        'typeScene = "TEMPORALVW": no object has the key "animation"; the scene stands still',
        'renderType = "TEMPORAL": nothing moves in the scene; it is one picture',
    ]


def test_lights_are_not_ignored(written: Write) -> None:
    _, [text] = convert(*written(BALL | {"animation": "ELLIPSE,4,2,20,IGNORELIGHTS"}))
    assert text.endswith('IGNORELIGHTS is ignored; give the material the shading "unlit"')


@pytest.mark.parametrize(
    ("animation", "text"),
    [
        ("ELIPSE,1,2,3", "unknown suffix 'ELIPSE'; did you mean \"ELLIPSE\"? (one of ELLIPSE, DOUBLEELLIPSE, ROTATION"),
        ("ELLIPSE,1,2", "ELLIPSE takes 3 numbers, the last of each three a number of frames"),
        ("ELLIPSE,1,2,x", "ELLIPSE takes 3 numbers"),
        ("ELLIPSE,1,2,0", "the number of frames of ELLIPSE must be greater than 0"),
        ("ROTATION,-3", "the number of frames of ROTATION must be greater than 0"),
        ("DOUBLEELLIPSE,1,2,3,1,2,0", "the number of frames of DOUBLEELLIPSE must be greater than 0"),
        (7, "unknown suffix '7'"),
    ],
)  # fmt: skip
def test_wrong_suffixes_are_refused(written: Write, animation: Any, text: str) -> None:
    with pytest.raises(vr.UserError, match=r"scene.json: objects.earth.animation = ") as refused:
        convert(*written(BALL | {"animation": animation}))
    [found] = refused.value.lines
    assert f": {text}" in found


@pytest.mark.parametrize(
    ("step", "text"),
    [
        ({"frames": [5, 5], "translate": [1, 0, 0]}, "objects.earth.animation.frames = [5, 5]: must be two frames"),
        ({"frames": [0, 5], "scale": 0}, "animation.tracks.earth 1 scale.values.1 = 0: a scale must not be 0"),
        ({"frames": [0, 5], "scale": -1}, "animation.tracks.earth 1 scale.values.1 = -1: has another sign"),
        ({"frames": [0, 5], "rotate": {"axis": [1, 0, 0]}}, "objects.earth.animation.rotate.angle: the key is missing"),
    ],
)  # fmt: skip
def test_wrong_steps_are_refused(written: Write, step: dict, text: str) -> None:
    with pytest.raises(vr.UserError) as refused:
        convert(*written(BALL | {"animation": [step]}))
    assert refused.value.lines[0].split("scene.json: ")[-1].startswith(text)


def test_a_wrong_number_of_frames_is_refused(written: Write) -> None:
    with pytest.raises(vr.UserError, match=r"numFrames = 0: must be at least 1"):
        convert(*written(BALL | {"animation": "ROTATION,3"}, numFrames=0))


@pytest.mark.parametrize("suffix", ["ELLIPSE,1,1,1e-9", "DOUBLEELLIPSE,1,1,1e-300,1,1,1e-9", "ROTATION,1e-7"])
def test_turns_of_next_to_no_frames_get_one_line(written: Write, suffix: str) -> None:
    word = suffix.partition(",")[0]
    with pytest.raises(vr.UserError, match=f"the number of frames of {word} must be at least 2.5e-05") as refused:
        vr.load(*written(BALL | {"animation": suffix}))
    assert len(refused.value.lines) == 1
