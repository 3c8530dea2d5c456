"""What reaches the terminal, and how the program ends: streams that fail, signals, and faults of visray itself."""

import ast
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from visray import progress, tables, terminal
from visray.cli import program, stuck
from visray.errors import UserError

ROOT = Path(__file__).resolve().parents[1]


def shell(command: str, **environment: str) -> subprocess.CompletedProcess:
    """A shell command in which `visray` is the program."""
    script = f'visray() {{ "{sys.executable}" -m visray "$@"; }}; {command}'
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.run(["bash", "-c", script], capture_output=True, text=True, env=environment, cwd=ROOT)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full is a device of Linux")
@pytest.mark.parametrize("command", ["visray --version", "visray --help", "visray schema", "visray surfaces"])
@pytest.mark.parametrize("stream", [">/dev/full", ">&-"])
def test_output_that_cannot_be_written_is_one_line(command, stream):
    done = shell(f"{command} {stream}")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("visray: standard output: ") and done.stderr.count("\n") == 1


@pytest.mark.parametrize("command", ["visray --help", "visray schema", "visray surfaces --json"])
def test_a_closed_pipe_is_quiet(command):
    done = shell(f"{command} | head -n 1; echo codes ${{PIPESTATUS[@]}}")
    assert done.stderr == "" and done.stdout.splitlines()[-1] == "codes 0 0"


@pytest.mark.parametrize("stream", ["2>/dev/full", "2>&-", "2>&1 | true; exit ${PIPESTATUS[0]}"])
def test_an_error_that_nobody_reads_still_has_its_exit_code(stream):
    assert shell(f"visray explain nowhere.json {stream}").returncode == 2


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_any_encoding_will_do(encoding, tmp_path):
    """JSON stays JSON, and tables are drawn with characters that the encoding has."""
    path = tmp_path / "scene.json"
    path.write_text(
        json.dumps(
            {
                "objects": {"é → ∞": {"type": "sphere"}},
                "materials": {"→": {"kt": [1, 1, 1]}},
                "camera": {},
                "lights": {},
            }
        )
    )
    done = shell(f"visray explain '{path}' && visray explain --json '{path}'", PYTHONIOENCODING=encoding)
    assert done.returncode == 0 and done.stderr == ""
    table, brace, report = done.stdout.partition("{")
    assert json.loads(brace + report)["features"] and "effect" in table


def test_names_are_plain_text(capsys):
    """A name is neither markup nor a command for the terminal."""
    table = tables.Table("name", title="[/x] title", caption="[bold]one\n\x1b[2Jtwo")
    table.add_row("[/x]")
    table.add_row("\x1b]0;title\x07:smile: \u202e\ud800")
    tables.show(table)
    terminal.write_line("a\x1b[31m\nb")
    terminal.note("c\rd")
    out, err = capsys.readouterr()
    for text in ("[/x] title", "[bold]one ", "\\x1b[2Jtwo", "│ [/x] ", r"\x1b]0;title\x07:smile: \u202e\ud800"):
        assert text in out
    assert out.endswith("\na\\x1b[31m\\nb\n") and err == "visray: note: c\\rd\n"
    assert "\x1b" not in out + err


def test_only_the_door_writes():
    """No other module writes to the standard streams."""
    for path in (ROOT / "visray").rglob("*.py"):
        nodes = list(ast.walk(ast.parse(path.read_text())))
        streams = {n.attr for n in nodes if isinstance(n, ast.Attribute) and ast.unparse(n.value) == "sys"}
        printed = [n for n in nodes if isinstance(n, ast.Call) and ast.unparse(n.func) == "print"]
        assert path.name in ("terminal.py", "tables.py", "program.py") or not streams & {"stdout", "stderr"}, path
        assert not printed, path


REPORT = "; please report it, with what VISRAY_TRACEBACK=1 shows\n"


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (UserError("a: b\nc", "d"), 2, "visray: a: b\\nc\nvisray: d\n"),
        (ValueError("a\n  b"), 70, "visray: internal error: ValueError: a b" + REPORT),
        (AssertionError(), 70, "visray: internal error: AssertionError" + REPORT),
        (MemoryError(), 2, "visray: there is not enough memory; make the picture or the scene smaller\n"),
        (PermissionError(13, "Permission denied", "a.json"), 2, "visray: a.json: Permission denied\n"),
        (KeyboardInterrupt(), 130, "visray: stopped before anything could be kept\n"),
        (KeyboardInterrupt("stopped here"), 130, "visray: stopped here\n"),
        (BrokenPipeError(), 0, ""),
        (SystemExit(3), 3, ""),
    ],
)  # fmt: skip
def test_every_exception_ends_in_one_line(error, code, line, monkeypatch, capsys):
    def fail(tokens):
        raise error

    monkeypatch.setattr(program, "_run", fail)
    monkeypatch.setattr(terminal, "abandon_output", lambda: None)
    assert program.main([]) == code
    assert capsys.readouterr() == ("", line)


