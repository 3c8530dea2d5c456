"""What is seen in the browser is made again: as a scene file, as a command line, and as a picture, to the same bits."""

import html
import json
import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.dark import DarkWarning
from visray.errors import UserError
from visray.live.picture_file import picture_file
from visray.live.reproducing import Seen, Wish, assignments, command_line, free_name, parse_wish
from visray.output.image import Image
from visray.progress import Follower, Interrupts
from visray.scene.address import changed
from visray.scene.load import dump, load

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SCENE = vr.Scene(
    camera=vr.Camera(origin=(0, 1, 5), target=(0, 0.5, 0), fov=40),
    film=vr.Film(width=12, height=8),
    lights={"lamp": vr.PointLight(position=(3, 5, 4))},
    materials={"it's red": vr.Material(kd=(0.7, 0.1, 0.1))},
    objects={"floor": vr.Plane(), "ball": vr.Sphere(center=(0, 0.5, 0), radius=0.5, material="it's red")},
    settings=vr.Settings(spp=4),
)
TURNED = vr.Camera(origin=(1.1, 1.3, 4.7), target=(0, 0.1 + 0.2, 0), fov=40)


def nothing(doing: str, share: float) -> None:
    """Reports nothing."""


def seen(scene: vr.Scene, edits: dict[str, Any] | None = None, camera: Any = None, time: float | None = None) -> Seen:
    """What a browser sees of a scene with changes."""
    scene = changed(scene, edits or {})
    return Seen(scene, tuple(edits or {}), time, camera or scene.camera, camera is None)


