"""Connects to a scheduler by its address, or starts one on this machine."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from visray.cluster.address import check_address, local_count
from visray.cluster.crew import Crew
from visray.cluster.local import LocalWorkers, cores, local_cluster
from visray.cluster.quiet import quiet
from visray.cluster.scheduler import check_scheduler
from visray.errors import UserError
from visray.progress import Bar

# Seconds in which a scheduler must answer. So a line is there within 10 s, with the start of the program and of Dask.
ANSWER = 6.0
# Seconds in which a scheduler must have workers, and in which they must answer: the first time, they import visray.
WORKERS = 10.0
# Seconds in which the workers of local:N must have started.
START = 60.0


@contextmanager
def connected(address: str, threads: int | None = None, progress: bool = True) -> Iterator[Crew]:
    """The workers of a scheduler, in a `with` block. At its end they are free again, and those of local:N have ended.

    address: address of a scheduler, such as tcp://host:8786, or local:N for N workers on this machine
    threads: number of threads of each worker. None: all that a worker's machine has; with local:N its share of them.
    progress: whether a progress bar is shown until the workers are there
    """
    check_address(address)
    count = local_count(address)
    title = f"connecting to {address}" if count is None else f"starting {count} worker{'s' * (count > 1)}"
    # Before the noise is kept away: the import gives Dask's loggers their handlers.
    import distributed  # noqa: F401

    with quiet(), ExitStack() as stack:
        with Bar(title, 1, progress):
            crew = _crew(stack, address, count, threads)
        try:
            yield crew
        finally:
            crew.cancel()


def _crew(stack: ExitStack, address: str, count: int | None, threads: int | None) -> Crew:
    """The workers of a scheduler, once they are there.

    stack: what ends them
    count: number of workers on this machine; None for the address of a scheduler
    address, threads: as in `connected`
    """
    local = None
    if count is not None:
        cluster, local = stack.enter_context(local_cluster(count))
        threads = threads or max(cores() // count, 1)
        client = stack.enter_context(_client(cluster, address))
        _wait_for_all(client, local, address)
    else:
        check_scheduler(address, ANSWER)
        client = stack.enter_context(_client(address, address))
        _wait_for_one(client, address)
    crew = Crew(client, address, threads, local)
    crew.check(WORKERS)
    return crew


def _client(target: Any, address: str) -> Any:
    """Dask's client of a scheduler. Raises UserError if the scheduler does not answer.

    target: the address, or the cluster on this machine
    """
    from distributed import Client

    try:
        # What workers send goes straight to the client if they are on its machine, else through the scheduler.
        return Client(target, timeout=ANSWER, set_as_default=False, direct_to_workers=target is not address)
    except (OSError, ValueError) as error:
        problem = f"no scheduler answers within {ANSWER:g} s" if isinstance(error, OSError) else str(error)
        raise UserError(f"cluster = {address!r}: {problem}; start one with: dask scheduler") from None


def _wait_for_one(client: Any, address: str) -> None:
    """Waits until the scheduler has a worker. Raises UserError if none comes."""
    try:
        client.wait_for_workers(1, timeout=WORKERS)
    except TimeoutError:
        raise UserError(f"cluster = {address!r}: it has no workers; start some with: dask worker {address}") from None


def _wait_for_all(client: Any, local: LocalWorkers, address: str) -> None:
    """Waits until the workers on this machine have started. Raises UserError if one cannot."""
    for _ in range(int(START)):
        try:
            client.wait_for_workers(len(local.processes), timeout=1)
            return
        except TimeoutError:
            if any(process.poll() is not None for process in local.processes):
                break
    raise UserError(f"cluster = {address!r}: a worker could not start: {local.last_words()}")
