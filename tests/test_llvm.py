"""Which libLLVM is taken, and that a wrong one costs one line and never the process."""

import os
import shutil
import subprocess
import sys
from glob import glob

import pytest

from visray import llvm

REQUIRE = """
from visray import llvm
from visray.errors import UserError
try:
    print("uses", llvm.require().path)
except UserError as error:
    print(error)
    raise SystemExit(2)
import drjit as dr
from drjit.llvm import Float
print("computes", dr.minimum(dr.opaque(Float, 3, 4), 2)[0])
"""
DRJIT_FIRST = "import drjit\n" + REQUIRE


def run(code: str, library: str | None) -> tuple[int, list[str]]:
    """The return code (negative: killed by a signal) and the lines on standard output of a fresh process."""
    environment = {name: value for name, value in os.environ.items() if name != llvm.VARIABLE}
    if library is not None:
        environment[llvm.VARIABLE] = library
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout.splitlines()


def system(version: int) -> str:
    folders = ("/usr/lib/*-linux-gnu", "/usr/lib64")
    found = [path for folder in folders for path in glob(f"{folder}/libLLVM-{version}.so*")]
    if not found:
        pytest.skip(f"no LLVM {version} on this machine")
    return found[0]


def usable() -> str:
    """A path that works on this machine; without one, nothing else of this project could be tested."""
    return llvm.library().path


@pytest.mark.parametrize("version", [14, 15, 16])
def test_a_fatal_library_is_refused_in_one_line(version: int) -> None:
    path = system(version)
    code, lines = run(REQUIRE, path)
    assert code == 2
    assert len(lines) == 1
    assert lines[0].startswith(f"{llvm.VARIABLE}={path} is LLVM {version}")
    assert "17 or newer" in lines[0]


@pytest.mark.slow
@pytest.mark.parametrize("version", [14, 15])
def test_a_fatal_library_under_another_name_is_asked_and_refused(version: int, tmp_path) -> None:
    path = tmp_path / "compiler.so"
    shutil.copyfile(system(version), path)
    code, lines = run(REQUIRE, str(path))
    assert (code, len(lines)) == (2, 1)
    assert "is LLVM 15 or older" in lines[0]


@pytest.mark.slow
def test_without_the_variable_a_usable_one_is_found_and_computes() -> None:
    code, lines = run(REQUIRE, None)
    assert code == 0
    assert lines[0].startswith("uses ")
    assert lines[1] == "computes 2.0"


def test_the_variable_is_respected() -> None:
    code, lines = run(REQUIRE, usable())
    assert (code, lines) == (0, [f"uses {usable()}", "computes 2.0"])


def test_a_usable_library_whose_name_tells_nothing_is_asked_and_taken(monkeypatch) -> None:
    monkeypatch.setattr(llvm, "version_in_name", lambda path: None)
    taken = llvm.judge(usable(), "test")
    assert isinstance(taken, llvm.LLVM)
    assert taken.version == llvm.loaded_version()


def test_a_path_that_does_not_exist_is_one_line() -> None:
    code, lines = run(REQUIRE, "/no/such/libLLVM.so")
    assert (code, len(lines)) == (2, 1)
    assert lines[0].startswith(f"{llvm.VARIABLE}=/no/such/libLLVM.so does not exist; set it to")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["notes.txt", "libLLVM.so.23.1"])
def test_a_text_file_is_one_line_whatever_its_name(name: str, tmp_path) -> None:
    path = tmp_path / name
    path.write_text("not a library\n")
    code, lines = run(REQUIRE, str(path))
    assert (code, len(lines)) == (2, 1)
    assert str(path) in lines[0]
    assert "17 or newer" in lines[0]


def test_a_name_without_folder_is_looked_up_by_the_linker() -> None:
    code, lines = run(REQUIRE, "libLLVM-no-such.so")
    assert (code, len(lines)) == (2, 1)
    assert "cannot be loaded" in lines[0]


@pytest.mark.slow
@pytest.mark.parametrize("version", [14, 15])
def test_drjit_imported_before_with_a_fatal_library_is_one_line(version: int) -> None:
    code, lines = run(DRJIT_FIRST, system(version))
    assert (code, len(lines)) == (2, 1)
    assert "import visray before drjit and mitsuba" in lines[0]


