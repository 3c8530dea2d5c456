"""Locks: while a process writes a file for minutes, no other process writes it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from visray.errors import UserError
from visray.leftovers import removed_at_the_end

# The lock of a file has its name and this ending.
LOCK_SUFFIX = ".lock"


@contextmanager
def locked(path: str | os.PathLike[str]) -> Iterator[None]:
    """Holds the lock of a file in a `with` block: the file `path`.lock, which is removed at the end. The operating
    system frees the lock however the process ends. Raises UserError if another process holds it."""
    # Here, because few commands need it.
    from filelock import FileLock, Timeout

    lock = FileLock(f"{path}{LOCK_SUFFIX}")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise UserError(f"{path}: another process uses it; wait for its end, or stop it") from None
    except (OSError, NotImplementedError) as error:
        raise UserError(f"{path}: cannot be locked, {error}; write to another folder") from error
    try:
        with removed_at_the_end(Path(lock.lock_file)):
            yield
    finally:
        lock.release()
