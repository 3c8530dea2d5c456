"""Completion in the shell: the scripts, and what they offer, as bash has it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from visray.cli import main
from visray.output.layers import NAMES
from visray.polynomials.catalogue import SURFACES

ROOT = Path(__file__).resolve().parents[1]
BASH = shutil.which("bash")
# Sets the words of a command line, and prints what bash would offer for the last one.
ASKED = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(( $# - 1 ))
{function}
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture(scope="module")
def shell(tmp_path_factory):
    """A folder with the script, a program `visray` and a scene."""
    folder = tmp_path_factory.mktemp("shell")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    code = [sys.executable, "-m", "visray", "completion", "bash"]
    (folder / "script").write_text(subprocess.check_output(code, text=True, env=environment))
    program = folder / "visray"
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m visray "$@"\n')
    program.chmod(0o755)
    (folder / "cup.json").write_text('{// a cup\n "objects": {"ball": {"type": "sphere", "radius": 2}}}')
    (folder / "scenes").mkdir()
    return folder


def offered(folder, *words):
    """What bash offers for the last of the words of a command line."""
    asked = ASKED.format(function="_visray_and_spaces")
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    told = subprocess.run(
        [BASH, "-c", asked, "bash", str(folder / "script"), "visray", *words],
        capture_output=True, text=True, cwd=folder, env=os.environ | {"PATH": path},
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


@pytest.mark.parametrize("shell_name", ["bash", "zsh", "fish"])
def test_every_shell_gets_all_commands(shell_name, capsys):
    assert main(["completion", shell_name]) == 0
    text = capsys.readouterr().out
    assert all(f"{name}" in text for name in ("render", "animate", "new", "--layers", "__complete"))


def test_another_shell_is_refused(capsys):
    assert main(["completion", "tcsh"]) == 2
    assert capsys.readouterr().err == "visray: visray completion = tcsh: must be one of bash, zsh, fish\n"
