"""The quick suite, `pytest -m "not slow"`, leaves out no part and no kind; reference/nightly says what fails."""

import sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

from visray import lights, primitives


def test_every_file_of_tests_has_one_that_is_quick(quick):
    assert not [name for name, tests in quick.items() if not tests]


@pytest.mark.parametrize("kind", [*primitives.KINDS, *lights.KINDS], ids=lambda k: k.__name__)
def test_every_kind_has_a_quick_test(kind, quick):
    """A test that has the kind, or its name, as a parameter; this one does not count."""
    if len(quick) < len(list(Path(__file__).parent.glob("test_*.py"))):
        pytest.skip("only some files are run: the others cannot be judged")
    tests = [test for name, tests in quick.items() if name != "test_suite.py" for test in tests]
    values = [value for test in tests if hasattr(test, "callspec") for value in test.callspec.params.values()]
    assert kind.__name__ in {v.__name__ if isinstance(v, type) else v for v in values if isinstance(v, type | str)}


@pytest.mark.slow
def test_nightly_prints_a_line_for_each_check_and_fails_if_one_does(monkeypatch, capsys):
    """With checks that are made up: one passes, one fails and has written why."""
    loader = SourceFileLoader("nightly", str(Path(__file__).resolve().parents[1] / "reference" / "nightly"))
    nightly = module_from_spec(spec_from_loader("nightly", loader))
    loader.exec_module(nightly)
    assert set(nightly.CHECKS) == {"tests", "scenes", "stability", "errors"}
    monkeypatch.setattr(nightly, "CHECKS", {
        "good": lambda folder, log: "" if nightly.run([sys.executable, "-c", "import visray"], log) else "bad",
        "bad": lambda folder, log: "" if nightly.run([sys.executable, "-c", "exit('why')"], log) else "it fails",
    })  # fmt: skip
    for checks, code, lines in ((["good"], 0, 1), (["good", "bad"], 1, 4), ([], 1, 4)):
        monkeypatch.setattr(sys, "argv", ["nightly", *checks])
        assert nightly.main() == code
        printed = capsys.readouterr().out
        assert printed.splitlines()[0].endswith("passed") and len(printed.splitlines()) == lines
        assert ("FAILED: it fails\nwhy\n" in printed) == bool(code)
    monkeypatch.setattr(sys, "argv", ["nightly", "unknown"])
    with pytest.raises(SystemExit, match="2"):
        nightly.main()
