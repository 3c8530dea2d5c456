"""The workers of a scheduler, and the tasks that they have. Tasks of lost workers are done again by others."""

import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from visray import clock
from visray.cluster.asking import facts_of
from visray.cluster.local import LocalWorkers
from visray.cluster.refusal import WorkerRefusal, refused, versions
from visray.errors import ClusterLost, ClusterWarning, UserError

# Tasks that a worker has at once: one that it does, and one that it takes up as soon as that is done.
AHEAD = 2
# Seconds between two looks for finished tasks, and for the number of workers.
LOOK, COUNT = 0.02, 1.0
# Seconds to wait for a worker that takes the package.
SEND = 2


@dataclass
class Task:
    """A task that a worker has.

    name: its name on the dashboard
    function: what the worker calls, with the package and with `args`
    args: arguments
    what: what the caller knows it by
    """

    name: str
    function: Callable
    args: tuple
    what: Any


@dataclass
class Crew:
    """The workers of a scheduler.

    client: Dask's client
    address: what the user gave
    threads: number of threads of a worker; None if each has its own number
    local: the processes, if the workers are on this machine
    refusals: why workers are refused, by their addresses
    pending: the tasks that workers have, by Dask's futures
    waiting: the tasks that no worker has
    """

    client: Any
    address: str
    threads: int | None = None
    local: LocalWorkers | None = None
    refusals: dict[str, str] = field(default_factory=dict)
    pending: dict[Any, Task] = field(default_factory=dict)
    waiting: list[Task] = field(default_factory=list)
    job: str = field(default_factory=lambda: uuid.uuid4().hex[:8])
    _package: Any = None
    _content: Any = None
    _said: bool = False
    _counted: float = -COUNT
    _workers: tuple[str, ...] = ()
    _threads: dict[str, int] = field(default_factory=dict)

    @property
    def least_threads(self) -> int:
        """The smallest number of threads of a worker."""
        return self.threads or min(self._threads.values(), default=1)

    def check(self, seconds: float) -> None:
        """Leaves out workers of other versions, and those that do not answer in these seconds, and says so. Raises
        UserError if no worker is left."""
        with self._reaching():
            for worker, found in facts_of(self.client, seconds).items():
                if isinstance(found, dict):
                    self._threads[worker] = found["threads"]
                if reason := found if isinstance(found, str) else refused(found, versions()):
                    where = f"{worker} on {found['machine']}" if isinstance(found, dict) else worker
                    self._refuse(worker, reason, where)

    def send(self, content: Any) -> None:
        """Sends what all further tasks need, such as a package, once to each worker."""
        if content == self._content and self._is_sent:
            return
        self._content = content
        # There may be no worker at this moment, or one is lost just now. Then it is tried again later.
        with self._reaching():
            # Not to those that are refused: one that is stopped would never take it.
            to = {"workers": list(self.workers()), "broadcast": True}
            self._package = self.client.scatter(content, **to, hash=False, timeout=SEND)

    @property
    def _is_sent(self) -> bool:
        """Whether some worker has what was sent. If all are lost that had it, it must be sent again."""
        return self._package is not None and self._package.status == "finished"

    def workers(self) -> tuple[str, ...]:
        """Addresses of the workers that are there and not refused. Raises UserError if none can come any more."""
        self._check_scheduler()
        now = clock.now()
        if now - self._counted >= COUNT:
            self._counted = now
            if self.local and self.local.all_ended():
                raise ClusterLost(f"cluster = {self.address!r}: all workers have ended: {self.local.last_words()}")
            with self._reaching():
                self._workers = tuple(w for w in self.client.nthreads() if w not in self.refusals)
        return self._workers

    def _check_scheduler(self) -> None:
        """Raises UserError if the scheduler is gone."""
        if self.client.status != "running":
            raise ClusterLost(f"cluster = {self.address!r}: the scheduler is gone")

    @contextmanager
    def _reaching(self) -> Iterator[None]:
        """A `with` block that ends early if a machine cannot be reached. Raises UserError if it is the scheduler's."""
        from distributed.client import ClosedClientError

        try:
            yield
        # The KeyError is that of a scheduler that has just lost the worker.
        except (OSError, KeyError, ClosedClientError):
            self._check_scheduler()

    def has_room(self) -> bool:
        """Whether the workers should get another task."""
        return len(self.pending) + len(self.waiting) < AHEAD * len(self.workers()) + 1

    def submit(self, what: Any, name: str, function: Callable, *args: Any) -> None:
        """Gives a task to some worker. what: what the caller knows it by. Others are as in Task."""
        self.waiting.append(Task(name, function, args, what))
        self._submit_waiting()

    @property
    def is_busy(self) -> bool:
        """Whether some task is not done."""
        return bool(self.pending or self.waiting)

    def done(self) -> list[tuple[Any, Any]]:
        """The tasks that are done by now: what each is, and its result. Waits a moment. Raises what a task raised."""
        time.sleep(LOOK)
        self._submit_waiting()
        ended = [future for future in self.pending if future.status != "pending"]
        good = [future for future in ended if future.status == "finished"]
        results = dict(zip(good, self._gathered(good)))
        found = []
        for future in ended:
            task = self.pending.pop(future)
            if future in results:
                found.append((task.what, results[future]))
                continue
            error = future.exception() if future.status == "error" else None
            if isinstance(error, WorkerRefusal):
                self._refuse(error.worker.split()[0], error.reason, error.worker)
            elif error is not None:
                raise self._explained(task, error)
            # A worker was lost, with what others needed of it.
            self.waiting.append(task)
        return found

    def cancel(self) -> None:
        """Takes all tasks back. A worker that is at one of them ends it, and its result is dropped."""
        if self.pending and self.client.status == "running":
            with suppress(OSError):
                self.client.cancel(list(self.pending))
        self.pending.clear()
        self.waiting.clear()

    def _submit_waiting(self) -> None:
        """Gives all waiting tasks to workers, if there are any."""
        if not (workers := self.workers()):
            self._say_there_is_none()
            return
        if self.waiting and not self._is_sent:
            self.send(self._content)
        while self.waiting and self._is_sent:
            task = self.waiting[0]
            # Dask takes a task with the name of another one for the same task.
            key = f"{task.name}-{self.job}-{uuid.uuid4().hex[:8]}"
            only = {"workers": list(workers), "allow_other_workers": False} if self.refusals else {}
            with self._reaching():
                future = self.client.submit(task.function, self._package, *task.args, key=key, pure=False, **only)
                self.pending[future] = self.waiting.pop(0)

    def _say_there_is_none(self) -> None:
        """Warns once that there is no worker."""
        if not self._said:
            text = f"cluster = {self.address!r}: no worker is left; waiting for others (Ctrl-C keeps what is done)"
            warnings.warn(text, ClusterWarning, stacklevel=2)
        self._said = True

    def _gathered(self, futures: list) -> list:
        """Results of finished tasks. A worker may be lost meanwhile; then there are fewer, and their tasks are done
        again."""
        if not futures:
            return []
        from distributed.client import FutureCancelledError

        with self._reaching(), suppress(FutureCancelledError):
            return self.client.gather(futures)
        return []

    def _refuse(self, worker: str, reason: str, where: str) -> None:
        """Gives no more tasks to a worker, and says so. Raises UserError if no worker is left."""
        if worker in self.refusals:
            return
        self.refusals[worker] = reason
        self._counted = -COUNT
        text = f"cluster = {self.address!r}: worker {where}: {reason}"
        if not self.workers():
            raise ClusterLost(f"{text}; no other worker is left")
        warnings.warn(f"{text}; the others do its work", ClusterWarning, stacklevel=2)

    def _explained(self, task: Task, error: Exception) -> Exception:
        """The error to raise for what a task raised."""
        from distributed.scheduler import KilledWorker

        if isinstance(error, KilledWorker):
            text = (
                f"{task.name} ended {error.allowed_failures + 1} workers, one after the other; perhaps they need more "
                "memory"
            )
            return UserError(f"cluster = {self.address!r}: {text}")
        return error
