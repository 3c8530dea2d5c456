"""Completion in the shell: the scripts, and what they offer in bash, zsh and fish."""

import os
import pty
import select
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from visray.cli import main
from visray.output.layers import NAMES
from visray.polynomials.catalogue import SURFACES

ROOT = Path(__file__).resolve().parents[1]
BASH, ZSH, FISH = map(shutil.which, ("bash", "zsh", "fish"))
# Sets the words of a command line, and prints what bash would offer for the last one.
ASKED = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(( $# - 1 ))
{function}
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


def script(shell_name):
    """The script of a shell."""
    code = [sys.executable, "-m", "visray", "completion", shell_name]
    return subprocess.check_output(code, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)})


def environment(folder):
    """The environment in which the program `visray` of a folder is found, and no settings of the user."""
    return os.environ | {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "HOME": str(folder)}


@pytest.fixture(scope="module")
def shell(tmp_path_factory):
    """A folder with the script, a program `visray` and a scene."""
    folder = tmp_path_factory.mktemp("shell")
    (folder / "script").write_text(script("bash"))
    program = folder / "visray"
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m visray "$@"\n')
    program.chmod(0o755)
    (folder / "cup.json").write_text('{// a cup\n "objects": {"ball": {"type": "sphere", "radius": 2}}}')
    (folder / "scenes").mkdir()
    return folder


def offered(folder, *words):
    """What bash offers for the last of the words of a command line."""
    asked = ASKED.format(function="_visray_and_spaces")
    told = subprocess.run(
        [BASH, "-c", asked, "bash", str(folder / "script"), "visray", *words],
        capture_output=True, text=True, cwd=folder, env=environment(folder),
    )  # fmt: skip
    assert told.stderr == ""
    return told.stdout.split()


@pytest.mark.skipif(BASH is None, reason="there is no bash")
@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["rend"], ["render"]),
        (["render", "--laye"], ["--layers"]),
        (["render", "c"], ["cup.json"]),
        (["render", "sc"], ["scenes/", "script"]),
        (["render", "cup.json", "--precision", "d"], ["double"]),
        (["completion", "z"], ["zsh"]),
        (["render", "cup.json", "--layers", "RGB,id,Z"], [r"RGB\,id\,Z"]),
        (["render", "cup.json", "--layers", ""], list(NAMES)),
        (["render", "cup.json", "--set", "objects.ball.r"], ["objects.ball.radius="]),
        (["render", "no.json", "--set", "o"], []),
        (["surfaces", "barth-s"], ["barth-sextic"]),
        (["surface", ""], list(SURFACES)),
    ],
    ids=lambda x: " ".join(x)[:30],
)
def test_bash_completes(shell, words, found):
    assert offered(shell, *words) == found


# The beginning of a line, and the line after Tab where only one word fits.
ONE_WAY = [
    ("visray rend", "visray render"),
    ("visray render --laye", "visray render --layers"),
    ("visray render cu", "visray render cup.json"),
    ("visray render cup.json --set objects.ball.r", "visray render cup.json --set objects.ball.radius="),
    ("visray surface barth-s", "visray surface barth-sextic"),
]


@pytest.mark.skipif(FISH is None, reason="there is no fish")
@pytest.mark.parametrize(("line", "completed"), ONE_WAY)
def test_fish_completes(shell, line, completed):
    folder = shell / ".config" / "fish" / "completions"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "visray.fish").write_text(script("fish"))
    told = subprocess.check_output([FISH, "-c", f"complete -C '{line}'"], text=True, cwd=shell, env=environment(shell))
    words = [found.split("\t")[0] for found in told.splitlines()]
    assert words == [completed.split()[-1]]


@pytest.mark.skipif(ZSH is None, reason="there is no zsh")
def test_zsh_completes(shell):
    """zsh completes only what is typed, so the test types: Tab, then Enter with `echo "` put before the line."""
    (shell / "zsh-script").write_text(script("zsh"))
    # Programs of a test runner have no terminal to reset, and a long line would be broken in the terminal's width.
    lines = ["PROMPT=''", "stty cols 1000", "autoload -Uz compinit", "compinit -u", "source ./zsh-script"]
    keys = "".join(f"{line}\n" for line in lines)
    keys += "".join(f'{line}\t\1echo "<\5>"\n' for line, _ in ONE_WAY) + "exit\n"
    process, terminal = pty.fork()
    if process == 0:
        os.chdir(shell)
        os.execve(ZSH, ["zsh", "-f", "-i"], environment(shell) | {"TERM": "dumb"})
    os.write(terminal, keys.encode())
    told = b""
    while select.select([terminal], [], [], 60)[0]:
        try:
            told += os.read(terminal, 4096)
        except OSError:  # Linux says so that the other end is closed
            break
    else:
        os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    said = [line for line in told.decode().splitlines() if line.startswith("<") and line.rstrip().endswith(">")]
    assert [line.strip("<> \r") for line in said] == [completed for _, completed in ONE_WAY]


@pytest.mark.parametrize("shell_name", ["bash", "zsh", "fish"])
def test_every_shell_gets_all_commands(shell_name, capsys):
    assert main(["completion", shell_name]) == 0
    text = capsys.readouterr().out
    assert all(f"{name}" in text for name in ("render", "animate", "new", "--layers", "__complete"))


def test_another_shell_is_refused(capsys):
    assert main(["completion", "tcsh"]) == 2
    assert capsys.readouterr().err == "visray: visray completion = tcsh: must be one of bash, zsh, fish\n"
