"""The public names of visray, and what old names say."""

import subprocess
import sys
from pathlib import Path

import pytest

import visray as vr


def test_dir_shows_the_public_names_and_all_of_them_exist() -> None:
    assert dir(vr) == sorted(vr.__all__)
    assert all(getattr(vr, name) is not None for name in vr.__all__)


@pytest.mark.parametrize(("old", "new"), [("Gradient", "SkyGradient"), ("surfaces", "SURFACES")])
def test_an_old_name_is_refused_with_the_new_one(old: str, new: str) -> None:
    line = f"^visray.{old} is now visray.{new}; use the new name$"
    with pytest.raises(AttributeError, match=line):
        getattr(vr, old)
    with pytest.raises(ImportError, match=line):
        exec(f"from visray import {old}")
    assert not hasattr(vr, old) and hasattr(vr, new)


def test_a_name_that_never_was_gets_pythons_own_errors() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'Sphare'"):
        _ = vr.Sphare
    with pytest.raises(ImportError, match="cannot import name 'Sphare'"):
        exec("from visray import Sphare")


def test_the_message_for_an_old_name_ends_without_a_suggestion_of_python() -> None:
    """When Python prints the error itself, it suggests names that look like the old one: here "gradient"."""
    done = subprocess.run([sys.executable, "-c", "import visray as vr\nvr.Gradient"], capture_output=True, text=True)
    assert done.stderr.splitlines()[-1] == "AttributeError: visray.Gradient is now visray.SkyGradient; use the new name"


def test_no_public_name_is_a_submodule() -> None:
    """The import of a submodule would replace it by the module."""
    folder = Path(vr.__file__).parent
    assert not {name for name in vr.__all__ if (folder / name).exists() or (folder / f"{name}.py").exists()}


def test_import_visray_imports_nothing_of_weight() -> None:
    """Names are imported when they are first used."""
    code = "import sys, visray; print(*sys.modules); visray.Sphere; print('visray.renderer' in sys.modules)"
    first, last = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.splitlines()
    assert not {"numpy", "pydantic", "drjit", "rich", "visray.llvm", "visray.primitives"} & set(first.split())
    assert last == "True"


def test_a_star_import_has_all_public_names() -> None:
    names: dict[str, object] = {}
    exec("from visray import *", names)
    assert {name: names[name] for name in vr.__all__} == {name: getattr(vr, name) for name in vr.__all__}
