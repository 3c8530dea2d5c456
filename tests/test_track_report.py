"""Notes about tracks: what goes on after the end of the animation, and assignments that a track makes useless."""

import warnings
from typing import Any

import pytest
from track_samples import SCENE, keys, moving

import visray as vr
from visray.errors import AnimationWarning
from visray.track_report import track_notes

LATE = {
    "keys": (
        vr.KeysTrack(address="camera.fov", times=(0, 1, 2, 3, 4), values=(30, 31, 32, 33, 34)),
        "times: 2 of 5 keys are after the end of the animation, 2 s, so the track is cut off there",
    ),
    "a key": (
        vr.KeysTrack(address="camera.fov", times=(0, 3), values=(30, 31)),
        "times: the last key, 3 s, is after the end of the animation, 2 s, so the track is cut off there",
    ),
    "an end": (
        vr.OrbitTrack(end=2.5),
        "end: 2.5 s is after the end of the animation, 2 s, so the track is cut off there",
    ),
    "a beginning": (
        vr.SpinTrack(of="objects.box", begin=2, end=3),
        "begin: 2 s is not before the end of the animation, 2 s, so the track moves nothing",
    ),
}
IN_TIME = (keys("camera.fov", 30.0, 31.0), vr.SpinTrack(of="objects.box", end=2.0))


def said(action: Any) -> list[str]:
    """The AnimationWarnings of an action."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        action()
    return [str(x.message) for x in caught if x.category is AnimationWarning]


@pytest.mark.parametrize("what", LATE)
def test_a_track_that_goes_on_after_the_end_is_noted_once(what: str) -> None:
    track, text = LATE[what]
    scene, note = moving(track), f"animation.tracks.track0.{text}"
    assert track_notes(scene) == [note]
    assert [x for x in vr.explain(scene).notes if x.startswith("animation.tracks")] == [note]
    assert said(lambda: vr.prepare(scene)) == [note]
    assert said(lambda: list(vr.animate(scene, frames="0:2", size=(4, 3), spp=1, progress=False))) == [note]


def test_tracks_that_end_in_time_get_no_note() -> None:
    assert not track_notes(moving(*IN_TIME)) and not track_notes(SCENE)


ELLIPSE = {"address": "objects.ball.center", "radii": (1, 1), "period": 2.0}
USELESS = {
    "keys": (keys("objects.ball.center", (0, 0, 0), (1, 0, 0)), "objects.ball.center", (5, 0, 0)),
    "a part": (keys("objects.ball.center", (0, 0, 0), (1, 0, 0)), "objects.ball.center.1", 5.0),
    "a path": (
        vr.PathTrack(address="objects.ball.center", points=((0, 0, 0), (1, 0, 0))), "objects.ball.center", (5, 0, 0)
    ),
    "an ellipse with a center": (vr.EllipseTrack(center=(0, 0, 0), **ELLIPSE), "objects.ball.center", (5, 0, 0)),
}  # fmt: skip
USEFUL = {
    "what one of the keys is a part of": (keys("objects.ball.center.1", 0.0, 1.0), "objects.ball.center", (5, 0, 0)),
    "a neighbour": (keys("objects.ball.center.1", 0.0, 1.0), "objects.ball.center.0", 5.0),
    "an orbit": (vr.OrbitTrack(), "camera.origin", (0, 1, 9)),
    "a spin": (vr.SpinTrack(of="objects.box"), "objects.box.transform.0.rotate", 45.0),
    "an ellipse": (vr.EllipseTrack(**ELLIPSE), "objects.ball.center", (5, 0, 0)),
}


@pytest.mark.parametrize("what", USELESS)
def test_an_assignment_to_what_a_track_writes_is_noted(what: str) -> None:
    track, address, new = USELESS[what]
    scene, made = moving(track), []
    text = "animation.tracks.track0 writes this value at all times, so the assignment has no effect; change the track"
    assert said(lambda: made.append(vr.replaced(scene, address, new))) == [f"{address}: {text}"]
    # It is true.
    assert all(vr.at(made[0], t) == vr.at(scene, t) for t in (0.0, 0.7, 2.0))


@pytest.mark.parametrize("what", USEFUL)
def test_other_assignments_get_no_note(what: str) -> None:
    track, address, new = USEFUL[what]
    scene, made = moving(track), []
    assert not said(lambda: made.append(vr.replaced(scene, address, new)))
    assert vr.at(made[0], 0.7) != vr.at(scene, 0.7)
    assert not said(lambda: vr.replaced(vr.at(scene, 0.7), address, new))
    assert not said(lambda: vr.replaced(scene, "animation", None))
