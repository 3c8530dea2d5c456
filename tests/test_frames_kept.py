"""Which frames of an earlier run count as made, and what stands in the way of the others."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_animate import COUNT, file, reported, run, scene  # noqa: F401 - a fixture

import visray as vr  # isort: skip - before drjit
import drjit as dr

from visray.checkpoint import Checkpoint
from visray.cli.program import main
from visray.output import exr, png
from visray.output.layers import BY_NAME
from visray.output.lock import locked
from visray.output.sequence import check_unused

# What brings a layer that is not in every picture: options, a change of the scene.
BRING = {
    "variance": (),
    "samples": ("--error", "0.5"),
    "error": ("--error", "0.5"),
    "forward": (),
    "unresolved": ("--set", 'objects.ball={"type": "torus", "center": [0, 0.8, 0]}', "--set", "animation.tracks.x="
                   '{"address": "objects.ball.center.0", "times": [0, 1], "values": [0, 1]}'),
}  # fmt: skip


@pytest.mark.parametrize("layer", BRING)
def test_frames_without_a_layer_that_they_could_have_are_made_again(
    file: Path, capsys: pytest.CaptureFixture[str], layer: str  # noqa: F811
) -> None:  # fmt: skip
    words = file, "-o", "a.####.exr", "--frames", "0:2", "--resume", *BRING[layer]
    for layers, rendered in (("Z", 2), (f"Z,{layer}", 2), (f"Z,{layer}", 0), ("Z", 0)):
        assert reported(capsys, *words, "--layers", layers)["rendered"] == rendered, layers
    assert exr.read_facts("a.0001.exr")[1] >= set(BY_NAME[layer].channels)


@pytest.mark.parametrize("more", [("--spp", "1"), ("--error", "0.5"), ("--spp", "2", "--no-legend")])
def test_layers_that_a_picture_cannot_have_are_not_waited_for(
    file: Path, capsys: pytest.CaptureFixture[str], more: tuple[str, ...]  # noqa: F811
) -> None:  # fmt: skip
    words = file, "-o", "a.####.exr", "--frames", "0:2", "--resume", *more
    assert [reported(capsys, *words)["rendered"] for _ in range(2)] == [2, 0]


def test_files_that_were_cut_off_are_damaged(file: Path, capsys: pytest.CaptureFixture[str]) -> None:  # noqa: F811
    """Wherever their end is lost, and however little of it."""
    words = file, "-o", "a.####.exr", "-o", "a.webp", "--frames", "0:1", "--resume"
    assert reported(capsys, *words)["rendered"] == 1
    movie = Path("a.webp").read_bytes()
    for path, damage in ((Path("a.0000.exr"), exr.read_facts), (Path("a.webp.frames/ball.0000.png"), png.read_facts)):
        whole = path.read_bytes()
        for left in {1, 2, 3, 4, 5, 12, 13, 40, len(whole) // 2, len(whole) - 9}:
            path.write_bytes(whole[:-left])
            with pytest.raises(vr.UserError):
                damage(path)
        report = reported(capsys, *words)
        assert report["rendered"] == 1 and report["notes"][0].endswith("1 finished frame made again: 1 damaged")
        path.write_bytes(whole[:-3])
        assert reported(capsys, *words)["rendered"] == 1 and Path("a.webp").read_bytes() == movie
    # A byte of the pixels is another one.
    whole = bytearray(path.read_bytes())
    whole[whole.index(b"IDAT") + 20] ^= 1
    path.write_bytes(whole)
    assert reported(capsys, *words)["rendered"] == 1 and Path("a.webp").read_bytes() == movie


def test_a_place_where_no_file_can_be_is_found_before_the_first_frame(
    file: Path, capsys: pytest.CaptureFixture[str]  # noqa: F811
) -> None:  # fmt: skip
    Path("a.0003.png").mkdir()
    for more in ((), ("--resume",), ("--overwrite",)):
        assert run(file, "-o", "a.####.png", *more) == 2
        assert "a.0003.png: this is a folder; give the name of a file in it" in capsys.readouterr().err
    assert [x.name for x in Path().glob("a.*")] == ["a.0003.png"]


def test_render_does_not_write_into_a_sequence_that_is_in_use(
    file: Path, capsys: pytest.CaptureFixture[str]  # noqa: F811
) -> None:  # fmt: skip
    folder = Path("x.mp4.frames")
    folder.mkdir()
    free = folder / "other.0002.png", folder / "slow.02.png", folder / "slow.0002.exr", folder / "slow.a002.png"
    with locked(folder / "slow.####.png"):
        for words in (("-o", folder / "slow.####.png", "--frame", "2"), ("-o", folder / "slow.0002.png")):
            assert main(["render", str(file), *map(str, words), "--quiet"]) == 2
            assert "slow.####.png: another process uses it" in capsys.readouterr().err
        for path in free:
            check_unused(path)
    assert main(["render", str(file), "-o", str(folder / "slow.0002.png"), "--quiet"]) == 0
    assert [x.name for x in folder.iterdir()] == ["slow.0002.png"]


def kept_samples(path: str, **more: Any) -> None:
    """Writes a checkpoint of the third frame."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Checkpoint, "every", 0.0)
        patch.setattr(Checkpoint, "done", lambda self: None)
        vr.render(scene(), at=0.4, progress=False, checkpoint=path, **more)
    assert Path(path).exists()


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ({"seed": 7}, "is of seed 7, not 0"),
        ({"spp": 4}, "is of spp 4, not 2"),
        (None, "is no checkp"),
    ],
)
def test_a_stale_checkpoint_of_a_frame_is_set_aside(
    file: Path, capsys: pytest.CaptureFixture[str], more: Any, problem: str  # noqa: F811
) -> None:  # fmt: skip
    path = Path("a.0002.png.checkpoint")
    kept_samples(str(path), **(more or {}))
    if more is None:
        path.write_bytes(path.read_bytes()[:-40])
    stale = path.read_bytes()
    report = reported(capsys, file, "-o", "a.####.png", "--resume")
    assert report["rendered"] == COUNT and len(report["notes"]) == 1
    assert report["notes"][0].startswith(f"frame 2: a.0002.png.checkpoint: {problem}")
    assert report["notes"][0].endswith("; it is kept as a.0002.png.checkpoint.old, and the picture begins anew")
    assert Path("a.0002.png.checkpoint.old").read_bytes() == stale and not path.exists()
    expected = vr.render(scene(), at=0.4, progress=False).display()
    assert np.array_equal(png.read_png("a.0002.png"), expected)


def test_each_frame_counts_its_own_kernels(file: Path, capsys: pytest.CaptureFixture[str]) -> None:  # noqa: F811
    """Those of its layers, too, which are computed after its samples."""
    dr.flush_kernel_cache()
    report = reported(capsys, file, "-o", "a.####.exr", "--frames", "0:3", "--size", "26x18")
    compiled = [frame["compiled"] for frame in report["frames"]]
    assert compiled == [report["compiled"], 0, 0] and report["compiled"] > 0