def test_a_developer_sees_the_traceback(monkeypatch, capsys):
    monkeypatch.setattr(program, "_run", lambda tokens: 1 // 0)
    monkeypatch.setattr(terminal, "abandon_output", lambda: None)
    monkeypatch.setenv(program.TRACEBACK, "1")
    assert program.main([]) == program.INTERNAL_ERROR
    assert "ZeroDivisionError: integer" in capsys.readouterr().err


# The program, in which a module receives Ctrl-C while it is imported, so many times.
INTERRUPTED = """
import signal, sys
from visray.cli import main

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            for _ in range({times}):
                try:
                    signal.raise_signal(signal.SIGINT)
                except KeyboardInterrupt:
                    if {wrapped}:
                        raise ImportError("interrupted") from None
                    raise

sys.meta_path.insert(0, Finder())
sys.exit(main(["surfaces"]))
"""


@pytest.mark.parametrize("module", ["cyclopts", "visray.cli.commands"])
@pytest.mark.parametrize("wrapped", [False, True])
def test_ctrl_c_during_imports_is_one_line(module, wrapped):
    script = INTERRUPTED.format(module=module, times=1, wrapped=wrapped)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "visray: stopped before anything could be kept\n"


def presses(times: int) -> int:
    """Number of times that KeyboardInterrupt is raised if Ctrl-C is pressed several times."""
    raised = 0
    with program._Stop.caught():
        for _ in range(times):
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                raised += 1
    return raised


def test_ctrl_c_twice_interrupts_once():
    """The second one must not interrupt the clearing up after the first one. The third one ends the process."""
    assert presses(1) == presses(2) == 1
    script = "import test_terminal; test_terminal.presses(3); print('alive')"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT / "tests")
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_ctrl_c_while_an_object_is_deleted_is_not_lost():
    class Slow:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    with program._Stop.caught(), pytest.raises(KeyboardInterrupt):
        Slow()
        for _ in range(1000):
            time.sleep(0.01)


# The program, in which the main thread runs compiled code for hours, and Ctrl-C is pressed several times.
BUSY = """
import hashlib, signal, sys, threading, time
from visray.cli import program, stuck
from visray.progress import Interrupts

def press():
    for _ in range({times}):
        time.sleep(0.3)
        signal.raise_signal(signal.SIGINT)

def run(tokens):
    with Interrupts(has_results={has_results}):
        threading.Thread(target=press, daemon=True).start()
        hashlib.pbkdf2_hmac("sha512", b"", b"", 2**31 - 1)

program._run = run
sys.exit(program.main([]))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("times", "has_results", "line"),
    [(1, False, "stopped before anything could be kept"), (2, True, "stopped; nothing is kept")],
)
def test_ctrl_c_while_compiled_code_runs(times, has_results, line):
    script = BUSY.format(times=times, has_results=has_results)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", f"visray: {line}\n")


def test_ctrl_c_that_is_answered_ends_nothing():
    """A thread watches; it says nothing if the main thread answers, and ends with the block."""
    threads = threading.active_count()
    with program._Stop.caught() as stop, stuck.watched(99):
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert stop.count == 1 and not stop.loses_nothing() and not stuck._loses_nothing()
    assert threading.active_count() == threads


def test_a_bar_appears_before_the_first_step(monkeypatch):
    """A compilation may take minutes. A thread shows that it goes on."""
    shown, started = [], threading.Event()

    class Recorder:
        def __init__(self):
            self.tasks, self.task_ids = [SimpleNamespace(start_time=0.0)], [0]

        def start(self):
            started.set()

        def stop(self):
            shown.append("stop")

        def add_task(self, text, total):
            shown.append((text, total))
            return 0

        def update(self, task, **more):
            shown.append((more.get("description"), more["completed"], more["total"]))

    monkeypatch.setattr(progress, "_rich_bar", Recorder)
    monkeypatch.setattr(progress, "SHOWN_AFTER", 0.01)
    with progress.Bar("rendering", 4, before="compiling") as bar:
        assert started.wait(60)
        bar.update(1)
    assert shown == [("compiling", None), ("rendering", 1, 4), "stop"]
    with progress.Bar("rendering", 4, shown=False) as bar:
        assert not bar.timer.is_alive()
    shown.clear()
    started.clear()
    with progress.Bar("reading", 1):
        assert started.wait(60)
    assert shown == [("reading", None), (None, 1, 1), "stop"]
