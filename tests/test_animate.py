"""Frames of animated scenes: their bits, what they compile, their files and movies, and what is refused."""

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr  # isort: skip - before drjit
import drjit as dr

from visray.animation.frames import chosen_frames
from visray.cli.frame_report import FrameReport
from visray.cli.program import main
from visray.errors import GoalWarning, StructureWarning
from visray.frame_maker import FrameMaker
from visray.output import exr, png
from visray.output.frame_files import FrameFiles
from visray.output.lock import locked
from visray.output.movie_gif import Gif
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
    dr.flush_kernel_cache()
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


def test_what_stands_still_is_rendered_once(monkeypatch: pytest.MonkeyPatch) -> None:
    one, rendered = scene(x=keys("objects.ball.center.0", -1.0, 1.0, interpolation="step")), []
    monkeypatch.setattr(FrameMaker, "_rendered", lambda self, frame, values: rendered.append(frame) or vr.render(one))
    assert len(list(vr.animate(one, progress=False, layers="RGB"))) == COUNT
    assert [frame.number for frame in rendered] == [0]
    # The motion vectors of the last frame before a movement are others.
    moves = scene(x=vr.KeysTrack(address="objects.ball.center.0", times=(0.5, 0.7), values=(0.0, 1.0)))
    rendered.clear()
    assert len(list(vr.animate(moves, progress=False))) == COUNT
    assert [frame.number for frame in rendered] == [0, 2, 3, 4]


