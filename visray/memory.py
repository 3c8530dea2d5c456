"""How much memory this process may still take: what the machine has, and what a container (cgroup) or `ulimit` allows.

A process that takes more dies without a word: the system kills it, or an allocation inside a library fails.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

try:
    import resource
except ImportError:  # Windows has no such limits
    resource = None

PROC = Path("/proc")
CGROUPS = Path("/sys/fs/cgroup")
# For each version of cgroups: the files with the limit and with the use of a group, and the entry of its memory.stat
# that says how much of this is cached files, which the system gives up before it kills a process.
CGROUP_FILES = {
    1: ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    2: ("memory.max", "memory.current", "inactive_file"),
}


class Free(NamedTuple):
    """Memory that can still be taken.

    size: in bytes. It is the machine's whole memory on systems that report only this.
    why: what limits it, as a part of a sentence.
    """

    size: int
    why: str

    def __str__(self) -> str:
        return f"{self.size / 2**30:.1f} GiB {self.why}"


def free() -> Free | None:
    """The memory that this process can still take; None if the system does not say."""
    return min(_limits(), default=None)


def address_space() -> Free | None:
    """What is left of the limit of this process's address space (`ulimit -v`); None if it has no limit."""
    return next((left for left in _ulimits() if left.why.endswith("-v`")), None)


def _limits() -> Iterator[Free]:
    """Yields what the machine has free, and what each limit leaves."""
    if (machine := _machine()) is not None:
        yield Free(machine, "are free")
    if sys.platform == "linux":
        yield from (Free(size, "are left of the container's limit") for size in _cgroups())
    yield from _ulimits()


def _machine() -> int | None:
    """Bytes that the machine has free; its whole memory if it does not say."""
    try:
        with open(PROC / "meminfo") as info:
            return next(int(line.split()[1]) * 1024 for line in info if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        pass
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return None


def _cgroups() -> Iterator[int]:
    """Yields the bytes that are left of the limit of this process's group, and of each group that contains it."""
    try:
        lines = (PROC / "self" / "cgroup").read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        version, root = (1, CGROUPS / "memory") if controllers else (2, CGROUPS)
        # In a container the path may be that of the host, which is not visible. Then the root is the container's group.
        group = root / path.lstrip("/")
        for folder in (group, *group.parents):
            if folder == root or root in folder.parents:
                left = _left_of_group(folder, *CGROUP_FILES[version])
                if left is not None:
                    yield left


def _left_of_group(folder: Path, limit_file: str, use_file: str, cached: str) -> int | None:
    """Bytes that are left of the limit of a group; None if it has no limit, or if the folder is not visible.

    limit_file, use_file: names of the files with its limit and its use. cached: the entry of cached files.
    """
    try:
        limit, use = (folder / limit_file).read_text().strip(), int((folder / use_file).read_text())
        stat = dict(line.split(" ", 1) for line in (folder / "memory.stat").read_text().splitlines())
    except (OSError, ValueError):
        return None
    if not limit.isdecimal():
        return None  # "max": no limit
    return max(int(limit) - use + int(stat.get(cached, 0)), 0)


def _ulimits() -> Iterator[Free]:
    """Yields what is left of the limits of this process's address space (`ulimit -v`) and data (`ulimit -d`)."""
    if resource is None:
        return
    try:
        status = (PROC / "self" / "status").read_text().splitlines()
        sizes = {line.split(":")[0]: int(line.split()[1]) * 1024 for line in status if line.endswith(" kB")}
    except (OSError, ValueError, IndexError):
        return
    for option, limit_name, entry in (("-v", "RLIMIT_AS", "VmSize"), ("-d", "RLIMIT_DATA", "VmData")):
        limit = resource.getrlimit(getattr(resource, limit_name))[0]
        if limit != resource.RLIM_INFINITY and entry in sizes:
            yield Free(max(limit - sizes[entry], 0), f"are left of `ulimit {option}`")
