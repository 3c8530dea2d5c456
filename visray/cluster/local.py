"""A cluster on this machine: a scheduler in this process, and workers as processes of their own."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from visray.cluster.folders import working_folder
from visray.errors import UserError

# Seconds after which a worker ends itself if its scheduler is gone.
ORPHANED = "10"
# Seconds in which a worker that is asked to end does so.
PATIENCE = 2.0


@dataclass
class LocalWorkers:
    """Worker processes on this machine.

    processes: the processes
    folder: their working files, and what they print
    """

    processes: list[subprocess.Popen]
    folder: Path

    def all_ended(self) -> bool:
        """Whether no process is left."""
        return all(process.poll() is not None for process in self.processes)

    def last_words(self) -> str:
        """How a worker ended: by a signal, or the last line that it printed."""
        for number, process in enumerate(self.processes):
            if process.returncode is not None and process.returncode < 0:
                return f"signal {signal.Signals(-process.returncode).name}"
            lines = (self.folder / f"{number}.txt").read_text(errors="replace").split("\n")
            if words := [line.strip() for line in lines if line.strip()]:
                return words[-1]
        return "no reason is known"

    def end(self) -> None:
        """Ends all processes."""
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_count(address: str, count: int) -> None:
    """Raises UserError if this machine cannot have this many workers."""
    if not 1 <= count <= cores():
        most = f"from 1 to {cores()}, the number of cores of this machine"
        raise UserError(f"cluster = {address!r}: the number of workers must be {most}")


@contextmanager
def local_cluster(count: int) -> Iterator[tuple[Any, LocalWorkers]]:
    """A scheduler and `count` workers in a `with` block: the cluster, as the client takes it, and the processes."""
    import dask
    from distributed import LocalCluster

    # The scheduler alone: the workers that Dask would start import the user's script once more.
    with (
        working_folder() as folder,
        dask.config.set(temporary_directory=str(folder)),
        LocalCluster(n_workers=0, dashboard_address="127.0.0.1:8787", silence_logs=False) as cluster,
    ):
        workers = LocalWorkers([], folder)
        try:
            for number in range(count):
                workers.processes.append(_started(cluster.scheduler_address, number, workers.folder))
            yield cluster, workers
        finally:
            workers.end()


def _started(address: str, number: int, folder: Path) -> subprocess.Popen:
    """A worker process. address: that of the scheduler."""
    options = ["--no-nanny", "--no-dashboard", "--nthreads", "1", "--memory-limit", "0", "--death-timeout", ORPHANED]
    options += ["--name", f"local-{number}", "--local-directory", str(folder)]
    # In a session of its own, because Ctrl-C in the terminal would end it before its samples have come back.
    with open(folder / f"{number}.txt", "w") as printed:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", "worker", address, *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=printed,
            start_new_session=True,
        )
