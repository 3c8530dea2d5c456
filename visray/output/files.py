"""Safe writing of files: if writing fails, the old file remains, and no incomplete file is left behind."""

import errno
import os
import re
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from visray.errors import UserError
from visray.leftovers import removed_at_the_end

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

# Names of temporary files, with the number of the process.
_TEMPORARY = re.compile(r"\.visray-([1-9][0-9]{0,9})-[0-9a-f]{16}(\.\w+)?")

_REASONS = {
    errno.ENOSPC: "the disk is full; free some space or write to another disk",
    errno.EDQUOT: "your disk quota is used up; free some space or write to another disk",
    errno.EFBIG: "the file would be larger than the file system or a limit allows; write to another disk",
    errno.EACCES: "there is no permission to write there; write to another folder",
    errno.EPERM: "there is no permission to write there; write to another folder",
    errno.EROFS: "the file system is read-only; write to another disk",
    errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
}


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raises a UserError if a file cannot be written at `path`. Call this before a long render."""
    try:
        check_place(Path(path))
        with _reserved(_target(path)):
            pass
    except OSError as error:
        raise _explain(path, error) from error


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields the path of a temporary file, to be written in a `with` block. At the end of the block this file replaces
    the file at `path`. If anything fails, the temporary file is removed.

    An OSError, for example because the disk is full, becomes a UserError. If `path` is a link, the file that the link
    points to is replaced.
    """
    try:
        check_place(Path(path))
        target = _target(path)
        with _reserved(target) as temporary:
            yield temporary
            _flush(temporary)
            if target.exists():
                os.chmod(temporary, stat.S_IMODE(target.stat().st_mode))
            os.replace(temporary, target)
    except OSError as error:
        raise _explain(path, error) from error


def check_place(path: Path) -> None:
    """Raises a UserError if `path` is not a file that can be written, or if its folder does not exist."""
    folder = path.parent
    if path.is_dir():
        raise UserError(f"{path}: this is a folder; give the name of a file in it")
    if not folder.exists():
        raise UserError(f"{path}: the folder '{folder}' does not exist; create it first")
    if not folder.is_dir():
        raise UserError(f"{path}: '{folder}' is a file, not a folder; write to another folder")
    if not path.exists():
        return
    if not path.is_file():
        raise UserError(f"{path}: this is not a regular file; choose another name")
    if not os.access(path, os.W_OK):
        raise UserError(f"{path}: the file is write-protected; choose another name or remove the protection")


def _target(path: str | os.PathLike[str]) -> Path:
    """The file that `path` leads to if all links are followed. Raises an OSError if the name is too long."""
    target = Path(os.path.realpath(path))
    with suppress(FileNotFoundError):
        target.lstat()
    return target


@contextmanager
def _reserved(target: Path) -> Iterator[Path]:
    """Yields the path of an empty file in the folder of `target`, with its suffix and the default permissions of new
    files. At the end of the `with` block, also after Ctrl-C, the file is removed if it still has this name.

    The file is locked while its process lives, so that others can tell a file that was left behind (_tidy).
    """
    _tidy(target.parent)
    path = target.with_name(f".visray-{os.getpid()}-{secrets.token_hex(8)}{target.suffix}")
    number = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
    try:
        if fcntl is None:
            os.close(number)  # Windows renames no file that is open
        else:
            _lock(number)
        with removed_at_the_end(path):
            yield path
    finally:
        if fcntl is not None:
            os.close(number)


def _lock(number: int) -> bool:
    """Locks an open file. Returns False if another process has locked it, or if the file system has no locks."""
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _tidy(folder: Path) -> None:
    """Removes temporary files that a process has left behind in a folder because it was killed.

    A file is removed only if its name is one that visray gives, its process no longer exists, and nobody locks it: a
    process on another machine may have the same number.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            name = _TEMPORARY.fullmatch(entry.name)
            if name and entry.is_file(follow_symlinks=False) and not may_be_alive(int(name[1])):
                with suppress(OSError):
                    _remove_unlocked(entry.path)


def may_be_alive(number: int) -> bool:
    """Whether there is a process with this number on this machine. True on Windows, where the question ends it."""
    if fcntl is None:
        return True
    try:
        os.kill(number, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def _remove_unlocked(path: str) -> None:
    """Removes a file unless a process has locked it."""
    number = os.open(path, os.O_WRONLY | os.O_NOFOLLOW)
    try:
        if _lock(number):
            os.unlink(path)
    finally:
        os.close(number)


def _flush(path: Path) -> None:
    """Waits until the file is on the disk. Without this, a crash of the system could leave an empty file."""
    with open(path, "rb+") as file:
        os.fsync(file.fileno())


def _explain(path: str | os.PathLike[str], error: OSError) -> UserError:
    """The UserError for an OSError: what went wrong, and what to do."""
    reason = _REASONS.get(error.errno, error.strerror or str(error))
    return UserError(f"{os.fspath(path)}: cannot be written, {reason}")


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Writes text to a file. An old file is replaced only when the new file is complete."""
    check_writable(path)
    with replacing(path) as aside:
        Path(aside).write_text(text, encoding="utf-8")
