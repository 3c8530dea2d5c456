"""Safe writing of files: if writing fails, the old file remains, and no incomplete file is left behind."""

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from visray.errors import UserError

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
        _check(Path(path))
        trial = _reserve(_target(path))
    except OSError as error:
        raise _explain(path, error) from error
    trial.unlink()


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields the path of a temporary file, to be written in a `with` block. At the end of the block this file replaces
    the file at `path`. If anything fails, the temporary file is removed.

    An OSError, for example because the disk is full, becomes a UserError. If `path` is a link, the file that the link
    points to is replaced.
    """
    temporary = None
    try:
        _check(Path(path))
        target = _target(path)
        temporary = _reserve(target)
        yield temporary
        _flush(temporary)
        if target.exists():
            os.chmod(temporary, stat.S_IMODE(target.stat().st_mode))
        os.replace(temporary, target)
    except OSError as error:
        raise _explain(path, error) from error
    finally:
        # Also after Ctrl-C. If the replacement has succeeded, the temporary file no longer exists.
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _check(path: Path) -> None:
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


def _reserve(target: Path) -> Path:
    """Creates an empty file in the folder of `target`, with its suffix and the default permissions of new files."""
    path = target.with_name(f".visray-{secrets.token_hex(8)}{target.suffix}")
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    return path


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
