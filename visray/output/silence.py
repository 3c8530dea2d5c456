"""Keeps what OpenEXR prints away from the terminal: visray says what is wrong with a file in its own words."""

import contextlib
import ctypes
import os
import sys
import threading
from collections.abc import Iterator

# Standard output and standard error belong to the whole process, so one thread at a time may redirect them.
_lock = threading.Lock()


@contextlib.contextmanager
def silenced() -> Iterator[None]:
    """Drops what is printed in a `with` block: by Python, and by libraries, which write to the files 1 and 2."""
    with _lock, open(os.devnull, "w") as null, contextlib.redirect_stdout(null), contextlib.redirect_stderr(null):
        _flush()
        saved = []
        try:
            for number in (1, 2):
                with contextlib.suppress(OSError):
                    saved.append((number, os.dup(number)))
                    os.dup2(null.fileno(), number)
            yield
        finally:
            # What a library has printed may still be in a buffer of C.
            _flush()
            for number, copy in saved:
                os.dup2(copy, number)
                os.close(copy)


def _flush() -> None:
    """Writes out the buffers of Python's and of C's standard streams."""
    for stream in (sys.__stdout__, sys.__stderr__):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    if os.name == "posix":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).fflush(None)
