"""Reads tables from files."""

import os
import stat
from pathlib import Path

from visray.data.csv_file import read_csv
from visray.data.table import Table
from visray.errors import UserError
from visray.scene.source import neighbour

READERS = {".csv": read_csv, ".tsv": read_csv, ".tab": read_csv, ".txt": read_csv}


def read_table(path: str | os.PathLike[str]) -> Table:
    """The table of a file. Raises a UserError of one line, which begins with the path."""
    path = Path(path)
    try:
        status = os.stat(path)
        read = READERS.get(path.suffix.lower())
        if stat.S_ISDIR(status.st_mode):
            raise UserError(f"{path}: is a folder; give a file in it")
        # A pipe must not be opened: that would wait for a writer.
        if not stat.S_ISREG(status.st_mode):
            raise UserError(f"{path}: is not a regular file; give a table file")
        if read is None:
            raise UserError(f"{path}: is not known to be a table by its name; visray reads {', '.join(READERS)}")
        return read(path)
    except FileNotFoundError:
        raise UserError(f"{path}: there is no such file{neighbour(path, READERS) or '; check the path'}") from None
    except MemoryError:
        raise UserError(f"{path}: does not fit into memory; leave out columns or rows") from None
    except (OSError, ValueError) as error:
        raise UserError(
            f"{path}: cannot be read ({getattr(error, 'strerror', None) or error}); check the path"
        ) from None
