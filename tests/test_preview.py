"""--preview: a picture in the terminal. What terminals are sent is decoded and compared with the picture's pixels."""

import re
from pathlib import Path

import numpy as np
import pytest

import visray as vr
from visray import terminal
from visray.cli import main
from visray.errors import UserError
from visray.output.preview import preview, screen

pytest.importorskip("pty", reason="only Unix has terminals of this kind")
from terminals import (
    CELL,
    FEATURES,
    HAS_KITTY,
    HAS_NO_SIXEL,
    HAS_SIXEL,
    KITTY,
    half_blocks,
    in_terminal,
    kitty,
    sixel,
)

SPHERE = str(Path(__file__).resolve().parents[1] / "scenes" / "sphere.json")
PORTS = str(Path(__file__).resolve().parents[1] / "scenes" / "data" / "ports.csv")
SMALL = ["--size", "48x32", "--spp", "4"]
# A script that shows a picture of some columns and rows.
SCRIPT = """
import sys
from test_preview import picture
from visray.cli import main
from visray.cli.program import terminal
from visray.output.preview import preview
terminal.open_streams()
preview(picture(*map(int, sys.argv[1:])))
"""


def picture(width, height):
    """A picture whose rows, columns and colours all differ; of few colours, as sixel has at most 256."""
    y, x = np.mgrid[:height, :width]
    rgb = np.stack([x * 8 // width / 8, y * 8 // height / 8, ((x + y) % 2) / 2], axis=-1)
    return vr.Image({"RGB": rgb.astype(np.float32)})


def shown(width, height, answers=None, **more):
    code, sent = in_terminal(["-c", SCRIPT, str(width), str(height)], answers, **more)
    assert code == 0, sent.decode()
    return sent


def test_half_blocks_are_the_pixels():
    np.testing.assert_array_equal(half_blocks(shown(40, 24)), picture(40, 24).display())


def test_a_large_picture_fits_and_a_strip_is_seen():
    """A picture of 400 x 200 pixels has 2 x 2 pixels and more for each half of a character."""
    small = half_blocks(shown(400, 200, columns=50, rows=40))
    assert small.shape == (26, 50, 3) or small.shape == (24, 50, 3)
    low = half_blocks(shown(400, 400, columns=80, rows=12))
    assert low.shape == (20, 20, 3)
    # Red grows to the right and green downwards, as in the picture.
    assert (np.diff(low[0, ::3, 0].astype(int)) > 0).all() and (np.diff(low[::3, 0, 1].astype(int)) > 0).all()
    assert half_blocks(shown(300, 1)).shape == (2, 80, 3)
    assert half_blocks(shown(1, 300)).shape[1] == 1


def test_a_terminal_with_sixel_gets_the_pixels():
    sent = shown(60, 40, {FEATURES: HAS_SIXEL})
    assert b"\xe2\x96\x80" not in sent
    np.testing.assert_allclose(sixel(sent), picture(60, 40).display(), atol=1.3)  # sixel has 101 levels


def test_a_terminal_with_kitty_gets_the_pixels():
    """Also without COLORTERM: the colour of the text is the number of the picture, and no colour is rounded."""
    sent = shown(60, 40, {FEATURES: HAS_NO_SIXEL, KITTY: HAS_KITTY}, COLORTERM=None, NO_COLOR="1")
    pixels, number, columns, rows = kitty(sent)
    np.testing.assert_array_equal(pixels, picture(60, 40).display())
    assert (columns, rows) == (6, 2) and sent.decode().count("\U0010eeee") == 12
    assert f"\x1b[38;2;{number >> 16 & 255};{number >> 8 & 255};{number & 255}m\U0010eeee" in sent.decode()


def test_the_size_of_a_character_is_asked_for():
    """Where the system does not know it."""
    answers = {FEATURES: HAS_NO_SIXEL, KITTY: HAS_KITTY, CELL: b"\x1b[6;8;4t"}
    pixels, _, columns, rows = kitty(shown(60, 40, answers, cell=(0, 0)))
    assert (columns, rows) == (15, 5)
    np.testing.assert_array_equal(pixels, picture(60, 40).display())


@pytest.mark.parametrize("answers", [{}, {FEATURES: b"\xff\xff"}, {FEATURES: b"ls\n", KITTY: b"\x1b_Gx\x1b\\"}])
def test_a_terminal_that_answers_nothing_or_nonsense_gets_half_blocks(answers):
    sent = shown(20, 12, answers, cell=(0, 0))
    np.testing.assert_array_equal(half_blocks(sent), picture(20, 12).display())
    assert b"Traceback" not in sent and b"Failed" not in sent


LATE = """
import select, sys
from test_preview import picture
from visray import terminal
from visray.output.preview import preview
terminal.LATE = 3
preview(picture(20, 12))
print("left:", select.select([0], [], [], 0.5)[0])
"""


def test_late_answers_are_not_left_for_the_shell():
    code, sent = in_terminal(["-c", LATE], {KITTY: HAS_SIXEL})
    assert code == 0 and b"left: []" in sent and b"?62" not in sent


NOT_ASKED = {
    "input from a file": "os.dup2(os.open(os.devnull, os.O_RDONLY), 0)",
    # A job in the background, which the system would stop.
    "background": """
child = os.fork()
if child:
    os._exit(9 if os.WIFSTOPPED(os.waitpid(child, os.WUNTRACED)[1]) else 0)
os.setpgid(0, 0)""",
}


@pytest.mark.parametrize("way", NOT_ASKED)
def test_a_terminal_that_cannot_answer_is_not_asked(way):
    code, sent = in_terminal(["-c", f"import os\n{NOT_ASKED[way]}\n{SCRIPT}", "20", "12"], {FEATURES: HAS_SIXEL})
    assert code == 0 and not re.search(FEATURES + b"|" + KITTY + b"|" + CELL, sent)
    np.testing.assert_array_equal(half_blocks(sent), picture(20, 12).display())


def test_without_colours_there_are_shades():
    sent = shown(20, 12, NO_COLOR="1").decode()
    assert "38;2" not in sent and "48;2" not in sent and "\u2580" not in sent
    assert sum(sent.count(c) for c in "\u2588\u2593\u2592\u2591") > 40


@pytest.mark.parametrize(
    ("environment", "reason"),
    [
        ({"TERM": "dumb", "WAYLAND_DISPLAY": "wayland-0"}, "a terminal with TERM=dumb shows no picture; --show does"),
        ({"TERM": "dumb", "DISPLAY": ""}, "a terminal with TERM=dumb shows no picture; -o picture.png writes a file"),
        ({"PYTHONIOENCODING": "latin-1"}, "the encoding of standard output has no half blocks"),
    ],
)
def test_terminals_without_pictures_say_so(environment, reason):
    code, sent = in_terminal(["-c", SCRIPT, "20", "12"], {FEATURES: HAS_SIXEL}, **environment)
    assert code == 1 and f"UserError: preview: {reason}" in sent.decode() and b"\x1b" not in sent


def test_what_is_transparent_is_black(monkeypatch, capsys):
    """Half of a pixel of white is grey, and not white."""
    monkeypatch.setattr(terminal, "is_terminal", lambda: True)
    monkeypatch.setattr(terminal, "can_write", lambda text: True)
    for name, value in {"TERM": "xterm", "COLORTERM": "truecolor", "COLUMNS": "80", "LINES": "24"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("NO_COLOR", raising=False)
    rgb, a = np.full((2, 3, 3), 0.5, np.float32), np.full((2, 3), 0.5, np.float32)
    rgb[0, 0], a[0, 0] = 0, 0
    preview(vr.Image({"RGB": rgb, "A": a}))
    pixels = half_blocks(capsys.readouterr().out.replace("\n", "\r\n").encode())
    assert pixels.tolist() == [[[0] * 3, [188] * 3, [188] * 3], [[188] * 3] * 3]


@pytest.mark.parametrize("words", [["render", SPHERE, *SMALL], ["data", PORTS, *SMALL], ["surface", "heart", *SMALL]])
def test_without_a_terminal_a_look_is_refused(words, tmp_path, capsys, monkeypatch):
    """It would show nothing, and replaces no file. With -o, the file is written, and a note says that none looks."""
    with pytest.raises(UserError, match="standard output is not a terminal"):
        screen()
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    text = "preview: standard output is not a terminal, so it shows no picture"
    for more in ([], ["--quiet"]):
        assert main([*words, "--preview", *more]) == 2
        assert capsys.readouterr() == ("", f"visray: {text}; -o picture.png writes a file\n")
    assert list(tmp_path.iterdir()) == []
    assert main([*words, "--preview", "-o", "a.png"]) == 0
    out, err = capsys.readouterr()
    assert f"visray: note: {text}\n" in err and "picture.png" not in out + err and "\x1b" not in out
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_the_report_and_the_picture_do_not_mix(capsys):
    assert main(["render", SPHERE, "--preview", "--json"]) == 2
    assert "--preview and --json" in capsys.readouterr().err


def test_a_picture_that_is_looked_at_is_not_written(tmp_path):
    run = f"import os, sys; os.chdir({str(tmp_path)!r}); from visray.cli import main; sys.exit(main(sys.argv[1:]))"
    code, sent = in_terminal(["-c", run, "render", SPHERE, *SMALL, "--preview"])
    assert code == 0 and list(tmp_path.iterdir()) == []
    np.testing.assert_array_equal(half_blocks(sent), vr.render(SPHERE, size=(48, 32), spp=4).display()[..., :3])
    assert sent.decode().rstrip().endswith("; not saved: -o sphere.png writes it")


def test_a_picture_that_is_written_is_looked_at_too(tmp_path):
    file = tmp_path / "a.png"
    code, sent = in_terminal(["-m", "visray", "render", SPHERE, *SMALL, "--preview", "--quiet", "-o", str(file)])
    assert code == 0 and file.exists() and b"not saved" not in sent
    assert half_blocks(sent).shape == (32, 48, 3)
