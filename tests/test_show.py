"""image.show() and --show: the system's viewer gets a file with the picture's pixels. The viewers here are scripts."""

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

import visray as vr
from visray.cli import main
from visray.errors import UserError
from visray.output import system_viewer

ROOT = Path(__file__).resolve().parents[1]
SPHERE = str(ROOT / "scenes" / "sphere.json")
SMALL = ["--size", "48x32", "--spp", "4"]
RGB = np.random.default_rng(1).random((20, 30, 3), np.float32)
IMAGE = vr.Image({"RGB": RGB, "A": np.full((20, 30), 0.75, np.float32)})

pytestmark = pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="the viewer is found in another way")


@pytest.fixture
def viewers(tmp_path, monkeypatch):
    """A folder that alone has programs, in which a test can write viewers, and that can open windows."""
    folder = tmp_path / "programs"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    for name in system_viewer.DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-9")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    # On a busy machine, a script needs some time to end.
    monkeypatch.setattr(system_viewer, "FAILS_WITHIN", 60.0)
    return folder


# A viewer that tells the path of the file.
TELLS = 'printf %s "$1" > "$0.aside"; /bin/mv "$0.aside" "$0.file"; echo noise; echo noise >&2'


def viewer(path, script=TELLS):
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def file_of(path) -> Path:
    """The file that a viewer was given, as soon as it is."""
    end = time.monotonic() + 60
    while not (told := path.with_name(path.name + ".file")).exists() and time.monotonic() < end:
        time.sleep(0.02)
    return Path(told.read_text())


def test_the_viewer_gets_the_pixels(viewers):
    viewer(viewers / "xdg-open")
    IMAGE.show(gamma=2.2, exposure=-1)
    shown = np.array(Pillow.open(file_of(viewers / "xdg-open")))
    np.testing.assert_array_equal(shown, IMAGE.display(gamma=2.2, exposure=-1))
    assert shown.shape == (20, 30, 4)


def test_a_viewer_that_stays_is_not_waited_for(viewers, monkeypatch):
    """It neither gets the standard streams nor Ctrl-C, as it has a session of its own."""
    monkeypatch.setattr(system_viewer, "FAILS_WITHIN", 0.1)
    viewer(viewers / "xdg-open", f"echo $$ > '{viewers}/number'; {TELLS}; exec /bin/sleep 600")
    IMAGE.show()
    file_of(viewers / "xdg-open")
    number = int((viewers / "number").read_text())
    try:
        assert os.getsid(number) == number
        assert os.readlink(f"/proc/{number}/fd/1") == os.devnull
    finally:
        os.kill(number, 9)


def test_if_one_viewer_fails_the_next_one_is_asked(viewers):
    viewer(viewers / "xdg-open", "exit 3")
    viewer(viewers / "gm", TELLS.replace("$1", "$1 $2"))
    IMAGE.show()
    command, path = str(file_of(viewers / "gm")).split(" ", 1)
    assert command == "display" and Path(path).suffix == ".png"


def test_if_all_viewers_fail_the_picture_is_kept(viewers):
    viewer(viewers / "xdg-open", "exit 3")
    (viewers / "feh").write_text("no program\n")
    (viewers / "feh").chmod(0o755)
    with pytest.raises(UserError, match=r"^show: xdg-open, feh failed; open (.*) yourself$") as raised:
        IMAGE.show()
    path = str(raised.value).removeprefix("show: xdg-open, feh failed; open ").removesuffix(" yourself")
    np.testing.assert_array_equal(Pillow.open(path), IMAGE.display())


def test_without_a_viewer_or_a_display_nothing_is_rendered(viewers, monkeypatch, capsys):
    with pytest.raises(UserError, match="no program that shows pictures was found; install xdg-utils"):
        IMAGE.show()
    assert main(["render", SPHERE, *SMALL, "--show", "-o", "a.png"]) == 2
    assert capsys.readouterr().err.startswith("visray: show: no program")
    viewer(viewers / "xdg-open")
    monkeypatch.delenv("WAYLAND_DISPLAY")
    with pytest.raises(UserError, match=r'no display .*; write a file, image.write\("picture.png"\), and open'):
        IMAGE.show()
    assert main(["data", str(ROOT / "scenes/data/ports.csv"), "--show"]) == 2
    assert capsys.readouterr().err.startswith("visray: show: there is no display")
    assert list(Path.cwd().iterdir()) == [viewers]