def test_a_frame_that_needs_other_kernels_says_why_and_has_its_bits() -> None:
    """The surface is a mirror from the third frame on."""
    one = scene(mirror=keys("materials.red.kr", *[(0.0, 0.0, 0.0)] * 3, (0.5, 0.5, 0.5)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pictures = list(vr.animate(one, progress=False, layers="RGB"))
    texts = [str(w.message) for w in caught if w.category is StructureWarning]
    assert len(texts) == 1 and texts[0].startswith("frame 4: other kernels are compiled: reflection comes (needed by ")
    for image in pictures:
        assert np.array_equal(image["RGB"], vr.render(one, at=image.metadata["time"], progress=False)["RGB"])


def test_motion_blur_that_comes_is_said() -> None:
    one = scene(x=vr.KeysTrack(address="objects.ball.center.0", times=(0.55, 1.0), values=(0.0, 1.0)))
    one = replace(one, camera=replace(one.camera, shutter=vr.Shutter(moments=2)))
    with pytest.warns(StructureWarning, match="^frame 3: other kernels are compiled: motion blur comes$"):
        pictures = list(vr.animate(one, progress=False))
    for image in pictures:
        alone = vr.render(one, at=image.metadata["time"], progress=False)
        assert image.metadata["scene_hash"] == alone.metadata["scene_hash"]
        assert all(np.array_equal(image[name], alone[name]) for name in alone.layers)


def test_frames_that_stand_still_amid_motion_blur_say_what_they_compile() -> None:
    """Their kernels are those without blur, which are compiled once; blur that comes again has its kernels."""
    track = vr.KeysTrack(
        address="objects.ball.center.0", times=(0.0, 0.35, 0.5, 0.7, 1.0), values=(0.0, 1.0, 1.0, 1.0, 0.0)
    )
    one = scene(x=track)
    one = replace(one, camera=replace(one.camera, shutter=vr.Shutter(moments=2)))
    dr.flush_kernel_cache()
    with Compilations() as log, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        counts = []
        for image in vr.animate(one, frames=[0, 1, 2, 3, 4, 2], progress=False):
            log.read()
            counts.append(log.count)
            assert image.metadata["interrupted"] == 0
    assert [str(w.message) for w in caught] == ["frame 2: other kernels are compiled: motion blur goes"]
    new = np.diff(counts, prepend=0)
    assert new[0] > 0 and new[2] > 0 and not new[[1, 3, 4, 5]].any()


def test_notes_are_said_once_and_with_their_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = vr.render(scene(), layers="RGB", progress=False)

    def rendered(self: FrameMaker, frame: Any, values: Any) -> vr.Image:
        warnings.warn(f"{frame.number + 1} pixels are odd", GoalWarning, stacklevel=1)
        if frame.number >= 2:
            warnings.warn("the ball is not seen", GoalWarning, stacklevel=1)
        return picture

    monkeypatch.setattr(FrameMaker, "_rendered", rendered)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert len(list(vr.animate(scene(), progress=False))) == COUNT
    assert [str(w.message) for w in caught] == ["1 pixels are odd", "frame 2: the ball is not seen"]
    with warnings.catch_warnings(), pytest.raises(GoalWarning):
        warnings.simplefilter("error")
        next(vr.animate(scene(), progress=False))


def test_times_and_frames_in_python() -> None:
    one = scene()
    pictures = list(vr.animate(one, [0.3, 0.3, 0.9], progress=False, layers="RGB", spp=1, size=(8, 6)))
    assert [(x.metadata["frame"], x.metadata["time"]) for x in pictures] == [(0, 0.3), (1, 0.3), (2, 0.9)]
    assert (pictures[0].width, pictures[0].height, pictures[0].metadata["spp"]) == (8, 6, 1)
    assert [f.number for f in chosen_frames(one.animation, slice(None, None, 2))] == [0, 2, 4]
    for given, numbers in (
        (3, [3]),
        (np.int64(3), [3]),
        ([3], [3]),
        ([4, 0, -1], [4, 0, 4]),
        (range(0, 5, 2), [0, 2, 4]),
        (np.arange(2), [0, 1]),
        ((np.uint8(1), 2), [1, 2]),
    ):
        assert [f.number for f in chosen_frames(one.animation, given)] == numbers
    pictures = list(vr.animate(one, frames=range(1, 5, 3), progress=False, layers="RGB", spp=1, size=(8, 6)))
    assert [x.metadata["time"] for x in pictures] == [0.2, 0.8]
    assert [f.time for f in chosen_frames(one.animation, "0:3", fps=10)] == [0.0, 0.1, 0.2]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"times": [0.0], "fps": 5}, "times: goes with neither frames nor fps"),
        ({"times": [2.0]}, r"times: 2.0 must be a time of the animation, from 0 to 1 s"),
        ({"times": 3}, "times = 3: must be a list of times"),
        ({"frames": "5:9"}, "is outside; the animation has 5 frames, 0 to 4"),
        ({"frames": "2:2"}, "chooses no frame"),
        ({"frames": slice("a")}, "is no range of frames"),
        ({"frames": [0, 5]}, "^frames: 5 is outside; the animation has 5 frames, 0 to 4$"),
        (
            {"frames": [0, 1.5]},
            r"^frames = \[0, 1.5\]: 1.5 is no number of a frame; must be numbers of frames, such as",
        ),
        ({"frames": ["a"]}, "'a' is no number of a frame"),
        ({"frames": range(0)}, r"^frames = range\(0, 0\): chooses no frame; "),
        ({"frames": 2.5}, r"^frames = 2.5: must be numbers of frames, such as \[0, 12\]"),
        ({"frames": True}, "^frames = True: must be numbers of frames"),
        ({"fps": 0}, "fps = 0: must be greater than 0"),
        ({"fps": float("nan")}, "fps = nan: must be greater than 0"),
        ({"fps": "x"}, "fps = 'x': must be a number"),
        ({"spp": 2, "time": 1.0}, "spp = 2: goes with neither error nor time"),
        ({"layers": "nothing"}, "there is no such layer"),
    ],
)
def test_wrong_arguments_are_refused_before_anything_is_rendered(given: dict[str, Any], message: str) -> None:
    with pytest.raises(vr.UserError, match=message):
        vr.animate(scene(), **given)