def rendered(line: str) -> None:
    """Runs a command line as a shell would."""
    words = shlex.split(line)
    assert words[0] == "visray" and main([*words[1:], "--quiet"]) == 0


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene file in the current folder, whose name has a space and a quote."""
    monkeypatch.chdir(tmp_path)
    path = Path("it's a ball.json")
    path.write_text(dump(SCENE))
    return path


def test_the_command_line_makes_the_same_bits(file: Path) -> None:
    edits = {
        "objects.ball.center": (0.1, 0.7, 0.3),
        "objects.ball.center.1": 0.25 / 3,
        "materials.it's red.kd": (0.1, 1 / 3, 0.9),
        "camera.fov": 35.0,
    }
    now = seen(SCENE, edits, replace(TURNED, fov=35.0))
    line = command_line(
        ["visray", "view", str(file), "--allow-outside"], load(file), now, Wish((9, 6), spp=3), ["a.exr"]
    )
    assert line.startswith("visray render 'it'\"'\"'s a ball.json' --allow-outside --set ")
    assert "objects.ball.center.1" not in line and line.endswith("--size 9x6 --spp 3 -o a.exr")
    rendered(line)
    scene, at = now.to_render()
    expected = vr.render(scene, at=at, size=(9, 6), spp=3, layers=("RGB",), progress=False)
    np.testing.assert_array_equal(Image.read("a.exr")["RGB"], expected["RGB"].astype(np.float16))


def test_without_changes_the_command_line_is_short(file: Path) -> None:
    line = command_line(
        ["visray", "view", "b.json", "--set", "materials.it's red.kd=[0,1,0]"], SCENE, seen(SCENE), Wish()
    )
    assert shlex.split(line) == ["visray", "render", "b.json", "--set", "materials.it's red.kd=[0,1,0]"]


def test_another_kind_of_camera_is_written_whole(file: Path) -> None:
    camera = vr.OrthographicCamera(origin=(0, 1, 5), target=(0, 0, 0), height=3.0)
    now = seen(SCENE, {}, camera)
    assert list(assignments(SCENE, now)) == ["camera"]
    words = shlex.split(command_line(["visray", "view", str(file)], SCENE, now, Wish()))
    rendered(shlex.join([*words, "-o", "a.exr"]))
    expected = vr.render(replace(SCENE, camera=camera), layers=("RGB",), progress=False)
    np.testing.assert_array_equal(Image.read("a.exr")["RGB"], expected["RGB"].astype(np.float16))


def test_rows_of_data_are_written(tmp_path: Path) -> None:
    base = load(SCENES / "data-globe.json")
    now = seen(base, {"data.quakes.3.radius": 5.25, "data.quakes.0.lon": -12.5})
    words = shlex.split(command_line(["visray", "view", "g.json"], base, now, Wish()))
    assert words == [
        "visray",
        "render",
        "g.json",
        "--set",
        "data.quakes.3.radius=5.25",
        "--set",
        "data.quakes.0.lon=-12.5",
    ]


def test_a_moment_of_an_animation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    base = replace(SCENE, animation=vr.Animation(
        duration=2.0, tracks={"up": vr.KeysTrack(address="objects.ball.center.1", times=(0.0, 2.0), values=(0.5, 1.5))}
    ))  # fmt: skip
    Path("up.json").write_text(dump(base))
    now = seen(base, {"objects.ball.radius": 0.4}, TURNED, 0.7)
    line = command_line(["visray", "view", "up.json"], base, now, Wish(spp=2), ["a.exr"])
    assert " --at 0.7 --spp 2 -o a.exr" in line
    rendered(line)
    scene, at = now.to_render()
    assert at == 0.7 and scene.camera == TURNED
    expected = vr.render(scene, at=at, spp=2, layers=("RGB",), progress=False)
    np.testing.assert_array_equal(Image.read("a.exr")["RGB"], expected["RGB"].astype(np.float16))


def test_a_camera_that_moves_is_said() -> None:
    base = replace(SCENE, animation=vr.Animation(
        duration=2.0, tracks={"by": vr.KeysTrack(address="camera.origin.0", times=(0.0, 2.0), values=(0.0, 1.0))}
    ))  # fmt: skip
    away = seen(base, {}, TURNED, 1.0)
    with pytest.raises(UserError, match="moves the camera"):
        command_line(["visray", "view", "by.json"], base, away, Wish())
    scene, at = away.to_render()
    assert (scene.camera, scene.animation, at) == (TURNED, None, None)
    assert away.as_file().camera == base.camera and "that camera" in away.notes()[0]
    assert seen(base, time=1.0).to_render() == (base, 1.0) and seen(base, time=1.0).notes() == ()


def test_a_picture_from_elsewhere_keeps_what_else_moves() -> None:
    by = vr.KeysTrack(address="camera.origin.0", times=(0.0, 2.0), values=(0.0, 1.0))
    up = vr.KeysTrack(address="objects.ball.center.1", times=(0.0, 2.0), values=(0.5, 1.5))
    shutter = vr.Shutter(moments=4)
    base = replace(
        SCENE,
        camera=replace(SCENE.camera, shutter=shutter),
        animation=vr.Animation(duration=2.0, tracks={"by": by, "up": up}),
    )
    scene, at = seen(base, {}, TURNED, 1.0).to_render()
    assert (scene.camera, at) == (replace(TURNED, shutter=shutter), 1.0)
    assert scene.animation.tracks == {"up": up}
    assert vr.at(scene, 1.0).objects == vr.at(base, 1.0).objects


def test_a_file_that_has_changed_meanwhile_is_said() -> None:
    other = replace(SCENE, ambient=(0.9, 0.9, 0.9))
    with pytest.raises(UserError, match="no longer what is shown"):
        command_line(["visray", "view", "a.json"], other, seen(SCENE), Wish())


def test_effects_left_out_are_said() -> None:
    notes = replace(seen(SCENE), left_out=("shadows", "specular")).notes()
    assert notes == ("shadows, specular: switched off only here; saved files have all effects",)


def test_the_saved_scene_is_what_is_seen(file: Path) -> None:
    now = seen(SCENE, {"objects.ball.radius": 0.125}, TURNED)
    again = json.loads(dump(now.as_file(), Path("."), file))
    assert again["objects"]["ball"]["radius"] == 0.125 and again["camera"]["origin"] == [1.1, 1.3, 4.7]
    Path("b.json").write_text(json.dumps(again))
    assert load("b.json").hash() == now.as_file().hash()


@pytest.mark.parametrize(
    ("size", "quality", "expected"),
    [
        ("", "1 %", Wish(None, 0.01)),
        ("12x8", "0.5%", Wish(None, 0.005)),
        (" 24 x 16 ", "0.02", Wish((24, 16), 0.02)),
        ("24X16", "64 spp", Wish((24, 16), None, 64)),
    ],
)
def test_wishes(size: str, quality: str, expected: Wish) -> None:
    assert parse_wish(size, quality, (12, 8)) == expected


@pytest.mark.parametrize(
    ("size", "quality", "hint"),
    [
        ("12", "1 %", "a width and a height"),
        ("0x4", "1 %", "a width and a height"),
        ("1e3x4", "1 %", "a width and a height"),
        ("", "", "an error such as 1 %"),
        ("", "200 %", "an error such as 1 %"),
        ("", "1.5 spp", "an error such as 1 %"),
        ("", "1 2 %", "an error such as 1 %"),
        ("", "nan", "an error such as 1 %"),
    ],
)
def test_wrong_wishes(size: str, quality: str, hint: str) -> None:
    with pytest.raises(UserError, match=hint):
        parse_wish(size, quality, (12, 8))


@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_the_saved_picture_is_that_of_render(suffix: str, tmp_path: Path) -> None:
    now = seen(SCENE, {"objects.ball.radius": 0.4}, TURNED)
    reports = []
    content, text = picture_file(now, Wish((10, 7), spp=2), suffix, Follower(lambda *x: reports.append(x)))
    (tmp_path / f"a{suffix}").write_bytes(content)
    assert text == "10 x 7, 2 spp" and ("compiling", 0.0) in reports and reports[-1][1] <= 1
    expected = vr.render(now.to_render()[0], size=(10, 7), spp=2, progress=False)
    if suffix == ".exr":
        found = Image.read(tmp_path / "a.exr")
        assert set(found.layers) == set(expected.layers)
        np.testing.assert_array_equal(found["RGB"], expected["RGB"].astype(np.float16))
    else:
        expected.write(tmp_path / "b.png")
        pixels = [np.array(Pillow.open(tmp_path / f"{x}.png")) for x in "ab"]
        np.testing.assert_array_equal(*pixels)


def test_work_of_a_thread_is_followed_and_stopped() -> None:
    """A picture is stopped after its first pass. Other work sees nothing of it."""
    shares = []

    def report(doing: str, share: float) -> None:
        shares.append(share)
        follower.stopped = share > 0

    follower = Follower(report)
    assert picture_file(seen(SCENE), Wish(spp=4_000_000), ".png", follower) is None
    assert 0 < shares[-1] < 1 and not Interrupts().requested
    assert picture_file(seen(SCENE), Wish(spp=1), ".png", Follower(nothing))[1] == "12 x 8, 1 spp"


def test_a_free_name(tmp_path: Path) -> None:
    file = tmp_path / "heart.json"
    assert free_name(file).name == "heart-edited.json"
    (tmp_path / "heart-edited.json").touch()
    assert free_name(file).name == "heart-edited-2.json"


@pytest.fixture
def opened(file: Path) -> Iterator[tuple[Any, Any]]:
    """A live picture of the file, and a page that shows it from elsewhere."""
    pytest.importorskip("viser")
    from page import Page
    from page_widgets import look_from

    with vr.view(file, error=0.2) as shown:
        page = Page(shown.url)
        look_from(page, shown.live, (0.0, 0.0, 4.5))
        yield shown.live, page
        page.close()


def test_a_page_gets_the_scene_and_the_picture(opened: tuple[Any, Any], file: Path) -> None:
    from page import eventually
    from page_widgets import downloads, press, told, write

    live, page = opened
    live.engine.assign({"objects.ball.radius": 0.375})
    eventually(lambda: live.engine.edits)
    camera = next(iter(live.clients.values())).camera
    expected = replace(changed(SCENE, {"objects.ball.radius": 0.375}), camera=camera)
    press(page, "Download the scene")
    name = "it-s-a-ball"
    eventually(lambda: f"{name}.json" in downloads(page))
    Path("again.json").write_bytes(downloads(page)[f"{name}.json"])
    assert load("again.json").hash() == expected.hash()
    press(page, "Write it beside the file")
    eventually(lambda: "written" in told(page))
    assert load("it's a ball-edited.json").hash() == expected.hash() and load(file).hash() == SCENE.hash()
    write(page, "size", "10x7")
    write(page, "quality", "2 spp")
    write(page, "format", "EXR")
    press(page, "Make the picture")
    eventually(lambda: f"{name}.exr" in downloads(page))
    eventually(lambda: f"{name}.exr: 10 x 7, 2 spp" in told(page))
    Path("a.exr").write_bytes(downloads(page)[f"{name}.exr"])
    picture = vr.render(expected, size=(10, 7), spp=2, layers=("RGB",), progress=False)
    np.testing.assert_array_equal(Image.read("a.exr")["RGB"], picture["RGB"].astype(np.float16))


def test_a_page_gets_the_command_line(opened: tuple[Any, Any]) -> None:
    from page import eventually
    from page_widgets import press, told, write

    live, page = opened
    live.engine.leave_out(("shadows",))
    eventually(lambda: live.engine.left_out)
    press(page, "Command line")
    eventually(lambda: "visray render" in page.html())
    camera = next(iter(live.clients.values())).camera
    now = Seen(load(live.file), (), None, camera, False)
    line = command_line(live.command, load(live.file), now, Wish(error=0.01), ["it-s-a-ball.png"])
    assert html.escape(line) in page.html() and "shadows: switched off only here" in page.html()
    write(page, "quality", "<b>")
    press(page, "Make the picture")
    eventually(lambda: "must be an error such as 1 %" in told(page))


def test_a_scene_without_a_file_has_no_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser")
    from page import Page, eventually
    from page_widgets import downloads, press, told, value_of

    monkeypatch.chdir(tmp_path)
    with vr.view(SCENE, error=0.2) as shown:
        page = Page(shown.url)
        page.look()
        press(page, "Command line")
        eventually(lambda: "has no file that a command could name" in told(page))
        assert value_of(page, "Write it beside the file", "visible") is False
        press(page, "Download the scene")
        eventually(lambda: "scene.json" in downloads(page))
        page.close()


def test_a_picture_is_cancelled(opened: tuple[Any, Any]) -> None:
    from page import eventually
    from page_widgets import downloads, press, told, value_of, write

    _, page = opened
    write(page, "quality", "4000000 spp")
    press(page, "Make the picture")
    eventually(lambda: value_of(page, "Cancel", "visible"))
    press(page, "Make the picture")
    eventually(lambda: "a picture is being made already" in told(page))
    press(page, "Cancel")
    eventually(lambda: "the picture was cancelled" in told(page))
    eventually(lambda: value_of(page, "Cancel", "visible") is False)
    assert downloads(page) == {}


def test_notes_about_a_picture_are_told(opened: tuple[Any, Any]) -> None:
    """No light falls on what is seen: as on the command line, that is said."""
    from page import eventually
    from page_widgets import press, told, write

    live, page = opened
    live.engine.assign({"lights.lamp.intensity": 0.0, "ambient": (0.0, 0.0, 0.0)})
    eventually(lambda: live.engine.edits)
    write(page, "quality", "1 spp")
    with pytest.warns(DarkWarning):
        press(page, "Make the picture")
        eventually(lambda: "it-s-a-ball.png: 12 x 8, 1 spp. " in told(page))
    assert "light" in told(page)
