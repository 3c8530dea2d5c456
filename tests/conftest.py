"""visray is imported first: it chooses the LLVM that Dr.Jit loads, whatever a test file imports before."""

import sys
from pathlib import Path

import pytest
from hypothesis import settings

if sys.dont_write_bytecode:
    # Rewriting the asserts of all tests takes longer than importing everything else, and each worker would do it anew.
    # Where nothing is to be written beside the sources, the rewritten tests are kept with pytest's own cache.
    sys.pycache_prefix = str(Path(__file__).resolve().parents[1] / ".pytest_cache" / "bytecode")
    sys.dont_write_bytecode = False

import visray  # noqa: F401, I001
from virtual import machine  # noqa: F401 - for every test

# No test asserts a time: machines are slow now and then.
settings.register_profile("visray", deadline=None)
settings.load_profile("visray")
COLLECTED = pytest.StashKey[list]()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What is nightly is slow as well. All tests are kept as they were before -m took some of them out."""
    for item in items:
        if item.get_closest_marker("nightly"):
            item.add_marker("slow")
    config.stash[COLLECTED] = list(items)


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is said once in a process is said in each test."""
    monkeypatch.setattr("visray.warn._SAID", set())


@pytest.fixture
def quick(request: pytest.FixtureRequest) -> dict[str, list[pytest.Item]]:
    """The tests of the quick suite by their file; files all of whose tests are slow have none."""
    tests: dict[str, list[pytest.Item]] = {}
    for item in request.config.stash[COLLECTED]:
        tests.setdefault(item.path.name, []).extend([] if item.get_closest_marker("slow") else [item])
    return tests
