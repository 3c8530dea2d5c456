"""Programs with a live picture end well, whatever their threads do in that moment. A thread in Dr.Jit, surprised by the
end of Python, would abort the process."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from visray import leftovers, work_threads
from visray.live import guard
from visray.live.effects import MEASURE

TESTS = Path(__file__).parent
# A piece of work that is in Dr.Jit most of the time for some seconds, as a compilation is.
BEGINNING = """
import sys, time
sys.path.insert(0, {tests!r})
import visray as vr
import drjit as dr
from live_support import small_scene
from visray.live.engine import Engine

def busy(prepared, seconds=2.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        dr.eval(dr.arange(prepared.a.U, 10000) + dr.opaque(prepared.a.U, 2))
        dr.sync_thread()
        begun.append(True)

def keep_busy(engine, work=busy):
    future = engine.ask(work)
    while not begun:
        time.sleep(0.001)
        assert not future.done(), future.exception()

begun = []
"""
# How a program may end, and its exit code.
ENDS = {
    "engine alone": ("keep_busy(Engine(small_scene()).start())", 0),
    "end": ("shown = vr.view(small_scene()); keep_busy(shown.live.engine)", 0),
    "stop": ("shown = vr.view(small_scene()); keep_busy(shown.live.engine); print(shown.stop())", 0),
    "exit": ("shown = vr.view(small_scene()); keep_busy(shown.live.engine); sys.exit(3)", 3),
    "error": ("shown = vr.view(small_scene()); keep_busy(shown.live.engine); 1 / 0", 1),
    "two": ("shown = [vr.view(small_scene()) for _ in 'ab']; [keep_busy(x.live.engine) for x in shown]", 0),
}
SAVING = """
from page import Page, eventually
from page_widgets import press, value_of, write
shown = vr.view(small_scene(film=vr.Film(width=64, height=48)), error=0.5)
page = Page(shown.url)
page.look()
write(page, "quality", "4000000 spp")
press(page, "Make the picture")
eventually(lambda: value_of(page, "Cancel", "visible"))
time.sleep(float(sys.argv[1]))
"""


def program(text: str, *arguments: str) -> subprocess.Popen:
    """A program that runs."""
    words = [sys.executable, "-c", BEGINNING.format(tests=str(TESTS)) + text, *arguments]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen) -> tuple[int, str, str]:
    """Exit code and output of a program."""
    try:
        out, err = process.communicate(timeout=120)
    finally:
        process.kill()
    return process.returncode, out, err


# No word of a wait: on a busy machine a step takes longer than the time after which one is said.
PATIENT = "from visray import work_threads; work_threads.SAID_AFTER = 100\n"


@pytest.mark.parametrize("how", ENDS)
def test_a_program_ends_while_a_thread_is_busy(how):
    if how != "engine alone":
        pytest.importorskip("viser")
    text, code = ENDS[how]
    for _ in range(2):
        found, out, err = ended(program(PATIENT + text))
        assert found == code and out == ("False\n" if how == "stop" else "")
        assert err.splitlines()[-1:] == (["ZeroDivisionError: division by zero"] if how == "error" else [])


@pytest.mark.parametrize("seconds", [0, 0.3, 1.5])
def test_a_program_ends_while_a_picture_is_saved(seconds):
    """With the compilation, and with the passes after it."""
    pytest.importorskip("viser")
    assert ended(program(PATIENT + SAVING, str(seconds))) == (0, "", "")


@pytest.mark.slow
def test_ctrl_c_while_python_waits_for_a_thread(tmp_path):
    """It ends the program at once, and nothing is left behind."""
    left = tmp_path / "left"
    text = f"""
from pathlib import Path
from visray.leftovers import removed_with_the_process
removed_with_the_process(Path({str(left)!r}))
Path({str(left)!r}).mkdir()
print("kept")
engine = Engine(small_scene()).start()
keep_busy(engine, lambda prepared: begun.append(1) or time.sleep(1000))
"""
    process = program(text)
    assert process.stderr.readline() == "visray: waiting until a thread has ended its step; Ctrl-C ends at once\n"
    assert left.exists()
    process.send_signal(signal.SIGINT)
    assert ended(process) == (130, "kept\n", "")
    assert not left.exists()


def test_threads_are_asked_to_stop():
    stopped, asked = threading.Event(), []

    def fails():
        asked.append(threading.current_thread())
        raise ValueError

    short = work_threads.begun(lambda: None, "short")
    deaf = work_threads.begun(stopped.wait, "deaf", fails)
    good = work_threads.begun(stopped.wait, "good", lambda: None)
    assert work_threads.have_ended(60, [short])
    assert not work_threads.have_ended(0.01, [deaf, good])
    assert asked == [threading.current_thread()] and deaf.is_alive() and good.is_alive()
    more = work_threads.begun(stopped.wait, "more", stopped.set)
    assert work_threads.have_ended(60)
    assert not (deaf.is_alive() or good.is_alive() or more.is_alive())


def test_no_thread_begins_while_python_ends(monkeypatch):
    monkeypatch.setattr(work_threads, "_python_ends", True)
    with pytest.raises(RuntimeError, match="no thread begins"):
        work_threads.begun(lambda: None, "late")


def test_a_thread_does_not_wait_for_itself():
    found = []
    thread = work_threads.begun(lambda: found.append(work_threads.have_ended(60)), "itself")
    thread.join(60)
    assert found == [True]


def test_what_is_left_behind_is_removed(tmp_path):
    with leftovers.passing_folder() as folder, leftovers.removed_at_the_end(tmp_path / "a"):
        (folder / "deep").mkdir()
        (folder / "deep" / "file").write_text("x")
        (tmp_path / "a").write_text("x")
        (tmp_path / "b").symlink_to(folder / "deep")
        with leftovers.removed_at_the_end(tmp_path / "b"):
            pass
        assert not (tmp_path / "b").is_symlink() and (folder / "deep" / "file").exists()
        leftovers.remove_all()
        assert not folder.exists() and not (tmp_path / "a").exists()
    assert not folder.exists()


def compiling(page):
    """A large page of glass: its kernel is compiled."""
    from page import eventually

    page.look(window=(1600, 1200))
    eventually(lambda: "compiling" in page.html())


def saving(page):
    """A picture is made."""
    from page import eventually
    from page_widgets import press, value_of, write

    page.look()
    write(page, "quality", "4000000 spp")
    press(page, "Make the picture")
    eventually(lambda: value_of(page, "Cancel", "visible"))


def measuring(page):
    """Prices are measured, for which kernels are compiled."""
    from page import eventually
    from page_widgets import press, value_of

    page.look()
    press(page, MEASURE)
    eventually(lambda: "compiling" in page.html() and value_of(page, "Stop", "visible"))


VIEW = ["view", str(TESTS.parent / "scenes" / "glass-heart.json")]
SURFACE = ["surface", "x^2 + y^2 - z^2 - a", "--param", "a=0.3", "--view"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("command", "doing"),
    [(VIEW, compiling), (VIEW, saving), (VIEW, measuring), (SURFACE, compiling), (SURFACE, None)],
)
def test_signals_end_the_command(command, doing, number, tmp_path):
    pytest.importorskip("viser")
    from page import Page

    port = guard.chosen_port("127.0.0.1", None)
    words = [sys.executable, "-m", "visray", *command, "--no-browser", "--port", str(port)]
    environment = os.environ | {"TMPDIR": str(tmp_path), "HOME": str(tmp_path)}  # without known kernels
    streams = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen(words, **streams, text=True, env=environment) as process:
        while "Ctrl-C ends" not in process.stdout.readline():
            assert process.poll() is None
        page = Page(f"http://127.0.0.1:{port}")
        if doing is not None:
            doing(page)
        process.send_signal(number)
        assert ended(process) == (0 if number == signal.SIGINT else 143, "", "")
    assert not list(tmp_path.glob("visray-*"))
