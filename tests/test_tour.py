"""docs/tour.md: it has twelve steps, and each of its commands runs. Its lines of Python are run by test_docs.py."""

import re
import shlex
from pathlib import Path

import pytest

from visray.cli import main

ROOT = Path(__file__).resolve().parents[1]
TOUR = (ROOT / "docs" / "tour.md").read_text()
STEPS = [step for step in re.split(r"^## ", TOUR, flags=re.MULTILINE) if step[0].isdigit()]
COMMANDS = [c for s in STEPS for c in re.findall(r"^```sh\nvisray (.*)\n```$", s, re.MULTILINE)]
# Commands that take seconds however small their pictures are.
SLOW = ("cost", "animate", "data", "surface", "view", "render scenes/everything")
SIZE, SPP = "24x16", "2"


def small(command: str) -> list[str]:
    """The words of a command, for a small picture and few samples."""
    name, words = command.split()[0], shlex.split(command)
    words = [word.replace("0:25", "0:2") for word in words]
    options = {"--size": SIZE} if name in ("render", "animate", "data", "surface") else {}
    options |= {"--spp": SPP} if options and "--error" not in words else {}
    for option, value in options.items():
        if option in words:
            words[words.index(option) + 1] = value
        else:
            words += [option, value]
    return words


def test_each_of_the_twelve_steps_has_one_command_or_a_few_lines_of_python():
    assert [int(step.split(".")[0]) for step in STEPS] == list(range(1, 13))
    for step in STEPS:
        commands = re.findall(r"^```sh\n(.*?)^```$", step, re.MULTILINE | re.DOTALL)
        scripts = re.findall(r"^```python\n(.*?)^```$", step, re.MULTILINE | re.DOTALL)
        assert commands or scripts, step
        assert all(command.count("\n") == 1 for command in commands), step
        lines = [line for s in scripts for line in s.splitlines() if line.strip() and not line.startswith("import")]
        assert len(lines) <= 5, step


@pytest.mark.parametrize(
    "command",
    [pytest.param(c, id=c, marks=[pytest.mark.slow] if c.startswith(SLOW) else []) for c in COMMANDS],
)
def test_a_command_of_the_tour_runs_and_writes_what_it_says(command, tmp_path, monkeypatch, capsys):
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    monkeypatch.chdir(tmp_path)
    assert main(small(command)) == 0, capsys.readouterr().err
    outputs = re.findall(r"-o (\S+)", command)
    assert all((tmp_path / name).stat().st_size for name in outputs)
