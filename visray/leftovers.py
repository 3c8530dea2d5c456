"""Files that a process removes when its work is done, or when it is ended at once after Ctrl-C."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_paths: set[Path] = set()


@contextmanager
def removed_at_the_end(path: Path) -> Iterator[None]:
    """Removes a file at the end of a `with` block, if it is there."""
    _paths.add(path)
    try:
        yield
    finally:
        # Windows removes no file that is open: there it stays.
        with suppress(OSError):
            path.unlink(missing_ok=True)
        _paths.discard(path)


def remove_all() -> None:
    """Removes the files of all blocks. Call this before the process is ended without leaving them."""
    for path in list(_paths):
        with suppress(OSError):
            path.unlink(missing_ok=True)
