"""Pictures on standard output, and the line that says what was rendered."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray import terminal
from visray.cli import main
from visray.cli.picture_report import line

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SPHERE, MOVES = str(SCENES / "sphere.json"), str(SCENES / "bouncing-balls.json")
SMALL = ["--size", "24x16", "--spp", "4"]


def said(capsysbinary, *words):
    """Exit code, the bytes on standard output, and the text on standard error."""
    code = main(list(words))
    out, err = capsysbinary.readouterr()
    return code, out, err.decode()


def test_a_png_file_on_standard_output(capsysbinary, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = said(capsysbinary, "render", SPHERE, *SMALL, "-o", "-")
    expected = vr.render(SPHERE, size=(24, 16), spp=4).display()
    np.testing.assert_array_equal(np.array(Pillow.open(io.BytesIO(out))), expected[..., :3])
    assert code == 0 and "-: 24 x 16 pixels in " in err and not list(tmp_path.iterdir())


def test_an_exr_file_on_standard_output_beside_another_file(capsysbinary, tmp_path):
    other = tmp_path / "a.exr"
    code, out, err = said(capsysbinary, "render", SPHERE, *SMALL, "-o", "-.exr", "-o", str(other))
    (tmp_path / "b.exr").write_bytes(out)
    np.testing.assert_array_equal(vr.Image.read(tmp_path / "b.exr")["Z"], vr.Image.read(other)["Z"])
    assert code == 0 and f"-.exr, {other}: " in err


def test_other_commands_write_there_too(capsysbinary):
    code, out, err = said(capsysbinary, "surface", "heart", *SMALL, "--output", "-")
    assert code == 0 and Pillow.open(io.BytesIO(out)).size == (24, 16) and "heart: degree 6" in err
    assert json.loads(said(capsysbinary, "import", SPHERE, "-o", "-")[1])["objects"]


REFUSED = {
    "twice": (["render", SPHERE, "-o", "-", "-o", "-.exr"], "-o -.exr: standard output takes one picture"),
    "json": (
        ["render", SPHERE, "-o", "-", "--json"],
        "-o -: writes the picture to standard output, and so does --json",
    ),
    "checkpoint": (["render", SPHERE, "-o", "-", "--checkpoint"], "the samples are kept beside the picture"),
    "frames": (["animate", MOVES, "-o", "-"], "-o -: standard output takes one picture, and frames are many"),
    "still": (["render", SPHERE, "-o", "a/shot.####.png"], "nothing moves in the scene; write a/shot.png"),
    "only hashes": (["render", SPHERE, "-o", "####.png"], "nothing moves in the scene; write picture.png"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_go_to_standard_output(name, capsysbinary):
    words, text = REFUSED[name]
    code, out, err = said(capsysbinary, *words)
    assert (code, out) == (2, b"") and text in err and err.count("\n") == 1


def test_a_terminal_gets_no_bytes(capsysbinary, monkeypatch):
    monkeypatch.setattr(terminal, "is_terminal", lambda: True)
    code, out, err = said(capsysbinary, "render", SPHERE, "-o", "-")
    assert (code, out) == (2, b"") and "-o -: a terminal shows no bytes of a picture" in err


FACTS = {"interrupted": 0, "spp": 4, "sampler": "stratified", "error_at_most": 0.094}
ADAPTIVE = {
    "interrupted": 0, "spp": 9.75, "spp_least": 8, "spp_most": 128, "error": 0.00173, "error_low": 0.00167,
    "error_high": 0.00183, "depth_error": 0.0, "file_error": 0.0, "error_asked": 0.002,
}  # fmt: skip
LINES = {
    "samples": (FACTS, "error below 9.4 %, 4 samples per pixel"),
    "independent": (FACTS | {"sampler": "independent"}, "error 9.4 %, 4 samples per pixel"),
    "equal": (FACTS | {"error_at_most": 1e-9}, "no noise seen, 4 samples per pixel"),
    "few": (FACTS | {"error_at_most": 3.42}, "error unknown: too few samples, 4 samples per pixel"),
    "one": (FACTS | {"spp": 1}, "error below 9.4 %, 1 sample per pixel"),
    "certificate": (FACTS | {"unresolved": 3, "residual_ulps": 1.2}, "error below 9.4 %, 4 samples per pixel"),
    "depth": (
        FACTS | {"depth_error_at_least": 0.3},
        "error below 9.4 % by noise, at least 30 % by settings.depth, 4 samples per pixel",
    ),
    "depth without noise": (
        FACTS | {"error_at_most": 0.0, "depth_error_at_least": 0.02},
        "error at least 2 % by settings.depth, 4 samples per pixel",
    ),
    "little depth": (FACTS | {"depth_error_at_least": 0.01}, "error below 9.4 %, 4 samples per pixel"),
    "stopped": (FACTS | {"interrupted": 1, "spp_asked": 16}, "stopped, error below 9.4 %, 4 of 16 samples per pixel"),
    "adaptive": (ADAPTIVE, "error 0.173 % (0.167 to 0.183 %), 9.75 samples per pixel (8 to 128)"),
    "missed": (
        ADAPTIVE | {"error_asked": 0.001},
        "error 0.173 % (0.167 to 0.183 %), above the 0.1 % asked, 9.75 samples per pixel (8 to 128)",
    ),
    "depth of a goal": (
        ADAPTIVE | {"depth_error": 0.001},
        "error 0.173 % (0.167 to 0.183 %; depth alone: 0.1 %), 9.75 samples per pixel (8 to 128)",
    ),
    "black": (
        ADAPTIVE | dict.fromkeys(("error", "error_low", "error_high"), 0.0),
        "no noise, 9.75 samples per pixel (8 to 128)",
    ),
}


@pytest.mark.parametrize("name", LINES)
def test_the_line_says_file_size_time_error_and_samples(name):
    facts, text = LINES[name]
    image = vr.Image({"RGB": np.zeros((2, 3, 3))}, facts)
    before = "a.png: 3 x 2 pixels in 1.2 s, "
    assert line(image, [Path("a.png")], 1.234, None) == before + text
    assert line(image, [Path("a.png")], 1.234, 2.0) == f"{before}{text} (2 of them from the checkpoint)"
