"""Scenes of animations that are wrong at a moment between their keys are refused with the time and the frame."""

from dataclasses import replace
from pathlib import Path

import pytest

import visray as vr
from visray import frame_checks
from visray.cli.program import main
from visray.output.movie import seconds_of

THROUGH = r"camera.target = \[0.0, 0.0, 0.0\]: must differ from origin"
# The camera is at its target at half of this time, in the frame 3 of 8 per second.
END = 0.75


@pytest.fixture
def scene() -> vr.Scene:
    """The camera goes through its target at 0.375 s."""
    track = vr.KeysTrack(address="camera.origin", times=(0.0, END), values=((0, 0, 4), (0, 0, -4)))
    return vr.Scene(
        film=vr.Film(width=8, height=6),
        camera=vr.Camera(origin=(0, 0, 4), target=(0, 0, 0)),
        lights={"sun": vr.DirectionalLight(direction=(0, -1, -1))},
        objects={"ball": vr.Sphere(radius=0.1, center=(0.5, 0, 0))},
        settings=vr.Settings(spp=1),
        animation=vr.Animation(duration=1, fps=8, tracks={"a": track}),
    )


@pytest.fixture
def file(scene: vr.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scene as a file in the current folder, which is a new one."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "through.json"
    path.write_text(vr.dump(scene))
    return path


def test_a_wrong_moment_is_named_by_its_time(scene: vr.Scene, file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(vr.UserError, match=f"^at 0.375 s: {THROUGH}$"):
        vr.at(scene, END / 2)
    with pytest.raises(vr.UserError, match=f"^at 0.375 s: {THROUGH}$"):
        vr.render(scene, at=END / 2)
    assert main(["render", str(file), "--at", "0.375", "-o", "a.png"]) == 2
    assert "at 0.375 s: camera.target" in capsys.readouterr().err


def test_a_wrong_frame_is_refused_before_the_first_one_is_rendered(
    scene: vr.Scene, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for more in ({}, {"cluster": "local:1"}):
        with pytest.raises(vr.UserError, match=f"^frame 3, at 0.375 s: {THROUGH}$"):
            vr.animate(scene, **more)
    assert main(["animate", str(file), "-o", "a.gif", "-o", "out"]) == 2
    shown = capsys.readouterr().err
    assert "frame 3, at 0.375 s: camera.target" in shown and shown.count("\n") == 1
    assert not Path("a.gif").exists() and not list(Path().glob("**/*.png"))
    assert len(list(vr.animate(scene, frames=":3", progress=False, layers="RGB"))) == 3


def test_a_wrong_moment_in_an_open_shutter_is_named_with_its_frame(scene: vr.Scene) -> None:
    shutter = vr.Shutter(open=0.0, close=1.0, moments=1)
    assert shutter.times(0.25, 0.25) == [END / 2]
    blurred = replace(scene, camera=replace(scene.camera, shutter=shutter))
    with pytest.raises(vr.UserError, match=f"^frame 1, at 0.25 s, while the shutter is open: {THROUGH}$"):
        list(vr.animate(blurred, frames=1, fps=4, progress=False, layers="RGB"))


def test_frames_before_a_wrong_one_are_kept(
    file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if the check before had not seen it."""
    monkeypatch.setattr(frame_checks, "check_frames", lambda *_: None)
    assert main(["animate", str(file), "-o", "a.gif"]) == 2
    shown = capsys.readouterr().err
    assert "frame 3, at 0.375 s: camera.target" in shown and "; the frames before it are kept" in shown
    assert seconds_of(Path("a.gif")) == pytest.approx(3 / 8, abs=0.01)
