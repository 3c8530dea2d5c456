"""How much memory there is: files of containers as Linux writes them, and limits of a real process."""

import subprocess
import sys
from pathlib import Path

import pytest

from visray import memory

MIB = 2**20


def machine(
    folder: Path, monkeypatch: pytest.MonkeyPatch, cgroup: str, groups: dict[str, tuple[str, int, int]]
) -> None:
    """A machine with 1000 MiB free, and groups: limit, use and cached files of each, in the words of their version."""
    proc, root = folder / "proc", folder / "cgroup"
    (proc / "self").mkdir(parents=True)
    (proc / "meminfo").write_text(f"MemTotal: 9999999 kB\nMemAvailable: {1000 * 1024} kB\n")
    (proc / "self" / "cgroup").write_text(cgroup)
    (proc / "self" / "status").write_text("Name:\tx\nVmSize:\t 1024 kB\nVmData:\t 512 kB\n")
    for path, (limit, use, cached) in groups.items():
        group = root / path
        group.mkdir(parents=True, exist_ok=True)
        limit_file, use_file, entry = memory.CGROUP_FILES[1 if path.startswith("memory") else 2]
        (group / limit_file).write_text(limit + "\n")
        (group / use_file).write_text(f"{use}\n")
        (group / "memory.stat").write_text(f"other 7\n{entry} {cached}\n")
    monkeypatch.setattr(memory, "PROC", proc)
    monkeypatch.setattr(memory, "CGROUPS", root)
    monkeypatch.setattr(memory.sys, "platform", "linux")


@pytest.mark.parametrize(
    ("cgroup", "groups", "left"),
    [
        ("0::/a/b\n", {"a/b": ("max", MIB, 0), "a": (f"{400 * MIB}", 300 * MIB, 50 * MIB)}, 150),
        # In a container with its own view of cgroups, or with the host's path, its group is the root.
        ("0::/\n", {"": (f"{100 * MIB}", 40 * MIB, 0)}, 60),
        ("0::/host/docker-1\n", {"": (f"{100 * MIB}", 40 * MIB, 0)}, 60),
        ("5:cpu:/\n4:memory:/x/y\n0::/\n", {"memory/x/y": (f"{300 * MIB}", 100 * MIB, 10 * MIB)}, 210),
        ("4:cpu,memory:/host\n", {"memory": (f"{64 * MIB}", 100 * MIB, 0)}, 0),
        # No limit: version 1 writes a huge number, version 2 a word.
        ("4:memory:/\n", {"memory": ("9223372036854771712", 100 * MIB, 0)}, 1000),
        ("0::/\n", {"": ("max", MIB, 0)}, 1000),
        ("0::/\n", {}, 1000),
    ],
)
def test_limits_of_containers(tmp_path, monkeypatch, cgroup: str, groups: dict, left: int) -> None:
    machine(tmp_path, monkeypatch, cgroup, groups)
    found = memory.free()
    assert found.size == left * MIB
    assert (
        str(found)
        == f"{left / 1024:.1f} GiB {'are free' if left == 1000 else 'are left of the container' + chr(39) + 's limit'}"
    )


def test_a_system_that_says_nothing(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(memory, "PROC", tmp_path)
    monkeypatch.setattr(memory, "CGROUPS", tmp_path)
    monkeypatch.delattr(memory.os, "sysconf", raising=False)
    monkeypatch.setattr(memory, "resource", None)
    assert memory.free() is None


@pytest.mark.skipif(sys.platform != "linux", reason="ulimit -v is read from Linux's /proc")
def test_a_limit_of_the_address_space_is_known_in_the_process() -> None:
    """A process with `ulimit -v` of 600 MiB: what is left of it is known, and can be taken."""
    code = """
import resource
resource.setrlimit(resource.RLIMIT_AS, (600 * 2**20, -1))
from visray import memory
free = memory.free()
assert free.why == "are left of `ulimit -v`" and 0 < free.size < 600 * 2**20
bytearray(free.size - 2**22)
try:
    bytearray(free.size + 2**22)
except MemoryError:
    print("as expected")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "as expected\n", done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the address space")
def test_too_little_address_space_for_drjit_is_refused() -> None:
    """Dr.Jit is not loaded: it would end the process."""
    code = """
import os, resource, sys
from visray import errors, llvm, memory
needed = llvm.LIBRARIES + llvm.THREAD * os.cpu_count()
size = next(int(x.split()[1]) * 1024 for x in open("/proc/self/status") if x.startswith("VmSize"))
for share in (0.9, 1.5):
    resource.setrlimit(resource.RLIMIT_AS, (size + int(share * needed), -1))
    try:
        import drjit
        print(drjit.__name__)
    except errors.UserError as error:
        print(*error.lines)
"""
    done = subprocess.run([sys.executable, "-c", "import visray\n" + code], capture_output=True, text=True)
    refused, loaded = done.stdout.splitlines()
    assert "GiB are left of `ulimit -v`, and Dr.Jit takes up to" in refused, done.stderr
    assert loaded == "drjit"
