"""Files and folders that a process removes when its work is done, or when it is ended at once after Ctrl-C."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

_paths: set[Path] = set()


@contextmanager
def removed_at_the_end(path: Path) -> Iterator[None]:
    """Removes a file, or a folder with all that is in it, at the end of a `with` block, if it is there."""
    _paths.add(path)
    try:
        yield
    finally:
        _remove(path)
        _paths.discard(path)


@contextmanager
def passing_folder() -> Iterator[Path]:
    """Yields a new folder among the temporary files, which is removed at the end of a `with` block."""
    import tempfile  # here, because the program imports this module before it can say anything

    folder = Path(tempfile.mkdtemp(prefix="visray-"))
    with removed_at_the_end(folder):
        yield folder


def removed_with_the_process(path: Path) -> None:
    """Removes a file or a folder if the process is ended at once. Who calls this sees to all other ends."""
    _paths.add(path)


def remove_all() -> None:
    """Removes the files and folders of all blocks. Call this before the process is ended without leaving them."""
    for path in list(_paths):
        _remove(path)


def leave(code: int) -> NoReturn:
    """Ends the process at once, whatever its threads do, and leaves no files behind. code: the exit code

    Nothing is flushed, because the stream may belong to a thread that hangs.
    """
    remove_all()
    os._exit(code)


def _remove(path: Path) -> None:
    """Removes a file or a folder. Windows removes no file that is open: there it stays."""
    with suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            import shutil

            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