@pytest.mark.slow
def test_drjit_imported_before_with_a_usable_library_is_left_alone() -> None:
    code, lines = run(DRJIT_FIRST, usable())
    assert (code, lines) == (0, [f"uses {usable()}", "computes 2.0"])


@pytest.mark.slow
def test_prepare_is_idempotent_and_a_child_process_searches_anew() -> None:
    code, lines = run("from visray import llvm; print(llvm.prepare() is llvm.prepare())", llvm.NOWHERE)
    assert (code, lines) == (0, ["True"])
    assert run(REQUIRE, llvm.NOWHERE)[0] == 0


def test_where_nothing_is_usable_the_line_says_what_to_install(monkeypatch, tmp_path) -> None:
    old = tmp_path / "libLLVM-15.so.1"
    old.touch()
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    monkeypatch.setattr(llvm, "_environment", lambda: iter(()))
    monkeypatch.setattr(llvm, "_system", lambda: iter([str(old), str(old)]))
    outcome = llvm.search()
    assert outcome.llvm is None
    assert outcome.refused == (f"{old} is LLVM 15, which ends the process during a render",)
    monkeypatch.setattr(llvm, "_result", outcome)
    with pytest.raises(llvm.UserError) as caught:
        llvm.require()
    line = str(caught.value)
    assert "\n" not in line
    assert "install" in line
    assert str(old) in line


def test_nowhere_keeps_drjit_from_choosing_by_itself() -> None:
    assert not os.path.exists(llvm.NOWHERE)
    code, lines = run("import drjit as dr; print(dr.has_backend(dr.JitBackend.LLVM))", llvm.NOWHERE)
    assert (code, lines) == (0, ["0"])


def test_the_highest_usable_version_is_taken_and_the_environment_comes_first(monkeypatch, tmp_path) -> None:
    for name in ("libLLVM-18.so.1", "libLLVM.so.21.1", "libLLVM.so.19.1", "libLLVMSPIRVLib.so.99"):
        (tmp_path / name).touch()
    everything = [str(path) for path in tmp_path.iterdir()]
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    monkeypatch.setattr(llvm, "_environment", lambda: iter(()))
    monkeypatch.setattr(llvm, "_system", lambda: iter(everything))
    assert llvm.search().llvm == llvm.LLVM(str(tmp_path / "libLLVM.so.21.1"), (21, 1), "system")
    monkeypatch.setattr(llvm, "_environment", lambda: iter([str(tmp_path / "libLLVM-18.so.1")]))
    assert llvm.search().llvm == llvm.LLVM(str(tmp_path / "libLLVM-18.so.1"), (18,), "Python environment")


@pytest.mark.parametrize("name", ["drjit.detail", "drjit.interop", "drjit.scalar", "drjit"])
def test_import_that_is_put_off_loads_each_module_once(name: str) -> None:
    # The command line puts the import of Dr.Jit off. A module in it may be the first that is asked for.
    code = f"""
from visray import drjit_import
drjit_import.watch()
drjit_import.put_off()
import importlib, sys
module = importlib.import_module("{name}")
import drjit
print(sys.modules["{name}"] is module, eval("{name}") is module, drjit.detail.llvm_version()[0] > 0)
"""
    assert run(code, None) == (0, ["True True True"])


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM.so.23.1", (23, 1)),
        ("libLLVM-15.so.1", (15,)),
        ("libLLVM-14.0.6.so", (14, 0, 6)),
        ("libLLVM-23.so", (23,)),
        ("libLLVM-15git.so", (15,)),
        ("libLLVM.18.1.dylib", (18, 1)),
        ("Cellar/llvm@17/17.0.6/lib/libLLVM.dylib", (17, 0, 6)),
        ("libLLVM.so.1", None),
        ("libLLVM.so", None),
        ("compiler.so", None),
        ("LLVM-C.dll", None),
    ],
)
def test_versions_in_names(name: str, version: tuple[int, ...] | None, tmp_path) -> None:
    assert llvm.version_in_name(str(tmp_path / name)) == version


def test_a_link_tells_the_version_of_its_target(tmp_path) -> None:
    (tmp_path / "libLLVM.so.19.1").touch()
    (tmp_path / "libLLVM.so").symlink_to("libLLVM.so.19.1")
    assert llvm.version_in_name(str(tmp_path / "libLLVM.so")) == (19, 1)
