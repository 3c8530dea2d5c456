"""Ends the program after Ctrl-C if the main thread does not answer.

Python handles a signal in the main thread, between two instructions of Python. While this thread runs compiled code,
such as Dr.Jit's compiler, no signal is handled, sometimes for minutes. Another thread then ends the process, if nothing
would be lost, or says what Ctrl-C waits for.
"""

import os
import select
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from visray import leftovers, terminal

# Seconds that the main thread has to answer.
PATIENCE = 1.0
SIGNALS = {signal.SIGINT, signal.SIGTERM}


@contextmanager
def watched(code: int) -> Iterator[None]:
    """Watches for Ctrl-C in a `with` block. code: exit code of a process that is ended here."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    # Python writes the number of each signal there at once, whatever the main thread does.
    previous = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    thread = threading.Thread(target=_watch, args=(reading, code), daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(previous)
        os.close(writing)
        thread.join()


def _watch(reading: int, code: int) -> None:
    """Waits for signals, until the pipe `reading` is closed at its other end."""
    presses, deadline, last = 0, None, signal.SIGINT
    while True:
        left = None if deadline is None else max(deadline - time.monotonic(), 0)
        if select.select([reading], [], [], left)[0]:
            numbers = os.read(reading, 64)
            if not numbers:
                os.close(reading)
                return
            stops = [n for n in numbers if n in SIGNALS]
            presses, last = presses + len(stops), stops[-1] if stops else last
            deadline = time.monotonic() + PATIENCE if presses else None
            continue
        deadline = None
        if _loses_nothing() or presses > 1:
            terminal.restore()
            terminal.say("stopped before anything could be kept" if presses == 1 else "stopped; nothing is kept")
            leftovers.leave(code if last == signal.SIGINT else 128 + last)
        terminal.say("stopping: what is done so far is kept as soon as possible; Ctrl-C again ends at once")


def last_signal() -> int | None:
    """Number of the last signal that asked the program to stop, as the owner of the handler of Ctrl-C says; None if
    there was none."""
    owner = _owner()
    return owner.last_signal() if hasattr(owner, "last_signal") else None


def _loses_nothing() -> bool:
    """Whether the process may be ended without a loss, as the owner of the handler of Ctrl-C says."""
    owner = _owner()
    return owner is not None and owner.loses_nothing()


def _owner() -> Any:
    """The object whose method handles Ctrl-C; None if no object does."""
    return getattr(signal.getsignal(signal.SIGINT), "__self__", None)
