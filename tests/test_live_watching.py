"""A scene file that is watched: what is wrong is told, and the last scene without errors stays until it is mended."""

import json
import os
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.live.file_watch import FileWatch
from visray.output.files import write_text
from visray.scene.load import load

BALL = {
    "film": {"width": 16, "height": 12},
    "textures": {"t": {"type": "image", "file": "t.png"}},
    "materials": {"m": {"texture": "t"}},
    "objects": {"ball": {"type": "sphere", "radius": 1.0, "material": "m"}},
    "camera": {},
    "lights": {},
}


def written(path: Path, scene: dict | str) -> None:
    """Writes a scene file at once, as editors do that write it aside."""
    write_text(path, scene if isinstance(scene, str) else json.dumps(scene))


def with_radius(radius: object) -> dict:
    """The scene with another radius of its ball."""
    return BALL | {"objects": {"ball": BALL["objects"]["ball"] | {"radius": radius}}}


def picture(path: Path, grey: int) -> None:
    """Writes a picture of one colour."""
    Pillow.fromarray(np.full((2, 2, 3), grey, np.uint8)).save(path)
    # Some file systems count in steps of milliseconds.
    os.utime(path, ns=(grey * 10**9, grey * 10**9))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "ball.json"
    picture(tmp_path / "t.png", 10)
    written(path, BALL)
    return path


@pytest.fixture
def watch(file: Path) -> FileWatch:
    return FileWatch(file, lambda: load(file), load(file))


def settled(watch: FileWatch) -> vr.Scene | None:
    """What is found after a file has changed and then rests."""
    assert watch.look() is None
    return watch.look()


def test_a_new_scene_is_found_when_the_file_rests(file: Path, watch: FileWatch) -> None:
    assert watch.look() is None and watch.look() is None
    written(file, with_radius(2.0))
    assert watch.look() is None  # it may not be whole yet
    written(file, with_radius(3.0))
    assert watch.look() is None
    assert watch.look().objects["ball"].radius == 3.0 and watch.lines == ()
    assert watch.look() is None and watch.scene.objects["ball"].radius == 3.0


def test_errors_are_told_until_they_are_mended(file: Path, watch: FileWatch) -> None:
    good = watch.scene
    written(file, with_radius(-1) | {"ambient": "<b>red</b>"})
    assert settled(watch) is None
    assert len(watch.lines) == 2 and all(line.startswith(f"{file}: ") for line in watch.lines)
    assert any("objects.ball.radius" in line for line in watch.lines) and watch.scene is good
    # What it was before: no other scene, and no errors.
    written(file, BALL)
    assert settled(watch) is None and watch.lines == ()
    written(file, with_radius(0.5))
    assert settled(watch).objects["ball"].radius == 0.5


def test_a_file_that_is_half_written_is_an_error(file: Path, watch: FileWatch) -> None:
    file.write_text(json.dumps(with_radius(2.0))[:40])
    assert settled(watch) is None and len(watch.lines) == 1
    file.write_text(json.dumps(with_radius(2.0)))
    assert settled(watch).objects["ball"].radius == 2.0 and watch.lines == ()


def test_a_file_that_is_deleted_and_comes_back(file: Path, watch: FileWatch) -> None:
    file.unlink()
    assert settled(watch) is None and watch.lines == (
        f"{file}: has been deleted or renamed; its last content is shown",
    )
    assert watch.look() is None and len(watch.lines) == 1
    written(file, BALL)
    assert settled(watch) is None and watch.lines == ()


def test_a_file_that_becomes_a_pipe_is_not_opened(file: Path, watch: FileWatch) -> None:
    file.unlink()
    os.mkfifo(file)
    found: list = []
    thread = threading.Thread(target=lambda: found.append(settled(watch)), daemon=True)
    thread.start()
    thread.join(30)
    if thread.is_alive():
        # It waits for a writer.
        os.close(os.open(file, os.O_WRONLY | os.O_NONBLOCK))
    assert found == [None]
    assert watch.lines == (f"{file}: is not a regular file; the last scene is shown until it is one",)
    file.unlink()
    written(file, with_radius(0.5))
    assert settled(watch).objects["ball"].radius == 0.5 and watch.lines == ()


def test_a_setup_file_that_is_a_pipe_is_not_opened(file: Path, tmp_path: Path) -> None:
    calls = []
    watch = FileWatch(file, lambda: calls.append(1) or load(file), load(file), [tmp_path / "setup.json"])
    os.mkfifo(tmp_path / "setup.json")
    assert settled(watch) is None and calls == []
    assert watch.lines[0].startswith(f"{tmp_path / 'setup.json'}: is not a regular file")


