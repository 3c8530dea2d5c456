"""What makes a worker unfit for a job: another version, or files that it cannot write."""

import platform
from typing import Any

import drjit as dr

from visray import llvm
from visray.errors import UserError
from visray.version import __version__


class WorkerRefusal(Exception):
    """A worker that cannot do a task, which others may do.

    worker: its address
    reason: what is wrong with it
    """

    def __init__(self, worker: str, reason: str):
        super().__init__(worker, reason)
        self.worker, self.reason = worker, reason


def versions() -> dict[str, str]:
    """Versions of the packages that the bits of a picture depend on."""
    return {"visray": __version__, "drjit": dr.__version__}


def facts() -> dict[str, Any]:
    """What a client must know of a worker: versions, the machine's name, threads, and why it cannot render, if so."""
    try:
        llvm.require()
        problem = None
    except UserError as error:
        problem = " ".join(error.lines)
    return versions() | {"machine": platform.node(), "threads": dr.thread_count(), "problem": problem}


def refused(theirs: dict[str, Any], ours: dict[str, str]) -> str | None:
    """Why a worker is refused, or None.

    theirs: facts of the worker; ours: versions of the client
    """
    for package, version in ours.items():
        if (found := theirs.get(package)) != version:
            return f"has {package} {found}, not {version}; install the same version there"
    return theirs.get("problem")