def test_a_prepared_scene_is_one_moment() -> None:
    made = vr.prepare(scene())
    line = "prepared scene is one moment, without an animation: give the scene itself"
    for call in (
        lambda: vr.render(made, at=0.5),
        lambda: vr.at(made, 0.5),
        lambda: vr.animate(made),
        lambda: made.updated({"animation.duration": 3.0}),
        lambda: made.updated({"animation": scene().animation}),
    ):
        with pytest.raises(vr.UserError, match=line):
            call()


def test_a_scene_without_an_animation_is_refused(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(vr.UserError, match="nothing moves in the scene"):
        vr.animate(replace(scene(), animation=None))
    assert run(file, "--set", "animation=null") == 2
    assert "ball.json: nothing moves in it" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no such signal")
@pytest.mark.parametrize("phase", ["compiled code", "a cluster that starts"])
def test_ctrl_c_leaves_no_lock_behind(file: Path, phase: str) -> None:
    """In whatever phase it is pressed: in compiled code, whose process is ended at once, or when workers start."""
    program = """
import ctypes, os, signal, sys, threading, time
from visray.frame_maker import FrameMaker
from visray.cli.program import main
from visray.cluster import connecting

def press():
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()

def stuck(*more):
    press()
    # Without Python's handling of signals, as in Dr.Jit's compiler.
    ctypes.CDLL(None).sleep(5)
    ctypes.CDLL(None).sleep(5)

def starting(*more):
    press()
    time.sleep(10)

FrameMaker._rendered, connecting._crew = stuck, starting
sys.exit(main(sys.argv[1:]))
"""
    more = []
    if phase == "a cluster that starts":
        pytest.importorskip("distributed")
        more = ["--cluster", "local:1"]
    words = ["animate", str(file), "-o", "a.####.png", "-o", "a.gif", "--checkpoint", *more]
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "visray: stopped before anything could be kept\n")
    assert sorted(x.name for x in Path().iterdir()) == ["ball.json"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no such signal")
def test_a_cluster_that_ends_slowly_loses_no_finished_frame(file: Path) -> None:
    """Between the last frame and the end of the movie, Ctrl-C is answered already."""
    program = """
import contextlib, os, signal, sys, time
from visray.frame_maker import FrameMaker
from visray.cli import animating
from visray.cli.program import main

@contextlib.contextmanager
def slow(*more):
    yield None
    time.sleep(2.5)

rendered = FrameMaker._rendered

def pressed(self, frame, values):
    if frame.number == 2:
        os.kill(os.getpid(), signal.SIGINT)
    return rendered(self, frame, values)

animating._crew, FrameMaker._rendered = slow, pressed
sys.exit(main(sys.argv[1:]))
"""
    words = ["animate", str(file), "-o", "a.webp", "--quiet"]
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True)
    assert done.returncode == 130 and "stopping: what is done so far is kept" in done.stderr
    assert len(means(Path("a.webp"))) in (2, 3) and not list(Path().glob("*.lock"))


def means(path: Path) -> list[np.ndarray]:
    """The mean colours of the frames of a movie."""
    with Pillow.open(path) as picture:
        found = []
        for number in range(picture.n_frames):
            picture.seek(number)
            found.append(np.asarray(picture.convert("RGB"), float).mean((0, 1)))
        return found


