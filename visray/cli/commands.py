"""Runs the commands of the command line. `visray COMMAND --help` explains each of them."""

import os
import sys
import warnings

from cyclopts import CycloptsError

from visray.cli import files, rendering, studies  # noqa: F401 - each module adds its commands to app
from visray.cli.options import INTERRUPTED, app
from visray.errors import UserError


def _note(message: Warning | str, *_: object, **__: object) -> None:
    """Prints a warning as one line."""
    sys.stderr.write(f"visray: note: {message}\n")


def main(tokens: list[str] | None = None) -> int:
    """Runs a command and returns its exit code: 0 done, 1 a check failed, 2 bad input, 130 stopped by Ctrl-C."""
    warnings.showwarning = _note
    try:
        return app(tokens, exit_on_error=False, print_error=False, result_action="return_value") or 0
    except UserError as error:
        lines = error.lines
    except CycloptsError as error:
        lines = (" ".join(str(error).split()) + " (see visray --help)",)
    except KeyboardInterrupt:
        sys.stderr.write("visray: stopped before anything could be kept\n")
        return INTERRUPTED
    except BrokenPipeError:
        # The program that reads the output, such as `head`, has closed it. Without this, Python would print an error at
        # its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    sys.stderr.write("".join(f"visray: {line}\n" for line in lines))
    return 2
