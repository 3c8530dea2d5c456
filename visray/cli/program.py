"""The program `visray`: it runs a command and ends with an exit code. An error gets one line, never a traceback.

Streams and signals are set up before anything else is imported. So an import that fails or is interrupted ends with one
line too.
"""

import _thread
import os
import signal
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from visray import drjit_import, leftovers, terminal
from visray.cli.stuck import watched
from visray.errors import UserError

# Exit codes. A command itself returns 0 (done), 1 (a check failed) or INTERRUPTED.
BAD_INPUT, INTERNAL_ERROR, INTERRUPTED, TERMINATED = 2, 70, 130, 143
# Seconds that threads of visray have to end after the command.
PATIENCE = 0.1
# Signals that ask the program to stop: Ctrl-C, and what systems send before they end a process.
SIGNALS = (signal.SIGINT, signal.SIGTERM)
# If this environment variable is set, an internal error shows its traceback too.
TRACEBACK = "VISRAY_TRACEBACK"


def main(tokens: list[str] | None = None) -> int:
    """Runs a command and returns its exit code.

    tokens: the words of the command; None means those of the command line.
    """
    terminal.open_streams()
    terminal.keep_output_free(False)
    if "visray.progress" in sys.modules:
        sys.modules["visray.progress"].Interrupts.last = None
    with _Stop.caught() as stop, watched(INTERRUPTED):
        try:
            code = _run(tokens)
            sys.stdout.flush()
        except BaseException as error:
            code = _ended(error, stop)
        if tokens is None and stop.catches:
            # The process ends now. From here on, Ctrl-C ends it without a word.
            stop.previous_handlers = dict.fromkeys(SIGNALS, signal.SIG_DFL)
    code = TERMINATED if code == INTERRUPTED and stop.last_signal() == signal.SIGTERM else code
    threads = sys.modules.get("visray.work_threads")
    if tokens is None and threads is not None and not threads.have_ended(PATIENCE):
        # A thread that compiles cannot be interrupted. Python's end would wait for it.
        leftovers.leave(code)
    return code


def _run(tokens: list[str] | None) -> int:
    """Runs a command and returns its exit code. Raises UserError if there is no such command or option."""
    if (sys.argv[1:] if tokens is None else tokens) == ["--version"]:
        from visray.version import __version__  # at once, without the help of cyclopts

        terminal.write_line(__version__)
        return 0
    from cyclopts import CycloptsError  # here, because its import may be interrupted, like that of the commands

    # Commands that need no Dr.Jit do without it, and errors in a scene are seen before it is loaded.
    drjit_import.put_off()
    from visray.cli.commands import app
    from visray.cli.words import written_out

    with warnings.catch_warnings():
        warnings.showwarning = terminal.note
        try:
            words = written_out(sys.argv[1:] if tokens is None else tokens)
            return app(words, exit_on_error=False, print_error=False, result_action="return_value") or 0
        except CycloptsError as error:
            from visray.cli.wrong_words import explained

            raise UserError(explained(error, app)) from None


class _Stop:
    """The request to stop by Ctrl-C or SIGTERM. The first one raises KeyboardInterrupt. While the program ends, a
    second one is ignored, and a third one ends it at once.

    count: how often it was asked for.
    number: number of the last signal that asked for it; None if there was none.
    catches: whether Ctrl-C is caught here; only the main thread can do so.
    """

    def __init__(self) -> None:
        self.count = 0
        self.catches = threading.current_thread() is threading.main_thread()
        self.number: int | None = None
        self.previous_handlers: dict[int, Any] = {}

    @staticmethod
    @contextmanager
    def caught() -> Iterator["_Stop"]:
        """Catches Ctrl-C in a `with` block."""
        stop = _Stop()
        if not stop.catches:
            yield stop
            return
        stop.previous_handlers = {number: signal.signal(number, stop.request) for number in SIGNALS}
        previous_hook, sys.unraisablehook = sys.unraisablehook, stop.repeat
        try:
            yield stop
        finally:
            sys.unraisablehook = previous_hook
            for number, handler in stop.previous_handlers.items():
                signal.signal(number, handler)

    def request(self, number: int, frame: FrameType | None) -> None:
        """Handler of the signals."""
        self.count, self.number = self.count + 1, number
        if self.count == 1:
            raise KeyboardInterrupt
        if self.count > 2:
            leftovers.remove_all()
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)

    def last_signal(self) -> int | None:
        """Number of the last signal that asked the program to stop, here or in long work (progress.Interrupts)."""
        progress = sys.modules.get("visray.progress")
        return self.number or (progress.Interrupts.last if progress else None)

    def loses_nothing(self) -> bool:
        """Whether nothing would be lost if the process ended now: the main thread has not answered Ctrl-C yet, neither
        here nor in long work, whose results may be about to be written."""
        return self.last_signal() is None

    def repeat(self, unraisable: Any) -> None:
        """Handler of exceptions that Python cannot raise, because they occur while an object is deleted. A
        KeyboardInterrupt is raised again a moment later. All others change nothing, and only developers see them."""
        if isinstance(unraisable.exc_value, KeyboardInterrupt):
            self.count = 0
            _thread.start_new_thread(_interrupt_later, ())
        elif os.environ.get(TRACEBACK):
            sys.__unraisablehook__(unraisable)


def _interrupt_later() -> None:
    """Raises KeyboardInterrupt in the main thread, after the handler that asks for it has returned."""
    time.sleep(0.05)
    _thread.interrupt_main()


def _ended(error: BaseException, stop: _Stop) -> int:
    """Says in one line why a command has ended, or in several lines if the user's input has several errors. Returns the
    exit code."""
    if os.environ.get(TRACEBACK) and not isinstance(error, (UserError, SystemExit)):
        traceback.print_exception(error)
    # An interrupted import may raise any exception.
    if stop.count or isinstance(error, KeyboardInterrupt):
        says_more = isinstance(error, KeyboardInterrupt) and error.args
        terminal.say(str(error) if says_more else "stopped before anything could be kept")
        return INTERRUPTED
    if isinstance(error, BrokenPipeError) or isinstance(error.__context__, BrokenPipeError):
        # The program that reads the output, such as `head`, has ended.
        terminal.abandon_output()
        return 0
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else BAD_INPUT if error.code else 0
    lines, code = _lines(error)
    for line in lines:
        terminal.say(line)
    terminal.abandon_output()
    return code


def _lines(error: BaseException) -> tuple[tuple[str, ...], int]:
    """The lines that describe an error, and the exit code."""
    if isinstance(error, UserError):
        return error.lines, BAD_INPUT
    if isinstance(error, MemoryError):
        return ("there is not enough memory; make the picture or the scene smaller",), BAD_INPUT
    if isinstance(error, OSError) and error.strerror:
        return (f"{error.filename or 'standard output'}: {error.strerror}",), BAD_INPUT
    text = " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")
    return (f"internal error: {text}; please report it, with what {TRACEBACK}=1 shows",), INTERNAL_ERROR