def test_sequences_and_movies_show_the_same_frames(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = reported(capsys, file, "-o", "out", "-o", "shot.##.exr", "-o", "a.gif", "-o", "a.webp", "--frames", "1:4")
    assert report["asked"] == report["rendered"] == 3 and not report["stopped"]
    assert [f["compiled"] for f in report["frames"][1:]] == [0, 0]
    names = [f"ball.000{k}.{suffix}" for k in (1, 2, 3) for suffix in ("exr", "png")]
    assert sorted(x.name for x in Path("out").iterdir()) == names
    assert sorted(x.name for x in Path().iterdir()) == [
        "a.gif", "a.webp", "ball.json", "out", "shot.01.exr", "shot.02.exr", "shot.03.exr"
    ]  # fmt: skip
    for place, number in enumerate((1, 2, 3)):
        alone = vr.render(scene(), at=number / FPS, progress=False)
        image = vr.Image.read(f"out/ball.000{number}.exr")
        assert np.array_equal(image["P"], alone["P"]) and np.array_equal(image["forward"], alone["forward"])
        assert np.array_equal(image["RGB"], alone["RGB"].astype(np.float16).astype(np.float32))
        assert image.metadata["frame"] == number and image.metadata["scene_hash"] == alone.metadata["scene_hash"]
        shown = alone.display()
        assert np.array_equal(png.read_png(f"out/ball.000{number}.png"), shown)
        for movie in ("a.gif", "a.webp"):
            assert np.abs(means(Path(movie))[place] - shown.mean((0, 1))).max() < 3


def test_render_names_a_frame_by_its_number(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (("--frame", 3), ("--at", 0.6)):
        assert main(["render", str(file), "-o", "r.####.png", "--quiet", *map(str, words)]) == 0
        assert np.array_equal(png.read_png("r.0003.png"), vr.render(scene(), at=3 / FPS, progress=False).display())
        Path("r.0003.png").unlink()
    for words, message in (
        (("--at", "0.5"), "at 0.5 s there is none; give --frame"),
        (("--at", "0.5", "--frame", "2"), "--at = 0.5 and --frame = 2: both say the moment"),
        (("--frame", "9"), "is outside; the animation has 5 frames"),
        (("--set", "animation=null"), "nothing moves in the scene; write r.png"),
    ):
        assert main(["render", str(file), "-o", "r.####.png", *words]) == 2
        assert message in capsys.readouterr().err
    assert not list(Path().glob("*.png"))


def test_finished_frames_are_not_rendered_again(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = file, "-o", "a.####.exr", "-o", "a.webp", "--resume"
    assert reported(capsys, *words)["rendered"] == COUNT
    first = Path("a.webp").read_bytes()
    assert sorted(x.name for x in Path("a.webp.frames").iterdir()) == [f"ball.000{k}.png" for k in range(COUNT)]
    assert reported(capsys, *words)["rendered"] == 0 and Path("a.webp").read_bytes() == first
    # One file is missing; one is of another scene, one has another picture in it; one is damaged.
    Path("a.0001.exr").unlink()
    vr.render(scene(), at=0.4, progress=False, spp=1).write("a.0002.exr")
    Path("a.0003.exr").write_bytes(Path("a.0003.exr").read_bytes()[:2000])
    report = reported(capsys, *words)
    assert [f["frame"] for f in report["frames"]] == [1, 2, 3] and Path("a.webp").read_bytes() == first
    assert report["found"] == 2
    assert report["notes"] == ["a.####.exr: 2 finished frames made again: 1 of spp 1, not 2, 1 damaged"]
    # What makes another picture: the scene, the display curve, the type of numbers, a layer that is missing.
    for more in (("--set", "materials.red.shininess=9"), ("--gamma", "2.2"), ("--float",)):
        assert reported(capsys, *words, *more)["rendered"] == COUNT
    assert reported(capsys, *words[:3], "--resume", "--float", "--layers", "N")["rendered"] == 0
    assert reported(capsys, *words[:3], "--resume", "--layers", "P")["rendered"] == COUNT
    assert reported(capsys, *words[:3], "--resume", "--layers", "N")["rendered"] == COUNT
    assert reported(capsys, *words[:3], "--resume", "--layers", "P")["rendered"] == COUNT
    assert exr.read_facts("a.0000.exr")[1] >= {"P.X"} and not exr.read_facts("a.0000.exr")[1] & {"N.X"}
    # What render has written counts.
    assert main(["render", str(file), "--frame", "2", "-o", "b.####.exr", "--quiet"]) == 0
    report = reported(capsys, file, "-o", "b.####.exr", "--frames", "1:4", "--resume")
    assert [f["frame"] for f in report["frames"]] == [1, 3]


@pytest.mark.parametrize("name", ["a.gif", "a.webp", "a.mp4"])
def test_a_movie_that_exists_is_not_replaced_unasked(file: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    if name == "a.mp4":
        pytest.importorskip("imageio_ffmpeg")
    words = file, "-o", name
    assert run(*words, "--frames", "1:5", "--quiet") == 0
    first = Path(name).read_bytes()
    for more, message in (
        ((), "exists already; --resume renders only what is missing, --overwrite replaces what exists"),
        (("--resume",), "exists already, and none of its frames is kept; --overwrite renders it anew"),
    ):
        capsys.readouterr()
        assert run(*words, *more) == 2 and Path(name).read_bytes() == first
        line = capsys.readouterr().err
        assert line.count("\n") == 1 and f"{name}: {message}" in line
    assert run(*words, "--frames", "1:5", "--overwrite", "--checkpoint", "--quiet") == 0
    assert Path(name).read_bytes() == first
    capsys.readouterr()
    assert run(*words, "--frames", "1:3", "--resume") == 2 and Path(name).read_bytes() == first
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and f"{name}: lasts 0.8 s, and 0.4 s of it would be left; choose" in line
    report = reported(capsys, *words, "--resume")
    assert (report["found"], report["rendered"], report["notes"]) == (4, 1, []) and Path(name).read_bytes() != first
    Path(name).write_bytes(first[:40])
    assert run(*words, "--resume") == 2
    assert f"{name}: is no movie that can be read; --overwrite replaces it" in capsys.readouterr().err


def test_frames_of_other_samples_or_scenes_are_made_again_with_a_note(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = file, "-o", "a.gif", "--resume"
    assert run(*words, "--quiet") == 0
    for more, reason in (
        (("--spp", "1"), "of spp 2, not 1"),
        (("--spp", "1", "--seed", "7"), "of seed 0, not 7"),
        (("--spp", "1", "--seed", "7", "--set", "objects.ball.radius=0.5"), "of another scene"),
        (("--spp", "1", "--seed", "7", "--set", "objects.ball.radius=0.5", "--gamma", "2"), "of another display curve"),
    ):
        report = reported(capsys, *words, *more)
        assert report["notes"] == [f"a.gif.frames/ball.####.png: 5 finished frames made again: 5 {reason}"]
        assert (report["found"], report["rendered"]) == (0, COUNT)
    capsys.readouterr()
    assert run(*words, *more) == 0
    assert f"a.gif: 0 of {COUNT} frames rendered, {COUNT} found finished, " in capsys.readouterr().out


def test_what_workers_compile_is_not_known(tmp_path: Path) -> None:
    files = FrameFiles.of([tmp_path / "a.####.png"], "a", False, fps=5.0)
    report = FrameReport(files, 2, 0.0)
    for number in range(2):
        report.add({"frame": number, "time": number / 5}, None)
    facts = report.facts()
    assert facts["compiled"] is None and [f["compiled"] for f in facts["frames"]] == [None, None]


def test_a_frame_has_the_facts_about_its_error(tmp_path: Path) -> None:
    report = FrameReport(FrameFiles.of([tmp_path / "a.####.png"], "a", False, fps=5.0), 1, 0.0)
    known = {"spp": 4, "error_at_most": 0.1, "depth_error_at_least": 0.3}
    report.add(known | {"frame": 0, "time": 0.0, "sampler": "sobol"}, 0)
    (frame,) = report.facts()["frames"]
    assert known.items() <= frame.items() and "sampler" not in frame


def test_an_output_is_named_once(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for names in (("a.gif", "a.gif"), ("out", "out/ball.####.png")):
        assert run(file, *(word for name in names for word in ("-o", name))) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1 and f"{names[1]}: is an output twice; name each output once" in line


def test_files_that_exist_are_refused_at_once(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(file, "-o", "out", "--frames", 2, "--quiet") == 0
    before = Path("out/ball.0002.png").stat().st_mtime_ns
    assert run(file, "-o", "out") == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "out/ball.0002.exr: exists already, and 1 more of these files" in line
    assert len(list(Path("out").iterdir())) == 2
    assert run(file, "-o", "out", "--overwrite", "--resume") == 2
    assert run(file, "-o", "out", "--overwrite", "--quiet") == 0
    assert len(list(Path("out").iterdir())) == 2 * COUNT and Path("out/ball.0002.png").stat().st_mtime_ns > before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "a.mov"), "is no place for frames; right would be a folder"),
        (("-o", "a.exr"), r"write a.####.exr"),
        (("-o", "a.%04d.png"), "a.%04d.png: numbers of frames are written with #; write a.####.png"),
        (("-o", "a%d.exr"), "a%d.exr: numbers of frames are written with #; write a####.exr"),
        (("-o", "a.%2d.exr"), "a.%2d.exr: numbers of frames are written with #; write a.##.exr"),
        (("--set", "animation=null"), "ball.json: nothing moves in it, as it has no animation; give it one"),
        (("-o", "ball"), "is a file, not a folder"),
        (("-o", "no/where/a.##.exr"), "cannot be made"),
        (("-o", "nowhere/a.gif"), "does not exist; create it first"),
        (("--fps", "0"), "fps = 0: must be greater than 0"),
        (("--fps", "nan"), "fps = nan: must be greater than 0"),
        (("--fps", "-2"), "fps = -2: must be greater than 0"),
        (("--frames", "3:99"), "is outside; the animation has 5 frames"),
        (("--frames", "2:1"), "chooses no frame"),
        (("--frames", "x"), "is no range of frames"),
        (("--spp", "2", "--time", "1"), "goes with neither error nor time"),
        (("--gamma", "no"), "gamma: 'no' cannot be used"),
        (("--layers", "no"), "there is no layer 'no'"),
    ],
)
def test_bad_input_is_one_line(
    file: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], message: str
) -> None:
    Path("ball").touch()
    words = words if "-o" in words else ("-o", "out", *words)
    assert run(file, *words) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and message in line
    assert not list(Path().glob("**/*.png")) and not list(Path().glob("**/*.lock"))


def test_two_at_once_are_refused(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with locked(Path("a.####.png")):
        assert run(file, "-o", "a.####.png") == 2
    assert "another process uses it" in capsys.readouterr().err and not list(Path().glob("*.png"))
    assert run(file, "-o", "a.####.png", "--quiet") == 0 and not list(Path().glob("*.lock"))


def test_ctrl_c_keeps_the_finished_frames_and_a_movie_of_them(
    file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rendered = FrameMaker._rendered

    def pressed(self: FrameMaker, frame: Any, values: Any) -> vr.Image:
        if frame.number == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return rendered(self, frame, values)

    monkeypatch.setattr(FrameMaker, "_rendered", pressed)
    assert run(file, "-o", "a.webp", "-o", "a.####.exr", "--json") == 130
    report = json.loads(capsys.readouterr().out)
    assert report["stopped"] and report["rendered"] in (3, 4)
    assert len(means(Path("a.webp"))) == len(list(Path().glob("a.*.exr"))) == report["rendered"]
    monkeypatch.undo()
    monkeypatch.chdir(file.parent)
    assert "a.webp: keeps no frames, so --overwrite begins anew; with --checkpoint" in report["notes"][0]
    assert run(file, "-o", "a.webp", "-o", "a.####.exr", "--resume") == 2
    assert "a.webp: exists already, and none of its frames is kept; --overwrite" in capsys.readouterr().err
    Path("a.webp").unlink()
    again = reported(capsys, file, "-o", "a.####.exr", "--resume")
    assert (again["asked"], again["found"]) == (COUNT, report["rendered"])
    assert run(file, "-o", "a.webp", "-o", "a.####.exr", "--resume") == 0
    assert f"{COUNT} frames rendered, " in capsys.readouterr().out and len(means(Path("a.webp"))) == COUNT


def test_a_movie_gets_its_frames_in_order(tmp_path: Path) -> None:
    """However they come: those of workers come as they are finished."""
    pictures = {k: vr.Image({"RGB": np.full((8, 8, 3), 0.2 * (k + 1), np.float32)}) for k in (4, 2, 0)}
    files = FrameFiles.of([tmp_path / "a.webp"], "a", False, fps=5.0)
    with files.opened([0, 2, 4]) as writer:
        for number, image in pictures.items():
            writer.write(number, image)
    shades = [m[0] for m in means(tmp_path / "a.webp")]
    assert len(shades) == 3 and shades == sorted(shades)
    assert shades == pytest.approx([pictures[k].display().mean() for k in (0, 2, 4)], abs=2)


def killed_and_resumed(file: Path, moments: int, seed: int) -> None:
    """Kills a command at random moments, and goes on, until it ends. Then everything is as if nothing had happened."""
    command = [sys.executable, "-m", "visray", "animate", str(file), "--quiet", "--size", "120x80", "--spp", "64"]
    whole, parts = ["-o", "whole.####.exr", "-o", "whole.webp"], ["-o", "parts.####.exr", "-o", "parts.webp"]
    begun = time.perf_counter()
    subprocess.run([*command, *whole, "--checkpoint"], check=True)
    lasts, chance = time.perf_counter() - begun, np.random.default_rng(seed)
    for _ in range(moments):
        process = subprocess.Popen([*command, *parts, "--resume"])
        try:
            process.wait(timeout=float(chance.uniform(0.3, 1.0)) * lasts)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        # What is there is whole.
        for path in Path().glob("parts.*.exr"):
            vr.Image.read(path)
        if Path("parts.webp").exists():
            assert Path("parts.webp").read_bytes() == Path("whole.webp").read_bytes()
    subprocess.run([*command, *parts, "--resume"], check=True)
    assert Path("parts.webp").read_bytes() == Path("whole.webp").read_bytes()
    for number in range(COUNT):
        one, other = (vr.Image.read(f"{name}.000{number}.exr") for name in ("whole", "parts"))
        assert one.layers.keys() == other.layers.keys()
        assert all(np.array_equal(one[name], other[name]) for name in one.layers)
    assert not list(Path().glob(".visray-*"))


@pytest.mark.slow
def test_a_killed_command_goes_on_to_the_same_bits(file: Path) -> None:
    killed_and_resumed(file, 3, seed=1)


@pytest.mark.nightly
def test_a_command_that_is_killed_often_goes_on_to_the_same_bits(file: Path) -> None:
    killed_and_resumed(file, 50, seed=2)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes")
def test_a_file_that_cannot_be_written_ends_in_one_line_and_the_frames_stay(file: Path) -> None:
    """As on a full disk: from the fourth frame on, the system allows only small files."""
    program = """
import resource, sys
from visray.frame_maker import FrameMaker
from visray.cli.program import main

rendered = FrameMaker._rendered

def limited(self, frame, values):
    if frame.number == 3:
        resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))
    return rendered(self, frame, values)

FrameMaker._rendered = limited
sys.exit(main(sys.argv[1:]))
"""
    words = ["animate", str(file), "-o", "a.####.png", "--quiet"]
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "a.0003.png: cannot be written, the file would be larger" in done.stderr
    assert sorted(x.name for x in Path().iterdir()) == ["a.0000.png", "a.0001.png", "a.0002.png", "ball.json"]
    assert run(file, "-o", "a.####.png", "--quiet", "--resume") == 0


def test_ctrl_c_while_a_gif_is_finished_loses_no_frame(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its frames are all rendered then, and the command ends as if there had been no Ctrl-C."""
    finish = Gif.finish

    def interrupted(gif: Gif) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        finish(gif)

    monkeypatch.setattr(Gif, "finish", interrupted)
    assert main(["animate", str(file), "-o", "a.gif", "--quiet"]) == 0
    with Pillow.open("a.gif") as movie:
        assert movie.n_frames == 5
