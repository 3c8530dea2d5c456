"""Work that other threads ask of the thread that renders."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Any


class Jobs:
    """Pieces of work that wait, the oldest first."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Future, Callable[[], Any]]] = deque()

    def ask(self, work: Callable[[], Any]) -> Future:
        """The result of some work that will be done. May be called from any thread."""
        future: Future = Future()
        self._waiting.append((future, work))
        return future

    def do_one(self) -> bool:
        """Does the oldest piece of work. Returns whether there was one."""
        try:
            future, work = self._waiting.popleft()
        except IndexError:
            return False
        if future.set_running_or_notify_cancel():
            try:
                future.set_result(work())
            except BaseException as error:
                future.set_exception(error)
        return True

    def cancel(self) -> None:
        """Cancels all work that nobody has begun."""
        # Other threads may take some away meanwhile.
        with suppress(IndexError):
            while True:
                self._waiting.popleft()[0].cancel()
