"""Where work that took minutes is kept: in a checkpoint until it is done, and elsewhere if its file cannot be written
because the disk is full, for example."""

import secrets
import tempfile
from collections.abc import Callable
from pathlib import Path

from visray.errors import UserError


def kept(path: Path, write: Callable[[Path], None]) -> tuple[Path | None, list[str]]:
    """Writes a file. If that fails, writes it to the folder for temporary files instead.

    write: writes the file at a path; raises UserError if it cannot.
    Returns the path of the file that was written, or None, and the lines of an error.
    """
    try:
        write(path)
        return path, []
    except UserError as error:
        lines = error.lines
    elsewhere = Path(tempfile.gettempdir(), f"visray-{secrets.token_hex(4)}-{path.name}")
    try:
        write(elsewhere)
    except UserError as error:
        return None, [*lines, *error.lines]
    return elsewhere, [f"{'; '.join(lines)}; it is kept as {elsewhere}"]


def checkpoint_path(outputs: list[Path]) -> Path:
    """The file that keeps the samples of a picture until it is written to these files: beside the first of them."""
    return outputs[0].with_name(outputs[0].name + ".checkpoint")
