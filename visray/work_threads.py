"""Threads that work with Dr.Jit, or with other compiled code, and that must have ended before Python ends.

Python ends while daemon threads still run. One that then comes back to Python from compiled code of C++ or Rust is
unwound by force, which aborts the process. Threads that are no daemons are waited for, but nobody asks them to
stop. So the threads of this kind begin here. When Python ends, all are asked to stop, and then waited for: a step or a
compilation takes a while, but ends.
"""

import atexit
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress

from visray import clock, leftovers, terminal

# Seconds that Python's end waits for threads before it says so.
SAID_AFTER = 2.0
# Exit code of a process that Ctrl-C ends while it waits.
INTERRUPTED = 130
# A wait is no longer than this many seconds, because Windows hears of Ctrl-C only between two waits.
PIECE = 0.2

# The threads, each with the function that asks it to stop.
_threads: dict[threading.Thread, Callable[[], None]] = {}
_lock = threading.Lock()
_has_hook = _python_ends = False


def begun(work: Callable[[], None], name: str, stop: Callable[[], None] = lambda: None) -> threading.Thread:
    """Begins a thread.

    work: what it does
    name: its name
    stop: asks it to stop soon. It returns at once, and may be called several times, from any thread. Default: the work
        is short, and ends by itself.

    Raises RuntimeError if Python ends.
    """
    global _has_hook
    # Dr.Jit has an end of its own. That of the threads comes before it, because it is registered later.
    import drjit

    drjit.__path__  # noqa: B018 - loads it, if that was put off
    thread = threading.Thread(target=work, name=name, daemon=True)
    with _lock:
        if _python_ends:
            raise RuntimeError("no thread begins while Python ends")
        if not _has_hook:
            _has_hook = True
            atexit.register(_end)
        for old in [t for t in _threads if not t.is_alive()]:
            del _threads[old]
        thread.start()
        _threads[thread] = stop
    return thread


def have_ended(seconds: float, threads: Iterable[threading.Thread] | None = None) -> bool:
    """Asks threads to stop, and waits for them. Returns whether all have ended in time.

    seconds: how long it waits at most
    threads: some of the threads that were begun here; None: all
    """
    asked = _running() if threads is None else [t for t in _running() if t in set(threads)]
    _ask(asked)
    end = clock.now() + seconds
    while (waited := [t for t in asked if t.is_alive()]) and (left := end - clock.now()) > 0:
        waited[0].join(min(left, PIECE))
    return not waited


def _running() -> list[threading.Thread]:
    """The threads that have not ended, but for the current one. In a copy of the process, made by fork, none lives."""
    with _lock:
        return [t for t in _threads if t.is_alive() and t is not threading.current_thread()]


def _ask(threads: Iterable[threading.Thread]) -> None:
    """Asks threads to stop."""
    for thread in threads:
        # An error of one leaves the others to be asked.
        with suppress(Exception):
            _threads[thread]()


def _end() -> None:
    """Python ends: waits for all threads, without a limit. Ctrl-C ends the process at once."""
    global _python_ends
    try:
        with _lock:
            _python_ends = True
        if not have_ended(SAID_AFTER):
            terminal.say("waiting until a thread has ended its step; Ctrl-C ends at once")
            while not have_ended(PIECE):
                pass
    except KeyboardInterrupt:
        terminal.flush()
        leftovers.leave(INTERRUPTED)
