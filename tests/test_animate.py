"""Frames of animated scenes: their bits, what they compile, their files and movies, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import visray as vr
from visray.cli.program import main
from visray.pass_timer import Compilations

COUNT, FPS = 5, 5.0


def keys(address: str, *values: Any, **more: Any) -> vr.KeysTrack:
    """A track with keys at equal distances."""
    times = tuple(np.linspace(0, COUNT / FPS, len(values)).tolist())
    return vr.KeysTrack(address=address, times=times, values=values, **more)


def scene(**tracks: Any) -> vr.Scene:
    """A small scene, whose ball goes to the right if no other tracks are given."""
    tracks = tracks or {"x": keys("objects.ball.center.0", -1.0, 1.0)}
    return vr.Scene(
        film=vr.Film(width=24, height=16),
        camera=vr.Camera(origin=(0, 1.5, 6), target=(0, 0.7, 0), fov=35),
        materials={"red": vr.Material(kd=(0.75, 0.15, 0.1), ks=(0.3, 0.3, 0.3), shininess=8)},
        lights={"key": vr.PointLight(position=(4, 6, 5))},
        objects={"floor": vr.Plane(), "ball": vr.Sphere(center=(0, 0.8, 0), radius=0.8, material="red")},
        settings=vr.Settings(spp=2),
        animation=vr.Animation(duration=COUNT / FPS, fps=FPS, tracks=tracks),
    )


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scene as a file in the current folder, which is a new one."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "ball.json"
    path.write_text(vr.dump(scene()))
    return path


def run(*words: Any) -> int:
    return main(["animate", *map(str, words)])


def reported(capsys: pytest.CaptureFixture[str], *words: Any) -> dict[str, Any]:
    """The report of a command."""
    capsys.readouterr()
    assert run(*words, "--json") == 0
    return json.loads(capsys.readouterr().out)


def test_frames_are_those_of_the_moments_bit_for_bit_and_compile_nothing() -> None:
    one = scene(
        x=keys("objects.ball.center.0", -1.0, 1.0),
        light=keys("lights.key.intensity", 1.0, 0.5),
        way=vr.OrbitTrack(turns=0.25),
        paint=keys("materials.red.kd", (0.7, 0.1, 0.1), (0.1, 0.7, 0.1), interpolation="smooth"),
    )
    new, pictures = [], []
    with Compilations() as compilations:
        for image in vr.animate(one, progress=False):
            pictures.append(image)
            compilations.read()
            new.append(compilations.count)
    assert len(pictures) == COUNT and new == [new[0]] * COUNT and new[0] > 0
    for number, image in enumerate(pictures):
        t = number / FPS
        alone = vr.render(vr.at(one, t), progress=False)
        assert image.metadata["frame"] == number and image.metadata["time"] == t
        assert image.metadata["scene_hash"] == alone.metadata["scene_hash"] == vr.at(one, t).hash()
        assert all(np.array_equal(image[name], alone[name]) for name in alone.layers)
        assert np.array_equal(image["RGB"], vr.render(one, at=t, progress=False)["RGB"])
    assert not np.array_equal(pictures[0]["RGB"], pictures[1]["RGB"])
