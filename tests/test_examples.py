"""Each example runs, in a folder of its own."""

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))
TOLD = {
    "fit_colour": "found [0.7  0.3  0.15]",
    "noise": "error ~ samples^-0.",
    "fit_glass": "step 6: ior = 1.500000",
    "penumbra": "sobol",
    "layers": "faces straight up",
    "what_is_simulated": "without shadows: ambient, diffuse, specular, background",
}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [path.name])
    runpy.run_path(str(path), run_name="__main__")
    assert TOLD.get(path.stem, "") in capsys.readouterr().out


def test_examples_are_short():
    long = {p.stem: n for p in EXAMPLES if not 10 <= (n := len(p.read_text().splitlines())) <= 40}
    assert not long
