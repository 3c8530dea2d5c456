"""The door to the terminal: everything that visray prints goes through here or through tables.py, as plain text.

What a user asks for, such as a report, goes to standard output. If it cannot be written there, that is an error. Notes
and errors go to standard error. Writing them never fails, because nobody could be told.
"""

import io
import json
import os
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from visray.errors import UserError

try:
    import termios
    import tty
except ImportError:  # Windows
    termios = tty = None

# Seconds in which the last answers of a terminal come, also of one that is far away.
LATE = 0.2


# Whether standard output is for a picture alone, so that lines of reports go to standard error.
_output_is_free = False


def keep_output_free(free: bool) -> None:
    """Says whether standard output is for a picture alone. Lines of reports then go to standard error."""
    global _output_is_free
    _output_is_free = free


class _Unfailing(io.TextIOWrapper):
    """A text stream that drops what cannot be written: to a closed pipe, or to a full disk."""

    def write(self, text: str, /) -> int:
        try:
            return super().write(text)
        except OSError:
            return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except OSError:
            return


def open_streams() -> None:
    """Makes the standard streams safe to write to. Characters that their encoding does not have are written as escapes
    such as `\\u2264`.

    A stream that is closed gets the null device, opened so that it cannot be written. Without this, the next file that
    the program opens would take the stream's number, and what a library prints would go into this file.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY)
        if getattr(sys, name) is None:
            stream = open(number, "w" if number else "r", encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    error = sys.stderr
    if type(error) is io.TextIOWrapper:
        sys.stderr = _Unfailing(error.buffer, error.encoding, "backslashreplace", line_buffering=True)
        # If the old stream were deleted, it would close the buffer.
        sys.stderr.old = error


def printable(text: str) -> str:
    """The text with escapes such as `\\n` for characters that cannot be printed. Names from files may have some."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def write(text: str) -> None:
    """Writes text to standard output. Raises a UserError if it cannot be written there, for example on a full disk; a
    BrokenPipeError if the program that reads the output has ended."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise UserError(f"standard output: cannot be written, {error.strerror or error}") from error


class Output:
    """Standard output as a file for a library, which writes through this door.

    is_terminal: what isatty() answers; None: whether it is a terminal.
    """

    def __init__(self, is_terminal: bool | None = None) -> None:
        self.is_terminal = is_terminal

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stdout, name)

    def isatty(self) -> bool:
        return is_terminal() if self.is_terminal is None else self.is_terminal

    def write(self, text: str) -> int:
        write(text)
        return len(text)

    def flush(self) -> None:
        """Does nothing, because the door writes at once."""


def is_terminal() -> bool:
    """Whether standard output is a terminal."""
    return sys.stdout.isatty()


def can_write(text: str) -> bool:
    """Whether the encoding of standard output has all characters of a text."""
    try:
        text.encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return False
    return True


def answers() -> bool:
    """Whether the terminal on standard output may be asked what it can do. Its answers are read from standard input, so
    this must be a terminal too, and other programs must not be waiting for what the user types there."""
    try:
        if not (sys.stdout.isatty() and sys.__stdin__.isatty()):
            return False
        # The system stops a process in the background that changes how the terminal reads.
        return termios is None or os.tcgetpgrp(sys.__stdin__.fileno()) == os.getpgrp()
    except (AttributeError, OSError, ValueError):
        return False  # a stream is missing, closed, or of no terminal that this process may steer


@contextmanager
def answered() -> Iterator[None]:
    """A `with` block in which the terminal is asked questions. Answers are not shown; those that come late are dropped,
    so that the shell does not take them for a command."""
    if termios is None:
        yield
        return
    number = sys.__stdin__.fileno()
    mode = termios.tcgetattr(number)
    tty.setcbreak(number, termios.TCSANOW)
    try:
        yield
        time.sleep(LATE)
    finally:
        termios.tcsetattr(number, termios.TCSAFLUSH, mode)


@contextmanager
def as_output(is_terminal: bool) -> Iterator[None]:
    """A `with` block in which a library that writes to sys.__stdout__ writes through this door.

    is_terminal: whether the library takes it for a terminal, which it may ask.
    """
    before, sys.__stdout__ = sys.__stdout__, Output(is_terminal)
    try:
        yield
    finally:
        sys.__stdout__ = before


def write_line(text: str) -> None:
    """Writes a line of plain text to standard output; to standard error if the output is for a picture alone."""
    (sys.stderr.write if _output_is_free else write)(printable(text) + "\n")


def write_bytes(data: bytes) -> None:
    """Writes bytes to standard output. Errors are those of `write`."""
    try:
        sys.stdout.flush()
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise UserError(f"standard output: cannot be written, {error.strerror or error}") from error


def write_json(report: Any) -> None:
    """Writes a report as JSON to standard output. Without a Unicode encoding, it is in ASCII."""
    unicode = (sys.stdout.encoding or "").lower().startswith("utf")
    write(json.dumps(report, indent=2, ensure_ascii=not unicode) + "\n")


def say(text: str) -> None:
    """Writes a line of plain text to standard error, after the name of the program."""
    sys.stderr.write(f"visray: {printable(text)}\n")


def note(message: Warning | str, *_: object, **__: object) -> None:
    """Writes a warning as one line to standard error. It can replace warnings.showwarning."""
    say(f"note: {message}")


def flush() -> None:
    """Writes out what Python still keeps of the standard streams, if that is possible."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()


def restore() -> None:
    """Shows the cursor again, which a progress bar hides, before a process is ended without clearing up."""
    if sys.stderr.isatty():
        sys.stderr.write("\x1b[?25h")
        sys.stderr.flush()


@contextmanager
def kept_notes() -> Iterator[list[str]]:
    """Collects the texts of all warnings in a `with` block, in a list. They are shown as before."""
    show, notes = warnings.showwarning, []

    def keep(message: Warning | str, *more: Any, **fields: Any) -> None:
        notes.append(str(message))
        show(message, *more, **fields)

    warnings.showwarning = keep
    try:
        yield notes
    finally:
        warnings.showwarning = show


def abandon_output() -> None:
    """Drops what was not yet written to standard output, after writing has failed. Otherwise Python would try again at
    its exit, and print an error."""
    try:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
    except (OSError, ValueError):
        return