def test_a_folder_in_place_of_the_file_is_told(file: Path, watch: FileWatch) -> None:
    file.unlink()
    file.mkdir()
    assert settled(watch) is None and watch.lines == (f"{file}: is a folder; give a file in it",)


def test_a_large_file_is_told_before_it_is_read(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("visray.live.file_watch.LARGE", 1000)
    told = []
    watch = FileWatch(file, lambda: told.append("read") or load(file), load(file), tell=told.append)
    written(file, with_radius(0.5))
    assert settled(watch) is not None and told == ["read"]
    written(file, json.dumps(with_radius(0.75)) + " " * 10**6)
    assert settled(watch).objects["ball"].radius == 0.75
    assert told[1:] == ["ball.json has 1 MB; the picture waits while it is read", "read"]


def test_a_file_that_is_only_touched_is_no_other_scene(file: Path, watch: FileWatch) -> None:
    os.utime(file, ns=(1, 1))
    assert settled(watch) is None and watch.lines == ()


def test_files_that_the_scene_names_are_watched(file: Path, watch: FileWatch) -> None:
    picture(file.with_name("t.png"), 20)
    assert settled(watch).hash() == load(file).hash()
    file.with_name("t.png").unlink()
    assert settled(watch) is None
    assert len(watch.lines) == 1 and watch.lines[0].startswith("textures.t.file = ")
    picture(file.with_name("t.png"), 30)
    assert settled(watch) is not None and watch.lines == ()


def test_a_file_that_only_a_broken_scene_names_is_watched(file: Path, watch: FileWatch) -> None:
    """A mesh that does not exist yet: the scene is read again when it comes."""
    mesh = {"objects": BALL["objects"] | {"m": {"type": "mesh", "file": "m.obj"}}, "camera": {}, "lights": {}}
    written(file, BALL | mesh)
    assert settled(watch) is None and "m.obj" in watch.lines[0]
    file.with_name("m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert set(settled(watch).objects) == {"ball", "m"} and watch.lines == ()


def test_a_change_while_the_file_is_read_is_found(file: Path) -> None:
    """The file changes again after it was read, and before that is known."""
    radii = iter([4.0])

    def slow() -> vr.Scene:
        scene = load(file)
        for radius in radii:
            written(file, with_radius(radius))
        return scene

    watch = FileWatch(file, slow, load(file))
    written(file, with_radius(2.0))
    assert settled(watch).objects["ball"].radius == 2.0
    assert settled(watch).objects["ball"].radius == 4.0


def test_other_files_are_watched(file: Path, tmp_path: Path) -> None:
    """As the setup file of a scene of the original VisRayTrace."""
    calls = []
    watch = FileWatch(file, lambda: calls.append(1) or load(file), load(file), [tmp_path / "setup.json"])
    written(tmp_path / "setup.json", "{}")
    assert settled(watch) is None and calls == [1]


def test_a_page_shows_errors_and_recovers(file: Path) -> None:
    pytest.importorskip("viser")
    from page import Page, eventually
    from page_widgets import told

    with vr.view(file, error=0.5) as shown:
        live, page = shown.live, Page(shown.url)
        page.look()
        eventually(lambda: page.pictures)
        live.engine.assign({"objects.ball.radius": 0.75})
        eventually(lambda: live.engine.edits)
        written(file, with_radius("<img src=x onerror=alert(1)>"))
        eventually(lambda: "The scene has errors" in page.html())
        assert "objects.ball.radius" in page.html() and "&lt;img src=x" in page.html() and "<img" not in page.html()
        assert live.engine.scene.objects["ball"].radius == 0.75
        file.unlink()
        eventually(lambda: "has been deleted or renamed" in page.html())
        written(file, with_radius(0.25))
        eventually(lambda: live.engine.scene.objects["ball"].radius == 0.25)
        eventually(lambda: "ball.json has changed and was read again; 1 value changed here is dropped" in told(page))
        assert live.engine.edits == {} and "The scene has errors" not in page.html()
        page.close()


def test_cameras_stay_unless_that_of_the_file_changes(file: Path) -> None:
    pytest.importorskip("viser")
    from page import Page, eventually
    from page_widgets import look_from

    with vr.view(file, error=0.5) as shown:
        live, page = shown.live, Page(shown.url)
        client = look_from(page, live, (1.0, 2.0, 3.0))
        camera = client.camera
        written(file, with_radius(0.25))
        eventually(lambda: live.engine.scene.objects["ball"].radius == 0.25)
        assert client.camera == camera and not client.at_home
        written(file, with_radius(0.25) | {"camera": {"origin": [0, 0, 9]}})
        eventually(lambda: client.at_home and client.camera.origin == (0.0, 0.0, 9.0))
        page.close()