def test_a_display_that_nobody_serves_shows_nothing(viewers, monkeypatch, capsys):
    """Programs such as xdg-open may end well there, or take long to fail."""
    viewer(viewers / "xdg-open")
    monkeypatch.delenv("WAYLAND_DISPLAY")
    number = next(n for n in range(4000, 5000) if not Path(f"/tmp/.X11-unix/X{n}").exists())
    for display in (f":{number}", f":{number}.0", f"unix:{number}"):
        monkeypatch.setenv("DISPLAY", display)
        assert main(["render", SPHERE, *SMALL, "--show"]) == 2
        assert capsys.readouterr().err.startswith(f"visray: show: DISPLAY = {display}: no display answers there")
    with socket.socket(socket.AF_INET) as server:
        server.bind(("127.0.0.1", 6000 + number))
        server.listen()
        IMAGE.show()
        assert file_of(viewers / "xdg-open").suffix == ".png"
    # Those of other machines are not asked.
    (viewers / "xdg-open.file").unlink()
    monkeypatch.setenv("DISPLAY", "elsewhere.example:0")
    IMAGE.show()
    assert file_of(viewers / "xdg-open").suffix == ".png"


def test_a_picture_without_colour_is_not_shown(viewers):
    viewer(viewers / "xdg-open")
    with pytest.raises(UserError, match="no layer 'RGB'"):
        vr.Image({"Z": np.ones((2, 3))}).show()


def test_in_a_notebook_it_is_shown_below_the_cell(monkeypatch):
    """IPython is a stand-in that has what visray uses of it."""
    shown = []
    page = type(sys)("IPython.display")
    page.Image, page.display = (lambda data, format: (format, data)), shown.append
    notebook = type(sys)("IPython")
    notebook.get_ipython = lambda: type("Shell", (), {"kernel": 1})()
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.display", page)
    IMAGE.show()
    [(format, data)] = shown
    assert format == "png" and data.startswith(b"\x89PNG")


def test_show_writes_no_file_and_leaves_the_report_alone(viewers):
    """Standard output has the report only, and ends with the program, although the viewer stays."""
    viewer(viewers / "xdg-open", f"{TELLS}; echo $$ > '{viewers}/number'; exec /bin/sleep 600")
    words = [sys.executable, "-m", "visray", "render", SPHERE, *SMALL, "--show", "--json"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(viewers.parent)}
    done = subprocess.run(words, capture_output=True, text=True, env=environment, timeout=120)
    path = file_of(viewers / "xdg-open")
    os.kill(int((viewers / "number").read_text()), 9)
    assert done.returncode == 0 and done.stderr == ""
    assert json.loads(done.stdout)["outputs"] == []
    assert path.name == "sphere.png" and path.parent != viewers.parent
    np.testing.assert_array_equal(Pillow.open(path), vr.render(SPHERE, size=(48, 32), spp=4).display())
    assert [p for p in viewers.parent.iterdir() if p.is_file()] == []


def test_show_says_what_is_not_saved_and_opens_what_is(viewers, capsys):
    viewer(viewers / "xdg-open")
    assert main(["render", SPHERE, *SMALL, "--show"]) == 0
    told, shown = capsys.readouterr(), file_of(viewers / "xdg-open")
    assert told.out.endswith("; not saved: -o sphere.png writes it\n")
    assert told.err == f"visray: shown from {shown}; if no window comes, open this file\n"
    (viewers / "xdg-open.file").unlink()
    assert main(["render", SPHERE, *SMALL, "--show", "-o", "a.exr", "-o", "b.png"]) == 0
    told = capsys.readouterr()
    assert "not saved" not in told.out and told.err == ""
    assert file_of(viewers / "xdg-open") == Path.cwd() / "b.png"


def test_samples_need_a_file_to_be_kept_beside(viewers, capsys):
    viewer(viewers / "xdg-open")
    assert main(["render", SPHERE, "--show", "--checkpoint"]) == 2
    assert capsys.readouterr().err.startswith("visray: --checkpoint and --resume: ")


def test_a_movie_is_not_shown(viewers, capsys):
    viewer(viewers / "xdg-open")
    table = str(ROOT / "scenes/data/ports.csv")
    assert main(["data", table, "--time-column", "name", "--animate", "2", "-o", "a.mp4", "--show"]) == 2
    assert capsys.readouterr().err.startswith("visray: --show and --preview: ")


def test_what_shows_pictures_is_imported_when_it_is_used():
    """The help, and errors in what is typed, come at once."""
    lazy = {"numpy", "PIL", "rich", "textual_image"}
    script = f"import sys, visray.cli.commands; print(sorted({lazy} & set(sys.modules)))"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment)
    assert done.stdout == "[]\n"
