"""Folders for the files of workers on this machine. One that a killed process has left is removed by the next one."""

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from visray.errors import UserError
from visray.output.files import may_be_alive
from visray.output.lock import locked

PREFIX = "visray-workers-"
# The number of the process, and what makes the name unique.
NAME = re.compile(rf"{PREFIX}(\d+)-\w+")
# The file whose lock the process holds.
HELD = "held"


@contextmanager
def working_folder() -> Iterator[Path]:
    """A folder for files of workers in a `with` block; it is removed at the end."""
    remove_left_behind()
    prefix = f"{PREFIX}{os.getpid()}-"
    with tempfile.TemporaryDirectory(prefix=prefix, ignore_cleanup_errors=True) as folder, locked(Path(folder, HELD)):
        yield Path(folder)


def remove_left_behind() -> None:
    """Removes the folders of processes that were killed.

    A folder is removed only if its process no longer exists, and if nobody holds its lock: a process in another
    container may have the same number.
    """
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        name = NAME.fullmatch(folder.name)
        if name and not may_be_alive(int(name[1])):
            with suppress(UserError), locked(folder / HELD):
                shutil.rmtree(folder, ignore_errors=True)
